//! Cells around the own vehicle, which of them are ground in a frame, and poles where rules on direct vision place them.
//!
//! A pole is an upright cylinder of 0.8 m by 0.3 m on the level z = 0 of the ego frame. Distances count from
//! the box around the body's outline to the axis of the pole, to the front, to the rear and to the sides.
//!
//! | standard | axes of the poles | source |
//! |---|---|---|
//! | R158 detection | 0.2, 0.6, 1.0 m behind; five across the width | 0.2–1 m, 0.8 m by 0.3 m: UNECE press release |
//! | R158 camera | 0.3, 1.9, 3.5 m behind; three across the width | 0.3–3.5 m: the same |
//! | FMVSS 111 | 0.3 m behind, ±1.52 m; 3.05 m, ±1.52 m; 6.1 m, 0 and ±1.52 m | S14.1.4, from memory |
//! | R159 | 0.8, 2.25, 3.7 m ahead; three across the width | 0.8–3.7 m, from memory |
//! | R151 | 0.9, 2.5, 4.25 m beside, both sides; front, middle, rear | 0.9–4.25 m, from memory |

use glam::DVec3;
use serde::Serialize;

use super::{Footprint, WheelPlane};
use crate::bvh::Hit;
use crate::cast::{cast_frame_closest, closest_hit_in};
use crate::geom::Pose;
use crate::maths;
use crate::problem::{Frame, Instance, SensorBatch};
use crate::vehicle::{BeamTable, FARTHEST_GROUND};

/// Metres from a cell's centre, counted level, within which a hit sees it.
pub(crate) const CLOSE: f64 = 0.5;
/// Longest side of a body in metres.
pub(super) const MOST_BODY: f64 = 50.0;
/// Edge of a cell in metres.
pub(crate) const CELL: f64 = 0.25;
/// Metres around the own body that the near field reaches.
pub(crate) const NEAR: f64 = FARTHEST_GROUND;
/// Metres around the own body of the inner ring.
pub(crate) const RING: f64 = 3.0;
/// Height in metres above the wheel plane from which ground is looked for, downwards, and as far below it.
const HEIGHT: f64 = 2.0;
/// Metres to the highest surface that may enclose a cell.
const SKY: f64 = 100.0;
/// Surfaces above a cell that are counted.
const MOST_ABOVE: usize = 64;
/// Share of coordinates by which boxes in plan are larger, for rounding.
const ROOM: f64 = 1e-4;
/// Metres by which a cast begins behind the surface that the one before ended at.
const STEP: f64 = 1e-3;

/// A square of ground: centre in the ego frame, and its distance from the body's outline, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    pub centre: [f64; 2],
    pub distance: f64,
}

/// The squares of a grid along the ego frame's axes whose centres lie outside a footprint and within
/// [`NEAR`] of its outline.
#[derive(Debug, Clone)]
pub(super) struct CellGrid {
    pub cells: Vec<Cell>,
    /// Grid coordinates of the first column and row.
    first: [i64; 2],
    shape: [usize; 2],
    /// Number of the cell at each place of the grid.
    numbers: Vec<Option<u32>>,
}

impl CellGrid {
    pub(super) fn around(footprint: &Footprint) -> Self {
        let [low, high] = footprint.bounds();
        let first = low.map(|v| ((v - NEAR) / CELL).floor() as i64);
        let shape = [0, 1].map(|k| (((high[k] + NEAR) / CELL).ceil() as i64 - first[k]) as usize);
        let mut this = Self { cells: Vec::new(), first, shape, numbers: Vec::new() };
        for i in 0..shape[0] {
            for j in 0..shape[1] {
                let centre = this.centre([i, j]);
                let distance = footprint.distance(centre);
                let is_near = distance > 0.0 && distance <= NEAR;
                this.numbers.push(is_near.then_some(this.cells.len() as u32));
                if is_near {
                    this.cells.push(Cell { centre, distance });
                }
            }
        }
        this
    }

