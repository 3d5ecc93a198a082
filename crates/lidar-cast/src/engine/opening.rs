//! Opens the engine that the user requested for a task, and another one after its device is lost.
//!
//! A [`Failover`] goes on after a loss on the same device, then on the CPU.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Backend, BackendError, CpuBackend, Result, TakeBitmap};
use crate::bvh::{Bvh, Hit};
use crate::cast::FiringCaster;
use crate::cover::BitOrder;
use crate::memory::available_memory;
use crate::sensor::{Placement, SensorPose};
use crate::task::{StageTimes, Tally, Task};

/// Bytes taken as free where the system does not tell.
const SMALL_MACHINE: u64 = 2 << 30;

/// Which engine computes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EngineKind {
    /// The best hardware device, or the CPU where there is none.
    #[default]
    Auto,
    /// The best Vulkan device, software among them.
    Gpu,
    /// The host processor.
    Cpu,
}

/// Requested engine.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct EngineChoice {
    /// Which engine.
    pub kind: EngineKind,
    /// Part of the name of the Vulkan device to take.
    pub adapter: Option<String>,
    /// Bytes that work buffers may take; `None` takes half of the free memory.
    pub memory: Option<u64>,
    /// True takes a device that fails its self-test, too: its name then says so in every result.
    pub inexact: bool,
}

impl EngineChoice {
    /// The CPU, with half of the free memory.
    pub fn cpu() -> Self {
        Self { kind: EngineKind::Cpu, ..Self::default() }
    }

    /// Checks that there is a device of the name that was given, without opening it.
    ///
    /// # Errors
    /// There is none.
    pub fn check_adapter(&self) -> Result<()> {
        let is_named = |name: &String| self.kind == EngineKind::Cpu || device::is_named(name);
        match &self.adapter {
            Some(name) if !is_named(name) => {
                Err(BackendError::NoDevice { name: Some(name.clone()) })
            }
            _ => Ok(()),
        }
    }

    /// Bytes that work buffers may take.
    pub fn memory_budget(&self) -> u64 {
        self.memory.unwrap_or_else(|| available_memory().unwrap_or(SMALL_MACHINE) / 2)
    }
}

/// An open engine, and sentences about it.
pub struct OpenedEngine {
    /// CPU or GPU engine, ready to score.
    pub engine: Box<dyn Backend>,
    /// Sentences for the user: which device, and why not another.
    pub notes: Vec<String>,
}

/// Opens the requested engine. A device lost while it computes is replaced, and `on_change` gets a sentence.
///
/// # Errors
/// The requested device is missing, or cannot hold the task.
pub fn open(
    task: &Arc<Task>,
    choice: &EngineChoice,
    on_change: impl Fn(&str) + Send + 'static,
) -> Result<OpenedEngine> {
    let mut notes = Vec::new();
    let cpu = || Box::new(CpuBackend::new(task.clone(), choice.memory_budget()));
    let engine: Box<dyn Backend> = match choice.kind {
        EngineKind::Cpu => cpu(),
        EngineKind::Auto if choice.adapter.is_none() => {
            let opened = match device::no_hardware() {
                Some(why) => Err(why),
                None => device::open(task, choice, on_change)
                    .map_err(|error| format!("computing on the CPU: {error}")),
            };
            match opened {
                Ok(device) => Box::new(device.cpu_for_too_large()),
                Err(why) => {
                    notes.push(why);
                    cpu()
                }
            }
        }
        // A requested device is not silently replaced by the CPU.
        _ => Box::new(device::open(task, choice, on_change)?),
    };
    notes.push(format!("computing on {}: {}", engine.name(), engine.adapter()));
    Ok(OpenedEngine { engine, notes })
}

/// Casts the rays of a scanner on a device; nothing where the host casts.
#[derive(Default)]
pub struct OpenedCaster {
    /// The device.
    pub caster: Option<Box<dyn FiringCaster>>,
    /// Sentence for the user: the device that casts, or the reason for which none does.
    pub note: Option<String>,
}

/// Opens the requested device for the rays of a scanner among some trees. Later steps run on the host, so scans have
/// equal bits on all devices.
///
/// # Errors
/// The requested device is missing or fails.
pub fn open_caster(trees: &[&Arc<Bvh>], choice: &EngineChoice) -> Result<OpenedCaster> {
    let host = |note| OpenedCaster { caster: None, note };
    match choice.kind {
        EngineKind::Cpu => Ok(host(None)),
        EngineKind::Auto if choice.adapter.is_none() => match device::no_hardware() {
            Some(why) => Ok(host(Some(why))),
            None => Ok(device::caster(trees, choice)
                .unwrap_or_else(|error| host(Some(format!("computing on the CPU: {error}"))))),
        },
        _ => device::caster(trees, choice),
    }
}

