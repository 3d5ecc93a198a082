//! A rig handed over: a folder with its poses, bill of materials, masks and crop boxes of the own body, drawing and
//! sensor profiles.
//!
//! | file | holds |
//! |---|---|
//! | `rig` | the placement with everything that is computed about it |
//! | `run` | the folder of a run in place of a file of placements |
//! | `mask` | masks of the beams that end at the own body, and a grey picture as PNG |

mod body_parts;
mod mask;
mod rig;
mod run;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use serde_json::json;

use super::{Computing, RunError};
use crate::csv::{csv, rounded};
use crate::files::{
    Input, Session, is_forced, safe_name, safe_names, writable_folder, write_folder,
};
use crate::report::handover::{DrawnLidar, DrawnMount, DrawnRig};
use crate::scene::Scene;
use crate::score::{Guard, percent_up};
use crate::shared::FieldOfView;
use crate::vehicle::sensor_file::isaac_profile;
use crate::vehicle::{MAX_LIDARS, Placement, SensorPose, sum_of_prices};
use mask::{FREE, NONE, OWN, SelfHitMask};
use rig::HandoverRig;

/// A placement that is to be handed over.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct HandoverRequest {
    /// A scene, none for level ground, then a file of placements, with :NAME of one where it has several; or the folder
    /// of a run, for its optimum on the vehicle of the run
    #[cfg_attr(feature = "cli", arg(value_name = "[SCENE] PLACEMENTS", required = true, num_args = 1..))]
    pub files: Vec<String>,
    /// Folder to write, new or empty
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
    /// Frame of the scene, from 0
    #[cfg_attr(feature = "cli", arg(long, default_value_t = 0, value_name = "T"))]
    pub frame: u32,
    /// Metres that crop boxes reach beyond the own body
    #[cfg_attr(feature = "cli", arg(long, default_value_t = 0.05, value_name = "METRES", value_parser = super::parse::number_that(|metres| (0.0..=10.0).contains(&metres), "metres from 0 to 10")))]
    pub margin: f64,
    /// Position of base_link in the ego frame, in metres [default: 0,0,0]
    #[cfg_attr(feature = "cli", arg(long, value_name = "X[,Y,Z]", value_parser = super::parse::base_link, allow_hyphen_values = true))]
    pub base_link: Option<[f64; 3]>,
    /// Scene and placement that a caller has in memory
    #[cfg_attr(feature = "cli", arg(skip))]
    pub held: Held,
}

/// Scene and placement in memory, each in place of its file. `files` then has the name of each.
#[derive(Debug, Clone, Default)]
pub struct Held {
    /// The scene; `None` reads its file.
    pub scene: Option<Arc<Scene>>,
    /// The placement; `None` reads its file.
    pub placement: Option<Placement>,
}

/// Summary of a folder that was written.
#[derive(Debug, Serialize)]
pub struct HandoverMade {
    /// The folder.
    pub out: PathBuf,
    /// Name of the placement.
    pub placement: String,
    /// Names of its files.
    pub files: Vec<String>,
    /// For each LiDAR the beams that end at the own body, and all beams.
    pub own_beams: Vec<[usize; 2]>,
    /// Price of all sensors.
    pub price: f64,
    /// Guards `self_hit` of its LiDARs in this frame, in words.
    pub guards: Vec<String>,
    /// The frame of the masks, where bodies move.
    #[serde(skip)]
    pub frame: Option<u32>,
}

/// Names and bytes of the files of the folder.
type NamedFiles = Vec<(String, Vec<u8>)>;

