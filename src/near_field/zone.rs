//! The blind zone: ground between the own vehicle and the nearest ground that is seen.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Footprint;
use super::ground::{CELL, Cell, NEAR};
use crate::engine::BackendError;
use crate::vehicle::{Side, UnknownSensor};

/// Ground before one edge of the own body, one cell wide, up to the nearest that is seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlindLane {
    /// Side of the edge: `ahead`, `behind`, `left` or `right`.
    pub side: &'static str,
    /// Its two ends along the edge in the ego frame, metres: y ahead and behind, x on the left and right.
    pub along: [f64; 2],
    /// Metres from the edge to the middle of its nearest cell seen; `None` where none is within 10 m.
    pub depth: Option<f64>,
}

/// Ground between the own body and the nearest ground seen, straight before its edges. Corners, which lie before no edge,
/// are not counted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlindZone {
    /// Lanes one cell wide before each edge where there is ground, counter-clockwise from the right end of the front edge.
    pub lanes: Vec<BlindLane>,
    /// Outline of all lanes and the box around the body in the ego frame, metres; lanes that do not end reach 10 m.
    pub polygon: Vec<[f64; 2]>,
    /// Square metres of all lanes.
    pub area: f64,
    /// Depth ahead of the front edge, metres: that of the deepest lane; `None` where a lane does not end.
    pub ahead: Option<f64>,
    /// Depth behind the rear edge.
    pub behind: Option<f64>,
    /// Depth beside the left edge, in the body's length.
    pub left: Option<f64>,
    /// Depth beside the right edge.
    pub right: Option<f64>,
}

/// Sides counter-clockwise, whether their lanes come by rising place along the edge, and the corner of the box that ends
/// each: high or low in x and y.
const ROUND: [(Side, bool, [usize; 2]); 4] = [
    (Side::Ahead, true, [1, 1]),
    (Side::Left, false, [0, 1]),
    (Side::Behind, false, [0, 0]),
    (Side::Right, true, [1, 0]),
];

