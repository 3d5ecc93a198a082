//! Ground that a vehicle's rules ask for, in one scene: by the cells and the depths of the near field.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use rayon::prelude::*;

use super::ground::{CLOSE, MOST_BODY};
use super::ground::{Cell, CellGrid};
use super::look::NearSite;
use super::zone::{kept_depth, lane_before};
use super::{CELL, Footprint, NEAR};
use crate::bvh::Hit;
use crate::cast::Caster;
use crate::geom::Pose;
use crate::maths;
use crate::problem::{Problem, ProblemError, SensorBatch};
use crate::score::{WorstFrame, metres_up};
use crate::vehicle::{GroundAsked, GroundRule, SensorPose, Side, UnknownSensor};

/// Metres by which the box around the ground is larger than the cells: a hit sees a cell from half a metre away, and
/// rounding must not lose it.
const MARGIN: f64 = CLOSE + CELL;
/// Share by which one side must lag behind the whole to be named.
const LAGS: f64 = 0.02;

/// Ground that rules ask for in a scene or its mirror image: cells near the own body, a bit each in every distinct frame.
pub(crate) struct RequiredGround {
    site: NearSite,
    is_mirrored: bool,
    /// Bit of each cell of the site; `None` for cells that no rule asks for.
    bits: Vec<Option<u32>>,
    cells: Vec<Cell>,
    /// For each distinct frame, the cells that are ground.
    ground: Vec<Box<[u64]>>,
    /// Corners of the box beyond which no hit sees any of the cells, metres.
    reach: [DVec3; 2],
    /// One a model, made on first use.
    casters: Vec<OnceLock<Caster>>,
    rules: Vec<CellRule>,
}

enum CellRule {
    /// For each distinct frame, the cells that count.
    Cells(Vec<Box<[u64]>>),
    /// For each pose of the bodies the lanes before an edge; the depth in metres; the side as the vehicle has it.
    Lanes(Vec<Vec<GroundLane>>, f64, Side),
}

/// Cells of a lane by distance.
type GroundLane = Vec<LaneCell>;

struct LaneCell {
    bit: usize,
    /// Metres from the edge.
    distance: f64,
    /// Frames of the pose in which it is ground.
    ground: u64,
}

/// Share of the ground that a rule asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GroundSeen {
    /// Share of cells, a mean over frames, or of lanes in the pose of the bodies with the least; `None` where the scene has
    /// no such ground.
    pub share: Option<f64>,
    /// Like the share, but rising with every lane that gets shorter, in whatever pose.
    pub soft: f64,
}

impl RequiredGround {
    /// Ground that the vehicle of a problem must see; `None` without rules on it. A mirror image has mirrored sensors.
    pub(crate) fn of(problem: &Arc<Problem>, is_mirrored: bool) -> Option<Self> {
        let required = problem.ground_required();
        if required.rules.is_empty() {
            return None;
        }
        let site = NearSite::of_rules(problem)?;
        let asks = |cell: &Cell| {
            required.rules.iter().any(|rule| match rule.asked {
                GroundAsked::Within(metres) => cell.distance <= metres,
                GroundAsked::BlindZone(side, _) => {
                    lane_before(&site.footprint, cell, seen_side(side, is_mirrored)).is_some()
                }
            })
        };
        let (mut bits, mut cells) = (Vec::new(), Vec::new());
        for cell in &site.cells.cells {
            let bit = asks(cell).then_some(cells.len() as u32);
            bits.push(bit);
            cells.extend(bit.map(|_| *cell));
        }
        let of_frame = |(_, _, ground): &(usize, u64, Vec<bool>)| {
            let with_bits = bits.iter().zip(ground).filter(|(bit, _)| bit.is_some());
            mask_of(with_bits.map(|(_, is_ground)| *is_ground))
        };
        let ground = site.frames.iter().map(of_frame).collect();
        let reach = reach_of(&cells, &site);
        let casters = problem.sensors().models().iter().map(|_| OnceLock::new()).collect();
        let rules = Vec::new();
        let mut this = Self { site, is_mirrored, bits, cells, ground, reach, casters, rules };
        this.rules = required.rules.iter().map(|rule| this.asked(rule)).collect();
        Some(this)
    }

