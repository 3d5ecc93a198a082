//! The search of a job step by step: sensors for the money, placements, own body.

mod baselines;
mod cheaper;
mod checks;
mod fewest;
mod told;

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::{Job, JobError};
use crate::json::counted;
use crate::search::{
    Choosing, EquipStep, Equipped, Equipping, Event, Limits, Observer, Outcome, Run, SearchError,
    Settings, State, Stopped, Suite, TimeLimit,
};
use crate::vehicle::{Placement, Vehicle};
use baselines::begun;
use cheaper::is_met;
use checks::check_equipped;
use fewest::{Fewest, Next, taken};
pub(super) use fewest::{LESS, NEARLY};
use told::{tell_equipment, tell_given};

/// Checkpoint of a job's search, beside the job itself: a value that is saved and read again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobState {
    /// Sensors of the vehicle, once they are chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    equipped: Option<Equipped>,
    /// Choice of the fewest sensors; `None` where the money decides alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fewest: Option<Fewest>,
    #[serde(flatten)]
    course: Course,
}

/// Current step of a search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Course {
    /// A vehicle's sensors are to be chosen.
    Equipping(Box<Wanted>),
    /// Placements are searched.
    Run(Box<State>),
}

/// A choice of sensors, and the search that is to follow.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Wanted {
    choosing: Choosing,
    settings: Settings,
    /// See [`Job::is_plain`].
    plainly: bool,
}

/// A search that has come to its end, and its result.
struct Before {
    state: JobState,
    run: Run,
    outcome: Outcome,
}

/// A step of a search.
#[derive(Debug)]
pub enum JobStep {
    /// There is more to do: take another step.
    On,
    /// The observer has stopped the choice of sensors: there is no result.
    Stopped,
    /// The result, with the guard `self_hit`.
    Done(Box<Outcome>),
}

/// A search that has come to its end.
#[derive(Debug)]
pub struct Found {
    /// The result, with the guard `self_hit`.
    pub outcome: Outcome,
    /// Scenes with the rules of the sensors chosen.
    pub suite: Suite,
    /// Settings of the search of placements, with its baselines and starts.
    pub settings: Settings,
    /// Sensors chosen, by mount, and their price, in words; `None` where there was nothing to choose.
    pub equipment: Option<String>,
    /// Sensors chosen as data, with requirements out of reach; `None` where there was nothing to choose.
    pub equipped: Option<Equipped>,
    /// Wall time of choosing them.
    pub equipping: Duration,
}

/// A search of a [`Job`] under way.
pub struct JobRun<'a> {
    job: &'a Job,
    vehicle: &'a Vehicle,
    suite: Suite,
    state: JobState,
    /// Poses that sensors are chosen from, once they are cast.
    equipping: Option<Equipping>,
    /// The search of placements, once the sensors are chosen.
    run: Option<Run>,
    /// The last search, whose result missed a requirement: it stands where more sensors are not searched. Or, where a cheaper
    /// rig of as many sensors is searched, the one whose result met all.
    before: Option<Before>,
    /// Result of an earlier sitting; see [`Self::keep`].
    kept: Option<Placement>,
    /// Note on baselines that are left out, until it is told.
    left_out: Option<String>,
    /// The time ended while sensors were chosen: a resumed search goes on with that choice.
    is_late: bool,
    /// Wall time that choosing sensors has taken in this process.
    pub(crate) equipped_in: Duration,
}

impl Job {
    /// Chooses the vehicle's sensors for the budget, searches their best placement, and looks at it for the guard
    /// `self_hit`; `None` where the observer stops the choice of sensors.
    ///
    /// # Errors
    /// See [`Self::begin`] and [`JobRun::step`].
    pub fn optimize(&self, observer: &mut dyn Observer) -> Result<Option<Found>, JobError> {
        let mut run = self.begin()?;
        loop {
            match run.step(observer)? {
                JobStep::On => {}
                JobStep::Stopped => return Ok(None),
                JobStep::Done(outcome) => return Ok(run.found(*outcome)),
            }
        }
    }

