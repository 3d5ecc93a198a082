//! Checks that the mounts of a vehicle leave room for the rules that tie its LiDARs together.

use std::sync::Arc;

use super::MAX_LIDARS;
use super::equipment::VehicleMount;
use super::mesh_mirror::OFF;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Mounts of one height: each is cut to the heights that all have.
///
/// # Errors
/// A patch of a mesh; several mounts, unless all are boxes with a height in common.
pub(super) fn level(at: &Place, mounts: &mut [VehicleMount]) -> Result<(), DescriptionError> {
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

/// Checks that LiDARs can come in mirrored pairs.
///
/// # Errors
/// A mount without a mirror image for as many sensors of the same models, or more sensors than a placement has.
pub(super) fn check_pairs(at: &Place, mounts: &[VehicleMount]) -> Result<(), DescriptionError> {
    let at = at.key("symmetric");
    for mount in mounts {
        let name = &mount.region.name;
        let holds = |other: &&VehicleMount| {
            let alike = other.count == mount.count && other.sensors == mount.sensors;
            alike && other.region.is_image_of(&mount.region)
        };
        if !mounts.iter().any(|other| holds(&other)) {
            let wanted = format!(
                "possible with `{name}`, which has no mirror image at the plane y = 0: y, roll and yaw must run \
                 from -a to a, or another mount be its image (of meshes to within {OFF} m), with the same `count` \
                 and `sensors`; leave it out"
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
