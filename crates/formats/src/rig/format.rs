//! Formats that hold a rig, told apart by name or content, and their files as texts.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde_json::Value;

use super::fields::{self, PHASE};
use super::{RigError, yaml};
use sightline_files::json::{
    DescriptionError, Location, Quantity, YamlDocument, parse_documents, parse_yaml, read_limited,
};

/// A format that holds a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum RigFormat {
    /// Autoware's pair of YAML files; metres, radians.
    Autoware,
    /// URDF; metres, radians.
    Urdf,
    /// SDF, as Gazebo reads it; metres, radians.
    Sdf,
    /// A ROS 2 launch file of static transform publishers; metres, radians.
    Ros2Launch,
    /// The list that `sensors()` of a CARLA agent returns; left-handed, degrees.
    Carla,
    /// `objects.json` of the CARLA ROS bridge; degrees.
    CarlaObjects,
    /// Static transforms as `ros2 topic echo /tf_static` prints them; metres, quaternions; read only.
    Tf,
    /// PandaSet's extrinsics; read only.
    Pandaset,
    /// Placements of this program.
    Json,
}

impl RigFormat {
    /// Every format.
    pub const ALL: [Self; 9] = [
        Self::Autoware,
        Self::Urdf,
        Self::Sdf,
        Self::Ros2Launch,
        Self::Carla,
        Self::CarlaObjects,
        Self::Tf,
        Self::Pandaset,
        Self::Json,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Autoware => "autoware",
            Self::Urdf => "urdf",
            Self::Sdf => "sdf",
            Self::Ros2Launch => "ros2-launch",
            Self::Carla => "carla",
            Self::CarlaObjects => "carla-objects",
            Self::Tf => "tf",
            Self::Pandaset => "pandaset",
            Self::Json => "json",
        }
    }

    /// True if a frame of this format is the foot of its sensor; else it is the optical centre.
    pub fn holds_feet(self) -> bool {
        matches!(self, Self::Autoware | Self::Urdf | Self::Sdf | Self::Ros2Launch | Self::Tf)
    }
}

/// The format of a text.
///
/// # Errors
/// XML that does not parse, or a text of no format.
pub(super) fn format_of(source: &RigSource) -> Result<RigFormat, RigError> {
    let text = source.text.as_str();
    refuse_program(source)?;
    let unrecognised = || RigError::Unrecognised { file: source.file.clone() };
    if text.trim_start().starts_with('<') {
        let document = fields::parse(text, &source.file)?;
        return match document.root_element().tag_name().name() {
            "robot" => Ok(RigFormat::Urdf),
            "sdf" => Ok(RigFormat::Sdf),
            "launch" => Ok(RigFormat::Ros2Launch),
            _ => Err(unrecognised()),
        };
    }
    // From the rarest word to the commonest.
    let words = [
        ("\"spawn_point\"", RigFormat::CarlaObjects),
        ("\"lidars\"", RigFormat::Json),
        ("sensor.lidar.", RigFormat::Carla),
    ];
    if let Some((_, format)) = words.into_iter().find(|(word, _)| text.contains(word)) {
        return Ok(format);
    }
    // A text with keys is YAML, and its fault says more than the list of formats.
    let is_yaml =
        source.file.ends_with(".yaml") || source.file.ends_with(".yml") || text.contains(": ");
    let parsed = source.documents();
    let documents = parsed.map_err(|fault| if is_yaml { fault } else { unrecognised() })?;
    let is = |of: fn(&Value) -> bool| documents.iter().any(|document| of(&document.value));
    type Fits = fn(&Value) -> bool;
    let kinds: [(Fits, RigFormat); 3] = [
        (yaml::holds_transforms, RigFormat::Tf),
        (yaml::is_pandaset, RigFormat::Pandaset),
        (yaml::holds_frames, RigFormat::Autoware),
    ];
    kinds.into_iter().find(|(of, _)| is(*of)).map(|(_, format)| format).ok_or_else(unrecognised)
}

