//! The device that casts the rays of a scanner, until it fails.

use std::sync::{Mutex, OnceLock};

use lidar_cast::bvh::Hit;
use lidar_cast::cast::{Firing, FiringCaster};

/// GPU that casts rays in place of the CPU; none by default.
#[derive(Default)]
pub(super) struct Device {
    caster: Option<Mutex<Box<dyn FiringCaster>>>,
    /// Why it casts no more.
    failure: OnceLock<String>,
}

impl Device {
    /// A device at work.
    pub fn new(caster: Box<dyn FiringCaster>) -> Self {
        Self { caster: Some(Mutex::new(caster)), failure: OnceLock::new() }
    }

    /// True if the device casts.
    pub fn is_at_work(&self) -> bool {
        self.caster.is_some() && self.failure.get().is_none()
    }

    /// Why the device casts no more, where it does not.
    pub fn failure(&self) -> Option<&str> {
        self.failure.get().map(String::as_str)
    }

    /// Closest hits of all rays of firings, in order; none where the host has to cast them.
    ///
    /// `firings` are put together before the device is taken: a thread that holds the device must not take up other
    /// tasks of the pool, which may want the device too.
    pub fn closest_hits<'a>(
        &self,
        range: f32,
        firings: impl FnOnce() -> Vec<Firing<'a>>,
    ) -> Option<Vec<Hit>> {
        let caster = self.caster.as_ref().filter(|_| self.failure.get().is_none())?;
        let firings = firings();
        // A thread that panicked in the driver leaves the lock poisoned.
        let found = match caster.lock() {
            Ok(mut caster) => caster.closest_hits(&firings, range),
            Err(_) => Err("another thread ended while it held the device".to_owned()),
        };
        found.map_err(|why| drop(self.failure.set(why))).ok()
    }
}
