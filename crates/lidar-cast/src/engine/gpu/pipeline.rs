//! A batch on its way through the device: chunk after chunk, frame after frame, one step in flight.
//!
//! ```text
//! GpuBatch ─► GpuChunk: uploaded ─► cast ─► settle: hits of the beams that the kernel left, by the host
//!                                      ├─► dim: hits that come back through weather, by the host, where there is any
//!                                      └─► cover ─► reduce ─► Pending ─► ChunkResult ─► BatchTallies
//! ```
//! While the device covers and sums up one step, the host adds up the sums of the step before.

use std::rc::Rc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::chunk::{
    ChunkSensors, GpuBatch, GpuChunk, SceneBuffers, WorkBuffers, bitmap_words, occupied_workgroups,
};
use super::device::Device;
use super::kernels::{Kernels, beam_workgroups};
use super::layout::{ITEMS_PER_WORKGROUP, PARTIAL_WORDS, UNFINISHED, Uniforms};
use super::readback::ReadBack;
use crate::bvh::Hit;
use crate::cast::closest_hit_in;
use crate::cover::{BitOrder, cover_voxels};
use crate::engine::{self, BackendError};
use crate::task::{Air, Frame, StageTimes, Task};

/// A step's commands on the device and the copy of their results.
struct Pending<'a> {
    chunk: Rc<GpuChunk<'a>>,
    turn: usize,
    covered: wgpu::SubmissionIndex,
    results: ReadBack,
}

/// Results of a chunk in a frame.
pub(super) enum ChunkResult<'a> {
    /// Hits by sensor.
    Hits(&'a [u32]),
    /// Bitmaps by sensor, in bricks.
    Bitmaps(&'a [u32]),
    /// Output of the reductions.
    Sums { totals: &'a [u32], partials: &'a [u32] },
}

/// The host's time by the stage that it worked for or waited for.
struct Clock {
    since: Instant,
    times: StageTimes,
}

impl Clock {
    fn lap(&mut self, stage: fn(&mut StageTimes) -> &mut Duration) {
        let now = Instant::now();
        *stage(&mut self.times) += now - self.since;
        self.since = now;
    }
}

/// The device with a task and room for a chunk.
pub(super) struct Pipeline<'a> {
    pub(super) task: &'a Task,
    pub(super) device: &'a Device,
    pub(super) kernels: &'a Kernels,
    pub(super) scene: &'a SceneBuffers,
    pub(super) work: &'a WorkBuffers,
}

impl<'a> Pipeline<'a> {
    /// Runs a batch; `take` is told the chunk, the number of the frame in the list, and the results:
    /// hits first, if beams end at hits.
    pub(super) fn run(
        &self,
        batch: &GpuBatch<'_>,
        mut take: impl FnMut(&GpuChunk<'_>, usize, ChunkResult<'_>),
    ) -> Result<StageTimes, BackendError> {
        let casts = self.task.ends_at_hits();
        self.compile(casts, batch.sums);
        let mut clock = Clock { since: Instant::now(), times: StageTimes::default() };
        let mut last: Option<Pending<'_>> = None;
        for cut in &batch.chunks {
            let chunk = Rc::new(self.upload(batch, cut)?);
            for (turn, &frame) in batch.frames.iter().enumerate() {
                let standing = self.place(&chunk, frame)?;
                if casts {
                    let counters = self.cast(&chunk)?;
                    if let Some(last) = &last {
                        self.wait(last, &mut clock)?;
                    }
                    let mut hits = self.settle(&chunk, &standing, frame, counters)?;
                    if let Some(air) = self.task.air() {
                        hits = self.dim(air, &chunk, &standing, frame)?;
                    }
                    take(&chunk, turn, ChunkResult::Hits(&hits));
                    clock.lap(|times| &mut times.cast);
                }
                let next = self.cover(&chunk, &standing, turn, batch)?;
                if let Some(last) = last.replace(next) {
                    self.finish(last, &mut clock, &mut take)?;
                }
            }
        }
        if let Some(last) = last {
            self.finish(last, &mut clock, &mut take)?;
        }
        Ok(clock.times)
    }

    /// Casts the poses of a batch in one frame, as [`crate::cast::cast_frame_closest`] does.
    pub(super) fn hits(
        &self,
        batch: &GpuBatch<'_>,
        frame: usize,
    ) -> Result<Vec<Hit>, BackendError> {
        self.compile(true, false);
        let mut hits = Vec::new();
        for cut in &batch.chunks {
            let chunk = self.upload(batch, cut)?;
            let standing = self.place(&chunk, frame)?;
            let counters = self.cast(&chunk)?;
            self.settle(&chunk, &standing, frame, counters)?;
            hits.append(&mut self.read_hits(&chunk)?);
        }
        Ok(hits)
    }

