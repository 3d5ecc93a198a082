//! Scans of a scene by virtual sensors.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod chance;
pub mod conditions;
mod device;
mod echoes;
mod error;
mod fires;
mod hits;
mod hull;
mod optics;
mod psog;
mod rays;
mod receiver;
mod record;
mod reflectance;
mod rim;
mod rings;
mod scanner;
mod stage;
mod station;
mod sweep;
mod visibility;

pub use error::ScanError;
pub use hits::BeamHits;
pub use psog::scan_scene;
pub use record::{
    BOX_MARGIN, EGO_INSTANCE, NO_CLASS, NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox,
};
pub use scanner::{Scanner, Scanning};
pub use stage::Stage;
pub use visibility::{VisibilityError, in_conditions};
#[cfg(test)]
mod tests;
