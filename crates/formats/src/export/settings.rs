//! Settings that fix the bytes of a data set.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::ExportError;
use sightline_files::files::Input;

/// Format of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Layout {
    /// Sequences of SemanticKITTI.
    SemanticKitti,
    /// nuScenes v1.0 with lidarseg.
    Nuscenes,
    /// An archive of NumPy arrays a frame, with all that a scan knows.
    Npz,
}

impl Layout {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::SemanticKitti => "semantickitti",
            Self::Nuscenes => "nuscenes",
            Self::Npz => "npz",
        }
    }
}

impl FromStr for Layout {
    type Err = ExportError;

    fn from_str(name: &str) -> Result<Self, ExportError> {
        let all = [Self::SemanticKitti, Self::Nuscenes, Self::Npz];
        let found = all.into_iter().find(|layout| layout.name() == name);
        found.ok_or_else(|| ExportError::UnknownLayout { name: name.to_owned() })
    }
}

/// Split of a data set that a scene belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Training.
    Train,
    /// Validation.
    Val,
    /// Tests.
    Test,
}

impl Split {
    pub(super) const ALL: [Self; 3] = [Self::Train, Self::Val, Self::Test];

    /// Name in data sets.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Val => "val",
            Self::Test => "test",
        }
    }
}

/// Shares of the scenes that train, validate and test; only their ratio counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Splits {
    /// For training.
    pub train: f64,
    /// For validation.
    pub val: f64,
    /// For tests.
    pub test: f64,
}

impl Default for Splits {
    fn default() -> Self {
        Self { train: 0.8, val: 0.2, test: 0.0 }
    }
}

/// A scene that a data set is to hold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// Its name; no two are the same.
    pub name: String,
    /// Class names; the index is the class.
    pub classes: Vec<String>,
    /// Numbers of the frames to write, rising.
    pub frames: Vec<usize>,
    /// Split; `None` draws it by the shares and the seed.
    pub split: Option<Split>,
}

/// Settings that fix the bytes of a data set, together with the scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DatasetSettings {
    /// Format.
    pub layout: Layout,
    /// nuScenes: every n-th frame is a keyframe with boxes and labels, the others are sweeps.
    pub keyframe_every: usize,
    /// nuScenes: rows of six cameras without pictures, which mmdetection3d asks for.
    pub camera_stubs: bool,
    /// Each LiDAR by itself as well, beside all of them merged.
    pub each_lidar: bool,
    /// Shares of the scenes.
    pub splits: Splits,
    /// Seed of random draws: the split of each scene.
    pub seed: u64,
    /// Classes of the scenes that are to count as others, by name.
    pub map: Vec<(String, String)>,
    /// Every file that decides the scans: of the scenes, in their order, and of the vehicle. A folder is gone
    /// on with only where they are the same.
    #[serde(default)]
    pub files: Vec<Input>,
    /// All else that decides the scans, as text: command, placement, conditions. A folder is gone on with only
    /// where it is the same; of a JSON object the keys `scenes` and `vehicle`, paths as they were given, are
    /// recorded only.
    pub provenance: String,
}

impl DatasetSettings {
    /// Every fifth frame a keyframe, all LiDARs merged and each by itself, a fifth of the scenes to validate.
    pub fn new(layout: Layout) -> Self {
        Self {
            layout,
            keyframe_every: 5,
            camera_stubs: false,
            each_lidar: true,
            splits: Splits::default(),
            seed: 0,
            map: Vec::new(),
            files: Vec::new(),
            provenance: String::new(),
        }
    }
}
