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
    #[error(transparent)]
    File(#[from] DescriptionError),
    #[error(transparent)]
    Placement(#[from] SensorError),
    #[error("{file}: {source}")]
    Within { file: String, source: Box<RigError> },
    #[error("{at}: is no {what}: {problem}")]
    Syntax { at: Box<Location>, what: &'static str, problem: String },
    #[error("{at}: `{key}` is missing; add it")]
    Missing { at: Box<Location>, key: String },
    #[error("{at}: unknown key `{key}`{}", did_you_mean(nearest, known))]
    UnknownKey { at: Box<Location>, key: String, nearest: Option<String>, known: Vec<String> },
    #[error("{fault} (line {line}, column {column})")]
    AtLine { fault: Box<RigError>, line: usize, column: usize },
    #[error("{at}: {value} stands where {wanted} belongs")]
    Value { at: Box<Location>, value: String, wanted: &'static str },
    #[error("{at}: the frame `{frame}` is placed a second time; keep one of the two")]
    Twice { at: Box<Location>, frame: String },
    #[error(
        "`{frame}` names no sensor, and the vehicle has {}; give --sensor {frame}={}",
        listed(known), known[0]
    )]
    UnnamedModel { frame: String, known: Vec<String> },
    #[error(
        "`{frame}` is a `{sensor}`, and the vehicle has {}; give its own vehicle, or --sensor {frame}=MODEL",
        listed(known)
    )]
    UnknownModel { frame: String, sensor: String, known: Vec<String> },
    #[error("{file}: no frame is called `{frame}`; there are {}", listed(known))]
    UnknownFrame { file: String, frame: String, known: Vec<String> },
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
    #[error("{at}: the frames {} hang on each other in a loop; break it", listed(frames))]
    Loop { at: Box<Location>, frames: Vec<String> },
    #[error(
        "{file}: no frame is a LiDAR by its type or name; pick frames with --frame; there are {}",
        listed(known)
    )]
    NoLidar { file: String, known: Vec<String> },
    #[error("{file}: several of its models have LiDARs: {}; pick one with --base-frame {}", listed(models), models[0])]
    SeveralModels { file: String, models: Vec<String> },
    #[error(
        "{file}: no model in it has a LiDAR, and its <include>s are not read: {}; merge the files with `gz sdf -p {file}`",
        listed(included)
    )]
    Included { file: String, included: Vec<String> },
    #[error("{file}: {count} frames are LiDARs, at most {most} are read; pick some with --frame")]
    TooManyLidars { file: String, count: usize, most: usize },
    #[error("`{frame}` is not a name of a frame: use 1 to {most} bytes without spaces")]
    BadFrame { frame: String, most: usize },
    #[error(
        "{sensor:?} is not a name of a sensor: use 1 to {most} bytes without control characters"
    )]
    BadSensor { sensor: String, most: usize },
    #[error(
        "the name `{name}` holds `$(` or `${{`, for which readers of {format} put a value; give another one"
    )]
    Substitution { name: String, format: &'static str },
    #[error("the frame `{frame}` is used twice, or is that of the vehicle; names must differ")]
    SharedFrame { frame: String },
    #[error("no format is called `{name}`; there are {}", formats(|_| true))]
    UnknownFormat { name: String },
    #[error("no format is called `{name}`; rigs are written in {}", formats(RigFormat::is_written))]
    NotWritten { name: String },
    #[error(
        "{file}: is a Python program, which is not run; write its sensors as JSON with these three lines: \
         `import json`, `sensors = MyAgent().sensors()` (the list of CARLA, or one made by hand), \
         `json.dump(sensors, open(\"sensors.json\", \"w\"))`; or give the URDF, or `/tf_static` as \
         `ros2 topic echo /tf_static --once` prints it"
    )]
    Program { file: String },
    #[error(
        "{file}: holds elements or values of xacro, which is a program; expand it first, `xacro {file} > robot.urdf`, \
         and read that"
    )]
    Xacro { file: String },
    #[error("{at}: {what}, which is not read; {mend}")]
    Unread { at: Box<Location>, what: &'static str, mend: &'static str },
    #[error("{file}: its content is none of {}; name its format with --format", formats(|_| true))]
    Unrecognised { file: String },
    #[error("{file}: {format} rigs stand in one file each; read them one at a time")]
    OneFile { file: String, format: &'static str },
    #[error(
        "{} is read, but not written; take one of {}",
        format.name(),
        formats(RigFormat::is_written)
    )]
    ReadOnly { format: RigFormat },
    #[error(
        "{file}: {}; pick one of {} as FILE:NAME (in Python name=NAME)",
        unpicked(name),
        listed(known)
    )]
    PickPlacement { file: String, name: Option<String>, known: Vec<String> },
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