    /// Begins a search, which [`JobRun::step`] takes to its end.
    ///
    /// # Errors
    /// See [`Self::suite`]; a budget without prices, settings that a scene does not allow.
    pub fn begin(&self) -> Result<JobRun<'_>, JobError> {
        self.check_room()?;
        let (vehicle, money) = (self.scene().vehicle(), self.most_money());
        // One LiDAR alone meets nothing that must hold without any one.
        let least = if vehicle.needs_two() { vehicle.most_sensors(money).min(2) } else { 1 };
        let least = vehicle.cheapest().len().max(least);
        let fewest = self.fewest.then(|| Fewest::new(money, least));
        self.resume(JobState { equipped: None, fewest, course: self.equipping() })
    }

    /// A choice of sensors at its beginning.
    fn equipping(&self) -> Course {
        let (settings, plainly) = (self.settings.clone(), self.is_plain);
        Course::Equipping(Box::new(Wanted { choosing: Choosing::default(), settings, plainly }))
    }

    /// Most that the sensors may cost; infinite without a limit.
    pub(super) fn most_money(&self) -> f64 {
        self.budget.unwrap_or(f64::INFINITY)
    }

    /// Goes on from a state of this job's search, to the same bits as if it had never stopped.
    ///
    /// # Errors
    /// See [`Self::begin`]; [`JobError::OtherState`] for a state of another vehicle or of other scenes.
    pub fn resume(&self, state: JobState) -> Result<JobRun<'_>, JobError> {
        let vehicle = self.scene().vehicle();
        if vehicle.is_nameless() && self.budget.is_some() {
            return Err(JobError::NoPrices);
        }
        if self.fewest && !vehicle.requires() {
            return Err(JobError::NothingRequired { asked: "--fewest" });
        }
        let suite = self.suite()?;
        let (is_late, equipped_in) = (false, Duration::ZERO);
        let mut run = JobRun {
            job: self,
            vehicle,
            suite,
            state,
            equipping: None,
            run: None,
            before: None,
            kept: None,
            left_out: None,
            is_late,
            equipped_in,
        };
        match &run.state.equipped {
            Some(equipped) => {
                check_equipped(vehicle, equipped)?;
                run.suite = run.suite.with_equipment(&vehicle.constraints(&equipped.equipment));
                run.search()?;
            }
            None if vehicle.is_nameless() => run.search()?,
            None if matches!(run.state.course, Course::Run(_)) => {
                let why =
                    "the vehicle's sensors are not chosen, and the search has begun".to_owned();
                return Err(JobError::OtherState { why });
            }
            None => {}
        }
        Ok(run)
    }
}

