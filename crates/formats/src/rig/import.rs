//! From files of another program to a rig: frames are read, LiDARs picked, chains followed.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::PathBuf;

use serde_json::Value;
use sightline_files::json::{Location, UniqueKeys};
use sightline_files::{Note, json};
use sightline_scene::vehicle::{MAX_LIDARS, SensorPose, doubt_of_ground, doubts_of_units};

use super::frames::{
    AT_ZERO, FrameContent, FrameTree, IDENTITY, MovingJoint, RigFrame, compose, up,
};
use super::yaml::Fields;
use super::{
    BASE_LINK, Checked, FormatError, MODELS_FILE, Mounting, Rig, RigFormat, RigLidar, RigSource,
    beams, carla, format, launch, model, sdf, sources, urdf, yaml,
};
use crate::error::listed;

/// Words in the names of LiDAR frames, for formats that say no more.
const WORDS: [&str; 10] = [
    "lidar", "velodyne", "hesai", "pandar", "ouster", "robosense", "rslidar", "livox", "laser",
    "vlp",
];
/// Name of a rig whose file has none that a placement may bear.
const UNNAMED: &str = "rig";
/// Frame on the ground below `base_link`, by REP 120.
const FOOTPRINT: &str = "base_footprint";

/// How files are read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ImportSettings {
    /// Format; told by content where it is `None`.
    pub format: Option<RigFormat>,
    /// Name of the rig; `None`: the file's, or `rig`. A file of placements: the name of the one to read.
    pub name: Option<String>,
    /// Frame of the vehicle, `BASE_LINK` where it is `None`.
    pub base_frame: Option<String>,
    /// Frames that are LiDARs; told by type or name where there are none.
    pub frames: Vec<String>,
    /// Sensor by frame; it wins over the files.
    pub sensors: BTreeMap<String, String>,
    /// Where `base_link` and the optical centres are.
    pub mounting: Mounting,
}

/// A rig that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedRig {
    /// The rig.
    pub rig: Rig,
    /// Format that was read.
    pub format: RigFormat,
    /// Frames that are no LiDARs, or carry the frame of one.
    pub left_out: Vec<String>,
    /// Notes for the user, in sentences.
    pub notes: Vec<Note>,
}

/// Reads a rig from files; a folder stands for the YAML files in it.
///
/// # Errors
/// Files that cannot be read, or that give no rig.
pub fn import(paths: &[PathBuf], settings: &ImportSettings) -> Result<ImportedRig, FormatError> {
    let mut settings = settings.clone();
    let mut notes = Vec::new();
    for file in paths.iter().filter(|path| path.is_dir()).map(|folder| folder.join(MODELS_FILE)) {
        if file.is_file() {
            notes.push(add_models(&RigSource::read(&file)?, &mut settings.sensors)?);
        }
    }
    let mut imported = import_texts(&sources(paths)?, &settings)?;
    imported.notes.extend(notes);
    Ok(imported)
}

/// Adds the models that `rig export` wrote beside files without a place for them, where none is given.
fn add_models(source: &RigSource, known: &mut BTreeMap<String, String>) -> Checked<Note> {
    let UniqueKeys(document) = json::parse(&source.text, &source.file)?;
    let lidars = Fields::of(&document, Location::top(&source.file))?.inner("lidars")?;
    for (frame, _, _) in lidars.each() {
        let model = lidars.text(frame)?;
        known.entry(frame.clone()).or_insert_with(|| model.to_owned());
    }
    Ok(Note::fact(format!("{}: the models of LiDARs that --sensor does not name", source.file)))
}

/// Reads a rig from the texts of files.
///
/// # Errors
/// Texts that give no rig.
pub fn import_texts(
    sources: &[RigSource],
    settings: &ImportSettings,
) -> Result<ImportedRig, FormatError> {
    let Some(first) = sources.first() else {
        return Err(no_lidar("no file", &[]));
    };
    let format = match settings.format {
        Some(format) => format,
        None => format::format_of(first)?,
    };
    if let (Some(second), false) = (sources.get(1), format.holds_feet()) {
        let (file, format) = (&second.file, format.name());
        return Err(refused!(
            "{file}: {format} rigs stand in one file each; read them one at a time"
        ));
    }
    if format == RigFormat::Json {
        return of_placements(first, settings);
    }
    let mut frames = FrameTree::default();
    for source in sources {
        format::refuse_program(source)?;
        read(format, source, settings, &mut frames)?;
    }
    rig_of(frames, format, settings, &first.file)
}

