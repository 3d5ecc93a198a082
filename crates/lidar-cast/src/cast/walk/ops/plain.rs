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