impl JobRun<'_> {
    /// Does one step: part of the choice of sensors, or a step of the search of placements.
    ///
    /// # Errors
    /// A budget below the cheapest sensors, settings that a scene does not allow, an engine that fails.
    pub fn step(&mut self, observer: &mut dyn Observer) -> Result<JobStep, JobError> {
        if let Some(note) = self.left_out.take() {
            observer.on(&Event::Note(&note));
        }
        let Some(run) = &mut self.run else {
            let start = Instant::now();
            let step = self.equip(observer);
            self.equipped_in += start.elapsed();
            return step;
        };
        let Some(outcome) = run.step(observer)? else { return Ok(JobStep::On) };
        let Some(outcome) = self.met_or_last(outcome, observer)? else { return Ok(JobStep::On) };
        self.done(outcome, observer)
    }

    /// Keeps the result of an earlier sitting: where this one is cut short by time or the observer, its result is no worse over
    /// the frames that it is scored over. A search that comes to its own end gives the bits of one that never stopped.
    pub fn keep(&mut self, earlier: Placement) {
        if let Some(run) = &mut self.run {
            run.keep(earlier.clone());
        }
        self.kept = Some(earlier);
    }

    /// The result of the last search, where no other is begun; `None` where there was none.
    fn done_before(
        &mut self,
        stopped: Option<Stopped>,
        observer: &mut dyn Observer,
    ) -> Result<Option<JobStep>, JobError> {
        let Some(before) = self.before.take() else { return Ok(None) };
        let mut outcome = self.restore(before);
        let untried = self.state.fewest.as_ref().map(Fewest::untried);
        outcome.untried = stopped.and(untried);
        outcome.stopped = stopped.unwrap_or(outcome.stopped);
        self.done(outcome, observer).map(Some)
    }

    /// Goes back to a search that has come to its end.
    fn restore(&mut self, Before { state, run, outcome }: Before) -> Outcome {
        let equipment = state.equipped.as_ref().map(|equipped| &equipped.equipment);
        let equipment = equipment.map(|equipment| self.vehicle.constraints(equipment));
        self.suite =
            equipment.map_or_else(|| self.suite.clone(), |of| self.suite.with_equipment(&of));
        (self.state, self.run) = (state, Some(run));
        outcome
    }

    /// The end of a search: prices, ranges and self-hits join its result.
    fn done(&self, mut outcome: Outcome, observer: &mut dyn Observer) -> Result<JobStep, JobError> {
        for scored in outcome.best.iter_mut().chain(&mut outcome.baselines) {
            scored.price = self.vehicle.price_of_rig(&scored.placement);
        }
        self.job.look_closely_at(&mut outcome, observer)?;
        Ok(JobStep::Done(Box::new(outcome)))
    }

    /// The result, or `None` where the search begins anew with one sensor more: the fewest are wanted, the placements found do
    /// not meet the requirements, and the search has come to its own end.
    fn met_or_last(
        &mut self,
        mut outcome: Outcome,
        observer: &mut dyn Observer,
    ) -> Result<Option<Outcome>, JobError> {
        let Some(fewest) = &self.state.fewest else { return Ok(Some(outcome)) };
        let allowed = fewest.limits.sensors;
        let is_over = outcome.stopped.is_unfinished() || self.is_late;
        if is_met(&outcome) || self.has_met() {
            return self.met_or_cheaper(outcome, observer);
        }
        if allowed >= self.vehicle.most_sensors(self.job.most_money()) {
            return Ok(Some(outcome));
        }
        if is_over {
            let untried = fewest.untried();
            observer.on(&Event::Note(&format!("{untried} were not tried")));
            outcome.untried = Some(untried);
            return Ok(Some(outcome));
        }
        let words = format!(
            "no placement of {} was found that meets all requirements; one more is allowed",
            counted(allowed, "sensor")
        );
        observer.on(&Event::Note(&words));
        let mut more = Fewest::new(self.job.most_money(), allowed + 1);
        more.searched.clone_from(&fewest.searched);
        more.searched.extend(self.state.equipped.iter().map(|equipped| equipped.equipment.clone()));
        let state = JobState { equipped: None, fewest: Some(more), course: self.job.equipping() };
        let (before, Some(run)) = (self.state(), self.run.take()) else {
            return Ok(Some(outcome));
        };
        self.before = Some(Before { state: before, run, outcome });
        (self.state, self.equipping) = (state, None);
        Ok(None)
    }

    /// Goes on with the choice of sensors.
    fn equip(&mut self, observer: &mut dyn Observer) -> Result<JobStep, JobError> {
        let found = match self.choose(observer)? {
            ControlFlow::Continue(found) => found,
            ControlFlow::Break(JobStep::Stopped) => {
                let before = self.done_before(Some(Stopped::Interrupted), observer)?;
                return Ok(before.unwrap_or(JobStep::Stopped));
            }
            ControlFlow::Break(step) => return Ok(step),
        };
        let fewest = self.state.fewest.as_ref();
        let was_searched = fewest.is_some_and(|fewest| fewest.was_searched(&found.equipment));
        if was_searched || found.is_cut {
            let stopped = found.is_cut.then_some(Stopped::Time);
            if let Some(step) = self.done_before(stopped, observer)? {
                observer
                    .on(&Event::Note("more sensors are not searched: the result of fewer stands"));
                return Ok(step);
            }
        }
        let vehicle = self.vehicle;
        if found.equipment.is_empty() {
            let least = vehicle.rig_by_the_rules().map_err(SearchError::from)?.0;
            let (budget, least) = (self.limits().budget, vehicle.cost(&least));
            return Err(SearchError::Budget { budget, least }.into());
        }
        self.before = None;
        self.search_with(found, observer)?;
        Ok(JobStep::On)
    }

    /// Begins the search of placements of chosen sensors.
    fn search_with(
        &mut self,
        chosen: Equipped,
        observer: &mut dyn Observer,
    ) -> Result<(), JobError> {
        tell_equipment(self.vehicle, &chosen, observer);
        self.equipping = None;
        self.suite = self.suite.with_equipment(&self.vehicle.constraints(&chosen.equipment));
        self.state.equipped = Some(chosen);
        self.search()
    }

    /// Limits of the choice of sensors.
    fn limits(&self) -> Limits {
        let all = Limits::budget(self.job.most_money());
        self.state.fewest.as_ref().map_or(all, |fewest| fewest.limits)
    }

    /// A step of the choice of sensors, or its end.
    fn choose(
        &mut self,
        observer: &mut dyn Observer,
    ) -> Result<ControlFlow<JobStep, Equipped>, JobError> {
        let limits = self.limits();
        let Course::Equipping(wanted) = &mut self.state.course else {
            return Ok(ControlFlow::Break(JobStep::Stopped));
        };
        let (vehicle, settings) = (self.vehicle, &self.job.settings);
        let choice = match &mut self.equipping {
            Some(choice) => choice,
            none => {
                let deadline = settings.time.as_ref().map(TimeLimit::deadline);
                let (objective, engine) = (&wanted.settings.objective, &settings.engine);
                let opened = Equipping::open(
                    &self.suite, vehicle, objective, limits, engine, deadline, observer,
                )?;
                let Some(opened) = opened else { return Ok(ControlFlow::Break(JobStep::Stopped)) };
                none.insert(opened.with_state(wanted.choosing.clone()))
            }
        };
        let step = choice.step(observer)?;
        wanted.choosing = choice.state().clone();
        let found = match step {
            EquipStep::On => return Ok(ControlFlow::Break(JobStep::On)),
            EquipStep::Stopped => return Ok(ControlFlow::Break(JobStep::Stopped)),
            EquipStep::Done(found) => found,
            EquipStep::OutOfTime(found) => {
                self.is_late = true;
                let kept: Vec<Placement> = self.kept.iter().cloned().collect();
                let Some((found, name)) = choice.or_given(vehicle, &kept, found, observer)? else {
                    return Ok(ControlFlow::Break(JobStep::Stopped));
                };
                tell_given(name.map(|_| "the result of an earlier sitting"), observer);
                // A choice under a lower price was cut: the best under the prices before stands.
                let held = self.state.fewest.as_mut().and_then(Fewest::take);
                let found = held.unwrap_or(found);
                return Ok(ControlFlow::Continue(Equipped { is_cut: true, ..found }));
            }
        };
        let Settings { starts, baselines, .. } = &wanted.settings;
        let given = [&starts[..], &baselines[..]].concat();
        let Some((found, name)) = choice.or_given(vehicle, &given, found, observer)? else {
            return Ok(ControlFlow::Break(JobStep::Stopped));
        };
        if found.is_cut {
            self.is_late = true;
            return Ok(ControlFlow::Continue(found));
        }
        tell_given(name.as_deref(), observer);
        Ok(match taken(&mut self.state.fewest, found, vehicle, observer) {
            Next::Take(found) => ControlFlow::Continue(*found),
            Next::Again(limits) => {
                choice.again(limits);
                wanted.choosing = choice.state().clone();
                ControlFlow::Break(JobStep::On)
            }
        })
    }

    /// Begins the search of placements, or goes on with one.
    fn search(&mut self) -> Result<(), JobError> {
        let mut run = match &self.state.course {
            Course::Run(state) => {
                state.check(&self.suite).map_err(|why| JobError::OtherState { why })?;
                Run::resume(self.suite.clone(), State::clone(state))
            }
            Course::Equipping(wanted) => {
                let Wanted { settings, plainly, .. } = &**wanted;
                let settings = match &self.state.equipped {
                    Some(equipped) => {
                        equipped.begin(settings.clone(), self.suite.constraints(), *plainly)
                    }
                    None => {
                        let (scene, rules) = (self.job.scene(), self.suite.constraints());
                        let (settings, note) = begun(settings.clone(), *plainly, scene, rules);
                        self.left_out = note;
                        settings
                    }
                };
                let run = Run::new(self.suite.clone(), &settings);
                run.map_err(|error| self.job.in_scene(error))?
            }
        };
        let settings = &self.job.settings;
        run.open_with(settings.engine.clone(), settings.time, self.job.tolerance);
        run.look_at_body_in(self.job.scene().clone());
        if let Some(kept) = &self.kept {
            run.keep(kept.clone());
        }
        self.run = Some(run);
        Ok(())
    }

    /// Checkpoint of the search. If the time ended while sensors were chosen, it is the state before the end of that
    /// choice.
    ///
    /// While a cheaper rig is searched than one that has met all requirements, it is the state before that search.
    pub fn state(&self) -> JobState {
        if let Some(before) = self.before.as_ref().filter(|_| self.has_met()) {
            return before.state.clone();
        }
        match &self.run {
            Some(run) if !self.is_late => JobState {
                equipped: self.state.equipped.clone(),
                fewest: self.state.fewest.clone(),
                course: Course::Run(Box::new(run.state().clone())),
            },
            Some(_) => JobState { equipped: None, ..self.state.clone() },
            None => self.state.clone(),
        }
    }

    /// The search of placements, once the sensors are chosen.
    pub fn run(&self) -> Option<&Run> {
        self.run.as_ref()
    }

    /// Sensors of the vehicle, once they are chosen.
    pub fn equipped(&self) -> Option<&Equipped> {
        self.state.equipped.as_ref()
    }

    /// Scenes, with the rules of the sensors chosen.
    pub fn suite(&self) -> &Suite {
        &self.suite
    }

    /// Sensors chosen, by mount, and their price, in words; `None` before they are chosen, or where there is nothing
    /// to choose.
    pub(crate) fn equipment_in_words(&self) -> Option<String> {
        Some(self.equipped()?.words_with_price(self.vehicle))
    }

    /// Result, scenes and settings together.
    fn found(self, outcome: Outcome) -> Option<Found> {
        let (equipment, equipping) = (self.equipment_in_words(), self.equipped_in);
        let equipped = self.equipped().cloned();
        let settings = self.run?.state().settings().clone();
        Some(Found { outcome, suite: self.suite, settings, equipment, equipped, equipping })
    }
}

#[cfg(test)]
mod tests;
