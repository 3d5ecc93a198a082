//! A backend that goes on after its device is lost: on the same device, then on the CPU.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::{Backend, BackendError, TakeBitmap};
use crate::bvh::Hit;
use crate::cover::BitOrder;
use crate::sensor::{Placement, SensorPose};
use crate::task::{StageTimes, Tally};

/// Losses after which the device is not opened again.
const MOST_LOSSES: u32 = 3;

/// Opens the device again.
pub type Reopen = Box<dyn FnMut() -> Result<Box<dyn Backend>, BackendError> + Send>;

/// A backend that outlives its device.
///
/// A batch that failed is repeated on the same device, opened again; if that fails too, or after three
/// losses, on the CPU. Earlier scores stay. Both give the same bits, so only [`Backend::changes`] tells of the
/// change. Other errors, such as a frame that does not exist, are handed on; so is a placement too large for
/// the device, unless [`Self::cpu_for_too_large`] was called.
pub struct Failover {
    backend: Box<dyn Backend>,
    on_cpu: bool,
    /// True if the CPU takes placements too large for the device.
    takes_too_large: bool,
    reopen: Reopen,
    cpu: Box<dyn Fn() -> Box<dyn Backend> + Send>,
    note: Box<dyn Fn(&str) + Send>,
    changes: Vec<String>,
    /// Times of the backends that are gone.
    past: StageTimes,
}

impl Failover {
    /// Goes on with `reopen` and then with `cpu` when `backend` loses its device; `note` is told.
    pub fn new(
        backend: Box<dyn Backend>,
        reopen: Reopen,
        cpu: impl Fn() -> Box<dyn Backend> + Send + 'static,
        note: impl Fn(&str) + Send + 'static,
    ) -> Self {
        Self {
            backend,
            on_cpu: false,
            takes_too_large: false,
            reopen,
            cpu: Box::new(cpu),
            note: Box::new(note),
            changes: Vec::new(),
            past: StageTimes::default(),
        }
    }

    /// Lets the CPU take placements too large for the device, if `--backend auto` chose the device.
    pub fn cpu_for_too_large(mut self) -> Self {
        self.takes_too_large = true;
        self
    }

    fn attempt<T>(
        &mut self,
        work: impl Fn(&mut dyn Backend) -> Result<T, BackendError>,
    ) -> Result<T, BackendError> {
        let mut again = false;
        loop {
            match work(&mut *self.backend) {
                Err(BackendError::Device { adapter, stage, message }) if !self.on_cpu => {
                    self.replace(format!("`{adapter}` failed at {stage}: {message}"), again);
                    again = true;
                }
                Err(error @ BackendError::TooLarge { .. })
                    if self.takes_too_large && !self.on_cpu =>
                {
                    self.replace(format!("too large for `{}`: {error}", self.adapter()), true);
                }
                result => return result,
            }
        }
    }

    /// Takes the next backend after a failure: the device opened again, or the CPU if it failed `again`.
    fn replace(&mut self, mut why: String, again: bool) {
        self.past += self.backend.times();
        let lost = std::mem::replace(&mut self.backend, (self.cpu)());
        // Dropped first, so that both never hold memory at once; dropping a lost device may panic in the
        // driver's wrapper.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(lost)));
        self.on_cpu = true;
        if !again && self.changes.len() < MOST_LOSSES as usize {
            match (self.reopen)() {
                Ok(backend) => (self.backend, self.on_cpu) = (backend, false),
                Err(error) => why = format!("{why}; opening it again: {error}"),
            }
        }
        let on = if self.on_cpu { "on the CPU" } else { "on the same device, opened again" };
        let change = format!("{why}; the batch is repeated {on}, scores so far are kept");
        (self.note)(&change);
        self.changes.push(change);
    }
}

impl Backend for Failover {
    fn name(&self) -> &'static str {
        self.backend.name()
    }

    fn adapter(&self) -> &str {
        self.backend.adapter()
    }

    fn tally(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Tally>, BackendError> {
        self.attempt(|backend| backend.tally(placements, range))
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        self.attempt(|backend| backend.hits(poses, frame))
    }

    fn order(&self) -> BitOrder {
        self.backend.order()
    }

    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<(), BackendError> {
        self.attempt(|backend| backend.each_bitmap(poses, frame, take))
    }

    fn times(&self) -> StageTimes {
        let mut times = self.past;
        times += self.backend.times();
        times
    }

    fn changes(&self) -> &[String] {
        &self.changes
    }
}
