//! Wet ground as published (Hahner et al. 2022 with the constants of Robo3D).

use super::super::fresnel::through_film;
use super::super::wet::FULL_FILM;
use super::cloud::ground_classes;
use super::fit::Polynomial;
use crate::scan::{Return, Scan, Status};

/// Fewest ground points of which anything is changed.
pub(super) const FEWEST: usize = 1000;
/// Power that the sensor sends out, in units of what ground gives back on the mean.
const OUTPUT: f64 = 15.0;

/// Pairs of range and intensity / cos θ of the ground points.
pub(super) fn ground_points(scan: &Scan) -> Vec<(f64, f64, &Return)> {
    let ground = ground_classes(scan);
    let points = scan.returns.iter().filter(|beam| beam.is_point_on(&ground));
    points
        .map(|beam| (f64::from(beam.range), f64::from(beam.intensity / beam.incidence), beam))
        .collect()
}

/// Reflectance of wet ground that has `dry`, by the published rule: the stronger polarization instead of the mean,
/// and divided by the angle of incidence in radians.
pub(super) fn reflectance(dry: f64, cos: f64, water: f64) -> f64 {
    let film = (water / FULL_FILM).min(1.0);
    let dry = dry.clamp(0.05, 1.0);
    let [s, p] = through_film(dry, cos);
    (1.0 - film) * dry + film * s.max(p) / cos.min(1.0).acos()
}

/// Dims the ground and loses what is below the floor. `water` in millimetres.
///
/// The noise line is the mean line itself, as the published code falls back to for intensities from 0 to 1; one line
/// is fitted to all LiDARs of the scan. Points keep their order, which the published code changes.
pub(super) fn apply(scan: &mut Scan, water: f64, floor: f64) {
    let points = ground_points(scan);
    if points.len() < FEWEST || water == 0.0 {
        return;
    }
    let line = Polynomial::<2>::through(points.iter().map(|&(range, bright, _)| (range, bright)));
    let Some(line) = line else { return };
    let ground = ground_classes(scan);
    for beam in scan.returns.iter_mut().filter(|beam| beam.is_point_on(&ground)) {
        let cos = f64::from(beam.incidence);
        let intensity = f64::from(beam.intensity);
        let mean = line.at(f64::from(beam.range));
        let output = OUTPUT * mean;
        let wet = output * cos * reflectance(intensity / (cos * output), cos, water);
        let wet = wet.min(intensity);
        if wet > floor * mean * cos {
            beam.intensity = wet as f32;
        } else {
            beam.remove(Status::Lost);
        }
    }
}
