//! Formats that hold a rig, told apart by name or content, and their files as texts.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde_json::Value;
use sightline_files::json::{
    DescriptionError, FileKind, Quantity, YamlDocument, parse_documents, parse_yaml, plain_names,
    quoted, read_text, refuse_comment, refuse_foreign, refuse_own_kinds,
};

use super::beams::{Models, RigBeams, TURNS_A_SECOND};
use super::yaml::PHASE;
use super::{
    Checked, Fan, FormatError, Mounting, Rig, RigLidar, carla, launch, model, sdf, urdf, yaml,
};
use crate::error::listed;

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

/// Names on the command line, in the order of [`RigFormat::ALL`].
const NAMES: [&str; RigFormat::ALL.len()] =
    ["autoware", "urdf", "sdf", "ros2-launch", "carla", "carla-objects", "tf", "pandaset", "json"];

impl RigFormat {
    /// Every format.
    #[rustfmt::skip] // Words of a list stand side by side.
    pub const ALL: [Self; 9] = [
        Self::Autoware, Self::Urdf, Self::Sdf, Self::Ros2Launch, Self::Carla, Self::CarlaObjects, Self::Tf,
        Self::Pandaset, Self::Json,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        NAMES[self as usize]
    }

    /// True if rigs are written in it; else they are only read.
    pub(crate) fn is_written(self) -> bool {
        !matches!(self, Self::Tf | Self::Pandaset)
    }

    /// The format of a name in which rigs are written.
    ///
    /// # Errors
    /// A name that none of them has.
    pub fn written(name: &str) -> Result<Self, FormatError> {
        match Self::from_str(name) {
            Ok(format) if format.is_written() => Ok(format),
            Ok(format) => Err(format.read_only()),
            Err(_) => {
                let written = formats(Self::is_written);
                Err(refused!("no format is called `{name}`; rigs are written in {written}"))
            }
        }
    }

    /// Error of a format in which no rig is written.
    fn read_only(self) -> FormatError {
        let (name, written) = (self.name(), formats(Self::is_written));
        refused!("{name} is read, but not written; take one of {written}")
    }

    /// True if a frame of this format is the foot of its sensor; else it is the optical centre.
    pub(crate) fn holds_feet(self) -> bool {
        matches!(self, Self::Autoware | Self::Urdf | Self::Sdf | Self::Ros2Launch | Self::Tf)
    }
}

fn formats(is_meant: impl Fn(RigFormat) -> bool) -> String {
    let meant = RigFormat::ALL.into_iter().filter(|format| is_meant(*format));
    meant.map(RigFormat::name).collect::<Vec<_>>().join(", ")
}

