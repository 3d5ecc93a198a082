//! Vulkan devices of this machine, best first, and an open one: its errors, its buffers, and writes to them.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde::Serialize;

use super::stages::Stamps;
use crate::engine::{BackendError, Result};

/// An open device. Errors of the driver wait here for [`Self::check`], instead of wgpu's default, a panic.
pub(super) struct Device {
    pub(super) wgpu: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) adapter: String,
    pub(super) software: bool,
    failure: Arc<Mutex<Option<String>>>,
    /// Buffers for copies to the host, kept from one to the next.
    pub(super) staging: Mutex<Vec<wgpu::Buffer>>,
    /// Times of a step; `None` on a device that tells none.
    pub(super) stamps: Option<Stamps>,
    traffic: Mutex<TransferCounts>,
}

/// Exchanges between host and device so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TransferCounts {
    /// Lists of commands handed to the device.
    pub submissions: u64,
    /// Times that the host waited for the device.
    pub waits: u64,
    /// Bytes that the host wrote to buffers.
    pub bytes_up: u64,
    /// Bytes that it read back.
    pub bytes_down: u64,
    /// Time that the device says it worked at whole steps.
    pub busy: Duration,
}

impl Device {
    /// Opens the best device, or the one whose name contains `name`, whatever it is good for.
    pub(super) fn open(name: Option<&str>) -> Result<Self> {
        let wanted = name.map(str::to_lowercase);
        let adapter = ranked_adapters(&instance())
            .into_iter()
            .find(|adapter| match &wanted {
                Some(part) => adapter.get_info().name.to_lowercase().contains(part),
                None => true,
            })
            .ok_or_else(|| BackendError::NoDevice { name: name.map(str::to_owned) })?;
        Self::of(&adapter)
    }

    /// Opens a device.
    pub(super) fn of(adapter: &wgpu::Adapter) -> Result<Self> {
        let info = adapter.get_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("sightline"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let request = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = request.map_err(|error| BackendError::Device {
            adapter: info.name.clone(),
            stage: "opening it",
            message: error.to_string(),
        })?;
        let failure = Arc::new(Mutex::new(None));
        let keep = |failure: &Arc<Mutex<Option<String>>>, message: String| {
            if let Ok(mut slot) = failure.lock() {
                slot.get_or_insert(message);
            }
        };
        let of_errors = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            keep(&of_errors, error.to_string());
        }));
        let of_loss = failure.clone();
        device.set_device_lost_callback(move |reason, message| {
            keep(&of_loss, format!("the device was lost ({reason:?}) {message}"));
        });
        let adapter = format!("{} ({} {})", info.name, info.driver, info.driver_info);
        let (staging, stamps) = (Mutex::default(), Stamps::new(&device, &queue));
        let traffic = Mutex::default();
        Ok(Self { wgpu: device, queue, adapter, software, failure, staging, stamps, traffic })
    }

    /// Most bytes of one storage buffer binding.
    pub(super) fn max_binding(&self) -> u64 {
        let limits = self.wgpu.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// The first error since the device was opened, if any: a device that failed is not used again.
    pub(super) fn check(&self, stage: &'static str) -> Result<()> {
        match self.failure.lock().ok().and_then(|slot| slot.clone()) {
            Some(message) => Err(self.failed(stage, message)),
            None => Ok(()),
        }
    }

    pub(super) fn failed(&self, stage: &'static str, message: String) -> BackendError {
        let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
        BackendError::Device { adapter: self.adapter.clone(), stage, message }
    }

    /// A buffer of at least `bytes` bytes.
    pub(super) fn buffer(
        &self,
        what: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer> {
        let limit = self.max_binding();
        if usage.contains(wgpu::BufferUsages::STORAGE) && bytes > limit {
            return Err(BackendError::TooLarge { what, need: bytes, limit });
        }
        let buffer = self.wgpu.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.next_multiple_of(16).max(64),
            usage,
            mapped_at_creation: false,
        });
        self.check("allocating a buffer")?;
        Ok(buffer)
    }

    /// A storage buffer that holds `data`.
    pub(super) fn upload<T: bytemuck::NoUninit>(
        &self,
        what: &'static str,
        data: &[T],
    ) -> Result<wgpu::Buffer> {
        let usage = readable(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
        let buffer = self.buffer(what, size_of_val(data) as u64, usage)?;
        self.write(&buffer, data);
        // Submits each upload alone: staging memory of several large ones would add up.
        self.queue.submit([]);
        Ok(buffer)
    }

    /// Writes `data` behind `index` elements of its size.
    pub(super) fn write_at<T: bytemuck::NoUninit>(
        &self,
        buffer: &wgpu::Buffer,
        index: u64,
        data: &[T],
    ) {
        let offset = index * size_of::<T>() as u64;
        self.count(|traffic| traffic.bytes_up += size_of_val(data) as u64);
        self.queue.write_buffer(buffer, offset, bytemuck::cast_slice(data));
    }

    pub(super) fn write<T: bytemuck::NoUninit>(&self, buffer: &wgpu::Buffer, data: &[T]) {
        if !data.is_empty() {
            self.write_at(buffer, 0, data);
        }
    }

    /// Exchanges with the host so far.
    pub(super) fn traffic(&self) -> TransferCounts {
        self.traffic.lock().map_or_else(|_| TransferCounts::default(), |traffic| *traffic)
    }

    /// Takes note of an exchange with the host.
    pub(super) fn count(&self, note: impl FnOnce(&mut TransferCounts)) {
        if let Ok(mut traffic) = self.traffic.lock() {
            note(&mut traffic);
        }
    }
}

