//! The rig: LiDARs by name on one vehicle, read from and written to placements of this program.
//!
//! Two rigs are compared LiDAR by LiDAR, and each with its own mirror image.

use std::collections::HashSet;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::frames::{tilt, turn};
use super::yaml::missing;
use super::{Checked, FormatError, RigFormat, RigSource, import, sdf, yaml};
use crate::error::listed;
use sightline_files::json::{self, DescriptionError, FileKind, Location};
use sightline_scene::vehicle::{
    Placement, SensorName, SensorPose, Vehicle, placement_to_nanometres,
};

/// Name that ROS gives the frame of a vehicle.
pub(super) const BASE_LINK: &str = "base_link";
/// Longest name of a frame or sensor, in bytes.
const MAX_FRAME: usize = 128;

/// The LiDARs of one vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Name of the placement: 1 to 64 letters, digits, `.`, `_`, `-`.
    pub name: String,
    /// 1 to 16 LiDARs, in the order of the file.
    pub lidars: Vec<RigLidar>,
}

/// One LiDAR of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RigLidar {
    /// Name of its frame, once in a rig; no spaces or control characters.
    pub frame: String,
    /// Sensor model, as `VLP-16`, where it is known.
    pub sensor: Option<String>,
    /// Optical centre in the ego frame.
    pub pose: SensorPose,
}

impl Rig {
    /// The rig as a placement, without the names of frames.
    pub fn placement(&self) -> Placement {
        let lidar = |lidar: &RigLidar| {
            let sensor = lidar.sensor.as_deref().and_then(|name| SensorName::new(name).ok());
            SensorPose { sensor: sensor.unwrap_or_default(), ..lidar.pose }
        };
        Placement { name: self.name.clone(), lidars: self.lidars.iter().map(lidar).collect() }
    }

    /// Names frames after the mounts of a vehicle that hold them: `roof_lidar`, with a number behind where a mount holds
    /// several. Readers know a LiDAR by that word. A LiDAR on no mount keeps its frame.
    pub fn name_by_mounts(&mut self, vehicle: &Vehicle) {
        let poses: Vec<SensorPose> = self.lidars.iter().map(|lidar| lidar.pose).collect();
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let plain = |name: &str| name.chars().map(plain).collect::<String>();
        let mounts: Vec<Option<String>> =
            vehicle.mount_names(&poses).into_iter().map(|name| name.map(plain)).collect();
        for (index, mount) in mounts.iter().enumerate() {
            let Some(name) = mount else { continue };
            let alike = |lidars: &[Option<String>]| lidars.iter().filter(|m| *m == mount).count();
            self.lidars[index].frame = match alike(&mounts) {
                1 => format!("{name}_lidar"),
                _ => format!("{name}_lidar_{}", alike(&mounts[..index])),
            };
        }
    }

    /// Checks the name, the number of LiDARs, their frames and every number.
    pub fn validate(&self) -> Result<(), FormatError> {
        self.placement().validate()?;
        let mut names = HashSet::from([BASE_LINK]);
        // Characters that XML cannot hold, escaped or not.
        let unwritable = |c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}');
        for RigLidar { frame, sensor, .. } in &self.lidars {
            if let Some(name) = sensor
                && (name.trim().is_empty() || name.len() > MAX_FRAME || name.contains(unwritable))
            {
                return Err(refused!(
                    "{name:?} is not a name of a sensor: use 1 to {MAX_FRAME} bytes without control characters"
                ));
            }
            let odd = |c: char| c.is_whitespace() || unwritable(c);
            if frame.is_empty() || frame.len() > MAX_FRAME || frame.contains(odd) {
                return Err(refused!(
                    "`{frame}` is not a name of a frame: use 1 to {MAX_FRAME} bytes without spaces"
                ));
            }
            if !names.insert(frame) {
                return Err(refused!(
                    "the frame `{frame}` is used twice, or is that of the vehicle; names must differ"
                ));
            }
        }
        Ok(())
    }
}

