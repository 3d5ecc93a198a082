//! Functions of one number by code of our own build: the same bits on every processor.
//!
//! The C library takes other code where a processor has fused multiplication, and its results differ in the last bit.
//! `clippy.toml` refuses the methods of `f64` and `f32` that call it. Square roots, rounding and whole powers are exact
//! or our own code everywhere. [`mixed`] turns a number into another that looks like chance.

pub use libm::{
    acos, asin, atan, atan2, cbrtf, cos, erf, erfc, exp, exp2, hypot, log as ln, log2, log10, pow,
    sin, tan,
};

/// Sine and cosine of an angle in radians.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    (sin(angle), cos(angle))
}

/// One step of SplitMix64 (Steele, Lea, Flood 2014).
pub fn mixed(word: u64) -> u64 {
    let z = word.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