impl BlindZone {
    /// Depth on each side, with its name: ahead, behind, left, right.
    pub fn depths(&self) -> [(&'static str, Option<f64>); 4] {
        let Self { ahead, behind, left, right, .. } = *self;
        [("ahead", ahead), ("behind", behind), ("left", left), ("right", right)]
    }

    /// The zone before cells that are seen, among those that are ground.
    pub(super) fn new(footprint: &Footprint, ground: &[Cell], seen: &[Cell]) -> Self {
        let sides = ROUND.map(|(side, rising, _)| {
            let mut lanes = lanes(footprint, ground, seen, side);
            if !rising {
                lanes.reverse();
            }
            lanes
        });
        let depth = |side: Side| {
            let own = sides.iter().flatten().filter(|lane| lane.side == side.name());
            // No depth where there is no ground, or a lane of it is not seen at all.
            let depths: Option<Vec<f64>> = own.map(|lane| lane.depth).collect();
            depths?.into_iter().max_by(f64::total_cmp)
        };
        let [ahead, behind, left, right] = Side::ALL.map(depth);
        let lanes = sides.concat();
        let area = |lane: &BlindLane| (lane.along[1] - lane.along[0]) * lane.depth.unwrap_or(NEAR);
        let area = lanes.iter().map(area).sum();
        let mut zone = Self { lanes, polygon: Vec::new(), area, ahead, behind, left, right };
        zone.polygon =
            zone.outline(footprint, NEAR).into_iter().map(|(corner, _)| corner).collect();
        zone
    }

    /// Outline of all lanes and the box around the body in the ego frame, lanes cut `most` metres from their edge; a corner
    /// is true where the line to the next one cuts a lane that goes on.
    pub(crate) fn outline(&self, footprint: &Footprint, most: f64) -> Vec<([f64; 2], bool)> {
        let bounds = footprint.bounds();
        let mut outline: Vec<([f64; 2], bool)> = Vec::new();
        for (side, rising, [x, y]) in ROUND {
            let (axis, sign) = outward(side);
            let edge = bounds[usize::from(sign > 0.0)][axis];
            let at = |along: f64, depth: f64| {
                let out = edge + sign * depth;
                if axis == 0 { [out, along] } else { [along, out] }
            };
            let mut end = None;
            for lane in self.lanes.iter().filter(|lane| lane.side == side.name()) {
                let [from, to] = if rising { lane.along } else { [lane.along[1], lane.along[0]] };
                // Where there is no ground between two lanes the outline follows the edge.
                let gap = end.filter(|end: &f64| (end - from).abs() > 1e-9);
                let follows = |end| [(at(end, 0.0), false), (at(from, 0.0), false)];
                outline.extend(gap.map(follows).into_iter().flatten());
                let goes_on = lane.depth.is_none_or(|depth| depth > most);
                let depth = lane.depth.unwrap_or(most).min(most);
                outline.extend([(at(from, depth), goes_on), (at(to, depth), false)]);
                end = Some(to);
            }
            outline.push(([bounds[x][0], bounds[y][1]], false));
        }
        outline
    }
}

/// Lanes before one edge, by rising place along it.
fn lanes(footprint: &Footprint, ground: &[Cell], seen: &[Cell], side: Side) -> Vec<BlindLane> {
    let mut depths: BTreeMap<i64, Option<f64>> = BTreeMap::new();
    let before = |cell| lane_before(footprint, cell, side);
    depths.extend(ground.iter().filter_map(before).map(|(lane, _)| (lane, None)));
    for (lane, distance) in seen.iter().filter_map(before) {
        let nearest = depths.entry(lane).or_default();
        *nearest = Some(nearest.map_or(distance, |known| known.min(distance)));
    }
    let ([low, high], other) = (footprint.bounds(), 1 - outward(side).0);
    let (low, high) = (low[other], high[other]);
    // A lane whose middle lies before the edge is cut at the edge's end, and reaches it where no other one does.
    let snapped = |end: f64| match end {
        _ if end < low + CELL / 2.0 => low,
        _ if end > high - CELL / 2.0 => high,
        _ => end,
    };
    let lane = |(lane, depth): (i64, Option<f64>)| {
        let along = [lane, lane + 1].map(|k| snapped(CELL * k as f64));
        BlindLane { side: side.name(), along, depth }
    };
    depths.into_iter().map(lane).collect()
}

/// Axis of the ego frame across an edge, and the sign of its way out.
fn outward(side: Side) -> (usize, f64) {
    match side {
        Side::Ahead => (0, 1.0),
        Side::Behind => (0, -1.0),
        Side::Left => (1, 1.0),
        Side::Right => (1, -1.0),
    }
}

/// Lane of a cell straight before an edge of a footprint, one cell wide, and its metres from the edge; `None` for a cell
/// that lies elsewhere.
pub(super) fn lane_before(footprint: &Footprint, cell: &Cell, side: Side) -> Option<(i64, f64)> {
    let [low, high] = footprint.bounds();
    let (axis, sign) = outward(side);
    let (edge, other) = (if sign > 0.0 { high[axis] } else { low[axis] }, 1 - axis);
    let distance = sign * (cell.centre[axis] - edge);
    let is_in = (low[other]..=high[other]).contains(&cell.centre[other]);
    (is_in && distance > 0.0).then(|| ((cell.centre[other] / CELL).floor() as i64, distance))
}

/// Why the near field of a scene cannot be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum NearFieldError {
    /// No triangle of an own body, or a body that is a line from above.
    #[error(
        "{scene}: the own vehicle has no body, from whose outline the near field counts; describe it under \
         `ego.body` in the scene"
    )]
    NoBody { scene: String },
    /// A body far larger than any vehicle.
    #[error(
        "{scene}: the own vehicle's body is {length:.0} m long or wide, more than {most:.0} m; give `ego.body` \
         in metres"
    )]
    LargeBody { scene: String, length: f64, most: f64 },
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

    #[test]
    fn the_outline_is_as_deep_as_each_side_is_said_to_be_and_holds_no_seen_cell() {
        let (low, high) = ([-2.1, -0.9], [2.3, 0.95]);
        let footprint = Footprint::of([low, [high[0], low[1]], high, [low[0], high[1]]]).unwrap();
        let steps = (-40..40).map(|k| CELL * (f64::from(k) + 0.5));
        let cells = steps.clone().flat_map(|x| steps.clone().map(move |y| [x, y]));
        let is_out = |c: &[f64; 2]| (0..2).any(|k| c[k] < low[k] || c[k] > high[k]);
        let ground: Vec<Cell> = cells
            .filter(is_out)
            .map(|centre| Cell { centre, distance: footprint.distance(centre) })
            .collect();
        // Seen on the left at once, ahead behind a slanted line, behind from 2 m on, on the right nowhere.
        let is_seen = |cell: &&Cell| match cell.centre {
            [x, y] if x > high[0] => x - high[0] > 1.0 + 0.8 * (y + 1.0),
            [x, _] if x < low[0] => low[0] - x > 2.0,
            [_, y] => y > 0.0,
        };
        let seen: Vec<Cell> = ground.iter().filter(is_seen).copied().collect();
        let zone = BlindZone::new(&footprint, &ground, &seen);
        let within = |of: &dyn Fn(&[f64; 2]) -> bool| -> Vec<[f64; 2]> {
            zone.polygon.iter().copied().filter(|corner| of(corner)).collect()
        };
        let most = |points: Vec<[f64; 2]>, depth: &dyn Fn(&[f64; 2]) -> f64| {
            points.iter().map(depth).fold(0.0, f64::max)
        };
        let ahead = within(&|[x, y]| *x > high[0] && (low[1]..=high[1]).contains(y));
        assert!((most(ahead, &|c| c[0] - high[0]) - zone.ahead.unwrap()).abs() < 1e-12);
        let left = within(&|[x, y]| *y > high[1] && (low[0]..=high[0]).contains(x));
        assert!((most(left, &|c| c[1] - high[1]) - zone.left.unwrap()).abs() < 1e-12);
        assert_eq!((zone.left.unwrap() < CELL, zone.right), (true, None));
        // Point in polygon by the parity of crossings, and the area by Gauss's formula.
        let ends = || zone.polygon.iter().zip(zone.polygon.iter().cycle().skip(1));
        let holds = |[x, y]: [f64; 2]| {
            let crosses = |(a, b): &(&[f64; 2], &[f64; 2])| {
                (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            };
            ends().filter(crosses).count() % 2 == 1
        };
        let just_before = |cell: &Cell| holds(cell.centre.map(|v| v + 1e-6 * v.signum()));
        assert!(seen.iter().all(|cell| !just_before(cell)), "{:?}", zone.polygon);
        let sum: f64 = ends().map(|(a, b)| 0.5 * (a[0] * b[1] - b[0] * a[1])).sum();
        let body = (high[0] - low[0]) * (high[1] - low[1]);
        assert!((sum - body - zone.area).abs() < 1e-9, "{sum} {body} {}", zone.area);
    }
}
