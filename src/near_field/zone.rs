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
    /// Metres of the way from the edge to that cell, or to 10 m, under an own body that moves: no blind ground.
    #[serde(skip_serializing_if = "is_zero")]
    pub own_body: f64,
    /// Stretches of 1 m or more without a seen cell that begin right behind a seen one: start and end, metres from the
    /// edge.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<[f64; 2]>,
}

fn is_zero(metres: &f64) -> bool {
    *metres == 0.0
}

/// The longest stretch of ground on one side that is lost again behind the nearest cell seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LostGround {
    /// Side of the edge: `ahead`, `behind`, `left` or `right`.
    pub side: &'static str,
    /// Metres from the edge to its beginning.
    pub from: f64,
    /// Metres from the edge to its end.
    pub to: f64,
    /// Lanes before the edge with such a stretch of 2 m or more.
    pub lanes: usize,
    /// Lanes before the edge.
    pub of: usize,
    /// Number of the frame where bodies move: the first of the pose in which the stretch is longest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<usize>,
}

impl LostGround {
    /// The longest stretch of a side; `None` where no lane has a stretch of 2 m or more.
    fn new(side: Side, lanes: &[BlindLane]) -> Option<Self> {
        let own = || lanes.iter().filter(|lane| lane.side == side.name());
        let longest = |all: &mut dyn Iterator<Item = [f64; 2]>| {
            all.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))
        };
        let long = |lane: &BlindLane| longest(&mut lane.lost.iter().copied().filter(is_long));
        let [from, to] = longest(&mut own().filter_map(long))?;
        let lanes = own().filter_map(long).count();
        Some(Self { side: side.name(), from, to, lanes, of: own().count(), frame: None })
    }

    /// Its place and lanes, such as `unseen again in 8 of 10 lanes, the longest stretch from 1.2 to 10 m`.
    pub fn in_words(&self) -> String {
        let [from, to] = [self.from, self.to].map(|metres| (10.0 * metres).round() / 10.0);
        let frame = self.frame.map_or(String::new(), in_frame);
        format!(
            "unseen again in {} of {} lanes, the longest stretch from {from} to {to} m{frame}",
            self.lanes, self.of
        )
    }

    fn length(&self) -> f64 {
        self.to - self.from
    }
}

/// A frame in words that follow a number: ` in frame 3`.
pub(crate) fn in_frame(frame: usize) -> String {
    format!(" in frame {frame}")
}

/// True for a stretch of a lane of 2 m or more.
fn is_long([from, to]: &[f64; 2]) -> bool {
    to - from > LONG_LOST - 1e-9
}

/// Metres of a stretch that a lane counts as lost: beams' rings leave less unseen between them.
const LOST: f64 = 1.0;
/// Metres of a stretch that is said.
const LONG_LOST: f64 = 2.0;

/// True for two ground cells of a lane without a thing between them.
fn is_next(a: &(f64, bool), b: &(f64, bool)) -> bool {
    b.0 - a.0 < 1.5 * CELL
}

/// Depth of a lane that a rule of so many `metres` keeps, from the metres of its ground cells, by distance, and whether each
/// is seen: metres to the nearest cell seen. Where the ground behind that cell, up to the next thing, is lost again over 1 m
/// or more from within `metres` to beyond them, metres to the nearest cell seen behind it. More cells seen never make it
/// deeper.
pub(super) fn kept_depth(
    lane: impl Iterator<Item = (f64, bool)> + Clone,
    metres: f64,
) -> Option<f64> {
    let mut seen = lane.skip_while(|(_, is_seen)| !is_seen);
    let (depth, _) = seen.clone().next()?;
    if depth > metres {
        return Some(depth);
    }
    let near = seen.clone().take_while(|(distance, _)| *distance < metres + LOST);
    let near: Vec<(f64, bool)> = near.collect();
    // Ground in the shadow of a thing is not judged.
    let lost = near.chunk_by(is_next).next().map(lost_stretches).unwrap_or_default();
    let Some([from, _]) = lost.into_iter().find(|[from, to]| *from <= metres && *to > metres)
    else {
        return Some(depth);
    };
    seen.find(|(distance, is_seen)| *is_seen && *distance > from).map(|(distance, _)| distance)
}

