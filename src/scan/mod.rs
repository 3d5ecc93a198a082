//! Scans of a scene by virtual sensors.

mod hits;
mod psog;
mod record;
mod rings;

pub use hits::BeamHits;
pub use psog::scan_scene;
pub use record::{
    EGO_INSTANCE, NO_CLASS, NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox,
};