    fn frame_words(&self) -> usize {
        self.cells.len().div_ceil(64)
    }

    pub(crate) fn words(&self) -> usize {
        self.frame_words() * self.site.frames.len()
    }

    pub(crate) fn moves(&self) -> bool {
        self.site.poses.len() > 1
    }

    fn asked(&self, rule: &GroundRule) -> CellRule {
        match rule.asked {
            GroundAsked::Within(metres) => {
                let near = mask_of(self.cells.iter().map(|cell| cell.distance <= metres));
                CellRule::Cells(self.ground.iter().map(|ground| both(ground, &near)).collect())
            }
            GroundAsked::BlindZone(side, metres) => {
                let poses = 0..self.site.poses.len();
                let lanes = poses.map(|pose| self.lanes(pose, seen_side(side, self.is_mirrored)));
                CellRule::Lanes(lanes.collect(), metres, side)
            }
        }
    }

    /// Lanes of ground before an edge in a pose of the bodies.
    fn lanes(&self, pose: usize, side: Side) -> Vec<GroundLane> {
        let mut lanes: BTreeMap<i64, GroundLane> = BTreeMap::new();
        for (bit, cell) in self.cells.iter().enumerate() {
            let Some((lane, distance)) = lane_before(&self.site.footprint, cell, side) else {
                continue;
            };
            let ground = self.frames_of(pose, bit, None);
            if ground > 0 {
                lanes.entry(lane).or_default().push(LaneCell { bit, distance, ground });
            }
        }
        let mut lanes: Vec<GroundLane> = lanes.into_values().collect();
        lanes.iter_mut().for_each(|l| l.sort_by(|a, b| a.distance.total_cmp(&b.distance)));
        lanes
    }

    /// Frames of a pose of the bodies in which a cell is ground and, if bits of all frames are given, seen.
    fn frames_of(&self, pose: usize, bit: usize, seen: Option<&[u64]>) -> u64 {
        let word = |words: &[u64], at: usize| {
            // Nothing is seen without a LiDAR: there are no words.
            words.get(at).map_or(0, |word| word >> (bit % 64) & 1)
        };
        let of_frame = |&frame: &usize| {
            let first = frame * self.frame_words();
            let is_seen = seen.map_or(1, |seen| word(seen, first + bit / 64));
            self.site.frames[frame].1 * (word(&self.ground[frame], bit / 64) & is_seen)
        };
        self.site.poses[pose].iter().map(of_frame).sum()
    }

    /// Cells that a LiDAR sees, frame after frame; `[frames × words]`.
    pub(crate) fn seen(&self, lidar: &SensorPose) -> Result<Vec<u64>, UnknownSensor> {
        let lidar = if self.is_mirrored { lidar.mirrored() } else { *lidar };
        let problem = &self.site.problem;
        let batch = SensorBatch::new(problem, std::slice::from_ref(&lidar), None)?;
        let mut all = vec![0; self.words()];
        let of_frame = all.par_chunks_mut(self.frame_words().max(1)).zip(&self.site.frames);
        of_frame.for_each(|(words, (frame, ..))| {
            let poses = batch.ego_from_sensors(*frame);
            let hits = self.hits(&batch, &poses, *frame);
            let mut seen = vec![false; self.bits.len()];
            self.site.mark_seen(batch.table(0), &poses[0], &hits, &mut seen);
            for (bit, _) in self.bits.iter().zip(&seen).filter(|(_, seen)| **seen) {
                let Some(bit) = bit.map(|bit| bit as usize) else { continue };
                words[bit / 64] |= 1 << (bit % 64);
            }
        });
        Ok(all)
    }

