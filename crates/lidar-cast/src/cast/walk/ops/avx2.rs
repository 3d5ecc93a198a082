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

macro_rules! ops {
    ($(fn $name:ident $args:tt -> $result:ty $body:block)*) => {
        $(#[inline]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        pub(in crate::cast) fn $name $args -> $result $body)*
    };
}

ops! {
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
