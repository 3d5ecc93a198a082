//! Fog: integrals, limits of range, and where light comes back from.

use super::{ks, uniform};
use crate::conditions::Fog;
use crate::conditions::fog::{Peaks, overlap, peak};

const ALPHAS: [f64; 6] = [0.0, 0.005, 0.01, 0.02, 0.03, 0.06];

/// The integral over time as it is written, by the midpoint rule.
fn integral(alpha: f64, range: f64, target: f64) -> f64 {
    let (half, steps) = (20e-9, 40_000);
    let step = 2.0 * half / f64::from(steps);
    let at = |k: i32| {
        let t = (f64::from(k) + 0.5) * step;
        let x = range - 299_792_458.0 * t / 2.0;
        let pulse = (std::f64::consts::PI * t / (2.0 * half)).sin().powi(2);
        let seen = x > 0.9 && x <= target;
        if seen { pulse * (-2.0 * alpha * x).exp() * overlap(x) / (x * x) * step } else { 0.0 }
    };
    (0..steps).map(at).sum()
}

/// Optical range of an extinction.
fn mor(alpha: f64) -> f64 {
    20_f64.ln() / alpha
}

/// Where a falling function passes 0.
pub(super) fn root(f: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (1.0, 1000.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 { low = middle } else { high = middle }
    }
    low
}

#[test]
fn integrals_are_those_of_the_published_tables() {
    let published = [4.645e-9, 4.568e-9, 4.493e-9, 4.347e-9, 4.207e-9, 3.817e-9];
    for (alpha, published) in ALPHAS.into_iter().zip(published) {
        let found = peak(alpha, 50.0);
        assert!((found.integral / published - 1.0).abs() < 5e-4, "{alpha} {found:?}");
        assert!((4.635..4.725).contains(&found.range), "{alpha} {found:?}");
    }
    assert!((peak(0.0, 50.0).range - 4.72).abs() < 0.01);
    assert!((peak(0.06, 50.0).range - 4.64).abs() < 0.01);
}

#[test]
fn peaks_agree_with_the_integral_as_it_is_written() {
    let peaks = Peaks::new(0.03);
    for target in [1.2, 2.0, 3.5, 4.6, 7.0, f64::INFINITY] {
        let found = peaks.before(target);
        let written = integral(0.03, found.range, target);
        assert!((found.integral / written - 1.0).abs() < 2e-3, "{target} {found:?} {written}");
        for aside in [-0.2, 0.2] {
            assert!(integral(0.03, found.range + aside, target) < written, "{target}");
        }
    }
    assert_eq!(peaks.before(0.5).integral, 0.0);
}

#[test]
fn hard_ranges_are_those_of_a_sensor_rated_for_60_m() {
    let table = [
        (0.06, [19.0, 24.0, 30.0]),
        (0.03, [27.0, 36.0, 46.0]),
        (0.02, [32.0, 44.0, 57.0]),
        (0.01, [40.0, 58.0, 80.0]),
        (0.005, [47.0, 72.0, 106.0]),
    ];
    for (alpha, ranges) in table {
        let fog = Fog::new(mor(alpha), 1.0);
        for (reflectance, wanted) in [0.1, 0.3, 0.9].into_iter().zip(ranges) {
            let power = |r: f64| reflectance / (r * r) * fog.attenuation(r);
            let limit = root(|r| power(r) - 0.1 / 3600.0);
            assert!((limit - wanted).abs() < 0.51, "{alpha} {reflectance}: {limit}");
        }
    }
}

#[test]
fn contrast_at_the_optical_range_is_five_hundredths() {
    for mor in [10.0, 50.0, 1000.0] {
        // e^(−2α·MOR) there and back.
        assert!((Fog::new(mor, 1.0).attenuation(mor).sqrt() - 0.05).abs() < 1e-12);
    }
}

#[test]
fn the_gain_puts_a_target_and_the_fog_level_at_36_m() {
    let fog = Fog::new(mor(0.06), 1.0);
    let level = root(|r| 0.3 / (r * r) * fog.attenuation(r) - fog.soft_power(r));
    assert!((level - 36.0).abs() < 1e-3, "{level}");
    let double = Fog::new(mor(0.06), 2.0);
    assert!((double.soft_power(20.0) / fog.soft_power(20.0) - 2.0).abs() < 1e-12);
}

#[test]
fn clear_air_changes_nothing_and_denser_fog_only_takes() {
    let clear = Fog::new(f64::INFINITY, 1.0);
    for range in [0.5, 3.0, 80.0, f64::INFINITY] {
        assert_eq!(clear.soft_power(range), 0.0);
    }
    assert_eq!(clear.attenuation(100.0), 1.0);
    let thick = [1000.0, 500.0, 200.0, 50.0, 10.0].map(|mor| Fog::new(mor, 1.0));
    for pair in thick.windows(2) {
        assert!(pair[1].attenuation(20.0) < pair[0].attenuation(20.0));
        assert!(pair[1].soft_power(20.0) > pair[0].soft_power(20.0));
    }
}

#[test]
fn light_comes_back_from_where_the_envelope_says() {
    for (mor, target) in [(50.0, f64::INFINITY), (50.0, 3.0), (600.0, 30.0)] {
        let fog = Fog::new(mor, 1.0);
        let mut draw = uniform(5);
        let mut ranges: Vec<f64> = (0..4000).map(|_| fog.soft_range(target, draw())).collect();
        assert!(ranges.iter().all(|&x| x >= 0.9 && x <= target));
        let alpha = 20_f64.ln() / mor;
        // The envelope summed step by step in x.
        let (step, end) = (2e-3, target.min(200.0));
        let h = |x: f64| (-2.0 * alpha * x).exp() * overlap(x) / (x * x) * step;
        let mut sums = vec![0.0];
        while (sums.len() as f64) * step + 0.9 < end {
            let x = 0.9 + (sums.len() as f64 - 0.5) * step;
            sums.push(sums[sums.len() - 1] + h(x));
        }
        let whole = sums[sums.len() - 1];
        let cumulative = |x: f64| sums[(((x - 0.9) / step) as usize).min(sums.len() - 1)] / whole;
        // 1 % level of the test.
        let gap = ks(&mut ranges, cumulative);
        assert!(gap < 1.63 / 4000_f64.sqrt(), "{mor} {target}: {gap}");
    }
    assert_eq!(Fog::new(50.0, 1.0).soft_range(0.5, 0.3), 0.5);
}
