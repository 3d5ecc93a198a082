//! Frames: the first frames of a search, and its steps to more.

use super::state::{Phase, Run};
use crate::score::Scores;
use crate::search::error::SearchError;
use crate::search::evaluator::Judged;
use crate::search::observer::{Event, Watch, Work};
use crate::search::on_demand::FramesOnDemand;
use crate::search::outcome::Scored;
use crate::search::pilot::Known;
use crate::search::settings::{FrameChoice, Method};
use crate::vehicle::Placement;

/// Most placements confirmed at once; progress is reported in between.
const CONFIRMED_AT_ONCE: usize = 4;
/// Baselines scored at once. The first of them are scored whatever the time where frames are few, the others only while
/// there is time.
const BASELINES_AT_ONCE: usize = 16;

impl Run {
    /// Chooses the frames that the search begins with, and opens its engine.
    pub(super) fn choose_frames(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        for layout in self.left_out() {
            watch.note(&format!("not starting from {}: {}", layout.name, layout.why.join("; ")));
        }
        if self.state.settings.frames == FrameChoice::OnDemand {
            let (memory, heeds_time) = (self.memory(), self.heeds_time());
            let (work, total) = (Work::Frames, self.suite.frame_count() as u64);
            let mut go_on = |done: usize| {
                let done = done as u64;
                watch.tell(&Event::Progress { work, done, total }) || !heeds_time
            };
            let settings = &self.state.settings;
            match FramesOnDemand::choose(&self.suite, settings, memory, &mut go_on)? {
                Some((levels, known)) => {
                    self.state.levels = Some(levels);
                    self.sitting.known = known;
                }
                None => {
                    self.cut(watch);
                    self.hurry(watch);
                }
            }
        }
        self.evaluator(watch)?;
        self.state.phase = match self.state.settings.method {
            Method::Swaps => Phase::Finalists,
            Method::Both | Method::Cma => Phase::Generations,
        };
        Ok(())
    }

    /// Takes note of a generation, and goes on over more frames where those of the search no longer tell
    /// the best apart. False where the run is to end before that is done.
    pub(super) fn follow(
        &mut self,
        scored: Vec<(Placement, Scores)>,
        watch: &mut Watch,
    ) -> Result<bool, SearchError> {
        let objective = self.objective();
        let Some(levels) = &mut self.state.levels else { return Ok(true) };
        levels.note(scored, &objective);
        let generation = self.state.generations.generation;
        let evaluations = self.state.generations.evaluations() as f64;
        let mut level = levels.enough(evaluations / self.state.settings.evaluations as f64);
        if level == levels.level() && levels.is_due(generation) {
            let to_check = levels.to_check();
            let Some(scores) = self.scores_over_all(&to_check, watch)? else { return Ok(false) };
            let levels = self.state.levels.as_mut().expect("there are levels above");
            levels.confirmed(&scores, &objective);
            if levels.is_unsure() {
                level = levels.next();
            }
        }
        let is_at_end = self.state.generations.stopped().is_some();
        match !is_at_end && self.is_other(level) {
            true => self.go_on_over(level, watch),
            false => Ok(true),
        }
    }

    fn is_other(&self, level: usize) -> bool {
        self.state.levels.as_ref().is_some_and(|levels| levels.level() != level)
    }

    /// Lets the generations go on over a level of frames. False, and the level stays, if the run is to end before the best
    /// are scored there.
    fn go_on_over(&mut self, level: usize, watch: &mut Watch) -> Result<bool, SearchError> {
        let (kept, heeds_time) = (self.state.levels.clone(), self.heeds_time());
        if !self.go_to(level, watch)? {
            return Ok(false);
        }
        let settings = self.state.settings.clone();
        self.evaluator(watch)?;
        let evaluator = self.sitting.evaluator.as_mut().expect("opened in the line above");
        let mut go_on = || watch.goes_on() || !heeds_time;
        if !self.state.generations.rescore_best(evaluator, &settings, &mut go_on)? {
            self.state.levels = kept;
            return Ok(false);
        }
        let (frames, generation) = (self.frames().len(), self.state.generations.generation);
        watch.note(&format!("generation {generation}: on with {frames} frames"));
        Ok(true)
    }

