//! Scans of a scene by virtual sensors.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod conditions;
mod error;
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

pub use error::ScanError;
pub use hits::BeamHits;
pub use psog::scan_scene;
pub use record::{
    BOX_MARGIN, EGO_INSTANCE, NO_CLASS, NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox,
};
pub use scanner::{Scanner, Scanning};
pub use stage::Stage;
pub use visibility::in_conditions;