    /// Closest hits of a LiDAR's beams as far as they may see a cell; in bad weather only the hits of beams that come back.
    fn hits(&self, batch: &SensorBatch<'_>, poses: &[Pose], frame: usize) -> Vec<Hit> {
        let problem = &self.site.problem;
        let Some(geometry) = problem.geometry(frame) else { return Vec::new() };
        let (table, far) = (batch.table(0), batch.range(0));
        let caster = self.casters[batch.model(0)].get_or_init(|| Caster::new(table));
        let range = |direction: &[f32; 3]| match problem.air() {
            // Weather depends on where beams end, near or far.
            Some(_) => far,
            None => self.range(*direction, &poses[0], far),
        };
        let mut hits: Vec<Hit> =
            table.directions().iter().map(|direction| Hit::none(range(direction))).collect();
        caster.closer_hits_in(poses, geometry, vec![&mut hits[..]]);
        if let Some(air) = problem.air() {
            air.dim(batch, poses, geometry, problem.number_of(frame), &mut hits);
        }
        hits
    }

    /// Metres after which a beam has left the box of the cells that must be seen; 0 for a beam that misses it.
    fn range(&self, direction: [f32; 3], pose: &Pose, far: f32) -> f32 {
        let along = pose.rotation * DVec3::from(direction.map(f64::from));
        let [low, high] = self.reach.map(|bound| bound - pose.translation);
        let (mut enter, mut leave) = (0.0_f64, f64::from(far));
        for axis in 0..3 {
            if along[axis] == 0.0 {
                let is_outside = low[axis] > 0.0 || high[axis] < 0.0;
                leave = if is_outside { -1.0 } else { leave };
                continue;
            }
            let inverse = 1.0 / along[axis];
            let [a, b] = [low[axis] * inverse, high[axis] * inverse];
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        if leave < enter { 0.0 } else { leave as f32 }
    }

    /// Share of the ground of a rule, by its number, that is seen in bits of all frames.
    pub(crate) fn share(&self, rule: usize, bits: &[u64]) -> GroundSeen {
        match &self.rules[rule] {
            CellRule::Cells(masks) => {
                let share = self.share_in(masks, bits, 0..masks.len());
                GroundSeen { share, soft: share.unwrap_or(0.0) }
            }
            CellRule::Lanes(poses, metres, _) => {
                let seen = |(pose, lanes): (usize, &Vec<GroundLane>)| {
                    self.lanes_seen(pose, lanes, *metres, bits)
                };
                let each: Vec<[f64; 2]> = with_lanes(poses).map(seen).collect();
                let share = each.iter().map(|seen| seen[0]).min_by(f64::total_cmp);
                let soft: f64 = each.iter().map(|seen| seen[1]).sum();
                GroundSeen { share, soft: soft / each.len().max(1) as f64 }
            }
        }
    }

    /// Share of the lanes of a pose that a rule of some metres keeps, and its softer twin.
    fn lanes_seen(&self, pose: usize, lanes: &[GroundLane], metres: f64, bits: &[u64]) -> [f64; 2] {
        let [mut ends, mut soft] = [0.0; 2];
        for lane in lanes {
            let depth = self.kept_depth(pose, lane, metres, bits);
            ends += f64::from(u8::from(depth.is_some_and(|depth| depth <= metres)));
            let beyond = (depth.unwrap_or(2.0 * NEAR) - metres).max(0.0);
            soft += 1.0 - beyond / (2.0 * NEAR);
        }
        [ends, soft].map(|sum| sum / lanes.len().max(1) as f64)
    }

    /// The pose of the bodies in which least of the ground of a rule is seen, by its first frame, and that share; `None`
    /// where no other pose has more.
    pub(crate) fn worst_frame(&self, rule: usize, bits: &[u64]) -> Option<WorstFrame> {
        let each: Vec<(usize, f64)> = match &self.rules[rule] {
            CellRule::Cells(masks) => {
                let poses = self.site.poses.iter().enumerate();
                let share = |(pose, frames): (usize, &Vec<usize>)| {
                    Some((pose, self.share_in(masks, bits, frames.iter().copied())?))
                };
                poses.filter_map(share).collect()
            }
            CellRule::Lanes(poses, metres, _) => with_lanes(poses)
                .map(|(pose, lanes)| (pose, self.lanes_seen(pose, lanes, *metres, bits)[0]))
                .collect(),
        };
        let by_frame = each.into_iter().map(|(pose, share)| (self.site.first_frame(pose), share));
        WorstFrame::among(by_frame)
    }

    /// Share of the cells of a frame's mask that are seen, as a mean over some frames. Frames with an empty mask do not count.
    fn share_in(
        &self,
        masks: &[Box<[u64]>],
        bits: &[u64],
        frames: impl IntoIterator<Item = usize>,
    ) -> Option<f64> {
        let ones = |words: &mut dyn Iterator<Item = u64>| -> u64 {
            words.map(|word| u64::from(word.count_ones())).sum()
        };
        let (mut sum, mut count) = (0.0, 0);
        for frame in frames {
            let (mask, weight) = (&masks[frame], self.site.frames[frame].1);
            let all = ones(&mut mask.iter().copied());
            if all > 0 {
                // Nothing is seen without a LiDAR: there are no words.
                let seen = bits.get(frame * self.frame_words()..).unwrap_or_default();
                let seen = ones(&mut mask.iter().zip(seen).map(|(mask, seen)| mask & seen));
                sum += weight as f64 * seen as f64 / all as f64;
                count += weight;
            }
        }
        (count > 0).then(|| sum / count as f64)
    }

    /// True for a cell that is seen in at least half of its frames of a pose.
    fn is_seen(&self, pose: usize, cell: &LaneCell, bits: &[u64]) -> bool {
        2 * self.frames_of(pose, cell.bit, Some(bits)) >= cell.ground
    }

    /// Metres to the nearest cell of a lane that is seen.
    fn depth(&self, pose: usize, lane: &[LaneCell], bits: &[u64]) -> Option<f64> {
        lane.iter().find(|cell| self.is_seen(pose, cell, bits)).map(|cell| cell.distance)
    }

    /// Depth of a lane that counts for a rule of some metres; see [`kept_depth`].
    fn kept_depth(&self, pose: usize, lane: &[LaneCell], metres: f64, bits: &[u64]) -> Option<f64> {
        kept_depth(lane.iter().map(|cell| (cell.distance, self.is_seen(pose, cell, bits))), metres)
    }

    /// Ground that a rule lacks, in words.
    pub(crate) fn missing(&self, rule: usize, bits: &[u64]) -> String {
        match &self.rules[rule] {
            CellRule::Cells(masks) => self.least_side(masks, bits),
            CellRule::Lanes(poses, metres, side) => {
                let side = side.name();
                let share = |&(pose, lanes): &(usize, &Vec<GroundLane>)| {
                    self.lanes_seen(pose, lanes, *metres, bits)[0]
                };
                let worst = with_lanes(poses).min_by(|a, b| share(a).total_cmp(&share(b)));
                let Some((pose, lanes)) = worst else {
                    return format!("no ground {side} within {NEAR:.0} m");
                };
                let depths: Option<Vec<f64>> =
                    lanes.iter().map(|lane| self.depth(pose, lane, bits)).collect();
                let is_within = |depth: Option<f64>| depth.is_some_and(|depth| depth <= *metres);
                let is_lost = |lane: &&GroundLane| {
                    is_within(self.depth(pose, lane, bits))
                        && !is_within(self.kept_depth(pose, lane, *metres, bits))
                };
                let lost = match (lanes.iter().filter(is_lost).count(), lanes.len()) {
                    (0, _) => String::new(),
                    (lost, all) => format!("; {lost} of {all} lanes lose ground behind it again"),
                };
                match depths.and_then(|depths| depths.into_iter().max_by(f64::total_cmp)) {
                    Some(depth) => {
                        let depth = metres_up(depth);
                        format!("the blind zone {side} ends at {depth:.1} m{lost}")
                    }
                    None => format!("the blind zone {side} does not end within {NEAR:.0} m"),
                }
            }
        }
    }

    /// Quarter around the vehicle of which least is seen, with its share.
    fn least_side(&self, masks: &[Box<[u64]>], bits: &[u64]) -> String {
        let Some(whole) = self.share_in(masks, bits, 0..masks.len()) else {
            return "no ground in any frame".to_owned();
        };
        let middle = self.site.footprint.middle();
        let share = |side: Side| {
            let in_quarter = |cell: &Cell| {
                let [x, y] = [0, 1].map(|k| cell.centre[k] - middle[k]);
                let turns = (maths::atan2(y, x) / std::f64::consts::FRAC_PI_2).round() as i64;
                let of = [Side::Ahead, Side::Left, Side::Behind, Side::Right];
                of[turns.rem_euclid(4) as usize] == seen_side(side, self.is_mirrored)
            };
            let quarter = mask_of(self.cells.iter().map(in_quarter));
            let masks: Vec<_> = masks.iter().map(|mask| both(mask, &quarter)).collect();
            self.share_in(&masks, bits, 0..masks.len()).map(|share| (side, share))
        };
        let sides: Vec<(Side, f64)> = Side::ALL.into_iter().filter_map(share).collect();
        match sides.iter().min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((side, share)) if *share < whole - LAGS => {
                format!("least is seen {}: {:.1} %", side.name(), 100.0 * share)
            }
            _ if sides.len() == Side::ALL.len() => "missing on all sides".to_owned(),
            _ => {
                let names: Vec<&str> = sides.iter().map(|(side, _)| side.name()).collect();
                format!("missing on each side with a cell of it: {}", names.join(", "))
            }
        }
    }
}

