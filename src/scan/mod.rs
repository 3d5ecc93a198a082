//! Scans of a scene by virtual sensors.

mod chance;
pub mod conditions;
mod echoes;
mod hits;
mod psog;
mod receiver;
mod record;
mod reflectance;
mod rings;
mod scanner;
mod stage;
mod sweep;

pub use hits::BeamHits;
pub use psog::scan_scene;
pub use record::{
    EGO_INSTANCE, NO_CLASS, NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox,
};
pub use scanner::{ScanError, Scanner, Scanning};
#[cfg(test)]
mod tests;
