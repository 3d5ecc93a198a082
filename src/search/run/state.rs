//! The state of a run as a value, its steps, and beside it the engines and caches of the process.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::engine::EngineChoice;
use crate::near_field::{below_ground, self_hits};
use crate::scene::Scene;
use crate::score::{Guard, Objective};
use crate::search::bound::Bounds;
use crate::search::error::SearchError;
use crate::search::evaluator::{Evaluator, Judged};
use crate::search::generations::{
    GenerationRecord, Generations, GenerationsStop, MOST_COUNTED, why_left_out,
};
use crate::search::observer::{Observer, Watch};
use crate::search::on_demand::FramesOnDemand;
use crate::search::outcome::{LeftOut, Outcome, Scored, SearchTimes};
use crate::search::pilot::Known;
use crate::search::seat::FRAMES_AT_ONCE;
use crate::search::settings::{
    FINALISTS_SHARE, FRAMES_SHARE, FrameChoice, GENERATIONS_SHARE, SEARCH_SHARE, Settings,
    TimeLimit,
};
use crate::search::suite::Suite;
use crate::search::swaps::Swapped;
use crate::search::tolerance::Tolerance;
use crate::vehicle::{MAX_LIDARS, Placement};

/// Largest population of a loaded state.
const MOST_POPULATION: usize = 1_000_000;
/// Frames of each scene that a run takes, spread evenly, where there is no time for more.
const FEW_FRAMES: u32 = 4;

/// Current step of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// Frames are to be chosen.
    Frames,
    /// Generations run.
    Generations,
    /// Finalists of the generations are to be scored over all frames.
    Finalists,
    /// LiDARs are to be swapped.
    Swaps,
    /// Ends of the swaps are to be refined.
    Refine,
    /// Bounds are to be computed.
    Bounds,
    /// The result is to be confirmed over all frames.
    Confirm,
}

/// Checkpoint of a run: all that it needs beside problem, engine and time limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    pub(super) phase: Phase,
    pub(super) settings: Settings,
    /// Levels of frames, where the frames are on demand and were chosen.
    pub(super) levels: Option<FramesOnDemand>,
    pub(super) generations: Generations,
    pub(super) history: Vec<GenerationRecord>,
    /// The best finalist of the generations over all frames, where the search is over fewer.
    pub(super) chosen: Option<Placement>,
    pub(super) swaps: Option<Swapped>,
    pub(super) bounds: Option<Bounds>,
}

impl State {
    /// Current step of the run.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Its settings; engine and time limit of a loaded state are the defaults.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Checks that a loaded state fits these scenes, since its numbers come from a file.
    ///
    /// # Errors
    /// The first part that does not fit, in words.
    pub fn check(&self, suite: &Suite) -> Result<(), String> {
        let constraints = suite.constraints();
        let settings = &self.settings;
        settings.grid(constraints).map_err(|error| error.to_string())?;
        if settings.evaluations > MOST_COUNTED
            || settings.population.is_some_and(|n| n > MOST_POPULATION)
        {
            return Err("settings: a count is beyond any run".to_owned());
        }
        self.generations.check(constraints).map_err(|why| format!("generations: {why}"))?;
        if let Some(levels) = &self.levels {
            levels.check(suite.frame_count())?;
        }
        if self.swaps.iter().any(|s| s.evaluations.max(s.poses_cast) > MOST_COUNTED) {
            return Err("swaps: a count is beyond any run".to_owned());
        }
        if let Some(bounds) = &self.bounds {
            bounds.sample.check().map_err(|why| format!("bounds: {why}"))?;
        }
        let later = !matches!(self.phase, Phase::Frames | Phase::Generations);
        if self.levels.is_none()
            && settings.frames == FrameChoice::OnDemand
            && (later || self.phase == Phase::Generations)
        {
            return Err("levels of frames: there are none".to_owned());
        }
        let lidars = constraints.lidars();
        let given = settings.baselines.iter().chain(&settings.starts);
        let best = self.generations.best().map(|best| &best.placement);
        let swapped =
            self.swaps.iter().flat_map(|swaps| swaps.others.iter().chain([&swaps.placement]));
        let sampled = self.bounds.iter().flat_map(|bounds| bounds.sample.placements());
        let held = self.levels.iter().flat_map(FramesOnDemand::held);
        let found = held.chain(best).chain(&self.chosen).chain(swapped).chain(sampled);
        let is_found = found.into_iter().all(|placement| placement.lidars.len() == lidars);
        let is_given = given.into_iter().all(|p| (1..=MAX_LIDARS).contains(&p.lidars.len()));
        match is_found && is_given {
            true => Ok(()),
            false => Err("a placement has another number of LiDARs than the run".to_owned()),
        }
    }

