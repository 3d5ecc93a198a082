use rayon::prelude::*;

use super::bricks::Bricks;
use super::casting::Left;
use super::device::Device;
use super::kernels::{Kernels, beam_workgroups};
use super::prepared::{Prepared, Slice};
use super::resources::{FrameTree, SceneBuffers, WorkBuffers, occupied_workgroups, walk_passes};
use super::transfer::Reading;
use crate::bvh::{Hit, Ray};
use crate::engine::BackendError;
use crate::engine::gpu::layout::{ITEMS_PER_WORKGROUP, PARTIAL_WORDS, UNFINISHED, Uniforms};
use crate::problem::Problem;
use crate::problem::beam_direction;

/// The stages, each of which hands the device the work on the chunk that was uploaded last.
pub(super) struct Run<'a> {
    pub(super) problem: &'a Problem,
    pub(super) device: &'a Device,
    pub(super) kernels: &'a Kernels,
    pub(super) scene: &'a SceneBuffers,
    pub(super) work: &'a WorkBuffers,
    pub(super) range: f32,
}

impl Run<'_> {
    fn write_uniforms(&self, frame: usize, walk_pass: u32, first_sensor: u32) {
        let roi = self.problem.roi();
        let bvh = self.problem.geometry(frame);
        let uniforms = Uniforms {
            shape: roi.shape(),
            direction_count: self.directions(),
            voxel: roi.voxel().map(|v| v as f32),
            range: self.range,
            bitmap_words: self.bitmap_words(),
            node_count: bvh.map_or(0, |b| b.nodes.len() as u32),
            pad: bvh.map_or(0.0, |b| b.pad),
            occupied_count: self.problem.content().occupied().len() as u32,
            class_count: self.problem.content().classes().len() as u32,
            walk_pass,
            first_sensor,
            ends_at_hits: u32::from(self.problem.ends_at_hits()),
        };
        if self.work.written.replace(Some(uniforms)) != Some(uniforms) {
            self.device.write(&self.work.uniforms, &[uniforms]);
        }
    }

    fn directions(&self) -> u32 {
        self.problem.table().directions().len() as u32
    }

    fn bitmap_words(&self) -> u32 {
        Bricks::new(self.problem.roi()).words() as u32
    }

    /// Compiles the kernels that cast and cover a chunk, and sum over that, where they do.
    pub(super) fn compile(&self, chunk: &Prepared, cast: bool, sums: bool) {
        let mut kernels = Vec::new();
        if cast {
            match &chunk.packing {
                Some(packing) => kernels.extend(packing.kernels()),
                None => kernels.push("cast_closest"),
            }
        }
        let some = |in_bricks| chunk.slices.iter().any(|slice| slice.in_bricks == in_bricks);
        kernels.extend(some(true).then_some("cover_bricks"));
        kernels.extend(some(false).then_some("cover_voxels"));
        if sums {
            kernels.push("reduce_words");
            if occupied_workgroups(self.problem) > 0 {
                kernels.extend(["reduce_occupied", "reduce_classes"]);
            }
        }
        self.kernels.compile(self.device, &kernels);
    }

    /// Casts every beam of the chunk into a frame's geometry; [`Self::settle`] takes what is read.
    pub(super) fn cast(&self, chunk: &Prepared, frame: usize) -> Result<Reading, BackendError> {
        self.write_uniforms(frame, 0, 0);
        let (work, scene) = (self.work, self.scene);
        match (&scene.frames[frame], &chunk.packing) {
            (FrameTree::Quads(tree), Some(packing)) => {
                let record = |encoder: &mut wgpu::CommandEncoder| {
                    let shared = [&work.uniforms, &work.poses, &scene.directions, &work.hits];
                    let (kernels, device) = (self.kernels, self.device);
                    work.packets.record(packing, kernels, device, encoder, shared, tree);
                };
                self.device.start("casting", record, &work.packets.marks(packing))
            }
            (FrameTree::Quantized { nodes, triangles }, _) => {
                let record = |encoder: &mut wgpu::CommandEncoder| {
                    encoder.clear_buffer(&work.counters, 0, None);
                    let buffers = [
                        &work.uniforms,
                        &work.poses,
                        &scene.directions,
                        nodes,
                        triangles,
                        &work.hits,
                        &work.counters,
                    ];
                    let groups = beam_workgroups(self.directions(), chunk.poses.len() as u32);
                    let (kernels, device) = (self.kernels, self.device);
                    kernels.dispatch(device, encoder, "cast_closest", &buffers, None, groups);
                };
                let bytes = 4 * (1 + chunk.poses.len() as u64);
                self.device.start("casting", record, &[(&work.counters, bytes)])
            }
            (FrameTree::Quads(_), None) => unreachable!("put together with its packets"),
        }
    }

    /// Waits for the hits of each sensor, and casts the beams that the kernel left.
    pub(super) fn settle(
        &self,
        chunk: &Prepared,
        frame: usize,
        cast: Reading,
    ) -> Result<Vec<u32>, BackendError> {
        let read = |parts: &[&[u8]]| match &chunk.packing {
            Some(packing) => packing.read(parts[0], parts[1]),
            None => (bytemuck::pod_collect_to_vec(parts[0]), Vec::new()),
        };
        let (mut hits, mut left) = self.device.finish(cast, read)?;
        if chunk.packing.is_none() && hits.remove(0) > 0 {
            left = self.unfinished(chunk)?;
        }
        if !left.is_empty() {
            self.finish_on_the_host(chunk, frame, &left, &mut hits);
        }
        Ok(hits)
    }

    /// The beams of the chunk that ran out of steps.
    fn unfinished(&self, chunk: &Prepared) -> Result<Vec<Left>, BackendError> {
        let hits = self.read_hits(chunk)?;
        let beams = hits.iter().zip(0_u32..).filter(|(hit, _)| hit.prim == UNFINISHED);
        Ok(beams.map(|(_, beam)| beam).collect())
    }

    /// Casts the beams that the kernel left, with the CPU twin, and puts their hits where the kernel
    /// would have.
    fn finish_on_the_host(&self, chunk: &Prepared, frame: usize, left: &[Left], hits: &mut [u32]) {
        let directions = self.problem.table().directions();
        let bvh = self.problem.geometry(frame).expect("only frames with geometry are cast");
        let range = self.range;
        let cast = left.par_iter().map(|&beam| {
            let pose = &chunk.poses[beam as usize / directions.len()];
            let origin = pose.rows.map(|row| row[3]).into();
            let direction = beam_direction(pose, directions[beam as usize % directions.len()]);
            bvh.closest_hit(&Ray::new(origin, direction, range))
        });
        for (hit, &beam) in cast.collect::<Vec<_>>().iter().zip(left) {
            hits[beam as usize / directions.len()] += u32::from(hit.is_hit());
            let words = [[hit.t.to_bits(), hit.prim]];
            self.device.write_at(&self.work.hits, u64::from(beam), &words);
        }
    }

    /// Hits of every beam of the chunk.
    pub(super) fn read_hits(&self, chunk: &Prepared) -> Result<Vec<Hit>, BackendError> {
        let bytes = 8 * chunk.poses.len() as u64 * u64::from(self.directions());
        let words: Vec<[u32; 2]> = self.device.read("read-back", &self.work.hits, bytes)?;
        Ok(words.iter().map(|&[t, prim]| Hit { t: f32::from_bits(t), prim }).collect())
    }

    /// Marks the voxels that the sensors of a slice cover, up to the last pass, and returns what records
    /// that one.
    fn record_cover(
        &self,
        slice: &Slice,
        frame: usize,
        bitmaps: &wgpu::Buffer,
    ) -> impl Fn(&mut wgpu::CommandEncoder) {
        let work = self.work;
        let record = move |encoder: &mut wgpu::CommandEncoder| {
            let buffers = [
                &work.uniforms,
                &work.poses,
                &self.scene.directions,
                &work.hits,
                bitmaps,
                &work.walk_state,
            ];
            let (kernel, buffers) = match slice.in_bricks {
                true => ("cover_bricks", &buffers[..5]),
                false => ("cover_voxels", &buffers[..]),
            };
            let groups = beam_workgroups(self.directions(), slice.sensors);
            self.kernels.dispatch(self.device, encoder, kernel, buffers, None, groups);
        };
        let passes = if slice.in_bricks { 1 } else { walk_passes(self.problem) };
        // A walk of one pass keeps no state, which pass 0 tells.
        let first = u32::from(passes > 1);
        self.write_uniforms(frame, first, slice.first_sensor);
        self.device.enqueue(|encoder| encoder.clear_buffer(bitmaps, 0, None));
        for pass in first + 1..first + passes {
            self.device.enqueue(record);
            self.write_uniforms(frame, pass, slice.first_sensor);
        }
        record
    }

    /// Covers a slice into the bitmaps of its turn, which are read.
    pub(super) fn cover(
        &self,
        slice: &Slice,
        frame: usize,
        turn: usize,
    ) -> Result<Reading, BackendError> {
        let bitmaps = &self.work.bitmaps[turn % self.work.bitmaps.len()];
        let record = self.record_cover(slice, frame, bitmaps);
        let bytes = 4 * u64::from(slice.sensors) * u64::from(self.bitmap_words());
        self.device.start("covering", record, &[(bitmaps, bytes)])
    }

    /// Covers a slice that is all of the chunk and leaves the bitmaps on the device.
    pub(super) fn cover_on_device(&self, slice: &Slice, frame: usize) -> wgpu::SubmissionIndex {
        self.device.enqueue(self.record_cover(slice, frame, &self.work.bitmaps[0]))
    }

    /// Sums over what was covered; totals and partial sums are read.
    pub(super) fn reduce(&self, chunk: &Prepared) -> Result<Reading, BackendError> {
        let (work, scene) = (self.work, self.scene);
        let count = chunk.placements.len() as u32;
        let occupied_groups = occupied_workgroups(self.problem);
        let record = |encoder: &mut wgpu::CommandEncoder| {
            let mut dispatch = |kernel, more: &[_], groups| {
                let shared = [&work.uniforms, &work.placement_sensors, &work.bitmaps[0]];
                let buffers = [&shared[..], more].concat();
                let groups = [groups, count, 1];
                self.kernels.dispatch(self.device, encoder, kernel, &buffers, None, groups);
            };
            let words = self.bitmap_words().div_ceil(ITEMS_PER_WORKGROUP);
            dispatch("reduce_words", &[&work.totals], words);
            if occupied_groups > 0 {
                let buffers = [&scene.occupied, &work.partials];
                dispatch("reduce_occupied", &buffers, occupied_groups);
                let buffers = [&scene.class_voxels, &scene.class_runs, &work.totals];
                dispatch("reduce_classes", &buffers, scene.class_run_count);
            }
        };
        let record = |encoder: &mut wgpu::CommandEncoder| {
            encoder.clear_buffer(&work.totals, 0, None);
            record(encoder);
        };
        let stride = 1 + self.problem.content().classes().len() as u64;
        let totals = (&work.totals, 4 * u64::from(count) * stride);
        let each = u64::from(occupied_groups) * u64::from(PARTIAL_WORDS);
        let partials = (&work.partials, 4 * u64::from(count) * each);
        self.device.start("reduce", record, &[totals, partials])
    }
}
