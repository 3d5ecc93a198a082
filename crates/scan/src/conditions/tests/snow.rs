//! Snow of beams: extinction, blocked lines, and all flakes drawn one by one.

use std::f64::consts::PI;

use super::{ks, uniform};
use crate::conditions::snow::{APART, Balls, LENGTH, swell};
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

/// `cargo test --release --lib snow_costs -- --ignored --nocapture`
#[test]
#[ignore = "prints a time"]
fn what_snow_costs() {
    use crate::fires::{Chance, Purpose};
    for (rate, speed) in [(0.5, 2.0), (1.0, 1.6), (2.5, 1.6)] {
        let snow = Falling::snow(rate, speed);
        let (beams, mut sum) = (1_000_000, snow.beam(WIDE, 50.0, || 0.5).passed);
        let start = std::time::Instant::now();
        for beam in 0..beams {
            let chance = Chance::new(1, 2, 3, beam);
            let mut drawn = 0;
            let draw = || {
                drawn += 1;
                chance.draw(Purpose::Snow, drawn - 1)
            };
            sum += snow.beam(WIDE, 5.0 + f64::from(beam % 95), draw).passed;
        }
        let each = start.elapsed().as_secs_f64() * 1e9 / f64::from(beams);
        println!("{rate} mm/h: {each:.0} ns a beam, mean {:.4}", sum / f64::from(beams));
    }
}
