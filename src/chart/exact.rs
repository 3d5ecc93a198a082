//! The reference of all settings: casting, coverage and sums with an `f64` for every number.

use glam::DVec3;
use rayon::prelude::*;

use super::exact_tree::ExactTree;
use super::{ChartError, ChartWorld, SceneDetail, merge_vertices};
use crate::geom::TriangleSoup;
use crate::maths;
use crate::problem::{Content, Entropy, KINDS, Tally, content_of};
use crate::psog::{ENTROPY_ONE, EntropyKind, EntropyTable, Psog, Roi};
use crate::scene::{EgoBody, Ground, Scene};
use crate::vehicle::{Lidar, Placement, SensorPose, Sensors, UnknownSensor};
use lidar_cast::grid::HIT_PUSH;

/// Numbers closer than this are meant to be one: direction components and zero (cos 90° is 6e-17), grid
/// coordinates and whole numbers, metres at which a beam crosses planes (cos 45° and sin 45° differ in
/// the last digit).
const ROUNDING: f64 = 1e-9;

/// The scorer that others are compared with: every number from the pose to the sum is an `f64`.
///
/// Casting, walking and summing are written for themselves and share no code with the backends but the build of trees.
/// Triangles are those of [`Scene::frame`], which rounds corners to `f32` once (4 µm at 50 m).
#[derive(Debug, Clone)]
pub(super) struct Exact {
    roi: Roi,
    /// Where the models fire, and their names.
    sensors: Sensors,
    /// Directions of each model.
    directions: Vec<Vec<DVec3>>,
    /// Range of each model in metres.
    ranges: Vec<f64>,
    /// Number of each frame in the scene, at least one.
    numbers: Vec<usize>,
    /// One tree a frame; empty where beams run through all.
    frames: Vec<ExactTree>,
    /// The classes and totals that the tallies belong to.
    pub(super) content: Content,
    /// Linear index and information of the voxels occupied in some frame: entropies in nats (all classes,
    /// detection target against the rest, occupied or not) and the share of [`Entropy::Near`], in all 1.
    occupied: Vec<(u64, [f64; KINDS])>,
}

/// The parts of a scene in their poses of a frame, in the ego frame.
fn standing(parts: &[TriangleSoup], scene: &Scene, t: usize) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    for (part, pose) in parts.iter().zip(scene.part_poses(t)) {
        let mut part = part.clone();
        for vertex in &mut part.vertices {
            *vertex = pose.apply(DVec3::from(vertex.map(f64::from))).as_vec3().to_array();
        }
        soup.append(&part);
    }
    soup
}

impl Exact {
    /// The scorer of a scene at a setting.
    pub(super) fn new(world: &mut ChartWorld, fidelity: &SceneDetail) -> Result<Self, ChartError> {
        let psog = world.psog(fidelity.voxel, &|| true)?.expect("nobody stops the scan");
        let scene = &*world.scene;
        let cell = fidelity.detail * psog.roi().voxel()[0];
        let frames = if fidelity.through { Vec::new() } else { world.frames(fidelity) };
        let numbers = if frames.is_empty() { vec![0] } else { frames.clone() };
        let lidars = scene.lidars();
        let merged = scene.parts(EgoBody::Include).filter(|_| cell > 0.0);
        let merged: Vec<_> = merged.map(|k| merge_vertices(&scene.part(k), cell)).collect();
        let trees = frames.into_par_iter().map(|t| {
            let whole = || scene.frame(t, EgoBody::Include);
            let soup = if merged.is_empty() { whole() } else { standing(&merged, scene, t) };
            ExactTree::build(&soup)
        });
        Ok(Self {
            roi: *psog.roi(),
            sensors: scene.thinned_sensors(fidelity.azimuth)?,
            directions: lidars.iter().map(|lidar| directions(lidar, fidelity.azimuth)).collect(),
            ranges: lidars.iter().map(|lidar| lidar.range()).collect(),
            numbers,
            frames: trees.collect(),
            occupied: occupied(scene, &psog),
            content: content_of(&psog, &scene.detection_among(psog.classes())),
        })
    }

