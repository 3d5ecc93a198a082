//! The search for equipment on one coarse grid over all models and mounts, and how far it is.

mod candidates;
mod few;

use serde::{Deserialize, Serialize};

use super::equipped::{Equipped, EveryRig, Limits};
use crate::engine::{BackendError, EngineChoice};
use crate::score::Objective;
use crate::search::atlases::Atlases;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::{GridSearch, Places};
use crate::search::observer::{Event, Watch, Work};
use crate::search::suite::Suite;
use crate::targets::{CAR_WEIGHT, OutOfReach};
use crate::vehicle::{
    Constraints, Equipment, MAX_LIDARS, Placement, PoseGrid, SensorName, Spacing, Ties, Vehicle,
    is_within_budget,
};

/// Frames that the choice looks at, spread evenly.
pub(super) const FRAMES: u32 = 4;
/// Most poses of the grid, over all models and mounts, but where both ends of every field are more.
const POSES: u32 = 1200;
/// Metres between poses from which on the grid is widened no more: all mounts are shorter.
const WIDEST: f64 = 100.0;
/// Spacing of the grid to begin with; widened until the poses are few enough.
const SPACING: Spacing = Spacing { metres: 0.1, radians: 0.1 };
/// Factor by which a grid with too many poses is widened.
const WIDER: f64 = 1.25;
/// Penalty for a missing share of 1, as a multiple of the largest gain of a single sensor: requirements come
/// first.
pub(crate) const REQUIRED: f64 = 1e3;
/// Most rounds of exchanges.
const ROUNDS: usize = 20;
/// Poses cast at once; progress is reported in between.
const CAST: usize = 32;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Choice {
    pose: u32,
    mount: usize,
    sensor: SensorName,
}

fn count_on<'a>(mount: usize, chosen: impl IntoIterator<Item = &'a Choice>) -> usize {
    chosen.into_iter().filter(|choice| choice.mount == mount).count()
}

/// Sensors added together: one, and its mirror image where the rules want pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SensorGroup {
    one: Choice,
    image: Option<Choice>,
}

impl SensorGroup {
    fn choices(&self) -> impl Iterator<Item = Choice> + use<> {
        std::iter::once(self.one).chain(self.image)
    }

    /// Sensors on a mount among those chosen and the group.
    fn count_on(&self, mount: usize, chosen: &[Choice]) -> usize {
        count_on(mount, chosen.iter().chain([&self.one]).chain(&self.image))
    }
}

/// Checkpoint of a choice of equipment, for one set of scenes, vehicle and budget. Poses are cast anew.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Choosing {
    /// Poses of the grid that the numbers below are of.
    #[serde(default)]
    grid: u32,
    /// Poses at which climbs have ended: the climb by gain, then the climb by gain for the money.
    ends: Vec<Vec<u32>>,
    climb: Option<Climb>,
}

impl Choosing {
    /// A choice at its beginning, on a grid of `poses` poses.
    pub(super) fn on_grid(poses: u32) -> Self {
        Self { grid: poses, ..Self::default() }
    }

