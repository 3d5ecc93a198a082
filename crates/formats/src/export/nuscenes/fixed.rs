//! Tables that every nuScenes set has: categories, attributes, visibilities.

/// Categories; the index is the label of lidarseg, and none may be left out.
pub(super) use crate::datasets::NUSCENES_CATEGORIES as CATEGORIES;

/// Category of an actor of no other.
pub(super) const DEBRIS: u8 = 10;
/// First and last category of things that have boxes.
pub(super) const BOXED: std::ops::RangeInclusive<u8> = 1..=23;

/// All attributes.
pub(super) const ATTRIBUTES: [&str; 8] = [
    "vehicle.moving",
    "vehicle.stopped",
    "vehicle.parked",
    "cycle.with_rider",
    "cycle.without_rider",
    "pedestrian.sitting_lying_down",
    "pedestrian.standing",
    "pedestrian.moving",
];

/// Attribute of an actor; `None` for categories without attributes.
pub(super) fn attribute(category: u8, moves: bool) -> Option<&'static str> {
    let name = CATEGORIES.get(usize::from(category))?;
    Some(match *name {
        "vehicle.bicycle" | "vehicle.motorcycle" => "cycle.with_rider",
        _ if name.starts_with("vehicle") && moves => "vehicle.moving",
        _ if name.starts_with("vehicle") => "vehicle.stopped",
        _ if name.starts_with("human") && moves => "pedestrian.moving",
        _ if name.starts_with("human") => "pedestrian.standing",
        _ => return None,
    })
}

/// Visibilities by token, from 1.
pub(super) const VISIBILITIES: [&str; 4] = ["v0-40", "v40-60", "v60-80", "v80-100"];

/// Token of a visibility, by the share of a box's hull that is seen; where nobody looked, by whether it has points.
pub(super) fn visibility(seen: Option<f32>, points: u32) -> &'static str {
    let seen = seen.unwrap_or(if points > 0 { 1.0 } else { 0.0 });
    match [0.4, 0.6, 0.8].iter().filter(|&&least| seen >= least).count() {
        0 => "1",
        1 => "2",
        2 => "3",
        _ => "4",
    }
}

/// Cameras that mmdetection3d asks for, and where they look: degrees to the left.
pub(super) const CAMERAS: [(&str, f64); 6] = [
    ("CAM_FRONT", 0.0),
    ("CAM_FRONT_RIGHT", -55.0),
    ("CAM_FRONT_LEFT", 55.0),
    ("CAM_BACK", 180.0),
    ("CAM_BACK_LEFT", 110.0),
    ("CAM_BACK_RIGHT", -110.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visibilities_are_those_of_the_share_that_is_seen() {
        let shares = [0.0, 0.39, 0.4, 0.5, 0.6, 0.79, 0.8, 1.0];
        let tokens = shares.map(|share| visibility(Some(share), 7));
        assert_eq!(tokens, ["1", "1", "2", "2", "3", "3", "4", "4"]);
        assert_eq!([0, 1].map(|points| visibility(None, points)), ["1", "4"]);
    }
}