/// Reads the list that `sensors()` of a CARLA agent returns, as JSON values: objects with `type`, `id`, `x`,
/// `y`, `z`, and angles in degrees.
///
/// # Errors
/// A list that gives no rig.
pub fn from_carla_sensors(
    sensors: &Value,
    settings: &ImportSettings,
) -> Result<ImportedRig, FormatError> {
    let (name, mut frames) = ("sensors", FrameTree::default());
    carla::read_list(sensors, &Location::top("CARLA").key(name), &mut frames)?;
    rig_of(frames, RigFormat::Carla, settings, name)
}

/// Frame of the inertial unit in calibrations of Apollo.
const OF_APOLLO: &str = "novatel";

/// The rig of frames that were read.
fn rig_of(
    mut frames: FrameTree,
    format: RigFormat,
    settings: &ImportSettings,
    file: &str,
) -> Checked<ImportedRig> {
    frames.refuse_loops()?;
    let base = base(format, &mut frames, settings, file)?;
    frames.add_root(&base);
    let mut notes = std::mem::take(&mut frames.notes);
    if base == OF_APOLLO {
        notes.push(Note::doubt(format!(
            "{file}: Apollo's `{base}` has x to the right and y ahead; poses are taken as they stand, with x ahead and y \
             left: give the transform of a frame whose x is ahead"
        )));
    }
    let unplaced = std::mem::take(&mut frames.left_out);
    let (lidars, mut left_out) = picked(&frames, settings, file)?;
    notes.extend(named_but_left_out(&frames, &lidars, settings, file));
    left_out.extend(unplaced);
    let moving: BTreeSet<&MovingJoint> =
        lidars.iter().flat_map(|frame| frames.moving_between(&base, &frame.name)).collect();
    notes.extend(moving.into_iter().map(|MovingJoint { joint, at }| {
        let text = format!("{file}: the joint {joint} moves; what stands behind it is taken where the joint is at {at}");
        if at == AT_ZERO { Note::fact(text) } else { Note::doubt(text) }
    }));
    let mut unknown = Vec::new();
    let named = settings.name.clone().or(frames.name.clone());
    let mut rig = Rig { name: named.unwrap_or_else(|| UNNAMED.to_owned()), lidars: Vec::new() };
    for frame in lidars {
        rig.lidars.push(lidar(&frames, frame, &base, format, settings, &mut unknown)?);
        let sensor = rig.lidars.last().and_then(|lidar| lidar.sensor.as_deref());
        let given = settings.mounting.given_height(&frame.name, sensor).is_some();
        doubts(&frames, frame, &base, given, &mut notes);
        notes.extend(rig.lidars.last().and_then(|lidar| optical_frame(lidar, file)));
    }
    if let Some(frame) = unknown.first() {
        // A model that is named already has no known height, so that naming one brings none.
        let of = rig.lidars.iter().find(|lidar| lidar.frame == *frame);
        let mend = match of.and_then(|lidar| lidar.sensor.as_deref()) {
            Some(sensor) => format!("give --optical-height {sensor}=METRES"),
            None => format!("give --sensor {frame}=MODEL or --optical-height {frame}=METRES"),
        };
        notes.push(Note::fact(format!(
            "nothing says how far above its foot the optical centre of {} is, so they are taken for one; {mend}",
            unknown.join(", ")
        )));
    }
    // A robot's name may be unfit for a placement and is replaced; an unfit requested name is an error.
    if settings.name.is_none() && rig.validate().is_err() {
        rig.name = UNNAMED.to_owned();
    }
    rig.validate().map_err(|source| match settings.name {
        Some(_) => source,
        None => refused!("{file}: {source}"),
    })?;
    notes.extend(below_ground(&rig, file));
    notes.extend(at_one_place(&rig, file));
    Ok(ImportedRig { rig, format, left_out, notes })
}

