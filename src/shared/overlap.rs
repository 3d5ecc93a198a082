//! Surfaces and directions that pairs of LiDARs share, and whether pairs connect all LiDARs, for calibration.

use serde::Serialize;

use super::field_of_view::{FieldOfView, shared_directions};
use crate::engine::{Backend, BackendError};
use crate::json::counted;
use crate::near_field::{place, returned_hits};
use crate::overlap::{Pair, Shared, chain, connected_up_to, groups, surface_voxels};
use crate::problem::{Problem, SensorBatch};
use crate::scene::{EgoBody, Scene};
use crate::vehicle::{Placement, SensorName};

/// Least mean number of surface voxels that a pair must share to be calibrated against each other, where none is said.
pub const LEAST_SHARED: u64 = 500;

/// Why pairs of a placement cannot be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum OverlapError {
    /// Fewer than two LiDARs.
    #[error(
        "placement `{placement}`: has {}, and overlap is between two; add a second LiDAR",
        counted(*.count, "LiDAR")
    )]
    OneLidar { placement: String, count: usize },
    /// Beams that end at no surface.
    #[error(
        "{scene}: beams end at nothing, so that no two LiDARs have a surface in common; give the scene geometry and \
         \"coverage\": \"first-hit\""
    )]
    NoHits { scene: String },
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
    /// Overlap: shared voxels as a share of the voxels of the LiDAR with fewer; 1 on the diagonal, 0 where a LiDAR has none.
    pub overlap: Vec<Vec<f64>>,
    /// Largest overlap at which pairs still connect all LiDARs: the number of a requirement on `overlap`.
    pub overlap_up_to: f64,
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
        let mut shared = Shared::none(count);
        for (frame, weight) in problem.distinct_frames() {
            let seen = surfaces_in(problem, engine, placement, (frame, own))?;
            shared.add(|lidar| &seen[lidar], weight);
        }
        let frames = problem.frame_count();
        let mean = |&sum: &u64| sum as f64 / frames as f64;
        let shared_voxels: Vec<Vec<f64>> =
            shared.sums.iter().map(|row| row.iter().map(mean).collect()).collect();
        let overlap = shared.shares();
        let groups = groups(&shared_voxels, least_shared as f64);
        let chain = chain(&shared_voxels).into_iter();
        let chain: Vec<SharedPair> =
            chain.map(|Pair { lidars, shared }| SharedPair { lidars, voxels: shared }).collect();
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
            overlap_up_to: connected_up_to(&overlap),
            overlap,
            shared_voxels,
        })
    }
}

/// Voxels in which each LiDAR has hits in a frame. Triangles from `own` on are the own body's.
fn surfaces_in(
    problem: &Problem,
    engine: &mut dyn Backend,
    placement: &Placement,
    (frame, own): (usize, usize),
) -> Result<Vec<Vec<u32>>, BackendError> {
    let batch = SensorBatch::new(problem, &placement.lidars, None)?;
    let (poses, hits) = returned_hits(problem, engine, &placement.lidars, frame)?;
    let of_lidar = |(k, pose)| {
        let hits = &hits[batch.beams_of(k)];
        surface_voxels(problem, batch.table(k), pose, hits, own)
    };
    Ok(poses.iter().enumerate().map(of_lidar).collect())
}
