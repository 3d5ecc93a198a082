//! Scans of a scene by virtual sensors.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod conditions;
mod fires;
mod hits;
mod optics;
mod psog;
mod receiver;
mod record;
mod rim;
mod rings;
mod scanner;
mod stage;
mod station;
mod sweep;
#[cfg(test)]
mod tests;
mod visibility;

pub use hits::BeamHits;
pub use psog::scan_scene;
pub use record::{
    BOX_MARGIN, EGO_INSTANCE, NO_CLASS, NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox,
};
pub use scanner::{Scanner, Scanning};
pub use stage::Stage;
pub use visibility::in_conditions;

use lidar_cast::memory::OutOfMemory;
use sightline_scene::vehicle::{SensorError, UnknownSensor};

/// Why a scene cannot be scanned, or not under its conditions.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum ScanError {
    /// There is nothing to scan.
    #[error("the scene `{scene}` has no geometry; a scan needs `static`, `actors` or a body")]
    NoGeometry { scene: String },
    /// Instances are numbers of 16 bits.
    #[error(
        "the scene `{scene}` has {actors} actors, a scan tells at most 65534 apart; leave some out"
    )]
    TooManyActors { scene: String, actors: usize },
    /// A sensor of a model that the vehicle does not have.
    UnknownSensor(#[from] UnknownSensor),
    /// A model without beams.
    Sensor(#[from] SensorError),
    /// A condition of an ideal scan.
    #[error(
        "the condition `{condition}` acts on beams, of which an ideal scan has the geometry alone; leave out one \
         of the two"
    )]
    Ideal { condition: String },
    /// Beams that end at nothing send nothing back.
    #[error(
        "the scene `{scene}` has no geometry that ends beams (coverage `through`); conditions need \
         `\"coverage\": \"first-hit\"`"
    )]
    Through { scene: String },
    /// There is no condition of that name.
    #[error(
        "there is no condition `{name}`; known are fog, wet, snow, rain, blur, crosstalk and echo, with values behind a \
         colon, as in fog:mor=200"
    )]
    UnknownCondition { name: String },
    #[error("`{part}` in the condition `{text}` is no KEY=VALUE; {condition} takes {known}")]
    NoPair { part: String, text: String, condition: &'static str, known: String },
    /// A key that the condition does not have.
    #[error("{condition} has no key `{key}`; it takes {known}{hint}")]
    UnknownKey { key: String, condition: &'static str, known: String, hint: &'static str },
    /// A key given more than once.
    #[error("the condition `{text}` gives `{key}` twice; give it once")]
    RepeatedKey { key: String, text: String },
    /// A word that is no level.
    #[error("`level={value}` of {condition}: `{value}` is not one of {known}")]
    UnknownLevel { value: String, condition: &'static str, known: String },
    /// A value that is no number or outside of its limits.
    #[error("`{key}={value}` of {condition}: wanted is {limits}")]
    BadNumber { key: &'static str, value: String, condition: &'static str, limits: String },
    /// A condition given twice.
    #[error("the condition {condition} is given twice; give it once")]
    Repeated { condition: &'static str },
    /// The trees do not fit into memory.
    OutOfMemory(#[from] OutOfMemory),
}
