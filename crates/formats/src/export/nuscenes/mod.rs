//! nuScenes v1.0 with lidarseg: clouds of each frame, and tables of all of them.
//!
//! `LIDAR_TOP` stands in the middle of all LiDARs and holds the points of all; its x axis points right,
//! its y axis forward, as on the vehicles of nuScenes. Each LiDAR is a channel of its own, `LIDAR_0` and on.

mod fixed;
mod frames;
mod names;
mod table;
mod tables;

use glam::{DMat3, DVec3};
use sha2::{Digest, Sha256};

use super::cloud::{Mover, Source, mounts};
use super::folder::Folder;
use super::labels::{Label, Labels, of_kind};
use super::plan::Planned;
use super::record::FrameRecord;
use super::{DatasetSettings, ExportError};
use lidar_cast::geom::Pose;
use sightline_scan::{BOX_MARGIN, Scan};

pub(super) use names::scene_names;
pub(super) use tables::finish;

/// Largest intensity.
const FULL: f32 = 255.0;
/// Microseconds at which the first scene begins; scenes lie apart by their number.
const EPOCH: i64 = 1_532_402_927_000_000;

/// Settings of a data set and the scene that is being written.
pub(super) struct About<'a> {
    pub settings: &'a DatasetSettings,
    pub planned: &'a Planned,
    /// Scenes of each split.
    pub counts: [usize; 3],
}

impl About<'_> {
    fn version(&self) -> &'static str {
        names::version(self.counts, self.planned.split)
    }

    fn is_keyframe(&self, at: usize) -> bool {
        at.is_multiple_of(self.settings.keyframe_every)
    }

    /// Microseconds of a moment of the scene.
    fn timestamp(&self, time: f64) -> i64 {
        let number = self.planned.name.trim_start_matches("scene-").parse::<i64>().unwrap_or(0);
        EPOCH + number * 100_000_000_000 + (time * 1e6).round() as i64
    }

    fn sample_data_token(&self, channel: &str, at: usize) -> String {
        token(&["sample_data", &self.planned.name, channel, &at.to_string()])
    }

    /// File of a cloud.
    fn file(&self, channel: &str, at: usize, time: f64) -> String {
        let folder = if self.is_keyframe(at) { "samples" } else { "sweeps" };
        let (scene, stamp) = (&self.planned.name, self.timestamp(time));
        format!("{folder}/{channel}/{scene}__{channel}__{stamp}.pcd.bin")
    }

    fn lidarseg_file(&self, at: usize) -> String {
        let token = self.sample_data_token("LIDAR_TOP", at);
        format!("lidarseg/{}/{token}_lidarseg.bin", self.version())
    }
}

/// 32 hexadecimal digits that the parts decide.
fn token(parts: &[&str]) -> String {
    let digest = Sha256::digest(parts.join("/").as_bytes());
    digest.iter().take(16).map(|byte| format!("{byte:02x}")).collect()
}

/// Channels of a rig, `LIDAR_TOP` first.
fn channels(lidars: usize, each: bool) -> impl Iterator<Item = (String, Source)> {
    Source::all(lidars, each).map(|source| match source {
        Source::Merged => ("LIDAR_TOP".to_owned(), source),
        Source::Lidar(lidar) => (format!("LIDAR_{lidar}"), source),
    })
}

/// The rotation of `LIDAR_TOP`: x right, y forward.
fn right_forward() -> DMat3 {
    DMat3::from_cols(DVec3::NEG_Y, DVec3::X, DVec3::Z)
}

/// Writes the clouds of a scan, and labels of a keyframe; `at` is its number among the scene's frames.
pub(super) fn write(
    folder: &Folder,
    about: About,
    at: usize,
    scan: &Scan,
    classes: &[Label],
) -> Result<FrameRecord, ExportError> {
    let mounts = mounts(scan);
    let rings = first_rings(scan);
    let mut files = Vec::new();
    let mut inside = vec![0; scan.boxes.len()];
    for (channel, source) in channels(mounts.len(), about.settings.each_lidar) {
        let ego_from_sensor = source.ego_from_sensor(&mounts, right_forward());
        let mover = Mover::new(&ego_from_sensor);
        let merged = source == Source::Merged;
        let points = scan.points().filter(|point| source.takes(point)).map(|point| {
            let [x, y, z] = mover.position(point);
            let first = if merged { rings[usize::from(point.lidar)] } else { 0 };
            [x, y, z, point.intensity * FULL, (first + u32::from(point.channel)) as f32]
        });
        let cloud: Vec<[f32; 5]> = points.collect();
        let file = about.file(&channel, at, scan.time);
        files.push(folder.put(&file, bytemuck::cast_slice(&cloud))?);
        if merged && about.is_keyframe(at) {
            inside = count(&cloud, &ego_from_sensor, scan);
            let labels = Labels::new(classes, &scan.boxes);
            let labels: Vec<u8> = scan.points().map(|point| labels.nuscenes(point)).collect();
            files.push(folder.put(&about.lidarseg_file(at), &labels)?);
        }
    }
    let category = |tracked: &sightline_scan::TrackedBox| {
        let class = classes.get(usize::from(tracked.class)).copied();
        let label = of_kind(tracked.kind).or(class).map(|label| label.nuscenes);
        label.filter(|label| fixed::BOXED.contains(label)).unwrap_or(fixed::DEBRIS)
    };
    let boxes = scan.boxes.iter().map(category).zip(inside).collect();
    Ok(FrameRecord { files, ..FrameRecord::new(scan, boxes) })
}

/// One for each LiDAR, the number of its first channel when all are counted through.
fn first_rings(scan: &Scan) -> Vec<u32> {
    let mut next = 0;
    let first = scan.lidars.iter().map(|lidar| {
        next += lidar.channels;
        next - lidar.channels
    });
    first.collect()
}

/// Points of a cloud, as it is rounded, in the boxes as they are written.
fn count(cloud: &[[f32; 5]], ego_from_sensor: &Pose, scan: &Scan) -> Vec<u32> {
    let in_box = |tracked: &sightline_scan::TrackedBox| {
        let box_from_sensor = tracked.ego_from_box.inverse().compose(ego_from_sensor);
        let half = tracked.size / 2.0 + BOX_MARGIN;
        let center = box_from_sensor.inverse().translation;
        let reach = half.length_squared() * (1.0 + 1e-6);
        let inside = |&&[x, y, z, ..]: &&[f32; 5]| {
            let point = DVec3::new(x.into(), y.into(), z.into());
            point.distance_squared(center) <= reach
                && box_from_sensor.apply(point).abs().cmple(half).all()
        };
        cloud.iter().filter(inside).count() as u32
    };
    scan.boxes.iter().map(in_box).collect()
}
