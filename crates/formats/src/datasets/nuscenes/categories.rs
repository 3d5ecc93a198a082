//! Categories of lidarseg: the 32 of nuScenes, and tags of CARLA by name as sets made there have them.

use super::super::carla::{class_of_name, tag_names};
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES};

/// Meaning of a category.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Category {
    /// Position in the default classes of scenes; `None` does not vote.
    pub class: Option<u16>,
    /// A thing that the data set draws boxes around.
    pub boxed: bool,
    /// Kind as an actor.
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
pub(super) fn category(name: &str) -> Option<Category> {
    let Some(&(_, class, kind)) = NUSCENES.iter().find(|(known, ..)| *known == name) else {
        return class_of_name(name).map(|(class, boxed, kind)| Category { class, boxed, kind });
    };
    let class = DEFAULT_CLASSES.iter().position(|known| *known == class);
    let boxed = ["animal", "human.", "movable_object.", "static_object.", "vehicle."];
    let boxed = boxed.iter().any(|start| name.starts_with(start));
    Some(Category { class: class.map(|class| class as u16), boxed, kind })
}

/// Names that are known.
pub(super) fn known() -> Vec<String> {
    NUSCENES.iter().map(|(name, ..)| *name).chain(tag_names()).map(str::to_owned).collect()
}
