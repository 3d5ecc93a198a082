//! Whether the mounts of a vehicle leave room for the rules that tie its LiDARs together.

use std::sync::Arc;

use super::equipment::VehicleMount;
use crate::json::check::bad;
use crate::json::{DescriptionError, Place};

/// Mounts of one height: each is cut to the heights that all have.
///
/// # Errors
/// Several mounts of which one is no box, or without a height in common.
pub(super) fn level(at: &Place, mounts: &mut [VehicleMount]) -> Result<(), DescriptionError> {
    if mounts.len() < 2 {
        return Ok(());
    }
    let at = at.key("equal_height");
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

/// Checks that LiDARs can come in mirrored pairs.
///
/// # Errors
/// A mount without a mirror image of as many sensors of the same model, or one of several with a choice of them.
pub(super) fn check_pairs(at: &Place, mounts: &[VehicleMount]) -> Result<(), DescriptionError> {
    let at = at.key("symmetric");
    for mount in mounts {
        let name = &mount.region.name;
        let is_open = mount.count[0] < mount.count[1];
        if mount.sensors.len() > 1 || mounts.len() > 1 && is_open {
            let wanted = format!(
                "possible where `{name}` leaves a choice: give its `count` as one number and one sensor in \
                 `sensors`, or leave it out"
            );
            return Err(bad(&at, true, wanted));
        }
        let holds = |other: &&VehicleMount| {
            let alike = other.count == mount.count && other.sensors == mount.sensors;
            alike && other.region.is_image_of(&mount.region)
        };
        if !mounts.iter().any(|other| holds(&other)) {
            let wanted = format!(
                "possible with `{name}`, which has no mirror image at the plane y = 0: y, roll and yaw must run \
                 from -a to a, or another mount be its image, for as many sensors of the same model; leave it out"
            );
            return Err(bad(&at, true, wanted));
        }
    }
    Ok(())
}
