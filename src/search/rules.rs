//! Layouts in words: rules of a mount, rules that a result just keeps, and properties that go with the objective.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use crate::geom::Pose;
use crate::maths;
use crate::score::{lidar_name, mean_height, spearman};
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

/// Numbers that describe a layout, by name.
type Descriptor = (&'static str, fn(&Placement) -> f64);

/// Properties of the paper's "intuitive interpretation"; the first, mean height, is the null model.
const DESCRIPTORS: [Descriptor; 4] = [
    ("mean height", mean_height),
    ("height spread", |p| deviation(p.lidars.iter().map(|l| l.z))),
    ("horizontal spread", |p| {
        maths::hypot(
            deviation(p.lidars.iter().map(|l| l.x)),
            deviation(p.lidars.iter().map(|l| l.y)),
        )
    }),
    ("mean |roll|", |p| p.lidars.iter().map(|l| l.roll.abs()).sum::<f64>() / p.lidars.len() as f64),
];

/// Standard deviation, with all values as the population.
fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    (values.map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Correlation of one layout property with the score, over a sample of placements.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Finding {
    /// Name of the property.
    pub property: &'static str,
    /// Spearman's rank correlation with the score; `None` where either is constant.
    pub correlation: Option<f64>,
    /// Partial rank correlation with the score, mean height held fixed; `None` for mean height itself.
    pub beside_height: Option<f64>,
}

/// Fewest placements that are correlated: of two each correlation is 1 or −1.
const FEWEST: usize = 10;

/// Rank correlations of layout properties with the score over a sample, also with mean height held fixed; none of fewer
/// than ten placements.
pub(super) fn findings(sample: &[(Placement, f64)]) -> Vec<Finding> {
    if sample.len() < FEWEST { Vec::new() } else { correlated(sample) }
}

fn correlated(sample: &[(Placement, f64)]) -> Vec<Finding> {
    let scores: Vec<f64> = sample.iter().map(|(_, score)| *score).collect();
    let of = |describe: fn(&Placement) -> f64| -> Vec<f64> {
        // Rounded, so that equal layouts have equal numbers whatever the order of their sums.
        sample.iter().map(|(placement, _)| (describe(placement) * 1e9).round()).collect()
    };
    let heights = of(mean_height);
    let by_height = spearman(&heights, &scores);
    let finding = |(index, &(property, describe)): (usize, &Descriptor)| {
        let values = of(describe);
        let correlation = spearman(&values, &scores);
        let beside_height = (index > 0)
            .then(|| partial(correlation?, spearman(&values, &heights)?, by_height?))
            .flatten();
        Finding { property, correlation, beside_height }
    };
    DESCRIPTORS.iter().enumerate().map(finding).collect()
}

/// Correlation of a and b with c held fixed, from the three pairwise ones.
fn partial(ab: f64, ac: f64, bc: f64) -> Option<f64> {
    let scale = ((1.0 - ac * ac) * (1.0 - bc * bc)).sqrt();
    (scale > 1e-9).then(|| (ab - ac * bc) / scale)
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

    fn placement(poses: &[(f64, f64, f64, f64)]) -> Placement {
        let pose = |&(x, y, z, roll): &(f64, f64, f64, f64)| SensorPose {
            roll,
            ..SensorPose::at(x, y, z)
        };
        Placement { name: "p".into(), lidars: poses.iter().map(pose).collect() }
    }

    #[test]
    fn descriptors_by_hand() {
        let layout = placement(&[(1.0, 0.0, 2.0, -0.2), (-1.0, 0.0, 3.0, 0.0)]);
        let values = DESCRIPTORS.map(|(_, describe)| describe(&layout));
        assert_eq!(values, [2.5, 0.5, 1.0, 0.1]);
    }

    #[test]
    fn a_score_that_is_height_leaves_nothing_to_the_others() {
        // Spread and height rise together, but the score follows height alone.
        let sample: Vec<(Placement, f64)> = [(0.1, 2.0), (0.2, 2.3), (0.4, 2.2), (0.5, 2.6)]
            .iter()
            .map(|&(x, z)| (placement(&[(x, 0.0, z, 0.0), (-x, 0.0, z, 0.0)]), z))
            .collect();
        assert_eq!(findings(&sample), [], "four placements are too few");
        let found = correlated(&sample);
        assert_eq!(found[0].correlation, Some(1.0));
        assert_eq!(found[0].beside_height, None);
        assert_eq!(found[1].correlation, None, "no height spread at all");
        assert!((found[2].correlation.unwrap() - 0.8).abs() < 1e-12);
        assert_eq!(found[2].beside_height, None, "height leaves nothing to explain");
        assert_eq!(partial(0.5, 0.0, 0.0), Some(0.5));
    }
}
