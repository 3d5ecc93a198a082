//! nuScenes with lidarseg: keyframes of LIDAR_TOP with their labels, boxes with their tracks.
//!
//! The world is nuScenes' global frame; the ego frame stands on the ground below the rear axle. A
//! sensor's pose is ego_pose · calibrated_sensor. Sweeps between keyframes have no labels and are not read.

mod boxes;
mod categories;
mod read;
mod tables;
mod watched;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};

pub(super) use boxes::ScanBox;
use categories::Category;
pub use categories::NUSCENES_CATEGORIES;
pub use read::read_nuscenes;

use super::files::{check_count, read_points, read_units};
use super::{BoxTrack, DatasetError, LabelledScan, LabelledSequence, PointLabel};
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_scene::scene::DEFAULT_CLASSES;

/// Bytes of a point: x, y, z, intensity, ring.
const POINT: usize = 20;
/// Farthest that points of a thing in motion lie beside its box, metres: boxes are drawn by hand, ranges err.
const BESIDE: f64 = 0.25;

/// A scene of nuScenes: its keyframes, numbered from 0.
#[derive(Debug, Clone)]
pub struct NuscenesScene {
    name: String,
    keyframes: Vec<Keyframe>,
    tracks: Vec<BoxTrack>,
    rate: Option<f64>,
    /// Meaning of each label that the set defines.
    categories: Arc<Vec<Option<Category>>>,
    notes: Vec<Note>,
}

#[derive(Debug, Clone)]
struct Keyframe {
    scan: PathBuf,
    labels: PathBuf,
    ego_from_sensor: Pose,
    world_from_sensor: Pose,
}

impl NuscenesScene {
    fn keyframe(&self, frame: u32) -> Result<&Keyframe, DatasetError> {
        self.keyframes.get(frame as usize).ok_or_else(|| DatasetError::NoFrame {
            path: PathBuf::from(&self.name),
            frame,
            have: self.frames(),
        })
    }

    /// Boxes of a frame in the frame of its scan, each with its track.
    fn boxes(&self, frame: u32, world_from_sensor: &Pose) -> Vec<(u32, ScanBox)> {
        let in_scan = |(index, track): (usize, &BoxTrack)| {
            let at = track.poses.binary_search_by_key(&frame, |pose| pose.frame).ok()?;
            let box_from_world = track.poses[at].world_from_box.inverse();
            let box_from_sensor = box_from_world.compose(world_from_sensor);
            let half = DVec3::from(track.size) / 2.0;
            Some((index as u32, ScanBox { box_from_sensor, half }))
        };
        self.tracks.iter().enumerate().filter_map(in_scan).collect()
    }

    /// Meaning of a label.
    fn category(&self, path: &Path, point: usize, label: u8) -> Result<Category, DatasetError> {
        let known = self.categories.get(usize::from(label)).copied().flatten();
        let label = u32::from(label);
        known.ok_or_else(|| DatasetError::Label { path: path.to_owned(), point, label })
    }
}

impl LabelledSequence for NuscenesScene {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn classes(&self) -> Vec<String> {
        DEFAULT_CLASSES.map(str::to_owned).to_vec()
    }

    fn frames(&self) -> Vec<u32> {
        (0..self.keyframes.len() as u32).collect()
    }

    fn rate(&self) -> Option<f64> {
        self.rate
    }

    fn ego_from_sensor(&self, frame: u32) -> Result<Pose, DatasetError> {
        Ok(self.keyframe(frame)?.ego_from_sensor)
    }

    fn world_from_sensor(&self, frame: u32) -> Result<Pose, DatasetError> {
        Ok(self.keyframe(frame)?.world_from_sensor)
    }

    fn tracks(&self) -> Result<Vec<BoxTrack>, DatasetError> {
        Ok(self.tracks.clone())
    }

    fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// A point of a thing that may have a box moves where that box does, also a little beside it. One that
    /// has no box stands still, as parked cars that a data set takes for a part of the street.
    fn read(&self, frame: u32) -> Result<LabelledScan, DatasetError> {
        let keyframe = self.keyframe(frame)?;
        let points = read_points::<POINT>(&keyframe.scan)?;
        let path = &keyframe.labels;
        let ids = read_units(path, 1)?;
        check_count(path.clone(), ids.len(), &keyframe.scan, points.len(), POINT)?;
        let boxes = self.boxes(frame, &keyframe.world_from_sensor);
        let at_rest: Vec<bool> = self.tracks.iter().map(BoxTrack::at_rest).collect();
        let moves = |track: u32| !at_rest[track as usize];
        let mut labels = Vec::with_capacity(ids.len());
        for (point, (&id, &xyz)) in ids.iter().zip(&points).enumerate() {
            let Category { class, boxed, .. } = self.category(path, point, id)?;
            let at = Vec3::from(xyz).as_dvec3();
            let found = boxes.iter().find(|(_, it)| boxed && it.holds(at)).map(|&(track, _)| track);
            let beside =
                |(track, it): &(u32, ScanBox)| moves(*track) && it.holds_within(at, BESIDE);
            let moving = found.map_or_else(|| boxed && boxes.iter().any(beside), moves);
            labels.push(PointLabel { class, moving, on_track: found.is_some() });
        }
        Ok(LabelledScan { points, labels })
    }
}
