use std::rc::Rc;
use std::time::{Duration, Instant};

use super::device::Device;
use super::kernels::Kernels;
use super::prepared::{Prepared, Slice};
use super::resources::{SceneBuffers, WorkBuffers};
use super::run::Run;
use super::transfer::Reading;
use crate::engine::{BackendError, Chunk};
use crate::problem::{Problem, StageTimes};

/// A batch on its way through the device, job after job: a chunk in a frame each.
///
/// While the device casts a job, the host takes up what was made of the one before, and puts the next
/// chunk together. The covering is handed over once the beams have ended, since the host may have to cast
/// some of them, and the next casting right behind it.
pub(super) struct Flow<'a> {
    pub(super) problem: &'a Problem,
    pub(super) device: &'a Device,
    pub(super) kernels: &'a Kernels,
    pub(super) scene: &'a SceneBuffers,
    pub(super) work: &'a mut WorkBuffers,
    pub(super) range: f32,
    /// Whether kernels sum over what is covered, and bitmaps stay on the device.
    pub(super) sums: bool,
}

/// What the device made of a job.
pub(super) enum Made<'a> {
    /// Hits of each sensor.
    Hits(&'a [u32]),
    /// Bitmaps of the sensors of a slice.
    Bitmaps(&'a Slice, &'a [u32]),
    /// What the reductions wrote.
    Sums { totals: &'a [u32], partials: &'a [u32] },
}

#[derive(Clone)]
struct Job {
    chunk: Rc<Prepared>,
    frame: usize,
    /// Number of the frame in the list.
    turn: usize,
}

/// A slice of a job that the device works on.
struct Step {
    job: Job,
    slice: usize,
    /// End of the covering, where more follows.
    covered: Option<wgpu::SubmissionIndex>,
    made: Reading,
}

/// Where the host's time went.
struct Clock {
    since: Instant,
    times: StageTimes,
}

impl Clock {
    /// Counts the time since the last call for a stage.
    fn lap(&mut self, stage: fn(&mut StageTimes) -> &mut Duration) {
        let now = Instant::now();
        *stage(&mut self.times) += now - self.since;
        self.since = now;
    }
}

impl Flow<'_> {
    /// Runs all chunks in all `frames`; `take` is told the chunk, the number of the frame in the list,
    /// and what was made, hits before what they lead to. Returns the host's time by the stage that it
    /// worked for or waited for.
    pub(super) fn batch(
        mut self,
        chunks: &[Chunk],
        prepare: impl Fn(&Chunk) -> Prepared,
        frames: &[usize],
        mut take: impl FnMut(&Prepared, usize, Made<'_>),
    ) -> Result<StageTimes, BackendError> {
        let mut clock = Clock { since: Instant::now(), times: StageTimes::default() };
        let mut last: Option<Step> = None;
        let mut number = 0;
        let mut rest = chunks.iter();
        let mut next = self.ready(rest.next().map(&prepare))?;
        while let Some(chunk) = next.take() {
            self.work.upload(self.device, &chunk)?;
            let chunk = Rc::new(chunk);
            for (turn, &frame) in frames.iter().enumerate() {
                let job = Job { chunk: chunk.clone(), frame, turn };
                let cast = self.cast(&job)?;
                // Some software devices take more only once the last is done.
                match last {
                    Some(_) => clock.lap(|times| &mut times.cover),
                    None => clock.lap(|times| &mut times.cast),
                }
                if cast.is_some()
                    && let Some(last) = last.take()
                {
                    self.finish(last, &mut clock, &mut take)?;
                }
                if turn + 1 == frames.len() {
                    // Nothing more is cast with the packets of this chunk.
                    next = self.ready(rest.next().map(&prepare))?;
                }
                if let Some(cast) = cast {
                    let hits = self.run().settle(&job.chunk, job.frame, cast)?;
                    take(&job.chunk, job.turn, Made::Hits(&hits));
                }
                clock.lap(|times| &mut times.cast);
                for slice in 0..chunk.slices.len() {
                    let step = self.cover(&job, slice, number)?;
                    number += 1;
                    clock.lap(|times| &mut times.cover);
                    if let Some(last) = last.replace(step) {
                        self.finish(last, &mut clock, &mut take)?;
                    }
                }
            }
        }
        if let Some(last) = last {
            self.finish(last, &mut clock, &mut take)?;
        }
        Ok(clock.times)
    }

    /// Uploads the packets of a chunk.
    fn ready(&mut self, chunk: Option<Prepared>) -> Result<Option<Prepared>, BackendError> {
        let ready = |mut chunk: Prepared| {
            self.work.upload_packets(self.device, self.kernels, &mut chunk).map(|()| chunk)
        };
        chunk.map(ready).transpose()
    }

    fn run(&self) -> Run<'_> {
        let Self { problem, device, kernels, scene, range, .. } = *self;
        Run { problem, device, kernels, scene, work: self.work, range }
    }

    /// Hands over the casting, where beams end at hits.
    fn cast(&self, job: &Job) -> Result<Option<Reading>, BackendError> {
        let (run, hits) = (self.run(), self.problem.ends_at_hits());
        run.compile(&job.chunk, hits, self.sums);
        hits.then(|| run.cast(&job.chunk, job.frame)).transpose()
    }

    /// Hands over what follows the casting.
    fn cover(&self, job: &Job, slice: usize, number: usize) -> Result<Step, BackendError> {
        let run = self.run();
        let part = &job.chunk.slices[slice];
        let (covered, made) = if self.sums {
            (Some(run.cover_on_device(part, job.frame)), run.reduce(&job.chunk)?)
        } else {
            (None, run.cover(part, job.frame, number)?)
        };
        Ok(Step { job: job.clone(), slice, covered, made })
    }

    /// Waits for a step and takes up what it made.
    fn finish(
        &self,
        step: Step,
        clock: &mut Clock,
        take: &mut impl FnMut(&Prepared, usize, Made<'_>),
    ) -> Result<(), BackendError> {
        let Step { job, slice, covered, made, .. } = step;
        self.device.wait("covering", covered.as_ref().unwrap_or(made.submission()))?;
        clock.lap(|times| &mut times.cover);
        self.device.finish(made, |parts| {
            let words = |part: usize| bytemuck::cast_slice(parts[part]);
            let made = if self.sums {
                Made::Sums { totals: words(0), partials: words(1) }
            } else {
                Made::Bitmaps(&job.chunk.slices[slice], words(0))
            };
            take(&job.chunk, job.turn, made);
        })?;
        clock.lap(|times| &mut times.reduce);
        Ok(())
    }
}
