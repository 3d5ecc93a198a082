//! Frames on their way into a data set: scans recorded side by side, points in a frame, and a small file each.
//!
//! Several frames are recorded at the same time, as many in memory as there are threads. A frame's record is kept
//! until the tables are made.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Dataset, ExportError};
use lidar_cast::geom::Pose;
use sightline_scan::{Return, Scan, ScanLidar, Scanner};

/// A rigid transform: rotation by columns, then translation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Transform([f64; 12]);

impl From<&Pose> for Transform {
    fn from(pose: &Pose) -> Self {
        let mut all = [0.0; 12];
        all[..9].copy_from_slice(&pose.rotation.to_cols_array());
        all[9..].copy_from_slice(&pose.translation.to_array());
        Self(all)
    }
}

impl Transform {
    pub fn pose(&self) -> Pose {
        let [x0, x1, x2, y0, y1, y2, z0, z1, z2, t @ ..] = self.0;
        let rotation = DMat3::from_cols_array(&[x0, x1, x2, y0, y1, y2, z0, z1, z2]);
        Pose { rotation, translation: DVec3::from_array(t) }
    }
}

/// A LiDAR of the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct LidarRecord {
    pub model: String,
    /// Without its phase.
    pub ego_from_mount: Transform,
    pub channels: u32,
    pub columns: u32,
    pub range: f32,
}

/// An actor's box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct BoxRecord {
    pub instance: u16,
    pub name: String,
    pub kind: String,
    /// Index of its nuScenes category.
    pub category: u8,
    pub ego_from_box: Transform,
    pub size: DVec3List,
    pub velocity: DVec3List,
    /// Points in it, as the layout counts them.
    pub points: u32,
    /// Share of its hull that the rig sees, where the layout says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible: Option<f32>,
}

type DVec3List = [f64; 3];

/// A file that belongs to a frame, and how long it must be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Written {
    pub path: String,
    pub bytes: u64,
}

/// All that is kept of a frame; its file is the last that is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct FrameRecord {
    /// Number in the scene.
    pub frame: usize,
    /// Seconds since frame 0.
    pub time: f64,
    pub world_from_ego: Transform,
    pub lidars: Vec<LidarRecord>,
    pub boxes: Vec<BoxRecord>,
    pub points: u64,
    pub files: Vec<Written>,
}

impl FrameRecord {
    /// A record without files. `boxes` holds category and points of each box, in order.
    pub fn new(scan: &Scan, boxes: Vec<(u8, u32)>) -> Self {
        let lidars = scan.lidars.iter().map(|lidar| LidarRecord {
            model: lidar.model.clone(),
            ego_from_mount: (&lidar.ego_from_mount).into(),
            channels: lidar.channels,
            columns: lidar.columns,
            range: lidar.range,
        });
        let boxes = scan.boxes.iter().zip(boxes).map(|(tracked, (category, points))| BoxRecord {
            instance: tracked.instance,
            name: tracked.name.clone(),
            kind: tracked.kind.name().to_owned(),
            category,
            ego_from_box: (&tracked.ego_from_box).into(),
            size: tracked.size.to_array(),
            velocity: tracked.velocity.to_array(),
            points,
            visible: tracked.visible,
        });
        Self {
            frame: scan.frame,
            time: scan.time,
            world_from_ego: (&scan.world_from_ego).into(),
            boxes: boxes.collect(),
            lidars: lidars.collect(),
            points: scan.points().count() as u64,
            files: Vec::new(),
        }
    }
}

/// Scans the frames of a scene that the data set lacks; `scene` is its number in the set.
///
/// `watch` gets every scan once it is written; it returns `false` to stop. Returns true if all frames are there.
///
/// # Errors
/// See [`Dataset::write`].
pub fn record(
    dataset: &Dataset,
    scene: usize,
    scanner: &Scanner<'_>,
    watch: impl Fn(&Scan) -> bool + Sync,
) -> Result<bool, ExportError> {
    let frames: Vec<usize> = dataset.missing_of(scene);
    let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    // Each takes the next frame as soon as its own is written, so that none waits for another's files.
    let takers = (0..rayon::current_num_threads().max(1)).into_par_iter().with_max_len(1);
    takers.try_for_each(|_| {
        while !stopped.load(Ordering::Relaxed)
            && let Some(&frame) = frames.get(next.fetch_add(1, Ordering::Relaxed))
        {
            let mut scan = scanner.scan(frame);
            if dataset.tells_visibility(scene, frame) {
                scanner.look_at_boxes(&mut scan);
            }
            let written = dataset.write(scene, &scan);
            if written.is_err() || !watch(&scan) {
                stopped.store(true, Ordering::Relaxed);
            }
            written?;
        }
        Ok::<(), ExportError>(())
    })?;
    match stopped.into_inner() {
        true => Ok(dataset.missing_of(scene).is_empty()),
        false => Ok(true),
    }
}

/// Whose points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CloudOrigin {
    /// All LiDARs as one.
    Merged,
    /// One LiDAR, by its number in the rig.
    Lidar(usize),
}

impl CloudOrigin {
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
