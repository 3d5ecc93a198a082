//! The equipment of a vehicle: models and numbers of sensors on each mount, for the money.
//!
//! Poses of every model on every mount lie on one coarse grid, each cast once into a few frames. The information gain
//! and the requirements are both submodular in the set of sensors. So sensors are added one by one, the best first:
//! once by gain, and once by gain for the price. Then single sensors are exchanged, moved, dropped or added while
//! that gains. A [`Choosing`] is the checkpoint from which a choice continues to the same equipment.

mod choosing;
mod equipped;

pub(crate) use choosing::REQUIRED;
pub use choosing::{Choosing, EquipStep, Limits};
pub use equipped::{Equipped, PLAIN};

use choosing::{Equip, FRAMES, Opened};

use std::time::Instant;

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::observer::{Event, Observer, Watch};
use super::suite::Suite;
use crate::engine::EngineChoice;
use crate::score::{Objective, reference_layout};
use crate::vehicle::{Placement, SensorName, Vehicle};

/// Said where the time is over before the choice.
const OUT_OF_TIME: &str = "the time ended while the sensors were chosen; the best so far are taken, and more time may find better ones";
/// Budgets of a front, beside the one that wants for nothing.
const BUDGETS: u32 = 8;

/// A choice of equipment under way, step by step.
pub struct Equipping {
    search: Search,
    state: Choosing,
    deadline: Option<Instant>,
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
    /// A budget below the cheapest equipment, an objective other than the information gain where there is a
    /// choice, or an engine that failed.
    pub fn open(
        suite: &Suite,
        vehicle: &Vehicle,
        objective: &Objective,
        limits: Limits,
        engine: &EngineChoice,
        deadline: Option<Instant>,
        observer: &mut dyn Observer,
    ) -> Result<Option<Self>, SearchError> {
        let cheapest = vehicle.cheapest();
        let (least, state) = (vehicle.cost(&cheapest), Choosing::default());
        if least > limits.budget {
            return Err(SearchError::Budget { budget: limits.budget, least });
        }
        if !objective.is_information_gain() {
            if vehicle.has_choice() {
                return Err(SearchError::NotForEquipment { objective: objective.to_string() });
            }
            let search = Search::Chosen(plain(suite, vehicle, objective, engine)?);
            return Ok(Some(Self { search, state, deadline }));
        }
        let mut watch = Watch::until(observer, deadline);
        let search = match Equip::open(suite, vehicle, objective, limits, engine, &mut watch)? {
            Opened::Open(search) => Search::Open(search),
            Opened::Stopped => return Ok(None),
            Opened::OutOfTime => Search::OutOfTime(plain(suite, vehicle, objective, engine)?),
        };
        Ok(Some(Self { search, state, deadline }))
    }

    /// Goes on with a state that an earlier choice of the same vehicle in the same scenes was in; one that does
    /// not fit begins anew.
    #[must_use]
    pub fn with_state(mut self, state: Choosing) -> Self {
        let poses = match &self.search {
            Search::Open(search) => search.pose_count(),
            Search::Chosen(_) | Search::OutOfTime(_) => return Self { state, ..self },
        };
        if state.fits(poses) {
            self.state = state;
        }
        self
    }

    /// Checkpoint of the choice.
    pub fn state(&self) -> &Choosing {
        &self.state
    }

    /// Begins another choice among the same poses, under other limits.
    pub fn again(&mut self, limits: Limits) {
        self.state = Choosing::default();
        if let Search::Open(search) = &mut self.search {
            search.limits = limits;
        }
    }

    /// Begins choices by another gain among the same poses, for which the objective of [`Self::open`] must hold all that is
    /// summed. `required` weighs a missing share of 1 of the requirements, in largest gains of a single sensor: 0 does not
    /// look at them, 1000 puts them first, as at the beginning.
    pub fn aim(&mut self, objective: &Objective, required: f64) {
        self.state = Choosing::default();
        if let Search::Open(search) = &mut self.search {
            search.aim(objective, required);
        }
    }

    /// Exchanges one sensor, or begins or ends a climb.
    pub fn step(&mut self, observer: &mut dyn Observer) -> EquipStep {
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

/// The only equipment of a vehicle that leaves no choice, as the reference layout puts it up.
fn plain(
    suite: &Suite,
    vehicle: &Vehicle,
    objective: &Objective,
    engine: &EngineChoice,
) -> Result<Equipped, SearchError> {
    let equipment = vehicle.cheapest();
    let models: Vec<SensorName> = equipment.iter().map(|(_, sensor)| *sensor).collect();
    let placement = reference_layout(&vehicle.constraints(&equipment), &models);
    let few = suite.over(&suite.spread(Some(FRAMES)));
    let mut evaluator = Evaluator::suite_on_cpu(&few, engine.memory_budget());
    let scores = evaluator.scores(std::slice::from_ref(&placement))?.remove(0);
    Ok(Equipped {
        cost: vehicle.cost(&equipment),
        value: objective.value(&scores).unwrap_or(f64::NEG_INFINITY),
        missing: scores.missing(),
        out_of_reach: Vec::new(),
        placement: Placement { name: "equipped".into(), ..placement },
        equipment,
    })
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
    let least = vehicle.cost(&vehicle.cheapest());
    if least > limits.budget {
        return Err(SearchError::Budget { budget: limits.budget, least });
    }
    let search = Equip::open(suite, vehicle, objective, limits, engine, &mut watch)?;
    let Opened::Open(mut search) = search else { return Ok(Vec::new()) };
    let Some(most) = search.best(&mut watch) else { return Ok(Vec::new()) };
    let mut front = Vec::new();
    for step in 0..BUDGETS {
        search.limits.budget = least + (most.cost - least) * f64::from(step) / f64::from(BUDGETS);
        front.extend(search.best(&mut watch));
    }
    front.push(most);
    front.dedup_by(|a, b| a.equipment == b.equipment);
    Ok(front)
}
