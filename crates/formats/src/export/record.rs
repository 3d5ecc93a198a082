//! Record of one frame: a small file that is kept until the tables are made.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use lidar_cast::geom::Pose;
use sightline_scan::Scan;

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

pub(super) type DVec3List = [f64; 3];

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
