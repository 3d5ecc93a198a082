//! The generations of a run, and what ends them.

use std::time::{Duration, Instant};

use sightline::problem::spread;
use sightline::search::Search;

use super::{Method, Open, Run};
use crate::cli::args::{Compute, Talk};
use crate::cli::error::Error;
use crate::cli::interrupt::Interrupt;
use crate::cli::progress;

/// Time between two checkpoints: one after each generation would take longer than the search itself
/// where generations are quick.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(1);

impl Run {
    /// Runs generations until the search stops, Ctrl-C, or the time is over.
    pub(super) fn search(
        &mut self,
        compute: &Compute,
        interrupt: &Interrupt,
        open: &Open,
    ) -> Result<(), Error> {
        let bar = progress::bar(self.settings.search.evaluations, "placements", compute.talk);
        bar.set_position(self.search.evaluations());
        bar.reset_eta();
        let mut ended = self.search.ended().len();
        let first = self.search.generation();
        let mut saved: Option<Instant> = None;
        // One generation at least, so that there is something to go on with.
        let goes_on = |search: &Search| {
            let begun = search.generation() > first;
            !(interrupt.is_pressed() || begun && interrupt.is_set())
        };
        let mut is_over = self.search.stopped().is_some() || !goes_on(&self.search);
        while !is_over {
            let (start, before) = (Instant::now(), self.evaluator.spent());
            let record = self.search.step(&mut self.evaluator, &self.objective)?;
            let scoring = self.evaluator.spent() - before;
            self.history.push(record);
            let stepped = start.elapsed();
            self.widen(compute, open)?;
            self.stop_at_target(open)?;
            let saving = Instant::now();
            is_over = self.search.stopped().is_some() || !goes_on(&self.search);
            if is_over || saved.is_none_or(|saved| saved.elapsed() > BETWEEN_CHECKPOINTS) {
                let (settings, search) = (&self.settings, &self.search);
                let spent = self.spent_so_far();
                self.folder.save(settings, search, &self.history, &self.auto, &spent)?;
                saved = Some(Instant::now());
            }
            let generation = stepped + saving.elapsed();
            self.spent.times.generations += generation.as_secs_f64();
            self.spent.times.bookkeeping += (generation - scoring).as_secs_f64();
            bar.set_position(self.search.evaluations());
            if let Some(best) = self.search.best() {
                bar.set_message(format!("· best {:.4e}", best.value));
            }
            for line in self.ended_in_words().iter().skip(ended) {
                compute.talk.note(format!("restart: {line}"));
            }
            ended = self.search.ended().len();
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Ends the search where its best placement has the score that was wanted, over all frames.
    fn stop_at_target(&mut self, open: &Open) -> Result<(), Error> {
        let (Some(target), Some(best)) = (self.settings.target, self.search.best()) else {
            return Ok(());
        };
        let is_new = best.generation == self.search.generation();
        if !is_new || best.value < target || best.guards > 0 {
            return Ok(());
        }
        let frames = self.whole.frame_count();
        if !self.is_over_all() {
            let mut full = open(&spread(frames, None), None)?;
            let scores = full.scores(std::slice::from_ref(&best.placement))?.remove(0);
            let value = self.objective.value(&scores);
            if value.is_none_or(|value| value < target) || !scores.guards.is_empty() {
                return Ok(());
            }
        }
        self.search.stop_at_target();
        Ok(())
    }

    /// Instances of the CMA-ES that have ended.
    pub(super) fn ended_in_words(&self) -> Vec<String> {
        let ended = self.search.ended().iter();
        let words = ended.map(|ended| {
            let (population, evaluations) = (ended.population, ended.evaluations);
            format!("of {population} candidates, after {evaluations} evaluations, {}", ended.reason)
        });
        words.collect()
    }

    /// Whether generations are left to run.
    pub(super) fn is_cut_short(&self) -> bool {
        self.settings.method != Method::Swaps && self.search.stopped().is_none()
    }

    /// Says why the search ended, and how to go on where something is left to do.
    pub(super) fn say_stopped(&self, stopped: &str, unfinished: bool, talk: Talk) {
        let generation = self.search.generation();
        let mut line = format!("stopped after generation {generation}: {stopped}");
        if unfinished {
            line += &format!("; go on with --resume {}", self.folder.path().display());
        }
        talk.note(line);
    }
}
