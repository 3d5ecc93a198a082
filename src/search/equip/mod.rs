//! The equipment of a vehicle: models and numbers of sensors on each mount, for the money.
//!
//! Poses of every model on every mount lie on one coarse grid with both ends of every pose field, each cast once into a few
//! frames. The information gain and the requirements are both submodular in the set of sensors. So sensors are added one
//! by one, the best first: once by gain, and once by gain for the price. Then single sensors are exchanged, moved, dropped
//! or added while that gains. A grid of few rigs is looked at rig by rig. A start or baseline with better sensors replaces
//! the choice. A [`Choosing`] is the checkpoint from which a choice continues to the same equipment.

mod choosing;
mod equipped;

pub(crate) use choosing::REQUIRED;
pub use choosing::{Choosing, EquipStep};
pub use equipped::{Equipped, Limits, OpenMount, PLAIN};
pub(crate) use equipped::{EveryRig, is_about};

use choosing::{Equip, FRAMES, Opened};

use std::time::Instant;

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::observer::{Event, Observer, Watch, Work};
use super::suite::Suite;
use crate::engine::EngineChoice;
use crate::score::{Objective, Scores, reference_layout};
use crate::vehicle::{Equipment, MAX_LIDARS, Placement, SensorName, Vehicle, is_within_budget};

/// Said where the time is over before the choice.
const OUT_OF_TIME: &str = "the time ended while the sensors were chosen; the best so far are taken, and more time may find better ones";
/// Said where the time is over in the look at starts and baselines.
const LOOK_OUT_OF_TIME: &str =
    "the time ended while starts and baselines were compared with the sensors chosen, which stay";
/// Budgets of a front, beside one without a limit.
const BUDGETS: u32 = 8;

/// A choice of equipment under way, step by step.
pub struct Equipping {
    search: Search,
    state: Choosing,
    deadline: Option<Instant>,
    /// Result if no rig of the coarse grid keeps all rules.
    spare: Spare,
}

/// A rig that keeps all rules, and where it is scored.
struct Spare {
    rig: (Equipment, Placement),
    cost: f64,
    /// A few frames.
    suite: Suite,
    objective: Objective,
    limits: Limits,
    memory: u64,
}

impl Spare {
    /// Scores of given placements over the few frames; `None` once the watch is over.
    fn scores(
        &self,
        placements: &[Placement],
        watch: &mut Watch,
    ) -> Result<Option<Vec<Scores>>, SearchError> {
        let mut evaluator = Evaluator::suite_on_cpu(&self.suite, self.memory);
        let (mut done, total) = (0, evaluator.looks(placements.len()) as u64);
        let mut go_on = || {
            let goes_on = watch.tell(&Event::Progress { work: Work::Given, done, total });
            done = total.min(done + 1);
            goes_on
        };
        Ok(evaluator.scores_while(placements, &mut go_on)?)
    }

    /// A rig of few sensors that keeps all rules.
    fn new(
        suite: &Suite,
        vehicle: &Vehicle,
        objective: &Objective,
        limits: Limits,
        engine: &EngineChoice,
    ) -> Result<Self, SearchError> {
        let check = |least: f64| match is_within_budget(least, limits.budget) {
            true => Ok(least),
            false => Err(SearchError::Budget { budget: limits.budget, least }),
        };
        check(vehicle.cost(&vehicle.cheapest()))?;
        let rig = vehicle.rig_by_the_rules()?;
        let cost = check(vehicle.cost(&rig.0))?;
        let (suite, objective) = (suite.over(&suite.spread(Some(FRAMES))), objective.clone());
        let memory = engine.memory_budget();
        Ok(Self { rig, cost, suite, objective, limits, memory })
    }

    /// The rig with its scores; no sensors where the limits do not allow it.
    fn equipped(&self, found: Equipped) -> Result<Equipped, SearchError> {
        let is_dear = !is_within_budget(self.cost, self.limits.budget);
        let count = self.rig.0.len();
        if !found.equipment.is_empty() || is_dear || count > self.limits.sensors {
            return Ok(found);
        }
        let Equipped { out_of_reach, ceilings, is_cut, .. } = found;
        Ok(Equipped { out_of_reach, ceilings, is_cut, ..self.scored(self.rig.clone(), self.cost)? })
    }

    /// The only equipment of a vehicle that leaves no choice, placed as in the reference layout. If that breaks a rule, a
    /// placement that keeps them.
    fn plain(&self, vehicle: &Vehicle) -> Result<Equipped, SearchError> {
        let equipment = vehicle.cheapest();
        let models: Vec<SensorName> = equipment.iter().map(|(_, sensor)| *sensor).collect();
        let constraints = vehicle.constraints(&equipment);
        let layout = reference_layout(&constraints, &models);
        let rig = match constraints.violations(&layout).is_empty() {
            true => (equipment, layout),
            false => vehicle.rig_by_the_rules()?,
        };
        let cost = vehicle.cost(&rig.0);
        self.scored(rig, cost)
    }

