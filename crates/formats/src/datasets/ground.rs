//! Ground of a sequence: checks by its labelled road, and its tiles as plates of a scene.
//!
//! The road says how high the LiDAR stands and whether the vehicle is upright. For a scene ground tiles become flat
//! plates, and everything else at rest becomes boxes; occupied cells are joined to few blocks, greedily.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::import::{rounded, world_from_ego};
use super::{Checked, LabelledScan, LabelledSequence};
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::Note;
use sightline_scene::scene::Ground;

/// Within this radius of the LiDAR the road tells its height, metres.
pub(super) const NEAR: f64 = 10.0;
/// Fewest points of a road that may contradict a stated height.
const LEAST_POINTS: usize = 10;
/// Scans that are looked at for a road.
pub(super) const MOST_SCANS: usize = 10;
/// Metres by which a road may lie off the ground of the ego frame: it is not flat, and a car sways.
const OFF: f64 = 0.3;
/// Longest median step between two frames, metres: half a second at 360 km/h.
const LONGEST_STEP: f64 = 50.0;
/// Least share of the vehicle's up axis that points up.
const UPRIGHT: f64 = 0.7;

/// The road near the LiDAR in one scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NearRoad {
    /// Its points within [`NEAR`].
    pub points: usize,
    /// Median of their depth below the LiDAR, metres.
    pub depth: f64,
    /// Metres of height that hold the middle four fifths of them.
    pub spread: f64,
}

impl NearRoad {
    /// The road among depths below the LiDAR; `None` of no depth.
    pub(super) fn of(mut depths: Vec<f64>) -> Option<Self> {
        let depth = median(&mut depths)?;
        let share = |share: usize| depths[depths.len() * share / 10];
        Some(Self { points: depths.len(), depth, spread: share(9) - share(1) })
    }

    /// True if it has enough points to contradict a stated height.
    pub(super) fn is_sure(&self) -> bool {
        self.points >= LEAST_POINTS
    }
}

/// True if a class is road, which says where the ground is.
pub(super) fn is_road(class: &str) -> bool {
    Ground::of(class) == Some(Ground::Road)
}

/// The road of the first scan that has enough of one, else of the scan that has most of it, and the scan's frame.
/// `ego_from_sensor` turns points upright.
pub(super) fn road(sequence: &dyn LabelledSequence) -> Checked<Option<(u32, NearRoad)>> {
    let classes = sequence.classes();
    let mut most: Option<(u32, NearRoad)> = None;
    for frame in sequence.frames().into_iter().take(MOST_SCANS) {
        let upright = Pose { translation: DVec3::ZERO, ..sequence.ego_from_sensor(frame)? };
        let LabelledScan { points, labels } = sequence.read(frame)?;
        let near = points.iter().zip(&labels).filter_map(|(&point, label)| {
            let at = upright.apply(Vec3::from(point).as_dvec3());
            let is_near =
                is_road(&classes[usize::from(label.class?)]) && maths::hypot(at.x, at.y) <= NEAR;
            is_near.then_some(0.0 - at.z)
        });
        let road = NearRoad::of(near.collect());
        if let Some(road) =
            road.filter(|road| most.is_none_or(|(_, most)| most.points < road.points))
        {
            most = Some((frame, road));
            if road.is_sure() {
                break;
            }
        }
    }
    Ok(most)
}

/// Doubts about a sequence: a road that lies off the ground, a vehicle that is not upright, poses that move it
/// sideways, backwards or by leaps. `option` names the option that gives the LiDAR's height, where there is one.
pub(super) fn doubts(sequence: &dyn LabelledSequence, option: Option<&str>) -> Checked<Vec<Note>> {
    let name = sequence.name();
    let mut notes = Vec::new();
    if let Some((frame, road)) = road(sequence)?.filter(|(_, road)| road.is_sure()) {
        let height = sequence.ego_from_sensor(frame)?.translation.z;
        if (road.depth - height).abs() > OFF {
            let mend =
                option.map(|option| format!("; {option} gives another height")).unwrap_or_default();
            notes.push(Note::doubt(format!(
                "{name}: the LiDAR stands {height:.2} m above the ground, and the road of frame {frame} lies \
                 {:.2} m below it; {height:.2} m counts{mend}.",
                road.depth
            )));
        }
    }
    let frames = sequence.frames();
    notes.extend(frames.first().map(|&frame| no_returns(sequence, frame)).transpose()?.flatten());
    let egos = frames.iter().map(|&frame| world_from_ego(sequence, frame));
    let egos = egos.collect::<Checked<Vec<Pose>>>()?;
    if let Some(k) = egos.iter().position(|ego| ego.rotation.z_axis.z < UPRIGHT) {
        let tilt = maths::acos(egos[k].rotation.z_axis.z.clamp(-1.0, 1.0)).to_degrees();
        notes.push(Note::doubt(format!(
            "{name}: the vehicle of frame {} leans by {tilt:.0} degrees; check the order of its quaternion (w, x, y, z) \
             or the axes of its pose.",
            frames[k]
        )));
    } else {
        notes.extend(off_course(&name, &egos).or_else(|| upwards(&name, &egos)));
    }
    notes.extend(leaps(&name, &frames, &egos));
    Ok(notes)
}

