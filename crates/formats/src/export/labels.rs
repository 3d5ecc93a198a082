//! Labels of SemanticKITTI and nuScenes lidarseg for classes and kinds of actors.

use std::collections::HashMap;

use super::{ExportError, SceneFacts};
use sightline_files::json::nearest;
use sightline_scan::{EGO_INSTANCE, Return, TrackedBox};
use sightline_scene::scene::ActorKind;

/// Metres a second from which on an actor moves.
pub(super) const MOVES: f64 = 0.3;

/// A label in both formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Label {
    /// Id in `semantic-kitti.yaml`.
    pub kitti: u16,
    /// Id in `semantic-kitti.yaml` for a moving thing.
    pub kitti_moving: u16,
    /// Index of the category of nuScenes lidarseg.
    pub nuscenes: u8,
}

const fn still(kitti: u16, nuscenes: u8) -> Label {
    Label { kitti, kitti_moving: kitti, nuscenes }
}

const fn moving(kitti: u16, kitti_moving: u16, nuscenes: u8) -> Label {
    Label { kitti, kitti_moving, nuscenes }
}

/// Fog, snow, rain and crosstalk.
const NOISE: Label = still(0, 0);
/// Own body: an outlier of SemanticKITTI.
const EGO: Label = still(1, 31);

/// Classes of scenes by name: the 21 default classes, SemanticKITTI's, and common names of actors in scenes.
const CLASSES: [(&str, Label); 58] = [
    ("building", still(50, 28)),
    ("fence", still(51, 28)),
    ("other", still(99, 29)),
    ("pedestrian", moving(30, 254, 2)),
    ("pole", still(80, 28)),
    ("road_line", still(60, 24)),
    ("road", still(40, 24)),
    ("sidewalk", still(48, 26)),
    ("vegetation", still(70, 30)),
    ("vehicle", moving(10, 252, 17)),
    // Small walls and crash barriers count as fences.
    ("wall", still(51, 28)),
    ("traffic_sign", still(81, 28)),
    ("ground", still(49, 25)),
    ("bridge", still(52, 28)),
    ("rail_track", still(49, 25)),
    ("guard_rail", still(51, 28)),
    ("traffic_light", still(99, 28)),
    ("static", still(99, 29)),
    ("dynamic", still(99, 10)),
    ("water", still(0, 25)),
    ("terrain", still(72, 27)),
    ("unlabeled", still(0, 0)),
    ("outlier", still(1, 0)),
    ("car", moving(10, 252, 17)),
    ("van", moving(10, 252, 17)),
    ("bicycle", moving(11, 253, 14)),
    ("bus", moving(13, 257, 16)),
    ("motorcycle", moving(15, 255, 21)),
    ("on-rails", moving(16, 256, 16)),
    ("truck", moving(18, 258, 23)),
    ("trailer", moving(20, 259, 22)),
    ("construction", moving(20, 259, 18)),
    ("other-vehicle", moving(20, 259, 18)),
    ("person", moving(30, 254, 2)),
    ("bicyclist", moving(31, 253, 14)),
    ("motorcyclist", moving(32, 255, 21)),
    ("animal", still(99, 1)),
    ("parking", still(44, 24)),
    ("other-ground", still(49, 25)),
    ("other-structure", still(52, 28)),
    ("lane-marking", still(60, 24)),
    ("trunk", still(71, 30)),
    ("traffic-sign", still(81, 28)),
    ("other-object", still(99, 29)),
    ("moving-car", still(252, 17)),
    ("moving-bicyclist", still(253, 14)),
    ("moving-person", still(254, 2)),
    ("moving-motorcyclist", still(255, 21)),
    ("moving-on-rails", still(256, 16)),
    ("moving-bus", still(257, 16)),
    ("moving-truck", still(258, 23)),
    ("moving-other-vehicle", still(259, 18)),
    ("sky", still(0, 0)),
    ("grass", still(72, 27)),
    ("tree", still(70, 30)),
    ("barrier", still(51, 9)),
    ("traffic_cone", still(99, 12)),
    ("curb", still(48, 26)),
];

