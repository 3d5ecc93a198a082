//! Why a rig cannot be read or written.

use super::RigFormat;
use sightline_files::json::{DescriptionError, Location, YamlDocument, did_you_mean};
use sightline_scene::vehicle::SensorError;

const MOST_LISTED: usize = 24;

/// Why a rig cannot be read or written; each message is one sentence with the file, the place and the mend.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum RigError {
    /// A file that cannot be read, is too large, or is no JSON of the expected form.
    #[error(transparent)]
    File(#[from] DescriptionError),
    /// A name, a number of LiDARs or a number that no placement may have.
    #[error(transparent)]
    Placement(#[from] SensorError),
    /// A fault of poses or of a frame name, with its file.
    #[error("{file}: {source}")]
    Within { file: String, source: Box<RigError> },
    /// Text that does not parse.
    #[error("{at}: is no {what}: {problem}")]
    Syntax { at: Box<Location>, what: &'static str, problem: String },
    /// A key, attribute or element that must be there.
    #[error("{at}: `{key}` is missing; add it")]
    Missing { at: Box<Location>, key: String },
    /// A key that is not known where an unread one may change a pose.
    #[error("{at}: unknown key `{key}`{}", did_you_mean(nearest, known))]
    UnknownKey { at: Box<Location>, key: String, nearest: Option<String>, known: Vec<String> },
    /// A fault and its line in a YAML file.
    #[error("{fault} (line {line}, column {column})")]
    AtLine { fault: Box<RigError>, line: usize, column: usize },
    /// A value of the wrong kind.
    #[error("{at}: {value} stands where {wanted} belongs")]
    Value { at: Box<Location>, value: String, wanted: &'static str },
    /// A frame placed by two entries.
    #[error("{at}: the frame `{frame}` is placed a second time; keep one of the two")]
    Twice { at: Box<Location>, frame: String },
    /// A LiDAR without a model, for a vehicle with several.
    #[error(
        "`{frame}` names no sensor, and the vehicle has {}; give --sensor {frame}={}",
        listed(known), known[0]
    )]
    UnnamedModel { frame: String, known: Vec<String> },
    /// A LiDAR of a model that the vehicle does not have.
    #[error(
        "`{frame}` is a `{sensor}`, and the vehicle has {}; give its own vehicle, or --sensor {frame}=MODEL",
        listed(known)
    )]
    UnknownModel { frame: String, sensor: String, known: Vec<String> },
    /// A frame that nothing mentions.
    #[error("{file}: no frame is called `{frame}`; there are {}", listed(known))]
    UnknownFrame { file: String, frame: String, known: Vec<String> },
    /// A frame whose chain does not lead to the base.
    #[error(
        "{at}: the frame `{frame}` has the parent `{parent}`, which no transform connects with `{base}`; read the file of \
         that transform, too (in ROS and Apollo `frame_id: {base}`, `child_frame_id: {parent}`), or give --base-frame \
         {parent}; there are {}",
        listed(known)
    )]
    Unconnected {
        at: Box<Location>,
        frame: String,
        parent: String,
        base: String,
        known: Vec<String>,
    },
    /// Frames that hang on each other.
    #[error("{at}: the frames {} hang on each other in a loop; break it", listed(frames))]
    Loop { at: Box<Location>, frames: Vec<String> },
    /// A rig without LiDARs.
    #[error(
        "{file}: no frame is a LiDAR by its type or name; pick frames with --frame; there are {}",
        listed(known)
    )]
    NoLidar { file: String, known: Vec<String> },
    /// Several models with LiDARs in one SDF file.
    #[error("{file}: several of its models have LiDARs: {}; pick one with --base-frame {}", listed(models), models[0])]
    SeveralModels { file: String, models: Vec<String> },
    /// LiDARs that may be in files which an SDF file includes.
    #[error(
        "{file}: no model in it has a LiDAR, and its <include>s are not read: {}; merge the files with `gz sdf -p {file}`",
        listed(included)
    )]
    Included { file: String, included: Vec<String> },
    /// Far more LiDARs than a placement holds.
    #[error("{file}: {count} frames are LiDARs, at most {most} are read; pick some with --frame")]
    TooManyLidars { file: String, count: usize, most: usize },
    /// A frame whose name cannot be written.
    #[error("`{frame}` is not a name of a frame: use 1 to {most} bytes without spaces")]
    BadFrame { frame: String, most: usize },
    /// A sensor whose name cannot be written.
    #[error(
        "{sensor:?} is not a name of a sensor: use 1 to {most} bytes without control characters"
    )]
    BadSensor { sensor: String, most: usize },
    /// Two LiDARs in one frame.
    #[error("the frame `{frame}` is used twice, or is that of the vehicle; names must differ")]
    SharedFrame { frame: String },
    /// A name that no format has.
    #[error("no format is called `{name}`; there are {}", formats(|_| true))]
    UnknownFormat { name: String },
    /// A name that no format has in which rigs are written.
    #[error("no format is called `{name}`; rigs are written in {}", formats(RigFormat::is_written))]
    NotWritten { name: String },
    /// Program source in the place of data.
    #[error(
        "{file}: is a Python program, which is not run; write its sensors as JSON with these three lines: \
         `import json`, `sensors = MyAgent().sensors()` (the list of CARLA, or one made by hand), \
         `json.dump(sensors, open(\"sensors.json\", \"w\"))`; or give the URDF, or `/tf_static` as \
         `ros2 topic echo /tf_static --once` prints it"
    )]
    Program { file: String },
    /// A robot that xacro has not expanded.
    #[error(
        "{file}: holds elements or values of xacro, which is a program; expand it first, `xacro {file} > robot.urdf`, \
         and read that"
    )]
    Xacro { file: String },
    /// An element that poses depend on and that is not read.
    #[error("{at}: {what}, which is not read; {mend}")]
    Unread { at: Box<Location>, what: &'static str, mend: &'static str },
    /// A file whose content tells no format.
    #[error("{file}: its content is none of {}; name its format with --format", formats(|_| true))]
    Unrecognised { file: String },
    /// Several files in a format of one.
    #[error("{file}: {format} rigs stand in one file each; read them one at a time")]
    OneFile { file: String, format: &'static str },
    /// A format that is read only.
    #[error(
        "{} is read, but not written; take one of {}",
        format.name(),
        formats(RigFormat::is_written)
    )]
    ReadOnly { format: RigFormat },
    /// No placement of this name, or several and none picked.
    #[error(
        "{file}: {}; pick one of {} as FILE:NAME (in Python name=NAME)",
        unpicked(name),
        listed(known)
    )]
    PickPlacement { file: String, name: Option<String>, known: Vec<String> },
    /// The number of frame names differs from the number of LiDARs.
    #[error("{given} names are given for {lidars} LiDARs; give one --frame for each")]
    FrameCount { given: usize, lidars: usize },
}

