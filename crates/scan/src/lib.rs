//! Scans of a scene by virtual sensors.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

#[cfg(test)]
#[macro_use]
extern crate sightline_files;

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
pub enum ScanError {
    /// A sensor of a model that the vehicle does not have.
    UnknownSensor(#[from] UnknownSensor),
    /// A model without beams.
    Sensor(#[from] SensorError),
    /// A scene or a condition that makes no scan; the sentence tells the mend.
    #[error("{0}")]
    Refused(String),
    /// The trees do not fit into memory.
    OutOfMemory(#[from] OutOfMemory),
}