/// Label of an actor whose kind says more than its classes; `None` leaves it to these.
pub(super) fn of_kind(kind: ActorKind) -> Option<Label> {
    Some(match kind {
        ActorKind::Car | ActorKind::Van => moving(10, 252, 17),
        ActorKind::Truck => moving(18, 258, 23),
        ActorKind::Bus => moving(13, 257, 16),
        ActorKind::Trailer => moving(20, 259, 22),
        ActorKind::Construction => moving(20, 259, 18),
        ActorKind::Motorcycle => moving(15, 255, 21),
        ActorKind::Bicycle => moving(11, 253, 14),
        ActorKind::Pedestrian => moving(30, 254, 2),
        ActorKind::Animal => still(99, 1),
        ActorKind::Other => return None,
    })
}

/// Checks that every class that is mapped is one of a scene.
///
/// # Errors
/// A class that no scene has.
pub(super) fn check_map(
    scenes: &[SceneFacts],
    map: &[(String, String)],
) -> Result<(), ExportError> {
    let mut known: Vec<&str> =
        scenes.iter().flat_map(|scene| &scene.classes).map(String::as_str).collect();
    known.sort_unstable();
    known.dedup();
    for (k, (class, second)) in map.iter().enumerate() {
        if let Some((_, first)) = map[..k].iter().find(|(other, _)| other == class) {
            let [class, first, second] = [class, first, second].map(String::clone);
            return Err(ExportError::MappedTwice { class, first, second });
        }
    }
    let Some((class, to)) = map.iter().find(|(class, _)| !known.contains(&class.as_str())) else {
        return Ok(());
    };
    Err(ExportError::UnknownClass {
        class: class.clone(),
        to: to.clone(),
        nearest: nearest(class, known.iter().copied()),
        known: known.into_iter().map(str::to_owned).collect(),
    })
}

/// Labels of the classes of a scene, in their order.
///
/// # Errors
/// A class without a label, a map to a class without one.
pub(super) fn of_classes(
    scene: &SceneFacts,
    map: &[(String, String)],
) -> Result<Vec<Label>, ExportError> {
    let known: HashMap<&str, Label> = CLASSES.into_iter().collect();
    for (class, to) in map {
        if !known.contains_key(to.as_str()) {
            return Err(ExportError::UnknownTarget { class: class.clone(), to: to.clone() });
        }
    }
    let label = |class: &String| {
        let mapped = map.iter().find(|(from, _)| from == class).map_or(class, |(_, to)| to);
        known.get(mapped.as_str()).copied().ok_or_else(|| ExportError::UnmappedClass {
            scene: scene.name.clone(),
            class: class.clone(),
        })
    };
    scene.classes.iter().map(label).collect()
}

/// Labels of the points of a scan.
pub(super) struct PointLabels<'a> {
    classes: &'a [Label],
    /// Label of its kind, and whether it moves, by instance.
    actors: Vec<Option<(Option<Label>, bool)>>,
}

impl<'a> PointLabels<'a> {
    pub fn new(classes: &'a [Label], boxes: &[TrackedBox]) -> Self {
        let most = boxes.iter().map(|tracked| usize::from(tracked.instance)).max();
        let mut actors = vec![None; most.map_or(0, |most| most + 1)];
        for tracked in boxes {
            let moves = tracked.velocity.length() > MOVES;
            actors[usize::from(tracked.instance)] = Some((of_kind(tracked.kind), moves));
        }
        Self { classes, actors }
    }

    fn of(&self, point: &Return) -> (Label, bool) {
        let Some(&class) = self.classes.get(usize::from(point.class)) else {
            return (NOISE, false);
        };
        if point.instance == EGO_INSTANCE {
            return (EGO, false);
        }
        match self.actors.get(usize::from(point.instance)) {
            Some(&Some((kind, moves))) => (kind.unwrap_or(class), moves),
            _ => (class, false),
        }
    }

    /// The `u32` of a SemanticKITTI label: id below, instance above.
    pub fn kitti(&self, point: &Return) -> u32 {
        let (label, moves) = self.of(point);
        let id = if moves { label.kitti_moving } else { label.kitti };
        let is_noise = usize::from(point.class) >= self.classes.len();
        let instance = if is_noise || label == EGO { 0 } else { point.instance };
        u32::from(instance) << 16 | u32::from(id)
    }

    /// Index of the category of nuScenes lidarseg.
    pub fn nuscenes(&self, point: &Return) -> u8 {
        self.of(point).0.nuscenes
    }
}