/// Devices, and engines that take the place of lost ones.
#[cfg(feature = "gpu")]
mod device {
    use std::sync::Arc;

    use super::{EngineChoice, OpenedCaster};
    use crate::bvh::Bvh;
    use crate::engine::gpu::{GpuBackend, GpuFirings, list_adapters};
    use crate::engine::{Backend, CpuBackend, Failover, Result};
    use crate::task::Task;

    /// A sentence that says why there is no hardware device; none where there is one.
    pub(super) fn no_hardware() -> Option<String> {
        match list_adapters().first() {
            None => Some("computing on the CPU: there is no Vulkan device".into()),
            Some(best) if best.auto => None,
            Some(best) => Some(format!(
                "computing on the CPU: no hardware Vulkan device; --backend gpu would take the software \
                 device `{}`",
                best.name
            )),
        }
    }

    /// True if a device has a name with such a part.
    pub(super) fn is_named(part: &str) -> bool {
        let part = part.to_lowercase();
        list_adapters().iter().any(|adapter| adapter.name.to_lowercase().contains(&part))
    }

    /// The device for the rays of a scanner, and which it is.
    pub(super) fn caster(trees: &[&Arc<Bvh>], choice: &EngineChoice) -> Result<OpenedCaster> {
        let firings = GpuFirings::new(trees, choice)?;
        let note = Some(format!("casting on gpu: {}", firings.adapter()));
        Ok(OpenedCaster { caster: Some(Box::new(firings)), note })
    }

    /// The requested device, which is opened again after a loss.
    pub(super) fn open(
        task: &Arc<Task>,
        choice: &EngineChoice,
        on_change: impl Fn(&str) + Send + 'static,
    ) -> Result<Failover> {
        let (choice, memory) = (choice.clone(), choice.memory_budget());
        let first = doomed(GpuBackend::open(task.clone(), &choice, memory)?);
        let (for_gpu, for_cpu) = (task.clone(), task.clone());
        let reopen = move || -> Result<Box<dyn Backend>> {
            Ok(Box::new(GpuBackend::open(for_gpu.clone(), &choice, memory)?))
        };
        let cpu =
            move || -> Box<dyn Backend> { Box::new(CpuBackend::new(for_cpu.clone(), memory)) };
        Ok(Failover::new(Box::new(first), Box::new(reopen), cpu, on_change))
    }

    /// A drill: `SIGHTLINE_LOSE_DEVICE_AFTER=N` destroys the first device after N batches, so that anybody
    /// can see how a run survives.
    fn doomed(mut gpu: GpuBackend) -> GpuBackend {
        let batches = std::env::var("SIGHTLINE_LOSE_DEVICE_AFTER").ok();
        if let Some(batches) = batches.and_then(|text| text.parse().ok()) {
            gpu.lose_device_after(batches);
        }
        gpu
    }
}

/// Without the feature `gpu` there is no device.
#[cfg(not(feature = "gpu"))]
mod device {
    use std::sync::Arc;

    use super::{EngineChoice, OpenedCaster};
    use crate::bvh::Bvh;
    use crate::engine::{BackendError, Failover, Result};
    use crate::task::Task;

    pub(super) fn no_hardware() -> Option<String> {
        Some("computing on the CPU: this build is without the feature `gpu`".into())
    }

    pub(super) fn is_named(_: &str) -> bool {
        false
    }

    pub(super) fn caster(_: &[&Arc<Bvh>], choice: &EngineChoice) -> Result<OpenedCaster> {
        Err(BackendError::NoDevice { name: choice.adapter.clone() })
    }

    pub(super) fn open(
        _: &Arc<Task>,
        choice: &EngineChoice,
        _: impl Fn(&str) + Send + 'static,
    ) -> Result<Failover> {
        Err(BackendError::NoDevice { name: choice.adapter.clone() })
    }
}

/// Losses after which the device is not opened again.
const MOST_LOSSES: u32 = 3;

/// Opens the device again.
type Reopen = Box<dyn FnMut() -> Result<Box<dyn Backend>> + Send>;

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

    fn attempt<T>(&mut self, work: impl Fn(&mut dyn Backend) -> Result<T>) -> Result<T> {
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

    fn tally(&mut self, placements: &[Placement], range: Option<f32>) -> Result<Vec<Tally>> {
        self.attempt(|backend| backend.tally(placements, range))
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>> {
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
    ) -> Result<()> {
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
