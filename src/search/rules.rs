//! The rules of a mount in words, and the rules that a result just keeps.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use crate::geom::Pose;
use crate::score::lidar_name;
use crate::vehicle::{Constraints, Placement, Region, SensorPose};

/// Distance from a bound, as a share of the range, that counts as on it.
const ON_BOUND: f64 = 1e-3;
/// Distance from a box or from another LiDAR, in metres over the least one, that counts as on it.
const ON_RULE: f64 = 1e-3;

/// Rules that every placement of a search keeps, beside the bounds of the mount, in words.
pub(crate) fn rules_in_words(constraints: &Constraints) -> Vec<String> {
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
        let name = (kinds.len() > 1).then_some(region.name.as_str());
        let beside = |frame: Option<&str>| match [name, frame].iter().flatten().count() {
            0 => String::new(),
            _ => [name, frame].into_iter().flatten().collect::<Vec<_>>().join(", ") + ": ",
        };
        let word = |k: usize| {
            let at = beside(own_frame(region));
            format!("{at}{} = {}", SensorPose::FIELDS[k], said(region, k, region.lower[k]))
        };
        words.extend(fixed.map(word));
        if let Some([from, to]) = slot.phase {
            let at = beside(None);
            words.push(format!("{at}a phase of each LiDAR from {from} to {to} rad"));
        }
    }
    words
}

/// True for a box whose sensors face straight back: its frame is the ego frame turned half around.
fn is_turned_back(region: &Region) -> bool {
    let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
    let turned = |frame: &Pose| frame.rotation == half_turn && frame.translation == DVec3::ZERO;
    region.surface.is_none() && region.ego_from_region.as_ref().is_some_and(turned)
}

/// Name of the frame that [`said`] counts in; `None` for the ego frame, as poses are given.
fn own_frame(region: &Region) -> Option<&'static str> {
    (region.ego_from_region.is_some() && !is_turned_back(region)).then_some("in its own frame")
}

/// Value of a pose field of a region, metres or radians, as a reader knows it: that of a box in the ego frame, that of
/// a patch or of a curved surface in its own frame. A nanometre more or less is rounding.
fn said(region: &Region, field: usize, value: f64) -> f64 {
    let value = match field {
        0 | 1 if is_turned_back(region) => 0.0 - value,
        5 if is_turned_back(region) => value + PI,
        _ => value,
    };
    (value * 1e9).round() / 1e9
}

/// Free pose fields of a LiDAR that lie on a bound of its mount, in words; `None` where none does.
fn limits_in_words(lidar: usize, region: &Region, pose: &SensorPose) -> Option<String> {
    let fields = region.fields(pose);
    let at_limit = |k: usize| {
        // The half turn of a box that faces back swaps the bounds of x and y.
        let bounds = [region.lower[k], region.upper[k]].map(|bound| said(region, k, bound));
        let (low, high) = (bounds[0].min(bounds[1]), bounds[0].max(bounds[1]));
        let near = ON_BOUND * (high - low);
        let (bound, word) = match said(region, k, fields[k]) {
            value if value - low <= near => (low, "least"),
            value if high - value <= near => (high, "most"),
            _ => return None,
        };
        let unit = if k < 3 { "m" } else { "rad" };
        Some(format!("{} = {bound} {unit} ({word})", SensorPose::FIELDS[k]))
    };
    let limits: Vec<String> = region.free_fields().into_iter().filter_map(at_limit).collect();
    let mount = match own_frame(region) {
        Some(frame) => format!("`{}`, {frame}", region.name),
        None => "its mount".to_owned(),
    };
    let name = Some(region.own_name()).filter(|own| !own.is_empty() && own_frame(region).is_none());
    let lidar = lidar_name(lidar, name);
    let words = || format!("{lidar} is at the limit of {mount}: {}", limits.join(", "));
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

    #[test]
    fn values_are_those_of_the_poses_or_name_their_own_frame() {
        let (lower, upper) = ([3.0, -0.8, 0.7, 0.0, 0.0, 0.0], [3.0, 0.5, 2.5, 0.0, 0.8, 0.0]);
        let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
        let turned = |rotation| Some(Pose { rotation, translation: DVec3::ZERO });
        let words = |rotation: Option<DMat3>, fields: [f64; 6]| {
            let ego_from_region = rotation.and_then(turned);
            let region = Region { lower, upper, ego_from_region, ..Region::default() };
            let pose = region.pose(fields, crate::vehicle::SensorName::default());
            let mut rules = Constraints::in_box(lower, upper, 1);
            std::sync::Arc::make_mut(&mut rules.slots[0].region).clone_from(&region);
            let found = active_bounds(&Placement { name: "p".into(), lidars: vec![pose] }, &rules);
            (rules_in_words(&rules), found, pose)
        };
        let fields = [3.0, -0.8, 0.7, 0.0, 0.1, 0.0];
        let (rules, found, _) = words(None, fields);
        assert_eq!(rules, ["x = 3", "roll = 0", "yaw = 0"]);
        assert_eq!(
            found,
            ["LiDAR 0 is at the limit of its mount: y = -0.8 m (least), z = 0.7 m (least)"]
        );
        // A tailgate: its frame is turned half around, the poses are not.
        let (rules, found, pose) = words(Some(half_turn), fields);
        assert!((pose.x + 3.0).abs() < 1e-12 && (pose.y - 0.8).abs() < 1e-12, "{pose:?}");
        assert_eq!(rules, ["x = -3", "roll = 0", "yaw = 3.141592654"]);
        assert_eq!(
            found,
            ["LiDAR 0 is at the limit of its mount: y = 0.8 m (most), z = 0.7 m (least)"]
        );
        // A side: no axis of its frame is one of the vehicle's.
        let (rules, found, _) = words(Some(DMat3::from_rotation_z(1.5)), fields);
        assert_eq!(rules[0], "in its own frame: x = 3");
        assert!(found[0].contains("`mount`, in its own frame: y = -0.8 m (least)"), "{found:?}");
    }
}