/// Writes the folder of a placement, whole or not at all.
///
/// # Errors
/// Files that cannot be read or written, several placements without a name, a frame that the scene does not have.
pub fn handover(
    request: &HandoverRequest,
    computing: &Computing<'_>,
) -> Result<HandoverMade, RunError> {
    let _session = Session::begin();
    writable_folder(&request.out)?;
    let rig = HandoverRig::new(request, computing)?;
    let masks = rig.masks();
    let guards: Vec<String> = rig.guards.iter().map(Guard::to_string).collect();
    guards.iter().for_each(|guard| computing.watcher.note(guard));
    let (materials, price) = materials(&rig);
    let mut files: NamedFiles = Vec::new();
    let mut add = |name: &str, bytes: Vec<u8>| files.push((name.to_owned(), bytes));
    add("poses.csv", poses(&rig, request.base_link).into_bytes());
    add("materials.csv", materials.into_bytes());
    let drawing = drawn(&rig).drawing();
    add("drawing.svg", drawing.svg().into_bytes());
    add("drawing.pdf", drawing.pdf());
    if let Some(boxes) = mask::boxes(&rig, request.margin, request.base_link.unwrap_or_default()) {
        add("crop_boxes.yaml", boxes.into_bytes());
    }
    for (k, mask) in masks.iter().enumerate() {
        let mount =
            rig.mounts[k].as_deref().map_or(String::new(), |m| format!("-{}", safe_name(m)));
        add(&format!("mask-{k}{mount}.csv"), mask.csv().into_bytes());
        add(&format!("mask-{k}{mount}.png"), mask.png());
    }
    files.extend(profiles(&rig));
    let readme = text(&rig, request, &masks, files.iter().map(|(name, _)| &**name))?;
    files.insert(0, ("README.txt".to_owned(), readme.into_bytes()));
    if !computing.watcher.goes_on() {
        return Err(RunError::Interrupted(format!(
            "{}: interrupted; nothing is written",
            request.out.display()
        )));
    }
    write_folder(&request.out, &files)?;
    if is_forced() {
        remove_stale_masks(&request.out, &files)?;
    }
    Ok(HandoverMade {
        out: request.out.clone(),
        placement: rig.placement.name.clone(),
        files: files.into_iter().map(|(name, _)| name).collect(),
        own_beams: masks.iter().map(SelfHitMask::counts).collect(),
        price,
        guards,
        frame: rig.frame_in_words().map(|_| request.frame),
    })
}

/// Lines of the guards, but for LiDARs of which the run that found the rig has said so over all of its frames.
fn unsaid_self_hits(rig: &HandoverRig) -> Vec<String> {
    let lines = rig.guards.iter().map(|guard| format!("Warning: {guard}"));
    let is_said = |line: &String| {
        let lidar: String = line.split_inclusive(' ').take(4).collect();
        rig.of_run.iter().any(|said| said.starts_with(&lidar))
    };
    lines.filter(|line| !is_said(line)).collect()
}

/// Lines on LiDARs that end many of their beams at the own body: of the run that found the rig, and of this frame.
fn self_hits_in_words(rig: &HandoverRig) -> Vec<String> {
    let said = rig.of_run.iter().filter(|line| line.starts_with("Warning: self_hit")).cloned();
    said.chain(unsaid_self_hits(rig)).collect()
}

/// Removes masks that an earlier rig of more or other LiDARs has left in a folder: they would be taken for this one's.
fn remove_stale_masks(out: &Path, files: &NamedFiles) -> Result<(), RunError> {
    for entry in std::fs::read_dir(out).map_err(RunError::io(out))? {
        let entry = entry.map_err(RunError::io(out))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_stale = is_mask(&name) && files.iter().all(|(written, _)| *written != name);
        // Links and folders are nobody's but the user's.
        if is_stale && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            std::fs::remove_file(entry.path()).map_err(RunError::io(&entry.path()))?;
        }
    }
    Ok(())
}

/// True for a name that this command gives to a mask: `mask-3.csv`, `mask-3-roof.png`.
fn is_mask(name: &str) -> bool {
    let stem = name.strip_suffix(".csv").or_else(|| name.strip_suffix(".png"));
    let Some(rest) = stem.and_then(|stem| stem.strip_prefix("mask-")) else { return false };
    let (number, mount) = rest.split_once('-').unwrap_or((rest, "of no mount"));
    let is_number =
        number.parse::<usize>().is_ok_and(|k| k < MAX_LIDARS && k.to_string() == number);
    is_number && !mount.is_empty()
}

