//! Tags of CARLA and their classes, by number in two versions and by name.

use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES};

/// Version of CARLA whose numbers the tags of a scan are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CarlaTags {
    /// 0.9.10 to 0.9.13: 0 to 22.
    Until0913,
    /// 0.9.14 and later: 0 to 28, of CityScapes' order.
    Since0914,
}

/// Meaning of a tag: its class, whether boxes are drawn around its things, their kind.
pub(in super::super) type Tag = (Option<u16>, bool, ActorKind);

#[rustfmt::skip]
const UNTIL_0913: [&str; 23] = [
    "Unlabeled", "Building", "Fence", "Other", "Pedestrian", "Pole", "RoadLine", "Road", "SideWalk",
    "Vegetation", "Vehicles", "Wall", "TrafficSign", "Sky", "Ground", "Bridge", "RailTrack",
    "GuardRail", "TrafficLight", "Static", "Dynamic", "Water", "Terrain",
];

#[rustfmt::skip]
const SINCE_0914: [&str; 29] = [
    "Unlabeled", "Roads", "SideWalks", "Building", "Wall", "Fence", "Pole", "TrafficLight",
    "TrafficSign", "Vegetation", "Terrain", "Sky", "Pedestrian", "Rider", "Car", "Truck", "Bus",
    "Train", "Motorcycle", "Bicycle", "Static", "Dynamic", "Other", "Water", "RoadLine", "Ground",
    "Bridge", "RailTrack", "GuardRail",
];

/// Class and kind of things that move, by the name without the s of a plural.
const THINGS: [(&str, &str, ActorKind); 9] = [
    ("pedestrian", "pedestrian", ActorKind::Pedestrian),
    ("rider", "pedestrian", ActorKind::Pedestrian),
    ("vehicle", "vehicle", ActorKind::Car),
    ("car", "vehicle", ActorKind::Car),
    ("truck", "vehicle", ActorKind::Truck),
    ("bu", "vehicle", ActorKind::Bus),
    ("train", "vehicle", ActorKind::Bus),
    ("motorcycle", "vehicle", ActorKind::Motorcycle),
    ("bicycle", "vehicle", ActorKind::Bicycle),
];

impl CarlaTags {
    /// Names by number.
    pub(in super::super) fn names(self) -> &'static [&'static str] {
        match self {
            Self::Until0913 => &UNTIL_0913,
            Self::Since0914 => &SINCE_0914,
        }
    }

    /// The first version that has these tags.
    pub(super) fn version(self) -> &'static str {
        match self {
            Self::Until0913 => "0.9.10",
            Self::Since0914 => "0.9.14",
        }
    }
}

/// Names of all tags, each once.
pub(in super::super) fn tag_names() -> impl Iterator<Item = &'static str> {
    let new = SINCE_0914.iter().filter(|name| !UNTIL_0913.contains(name));
    UNTIL_0913.iter().chain(new).copied()
}

/// The meaning of a tag's name, however it is spelt: `RoadLine`, `road_line`, and `RoadLines` as sets of
/// Place3D have it.
pub(in super::super) fn class_of_name(name: &str) -> Option<Tag> {
    let plain = |name: &str| -> String {
        let letters = name.chars().filter(char::is_ascii_alphanumeric).collect::<String>();
        letters.to_ascii_lowercase().trim_end_matches('s').to_owned()
    };
    let name = plain(name);
    if ["unlabeled", "none", "sky"].contains(&name.as_str()) {
        return Some((None, false, ActorKind::Other));
    }
    let thing = THINGS.iter().find(|(known, ..)| *known == name);
    let (class, kind) = thing.map_or((&*name, ActorKind::Other), |&(_, class, kind)| (class, kind));
    let class = DEFAULT_CLASSES.iter().position(|known| plain(known) == class)?;
    let boxed = ["pedestrian", "vehicle"].contains(&DEFAULT_CLASSES[class]);
    Some((Some(class as u16), boxed, kind))
}
