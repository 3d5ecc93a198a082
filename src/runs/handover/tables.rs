//! Tables of a handover: poses and the bill of materials, and its README.txt.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::json;

use super::HandoverRequest;
use super::mask::{FREE, NONE, OWN, SelfHitMask};
use super::rig::HandoverRig;
use crate::csv::{csv, rounded};
use crate::files::Input;
use crate::runs::RunError;

/// Decimals of metres and radians, and of millimetres and degrees.
const FINE: i32 = 12;
const COARSE: i32 = 9;

/// A line a LiDAR: number, mount, model, position in metres and millimetres, angles in radians and degrees.
pub(super) fn poses(rig: &HandoverRig) -> String {
    let titles = [
        "lidar",
        "mount",
        "model",
        "x_m",
        "y_m",
        "z_m",
        "x_mm",
        "y_mm",
        "z_mm",
        "roll_rad",
        "pitch_rad",
        "yaw_rad",
        "roll_deg",
        "pitch_deg",
        "yaw_deg",
        "phase_rad",
        "phase_deg",
    ];
    let mut rows = vec![titles.map(str::to_owned).to_vec()];
    for (k, pose) in rig.placement.lidars.iter().enumerate() {
        let [place, angles] = [[pose.x, pose.y, pose.z], [pose.roll, pose.pitch, pose.yaw]];
        let phase = pose.phase.unwrap_or_default();
        let mount = rig.mounts[k].clone().unwrap_or_default();
        let mut row = vec![k.to_string(), mount, rig.model_name(rig.models[k])];
        row.extend(place.map(|metres| rounded(metres, FINE)));
        row.extend(place.map(|metres| rounded(1000.0 * metres, COARSE)));
        row.extend(angles.map(|angle| rounded(angle, FINE)));
        row.extend(angles.map(|angle| rounded(angle.to_degrees(), COARSE)));
        row.extend([rounded(phase, FINE), rounded(phase.to_degrees(), COARSE)]);
        rows.push(row);
    }
    csv(rows)
}

/// A line a model: how many, price of one, price of all; last the sum. Returns the sum, too.
pub(super) fn materials(rig: &HandoverRig) -> (String, f64) {
    let mut rows = vec![["model", "count", "price_each", "price"].map(str::to_owned)];
    let mut total = 0.0;
    for model in rig.used_models() {
        let count = rig.models.iter().filter(|of| **of == model).count();
        let (each, all) = (rig.price(model), rig.price(model) * count as f64);
        total += all;
        rows.push([
            rig.model_name(model),
            count.to_string(),
            each.to_string(),
            rounded(all, COARSE),
        ]);
    }
    rows.push([
        "total".to_owned(),
        rig.models.len().to_string(),
        String::new(),
        rounded(total, COARSE),
    ]);
    (csv(rows), total)
}

const CONVENTION: &str = "\
Frame: ISO 8855, the ego frame. x ahead, y left, z up; origin on the ground below the vehicle's reference point.
Positions are optical centres. Angles: R = Rz(yaw) * Ry(pitch) * Rx(roll), sensor to vehicle: a positive yaw turns
left, a positive pitch looks down, a positive roll leans to the right. The sensor's own frame: x ahead, y left, z up;
azimuth counter-clockwise from x, elevation up from the xy plane. phase: a turn about the sensor's own z before all
others.
";

const FILES: [(&str, &str); 6] = [
    (
        "poses.csv",
        "LiDARs by number: mount, model, position in m and mm, angles in rad and degrees",
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

pub(super) fn text<'a>(
    rig: &HandoverRig,
    request: &HandoverRequest,
    masks: &[SelfHitMask<'_>],
    files: impl Iterator<Item = &'a str>,
) -> Result<String, RunError> {
    let (vehicle, placement) = (rig.vehicle_name(), &rig.placement.name);
    let mut text = format!(
        "{vehicle}, placement {placement}: LiDARs to be handed over\n\n{CONVENTION}\nFiles\n"
    );
    for file in files {
        let known = FILES.iter().find(|(name, _)| file.ends_with(name));
        let words = known.map_or("mask of the own body, see below", |(_, words)| *words);
        let _ = writeln!(text, "  {file}: {words}");
    }
    let _ = write!(
        text,
        "\nMasks: mask-N-MOUNT of LiDAR N. A beam is masked if its closest hit within range is the own body, in frame \
         {} of {}.\nCSV: a row a ring, a column an azimuth; the first line has the azimuths, the first columns have ring,\n\
         elevation and azimuth offset, in degrees; 1 is the own body. A beam points at the azimuth of its column plus\n\
         the offset of its ring. PNG: the same rows and columns, {OWN} own body, {FREE} any other beam.\n\
         Sensors without rings: a row a beam; the PNG then has azimuth 180 to -180 degrees from left to right and\n\
         elevation 90 to -90 from top to bottom, half a degree a pixel, {NONE} where no beam points.\n",
        request.frame,
        rig.scene().name()
    );
    for (k, mask) in masks.iter().enumerate() {
        let [own, all] = mask.counts();
        let rings = if mask.is_grid() { "" } else { ", no rings" };
        let share = 100.0 * own as f64 / all as f64;
        let _ = writeln!(text, "  LiDAR {k}: {own} of {all} beams, {share:.2} %{rings}");
    }
    let _ = write!(
        text,
        "\nCrop boxes reach {} m beyond the body. base_link stands at x {}, y {}, z {} m in the ego frame.\n",
        request.margin, request.base_link[0], request.base_link[1], request.base_link[2]
    );
    text += "\nMade by sightline ";
    text += env!("CARGO_PKG_VERSION");
    text += " from these files, with the SHA-256 of each\n";
    let mut inputs = rig.scene().files().to_vec();
    inputs.push(PathBuf::from(&rig.file));
    inputs.retain(|file| file.is_file());
    inputs.sort();
    inputs.dedup();
    for input in json!(Input::names_of(&inputs)?).as_array().into_iter().flatten() {
        let word = |key: &str| input[key].as_str().unwrap_or_default().to_owned();
        let _ = writeln!(text, "  {}  {}", word("sha256"), word("file"));
    }
    Ok(text)
}