    /// Frames over which a tally is summed.
    pub(super) fn frame_count(&self) -> usize {
        self.frames.len().max(1)
    }

    /// Tallies of `placements` in order, summed over frames, each entropy sum rounded once at the end.
    ///
    /// Counts by class, shares of single LiDARs and hits stay 0: no objective needs them.
    ///
    /// # Errors
    /// A LiDAR of a model that the vehicle does not have.
    pub(super) fn tallies(&self, placements: &[Placement]) -> Result<Vec<Tally>, UnknownSensor> {
        let words = self.roi.voxel_count().div_ceil(64) as usize;
        let tally = |bitmap: &mut Vec<u64>, placement: &Placement| {
            let models = placement.lidars.iter().map(|pose| self.sensors.number(pose));
            let models = models.collect::<Result<Vec<usize>, _>>()?;
            let mut tally = Tally::zero(self.content.set_count(), placement.lidars.len());
            let mut entropy = [0.0; KINDS];
            for frame in 0..self.frame_count() {
                bitmap.fill(0);
                for (pose, &model) in placement.lidars.iter().zip(&models) {
                    self.cover(pose, model, frame, bitmap);
                }
                tally.covered += bitmap.iter().map(|w| u64::from(w.count_ones())).sum::<u64>();
                for (voxel, worth) in &self.occupied {
                    if bitmap[(voxel >> 6) as usize] >> (voxel & 63) & 1 == 1 {
                        tally.covered_nonzero += 1;
                        for (sum, h) in entropy.iter_mut().zip(worth) {
                            *sum += h;
                        }
                    }
                }
            }
            let beams: usize = models.iter().map(|&model| self.directions[model].len()).sum();
            tally.beams = (beams * self.frame_count()) as u64;
            let mut units = [ENTROPY_ONE; KINDS];
            units[Entropy::Near as usize] = Entropy::Near.of(&self.content.entropy_total()) as f64;
            tally.entropy =
                std::array::from_fn(|kind| (entropy[kind] * units[kind]).round() as u64);
            Ok(tally)
        };
        placements.par_iter().map_init(|| vec![0_u64; words], tally).collect()
    }

    /// Bytes of trees and entropies, and of the bitmap of one placement.
    pub(super) fn bytes(&self) -> u64 {
        let trees: u64 = self.frames.iter().map(ExactTree::bytes).sum();
        trees + size_of_val(self.occupied.as_slice()) as u64 + self.roi.voxel_count().div_ceil(8)
    }

    /// Triangles, a mean over frames.
    pub(super) fn triangles(&self) -> u64 {
        let all: usize = self.frames.iter().map(ExactTree::triangle_count).sum();
        (all / self.frame_count()) as u64
    }

    /// Marks the voxels that the beams of a LiDAR traverse in a frame, up to and including the voxel of their hit.
    fn cover(&self, pose: &SensorPose, model: usize, frame: usize, bitmap: &mut [u64]) {
        let pose = self.sensors.ego_from_sensor(model, pose, self.numbers[frame]);
        let (tree, range) = (self.frames.get(frame), self.ranges[model]);
        for &direction in &self.directions[model] {
            let direction = snapped(pose.rotation * direction);
            let hit = tree.and_then(|t| t.closest(pose.translation, direction, range));
            let end = hit.map_or(range, |t| t + HIT_PUSH);
            walk(&self.roi, pose.translation, direction, end, |v| bitmap[v >> 6] |= 1 << (v & 63));
        }
    }
}

fn snapped(direction: DVec3) -> DVec3 {
    DVec3::from(direction.to_array().map(|d| if d.abs() < ROUNDING { 0.0 } else { d }))
}

