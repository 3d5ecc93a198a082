//! Questions that take many runs: how many LiDARs, which sensor, what if one fails.
//!
//! | file | holds |
//! |---|---|
//! | `scene` | problems, searches and scores of one scene, shared by its cases |
//! | `cases` | the cases, measured once and kept by name; the observer |
//! | `table` | the result |
//! | `lidars`, `sensors`, `height` | how many LiDARs, of which kind, how high |
//! | `random`, `tasks`, `regions`, `loss` | placements of one scene against each other |
//! | `voxels`, `transfer`, `published` | other voxels, other scenes, the published results |

mod cases;
mod columns;
mod error;
mod height;
mod lidars;
mod loss;
mod published;
mod random;
mod regions;
mod scene;
mod sensors;
mod table;
mod tasks;
mod transfer;
mod voxels;

use std::path::PathBuf;
use std::str::FromStr;

use crate::engine::EngineChoice;
use crate::psog::Psog;
use crate::scene::Scene;
use crate::score::Objective;

pub use cases::StudyObserver;
pub use error::StudyError;
pub use regions::Region;
pub use table::{Drawing, Row, Table};

use cases::Cases;
use scene::StudyScene;

/// Question of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// One to eight LiDARs.
    Lidars,
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
    /// Placements on other scenes.
    Transfer,
    /// Scores against published results.
    Published,
}

impl Kind {
    /// Every kind, its name, and its cases.
    pub const ALL: [(Self, &str, &str); 10] = [
        (
            Self::Lidars,
            "lidars",
            "One to eight LiDARs: the best placement of each number, marginal gains, the knee",
        ),
        (Self::Channels, "channels", "16 to 128 channels, and real sensors (--sensor)"),
        (Self::Voxels, "voxels", "The four voxel sizes of the paper with the layouts of Table 7"),
        (Self::Random, "random", "Random placements against hand-made ones and an optimized one"),
        (
            Self::Tasks,
            "tasks",
            "One placement for two tasks: weights between segmentation and detection",
        ),
        (Self::Height, "height", "All LiDARs at one height, against free heights"),
        (
            Self::Regions,
            "regions",
            "Near, middle and far; front, side and rear; any --box; every class",
        ),
        (
            Self::Loss,
            "loss",
            "Each LiDAR lost in turn, and the placement that is best after the worst loss",
        ),
        (Self::Transfer, "transfer", "A placement optimized on one scene, scored on the others"),
        (
            Self::Published,
            "published",
            "Every score of the eight published placements against the published results",
        ),
    ];

    /// The name by which it is asked for.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(kind, ..)| *kind == self);
        found.map_or("", |(_, name, _)| name)
    }
}

impl Kind {
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
        found.map(|(kind, ..)| *kind).ok_or_else(|| StudyError::NoKind { name: name.to_owned() })
    }
}

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
    /// Edge of a voxel in metres, for [`Kind::Published`].
    pub voxel: f64,
    /// Seed of all randomness.
    pub seed: u64,
    /// Sensor files to compare beside the channels.
    pub sensors: Vec<PathBuf>,
    /// Regions to look at beside the standard ones.
    pub regions: Vec<Region>,
    /// Which engine computes; every engine gives the same bits.
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
            engine: EngineChoice::cpu(),
        }
    }
}

/// Makes a study of scenes, each with its P-SOG: several for [`Kind::Transfer`], one for all others.
///
/// `known` holds the rows of an interrupted study of the same settings and scenes, and gets those that
/// are measured: it is all that an interrupted study needs to go on. The table holds the cases there are
/// when the observer says stop.
///
/// # Errors
/// Scenes or settings that do not fit the kind, or from searching and scoring.
pub fn study(
    kind: Kind,
    scenes: &[(&Scene, &Psog)],
    settings: &StudySettings,
    known: &mut Vec<Row>,
    observer: &dyn StudyObserver,
) -> Result<Table, StudyError> {
    kind.check_scenes(scenes.len())?;
    let scenes: Vec<StudyScene> = scenes
        .iter()
        .map(|(scene, psog)| StudyScene::new(scene, psog, settings, observer))
        .collect::<Result<_, _>>()?;
    let mut cases = Cases::new(known, observer);
    let one = &scenes[0];
    let cases = &mut cases;
    match kind {
        Kind::Lidars => lidars::lidars(one, cases),
        Kind::Channels => sensors::channels(one, cases),
        Kind::Voxels => voxels::voxels(one, cases),
        Kind::Random => random::random(one, cases),
        Kind::Tasks => tasks::tasks(one, cases),
        Kind::Height => height::height(one, cases),
        Kind::Regions => regions::regions(one, cases),
        Kind::Loss => loss::loss(one, cases),
        Kind::Transfer => transfer::transfer(&scenes, cases),
        Kind::Published => published::published(one, cases),
    }
}
