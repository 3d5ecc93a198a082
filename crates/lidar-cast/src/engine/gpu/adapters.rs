//! Vulkan devices of this machine, best first.

use serde::Serialize;

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
pub fn list_adapters() -> Vec<AdapterSummary> {
    let ranked = ranked_adapters(&instance());
    ranked.iter().enumerate().map(|(index, adapter)| summary(index, adapter)).collect()
}

/// The adapter of a number in the ranking.
pub(super) fn summary(index: usize, adapter: &wgpu::Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    let limits = adapter.limits();
    AdapterSummary {
        kind: kind(info.device_type),
        auto: index == 0 && info.device_type != wgpu::DeviceType::Cpu,
        name: info.name,
        driver: info.driver,
        driver_info: info.driver_info,
        max_binding: limits.max_storage_buffer_binding_size,
        max_buffer: limits.max_buffer_size,
        max_workgroup: limits.max_compute_invocations_per_workgroup,
    }
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

pub(super) fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

/// Best first: dedicated hardware before shared before software; ties keep the driver's order.
pub(super) fn ranked_adapters(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
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
