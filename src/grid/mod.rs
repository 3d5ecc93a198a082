//! (see lib.rs)

/// One nat in fixed point.
pub const ENTROPY_ONE: f64 = (1_u64 << 28) as f64;

/// Fixed-point entropy.
pub fn fixed(nats: f64) -> u32 {
    (nats * ENTROPY_ONE).round() as u32
}

/// Nats of a fixed-point sum.
pub fn to_nats(sum: u64) -> f64 {
    sum as f64 / ENTROPY_ONE
}
