//! Why a data set cannot be written.

use std::path::PathBuf;

use sightline_files::files::FileError;
use sightline_files::json::did_you_mean;
use sightline_scene::vehicle::{SensorError, UnknownSensor};

/// Why a data set cannot be written.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum ExportError {
    /// No layout of that name.
    #[error("`{name}` is no layout; take `semantickitti`, `nuscenes` or `npz`")]
    UnknownLayout { name: String },
    /// Shares that are no shares.
    #[error(
        "splits {train}, {val}, {test}: take three shares from 0 to below 1e9 whose sum is above 0"
    )]
    Splits { train: f64, val: f64, test: f64 },
    /// A number of a setting that makes no sense.
    #[error("`{name}` is 0; take 1 or more")]
    Zero { name: &'static str },
    /// Nothing to write.
    #[error("a data set needs at least one scene")]
    NoScenes,
    /// A scene without frames to write.
    #[error(
        "the scene `{scene}` has no frames to write; name at least one, or leave the scene out"
    )]
    NoFrames { scene: String },
    /// Frames in no order.
    #[error("the frames of the scene `{scene}` do not rise; name each once, from first to last")]
    Frames { scene: String },
    /// Two scenes would share a folder.
    #[error("two scenes are called `{scene}`; rename one")]
    SameName { scene: String },
    /// Two scenes would share a folder, although their names differ.
    #[error("the scenes `{other}` and `{scene}` would share the folder `{folder}`; rename one")]
    SameFolder { scene: String, other: String, folder: String },
    /// A scene that no folder can be called after.
    #[error(
        "no folder of the data set can have the name of the scene `{scene}`: {unfit}; rename it"
    )]
    FolderName { scene: String, unfit: &'static str },
    /// A class that the format has no label for.
    #[error(
        "scene `{scene}`: the class `{class}` has no label in this layout; map it to one that has, \
         as in `{class}=building`"
    )]
    UnmappedClass { scene: String, class: String },
    /// A mapping to a class that has no label either.
    #[error(
        "the map `{class}={to}`: `{to}` is no class with a label; take one of the scene format's own, \
         such as `building`, `vehicle` or `vegetation`"
    )]
    UnknownTarget { class: String, to: String },
    /// A class that is mapped more than once.
    #[error("the class `{class}` is mapped to `{first}` and to `{second}`; map it once")]
    MappedTwice { class: String, first: String, second: String },
    /// A mapping of a class that is nowhere.
    #[error("the map `{class}={to}`: no scene has a class `{class}`{}", did_you_mean(.nearest, .known))]
    UnknownClass { class: String, to: String, nearest: Option<String>, known: Vec<String> },
    /// Loaders replace the word everywhere in a path.
    #[error(
        "{}: has `velodyne` in its path, which loaders of SemanticKITTI replace by `labels`; name \
         another folder", path.display()
    )]
    Velodyne { path: PathBuf },
    /// More scenes than the format has names for.
    #[error(
        "{scenes} scenes for {split}: {layout} has {limit} names for those; use fewer, or other splits"
    )]
    TooManyScenes { scenes: usize, split: &'static str, layout: &'static str, limit: usize },
    /// A file where the folder is to be.
    #[error("{}: is a file, and a data set is a folder; name another place", path.display())]
    NoFolder { path: PathBuf },
    /// Something else where records are kept.
    #[error(
        "{}: is not the folder of records that a data set keeps; take it away, or name another place for the set",
        path.display()
    )]
    Hidden { path: PathBuf },
    /// The description of the data set cannot be parsed.
    #[error("{}: cannot be read ({why}); put it back as it was, or name another folder", path.display())]
    About { path: PathBuf, why: serde_json::Error },
    /// The folder holds something else.
    #[error("{}: is not empty and holds no data set of this program; name another folder", path.display())]
    Foreign { path: PathBuf },
    /// The folder lies within the folder of another data set.
    #[error(
        "{}: lies in {}, the folder of another data set, which would hold files of both; name a folder outside it",
        path.display(), set.display()
    )]
    Nested { path: PathBuf, set: PathBuf },
    /// The folder holds another data set.
    #[error(
        "{}: holds a data set of other settings ({difference}); name another folder, or take the same settings",
        path.display()
    )]
    OtherSettings { path: PathBuf, difference: String },
    /// A file of the scenes is not as it was when the folder was begun.
    #[error(
        "{}: {change} since this data set was begun; put it back as it was, or name another folder",
        path.display()
    )]
    OtherFile { path: PathBuf, change: String },
    /// A scan that was not announced.
    #[error("frame {frame} of scene {scene} is not among those that the data set was made for")]
    Unplanned { scene: usize, frame: usize },
    /// A frame whose placement or classes are others than announced.
    #[error("frame {frame} of the scene `{scene}`: {what}")]
    Scan { scene: String, frame: usize, what: String },
    /// Frames are missing.
    #[error("{}: {missing} of {frames} frames are missing, the first is frame {frame} of `{scene}`; \
             run again to write them", path.display())]
    Incomplete { path: PathBuf, missing: usize, frames: usize, scene: String, frame: usize },
    /// The disk would not hold it.
    #[error("{}: the frames to come need about {need} MB, {free} MB are free; make room, or write fewer frames",
            path.display())]
    Space { path: PathBuf, need: u64, free: u64 },
    /// A view of a frame that is not there.
    #[error("the scene `{scene}` has no frame {frame}; name one of its frames, from 0")]
    NoFrame { scene: String, frame: usize },
    /// Lengths in a binary glTF have 32 bits.
    #[error(
        "the glTF would have more than {need} bytes, at most {limit} fit; show fewer placements, or no points"
    )]
    GltfTooLarge { need: u64, limit: u64 },
    /// A sensor of the vehicle that has no beams.
    Sensor(#[from] SensorError),
    /// A LiDAR of a model that the vehicle does not have.
    UnknownSensor(#[from] UnknownSensor),
    /// A file that cannot be written or read.
    File(#[from] FileError),
}

/// Result of a step of writing a data set.
pub(super) type Checked<T> = Result<T, ExportError>;
