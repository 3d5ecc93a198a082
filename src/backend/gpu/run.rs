use rayon::prelude::*;

use super::casting::Caster;
use super::device::Device;
use super::kernels::{Kernels, beam_workgroups, dispatch};
use super::resources::{ChunkBuffers, SceneBuffers, occupied_workgroups, walk_passes};
use crate::backend::cpu::{Worth, beam_direction, bitmap_words, take_sums, union_of};
use crate::backend::layout::{
    DevicePose, HALVED_SUMS, ITEMS_PER_WORKGROUP, PARTIAL_WORDS, UNFINISHED, Uniforms,
};
use crate::backend::{BackendError, Problem, Tally};
use crate::bvh::{Hit, NO_HIT, Ray};

/// One loaded chunk and all that its stages read.
pub(super) struct Run<'a> {
    pub(super) problem: &'a Problem,
    pub(super) device: &'a Device,
    pub(super) kernels: &'a Kernels,
    pub(super) scene: &'a SceneBuffers,
    pub(super) chunk: &'a ChunkBuffers,
    /// Where the chunk is cast by shafts.
    pub(super) caster: Option<&'a Caster>,
}

impl Run<'_> {
    fn write_uniforms(&self, frame: usize, range: f32, walk_pass: u32) {
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
            walk_resumes: u32::from(walk_passes(self.problem) > 1),
            ends_at_hits: u32::from(self.problem.ends_at_hits()),
        };
        self.device.write(&self.chunk.uniforms, &[uniforms]);
    }

    fn directions(&self) -> u32 {
        self.problem.table().directions().len() as u32
    }

    fn bitmap_words(&self) -> u32 {
        self.problem.roi().voxel_count().div_ceil(32) as u32
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
        self.write_uniforms(frame, range, 0);
        let (chunk, scene) = (self.chunk, self.scene);
        let tree = &scene.frames[frame];
        self.device.submit("casting", |encoder| {
            encoder.clear_buffer(&chunk.counters, 0, None);
            let kernels = self.kernels;
            if let Some((shafts, bundles)) = self.caster.and_then(|c| c.frame(frame)) {
                let buffers = [
                    &chunk.uniforms,
                    &bundles.blocks,
                    &bundles.beams,
                    &bundles.slots,
                    &shafts.starts,
                    &shafts.candidates,
                    &tree.triangles,
                    &chunk.hits,
                    &chunk.counters,
                ];
                dispatch(self.device, encoder, &kernels.cast_shafts, &buffers, bundles.workgroups);
            } else {
                let buffers = [
                    &chunk.uniforms,
                    &chunk.poses,
                    &scene.directions,
                    &tree.nodes,
                    &tree.triangles,
                    &chunk.hits,
                    &chunk.counters,
                ];
                let groups = beam_workgroups(self.directions(), chunk.sensors);
                dispatch(self.device, encoder, &kernels.cast_closest, &buffers, groups);
            }
        })?;
        let bytes = 4 * (1 + u64::from(chunk.sensors));
        let mut counters: Vec<u32> = self.device.read("cast_closest", &chunk.counters, bytes)?;
        let unfinished = counters.remove(0);
        if unfinished > 0 {
            self.finish_on_the_host(frame, range, &mut counters)?;
        }
        Ok(counters)
    }

    /// Casts the beams whose traversal needs more steps than an invocation may take, with the CPU
    /// twin, and puts their hits where the kernel would have.
    fn finish_on_the_host(
        &self,
        frame: usize,
        range: f32,
        counters: &mut [u32],
    ) -> Result<(), BackendError> {
        let mut hits = self.read_hits()?;
        let bytes = u64::from(self.chunk.sensors) * size_of::<DevicePose>() as u64;
        let poses: Vec<DevicePose> = self.device.read("cast_closest", &self.chunk.poses, bytes)?;
        let table = self.problem.table();
        let bvh = self.problem.geometry(frame).expect("only frames with geometry are cast");
        for (sensor, row) in hits.chunks_mut(table.directions().len()).enumerate() {
            let pose = &poses[sensor];
            let origin = pose.rows.map(|row| row[3]).into();
            for (hit, &direction) in row.iter_mut().zip(table.directions()) {
                if hit.prim == UNFINISHED {
                    let ray = Ray::new(origin, beam_direction(pose, direction), range);
                    *hit = bvh.closest_hit(&ray);
                    counters[sensor] += u32::from(hit.prim != NO_HIT);
                }
            }
        }
        let words: Vec<[u32; 2]> = hits.iter().map(|hit| [hit.t.to_bits(), hit.prim]).collect();
        self.device.write(&self.chunk.hits, &words);
        Ok(())
    }

    /// Hits of every beam of the chunk.
    pub(super) fn read_hits(&self) -> Result<Vec<Hit>, BackendError> {
        let bytes = 8 * u64::from(self.chunk.sensors) * u64::from(self.directions());
        let words: Vec<[u32; 2]> = self.device.read("read-back", &self.chunk.hits, bytes)?;
        Ok(words.iter().map(|&[t, prim]| Hit { t: f32::from_bits(t), prim }).collect())
    }

    /// Marks the covered voxels of each sensor.
    pub(super) fn cover(&self, frame: usize, range: f32) -> Result<(), BackendError> {
        let chunk = self.chunk;
        let buffers = [
            &chunk.uniforms,
            &chunk.poses,
            &self.scene.directions,
            &chunk.hits,
            &chunk.bitmaps,
            &chunk.walk_state,
        ];
        for pass in 0..walk_passes(self.problem) {
            self.write_uniforms(frame, range, pass);
            self.device.submit("cover_voxels", |encoder| {
                if pass == 0 {
                    encoder.clear_buffer(&chunk.bitmaps, 0, None);
                }
                let groups = beam_workgroups(self.directions(), chunk.sensors);
                dispatch(self.device, encoder, &self.kernels.cover_voxels, &buffers, groups);
            })?;
        }
        Ok(())
    }

    /// Adds the sums over the covered voxels of this frame to `tallies`, one a placement.
    pub(super) fn reduce(&self, hits: &[u32], tallies: &mut [Tally]) -> Result<(), BackendError> {
        let (chunk, scene) = (self.chunk, self.scene);
        let count = tallies.len() as u32;
        let occupied_groups = occupied_workgroups(self.problem);
        let shared = [&chunk.uniforms, &chunk.placement_sensors, &chunk.bitmaps];
        let with = |more: &[_]| [&shared[..], more].concat();
        self.device.submit("reduce", |encoder| {
            encoder.clear_buffer(&chunk.totals, 0, None);
            let words = self.bitmap_words().div_ceil(ITEMS_PER_WORKGROUP);
            let buffers = with(&[&chunk.totals]);
            dispatch(self.device, encoder, &self.kernels.reduce_words, &buffers, [words, count, 1]);
            if occupied_groups > 0 {
                let buffers = with(&[&scene.occupied, &chunk.partials]);
                let groups = [occupied_groups, count, 1];
                dispatch(self.device, encoder, &self.kernels.reduce_occupied, &buffers, groups);
                let buffers = with(&[&scene.class_voxels, &scene.class_runs, &chunk.totals]);
                let groups = [scene.class_run_count, count, 1];
                dispatch(self.device, encoder, &self.kernels.reduce_classes, &buffers, groups);
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

    /// As [`Self::reduce`], from bitmaps read back.
    pub(super) fn reduce_on_host(
        &self,
        worth: &Worth,
        hits: &[u32],
        tallies: &mut [Tally],
    ) -> Result<(), BackendError> {
        let words = bitmap_words(self.problem.roi());
        let mut bitmaps = self.read_bitmaps()?;
        let mut rest = bitmaps.as_mut_slice();
        let mut tasks = Vec::with_capacity(tallies.len());
        for (tally, [first, lidars]) in tallies.iter_mut().zip(&self.chunk.placements) {
            let (own, after) = rest.split_at_mut(*lidars as usize * words);
            rest = after;
            self.add_beams(hits, *first, *lidars, tally);
            tasks.push((own, tally));
        }
        tasks.into_par_iter().for_each(|(own, tally)| take_sums(own, words, worth, tally));
        Ok(())
    }

    fn add_beams(&self, hits: &[u32], first: u32, lidars: u32, tally: &mut Tally) {
        let own = &hits[first as usize..(first + lidars) as usize];
        tally.hits += own.iter().map(|&h| u64::from(h)).sum::<u64>();
        tally.beams += u64::from(lidars) * u64::from(self.directions());
    }

    /// Voxels that any sensor of the chunk covers, rising.
    pub(super) fn read_covered(&self) -> Result<Vec<u64>, BackendError> {
        let words = bitmap_words(self.problem.roi());
        let bitmaps = self.read_bitmaps()?;
        Ok(union_of(&bitmaps, words))
    }

    /// Bitmaps of the chunk's sensors in words of 64 bits.
    pub(super) fn read_bitmaps(&self) -> Result<Vec<u64>, BackendError> {
        let words = self.bitmap_words() as usize;
        let bytes = 4 * u64::from(self.chunk.sensors) * words as u64;
        if words.is_multiple_of(2) {
            return self.device.read("read-back", &self.chunk.bitmaps, bytes);
        }
        let bitmaps: Vec<u32> = self.device.read("read-back", &self.chunk.bitmaps, bytes)?;
        let wide = |pair: &[u32]| {
            u64::from(pair[0]) | pair.get(1).map_or(0, |&high| u64::from(high) << 32)
        };
        Ok(bitmaps.chunks(words).flat_map(|bitmap| bitmap.chunks(2).map(wide)).collect())
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
