//! Mounts of a vehicle file: their regions, the models they may hold, how many, and room for the rules that tie LiDARs.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::description::{CountDescription, MountingDescription};
use super::equipment::{VehicleMount, VehicleSensor};
use super::mesh_mount::{self, OFF};
use super::pairing::ROUNDED;
use super::surface::frame_of_patch;
use super::{MAX_LIDARS, Outline, Region, SensorName};
use lidar_cast::geom::crossing;
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location, quoted};

const MOST_CORNERS: usize = 256;
/// Metres that corners of a polygon may lie off its plane.
const FLAT: f64 = 0.01;

/// Checks a mount, which may hold some of `sensors`; `dir` is where its mesh is. Returns the files read too.
pub(super) fn mounting(
    at: &Location,
    mount: MountingDescription,
    sensors: &[VehicleSensor],
    dir: &Path,
) -> Checked<(VehicleMount, Vec<PathBuf>)> {
    let name = check::name(&at.key("name"), mount.name.clone())?;
    let mut files = Vec::new();
    let region = match (&mount.polygon, &mount.mesh, mount.min, mount.max) {
        (None, None, Some(min), Some(max)) => boxed(at, &mount, min, max)?,
        (Some(corners), None, None, None) => patch(at, &mount, corners)?,
        (None, Some(patch), None, None) => {
            let (region, read) = mesh_mount::patch(&at.key("mesh"), patch, dir)?;
            files = read;
            let along = region.surface.as_ref().map_or(2, |surface| surface.along());
            with_ranges(at, &mount, region, along)?
        }
        (polygon, mesh, min, max) => {
            let keys = [
                ("polygon", polygon.is_some()),
                ("mesh", mesh.is_some()),
                ("min", min.is_some()),
                ("max", max.is_some()),
            ];
            let found: Vec<&str> = keys.iter().filter(|(_, is)| *is).map(|(key, _)| *key).collect();
            let wanted = "a region: give `min` and `max` of a box, or a `polygon`, or a `mesh`";
            return Err(bad(at, format!("a mount with {found:?}"), wanted));
        }
    };
    let allowed = allowed_models(&at.key("sensors"), mount.sensors.as_deref(), sensors)?;
    let at_count = at.key("count");
    let [least, most] = match mount.count {
        CountDescription::Exactly(count) => [count; 2],
        CountDescription::Range([least, most]) if least > most => {
            let wanted =
                format!("[least, most]: the least is above the most; write [{most}, {least}]");
            return Err(bad(&at_count, format!("[{least}, {most}]"), wanted));
        }
        CountDescription::Range(range) => range,
    };
    let most = check::count(&at_count, most, 0, MAX_LIDARS as u64)? as usize;
    let least = check::count(&at_count, least, 0, most as u64)? as usize;
    let rides_on = mount.rides_on.as_deref().map_or(Ok(SensorName::NONE), SensorName::new);
    let rides_on = rides_on.map_err(|fault| check::refused(&at.key("rides_on"), fault))?;
    let region = Arc::new(Region { name, rides_on, ..region });
    Ok((VehicleMount { region, sensors: allowed, count: [least, most] }, files))
}

/// Models that a mount may hold: all that it names, or all of the vehicle; at least one.
fn allowed_models(
    at: &Location,
    names: Option<&[String]>,
    sensors: &[VehicleSensor],
) -> Checked<Vec<SensorName>> {
    let known = || quoted(sensors.iter().map(|model| model.name));
    let mut allowed = Vec::new();
    for (i, name) in names.iter().copied().flatten().enumerate() {
        let found = sensors.iter().find(|model| model.name.as_str() == name);
        let Some(model) = found else {
            let wanted = format!("a sensor of this vehicle, which has {}", known());
            return Err(bad(&at.item(i), format!("`{name}`"), wanted));
        };
        if !allowed.contains(&model.name) {
            allowed.push(model.name);
        }
    }
    if names.is_none() {
        allowed = sensors.iter().map(|model| model.name).collect();
    }
    if allowed.is_empty() {
        let wanted = format!("the models that may stand here, some of {}", known());
        return Err(bad(at, "an empty list", wanted));
    }
    Ok(allowed)
}

/// Ranges of roll, pitch and yaw in radians.
pub(super) fn angles(at: &Location, [roll, pitch, yaw]: [[f64; 2]; 3]) -> Checked<[[f64; 2]; 3]> {
    Ok([
        check::radian_range(&at.key("roll"), roll)?,
        check::radian_range(&at.key("pitch"), pitch)?,
        check::radian_range(&at.key("yaw"), yaw)?,
    ])
}