/// Result of a step of reading or writing a rig.
pub(super) type Checked<T> = Result<T, RigError>;

impl RigError {
    /// The fault with the line of its place in a document.
    pub(super) fn at_line(self, document: &YamlDocument) -> Self {
        let path = match &self {
            Self::UnknownKey { at, key, .. } => at.key(key).path,
            Self::Missing { at, .. } | Self::Value { at, .. } | Self::Twice { at, .. } => {
                at.path.clone()
            }
            _ => return self,
        };
        let (line, column) = document.line_of(&path);
        Self::AtLine { fault: Box::new(self), line, column }
    }
}

fn unpicked(name: &Option<String>) -> String {
    match name {
        Some(name) => format!("no placement is called `{name}`"),
        None => "holds several placements".to_owned(),
    }
}

fn listed(names: &[String]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    let shown: Vec<_> = names.iter().take(MOST_LISTED).map(|name| format!("`{name}`")).collect();
    let more = names.len().saturating_sub(MOST_LISTED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    shown.join(", ") + &rest
}

fn formats(is_meant: impl Fn(RigFormat) -> bool) -> String {
    let meant = RigFormat::ALL.into_iter().filter(|format| is_meant(*format));
    meant.map(RigFormat::name).collect::<Vec<_>>().join(", ")
}