/// Frame of a LiDAR without a name.
pub fn default_frame(index: usize) -> String {
    format!("lidar_{index}")
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigFile {
    #[serde(rename = "$schema", skip_serializing)]
    _schema: Option<String>,
    #[serde(default, rename = "sightline", deserialize_with = "json::version_1", skip_serializing)]
    _version: Option<u64>,
    placements: Vec<Placement>,
}

/// Reads one placement of a file; where the file holds several, `name` picks it.
///
/// # Errors
/// A file that cannot be read, or none or several placements to pick from.
pub fn read_rig(path: &Path, name: Option<&str>) -> Result<Rig, FormatError> {
    rig_of(&RigSource::read(path)?, name)
}

/// Reads one placement of a text, a document or one placement a line.
pub(super) fn rig_of(source: &RigSource, name: Option<&str>) -> Checked<Rig> {
    let RigSource { file, text } = source;
    let mut all = if file.ends_with(".jsonl") {
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let parse = |(number, line)| json::parse(line, &format!("{file}, line {}", number + 1));
        lines.map(parse).collect::<Result<Vec<Placement>, _>>()?
    } else {
        refuse_others(text, file)?;
        json::parse::<RigFile>(text, file)?.placements
    };
    let picked = match name {
        Some(name) => all.iter().position(|placement| placement.name == name),
        None => (all.len() == 1).then_some(0),
    };
    let Some(picked) = picked else {
        if all.is_empty() {
            return Err(missing(&Location::top(file), "a placement"));
        }
        let fault = name.map(|name| format!("no placement is called `{name}`"));
        let fault = fault.unwrap_or_else(|| "holds several placements".to_owned());
        let known: Vec<String> = all.into_iter().map(|placement| placement.name).collect();
        let known = listed(&known);
        return Err(refused!(
            "{file}: {fault}; pick one of {known} as FILE:NAME (in Python name=NAME)"
        ));
    };
    let Placement { name, lidars } = all.swap_remove(picked);
    let lidar = |(index, pose): (usize, SensorPose)| RigLidar {
        frame: default_frame(index),
        sensor: (!pose.sensor.is_none()).then(|| pose.sensor.to_string()),
        pose: SensorPose { sensor: SensorName::default(), ..pose },
    };
    let rig = Rig { name, lidars: lidars.into_iter().enumerate().map(lidar).collect() };
    rig.validate().map_err(|fault| refused!("{file}: {fault}"))?;
    Ok(rig)
}

/// Refuses a text that is no file of placements, by its kind.
fn refuse_others(text: &str, file: &str) -> Result<(), DescriptionError> {
    let wanted = FileKind::Placements;
    json::refuse_comment(text, file)?;
    match json::not_json(text) {
        Some(told) => Err(DescriptionError::NotJson { file: file.to_owned(), told, wanted }),
        None if FileKind::of(text) == Some(wanted) => Ok(()),
        None => json::refuse_own_kinds(text, file, &wanted.to_string()),
    }
}

/// The placements file of rigs, with numbers of at most nine digits.
pub fn rig_json(rigs: &[&Rig]) -> Value {
    let written = rigs.iter().map(|rig| placement_to_nanometres(&rig.placement()));
    serde_json::json!(RigFile { _schema: None, _version: None, placements: written.collect() })
}

/// Largest difference of angles that are taken for equal, in radians.
const SAME: f64 = 1e-9;
/// Largest move in metres, and largest turn in radians, that is taken for rounding of a file.
const STILL: f64 = 5e-6;

/// A LiDAR before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MovedLidar {
    /// Its frame, as the first rig calls it.
    pub frame: String,
    /// Its frame, as the second rig calls it.
    pub partner: String,
    /// Distance between the optical centres, in metres.
    pub moved: f64,
    /// Angle between the rotations, in radians.
    pub turned: f64,
    /// Angle between the sensors' own z axes, in radians: a turn about z changes no beam of a full circle.
    pub tilted: f64,
    /// Sensor models before and after; `None` for one that is not known.
    pub models: [Option<String>; 2],
    /// Bodies that carry it before and after, `""` for none; `None` where they are the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rides_on: Option<[SensorName; 2]>,
}

impl MovedLidar {
    /// True if it was moved or turned, or has another model or carrier. An unknown model counts as equal.
    fn differs(&self) -> bool {
        let of_other_models =
            matches!(&self.models, [Some(before), Some(after)] if before != after);
        self.moved > STILL || self.turned > STILL || of_other_models || self.rides_on.is_some()
    }
}