    fn centre(&self, place: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|k| ((self.first[k] + place[k] as i64) as f64 + 0.5) * CELL)
    }

    /// Marks the cells whose centres lie within `radius` of a point; marks have an entry a cell.
    pub(super) fn mark_within(&self, point: [f64; 2], radius: f64, marks: &mut [bool]) {
        let range = |k: usize| {
            // Casts saturate: a point far away has an empty range.
            let bound = |v: f64| {
                let cell = (v / CELL).floor() as i64;
                cell.saturating_sub(self.first[k]).clamp(0, self.shape[k] as i64) as usize
            };
            bound(point[k] - radius)..(bound(point[k] + radius) + 1).min(self.shape[k])
        };
        for i in range(0) {
            for j in range(1) {
                let Some(number) = self.numbers[i * self.shape[1] + j] else { continue };
                let (number, [x, y]) = (number as usize, self.cells[number as usize].centre);
                // Most cells are seen by many beams, and looked at once.
                let is_close = || maths::hypot(x - point[0], y - point[1]) <= radius;
                if !marks[number] && is_close() {
                    marks[number] = true;
                }
            }
        }
    }

    /// The first surface straight down over each cell's centre from [`HEIGHT`] above the wheel plane, ego frame, metres;
    /// the wheel plane where there is none.
    pub(super) fn points(&self, frame: &Frame, wheels: &WheelPlane) -> Vec<DVec3> {
        let from = self.above(wheels);
        let down = vertical(frame, &from, -DVec3::Z, 2.0 * HEIGHT);
        let point = |(from, hit): (&DVec3, &Hit)| {
            *from - DVec3::Z * if hit.is_hit() { f64::from(hit.t) } else { HEIGHT }
        };
        from.iter().zip(&down).map(point).collect()
    }

    /// Numbers of the cells whose centres lie under or over bodies between two heights.
    pub(super) fn covered(&self, bodies: &Frame, [low, high]: [f64; 2]) -> Vec<usize> {
        let at = |&Cell { centre: [x, y], .. }: &Cell| DVec3::new(x, y, high + STEP);
        let from: Vec<DVec3> = self.cells.iter().map(at).collect();
        let hits = vertical(bodies, &from, -DVec3::Z, high - low + 2.0 * STEP);
        (0..).zip(hits).filter(|(_, hit)| hit.is_hit()).map(|(cell, _)| cell).collect()
    }

    /// Points [`HEIGHT`] above the wheel plane over the cells' centres.
    fn above(&self, wheels: &WheelPlane) -> Vec<DVec3> {
        let at = |&Cell { centre: [x, y], .. }: &Cell| DVec3::new(x, y, wheels.at([x, y]) + HEIGHT);
        self.cells.iter().map(at).collect()
    }

    /// True for each cell that is ground in a frame: the first surface straight down from [`HEIGHT`] above the wheel
    /// plane over its centre is ground. Ground inside a closed thing, under an odd number of its surfaces, does not
    /// count.
    pub(super) fn are_ground(
        &self,
        frame: &Frame,
        is_ground: &[bool],
        wheels: &WheelPlane,
    ) -> Vec<bool> {
        let from = self.above(wheels);
        let down = vertical(frame, &from, -DVec3::Z, 2.0 * HEIGHT);
        let on_ground = |hit: &Hit| hit.is_hit() && is_ground.get(hit.prim as usize) == Some(&true);
        let mut ground: Vec<bool> = down.iter().map(on_ground).collect();
        let start = |(k, hit): (usize, &Hit)| {
            let z = from[k].z - f64::from(hit.t) + STEP;
            (k, from[k].with_z(z))
        };
        let open = down.iter().enumerate().filter(|(k, _)| ground[*k]);
        let mut open: Vec<(usize, DVec3)> = open.map(start).collect();
        for _ in 0..MOST_ABOVE {
            let from: Vec<DVec3> = open.iter().map(|(_, from)| *from).collect();
            let hits = vertical(frame, &from, DVec3::Z, SKY);
            let mut above = Vec::new();
            for ((k, from), hit) in open.into_iter().zip(hits).filter(|(_, hit)| hit.is_hit()) {
                ground[k] ^= is_ground.get(hit.prim as usize) != Some(&true);
                above.push((k, from + DVec3::Z * (f64::from(hit.t) + STEP)));
            }
            open = above;
        }
        ground
    }
}

