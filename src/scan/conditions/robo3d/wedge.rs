//! Snow in the plane of a ring, as published: discs, and the shares of a wedge of light that they take.

use super::super::overlap::{APART, LENGTH, swell};
use super::super::pulse::overlap;
use super::super::snow_law::Balls;

/// Full angle of the wedge in radians.
pub(super) const WEDGE: f64 = 3e-3;
/// Metres up to which discs lie.
const FARTHEST: f64 = 80.0;
/// Largest ball in metres.
const LARGEST: f64 = 20e-3;
/// Metres of a step of the waveform.
const STEP: f64 = 0.1;
/// What a flake sends back, in units of an intensity from 0 to 255.
const FLAKE: f64 = 0.9 * 255.0;

/// A disc that the wedge meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Disc {
    /// Metres to its middle.
    pub range: f64,
    pub radius: f64,
    /// Radians from the wedge's axis.
    angle: f64,
}

/// Discs that the wedge meets before `reach` metres, nearest first: those with their middles in it, and those that
/// reach into it from beside.
///
/// The published discs fill files, which neighbouring beams share; here each beam has its own, of the same density.
pub(super) fn discs(balls: &Balls, reach: f64, mut draw: impl FnMut() -> f64) -> Vec<Disc> {
    let reach = reach.min(FARTHEST);
    let density = balls.discs_per_square_metre();
    let exponential = |u: f64| -(-u).ln_1p();
    let mut discs = Vec::new();
    let mut area = 0.0;
    loop {
        area += exponential(draw()) / density;
        let range = (2.0 * area / WEDGE).sqrt();
        if range >= reach {
            break;
        }
        let diameter = balls.mean * exponential(draw());
        let (height, angle) = (draw(), WEDGE * (draw() - 0.5));
        let radius = diameter.min(LARGEST) / 2.0 * (1.0 - height * height).sqrt();
        discs.push(Disc { range, radius, angle });
    }
    let mut range = 0.0;
    loop {
        // Twice the ball's mean radius a metre, of which π/4 are cut so that they reach in.
        range += exponential(draw()) / (density * balls.mean);
        if range >= reach {
            break;
        }
        let diameter = balls.mean * (exponential(draw()) + exponential(draw()));
        let (height, place, keep) = (draw(), 2.0 * draw() - 1.0, draw());
        let cut = (1.0 - height * height).sqrt();
        let radius = diameter.min(LARGEST) / 2.0 * cut;
        if keep < cut && radius < range {
            let beside = WEDGE / 2.0 + place.abs() * radius / range;
            discs.push(Disc { range, radius, angle: beside.copysign(place) });
        }
    }
    discs.sort_by(|a, b| a.range.total_cmp(&b.range));
    discs
}

/// Share of the wedge that each disc takes, the nearest first, and what is left.
pub(super) fn shares(discs: &[Disc]) -> (Vec<f64>, f64) {
    let half = WEDGE / 2.0;
    // Angles still lit.
    let mut lit = vec![[-half, half]];
    let share = |lit: &[[f64; 2]]| lit.iter().map(|[from, to]| to - from).sum::<f64>() / WEDGE;
    let mut taken = Vec::with_capacity(discs.len());
    for disc in discs {
        let before = share(&lit);
        let wide = (disc.radius / disc.range).min(1.0).asin();
        let [from, to] = [disc.angle - wide, disc.angle + wide];
        let left = |[a, b]: [f64; 2]| {
            [[a, b.min(from)], [a.max(to), b]].into_iter().filter(|[a, b]| a < b)
        };
        lit = lit.into_iter().flat_map(left).collect();
        taken.push(before - share(&lit));
    }
    (taken, share(&lit))
}

/// What the receiver makes of a wedge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Seen {
    /// The target, with this share of its intensity.
    Target(f64),
    /// Snow at a range, of an intensity from 0 to 255.
    Snow { range: f64, intensity: f64 },
}

/// The strongest sample of the waveform of discs and a target, whose intensity is from 0 to 255.
pub(super) fn seen(discs: &[Disc], target: f64, intensity: f64) -> Seen {
    let (taken, left) = shares(discs);
    let flake = |(disc, share): (&Disc, f64)| {
        (disc.range, FLAKE * share * overlap(disc.range) / (disc.range * disc.range))
    };
    let mut echoes: Vec<(f64, f64)> = discs.iter().zip(taken).map(flake).collect();
    echoes.push((target, intensity * left * overlap(target)));
    let most = echoes.iter().map(|echo| echo.1).fold(0.0, f64::max);
    let mut best = (0.0, target + LENGTH / 2.0);
    for &(start, _) in &echoes {
        let near = |echo: &&(f64, f64)| (echo.0 - start).abs() < LENGTH;
        // Echoes that cannot make up the strongest together are passed over; a sample misses a peak by less
        // than a hundredth.
        if echoes.iter().filter(near).map(|echo| echo.1).sum::<f64>() < 0.99 * most {
            continue;
        }
        let first = (start / STEP).floor() as u64 + 1;
        for sample in (first..).map(|k| k as f64 * STEP).take_while(|r| *r < start + LENGTH) {
            let of = |&(range, peak): &(f64, f64)| peak * swell((sample - range) / LENGTH);
            let power: f64 = echoes.iter().filter(near).map(of).sum();
            if power > best.0 {
                best = (power, sample);
            }
        }
    }
    let range = best.1 - LENGTH / 2.0;
    if (range - target).abs() < APART {
        Seen::Target(left)
    } else {
        Seen::Snow { range, intensity: best.0 }
    }
}
