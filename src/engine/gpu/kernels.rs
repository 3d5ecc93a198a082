use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};

use super::device::Device;
use crate::engine::gpu::layout::{MAX_WORKGROUPS, PACKET_FOURS, WORKGROUP_SIZE, prelude};

const BEAM: &str = include_str!("../../../shaders/common/beam.wgsl");
const RAY: &str = include_str!("../../../shaders/common/ray.wgsl");
const PACKET: &str = include_str!("../../../shaders/common/packet.wgsl");
const COVERED: &str = include_str!("../../../shaders/common/covered.wgsl");

/// (kernel, parts of its source): the name is that of the file, the entry point and the CPU twin.
pub(crate) const SOURCES: [(&str, &[&str]); 8] = [
    ("cast_closest", &[BEAM, RAY, include_str!("../../../shaders/cast_closest.wgsl")]),
    ("cast_packets", &[BEAM, RAY, PACKET, include_str!("../../../shaders/cast_packets.wgsl")]),
    ("cast_mixed", &[BEAM, RAY, PACKET, include_str!("../../../shaders/cast_mixed.wgsl")]),
    ("cover_bricks", &[BEAM, include_str!("../../../shaders/cover_bricks.wgsl")]),
    ("cover_voxels", &[BEAM, include_str!("../../../shaders/cover_voxels.wgsl")]),
    ("reduce_words", &[BEAM, include_str!("../../../shaders/reduce_words.wgsl"), COVERED]),
    ("reduce_occupied", &[BEAM, include_str!("../../../shaders/reduce_occupied.wgsl"), COVERED]),
    ("reduce_classes", &[BEAM, include_str!("../../../shaders/reduce_classes.wgsl"), COVERED]),
];

/// What of the kernels' source depends on the scene.
#[derive(Clone, Copy)]
pub(crate) struct SceneConstants {
    /// Entries of the stack where beams go down a tree one by one.
    pub(crate) stack: usize,
    /// Whether the beams of a packet are sifted before they are tested.
    pub(crate) sifted: bool,
}

/// Source of a kernel as it is compiled.
pub(crate) fn source(parts: &[&str], constants: SceneConstants) -> String {
    let SceneConstants { stack, sifted } = constants;
    let own = format!("const TREE_STACK: u32 = {stack}u;\nconst BEAMS_SIFTED: bool = {sifted};\n");
    prelude() + &own + &unrolled(&parts.concat())
}

/// Repeats what is done with each four of a packet, so that no number is looked up by its index: drivers
/// unroll such a loop by themselves for small bodies only.
fn unrolled(source: &str) -> String {
    const LOOP: &str = "for (var k = 0u; k < PACKET_FOURS; k++) {";
    let mut text = String::with_capacity(2 * source.len());
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        if line.trim_start() == LOOP {
            let end = line.replace(LOOP, "}");
            let body: Vec<&str> = lines.by_ref().take_while(|line| *line != end).collect();
            let body = body.join("\n");
            text.extend((0..PACKET_FOURS).map(|k| format!("{{ const k = {k}u;\n{body}\n}}\n")));
        } else {
            text.extend([line, "\n"]);
        }
    }
    text
}

/// What a bind group binds: the number of a kernel, its buffers and its texture.
type Bound = (usize, Vec<wgpu::Buffer>, Option<wgpu::TextureView>);

/// Kernels, each compiled when it is first needed, and what they were bound to.
pub(super) struct Kernels {
    constants: SceneConstants,
    pipelines: [OnceLock<wgpu::ComputePipeline>; SOURCES.len()],
    groups: Mutex<HashMap<Bound, wgpu::BindGroup>>,
}

impl Kernels {
    /// Kernels for a scene.
    pub(super) fn new(constants: SceneConstants) -> Self {
        Self { constants, pipelines: Default::default(), groups: Mutex::default() }
    }

    /// Compiles those of some kernels that are not yet, side by side.
    pub(super) fn compile(&self, device: &Device, kernels: &[&str]) {
        let missing = (0..SOURCES.len())
            .filter(|&k| kernels.contains(&SOURCES[k].0) && self.pipelines[k].get().is_none());
        std::thread::scope(|scope| {
            missing.for_each(|kernel| {
                scope.spawn(move || self.pipeline(device, kernel));
            });
        });
    }

