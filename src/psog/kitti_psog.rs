//! A P-SOG from labelled scans.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::kitti::{KittiError, KittiSequence, LabelledScan};
use super::{BuildReport, FrameVotes, Psog, PsogBuilder, Roi};
use crate::geom::Pose;

/// Height of the KITTI car's LiDAR above the ground, in metres.
pub const KITTI_LIDAR_HEIGHT: f64 = 1.73;

/// How to build a P-SOG from labelled frames.
#[derive(Debug, Clone)]
pub struct KittiPsogOptions {
    /// The voxel grid, in the ego frame (origin on the ground below the LiDAR).
    pub roi: Roi,
    /// Height of the LiDAR above the ground, metres: z_ego = z_lidar + this.
    pub lidar_height: f64,
    /// Frames to vote, by number; `None` takes all that have a scan.
    pub frames: Option<Vec<u32>>,
    /// Frame t merges the scans of frames t − w ..= t + w; `None` merges all of `frames`.
    /// Without a window all scans are in memory at once (14 bytes a point).
    pub window: Option<u32>,
}

impl KittiPsogOptions {
    /// All frames, all merged, LiDAR at the height of the KITTI car's.
    pub fn new(roi: Roi) -> Self {
        Self { roi, lidar_height: KITTI_LIDAR_HEIGHT, frames: None, window: None }
    }
}

/// Builds a P-SOG from a labelled sequence.
///
/// The dense points of frame t are its own scan and those of the other frames of its window,
/// moved through the LiDAR poses into the ego frame of t. Each votes in the voxel of its hit
/// ([`Roi::voxel_of_hit`]), seen from where its own LiDAR stood. Points of moving objects vote only
/// in their own frame (elsewhere they would smear), and ignored labels never.
///
/// # Errors
/// See [`KittiError`].
pub fn build_kitti_psog(
    sequence: &KittiSequence,
    options: &KittiPsogOptions,
) -> Result<(Psog, BuildReport), KittiError> {
    let height = options.lidar_height;
    if !height.is_finite() {
        return Err(KittiError::Height { value: height });
    }
    let mut frames = options.frames.clone().unwrap_or_else(|| sequence.frames().collect());
    frames.sort_unstable();
    frames.dedup();
    let ego_from_lidar = Pose { translation: DVec3::new(0.0, 0.0, height), ..Pose::IDENTITY };
    let mut builder = PsogBuilder::new(options.roi, Psog::kitti_classes())?;
    let mut scans = BTreeMap::new();
    for &t in &frames {
        let near = |&n: &u32| options.window.is_none_or(|w| n.abs_diff(t) <= w);
        scans.retain(|n, _| near(n));
        for n in frames.iter().copied().filter(near) {
            if let std::collections::btree_map::Entry::Vacant(slot) = scans.entry(n) {
                slot.insert(Scan::new(sequence.read(n)?));
            }
        }
        let ego_from_world = ego_from_lidar.compose(&sequence.world_from_lidar(t)?.inverse());
        let mut votes = FrameVotes::new();
        for (&n, scan) in &scans {
            // Frame t's own points need no pose, and so lose nothing to its rounding.
            let ego_from_scan = if n == t {
                ego_from_lidar
            } else {
                ego_from_world.compose(&sequence.world_from_lidar(n)?)
            };
            scan.vote(&options.roi, &ego_from_scan, n == t, &mut votes);
        }
        builder.frame(votes)?;
    }
    Ok(builder.finish()?)
}

/// The voting points of a scan in the LiDAR frame: those of things at rest, then the moving ones.
struct Scan {
    points: Vec<([f32; 3], u16)>,
    at_rest: usize,
}

impl Scan {
    fn new(scan: LabelledScan) -> Self {
        let labelled = || scan.points.iter().zip(&scan.labels);
        let pick = |moving| {
            labelled()
                .filter(move |(_, label)| label.moving == moving)
                .filter_map(|(&point, label)| Some((point, label.class?)))
        };
        let mut points: Vec<_> = pick(false).collect();
        let at_rest = points.len();
        points.extend(pick(true));
        points.shrink_to_fit();
        Self { points, at_rest }
    }

    fn vote(&self, roi: &Roi, ego_from_lidar: &Pose, own: bool, votes: &mut FrameVotes) {
        let points = if own { &self.points[..] } else { &self.points[..self.at_rest] };
        let origin = ego_from_lidar.translation;
        votes.par_extend(points.par_iter().with_min_len(8192).map(|&(point, class)| {
            let point = ego_from_lidar.apply(Vec3::from(point).as_dvec3());
            (roi.voxel_of_hit(origin, point), class)
        }));
    }
}
