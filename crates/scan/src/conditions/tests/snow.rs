//! Snow and rain of beams: extinction, blocked lines, all flakes and drops drawn one by one, and published attenuation.

use std::f64::consts::PI;

use super::{ks, uniform};
use crate::conditions::snow::{APART, Balls, LENGTH};
use crate::conditions::{FallEffect, Falling, Flake, JoinedEcho};

const WIDE: [f64; 2] = [3e-3, 1.5e-3];

fn exponential(draw: &mut impl FnMut() -> f64) -> f64 {
    -(1.0 - draw()).ln()
}

#[test]
fn the_extinction_is_that_of_the_balls() {
    for (rate, speed) in [(0.5, 2.0), (1.0, 1.6), (2.5, 1.6)] {
        let balls = Balls::flakes(rate, speed).unwrap();
        let mut draw = uniform(3);
        let diameters: Vec<f64> =
            (0..400_000).map(|_| balls.mean * exponential(&mut draw)).collect();
        let mean = |k: i32| diameters.iter().map(|d| d.powi(k)).sum::<f64>() / 400_000.0;
        let number = balls.volume / (PI / 6.0 * mean(3));
        let wanted = number * PI / 4.0 * mean(2);
        let found = Falling::snow(rate, speed).extinction();
        assert!((found / wanted - 1.0).abs() < 0.02, "{found} {wanted}");
        assert!((balls.per_cubic_metre() / number - 1.0).abs() < 0.03);
    }
}

#[test]
fn no_snow_is_clean() {
    let fallen = Falling::snow(0.0, 1.6).beam(WIDE, 100.0, || unreachable!("nothing is drawn"));
    assert_eq!(fallen, FallEffect { passed: 1.0, flake: None });
    let mut draw = uniform(1);
    for _ in 0..1000 {
        let fallen = Falling::snow(1e-9, 1.6).beam(WIDE, 100.0, &mut draw);
        assert!(fallen.passed > 0.999, "{fallen:?}");
        let tiny = Falling::snow(1e-300, 1.6).beam(WIDE, 100.0, &mut draw);
        assert!(tiny.passed > 0.999, "{tiny:?}");
    }
}

#[test]
fn a_line_is_blocked_at_exponential_ranges() {
    let snow = Falling::snow(2.5, 1.6);
    let mut draw = uniform(2);
    let reach = 5000.0;
    let mut ranges = Vec::new();
    for _ in 0..4000 {
        let fallen = snow.beam([0.0, 0.0], reach, &mut draw);
        assert!(fallen.passed == 0.0 || fallen.passed == 1.0 && fallen.flake.is_none());
        ranges.extend(fallen.flake.map(|flake| flake.range));
    }
    let rate = snow.extinction();
    let whole = 1.0 - (-rate * reach).exp();
    assert!(ranges.len() > 3500);
    // Flakes nearer than 0.9 m send nothing back; 1e-3 of a line's.
    let gap = ks(&mut ranges, |r| (1.0 - (-rate * r).exp()) / whole);
    assert!(gap < 1.63 / 3500_f64.sqrt() + 1e-3, "{gap}");
}

#[test]
fn the_light_that_passes_is_that_of_the_extinction() {
    for (rate, speed) in [(0.5, 2.0), (2.5, 1.6)] {
        let snow = Falling::snow(rate, speed);
        for reach in [5.0, 30.0, 100.0] {
            let mut draw = uniform(4);
            let beams = 40_000;
            let passed: Vec<f64> =
                (0..beams).map(|_| snow.beam(WIDE, reach, &mut draw).passed).collect();
            let mean = passed.iter().sum::<f64>() / f64::from(beams);
            let variance =
                passed.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / f64::from(beams);
            let wanted = (-snow.extinction() * reach).exp();
            let error = (variance / f64::from(beams)).sqrt();
            assert!((mean - wanted).abs() < 4.0 * error + 1e-5, "{rate} {reach}: {mean} {wanted}");
        }
    }
}

/// Brute force: draws every flake in the cone, and every flake larger than the beam that its axis meets.
fn brute(balls: &Balls, reach: f64, draw: &mut impl FnMut() -> f64) -> FallEffect {
    let number = balls.volume / (PI / 6.0 * 6.0 * balls.mean.powi(3));
    let mut flakes = Vec::new();
    let volume = PI / 12.0 * WIDE[0] * WIDE[1] * reach.powi(3);
    let mut sum = exponential(draw);
    while sum < number * volume {
        let (range, diameter) = (reach * draw().cbrt(), balls.mean * exponential(draw));
        let share = diameter * diameter / (WIDE[0] * WIDE[1] * range * range);
        if share < 1.0 {
            flakes.push((range, share));
        }
        sum += exponential(draw);
    }
    let rate = number * PI / 4.0 * 2.0 * balls.mean * balls.mean;
    let mut range = exponential(draw) / rate;
    while range < reach {
        let diameter = balls.mean * (0..3).map(|_| exponential(draw)).sum::<f64>();
        if diameter * diameter > WIDE[0] * WIDE[1] * range * range {
            flakes.push((range, 1.0));
        }
        range += exponential(draw) / rate;
    }
    flakes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut light = 1.0;
    let mut fallen = FallEffect { passed: 1.0, flake: None };
    for (range, share) in flakes {
        let seen = ((range - 0.9) / 0.1).clamp(0.0, 1.0);
        let power = light * 0.9 * share * seen / (range * range);
        if power > fallen.flake.map_or(0.0, |flake| flake.power) {
            fallen.flake = Some(Flake { range, power });
        }
        light *= 1.0 - share;
    }
    FallEffect { passed: light, ..fallen }
}

