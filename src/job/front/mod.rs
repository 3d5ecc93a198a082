//! The front of two or three objectives of a vehicle's sensors and their poses.
//!
//! | file | holds |
//! |---|---|
//! | `axis` | objectives by name |
//! | `sweep` | choices of sensors on the coarse grid, under a row of prices or numbers |
//! | `pool` | placements found, scored over all frames, and searches of poses around them |
//! | `pareto` | the Pareto filter and the knee |
//!
//! Poses are cast once. For each of a row of limits the best sensors are chosen among them (the ε-constraint method;
//! Haimes, Lasdon, Wismer 1971). All placements are then scored over all frames, and those that no other one beats are the
//! front.

mod axis;
mod pareto;
mod pool;
mod sweep;

use std::fmt;
use std::time::Instant;

use serde::Serialize;

use super::{Job, JobError};
use crate::score::{Objective, Scores};
use crate::search::{Observer, SceneScores, TimeLimit};
use crate::vehicle::Placement;
use pareto::{FrontProgress, Objectives, knee};
use pool::Pool;
use sweep::{End, FrontSweep, PoseCaster, Swept};

pub use axis::{FrontError, FrontObjective, FrontObjectives};
pub use pareto::FrontState;

/// Share of the time limit for the choices of sensors where poses are searched afterwards.
const CHOICES_SHARE: f64 = 0.4;
/// Share of the time limit for choices without a search of poses, and for casts before the first choice.
const CASTS_SHARE: f64 = 0.85;

/// Missing share of the requirements, summed, that a search around a placement may close, as for the fewest sensors.
const NEARLY: f64 = super::search::NEARLY;

/// Evaluations of the search around a point where none are given.
pub const FRONT_EVALUATIONS: u64 = 40;

/// Placements that no other one found beats in all objectives together.
#[derive(Debug, Clone, PartialEq)]
pub struct Front {
    /// Objectives that are traded against each other.
    pub objectives: FrontObjectives,
    /// In the order of the first objective, the best first.
    pub points: Vec<FrontPoint>,
    /// Points that a decision may begin with: role, and number in [`Self::points`].
    pub picks: Vec<(Pick, usize)>,
    /// Placements to compare with, as they were given by [`Job::baselines`]: no points, and no search starts from them.
    /// One without a value of an objective is left out.
    pub baselines: Vec<FrontPoint>,
    /// Placements scored over all frames.
    pub scored: usize,
    /// True if every rig that there is was scored: few models on poses that are fixed. The cheapest that meets all
    /// requirements is then the cheapest of all.
    pub is_whole: bool,
    /// Why the search ended.
    pub stopped: FrontStopped,
    /// `cpu` or `gpu`; empty where nothing was scored.
    pub backend: String,
    /// Device as reported.
    pub adapter: String,
}

/// One placement of a front.
#[derive(Debug, Clone, PartialEq)]
pub struct FrontPoint {
    /// Name and poses.
    pub placement: Placement,
    /// Values of the objectives, in their order.
    pub values: Vec<f64>,
    /// Price of all sensors.
    pub price: f64,
    /// Sensors by mount, in words.
    pub equipment: String,
    /// True if all requirements are met, or there are none.
    pub meets: bool,
    /// Scores over all frames of the scene, or of all scenes.
    pub scores: Scores,
    /// Scores in each of several scenes and mirror images; empty where there is one.
    pub by_scene: Vec<SceneScores>,
}

/// Role of a point that a decision may begin with.
#[derive(Debug, Clone, PartialEq)]
pub enum Pick {
    /// The cheapest that meets all requirements.
    Cheapest,
    /// Farthest from the line or plane between the best of each objective, each axis scaled to [0, 1].
    Knee,
    /// The best of one objective.
    Best(FrontObjective),
}

impl fmt::Display for Pick {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cheapest => f.write_str("cheapest that meets all requirements"),
            Self::Knee => f.write_str("knee"),
            Self::Best(objective) => write!(f, "best {objective}"),
        }
    }
}

impl Serialize for Pick {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Why the search of a front ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrontStopped {
    /// All limits were looked at.
    Complete,
    /// The time was over.
    Time,
    /// The observer stopped it.
    Interrupted,
}

impl fmt::Display for FrontStopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Complete => "complete: sensors were chosen under every limit",
            Self::Time => {
                "time: the seconds given are over, and more may find other points; raise --max-seconds"
            }
            Self::Interrupted => "interrupted",
        })
    }
}

impl Job {
    /// The front of some objectives over the equipment of a vehicle and its poses.
    ///
    /// With [`Settings::evaluations`] above 0 a search of poses follows around each point of the front, and around
    /// cheap sensors that miss little of the requirements. Each has that many evaluations. Where no point then meets
    /// all requirements, two more searches follow: for the fewest sensors that do, as [`Self::fewest`], and for the
    /// best for all the money. Where one does and the price is an objective, the search for the fewest sensors follows with
    /// as many evaluations as each point has, so that the cheapest is not dearer than its result.
    ///
    /// Where rigs are few each of them is scored.
    ///
    /// A point that misses a requirement never takes the place of one that meets all. Sensors are chosen by gains. If
    /// the objectives name none, the job's own objective chooses them, or near gain.
    ///
    /// [`Settings::evaluations`]: crate::Settings::evaluations
    ///
    /// # Errors
    /// [`FrontError`] for objectives that the vehicle does not have; a budget below the cheapest sensors, settings that a
    /// scene does not allow, an engine that fails.
    pub fn front(
        &self,
        objectives: &FrontObjectives,
        observer: &mut dyn Observer,
    ) -> Result<Front, JobError> {
        self.front_from(objectives, &mut FrontState::default(), &mut |_| {}, observer)
    }

