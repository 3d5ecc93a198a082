//! How a run follows what `auto` decides: over which frames it goes on, and what it confirms.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use sightline::engine::BackendError;
use sightline::engine::CpuBackend;
use sightline::score::Scores;
use sightline::search::Evaluator;
use sightline::vehicle::Placement;

use super::auto::Auto;
use super::{Open, Run};
use crate::cli::args::{Compute, Talk};
use crate::cli::error::Error;
use crate::cli::progress;

/// Time of a batch that is confirmed, about: after each the bar tells how long the others take.
const BATCH: Duration = Duration::from_secs(1);

impl Run {
    /// Lets `auto` look at the last generation, and goes on with more frames where it wants them.
    pub(super) fn widen(&mut self, compute: &Compute, open: &Open) -> Result<(), Error> {
        let Some(mut auto) = self.auto.take() else { return Ok(()) };
        let generation = self.search.generation();
        auto.note(self.evaluator.take_last(), &self.objective);
        let progress = self.search.evaluations() as f64 / self.settings.search.evaluations as f64;
        let mut level = auto.least(progress).max(auto.at);
        if level == auto.at && auto.is_due(generation) {
            let mut full = self.full(&auto, compute);
            if auto.is_unsure(&mut full, &self.objective)? {
                level = auto.next();
            }
            self.full = Some(full);
        }
        if level != auto.at && self.search.stopped().is_none() {
            auto.at = level;
            let wider = auto.frames();
            compute.talk.note(format!("generation {generation}: on with {} frames", wider.len()));
            self.evaluator = open(wider, auto.cell())?;
            auto.widen(generation, &mut self.evaluator, &self.objective)?;
            self.search.rescore_best(&mut self.evaluator, &self.objective)?;
            self.evaluator.keep_last();
        }
        self.auto = Some(auto);
        Ok(())
    }

    /// Confirms the finalists of the generations over all frames, and goes on over those of the swaps.
    pub(super) fn settle(&mut self, compute: &Compute, open: &Open) -> Result<(), Error> {
        let Some(mut auto) = self.auto.take() else { return Ok(()) };
        let mut full = self.full(&auto, compute);
        let bar = self.confirming(auto.unconfirmed(), compute.talk);
        self.chosen = auto.winner(&mut full, &self.objective, &bar)?;
        bar.finish_and_clear();
        self.full = Some(full);
        let level = auto.second().max(auto.at);
        if level != auto.at {
            auto.at = level;
            self.evaluator = open(auto.frames(), auto.cell())?;
            auto.widen(self.search.generation(), &mut self.evaluator, &self.objective)?;
        }
        self.auto = Some(auto);
        Ok(())
    }

    /// A bar for placements that are scored over all frames.
    pub(super) fn confirming(&self, placements: usize, talk: Talk) -> ProgressBar {
        let unit = format!("placements confirmed over all {} frames", self.whole.frame_count());
        progress::bar(placements as u64, &unit, talk)
    }

    /// What scores over all frames, on the CPU: a second scene on a device would take its memory twice.
    fn full(&mut self, auto: &Auto, compute: &Compute) -> Evaluator {
        self.full.take().unwrap_or_else(|| {
            let backend = Box::new(CpuBackend::new(self.whole.clone(), compute.memory_budget()));
            let mut full = Evaluator::new(self.whole.clone(), backend);
            full.remember(auto.known());
            full
        })
    }
}

/// Scores of placements, the first alone and then as many at a time as take about [`BATCH`].
pub(super) fn scores_with(
    bar: &ProgressBar,
    evaluator: &mut Evaluator,
    placements: &[Placement],
) -> Result<Vec<Scores>, BackendError> {
    let start = Instant::now();
    let mut scores: Vec<Scores> = Vec::with_capacity(placements.len());
    while scores.len() < placements.len() {
        let left = &placements[scores.len()..];
        let in_time = BATCH.as_secs_f64() * scores.len() as f64 / start.elapsed().as_secs_f64();
        let batch = &left[..(in_time as usize).clamp(1, left.len())];
        scores.extend(evaluator.scores(batch)?);
        bar.inc(batch.len() as u64);
    }
    Ok(scores)
}