    /// A record of each generation so far.
    pub fn history(&self) -> &[GenerationRecord] {
        &self.history
    }
}

/// Engines, and scores that need not be computed twice in one process.
#[derive(Default)]
pub(super) struct Sitting {
    /// Engine over the frames of the search, or of the bounds: one at a time, or a device would hold a scene twice.
    pub evaluator: Option<Evaluator>,
    /// Frames of that engine.
    pub frames: Vec<usize>,
    /// Engine over all frames, where the search is over fewer.
    pub over_all: Option<Evaluator>,
    /// Frames that result and baselines are scored over where there was no time for all.
    pub hurried: Option<Vec<usize>>,
    /// Placements whose tallies over all frames of each scene are known.
    pub known: Known,
    /// The result of an earlier sitting, which that of a sitting cut short is no worse than.
    pub kept: Option<Placement>,
    /// The baselines over all frames.
    pub baselines: Option<Vec<Scored>>,
    /// Generations of this sitting.
    pub generations: u64,
    /// Devices lost in engines that are closed, in words.
    pub changes: Vec<String>,
    /// Lost devices of the open engine that the user has been told of.
    pub told: usize,
    /// True if the engine was named to the user.
    pub named: bool,
    pub interrupted: bool,
    pub out_of_time: bool,
    pub times: SearchTimes,
}