    fn scored(
        &self,
        (equipment, placement): (Equipment, Placement),
        cost: f64,
    ) -> Result<Equipped, SearchError> {
        let mut evaluator = Evaluator::suite_on_cpu(&self.suite, self.memory);
        let scores = evaluator.scores(std::slice::from_ref(&placement))?.remove(0);
        Ok(Equipped {
            placement: Placement { name: "equipped".into(), ..placement },
            value: self.objective.value(&scores).unwrap_or(f64::NEG_INFINITY),
            missing: scores.missing(),
            out_of_reach: Vec::new(),
            ceilings: Vec::new(),
            is_cut: false,
            equipment,
            cost,
        })
    }
}

enum Search {
    /// There was nothing to choose.
    Chosen(Equipped),
    /// The time was over before poses could be compared: the cheapest equipment.
    OutOfTime(Equipped),
    Open(Box<Equip>),
}

impl Equipping {
    /// Casts every model on every mount; `None` where the observer stops that.
    ///
    /// # Errors
    /// A budget below the cheapest equipment, rules that no rig was found to keep, an objective other than the
    /// information gain where there is a choice, or an engine that failed.
    pub fn open(
        suite: &Suite,
        vehicle: &Vehicle,
        objective: &Objective,
        limits: Limits,
        engine: &EngineChoice,
        deadline: Option<Instant>,
        observer: &mut dyn Observer,
    ) -> Result<Option<Self>, SearchError> {
        let state = Choosing::default();
        let spare = Spare::new(suite, vehicle, objective, limits, engine)?;
        if !objective.is_information_gain() {
            if vehicle.has_choice() {
                return Err(SearchError::NotForEquipment { objective: objective.to_string() });
            }
            let search = Search::Chosen(spare.plain(vehicle)?);
            return Ok(Some(Self { search, state, deadline, spare }));
        }
        let mut watch = Watch::until(observer, deadline);
        let search = match Equip::open(suite, vehicle, objective, limits, engine, &mut watch)? {
            Opened::Open(search) => Search::Open(search),
            Opened::Stopped => return Ok(None),
            Opened::OutOfTime => Search::OutOfTime(spare.plain(vehicle)?),
        };
        let mut begun = Self { search, state, deadline, spare };
        begun.begin_anew();
        Ok(Some(begun))
    }

    /// Goes on with a state that an earlier choice of the same vehicle in the same scenes was in; one that does
    /// not fit begins anew.
    #[must_use]
    pub fn with_state(mut self, state: Choosing) -> Self {
        let fits = match &self.search {
            Search::Open(search) => state.fits(search.pose_count()),
            Search::Chosen(_) | Search::OutOfTime(_) => true,
        };
        if fits {
            self.state = state;
        } else {
            self.begin_anew();
        }
        self
    }

    fn begin_anew(&mut self) {
        self.state = match &self.search {
            Search::Open(search) => Choosing::on_grid(search.pose_count()),
            Search::Chosen(_) | Search::OutOfTime(_) => Choosing::default(),
        };
    }

    /// Sets the end of the time for choices that follow.
    #[must_use]
    pub fn until(self, deadline: Option<Instant>) -> Self {
        Self { deadline, ..self }
    }

    /// Checkpoint of the choice.
    pub fn state(&self) -> &Choosing {
        &self.state
    }

    /// Begins another choice among the same poses, under other limits.
    pub fn again(&mut self, limits: Limits) {
        self.begin_anew();
        self.spare.limits = limits;
        if let Search::Open(search) = &mut self.search {
            search.limits = limits;
        }
    }

    /// Begins choices by another gain among the same poses, for which the objective of [`Self::open`] must hold all that is
    /// summed. `required` weighs a missing share of 1 of the requirements, in largest gains of a single sensor: 0 does not
    /// look at them, 1000 puts them first, as at the beginning.
    pub(crate) fn aim(&mut self, objective: &Objective, required: f64) {
        self.begin_anew();
        self.spare.objective = objective.clone();
        if let Search::Open(search) = &mut self.search {
            search.aim(objective, required);
        }
    }

    /// Every rig within the limits, where they are few; none where they are many. `None` where the time or the observer
    /// ends the look.
    pub(crate) fn every_rig(&mut self, observer: &mut dyn Observer) -> Option<EveryRig> {
        let mut watch = Watch::until(observer, self.deadline);
        if !watch.goes_on() {
            return None;
        }
        let every = match &mut self.search {
            Search::Open(search) => search.every_of_few(&watch),
            Search::Chosen(_) | Search::OutOfTime(_) => None,
        };
        (!watch.is_over()).then(|| every.unwrap_or_default())
    }