/// Usages of a buffer that kernels write, and that the host writes and reads.
pub(super) const WORK: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE
    .union(wgpu::BufferUsages::COPY_DST)
    .union(wgpu::BufferUsages::COPY_SRC);

/// Usages of a buffer that the host only writes. Tests read these, too.
pub(super) fn readable(usage: wgpu::BufferUsages) -> wgpu::BufferUsages {
    if cfg!(test) { usage | wgpu::BufferUsages::COPY_SRC } else { usage }
}

/// One Vulkan device as reported by its driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AdapterSummary {
    /// Device name.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: &'static str,
    /// Driver name.
    pub driver: String,
    /// Driver version and build.
    pub driver_info: String,
    /// Most bytes that a kernel binds as one buffer.
    pub max_binding: u64,
    /// Most bytes of one buffer.
    pub max_buffer: u64,
    /// Most invocations of a workgroup.
    pub max_workgroup: u32,
    /// True if `--backend auto` takes this device: the best one, if it is hardware. It must still pass its self-test.
    pub auto: bool,
}

/// Every Vulkan device of this machine, best first; none is opened. The first is the one that
/// [`GpuBackend::new`](super::GpuBackend::new) takes when no name is given.
pub(in crate::engine) fn list_adapters() -> Vec<AdapterSummary> {
    let ranked = ranked_adapters(&instance());
    ranked.iter().enumerate().map(|(index, adapter)| summary(index, adapter)).collect()
}

/// The adapter of a number in the ranking.
pub(super) fn summary(index: usize, adapter: &wgpu::Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    let limits = adapter.limits();
    AdapterSummary {
        kind: TYPES[rank(info.device_type)].1,
        auto: index == 0 && info.device_type != wgpu::DeviceType::Cpu,
        name: info.name,
        driver: info.driver,
        driver_info: info.driver_info,
        max_binding: limits.max_storage_buffer_binding_size,
        max_buffer: limits.max_buffer_size,
        max_workgroup: limits.max_compute_invocations_per_workgroup,
    }
}

/// Types of devices and their names, best first: dedicated hardware before shared before software.
const TYPES: [(wgpu::DeviceType, &str); 5] = [
    (wgpu::DeviceType::DiscreteGpu, "discrete"),
    (wgpu::DeviceType::IntegratedGpu, "integrated"),
    (wgpu::DeviceType::VirtualGpu, "virtual"),
    (wgpu::DeviceType::Other, "other"),
    (wgpu::DeviceType::Cpu, "software"),
];

/// Place of a type among [`TYPES`].
fn rank(device_type: wgpu::DeviceType) -> usize {
    let place = TYPES.iter().position(|(known, _)| *known == device_type);
    place.expect("every type is in the list")
}

pub(super) fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

/// Best first; ties keep the driver's order.
pub(super) fn ranked_adapters(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    adapters
}