/// Lower and upper corner of a box of the ego frame, metres.
pub(super) fn corners(at: &Location, min: [f64; 3], max: [f64; 3]) -> Checked<[[f64; 3]; 2]> {
    let min = check::point(&at.key("min"), min)?;
    let max = check::point(&at.key("max"), max)?;
    check::rising(at, min, max)?;
    Ok([min, max])
}

/// Region of a box and of ranges of angles.
pub(super) fn box_of(corners: [[f64; 3]; 2], [roll, pitch, yaw]: [[f64; 2]; 3]) -> Region {
    let [lower, upper] = [0, 1].map(|side| {
        let [x, y, z] = corners[side];
        [x, y, z, roll[side], pitch[side], yaw[side]]
    });
    Region { lower, upper, ..Region::default() }
}

fn boxed(
    at: &Location,
    mount: &MountingDescription,
    min: [f64; 3],
    max: [f64; 3],
) -> Checked<Region> {
    if mount.offset.is_some() {
        return Err(check::misplaced(at, "offset", "it belongs to `polygon` and `mesh`"));
    }
    let corners = corners(at, min, max)?;
    Ok(box_of(corners, angles(at, [mount.roll, mount.pitch, mount.yaw])?))
}

/// A flat polygon, its corners counter-clockwise as seen from outside the vehicle.
fn patch(at: &Location, mount: &MountingDescription, corners: &[[f64; 3]]) -> Checked<Region> {
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
        return Err(bad(
            &place,
            "a list",
            "a polygon with an area; its corners lie on a line, or its sides cross",
        ));
    };
    for (i, point) in points.iter().enumerate() {
        let off = (*point - middle).dot(normal).abs();
        if off > FLAT {
            let wanted =
                format!("within {FLAT} m of the plane of the others, it is {off:.3} m off");
            return Err(bad(&place.item(i), format!("{corner:?}", corner = corners[i]), wanted));
        }
    }
    let (frame, axes) = frame_of_patch(normal, middle);
    let back = frame.inverse();
    let outline: Vec<[f64; 2]> =
        points.iter().map(|point| back.apply(*point)).map(|p| axes.map(|k| p[k])).collect();
    if let Some((i, j)) = crossing(&outline) {
        let count = outline.len();
        let ends = |k: usize| format!("from corner {k} to corner {}", (k + 1) % count);
        let wanted =
            format!("free of the side {}; the outline must not cross or touch itself", ends(i));
        return Err(bad(&place.item(j), format!("the side {}", ends(j)), wanted));
    }
    let (mut lower, mut upper) = ([0.0; 6], [0.0; 6]);
    for (side, &field) in axes.iter().enumerate() {
        let values = outline.iter().map(|corner| corner[side]);
        lower[field] = values.clone().fold(f64::MAX, f64::min);
        upper[field] = values.fold(f64::MIN, f64::max);
    }
    let outline = Outline { axes, corners: outline };
    let region =
        Region { ego_from_region: Some(frame), lower, upper, outline, ..Region::default() };
    with_ranges(at, mount, region, 3 - axes[0] - axes[1])
}

/// A patch with the ranges of `offset`, in front of it, and of the angles.
fn with_ranges(
    at: &Location,
    mount: &MountingDescription,
    mut region: Region,
    along: usize,
) -> Checked<Region> {
    let [from, to] = mount.offset.unwrap_or_default();
    let far = if from.abs() > to.abs() { from } else { to };
    if !(from <= to && far.abs() <= 10.0) {
        let mend =
            if from > to { check::swapped([from, to]) } else { ", [0, 0.1] for example".into() };
        let wanted = format!("a range of metres in front of the patch{mend}");
        let is_large = |metres: f64| from <= to && far.abs() > 10.0 && metres.abs() <= 10.0;
        let wanted = check::or_millimetres(wanted, far, is_large);
        return Err(bad(&at.key("offset"), format!("{:?}", [from, to]), wanted));
    }
    let [roll, pitch, yaw] = angles(at, [mount.roll, mount.pitch, mount.yaw])?;
    for (field, range) in [(along, [from, to]), (3, roll), (4, pitch), (5, yaw)] {
        (region.lower[field], region.upper[field]) = (range[0], range[1]);
    }
    Ok(region)
}

