//! nuScenes with lidarseg: keyframes of LIDAR_TOP with their labels, boxes with their tracks.
//!
//! The world is nuScenes' global frame; the ego frame stands on the ground below the rear axle. A
//! sensor's pose is ego_pose · calibrated_sensor. Sweeps between keyframes have no labels and are not read.

mod read;
mod tables;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use lidar_cast::geom::Pose;
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use serde::forward_to_deserialize_any;
use sightline_files::Note;
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES};

use super::carla::{class_of_name, tag_names};
use super::sequence::{check_count, read_points, read_units};
use super::{BoxTrack, DatasetError, LabelledScan, LabelledSequence, PointLabel};

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

    /// Points in a moving box, or a little beside it, count as moving. A thing without a box stands still, such as a parked
    /// car that the data set takes for a part of the street.
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
    pub fn holds(&self, point: DVec3) -> bool {
        self.holds_within(point, 0.0)
    }

    /// True if a point lies in the box grown by `margin` metres on every side.
    fn holds_within(&self, point: DVec3, margin: f64) -> bool {
        self.box_from_sensor.apply(point).abs().cmple(self.half + margin).all()
    }
}

/// Meaning of a category.
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
pub const NUSCENES_CATEGORIES: [&str; NUSCENES.len()] = {
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

/// Names that are known.
fn known() -> Vec<String> {
    NUSCENES.iter().map(|(name, ..)| *name).chain(tag_names()).map(str::to_owned).collect()
}

/// Most unknown names that a table keeps; a table of other things has one a row.
const MOST_KEPT: usize = 8;
/// Most characters of a name that are kept.
const LONGEST: usize = 40;

/// Names of fields that are neither read nor passed over.
#[derive(Default)]
struct Unknown {
    names: RefCell<BTreeSet<String>>,
}

impl Unknown {
    fn keep(&self, name: &str) {
        let mut names = self.names.borrow_mut();
        if names.len() < MOST_KEPT {
            names.insert(name.escape_debug().take(LONGEST).collect());
        }
    }

    /// The names in words; `None` where every field is known.
    fn in_words(self) -> Option<String> {
        let names = self.names.into_inner();
        let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        (!quoted.is_empty()).then(|| quoted.join(", "))
    }
}

/// A deserializer, or a visitor, that looks at the names of a row's fields on their way through.
struct Watched<'a, T> {
    of: T,
    /// Names that the row's struct reads; empty until the struct names them.
    read: &'static [&'static str],
    /// Names that are passed over.
    passed: &'static [&'static str],
    unknown: &'a Unknown,
}

impl<'a, T> Watched<'a, T> {
    fn around<U>(&self, of: U) -> Watched<'a, U> {
        Watched { of, read: self.read, passed: self.passed, unknown: self.unknown }
    }
}

impl<R> Watched<'_, PhantomData<R>> {
    /// For one more row.
    fn again(&self) -> Self {
        Self { of: PhantomData, read: self.read, passed: self.passed, unknown: self.unknown }
    }
}

impl<'de, R: Deserialize<'de>> DeserializeSeed<'de> for Watched<'_, PhantomData<R>> {
    type Value = R;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<R, D::Error> {
        R::deserialize(self.around(deserializer))
    }
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for Watched<'_, D> {
    type Error = D::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, D::Error> {
        self.of.deserialize_any(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        let visitor = Watched { read: fields, ..self.around(visitor) };
        self.of.deserialize_struct(name, fields, visitor)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

impl<'de, V: Visitor<'de>> Visitor<'de> for Watched<'_, V> {
    type Value = V::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.of.expecting(f)
    }

    fn visit_map<A: MapAccess<'de>>(self, fields: A) -> Result<V::Value, A::Error> {
        let fields = self.around(fields);
        self.of.visit_map(fields)
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Watched<'_, A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        let name = self.around(seed);
        self.of.next_key_seed(Name(name))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, A::Error> {
        self.of.next_value_seed(seed)
    }
}

/// The name of a field, which goes on to the row's struct.
struct Name<'a, K>(Watched<'a, K>);

impl<'de, K: DeserializeSeed<'de>> DeserializeSeed<'de> for Name<'_, K> {
    type Value = K::Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<K::Value, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'de, K: DeserializeSeed<'de>> Visitor<'de> for Name<'_, K> {
    type Value = K::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a field")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<K::Value, E> {
        let Watched { of, read, passed, unknown } = self.0;
        if !read.contains(&name) && !passed.contains(&name) {
            unknown.keep(name);
        }
        of.deserialize(serde::de::value::StrDeserializer::new(name))
    }
}
