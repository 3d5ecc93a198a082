//! Rain of beams: closed forms of Marshall and Palmer's drops, and published attenuation.

use std::f64::consts::PI;

use super::uniform;
use crate::conditions::snow::Balls;
use crate::conditions::{FallEffect, Falling};

const WIDE: [f64; 2] = [3e-3, 1.5e-3];
const RATES: [f64; 4] = [1.0, 5.0, 25.0, 100.0];

/// ∫ f(D)·N(D) dD over drops of Marshall and Palmer, D in millimetres, a cubic metre, by Simpson's rule.
fn drops(rate: f64, f: impl Fn(f64) -> f64) -> f64 {
    let slope = 4.1 * rate.powf(-0.21);
    let (steps, widest) = (4000, 60.0 / slope);
    let step = widest / f64::from(steps);
    let term = |k: i32| {
        let diameter = f64::from(k) * step;
        let weight = if k == 0 || k == steps { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
        weight * f(diameter) * 8000.0 * (-slope * diameter).exp()
    };
    (0..=steps).map(term).sum::<f64>() * step / 3.0
}

#[test]
fn the_extinction_is_twice_the_cross_sections_of_the_drops() {
    for rate in RATES {
        let found = Falling::rain(rate).extinction();
        let summed = drops(rate, |d| 2.0 * PI / 4.0 * d * d) * 1e-6;
        assert!((found / summed - 1.0).abs() < 1e-6, "{rate}: {found} {summed}");
        // ∫ D²·e^(−ΛD) dD = Γ(3)/Λ³.
        let closed = PI * 8000.0 / (4.1 * rate.powf(-0.21)).powi(3) * 1e-6;
        assert!((found / closed - 1.0).abs() < 1e-12, "{rate}: {found} {closed}");
        let number = drops(rate, |_| 1.0);
        let balls = Balls::drops(rate).unwrap();
        assert!((balls.per_cubic_metre() / number - 1.0).abs() < 1e-6);
        // Carbonneau and Wisely 1998, measured: 1.076·R^0.67 dB/km.
        let measured = 1.076 * rate.powf(0.67) / (10.0 / 10_f64.ln()) / 1000.0;
        assert!((1.0..1.6).contains(&(found / measured)), "{rate}: {found} {measured}");
    }
}

#[test]
fn no_rain_is_clean() {
    for rate in [0.0, 1e-300] {
        let fallen = Falling::rain(rate).beam(WIDE, 100.0, || 0.5);
        assert!(fallen.passed > 0.999, "{rate}: {fallen:?}");
    }
    let none = Falling::rain(0.0).beam(WIDE, 100.0, || unreachable!("nothing is drawn"));
    assert_eq!(none, FallEffect { passed: 1.0, flake: None });
}

#[test]
fn the_light_that_passes_rain_is_that_of_the_extinction() {
    for rate in [5.0, 100.0] {
        let rain = Falling::rain(rate);
        for reach in [10.0, 60.0] {
            let (mut draw, beams) = (uniform(4), 20_000);
            let passed = (0..beams).map(|_| rain.beam(WIDE, reach, &mut draw).passed);
            let mean = passed.sum::<f64>() / f64::from(beams);
            let wanted = (-rain.extinction() * reach).exp();
            assert!((mean / wanted - 1.0).abs() < 4e-3, "{rate} {reach}: {mean} {wanted}");
        }
    }
}

/// Strongest echo among all drops in the cone of a beam, each drawn by itself.
fn strongest(rate: f64, reach: f64, draw: &mut impl FnMut() -> f64) -> f64 {
    let mean = 1e-3 / (4.1 * rate.powf(-0.21));
    let volume = PI / 12.0 * WIDE[0] * WIDE[1] * reach.powi(3);
    let (number, mut sum, mut most) = (8e6 * mean * volume, 0.0, 0.0_f64);
    loop {
        sum -= (1.0 - draw()).ln();
        if sum >= number {
            return most;
        }
        let (range, diameter) = (reach * draw().cbrt(), -mean * (1.0 - draw()).ln());
        // Backscatter of a drop's extinction 2·πD²/4 by a lidar ratio S, relative to a white target of that area.
        let share = 2.0 * diameter * diameter / (WIDE[0] * WIDE[1] * range * range);
        let seen = ((range - 0.9) / 0.1).clamp(0.0, 1.0);
        if share < 1.0 {
            most = most.max(PI / 18.8 * share * seen / (range * range));
        }
    }
}

#[test]
fn drops_win_as_often_as_if_each_were_drawn() {
    // Without the shade of nearer drops, which takes a per cent of the light at most.
    let (rate, reach, beams) = (25.0, 20.0, 20_000);
    let rain = Falling::rain(rate);
    let (mut draw, mut other) = (uniform(6), uniform(7));
    for share in [0.02, 0.1, 0.3] {
        let least = share * 0.3 / (reach * reach);
        let fast = (0..beams).filter(|_| {
            let fallen = rain.beam(WIDE, reach, &mut draw);
            fallen.flake.is_some_and(|drop| drop.power > least)
        });
        let all = (0..beams).filter(|_| strongest(rate, reach, &mut other) > least);
        let (fast, all) = (fast.count() as f64, all.count() as f64);
        assert!(all > 100.0, "{all}");
        assert!(
            (fast - all).abs() < 4.0 * (fast + all).sqrt() + 0.02 * all,
            "{share}: {fast} {all}"
        );
    }
}