    /// True if the state was saved on a grid of `poses` poses, and each end is a rig on it.
    pub(super) fn fits(&self, poses: u32) -> bool {
        let climbing = self.climb.iter().map(|climb| &climb.poses);
        let is_rig = |end: &Vec<u32>| {
            (1..=MAX_LIDARS).contains(&end.len()) && end.iter().all(|&pose| pose < poses)
        };
        self.grid == poses && self.ends.len() <= 2 && self.ends.iter().chain(climbing).all(is_rig)
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Climb {
    poses: Vec<u32>,
    /// Exchanges that have gained.
    round: usize,
    /// Sensor that is exchanged next.
    index: usize,
}

/// Result of one step of a choice.
#[derive(Debug, Clone, PartialEq)]
pub enum EquipStep {
    /// There is more to do: take another step.
    On,
    /// The observer has stopped it.
    Stopped,
    /// Its time is over; the best equipment so far.
    OutOfTime(Equipped),
    /// The equipment.
    Done(Equipped),
}

pub(super) enum Opened {
    /// The search, all poses cast.
    Open(Box<Equip>),
    /// The observer has stopped it.
    Stopped,
    /// Its time was over before all poses were cast.
    OutOfTime,
}

pub(super) struct Equip {
    vehicle: Vehicle,
    /// Most that the sensors may cost, and most sensors.
    pub(super) limits: Limits,
    grid: GridSearch,
    /// Positions and kinds of the grid's poses.
    places: Places,
    /// Mount and model of each kind of pose.
    kinds: Vec<(usize, SensorName)>,
    /// See [`GridSearch::require`].
    penalty: f64,
    /// Requirements that no rig on the grid meets, in words.
    out_of_reach: Vec<OutOfReach>,
    /// True if sensors come in mirrored pairs; an odd one of a kind lies in the plane of symmetry.
    in_pairs: bool,
}

/// Reports the finished rounds of exchanges; false where the choice is to end.
fn tell(watch: &mut Watch, done: usize) -> bool {
    let (work, done, total) = (Work::Exchanges, done as u64, 2 * ROUNDS as u64);
    watch.tell(&Event::Progress { work, done, total })
}

/// Rules with a slot for every sensor that a mount could hold, of each model; mount and model of each kind.
fn every_kind(vehicle: &Vehicle) -> (Constraints, Vec<(usize, SensorName)>) {
    let constraints = vehicle.every_kind();
    // Kinds in the order in which the constraints have sorted them.
    let of_kind = constraints.kinds().into_iter().map(|(slot, _)| {
        let mount = vehicle.mounts.iter().position(|mount| mount.region == slot.region);
        (mount.unwrap_or(0), slot.sensor)
    });
    let kinds = of_kind.collect();
    (constraints, kinds)
}

/// The grid of a choice, widened until its poses are few enough; with a note where both ends of every pose field are more.
fn grid_of_choice(constraints: &Constraints, watch: &mut Watch) -> Result<PoseGrid, SearchError> {
    // The mirror image of a pose is on the grid where pairs are wanted.
    let ties = Ties { equal_height: false, ..constraints.ties };
    let (constraints, mut spacing) = (Constraints { ties, ..constraints.clone() }, SPACING);
    loop {
        let is_widest = spacing.metres > WIDEST;
        match PoseGrid::with_both_ends(&constraints, spacing) {
            Ok(grid) if grid.len() <= POSES => return Ok(grid),
            Ok(grid) if is_widest => {
                watch.note(&format!(
                    "sensors are chosen among {} poses, both ends of every pose field alone: mounts and models are too many \
                     for a finer grid of {POSES} poses",
                    grid.len()
                ));
                return Ok(grid);
            }
            Err(error) if is_widest => return Err(error.into()),
            _ => {
                spacing.metres *= WIDER;
                spacing.radians *= WIDER;
            }
        }
    }
}

/// Requirements that no rig on the grid meets, all of whose poses are held, in words.
fn out_of_reach(
    vehicle: &Vehicle,
    kinds: &[(usize, SensorName)],
    grid: &GridSearch,
) -> Vec<OutOfReach> {
    let poses = grid.atlas().grid();
    let on =
        |mount: usize| (0..poses.len()).filter(move |&pose| kinds[poses.kind(pose)].0 == mount);
    let mounts = vehicle.mounts.iter().enumerate();
    let mounts = mounts.map(|(k, mount)| (mount.count, on(k).collect()));
    grid.atlas.out_of_reach(&mounts.collect::<Vec<_>>())
}

impl Equip {
    pub(super) fn open(
        suite: &Suite,
        vehicle: &Vehicle,
        objective: &Objective,
        limits: Limits,
        engine: &EngineChoice,
        watch: &mut Watch,
    ) -> Result<Opened, SearchError> {
        let (vehicle, (constraints, kinds)) = (vehicle.clone(), every_kind(vehicle));
        // The choice is between models and mounts: phases are left to the search that follows.
        let constraints = constraints.without_phases();
        let suite = suite
            .over(&suite.spread(Some(FRAMES)))
            .for_search()
            .with_equipment(&constraints.untied());
        let grid = grid_of_choice(&constraints, watch)?;
        let memory = engine.memory_budget();
        let mut evaluator = Evaluator::suite_on_cpu(&suite, memory / 2).watching_cars(objective);
        let all: Vec<u32> = (0..grid.len()).collect();
        let atlases = Atlases::new(&evaluator, &grid, objective.needed(), memory / 2);
        if all.len() > atlases.capacity() {
            let page = atlases.page_bytes() as u64;
            let (need, limit) = (page * all.len() as u64, page * atlases.capacity() as u64);
            let what = "the sensor poses that equipment is chosen from";
            return Err(BackendError::TooLarge { what, need, limit }.into());
        }
        let mut grid = GridSearch::new(atlases, objective.clone(), &evaluator);
        for (block, poses) in all.chunks(CAST).enumerate() {
            let (work, done, total) = (Work::Equipment, (block * CAST) as u64, all.len() as u64);
            if !watch.tell(&Event::Progress { work, done, total }) {
                return Ok(match watch.interrupted {
                    true => Opened::Stopped,
                    false => Opened::OutOfTime,
                });
            }
            grid.hold(&mut evaluator, poses)?;
        }
        let (in_pairs, places, penalty) = (constraints.ties.symmetric, grid.places(), 0.0);
        let out_of_reach = out_of_reach(&vehicle, &kinds, &grid);
        let told = out_of_reach.iter().map(|of| format!("OUT OF REACH: {}", of.words));
        told.for_each(|words| watch.note(&words));
        if !out_of_reach.is_empty() {
            watch.note("the search goes on to come as near as it can; it may end here and the vehicle be changed first");
        }
        let mut search =
            Self { vehicle, limits, grid, places, kinds, penalty, out_of_reach, in_pairs };
        search.aim(objective, REQUIRED);
        Ok(Opened::Open(Box::new(search)))
    }

    /// Chooses by another objective from now on, whose sums the poses hold; `required` is the penalty for a missing share
    /// of 1, as a multiple of the largest gain of a single sensor.
    pub(super) fn aim(&mut self, objective: &Objective, required: f64) {
        self.grid.objective = objective.clone();
        self.grid.require(0.0);
        self.grid.watch_cars(0.0);
        let all: Vec<u32> = (0..self.pose_count()).collect();
        let singles = self.grid.values_with(&[], &all);
        let most = singles.iter().map(|(_, value)| *value).fold(0.0, f64::max);
        self.penalty = required * most.max(1e-9);
        self.grid.require(self.penalty);
        self.grid.watch_cars(CAR_WEIGHT);
    }

    /// The equipment from the beginning; `None` where the observer stops the choice.
    pub(super) fn best(&mut self, watch: &mut Watch) -> Option<Equipped> {
        let mut state = Choosing::default();
        loop {
            match self.step(&mut state, watch) {
                EquipStep::On => {}
                EquipStep::Stopped => return None,
                EquipStep::Done(equipped) | EquipStep::OutOfTime(equipped) => {
                    return Some(equipped);
                }
            }
        }
    }

    /// A climb from the equipment grown by gain, then one from that grown by gain for the money; the better end of
    /// them, or the best of all rigs where they are few.
    pub(super) fn step(&mut self, state: &mut Choosing, watch: &mut Watch) -> EquipStep {
        if let Some(climb) = &mut state.climb {
            if climb.index < climb.poses.len() && climb.round < ROUNDS {
                let done = state.ends.len() * ROUNDS + climb.round;
                if !tell(watch, done) || !self.exchange(climb, done, watch) {
                    return self.cut(state, Vec::new(), watch);
                }
            } else {
                state.ends.push(std::mem::take(&mut climb.poses));
                state.climb = None;
            }
            return EquipStep::On;
        }
        let grown = match state.ends.len() {
            0 => self.grown(Vec::new(), |gain, _| gain, 0, watch),
            1 => self.grown(Vec::new(), |gain, price| gain / price.max(1e-9), ROUNDS, watch),
            _ => {
                let few = self.best_of_few(watch);
                let ends: Vec<Vec<u32>> = state.ends.iter().cloned().chain(few).collect();
                return EquipStep::Done(self.better(&ends));
            }
        };
        if watch.is_over() {
            return self.cut(state, grown, watch);
        }
        state.climb = Some(Climb { poses: Self::poses(&grown), round: 0, index: 0 });
        EquipStep::On
    }

    /// The best rig of some ends, the first of equal ones; no sensors where none of them is a rig.
    fn better(&mut self, ends: &[Vec<u32>]) -> Equipped {
        let ends = ends.iter().map(|poses| self.choices(poses));
        let ends: Vec<Vec<Choice>> = ends.filter(|end| self.is_rig(end)).collect();
        let worths: Vec<f64> = ends.iter().map(|end| self.worth(end)).collect();
        let best = (0..ends.len()).reduce(|a, b| if worths[b] > worths[a] { b } else { a });
        self.equipped(best.map_or(&[], |best| &ends[best]))
    }

    /// Ends a choice early: without a result after Ctrl-C, with the best equipment so far where the time is over.
    fn cut(&mut self, state: &Choosing, grown: Vec<Choice>, watch: &mut Watch) -> EquipStep {
        if watch.interrupted {
            return EquipStep::Stopped;
        }
        let mut ends = state.ends.clone();
        ends.extend(state.climb.iter().map(|climb| climb.poses.clone()));
        ends.push(Self::poses(&self.filled(grown)));
        EquipStep::OutOfTime(self.better(&ends))
    }

    /// `chosen`, and for mounts that must hold more the cheapest sensors that fit; the cheapest of all where no mount
    /// must hold any and nothing is chosen.
    fn filled(&self, mut chosen: Vec<Choice>) -> Vec<Choice> {
        let all_may_be_empty = self.vehicle.mounts.iter().all(|mount| mount.count[0] == 0);
        while !self.is_rig(&chosen) {
            let lacks = |mount: usize| {
                all_may_be_empty || count_on(mount, &chosen) < self.vehicle.mounts[mount].count[0]
            };
            let candidates = self.candidates(&chosen).into_iter();
            let next = candidates.filter(|group| group.choices().any(|one| lacks(one.mount)));
            let price = |group: &SensorGroup| self.cost(group.choices());
            let Some(next) = next.min_by(|a, b| price(a).total_cmp(&price(b))) else { break };
            chosen.extend(next.choices());
        }
        chosen
    }

    fn choices(&self, poses: &[u32]) -> Vec<Choice> {
        poses.iter().map(|&pose| self.choice(pose)).collect()
    }

    fn choice(&self, pose: u32) -> Choice {
        let (mount, sensor) = self.kinds[self.grid.atlas().grid().kind(pose)];
        Choice { pose, mount, sensor }
    }

    /// The mirror image of a pose where pairs are wanted; the pose itself in the plane of symmetry.
    fn image(&self, pose: u32) -> Option<u32> {
        self.in_pairs.then(|| self.grid.atlas().grid().mirrored(pose))
    }

    pub(super) fn pose_count(&self) -> u32 {
        self.grid.atlas().grid().len()
    }

    fn poses(chosen: &[Choice]) -> Vec<u32> {
        chosen.iter().map(|choice| choice.pose).collect()
    }

    fn cost(&self, chosen: impl IntoIterator<Item = Choice>) -> f64 {
        self.vehicle.price_of(chosen.into_iter().map(|choice| choice.sensor))
    }

    /// Gain less the penalties for missing requirements, as one submodular number.
    fn worth(&mut self, chosen: &[Choice]) -> f64 {
        let poses = Self::poses(chosen);
        self.grid.held_value(&poses)
    }

    /// Adds sensors until no mount lacks one and none adds anything; stops early where the watch is over.
    fn grown(
        &mut self,
        mut chosen: Vec<Choice>,
        rating: impl Fn(f64, f64) -> f64,
        done: usize,
        watch: &mut Watch,
    ) -> Vec<Choice> {
        while tell(watch, done)
            && let Some((group, added)) = self.best_beside(&chosen, &rating)
        {
            let mut mounts = self.vehicle.mounts.iter().enumerate();
            let must = mounts.any(|(mount, of)| count_on(mount, &chosen) < of.count[0]);
            if added <= 0.0 && !must && !chosen.is_empty() {
                break;
            }
            chosen.extend(group.choices());
        }
        chosen
    }

    /// Takes a climb's next sensor off, with its image, and refills by gain; keeps the change if the worth grows. False
    /// where the watch is over before that; the climb is then unchanged.
    fn exchange(&mut self, climb: &mut Climb, done: usize, watch: &mut Watch) -> bool {
        let chosen = self.choices(&climb.poses);
        let held = self.worth(&chosen);
        let off = chosen[climb.index].pose;
        let image = self.image(off);
        let mut without = chosen;
        without.retain(|choice| choice.pose != off && Some(choice.pose) != image);
        let other = self.grown(without, |gain, _| gain, done, watch);
        if watch.is_over() {
            return false;
        }
        let worth = self.worth(&other);
        if worth > held * (1.0 + 1e-9) && self.is_rig(&other) {
            *climb = Climb { poses: Self::poses(&other), round: climb.round + 1, index: 0 };
        } else {
            climb.index += 1;
        }
        true
    }

    /// True if there is a sensor, and each mount holds at least the least count that it may.
    fn is_rig(&self, chosen: &[Choice]) -> bool {
        let mut mounts = self.vehicle.mounts.iter().enumerate();
        let holds = |count: [usize; 2], on: usize| (count[0]..=count[1]).contains(&on);
        !chosen.is_empty() && mounts.all(|(k, mount)| holds(mount.count, count_on(k, chosen)))
    }

    fn equipped(&mut self, chosen: &[Choice]) -> Equipped {
        let mut sorted = chosen.to_vec();
        // The grid's order, which is that of the slots.
        sorted.sort_by_key(|choice| choice.pose);
        let poses = Self::poses(&sorted);
        let missing = self.grid.missing(&poses);
        // Value without penalties.
        self.grid.require(0.0);
        self.grid.watch_cars(0.0);
        let value = self.grid.held_value(&poses);
        self.grid.require(self.penalty);
        self.grid.watch_cars(CAR_WEIGHT);
        let grid = self.grid.atlas().grid();
        let lidars = poses.iter().map(|&pose| grid.pose(pose)).collect();
        Equipped {
            equipment: sorted.iter().map(|choice| (choice.mount, choice.sensor)).collect(),
            placement: Placement { name: "equipped".into(), lidars },
            cost: self.cost(chosen.iter().copied()),
            value,
            missing,
            out_of_reach: self.out_of_reach.iter().map(|of| of.words.clone()).collect(),
            ceilings: self.out_of_reach.iter().map(|of| of.share).collect(),
            is_cut: false,
        }
    }
}
