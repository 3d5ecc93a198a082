//! The blind zone: ground between the own vehicle and the nearest ground that is seen.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use serde::Serialize;

use super::Footprint;
use super::body::polygon_area;
use super::ground::{CELL, Cell, NEAR};
use crate::engine::BackendError;
use crate::maths;
use crate::vehicle::{Side, UnknownSensor};

/// Directions that the blind zone is measured in.
pub const DIRECTIONS: usize = 72;

/// Ground between the own body and the nearest ground seen, by direction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlindZone {
    /// By direction, counter-clockwise from straight ahead: metres from the outline to the nearest cell
    /// seen in the sector around it, along it; `None` where none is within 10 m.
    pub distances: Vec<Option<f64>>,
    /// The zone's outline in the ego frame, metres, a corner a direction.
    pub polygon: Vec<[f64; 2]>,
    /// Square metres between the zone's outline and the body's.
    pub area: f64,
    /// Depth ahead of the front edge, metres: the largest over lanes one cell wide, each up to its nearest cell seen;
    /// `None` where a lane has none within 10 m, so that the zone does not end.
    pub ahead: Option<f64>,
    /// Depth behind the rear edge.
    pub behind: Option<f64>,
    /// Depth beside the left edge, in the body's length.
    pub left: Option<f64>,
    /// Depth beside the right edge.
    pub right: Option<f64>,
}

impl BlindZone {
    /// The zone before cells that are seen, among those that are ground.
    pub(super) fn new(footprint: &Footprint, ground: &[Cell], seen: &[Cell]) -> Self {
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
        let depth = |side: Side| {
            let mut lanes: BTreeMap<i64, Option<f64>> = BTreeMap::new();
            let before = |cell| lane_before(footprint, cell, side);
            lanes.extend(ground.iter().filter_map(before).map(|(lane, _)| (lane, None)));
            for (lane, distance) in seen.iter().filter_map(before) {
                let nearest = lanes.entry(lane).or_default();
                *nearest = Some(nearest.map_or(distance, |known| known.min(distance)));
            }
            // No depth where there is no ground, or a lane of it is not seen at all.
            let depths: Option<Vec<f64>> = lanes.into_values().collect();
            depths?.into_iter().max_by(f64::total_cmp)
        };
        let [ahead, behind, left, right] = Side::ALL.map(depth);
        Self { distances, polygon, area, ahead, behind, left, right }
    }
}

/// Lane of a cell straight before an edge of a footprint, one cell wide, and its metres from the edge; `None` for a cell
/// that lies elsewhere.
pub(super) fn lane_before(footprint: &Footprint, cell: &Cell, side: Side) -> Option<(i64, f64)> {
    let [low, high] = footprint.bounds();
    let (axis, sign) = match side {
        Side::Ahead => (0, 1.0),
        Side::Behind => (0, -1.0),
        Side::Left => (1, 1.0),
        Side::Right => (1, -1.0),
    };
    let (edge, other) = (if sign > 0.0 { high[axis] } else { low[axis] }, 1 - axis);
    let distance = sign * (cell.centre[axis] - edge);
    let is_in = (low[other]..=high[other]).contains(&cell.centre[other]);
    (is_in && distance > 0.0).then(|| ((cell.centre[other] / CELL).floor() as i64, distance))
}

/// Why the near field of a scene cannot be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NearFieldError {
    /// No triangle of an own body, or a body that is a line from above.
    #[error(
        "{scene}: the own vehicle has no body, from whose outline the near field counts; describe it under \
         `ego.body` in the scene"
    )]
    NoBody {
        /// File or name of the scene.
        scene: String,
    },
    /// A body far larger than any vehicle.
    #[error(
        "{scene}: the own vehicle's body is {length:.0} m long or wide, more than {most:.0} m; give `ego.body` \
         in metres"
    )]
    LargeBody {
        /// File or name of the scene.
        scene: String,
        /// Longer side of the body.
        length: f64,
        /// The limit.
        most: f64,
    },
    /// No cell near the body is ground in any frame.
    #[error(
        "{scene}: there is no ground within {within} m of the own vehicle: no surface of a class named {names} \
         within 2 m of z = 0; name the ground's class so"
    )]
    NoGround {
        /// File or name of the scene.
        scene: String,
        /// Metres around the body.
        within: f64,
        /// Names of the classes that count as ground.
        names: String,
    },
    /// A sensor of a model that the vehicle does not have.
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
    /// Casting failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wedge_that_does_not_end_has_no_depth_and_the_deepest_lane_counts() {
        let footprint =
            Footprint::of([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]).unwrap();
        let cell = |x: f64, y: f64| Cell { centre: [x, y], distance: footprint.distance([x, y]) };
        let steps =
            |from: f64, count: i32| (0..count).map(move |k| from + CELL * (f64::from(k) + 0.5));
        let behind = steps(-12.0, 40).flat_map(|x| steps(-1.0, 8).map(move |y| [x, y]));
        let ahead = steps(2.0, 40).flat_map(|x| steps(-1.0, 8).map(move |y| [x, y]));
        let ground: Vec<Cell> = behind.chain(ahead).map(|[x, y]| cell(x, y)).collect();
        // Ahead everything from 1 m on is seen, in one lane from 3 m on. Behind, a lane is not seen at all.
        let is_seen = |cell: &&Cell| match cell.centre {
            [x, y] if x > 0.0 => x > if y.abs() < CELL { 5.0 } else { 3.0 },
            [_, y] => y > -0.75,
        };
        let seen: Vec<Cell> = ground.iter().filter(is_seen).copied().collect();
        let zone = BlindZone::new(&footprint, &ground, &seen);
        assert_eq!(zone.ahead, Some(3.0 + CELL / 2.0));
        assert_eq!((zone.behind, zone.left), (None, None));
        let all = BlindZone::new(&footprint, &ground, &ground);
        assert_eq!((all.ahead, all.behind), (Some(CELL / 2.0), Some(CELL / 2.0)));
    }
}
