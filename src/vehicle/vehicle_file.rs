//! The vehicle file as it is written, and its checks.
//!
//! Keys, units and defaults are explained in `scenes/README.md`.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::description::{KeepOutDescription, LidarDescription};
use super::equipment::{Requirement, Vehicle, VehicleMount, VehicleSensor};
use super::mount::keep_out_boxes;
use super::{Lidar, MAX_LIDARS, Outline, Phase, Region, SensorName, Ties};
use crate::geom::Pose;
use crate::json::check::{self, bad};
use crate::json::{self, DescriptionError, Place};

/// Largest vehicle file, in bytes.
const MAX_FILE: u64 = 64 << 20;
/// Most sensor models, mounts and requirements.
const MOST: usize = 64;
/// Most corners of a polygon.
const MOST_CORNERS: usize = 256;
/// Metres that corners of a polygon may lie off its plane.
const FLAT: f64 = 0.01;

/// A vehicle file; `B` is a shape of the body, which a scene reads.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct VehicleDescription<B> {
    #[serde(rename = "sightline")]
    pub _version: Option<u64>,
    pub name: Option<String>,
    #[serde(default = "Vec::new")]
    pub body: Vec<B>,
    pub sensors: Vec<ModelDescription>,
    pub mounts: Vec<MountingDescription>,
    #[serde(default)]
    pub min_distance: f64,
    #[serde(default)]
    pub keep_out: Vec<KeepOutDescription>,
    #[serde(default)]
    pub equal_height: bool,
    #[serde(default)]
    pub symmetric: bool,
    #[serde(default)]
    pub require: Vec<RequirementDescription>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ModelDescription {
    pub name: String,
    pub lidar: LidarDescription,
    #[serde(default)]
    pub price: f64,
    pub phase: Option<PhaseDescription>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "expected \"free\" or an angle in radians")]