/// A doubt about labelled points at the sensor's own origin: programs write a beam that came back from nowhere so.
fn no_returns(sequence: &dyn LabelledSequence, frame: u32) -> Checked<Option<Note>> {
    let LabelledScan { points, labels } = sequence.read(frame)?;
    let all = points.iter().zip(&labels);
    let count = all.filter(|(at, label)| **at == [0.0; 3] && label.class.is_some()).count();
    let name = sequence.name();
    let text = format!(
        "{name}: {count} labelled points of frame {frame} lie at 0, 0, 0, in the LiDAR itself, and vote there; leave out beams \
         without a return, with their labels."
    );
    Ok((count > 0).then(|| Note::doubt(text)))
}

/// The middle of values, which are sorted for it; `None` without one.
fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// A doubt where the median step of a vehicle from one frame number to the next is longer than any vehicle drives.
fn leaps(name: &str, frames: &[u32], egos: &[Pose]) -> Option<Note> {
    let pairs = egos.windows(2).zip(frames.windows(2));
    let mut steps: Vec<f64> = pairs
        .map(|(ego, frame)| {
            let way = (ego[1].translation - ego[0].translation).length();
            way / f64::from(frame[1].abs_diff(frame[0]).max(1))
        })
        .collect();
    let step = median(&mut steps)?;
    let text = format!(
        "{name}: the vehicle moves {step:.0} m from frame to frame; positions are in metres: centimetres, or millimetres?"
    );
    (step > LONGEST_STEP).then(|| Note::doubt(text))
}

/// A doubt where the median way of a vehicle leads sideways or backwards.
fn off_course(name: &str, egos: &[Pose]) -> Option<Note> {
    const STEP: f64 = 0.3;
    let mut angles: Vec<f64> = egos
        .windows(2)
        .map(|pair| (pair[0].rotation.x_axis, pair[1].translation - pair[0].translation))
        .filter(|(_, way)| way.truncate().length() > STEP)
        .map(|(ahead, way)| ahead.truncate().angle_to(way.truncate()).to_degrees().abs())
        .collect();
    let angle = median(&mut angles)?;
    let mend = match angle {
        ..45.0 => return None,
        ..=135.0 => "check the unit of the angles and the axes of the poses",
        _ => {
            "do the poses lead from the world to the sensor, the inverse, or does the sensor look back?"
        }
    };
    let end = if mend.ends_with('?') { "" } else { "." };
    let text = format!(
        "{name}: the vehicle moves {angle:.0} degrees off its own heading over {} steps; {mend}{end}",
        angles.len()
    );
    (angles.len() >= 2).then(|| Note::doubt(text))
}

/// A doubt where the median way of a vehicle climbs or falls steeper than any street: poses of a camera whose z axis looks
/// ahead, most likely, with the `Tr` of poses of the LiDAR.
fn upwards(name: &str, egos: &[Pose]) -> Option<Note> {
    const STEP: f64 = 0.3;
    const STEEPEST: f64 = 45.0;
    let mut angles: Vec<f64> = egos
        .windows(2)
        .map(|pair| (pair[0].rotation.z_axis, pair[1].translation - pair[0].translation))
        .filter(|(_, way)| way.length() > STEP)
        .map(|(up, way)| (90.0 - up.angle_between(way).to_degrees()).abs())
        .collect();
    let angle = median(&mut angles)?;
    let text = format!(
        "{name}: the vehicle moves {angle:.0} degrees up or down over {} steps; check the axes of the poses, and the \
         transform from the LiDAR to them.",
        angles.len()
    );
    (angles.len() >= 2 && angle > STEEPEST).then(|| Note::doubt(text))
}

