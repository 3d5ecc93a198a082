//! Settings of a study.

use std::path::PathBuf;
use std::str::FromStr;

use super::regions::Subregion;
use crate::engine::EngineChoice;
use crate::job::JobError;
use crate::scan::conditions::Condition;
use crate::score::{Objective, ObjectiveError};
use crate::vehicle::Placement;

/// Settings of a study: with its scenes they decide about every number.
#[derive(Debug, Clone)]
pub struct StudySettings {
    /// Score that searches maximize.
    pub objective: Objective,
    /// Placements that each search evaluates before swaps.
    pub evaluations: u64,
    /// Frames to average over, spread evenly over the scene.
    pub frames: u32,
    /// Random placements, where the study draws some.
    pub random: u32,
    /// Edge of a voxel in metres, for [`Kind::Published`](super::Kind::Published).
    pub voxel: f64,
    /// Seed of all randomness.
    pub seed: u64,
    /// Sensor files to compare beside the channels.
    pub sensors: Vec<PathBuf>,
    /// Regions to look at beside the standard ones.
    pub regions: Vec<Subregion>,
    /// Own rigs to look at, for kinds that [take some](super::Kind::takes_placements), in place of placements that are
    /// searched and of the layouts of the paper.
    pub placements: Vec<Placement>,
    /// Most that the sensors of a placement that is searched may cost, in the currency of the vehicle's prices; `None`
    /// sets no limit.
    pub budget: Option<f64>,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
    /// Engine that computes; every engine gives the same bits.
    pub engine: EngineChoice,
}

impl Default for StudySettings {
    fn default() -> Self {
        Self {
            objective: Objective::default(),
            evaluations: 120,
            frames: 2,
            random: 200,
            voxel: 0.1,
            seed: 1,
            sensors: Vec::new(),
            regions: Vec::new(),
            placements: Vec::new(),
            budget: None,
            conditions: Vec::new(),
            engine: EngineChoice::cpu(),
        }
    }
}

/// Question of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// One to eight LiDARs.
    Lidars,
    /// Gain of a vehicle's sensors for their price.
    Cost,
    /// Numbers of channels, and real sensors.
    Channels,
    /// Voxel sizes.
    Voxels,
    /// Random placements against hand-made ones and an optimized one.
    Random,
    /// Segmentation against detection.
    Tasks,
    /// Heights of all LiDARs.
    Height,
    /// Parts of the region, and classes.
    Regions,
    /// The loss of one LiDAR.
    Loss,
    /// Own rigs in fog, snow and rain.
    Weather,
    /// Placements on other scenes.
    Transfer,
    /// Scores against published results.
    Published,
}

impl Kind {
    /// Every kind, its name, and its cases.
    pub const ALL: [(Self, &str, &str); 12] = [
        (
            Self::Lidars,
            "lidars",
            "One to eight LiDARs, as far as the mounts hold them: the best rig of each number, marginal gains, the knee",
        ),
        (
            Self::Cost,
            "cost",
            "Gain of a vehicle's sensors for their price, from the cheapest rig up to --budget (--vehicle)",
        ),
        (
            Self::Channels,
            "channels",
            "16 to 128 channels, elevations crowded at the horizon, and real sensors (--sensor-file): gain and near field",
        ),
        (Self::Voxels, "voxels", "Own rigs ranked at the four voxel sizes of the paper"),
        (Self::Random, "random", "Random placements against own rigs and an optimized one"),
        (
            Self::Tasks,
            "tasks",
            "One placement for two tasks: weights between segmentation and detection",
        ),
        (Self::Height, "height", "All LiDARs at one height, against free heights"),
        (
            Self::Regions,
            "regions",
            "Own rigs, else an optimized one: near, middle and far; front, side and rear; any --box; every class",
        ),
        (
            Self::Loss,
            "loss",
            "Each LiDAR lost in turn: of own rigs (a file of placements) requirements that fail and blind sectors, else the placement that is best after the worst loss",
        ),
        (
            Self::Weather,
            "weather",
            "Own rigs in clear air and under each --condition (else fog, snow, rain): scores, requirements, a car ahead",
        ),
        (Self::Transfer, "transfer", "A placement optimized on one scene, scored on the others"),
        (
            Self::Published,
            "published",
            "Every score of the eight published placements against the published results",
        ),
    ];

