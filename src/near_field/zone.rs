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
    /// Stretches of 1 m or more without a seen cell that begin right behind a seen one: start and end, metres from the
    /// edge.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<[f64; 2]>,
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
        Some(Self { side: side.name(), from, to, lanes, of: own().count() })
    }

    /// Its place and lanes, such as `unseen again in 8 of 10 lanes, at most from 1.2 to 10 m`.
    pub fn in_words(&self) -> String {
        let [from, to] = [self.from, self.to].map(|metres| (10.0 * metres).round() / 10.0);
        format!(
            "unseen again in {} of {} lanes, at most from {from} to {to} m",
            self.lanes, self.of
        )
    }
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
    /// Sides on which ground behind the nearest cell seen is lost again over 2 m or more.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<LostGround>,
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
    pub fn lost_on(&self, side: &str) -> Option<&LostGround> {
        let has_depth = |(name, depth): (&str, Option<f64>)| name == side && depth.is_some();
        let ends = self.depths().into_iter().any(has_depth);
        self.lost.iter().find(|lost| ends && lost.side == side)
    }

    /// Like [`Self::lost_on`] in words that follow the depth of the side; empty where there is none.
    pub fn but_lost(&self, side: &str) -> String {
        self.lost_on(side).map_or(String::new(), |lost| format!(", but {}", lost.in_words()))
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
        let lost = Side::ALL.into_iter().filter_map(|side| LostGround::new(side, &lanes)).collect();
        let mut zone = Self { lanes, polygon: Vec::new(), area, ahead, behind, left, right, lost };
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
    let mut cells: BTreeMap<i64, Vec<(f64, bool)>> = BTreeMap::new();
    for (some, are_seen) in [(ground, false), (seen, true)] {
        for (lane, distance) in some.iter().filter_map(|cell| lane_before(footprint, cell, side)) {
            cells.entry(lane).or_default().push((distance, are_seen));
        }
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
        let along = [lane, lane + 1].map(|k| snapped(CELL * k as f64));
        // Seen cells are in both lists: each stays once, as seen.
        cells.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        cells.dedup_by_key(|cell| cell.0);
        let depth = cells.iter().find(|(_, is_seen)| *is_seen).map(|cell| cell.0);
        BlindLane { side: side.name(), along, depth, lost: lost_stretches(&cells) }
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
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Middles of some cells from a place on, metres.
    fn middles(from: f64, count: i32) -> impl Iterator<Item = f64> {
        (0..count).map(move |k| from + CELL * (f64::from(k) + 0.5))
    }

    /// A box of 4 by 2 m, and the ground in 8 lanes up to 10 m behind and ahead of it.
    fn ground() -> (Footprint, Vec<Cell>) {
        let footprint =
            Footprint::of([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]).unwrap();
        let cell = |x: f64, y: f64| Cell { centre: [x, y], distance: footprint.distance([x, y]) };
        let behind = middles(-12.0, 40).flat_map(|x| middles(-1.0, 8).map(move |y| [x, y]));
        let ahead = middles(2.0, 40).flat_map(|x| middles(-1.0, 8).map(move |y| [x, y]));
        let ground = behind.chain(ahead).map(|[x, y]| cell(x, y)).collect();
        (footprint, ground)
    }

    #[test]
    fn a_wedge_that_does_not_end_has_no_depth_and_the_deepest_lane_counts() {
        let (footprint, ground) = ground();
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
    fn ground_lost_again_behind_a_slit_is_told_and_gaps_between_rings_are_not() {
        let (footprint, ground) = ground();
        // Behind a slit of 1.25 m is seen, and all of two lanes. Ahead are rings with gaps of 0.75 m.
        let is_seen = |cell: &&Cell| match cell.centre {
            [x, _] if x > 0.0 => ((x - 2.0) % 1.0) < CELL,
            [x, y] => x > -3.25 || y < -0.5,
        };
        let seen: Vec<Cell> = ground.iter().filter(is_seen).copied().collect();
        let zone = BlindZone::new(&footprint, &ground, &seen);
        assert_eq!((zone.ahead, zone.behind), (Some(CELL / 2.0), Some(CELL / 2.0)));
        let want = LostGround { side: "behind", from: 1.25, to: 10.0, lanes: 6, of: 8 };
        assert_eq!(zone.lost, [want]);
        let words = "unseen again in 6 of 8 lanes, at most from 1.3 to 10 m";
        assert_eq!(zone.lost_on("behind").unwrap().in_words(), words);
        assert_eq!(zone.lost_on("ahead"), None);
        // A thing of 1 m stands on a lane: the ground in its shadow is not lost by the rig.
        let cells = |thing: bool| -> Vec<(f64, bool)> {
            let all = middles(0.0, 40).map(|metres| (metres, metres < 2.0));
            all.filter(|(metres, _)| !thing || !(2.0..3.0).contains(metres)).collect()
        };
        assert_eq!(lost_stretches(&cells(false)), [[2.0, 10.0]]);
        assert_eq!(lost_stretches(&cells(true)), [[0.0; 2]; 0]);
    }

    #[test]
    fn more_ground_seen_never_makes_the_kept_depth_worse() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let depth = |cells: &[(f64, bool)], metres| {
            kept_depth(cells.iter().copied(), metres).unwrap_or(f64::INFINITY)
        };
        let (mut lost, mut better) = (0, 0);
        for _ in 0..20_000 {
            // Things leave gaps in the ground; what is seen comes in runs, too.
            let mut runs = |likely: f64| -> Vec<bool> {
                let mut is_set = rng.random_bool(likely);
                let turned = |_| {
                    is_set ^= rng.random_bool(0.25);
                    is_set
                };
                (0..40).map(turned).collect()
            };
            let (ground, few, added) = (runs(0.9), runs(0.3), runs(0.3));
            let lane = |seen: &dyn Fn(usize) -> bool| -> Vec<(f64, bool)> {
                let cells = middles(0.0, 40).enumerate().filter(|(k, _)| ground[*k]);
                cells.map(|(k, metres)| (metres, seen(k))).collect()
            };
            let (less, more) = (lane(&|k| few[k]), lane(&|k| few[k] || added[k]));
            for metres in [0.5, 1.0, 2.0, 3.3, 6.0, 9.5] {
                let [with_less, with_more] = [depth(&less, metres), depth(&more, metres)];
                assert!(with_more <= with_less, "{metres}: {less:?} {more:?}");
                let nearest = less.iter().find(|cell| cell.1).map_or(f64::INFINITY, |cell| cell.0);
                lost += usize::from(with_less > nearest);
                better += usize::from(with_more < with_less);
            }
        }
        assert!(lost > 100 && better > 100, "{lost} {better}");
        // Ground seen right behind a thing, and none beyond: as good as without that ground.
        let behind_a_thing = |is_seen: bool| -> Vec<(f64, bool)> {
            let ground = middles(0.0, 40).filter(|metres| !(0.5..1.0).contains(metres));
            ground.map(|metres| (metres, metres < 0.5 || (is_seen && metres < 1.5))).collect()
        };
        let both = [false, true].map(|is_seen| depth(&behind_a_thing(is_seen), 2.0));
        assert_eq!(both, [CELL / 2.0; 2]);
        // The first cell seen and lost ground behind it: the lane does not end.
        let slit: Vec<(f64, bool)> =
            middles(0.0, 40).map(|metres| (metres, metres < 1.0)).collect();
        assert_eq!(depth(&slit, 2.0), f64::INFINITY);
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