/// Heights of plates are whole multiples of this, metres.
const STEP: f64 = 0.1;
/// Fewest points of a cell that is a thing: single ones are noise.
const LEAST_OF_A_TILE: u32 = 2;

/// Points of things at rest, counted by cell.
pub(super) struct PointCells<'a> {
    edge: f64,
    classes: &'a [String],
    /// Class that a ground point of each class counts for; `None` is no ground.
    ground_as: Vec<Option<u16>>,
    /// Points and the sum of their heights, by tile and class.
    ground: HashMap<([i32; 2], u16), (u32, f64)>,
    /// Points by cell and class.
    solid: HashMap<(CellIndex, u16), u32>,
}

/// Shapes of a scene and how many of each.
pub(super) struct Shapes {
    pub shapes: Vec<Value>,
    pub plates: usize,
    pub boxes: usize,
}

impl<'a> PointCells<'a> {
    pub(super) fn new(edge: f64, classes: &'a [String]) -> Self {
        let id = |name: &str| classes.iter().position(|class| class == name).map(|id| id as u16);
        // Lane markings lie on the road; a bridge is a body.
        let ground_as = |name: &String| match Ground::of(name)? {
            Ground::Bridge => None,
            _ if name == "road_line" => id("road"),
            _ => id(name),
        };
        let ground_as = classes.iter().map(ground_as).collect();
        Self { edge, classes, ground_as, ground: HashMap::new(), solid: HashMap::new() }
    }

    /// Counts a point; its coordinates are few enough cells from the origin.
    pub(super) fn add(&mut self, point: DVec3, class: u16) {
        let cell = (point / self.edge).floor().to_array().map(|v| v as i32);
        match self.ground_as[usize::from(class)] {
            Some(class) => {
                let (points, height) = self.ground.entry(([cell[0], cell[1]], class)).or_default();
                *points += 1;
                *height += point.z;
            }
            None => *self.solid.entry((cell, class)).or_default() += 1,
        }
    }

    /// Plates of the ground and boxes of the rest, each of its cell's most frequent class.
    pub(super) fn shapes(self) -> Shapes {
        let mut plates: BTreeMap<u16, HashSet<CellIndex>> = BTreeMap::new();
        let ground =
            self.ground.iter().map(|(&(tile, class), &(n, height))| (tile, class, n, height));
        for (tile, (class, points, height)) in most(ground) {
            let level = (height / f64::from(points) / STEP).round() as i32;
            plates.entry(class).or_default().insert([tile[0], tile[1], level]);
        }
        let mut things: BTreeMap<u16, HashSet<CellIndex>> = BTreeMap::new();
        for (cell, (class, points, ())) in
            most(self.solid.iter().map(|(&(cell, class), &n)| (cell, class, n, ())))
        {
            if points >= LEAST_OF_A_TILE {
                things.entry(class).or_default().insert(cell);
            }
        }
        let metres = |cell: CellIndex| cell.map(|v| rounded(f64::from(v) * self.edge));
        let mut shapes = Vec::new();
        for (class, cells) in plates {
            shapes.extend(merge(cells, &[1, 0]).into_iter().map(|Block { low, high }| {
                let z = rounded(f64::from(low[2]) * STEP);
                let ([x, y, _], [to_x, to_y, _]) = (metres(low), metres(high));
                json!({ "class": self.classes[usize::from(class)],
                        "plane": { "min": [x, y], "max": [to_x, to_y], "z": z } })
            }));
        }
        let plates = shapes.len();
        for (class, cells) in things {
            shapes.extend(merge(cells, &[2, 1, 0]).into_iter().map(|Block { low, high }| {
                json!({ "class": self.classes[usize::from(class)],
                        "box": { "min": metres(low), "max": metres(high) } })
            }));
        }
        Shapes { plates, boxes: shapes.len() - plates, shapes }
    }
}

/// Majority class of each place (ties: lowest id), with its point count and payload.
fn most<K: Ord, V>(counted: impl Iterator<Item = (K, u16, u32, V)>) -> BTreeMap<K, (u16, u32, V)> {
    let mut best: BTreeMap<K, (u16, u32, V)> = BTreeMap::new();
    for (place, class, points, value) in counted {
        let rank = (points, std::cmp::Reverse(class));
        match best.get(&place) {
            Some(&(other, most, _)) if (most, std::cmp::Reverse(other)) >= rank => {}
            _ => drop(best.insert(place, (class, points, value))),
        }
    }
    best
}