/// Stretches of a lane that are lost again, from the metres of its ground cells, by distance, and whether each is seen; see
/// [`BlindLane::lost`]. One that begins behind a thing, where ground is missing, does not count.
fn lost_stretches(cells: &[(f64, bool)]) -> Vec<[f64; 2]> {
    let runs: Vec<&[(f64, bool)]> = cells.chunk_by(|a, b| a.1 == b.1 && is_next(a, b)).collect();
    let lost = |pair: &[&[(f64, bool)]]| {
        let (before, first, last) = (pair[0].last()?, pair[1].first()?, pair[1].last()?);
        let is_lost = before.1 && !first.1 && is_next(before, first);
        let end = last.0 + CELL / 2.0;
        let end = if end > NEAR - CELL { NEAR } else { end };
        let is_wide = pair[1].len() as f64 * CELL >= LOST;
        (is_lost && is_wide).then_some([first.0 - CELL / 2.0, end])
    };
    runs.windows(2).filter_map(lost).collect()
}

/// Ground between the own body and the nearest ground seen, straight before its edges. Corners, which lie before no edge,
/// are not counted.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BlindZone {
    /// Lanes one cell wide before each edge where there is ground, counter-clockwise from the right end of the front edge.
    pub lanes: Vec<BlindLane>,
    /// Outline of all lanes and the box around the body in the ego frame, metres; lanes that do not end reach 10 m.
    pub polygon: Vec<[f64; 2]>,
    /// Square metres of all lanes, without ground under own bodies that move.
    pub area: f64,
    /// Depth ahead of the front edge, metres: that of the deepest lane; `None` where a lane does not end.
    pub ahead: Option<f64>,
    /// Depth behind the rear edge.
    pub behind: Option<f64>,
    /// Depth beside the left edge, in the body's length.
    pub left: Option<f64>,
    /// Depth beside the right edge.
    pub right: Option<f64>,
    /// Sides on which ground behind the nearest cell seen is lost again over 2 m or more.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<LostGround>,
    /// Where bodies move, the frame that each side's lanes are of, by the name of the side: the first of the pose in which
    /// they are deepest.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub worst_frames: BTreeMap<&'static str, usize>,
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

    /// Ground that is lost again on a side, of which a depth is known.
    pub(crate) fn lost_on(&self, side: &str) -> Option<&LostGround> {
        let has_depth = |(name, depth): (&str, Option<f64>)| name == side && depth.is_some();
        let ends = self.depths().into_iter().any(has_depth);
        self.lost.iter().find(|lost| ends && lost.side == side)
    }

    /// Like [`Self::lost_on`] in words that follow the depth of the side; empty where there is none.
    pub(crate) fn but_lost(&self, side: &str) -> String {
        self.lost_on(side).map_or(String::new(), |lost| format!(", but {}", lost.in_words()))
    }

    /// The frame that the lanes of a side are of, where bodies move, in words that follow its depth: ` in frame 3`.
    pub(crate) fn in_frame(&self, side: &str) -> String {
        self.worst_frames.get(side).map_or(String::new(), |frame| in_frame(*frame))
    }

    /// The blind zone of a footprint, by cells of ground: all, seen ones, and cells under own bodies that move.
    pub(super) fn new(footprint: &Footprint, [ground, seen, own]: [&[Cell]; 3]) -> Self {
        let sides = ROUND.map(|(side, rising, _)| {
            let mut lanes = lanes(footprint, [ground, seen, own], side);
            if !rising {
                lanes.reverse();
            }
            lanes
        });
        Self::of_lanes(footprint, sides.concat())
    }

    /// From the zones of several poses of the bodies, each with its first frame: each side's lanes from the zone in which
    /// they are deepest, and its longest stretch of lost ground.
    pub(super) fn worst(footprint: &Footprint, mut zones: Vec<(usize, Self)>) -> Self {
        if zones.len() < 2 {
            let only = zones.pop().map(|(_, zone)| zone);
            return only.unwrap_or_else(|| Self::of_lanes(footprint, Vec::new()));
        }
        let (mut lanes, mut lost, mut frames) = (Vec::new(), Vec::new(), BTreeMap::new());
        for (side, ..) in ROUND {
            let side = side.name();
            // The larger of equally deep ones, then the first.
            let deepest = zones.iter().rev().max_by(|a, b| {
                let [a, b] = [a, b].map(|(_, zone)| zone.deepest(side));
                a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
            });
            let Some((frame, zone)) = deepest.filter(|(_, zone)| zone.deepest(side)[0] > 0.0)
            else {
                continue;
            };
            lanes.extend(zone.lanes.iter().filter(|lane| lane.side == side).cloned());
            frames.insert(side, *frame);
            let each = zones.iter().rev().flat_map(|(frame, zone)| {
                let own = zone.lost.iter().filter(move |lost| lost.side == side);
                own.map(move |lost| LostGround { frame: Some(*frame), ..lost.clone() })
            });
            lost.extend(each.max_by(|a, b| a.length().total_cmp(&b.length())));
        }
        Self { lost, worst_frames: frames, ..Self::of_lanes(footprint, lanes) }
    }

    /// Metres of the deepest lane of a side, and square metres of all of them; zeros without a lane.
    fn deepest(&self, side: &str) -> [f64; 2] {
        let own = self.lanes.iter().filter(|lane| lane.side == side);
        let depth = |lane: &BlindLane| lane.depth.unwrap_or(f64::INFINITY);
        let deepest = own.clone().map(depth).fold(0.0, f64::max);
        [deepest, own.map(lane_area).sum()]
    }

    fn of_lanes(footprint: &Footprint, lanes: Vec<BlindLane>) -> Self {
        let depth = |side: Side| {
            let own = lanes.iter().filter(|lane| lane.side == side.name());
            // No depth where there is no ground, or a lane of it is not seen at all.
            let depths: Option<Vec<f64>> = own.map(|lane| lane.depth).collect();
            depths?.into_iter().max_by(f64::total_cmp)
        };
        let [ahead, behind, left, right] = Side::ALL.map(depth);
        let area = lanes.iter().map(lane_area).sum();
        let lost = Side::ALL.into_iter().filter_map(|side| LostGround::new(side, &lanes)).collect();
        let (polygon, worst_frames) = (Vec::new(), BTreeMap::new());
        let mut zone =
            Self { lanes, polygon, area, ahead, behind, left, right, lost, worst_frames };
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

/// Square metres of a lane without ground under own bodies that move; one that does not end reaches 10 m.
fn lane_area(lane: &BlindLane) -> f64 {
    (lane.along[1] - lane.along[0]) * (lane.depth.unwrap_or(NEAR) - lane.own_body)
}

/// Metres of a lane up to a depth in cells whose middles lie at some distances.
fn metres_within(depth: Option<f64>, middles: &[f64]) -> f64 {
    let depth = depth.unwrap_or(NEAR);
    let within = |at: &f64| (at + CELL / 2.0).min(depth) - (at - CELL / 2.0).max(0.0);
    middles.iter().map(|at| within(at).max(0.0)).sum()
}

/// Lanes before one edge, by rising place along it.
fn lanes(footprint: &Footprint, [ground, seen, own]: [&[Cell]; 3], side: Side) -> Vec<BlindLane> {
    let mut cells: BTreeMap<i64, Vec<(f64, bool)>> = BTreeMap::new();
    for (some, are_seen) in [(ground, false), (seen, true)] {
        for (lane, distance) in some.iter().filter_map(|cell| lane_before(footprint, cell, side)) {
            cells.entry(lane).or_default().push((distance, are_seen));
        }
    }
    let mut own_bodies: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for (lane, distance) in own.iter().filter_map(|cell| lane_before(footprint, cell, side)) {
        own_bodies.entry(lane).or_default().push(distance);
    }
    let ([low, high], other) = (footprint.bounds(), 1 - outward(side).0);
    let (low, high) = (low[other], high[other]);
    // A lane whose middle lies before the edge is cut at the edge's end, and reaches it where no other one does.
    let snapped = |end: f64| match end {
        _ if end < low + CELL / 2.0 => low,
        _ if end > high - CELL / 2.0 => high,
        _ => end,
    };
    let lane = |(lane, mut cells): (i64, Vec<(f64, bool)>)| {
        let under = own_bodies.get(&lane).map_or(&[][..], Vec::as_slice);
        let along = [lane, lane + 1].map(|k| snapped(CELL * k as f64));
        // Seen cells are in both lists: each stays once, as seen.
        cells.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        cells.dedup_by_key(|cell| cell.0);
        let depth = cells.iter().find(|(_, is_seen)| *is_seen).map(|cell| cell.0);
        let own_body = metres_within(depth, under);
        BlindLane { side: side.name(), along, depth, own_body, lost: lost_stretches(&cells) }
    };
    cells.into_iter().map(lane).collect()
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
mod tests;