fn drawn(rig: &HandoverRig) -> DrawnRig<'_> {
    let lidars = rig.placement.lidars.iter().enumerate().map(|(k, pose)| DrawnLidar {
        pose: *pose,
        ego_from_sensor: rig.poses[k],
        view: FieldOfView::of(rig.table(k)),
        model: rig.model_name(rig.models[k]),
        mount: rig.mounts[k].clone().unwrap_or_default(),
    });
    let vehicle = rig.scene().vehicle();
    let mounts = vehicle.mounts.iter().filter(|mount| rig.is_in_place(&mount.region));
    let mounts = mounts.map(|mount| DrawnMount {
        name: if vehicle.is_nameless() { String::new() } else { mount.region.name.clone() },
        corners: mount.region.corners(),
    });
    DrawnRig {
        vehicle: rig.vehicle_name(),
        placement: &rig.placement.name,
        body: &rig.body,
        lidars: lidars.collect(),
        mounts: mounts.collect(),
        near: rig.near.as_ref().map(|(outline, near)| (outline, near)).map_err(Clone::clone),
        about: rig.about.clone(),
        warnings: rig.warnings.iter().cloned().chain(self_hits_in_words(rig)).collect(),
    }
}

/// Isaac Sim's profile of each model that the rig has.
fn profiles(rig: &HandoverRig) -> NamedFiles {
    let used = rig.used_models();
    let names: Vec<String> = used.iter().map(|model| rig.model_name(*model)).collect();
    let files = safe_names(names.iter().map(|name| &**name)).into_iter();
    let profile = |((model, name), file): ((&usize, &String), String)| {
        let sensor = &rig.scene().vehicle().sensors[*model];
        let profile = isaac_profile(name, &sensor.lidar, &sensor.response);
        (format!("{file}.isaac.json"), format!("{profile:#}\n").into_bytes())
    };
    used.iter().zip(&names).zip(files).map(profile).collect()
}

/// Decimals of metres and radians, of millimetres, and of degrees: a thousandth of a millimetre, and less than that at the
/// end of a lever of 50 m.
const FINE: i32 = 12;
const OF_MM: i32 = 3;
const OF_DEGREES: i32 = 6;
/// Decimals of a price.
const OF_PRICE: i32 = 9;

/// A line a LiDAR: number, mount, model, position in metres and millimetres, angles in radians and degrees; the position
/// from `base_link`, too, where that is given by its place in the ego frame.
fn poses(rig: &HandoverRig, base_link: Option<[f64; 3]>) -> String {
    let titles = [
        "lidar", "mount", "model", "x_m", "y_m", "z_m", "x_mm", "y_mm", "z_mm", "roll_rad",
        "pitch_rad", "yaw_rad", "roll_deg", "pitch_deg", "yaw_deg", "phase_rad", "phase_deg",
    ];
    let mut rows = vec![titles.map(str::to_owned).to_vec()];
    let from_base = base_link.map(|_| ["base_link_x_m", "base_link_y_m", "base_link_z_m"]);
    rows[0].extend(from_base.into_iter().flatten().map(str::to_owned));
    let any_rides = rig.placement.lidars.iter().any(|pose| !pose.rides_on.is_none());
    let carried = ["rides_on", "body_x_m", "body_y_m", "body_z_m", "body_roll_deg"];
    let carried = carried.into_iter().chain(["body_pitch_deg", "body_yaw_deg"]);
    rows[0].extend(carried.filter(|_| any_rides).map(str::to_owned));
    for (k, pose) in rig.placement.lidars.iter().enumerate() {
        let [place, angles] = [[pose.x, pose.y, pose.z], [pose.roll, pose.pitch, pose.yaw]];
        let mount = rig.mounts[k].clone().unwrap_or_default();
        let mut row = vec![k.to_string(), mount, rig.model_name(rig.models[k])];
        row.extend(place.map(|metres| rounded(metres, FINE)));
        row.extend(place.map(|metres| rounded(1000.0 * metres, OF_MM)));
        row.extend(angles.map(|angle| rounded(angle, FINE)));
        row.extend(angles.map(|angle| rounded(angle.to_degrees(), OF_DEGREES)));
        // One that spins freely has another phase at every moment.
        let phase = pose.phase.filter(|_| !rig.spins_freely[k]);
        row.push(phase.map_or(String::new(), |phase| rounded(phase, FINE)));
        row.push(phase.map_or(String::new(), |phase| rounded(phase.to_degrees(), OF_DEGREES)));
        let from_base = base_link.map(|base| [0, 1, 2].map(|axis| place[axis] - base[axis]));
        row.extend(from_base.into_iter().flatten().map(|metres| rounded(metres, FINE)));
        if any_rides {
            row.extend(on_body(rig, pose));
        }
        rows.push(row);
    }
    csv(rows)
}

