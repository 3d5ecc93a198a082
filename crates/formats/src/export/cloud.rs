//! Points of one LiDAR, or of all of them as of one that stands in their middle.

use glam::{DMat3, DVec3};

use lidar_cast::geom::Pose;
use sightline_scan::{Return, Scan, ScanLidar};

/// Whose points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// All LiDARs as one.
    Merged,
    /// One LiDAR, by its number in the rig.
    Lidar(usize),
}

impl Source {
    /// All sources of a rig: merged first.
    pub fn all(lidars: usize, each: bool) -> impl Iterator<Item = Self> {
        let each = if each { lidars } else { 0 };
        std::iter::once(Self::Merged).chain((0..each).map(Self::Lidar))
    }

    pub fn takes(self, point: &Return) -> bool {
        match self {
            Self::Merged => true,
            Self::Lidar(lidar) => usize::from(point.lidar) == lidar,
        }
    }

    /// The frame that its points are given in; merged ones in the middle of the LiDARs, turned as `turn`.
    pub fn ego_from_sensor(self, lidars: &[Pose], turn: DMat3) -> Pose {
        match self {
            Self::Lidar(lidar) => lidars.get(lidar).copied().unwrap_or(Pose::IDENTITY),
            Self::Merged => {
                let sum: DVec3 = lidars.iter().map(|pose| pose.translation).sum();
                Pose { rotation: turn, translation: sum / lidars.len().max(1) as f64 }
            }
        }
    }
}

/// Poses of the LiDARs of a scan, without their phases: one calibration holds for all frames.
pub(super) fn mounts(scan: &Scan) -> Vec<Pose> {
    scan.lidars.iter().map(|lidar: &ScanLidar| lidar.ego_from_mount).collect()
}

/// Takes positions of points from the ego frame to another, rounded once.
pub(super) struct Mover(Pose);

impl Mover {
    pub fn new(ego_from_sensor: &Pose) -> Self {
        Self(ego_from_sensor.inverse())
    }

    pub fn position(&self, point: &Return) -> [f32; 3] {
        self.0.apply(DVec3::from(point.position.map(f64::from))).as_vec3().to_array()
    }
}
