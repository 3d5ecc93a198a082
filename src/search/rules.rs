//! The rules of a mount in words, and the rules that a result just keeps.

use crate::vehicle::{Constraints, Placement, Region, SensorPose};

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

/// Free pose fields of a LiDAR that lie on a bound of its mount, in words; `None` where none does.
fn limits_in_words(lidar: usize, region: &Region, pose: &SensorPose) -> Option<String> {
    let fields = region.fields(pose);
    let at_limit = |k: usize| {
        // Bounds of a patch are computed: a nanometre more or less is rounding.
        let said = |bound: f64| (bound * 1e9).round() / 1e9;
        let (low, high) = (said(region.lower[k]), said(region.upper[k]));
        let near = ON_BOUND * (high - low);
        let (bound, word) = match fields[k] {
            value if value - low <= near => (low, "least"),
            value if high - value <= near => (high, "most"),
            _ => return None,
        };
        let unit = if k < 3 { "m" } else { "rad" };
        Some(format!("{} = {bound} {unit} ({word})", SensorPose::FIELDS[k]))
    };
    let limits: Vec<String> = region.free_fields().into_iter().filter_map(at_limit).collect();
    // Fields of a patch are in the patch's own frame.
    let mount = match region.ego_from_region {
        Some(_) => format!("`{}`, in its own frame", region.name),
        None => "its mount".to_owned(),
    };
    let words = || format!("LiDAR {lidar} is at the limit of {mount}: {}", limits.join(", "));
    (!limits.is_empty()).then(words)
}

/// Free pose fields that lie on a bound, and other rules that are just kept, in words.
pub(super) fn active_bounds(placement: &Placement, constraints: &Constraints) -> Vec<String> {
    let mut found = Vec::new();
    for (lidar, pose) in placement.lidars.iter().enumerate() {
        let Some(slot) = constraints.slots.get(lidar) else { continue };
        found.extend(limits_in_words(lidar, &slot.region, pose));
        let position = pose.position().to_array();
        for (index, [min, max]) in constraints.keep_out.iter().enumerate() {
            let beyond = |k: usize| (min[k] - position[k]).max(position[k] - max[k]);
            if (0..3).map(beyond).fold(f64::MIN, f64::max) <= ON_RULE {
                found.push(format!("LiDAR {lidar} is at a face of keep_out[{index}]"));
            }
        }
        for (other, pose) in placement.lidars.iter().enumerate().skip(lidar + 1) {
            let apart = pose.position().distance(position.into());
            let least = constraints.min_distance;
            if least > 0.0 && apart <= least + ON_RULE {
                found.push(format!(
                    "LiDARs {lidar} and {other} are as near as they may be, {least} m"
                ));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_said_once_a_lidar_with_units() {
        let (low, high) = ([-1.0, -1.0, 2.0, -0.3, 0.0, 0.0], [1.0, 1.0, 3.0, 0.3, 0.0, 0.0]);
        let constraints = Constraints { min_distance: 0.5, ..Constraints::in_box(low, high, 3) };
        let at = |x, y, z, roll| SensorPose { roll, ..SensorPose::at(x, y, z) };
        let lidars = vec![at(1.0, 0.0, 2.0, 0.0), at(0.6, 0.3, 2.5, -0.3), at(0.0, 0.0, 2.5, 0.1)];
        let placement = Placement { name: "p".into(), lidars };
        assert_eq!(
            active_bounds(&placement, &constraints),
            [
                "LiDAR 0 is at the limit of its mount: x = 1 m (most), z = 2 m (least)",
                "LiDAR 1 is at the limit of its mount: roll = -0.3 rad (least)",
            ]
        );
        let near =
            Placement { lidars: vec![at(0.0, 0.0, 2.5, 0.0), at(0.5, 0.0, 2.5, 0.0)], ..placement };
        let words = ["LiDARs 0 and 1 are as near as they may be, 0.5 m"];
        assert_eq!(active_bounds(&near, &constraints), words);
    }
}
