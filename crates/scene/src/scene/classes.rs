//! Class names (the index in the list is the class id everywhere), kinds of actors, and reflectances.

use super::description::{ActorDescription, Dictionary};
use sightline_files::json::check::{self, bad, did_you_mean, refused};
use sightline_files::json::{Checked, DescriptionError, Location, nearest};

/// The 21 classes of a scene that lists none, in the order of CARLA's semantic tags as Place3D
/// prints them; a name's index is its class id.
pub const DEFAULT_CLASSES: [&str; 21] = [
    "building", "fence", "other", "pedestrian", "pole", "road_line", "road", "sidewalk",
    "vegetation", "vehicle", "wall", "traffic_sign", "ground", "bridge", "rail_track",
    "guard_rail", "traffic_light", "static", "dynamic", "water", "terrain",
];

/// Ground by its material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// Road and its markings.
    Road,
    /// Other hard and flat ground, on which water stands.
    Hard,
    /// Soil and grass, which drain.
    Soil,
    /// Bridges: they carry the road.
    Bridge,
}

/// Classes of ground, by the names of the own scenes, of SemanticKITTI and of nuScenes.
const GROUND: [(&str, Ground); 13] = [
    ("road", Ground::Road),
    ("road_line", Ground::Road),
    ("lane-marking", Ground::Road),
    ("driveable_surface", Ground::Road),
    ("parking", Ground::Hard),
    ("sidewalk", Ground::Hard),
    ("ground", Ground::Hard),
    ("other-ground", Ground::Hard),
    ("other_ground", Ground::Hard),
    ("other_flat", Ground::Hard),
    ("rail_track", Ground::Hard),
    ("terrain", Ground::Soil),
    ("bridge", Ground::Bridge),
];

impl Ground {
    /// Ground that a class is; `None` for every other surface.
    pub fn of(class: &str) -> Option<Self> {
        GROUND.iter().find(|(name, _)| *name == class).map(|(_, ground)| *ground)
    }

    /// One for each class: whether it is ground.
    pub fn among(classes: &[String]) -> Vec<bool> {
        classes.iter().map(|class| Self::of(class).is_some()).collect()
    }

    /// All classes of ground, in words.
    pub fn in_words() -> String {
        GROUND.map(|(name, _)| name).join(", ")
    }
}

/// Detection target of a scene without `detection`.
const DETECTION: [&str; 3] = ["vehicle", "car", "moving-car"];

/// Most classes: a P-SOG holds a count for each class and voxel.
const MAX_CLASSES: usize = 256;

/// Class names of a scene, checked.
#[derive(Debug, Clone)]
pub(crate) struct Classes {
    pub names: Vec<String>,
    /// Place and names of the scene's `detection`; `None` takes the defaults.
    detection: Option<(Location, Vec<String>)>,
}

impl Classes {
    /// Checks the `classes` of a scene; `None` takes the defaults. [`Self::check_detection`] checks the
    /// names of `detection`.
    pub(crate) fn new(
        top: &Location,
        names: Option<Vec<String>>,
        detection: Option<Vec<String>>,
    ) -> Checked<Self> {
        let names =
            names.unwrap_or_else(|| DEFAULT_CLASSES.iter().map(|&n| n.to_owned()).collect());
        let at = top.key("classes");
        if names.is_empty() || names.len() > MAX_CLASSES {
            let wanted = format!("1 to {MAX_CLASSES} class names");
            return Err(bad(&at, format!("a list of {}", names.len()), wanted));
        }
        let mut seen = std::collections::HashSet::new();
        for (i, name) in names.iter().enumerate() {
            let blank = name.trim() != name || name.is_empty() || name.len() > 64;
            if blank || name.chars().any(char::is_control) || name == "empty" {
                let wanted = "a class name: 1 to 64 printable characters, no space around, not \
                              `empty` (that class is implied)";
                return Err(bad(&at.item(i), format!("{name:?}"), wanted));
            }
            if !seen.insert(name.as_str()) {
                return Err(bad(&at.item(i), format!("{name:?}"), "a name used once in the list"));
            }
        }
        Ok(Self { names, detection: detection.map(|list| (top.key("detection"), list)) })
    }

    /// Checks that `classes` holds every name of `detection`.
    pub(crate) fn check_detection(&self, classes: &[String]) -> Checked<()> {
        let (at, list) = match &self.detection {
            Some((at, list)) => (at, list.as_slice()),
            None => return Ok(()),
        };
        let missing = list.iter().enumerate().find(|(_, name)| !classes.contains(name));
        missing.map_or(Ok(()), |(i, name)| Err(unknown(&at.item(i), name, classes)))
    }

    /// Ids in `classes` of the detection target, rising.
    pub(crate) fn detection_among(&self, classes: &[String]) -> Vec<u16> {
        let counts = |name: &str| match &self.detection {
            Some((_, list)) => list.iter().any(|n| n == name),
            None => DETECTION.contains(&name),
        };
        (0_u16..).zip(classes).filter(|(_, name)| counts(name)).map(|(id, _)| id).collect()
    }

