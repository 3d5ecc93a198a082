//! Surfaces and directions that pairs of LiDARs share, and whether pairs connect all LiDARs, for calibration.

use glam::DVec3;
use lidar_cast::grid::HIT_PUSH;
use serde::Serialize;

use super::field_of_view::{FieldOfView, shared_directions};
use crate::engine::{Backend, BackendError};
use crate::near_field::{place, returned_hits};
use crate::problem::{Problem, SensorBatch};
use crate::scene::{EgoBody, Scene};
use crate::vehicle::{Placement, SensorName};

/// Least mean number of surface voxels that a pair must share to be calibrated against each other, where none is said.
pub const LEAST_SHARED: u64 = 500;

/// Why pairs of a placement cannot be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OverlapError {
    /// Fewer than two LiDARs.
    #[error(
        "placement `{placement}`: has {count} LiDAR(s), and overlap is between two; add a second LiDAR"
    )]
    OneLidar {
        /// Name of the placement.
        placement: String,
        /// Its LiDARs.
        count: usize,
    },
    /// Beams that end at no surface.
    #[error(
        "{scene}: beams end at nothing, so that no two LiDARs have a surface in common; give the scene geometry and \
         \"coverage\": \"first-hit\""
    )]
    NoHits {
        /// File of the scene, or its name.
        scene: String,
    },
    /// Casting failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
}

/// Two LiDARs of a placement, and the surface voxels that they share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SharedPair {
    /// Positions of the LiDARs in the placement, the lower first.
    pub lidars: [usize; 2],
    /// Voxels, a mean over frames.
    pub voxels: f64,
}

/// Pairs of a placement's LiDARs in a scene. Matrices are `[lidars][lidars]` and symmetric.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Overlap {
    /// Name of the scene.
    pub scene: String,
    /// Name of the placement.
    pub placement: String,
    /// Model of each LiDAR.
    pub lidars: Vec<SensorName>,
    /// Frames averaged over.
    pub frames: usize,
    /// Voxels in which both LiDARs have a hit, a mean over frames; on the diagonal the voxels of each one's hits.
    pub shared_voxels: Vec<Vec<f64>>,
    /// Share of the sphere that lies in both fields of view; on the diagonal each one's own.
    pub shared_directions: Vec<Vec<f64>>,
    /// Least number of shared voxels of a pair that counts.
    pub least_shared: u64,
    /// True if pairs that count connect all LiDARs.
    pub connected: bool,
    /// Largest `least_shared` at which pairs would still connect all LiDARs; 0 where no number would.
    pub connected_up_to: f64,
    /// LiDARs that pairs that count connect, group by group; the largest first.
    pub groups: Vec<Vec<usize>>,
    /// LiDARs outside the largest group.
    pub cut_off: Vec<usize>,
    /// Pairs that connect as many LiDARs as any pairs do, each sharing as much as possible: from the strongest on.
    pub chain: Vec<SharedPair>,
}

impl Overlap {
    /// Looks at all pairs of a placement with an engine of the problem, which was made of the scene.
    ///
    /// # Errors
    /// Fewer than two LiDARs, beams that end at nothing, a sensor of a model that the vehicle does not have, or as
    /// [`Backend::hits`].
    pub fn new(
        scene: &Scene,
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
        least_shared: u64,
    ) -> Result<Self, OverlapError> {
        let count = placement.lidars.len();
        if count < 2 {
            let placement = placement.name.clone();
            return Err(OverlapError::OneLidar { placement, count });
        }
        if !problem.ends_at_hits() {
            return Err(OverlapError::NoHits { scene: place(scene) });
        }
        let batch =
            SensorBatch::new(problem, &placement.lidars, None).map_err(BackendError::from)?;
        let poses = batch.ego_from_sensors(0).into_iter().enumerate();
        let views = poses.map(|(k, pose)| (FieldOfView::of(batch.table(k)), pose));
        let shared_directions = shared_directions(&views.collect::<Vec<_>>());
        let own = scene.triangles(EgoBody::Exclude);
        let mut sums = vec![0_u64; count * count];
        for (frame, weight) in problem.distinct_frames() {
            for seen in surface_voxels(problem, engine, placement, (frame, own))?.chunk_by(same) {
                for (_, a) in seen {
                    seen.iter().for_each(|(_, b)| sums[a * count + b] += weight);
                }
            }
        }
        let frames = problem.frame_count();
        let mean = |&sum: &u64| sum as f64 / frames as f64;
        let shared_voxels: Vec<Vec<f64>> =
            sums.chunks(count).map(|row| row.iter().map(mean).collect()).collect();
        let groups = groups(&shared_voxels, least_shared as f64);
        let chain = chain(&shared_voxels);
        let weakest = chain.last().filter(|_| chain.len() + 1 == count);
        Ok(Self {
            scene: scene.name().to_owned(),
            placement: placement.name.clone(),
            lidars: (0..count).map(|k| batch.sensor_model(k).name).collect(),
            frames,
            shared_directions,
            least_shared,
            connected: groups.len() == 1,
            connected_up_to: weakest.map_or(0.0, |pair| pair.voxels),
            cut_off: groups[1..].concat(),
            groups,
            chain,
            shared_voxels,
        })
    }
}

