//! The rules of a mount in words, and the rules that a result just keeps.

use crate::vehicle::{Constraints, Placement, SensorPose};

/// Distance from a bound, as a share of the range, that counts as on it.
const ON_BOUND: f64 = 1e-3;
/// Distance from a box or from another LiDAR, in metres over the least one, that counts as on it.
const ON_RULE: f64 = 1e-3;

/// Rules that every placement of a search keeps, beside the bounds of the mount, in words.
pub fn rules_in_words(constraints: &Constraints) -> Vec<String> {
    let mut words = Vec::new();
    if constraints.min_distance > 0.0 {
        words.push(format!("LiDARs at least {} m apart", constraints.min_distance));
    }
    for (index, [min, max]) in constraints.keep_out.iter().enumerate() {
        words.push(format!("no LiDAR in keep_out[{index}], {min:?} to {max:?}"));
    }
    if constraints.ties.equal_height {
        words.push("all LiDARs at one height".into());
    }
    if constraints.ties.symmetric {
        words.push("LiDARs in pairs mirrored at the plane y = 0".into());
    }
    let kinds = constraints.kinds();
    for (slot, count) in &kinds {
        let region = &slot.region;
        if kinds.len() > 1 {
            words.push(format!("{count} × {} on {}", slot.sensor, region.name));
        }
        let fixed = (0..6).filter(|&k| region.upper[k] <= region.lower[k]);
        let beside = if kinds.len() > 1 { format!("{}: ", region.name) } else { String::new() };
        let word = |k: usize| format!("{beside}{} = {}", SensorPose::FIELDS[k], region.lower[k]);
        words.extend(fixed.map(word));
        if let Some([from, to]) = slot.phase {
            words.push(format!("{beside}a phase of each LiDAR from {from} to {to} rad"));
        }
    }
    words
}

/// Free pose fields that lie on a bound, and other rules that are just kept, in words.
pub(super) fn active_bounds(placement: &Placement, constraints: &Constraints) -> Vec<String> {
    let mut found = Vec::new();
    for (lidar, pose) in placement.lidars.iter().enumerate() {
        let Some(slot) = constraints.slots.get(lidar) else { continue };
        let fields = slot.region.fields(pose);
        // Fields of a patch are in the patch's own frame.
        let of = match slot.region.ego_from_region {
            Some(_) => format!(" along `{}`", slot.region.name),
            None => String::new(),
        };
        for k in slot.region.free_fields() {
            // Bounds of a patch are computed: a nanometre more or less is rounding.
            let said = |bound: f64| (bound * 1e9).round() / 1e9;
            let (low, high) = (said(slot.region.lower[k]), said(slot.region.upper[k]));
            let (field, value) = (SensorPose::FIELDS[k], fields[k]);
            let near = ON_BOUND * (high - low);
            if value - low <= near {
                found.push(format!("LiDAR {lidar}: {field}{of} at its lower bound {low}"));
            } else if high - value <= near {
                found.push(format!("LiDAR {lidar}: {field}{of} at its upper bound {high}"));
            }
        }
        let position = pose.position().to_array();
        for (index, [min, max]) in constraints.keep_out.iter().enumerate() {
            let beyond = |k: usize| (min[k] - position[k]).max(position[k] - max[k]);
            if (0..3).map(beyond).fold(f64::MIN, f64::max) <= ON_RULE {
                found.push(format!("LiDAR {lidar}: at a face of keep_out[{index}]"));
            }
        }
        for (other, pose) in placement.lidars.iter().enumerate().skip(lidar + 1) {
            let apart = pose.position().distance(position.into());
            let least = constraints.min_distance;
            if least > 0.0 && apart <= least + ON_RULE {
                found.push(format!("LiDARs {lidar} and {other}: at the least distance {least} m"));
            }
        }
    }
    found
}