/// Unit directions in the sensor frame; see [`crate::vehicle::BeamTable::spinning`].
fn directions(lidar: &Lidar, divisor: u32) -> Vec<DVec3> {
    let lidar = lidar.thinned(divisor);
    let sector = lidar.sector();
    match &lidar {
        Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps: steps, .. } => {
            let channels = elevations.iter().zip(azimuth_offsets);
            let beams = channels.flat_map(|(elevation, offset)| {
                let (sin_e, cos_e) = maths::sin_cos(elevation.to_radians());
                (0..*steps).map(move |j| {
                    let turn = match sector {
                        Some([start, step]) => (start + step * f64::from(j)).to_radians(),
                        None => std::f64::consts::TAU * f64::from(j) / f64::from(*steps),
                    };
                    let (sin_a, cos_a) = maths::sin_cos(turn + offset.to_radians());
                    DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e)
                })
            });
            beams.collect()
        }
        Lidar::Directions { directions, .. } => {
            directions.iter().map(|&d| DVec3::from(d)).collect()
        }
    }
}

fn occupied(scene: &Scene, psog: &Psog) -> Vec<(u64, [f64; KINDS])> {
    let table = EntropyTable::new(psog.frames());
    let targets = scene.detection_among(psog.classes());
    let rows = psog.index().iter().zip(psog.rows());
    // The first of the most frequent classes.
    let commonest =
        |row: &[u16]| row.iter().position(|count| row.iter().all(|c| c <= count)).unwrap_or(0);
    let (ny, nz) = (u64::from(psog.roi().shape()[1]), u64::from(psog.roi().shape()[2]));
    let (min, edge) = (psog.roi().min(), psog.roi().voxel());
    let plan = |index: u64| {
        let x = min[0] + (index / (ny * nz)) as f64 * edge[0] + edge[0] / 2.0;
        let y = min[1] + (index / nz % ny) as f64 * edge[1] + edge[1] / 2.0;
        (x * x + y * y).sqrt()
    };
    let near = |index: u64| ((80.0 / plan(index)).round().clamp(1.0, 8.0)) / 8.0;
    let is_floor = |index: u64, row: &[u16]| {
        let name = &psog.classes()[commonest(row)];
        let is_occupied = row.iter().any(|&count| count > 0);
        is_occupied && Ground::of(name).is_some() && plan(index) <= 10.0
    };
    let all = || psog.index().iter().copied().zip(psog.rows());
    let told: f64 =
        all().map(|(index, row)| table.entropy(row, EntropyKind::Segmentation) * near(index)).sum();
    let floor = all().filter(|(index, row)| is_floor(*index, row)).count() as f64;
    let whole: f64 = if told > 0.0 { 1.0 } else { 0.0 } + if floor > 0.0 { 0.25 } else { 0.0 };
    let worth = |index: u64, row: &[u16]| {
        let target = targets.iter().map(|&c| row[usize::from(c)]).sum();
        let all: u16 = row.iter().sum();
        let merged = [target, all - target];
        let entropy = table.entropy(row, EntropyKind::Segmentation);
        let of_floor = if is_floor(index, row) { 0.25 / floor } else { 0.0 };
        [
            entropy,
            table.entropy(&merged, EntropyKind::Segmentation),
            table.entropy(row, EntropyKind::Bernoulli),
            (entropy * near(index) / told.max(f64::MIN_POSITIVE) + of_floor) / whole.max(0.25),
        ]
    };
    let some = rows.filter(|(_, row)| row.iter().any(|&count| count > 0));
    some.map(|(&index, row)| (index, worth(index, row))).collect()
}