    pub(crate) fn id(&self, at: &Location, name: &str) -> Checked<u16> {
        let found = self.names.iter().position(|known| known == name);
        found.map(|i| i as u16).ok_or_else(|| unknown(at, name, &self.names))
    }

    /// Like [`Self::id`] for a shape of the own body, which is never ground.
    pub(crate) fn id_of_own(&self, at: &Location, name: &str) -> Checked<u16> {
        self.id(at, name).map_err(|_| {
            let known =
                || self.names.iter().map(String::as_str).filter(|n| Ground::of(n).is_none());
            let usual = known().find(|known| DETECTION.contains(known));
            // Where the usual class is known, nothing far from it is likely meant.
            let is_likely = |near: &String| usual.is_none() || DETECTION.contains(&near.as_str());
            let near = nearest(name, known()).filter(is_likely);
            let usual = usual.filter(|usual| near.as_deref() != Some(*usual));
            let usual = usual.map(|usual| format!("; the own body is usually of class `{usual}`"));
            let (usual, mend) = (usual.unwrap_or_default(), did_you_mean(&near, known()));
            refused(at, format_args!("no class is called `{name}`{usual}{mend}"))
        })
    }
}

fn unknown(at: &Location, name: &str, classes: &[String]) -> DescriptionError {
    check::unknown_name(at, "class", name, classes.iter().map(String::as_str))
}

/// Kind of an actor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ActorKind {
    /// Passenger car.
    Car,
    /// Delivery van.
    Van,
    /// Lorry, with its load.
    Truck,
    /// Bus or tram.
    Bus,
    /// Trailer behind a truck or a car.
    Trailer,
    /// Excavator, crane, forklift and the like.
    Construction,
    /// Motorcycle with its rider.
    Motorcycle,
    /// Bicycle with its rider.
    Bicycle,
    /// Person on foot.
    Pedestrian,
    /// Animal.
    Animal,
    /// Anything else that moves.
    Other,
}

impl ActorKind {
    /// All kinds with their names in scene files.
    const NAMES: [(Self, &'static str); 11] = [
        (Self::Car, "car"),
        (Self::Van, "van"),
        (Self::Truck, "truck"),
        (Self::Bus, "bus"),
        (Self::Trailer, "trailer"),
        (Self::Construction, "construction"),
        (Self::Motorcycle, "motorcycle"),
        (Self::Bicycle, "bicycle"),
        (Self::Pedestrian, "pedestrian"),
        (Self::Animal, "animal"),
        (Self::Other, "other"),
    ];

    /// Name in scene files.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(kind, _)| *kind == self).map_or("other", |(_, name)| name)
    }

    /// True if it goes on wheels or tracks: it heads along its way, and pitches with a slope.
    pub(super) fn rolls(self) -> bool {
        ![Self::Pedestrian, Self::Animal, Self::Other].contains(&self)
    }

    /// The kind of an actor whose first triangle has `class`: as written, or guessed from the class.
    pub(super) fn read(at: &Location, written: Option<&str>, class: Option<&str>) -> Checked<Self> {
        let Some(written) = written else {
            return Ok(match class {
                Some("vehicle" | "car" | "moving-car") => Self::Car,
                Some("pedestrian" | "person" | "moving-person") => Self::Pedestrian,
                _ => Self::Other,
            });
        };
        let found = Self::NAMES.iter().find(|(_, name)| *name == written);
        found.map(|(kind, _)| *kind).ok_or_else(|| {
            let known: Vec<&str> = Self::NAMES.iter().map(|(_, name)| *name).collect();
            bad(at, format!("{written:?}"), format!("a kind of actor: {}", known.join(", ")))
        })
    }
}

/// Reflectances that a scene states, from 0 to 1, of a surface that faces the sensor.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reflectances {
    /// Reflectance by class id; `None` leaves the class at its usual value.
    pub classes: Vec<Option<f64>>,
    /// Reflectance by actor, as listed; `None` leaves the actor at its classes' values.
    pub actors: Vec<Option<f64>>,
}

impl Reflectances {
    /// From `reflectance` of a scene and of its actors.
    pub(super) fn new(
        top: &Location,
        classes: &Classes,
        of_classes: &Dictionary<f64>,
        actors: &[ActorDescription],
    ) -> Checked<Self> {
        let (at, mut by_class) = (top.key("reflectance"), vec![None; classes.names.len()]);
        for (name, value) in &of_classes.0 {
            let at = at.key(name);
            by_class[usize::from(classes.id(&at, name)?)] = Some(share(&at, *value)?);
        }
        let of_actor = |(i, actor): (usize, &ActorDescription)| {
            let at = top.key("actors").item(i).key("reflectance");
            actor.reflectance.map(|value| share(&at, value)).transpose()
        };
        let actors = actors.iter().enumerate().map(of_actor).collect::<Result<_, _>>()?;
        Ok(Self { classes: by_class, actors })
    }
}

fn share(at: &Location, value: f64) -> Checked<f64> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    let wanted = "the share of light that the surface sends back, from 0 to 1; asphalt has 0.26";
    Err(bad(at, value, wanted))
}