/// A run under way: a [`State`], the scenes over all frames, and open engines.
pub struct Run {
    pub(super) suite: Suite,
    /// The first scene, whose own body stands for all; `None` where guards of the body are not looked at.
    body_in: Option<Arc<Scene>>,
    pub(super) state: State,
    /// The state before the first cut, where there was one.
    pub(super) before_cut: Option<State>,
    pub(super) sitting: Sitting,
}

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
    /// A run over the frames of a problem, or of several scenes.
    ///
    /// # Errors
    /// Settings that a scene does not allow, or that the CMA-ES refuses.
    pub fn new(scenes: impl Into<Suite>, settings: &Settings) -> Result<Self, SearchError> {
        let (suite, settings) = (scenes.into(), settings.clone());
        let objective = &settings.objective;
        let without =
            suite.members().iter().find(|member| !member.problem().content().has_detection());
        if let Some(member) = without.filter(|_| objective.needs_detection()) {
            let (objective, scene) = (objective.to_string(), member.scene());
            return Err(SearchError::NoDetection { objective, scene });
        }
        // Before any work, so that a grid too fine is found out now.
        settings.grid(suite.constraints())?;
        let starts = settings.baselines.iter().chain(&settings.starts);
        let generations = Generations::new(&settings, suite.constraints(), starts)?;
        let state = State {
            phase: Phase::Frames,
            settings,
            levels: None,
            generations,
            history: Vec::new(),
            chosen: None,
            swaps: None,
            bounds: None,
        };
        Ok(Self::resume(suite, state))
    }

    /// Goes on with a state that an earlier run over the same scenes was in.
    pub fn resume(scenes: impl Into<Suite>, state: State) -> Self {
        let (suite, sitting) = (scenes.into(), Sitting::default());
        Self { suite, body_in: None, state, before_cut: None, sitting }
    }

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
        self.sitting.interrupted |= watch.interrupted;
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

    /// Sets engine, time limit and mounting tolerance, which are no part of a saved state.
    pub fn open_with(
        &mut self,
        engine: EngineChoice,
        time: Option<TimeLimit>,
        tolerance: Option<Tolerance>,
    ) {
        let settings = &mut self.state.settings;
        (settings.engine, settings.time, settings.tolerance) = (engine, time, tolerance);
    }

    /// Looks at the own body in a scene: results, layouts given and moves then have the guards `self_hit` and `below_ground`
    /// when they are compared, and swaps the first. Generations know neither.
    pub(crate) fn look_at_body_in(&mut self, scene: Arc<Scene>) {
        self.body_in = Some(scene);
    }

    /// Keeps the result of an earlier sitting: where this one is cut short, its result is no worse. One that does not fit the
    /// rules is passed over. A run that comes to its own end gives the bits of one that never stopped.
    pub fn keep(&mut self, earlier: Placement) {
        let fits = why_left_out(self.suite.constraints(), &earlier).is_empty();
        self.sitting.kept = fits.then_some(earlier);
    }

    /// The state to save. If time or an interruption cut a phase short, it is the state before that phase.
    pub fn state(&self) -> &State {
        self.before_cut.as_ref().unwrap_or(&self.state)
    }

    /// Wall times of this sitting so far.
    pub fn times(&self) -> SearchTimes {
        self.sitting.times
    }

    /// Layouts to start from, beside the baselines, that the mount does not allow.
    pub fn left_out(&self) -> Vec<LeftOut> {
        let constraints = self.suite.constraints();
        let layouts = self.state.settings.starts.iter().map(|placement| LeftOut {
            name: placement.name.clone(),
            why: why_left_out(constraints, placement),
        });
        layouts.filter(|layout| !layout.why.is_empty()).collect()
    }

    pub(super) fn objective(&self) -> Objective {
        self.state.settings.objective.clone()
    }

    /// Snapshots the state for [`Self::state`] before a phase is aborted.
    pub(super) fn cut(&mut self, watch: &Watch) {
        self.cut_at(self.state.clone(), watch);
    }

    /// Snapshots `before`, the state before the phase that is aborted, for [`Self::state`].
    pub(super) fn cut_at(&mut self, before: State, watch: &Watch) {
        self.before_cut.get_or_insert(before);
        self.sitting.interrupted |= watch.interrupted;
        self.sitting.out_of_time |= !watch.interrupted;
    }

    /// True if a run that is to end does not score over all frames, because there are many; over few frames it scores
    /// whatever the time.
    pub(super) fn heeds_time(&self) -> bool {
        self.sitting.hurried.is_none() && self.suite.frame_count() > FRAMES_AT_ONCE
    }

    /// Few frames that stand for all as well as is known: those that the search began with, or some spread evenly.
    pub(super) fn few_frames(&self) -> Vec<usize> {
        match &self.state.levels {
            Some(levels) if levels.first().len() <= FRAMES_AT_ONCE => levels.first().to_vec(),
            _ => self.suite.spread(Some(FEW_FRAMES)),
        }
    }

    /// Goes on over few frames, spread evenly, that nobody has compared with all.
    pub(super) fn hurry(&mut self, watch: &mut Watch) {
        let (few, all) = (self.suite.spread(Some(FEW_FRAMES)), self.suite.frame_count());
        let (count, why) = (few.len(), watch.why_over());
        watch.note(&format!("{why}: the search takes {count} of {all} frames, spread evenly"));
        self.state.levels = Some(FramesOnDemand::hurried(few, all));
    }

    /// The scenes over the frames that result and baselines are scored over: all, if there was time.
    pub(super) fn confirming(&self) -> Cow<'_, Suite> {
        match &self.sitting.hurried {
            Some(few) => Cow::Owned(self.suite.over(few)),
            None => Cow::Borrowed(&self.suite),
        }
    }

    pub(super) fn is_at_target(&self) -> bool {
        self.state.generations.stopped() == Some(GenerationsStop::Target)
    }

    pub(super) fn memory(&self) -> u64 {
        self.state.settings.engine.memory_budget()
    }

    /// Frames of the search, numbered through all scenes.
    pub(super) fn frames(&self) -> Vec<usize> {
        match (&self.state.levels, self.state.settings.frames) {
            (Some(levels), _) => levels.frames().to_vec(),
            (None, FrameChoice::Count(wanted)) => self.suite.spread(Some(wanted)),
            (None, _) => self.suite.spread(None),
        }
    }

    pub(super) fn is_over_all(&self) -> bool {
        self.frames().len() == self.suite.frame_count()
    }

    pub(super) fn evaluator(&mut self, watch: &mut Watch) -> Result<&mut Evaluator, SearchError> {
        self.evaluator_over(self.frames(), watch)
    }

    /// Scores over some frames; closes an engine over others.
    pub(super) fn evaluator_over(
        &mut self,
        frames: Vec<usize>,
        watch: &mut Watch,
    ) -> Result<&mut Evaluator, SearchError> {
        if self.sitting.frames != frames {
            self.tell_changes(watch);
            let closed = self.sitting.evaluator.take();
            self.sitting.changes.extend(closed.iter().flat_map(Evaluator::changes));
            self.sitting.told = 0;
        }
        if self.sitting.evaluator.is_none() {
            let suite = match frames.len() == self.suite.frame_count() {
                true => self.suite.clone(),
                false => self.suite.over(&frames),
            };
            let suite = suite.for_search();
            // Lost devices are noted after each step, from the engines' own lists.
            let (evaluator, notes) = Evaluator::open(&suite, &self.state.settings.engine, |_| {})?;
            if !self.sitting.named {
                notes.iter().for_each(|note| watch.note(note));
                self.sitting.named = true;
            }
            let evaluator = evaluator.watching_cars(&self.state.settings.objective);
            self.sitting.evaluator = Some(evaluator.looking_at_body(self.body_in.clone()));
            self.sitting.frames = frames;
        }
        Ok(self.sitting.evaluator.as_mut().expect("opened above"))
    }

    /// Frames of the bounds: the first level, which stands for all; without levels, the frames of the search.
    pub(super) fn frames_of_bounds(&self) -> Vec<usize> {
        self.state.levels.as_ref().map_or_else(|| self.frames(), |levels| levels.first().to_vec())
    }

    pub(super) fn evaluator_of_bounds(
        &mut self,
        watch: &mut Watch,
    ) -> Result<&mut Evaluator, SearchError> {
        self.evaluator_over(self.frames_of_bounds(), watch)
    }

    /// Scores over the frames of [`Self::confirming`]; on the CPU where the search is over fewer, since a second scene on a
    /// device would take its memory twice.
    pub(super) fn over_all(&mut self, watch: &mut Watch) -> Result<&mut Evaluator, SearchError> {
        let is_hurried = self.sitting.hurried.is_some();
        if !is_hurried && self.is_over_all() && !self.suite.is_left_to_chance() {
            return self.evaluator(watch);
        }
        if self.sitting.over_all.is_none() {
            let evaluator = Evaluator::suite_on_cpu(&self.confirming(), self.memory());
            let objective = &self.state.settings.objective;
            self.sitting.over_all = Some(evaluator.watching_cars(objective));
        }
        Ok(self.sitting.over_all.as_mut().expect("opened above"))
    }

    /// Tells of devices that were lost since the last call.
    pub(super) fn tell_changes(&mut self, watch: &mut Watch) {
        let Some(evaluator) = &self.sitting.evaluator else { return };
        let changes = evaluator.changes();
        changes[self.sitting.told.min(changes.len())..]
            .iter()
            .for_each(|change| watch.note(change));
        self.sitting.told = changes.len();
    }

    /// Placements with their scores, the guards of the own body, and the rules that they break.
    pub(super) fn scored(
        &mut self,
        placements: &[Placement],
        judged: Vec<Judged>,
        watch: &mut Watch,
    ) -> Result<Vec<Scored>, SearchError> {
        let (objective, constraints) = (self.objective(), self.suite.rules());
        let scored = placements.iter().zip(judged);
        let scored = scored.map(|(p, judged)| Scored::new(p, judged, &objective, constraints));
        let mut scored: Vec<Scored> = scored.collect();
        for scored in &mut scored {
            scored.scores.guards.extend(self.guards_of_body(&scored.placement, watch)?);
        }
        Ok(scored)
    }

    /// Guards `below_ground` and `self_hit` of a placement in the scene of [`Self::look_at_body_in`].
    pub(super) fn guards_of_body(
        &mut self,
        placement: &Placement,
        watch: &mut Watch,
    ) -> Result<Vec<Guard>, SearchError> {
        let Some(scene) = self.body_in.clone() else { return Ok(Vec::new()) };
        let evaluator = self.over_all(watch)?;
        let problem = evaluator.shared_problem();
        let mut guards = below_ground(&scene, &problem, placement);
        guards.extend(self_hits(&scene, &problem, evaluator.backend_mut(), placement)?);
        Ok(guards)
    }
}
