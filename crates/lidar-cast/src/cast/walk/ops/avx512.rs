//! Sixteen numbers in one register.

use std::arch::x86_64::*;

use bytemuck::cast;

use super::W;

/// Numbers, integers, and a bit for each.
pub(in crate::cast) type V = __m512;
pub(in crate::cast) type I = __m512i;
pub(in crate::cast) type M = __mmask16;

macro_rules! ops {
    ($(fn $name:ident $args:tt -> $result:ty $body:block)*) => {
        $(#[inline]
        #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512dq,avx512vl")]
        pub(in crate::cast) fn $name $args -> $result $body)*
    };
}

ops! {
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
