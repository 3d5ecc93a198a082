use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};

use serde::Serialize;

use crate::backend::BackendError;

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
    /// Whether `--backend auto` takes this device.
    pub auto: bool,
}

/// Every Vulkan device of this machine, the one that is taken by default first.
pub fn list_adapters() -> Vec<AdapterSummary> {
    let ranked = ranked_adapters(&instance());
    let summaries = ranked.iter().enumerate().map(|(index, adapter)| {
        let info = adapter.get_info();
        let limits = adapter.limits();
        AdapterSummary {
            kind: kind(info.device_type),
            name: info.name,
            driver: info.driver,
            driver_info: info.driver_info,
            max_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            max_workgroup: limits.max_compute_invocations_per_workgroup,
            auto: index == 0,
        }
    });
    summaries.collect()
}

fn kind(device_type: wgpu::DeviceType) -> &'static str {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    }
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

/// Best first: dedicated hardware before shared before software; ties keep the driver's order.
fn ranked_adapters(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

/// An open device. Errors of the driver are kept here until [`Self::check`] hands them out, so that
/// wgpu's default of a panic never reaches a user.
pub(super) struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: String,
    software: bool,
    maps: bool,
    failure: Arc<Mutex<Option<String>>>,
    /// Buffers for copies to the host, kept from one to the next.
    staging: Mutex<Vec<wgpu::Buffer>>,
}

/// Staging buffers that are kept: two copies may be under way at a time.
const KEPT_STAGING: usize = 4;

impl Device {
    pub(super) fn open(name: Option<&str>) -> Result<Self, BackendError> {
        let wanted = name.map(str::to_lowercase);
        let adapter = ranked_adapters(&instance())
            .into_iter()
            .find(|adapter| match &wanted {
                Some(part) => adapter.get_info().name.to_lowercase().contains(part),
                None => true,
            })
            .ok_or_else(|| BackendError::NoDevice { name: name.map(str::to_owned) })?;
        let info = adapter.get_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let mapping = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;
        let maps = software && adapter.features().contains(mapping);
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("sightline"),
            required_features: if maps { mapping } else { wgpu::Features::empty() },
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
        Ok(Self { device, queue, adapter, software, maps, failure, staging })
    }

    /// Whether the device is a program on the host.
    pub(super) fn is_software(&self) -> bool {
        self.software
    }

    /// Whether the host reads what kernels write where it lies: a program on the host has its memory.
    pub(super) fn maps(&self) -> bool {
        self.maps
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

    fn failed(&self, stage: &'static str, message: String) -> BackendError {
        let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
        BackendError::Device { adapter: self.adapter.clone(), stage, message }
    }

    /// A buffer of at least one vector, for kernels to read or write.
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

    /// A storage buffer that holds `data` for good.
    pub(super) fn upload<T: bytemuck::NoUninit>(
        &self,
        what: &'static str,
        data: &[T],
    ) -> Result<wgpu::Buffer, BackendError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.buffer(what, size_of_val(data) as u64, usage)?;
        self.write(&buffer, data);
        // Flushed one by one: staging memory of several large uploads would add up.
        self.queue.submit([]);
        Ok(buffer)
    }

