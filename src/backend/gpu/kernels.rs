use super::device::Device;
use crate::backend::BackendError;
use crate::backend::layout::{MAX_WORKGROUPS, WORKGROUP_SIZE, prelude};

const BEAM: &str = include_str!("../../../shaders/common/beam.wgsl");
const COVERED: &str = include_str!("../../../shaders/common/covered.wgsl");

/// (kernel, parts of its source): the name is that of the file, the entry point and the CPU twin.
pub(crate) const SOURCES: [(&str, &[&str]); 5] = [
    ("cast_closest", &[BEAM, include_str!("../../../shaders/cast_closest.wgsl")]),
    ("cover_voxels", &[BEAM, include_str!("../../../shaders/cover_voxels.wgsl")]),
    ("reduce_words", &[BEAM, include_str!("../../../shaders/reduce_words.wgsl"), COVERED]),
    ("reduce_occupied", &[BEAM, include_str!("../../../shaders/reduce_occupied.wgsl"), COVERED]),
    ("reduce_classes", &[BEAM, include_str!("../../../shaders/reduce_classes.wgsl"), COVERED]),
];

/// Source of a kernel as it is compiled.
pub(crate) fn source(parts: &[&str]) -> String {
    prelude() + &parts.concat()
}

/// Compiled kernels.
pub(super) struct Kernels {
    pub(super) cast_closest: wgpu::ComputePipeline,
    pub(super) cover_voxels: wgpu::ComputePipeline,
    pub(super) reduce_words: wgpu::ComputePipeline,
    pub(super) reduce_occupied: wgpu::ComputePipeline,
    pub(super) reduce_classes: wgpu::ComputePipeline,
}

impl Kernels {
    pub(super) fn new(device: &Device) -> Result<Self, BackendError> {
        let [cast_closest, cover_voxels, reduce_words, reduce_occupied, reduce_classes] = SOURCES
            .map(|(name, parts)| {
                let module = device.wgpu().create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(name),
                    source: wgpu::ShaderSource::Wgsl(source(parts).into()),
                });
                device.wgpu().create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(name),
                    layout: None,
                    module: &module,
                    entry_point: Some(name),
                    compilation_options: Default::default(),
                    cache: None,
                })
            });
        device.check("compiling kernels")?;
        Ok(Self { cast_closest, cover_voxels, reduce_words, reduce_occupied, reduce_classes })
    }
}

/// Records one dispatch; buffers are bound in the order of the kernel's binding numbers.
pub(super) fn dispatch(
    device: &Device,
    encoder: &mut wgpu::CommandEncoder,
    pipeline: &wgpu::ComputePipeline,
    buffers: &[&wgpu::Buffer],
    workgroups: [u32; 3],
) {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
        .iter()
        .enumerate()
        .map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    let group = device.wgpu().create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    let [x, y, z] = workgroups;
    pass.dispatch_workgroups(x, y, z);
}

/// Workgroups for `directions` beams of each of `sensors` sensors: x holds the beams and spills into
/// z beyond the limit of a dimension.
pub(super) fn beam_workgroups(directions: u32, sensors: u32) -> [u32; 3] {
    let groups = directions.div_ceil(WORKGROUP_SIZE);
    let z = groups.div_ceil(MAX_WORKGROUPS);
    [groups.div_ceil(z), sensors, z]
}
