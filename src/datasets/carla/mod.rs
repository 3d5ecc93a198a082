//! Scans of CARLA's semantic LiDAR, a file a frame, with a table of the LiDAR's poses.
//!
//! Points come in the sensor's frame with y to the right; y is mirrored on reading, as are the poses.

mod poses;
mod records;
mod tags;
mod tracks;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::kitti::above_ground;
use super::{BoxTrack, DatasetError, LabelledScan, LabelledSequence, PointLabel};
use crate::geom::Pose;
use crate::maths;
use crate::scene::DEFAULT_CLASSES;
use poses::{Stood, frame_of};
use records::Record;
pub use tags::CarlaTags;
use tags::Tag;
pub(super) use tags::{class_of_name, tag_names};
use tracks::Seen;

/// Within this radius of the LiDAR the road tells its height, metres.
const NEAR: f64 = 10.0;
/// Classes that say where the ground is.
const GROUND: [&str; 2] = ["road", "road_line"];

/// A point with the name and the meaning of its tag.
type Tagged = (Record, (&'static str, Tag));

/// A folder of scans of one LiDAR.
#[derive(Debug, Clone)]
pub struct CarlaSequence {
    folder: PathBuf,
    /// Scan and pose of each frame.
    frames: BTreeMap<u32, (PathBuf, Stood)>,
    tags: CarlaTags,
    /// Meaning of each tag, by its number.
    meanings: Vec<(&'static str, Tag)>,
    /// The ego frame stands on the ground below the LiDAR.
    ego_from_sensor: Pose,
}

impl CarlaSequence {
    /// Opens a folder of scans named by their frames (`000123.ply`, `.bin` or `.npy`) and a table of
    /// `carla.Transform` of the LiDAR: frame or file, x, y, z, roll, pitch, yaw, and perhaps time. Without a
    /// height of the LiDAR above the ground the first scan's road within 10 m tells it.
    ///
    /// # Errors
    /// Files that are missing, malformed or named by no frame, a scan without a pose; see [`DatasetError`].
    pub fn open(
        folder: &Path,
        poses: &Path,
        tags: CarlaTags,
        lidar_height: Option<f64>,
    ) -> Result<Self, DatasetError> {
        let table = poses::read(poses)?;
        let mut frames = BTreeMap::new();
        for (frame, scan) in list_scans(folder)? {
            let Some(&stood) = table.get(&frame) else {
                return Err(DatasetError::NoCarlaPose { path: poses.to_owned(), frame, scan });
            };
            if frames.insert(frame, (scan, stood)).is_some() {
                return Err(DatasetError::Twice { path: folder.to_owned(), frame });
            }
        }
        let named = tags.names().iter().map(|&name| class_of_name(name).map(|tag| (name, tag)));
        let meanings = named.flatten().collect();
        let folder = folder.to_owned();
        let mut sequence = Self { folder, frames, tags, meanings, ego_from_sensor: Pose::IDENTITY };
        let height = lidar_height.map_or_else(|| sequence.measured_height(), Ok)?;
        sequence.ego_from_sensor = above_ground(height)?;
        Ok(sequence)
    }

    /// Height of the LiDAR above the ground in metres.
    pub fn lidar_height(&self) -> f64 {
        self.ego_from_sensor.translation.z
    }

    /// Median height above the road points near the LiDAR, in the first scan.
    fn measured_height(&self) -> Result<f64, DatasetError> {
        let Some((path, _)) = self.frames.values().next() else {
            return Err(DatasetError::NoCarlaScans { path: self.folder.clone() });
        };
        let mut heights = Vec::new();
        for (record, (_, (class, ..))) in self.records(path)? {
            let [x, y, z] = record.xyz.map(f64::from);
            let ground = class.is_some_and(|c| GROUND.contains(&DEFAULT_CLASSES[usize::from(c)]));
            if ground && maths::hypot(x, y) <= NEAR {
                heights.push(0.0 - z);
            }
        }
        heights.sort_by(f64::total_cmp);
        let none = || DatasetError::NoGround { path: path.clone(), radius: NEAR };
        heights.get(heights.len() / 2).copied().ok_or_else(none)
    }

    /// The points of a scan with the name and meaning of their tags.
    fn records(&self, path: &Path) -> Result<Vec<Tagged>, DatasetError> {
        let meaning = |(point, record): (usize, Record)| {
            let found = self.meanings.get(record.tag as usize).copied();
            let found = found.ok_or_else(|| DatasetError::Tag {
                path: path.to_owned(),
                point,
                tag: record.tag,
                version: self.tags.version(),
                most: self.meanings.len() as u32 - 1,
            })?;
            Ok((record, found))
        };
        records::read(path)?.into_iter().enumerate().map(meaning).collect()
    }

    fn frame(&self, frame: u32) -> Result<&(PathBuf, Stood), DatasetError> {
        self.frames.get(&frame).ok_or_else(|| DatasetError::NoFrame {
            path: self.folder.clone(),
            frame,
            have: self.frames(),
        })
    }
}

impl LabelledSequence for CarlaSequence {
    fn name(&self) -> String {
        self.folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    fn classes(&self) -> Vec<String> {
        DEFAULT_CLASSES.map(str::to_owned).to_vec()
    }

    fn frames(&self) -> Vec<u32> {
        self.frames.keys().copied().collect()
    }

    fn rate(&self) -> Option<f64> {
        let times = || self.frames.values().map(|(_, stood)| stood.time);
        let (first, last) = (times().next()??, times().next_back()??);
        let rate = (self.frames.len() - 1) as f64 / (last - first);
        Some((rate * 1000.0).round() / 1000.0).filter(|rate| *rate > 0.0 && *rate <= 1000.0)
    }

    fn ego_from_sensor(&self, _: u32) -> Result<Pose, DatasetError> {
        Ok(self.ego_from_sensor)
    }

    fn world_from_sensor(&self, frame: u32) -> Result<Pose, DatasetError> {
        Ok(self.frame(frame)?.1.world_from_sensor)
    }

    /// Boxes around the points of each actor; see `tracks.rs` for what they cannot know.
    fn tracks(&self) -> Result<Vec<BoxTrack>, DatasetError> {
        let mut seen: BTreeMap<u32, Seen> = BTreeMap::new();
        for (&frame, (path, stood)) in &self.frames {
            for (record, meaning) in self.records(path)? {
                if is_actor(&record, &meaning.1) {
                    let point = Vec3::from(record.xyz).as_dvec3();
                    let actor = seen.entry(record.object).or_default();
                    actor.tag = actor.tag.or(Some(meaning));
                    let points = actor.frames.entry(frame).or_default();
                    points.push(stood.world_from_sensor.apply(point));
                }
            }
        }
        Ok(seen.values().filter_map(Seen::track).collect())
    }

    fn read(&self, frame: u32) -> Result<LabelledScan, DatasetError> {
        let records = self.records(&self.frame(frame)?.0)?;
        let label = |(record, (_, tag)): &(Record, (&str, Tag))| {
            let actor = is_actor(record, tag);
            PointLabel { class: tag.0, moving: actor, on_track: actor }
        };
        let labels = records.iter().map(label).collect();
        Ok(LabelledScan { points: records.iter().map(|(record, _)| record.xyz).collect(), labels })
    }
}

/// Whether a point lies on a vehicle or person that the simulator moves: parts of the map have object 0.
fn is_actor(record: &Record, (_, boxed, _): &Tag) -> bool {
    *boxed && record.object != 0
}

fn list_scans(folder: &Path) -> Result<Vec<(u32, PathBuf)>, DatasetError> {
    let to_read = |source| DatasetError::Read { path: folder.to_owned(), source };
    let mut scans = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(to_read)? {
        let path = entry.map_err(to_read)?.path();
        let ending = path.extension().and_then(|ending| ending.to_str());
        if matches!(ending, Some("ply" | "bin" | "npy")) {
            let Some(frame) = frame_of(&path) else { return Err(DatasetError::CarlaName { path }) };
            scans.push((frame, path));
        }
    }
    if scans.is_empty() {
        return Err(DatasetError::NoCarlaScans { path: folder.to_owned() });
    }
    scans.sort();
    Ok(scans)
}
