use std::rc::Rc;
use std::time::{Duration, Instant};

use super::device::Device;
use super::kernels::Kernels;
use super::prepared::{Prepared, Slice};
use super::resources::{SceneBuffers, WorkBuffers};
use super::run::Run;
use super::transfer::Reading;
use crate::backend::{BackendError, Chunk, Problem, StageTimes};

/// A batch on its way through the device.
///
/// While the device casts a chunk into a frame, the host takes up what was made of the frame before, and
/// puts the next chunk together. The beams of the next frame are handed over once those of this one have
/// ended, and what they cover is being marked: until then the host may have to cast some itself.
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

/// What the device made of a chunk in a frame.
pub(super) enum Made<'a> {
    /// Hits of each sensor.
    Hits(&'a [u32]),
    /// Bitmaps of the sensors of a slice.
    Bitmaps(&'a Slice, &'a [u32]),
    /// What the reductions wrote.
    Sums { totals: &'a [u32], partials: &'a [u32] },
}

/// A slice of a chunk in a frame that the device works on.
struct Step {
    chunk: Rc<Prepared>,
    turn: usize,
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
    fn run(&self) -> Run<'_> {
        let Self { problem, device, kernels, scene, range, .. } = *self;
        Run { problem, device, kernels, scene, work: self.work, range }
    }

    /// Runs all chunks in all `frames`; `take` is told the chunk, the number of the frame in the list,
    /// and what was made, hits before what they lead to.
    pub(super) fn batch(
        self,
        chunks: &[Chunk],
        prepare: impl Fn(&Chunk) -> Prepared,
        frames: &[usize],
        mut take: impl FnMut(&Prepared, usize, Made<'_>),
    ) -> Result<StageTimes, BackendError> {
        let mut clock = Clock { since: Instant::now(), times: StageTimes::default() };
        let mut under_way = None;
        let mut turns = 0;
        let mut rest = chunks.iter();
        let mut next = rest.next().map(&prepare);
        while let Some(mut chunk) = next.take() {
            self.work.upload(self.device, self.kernels, &mut chunk)?;
            let chunk = Rc::new(chunk);
            for (turn, &frame) in frames.iter().enumerate() {
                let mut cast = self.cast(&chunk, frame)?;
                for slice in 0..chunk.slices.len() {
                    let step = self.cover(&chunk, turn, frame, slice, turns)?;
                    clock.lap(|times| &mut times.cast);
                    if let Some(last) = under_way.replace(step) {
                        self.finish(last, &mut clock, &mut take)?;
                    }
                    if slice == 0 {
                        if turn == 0 {
                            next = rest.next().map(&prepare);
                        }
                        let hits = match cast.take() {
                            Some(cast) => {
                                let (hits, late) = self.run().settle(&chunk, frame, cast)?;
                                if late && let Some(void) = under_way.take() {
                                    self.device.finish(void.made, |_| ())?;
                                    let step = self.cover(&chunk, turn, frame, slice, turns)?;
                                    under_way = Some(step);
                                }
                                hits
                            }
                            None => vec![0; chunk.poses.len()],
                        };
                        take(&chunk, turn, Made::Hits(&hits));
                        clock.lap(|times| &mut times.cast);
                    }
                    turns += 1;
                }
            }
        }
        if let Some(last) = under_way {
            self.finish(last, &mut clock, &mut take)?;
        }
        Ok(clock.times)
    }

    /// Starts casting where beams end at hits.
    fn cast(&self, chunk: &Prepared, frame: usize) -> Result<Option<Reading>, BackendError> {
        let run = self.run();
        run.compile(chunk, self.problem.ends_at_hits(), self.sums);
        self.problem.ends_at_hits().then(|| run.cast(chunk, frame)).transpose()
    }

    fn cover(
        &self,
        chunk: &Rc<Prepared>,
        turn: usize,
        frame: usize,
        slice: usize,
        turns: usize,
    ) -> Result<Step, BackendError> {
        let run = self.run();
        let part = &chunk.slices[slice];
        let (covered, made) = if self.sums {
            (Some(run.cover_on_device(part, frame)), run.reduce(chunk)?)
        } else {
            (None, run.cover(part, frame, turns)?)
        };
        Ok(Step { chunk: chunk.clone(), turn, slice, covered, made })
    }

    fn finish(
        &self,
        step: Step,
        clock: &mut Clock,
        take: &mut impl FnMut(&Prepared, usize, Made<'_>),
    ) -> Result<(), BackendError> {
        let Step { chunk, turn, slice, covered, made } = step;
        self.device.wait("covering", covered.as_ref().unwrap_or(made.submission()))?;
        clock.lap(|times| &mut times.cover);
        self.device.finish(made, |parts| {
            let words = |part: usize| bytemuck::cast_slice(parts[part]);
            let made = if self.sums {
                Made::Sums { totals: words(0), partials: words(1) }
            } else {
                Made::Bitmaps(&chunk.slices[slice], words(0))
            };
            take(&chunk, turn, made);
        })?;
        clock.lap(|times| &mut times.reduce);
        Ok(())
    }
}
