//! Scans of a scene by virtual sensors.

mod hits;
mod psog;
mod rings;

pub use hits::BeamHits;
pub use psog::scan_scene;