    fn pipeline(&self, device: &Device, kernel: usize) -> &wgpu::ComputePipeline {
        let (name, parts) = SOURCES[kernel];
        self.pipelines[kernel].get_or_init(|| {
            let module = device.wgpu().create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source(parts, self.constants).into()),
            });
            device.wgpu().create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: None,
                module: &module,
                entry_point: Some(name),
                compilation_options: Default::default(),
                cache: None,
            })
        })
    }

    /// Records one dispatch; buffers are bound in the order of the kernel's binding numbers, the texture
    /// of a tree after them.
    pub(super) fn dispatch(
        &self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        kernel: &str,
        buffers: &[&wgpu::Buffer],
        tree: Option<&wgpu::TextureView>,
        workgroups: [u32; 3],
    ) {
        let named = SOURCES.iter().position(|(name, _)| *name == kernel);
        let kernel = named.expect("a kernel of the list above");
        let pipeline = self.pipeline(device, kernel);
        let group = self.group(device, pipeline, kernel, buffers, tree);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        let [x, y, z] = workgroups;
        pass.dispatch_workgroups(x, y, z);
    }

    /// The bind group of what is bound, made once.
    fn group(
        &self,
        device: &Device,
        pipeline: &wgpu::ComputePipeline,
        kernel: usize,
        buffers: &[&wgpu::Buffer],
        tree: Option<&wgpu::TextureView>,
    ) -> wgpu::BindGroup {
        let bound = (kernel, buffers.iter().map(|&buffer| buffer.clone()).collect(), tree.cloned());
        let make = || {
            let buffers = buffers.iter().map(|buffer| buffer.as_entire_binding());
            let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
                .chain(tree.map(wgpu::BindingResource::TextureView))
                .zip(0..)
                .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
                .collect();
            device.wgpu().create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            })
        };
        match self.groups.lock() {
            Ok(mut groups) => groups.entry(bound).or_insert_with(make).clone(),
            Err(_) => make(),
        }
    }

    /// Lets go of the buffers that were bound, which are about to be replaced.
    pub(super) fn unbind(&self) {
        if let Ok(mut groups) = self.groups.lock() {
            groups.clear();
        }
    }
}

/// Workgroups for `directions` beams of each of `sensors` sensors: x holds the beams and spills into
/// z beyond the limit of a dimension.
pub(super) fn beam_workgroups(directions: u32, sensors: u32) -> [u32; 3] {
    let groups = directions.div_ceil(WORKGROUP_SIZE);
    let z = groups.div_ceil(MAX_WORKGROUPS);
    [groups.div_ceil(z), sensors, z]
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;
    use crate::bvh::{QuantizedNode as Node, Triangle};
    use crate::engine::gpu::layout::Uniforms;
    use crate::problem::{DevicePose, OccupiedVoxel};

    fn parsed(parts: &[&str], sifted: bool) -> naga::Module {
        let source = source(parts, SceneConstants { stack: 48, sifted });
        naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)))
    }

    #[test]
    fn kernels_need_no_extra_capabilities() {
        for (name, parts) in SOURCES {
            for sifted in [false, true] {
                let module = parsed(parts, sifted);
                let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
                validator.validate(&module).unwrap_or_else(|error| panic!("{name}: {error:?}"));
                assert_eq!(module.entry_points[0].name, name);
            }
        }
    }

    /// (field, offset) of a struct, and its stride, as the shader compiler lays it out.
    fn layout(kernel: &str, name: &str) -> (Vec<(String, usize)>, usize) {
        let parts = SOURCES.iter().find(|(k, _)| *k == kernel).unwrap().1;
        let module = parsed(parts, false);
        let (_, found) = module
            .types
            .iter()
            .find(|(_, ty)| ty.name.as_deref() == Some(name))
            .unwrap_or_else(|| panic!("{kernel} has no struct {name}"));
        let naga::TypeInner::Struct { members, span } = &found.inner else { panic!() };
        let fields = members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
        (fields, *span as usize)
    }

    macro_rules! same_layout {
        ($kernel:literal, $host:ident, [$($field:ident => $shader:literal),* $(,)?]) => {
            let (fields, span) = layout($kernel, stringify!($host));
            assert_eq!(span, size_of::<$host>(), "size of {}", stringify!($host));
            let host = [$(($shader.to_owned(), offset_of!($host, $field))),*];
            assert_eq!(fields, host, "{}", stringify!($host));
        };
    }

    #[test]
    fn structs_lie_where_the_shaders_read_them() {
        for kernel in SOURCES {
            let (fields, span) = layout(kernel.0, "Uniforms");
            assert_eq!((fields.len(), span), (12, size_of::<Uniforms>()));
        }
        same_layout!("cast_closest", Uniforms, [
            shape => "shape", direction_count => "direction_count", voxel => "voxel",
            range => "range", bitmap_words => "bitmap_words", node_count => "node_count",
            pad => "pad", occupied_count => "occupied_count", class_count => "class_count",
            walk_pass => "walk_pass", first_sensor => "first_sensor",
            ends_at_hits => "ends_at_hits",
        ]);
        same_layout!("cast_closest", Node, [
            corner => "corner", low_x => "low_x", step => "step", low_y => "low_y",
            high => "high", low_z => "low_z", children => "children",
        ]);
        same_layout!("cast_closest", Triangle, [
            a => "a", prim => "prim", b => "b", pad0 => "pad0", c => "c", pad1 => "pad1", normal => "normal", pad2 => "pad2",
        ]);
        let (fields, span) = layout("cast_closest", "DevicePose");
        let offsets: Vec<usize> = fields.iter().map(|f| f.1).collect();
        assert_eq!((offsets, span), (vec![0, 16, 32, 48], size_of::<DevicePose>()));
        assert_eq!(offset_of!(DevicePose, in_grid), 48);
        let (fields, span) = layout("reduce_occupied", "OccupiedVoxel");
        let offsets: Vec<usize> = fields.iter().map(|f| f.1).collect();
        assert_eq!((offsets, span), (vec![0, 4, 8, 12], size_of::<OccupiedVoxel>()));
        assert_eq!(offset_of!(OccupiedVoxel, entropy), 4);
    }
}
