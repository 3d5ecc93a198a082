//! Class names: the index in the list is the class id everywhere.

use super::check::bad;
use super::error::{Place, SceneError, nearest};

/// The 21 classes of a scene that lists none, in the order of CARLA's semantic tags as Place3D
/// prints them; a name's index is its class id.
pub const DEFAULT_CLASSES: [&str; 21] = [
    "building",
    "fence",
    "other",
    "pedestrian",
    "pole",
    "road_line",
    "road",
    "sidewalk",
    "vegetation",
    "vehicle",
    "wall",
    "traffic_sign",
    "ground",
    "bridge",
    "rail_track",
    "guard_rail",
    "traffic_light",
    "static",
    "dynamic",
    "water",
    "terrain",
];

/// Names that count as the detection target when a scene does not say.
const DETECTION: [&str; 3] = ["vehicle", "car", "moving-car"];

/// More classes than any data set has; P-SOG files hold a count for each of them.
const MAX_CLASSES: usize = 256;

/// Class names of a scene, checked.
#[derive(Debug, Clone)]
pub(crate) struct Classes {
    pub names: Vec<String>,
    /// Ids of the detection target, rising.
    pub detection: Vec<u16>,
}

impl Classes {
    /// Checks the `classes` and `detection` lists of a scene; `None` takes the defaults.
    pub fn new(
        top: &Place,
        names: Option<Vec<String>>,
        detection: Option<&[String]>,
    ) -> Result<Self, SceneError> {
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
        let mut classes = Self { names, detection: Vec::new() };
        let mut ids = match detection {
            None => DETECTION.iter().filter_map(|n| classes.find(n)).collect(),
            Some(list) => {
                let at = top.key("detection");
                let ids = list.iter().enumerate().map(|(i, n)| classes.id(&at.item(i), n));
                ids.collect::<Result<Vec<_>, _>>()?
            }
        };
        ids.sort_unstable();
        ids.dedup();
        classes.detection = ids;
        Ok(classes)
    }

    fn find(&self, name: &str) -> Option<u16> {
        self.names.iter().position(|n| n == name).map(|i| i as u16)
    }

    /// The id of `name`, which stands at `at`.
    pub fn id(&self, at: &Place, name: &str) -> Result<u16, SceneError> {
        self.find(name).ok_or_else(|| SceneError::UnknownName {
            at: Box::new(at.clone()),
            kind: "class",
            name: name.to_owned(),
            nearest: nearest(name, self.names.iter().map(String::as_str)),
            known: self.names.clone(),
        })
    }
}
