//! Sixteen numbers at a time, in three ways with the same names.
//!
//! [`per_target`] compiles the functions of the walk once for each of them. Bounds may differ in their
//! last bits from way to way (reciprocals are estimates here and quotients there); a hit
//! is decided by operations that round alike everywhere.

/// Numbers of a vector.
pub(super) const W: usize = 16;

/// The functions of a file for AVX-512, for AVX2, and for any machine, in modules of these names. `use
/// super::{…};` names the files whose functions they call.
macro_rules! per_target {
    (use $up:tt::{$($file:ident),*}; $($functions:tt)*) => {
        #[cfg(target_arch = "x86_64")]
        #[allow(unused_imports, clippy::needless_range_loop, clippy::too_many_arguments)]
        pub(in $up::$up) mod avx512 {
            use $up::*;
            use $up::$up::ops::avx512::*;
            $(use $up::$up::$file::avx512::*;)*
            per_target!(@avx512 $($functions)*);
        }
        #[cfg(target_arch = "x86_64")]
        #[allow(unused_imports, clippy::needless_range_loop, clippy::too_many_arguments)]
        pub(in $up::$up) mod avx2 {
            use $up::*;
            use $up::$up::ops::avx2::*;
            $(use $up::$up::$file::avx2::*;)*
            per_target!(@avx2 $($functions)*);
        }
        #[allow(unused_imports, clippy::needless_range_loop, clippy::too_many_arguments)]
        pub(in $up::$up) mod plain {
            use $up::*;
            use $up::$up::ops::plain::*;
            $(use $up::$up::$file::plain::*;)*
            per_target!(@plain $($functions)*);
        }
    };
    (@avx512 $($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        $($(#[$meta])*
        #[inline]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
        pub(in crate::cast) fn $name $args $(-> $result)? $body)*
    };
    (@avx2 $($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        $($(#[$meta])*
        #[inline]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        pub(in crate::cast) fn $name $args $(-> $result)? $body)*
    };
    (@plain $($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        $($(#[$meta])*
        #[inline]
        pub(in crate::cast) fn $name $args $(-> $result)? $body)*
    };
}
/// An array of three, without a closure: those are not always compiled into their caller.
macro_rules! three {
    ($k:ident => $number:expr) => {
        [
            {
                const $k: usize = 0;
                $number
            },
            {
                const $k: usize = 1;
                $number
            },
            {
                const $k: usize = 2;
                $number
            },
        ]
    };
}
pub(super) use per_target;
pub(in crate::cast) use three;

/// Functions for processors with these features.
#[cfg(target_arch = "x86_64")]
macro_rules! in_registers {
    ($features:tt; $(fn $name:ident $args:tt -> $result:ty $body:block)*) => {
        $(#[inline]
        #[target_feature(enable = $features)]
        pub(in crate::cast) fn $name $args -> $result $body)*
    };
}

#[cfg(target_arch = "x86_64")]
pub(super) mod avx512 {
    //! Sixteen numbers in one register.

    use std::arch::x86_64::*;

    use bytemuck::cast;

    use super::W;

    /// Numbers, integers, and a bit for each.
    pub(in crate::cast) type V = __m512;
    pub(in crate::cast) type I = __m512i;
    pub(in crate::cast) type M = __mmask16;

    in_registers! {
        "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl";
        fn splat(x: f32) -> V { _mm512_set1_ps(x) }
        fn load(x: &[f32; W]) -> V { cast(*x) }
        fn store(x: V) -> [f32; W] { cast(x) }
        fn add(a: V, b: V) -> V { _mm512_add_ps(a, b) }
        fn sub(a: V, b: V) -> V { _mm512_sub_ps(a, b) }
        fn mul(a: V, b: V) -> V { _mm512_mul_ps(a, b) }
        fn div(a: V, b: V) -> V { _mm512_div_ps(a, b) }
        // a·b + c and c − a·b; bounds only, as machines without them round twice
        fn fma(a: V, b: V, c: V) -> V { _mm512_fmadd_ps(a, b, c) }
        fn fnma(a: V, b: V, c: V) -> V { _mm512_fnmadd_ps(a, b, c) }
        fn min(a: V, b: V) -> V { _mm512_min_ps(a, b) }
        fn max(a: V, b: V) -> V { _mm512_max_ps(a, b) }
        fn abs(a: V) -> V { _mm512_abs_ps(a) }
        // within 2⁻¹⁴
        fn rcp(a: V) -> V { _mm512_rcp14_ps(a) }
        fn rsqrt(a: V) -> V { _mm512_rsqrt14_ps(a) }
        fn floor(a: V) -> V { _mm512_roundscale_ps::<1>(a) }
        fn nearest(a: V) -> V { _mm512_roundscale_ps::<0>(a) }
        fn floor_i(a: V) -> I {
            _mm512_cvt_roundps_epi32::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(a)
        }
        fn ceil_i(a: V) -> I {
            _mm512_cvt_roundps_epi32::<{ _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC }>(a)
        }
        fn sign(a: V) -> V { _mm512_and_ps(a, _mm512_set1_ps(-0.0)) }
        fn flip(a: V, sign: V) -> V { _mm512_xor_ps(a, sign) }
        fn lt(a: V, b: V) -> M { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b) }
        fn le(a: V, b: V) -> M { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b) }
        fn eq(a: V, b: V) -> M { _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b) }
        fn select(m: M, a: V, b: V) -> V { _mm512_mask_mov_ps(b, m, a) }
        fn both(a: M, b: M) -> M { a & b }
        fn either(a: M, b: M) -> M { a | b }
        fn bits(m: M) -> u16 { m }
        fn mask(bits: u16) -> M { bits }
        fn splat_i(x: i32) -> I { _mm512_set1_epi32(x) }
        fn load_i(x: &[i32; W]) -> I { cast(*x) }
        fn store_i(x: I) -> [i32; W] { cast(x) }
        fn add_i(a: I, b: I) -> I { _mm512_add_epi32(a, b) }
        fn sub_i(a: I, b: I) -> I { _mm512_sub_epi32(a, b) }
        fn mul_i(a: I, b: I) -> I { _mm512_mullo_epi32(a, b) }
        fn min_i(a: I, b: I) -> I { _mm512_min_epi32(a, b) }
        fn max_i(a: I, b: I) -> I { _mm512_max_epi32(a, b) }
        fn le_i(a: I, b: I) -> M { _mm512_cmple_epi32_mask(a, b) }
        fn less_id(a: I, b: I) -> M { _mm512_cmplt_epu32_mask(a, b) }
        fn select_i(m: M, a: I, b: I) -> I { _mm512_mask_mov_epi32(b, m, a) }
        fn compress(m: u16, x: I) -> [i32; W] { cast(_mm512_maskz_compress_epi32(m, x)) }
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2 {
    //! Sixteen numbers in two registers.

    use std::arch::x86_64::*;

    use bytemuck::cast;

    use super::W;

    /// Numbers, integers, and all ones or zero for each; lower half first.
    #[derive(Clone, Copy)]
    pub(in crate::cast) struct V(__m256, __m256);
    #[derive(Clone, Copy)]
    pub(in crate::cast) struct I(__m256i, __m256i);
    pub(in crate::cast) type M = V;

    in_registers! {
        "avx2,fma,bmi1,bmi2,popcnt,lzcnt";
        fn splat(x: f32) -> V { V(_mm256_set1_ps(x), _mm256_set1_ps(x)) }
        fn load(x: &[f32; W]) -> V { let [a, b]: [__m256; 2] = cast(*x); V(a, b) }
        fn store(x: V) -> [f32; W] { cast([x.0, x.1]) }
        fn add(a: V, b: V) -> V { V(_mm256_add_ps(a.0, b.0), _mm256_add_ps(a.1, b.1)) }
        fn sub(a: V, b: V) -> V { V(_mm256_sub_ps(a.0, b.0), _mm256_sub_ps(a.1, b.1)) }
        fn mul(a: V, b: V) -> V { V(_mm256_mul_ps(a.0, b.0), _mm256_mul_ps(a.1, b.1)) }
        fn div(a: V, b: V) -> V { V(_mm256_div_ps(a.0, b.0), _mm256_div_ps(a.1, b.1)) }
        fn fma(a: V, b: V, c: V) -> V {
            V(_mm256_fmadd_ps(a.0, b.0, c.0), _mm256_fmadd_ps(a.1, b.1, c.1))
        }
        fn fnma(a: V, b: V, c: V) -> V {
            V(_mm256_fnmadd_ps(a.0, b.0, c.0), _mm256_fnmadd_ps(a.1, b.1, c.1))
        }
        fn min(a: V, b: V) -> V { V(_mm256_min_ps(a.0, b.0), _mm256_min_ps(a.1, b.1)) }
        fn max(a: V, b: V) -> V { V(_mm256_max_ps(a.0, b.0), _mm256_max_ps(a.1, b.1)) }
        fn and(a: V, b: V) -> V { V(_mm256_and_ps(a.0, b.0), _mm256_and_ps(a.1, b.1)) }
        fn abs(a: V) -> V { and(a, splat(f32::from_bits(0x7fff_ffff))) }
        // the estimate has 12 bits only: one step of Newton's method
        fn rcp(a: V) -> V {
            let x = V(_mm256_rcp_ps(a.0), _mm256_rcp_ps(a.1));
            mul(x, fnma(a, x, splat(2.0)))
        }
        fn rsqrt(a: V) -> V {
            let x = V(_mm256_rsqrt_ps(a.0), _mm256_rsqrt_ps(a.1));
            mul(x, fnma(mul(a, mul(x, x)), splat(0.5), splat(1.5)))
        }
        fn floor(a: V) -> V { V(_mm256_floor_ps(a.0), _mm256_floor_ps(a.1)) }
        fn nearest(a: V) -> V { V(_mm256_round_ps::<8>(a.0), _mm256_round_ps::<8>(a.1)) }
        fn floor_i(a: V) -> I {
            I(_mm256_cvttps_epi32(_mm256_floor_ps(a.0)), _mm256_cvttps_epi32(_mm256_floor_ps(a.1)))
        }
        fn ceil_i(a: V) -> I {
            I(_mm256_cvttps_epi32(_mm256_ceil_ps(a.0)), _mm256_cvttps_epi32(_mm256_ceil_ps(a.1)))
        }
        fn sign(a: V) -> V { and(a, splat(-0.0)) }
        fn flip(a: V, sign: V) -> V { V(_mm256_xor_ps(a.0, sign.0), _mm256_xor_ps(a.1, sign.1)) }
        fn lt(a: V, b: V) -> M {
            V(_mm256_cmp_ps::<_CMP_LT_OQ>(a.0, b.0), _mm256_cmp_ps::<_CMP_LT_OQ>(a.1, b.1))
        }
        fn le(a: V, b: V) -> M {
            V(_mm256_cmp_ps::<_CMP_LE_OQ>(a.0, b.0), _mm256_cmp_ps::<_CMP_LE_OQ>(a.1, b.1))
        }
        fn eq(a: V, b: V) -> M {
            V(_mm256_cmp_ps::<_CMP_EQ_OQ>(a.0, b.0), _mm256_cmp_ps::<_CMP_EQ_OQ>(a.1, b.1))
        }
        fn select(m: M, a: V, b: V) -> V {
            V(_mm256_blendv_ps(b.0, a.0, m.0), _mm256_blendv_ps(b.1, a.1, m.1))
        }
        fn both(a: M, b: M) -> M { and(a, b) }
        fn either(a: M, b: M) -> M { V(_mm256_or_ps(a.0, b.0), _mm256_or_ps(a.1, b.1)) }
        fn bits(m: M) -> u16 { (_mm256_movemask_ps(m.0) | _mm256_movemask_ps(m.1) << 8) as u16 }
        fn mask(bits: u16) -> M {
            let low = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let (all, high) = (_mm256_set1_epi32(bits.into()), _mm256_slli_epi32::<8>(low));
            as_mask(I(
                _mm256_cmpeq_epi32(_mm256_and_si256(all, low), low),
                _mm256_cmpeq_epi32(_mm256_and_si256(all, high), high),
            ))
        }
        fn as_mask(a: I) -> M { V(_mm256_castsi256_ps(a.0), _mm256_castsi256_ps(a.1)) }
        fn splat_i(x: i32) -> I { I(_mm256_set1_epi32(x), _mm256_set1_epi32(x)) }
        fn load_i(x: &[i32; W]) -> I { let [a, b]: [__m256i; 2] = cast(*x); I(a, b) }
        fn store_i(x: I) -> [i32; W] { cast([x.0, x.1]) }
        fn add_i(a: I, b: I) -> I { I(_mm256_add_epi32(a.0, b.0), _mm256_add_epi32(a.1, b.1)) }
        fn sub_i(a: I, b: I) -> I { I(_mm256_sub_epi32(a.0, b.0), _mm256_sub_epi32(a.1, b.1)) }
        fn mul_i(a: I, b: I) -> I { I(_mm256_mullo_epi32(a.0, b.0), _mm256_mullo_epi32(a.1, b.1)) }
        fn min_i(a: I, b: I) -> I { I(_mm256_min_epi32(a.0, b.0), _mm256_min_epi32(a.1, b.1)) }
        fn max_i(a: I, b: I) -> I { I(_mm256_max_epi32(a.0, b.0), _mm256_max_epi32(a.1, b.1)) }
        fn le_i(a: I, b: I) -> M { eq_i(min_i(a, b), a) }
        fn eq_i(a: I, b: I) -> M {
            as_mask(I(_mm256_cmpeq_epi32(a.0, b.0), _mm256_cmpeq_epi32(a.1, b.1)))
        }
        // unsigned a < b: b > a after the sign bits are turned
        fn less_id(a: I, b: I) -> M {
            let turn = _mm256_set1_epi32(i32::MIN);
            let (a, b) = (
                I(_mm256_xor_si256(a.0, turn), _mm256_xor_si256(a.1, turn)),
                I(_mm256_xor_si256(b.0, turn), _mm256_xor_si256(b.1, turn)),
            );
            as_mask(I(_mm256_cmpgt_epi32(b.0, a.0), _mm256_cmpgt_epi32(b.1, a.1)))
        }
        fn select_i(m: M, a: I, b: I) -> I {
            let m = I(_mm256_castps_si256(m.0), _mm256_castps_si256(m.1));
            I(_mm256_blendv_epi8(b.0, a.0, m.0), _mm256_blendv_epi8(b.1, a.1, m.1))
        }
        fn compress(m: u16, x: I) -> [i32; W] { super::plain::compressed(m, store_i(x)) }
    }
}

pub(super) mod plain {
    //! Sixteen numbers in an array, left to the compiler.

    use super::W;

    /// Numbers, integers, and a flag for each.
    pub(in crate::cast) type V = [f32; W];
    pub(in crate::cast) type I = [i32; W];
    pub(in crate::cast) type M = [bool; W];

    macro_rules! ops {
        ($(fn $name:ident ($($arg:ident: $kind:ty),*) -> [$result:ty] { $body:expr })*) => {
            $(#[inline(always)]
            pub(in crate::cast) fn $name($($arg: $kind),*) -> [$result; W] {
                let mut all = [<$result>::default(); W];
                for i in 0..W {
                    $(let $arg = $arg[i];)*
                    all[i] = $body;
                }
                all
            })*
        };
    }

    ops! {
        fn load(x: &V) -> [f32] { x }
        fn store(x: V) -> [f32] { x }
        fn add(a: V, b: V) -> [f32] { a + b }
        fn sub(a: V, b: V) -> [f32] { a - b }
        fn mul(a: V, b: V) -> [f32] { a * b }
        fn div(a: V, b: V) -> [f32] { a / b }
        fn fma(a: V, b: V, c: V) -> [f32] { a * b + c }
        fn fnma(a: V, b: V, c: V) -> [f32] { c - a * b }
        fn min(a: V, b: V) -> [f32] { if a < b { a } else { b } }
        fn max(a: V, b: V) -> [f32] { if a > b { a } else { b } }
        fn abs(a: V) -> [f32] { a.abs() }
        fn rcp(a: V) -> [f32] { 1.0 / a }
        fn rsqrt(a: V) -> [f32] { 1.0 / a.sqrt() }
        fn floor(a: V) -> [f32] { a.floor() }
        fn nearest(a: V) -> [f32] { (a + 0.5).floor() }
        fn floor_i(a: V) -> [i32] { a.floor() as i32 }
        fn ceil_i(a: V) -> [i32] { a.ceil() as i32 }
        fn sign(a: V) -> [f32] { f32::from_bits(a.to_bits() & (1 << 31)) }
        fn flip(a: V, sign: V) -> [f32] { f32::from_bits(a.to_bits() ^ sign.to_bits()) }
        fn lt(a: V, b: V) -> [bool] { a < b }
        fn le(a: V, b: V) -> [bool] { a <= b }
        fn eq(a: V, b: V) -> [bool] { a == b }
        fn select(m: M, a: V, b: V) -> [f32] { if m { a } else { b } }
        fn both(a: M, b: M) -> [bool] { a & b }
        fn either(a: M, b: M) -> [bool] { a | b }
        fn load_i(x: &I) -> [i32] { x }
        fn store_i(x: I) -> [i32] { x }
        fn add_i(a: I, b: I) -> [i32] { a.wrapping_add(b) }
        fn sub_i(a: I, b: I) -> [i32] { a.wrapping_sub(b) }
        fn mul_i(a: I, b: I) -> [i32] { a.wrapping_mul(b) }
        fn min_i(a: I, b: I) -> [i32] { if a < b { a } else { b } }
        fn max_i(a: I, b: I) -> [i32] { if a > b { a } else { b } }
        fn le_i(a: I, b: I) -> [bool] { a <= b }
        fn less_id(a: I, b: I) -> [bool] { (a as u32) < b as u32 }
        fn select_i(m: M, a: I, b: I) -> [i32] { if m { a } else { b } }
    }

    #[inline(always)]
    pub(in crate::cast) fn splat(x: f32) -> V {
        [x; W]
    }

    #[inline(always)]
    pub(in crate::cast) fn splat_i(x: i32) -> I {
        [x; W]
    }

    #[inline(always)]
    pub(in crate::cast) fn bits(m: M) -> u16 {
        m.into_iter().zip(0..).fold(0, |bits, (flag, i)| bits | u16::from(flag) << i)
    }

    #[inline(always)]
    pub(in crate::cast) fn mask(bits: u16) -> M {
        let mut all = [false; W];
        for (i, flag) in all.iter_mut().enumerate() {
            *flag = bits >> i & 1 != 0;
        }
        all
    }

    /// The marked numbers, side by side from the first place on.
    #[inline(always)]
    pub(in crate::cast) fn compress(m: u16, x: I) -> [i32; W] {
        compressed(m, x)
    }

    #[inline(always)]
    pub(super) fn compressed(mut m: u16, x: [i32; W]) -> [i32; W] {
        let (mut all, mut len) = ([0; W], 0);
        while m != 0 {
            all[len % W] = x[m.trailing_zeros() as usize % W];
            m &= m - 1;
            len += 1;
        }
        all
    }
}
