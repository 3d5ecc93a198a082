//! The reference of all settings: casting, coverage and sums with an `f64` for every number.

use glam::DVec3;
use rayon::prelude::*;

use super::{ChartError, ChartWorld, SceneDetail, merge_vertices};
use crate::bvh::{Bvh, BvhNode, Triangle};
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

/// Metres by which rounding may move the entry or exit of a ray at a box.
const SLACK: f64 = 1e-9;

/// Triangles under the boxes of a [`Bvh`], which hold them exactly; the way down and both tests are in `f64` and share
/// no code with [`crate::cast`].
#[derive(Debug, Clone)]
pub(super) struct ExactTree(Bvh);

impl ExactTree {
    pub(super) fn build(soup: &TriangleSoup) -> Self {
        Self(Bvh::build(soup, 0.0))
    }

    /// Metres along the unit `direction` to the closest triangle with 0 < t ≤ `range`.
    pub(super) fn closest(&self, origin: DVec3, direction: DVec3, range: f64) -> Option<f64> {
        let Self(Bvh { nodes, triangles, .. }) = self;
        let inverse = direction.recip();
        let (mut best, mut limit) = (None, range);
        let enters = |index: usize, limit: f64| {
            let entered = enter(nodes.get(index)?, origin, inverse, limit)?;
            Some((entered, index))
        };
        // Nodes to visit and the ray's entry into them, the nearest last.
        let mut stack = Vec::with_capacity(64);
        stack.extend(enters(0, limit));
        while let Some((entered, index)) = stack.pop() {
            if entered > limit + SLACK {
                continue;
            }
            let (first, count) = (nodes[index].first as usize, nodes[index].count as usize);
            if count == 0 {
                let [left, right] = [first, first + 1].map(|child| enters(child, limit));
                let is_right_near = matches!((left, right), (Some(l), Some(r)) if r.0 < l.0);
                let order = if is_right_near { [left, right] } else { [right, left] };
                stack.extend(order.into_iter().flatten());
                continue;
            }
            for triangle in &triangles[first..first + count] {
                if let Some(t) = meet(triangle, origin, direction)
                    && t > 0.0
                    && t <= limit
                {
                    limit = t;
                    best = Some(t);
                }
            }
        }
        best
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.0.triangles.len()
    }

    pub(super) fn bytes(&self) -> u64 {
        self.0.bytes()
    }
}

/// Entry of the ray into the box, if it is somewhere in 0 ≤ t ≤ `limit`; rounding and 0 · ∞ only add visits.
fn enter(node: &BvhNode, origin: DVec3, inverse: DVec3, limit: f64) -> Option<f64> {
    let (mut enter, mut leave) = (0.0_f64, limit);
    for axis in 0..3 {
        let a = (f64::from(node.min[axis]) - origin[axis]) * inverse[axis];
        let b = (f64::from(node.max[axis]) - origin[axis]) * inverse[axis];
        // 0 · ∞ is no bound: a ray within a face's plane is not turned away. Comparisons take half the time of
        // `f64::max` and `min`.
        let (near, far) = if a > b { (b, a) } else { (a, b) };
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    (enter <= leave + SLACK).then_some(enter)
}

/// Metres to the triangle if the ray's line meets it (Möller, Trumbore 1997).
fn meet(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
    let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|v| DVec3::from(v.map(f64::from)));
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
    let u = s.dot(p) / det;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(e1);
    let v = direction.dot(q) / det;
    (v >= 0.0 && u + v <= 1.0).then(|| e2.dot(q) / det)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

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

    #[test]
    fn the_tree_finds_what_all_triangles_give() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut soup = TriangleSoup::default();
        for face in 0..500_u32 {
            let centre = [0; 3].map(|_| rng.random_range(-10.0_f32..10.0));
            for _ in 0..3 {
                soup.vertices.push(centre.map(|c| c + rng.random_range(-1.0_f32..1.0)));
            }
            soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
            soup.face_class.push(0);
        }
        let tree = ExactTree::build(&soup);
        let mut hits = 0;
        for _ in 0..2000 {
            let mut vector = || DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
            let (origin, direction) = (vector() * 5.0, vector().normalize());
            let all = tree.0.triangles.iter().filter_map(|t| meet(t, origin, direction));
            let want = all.filter(|t| *t > 0.0 && *t <= 12.0).min_by(f64::total_cmp);
            assert_eq!(tree.closest(origin, direction, 12.0), want);
            hits += usize::from(want.is_some());
        }
        assert!(hits > 200, "only {hits} hits");
        assert_eq!(
            ExactTree::build(&TriangleSoup::default()).closest(DVec3::ZERO, DVec3::X, 1.0),
            None
        );
    }
    #[test]
    fn a_ray_in_the_plane_of_a_box_face_meets_what_ends_there() {
        let vertices = vec![[5.0, 0.0, 0.0], [5.0, 1.0, 0.0], [5.0, 0.0, 1.0]];
        let soup = TriangleSoup { vertices, faces: vec![[0, 1, 2]], face_class: vec![0] };
        let tree = ExactTree::build(&soup);
        let hit = |y: f64| tree.closest(DVec3::new(0.0, y, 0.5), DVec3::X, 9.0);
        assert_eq!([-0.1, 0.0, 0.1].map(hit), [None, Some(5.0), Some(5.0)]);
    }
}
