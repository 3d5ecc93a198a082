//! Rays of scans on the device: each group that leaves one place is a sensor of `cast_closest`.

use std::sync::Arc;

use super::chunk::Trees;
use super::device::{Device, WORK};
use super::kernels::{Kernels, beam_workgroups};
use super::layout::{GpuInstance, MAX_WORKGROUPS, Sensor, UNFINISHED};
use super::self_test;
use crate::bvh::{Bvh, Hit};
use crate::cast::{Firing, FiringCaster};
use crate::engine::{EngineChoice, Result};

/// Casts firings on a Vulkan device.
pub(in crate::engine) struct GpuFirings {
    device: Device,
    kernels: Kernels,
    trees: Trees,
    /// Buffers of a dispatch in the order of [`NAMES`], each made again where a larger one is needed.
    work: [Option<wgpu::Buffer>; NAMES.len()],
}

/// Names of the buffers of a dispatch.
const NAMES: [&str; 5] = ["instances", "sensors", "directions of rays", "hits", "hit counters"];

/// Firings as the kernel reads them.
#[derive(Default)]
struct PackedFirings {
    instances: Vec<GpuInstance>,
    sensors: Vec<Sensor>,
    /// Unit directions, the fourth number 0.
    directions: Vec<[f32; 4]>,
    /// Rays of the firing that has most.
    longest: u32,
}

impl GpuFirings {
    /// Opens a device, and uploads the trees that will be cast into.
    ///
    /// # Errors
    /// No such device, or one that cannot hold the trees.
    pub(in crate::engine) fn new(trees: &[&Arc<Bvh>], choice: &EngineChoice) -> Result<Self> {
        let device = self_test::open(choice)?;
        let trees = Trees::new(&device, trees)?;
        let kernels = Kernels::new();
        kernels.compile(&device, |kernel| kernel == "cast_closest");
        device.check("compiling a kernel")?;
        Ok(Self { device, kernels, trees, work: Default::default() })
    }

    /// Name and driver of the device.
    pub(in crate::engine) fn adapter(&self) -> &str {
        &self.device.adapter
    }

    /// The first firings that fit into one dispatch: at least one.
    fn cut(&self, firings: &[Firing<'_>]) -> usize {
        let most = self.device.max_binding();
        let (mut instances, mut rays) = (0, 0);
        let fits = |firing: &&Firing<'_>| {
            instances += firing.targets.len() * size_of::<GpuInstance>();
            rays += firing.rays.len() * size_of::<[f32; 4]>();
            (instances.max(rays) as u64) <= most
        };
        firings.iter().take(MAX_WORKGROUPS as usize).take_while(fits).count().max(1)
    }

    fn pack(&self, firings: &[Firing<'_>], range: f32) -> PackedFirings {
        let mut packed = PackedFirings::default();
        for firing in firings {
            let (first_instance, first) = (packed.instances.len(), packed.directions.len() as u32);
            packed.instances.extend(firing.targets.iter().map(|target| {
                let standing = target.standing;
                let root = self.trees.roots[&std::ptr::from_ref(target.tree).addr()];
                GpuInstance::new(
                    &standing.pose, &standing.sight, target.tree, root, target.first_prim,
                )
            }));
            packed.directions.extend(firing.rays.iter().map(|&[x, y, z]| [x, y, z, 0.0]));
            let count = firing.rays.len() as u32;
            packed.longest = packed.longest.max(count);
            packed.sensors.push(Sensor {
                first_instance: first_instance as u32,
                end_instance: packed.instances.len() as u32,
                first_direction: first,
                direction_count: count,
                first_beam: first,
                range,
                zero: 0,
                covered_by_host: 0,
            });
        }
        packed
    }

    fn cast(&mut self, firings: &[Firing<'_>], range: f32) -> Result<Vec<Hit>> {
        let packed = self.pack(firings, range);
        let (sensors, rays) = (packed.sensors.len(), packed.directions.len());
        let sizes = [
            size_of_val(&packed.instances[..]),
            size_of_val(&packed.sensors[..]),
            size_of_val(&packed.directions[..]),
            rays * size_of::<Hit>(),
            4 * (1 + sensors),
        ];
        let [instances, of_sensors, directions, hits, counters] = &self.with_room(sizes)?;
        let Self { device, kernels, trees, .. } = &*self;
        device.write(instances, &packed.instances);
        device.write(of_sensors, &packed.sensors);
        device.write(directions, &packed.directions);
        let record = |encoder: &mut wgpu::CommandEncoder| {
            encoder.clear_buffer(counters, 0, None);
            let (nodes, triangles) = (&trees.nodes, &trees.triangles);
            let buffers = [instances, of_sensors, directions, nodes, triangles, hits, counters];
            let groups = beam_workgroups(packed.longest, sensors as u32);
            kernels.dispatch(device, encoder, "cast_closest", &buffers, groups, None);
        };
        let reading = device.start("casting", record, &[(hits, sizes[3] as u64)])?;
        let mut found: Vec<Hit> =
            device.finish(reading, |parts| bytemuck::pod_collect_to_vec(parts[0]))?;
        let rays =
            firings.iter().flat_map(|firing| firing.rays.iter().map(move |ray| (firing, *ray)));
        // The kernel ran out of steps with some.
        let unfinished = found.iter_mut().zip(rays).filter(|(hit, _)| hit.prim == UNFINISHED);
        unfinished.for_each(|(hit, (firing, ray))| *hit = firing.closest_hit(ray, range));
        Ok(found)
    }

    /// Buffers with room for so many bytes.
    fn with_room(&mut self, bytes: [usize; NAMES.len()]) -> Result<[wgpu::Buffer; NAMES.len()]> {
        for ((buffer, what), bytes) in self.work.iter_mut().zip(NAMES).zip(bytes) {
            let bytes = bytes as u64;
            if buffer.as_ref().is_none_or(|buffer| buffer.size() < bytes) {
                self.kernels.unbind();
                *buffer = None;
                // Half as much again, so that slightly larger ones do not come one after the other.
                let room = (bytes + bytes / 2).min(self.device.max_binding()).max(bytes);
                *buffer = Some(self.device.buffer(what, room, WORK)?);
            }
        }
        Ok(self.work.clone().map(|buffer| buffer.expect("made above")))
    }
}

impl FiringCaster for GpuFirings {
    fn closest_hits(&mut self, firings: &[Firing<'_>], range: f32) -> Result<Vec<Hit>, String> {
        let mut hits = Vec::with_capacity(firings.iter().map(|firing| firing.rays.len()).sum());
        let mut left = firings;
        while !left.is_empty() {
            let (now, later) = left.split_at(self.cut(left));
            let found = self.cast(now, range).map_err(|error| error.to_string())?;
            hits.extend(found);
            left = later;
        }
        Ok(hits)
    }
}
