//! An open device: its errors, its buffers, and writes to them.

use std::sync::{Arc, Mutex};

use super::adapters::{instance, ranked_adapters};
use crate::engine::BackendError;

/// An open device. Errors of the driver wait here for [`Self::check`], instead of wgpu's default, a panic.
pub(super) struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: String,
    software: bool,
    failure: Arc<Mutex<Option<String>>>,
    /// Buffers for copies to the host, kept from one to the next.
    staging: Mutex<Vec<wgpu::Buffer>>,
}

impl Device {
    /// Opens the best device, or the one whose name contains `name`, whatever it is good for.
    pub(super) fn open(name: Option<&str>) -> Result<Self, BackendError> {
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
    pub(super) fn of(adapter: &wgpu::Adapter) -> Result<Self, BackendError> {
        let info = adapter.get_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("sightline"),
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
        let staging = Mutex::default();
        Ok(Self { device, queue, adapter, software, failure, staging })
    }

    /// True if the device is a software renderer on the CPU.
    pub(super) fn is_software(&self) -> bool {
        self.software
    }

    pub(super) fn adapter(&self) -> &str {
        &self.adapter
    }

    /// Most bytes of one storage buffer binding.
    pub(super) fn max_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    pub(super) fn destroy(&self) {
        self.device.destroy();
    }

    /// The first error since the device was opened, if any: a device that failed is not used again.
    pub(super) fn check(&self, stage: &'static str) -> Result<(), BackendError> {
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
    ) -> Result<wgpu::Buffer, BackendError> {
        let limit = self.max_binding();
        if usage.contains(wgpu::BufferUsages::STORAGE) && bytes > limit {
            return Err(BackendError::TooLarge { what, need: bytes, limit });
        }
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
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
    ) -> Result<wgpu::Buffer, BackendError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
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
        self.queue.write_buffer(buffer, offset, bytemuck::cast_slice(data));
    }

    pub(super) fn write<T: bytemuck::NoUninit>(&self, buffer: &wgpu::Buffer, data: &[T]) {
        if !data.is_empty() {
            self.queue.write_buffer(buffer, 0, bytemuck::cast_slice(data));
        }
    }

    pub(super) fn wgpu(&self) -> &wgpu::Device {
        &self.device
    }

    pub(super) fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    pub(super) fn kept_staging(&self) -> &Mutex<Vec<wgpu::Buffer>> {
        &self.staging
    }
}