/// Cell numbers along x, y and z.
type CellIndex = [i32; 3];

/// A block of cells from `low` up to and without `high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Block {
    low: CellIndex,
    high: CellIndex,
}

/// Blocks that hold every cell once and nothing else: from the least cell on, each grows along `axes` in
/// their order as far as whole layers of free cells reach.
fn merge(mut cells: HashSet<CellIndex>, axes: &[usize]) -> Vec<Block> {
    let mut order: Vec<CellIndex> = cells.iter().copied().collect();
    order.sort_unstable();
    let mut blocks = Vec::new();
    for low in order {
        if !cells.contains(&low) {
            continue;
        }
        let mut block = Block { low, high: low.map(|v| v + 1) };
        for &axis in axes {
            while layer(&block, axis).all(|cell| cells.contains(&cell)) {
                block.high[axis] += 1;
            }
        }
        inside(block.low, block.high).for_each(|cell| {
            cells.remove(&cell);
        });
        blocks.push(block);
    }
    blocks
}

/// The cells beyond the upper face of a block.
fn layer(block: &Block, axis: usize) -> impl Iterator<Item = CellIndex> {
    let (mut low, mut high) = (block.low, block.high);
    (low[axis], high[axis]) = (high[axis], high[axis] + 1);
    inside(low, high)
}

fn inside(low: CellIndex, high: CellIndex) -> impl Iterator<Item = CellIndex> {
    let [x, y, z] = [0, 1, 2].map(|axis| low[axis]..high[axis]);
    x.flat_map(move |i| {
        let z = z.clone();
        y.clone().flat_map(move |j| z.clone().map(move |k| [i, j, k]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn leaps_are_told_by_the_frame() {
        let at = |x: f64| Pose { translation: DVec3::new(x, 0.0, 0.0), ..Pose::IDENTITY };
        let egos = [at(0.0), at(100.0), at(200.0)];
        let said = leaps("drive", &[0, 1, 2], &egos).unwrap();
        assert!(said.is_doubt());
        assert_holds!(said, "moves 100 m from frame to frame");
        // Every tenth frame of a drive is no leap, nor is one gap.
        assert_eq!(leaps("drive", &[0, 10, 20], &egos), None);
        assert_eq!(leaps("drive", &[0, 1, 2, 3], &[at(0.0), at(1.0), at(2.0), at(400.0)]), None);
    }

    #[test]
    fn vehicles_that_climb_are_doubted() {
        let at = |x: f64, z: f64| Pose { translation: DVec3::new(x, 0.0, z), ..Pose::IDENTITY };
        let way = |x: f64, z: f64| -> Vec<Pose> {
            (0..3).map(|k| at(x * f64::from(k), z * f64::from(k))).collect()
        };
        let said = upwards("drive", &way(0.1, 1.0)).unwrap();
        assert!(said.is_doubt());
        assert_holds!(said, "moves 84 degrees up or down over 2");
        assert_eq!(upwards("drive", &way(1.0, 0.4)), None);
        // A vehicle at rest, and one step of noise.
        assert_eq!(upwards("drive", &way(0.0, 0.1)), None);
        assert_eq!(upwards("drive", &[at(0.0, 0.0), at(0.0, 1.0)]), None);
    }

    /// Every cell lies in one block, and no block holds another cell.
    #[test]
    fn blocks_are_the_cells() {
        let mut state = 7_u32;
        let mut random = |most: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 16) % most) as i32
        };
        for axes in [&[1, 0][..], &[2, 1, 0]] {
            let cells: HashSet<CellIndex> =
                (0..400).map(|_| [random(9), random(9) - 4, random(5)]).collect();
            let blocks = merge(cells.clone(), axes);
            let held: Vec<CellIndex> = blocks.iter().flat_map(|b| inside(b.low, b.high)).collect();
            assert_eq!(held.len(), cells.len(), "{axes:?}");
            assert_eq!(held.into_iter().collect::<HashSet<_>>(), cells, "{axes:?}");
            assert!(blocks.len() < cells.len(), "{axes:?}");
            assert!(axes.contains(&2) || blocks.iter().all(|b| b.high[2] == b.low[2] + 1));
        }
        let full: HashSet<CellIndex> = inside([0, 0, 0], [3, 4, 5]).collect();
        assert_eq!(merge(full, &[2, 1, 0]), [Block { low: [0; 3], high: [3, 4, 5] }]);
    }
}