/// The format of a text.
///
/// # Errors
/// XML that does not parse, or a text of no format.
pub(super) fn format_of(source: &RigSource) -> Checked<RigFormat> {
    let text = source.text.as_str();
    refuse_program(source)?;
    let unrecognised = || {
        let (file, all) = (&source.file, formats(|_| true));
        refused!("{file}: its content is none of {all}; name its format with --format")
    };
    if text.trim_start().starts_with('<') {
        let text = plain_names(text);
        let document = yaml::parse(&text, &source.file)?;
        return match document.root_element().tag_name().name() {
            "robot" => Ok(RigFormat::Urdf),
            "sdf" => Ok(RigFormat::Sdf),
            "launch" => Ok(RigFormat::Ros2Launch),
            _ => Err(unrecognised()),
        };
    }
    // YAML has comments.
    if source.file.ends_with(".json") {
        refuse_comment(text, &source.file)?;
    }
    refuse_foreign(text, &source.file, "a rig of another program")?;
    // Own placements are a format of rigs.
    if text.contains("\"sightline\"") && FileKind::of(text) != Some(FileKind::Placements) {
        refuse_own_kinds(text, &source.file, "a rig of another program")?;
    }
    // From the rarest word to the commonest.
    let words = ["\"spawn_point\"", "\"lidars\"", "sensor.lidar."];
    match words.into_iter().find(|word| text.contains(word)) {
        Some("\"lidars\"") => return Ok(RigFormat::Json),
        Some(_) => return Ok(carla::format_of(source)),
        None => {}
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
/// A file named as a Python program, or with lines that begin like Python's; USD, which has such lines, and YAML of ROS.
pub(super) fn refuse_program(source: &RigSource) -> Checked<()> {
    let others = [("#usda", "USD"), ("launch:", "a launch file in YAML")];
    let begins_with = |start: &str| source.text.trim_start().starts_with(start);
    if let Some((_, kind)) = others.iter().find(|(start, _)| begins_with(start)) {
        let mend = "give the robot's URDF, or a launch file in XML";
        return Err(refused!("{}: is {kind}, which is not read; {mend}", source.file));
    }
    let named = source.file.ends_with(".py");
    let starts = ["import ", "from ", "def ", "class ", "#!/usr/bin/env python", "@"];
    let begins = |line: &str| starts.iter().any(|start| line.starts_with(start));
    let is_markup = source.text.trim_start().starts_with(['<', '{', '[']);
    if named || (!is_markup && source.text.lines().any(begins)) {
        return Err(refused!(
            "{}: is a Python program, which is not run; write its sensors as JSON with these three lines: `import json`, \
             `sensors = MyAgent().sensors()` (the list of CARLA, or one made by hand), `json.dump(sensors, \
             open(\"sensors.json\", \"w\"))`; or give the URDF, or `/tf_static` as `ros2 topic echo /tf_static --once` \
             prints it",
            source.file
        ));
    }
    Ok(())
}

impl FromStr for RigFormat {
    type Err = FormatError;

    fn from_str(text: &str) -> Checked<Self> {
        let found = Self::ALL.into_iter().find(|format| format.name() == text);
        let all = || formats(|_| true);
        found.ok_or_else(|| refused!("no format is called `{text}`; there are {}", all()))
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
    pub(super) fn read(path: &Path) -> Checked<Self> {
        Ok(Self { file: path.display().to_string(), text: read_text(path, MAX_FILE)? })
    }

    /// The text as one YAML document; JSON is YAML, too.
    pub(super) fn yaml(&self) -> Checked<YamlDocument> {
        Ok(parse_yaml(&self.text, &self.file, quantity)?)
    }

    /// All documents of a YAML text that are not empty.
    pub(super) fn documents(&self) -> Checked<Vec<YamlDocument>> {
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
pub(super) fn sources(paths: &[PathBuf]) -> Checked<Vec<RigSource>> {
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

/// Models of LiDARs beside Autoware's files.
pub const MODELS_FILE: &str = "models.json";
/// Most LiDARs that CARLA's leaderboard lets an agent have.
const LEADERBOARD_LIDARS: usize = 2;
/// Farthest that they may stand from the vehicle's origin, in metres.
const LEADERBOARD_RADIUS: f64 = 3.0;

/// A rig in another format.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// One file, or the two of Autoware.
    pub files: Vec<NamedText>,
    /// Sentences about parts of the rig that the format cannot hold.
    pub warnings: Vec<String>,
}

/// Writes a rig. `models` are its vehicle's or scene's: the simulators' formats carry their beams.
///
/// # Errors
/// A rig that no placement could be, or a format that is read only.
pub fn export(
    rig: &Rig,
    format: RigFormat,
    mounting: &Mounting,
    models: &Models,
) -> Result<Exported, FormatError> {
    rig.validate()?;
    check_models(rig, models)?;
    model::refuse_names(rig, format)?;
    let one = |name: &str, text| vec![NamedText { name: name.to_owned(), text }];
    let files = match format {
        RigFormat::Autoware => {
            let mut files = yaml::write_autoware(rig, mounting);
            let text = models.document(rig).map(|document| pretty(&document));
            files.extend(text.map(|text| NamedText { name: MODELS_FILE.to_owned(), text }));
            files
        }
        RigFormat::Urdf => one("rig.urdf", urdf::write(rig, mounting, models)),
        RigFormat::Sdf => one("rig.sdf", sdf::write(rig, mounting, models)),
        RigFormat::Ros2Launch => one("rig.launch.xml", launch::write(rig, mounting)),
        RigFormat::Carla => one("sensors.json", pretty(&carla::write(rig, mounting, models))),
        RigFormat::CarlaObjects => {
            one("objects.json", pretty(&carla::write_objects(rig, mounting, models)))
        }
        RigFormat::Json => one("placements.json", pretty(&model::rig_json(&[rig]))),
        RigFormat::Tf | RigFormat::Pandaset => return Err(format.read_only()),
    };
    let mut warnings = Vec::new();
    if let Some(program) = simulator(format) {
        warnings.extend(usual_rates(rig, models));
        let unsaid = |lidar| unsaid_beams(lidar, models, program);
        warnings.extend(rig.lidars.iter().filter_map(unsaid));
    }
    if format == RigFormat::Carla {
        warnings.extend(leaderboard(rig, mounting));
    }
    if matches!(format, RigFormat::Autoware | RigFormat::Ros2Launch) {
        let moved = |lidar: &&RigLidar| {
            mounting.height(&lidar.frame, lidar.sensor.as_deref()).unwrap_or(0.0) != 0.0
        };
        warnings.extend(rig.lidars.iter().find(moved).map(|lidar| {
            format!(
                "`{}` and others are written as the feet of their sensors, which this format does not \
                 name; import them with --sensor or --optical-height",
                lidar.frame
            )
        }));
    }
    warnings.extend(lost_phases(rig, format));
    warnings.extend(lost_models(rig, format));
    warnings.extend((format != RigFormat::Json).then(|| lost_carriers(rig)).flatten());
    Ok(Exported { files, warnings })
}

/// Warning about phases that the format has no place for.
fn lost_phases(rig: &Rig, format: RigFormat) -> Option<String> {
    let phased: Vec<&str> =
        rig.lidars.iter().filter(|l| l.pose.phase.is_some()).map(|l| l.frame.as_str()).collect();
    (format == RigFormat::Ros2Launch && !phased.is_empty()).then(|| {
        format!(
            "a launch file has no place for the phases of {}, which are left out; keep the placement beside it",
            phased.join(", ")
        )
    })
}

/// Warning about LiDARs that ride on a body, which no format of other programs says.
fn lost_carriers(rig: &Rig) -> Option<String> {
    let ridden = rig.lidars.iter().filter(|lidar| !lidar.pose.rides_on.is_none());
    let frames = quoted(ridden.map(|lidar| &lidar.frame));
    (!frames.is_empty())
        .then(|| format!("{frames}: written where the body that carries it stands in frame 0"))
}

fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}

/// Refuses LiDARs without a model where there are several, and models that are none of them.
fn check_models(rig: &Rig, models: &Models) -> Checked<()> {
    let known = models.names();
    for lidar in &rig.lidars {
        let frame = &lidar.frame;
        match (&lidar.sensor, models.of(lidar)) {
            (None, _) if models.count() > 1 => {
                return Err(refused!(
                    "`{frame}` names no sensor, and the vehicle has {}; give --sensor {frame}={}",
                    listed(&known),
                    known[0]
                ));
            }
            (Some(sensor), RigBeams::Unknown) if !known.is_empty() => {
                return Err(refused!(
                    "`{frame}` is a `{sensor}`, and the vehicle has {}; give its own vehicle, or --sensor {frame}=MODEL",
                    listed(&known)
                ));
            }
            _ => {}
        }
    }
    Ok(())
}

/// The simulator that casts the beams of a format.
fn simulator(format: RigFormat) -> Option<&'static str> {
    match format {
        RigFormat::Carla | RigFormat::CarlaObjects => Some("CARLA"),
        RigFormat::Urdf | RigFormat::Sdf => Some("Gazebo"),
        _ => None,
    }
}

/// Warning about a LiDAR whose beams a simulator cannot reproduce.
fn unsaid_beams(lidar: &RigLidar, models: &Models, program: &str) -> Option<String> {
    let frame = &lidar.frame;
    let of = lidar.sensor.as_deref().unwrap_or("the scene's sensor");
    let said = match models.of(lidar) {
        RigBeams::Known(_) => return None,
        RigBeams::Given(model) => match Fan::of(&model.lidar) {
            Some(fan) if !(fan.is_even && fan.is_straight) => lost_channels(&fan, of, program),
            Some(fan) if program == "CARLA" && !fan.is_centred() => format!(
                "{program} casts a sector to both sides of straight ahead, and that of {of} is not; turn the \
                 LiDAR by its middle in CARLA"
            ),
            Some(_) => return None,
            None => format!(
                "{of} has a list of directions, which {program} cannot cast; its beams are left out, and \
                 {program} takes its own"
            ),
        },
        RigBeams::Uneven => format!(
            "{program} casts channels at even steps only, and those of {of} are uneven; its channels and field \
             of view are left out, and {program} takes its own"
        ),
        RigBeams::Unknown => format!(
            "its beams are not known, so {program} takes its own; name its sensor, and give --vehicle or \
             --scene"
        ),
    };
    Some(format!("`{frame}`: {said}"))
}

/// Words on channels that are uneven or look different ways, which a simulator cannot be told.
fn lost_channels(fan: &Fan, of: &str, program: &str) -> String {
    if fan.is_even {
        return format!(
            "{of} has azimuth offsets, which {program} cannot cast; they are lost, and its channels fire in one line"
        );
    }
    let also = if fan.is_straight { "" } else { "; its azimuth offsets are lost" };
    format!(
        "{program} casts channels at even steps only, and those of {of} are uneven; only their number, the lowest \
         and the highest are kept{also}"
    )
}

/// Warning about LiDARs that are written with the usual turns a second, since nothing says another number.
fn usual_rates(rig: &Rig, models: &Models) -> Option<String> {
    let usual = |lidar: &&RigLidar| models.turns_as_usual(lidar);
    let frames = quoted(rig.lidars.iter().filter(usual).map(|lidar| &lidar.frame));
    (!frames.is_empty()).then(|| {
        format!(
            "{} turns a second are written for {frames}: no `rate` is given in the vehicle or its sensor files",
            TURNS_A_SECOND
        )
    })
}

/// Warning about model names that the format has no place for.
fn lost_models(rig: &Rig, format: RigFormat) -> Option<String> {
    let (what, kept) = match format {
        RigFormat::Autoware => (
            "YAML files have",
            format!(
                "with --out they are in {MODELS_FILE}, which `rig import` of the folder reads; else "
            ),
        ),
        RigFormat::Ros2Launch => ("a launch file has", String::new()),
        RigFormat::Carla | RigFormat::CarlaObjects => ("CARLA has", String::new()),
        _ => return None,
    };
    let named =
        |lidar: &RigLidar| Some(format!("--sensor {}={}", lidar.frame, lidar.sensor.as_ref()?));
    let options: Vec<String> = rig.lidars.iter().filter_map(named).collect();
    (!options.is_empty()).then(|| {
        format!("{what} no place for names of models; {kept}import them with {}", options.join(" "))
    })
}

/// Warnings about limits of CARLA's leaderboard: number of LiDARs, distance from the vehicle's origin.
fn leaderboard(rig: &Rig, mounting: &Mounting) -> Vec<String> {
    let mut warnings = Vec::new();
    if rig.lidars.len() > LEADERBOARD_LIDARS {
        let count = rig.lidars.len();
        warnings.push(format!(
            "CARLA's leaderboard takes at most {LEADERBOARD_LIDARS} LiDARs, here are {count}; other users of \
             its API take them all"
        ));
    }
    for lidar in &rig.lidars {
        let far = mounting.to_base(&lidar.pose).position().length();
        if far > LEADERBOARD_RADIUS {
            let frame = &lidar.frame;
            warnings.push(format!(
                "`{frame}`: stands {far:.2} m from the vehicle's origin; CARLA's leaderboard takes at most \
                 {LEADERBOARD_RADIUS} m"
            ));
        }
    }
    warnings
}
