//! Scans of a scene by virtual sensors.

mod bundle;
mod hits;
mod psog;
#[cfg(test)]
mod tests;

pub use hits::BeamHits;
pub use psog::scan_scene;