/// Calls `mark` with the linear index of every voxel that the beam traverses for 0 ≤ t ≤ `end`.
///
/// Crossings that coincide are taken at once, and a crossing at the very start or end counts.
fn walk(roi: &Roi, origin: DVec3, direction: DVec3, end: f64, mut mark: impl FnMut(usize)) {
    let shape = roi.shape().map(i64::from);
    let (min, voxel) = (roi.min(), roi.voxel());
    let p = [0, 1, 2].map(|a| {
        let p = (origin[a] - min[a]) / voxel[a];
        if (p - p.round()).abs() < ROUNDING { p.round() } else { p }
    });
    // When the beam crosses plane i of an axis; a level beam never does.
    let along = [0, 1, 2].map(|a| if direction[a] == 0.0 { 0.0 } else { voxel[a] / direction[a] });
    let crossing = |a: usize, i: i64| match along[a] {
        0.0 => f64::INFINITY,
        along => (i as f64 - p[a]) * along,
    };
    let mut enter = 0.0_f64;
    for a in 0..3 {
        if direction[a] >= 0.0 && p[a] >= shape[a] as f64 || direction[a] <= 0.0 && p[a] < 0.0 {
            return;
        }
        if p[a] < 0.0 {
            enter = enter.max(crossing(a, 0));
        } else if p[a] >= shape[a] as f64 {
            enter = enter.max(crossing(a, shape[a]));
        }
    }
    if enter > end {
        return;
    }
    let forward = [0, 1, 2].map(|a| direction[a] >= 0.0);
    // Plane ahead of a voxel.
    let ahead = |a: usize, i: i64| crossing(a, if forward[a] { i + 1 } else { i });
    let step = forward.map(|f| if f { 1 } else { -1 });
    let mut cell = [0, 1, 2].map(|a| {
        // One voxel too early at most; then on to the one after every crossing up to `enter`.
        let guess = (p[a] + enter * direction[a] / voxel[a]).floor() as i64;
        let mut i = guess - step[a];
        while ahead(a, i) <= enter + ROUNDING {
            i += step[a];
        }
        if direction[a] == 0.0 { guess } else { i }
    });
    let mut next = [0, 1, 2].map(|a| ahead(a, cell[a]));
    while (0..3).all(|a| (0..shape[a]).contains(&cell[a])) {
        mark(((cell[0] * shape[1] + cell[1]) * shape[2] + cell[2]) as usize);
        let t = next[0].min(next[1]).min(next[2]);
        if t > end {
            return;
        }
        for a in 0..3 {
            if next[a] <= t + ROUNDING {
                cell[a] += step[a];
                next[a] = ahead(a, cell[a]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(origin: [f64; 3], direction: [f64; 3], end: f64) -> Vec<[u32; 3]> {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 4, 4]).unwrap();
        let mut seen = Vec::new();
        let direction = DVec3::from(direction).normalize();
        walk(&roi, origin.into(), direction, end, |v| seen.push(roi.coords(v as u64)));
        seen
    }

    #[test]
    fn a_beam_walks_as_the_definition_says() {
        let row = [[0, 1, 2], [1, 1, 2], [2, 1, 2], [3, 1, 2]];
        assert_eq!(cells([0.5, 1.5, 2.5], [1.0, 0.0, 0.0], 100.0), row);
        assert_eq!(cells([0.5, 1.0, 2.0], [1.0, 0.0, 0.0], 100.0), row);
        assert_eq!(cells([-2.0, 1.5, 2.5], [1.0, 0.0, 0.0], 3.5), row[..2]);
        assert!(cells([-2.0, 1.5, 2.5], [-1.0, 0.0, 0.0], 100.0).is_empty());
        assert!(cells([-2.0, 4.0, 2.5], [1.0, 0.0, 0.0], 100.0).is_empty());
        // Going back from a face leaves the voxel above it at once.
        assert_eq!(cells([2.0, 0.5, 0.5], [-1.0, 0.0, 0.0], 9.0), [[1, 0, 0], [0, 0, 0]]);
        assert_eq!(
            cells([3.5, 3.5, 1.5], [-1.0, -1.0, 0.0], 100.0),
            [[3, 3, 1], [2, 2, 1], [1, 1, 1], [0, 0, 1]]
        );
        // At 45° through edges, from inside and from outside, where cos and sin differ by rounding.
        let (sin, cos) = std::f64::consts::FRAC_PI_4.sin_cos();
        assert_ne!(sin, cos);
        let diagonal = [[0, 0, 1], [1, 1, 1], [2, 2, 1], [3, 3, 1]];
        assert_eq!(cells([0.3, 0.3, 1.5], [cos, sin, 0.0], 100.0), diagonal);
        assert_eq!(cells([-1.7, -1.7, 1.5], [cos, sin, 0.0], 100.0), diagonal);
        assert_eq!(cells([0.5, 0.5, 0.5], [0.0, 1.0, 0.0], 1.5), [[0, 0, 0], [0, 1, 0], [0, 2, 0]]);
        assert_eq!(cells([0.5, 0.5, 0.5], [0.0, 1.0, 0.0], 1.4999), [[0, 0, 0], [0, 1, 0]]);
    }
}