/// Refuses program source: only running it tells its sensors.
///
/// # Errors
/// A file named as a Python program, or with lines that begin like Python's.
pub(super) fn refuse_program(source: &RigSource) -> Result<(), RigError> {
    let named = source.file.ends_with(".py");
    let starts = ["import ", "from ", "def ", "class ", "#!/usr/bin/env python", "@"];
    let begins = |line: &str| starts.iter().any(|start| line.starts_with(start));
    let is_markup = source.text.trim_start().starts_with(['<', '{', '[']);
    if named || (!is_markup && source.text.lines().any(begins)) {
        return Err(RigError::Program { file: source.file.clone() });
    }
    Ok(())
}

impl FromStr for RigFormat {
    type Err = RigError;

    fn from_str(text: &str) -> Result<Self, RigError> {
        let found = Self::ALL.into_iter().find(|format| format.name() == text);
        found.ok_or_else(|| RigError::UnknownFormat { name: text.to_owned() })
    }
}

/// Largest file in bytes: robots with many links have hundreds of kilobytes.
const MAX_FILE: u64 = 16 << 20;
/// Endings that a folder of a rig is searched for.
const ENDINGS: [&str; 2] = ["yaml", "yml"];

/// A text and the name that its file usually has.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedText {
    /// Name of the file.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// A text and the file that it is from.
#[derive(Debug, Clone, PartialEq)]
pub struct RigSource {
    /// File as the user named it.
    pub file: String,
    /// Its text, without a byte order mark.
    pub text: String,
}

impl RigSource {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, is too large, or is no UTF-8.
    pub fn read(path: &Path) -> Result<Self, RigError> {
        let file = path.display().to_string();
        let bytes = read_limited(path, MAX_FILE)?;
        let text = String::from_utf8(bytes).map_err(|error| RigError::Syntax {
            at: Box::new(Location::top(&file)),
            what: "UTF-8 text",
            problem: format!("byte {} is of another encoding", error.utf8_error().valid_up_to()),
        })?;
        let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
        Ok(Self { file, text })
    }

    /// The text as one YAML document; JSON is YAML, too.
    pub(super) fn yaml(&self) -> Result<YamlDocument, RigError> {
        Ok(parse_yaml(&self.text, &self.file, quantity)?)
    }

    /// All documents of a YAML text that are not empty.
    pub(super) fn documents(&self) -> Result<Vec<YamlDocument>, RigError> {
        Ok(parse_documents(&self.text, &self.file, quantity)?)
    }
}

/// Quantity under a key of a pose, as all YAML of rigs names them.
fn quantity(parent: &str, key: &str) -> Option<Quantity> {
    match (parent, key) {
        ("rotation", "x" | "y" | "z" | "w") => Some(Quantity::Bare),
        (_, "x" | "y" | "z") => Some(Quantity::Length),
        (_, "roll" | "pitch" | "yaw" | PHASE) => Some(Quantity::Angle),
        _ => None,
    }
}

/// Reads files; a folder stands for the YAML files in it, as Autoware's pair lies in one.
///
/// # Errors
/// A file or folder that cannot be read.
pub fn sources(paths: &[PathBuf]) -> Result<Vec<RigSource>, RigError> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let fail = |source| DescriptionError::Read { file: path.clone(), source };
        let mut inside = Vec::new();
        for entry in std::fs::read_dir(path).map_err(fail)? {
            let file = entry.map_err(fail)?.path();
            let ending = file.extension().and_then(|ending| ending.to_str());
            if ending.is_some_and(|ending| ENDINGS.contains(&ending)) {
                inside.push(file);
            }
        }
        if inside.is_empty() {
            return Err(fail(std::io::Error::other("is a folder without .yaml files")).into());
        }
        inside.sort();
        files.extend(inside);
    }
    files.iter().map(|file| RigSource::read(file)).collect()
}