/// How far a pair of LiDARs is from being mirror images at the plane y = 0, or one LiDAR from being its own.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Asymmetry {
    /// The LiDAR of larger y.
    pub left: String,
    /// Its partner; the same LiDAR where it stands near the plane.
    pub right: String,
    /// Distance between the left one and the right one's image, in metres.
    pub moved: f64,
    /// Angle between their rotations, in radians.
    pub turned: f64,
    /// Angle between their z axes, in radians.
    pub tilted: f64,
    /// True if both have the same roll other than 0: in a mirror image roll changes its sign.
    pub same_roll: bool,
    /// Sensor models of the left and the right one; `None` for one that is not known.
    pub models: [Option<String>; 2],
}

/// Two rigs compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// LiDARs that both rigs have, in the order of the first rig.
    pub lidars: Vec<MovedLidar>,
    /// Frames of LiDARs without a partner, of the first and of the second rig.
    pub alone: [Vec<String>; 2],
    /// LiDARs that differ in pose or model.
    pub different: usize,
    /// Vector from the first rig to the second by which all of several LiDARs moved without a turn, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift: Option<[f64; 3]>,
    /// Asymmetry of the first rig.
    pub before: Vec<Asymmetry>,
    /// Asymmetry of the second rig.
    pub after: Vec<Asymmetry>,
}

/// Compares LiDARs of the same frames, or by their order where the frames differ. Rigs of different numbers of LiDARs are
/// compared by the frames that both name, then by least distance; the other LiDARs have no partner.
pub fn compare(before: &Rig, after: &Rig) -> Comparison {
    let matched = matched(&before.lidars, &after.lidars);
    let pair = |&(a, b): &(usize, usize)| (&before.lidars[a], &after.lidars[b]);
    let pairs: Vec<(&RigLidar, &RigLidar)> = matched.iter().map(pair).collect();
    let moved = |(a, b): (&RigLidar, &RigLidar)| {
        let [moved, turned, tilted] = difference(&a.pose, &b.pose);
        let (frame, partner) = (a.frame.clone(), b.frame.clone());
        let carriers = [a.pose.rides_on, b.pose.rides_on];
        let rides_on = (carriers[0] != carriers[1]).then_some(carriers);
        MovedLidar { frame, partner, moved, turned, tilted, models: models(a, b), rides_on }
    };
    let lidars: Vec<MovedLidar> = pairs.iter().copied().map(moved).collect();
    let alone = |rig: &Rig, taken: &HashSet<usize>| -> Vec<String> {
        let rest = rig.lidars.iter().enumerate().filter(|(k, _)| !taken.contains(k));
        rest.map(|(_, lidar)| lidar.frame.clone()).collect()
    };
    Comparison {
        shift: shift(&pairs).filter(|_| lidars.iter().all(|lidar| lidar.turned <= STILL)),
        different: lidars.iter().filter(|lidar| lidar.differs()).count(),
        lidars,
        alone: [
            alone(before, &matched.iter().map(|pair| pair.0).collect()),
            alone(after, &matched.iter().map(|pair| pair.1).collect()),
        ],
        before: asymmetries(before),
        after: asymmetries(after),
    }
}

