//! Rigs in the formats of other programs, as files: read, written and compared.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::inputs::file_and_name;
use super::run_folder::rig_file;
use super::{RunError, Watcher, outputs};
use crate::files::{Session, safe_name, shared_folder, writable_file, writable_folder};
use crate::json::stream_text;
use crate::rig::{
    Comparison, Exported, FormatError, ImportSettings, ImportedRig, MODELS_FILE, Models, Mounting,
    NamedText, Rig, RigFormat, RigSource, compare, default_frame, export, import, import_texts,
    placement_doubts, read_rig, rig_json,
};
use crate::scene::Scene;
use crate::vehicle::{PlacementFileError, Vehicle, in_millimetres};

/// Most bytes of a rig on standard input, as of a file.
const MOST_INPUT: u64 = 16 << 20;
/// Frames left out that a note lists.
const MOST_LISTED: usize = 12;

/// Offsets from the frames of a file to optical centres in the ego frame.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct Mounted {
    /// Position of base_link in the ego frame, in metres [default: 0,0,0]
    #[cfg_attr(feature = "cli", arg(long, value_name = "X[,Y,Z]", value_parser = super::parse::base_link, allow_hyphen_values = true))]
    pub base_link: Option<[f64; 3]>,
    /// Optical centre above the foot of a sensor or frame [known: VLP-16, VLS-128]
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME=METRES", value_parser = super::parse::optical_height))]
    pub optical_height: Vec<(String, f64)>,
    /// Sensor in a frame, as lidar_0=VLP-16
    #[cfg_attr(feature = "cli", arg(long, value_name = "FRAME=MODEL", value_parser = super::parse::sensor_in_frame))]
    pub sensor: Vec<(String, String)>,
}

impl Mounted {
    /// The offsets, each name once.
    ///
    /// # Errors
    /// A name that comes twice.
    pub fn mounting(&self) -> Result<Mounting, RunError> {
        Ok(Mounting {
            base_link: self.base_link.unwrap_or_default(),
            optical_heights: by_name("--optical-height", &self.optical_height)?,
        })
    }

    /// Models by frame.
    ///
    /// # Errors
    /// A frame that comes twice.
    pub fn sensors(&self) -> Result<BTreeMap<String, String>, RunError> {
        by_name("--sensor", &self.sensor)
    }
}

/// Values of an option by name, each name once.
fn by_name<V: Clone>(option: &str, given: &[(String, V)]) -> Result<BTreeMap<String, V>, RunError> {
    let mut all = BTreeMap::new();
    for (name, value) in given {
        if all.insert(name.clone(), value.clone()).is_some() {
            return Err(RunError::Usage(format!("{option} {name}: comes twice; give it once")));
        }
    }
    Ok(all)
}

/// A placement that is to be written in the format of another program.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ExportRequest {
    /// File of placements, with :NAME of one where it has several
    #[cfg_attr(feature = "cli", arg(value_name = "PLACEMENTS[:NAME]"))]
    pub placement: String,
    /// Format: autoware, urdf, sdf, ros2-launch, carla, carla-objects, json
    #[cfg_attr(feature = "cli", arg(long, value_name = "FORMAT", value_parser = RigFormat::written))]
    pub format: RigFormat,
    /// File to write, for autoware a folder [default: standard output]
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE_OR_DIR"))]
    pub out: Option<PathBuf>,
    /// Name of a LiDAR's frame, one for each LiDAR [default: lidar_0, lidar_1, …]
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME"))]
    pub frame: Vec<String>,
    /// Scene whose sensors the LiDARs are: CARLA and Gazebo get the beams of each
    #[cfg_attr(feature = "cli", arg(long, value_name = "SCENE", conflicts_with = "vehicle"))]
    pub scene: Option<PathBuf>,
    /// Vehicle file whose sensors the LiDARs are
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub vehicle: Option<PathBuf>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub mounted: Mounted,
}

