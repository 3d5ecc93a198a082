//! Acceptance of the conditions: closed forms, published figures, and brute force.

mod faults;
mod fog;
mod rain;
mod snow;
mod wet;
mod words;

/// Greatest distance between the distribution of a sample and one in closed form (Kolmogorov and Smirnov).
pub(super) fn ks(sample: &mut [f64], cumulative: impl Fn(f64) -> f64) -> f64 {
    sample.sort_by(f64::total_cmp);
    let n = sample.len() as f64;
    let gap = |(k, &x): (usize, &f64)| {
        let p = cumulative(x);
        (p - k as f64 / n).abs().max(((k + 1) as f64 / n - p).abs())
    };
    sample.iter().enumerate().map(gap).fold(0.0, f64::max)
}

/// Random numbers from 0 to below 1 by another generator than the program's.
pub(super) fn uniform(seed: u64) -> impl FnMut() -> f64 {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    move || random.random::<f64>()
}
