//! Questions that studies answer.

use std::str::FromStr;

use super::{StudyError, StudySettings};

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
            "What a vehicle's sensors gain for their price, from the cheapest rig up to --budget (--vehicle)",
        ),
        (
            Self::Channels,
            "channels",
            "16 to 128 channels, elevations crowded at the horizon, and real sensors (--sensor): gain and near field",
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
}

impl Kind {
    /// True if a file of own placements may stand behind the scenes.
    pub fn takes_placements(self) -> bool {
        matches!(self, Self::Voxels | Self::Random | Self::Regions | Self::Loss | Self::Weather)
    }

    /// Refuses a budget where no sensors are chosen for it.
    ///
    /// # Errors
    /// A budget for a kind that searches nothing, or does not with own placements.
    pub(super) fn check_budget(self, settings: &StudySettings) -> Result<(), StudyError> {
        let is_given = !settings.placements.is_empty();
        let searches = match self {
            Self::Voxels | Self::Weather | Self::Published => false,
            Self::Regions | Self::Loss => !is_given,
            _ => true,
        };
        match settings.budget {
            Some(_) if !searches => Err(StudyError::NoSearch { kind: self.name() }),
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