/// Writes a placement in the format of another program; returns its text where no file is given.
///
/// # Errors
/// Files that cannot be read or written, names that do not fit the rig, a rig that the format cannot express.
pub fn export_file(
    request: &ExportRequest,
    watcher: &dyn Watcher,
) -> Result<Option<String>, RunError> {
    let _session = Session::begin();
    let (sensors, mounting) = (request.mounted.sensors()?, request.mounted.mounting()?);
    let placement = rig_file(&request.placement)?;
    let (file, name) = file_and_name(&placement);
    let file = Path::new(file);
    if file.is_dir() {
        return Err(PlacementFileError::folder(file).into());
    }
    let mut rig = read_rig(file, name)?;
    let doubts = placement_doubts(&rig, &file.display().to_string());
    doubts.iter().try_for_each(|doubt| watcher.tell(doubt))?;
    let vehicle = vehicle_of(request)?;
    if let Some(vehicle) = &vehicle {
        rig.name_by_mounts(vehicle);
    }
    if !request.frame.is_empty() {
        let (given, lidars) = (request.frame.len(), rig.lidars.len());
        if given != lidars {
            return Err(FormatError::Refused(format!(
                "{given} names are given for {lidars} LiDARs; give one --frame for each"
            ))
            .into());
        }
        for (lidar, frame) in rig.lidars.iter_mut().zip(&request.frame) {
            lidar.frame.clone_from(frame);
        }
    }
    put_models(&mut rig, &sensors, file)?;
    check_heights(&rig, &mounting, file)?;
    let models = vehicle.as_ref().map(Models::from).unwrap_or_default();
    let exported = export(&rig, request.format, &mounting, &models)?;
    exported.warnings.iter().for_each(|warning| watcher.note(warning));
    match &request.out {
        Some(out) => write_files(&exported, out).map(|()| None),
        None => {
            // Models are a document of another kind than the YAML that is printed.
            let printed = exported.files.iter().filter(|file| file.name != MODELS_FILE);
            Ok(Some(printed.map(|file| &*file.text).collect()))
        }
    }
}

/// Gives LiDARs the models that `--sensor` names; `file` is that of the rig, for errors.
fn put_models(
    rig: &mut Rig,
    sensors: &BTreeMap<String, String>,
    file: &Path,
) -> Result<(), RunError> {
    for (frame, sensor) in sensors.clone() {
        let known: Vec<String> = rig.lidars.iter().map(|lidar| lidar.frame.clone()).collect();
        // `lidar_0` and the like stay good, whatever the mounts are called.
        let by_number = (0..known.len()).find(|&index| default_frame(index) == frame);
        let named = rig.lidars.iter().position(|lidar| lidar.frame == frame).or(by_number);
        match named {
            Some(index) => {
                let lidar = &mut rig.lidars[index];
                if let Some(named) = lidar.sensor.replace(sensor.clone())
                    && named != sensor
                {
                    return Err(RunError::Usage(format!(
                        "{}: LiDAR {index} is a `{named}`, and --sensor {frame}={sensor} says otherwise; leave one of \
                         them out",
                        file.display()
                    )));
                }
            }
            None => {
                let file = file.display().to_string();
                return Err(FormatError::UnknownFrame { file, frame, known }.into());
            }
        }
    }
    Ok(())
}

/// Refuses an `--optical-height` of a name that is neither a frame nor a sensor of the rig in `file`.
fn check_heights(rig: &Rig, mounting: &Mounting, file: &Path) -> Result<(), RunError> {
    let Some(frame) = mounting.unused(rig) else { return Ok(()) };
    let frames = rig.lidars.iter().map(|lidar| lidar.frame.clone());
    let sensors: BTreeSet<String> =
        rig.lidars.iter().filter_map(|lidar| lidar.sensor.clone()).collect();
    let (file, frame) = (file.display().to_string(), frame.to_owned());
    Err(FormatError::UnknownFrame { file, frame, known: frames.chain(sensors).collect() }.into())
}

/// The vehicle that a rig stands on: that of the vehicle file, else of the scene; `None` where neither is named.
fn vehicle_of(request: &ExportRequest) -> Result<Option<Vehicle>, RunError> {
    Ok(match (&request.vehicle, &request.scene) {
        (Some(file), _) => Some(Vehicle::read(file)?),
        (None, Some(file)) => Some(Scene::read(file)?.vehicle().clone()),
        (None, None) => None,
    })
}