fn same(a: &(u64, usize), b: &(u64, usize)) -> bool {
    a.0 == b.0
}

/// Voxels in which LiDARs have hits in a frame, with the LiDAR, in rising order and each once. Triangles from `own` on
/// are the own body's.
fn surface_voxels(
    problem: &Problem,
    engine: &mut dyn Backend,
    placement: &Placement,
    (frame, own): (usize, usize),
) -> Result<Vec<(u64, usize)>, BackendError> {
    let batch = SensorBatch::new(problem, &placement.lidars, None)?;
    let (poses, hits) = returned_hits(problem, engine, &placement.lidars, frame)?;
    let mut voxels = Vec::new();
    for (k, pose) in poses.iter().enumerate() {
        let beams = batch.table(k).directions().iter().zip(&hits[batch.beams_of(k)]);
        let on_surface = beams.filter(|(_, hit)| hit.is_hit() && (hit.prim as usize) < own);
        voxels.extend(on_surface.filter_map(|(direction, hit)| {
            let along = DVec3::from(direction.map(f64::from)) * (f64::from(hit.t) + HIT_PUSH);
            Some((problem.roi().voxel_of(pose.apply(along))?, k))
        }));
    }
    voxels.sort_unstable();
    voxels.dedup();
    Ok(voxels)
}

/// All pairs, those that share most first; of equal ones the lower LiDARs first.
fn pairs(shared: &[Vec<f64>]) -> Vec<SharedPair> {
    let mut pairs = Vec::new();
    for (a, row) in shared.iter().enumerate() {
        let above = row.iter().enumerate().skip(a + 1);
        pairs.extend(above.map(|(b, &voxels)| SharedPair { lidars: [a, b], voxels }));
    }
    pairs.sort_by(|a, b| b.voxels.total_cmp(&a.voxels));
    pairs
}

/// Pairs that join LiDARs which stronger pairs have not joined, and that share anything (Kruskal 1956).
fn chain(shared: &[Vec<f64>]) -> Vec<SharedPair> {
    let mut group: Vec<usize> = (0..shared.len()).collect();
    let joins = |pair: &SharedPair| {
        let [a, b] = pair.lidars.map(|lidar| group[lidar]);
        group.iter_mut().filter(|of| **of == b).for_each(|of| *of = a);
        a != b
    };
    pairs(shared).into_iter().filter(|pair| pair.voxels > 0.0).filter(joins).collect()
}

/// LiDARs that pairs of at least `least` shared voxels connect; the largest group first, of equal ones that of the
/// lowest LiDAR.
fn groups(shared: &[Vec<f64>], least: f64) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (lidar, row) in shared.iter().enumerate() {
        let is_joined = |group: &Vec<usize>| group.iter().any(|&other| row[other] >= least);
        let (joined, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(is_joined);
        let mut group = joined.concat();
        group.push(lidar);
        group.sort_unstable();
        groups = apart;
        groups.push(group);
    }
    groups.sort_by_key(|group| (std::cmp::Reverse(group.len()), group[0]));
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(count: usize, pairs: &[(usize, usize, f64)]) -> Vec<Vec<f64>> {
        let mut shared = vec![vec![0.0; count]; count];
        for &(a, b, voxels) in pairs {
            (shared[a][b], shared[b][a]) = (voxels, voxels);
        }
        shared
    }

    #[test]
    fn a_chain_connects_what_no_single_pair_does() {
        let shared =
            matrix(5, &[(0, 3, 900.0), (3, 1, 600.0), (0, 1, 500.0), (2, 4, 700.0), (1, 2, 80.0)]);
        assert_eq!(groups(&shared, 500.0), [vec![0, 1, 3], vec![2, 4]]);
        assert_eq!(groups(&shared, 80.0), [vec![0, 1, 2, 3, 4]]);
        assert_eq!(groups(&shared, 650.0), [vec![0, 3], vec![2, 4], vec![1]]);
        let chain = chain(&shared);
        let told: Vec<_> = chain.iter().map(|pair| (pair.lidars, pair.voxels)).collect();
        assert_eq!(told, [([0, 3], 900.0), ([2, 4], 700.0), ([1, 3], 600.0), ([1, 2], 80.0)]);
    }

    #[test]
    fn the_weakest_pair_of_the_chain_is_the_largest_number_that_connects() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let of = |a: usize| (a + 1..6).map(move |b| (a, b));
            let mut voxels = || f64::from(rng.random_range(0..40_u32)).max(8.0) - 8.0;
            let pairs = (0..6).flat_map(of).map(|(a, b)| (a, b, voxels()));
            let shared = matrix(6, &pairs.collect::<Vec<_>>());
            let connects = |least: u32| groups(&shared, f64::from(least)).len() == 1;
            let most = (1..40).rev().find(|&least| connects(least)).map_or(0.0, f64::from);
            let chain = chain(&shared);
            let weakest = chain.last().filter(|_| chain.len() == 5);
            assert_eq!(weakest.map_or(0.0, |pair| pair.voxels), most);
        }
    }
}
