//! Frames on their way into a data set: scans recorded side by side, points in a frame, and a small file each.
//!
//! Several frames are recorded at the same time, as many in memory as there are threads. A frame's record is kept
//! until the tables are made.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use glam::{DMat3, DMat4, DVec3};
use lidar_cast::geom::Pose;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sightline_scan::{Return, Scan, ScanLidar, Scanner};
use sightline_scene::psog::{NpzOut, write_npz};

use super::folder::Folder;
use super::{Checked, Dataset, FormatError};

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
    pub(super) fn pose(&self) -> Pose {
        let [x0, x1, x2, y0, y1, y2, z0, z1, z2, t @ ..] = self.0;
        let rotation = DMat3::from_cols_array(&[x0, x1, x2, y0, y1, y2, z0, z1, z2]);
        Pose { rotation, translation: DVec3::from_array(t) }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct LidarRecord {
    pub model: String,
    /// Without its phase.
    pub ego_from_mount: Transform,
    pub channels: u32,
    pub columns: u32,
    pub range: f32,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct BoxRecord {
    pub instance: u16,
    pub name: String,
    pub kind: String,
    /// Index of its nuScenes category.
    pub category: u8,
    pub ego_from_box: Transform,
    pub size: [f64; 3],
    pub velocity: [f64; 3],
    /// Points in it, as the layout counts them.
    pub points: u32,
    /// Share of its hull that the rig sees, where the layout says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible: Option<f32>,
}

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
    pub(super) fn new(scan: &Scan, boxes: Vec<(u8, u32)>) -> Self {
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
pub fn record(
    dataset: &Dataset,
    scene: usize,
    scanner: &Scanner<'_>,
    watch: impl Fn(&Scan) -> bool + Sync,
) -> Result<bool, FormatError> {
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
        Ok::<(), FormatError>(())
    })?;
    match stopped.into_inner() {
        true => Ok(dataset.missing_of(scene).is_empty()),
        false => Ok(true),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CloudOrigin {
    Merged,
    /// One LiDAR, by its number in the rig.
    Lidar(usize),
}

impl CloudOrigin {
    /// All sources of a rig: merged first.
    pub(super) fn all(lidars: usize, each: bool) -> impl Iterator<Item = Self> {
        let each = if each { lidars } else { 0 };
        std::iter::once(Self::Merged).chain((0..each).map(Self::Lidar))
    }

    pub(super) fn takes(self, point: &Return) -> bool {
        match self {
            Self::Merged => true,
            Self::Lidar(lidar) => usize::from(point.lidar) == lidar,
        }
    }

    /// The frame that its points are given in; merged ones in the middle of the LiDARs, turned as `turn`.
    pub(super) fn ego_from_sensor(self, lidars: &[Pose], turn: DMat3) -> Pose {
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
    pub(super) fn new(ego_from_sensor: &Pose) -> Self {
        Self(ego_from_sensor.inverse())
    }

    pub(super) fn position(&self, point: &Return) -> [f32; 3] {
        self.0.apply(DVec3::from(point.position.map(f64::from))).as_vec3().to_array()
    }
}

/// Writes a scan to `SCENE/NNNNNN.npz`.
pub(super) fn write(folder: &Folder, scene: &str, at: usize, scan: &Scan) -> Checked<FrameRecord> {
    let mut staged = folder.begin(&format!("{scene}/{at:06}.npz"))?;
    staged.write(|out| {
        write_npz(out, false, |npz| {
            put_beams(npz, &scan.returns)?;
            put_rig(npz, scan)?;
            put_boxes(npz, scan)
        })
    })?;
    let files = vec![staged.end()?];
    let boxes = scan.boxes.iter().map(|tracked| (0, tracked.points)).collect();
    Ok(FrameRecord { files, ..FrameRecord::new(scan, boxes) })
}

type Io = std::io::Result<()>;

/// Beams that are turned to columns together: their records lie in the first cache.
const TOGETHER: usize = 256;

fn put_beams<W: std::io::Write + std::io::Seek>(npz: &mut NpzOut<W>, beams: &[Return]) -> Io {
    let n = beams.len() as u64;
    macro_rules! columns {
        ($($name:ident: $of:expr => $shape:expr, $data:expr;)*) => {
            $(let mut $name = Vec::with_capacity(beams.len());)*
            for beams in beams.chunks(TOGETHER) {
                $($name.extend(beams.iter().map($of));)*
            }
            $(npz.put(stringify!($name), $shape, $data)?;)*
        };
    }
    columns! {
        position: |beam: &Return| beam.position => &[n, 3], position.as_flattened();
        raw: |beam: &Return| beam.raw => &[n, 3], raw.as_flattened();
        range: |beam: &Return| beam.range => &[n], &range;
        intensity: |beam: &Return| beam.intensity => &[n], &intensity;
        time: |beam: &Return| beam.time => &[n], &time;
        lidar: |beam: &Return| beam.lidar => &[n], &lidar;
        ring: |beam: &Return| beam.channel => &[n], &ring;
        column: |beam: &Return| beam.column => &[n], &column;
        class: |beam: &Return| beam.class => &[n], &class;
        clean_class: |beam: &Return| beam.clean_class => &[n], &clean_class;
        instance: |beam: &Return| beam.instance => &[n], &instance;
        incidence: |beam: &Return| beam.incidence => &[n], &incidence;
        status: |beam: &Return| beam.status as u8 => &[n], &status;
    }
    Ok(())
}

/// Rows of 4×4 matrices, one after the other.
fn matrices<'a>(poses: impl Iterator<Item = &'a Pose>) -> Vec<f64> {
    let matrix = |pose: &Pose| {
        let (x, y, z) = (pose.rotation.x_axis, pose.rotation.y_axis, pose.rotation.z_axis);
        let columns = [x.extend(0.0), y.extend(0.0), z.extend(0.0), pose.translation.extend(1.0)];
        DMat4::from_cols(columns[0], columns[1], columns[2], columns[3]).transpose().to_cols_array()
    };
    poses.flat_map(matrix).collect()
}

fn put_rig<W: std::io::Write + std::io::Seek>(npz: &mut NpzOut<W>, scan: &Scan) -> Io {
    let lidars = &scan.lidars;
    let n = lidars.len() as u64;
    npz.put("frame", &[], &[scan.frame as u64])?;
    npz.put("frame_time", &[], &[scan.time])?;
    npz.put("world_from_ego", &[4, 4], &matrices([&scan.world_from_ego].into_iter()))?;
    let poses = matrices(lidars.iter().map(|lidar| &lidar.ego_from_sensor));
    npz.put("ego_from_lidar", &[n, 4, 4], &poses)?;
    let channels: Vec<u32> = lidars.iter().map(|lidar| lidar.channels).collect();
    npz.put("lidar_channels", &[n], &channels)?;
    let columns: Vec<u32> = lidars.iter().map(|lidar| lidar.columns).collect();
    npz.put("lidar_columns", &[n], &columns)?;
    let ranges: Vec<f32> = lidars.iter().map(|lidar| lidar.range).collect();
    npz.put("lidar_range", &[n], &ranges)
}

fn put_boxes<W: std::io::Write + std::io::Seek>(npz: &mut NpzOut<W>, scan: &Scan) -> Io {
    let boxes = &scan.boxes;
    let n = boxes.len() as u64;
    let numbers =
        |of: fn(&sightline_scan::TrackedBox) -> u16| boxes.iter().map(of).collect::<Vec<_>>();
    npz.put("box_instance", &[n], &numbers(|tracked| tracked.instance))?;
    npz.put("box_class", &[n], &numbers(|tracked| tracked.class))?;
    npz.put("box_kind", &[n], &boxes.iter().map(|b| b.kind as u8).collect::<Vec<_>>())?;
    npz.put("ego_from_box", &[n, 4, 4], &matrices(boxes.iter().map(|b| &b.ego_from_box)))?;
    let list = |of: fn(&sightline_scan::TrackedBox) -> glam::DVec3| {
        boxes.iter().flat_map(|tracked| of(tracked).to_array()).collect::<Vec<f64>>()
    };
    npz.put("box_size", &[n, 3], &list(|tracked| tracked.size))?;
    npz.put("box_velocity", &[n, 3], &list(|tracked| tracked.velocity))?;
    npz.put("box_points", &[n], &boxes.iter().map(|b| b.points).collect::<Vec<_>>())
}