/// Greatest distance between the distributions of two samples.
fn ks_two(a: &mut [f64], b: &mut [f64]) -> f64 {
    a.sort_by(f64::total_cmp);
    b.sort_by(f64::total_cmp);
    let below =
        |sample: &[f64], x: f64| sample.partition_point(|y| *y <= x) as f64 / sample.len() as f64;
    a.iter().chain(&*b).map(|&x| (below(a, x) - below(b, x)).abs()).fold(0.0, f64::max)
}

#[test]
fn returns_are_distributed_as_if_every_flake_were_drawn() {
    for (rate, speed, reach) in [(0.5, 2.0, 20.0), (2.5, 1.6, 50.0), (2.5, 1.6, 4.0)] {
        let (snow, balls) = (Falling::snow(rate, speed), Balls::flakes(rate, speed).unwrap());
        let (mut draw, mut other) = (uniform(6), uniform(7));
        let beams = 40_000;
        let fast: Vec<FallEffect> = (0..beams).map(|_| snow.beam(WIDE, reach, &mut draw)).collect();
        let all: Vec<FallEffect> = (0..beams).map(|_| brute(&balls, reach, &mut other)).collect();
        type Part = fn(&FallEffect) -> f64;
        let parts: [(&str, Part); 2] = [
            ("power", |fallen| fallen.flake.map_or(0.0, |flake| flake.power)),
            ("range", |fallen| fallen.flake.map_or(1e3, |flake| flake.range)),
        ];
        for (name, part) in parts {
            let mut a: Vec<f64> = fast.iter().map(part).collect();
            let mut b: Vec<f64> = all.iter().map(part).collect();
            let gap = ks_two(&mut a, &mut b);
            // 1 % level of two samples.
            assert!(gap < 1.63 * (2.0 / f64::from(beams)).sqrt(), "{name} {rate} {reach}: {gap}");
        }
        let beats = |fallen: &[FallEffect]| {
            let target = 0.3 / (reach * reach);
            let won = |fallen: &&FallEffect| {
                fallen.flake.is_some_and(|flake| flake.power > target * fallen.passed)
            };
            fallen.iter().filter(won).count() as f64 / f64::from(beams)
        };
        let (a, b) = (beats(&fast), beats(&all));
        let error = (2.0 * b.max(1e-3) / f64::from(beams)).sqrt();
        println!("{rate} mm/h, target at {reach} m: {:.2} % become snow", 100.0 * b);
        assert!((a - b).abs() < 3.0 * error, "{a} {b}");
    }
}

/// The echo of a unit pulse by its phase, from 0 where it begins to 1 where it ends.
fn swell(phase: f64) -> f64 {
    if phase > 0.0 && phase < 1.0 { (PI * phase).sin().powi(2) } else { 0.0 }
}

/// The highest of the waveform's samples, and where it begins less half of the pulse.
fn sampled(echoes: [(f64, f64); 2], step: f64) -> (f64, f64) {
    let first = echoes.map(|(range, _)| range).into_iter().fold(f64::MAX, f64::min);
    let samples = (0..(2.0 * LENGTH / step) as u32).map(|k| first + f64::from(k) * step);
    let of = |x: f64| echoes.map(|(range, power)| power * swell((x - range) / LENGTH));
    let all = samples.map(|x| (of(x).iter().sum::<f64>(), x - LENGTH / 2.0));
    all.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

#[test]
fn a_flake_and_a_target_add_up_as_the_sum_of_their_pulses() {
    let mut draw = uniform(8);
    let (mut joined, mut snow) = (0, 0);
    for _ in 0..4000 {
        let (range, power) = (5.0 + 40.0 * draw(), 10_f64.powf(-3.0 * draw()));
        let flake =
            Flake { range: range + 3.6 * (draw() - 0.5), power: 10_f64.powf(-3.0 * draw()) };
        let echoes = [(flake.range, flake.power), (range, power)];
        let strongest = flake.power.max(power);
        let (peak, at) = match flake.join(range, power) {
            JoinedEcho::Apart => {
                let own = if flake.power > power { flake.range } else { range };
                (strongest, own)
            }
            JoinedEcho::Target(peak) => (peak, range),
            JoinedEcho::Flake(flake) => {
                snow += 1;
                (flake.power, flake.range)
            }
        };
        joined += u32::from(peak != strongest);
        // Bins of 10 cm miss a peak by (π·0.05/L)² at most; of 1 mm by next to nothing.
        let (coarse, place) = sampled(echoes, 0.1);
        assert!(coarse <= peak * (1.0 + 1e-9) && coarse > 0.99 * peak, "{coarse} {peak}");
        let (fine, exact) = sampled(echoes, 1e-3);
        assert!((fine / peak - 1.0).abs() < 1e-5, "{fine} {peak}");
        // A plain between two peaks that are alike says little of where the peak is.
        if (flake.range - range).abs() < 1.2 {
            assert!((at - exact).abs() < APART + 0.02, "{at} {exact}");
            assert!((exact - place).abs() < 0.3, "{exact} {place}");
        }
    }
    assert!(joined > 1000 && snow > 300, "{joined} {snow}");
    // No flake, no change.
    let none = Flake { range: 20.0, power: 0.0 };
    let JoinedEcho::Target(power) = none.join(20.5, 1e-3) else { panic!() };
    assert!((power / 1e-3 - 1.0).abs() < 1e-12);
}

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