/// The body that carries a LiDAR, and its pose in that body's own frame; empty cells where none does.
fn on_body(rig: &HandoverRig, pose: &SensorPose) -> Vec<String> {
    let Some(ego_from_body) = rig.scene().carrier_pose(pose.rides_on) else {
        return vec![String::new(); 7];
    };
    let own = SensorPose::from(&ego_from_body.inverse().compose(&pose.ego_from_sensor()));
    let place = [own.x, own.y, own.z].map(|metres| rounded(metres, FINE));
    let angles = [own.roll, own.pitch, own.yaw].map(|a| rounded(a.to_degrees(), OF_DEGREES));
    let body = pose.rides_on.to_string();
    std::iter::once(body).chain(place).chain(angles).collect()
}

/// A line a model: how many, price of one, price of all; last the sum. Returns the sum, too.
fn materials(rig: &HandoverRig) -> (String, f64) {
    let mut rows = vec![["model", "count", "price_each", "price"].map(str::to_owned)];
    let total = sum_of_prices(rig.models.iter().map(|model| rig.price(*model)));
    for model in rig.used_models() {
        let count = rig.models.iter().filter(|of| **of == model).count();
        let each = rig.price(model);
        let all = sum_of_prices(std::iter::repeat_n(each, count));
        rows.push([
            rig.model_name(model),
            count.to_string(),
            each.to_string(),
            rounded(all, OF_PRICE),
        ]);
    }
    rows.push([
        "total".to_owned(),
        rig.models.len().to_string(),
        String::new(),
        rounded(total, OF_PRICE),
    ]);
    (csv(rows), total)
}

const CONVENTION: &str = "\
Frame: ISO 8855, the ego frame. x ahead, y left, z up; origin on the ground below the vehicle's reference point.
Positions are optical centres. Angles: R = Rz(yaw) * Ry(pitch) * Rx(roll), sensor to vehicle: a positive yaw turns
left, a positive pitch looks down, a positive roll lifts the left side. The sensor's own frame: x ahead, y left, z up;
azimuth counter-clockwise from x, elevation up from the xy plane. phase: a turn about the sensor's own z before all
others; empty for a sensor that spins freely.
";

const FILES: [(&str, &str); 6] = [
    (
        "poses.csv",
        "LiDARs by number: mount, model, position in m and mm, angles in rad and degrees, in the ego frame; \
         base_link_*: the position in base_link, where --base-link gives it (angles are the same); of a LiDAR that rides on \
         a body of the vehicle all these are as in frame 0, and body_* is its pose in the frame of that body",
    ),
    ("materials.csv", "models, how many, price of one, price of all; the last line is the sum"),
    ("drawing.svg", "from above, from the right, from the front, at one scale, on A3"),
    ("drawing.pdf", "the same drawing"),
    ("crop_boxes.yaml", "boxes of the own body for Autoware's crop_box_filter, in base_link"),
    (
        ".isaac.json",
        "lidar profile of a model for Isaac Sim, degrees and metres; divergence and phase have no place in it",
    ),
];