    /// Goes to a level of frames and scores the finalists there, unless it is the present one. False, and the level stays,
    /// if the run is to end before that.
    pub(super) fn go_to(&mut self, level: usize, watch: &mut Watch) -> Result<bool, SearchError> {
        if !self.is_other(level) {
            return Ok(true);
        }
        let (objective, heeds_time) = (self.objective(), self.heeds_time());
        let generation = self.state.generations.generation;
        let kept = self.state.levels.clone();
        let Some(levels) = &mut self.state.levels else { return Ok(true) };
        levels.go_to(level, generation);
        let finalists = levels.finalists();
        let evaluator = self.evaluator(watch)?;
        let mut go_on = || watch.goes_on() || !heeds_time;
        let Some(scores) = evaluator.scores_while(&finalists, &mut go_on)? else {
            self.state.levels = kept;
            return Ok(false);
        };
        if let Some(levels) = &mut self.state.levels {
            levels.rescored(&scores, &objective);
        }
        Ok(true)
    }

    /// Scores over the frames of [`Self::confirming`], with progress in between; `None` where the run is to end before.
    pub(super) fn judged_over_all(
        &mut self,
        placements: &[Placement],
        watch: &mut Watch,
    ) -> Result<Option<Vec<Judged>>, SearchError> {
        let few = self.sitting.hurried.as_ref().map(Vec::len);
        let work = Work::Confirming { frames: few.unwrap_or_else(|| self.suite.frame_count()) };
        let heeds_time = self.heeds_time();
        let mut judged = Vec::new();
        for some in placements.chunks(CONFIRMED_AT_ONCE) {
            let evaluator = self.over_all(watch)?;
            let mut go_on = || watch.goes_on() || !heeds_time;
            let Some(more) = evaluator.judged_while(some, &Known::new(), &mut go_on)? else {
                return Ok(None);
            };
            judged.extend(more);
            let (done, total) = (judged.len() as u64, placements.len() as u64);
            watch.tell(&Event::Progress { work, done, total });
        }
        Ok(Some(judged))
    }

    /// Scores of [`Self::judged_over_all`] alone, in silence.
    pub(super) fn scores_over_all(
        &mut self,
        placements: &[Placement],
        watch: &mut Watch,
    ) -> Result<Option<Vec<Scores>>, SearchError> {
        let heeds_time = self.heeds_time();
        let evaluator = self.over_all(watch)?;
        let mut go_on = || watch.goes_on() || !heeds_time;
        Ok(evaluator.scores_while(placements, &mut go_on)?)
    }

    /// The baselines over the frames of [`Self::confirming`]; those that the pilot has scored are not cast again. `None`
    /// where the run is to end before that. Where frames are few and baselines many, the first ones alone.
    pub(super) fn baselines(
        &mut self,
        watch: &mut Watch,
    ) -> Result<Option<Vec<Scored>>, SearchError> {
        if let Some(baselines) = &self.sitting.baselines {
            return Ok(Some(baselines.clone()));
        }
        let baselines = self.state.settings.baselines.clone();
        // The pilot's tallies are of all frames.
        let known =
            if self.sitting.hurried.is_none() { self.sitting.known.clone() } else { Known::new() };
        let heeds_time = self.heeds_time();
        let mut judged = Vec::new();
        for some in baselines.chunks(BASELINES_AT_ONCE) {
            if !judged.is_empty() && !heeds_time && !watch.goes_on() {
                break;
            }
            let evaluator = self.over_all(watch)?;
            let mut go_on = || watch.goes_on() || !heeds_time;
            let Some(more) = evaluator.judged_while(some, &known, &mut go_on)? else {
                return Ok(None);
            };
            judged.extend(more);
        }
        let count = judged.len();
        let scored = self.scored(&baselines[..count], judged, watch)?;
        if count < baselines.len() {
            self.cut(watch);
            return Ok(Some(scored));
        }
        self.sitting.baselines = Some(scored.clone());
        self.sitting.known.clear();
        Ok(Some(scored))
    }
}
