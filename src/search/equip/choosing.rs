//! The search for equipment on one coarse grid over all models and mounts, and how far it is.

use serde::{Deserialize, Serialize};

use super::equipped::Equipped;
use crate::engine::EngineChoice;
use crate::score::Objective;
use crate::search::atlases::Atlases;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::GridSearch;
use crate::search::observer::{Event, Watch, Work};
use crate::search::suite::Suite;
use crate::vehicle::{Constraints, MAX_LIDARS, Placement, PoseGrid, SensorName, Spacing, Vehicle};

/// Frames that the choice looks at, spread evenly.
pub(super) const FRAMES: u32 = 4;
/// Most poses of the grid, over all models and mounts.
const POSES: u32 = 1200;
/// Spacing of the grid to begin with; widened until the poses are few enough.
const SPACING: Spacing = Spacing { metres: 0.1, radians: 0.1 };
/// Factor by which a grid with too many poses is widened.
const WIDER: f64 = 1.25;
/// Worth of an area that must be seen, against the largest gain of a single sensor: what must be seen comes
/// first.
const REQUIRED: f64 = 1e3;
/// Most rounds of exchanges.
const ROUNDS: usize = 20;
/// Poses that are cast at once, so that progress is told in between.
const CAST: usize = 32;

/// A sensor on the grid.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Choice {
    pose: u32,
    mount: usize,
    sensor: SensorName,
}

/// How far a choice of equipment is: all that it goes on from, beside scenes, vehicle and budget. Poses are cast
/// anew.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Choosing {
    /// Poses at which climbs have ended: that of gain, then that of gain for the money.
    ends: Vec<Vec<u32>>,
    climb: Option<Climb>,
}

impl Choosing {
    /// Whether all of its poses are on a grid of so many.
    pub(super) fn fits(&self, poses: u32) -> bool {
        let climbing = self.climb.iter().map(|climb| &climb.poses);
        self.ends.iter().chain(climbing).flatten().all(|&pose| pose < poses)
    }
}

/// A climb by exchanges of single sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Climb {
    poses: Vec<u32>,
    /// Exchanges that have gained.
    round: usize,
    /// Sensor that is exchanged next.
    index: usize,
}

/// What a step of a choice gave.
#[derive(Debug, Clone, PartialEq)]
pub enum EquipStep {
    /// It goes on.
    On,
    /// The observer has stopped it.
    Stopped,
    /// The equipment.
    Done(Equipped),
}

/// The search for equipment.
pub(super) struct Equip<'a> {
    vehicle: &'a Vehicle,
    pub(super) budget: f64,
    grid: GridSearch,
    /// Mount and model of each kind of pose.
    kinds: Vec<(usize, SensorName)>,
    /// As of [`GridSearch::require`].
    penalty: f64,
}

/// Rules with a slot for each sensor that a mount could hold of each model, and mount and model by kind.
fn every_kind(vehicle: &Vehicle) -> (Constraints, Vec<(usize, SensorName)>) {
    let mounts = vehicle.mounts.iter().enumerate().filter(|(_, mount)| mount.count[1] > 0);
    let kinds: Vec<(usize, SensorName)> = mounts
        .flat_map(|(k, mount)| mount.sensors.iter().map(move |&sensor| (k, sensor)))
        .collect();
    let slots = kinds.iter().flat_map(|&kind| vec![kind; vehicle.mounts[kind.0].count[1]]);
    let constraints = vehicle.constraints(&slots.collect());
    // In the order in which the constraints have sorted them.
    let of_kind = constraints.kinds().into_iter().map(|(slot, _)| {
        let mount = vehicle.mounts.iter().position(|mount| mount.region == slot.region);
        (mount.unwrap_or(0), slot.sensor)
    });
    let kinds = of_kind.collect();
    (constraints, kinds)
}

