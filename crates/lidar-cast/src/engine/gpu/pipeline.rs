//! A batch on its way through the device: chunk after chunk, frame after frame, without the host in between.
//!
//! ```text
//! GpuBatch ─► GpuChunk ─► cast ─► cover ─► reduce ─► Pending ─► ChunkResult ─► BatchTallies
//!                 one submission, up to three of them ahead of the host
//! ```
//! While the device works, the host places the sensors of the next steps and adds up the sums of earlier ones. Some steps
//! go slowly, with the host between casting and coverage:
//! - a step in which the kernel left beams unfinished is done anew, and these beams are cast by the CPU twin;
//! - weather that ends beams early, and sensors whose beams the host covers, need the hits.

use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::chunk::{
    ChunkSensors, GpuBatch, GpuChunk, SceneBuffers, WorkBuffers, occupied_workgroups,
};
use super::device::Device;
use super::kernels::Kernels;
use super::readback::ReadBack;
use super::stages::{STAMP_BYTES, StepStage, stage_ticks};
use crate::bvh::Hit;
use crate::engine::Result;
use crate::task::{StageTimes, Task};

/// Steps that are handed to the device before the host waits for the first of them. Bitmaps that are read back are large:
/// one is copied while the device works at the next.
pub(super) const fn in_flight(sums: bool) -> usize {
    if sums { 3 } else { 1 }
}

/// Part of the steps done anew from which on all steps of a batch go slowly: each of them was cast twice.
const MOST_REDONE: f64 = 0.25;

#[derive(Clone)]
struct FrameChunk<'a> {
    chunk: Rc<GpuChunk<'a>>,
    /// Number of the frame in the batch's list.
    turn: usize,
    frame: usize,
}

/// A step's commands on the device, and the copy of their results.
struct Pending<'a> {
    step: FrameChunk<'a>,
    stages: Vec<StepStage>,
    results: ReadBack,
}

