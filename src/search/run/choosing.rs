//! Frames: which ones the search begins with, and when it goes on over more.

use super::state::{Phase, Run};
use crate::problem::Tally;
use crate::score::Scores;
use crate::search::error::SearchError;
use crate::search::evaluator::Judged;
use crate::search::observer::{Event, Watch, Work};
use crate::search::on_demand::FramesOnDemand;
use crate::search::outcome::Scored;
use crate::search::settings::{FrameChoice, Method};
use crate::vehicle::Placement;

/// Placements that are confirmed at once at most, so that progress is told in between.
const CONFIRMED_AT_ONCE: usize = 4;

impl Run {
    /// Chooses the frames that the search begins with, and opens its engine.
    pub(super) fn choose_frames(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        for layout in self.left_out() {
            watch.note(&format!("not starting from {}: {}", layout.name, layout.why.join("; ")));
        }
        if self.state.settings.frames == FrameChoice::OnDemand {
            let memory = self.memory();
            let (levels, known) =
                FramesOnDemand::choose(&self.suite, &self.state.settings, memory)?;
            self.state.levels = Some(levels);
            self.sitting.known = known;
        }
        self.evaluator(watch)?;
        self.state.phase = match self.state.settings.method {
            Method::Swaps => Phase::Finalists,
            Method::Both | Method::Cma => Phase::Generations,
        };
        Ok(())
    }

    /// Takes note of a generation, and goes on over more frames where those of the search no longer tell
    /// the best apart.
    pub(super) fn follow(
        &mut self,
        scored: Vec<(Placement, Scores)>,
        watch: &mut Watch,
    ) -> Result<(), SearchError> {
        let objective = self.objective();
        let Some(levels) = &mut self.state.levels else { return Ok(()) };
        levels.note(scored, &objective);
        let generation = self.state.generations.generation();
        let evaluations = self.state.generations.evaluations() as f64;
        let mut level = levels.enough(evaluations / self.state.settings.evaluations as f64);
        if level == levels.level() && levels.is_due(generation) {
            let to_check = levels.to_check();
            let scores = self.over_all(watch)?.scores(&to_check)?;
            let levels = self.state.levels.as_mut().expect("there are levels above");
            levels.confirmed(&scores, &objective);
            if levels.is_unsure() {
                level = levels.next();
            }
        }
        if self.state.generations.stopped().is_none() && self.go_to(level, watch)? {
            let frames = self.frames().len();
            watch.note(&format!("generation {generation}: on with {frames} frames"));
            let settings = self.state.settings.clone();
            self.evaluator(watch)?;
            let evaluator = self.sitting.evaluator.as_mut().expect("opened in the line above");
            self.state.generations.rescore_best(evaluator, &settings)?;
        }
        Ok(())
    }

    /// Goes to a level of frames and scores the finalists there; false where it is the present one.
    pub(super) fn go_to(&mut self, level: usize, watch: &mut Watch) -> Result<bool, SearchError> {
        let objective = self.objective();
        let generation = self.state.generations.generation();
        let Some(levels) = self.state.levels.as_mut().filter(|levels| levels.level() != level)
        else {
            return Ok(false);
        };
        levels.go_to(level, generation);
        let finalists = levels.finalists();
        let scores = self.evaluator(watch)?.scores(&finalists)?;
        if let Some(levels) = &mut self.state.levels {
            levels.rescored(&scores, &objective);
        }
        Ok(true)
    }

    /// Scores over all frames, told a few placements at a time.
    pub(super) fn judged_over_all(
        &mut self,
        placements: &[Placement],
        watch: &mut Watch,
    ) -> Result<Vec<Judged>, SearchError> {
        let work = Work::Confirming { frames: self.suite.frame_count() };
        let mut judged = Vec::new();
        for some in placements.chunks(CONFIRMED_AT_ONCE) {
            judged.extend(self.over_all(watch)?.judged(some)?);
            let (done, total) = (judged.len() as u64, placements.len() as u64);
            watch.tell(&Event::Progress { work, done, total });
        }
        Ok(judged)
    }

    /// The baselines over all frames; those that the pilot has scored are not cast again.
    pub(super) fn baselines(&mut self, watch: &mut Watch) -> Result<Vec<Scored>, SearchError> {
        if let Some(baselines) = &self.sitting.baselines {
            return Ok(baselines.clone());
        }
        let baselines = self.state.settings.baselines.clone();
        let mut known = std::mem::take(&mut self.sitting.known);
        if self.suite.is_left_to_chance() {
            // Scores of the draw that the search has seen.
            known.clear();
        }
        let known = |p: &Placement| known.iter().find(|(k, _)| k.lidars == p.lidars).map(|k| &k.1);
        let missing: Vec<Placement> =
            baselines.iter().filter(|p| known(p).is_none()).cloned().collect();
        let evaluator = self.over_all(watch)?;
        let cast = evaluator.tallies(&missing)?.into_iter().enumerate();
        let tallies = cast.map(|(member, cast)| {
            let mut cast = cast.into_iter();
            let tally = |p| known(p).map(|known| known[member].clone()).or_else(|| cast.next());
            baselines.iter().filter_map(tally).collect()
        });
        let tallies: Vec<Vec<Tally>> = tallies.collect();
        let judged = evaluator.judged_from(&baselines, &tallies)?;
        let scored = self.scored(&baselines, judged);
        self.sitting.baselines = Some(scored.clone());
        Ok(scored)
    }
}