/// Closest hits of vertical beams in a frame; equally close ones of the lowest triangle.
fn vertical(frame: &Frame, from: &[DVec3], direction: DVec3, range: f64) -> Vec<Hit> {
    // A table of one unit direction is never refused.
    let Ok(table) = BeamTable::from_directions([direction], range) else { return Vec::new() };
    let mut hits = vec![Hit::none(table.range()); from.len()];
    for instance in frame.instances() {
        let Some([low, high]) = in_plan(instance) else { continue };
        let is_over =
            |at: &DVec3| (0..2).all(|axis| low[axis] <= at[axis] && at[axis] <= high[axis]);
        let over: Vec<usize> = (0..from.len()).filter(|&k| is_over(&from[k])).collect();
        let pose = |&k: &usize| Pose { translation: from[k], ..Pose::IDENTITY };
        let poses: Vec<Pose> = over.iter().map(pose).collect();
        let alone = Frame::new([instance.clone()]);
        let found = cast_frame_closest(&poses, &table, &alone, table.range());
        for (k, found) in over.into_iter().zip(found).filter(|(_, found)| found.is_hit()) {
            let hit = &mut hits[k];
            if !hit.is_hit() || (found.t, found.prim) < (hit.t, hit.prim) {
                *hit = found;
            }
        }
    }
    hits
}

/// Corners of the box in plan around an instance, with room for rounding, metres; `None` without triangles.
pub(super) fn in_plan(instance: &Instance) -> Option<[DVec3; 2]> {
    let bounds = instance.tree.bounds()?;
    let [from, to] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
    let corners = (0..8).map(|k| {
        let of = |axis: usize| if k >> axis & 1 == 0 { from[axis] } else { to[axis] };
        instance.ego_from_instance.apply(DVec3::new(of(0), of(1), of(2)))
    });
    let corners: Vec<DVec3> = corners.collect();
    let low = corners.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let room = 0.01 + ROOM * low.abs().max(high.abs()).max_element();
    Some([low - room, high + room])
}

/// Height of a pole in metres.
const POLE_HEIGHT: f64 = 0.8;
/// Radius of a pole in metres.
const POLE_RADIUS: f64 = 0.15;
/// Least beams on a pole that is seen.
const POLE_BEAMS: u32 = 5;

/// A rule that says where something must be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Standard {
    /// UN R158, devices for reversing: zone of detection systems.
    #[serde(rename = "R158 detection")]
    R158Detection,
    /// UN R158, close-proximity rear view of cameras.
    #[serde(rename = "R158 camera")]
    R158Camera,
    /// FMVSS 111, rear visibility: test objects A to G.
    #[serde(rename = "FMVSS 111")]
    Fmvss111,
    /// UN R159, moving off: in front.
    #[serde(rename = "R159")]
    R159,
    /// UN R151, blind spot at the side.
    #[serde(rename = "R151")]
    R151,
}

impl Standard {
    /// Every standard and its name.
    pub const ALL: [(Self, &str); 5] = [
        (Self::R158Detection, "R158 detection"),
        (Self::R158Camera, "R158 camera"),
        (Self::Fmvss111, "FMVSS 111"),
        (Self::R159, "R159"),
        (Self::R151, "R151"),
    ];

