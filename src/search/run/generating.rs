//! Generations and their end: budget, target, time, interruption; then their finalists.

use std::time::Instant;

use super::state::{Phase, Run};
use crate::score::{Scores, Standing};
use crate::search::error::SearchError;
use crate::search::observer::{Event, Watch, Work};

impl Run {
    /// Runs one generation, unless nothing is left to do.
    ///
    /// The first one of a sitting runs even where the time is over, so that there is something to go on
    /// with.
    pub(super) fn generate(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        if self.state.generations.stopped().is_some() {
            self.state.phase = Phase::Finalists;
            return Ok(());
        }
        let is_over = watch.is_over() && self.sitting.generations > 0;
        if watch.is_interrupted() || is_over {
            self.cut(watch);
            self.state.phase = Phase::Finalists;
            return Ok(());
        }
        self.evaluator(watch)?;
        let evaluator = self.sitting.evaluator.as_mut().expect("opened in the line above");
        let frames = evaluator.frame_count();
        let start = Instant::now();
        let generation = self.state.generations.step(evaluator, &self.state.settings)?;
        let took = start.elapsed();
        self.sitting.generations += 1;
        self.sitting.times.generations += took.as_secs_f64();
        self.sitting.times.bookkeeping += (took - generation.scoring).as_secs_f64();
        self.sitting.times.scored += (generation.scored.len() * frames) as u64;
        self.state.history.push(generation.record.clone());
        self.follow(generation.scored, watch)?;
        self.stop_at_target(watch)?;
        watch.tell(&Event::Generation(&generation.record));
        let (work, total) = (Work::Generations, self.state.settings.evaluations);
        // The last generation is a whole one.
        let done = generation.record.evaluations.min(total);
        watch.tell(&Event::Progress { work, done, total });
        Ok(())
    }

    /// Ends the generations where their best placement has the objective that was wanted, over all frames.
    fn stop_at_target(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let generations = &self.state.generations;
        let (Some(target), Some(best)) = (self.state.settings.target, generations.best()) else {
            return Ok(());
        };
        let reaches = |standing: &Standing| {
            standing.is_sound() && standing.value.is_some_and(|value| value >= target)
        };
        let is_new = best.generation == generations.generation();
        if !is_new || !reaches(&best.standing) {
            return Ok(());
        }
        if !self.is_over_all() {
            let (best, objective) = (best.placement.clone(), self.objective());
            let scores = self.over_all(watch)?.scores(&[best])?;
            if !reaches(&Standing::of(&scores[0], &objective)) {
                return Ok(());
            }
        }
        self.state.generations.stop_at_target();
        Ok(())
    }

    /// Scores the finalists of the generations over all frames, and goes to the frames of the swaps.
    pub(super) fn settle(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let objective = self.objective();
        if let Some(levels) = &self.state.levels {
            let (finalists, level) = (levels.to_confirm(), levels.of_swaps());
            let judged = self.judged_over_all(&finalists, watch)?;
            let scores: Vec<Scores> = judged.into_iter().map(|judged| judged.scores).collect();
            if let Some(levels) = &mut self.state.levels {
                levels.confirmed(&scores, &objective);
                self.state.chosen = levels.winner();
            }
            self.go_to(level, watch)?;
        }
        self.state.phase = if self.is_at_target() { Phase::Confirm } else { Phase::Swaps };
        if watch.is_interrupted() {
            self.cut(watch);
            self.state.phase = Phase::Confirm;
        }
        Ok(())
    }

    /// Instances of the CMA-ES that have ended, in words.
    pub(super) fn ended_in_words(&self) -> Vec<String> {
        let ended = self.state.generations.ended().iter();
        let words = ended.map(|ended| {
            let (population, evaluations) = (ended.population, ended.evaluations);
            format!("of {population} candidates, after {evaluations} evaluations, {}", ended.reason)
        });
        words.collect()
    }
}
