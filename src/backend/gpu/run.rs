use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::bricks::Bricks;
use super::casting::{Left, PacketCaster};
use super::device::{Device, Reading};
use super::kernels::{Kernels, beam_workgroups, dispatch};
use super::resources::{
    ChunkBuffers, FrameTree, SceneBuffers, Slice, occupied_workgroups, walk_passes,
};
use crate::backend::cpu::{Worth, add_sums, beam_direction, bitmap_words};
use crate::backend::layout::{
    DevicePose, HALVED_SUMS, ITEMS_PER_WORKGROUP, PARTIAL_WORDS, UNFINISHED, Uniforms,
};
use crate::backend::{BackendError, Problem, Tally};
use crate::bvh::{Hit, Ray};

/// One loaded chunk and all that its stages read.
pub(super) struct Run<'a> {
    pub(super) problem: &'a Problem,
    pub(super) device: &'a Device,
    pub(super) kernels: &'a Kernels,
    pub(super) scene: &'a SceneBuffers,
    pub(super) chunk: &'a ChunkBuffers,
    /// Where beams are cast in packets.
    pub(super) caster: Option<&'a PacketCaster>,
}

impl Run<'_> {
    fn write_uniforms(&self, frame: usize, range: f32, walk_pass: u32, first_sensor: u32) {
        let roi = self.problem.roi();
        let bvh = self.problem.geometry(frame);
        let uniforms = Uniforms {
            shape: roi.shape(),
            direction_count: self.directions(),
            voxel: roi.voxel().map(|v| v as f32),
            range,
            bitmap_words: self.bitmap_words(),
            node_count: bvh.map_or(0, |b| b.nodes.len() as u32),
            pad: bvh.map_or(0.0, |b| b.pad),
            occupied_count: self.problem.content().occupied().len() as u32,
            class_count: self.problem.content().classes().len() as u32,
            walk_pass,
            first_sensor,
            ends_at_hits: u32::from(self.problem.ends_at_hits()),
        };
        self.device.write(&self.chunk.uniforms, &[uniforms]);
    }

    fn directions(&self) -> u32 {
        self.problem.table().directions().len() as u32
    }

    fn bitmap_words(&self) -> u32 {
        Bricks::new(self.problem.roi()).words() as u32
    }

    /// Casts the beams where the coverage needs hits; hits counted a sensor, else all zero.
    pub(super) fn cast(&self, frame: usize, range: f32) -> Result<Vec<u32>, BackendError> {
        if self.problem.ends_at_hits() {
            self.cast_geometry(frame, range)
        } else {
            Ok(vec![0; self.chunk.sensors as usize])
        }
    }

    /// Casts every beam into a frame's geometry and counts the hits of each sensor.
    pub(super) fn cast_geometry(&self, frame: usize, range: f32) -> Result<Vec<u32>, BackendError> {
        self.write_uniforms(frame, range, 0, 0);
        let (chunk, scene) = (self.chunk, self.scene);
        let (mut hits, left) = match (&scene.frames[frame], self.caster) {
            (FrameTree::Quads(tree), Some(caster)) => {
                self.device.submit("casting", |encoder| {
                    let (device, kernels) = (self.device, self.kernels);
                    caster.record(device, kernels, encoder, chunk, &scene.directions, tree);
                })?;
                caster.read(self.device, chunk.sensors as usize, self.directions() as usize)?
            }
            (FrameTree::Quantized { nodes, triangles }, _) => {
                self.device.submit("casting", |encoder| {
                    encoder.clear_buffer(&chunk.counters, 0, None);
                    let buffers = [
                        &chunk.uniforms,
                        &chunk.poses,
                        &scene.directions,
                        nodes,
                        triangles,
                        &chunk.hits,
                        &chunk.counters,
                    ];
                    let kernels = self.kernels;
                    let groups = beam_workgroups(self.directions(), chunk.sensors);
                    dispatch(self.device, encoder, kernels, "cast_closest", &buffers, None, groups);
                })?;
                let bytes = 4 * (1 + u64::from(chunk.sensors));
                let mut hits: Vec<u32> = self.device.read("casting", &chunk.counters, bytes)?;
                let unfinished = hits.remove(0);
                (hits, if unfinished > 0 { self.unfinished()? } else { Vec::new() })
            }
            (FrameTree::Quads(_), None) => unreachable!("made together with its caster"),
        };
        if !left.is_empty() {
            self.finish_on_the_host(frame, range, &left, &mut hits)?;
        }
        Ok(hits)
    }

    /// The beams of the chunk that ran out of steps.
    fn unfinished(&self) -> Result<Vec<Left>, BackendError> {
        let hits = self.read_hits()?;
        let beams = hits.iter().zip(0_u32..).filter(|(hit, _)| hit.prim == UNFINISHED);
        Ok(beams.map(|(_, beam)| beam).collect())
    }

    /// Casts the beams that the kernel left, with the CPU twin, and puts their hits where the kernel
    /// would have.
    fn finish_on_the_host(
        &self,
        frame: usize,
        range: f32,
        left: &[Left],
        hits: &mut [u32],
    ) -> Result<(), BackendError> {
        let bytes = u64::from(self.chunk.sensors) * size_of::<DevicePose>() as u64;
        let poses: Vec<DevicePose> = self.device.read("casting", &self.chunk.poses, bytes)?;
        let directions = self.problem.table().directions();
        let bvh = self.problem.geometry(frame).expect("only frames with geometry are cast");
        let cast = left.par_iter().map(|&beam| {
            let pose = &poses[beam as usize / directions.len()];
            let origin = pose.rows.map(|row| row[3]).into();
            let direction = beam_direction(pose, directions[beam as usize % directions.len()]);
            bvh.closest_hit(&Ray::new(origin, direction, range))
        });
        for (hit, &beam) in cast.collect::<Vec<_>>().iter().zip(left) {
            hits[beam as usize / directions.len()] += u32::from(hit.is_hit());
            let words = [[hit.t.to_bits(), hit.prim]];
            self.device.write_at(&self.chunk.hits, u64::from(beam), &words);
        }
        Ok(())
    }

    /// Hits of every beam of the chunk.
    pub(super) fn read_hits(&self) -> Result<Vec<Hit>, BackendError> {
        let bytes = 8 * u64::from(self.chunk.sensors) * u64::from(self.directions());
        let words: Vec<[u32; 2]> = self.device.read("read-back", &self.chunk.hits, bytes)?;
        Ok(words.iter().map(|&[t, prim]| Hit { t: f32::from_bits(t), prim }).collect())
    }

    /// Marks the voxels that the sensors of a slice cover, up to the last pass, and returns what records
    /// that one.
    fn cover(
        &self,
        frame: usize,
        range: f32,
        slice: &Slice,
        bitmaps: &wgpu::Buffer,
    ) -> impl Fn(&mut wgpu::CommandEncoder) {
        let chunk = self.chunk;
        let record = move |encoder: &mut wgpu::CommandEncoder| {
            let buffers = [
                &chunk.uniforms,
                &chunk.poses,
                &self.scene.directions,
                &chunk.hits,
                bitmaps,
                &chunk.walk_state,
            ];
            let (kernel, buffers) = match slice.in_bricks {
                true => ("cover_bricks", &buffers[..5]),
                false => ("cover_voxels", &buffers[..]),
            };
            let groups = beam_workgroups(self.directions(), slice.sensors);
            dispatch(self.device, encoder, self.kernels, kernel, buffers, None, groups);
        };
        let passes = if slice.in_bricks { 1 } else { walk_passes(self.problem) };
        // A walk of one pass keeps no state, which pass 0 tells.
        let first = u32::from(passes > 1);
        self.write_uniforms(frame, range, first, slice.first_sensor);
        self.device.enqueue(|encoder| encoder.clear_buffer(bitmaps, 0, None));
        for pass in first + 1..first + passes {
            self.device.enqueue(record);
            self.write_uniforms(frame, range, pass, slice.first_sensor);
        }
        record
    }

    /// Covers the chunk slice after slice and hands the bitmaps of each to `take`, while the next is
    /// being covered.
    pub(super) fn cover_slices(
        &self,
        frame: usize,
        range: f32,
        mut take: impl FnMut(&Slice, &[u32]),
    ) -> Result<(), BackendError> {
        let words = u64::from(self.bitmap_words());
        let mut under_way: Option<(&Slice, Reading)> = None;
        let mut finish = |under_way: Option<(&Slice, Reading)>| match under_way {
            Some((slice, reading)) => {
                self.device.finish(reading, |bytes| take(slice, bytemuck::cast_slice(bytes)))
            }
            None => Ok(()),
        };
        for (turn, slice) in self.chunk.slices.iter().enumerate() {
            let bitmaps = &self.chunk.bitmaps[turn % self.chunk.bitmaps.len()];
            let record = self.cover(frame, range, slice, bitmaps);
            let bytes = 4 * u64::from(slice.sensors) * words;
            let reading = self.device.start("covering", record, bitmaps, bytes)?;
            finish(under_way.replace((slice, reading)))?;
        }
        finish(under_way)
    }

    /// Covers the chunk, which is one slice, and leaves the bitmaps on the device.
    pub(super) fn cover_all(&self, frame: usize, range: f32) -> Result<(), BackendError> {
        for slice in &self.chunk.slices {
            let record = self.cover(frame, range, slice, &self.chunk.bitmaps[0]);
            self.device.submit("covering", record)?;
        }
        Ok(())
    }

    /// Adds the sums over the covered voxels of this frame to `tallies`, one a placement.
    pub(super) fn reduce(&self, hits: &[u32], tallies: &mut [Tally]) -> Result<(), BackendError> {
        let (chunk, scene) = (self.chunk, self.scene);
        let count = tallies.len() as u32;
        let occupied_groups = occupied_workgroups(self.problem);
        let shared = [&chunk.uniforms, &chunk.placement_sensors, &chunk.bitmaps[0]];
        let with = |more: &[_]| [&shared[..], more].concat();
        self.device.submit("reduce", |encoder| {
            encoder.clear_buffer(&chunk.totals, 0, None);
            let words = self.bitmap_words().div_ceil(ITEMS_PER_WORKGROUP);
            let buffers = with(&[&chunk.totals]);
            dispatch(
                self.device,
                encoder,
                self.kernels,
                "reduce_words",
                &buffers,
                None,
                [words, count, 1],
            );
            if occupied_groups > 0 {
                let buffers = with(&[&scene.occupied, &chunk.partials]);
                let groups = [occupied_groups, count, 1];
                dispatch(
                    self.device,
                    encoder,
                    self.kernels,
                    "reduce_occupied",
                    &buffers,
                    None,
                    groups,
                );
                let buffers = with(&[&scene.class_voxels, &scene.class_runs, &chunk.totals]);
                let groups = [scene.class_run_count, count, 1];
                dispatch(
                    self.device,
                    encoder,
                    self.kernels,
                    "reduce_classes",
                    &buffers,
                    None,
                    groups,
                );
            }
        })?;
        let stride = 1 + self.problem.content().classes().len();
        let bytes = 4 * u64::from(count) * stride as u64;
        let totals: Vec<u32> = self.device.read("reduce", &chunk.totals, bytes)?;
        let bytes = 4 * u64::from(count * occupied_groups) * u64::from(PARTIAL_WORDS);
        let partials: Vec<u32> = if bytes > 0 {
            self.device.read("reduce", &chunk.partials, bytes)?
        } else {
            Vec::new()
        };
        let partials_each = (occupied_groups * PARTIAL_WORDS) as usize;
        for (index, tally) in tallies.iter_mut().enumerate() {
            let totals = &totals[index * stride..(index + 1) * stride];
            tally.covered += u64::from(totals[0]);
            for (sum, &count) in tally.by_class.iter_mut().zip(&totals[1..]) {
                *sum += u64::from(count);
            }
            let partials = &partials[index * partials_each..(index + 1) * partials_each];
            for partial in partials.chunks(PARTIAL_WORDS as usize) {
                add_partial(partial, tally);
            }
            let [first, lidars] = chunk.placements[index];
            self.add_beams(hits, first, lidars, tally);
        }
        Ok(())
    }

    /// Covers the chunk and adds the sums of this frame to `tallies`, as [`Self::reduce`], on the
    /// host; the time that the sums take.
    pub(super) fn cover_and_reduce_on_host(
        &self,
        frame: usize,
        range: f32,
        worth: &Worth,
        hits: &[u32],
        tallies: &mut [Tally],
    ) -> Result<Duration, BackendError> {
        let words = self.bitmap_words() as usize;
        let mut time = Duration::ZERO;
        self.cover_slices(frame, range, |slice, bitmaps| {
            let start = Instant::now();
            let mut rest = bitmaps;
            let mut tasks = Vec::with_capacity(slice.placements.len());
            let placements = &self.chunk.placements[slice.placements.clone()];
            for (tally, [first, lidars]) in
                tallies[slice.placements.clone()].iter_mut().zip(placements)
            {
                let (own, after) = rest.split_at(*lidars as usize * words);
                rest = after;
                self.add_beams(hits, *first, *lidars, tally);
                tasks.push((bytemuck::cast_slice(own), tally));
            }
            tasks.into_par_iter().for_each(|(own, tally)| add_sums(own, words / 2, worth, tally));
            time += start.elapsed();
        })?;
        Ok(time)
    }

    fn add_beams(&self, hits: &[u32], first: u32, lidars: u32, tally: &mut Tally) {
        let own = &hits[first as usize..(first + lidars) as usize];
        tally.hits += own.iter().map(|&h| u64::from(h)).sum::<u64>();
        tally.beams += u64::from(lidars) * u64::from(self.directions());
    }

    /// Covers the chunk; bitmaps of its sensors in the order of the grid, in words of 64 bits.
    pub(super) fn bitmaps(&self, frame: usize, range: f32) -> Result<Vec<u64>, BackendError> {
        let bricks = Bricks::new(self.problem.roi());
        let (words, linear) = (self.bitmap_words() as usize, bitmap_words(self.problem.roi()));
        let mut bitmaps = vec![0; self.chunk.sensors as usize * linear];
        self.cover_slices(frame, range, |slice, made| {
            let first = slice.first_sensor as usize * linear;
            bitmaps[first..]
                .par_chunks_mut(linear)
                .zip(made.par_chunks(words))
                .for_each(|(linear, made)| bricks.add_in_order(made, linear));
        })?;
        Ok(bitmaps)
    }
}

/// Puts the 16-bit halves of one workgroup's sums together.
fn add_partial(partial: &[u32], tally: &mut Tally) {
    let sum = |slot: u32| {
        let at = 1 + 2 * slot as usize;
        u64::from(partial[at]) + (u64::from(partial[at + 1]) << 16)
    };
    tally.covered_nonzero += u64::from(partial[0]);
    for (slot, entropy) in tally.entropy.iter_mut().enumerate() {
        *entropy += sum(slot as u32);
    }
    for (slot, unique) in (3..HALVED_SUMS).zip(&mut tally.unique) {
        *unique += sum(slot);
    }
}
