//! The loop over the steps of a run.

use std::time::Instant;

use super::state::{Phase, Run};
use crate::search::error::SearchError;
use crate::search::observer::{Observer, Watch};
use crate::search::outcome::Outcome;
use crate::search::settings::{
    FINALISTS_SHARE, FRAMES_SHARE, GENERATIONS_SHARE, SEARCH_SHARE, Settings,
};
use crate::search::suite::Suite;

/// Searches the placement that makes the objective largest: frames on demand, CMA-ES, swaps, finalists
/// confirmed over all frames, a bound on the objective of every other placement.
///
/// `scenes` is a problem over all frames of its scene, or a [`Suite`] of several whose mean is maximized; its
/// constraints are the rules that every candidate keeps.
///
/// # Errors
/// Settings that a scene does not allow, or from the engine.
pub fn optimize(
    scenes: impl Into<Suite>,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Outcome, SearchError> {
    let mut run = Run::new(scenes, settings)?;
    loop {
        if let Some(outcome) = run.step(observer)? {
            return Ok(outcome);
        }
    }
}

impl Run {
    /// Does one step; hands out the outcome after the last one.
    ///
    /// # Errors
    /// From the engine; a state half-way through the step is then left: go on from the last one that was written.
    pub fn step(&mut self, observer: &mut dyn Observer) -> Result<Option<Outcome>, SearchError> {
        let start = Instant::now();
        let mut watch = Watch::new(observer, self.sitting.interrupted);
        let phase = self.state.phase;
        let (time, heeds_time) = (self.state.settings.time.as_ref(), self.heeds_time());
        watch.deadline = time.map(|time| match phase {
            Phase::Frames => time.after(FRAMES_SHARE),
            Phase::Generations => time.after(GENERATIONS_SHARE),
            Phase::Finalists if heeds_time => time.after(FINALISTS_SHARE),
            Phase::Swaps | Phase::Refine | Phase::Bounds if heeds_time => time.after(SEARCH_SHARE),
            _ => time.deadline(),
        });
        let mut outcome = None;
        match phase {
            Phase::Frames => self.choose_frames(&mut watch)?,
            Phase::Generations => self.generate(&mut watch)?,
            Phase::Finalists => self.settle(&mut watch)?,
            Phase::Swaps => self.swap(&mut watch)?,
            Phase::Refine => self.refine(&mut watch)?,
            Phase::Bounds => self.bound(&mut watch)?,
            Phase::Confirm => outcome = Some(self.confirm(&mut watch)?),
        }
        self.tell_changes(&mut watch);
        self.sitting.interrupted |= watch.is_interrupted();
        let took = start.elapsed().as_secs_f64();
        let times = &mut self.sitting.times;
        match phase {
            Phase::Frames => times.frames += took,
            Phase::Generations | Phase::Finalists => times.until_swaps += took,
            Phase::Swaps | Phase::Refine => times.swaps += took,
            Phase::Bounds => times.bounds += took,
            Phase::Confirm => times.confirm += took,
        }
        if !matches!(phase, Phase::Frames | Phase::Confirm) {
            times.search += took;
        }
        if let Some(outcome) = &mut outcome {
            outcome.times = *times;
        }
        Ok(outcome)
    }
}
