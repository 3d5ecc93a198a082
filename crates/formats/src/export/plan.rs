//! Settings that fix the bytes of a data set, and the split and name that they give each scene.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::ExportError;
use super::folder::{ABOUT, INCOMPLETE};
use super::nuscenes::scene_names;
use lidar_cast::maths::mixed;
use sightline_files::files::{Input, safe_name};

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

/// Numbers of sequences that every loader of SemanticKITTI takes for training, validation and tests.
const SEQUENCES: [&[usize]; 3] =
    [&[0, 1, 2, 3, 4, 5, 6, 7, 9, 10], &[8], &[11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21]];

/// Split and name of a scene in the data set.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Planned {
    pub split: Split,
    pub name: String,
}

/// Gives every scene its split and its name.
pub(super) fn plan(
    settings: &DatasetSettings,
    scenes: &[SceneFacts],
) -> Result<Vec<Planned>, ExportError> {
    check(settings, scenes)?;
    let splits = assign(settings, scenes);
    let names = Split::ALL.map(|split| splits.iter().filter(|at| **at == split).count());
    let names = match settings.layout {
        Layout::Npz => return Ok(own_names(scenes, &splits)),
        Layout::SemanticKitti => {
            let named = |list: &[usize]| list.iter().map(|n| format!("{n:02}")).collect();
            limited(settings, names, SEQUENCES.map(named))?
        }
        Layout::Nuscenes => limited(settings, names, scene_names(names))?,
    };
    let mut names = names.map(Vec::into_iter);
    let next = |split: Split| names[split as usize].next().unwrap_or_default();
    let mut next = next;
    Ok(splits.into_iter().map(|split| Planned { split, name: next(split) }).collect())
}

fn check(settings: &DatasetSettings, scenes: &[SceneFacts]) -> Result<(), ExportError> {
    let Splits { train, val, test } = settings.splits;
    let shares = [train, val, test];
    if shares.iter().any(|s| !(0.0..1e9).contains(s)) || shares.iter().sum::<f64>() <= 0.0 {
        return Err(ExportError::Splits { train, val, test });
    }
    if settings.keyframe_every == 0 {
        return Err(ExportError::Zero { name: "keyframe_every" });
    }
    if scenes.is_empty() {
        return Err(ExportError::NoScenes);
    }
    for (i, SceneFacts { name: scene, frames, .. }) in scenes.iter().enumerate() {
        let scene = scene.clone();
        if frames.is_empty() {
            return Err(ExportError::NoFrames { scene });
        }
        if !frames.is_sorted_by(|a, b| a < b) {
            return Err(ExportError::Frames { scene });
        }
        let folder = safe_name(&scene);
        let same = scenes[..i].iter().find(|other| safe_name(&other.name) == folder);
        if let Some(other) = same.map(|other| other.name.clone()) {
            return Err(match other == scene {
                true => ExportError::SameName { scene },
                false => ExportError::SameFolder { scene, other, folder },
            });
        }
        if let Some(unfit) = unfit(&folder).filter(|_| settings.layout == Layout::Npz) {
            return Err(ExportError::FolderName { scene, unfit });
        }
    }
    Ok(())
}

/// Why a folder of a data set cannot have a name.
fn unfit(name: &str) -> Option<&'static str> {
    [ABOUT, INCOMPLETE].contains(&name).then_some("a file of the set has it")
}

fn own_names(scenes: &[SceneFacts], splits: &[Split]) -> Vec<Planned> {
    let named = scenes.iter().zip(splits);
    named.map(|(scene, &split)| Planned { split, name: safe_name(&scene.name) }).collect()
}

fn limited(
    settings: &DatasetSettings,
    wanted: [usize; 3],
    names: [Vec<String>; 3],
) -> Result<[Vec<String>; 3], ExportError> {
    for split in Split::ALL {
        let (scenes, limit) = (wanted[split as usize], names[split as usize].len());
        if scenes > limit {
            let layout = settings.layout.name();
            return Err(ExportError::TooManyScenes { scenes, split: split.name(), layout, limit });
        }
    }
    Ok(names)
}

/// Splits as wished, the rest by shares: in an order that the seed alone decides, first those that
/// validate, then those that test.
fn assign(settings: &DatasetSettings, scenes: &[SceneFacts]) -> Vec<Split> {
    let mut open: Vec<usize> = (0..scenes.len()).filter(|&i| scenes[i].split.is_none()).collect();
    open.sort_by_key(|&i| mixed(mixed(settings.seed) ^ i as u64));
    let Splits { train, val, test } = settings.splits;
    let share = |part: f64| {
        let wanted = part / (train + val + test) * open.len() as f64;
        // No scene of several is left without one that it asks for.
        let least = usize::from(part > 0.0 && open.len() > 1);
        (wanted.round() as usize).max(least).min(open.len())
    };
    let mut vals = share(val);
    if settings.layout == Layout::SemanticKitti {
        vals = vals.min(SEQUENCES[1].len());
    }
    let tests = if train > 0.0 { share(test) } else { open.len() - vals };
    let mut splits: Vec<Split> =
        scenes.iter().map(|scene| scene.split.unwrap_or(Split::Train)).collect();
    for (at, &i) in open.iter().enumerate() {
        splits[i] = match at {
            _ if at < vals => Split::Val,
            _ if at < vals + tests => Split::Test,
            _ => Split::Train,
        };
    }
    splits
}