    /// Compiles the kernels of a batch before its clock starts.
    fn compile(&self, casts: bool, sums: bool) {
        let occupied = occupied_workgroups(self.task) > 0;
        self.kernels.compile(self.device, |kernel| match kernel {
            "cast_closest" => casts,
            "reduce_words" => sums,
            "reduce_occupied" | "reduce_classes" => sums && occupied,
            kernel => kernel == "cover_voxels",
        });
    }

    /// Puts a chunk together and uploads it, for all commands from now on.
    fn upload(
        &self,
        batch: &GpuBatch<'_>,
        cut: &engine::Chunk,
    ) -> Result<GpuChunk<'a>, BackendError> {
        let chunk = GpuChunk::new(self.task, batch, cut)?;
        self.device.write(&self.work.placement_sensors, &chunk.placements);
        self.write_uniforms();
        self.device.check("uploading placements")?;
        Ok(chunk)
    }

    /// Uploads where the sensors of a chunk stand in a frame, for all commands from now on.
    fn place(&self, chunk: &GpuChunk<'_>, frame: usize) -> Result<ChunkSensors, BackendError> {
        let standing = chunk.standing(self.task.roi(), frame);
        let (work, scene) = (self.work, self.scene);
        let geometry = self.task.geometry(frame);
        let (instances, sensors) =
            chunk.sensors(&standing, geometry, &scene.roots, &scene.first_directions);
        self.device.write(&work.poses, &standing.poses);
        self.device.write(&work.instances, &instances);
        self.device.write(&work.sensor_beams, &sensors);
        self.device.check("placing sensors")?;
        Ok(standing)
    }

    fn write_uniforms(&self) {
        let (roi, content) = (self.task.roi(), self.task.content());
        let uniforms = Uniforms {
            shape: roi.shape(),
            bitmap_words: self.bitmap_words(),
            voxel: roi.voxel().map(|v| v as f32),
            occupied_count: content.occupied().len() as u32,
            class_count: content.set_count() as u32,
            ends_at_hits: u32::from(self.task.ends_at_hits()),
            spare: [0; 2],
        };
        self.device.write(&self.work.uniforms, &[uniforms]);
    }

    /// Workgroups for the beams of a chunk.
    fn groups(&self, chunk: &GpuChunk<'_>) -> [u32; 3] {
        beam_workgroups(self.task.sensors().most_beams() as u32, chunk.batch.len() as u32)
    }

    fn bitmap_words(&self) -> u32 {
        bitmap_words(self.task)
    }

    fn frame(&self, frame: usize) -> &Frame {
        self.task.geometry(frame).expect("only frames with geometry are cast")
    }

    /// Hands over the casting of a chunk that is placed in a frame; the counters are read.
    fn cast(&self, chunk: &GpuChunk<'_>) -> Result<ReadBack, BackendError> {
        let (work, scene) = (self.work, self.scene);
        let record = |encoder: &mut wgpu::CommandEncoder| {
            encoder.clear_buffer(&work.counters, 0, None);
            let buffers = [
                &work.instances,
                &work.sensor_beams,
                &scene.directions,
                &scene.nodes,
                &scene.triangles,
                &work.hits,
                &work.counters,
            ];
            let groups = self.groups(chunk);
            self.kernels.dispatch(self.device, encoder, "cast_closest", &buffers, groups);
        };
        let bytes = 4 * (1 + chunk.batch.len() as u64);
        self.device.start("casting", record, &[(&work.counters, bytes)])
    }

    /// Waits for the hits by sensor, and casts the beams that ran out of steps by the CPU twin.
    fn settle(
        &self,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
        frame: usize,
        counters: ReadBack,
    ) -> Result<Vec<u32>, BackendError> {
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
    fn dim(
        &self,
        air: &dyn Air,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
        frame: usize,
    ) -> Result<Vec<u32>, BackendError> {
        let (batch, number) = (&chunk.batch, self.task.number_of(frame));
        let mut beams = self.read_hits(chunk)?;
        air.dim(batch, &standing.ego_from_sensors, self.frame(frame), number, &mut beams);
        self.device.write_at(&self.work.hits, 0, &beams);
        let left = |sensor| beams[batch.beams_of(sensor)].iter().filter(|hit| hit.is_hit()).count();
        Ok((0..batch.len()).map(|sensor| left(sensor) as u32).collect())
    }

    /// Hits of every beam of the chunk that was cast last.
    fn read_hits(&self, chunk: &GpuChunk<'_>) -> Result<Vec<Hit>, BackendError> {
        let beams = chunk.batch.beams() as u64;
        self.device.read("read-back", &self.work.hits, size_of::<Hit>() as u64 * beams)
    }

    /// Queues the covering and all later kernels.
    fn cover(
        &self,
        chunk: &Rc<GpuChunk<'a>>,
        standing: &ChunkSensors,
        turn: usize,
        batch: &GpuBatch<'_>,
    ) -> Result<Pending<'a>, BackendError> {
        let work = self.work;
        let by_host = self.cover_by_host(chunk, standing)?;
        let covered = self.device.enqueue(|encoder| {
            encoder.clear_buffer(&work.bitmaps, 0, None);
            let buffers = [
                &work.uniforms,
                &work.poses,
                &work.sensor_beams,
                &self.scene.directions,
                &work.hits,
                &work.bitmaps,
            ];
            let groups = self.groups(chunk);
            self.kernels.dispatch(self.device, encoder, "cover_voxels", &buffers, groups);
        });
        for (sensor, bitmap) in by_host {
            let first = sensor as u64 * u64::from(self.bitmap_words());
            self.device.write_at(&work.bitmaps, first, &bitmap);
        }
        let results = if batch.sums {
            self.reduce(chunk)?
        } else {
            let bytes = 4 * chunk.batch.len() as u64 * u64::from(self.bitmap_words());
            self.device.start("covering", |_| {}, &[(&work.bitmaps, bytes)])?
        };
        Ok(Pending { chunk: chunk.clone(), turn, covered, results })
    }

    /// Bitmaps of the sensors that the kernel leaves, by its CPU twin.
    fn cover_by_host(
        &self,
        chunk: &GpuChunk<'_>,
        standing: &ChunkSensors,
    ) -> Result<Vec<(usize, Vec<u32>)>, BackendError> {
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

    /// Hands over the sums over the covered voxels; totals and partial sums are read.
    fn reduce(&self, chunk: &GpuChunk<'_>) -> Result<ReadBack, BackendError> {
        let (work, scene) = (self.work, self.scene);
        let count = chunk.placements.len() as u32;
        let occupied_groups = occupied_workgroups(self.task);
        let record = |encoder: &mut wgpu::CommandEncoder| {
            encoder.clear_buffer(&work.totals, 0, None);
            let mut dispatch = |kernel, more: &[_], groups| {
                let shared = [&work.uniforms, &work.placement_sensors, &work.bitmaps];
                let buffers = [&shared[..], more].concat();
                self.kernels.dispatch(self.device, encoder, kernel, &buffers, [groups, count, 1]);
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
        let stride = 1 + self.task.content().set_count() as u64;
        let totals = (&work.totals, 4 * u64::from(count) * stride);
        let each = u64::from(occupied_groups) * u64::from(PARTIAL_WORDS);
        let partials = (&work.partials, 4 * u64::from(count) * each);
        self.device.start("reduce", record, &[totals, partials])
    }

    /// Waits for a step, its covering first, so that the time of each is known.
    fn wait(&self, step: &Pending<'_>, clock: &mut Clock) -> Result<(), BackendError> {
        self.device.wait("covering", &step.covered)?;
        clock.lap(|times| &mut times.cover);
        self.device.wait("summing", step.results.submission())?;
        clock.lap(|times| &mut times.reduce);
        Ok(())
    }

    /// Waits for a step and hands over its results.
    fn finish(
        &self,
        step: Pending<'_>,
        clock: &mut Clock,
        take: &mut impl FnMut(&GpuChunk<'_>, usize, ChunkResult<'_>),
    ) -> Result<(), BackendError> {
        self.wait(&step, clock)?;
        let Pending { chunk, turn, results, .. } = step;
        self.device.finish(results, |parts| {
            let words = |part: usize| bytemuck::cast_slice(parts[part]);
            let made = match parts {
                [_] => ChunkResult::Bitmaps(words(0)),
                _ => ChunkResult::Sums { totals: words(0), partials: words(1) },
            };
            take(&chunk, turn, made);
        })?;
        clock.lap(|times| &mut times.reduce);
        Ok(())
    }
}