/// Numbers of the LiDARs that are compared, in the order of the first rig.
fn matched(before: &[RigLidar], after: &[RigLidar]) -> Vec<(usize, usize)> {
    let is_same = |&(a, b): &(usize, usize)| before[a].frame == after[b].frame;
    if before.len() == after.len() {
        let partner = |a: usize| (0..after.len()).map(|b| (a, b)).find(is_same);
        let by_frame: Option<Vec<_>> = (0..before.len()).map(partner).collect();
        return by_frame.unwrap_or_else(|| (0..before.len()).map(|k| (k, k)).collect());
    }
    // Frames by number, as LiDARs without a name have them, say nothing where the numbers differ.
    let is_named = |pair: &(usize, usize)| {
        let frame = &before[pair.0].frame;
        is_same(pair) && ![pair.0, pair.1].map(default_frame).contains(frame)
    };
    let gap =
        |&(a, b): &(usize, usize)| before[a].pose.position().distance(after[b].pose.position());
    let mut candidates: Vec<(usize, usize)> =
        (0..before.len()).flat_map(|a| (0..after.len()).map(move |b| (a, b))).collect();
    candidates.sort_by(|one, other| {
        is_named(other).cmp(&is_named(one)).then(gap(one).total_cmp(&gap(other)))
    });
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (a, b) in candidates {
        if pairs.iter().all(|pair| pair.0 != a && pair.1 != b) {
            pairs.push((a, b));
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Vector by which all of several LiDARs moved, in metres; `None` where they moved by several vectors, or not at all.
fn shift(pairs: &[(&RigLidar, &RigLidar)]) -> Option<[f64; 3]> {
    let by = |(a, b): &(&RigLidar, &RigLidar)| b.pose.position() - a.pose.position();
    let first = by(pairs.first()?);
    let is_one = pairs.len() > 1 && pairs.iter().all(|pair| by(pair).distance(first) <= STILL);
    (is_one && first.length() > STILL).then(|| first.to_array())
}

fn models(a: &RigLidar, b: &RigLidar) -> [Option<String>; 2] {
    [a, b].map(|lidar| lidar.sensor.clone())
}

/// Distance in metres, angle between rotations and angle between z axes in radians.
fn difference(a: &SensorPose, b: &SensorPose) -> [f64; 3] {
    let (ego_from_a, ego_from_b) = (a.ego_from_sensor(), b.ego_from_sensor());
    let (ra, rb) = (ego_from_a.rotation, ego_from_b.rotation);
    [a.position().distance(b.position()), turn(&ra, &rb), tilt(ra.z_axis, rb.z_axis)]
}

/// Pairs whose images are nearest, each LiDAR once; a LiDAR without a pair is compared with itself.
fn asymmetries(rig: &Rig) -> Vec<Asymmetry> {
    let lidars = &rig.lidars;
    let gap = |a: usize, b: usize| {
        lidars[a].pose.position().distance(lidars[b].pose.mirrored().position())
    };
    let all = (0..lidars.len()).flat_map(|a| (a..lidars.len()).map(move |b| (a, b)));
    let mut candidates: Vec<(usize, usize)> = all.collect();
    candidates.sort_by(|&(a, b), &(c, d)| gap(a, b).total_cmp(&gap(c, d)));
    let mut taken = vec![false; lidars.len()];
    let mut pairs = Vec::new();
    for (a, b) in candidates {
        if !taken[a] && !taken[b] {
            (taken[a], taken[b]) = (true, true);
            pairs.push(if lidars[a].pose.y >= lidars[b].pose.y { (a, b) } else { (b, a) });
        }
    }
    pairs.sort_unstable();
    pairs.into_iter().map(|(left, right)| asymmetry(&lidars[left], &lidars[right])).collect()
}

fn asymmetry(left: &RigLidar, right: &RigLidar) -> Asymmetry {
    let [moved, turned, tilted] = difference(&left.pose, &right.pose.mirrored());
    let (a, b) = (&left.pose, &right.pose);
    // Only where roll means the same for both: neither looks straight up or down, and they are two.
    let level = a.pitch.abs() < FRAC_PI_2 && b.pitch.abs() < FRAC_PI_2;
    let same_roll = left.frame != right.frame
        && level
        && a.roll.abs() > SAME
        && (a.roll - b.roll).abs() <= SAME;
    Asymmetry {
        left: left.frame.clone(),
        right: right.frame.clone(),
        moved,
        turned,
        tilted,
        same_roll,
        models: models(left, right),
    }
}

/// Refuses names with `$(` or `${`, for which xacro and launch files put values, and names that mean another frame.
pub(super) fn refuse_names(rig: &Rig, format: RigFormat) -> Checked<()> {
    let is_taken =
        |name: &str| import::is_footprint(name) || [sdf::MODEL, yaml::KIT].contains(&name);
    let taken = rig.lidars.iter().find(|lidar| is_taken(&lidar.frame));
    if let Some(RigLidar { frame, .. }) = taken.filter(|_| format != RigFormat::Json) {
        return Err(refused!(
            "`{frame}` is the name of a frame of the vehicle, which readers take it for; give the LiDAR another one"
        ));
    }
    let is_robot = format == RigFormat::Urdf;
    if !is_robot && format != RigFormat::Ros2Launch {
        return Ok(());
    }
    let of_rig = is_robot.then_some(rig.name.as_str());
    let sensors = rig.lidars.iter().filter_map(|lidar| lidar.sensor.as_deref());
    let sensors = sensors.filter(|_| is_robot);
    let frames = rig.lidars.iter().map(|lidar| lidar.frame.as_str());
    let mut names = of_rig.into_iter().chain(sensors).chain(frames);
    match names.find(|name| name.contains("$(") || name.contains("${")) {
        Some(name) => Err(refused!(
            "the name `{name}` holds `$(` or `${{`, for which readers of {} put a value; give another one",
            format.name()
        )),
        None => Ok(()),
    }
}