fn text<'a>(
    rig: &HandoverRig,
    request: &HandoverRequest,
    masks: &[SelfHitMask<'_>],
    files: impl Iterator<Item = &'a str>,
) -> Result<String, RunError> {
    let (vehicle, placement) = (rig.vehicle_name(), &rig.placement.name);
    let mut text = format!("{vehicle}, placement {placement}: LiDARs to be handed over\n\n");
    let own = unsaid_self_hits(rig);
    let lines = rig.of_run.iter().chain(&rig.warnings).chain(&own).chain(&rig.about);
    lines.for_each(|line| text += &format!("{}\n", without_folders(line)));
    for note in &rig.scene().vehicle().notes {
        let _ = writeln!(text, "Note: {}", without_folders(note.text()));
    }
    let _ = write!(text, "\n{CONVENTION}\nFiles\n");
    for file in files {
        let known = FILES.iter().find(|(name, _)| file.ends_with(name));
        let words = known.map_or("mask of the own body, see below", |(_, words)| *words);
        let _ = writeln!(text, "  {file}: {words}");
    }
    let _ = write!(
        text,
        "\nMasks: mask-N-MOUNT of LiDAR N. A beam is masked if its closest hit within range is the own body, in frame \
         {} of {}.\nCSV: a row a channel, a column an azimuth; the first line has the azimuths, the first columns have channel,\n\
         elevation and azimuth offset, in degrees; 1 is the own body. A beam points at the azimuth of its column plus\n\
         the offset of its channel. PNG: the same rows and columns, {OWN} own body, {FREE} any other beam.\n\
         Sensors without channels: a row a beam; the PNG then has azimuth 180 to -180 degrees from left to right and\n\
         elevation 90 to -90 from top to bottom, half a degree a pixel, {NONE} where no beam points.\n",
        request.frame,
        rig.scene().name()
    );
    for (k, mask) in masks.iter().enumerate() {
        let [own, all] = mask.counts();
        let channels = if mask.is_grid() { "" } else { ", no channels" };
        // Guards are over the angles that scores have, masks are of the sensor at rest.
        let at_rest = if rig.spins_freely[k] { " at its angle 0" } else { "" };
        let share = percent_up(own as f64 / all as f64);
        let _ =
            writeln!(text, "  LiDAR {k}: {own} of {all} beams, {share:.1} %{at_rest}{channels}");
    }
    let (margin, [x, y, z]) = (request.margin, request.base_link.unwrap_or_default());
    let _ = write!(
        text,
        "\nCrop boxes reach {margin} m beyond the body. base_link stands at x {x}, y {y}, z {z} m in the ego frame.\n"
    );
    text += &rig.frame_in_words().map_or(String::new(), |words| words + "\n");
    text += "\nMade by sightline ";
    text += env!("CARGO_PKG_VERSION");
    text += " from these files, named without their folders, with the SHA-256 of each\n";
    let mut inputs = rig.scene().files().to_vec();
    inputs.extend(rig.file.as_ref().map(PathBuf::from));
    inputs.retain(|file| file.is_file());
    inputs.sort();
    inputs.dedup();
    for input in json!(Input::names_of(&inputs)?).as_array().into_iter().flatten() {
        let word = |key: &str| input[key].as_str().unwrap_or_default().to_owned();
        let _ = writeln!(text, "  {}  {}", word("sha256"), word("file"));
    }
    Ok(text)
}

/// A sentence or a command in which absolute paths are names alone: whoever gets the folder has other folders.
fn without_folders(words: &str) -> String {
    let named = |word: &str| {
        // An option's value, and paths in brackets or quotes.
        let (before, path) = word.split_at(word.find('/').unwrap_or(0));
        let begins = before.is_empty() || before.ends_with(['=', '(', '[', '`', '"', ',']);
        let (before, path) = if begins { (before, path) } else { ("", word) };
        let name = Path::new(path).file_name().filter(|_| Path::new(path).is_absolute());
        let name = name.map_or_else(|| path.into(), |name| name.to_string_lossy());
        format!("{before}{name}")
    };
    // Paths with spaces stand between quotes.
    let part = |(k, part): (usize, &str)| match k % 2 == 1 && Path::new(part).is_absolute() {
        true => named(part),
        false => part.split(' ').map(named).collect::<Vec<_>>().join(" "),
    };
    words.split('\'').enumerate().map(part).collect::<Vec<_>>().join("'")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn paths_of_this_machine_are_names_alone() {
        let command = "sightline optimize '/a b/c d.json' --vehicle /e/van.json --seed 1 out/run";
        let words = "sightline optimize 'c d.json' --vehicle van.json --seed 1 out/run";
        assert_eq!(without_folders(command), words);
        let command = "sightline score --vehicle=/e/van.json (see `/e/f.json` or /g)";
        let words = "sightline score --vehicle=van.json (see `f.json` or g)";
        assert_eq!(without_folders(command), words);
        let note = "/e/van.json: beams a/b, 3 / 4 of the vehicle's; see /e/f/wheel.obj.";
        let words = "van.json: beams a/b, 3 / 4 of the vehicle's; see wheel.obj.";
        assert_eq!(without_folders(note), words);
    }

    #[test]
    fn only_names_of_masks_are_masks() {
        for mask in ["mask-0.csv", "mask-15-roof.png", "mask-3-front-left.csv"] {
            assert!(is_mask(mask), "{mask}");
        }
        for other in [
            "mask-16.csv", "mask-03.csv", "mask-a.png", "mask-1-.png", "mask-1.txt", "mask.csv",
            "my-mask-1.csv",
        ] {
            assert!(!is_mask(other), "{other}");
        }
    }
}
