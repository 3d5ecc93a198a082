//! Generations and their end: budget, target, time, interruption; then their finalists.

use std::time::Instant;

use super::state::{Phase, Run, State};
use crate::score::{Scores, Standing};
use crate::search::error::SearchError;
use crate::search::generations::GenerationsStop;
use crate::search::observer::{Event, Watch, Work};
use crate::search::seat::FRAMES_AT_ONCE;

impl Run {
    /// Runs one generation, unless nothing is left to do.
    ///
    /// The first one of a sitting runs even where the time is over, so that there is something to go on
    /// with; over few frames where there are many.
    pub(super) fn generate(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        if self.state.generations.stopped().is_some() {
            self.state.phase = Phase::Finalists;
            return Ok(());
        }
        let is_first = self.sitting.generations == 0;
        let is_over = watch.is_over() && !is_first;
        if watch.interrupted || is_over {
            self.cut(watch);
            self.state.phase = Phase::Finalists;
            return Ok(());
        }
        self.evaluator(watch)?;
        let evaluator = self.sitting.evaluator.as_mut().expect("opened in the line above");
        let frames = evaluator.frame_count();
        // A run that was cut before is over few frames already.
        let heeds_time = !is_first || frames > FRAMES_AT_ONCE && self.before_cut.is_none();
        let before = self.heeds_time().then(|| self.state_without_history());
        let start = Instant::now();
        let mut go_on = || watch.goes_on() || !heeds_time;
        let evaluator = self.sitting.evaluator.as_mut().expect("opened above");
        let settings = &self.state.settings;
        let Some(generation) = self.state.generations.step(evaluator, settings, &mut go_on)? else {
            self.cut(watch);
            match is_first && !watch.interrupted {
                true => self.hurry(watch),
                false => self.state.phase = Phase::Finalists,
            }
            return Ok(());
        };
        let took = start.elapsed();
        self.sitting.generations += 1;
        self.sitting.times.generations += took.as_secs_f64();
        self.sitting.times.bookkeeping += (took - generation.scoring).as_secs_f64();
        self.sitting.times.scored += (generation.scored.len() * frames) as u64;
        self.state.history.push(generation.record.clone());
        let is_whole = self.follow(generation.scored, watch)? && self.stop_at_target(watch)?;
        if let Some(before) = before.filter(|_| !is_whole) {
            // Its placements stay; a resumed run does the generation anew.
            let history = self.state.history[..self.state.history.len() - 1].to_vec();
            self.cut_at(State { history, ..before }, watch);
        }
        watch.tell(&Event::Generation(&generation.record));
        let (work, total) = (Work::Generations, self.state.settings.evaluations);
        // The last generation is a whole one.
        let done = generation.record.evaluations.min(total);
        watch.tell(&Event::Progress { work, done, total });
        Ok(())
    }

    /// The state but for its history, which is long.
    fn state_without_history(&mut self) -> State {
        let history = std::mem::take(&mut self.state.history);
        let state = self.state.clone();
        self.state.history = history;
        state
    }

    /// Ends the generations where their best placement has the objective that was wanted, over all frames. False where
    /// the run is to end before that is known.
    fn stop_at_target(&mut self, watch: &mut Watch) -> Result<bool, SearchError> {
        let generations = &self.state.generations;
        let (Some(target), Some(best)) = (self.state.settings.target, generations.best()) else {
            return Ok(true);
        };
        let reaches = |standing: &Standing| {
            standing.is_sound() && standing.value.is_some_and(|value| value >= target)
        };
        let is_new = best.generation == generations.generation;
        if !is_new || !reaches(&best.standing) {
            return Ok(true);
        }
        if !self.is_over_all() {
            let (best, objective) = (best.placement.clone(), self.objective());
            let Some(scores) = self.scores_over_all(&[best], watch)? else { return Ok(false) };
            if !reaches(&Standing::of(&scores[0], &objective)) {
                return Ok(true);
            }
        }
        self.state.generations.stopped = Some(GenerationsStop::Target);
        Ok(true)
    }

    /// Scores the finalists of the generations over all frames, and goes to the frames of the swaps; leaves either out
    /// where the run is to end before that.
    pub(super) fn settle(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let objective = self.objective();
        if let Some(levels) = &self.state.levels {
            let (finalists, level) = (levels.to_confirm(), levels.of_swaps());
            let before = self.heeds_time().then(|| self.state.clone());
            let judged = self.judged_over_all(&finalists, watch)?;
            let is_judged = judged.is_some();
            if let (Some(levels), Some(judged)) = (&mut self.state.levels, judged) {
                let scores: Vec<Scores> = judged.into_iter().map(|judged| judged.scores).collect();
                levels.confirmed(&scores, &objective);
                levels.note_last_loss();
                self.state.chosen = levels.winner();
            }
            let is_whole = is_judged && self.go_to(level, watch)?;
            if let Some(before) = before.filter(|_| !is_whole) {
                self.cut_at(before, watch);
            }
        }
        self.state.phase = if self.is_at_target() { Phase::Confirm } else { Phase::Swaps };
        if watch.interrupted {
            self.cut(watch);
            self.state.phase = Phase::Confirm;
        }
        Ok(())
    }

    pub(super) fn ended_in_words(&self) -> Vec<String> {
        let ended = self.state.generations.ended().iter();
        let words = ended.map(|ended| {
            let (population, evaluations) = (ended.population, ended.evaluations);
            format!("of {population} candidates, after {evaluations} evaluations, {}", ended.reason)
        });
        words.collect()
    }
}