    /// A given placement in place of the rig chosen, and its name, where it is better over the few frames of the choice. It is
    /// so if it misses less of the requirements. Where money decides alone, it is so too if it misses as much and has more of
    /// the objective. Placements that break a rule or the limits are passed over. `None` where the observer stops the look;
    /// where the time ends it, the rig chosen, marked as cut. A single one is looked at whatever the time.
    ///
    /// # Errors
    /// An engine that failed.
    pub fn or_given(
        &self,
        vehicle: &Vehicle,
        given: &[Placement],
        found: Equipped,
        observer: &mut dyn Observer,
    ) -> Result<Option<(Equipped, Option<String>)>, SearchError> {
        let Spare { objective, limits, .. } = &self.spare;
        let allowed = given.iter().filter_map(|one| {
            let (equipment, lidars) = vehicle.equipment_of(one)?;
            let cost = vehicle.cost(&equipment);
            let is_allowed =
                is_within_budget(cost, limits.budget) && equipment.len() <= limits.sensors;
            let placement = Placement { name: "equipped".into(), lidars };
            is_allowed
                .then(|| (&one.name, Equipped { equipment, placement, cost, ..found.clone() }))
        });
        let mut allowed: Vec<(&String, Equipped)> = allowed.collect();
        if allowed.is_empty() {
            return Ok(Some((found, None)));
        }
        // The rig chosen is scored as they are: the choice itself looks at other draws, and wants a margin.
        let chosen = (!found.equipment.is_empty()).then_some(&found.placement);
        let all = chosen.into_iter().chain(allowed.iter().map(|(_, of)| &of.placement));
        let mut watch = Watch::until(observer, self.deadline.filter(|_| given.len() > 1));
        let Some(scores) = self.spare.scores(&all.cloned().collect::<Vec<_>>(), &mut watch)? else {
            if watch.interrupted {
                return Ok(None);
            }
            watch.note(LOOK_OUT_OF_TIME);
            return Ok(Some((Equipped { is_cut: true, ..found }, None)));
        };
        let worth = |scores: &Scores| {
            (-scores.missing(), objective.value(scores).unwrap_or(f64::NEG_INFINITY))
        };
        let (own, others) = scores.split_at(usize::from(chosen.is_some()));
        let own = own.first().map_or((f64::NEG_INFINITY, f64::NEG_INFINITY), worth);
        let for_money = limits.sensors >= MAX_LIDARS;
        let better = |a: (f64, f64), b: (f64, f64)| a.0 > b.0 || (for_money && a > b);
        let mut best = (own, None);
        for (number, scores) in others.iter().enumerate() {
            if better(worth(scores), best.0) {
                best = (worth(scores), Some(number));
            }
        }
        let ((missing, value), Some(number)) = best else { return Ok(Some((found, None))) };
        let (name, given) = allowed.swap_remove(number);
        Ok(Some((Equipped { missing: 0.0 - missing, value, ..given }, Some(name.clone()))))
    }

    /// Exchanges one sensor, or begins or ends a climb. Where no rig of the coarse grid keeps all rules, the end is a rig
    /// of few sensors that does; where the limits do not allow that one either, the end has no sensors.
    ///
    /// # Errors
    /// An engine that failed.
    pub fn step(&mut self, observer: &mut dyn Observer) -> Result<EquipStep, SearchError> {
        Ok(match self.step_on_grid(observer) {
            EquipStep::Done(found) => EquipStep::Done(self.spare.equipped(found)?),
            EquipStep::OutOfTime(found) => EquipStep::OutOfTime(self.spare.equipped(found)?),
            other => other,
        })
    }

    fn step_on_grid(&mut self, observer: &mut dyn Observer) -> EquipStep {
        match &mut self.search {
            Search::Chosen(equipped) => EquipStep::Done(equipped.clone()),
            Search::OutOfTime(equipped) => {
                Watch::new(observer, false).note(OUT_OF_TIME);
                EquipStep::OutOfTime(equipped.clone())
            }
            Search::Open(search) => {
                let mut watch = Watch::until(observer, self.deadline);
                let step = search.step(&mut self.state, &mut watch);
                if matches!(step, EquipStep::OutOfTime(_)) {
                    watch.note(OUT_OF_TIME);
                }
                step
            }
        }
    }
}

/// The best equipment for each of some budgets, from the cheapest rig to the best that the limits allow.
///
/// # Errors
/// See [`Equipping::open`].
pub fn cost_front(
    suite: &Suite,
    vehicle: &Vehicle,
    objective: &Objective,
    limits: Limits,
    engine: &EngineChoice,
) -> Result<Vec<Equipped>, SearchError> {
    if !objective.is_information_gain() {
        return Err(SearchError::NotForEquipment { objective: objective.to_string() });
    }
    let silent = &mut |_: &Event| true;
    let mut watch = Watch::new(silent, false);
    let mut spare = Spare::new(suite, vehicle, objective, limits, engine)?;
    let least = spare.cost;
    let search = Equip::open(suite, vehicle, objective, limits, engine, &mut watch)?;
    let Opened::Open(mut search) = search else { return Ok(Vec::new()) };
    let Some(most) = search.best(&mut watch) else { return Ok(Vec::new()) };
    let most = spare.equipped(most)?;
    let mut front = Vec::new();
    for step in 0..BUDGETS {
        let budget = least + (most.cost - least) * f64::from(step) / f64::from(BUDGETS);
        (search.limits.budget, spare.limits.budget) = (budget, budget);
        let found = search.best(&mut watch);
        front.extend(found.map(|found| spare.equipped(found)).transpose()?);
    }
    front.push(most);
    front.retain(|equipped| !equipped.equipment.is_empty());
    front.dedup_by(|a, b| a.equipment == b.equipment);
    Ok(front)
}
