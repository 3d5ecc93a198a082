//! Eight numbers at a time, in two ways with the same names.

/// Numbers of a vector.
pub(super) const W: usize = crate::bvh::bvh8::WIDTH;

/// Eight numbers in one register.
#[cfg(target_arch = "x86_64")]
pub(super) mod avx2 {
    use std::arch::x86_64::*;

    use bytemuck::cast;

    use super::W;

    pub(crate) type V = __m256;

    macro_rules! ops {
        ($(fn $name:ident $args:tt -> $result:ty $body:block)*) => {
            $(#[inline]
            #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
            pub(crate) fn $name $args -> $result $body)*
        };
    }

    ops! {
        fn splat(x: f32) -> V { _mm256_set1_ps(x) }
        fn load(x: &[f32; W]) -> V { cast(*x) }
        fn store(x: V) -> [f32; W] { cast(x) }
        fn add(a: V, b: V) -> V { _mm256_add_ps(a, b) }
        fn sub(a: V, b: V) -> V { _mm256_sub_ps(a, b) }
        fn div(a: V, b: V) -> V { _mm256_div_ps(a, b) }
        // x where a > b, y elsewhere
        fn if_above(a: V, b: V, x: V, y: V) -> V { _mm256_blendv_ps(y, x, _mm256_cmp_ps::<_CMP_GT_OQ>(a, b)) }
        fn mul(a: V, b: V) -> V { _mm256_mul_ps(a, b) }
        // a·b + c; bounds only, as machines without it round twice
        fn fma(a: V, b: V, c: V) -> V { _mm256_fmadd_ps(a, b, c) }
        // b where a is no number
        fn min(a: V, b: V) -> V { _mm256_min_ps(a, b) }
        fn max(a: V, b: V) -> V { _mm256_max_ps(a, b) }
        // a bit for each pair
        fn below(a: V, b: V) -> u32 { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as u32 }
        fn at_most(a: V, b: V) -> u32 { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32 }
        // a bit for each pair of an ordered `near` and `far`, and the least `near` of these.
        fn first_of(near: V, far: V) -> (u32, f32) {
            let seen = _mm256_cmp_ps::<_CMP_LE_OQ>(near, far);
            let near = _mm256_blendv_ps(splat(f32::INFINITY), near, seen);
            let four = _mm_min_ps(_mm256_castps256_ps128(near), _mm256_extractf128_ps::<1>(near));
            let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
            let one = _mm_min_ss(two, _mm_shuffle_ps::<1>(two, two));
            (_mm256_movemask_ps(seen) as u32, _mm_cvtss_f32(one))
        }
        fn same(a: V, b: V) -> u32 { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b)) as u32 }
    }
}

/// Eight numbers in an array, left to the compiler.
pub(super) mod plain {
    use super::W;

    pub(crate) type V = [f32; W];

    macro_rules! ops {
        ($(fn $name:ident ($a:ident, $b:ident) $number:expr;)*) => {
            $(#[inline(always)]
            pub(crate) fn $name(a: V, b: V) -> V {
                std::array::from_fn(|k| { let ($a, $b) = (a[k], b[k]); $number })
            })*
        };
        ($(fn $name:ident ($a:ident, $b:ident) bit $number:expr;)*) => {
            $(#[inline(always)]
            pub(crate) fn $name(a: V, b: V) -> u32 {
                let mut bits = 0;
                for k in 0..W {
                    let ($a, $b) = (a[k], b[k]);
                    bits |= u32::from($number) << k;
                }
                bits
            })*
        };
    }

    ops! {
        fn add(a, b) a + b;
        fn sub(a, b) a - b;
        fn mul(a, b) a * b;
        fn div(a, b) a / b;
        fn min(a, b) if a < b { a } else { b };
        fn max(a, b) if a > b { a } else { b };
    }
    ops! {
        fn below(a, b) bit a < b;
        fn at_most(a, b) bit a <= b;
        fn same(a, b) bit a == b;
    }

    #[inline(always)]
    pub(crate) fn splat(x: f32) -> V {
        [x; W]
    }

    #[inline(always)]
    pub(crate) fn load(x: &V) -> V {
        *x
    }

    #[inline(always)]
    pub(crate) fn store(x: V) -> V {
        x
    }

    #[inline(always)]
    pub(crate) fn if_above(a: V, b: V, x: V, y: V) -> V {
        std::array::from_fn(|k| if a[k] > b[k] { x[k] } else { y[k] })
    }

    #[inline(always)]
    pub(crate) fn first_of(near: V, far: V) -> (u32, f32) {
        let seen = at_most(near, far);
        let met = (0..W).filter(|k| seen >> k & 1 == 1);
        (seen, met.fold(f32::INFINITY, |least, k| if near[k] < least { near[k] } else { least }))
    }

    #[inline(always)]
    pub(crate) fn fma(a: V, b: V, c: V) -> V {
        add(mul(a, b), c)
    }
}
