//! nuScenes with lidarseg: keyframes of LIDAR_TOP with their labels, boxes with their tracks.
//!
//! The world is nuScenes' global frame; the ego frame stands on the ground below the rear axle. A
//! sensor's pose is ego_pose · calibrated_sensor. Sweeps between keyframes have no labels and are not read.

mod read;
mod tables;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES};

use super::carla::{class_of_name, tag_names};
use super::sequence::{check_count, no_frame, read_points, read_units};
use super::{BoxTrack, Checked, LabelledScan, LabelledSequence, PointLabel};

pub use read::read_nuscenes;

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
    fn keyframe(&self, frame: u32) -> Checked<&Keyframe> {
        self.keyframes.get(frame as usize).ok_or_else(|| no_frame(&self.name, frame, self))
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

    fn category(&self, path: &Path, point: usize, label: u8) -> Checked<Category> {
        let known = self.categories.get(usize::from(label)).copied().flatten();
        known.ok_or_else(|| {
            refused!(
                "{}: point {point} has label {label}, and category.json has no category with that index",
                path.display()
            )
        })
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

    fn ego_from_sensor(&self, frame: u32) -> Checked<Pose> {
        Ok(self.keyframe(frame)?.ego_from_sensor)
    }

    fn world_from_sensor(&self, frame: u32) -> Checked<Pose> {
        Ok(self.keyframe(frame)?.world_from_sensor)
    }

    fn tracks(&self) -> Checked<Vec<BoxTrack>> {
        Ok(self.tracks.clone())
    }

    fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Points in a moving box, or a little beside it, count as moving. A thing without a box stands still, such as a parked
    /// car that the data set takes for a part of the street.
    fn read(&self, frame: u32) -> Checked<LabelledScan> {
        let keyframe = self.keyframe(frame)?;
        let points = read_points::<POINT>(&keyframe.scan)?;
        let path = &keyframe.labels;
        let ids = read_units(path, 1)?;
        check_count(path, ids.len(), &keyframe.scan, points.len(), POINT)?;
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

/// A box in the frame of a scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScanBox {
    /// Takes the scan's frame to the box's own, whose origin is its middle.
    pub box_from_sensor: Pose,
    /// Half of its extents.
    pub half: DVec3,
}

impl ScanBox {
    /// True if a point lies in the box or on its surface.
    pub(super) fn holds(&self, point: DVec3) -> bool {
        self.holds_within(point, 0.0)
    }

    /// True if a point lies in the box grown by `margin` metres on every side.
    fn holds_within(&self, point: DVec3, margin: f64) -> bool {
        self.box_from_sensor.apply(point).abs().cmple(self.half + margin).all()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Category {
    /// Position in the default classes of scenes; `None` does not vote.
    pub class: Option<u16>,
    /// A thing that the data set draws boxes around.
    pub boxed: bool,
    pub kind: ActorKind,
}

/// Name in nuScenes, class in a scene, kind of actor. Points vote for the class; the kind does not count.
const NUSCENES: [(&str, &str, ActorKind); 32] = [
    ("noise", "", ActorKind::Other),
    ("animal", "dynamic", ActorKind::Animal),
    ("human.pedestrian.adult", "pedestrian", ActorKind::Pedestrian),
    ("human.pedestrian.child", "pedestrian", ActorKind::Pedestrian),
    ("human.pedestrian.construction_worker", "pedestrian", ActorKind::Pedestrian),
    ("human.pedestrian.personal_mobility", "pedestrian", ActorKind::Pedestrian),
    ("human.pedestrian.police_officer", "pedestrian", ActorKind::Pedestrian),
    ("human.pedestrian.stroller", "pedestrian", ActorKind::Pedestrian),
    ("human.pedestrian.wheelchair", "pedestrian", ActorKind::Pedestrian),
    ("movable_object.barrier", "guard_rail", ActorKind::Other),
    ("movable_object.debris", "dynamic", ActorKind::Other),
    ("movable_object.pushable_pullable", "dynamic", ActorKind::Other),
    ("movable_object.trafficcone", "static", ActorKind::Other),
    ("static_object.bicycle_rack", "static", ActorKind::Other),
    ("vehicle.bicycle", "vehicle", ActorKind::Bicycle),
    ("vehicle.bus.bendy", "vehicle", ActorKind::Bus),
    ("vehicle.bus.rigid", "vehicle", ActorKind::Bus),
    ("vehicle.car", "vehicle", ActorKind::Car),
    ("vehicle.construction", "vehicle", ActorKind::Construction),
    ("vehicle.emergency.ambulance", "vehicle", ActorKind::Van),
    ("vehicle.emergency.police", "vehicle", ActorKind::Car),
    ("vehicle.motorcycle", "vehicle", ActorKind::Motorcycle),
    ("vehicle.trailer", "vehicle", ActorKind::Trailer),
    ("vehicle.truck", "vehicle", ActorKind::Truck),
    ("flat.driveable_surface", "road", ActorKind::Other),
    ("flat.other", "ground", ActorKind::Other),
    ("flat.sidewalk", "sidewalk", ActorKind::Other),
    ("flat.terrain", "terrain", ActorKind::Other),
    ("static.manmade", "building", ActorKind::Other),
    ("static.other", "static", ActorKind::Other),
    ("static.vegetation", "vegetation", ActorKind::Other),
    // Its own body, which the scene has apart.
    ("vehicle.ego", "", ActorKind::Other),
];

/// Names of nuScenes' categories; the index is the label of lidarseg.
pub(crate) const NUSCENES_CATEGORIES: [&str; NUSCENES.len()] = {
    let mut names = [""; NUSCENES.len()];
    let mut k = 0;
    while k < names.len() {
        names[k] = NUSCENES[k].0;
        k += 1;
    }
    names
};

/// The meaning of a category's name; `None` for one that is not known.
fn category(name: &str) -> Option<Category> {
    let Some(&(_, class, kind)) = NUSCENES.iter().find(|(known, ..)| *known == name) else {
        return class_of_name(name).map(|(class, boxed, kind)| Category { class, boxed, kind });
    };
    let class = DEFAULT_CLASSES.iter().position(|known| *known == class);
    let boxed = ["animal", "human.", "movable_object.", "static_object.", "vehicle."];
    let boxed = boxed.iter().any(|start| name.starts_with(start));
    Some(Category { class: class.map(|class| class as u16), boxed, kind })
}

fn known() -> Vec<String> {
    NUSCENES.iter().map(|(name, ..)| *name).chain(tag_names()).map(str::to_owned).collect()
}
