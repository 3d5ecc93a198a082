//! The compute kernels: their sources, pipelines and bind groups.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};

use super::device::Device;
use super::layout::{MAX_WORKGROUPS, WORKGROUP_SIZE, prelude};

const EXACT: &str = include_str!("../../../shaders/common/exact.wgsl");
const BEAM: &str = include_str!("../../../shaders/common/beam.wgsl");
const COVERED: &str = include_str!("../../../shaders/common/covered.wgsl");

/// (kernel, parts of its source): file, entry point, pipeline label and CPU twin share the name.
pub(super) const SOURCES: [(&str, &[&str]); 6] = [
    ("cast_closest", &[EXACT, BEAM, include_str!("../../../shaders/cast_closest.wgsl")]),
    ("cover_voxels", &[EXACT, BEAM, include_str!("../../../shaders/cover_voxels.wgsl")]),
    ("reduce_words", &[EXACT, BEAM, include_str!("../../../shaders/reduce_words.wgsl"), COVERED]),
    (
        "reduce_occupied",
        &[EXACT, BEAM, include_str!("../../../shaders/reduce_occupied.wgsl"), COVERED],
    ),
    (
        "reduce_classes",
        &[EXACT, BEAM, include_str!("../../../shaders/reduce_classes.wgsl"), COVERED],
    ),
    ("self_test", &[EXACT, BEAM, include_str!("../../../shaders/self_test.wgsl")]),
];

/// Key of a bind group: the number of a kernel and its buffers.
type Bound = (usize, Vec<wgpu::Buffer>);

/// A dispatch: kernel, buffers and workgroups.
#[cfg(test)]
type Noted = (String, Vec<wgpu::Buffer>, [u32; 3]);

/// Changes the source of a kernel, which is given by name, before it is compiled.
pub(super) type Rewrite = fn(kernel: &str, source: String) -> String;

/// Kernels, each compiled at its first use, and their bind groups.
pub(super) struct Kernels {
    rewrite: Rewrite,
    pipelines: [OnceLock<wgpu::ComputePipeline>; SOURCES.len()],
    groups: Mutex<HashMap<Bound, wgpu::BindGroup>>,
    /// Dispatches so far: kernel, buffers and workgroups.
    #[cfg(test)]
    pub(super) noted: Mutex<Vec<Noted>>,
}

impl Kernels {
    pub(super) fn new() -> Self {
        Self::rewritten(|_, source| source)
    }

    /// The kernels with other sources.
    pub(super) fn rewritten(rewrite: Rewrite) -> Self {
        Self {
            rewrite,
            pipelines: Default::default(),
            groups: Mutex::default(),
            #[cfg(test)]
            noted: Mutex::default(),
        }
    }

    /// Compiles the kernels that a batch needs and that are not compiled yet, side by side.
    pub(super) fn compile(&self, device: &Device, needs: impl Fn(&str) -> bool) {
        let missing = (0..SOURCES.len())
            .filter(|&k| needs(SOURCES[k].0) && self.pipelines[k].get().is_none());
        std::thread::scope(|scope| {
            missing.for_each(|kernel| {
                scope.spawn(move || self.pipeline(device, kernel));
            });
        });
    }

