//! Origins of the frames that the rigid parts of a scene are stored in.

use glam::DVec3;

use super::route::Motion;
use super::solid::Solid;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Farthest that the ego may get from the middle of its way, in metres: `f32` keeps 2 mm there.
const FARTHEST: f64 = 5.0e4;

/// Origin of the static world's frame: the middle of the box around the ego's places.
///
/// # Errors
/// A way so long that `f32` cannot hold the world along all of it.
pub(super) fn middle_of_way(
    at: &Place,
    ego: &Motion,
    frames: usize,
    world: &Solid,
) -> Result<DVec3, DescriptionError> {
    let places = || (0..frames).map(|t| ego.pose(t).translation);
    let (low, high) = bounds(places());
    let middle = (0.5 * (low + high)).round();
    let far = places().map(|place| (place - middle).abs().max_element()).fold(0.0, f64::max);
    if far > FARTHEST && !world.faces.is_empty() {
        let at = at.key(if matches!(ego, Motion::Poses(_)) { "poses" } else { "route" });
        let value = format!("a way that leads {far:.0} m from its middle");
        let wanted = "one within 50000 m, where coordinates keep 2 mm; cut the scene into several";
        return Err(bad(&at, value, wanted));
    }
    Ok(middle)
}

/// Origin of a moving part's frame: the middle of its box.
pub(super) fn middle(part: &Solid) -> DVec3 {
    if part.vertices.is_empty() {
        return DVec3::ZERO;
    }
    let (low, high) = bounds(part.vertices.iter().copied());
    (0.5 * (low + high)).round()
}

fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