pub(crate) enum PhaseDescription {
    Angle(f64),
    Word(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MountingDescription {
    pub name: String,
    pub min: Option<[f64; 3]>,
    pub max: Option<[f64; 3]>,
    pub polygon: Option<Vec<[f64; 3]>>,
    pub offset: Option<[f64; 2]>,
    #[serde(default)]
    pub roll: [f64; 2],
    #[serde(default)]
    pub pitch: [f64; 2],
    #[serde(default)]
    pub yaw: [f64; 2],
    pub sensors: Option<Vec<String>>,
    pub count: CountDescription,
}

#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number of sensors, 4 for example, or a range, [0, 2] for example"
)]
pub(crate) enum CountDescription {
    Exactly(u64),
    Range([u64; 2]),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RequirementDescription {
    pub name: String,
    pub min: [f64; 3],
    pub max: [f64; 3],
    #[serde(default)]
    pub without: Vec<KeepOutDescription>,
    pub share: f64,
}

/// Reads a vehicle file: its description, and its text's name for errors.
pub(crate) fn read<B: DeserializeOwned>(
    path: &Path,
) -> Result<VehicleDescription<B>, DescriptionError> {
    let name = path.display().to_string();
    let bytes = json::read_limited(path, MAX_FILE)?;
    let text = String::from_utf8_lossy(&bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    json::check_version(text, &name)?;
    json::parse(text, &name)
}

impl Vehicle {
    /// Checks a description; `dir` is where its files are. Returns the vehicle and the files it names.
    pub(crate) fn new<B>(
        at: &Place,
        vehicle: VehicleDescription<B>,
        stem: &str,
        dir: &Path,
    ) -> Result<(Self, Vec<PathBuf>), DescriptionError> {
        let lists = [("sensors", vehicle.sensors.len()), ("mounts", vehicle.mounts.len())];
        for (key, count) in lists.into_iter().chain([("require", vehicle.require.len().max(1))]) {
            if count == 0 || count > MOST {
                let wanted =
                    format!("1 to {MOST} entries: a vehicle needs at least one of `{key}`");
                return Err(bad(&at.key(key), format!("a list of {count}"), wanted));
            }
        }
        let name = vehicle.name.filter(|name| !name.trim().is_empty());
        let name = name.map(|name| check::text(&at.key("name"), name)).transpose()?;
        let mut files = Vec::new();
        let mut sensors: Vec<VehicleSensor> = Vec::new();
        for (i, model) in vehicle.sensors.into_iter().enumerate() {
            let at = at.key("sensors").item(i);
            files.extend(model.lidar.file.iter().map(|file| dir.join(file)));
            let sensor = sensor(&at, model, dir)?;
            if sensors.iter().any(|known| known.name == sensor.name) {
                let wanted = "a name of its own; it is used twice";
                return Err(bad(&at.key("name"), format!("`{}`", sensor.name), wanted));
            }
            sensors.push(sensor);
        }
        let mut names = HashSet::new();
        let mut mounts = Vec::new();
        for (i, mount) in vehicle.mounts.into_iter().enumerate() {
            let at = at.key("mounts").item(i);
            if !names.insert(mount.name.clone()) {
                let wanted = "a name of its own; it is used twice";
                return Err(bad(&at.key("name"), format!("`{}`", mount.name), wanted));
            }
            mounts.push(mounting(&at, mount, &sensors)?);
        }
        let most: usize = mounts.iter().map(|mount| mount.count[1]).sum();
        let least: usize = mounts.iter().map(|mount| mount.count[0]).sum();
        if most == 0 || least > MAX_LIDARS {
            let wanted = format!("made for 1 to {MAX_LIDARS} sensors in all; change their `count`");
            let found = format!("a list for {least} to {most} sensors");
            return Err(bad(&at.key("mounts"), found, wanted));
        }
        let min_distance = vehicle.min_distance;
        if !(0.0..=check::MAX_METRES).contains(&min_distance) {
            return Err(bad(&at.key("min_distance"), min_distance, "a distance of 0 m or more"));
        }
        let keep_out = keep_out_boxes(&at.key("keep_out"), &vehicle.keep_out)?;
        let ties = Ties { equal_height: vehicle.equal_height, symmetric: vehicle.symmetric };
        if ties.any() && (mounts.len() > 1 || mounts[0].sensors.len() > 1) {
            let key = if ties.symmetric { "symmetric" } else { "equal_height" };
            let wanted = "possible with one mount for one sensor model only; leave it out";
            return Err(bad(&at.key(key), true, wanted));
        }
        let require = vehicle.require.iter().enumerate();
        let require = require.map(|(i, r)| requirement(&at.key("require").item(i), r));
        let require = require.collect::<Result<_, _>>()?;
        let name = name.unwrap_or_else(|| stem.to_owned());
        Ok((Self { name, sensors, mounts, min_distance, keep_out, ties, require }, files))
    }
}

fn sensor(
    at: &Place,
    model: ModelDescription,
    dir: &Path,
) -> Result<VehicleSensor, DescriptionError> {
    let name = SensorName::new(&model.name)
        .map_err(|why| bad(&at.key("name"), format!("{:?}", model.name), why))?;
    let lidar = Lidar::new(&at.key("lidar"), model.lidar, dir)?;
    let phase = match model.phase {
        None if lidar.turns() => Phase::Free,
        None => Phase::Locked(0.0),
        Some(PhaseDescription::Angle(angle)) => {
            Phase::Locked(check::radians(&at.key("phase"), angle)?)
        }
        Some(PhaseDescription::Word(word)) if word == "free" => Phase::Free,
        Some(PhaseDescription::Word(word)) => {
            let wanted = "\"free\" or an angle in radians at which the sensor is locked";
            return Err(bad(&at.key("phase"), format!("{word:?}"), wanted));
        }
    };
    if !(0.0..=1e12).contains(&model.price) {
        return Err(bad(&at.key("price"), model.price, "a price of 0 or more"));
    }
    Ok(VehicleSensor { name, lidar, phase, price: model.price })
}

fn mounting(
    at: &Place,
    mount: MountingDescription,
    sensors: &[VehicleSensor],
) -> Result<VehicleMount, DescriptionError> {
    let name = check::text(&at.key("name"), mount.name.clone())?;
    let region = match (&mount.polygon, mount.min, mount.max) {
        (None, Some(min), Some(max)) => boxed(at, &mount, min, max)?,
        (Some(corners), None, None) => patch(at, &mount, corners)?,
        (polygon, min, max) => {
            let found =
                [("polygon", polygon.is_some()), ("min", min.is_some()), ("max", max.is_some())];
            let found: Vec<&str> =
                found.iter().filter(|(_, is)| *is).map(|(key, _)| *key).collect();
            let wanted = "a region: give `min` and `max` of a box, or a `polygon`";
            return Err(bad(at, format!("a mount with {found:?}"), wanted));
        }
    };
    let known = || {
        let names: Vec<String> = sensors.iter().map(|model| format!("`{}`", model.name)).collect();
        names.join(", ")
    };
    let mut allowed = Vec::new();
    for (i, name) in mount.sensors.iter().flatten().enumerate() {
        let found = sensors.iter().find(|model| model.name.as_str() == name);
        let Some(model) = found else {
            let wanted = format!("a sensor of this vehicle, which has {}", known());
            return Err(bad(&at.key("sensors").item(i), format!("`{name}`"), wanted));
        };
        if !allowed.contains(&model.name) {
            allowed.push(model.name);
        }
    }
    if mount.sensors.is_none() {
        allowed = sensors.iter().map(|model| model.name).collect();
    }
    if allowed.is_empty() {
        let wanted = format!("the models that may stand here, some of {}", known());
        return Err(bad(&at.key("sensors"), "an empty list", wanted));
    }
    let at_count = at.key("count");
    let [least, most] = match mount.count {
        CountDescription::Exactly(count) => [count; 2],
        CountDescription::Range(range) => range,
    };
    let most = check::count(&at_count, most, 0, MAX_LIDARS as u64)? as usize;
    let least = check::count(&at_count, least, 0, most as u64)? as usize;
    let region = Arc::new(Region { name, ..region });
    Ok(VehicleMount { region, sensors: allowed, count: [least, most] })
}

/// The ranges of the angles, side by side.
fn angles(at: &Place, mount: &MountingDescription) -> Result<[[f64; 2]; 3], DescriptionError> {
    Ok([
        check::radian_range(&at.key("roll"), mount.roll)?,
        check::radian_range(&at.key("pitch"), mount.pitch)?,
        check::radian_range(&at.key("yaw"), mount.yaw)?,
    ])
}

fn boxed(
    at: &Place,
    mount: &MountingDescription,
    min: [f64; 3],
    max: [f64; 3],
) -> Result<Region, DescriptionError> {
    if mount.offset.is_some() {
        let (at, mend) = (Box::new(at.clone()), "it belongs to `polygon`".to_owned());
        return Err(DescriptionError::Misplaced { at, key: "offset", mend });
    }
    let min = check::point(&at.key("min"), min)?;
    let max = check::point(&at.key("max"), max)?;
    for i in 0..3 {
        if min[i] > max[i] {
            let wanted = format!("{} or more, the lower corner of the mount", min[i]);
            return Err(bad(&at.key("max").item(i), max[i], wanted));
        }
    }
    let [roll, pitch, yaw] = angles(at, mount)?;
    Ok(Region {
        lower: [min[0], min[1], min[2], roll[0], pitch[0], yaw[0]],
        upper: [max[0], max[1], max[2], roll[1], pitch[1], yaw[1]],
        ..Region::default()
    })
}

/// A flat polygon, its corners counter-clockwise as seen from outside the vehicle.
fn patch(
    at: &Place,
    mount: &MountingDescription,
    corners: &[[f64; 3]],
) -> Result<Region, DescriptionError> {
    let place = at.key("polygon");
    if !(3..=MOST_CORNERS).contains(&corners.len()) {
        let wanted = format!("3 to {MOST_CORNERS} corners, counter-clockwise as seen from outside");
        return Err(bad(&place, format!("a list of {}", corners.len()), wanted));
    }
    let mut points = Vec::new();
    for (i, corner) in corners.iter().enumerate() {
        points.push(DVec3::from(check::point(&place.item(i), *corner)?));
    }
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    // Newell's normal: twice the area's vector.
    let next = |k: usize| points[(k + 1) % points.len()] - middle;
    let area: DVec3 = (0..points.len()).map(|k| (points[k] - middle).cross(next(k))).sum();
    let Some(normal) = area.try_normalize().filter(|_| area.length() > 1e-8) else {
        return Err(bad(&place, "a list", "a polygon with an area; its corners lie on a line"));
    };
    for (i, point) in points.iter().enumerate() {
        let off = (*point - middle).dot(normal).abs();
        if off > FLAT {
            let wanted =
                format!("within {FLAT} m of the plane of the others, it is {off:.3} m off");
            return Err(bad(&place.item(i), format!("{corner:?}", corner = corners[i]), wanted));
        }
    }
    let on_roof = normal.z.abs() >= std::f64::consts::FRAC_1_SQRT_2;
    let rotation = rest(normal, on_roof);
    let frame = Pose { rotation, translation: middle };
    let back = frame.inverse();
    let axes = if on_roof { [0, 1] } else { [1, 2] };
    let outline: Vec<[f64; 2]> =
        points.iter().map(|point| back.apply(*point)).map(|p| axes.map(|k| p[k])).collect();
    let [from, to] = mount.offset.unwrap_or_default();
    let along = if on_roof { 2 } else { 0 };
    let [roll, pitch, yaw] = angles(at, mount)?;
    let (mut lower, mut upper) = ([0.0; 6], [0.0; 6]);
    for (k, bounds) in [[from, to], roll, pitch, yaw].into_iter().enumerate() {
        let field = if k == 0 { along } else { k + 2 };
        (lower[field], upper[field]) = (bounds[0], bounds[1]);
    }
    if !(from <= to && from.abs().max(to.abs()) <= 10.0) {
        let wanted = "a range of metres in front of the patch, [0, 0.1] for example";
        return Err(bad(&at.key("offset"), format!("{:?}", [from, to]), wanted));
    }
    for (side, &field) in axes.iter().enumerate() {
        let values = outline.iter().map(|corner| corner[side]);
        lower[field] = values.clone().fold(f64::MAX, f64::min);
        upper[field] = values.fold(f64::MIN, f64::max);
    }
    let outline = Outline { axes, corners: outline };
    Ok(Region { ego_from_region: Some(frame), lower, upper, outline, ..Region::default() })
}

/// Axes of a sensor at rest on a patch: on a roof z along the normal and x ahead, on a side x along the
/// normal and z up, as near as may be.
fn rest(normal: DVec3, on_roof: bool) -> DMat3 {
    let [x, y, z] = if on_roof {
        let up = normal;
        let y = up.cross(DVec3::X).normalize_or(DVec3::Y);
        [y.cross(up), y, up]
    } else {
        let y = DVec3::Z.cross(normal).normalize_or(DVec3::Y);
        [normal, y, normal.cross(y)]
    };
    DMat3::from_cols(x, y, z)
}

fn requirement(
    at: &Place,
    required: &RequirementDescription,
) -> Result<Requirement, DescriptionError> {
    let name = check::text(&at.key("name"), required.name.clone())?;
    let inside = KeepOutDescription { min: required.min, max: required.max };
    let inside = keep_out_boxes(at, std::slice::from_ref(&inside))?[0];
    let without = keep_out_boxes(&at.key("without"), &required.without)?;
    if !(0.0..=1.0).contains(&required.share) {
        return Err(bad(&at.key("share"), required.share, "a share from 0 to 1"));
    }
    Ok(Requirement { name, inside, without, share: required.share })
}