fn with_lanes(poses: &[Vec<GroundLane>]) -> impl Iterator<Item = (usize, &Vec<GroundLane>)> {
    poses.iter().enumerate().filter(|(_, lanes)| !lanes.is_empty())
}

/// Metres from which on each of some rules has a cell to count, beside the own body of a problem: from its outline, or
/// before the edge of a blind zone; `None` where no lane of cells lies there.
pub(crate) fn least_metres(
    problem: &Problem,
    rules: &[GroundRule],
) -> Result<Vec<Option<f64>>, ProblemError> {
    let Some(first) = rules.first() else { return Ok(Vec::new()) };
    let footprint = Footprint::of(problem.body().corners().map(|at| [at.x, at.y]));
    let lacks =
        "own body with an area from above (`ego.body` of the scene, or `body` of the vehicle)";
    let footprint = footprint.ok_or_else(|| ProblemError::ground_without(&first.name, lacks))?;
    let length = footprint.length();
    if length > MOST_BODY {
        return Err(ProblemError::Refused(format!(
            "the vehicle requires `{}`, and its body is {length:.0} m long or wide, more than the {MOST_BODY:.0} m around \
             which ground is counted; give `body` in metres, or leave the ground out of `require`",
            first.name
        )));
    }
    let cells = CellGrid::around(&footprint).cells;
    let least = |rule: &GroundRule| {
        let metres = |cell: &Cell| match rule.asked {
            GroundAsked::Within(_) => Some(cell.distance),
            GroundAsked::BlindZone(side, _) => Some(lane_before(&footprint, cell, side)?.1),
        };
        cells.iter().filter_map(metres).min_by(f64::total_cmp)
    };
    Ok(rules.iter().map(least).collect())
}

