//! Scans of a scene by virtual sensors.

mod bundle;
mod psog;
#[cfg(test)]
mod tests;

pub use psog::scan_scene;