impl<'a> Equip<'a> {
    pub(super) fn new(
        suite: &Suite,
        vehicle: &'a Vehicle,
        objective: &Objective,
        budget: f64,
        engine: &EngineChoice,
        watch: &mut Watch,
    ) -> Result<Option<Self>, SearchError> {
        let (constraints, kinds) = every_kind(vehicle);
        // What is chosen are models and mounts: the search that follows chooses phases.
        let constraints = constraints.without_phases();
        let suite = suite.over(&suite.spread(Some(FRAMES))).with_constraints(&constraints.untied());
        let mut spacing = SPACING;
        let grid = loop {
            let grid = PoseGrid::new(&constraints.untied(), spacing);
            match grid {
                Ok(grid) if grid.len() <= POSES.max(kinds.len() as u32) => break grid,
                Err(error) if spacing.metres > 100.0 => return Err(error.into()),
                _ => {
                    spacing.metres *= WIDER;
                    spacing.radians *= WIDER;
                }
            }
        };
        let memory = engine.memory_budget();
        let mut evaluator = Evaluator::suite_on_cpu(&suite, memory / 2);
        let all: Vec<u32> = (0..grid.len()).collect();
        let atlases = Atlases::new(&evaluator, &grid, false, memory / 2);
        let mut grid = GridSearch::new(atlases, objective.clone(), &evaluator);
        for (block, poses) in all.chunks(CAST).enumerate() {
            let (work, done, total) = (Work::Equipment, (block * CAST) as u64, all.len() as u64);
            if !watch.tell(&Event::Progress { work, done, total }) {
                return Ok(None);
            }
            grid.hold(&mut evaluator, poses)?;
        }
        let singles = grid.values_with(&[], &all);
        let most = singles.iter().map(|(_, value)| *value).fold(0.0, f64::max);
        let penalty = REQUIRED * most.max(1e-9);
        grid.require(penalty);
        Ok(Some(Self { vehicle, budget, grid, kinds, penalty }))
    }

    /// The equipment from the beginning; `None` where the observer stops the choice.
    pub(super) fn best(&mut self, watch: &mut Watch) -> Option<Equipped> {
        let mut state = Choosing::default();
        loop {
            match self.step(&mut state, watch) {
                EquipStep::On => {}
                EquipStep::Stopped => return None,
                EquipStep::Done(equipped) => return Some(equipped),
            }
        }
    }

    /// A climb from the equipment grown by gain, then one from that grown by gain for the money; the better end of
    /// them.
    pub(super) fn step(&mut self, state: &mut Choosing, watch: &mut Watch) -> EquipStep {
        if let Some(climb) = &mut state.climb {
            if climb.index < climb.poses.len() && climb.round < ROUNDS {
                let (work, done) = (Work::Exchanges, state.ends.len() * ROUNDS + climb.round);
                let (done, total) = (done as u64, 2 * ROUNDS as u64);
                if !watch.tell(&Event::Progress { work, done, total }) {
                    return EquipStep::Stopped;
                }
                self.exchange(climb);
            } else {
                state.ends.push(std::mem::take(&mut climb.poses));
                state.climb = None;
            }
            return EquipStep::On;
        }
        let grown = match state.ends.len() {
            0 => self.grown(Vec::new(), |gain, _| gain),
            1 => self.grown(Vec::new(), |gain, price| gain / price.max(1e-9)),
            _ => return EquipStep::Done(self.better(&state.ends)),
        };
        state.climb = Some(Climb { poses: Self::poses(&grown), round: 0, index: 0 });
        EquipStep::On
    }

    /// The better of two ends, the first of equal ones.
    fn better(&mut self, ends: &[Vec<u32>]) -> Equipped {
        let ends: Vec<Vec<Choice>> = ends.iter().map(|poses| self.choices(poses)).collect();
        let worths: Vec<f64> = ends.iter().map(|end| self.worth(end)).collect();
        let best = usize::from(worths[1] > worths[0]);
        self.equipped(&ends[best])
    }

    /// Sensors at poses of the grid.
    fn choices(&self, poses: &[u32]) -> Vec<Choice> {
        let choice = |&pose: &u32| {
            let (mount, sensor) = self.kinds[self.grid.atlas().grid().kind(pose)];
            Choice { pose, mount, sensor }
        };
        poses.iter().map(choice).collect()
    }

    /// Poses of the grid.
    pub(super) fn pose_count(&self) -> u32 {
        self.grid.atlas().grid().len()
    }

    fn poses(chosen: &[Choice]) -> Vec<u32> {
        chosen.iter().map(|choice| choice.pose).collect()
    }

    fn cost(&self, chosen: &[Choice]) -> f64 {
        chosen.iter().map(|choice| self.vehicle.price(choice.sensor)).sum()
    }

    /// Gain, less what is not seen of what must be, as one submodular number.
    fn worth(&mut self, chosen: &[Choice]) -> f64 {
        let poses = Self::poses(chosen);
        self.grid.held_value(&poses)
    }

