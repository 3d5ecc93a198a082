//! The blind zone around the own vehicle: the ground nearer than the nearest that is seen.

use crate::maths;
use std::f64::consts::TAU;

use serde::Serialize;

use super::ground::{Cell, NEAR};
use super::{Footprint, footprint::polygon_area};

/// Directions that the blind zone is measured in.
pub const DIRECTIONS: usize = 72;

/// What lies nearer to the own body than the nearest ground seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlindZone {
    /// By direction, counter-clockwise from straight ahead: metres from the outline to the nearest cell
    /// seen in the sector around it, along it; `None` where none is within 10 m.
    pub distances: Vec<Option<f64>>,
    /// The zone's outline in the ego frame, metres, a corner a direction.
    pub polygon: Vec<[f64; 2]>,
    /// Square metres between the zone's outline and the body's.
    pub area: f64,
    /// Metres to the nearest cell seen before the front edge, in the body's width.
    pub ahead: Option<f64>,
    /// The same behind the rear edge.
    pub behind: Option<f64>,
    /// The same beside the left edge, in the body's length.
    pub left: Option<f64>,
    /// The same beside the right edge.
    pub right: Option<f64>,
}

impl BlindZone {
    /// The zone before some cells that are seen.
    pub(super) fn new(footprint: &Footprint, seen: &[Cell]) -> Self {
        let middle = footprint.middle();
        let mut nearest = [f64::INFINITY; DIRECTIONS];
        for Cell { centre, .. } in seen {
            let [x, y] = [0, 1].map(|k| centre[k] - middle[k]);
            let sector = (maths::atan2(y, x).rem_euclid(TAU) / TAU * DIRECTIONS as f64).round();
            let nearest = &mut nearest[sector as usize % DIRECTIONS];
            *nearest = nearest.min(maths::hypot(x, y));
        }
        let (mut distances, mut polygon) = (Vec::new(), Vec::new());
        for (k, radius) in nearest.into_iter().enumerate() {
            let (sin, cos) = maths::sin_cos(TAU * k as f64 / DIRECTIONS as f64);
            let reach = footprint.reach([cos, sin]);
            let distance = radius.is_finite().then(|| (radius - reach).max(0.0));
            distances.push(distance);
            let radius = reach + distance.unwrap_or(NEAR);
            polygon.push([middle[0] + radius * cos, middle[1] + radius * sin]);
        }
        let area = (polygon_area(&polygon) - footprint.area()).max(0.0);
        let [low, high] = footprint.bounds();
        let straight = |axis: usize, sign: f64| {
            let edge = if sign > 0.0 { high[axis] } else { low[axis] };
            let other = 1 - axis;
            let is_before = |cell: &&Cell| {
                (low[other]..=high[other]).contains(&cell.centre[other])
                    && sign * (cell.centre[axis] - edge) > 0.0
            };
            let distances = seen.iter().filter(is_before);
            distances.map(|cell| sign * (cell.centre[axis] - edge)).min_by(f64::total_cmp)
        };
        let (ahead, behind) = (straight(0, 1.0), straight(0, -1.0));
        let (left, right) = (straight(1, 1.0), straight(1, -1.0));
        Self { distances, polygon, area, ahead, behind, left, right }
    }
}