    /// Axes of its poles around a footprint, metres in the ego frame.
    pub fn poles(self, footprint: &Footprint) -> Vec<[f64; 2]> {
        let ([low, high], [x, y]) = (footprint.bounds(), footprint.middle());
        let across = |count: usize| -> Vec<f64> {
            let step = (high[1] - low[1]) / (count - 1) as f64;
            (0..count).map(|k| low[1] + step * k as f64).collect()
        };
        let behind = |distances: &[f64], ys: &[f64]| grid(distances.iter().map(|d| low[0] - d), ys);
        match self {
            Self::R158Detection => behind(&[0.2, 0.6, 1.0], &across(5)),
            Self::R158Camera => behind(&[0.3, 1.9, 3.5], &across(3)),
            Self::Fmvss111 => {
                let sides = [y - 1.52, y + 1.52];
                let mut poles = behind(&[0.3, 3.05, 6.1], &sides);
                poles.push([low[0] - 6.1, y]);
                poles
            }
            Self::R159 => grid([0.8, 2.25, 3.7].map(|d| high[0] + d).into_iter(), &across(3)),
            Self::R151 => {
                let ys = [0.9, 2.5, 4.25].into_iter().flat_map(|d| [low[1] - d, high[1] + d]);
                grid([low[0], x, high[0]].into_iter(), &ys.collect::<Vec<_>>())
            }
        }
    }
}

fn grid(xs: impl Iterator<Item = f64>, ys: &[f64]) -> Vec<[f64; 2]> {
    xs.flat_map(|x| ys.iter().map(move |&y| [x, y])).collect()
}

/// A pole and the beams on it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pole {
    /// The rule that it is of.
    pub standard: Standard,
    /// Its axis in the ego frame, metres.
    pub at: [f64; 2],
    /// Beams on it, by LiDAR.
    pub beams: Vec<u32>,
    /// True if [`POLE_BEAMS`] or more of all LiDARs together are.
    pub seen: bool,
}

/// Every pole of every standard with the beams on it, each pole alone on level ground with the own body.
pub(super) fn count(
    footprint: &Footprint,
    batch: &SensorBatch<'_>,
    ego_from_sensors: &[Pose],
    body: &Frame,
) -> Vec<Pole> {
    let standing = |(standard, _): (Standard, _)| {
        standard.poles(footprint).into_iter().map(move |at| (standard, at))
    };
    let all = Standard::ALL.into_iter().flat_map(standing);
    let counted = all.map(|(standard, at)| {
        let beams = ego_from_sensors.iter().enumerate().map(|(k, pose)| {
            let (directions, range) = (batch.table(k).directions(), batch.range(k));
            let is_on = |direction: &&[f32; 3]| is_on(pose, **direction, range, at, body);
            directions.iter().filter(is_on).count() as u32
        });
        let beams: Vec<u32> = beams.collect();
        let seen = beams.iter().sum::<u32>() >= POLE_BEAMS;
        Pole { standard, at, beams, seen }
    });
    counted.collect()
}

/// True if a beam ends at a pole.
fn is_on(pose: &Pose, direction: [f32; 3], range: f32, at: [f64; 2], body: &Frame) -> bool {
    let along = pose.rotation * DVec3::from(direction.map(f64::from));
    distance(pose.translation, along, at).is_some_and(|t| {
        t <= f64::from(range) && !closest_hit_in(body, pose, direction, t as f32).is_hit()
    })
}

/// Metres along a beam to a pole; `None` where it passes, or begins inside.
pub(super) fn distance(from: DVec3, along: DVec3, [x, y]: [f64; 2]) -> Option<f64> {
    let (to, flat) = (from - DVec3::new(x, y, 0.0), along.truncate());
    let (a, b) = (flat.length_squared(), to.truncate().dot(flat));
    let c = to.truncate().length_squared() - POLE_RADIUS * POLE_RADIUS;
    let inside = b * b - a * c;
    if c <= 0.0 && (0.0..=POLE_HEIGHT).contains(&to.z) {
        return None;
    }
    let side = (a > 0.0 && inside >= 0.0).then(|| (-b - inside.sqrt()) / a);
    let height = |t: f64| to.z + t * along.z;
    let side = side.filter(|&t| t >= 0.0 && (0.0..=POLE_HEIGHT).contains(&height(t)));
    let top = (along.z < 0.0).then(|| (POLE_HEIGHT - to.z) / along.z);
    let is_on_top = |t: f64| (to + along * t).truncate().length() <= POLE_RADIUS;
    side.or(top.filter(|&t| t >= 0.0 && is_on_top(t)))
}