/// Mounts of one height: each is cut to the heights that all have.
///
/// # Errors
/// A patch of a mesh; several mounts, unless all are boxes with a height in common.
pub(super) fn level(at: &Location, mounts: &mut [VehicleMount]) -> Checked<()> {
    let at = at.key("equal_height");
    if let Some(mount) = mounts.iter().find(|mount| mount.region.surface.is_some()) {
        let wanted = format!(
            "possible with `{}`, a patch of a mesh, whose heights are counted from the mesh; leave it out",
            mount.region.name
        );
        return Err(bad(&at, true, wanted));
    }
    if mounts.len() < 2 {
        return Ok(());
    }
    let patch = mounts.iter().find(|mount| mount.region.ego_from_region.is_some());
    if let Some(mount) = patch {
        let wanted = format!(
            "possible with several mounts unless all are boxes, and `{}` is a patch; leave it out",
            mount.region.name
        );
        return Err(bad(&at, true, wanted));
    }
    let low = mounts.iter().map(|mount| mount.region.lower[2]).fold(f64::MIN, f64::max);
    let high = mounts.iter().map(|mount| mount.region.upper[2]).fold(f64::MAX, f64::min);
    if low > high {
        let heights = |mount: &VehicleMount| {
            let [low, high] = [mount.region.lower[2], mount.region.upper[2]];
            format!("`{}` runs from {low} to {high} m", mount.region.name)
        };
        let heights: Vec<String> = mounts.iter().map(heights).collect();
        let wanted = format!(
            "possible with mounts that have no height in common ({}); leave it out",
            heights.join(", ")
        );
        return Err(bad(&at, true, wanted));
    }
    for mount in mounts {
        let region = Arc::make_mut(&mut mount.region);
        (region.lower[2], region.upper[2]) = (low, high);
    }
    Ok(())
}

/// Turns the frames of boxes that face straight back and are no image of another mount, so that their sensors can be
/// mirrored; returns a note where the range of yaw is cut to do so.
pub(super) fn face_back(at: &Location, mounts: &mut [VehicleMount]) -> Vec<Note> {
    let mut notes = Vec::new();
    for k in 0..mounts.len() {
        let region = mounts[k].region.clone();
        if mounts.iter().any(|other| other.region.is_image_of(&region)) {
            continue;
        }
        let Some(turned) = region.turned_back() else { continue };
        let [from, to] = [region.lower[5], region.upper[5]];
        let half = turned.upper[5];
        let middle = if from + to > 0.0 { PI } else { -PI };
        if (middle - half - from).max(to - middle - half) > ROUNDED {
            notes.push(Note::fact(format!(
                "{}: {from} to {to}; mirrored pairs stand from {:.4} to {:.4}, the part of it that is its own image",
                at.key("mounts").item(k).key("yaw"),
                middle - half,
                middle + half
            )));
        }
        mounts[k].region = Arc::new(turned);
    }
    notes
}

/// Checks that LiDARs can come in mirrored pairs.
///
/// # Errors
/// A mount without a mirror image for as many sensors of the same models, or more sensors than a placement has.
pub(super) fn check_pairs(at: &Location, mounts: &[VehicleMount]) -> Checked<()> {
    let at = at.key("symmetric");
    let rides = mounts.iter().any(|mount| !mount.region.rides_on.is_none());
    let same = if rides { "`count`, `sensors` and `rides_on`" } else { "`count` and `sensors`" };
    for mount in mounts {
        let name = &mount.region.name;
        let holds = |other: &&VehicleMount| {
            let alike = other.count == mount.count && other.sensors == mount.sensors;
            alike && other.region.is_image_of(&mount.region)
        };
        if !mounts.iter().any(|other| holds(&other)) {
            let wanted = format!(
                "possible with `{name}`, which has no mirror image at the plane y = 0: y, roll and yaw must run \
                 from -a to a (yaw of a mount that faces back from 3.1416 - a to 3.1416 + a), or another mount be its \
                 image (of meshes to within {OFF} m), with the same {same}; change the mount, or leave \
                 `symmetric` out"
            );
            return Err(bad(&at, true, wanted));
        }
    }
    let most: usize = mounts.iter().map(|mount| mount.count[1]).sum();
    if most > MAX_LIDARS {
        let wanted = format!(
            "possible with mounts for up to {most} sensors: a placement has at most {MAX_LIDARS}; lower `count`"
        );
        return Err(bad(&at, true, wanted));
    }
    Ok(())
}