    /// The name that selects it on the command line.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(kind, ..)| *kind == self);
        found.map_or("", |(_, name, _)| name)
    }

    /// True if a file of own placements may stand behind the scenes.
    pub fn takes_placements(self) -> bool {
        matches!(self, Self::Voxels | Self::Random | Self::Regions | Self::Loss | Self::Weather)
    }

    /// True if placements are searched; `is_given` tells whether own ones are there.
    pub fn searches(self, is_given: bool) -> bool {
        match self {
            Self::Voxels | Self::Weather | Self::Published => false,
            Self::Regions | Self::Loss => !is_given,
            _ => true,
        }
    }

    /// Refuses a budget where no sensors are chosen for it.
    ///
    /// # Errors
    /// A budget for a kind that searches nothing, or does not with own placements.
    pub(super) fn check_budget(self, settings: &StudySettings) -> Result<(), StudyError> {
        match settings.budget {
            Some(_) if !self.searches(!settings.placements.is_empty()) => {
                Err(StudyError::NoSearch { kind: self.name() })
            }
            _ => Ok(()),
        }
    }

    /// Refuses a number of scenes that this kind cannot take.
    ///
    /// # Errors
    /// Fewer than two for [`Kind::Transfer`], other than one for the others.
    pub fn check_scenes(self, given: usize) -> Result<(), StudyError> {
        match (self, given) {
            (Self::Transfer, 0 | 1) => Err(StudyError::SeveralScenes),
            (Self::Transfer, _) | (_, 1) => Ok(()),
            (kind, given) => Err(StudyError::OneScene { kind: kind.name(), given }),
        }
    }
}

impl FromStr for Kind {
    type Err = StudyError;

    fn from_str(name: &str) -> Result<Self, StudyError> {
        let found = Self::ALL.iter().find(|(_, known, _)| *known == name);
        found.map(|(kind, ..)| *kind).ok_or_else(|| StudyError::NoKind {
            name: name.to_owned(),
            known: Self::ALL.map(|(_, name, _)| name).join(", "),
        })
    }
}

/// Why a study cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum StudyError {
    /// A study of prices of a scene without a vehicle.
    #[error("{scene}: has no vehicle, so no prices; give one with --vehicle")]
    NoVehicle { scene: String },
    /// A budget where nothing is searched.
    #[error(
        "`study {kind}` looks at placements that are there and chooses no sensors; leave --budget out"
    )]
    NoSearch { kind: &'static str },
    /// No placement to look at.
    #[error(
        "{scene}: the vehicle is not the paper's car, whose layouts are looked at by default; give a file of placements \
         behind the scenes"
    )]
    NoPlacements { scene: String },
    /// No study of that name.
    #[error("`{name}` is no study; there are {known}")]
    NoKind { name: String, known: String },
    /// Several scenes for a study of one.
    #[error("`study {kind}` takes one scene, not {given}; only `transfer` compares several")]
    OneScene { kind: &'static str, given: usize },
    /// One scene for a study of several.
    #[error("`study transfer` compares scenes; name two or more scene files")]
    SeveralScenes,
    /// An objective of a task that the scene does not have.
    #[error(
        "{scene}: the objective `{objective}` needs a detection target; name its classes under \
         `detection` in the scene"
    )]
    NoDetection { scene: String, objective: String },
    /// Two tasks of a scene that has one.
    #[error("{scene}: has no detection target; name its classes under `detection` in the scene")]
    OneTask { scene: String },
    /// Other voxels of a P-SOG that is a file.
    #[error(
        "{scene}: its P-SOG is a file, which has voxels of one size; a scene with geometry can be \
         scanned again"
    )]
    FixedVoxels { scene: String },
    /// Channels of a sensor that is a list of directions.
    #[error("{scene}: no LiDAR of the rig has channels to vary; each is a list of directions")]
    NoChannels { scene: String },
    /// Heights of a vehicle whose mounts have their own.
    #[error(
        "{scene}: `study height` puts all LiDARs at one height, and the vehicle has {mounts}; give a vehicle with one mount \
         that is a box"
    )]
    NoHeights { scene: String, mounts: String },
    /// The paper's layouts with sensors of another vehicle.
    #[error(
        "{scene}: `study published` compares scores of the paper's car and LiDAR with the paper's results; leave --vehicle out, \
         or give a scene with `lidar` and `mount`"
    )]
    OtherVehicle { scene: String },
    /// The loss of the only LiDAR.
    #[error("{scene}: its mount has one LiDAR; without it nothing is left to score")]
    OneLidar { scene: String },
    /// Two cases of one name, which would share their numbers.
    #[error("two {cases} are called `{name}`; {mend}")]
    SameName { cases: &'static str, name: String, mend: &'static str },
    /// A box with the name of a region that every study of regions has.
    #[error(
        "`{name}` is a built-in region; choose another name for the --box; see `sightline study regions --help`"
    )]
    BuiltInRegion { name: String },
    /// The observer wanted to stop.
    #[error("stopped")]
    Stopped,
    /// A job, or a part of it, that cannot be posed, scored or searched.
    #[error(transparent)]
    Job(JobError),
    /// An objective that cannot be read.
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
}

impl<E> From<E> for StudyError
where
    JobError: From<E>,
{
    fn from(error: E) -> Self {
        Self::Job(error.into())
    }
}