    /// Sensors that may come beside those chosen: room on their mount, apart from the others, and money left
    /// for what other mounts must hold.
    fn candidates(&self, chosen: &[Choice]) -> Vec<Choice> {
        if chosen.len() >= MAX_LIDARS {
            return Vec::new();
        }
        let poses = Self::poses(chosen);
        let on = |mount: usize| chosen.iter().filter(|choice| choice.mount == mount).count();
        let spent = self.cost(chosen);
        let mut found = Vec::new();
        let cheapest = self.vehicle.cheapest();
        // What the mounts must hold beyond those chosen: its price, and how many sensors.
        let owed = |beside: usize| -> (f64, usize) {
            let mounts = self.vehicle.mounts.iter().enumerate();
            let owed = mounts.map(|(mount, of)| {
                let have = on(mount) + usize::from(mount == beside);
                let missing = of.count[0].saturating_sub(have);
                let price = cheapest.iter().find(|(k, _)| *k == mount);
                (
                    missing as f64 * price.map_or(0.0, |(_, sensor)| self.vehicle.price(*sensor)),
                    missing,
                )
            });
            owed.fold((0.0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
        };
        for pose in 0..self.grid.atlas().grid().len() {
            let (mount, sensor) = self.kinds[self.grid.atlas().grid().kind(pose)];
            let (reserve, sensors) = owed(mount);
            let price = self.vehicle.price(sensor);
            let affordable = spent + price + reserve <= self.budget * (1.0 + 1e-12);
            let has_room = on(mount) < self.vehicle.mounts[mount].count[1]
                && chosen.len() + 1 + sensors <= MAX_LIDARS;
            if affordable && has_room && self.grid.fits(pose, &poses) {
                found.push(Choice { pose, mount, sensor });
            }
        }
        found
    }

    /// The candidate with the largest rating of what it adds and its price.
    fn best_beside(
        &mut self,
        chosen: &[Choice],
        rating: impl Fn(f64, f64) -> f64,
    ) -> Option<(Choice, f64)> {
        let candidates = self.candidates(chosen);
        let (poses, before) = (Self::poses(chosen), self.worth(chosen));
        let values = self.grid.values_with(&poses, &Self::poses(&candidates));
        let of = |(choice, (_, value)): (Choice, (u32, f64))| {
            let added = value - before;
            (choice, rating(added, self.vehicle.price(choice.sensor)), added)
        };
        let rated = candidates.into_iter().zip(values).map(of);
        // Of equal ones the first.
        let best = rated.reduce(|best, other| if other.1 > best.1 { other } else { best });
        best.map(|(choice, _, added)| (choice, added))
    }

    /// Sensors added until none is left that adds anything, or that a mount must hold.
    fn grown(&mut self, mut chosen: Vec<Choice>, rating: impl Fn(f64, f64) -> f64) -> Vec<Choice> {
        while let Some((choice, added)) = self.best_beside(&chosen, &rating) {
            let must = self.vehicle.mounts.iter().enumerate().any(|(mount, of)| {
                chosen.iter().filter(|choice| choice.mount == mount).count() < of.count[0]
            });
            if added <= 0.0 && !must && !chosen.is_empty() {
                break;
            }
            chosen.push(choice);
        }
        chosen
    }

    /// Takes a climb's next sensor off and adds what gains most; kept where that gains.
    fn exchange(&mut self, climb: &mut Climb) {
        let chosen = self.choices(&climb.poses);
        let held = self.worth(&chosen);
        let mut without = chosen;
        without.remove(climb.index);
        let other = self.grown(without, |gain, _| gain);
        let worth = self.worth(&other);
        if worth > held * (1.0 + 1e-9) && self.keeps_counts(&other) {
            *climb = Climb { poses: Self::poses(&other), round: climb.round + 1, index: 0 };
        } else {
            climb.index += 1;
        }
    }

    fn keeps_counts(&self, chosen: &[Choice]) -> bool {
        let on = |mount: usize| chosen.iter().filter(|choice| choice.mount == mount).count();
        self.vehicle.mounts.iter().enumerate().all(|(k, mount)| on(k) >= mount.count[0])
    }

    fn equipped(&mut self, chosen: &[Choice]) -> Equipped {
        let mut sorted = chosen.to_vec();
        // The grid's order, which is that of the slots.
        sorted.sort_by_key(|choice| choice.pose);
        let poses = Self::poses(&sorted);
        let missing = self.grid.missing(&poses);
        // The objective alone.
        self.grid.require(0.0);
        let value = self.grid.held_value(&poses);
        self.grid.require(self.penalty);
        let grid = self.grid.atlas().grid();
        let lidars = poses.iter().map(|&pose| grid.pose(pose)).collect();
        Equipped {
            equipment: sorted.iter().map(|choice| (choice.mount, choice.sensor)).collect(),
            placement: Placement { name: "equipped".into(), lidars },
            cost: self.cost(chosen),
            value,
            missing,
        }
    }
}
