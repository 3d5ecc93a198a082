//! Poses and bill of materials as CSV.

use super::rig::HandoverRig;
use crate::csv::{csv, rounded};

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
