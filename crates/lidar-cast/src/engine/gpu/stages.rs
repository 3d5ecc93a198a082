//! The stages of a step: their commands for the device, and their parts that the host does.

use std::time::Duration;

use rayon::prelude::*;

use super::chunk::{ChunkSensors, GpuBatch, GpuChunk, bitmap_words, occupied_workgroups};
use super::kernels::beam_workgroups;
use super::layout::{ITEMS_PER_WORKGROUP, PARTIAL_WORDS, UNFINISHED, Uniforms};
use super::pipeline::Pipeline;
use super::readback::ReadBack;
use crate::bvh::Hit;
use crate::cast::closest_hit_in;
use crate::cover::{BitOrder, cover_voxels};
use crate::engine::Result;
use crate::task::{Air, Frame};

/// A buffer whose first bytes are read back, and their number.
type BufferHead<'b> = (&'b wgpu::Buffer, u64);

impl Pipeline<'_> {
    /// Uploads a chunk and where its sensors stand in a frame, for all commands from now on.
    pub(super) fn place(
        &self,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
        frame: usize,
    ) -> Result<()> {
        let (work, scene) = (self.work, self.scene);
        let geometry = self.task.geometry(frame);
        let (instances, sensors) =
            chunk.sensors(standing, geometry, &scene.trees.roots, &scene.first_directions);
        let (roi, content) = (self.task.roi(), self.task.content());
        let uniforms = Uniforms {
            shape: roi.shape(),
            bitmap_words: bitmap_words(self.task),
            voxel: roi.voxel().map(|v| v as f32),
            occupied_count: content.occupied().len() as u32,
            class_count: content.set_count() as u32,
            ends_at_hits: u32::from(self.task.ends_at_hits()),
            spare: [0; 2],
        };
        self.device.write(&work.uniforms, &[uniforms]);
        self.device.write(&work.placement_sensors, &chunk.placements);
        self.device.write(&work.poses, &standing.poses);
        self.device.write(&work.instances, &instances);
        self.device.write(&work.sensor_beams, &sensors);
        self.device.check("placing sensors")
    }

    fn frame(&self, frame: usize) -> &Frame {
        self.task.geometry(frame).expect("only frames with geometry are cast")
    }

    /// Records a stage of a chunk that is placed in a frame; `number` is its number in the step where the device is to
    /// write down its time.
    pub(super) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        chunk: &GpuChunk<'_>,
        stage: StepStage,
        number: Option<usize>,
    ) {
        let (work, scene) = (self.work, self.scene);
        let stamps = self.device.stamps.as_ref().zip(number);
        let stamp = stamps.map(|(stamps, number)| stamps.of(number));
        let most = self.task.sensors().most_beams() as u32;
        let groups = beam_workgroups(most, chunk.batch.len() as u32);
        match stage {
            StepStage::Cast => {
                encoder.clear_buffer(&work.counters, 0, None);
                let buffers = [
                    &work.instances, &work.sensor_beams, &scene.directions, &scene.trees.nodes,
                    &scene.trees.triangles, &work.hits, &work.counters,
                ];
                let kernel = "cast_closest";
                self.kernels.dispatch(self.device, encoder, kernel, &buffers, groups, stamp);
            }
            StepStage::Cover => {
                encoder.clear_buffer(&work.bitmaps, 0, None);
                let buffers = [
                    &work.uniforms, &work.poses, &work.sensor_beams, &scene.directions, &work.hits,
                    &work.bitmaps,
                ];
                let kernel = "cover_voxels";
                self.kernels.dispatch(self.device, encoder, kernel, &buffers, groups, stamp);
            }
            StepStage::Reduce => self.record_reduce(encoder, chunk, stamp),
        }
    }

    /// Counters of the casting: unfinished beams, then hits by sensor.
    pub(super) fn counters(&self, chunk: &GpuChunk<'_>) -> BufferHead<'_> {
        (&self.work.counters, 4 * (1 + chunk.batch.len() as u64))
    }

    /// Hands over the casting alone; the counters are read.
    pub(super) fn cast(&self, chunk: &GpuChunk<'_>) -> Result<ReadBack> {
        let record =
            |encoder: &mut wgpu::CommandEncoder| self.record(encoder, chunk, StepStage::Cast, None);
        self.device.start("casting", record, &[self.counters(chunk)])
    }

    /// Waits for the hits by sensor, and casts the beams that ran out of steps by the CPU twin.
    pub(super) fn settle(
        &self,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
        frame: usize,
        counters: ReadBack,
    ) -> Result<Vec<u32>> {
        let counters: Vec<u32> =
            self.device.finish(counters, |parts| bytemuck::pod_collect_to_vec(parts[0]))?;
        let mut hits = counters[1..].to_vec();
        if counters[0] == 0 {
            return Ok(hits);
        }
        let (frame, batch) = (self.frame(frame), &chunk.batch);
        let beams = self.read_hits(chunk)?;
        let unfinished = (0..beams.len()).into_par_iter().filter(|&b| beams[b].prim == UNFINISHED);
        let cast = unfinished.map(|beam| {
            let sensor = batch.sensor_of(beam);
            let direction = batch.table(sensor).directions()[beam - batch.beams_of(sensor).start];
            let pose = &standing.ego_from_sensors[sensor];
            (beam, closest_hit_in(frame, pose, direction, batch.range(sensor)))
        });
        for (beam, hit) in cast.collect::<Vec<_>>() {
            hits[batch.sensor_of(beam)] += u32::from(hit.is_hit());
            self.device.write_at(&self.work.hits, beam as u64, &[hit]);
        }
        Ok(hits)
    }

    /// Lets weather end beams early, by one host function for all engines, so that hits keep their bits. Returns
    /// the remaining hits by sensor.
    pub(super) fn dim(
        &self,
        air: &dyn Air,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
        frame: usize,
    ) -> Result<Vec<u32>> {
        let (batch, number) = (&chunk.batch, self.task.number_of(frame));
        let mut beams = self.read_hits(chunk)?;
        air.dim(batch, &standing.ego_from_sensors, self.frame(frame), number, &mut beams);
        self.device.write_at(&self.work.hits, 0, &beams);
        let left = |sensor| beams[batch.beams_of(sensor)].iter().filter(|hit| hit.is_hit()).count();
        Ok((0..batch.len()).map(|sensor| left(sensor) as u32).collect())
    }

    /// Hits of every beam of the chunk that was cast last.
    pub(super) fn read_hits(&self, chunk: &GpuChunk<'_>) -> Result<Vec<Hit>> {
        let beams = chunk.batch.beams() as u64;
        self.device.read("read-back", &self.work.hits, size_of::<Hit>() as u64 * beams)
    }

    /// Bitmaps of the sensors that the kernel leaves, by its CPU twin.
    pub(super) fn cover_by_host(
        &self,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
    ) -> Result<Vec<(usize, Vec<u32>)>> {
        if standing.covered_by_host.is_empty() {
            return Ok(Vec::new());
        }
        let (task, batch) = (self.task, &chunk.batch);
        let roi = task.roi();
        let (linear, bricks) = (BitOrder::linear(roi), BitOrder::bricks(roi));
        let hits = if task.ends_at_hits() { Some(self.read_hits(chunk)?) } else { None };
        let cover = |&sensor: &usize| {
            let hits = hits.as_ref().map(|hits| &hits[batch.beams_of(sensor)]);
            let mut bitmap = Vec::new();
            let pose = &standing.poses[sensor..=sensor];
            let (table, range) = (batch.table(sensor), batch.range(sensor));
            cover_voxels(pose, table, roi, hits, range, &mut bitmap);
            let words = linear.convert(&bitmap, &bricks);
            (sensor, words.iter().flat_map(|&w| [w as u32, (w >> 32) as u32]).collect())
        };
        Ok(standing.covered_by_host.par_iter().map(cover).collect())
    }

    /// Replaces the kernel's bitmaps of some sensors.
    pub(super) fn write_bitmaps(&self, bitmaps: &[(usize, Vec<u32>)]) {
        for (sensor, bitmap) in bitmaps {
            let first = *sensor as u64 * u64::from(bitmap_words(self.task));
            self.device.write_at(&self.work.bitmaps, first, bitmap);
        }
    }

    /// Records the sums over the covered voxels.
    fn record_reduce(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        chunk: &GpuChunk<'_>,
        stamp: Option<wgpu::ComputePassTimestampWrites<'_>>,
    ) {
        let (work, scene) = (self.work, self.scene);
        let count = chunk.placements.len() as u32;
        let occupied_groups = occupied_workgroups(self.task);
        encoder.clear_buffer(&work.totals, 0, None);
        let mut dispatch = |kernel, more: &[_], groups, stamp| {
            let shared = [&work.uniforms, &work.placement_sensors, &work.bitmaps];
            let buffers = [&shared[..], more].concat();
            let groups = [groups, count, 1];
            self.kernels.dispatch(self.device, encoder, kernel, &buffers, groups, stamp);
        };
        if occupied_groups > 0 {
            let buffers = [&scene.occupied, &work.partials];
            dispatch("reduce_occupied", &buffers, occupied_groups, None);
            let buffers = [&scene.class_voxels, &scene.class_runs, &work.totals];
            dispatch("reduce_classes", &buffers, scene.class_run_count, None);
        }
        let words = bitmap_words(self.task).div_ceil(ITEMS_PER_WORKGROUP);
        dispatch("reduce_words", &[&work.totals], words, stamp);
    }

    /// Results of a chunk in a frame: totals and partial sums, or bitmaps.
    pub(super) fn results(
        &self,
        chunk: &GpuChunk<'_>,
        batch: &GpuBatch<'_>,
    ) -> Vec<BufferHead<'_>> {
        let (work, count) = (self.work, chunk.placements.len() as u64);
        if !batch.sums {
            let bytes = 4 * chunk.batch.len() as u64 * u64::from(bitmap_words(self.task));
            return vec![(&work.bitmaps, bytes)];
        }
        let stride = 1 + self.task.content().set_count() as u64;
        let each = u64::from(occupied_workgroups(self.task)) * u64::from(PARTIAL_WORDS);
        vec![(&work.totals, 4 * count * stride), (&work.partials, 4 * count * each)]
    }
}