/// A doubt about a LiDAR in a frame of a camera's axes: z ahead, x right, y down. Its beams turn about a level axis there.
fn optical_frame(lidar: &RigLidar, file: &str) -> Option<Note> {
    const LEVEL: f64 = 0.1;
    let frame = &lidar.frame;
    let up = lidar.pose.ego_from_sensor().rotation.z_axis.z;
    let is_odd = frame.to_ascii_lowercase().contains("optical") && up.abs() < LEVEL;
    is_odd.then(|| {
        Note::doubt(format!(
            "{file}: the z axis of `{frame}` is level, as in the optical frame of a camera (x right, y down, z ahead), and \
             beams turn about z; name the frame that the LiDAR stands in by --frame"
        ))
    })
}

/// Doubts of the units of every pose that a LiDAR's own comes from: of the frames between it and the base, and of its
/// optical centre unless its height is `given`. Each is told once.
fn doubts(frames: &FrameTree, lidar: &RigFrame, base: &str, given: bool, notes: &mut Vec<Note>) {
    let way = frames.way(base, &lidar.name).into_iter();
    let mut poses: Vec<_> = way.map(|frame| (frame.at.clone(), frame.pose)).collect();
    if let (FrameContent::Lidar { optical: Some(optical), .. }, false) = (&lidar.holds, given) {
        poses.push((lidar.at.key("<sensor>").key("pose"), *optical));
    }
    for (at, pose) in poses {
        for doubt in doubts_of_units(&pose) {
            let note = Note::doubt(format!("{at}: {doubt}"));
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
    }
}

/// A doubt about two LiDARs that stand in one pose: one sensor, which the files have twice, most likely.
fn at_one_place(rig: &Rig, file: &str) -> Option<Note> {
    let same = |a: &RigLidar, b: &RigLidar| a.pose.values() == b.pose.values();
    let (k, other) = rig.lidars.iter().enumerate().find_map(|(k, lidar)| {
        Some((k, rig.lidars[..k].iter().find(|other| same(other, lidar))?))
    })?;
    let (one, two) = (&other.frame, &rig.lidars[k].frame);
    Some(Note::doubt(format!(
        "{file}: `{one}` and `{two}` stand in one pose; one sensor that comes twice? Name each LiDAR once by --frame, or correct \
         a pose"
    )))
}

fn below_ground(rig: &Rig, file: &str) -> Vec<Note> {
    let low =
        rig.lidars.iter().filter_map(|lidar| Some((&lidar.frame, doubt_of_ground(&lidar.pose)?)));
    low.map(|(frame, doubt)| {
        Note::doubt(format!(
            "{file}, `{frame}`: {doubt}; --base-link says where the vehicle's frame is"
        ))
    })
    .collect()
}

fn of_placements(source: &RigSource, settings: &ImportSettings) -> Checked<ImportedRig> {
    let mut rig = model::rig_of(source, settings.name.as_deref())?;
    for lidar in &mut rig.lidars {
        let sensor = settings.sensors.get(&lidar.frame).cloned();
        lidar.sensor = sensor.or(lidar.sensor.take());
    }
    let mut notes = placement_doubts(&rig, &source.file);
    notes.extend(at_one_place(&rig, &source.file));
    Ok(ImportedRig { rig, format: RigFormat::Json, left_out: Vec::new(), notes })
}

/// Doubts of the units and heights of a rig's placement, for `file`.
pub fn placement_doubts(rig: &Rig, file: &str) -> Vec<Note> {
    let units = rig.lidars.iter().flat_map(|lidar| {
        let doubts = doubts_of_units(&lidar.pose).into_iter();
        doubts.map(|doubt| Note::doubt(format!("{file}, `{}`: {doubt}", lidar.frame)))
    });
    units.chain(below_ground(rig, file)).collect()
}

fn read(
    format: RigFormat,
    source: &RigSource,
    settings: &ImportSettings,
    frames: &mut FrameTree,
) -> Checked<()> {
    match format {
        RigFormat::Autoware => yaml::read(source, frames, yaml::read_frames),
        RigFormat::Urdf => urdf::read(source, frames),
        RigFormat::Sdf => sdf::read(source, settings, frames),
        RigFormat::Ros2Launch => launch::read(source, frames),
        RigFormat::Carla => carla::read(source, frames),
        RigFormat::CarlaObjects => carla::read_objects(source, frames),
        RigFormat::Tf => yaml::read_transforms(source, frames),
        RigFormat::Pandaset => yaml::read(source, frames, yaml::read_sensors),
        // Read as a rig, not as frames.
        RigFormat::Json => Ok(()),
    }
}

/// The frame that stands for the vehicle.
fn base(
    format: RigFormat,
    frames: &mut FrameTree,
    settings: &ImportSettings,
    file: &str,
) -> Checked<String> {
    if let Some(base) = &settings.base_frame {
        if frames.mentions(base) {
            return Ok(base.clone());
        }
        // The frame of a model, or a frame in it.
        let inner = frames.model.as_deref().and_then(|model| base.strip_prefix(model));
        match inner.map(|inner| inner.strip_prefix("::").unwrap_or(inner)) {
            Some("") => return Ok(sdf::MODEL.to_owned()),
            Some(inner) if frames.mentions(inner) => return Ok(inner.to_owned()),
            _ => {}
        }
        let (file, frame) = (file.to_owned(), base.clone());
        return Err(FormatError::UnknownFrame { file, frame, known: frames.names() });
    }
    let own = match format {
        RigFormat::Pandaset => yaml::PANDASET_BASE,
        RigFormat::Sdf if !frames.mentions(BASE_LINK) => sdf::MODEL,
        _ => return Ok(ground(frames, settings, file)),
    };
    let text = format!("{file}: the vehicle's frame is taken to be `{own}`");
    frames.notes.push(Note::fact(text));
    Ok(own.to_owned())
}

/// True for the name of the frame on the ground, with a prefix or without.
pub(super) fn is_footprint(name: &str) -> bool {
    name.rsplit(['/', ':']).next() == Some(FOOTPRINT) || name.ends_with(&format!("_{FOOTPRINT}"))
}

/// `base_link`, or the frame on the ground below it (REP 120) where the files place one and no position of `base_link`
/// is given: the frame of placements stands on the ground.
fn ground(frames: &mut FrameTree, settings: &ImportSettings, file: &str) -> String {
    let names = frames.names();
    let found = names.iter().find(|name| is_footprint(name));
    let below = found.and_then(|name| Some((name, frames.between(name, BASE_LINK)?)));
    match below {
        Some((name, pose)) if settings.mounting.base_link == [0.0; 3] && pose != IDENTITY => {
            frames.notes.push(Note::fact(format!(
                "{file}: `{BASE_LINK}` stands {} m above `{name}`; positions count from `{name}`, which is on the ground, \
                 and --base-frame {BASE_LINK} counts them from there",
                rounded(pose.z)
            )));
            name.clone()
        }
        _ => BASE_LINK.to_owned(),
    }
}

/// Metres to the micrometre, for messages.
fn rounded(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e6
}

/// True if a frame without other facts has the name of a LiDAR.
fn is_named_lidar(frame: &RigFrame) -> bool {
    frame.holds == FrameContent::Unsaid && is_name_of_lidar(&frame.name)
}

pub(super) fn is_name_of_lidar(name: &str) -> bool {
    let name = name.to_lowercase();
    WORDS.iter().any(|word| name.contains(word))
}

/// Frames that the files call LiDARs; if there are none, frames with names of LiDARs.
fn lidars(frames: &FrameTree) -> Vec<&RigFrame> {
    let said = |frame: &&RigFrame| matches!(frame.holds, FrameContent::Lidar { .. });
    let said: Vec<&RigFrame> = frames.all().iter().filter(said).collect();
    if !said.is_empty() {
        return said;
    }
    let named: Vec<&RigFrame> = frames.all().iter().filter(|frame| is_named_lidar(frame)).collect();
    // The foot of a sensor whose own frame stands on it is no second LiDAR.
    let feet: HashSet<&str> = named.iter().map(|frame| frame.parent.as_str()).collect();
    let stands_on_none = |frame: &&RigFrame| !feet.contains(frame.name.as_str());
    let upper: Vec<&RigFrame> = named.iter().copied().filter(stands_on_none).collect();
    // Feet only: a loop, which the chain reports.
    if upper.is_empty() { named } else { upper }
}

fn no_lidar(file: &str, known: &[String]) -> FormatError {
    let known = listed(known);
    refused!(
        "{file}: no frame is a LiDAR by its type or name; pick frames with --frame; there are {known}"
    )
}

/// The LiDARs, and the names of all other frames.
fn picked<'a>(
    frames: &'a FrameTree,
    settings: &ImportSettings,
    file: &str,
) -> Checked<(Vec<&'a RigFrame>, Vec<String>)> {
    let find = |name: &String| {
        frames.get(name).ok_or_else(|| {
            let (file, frame, known) = (file.to_owned(), name.clone(), frames.names());
            FormatError::UnknownFrame { file, frame, known }
        })
    };
    settings.sensors.keys().try_for_each(|name| find(name).map(drop))?;
    let lidars: Vec<&RigFrame> = if settings.frames.is_empty() {
        lidars(frames)
    } else {
        settings.frames.iter().map(find).collect::<Result<_, _>>()?
    };
    if lidars.is_empty() {
        return Err(no_lidar(file, &frames.names()));
    }
    if lidars.len() > MAX_LIDARS {
        return Err(refused!(
            "{file}: {} frames are LiDARs, at most {MAX_LIDARS} are read; pick some with --frame",
            lidars.len()
        ));
    }
    let taken: HashSet<&str> = lidars.iter().map(|frame| frame.name.as_str()).collect();
    let is_other =
        |frame: &&RigFrame| !frame.parent.is_empty() && !taken.contains(frame.name.as_str());
    let others = frames.all().iter().filter(is_other);
    let others = others.map(|frame| frame.name.clone()).collect();
    Ok((lidars, others))
}

