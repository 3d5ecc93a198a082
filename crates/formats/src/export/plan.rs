//! Settings that fix the bytes of a data set, and the split and name that they give each scene.

use std::collections::HashMap;
use std::str::FromStr;

use lidar_cast::maths::mixed;
use serde::{Deserialize, Serialize};
use sightline_files::files::{Input, safe_name};
use sightline_files::json::{did_you_mean, nearest};
use sightline_scan::{EGO_INSTANCE, Return, TrackedBox};
use sightline_scene::scene::ActorKind;

use super::folder::{ABOUT, INCOMPLETE};
use super::nuscenes::scene_names;
use super::{Checked, FormatError};

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
    type Err = FormatError;

    fn from_str(name: &str) -> Checked<Self> {
        let all = [Self::SemanticKitti, Self::Nuscenes, Self::Npz];
        let found = all.into_iter().find(|layout| layout.name() == name);
        found.ok_or_else(|| {
            refused!("`{name}` is no layout; take `semantickitti`, `nuscenes` or `npz`")
        })
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

    pub(super) fn name(self) -> &'static str {
        ["train", "val", "test"][self as usize]
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
pub(super) fn plan(settings: &DatasetSettings, scenes: &[SceneFacts]) -> Checked<Vec<Planned>> {
    check(settings, scenes)?;
    let splits = assign(settings, scenes);
    let names = Split::ALL.map(|split| splits.iter().filter(|at| **at == split).count());
    let names = match settings.layout {
        Layout::Npz => {
            let own = |(scene, split): (&SceneFacts, Split)| Planned {
                split,
                name: safe_name(&scene.name),
            };
            return Ok(scenes.iter().zip(splits).map(own).collect());
        }
        Layout::SemanticKitti => {
            let named = |list: &[usize]| list.iter().map(|n| format!("{n:02}")).collect();
            limited(settings, names, SEQUENCES.map(named))?
        }
        Layout::Nuscenes => limited(settings, names, scene_names(names))?,
    };
    let mut names = names.map(Vec::into_iter);
    let mut next = |split: Split| names[split as usize].next().unwrap_or_default();
    Ok(splits.into_iter().map(|split| Planned { split, name: next(split) }).collect())
}

fn check(settings: &DatasetSettings, scenes: &[SceneFacts]) -> Checked<()> {
    let Splits { train, val, test } = settings.splits;
    let shares = [train, val, test];
    if shares.iter().any(|s| !(0.0..1e9).contains(s)) || shares.iter().sum::<f64>() <= 0.0 {
        return Err(refused!(
            "splits {train}, {val}, {test}: take three shares from 0 to below 1e9 whose sum is above 0"
        ));
    }
    if settings.keyframe_every == 0 {
        return Err(FormatError::Refused("`keyframe_every` is 0; take 1 or more".to_owned()));
    }
    if scenes.is_empty() {
        return Err(FormatError::Refused("a data set needs at least one scene".to_owned()));
    }
    for (i, SceneFacts { name: scene, frames, .. }) in scenes.iter().enumerate() {
        if frames.is_empty() {
            return Err(refused!(
                "the scene `{scene}` has no frames to write; name at least one, or leave the scene out"
            ));
        }
        if !frames.is_sorted_by(|a, b| a < b) {
            return Err(refused!(
                "the frames of the scene `{scene}` do not rise; name each once, from first to last"
            ));
        }
        let folder = safe_name(scene);
        let same = scenes[..i].iter().find(|other| safe_name(&other.name) == folder);
        if let Some(SceneFacts { name: other, .. }) = same {
            return Err(match other == scene {
                true => refused!("two scenes are called `{scene}`; rename one"),
                false => refused!(
                    "the scenes `{other}` and `{scene}` would share the folder `{folder}`; rename one"
                ),
            });
        }
        if settings.layout == Layout::Npz && [ABOUT, INCOMPLETE].contains(&folder.as_str()) {
            return Err(refused!(
                "no folder of the data set can have the name of the scene `{scene}`: a file of the set has it; rename it"
            ));
        }
    }
    Ok(())
}

fn limited(
    settings: &DatasetSettings,
    wanted: [usize; 3],
    names: [Vec<String>; 3],
) -> Checked<[Vec<String>; 3]> {
    for split in Split::ALL {
        let (scenes, limit) = (wanted[split as usize], names[split as usize].len());
        if scenes > limit {
            let (layout, split) = (settings.layout.name(), split.name());
            return Err(refused!(
                "{scenes} scenes for {split}: {layout} has {limit} names for those; use fewer, or other splits"
            ));
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

/// Metres a second from which on an actor moves.
pub(super) const MOVES: f64 = 0.3;

/// A label in both formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Label {
    /// Id in `semantic-kitti.yaml`.
    pub kitti: u16,
    /// Id in `semantic-kitti.yaml` for a moving thing.
    pub kitti_moving: u16,
    /// Index of the category of nuScenes lidarseg.
    pub nuscenes: u8,
}

const fn still(kitti: u16, nuscenes: u8) -> Label {
    Label { kitti, kitti_moving: kitti, nuscenes }
}

const fn moving(kitti: u16, kitti_moving: u16, nuscenes: u8) -> Label {
    Label { kitti, kitti_moving, nuscenes }
}

/// Fog, snow, rain and crosstalk.
const NOISE: Label = still(0, 0);
/// Own body: an outlier of SemanticKITTI.
const EGO: Label = still(1, 31);

/// Classes of scenes by name: the 21 default classes, SemanticKITTI's, and common names of actors in scenes. Small walls and
/// crash barriers count as fences.
#[rustfmt::skip] // Words of a list stand side by side.
const CLASSES: [(&str, Label); 58] = [
    ("building", still(50, 28)), ("fence", still(51, 28)), ("other", still(99, 29)),
    ("pedestrian", moving(30, 254, 2)), ("pole", still(80, 28)), ("road_line", still(60, 24)),
    ("road", still(40, 24)), ("sidewalk", still(48, 26)), ("vegetation", still(70, 30)),
    ("vehicle", moving(10, 252, 17)), ("wall", still(51, 28)), ("traffic_sign", still(81, 28)),
    ("ground", still(49, 25)), ("bridge", still(52, 28)), ("rail_track", still(49, 25)),
    ("guard_rail", still(51, 28)), ("traffic_light", still(99, 28)), ("static", still(99, 29)),
    ("dynamic", still(99, 10)), ("water", still(0, 25)), ("terrain", still(72, 27)), ("unlabeled", still(0, 0)),
    ("outlier", still(1, 0)), ("car", moving(10, 252, 17)), ("van", moving(10, 252, 17)),
    ("bicycle", moving(11, 253, 14)), ("bus", moving(13, 257, 16)), ("motorcycle", moving(15, 255, 21)),
    ("on-rails", moving(16, 256, 16)), ("truck", moving(18, 258, 23)), ("trailer", moving(20, 259, 22)),
    ("construction", moving(20, 259, 18)), ("other-vehicle", moving(20, 259, 18)), ("person", moving(30, 254, 2)),
    ("bicyclist", moving(31, 253, 14)), ("motorcyclist", moving(32, 255, 21)), ("animal", still(99, 1)),
    ("parking", still(44, 24)), ("other-ground", still(49, 25)), ("other-structure", still(52, 28)),
    ("lane-marking", still(60, 24)), ("trunk", still(71, 30)), ("traffic-sign", still(81, 28)),
    ("other-object", still(99, 29)), ("moving-car", still(252, 17)), ("moving-bicyclist", still(253, 14)),
    ("moving-person", still(254, 2)), ("moving-motorcyclist", still(255, 21)), ("moving-on-rails", still(256, 16)),
    ("moving-bus", still(257, 16)), ("moving-truck", still(258, 23)), ("moving-other-vehicle", still(259, 18)),
    ("sky", still(0, 0)), ("grass", still(72, 27)), ("tree", still(70, 30)), ("barrier", still(51, 9)),
    ("traffic_cone", still(99, 12)), ("curb", still(48, 26)),
];

/// Label of an actor by its kind, where a class has the same name; `None` where its classes decide.
pub(super) fn of_kind(kind: ActorKind) -> Option<Label> {
    let label = CLASSES.iter().find(|(name, _)| *name == kind.name()).map(|(_, label)| *label);
    label.filter(|_| kind != ActorKind::Other)
}

/// Checks that every class that is mapped is one of a scene.
///
/// # Errors
/// A class that no scene has.
pub(super) fn check_map(scenes: &[SceneFacts], map: &[(String, String)]) -> Checked<()> {
    let mut known: Vec<&str> =
        scenes.iter().flat_map(|scene| &scene.classes).map(String::as_str).collect();
    known.sort_unstable();
    known.dedup();
    for (k, (class, second)) in map.iter().enumerate() {
        if let Some((_, first)) = map[..k].iter().find(|(other, _)| other == class) {
            return Err(refused!(
                "the class `{class}` is mapped to `{first}` and to `{second}`; map it once"
            ));
        }
    }
    let Some((class, to)) = map.iter().find(|(class, _)| !known.contains(&class.as_str())) else {
        return Ok(());
    };
    let nearest = nearest(class, known.iter().copied());
    let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
    let hint = did_you_mean(&nearest, &known);
    Err(refused!("the map `{class}={to}`: no scene has a class `{class}`{hint}"))
}

/// Labels of the classes of a scene, in their order.
///
/// # Errors
/// A class without a label, a map to a class without one.
pub(super) fn of_classes(scene: &SceneFacts, map: &[(String, String)]) -> Checked<Vec<Label>> {
    let known: HashMap<&str, Label> = CLASSES.into_iter().collect();
    for (class, to) in map {
        if !known.contains_key(to.as_str()) {
            return Err(refused!(
                "the map `{class}={to}`: `{to}` is no class with a label; take one of the scene format's own, such as \
                 `building`, `vehicle` or `vegetation`"
            ));
        }
    }
    let label = |class: &String| {
        let mapped = map.iter().find(|(from, _)| from == class).map_or(class, |(_, to)| to);
        known.get(mapped.as_str()).copied().ok_or_else(|| {
            refused!(
                "scene `{}`: the class `{class}` has no label in this layout; map it to one that has, as in \
                 `{class}=building`",
                scene.name
            )
        })
    };
    scene.classes.iter().map(label).collect()
}

pub(super) struct ScanLabels<'a> {
    classes: &'a [Label],
    /// Label of its kind, and whether it moves, by instance.
    actors: Vec<Option<(Option<Label>, bool)>>,
}

impl<'a> ScanLabels<'a> {
    pub(super) fn new(classes: &'a [Label], boxes: &[TrackedBox]) -> Self {
        let most = boxes.iter().map(|tracked| usize::from(tracked.instance)).max();
        let mut actors = vec![None; most.map_or(0, |most| most + 1)];
        for tracked in boxes {
            let moves = tracked.velocity.length() > MOVES;
            actors[usize::from(tracked.instance)] = Some((of_kind(tracked.kind), moves));
        }
        Self { classes, actors }
    }

    fn of(&self, point: &Return) -> (Label, bool) {
        let Some(&class) = self.classes.get(usize::from(point.class)) else {
            return (NOISE, false);
        };
        if point.instance == EGO_INSTANCE {
            return (EGO, false);
        }
        match self.actors.get(usize::from(point.instance)) {
            Some(&Some((kind, moves))) => (kind.unwrap_or(class), moves),
            _ => (class, false),
        }
    }

    /// The `u32` of a SemanticKITTI label: id below, instance above.
    pub(super) fn kitti(&self, point: &Return) -> u32 {
        let (label, moves) = self.of(point);
        let id = if moves { label.kitti_moving } else { label.kitti };
        let is_noise = usize::from(point.class) >= self.classes.len();
        let instance = if is_noise || label == EGO { 0 } else { point.instance };
        u32::from(instance) << 16 | u32::from(id)
    }

    /// Index of the category of nuScenes lidarseg.
    pub(super) fn nuscenes(&self, point: &Return) -> u8 {
        self.of(point).0.nuscenes
    }
}