/// Writes one file to `out`, several into the folder `out`.
fn write_files(exported: &Exported, out: &Path) -> Result<(), RunError> {
    match &exported.files[..] {
        [file] if !out.is_dir() => {
            let ending = Path::new(&file.name).extension().unwrap_or_default().to_string_lossy();
            outputs::check_file(out, &ending)?;
            outputs::write_text(out, &file.text)
        }
        files => {
            writable_folder(out)?;
            shared_folder(out)?;
            // Checks all files first, so that none is written unless all can be.
            let place = |file: &NamedText| out.join(safe_name(&file.name));
            files.iter().try_for_each(|file| writable_file(&place(file)))?;
            files.iter().try_for_each(|file| outputs::write_text(&place(file), &file.text))
        }
    }
}

/// Reads a rig of another program and writes it as a placement; returns its text where no file is given. A single
/// file may have the name of a placement behind a colon.
///
/// # Errors
/// Files that cannot be read or written, files of no rig.
pub fn import_files(
    files: &[PathBuf],
    settings: &ImportSettings,
    out: Option<&Path>,
    watcher: &dyn Watcher,
) -> Result<Option<String>, RunError> {
    let _session = Session::begin();
    if files.len() > 1 && files.iter().any(|file| file == Path::new("-")) {
        return Err(RunError::Usage(
            "-: stands for standard input alone, the whole rig; give it as the only file, or give files".into(),
        ));
    }
    let only = match files {
        [only] if settings.name.is_none() => only.to_str(),
        _ => None,
    };
    let imported = match only {
        _ if files == [Path::new("-")] => import_texts(&[standard_input()?], settings)?,
        Some(only) => named_rig(only, settings)?,
        None => import(files, settings)?,
    };
    let rig = &imported.rig;
    if let Some(first) = files.first() {
        check_heights(rig, &settings.mounting, first)?;
    }
    for (index, lidar) in rig.lidars.iter().enumerate() {
        let sensor = lidar.sensor.as_deref().unwrap_or("sensor not known");
        let place = in_millimetres(&lidar.pose);
        watcher.note(&format!("LiDAR {index} is `{}`, {sensor}: {place}", lidar.frame));
    }
    say(&imported, watcher)?;
    let text = format!("{:#}\n", rig_json(&[rig]));
    let Some(out) = out else { return Ok(Some(text)) };
    writable_file(out)?;
    outputs::write_text(out, &text)?;
    Ok(None)
}

/// A rig's text from standard input.
fn standard_input() -> Result<RigSource, RunError> {
    let file = "standard input".to_owned();
    let text =
        stream_text(std::io::stdin().lock(), &file, MOST_INPUT).map_err(FormatError::from)?;
    Ok(RigSource { file, text })
}

/// Reads a file or folder of any format; a name behind a colon picks one of several placements.
fn named_rig(text: &str, settings: &ImportSettings) -> Result<ImportedRig, FormatError> {
    let (file, name) = file_and_name(text);
    let settings = ImportSettings { name: name.map(str::to_owned), ..settings.clone() };
    import(&[file.into()], &settings)
}

/// Notes the frames that were left out, and doubts.
fn say(imported: &ImportedRig, watcher: &dyn Watcher) -> Result<(), RunError> {
    let left_out = &imported.left_out;
    if !left_out.is_empty() {
        let shown = left_out[..left_out.len().min(MOST_LISTED)].join(", ");
        let more = left_out.len().saturating_sub(MOST_LISTED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        watcher.note(&format!("left out, not being LiDARs: {shown}{more}"));
    }
    imported.notes.iter().try_for_each(|note| watcher.tell(note))
}

/// Compares two rigs, each a file or folder of any format, or placements with a name behind a colon.
///
/// # Errors
/// Files that cannot be read.
pub fn compare_files(
    before: &str,
    after: &str,
    settings: &ImportSettings,
    watcher: &dyn Watcher,
) -> Result<Comparison, RunError> {
    if [before, after].contains(&"-") {
        return Err(RunError::Usage(
            "-: stands for standard input alone in `rig import`; give two files to compare".into(),
        ));
    }
    let read = |text: &str| {
        let imported = named_rig(&rig_file(text)?, settings)?;
        imported.notes.iter().for_each(|note| watcher.detail(note.text()));
        Ok::<_, RunError>(imported.rig)
    };
    Ok(compare(&read(before)?, &read(after)?))
}