pub(super) enum ChunkResult<'a> {
    /// Hits by sensor.
    Hits(&'a [u32]),
    /// Bitmaps by sensor, in bricks.
    Bitmaps(&'a [u32]),
    /// Output of the reductions.
    Sums { totals: &'a [u32], partials: &'a [u32] },
}

impl<'a> ChunkResult<'a> {
    /// Results of the last stage, read back in the order of [`Pipeline::results`].
    fn made(parts: &[&'a [u8]], sums: bool) -> Self {
        let words = |part: usize| bytemuck::cast_slice(parts[part]);
        match sums {
            true => Self::Sums { totals: words(0), partials: words(1) },
            false => Self::Bitmaps(words(0)),
        }
    }
}

/// Takes the results of a chunk, with the number of the frame in the batch's list.
type Take<'t> = &'t mut dyn FnMut(&GpuChunk<'_>, usize, ChunkResult<'_>);

/// The wall time of a batch, by stage.
struct Clock {
    begun: Instant,
    /// Time of slow steps.
    slow: StageTimes,
    /// Ticks of the device in all other steps, by [`StepStage`].
    ticks: [u64; 3],
    steps: usize,
    redone: usize,
}

impl Clock {
    fn start() -> Self {
        let slow = StageTimes::default();
        Self { begun: Instant::now(), slow, ticks: [0; 3], steps: 0, redone: 0 }
    }

    fn expects_leftovers(&self) -> bool {
        self.redone as f64 > MOST_REDONE * self.steps as f64
    }

    /// Wall time by stage: the host's measure for slow steps, for all others the time that the device's ticks divide.
    fn times(&self) -> StageTimes {
        let StageTimes { cast, cover, reduce } = self.slow;
        let rest = self.begun.elapsed().saturating_sub(cast + cover + reduce);
        let ticks: u64 = self.ticks.iter().sum();
        let mut times = self.slow;
        match ticks {
            0 => times.cover += rest,
            all => {
                let share =
                    |stage: StepStage| rest.mul_f64(self.ticks[stage as usize] as f64 / all as f64);
                times += StageTimes {
                    cast: share(StepStage::Cast),
                    cover: share(StepStage::Cover),
                    reduce: share(StepStage::Reduce),
                };
            }
        }
        times
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
    pub(super) fn run(&self, batch: &GpuBatch<'_>, take: Take<'_>) -> Result<StageTimes> {
        self.compile(self.task.ends_at_hits(), batch.sums);
        let mut clock = Clock::start();
        let mut pending = VecDeque::new();
        for cut in &batch.chunks {
            let chunk = Rc::new(GpuChunk::new(self.task, batch, cut)?);
            for (turn, &frame) in batch.frames.iter().enumerate() {
                let step = FrameChunk { chunk: chunk.clone(), turn, frame };
                let standing = step.chunk.standing(self.task.roi(), frame);
                clock.steps += 1;
                if self.needs_host(&standing) || clock.expects_leftovers() {
                    self.slow_step(&step, &standing, batch, &mut clock, take)?;
                    continue;
                }
                pending.push_back(self.queue(step, &standing, batch)?);
                while pending.len() > in_flight(batch.sums) {
                    self.finish(pending.pop_front(), batch, &mut clock, take)?;
                }
            }
        }
        while !pending.is_empty() {
            self.finish(pending.pop_front(), batch, &mut clock, take)?;
        }
        Ok(clock.times())
    }

    /// True if a step needs its hits on the host before coverage, or if the device does not tell how long each stage took.
    fn needs_host(&self, standing: &ChunkSensors) -> bool {
        !standing.covered_by_host.is_empty()
            || self.task.ends_at_hits() && self.task.air().is_some()
            || self.device.stamps.is_none()
    }

    /// Hands a whole step to the device.
    fn queue(
        &self,
        step: FrameChunk<'a>,
        standing: &ChunkSensors,
        batch: &GpuBatch<'_>,
    ) -> Result<Pending<'a>> {
        self.place(&step.chunk, standing, step.frame)?;
        let mut stages = Vec::new();
        let mut sources = self.results(&step.chunk, batch);
        if self.task.ends_at_hits() {
            stages.push(StepStage::Cast);
            sources.push(self.counters(&step.chunk));
        }
        stages.push(StepStage::Cover);
        if batch.sums {
            stages.push(StepStage::Reduce);
        }
        if let Some(stamps) = &self.device.stamps {
            sources.push((&stamps.resolved, STAMP_BYTES));
        }
        let record = |encoder: &mut wgpu::CommandEncoder| {
            for (number, &stage) in stages.iter().enumerate() {
                self.record(encoder, &step.chunk, stage, Some(number));
            }
            if let Some(stamps) = &self.device.stamps {
                stamps.resolve(encoder, stages.len());
            }
        };
        let results = self.device.start("casting and covering", record, &sources)?;
        Ok(Pending { step, stages, results })
    }

    /// Waits for a step, and hands over its results; does it anew if the kernel left beams unfinished.
    fn finish(
        &self,
        pending: Option<Pending<'a>>,
        batch: &GpuBatch<'_>,
        clock: &mut Clock,
        take: Take<'_>,
    ) -> Result<()> {
        let Some(Pending { step, stages, results }) = pending else { return Ok(()) };
        let is_whole = self.device.finish(results, |parts| {
            if let Some(clocked) = &self.device.stamps {
                let stamps = bytemuck::pod_collect_to_vec(parts[parts.len() - 1]);
                let before: u64 = clock.ticks.iter().sum();
                stage_ticks(&stages, &stamps, &mut clock.ticks);
                let worked = clocked.time(clock.ticks.iter().sum::<u64>() - before);
                self.device.count(|traffic| traffic.busy += worked);
            }
            if self.task.ends_at_hits() {
                // They stand behind the results.
                let place = if batch.sums { 2 } else { 1 };
                let counters: &[u32] = bytemuck::cast_slice(parts[place]);
                if counters[0] > 0 {
                    return false;
                }
                take(&step.chunk, step.turn, ChunkResult::Hits(&counters[1..]));
            }
            take(&step.chunk, step.turn, ChunkResult::made(parts, batch.sums));
            true
        })?;
        if !is_whole {
            clock.redone += 1;
            let standing = step.chunk.standing(self.task.roi(), step.frame);
            self.slow_step(&step, &standing, batch, clock, take)?;
        }
        Ok(())
    }

    /// Does a step with the host between casting and coverage, and waits for its end.
    fn slow_step(
        &self,
        step: &FrameChunk<'a>,
        standing: &ChunkSensors,
        batch: &GpuBatch<'_>,
        clock: &mut Clock,
        take: Take<'_>,
    ) -> Result<()> {
        let FrameChunk { chunk, turn, frame } = step;
        let mut since = Instant::now();
        let mut lap = |stage: &mut Duration| {
            let now = Instant::now();
            *stage += now - since;
            since = now;
        };
        self.place(chunk, standing, *frame)?;
        if self.task.ends_at_hits() {
            let counters = self.cast(chunk)?;
            let mut hits = self.settle(chunk, standing, *frame, counters)?;
            if let Some(air) = self.task.air() {
                hits = self.dim(&**air, chunk, standing, *frame)?;
            }
            take(chunk, *turn, ChunkResult::Hits(&hits));
            lap(&mut clock.slow.cast);
        }
        let by_host = self.cover_by_host(chunk, standing)?;
        let record =
            |encoder: &mut wgpu::CommandEncoder, stage| self.record(encoder, chunk, stage, None);
        let covered = self.device.enqueue(|encoder| record(encoder, StepStage::Cover));
        self.write_bitmaps(&by_host);
        self.device.wait("covering", &covered)?;
        lap(&mut clock.slow.cover);
        let sums = |encoder: &mut wgpu::CommandEncoder| {
            if batch.sums {
                record(encoder, StepStage::Reduce);
            }
        };
        let results = self.device.start("summing", sums, &self.results(chunk, batch))?;
        self.device.finish(results, |parts| {
            take(chunk, *turn, ChunkResult::made(parts, batch.sums));
        })?;
        lap(&mut clock.slow.reduce);
        Ok(())
    }

    /// Casts the poses of a batch in one frame, as [`crate::cast::cast_frame_closest`] does.
    pub(super) fn hits(&self, batch: &GpuBatch<'_>, frame: usize) -> Result<Vec<Hit>> {
        self.compile(true, false);
        let mut hits = Vec::new();
        for cut in &batch.chunks {
            let chunk = GpuChunk::new(self.task, batch, cut)?;
            let standing = chunk.standing(self.task.roi(), frame);
            self.place(&chunk, &standing, frame)?;
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
}
