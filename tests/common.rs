//! Random small problems and what several tests share.

pub(crate) use std::sync::Arc;

pub(crate) use glam::{DVec3, Vec3};
pub(crate) use lidar_cast::bvh::{Bvh, Hit};
use lidar_cast::task::KINDS;
pub(crate) use rand::RngExt;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
#[cfg(feature = "gpu")]
use sightline::engine::gpu::GpuBackend;
pub(crate) use sightline::engine::{Backend, CpuBackend};
pub(crate) use sightline::geom::TriangleSoup;
pub(crate) use sightline::problem::{Content, OccupiedVoxel, Problem, Task};
pub(crate) use sightline::psog::Roi;
pub(crate) use sightline::vehicle::{BeamTable, Constraints, Placement, SensorPose};

/// Memory that a test backend may use.
pub(crate) const MEMORY: u64 = 1 << 30;

pub(crate) fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub(crate) fn random_vec(rng: &mut impl Rng, half: f32) -> Vec3 {
    Vec3::from([0; 3].map(|_| rng.random_range(-half..half)))
}

/// Triangles of mixed size scattered over a cube of half extent `half` metres.
pub(crate) fn random_soup(seed: u64, triangles: usize, half: f32) -> TriangleSoup {
    let mut rng = rng(seed);
    let mut soup = TriangleSoup::default();
    for face in 0..triangles as u32 {
        let centre = random_vec(&mut rng, half);
        let size = half * rng.random_range(0.05_f32..0.6);
        for _ in 0..3 {
            soup.vertices.push((centre + random_vec(&mut rng, size)).to_array());
        }
        soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
        soup.face_class.push((face % 3) as u16);
    }
    soup
}

pub(crate) fn random_placements(seed: u64, count: usize, half: f64) -> Vec<Placement> {
    let mut rng = rng(seed);
    (0..count)
        .map(|index| Placement {
            name: format!("random-{index}"),
            lidars: (0..1 + index % 4)
                .map(|_| SensorPose {
                    x: rng.random_range(-half..half),
                    y: rng.random_range(-half..half),
                    z: rng.random_range(-half..half),
                    roll: rng.random_range(-0.3..0.3),
                    pitch: rng.random_range(-0.3..0.3),
                    yaw: rng.random_range(-3.0..3.0),
                    ..SensorPose::default()
                })
                .collect(),
        })
        .collect()
}

/// A quarter of the voxels occupied, with arbitrary entropies, in three classes.
pub(crate) fn random_content(seed: u64, roi: &Roi) -> Content {
    let mut rng = rng(seed);
    let mut occupied = Vec::new();
    let mut by_class = vec![Vec::new(); 3];
    for index in 0..roi.voxel_count() as u32 {
        if rng.random_bool(0.25) {
            let entropy = [0; KINDS].map(|_| rng.random_range(0..3_u32 << 28));
            occupied.push(OccupiedVoxel { index, entropy });
            by_class[rng.random_range(0..3_usize)].push(index);
            if rng.random_bool(0.1) {
                by_class[0].push(index);
            }
        }
    }
    for voxels in &mut by_class {
        voxels.dedup();
    }
    Content::new(["a", "b", "c"].map(String::from).to_vec(), occupied, &by_class, true)
}

/// A 24 × 20 × 13 grid around the origin with two frames of random triangles.
pub(crate) fn random_problem(seed: u64, ends_at_hits: bool) -> Arc<Problem> {
    let roi = Roi::new([-6.0, -5.0, -3.25], [0.5, 0.5, 0.5], [24, 20, 13]).expect("a valid grid");
    let channels: Vec<(f64, f64)> = (0..7).map(|k| (-30.0 + 10.0 * f64::from(k), 0.3)).collect();
    let table = BeamTable::spinning(&channels, 45, 12.0).expect("a valid sensor");
    let frames: Vec<_> =
        (0..2).map(|t| Arc::new(Bvh::build(&random_soup(seed + t, 300, 6.0), 12.0))).collect();
    let content = random_content(seed + 2, &roi);
    Arc::new(Problem::from(Task::new(roi, content, table, frames, ends_at_hits)))
}

pub(crate) fn cpu(problem: &Arc<Problem>) -> CpuBackend {
    CpuBackend::new(problem.task().clone(), MEMORY)
}

#[cfg(feature = "gpu")]
/// The GPU backend; a machine without any Vulkan device fails the test, because GPU tests that skip
/// themselves check nothing.
pub(crate) fn gpu(problem: &Arc<Problem>) -> GpuBackend {
    GpuBackend::new(problem.task().clone(), None, MEMORY).expect("a Vulkan device: see the README")
}

/// All engines but the reference.
pub(crate) fn engines(problem: &Arc<Problem>) -> Vec<Box<dyn Backend>> {
    vec![
        Box::new(cpu(problem)),
        #[cfg(feature = "gpu")]
        Box::new(gpu(problem)),
    ]
}

/// Hits as numbers that are equal where every bit is.
pub(crate) fn bits(hits: &[Hit]) -> Vec<(u32, u32)> {
    hits.iter().map(|h| (h.t.to_bits(), h.prim)).collect()
}

#[cfg(feature = "gpu")]
pub(crate) fn both(problem: &Arc<Problem>) -> [Box<dyn Backend>; 2] {
    [Box::new(cpu(problem)), Box::new(gpu(problem))]
}

/// The problem with other rules of the mount.
pub(crate) fn mounted(problem: &Problem, rules: &Constraints) -> Arc<Problem> {
    Arc::new(problem.clone().with_constraints(rules.clone()))
}