/// Stages of a step, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum StepStage {
    Cast,
    Cover,
    Reduce,
}

/// Most times of a step: its begin, and the end of each stage.
const STAMPS: u32 = 4;
/// Bytes of the times of a step.
pub(super) const STAMP_BYTES: u64 = 8 * STAMPS as u64;

/// Times of one step on the device. The next step writes over them, once they are copied.
pub(super) struct Stamps {
    set: wgpu::QuerySet,
    /// Nanoseconds of a tick.
    period: f64,
    pub(super) resolved: wgpu::Buffer,
}

impl Stamps {
    /// Room for the times of a step; `None` on a device that tells no time.
    pub(super) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Option<Self> {
        if !device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let set = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: STAMPS,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times"),
            size: STAMP_BYTES,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Some(Self { set, period: f64::from(queue.get_timestamp_period()), resolved })
    }

    /// The times of a stage, given by its number in the step: the first one also begins.
    pub(super) fn of(&self, stage: usize) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: (stage == 0).then_some(0),
            end_of_pass_write_index: Some(stage as u32 + 1),
        }
    }

    /// Copies the times of a step of some stages to [`Self::resolved`].
    pub(super) fn resolve(&self, encoder: &mut wgpu::CommandEncoder, stages: usize) {
        encoder.resolve_query_set(&self.set, 0..stages as u32 + 1, &self.resolved, 0);
    }

    /// Time of some ticks.
    pub(super) fn time(&self, ticks: u64) -> Duration {
        Duration::from_nanos((ticks as f64 * self.period) as u64)
    }
}

/// Adds the ticks of a step's stages, which lie between its times.
pub(super) fn stage_ticks(stages: &[StepStage], stamps: &[u64], ticks: &mut [u64; 3]) {
    for (stage, between) in stages.iter().zip(stamps.windows(2)) {
        ticks[*stage as usize] += between[1].saturating_sub(between[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_lie_between_times() {
        let mut ticks = [1, 0, 0];
        stage_ticks(
            &[StepStage::Cast, StepStage::Cover, StepStage::Reduce],
            &[10, 13, 18, 25],
            &mut ticks,
        );
        assert_eq!(ticks, [4, 5, 7]);
        // Only coverage; the rest is of an earlier step.
        stage_ticks(&[StepStage::Cover], &[30, 32, 18, 25], &mut ticks);
        assert_eq!(ticks, [4, 7, 7]);
    }
}