    fn pipeline(&self, device: &Device, kernel: usize) -> &wgpu::ComputePipeline {
        let (name, parts) = SOURCES[kernel];
        self.pipelines[kernel].get_or_init(|| {
            let source = (self.rewrite)(name, source(parts));
            let module = device.wgpu.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            device.wgpu.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: None,
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions {
                    // `cast_closest` uses much of this memory, and writes every word before it reads it.
                    zero_initialize_workgroup_memory: name != "cast_closest",
                    ..Default::default()
                },
                cache: None,
            })
        })
    }

    /// Records one dispatch; buffers are bound in the order of the kernel's binding numbers. `stamp` is where the device writes
    /// down begin and end.
    pub(super) fn dispatch(
        &self,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        kernel: &str,
        buffers: &[&wgpu::Buffer],
        [x, y, z]: [u32; 3],
        stamp: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        #[cfg(test)]
        if let Ok(mut noted) = self.noted.lock() {
            let buffers = buffers.iter().map(|&buffer| buffer.clone()).collect();
            noted.push((kernel.to_owned(), buffers, [x, y, z]));
        }
        let named = SOURCES.iter().position(|(name, _)| *name == kernel);
        let kernel = named.expect("a kernel of the list above");
        let pipeline = self.pipeline(device, kernel);
        let group = self.group(device, pipeline, kernel, buffers);
        let pass = wgpu::ComputePassDescriptor { label: None, timestamp_writes: stamp };
        let mut pass = encoder.begin_compute_pass(&pass);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(x, y, z);
    }

    /// The bind group of a kernel and its buffers, made once.
    fn group(
        &self,
        device: &Device,
        pipeline: &wgpu::ComputePipeline,
        kernel: usize,
        buffers: &[&wgpu::Buffer],
    ) -> wgpu::BindGroup {
        let bound = (kernel, buffers.iter().map(|&buffer| buffer.clone()).collect());
        let make = || {
            let entries: Vec<wgpu::BindGroupEntry<'_>> = (0..)
                .zip(buffers)
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            device.wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
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

    /// Drops all bind groups, which would keep their buffers alive.
    pub(super) fn unbind(&self) {
        if let Ok(mut groups) = self.groups.lock() {
            groups.clear();
        }
    }
}

/// A kernel as WGSL.
pub(super) fn source(parts: &[&str]) -> String {
    prelude() + &parts.concat()
}

/// Workgroups for `directions` beams of each of `sensors` sensors, [x, y, z]: sensors along y, beams along x
/// and, beyond the limit of a dimension, z. Example: 70 000 · 64 directions give [35 000, sensors, 2].
pub(super) fn beam_workgroups(directions: u32, sensors: u32) -> [u32; 3] {
    let groups = directions.div_ceil(WORKGROUP_SIZE);
    let z = groups.div_ceil(MAX_WORKGROUPS);
    [groups.div_ceil(z), sensors, z]
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use wgpu::naga::{
        self,
        valid::{Capabilities, ValidationFlags, Validator},
    };

    use super::*;
    use crate::bvh::{QuantizedNode as BvhNode, Triangle};
    use crate::engine::gpu::layout::{GpuInstance, Sensor, Uniforms};
    use crate::task::{DevicePose, OccupiedVoxel};

    fn parsed(parts: &[&str]) -> naga::Module {
        let source = source(parts);
        naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&source)))
    }

    /// Leaves the sources in `target/kernels`, where `tests/browser` finds them for another compiler of WGSL.
    #[test]
    fn kernels_need_no_extra_capabilities() {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join("target/kernels");
        std::fs::create_dir_all(&folder).unwrap();
        for (name, parts) in SOURCES {
            let module = parsed(parts);
            let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
            validator.validate(&module).unwrap_or_else(|error| panic!("{name}: {error:?}"));
            assert_eq!(module.entry_points[0].name, name);
            std::fs::write(folder.join(format!("{name}.wgsl")), source(parts)).unwrap();
        }
    }

    #[test]
    fn headers_name_files_that_exist() {
        let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        for (name, parts) in SOURCES {
            let header: Vec<&str> = parts
                .iter()
                .flat_map(|part| part.lines())
                .filter(|l| l.starts_with("//"))
                .collect();
            let header = header.join(" ");
            assert!(header.contains(&format!("// {name}: ")), "{name} has no header");
            let words = header.split([' ', ',', ';', '(', ')']);
            let files = words.filter(|word| word.starts_with("crates/"));
            let mut named = 0;
            for word in files {
                let (file, function) = word.split_once("::").unwrap_or((word, ""));
                let text = std::fs::read_to_string(root.join(file))
                    .unwrap_or_else(|error| panic!("{name}: {file}: {error}"));
                let item = function.rsplit("::").next().unwrap_or_default();
                assert!(text.contains(item), "{name}: {file} has no {item}");
                named += 1;
            }
            assert!(named >= 2, "{name} names no twin");
        }
    }

    /// (field, offset) of a struct, and its stride, as the shader compiler lays it out.
    fn layout(kernel: &str, name: &str) -> (Vec<(String, usize)>, usize) {
        let parts = SOURCES.iter().find(|(k, _)| *k == kernel).unwrap().1;
        let module = parsed(parts);
        let (_, found) = module
            .types
            .iter()
            .find(|(_, ty)| ty.name.as_deref() == Some(name))
            .unwrap_or_else(|| panic!("{kernel} has no struct {name}"));
        let naga::TypeInner::Struct { members, span } = &found.inner else { panic!() };
        let fields = members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect();
        (fields, *span as usize)
    }

    /// Compares the fields of a struct, which have the names of the shader's.
    macro_rules! same_layout {
        ($kernel:expr, $host:ident, [$($field:ident),* $(,)?]) => {
            let (fields, span) = layout($kernel, stringify!($host));
            assert_eq!(span, size_of::<$host>(), "size of {}", stringify!($host));
            let host = [$((stringify!($field).to_owned(), offset_of!($host, $field))),*];
            assert_eq!(fields, host, "{}", stringify!($host));
        };
    }

    #[test]
    fn structs_lie_where_the_shaders_read_them() {
        for (kernel, _) in SOURCES {
            same_layout!(
                kernel,
                Uniforms,
                [shape, bitmap_words, voxel, occupied_count, class_count, ends_at_hits, spare,]
            );
        }
        for kernel in ["cast_closest", "cover_voxels"] {
            same_layout!(
                kernel,
                Sensor,
                [
                    first_instance, end_instance, first_direction, direction_count, first_beam,
                    range, zero, covered_by_host,
                ]
            );
        }
        same_layout!("cast_closest", BvhNode, [corner, low_x, step, low_y, high, low_z, children,]);
        same_layout!("cast_closest", Triangle, [a, prim, b, pad0, c, pad1, normal, pad2]);
        // Rows are one array on the host.
        let (fields, span) = layout("cast_closest", "Instance");
        let shader: Vec<usize> = fields.iter().map(|f| f.1).collect();
        let host = [
            offset_of!(GpuInstance, center),
            offset_of!(GpuInstance, radius),
            offset_of!(GpuInstance, least_square),
            offset_of!(GpuInstance, pad),
            offset_of!(GpuInstance, root),
            offset_of!(GpuInstance, first_prim),
        ];
        assert_eq!((&shader[..3], &shader[3..]), (&[0, 16, 32][..], &host[..]));
        assert_eq!(span, size_of::<GpuInstance>());
        let (fields, span) = layout("cover_voxels", "DevicePose");
        let offsets: Vec<usize> = fields.iter().map(|f| f.1).collect();
        assert_eq!((offsets, span), (vec![0, 16, 32, 48], size_of::<DevicePose>()));
        assert_eq!(offset_of!(DevicePose, in_grid), 48);
        let (fields, span) = layout("reduce_occupied", "OccupiedVoxel");
        let offsets: Vec<usize> = fields.iter().map(|f| f.1).collect();
        assert_eq!((offsets, span), (vec![0, 4, 8, 12, 16], size_of::<OccupiedVoxel>()));
        assert_eq!(offset_of!(OccupiedVoxel, entropy), 4);
    }
}