    /// A texture that holds vectors of four numbers for good, in rows of `row`.
    pub(super) fn upload_texels(
        &self,
        what: &'static str,
        mut texels: Vec<[f32; 4]>,
        row: u32,
    ) -> Result<wgpu::TextureView, BackendError> {
        let rows = texels.len().div_ceil(row as usize);
        if rows > self.device.limits().max_texture_dimension_2d as usize {
            let limit = self.max_texels(row) * size_of::<[f32; 4]>() as u64;
            let need = size_of_val(texels.as_slice()) as u64;
            return Err(BackendError::TooLarge { what, need, limit });
        }
        texels.resize(rows * row as usize, [0.0; 4]);
        let size = wgpu::Extent3d { width: row, height: rows as u32, depth_or_array_layers: 1 };
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(what),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row * size_of::<[f32; 4]>() as u32),
            rows_per_image: None,
        };
        self.queue.write_texture(
            texture.as_image_copy(),
            bytemuck::cast_slice(&texels),
            layout,
            size,
        );
        self.queue.submit([]);
        self.check("uploading a texture")?;
        Ok(texture.create_view(&Default::default()))
    }

    /// Most vectors of a texture in rows of `row`.
    pub(super) fn max_texels(&self, row: u32) -> u64 {
        u64::from(row) * u64::from(self.device.limits().max_texture_dimension_2d)
    }

    /// Writes `data` behind `index` such values.
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

    /// Hands recorded commands to the device, which runs them after all before them.
    pub(super) fn enqueue(
        &self,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> wgpu::SubmissionIndex {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        record(&mut encoder);
        self.queue.submit([encoder.finish()])
    }

    /// Runs recorded commands to their end.
    pub(super) fn submit(
        &self,
        stage: &'static str,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<(), BackendError> {
        let submission = self.enqueue(record);
        self.wait(stage, submission)
    }

    /// Waits for a submission and all before it.
    fn wait(
        &self,
        stage: &'static str,
        submission: wgpu::SubmissionIndex,
    ) -> Result<(), BackendError> {
        let poll = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
        // wgpu reports a device that a wait finds lost with a panic.
        let waited = caught(|| self.device.poll(poll));
        if !matches!(waited, Ok(Ok(_))) {
            // A device that refused the submission says why once all before it has ended.
            let _ = caught(|| self.device.poll(wgpu::PollType::wait_indefinitely()));
        }
        // The callbacks know more than the panic.
        self.check(stage)?;
        match waited {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(self.failed(stage, error.to_string())),
            Err(message) => Err(self.failed(stage, message)),
        }
    }

    /// Starts recorded commands, after which the first `bytes` of a buffer are copied to the host, or
    /// mapped where it allows that; no commands may use it then before [`Self::finish`].
    pub(super) fn start(
        &self,
        stage: &'static str,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
        buffer: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Reading, BackendError> {
        let size = bytes.next_multiple_of(4);
        let mapped = buffer.usage().contains(wgpu::BufferUsages::MAP_READ);
        let staging = if mapped { buffer.clone() } else { self.staging(size)? };
        let submission = self.enqueue(|encoder| {
            record(encoder);
            if !mapped {
                encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
            }
        });
        let answer = Arc::new(Mutex::new(None));
        let sink = answer.clone();
        staging.map_async(wgpu::MapMode::Read, 0..size, move |result| {
            if let Ok(mut slot) = sink.lock() {
                *slot = Some(result);
            }
        });
        Ok(Reading { stage, staging, mapped, bytes, submission, answer })
    }

    /// Waits for a copy, or for what is mapped, and hands it to `take`.
    pub(super) fn finish<R>(
        &self,
        reading: Reading,
        take: impl FnOnce(&[u8]) -> R,
    ) -> Result<R, BackendError> {
        let Reading { stage, staging, mapped, bytes, submission, answer } = reading;
        self.wait(stage, submission)?;
        match answer.lock().ok().and_then(|mut slot| slot.take()) {
            Some(Ok(())) => {}
            Some(Err(error)) => return Err(self.failed(stage, error.to_string())),
            None => return Err(self.failed(stage, "the read-back never finished".into())),
        }
        let view = staging
            .get_mapped_range(0..bytes.next_multiple_of(4))
            .map_err(|error| self.failed(stage, error.to_string()))?;
        let taken = take(&view[..bytes as usize]);
        drop(view);
        staging.unmap();
        if !mapped
            && let Ok(mut kept) = self.staging.lock()
            && kept.len() < KEPT_STAGING
        {
            kept.push(staging);
        }
        Ok(taken)
    }

    /// A buffer to map, one used before where it is large enough.
    fn staging(&self, size: u64) -> Result<wgpu::Buffer, BackendError> {
        if let Ok(mut kept) = self.staging.lock() {
            kept.sort_by_key(wgpu::Buffer::size);
            if let Some(found) = kept.iter().position(|buffer| buffer.size() >= size) {
                return Ok(kept.remove(found));
            }
            // The largest gives way to one that is large enough.
            kept.pop();
        }
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        self.buffer("read-back", size, usage)
    }

    /// Copies the first `bytes` of a buffer to the host.
    pub(super) fn read<T: bytemuck::Pod>(
        &self,
        stage: &'static str,
        buffer: &wgpu::Buffer,
        bytes: u64,
    ) -> Result<Vec<T>, BackendError> {
        let reading = self.start(stage, |_| {}, buffer, bytes)?;
        self.finish(reading, bytemuck::pod_collect_to_vec)
    }
}

/// A copy to the host that is under way, or a buffer that is about to be mapped.
pub(super) struct Reading {
    stage: &'static str,
    staging: wgpu::Buffer,
    mapped: bool,
    bytes: u64,
    submission: wgpu::SubmissionIndex,
    answer: Arc<Mutex<Option<Result<(), wgpu::BufferAsyncError>>>>,
}

/// The result of `work`, or the words of its panic.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_words() {
        assert_eq!(caught(|| 3), Ok(3));
        assert_eq!(caught(|| -> u8 { panic!("lost {}", 7) }), Err("lost 7".to_owned()));
        assert_eq!(caught(|| -> u8 { panic!("lost") }), Err("lost".to_owned()));
    }
}