/// Side of the scene's own frame that is a side of the vehicle.
fn seen_side(side: Side, is_mirrored: bool) -> Side {
    if is_mirrored { side.mirrored() } else { side }
}

/// Bits of a list, 64 a word.
fn mask_of(list: impl IntoIterator<Item = bool>) -> Box<[u64]> {
    let mut words = Vec::new();
    for (bit, is_set) in list.into_iter().enumerate() {
        if bit % 64 == 0 {
            words.push(0);
        }
        if let Some(word) = words.last_mut() {
            *word |= u64::from(is_set) << (bit % 64);
        }
    }
    words.into()
}

fn both(a: &[u64], b: &[u64]) -> Box<[u64]> {
    a.iter().zip(b).map(|(a, b)| a & b).collect()
}

/// Corners of the box around cells and the ground near them, in which alone a hit sees any of them.
fn reach_of(cells: &[Cell], site: &NearSite) -> [DVec3; 2] {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for cell in cells {
        let at = DVec3::new(cell.centre[0], cell.centre[1], 0.0);
        (low, high) = (low.min(at), high.max(at));
    }
    (low, high) = (low - MARGIN, high + MARGIN);
    let [bottom, top] = site.heights_between([low, high]);
    [low.with_z(bottom - MARGIN), high.with_z(top + MARGIN)]
}
