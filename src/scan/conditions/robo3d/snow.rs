//! Snow as published (Hahner et al. 2022 with the constants of Robo3D).

use rayon::prelude::*;

use super::super::snow_law::Balls;
use super::cloud::{Draws, origins};
use super::fit::Polynomial;
use super::wedge::{Seen, discs, seen};
use super::wet::{FEWEST, ground_points};
use crate::scan::chance::Purpose;
use crate::scan::{Scan, Status};

/// Least millimetres an hour that count as snow. By the published law less snow is more flakes, all the smaller, which
/// at rates that nobody measures would be too many to be counted.
const LEAST: f64 = 0.01;
/// Intensities of the published rule go from 0 to this.
const FULL: f64 = 255.0;
/// Share of the noise line that points must reach.
const FLOOR: f64 = 0.7;
/// Metres from and to which the lowest ground is looked for, in so many steps; what is darker does not count.
const FROM: f64 = 10.0;
const TO: f64 = 70.0;
const STEPS: usize = 50;
const DARKEST: f64 = 5.0;

/// Turns points into snow or dims them, then loses all that is below the noise.
///
/// As published, the calibrated intensity stands for the received power, a flake's power has no range to refer
/// to, and a beam without a target meets no snow. The calibration of one sensor model that the published code
/// applies to all is left out.
pub(super) fn apply(scan: &mut Scan, draws: &Draws, rate: f64, speed: f64) {
    let Some(balls) = Balls::new(rate, speed).filter(|_| rate >= LEAST) else { return };
    let noise = noise(scan);
    let flakes = |beam: &crate::scan::Return| {
        let chance = draws.beam(scan, beam, 0);
        let mut drawn = 0;
        let next = || {
            drawn += 1;
            chance.draw(Purpose::Corruption, drawn - 1)
        };
        let met = discs(&balls, f64::from(beam.range), next);
        let intensity = f64::from(beam.intensity) * FULL;
        match met.is_empty() {
            true => Seen::Target(1.0),
            false => seen(&met, f64::from(beam.range), intensity),
        }
    };
    let points = |beam: &crate::scan::Return| beam.status.is_point().then(|| flakes(beam));
    let found: Vec<Option<Seen>> = scan.returns.par_iter().map(points).collect();
    let origins = origins(scan);
    for (beam, found) in scan.returns.iter_mut().zip(found) {
        match found {
            Some(Seen::Snow { range, intensity }) => {
                beam.move_to(range, origins[usize::from(beam.lidar)]);
                beam.intensity = (intensity.min(FULL) / FULL) as f32;
                beam.detach(Status::Snow);
            }
            Some(Seen::Target(left)) => {
                beam.intensity *= left as f32;
                let least = noise.map_or(0.0, |noise| noise.at(f64::from(beam.range)));
                if f64::from(beam.intensity) * FULL < least {
                    beam.remove(Status::Lost);
                }
            }
            None => {}
        }
    }
}

/// Least intensity from 0 to 255 by range: a square polynomial through 0.7·N·cos θ of the ground points, N the line
/// through the lowest of them; none with too few of them.
fn noise(scan: &Scan) -> Option<Polynomial<3>> {
    let points = ground_points(scan);
    if points.len() < FEWEST {
        return None;
    }
    let mut lowest = [f64::INFINITY; STEPS];
    let width = (TO - FROM) / STEPS as f64;
    for &(range, bright, _) in &points {
        let place = (range - FROM) / width;
        if (0.0..STEPS as f64).contains(&place) && bright * FULL > DARKEST {
            let low = &mut lowest[place as usize];
            *low = low.min(bright * FULL);
        }
    }
    let filled = lowest.iter().enumerate().filter(|(_, low)| low.is_finite());
    let low = filled.map(|(k, &low)| (FROM + (k as f64 + 0.5) * width, low));
    let mean = points.iter().map(|&(range, bright, _)| (range, bright * FULL));
    let line = Polynomial::<2>::through(low).or_else(|| Polynomial::<2>::through(mean))?;
    let floor = points
        .iter()
        .map(|(range, _, beam)| (*range, FLOOR * line.at(*range) * f64::from(beam.incidence)));
    Polynomial::<3>::through(floor)
}