    /// Like [`Self::front`], going on from a state that an earlier search of the same job was in: the result has the bits of
    /// one that never stopped. `keep` is told the state whenever a part is finished.
    ///
    /// # Errors
    /// See [`Self::front`].
    pub fn front_from(
        &self,
        objectives: &FrontObjectives,
        state: &mut FrontState,
        keep: &mut dyn FnMut(&FrontState),
        observer: &mut dyn Observer,
    ) -> Result<Front, JobError> {
        self.check_front(objectives)?;
        let kept = &mut FrontProgress { state, tell: keep };
        let vehicle = self.scene().vehicle();
        let requires = vehicle.requires();
        let suite = self.suite()?;
        let own = &self.settings.objective;
        let own = if own.is_information_gain() { own.clone() } else { Objective::default() };
        let sweep = FrontSweep::new(objectives, vehicle, self.most_money(), requires, &own);
        let at = |share| self.settings.time.map(|time| time.start + time.length.mul_f64(share));
        let casts_until = at(CASTS_SHARE);
        let until = if self.settings.evaluations == 0 { casts_until } else { at(CHOICES_SHARE) };
        let casting = PoseCaster {
            sweep: &sweep,
            suite: &suite,
            vehicle,
            settings: &self.settings,
            casts_until,
            until,
        };
        let Swept { chosen, others, is_whole, mut end } = sweep.run(&casting, kept, observer)?;
        if chosen.is_empty() && end == End::Interrupted {
            return Ok(Front {
                objectives: objectives.clone(),
                points: Vec::new(),
                picks: Vec::new(),
                baselines: Vec::new(),
                scored: 0,
                is_whole: false,
                stopped: FrontStopped::Interrupted,
                backend: String::new(),
                adapter: String::new(),
            });
        }
        let mut pool = Pool::open(self, &suite, vehicle, objectives, observer)?;
        end = end.and(pool.add(chosen, others, end, observer)?);
        if self.settings.evaluations > 0 && end != End::Interrupted {
            end = end.and(pool.polish(kept, observer)?);
        }
        if requires && self.settings.evaluations > 0 && end == End::Done {
            end = pool.meet(is_whole, kept, observer)?;
        }
        pool.finish(requires, is_whole, end, observer)
    }

    /// Checks that the vehicle has prices and requirements where the objectives name them.
    ///
    /// # Errors
    /// [`FrontError`]: nothing to choose from, no prices, no requirements.
    pub(crate) fn check_front(&self, objectives: &FrontObjectives) -> Result<(), JobError> {
        let vehicle = self.scene().vehicle();
        let name = || vehicle.name.clone();
        let is_free = vehicle.sensors.iter().all(|sensor| sensor.price <= 0.0);
        if vehicle.is_nameless() {
            return Err(FrontError::NoVehicle.into());
        }
        if objectives.has(&FrontObjective::Price) && is_free {
            return Err(FrontError::NoPrices { vehicle: name() }.into());
        }
        if objectives.has(&FrontObjective::Requirements) && !vehicle.requires() {
            return Err(FrontError::NothingRequired { vehicle: name() }.into());
        }
        Ok(())
    }
}

impl End {
    /// The later of two ends, the stronger of both.
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (Self::Interrupted, _) | (_, Self::Interrupted) => Self::Interrupted,
            (Self::Time, _) | (_, Self::Time) => Self::Time,
            _ => Self::Done,
        }
    }
}

/// True once a limit of time is over.
fn is_over(time: Option<TimeLimit>) -> bool {
    time.is_some_and(|time| Instant::now() >= time.deadline())
}

/// Numbers of the picks in sorted points. Only points that meet all requirements are picked, if there are any.
fn picks(
    objectives: &FrontObjectives,
    points: &[FrontPoint],
    requires: bool,
) -> Vec<(Pick, usize)> {
    let standing = |point| Objectives::new(objectives, point);
    let standings: Vec<Objectives> = points.iter().map(standing).collect();
    let sensors = |k: usize| points[k].placement.lidars.len();
    let any_meets = points.iter().any(|point| point.meets);
    let among: Vec<usize> = (0..points.len()).filter(|&k| points[k].meets || !any_meets).collect();
    let cheapest = among.iter().copied().filter(|&k| requires && points[k].meets);
    let cheapest = cheapest.min_by(|&a, &b| {
        let by_price = points[a].price.total_cmp(&points[b].price);
        by_price.then(sensors(a).cmp(&sensors(b)))
    });
    let mut picks: Vec<(Pick, usize)> = cheapest.map(|k| (Pick::Cheapest, k)).into_iter().collect();
    let picked: Vec<Objectives> = among.iter().map(|&k| standings[k].clone()).collect();
    picks.extend(knee(&picked).map(|k| (Pick::Knee, among[k])));
    for (axis, objective) in objectives.all().iter().enumerate() {
        let value = |k: usize| standings[k].values[axis];
        let best = among.iter().copied().min_by(|&a, &b| value(a).total_cmp(&value(b)));
        picks.extend(best.map(|k| (Pick::Best(objective.clone()), k)));
    }
    picks
}