/// A doubt about frames that have the name of a LiDAR and are left out, because others are LiDARs by type. A frame on
/// the way to a LiDAR, or right on one, is a part of it.
fn named_but_left_out(
    frames: &FrameTree,
    lidars: &[&RigFrame],
    settings: &ImportSettings,
    file: &str,
) -> Option<Note> {
    let mut parts: HashSet<&str> = HashSet::new();
    for lidar in lidars {
        let mut next = Some(*lidar);
        while let Some(frame) = next.filter(|frame| parts.insert(&frame.name)) {
            next = frames.get(&frame.parent);
        }
    }
    let taken: HashSet<&str> = lidars.iter().map(|frame| frame.name.as_str()).collect();
    let is_part = |frame: &RigFrame| {
        parts.contains(frame.name.as_str()) || taken.contains(frame.parent.as_str())
    };
    let is_missed = |frame: &&RigFrame| is_named_lidar(frame) && !is_part(frame);
    let missed = frames.all().iter().find(is_missed).filter(|_| settings.frames.is_empty())?;
    let name = &missed.name;
    Some(Note::doubt(format!(
        "{file}: `{name}` has the name of a LiDAR and is left out, since others have a sensor of that type; give it such a \
         sensor, or name every LiDAR with --frame"
    )))
}

/// The LiDAR of a frame. Where nothing tells the height of its optical centre, its name goes into `unknown`.
fn lidar(
    frames: &FrameTree,
    frame: &RigFrame,
    base: &str,
    format: RigFormat,
    settings: &ImportSettings,
    unknown: &mut Vec<String>,
) -> Checked<RigLidar> {
    let (said, optical) = match &frame.holds {
        FrameContent::Lidar { sensor, optical } => (sensor.clone(), *optical),
        _ => (None, None),
    };
    let (name, mounting) = (&frame.name, &settings.mounting);
    let sensor = settings.sensors.get(name).map(|name| beams::usual(name)).or(said);
    let stands_on_foot = || {
        frame.holds == FrameContent::Unsaid && frames.get(&frame.parent).is_some_and(is_named_lidar)
    };
    let given = mounting.given_height(name, sensor.as_deref());
    let up_from_foot = match (given, optical) {
        _ if !format.holds_feet() => IDENTITY,
        (Some(height), _) => up(height),
        (None, Some(optical)) => optical,
        (None, None) if stands_on_foot() => IDENTITY,
        (None, None) => {
            let height = mounting.height(name, sensor.as_deref());
            unknown.extend(height.is_none().then(|| name.clone()));
            up(height.unwrap_or(0.0))
        }
    };
    let pose = mounting.to_ego(&compose(&frames.in_base(base, frame)?, &up_from_foot));
    let phase = optical.and_then(|optical| optical.phase).or(frame.pose.phase);
    Ok(RigLidar { frame: name.clone(), sensor, pose: SensorPose { phase, ..pose } })
}
