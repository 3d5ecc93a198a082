//! Ground near the vehicle that counts more in a search.

use super::ground::{GROUND, NEAR};
use super::look::outline;
use super::NearFieldError;
use crate::problem::{Content, Problem};
use crate::psog::fixed;
use crate::scene::Scene;
use glam::DVec3;

/// Most nats that a voxel of near ground may be given.
pub const MOST_WEIGHT: f64 = 4.0;

/// The problem with `nats` more entropy in every voxel of ground within 10 m of the own body: voxels in which
/// a class of the ground occurs in the P-SOG, whose centres lie outside the footprint.
///
/// Only the entropy of all classes grows, and with it `information_gain`; coverage and counts stay. What is
/// searched, bounded and reported as information then holds the weight.
///
/// # Errors
/// A scene without an own body, or a weight outside 0 to [`MOST_WEIGHT`].
pub fn weighted(scene: &Scene, problem: Problem, nats: f64) -> Result<Problem, NearFieldError> {
    if !(0.0..=MOST_WEIGHT).contains(&nats) {
        return Err(NearFieldError::Weight { given: nats, most: MOST_WEIGHT });
    }
    let (footprint, roi, content) = (outline(scene)?, *problem.roi(), problem.content());
    let (min, edge) = (DVec3::from(roi.min()), DVec3::from(roi.voxel()));
    let classes = content.classes();
    let mut is_ground = vec![false; content.occupied().len()];
    for (class, _) in classes.iter().enumerate().filter(|(_, name)| GROUND.contains(&name.as_str())) {
        for voxel in content.voxels_of_class(class) {
            if let Ok(at) = content.occupied().binary_search_by_key(voxel, |v| v.index) {
                is_ground[at] = true;
            }
        }
    }
    let mut occupied = content.occupied().to_vec();
    for (voxel, _) in occupied.iter_mut().zip(is_ground).filter(|(_, is_ground)| *is_ground) {
        let [i, j, k] = roi.coords(u64::from(voxel.index)).map(f64::from);
        let centre = min + (DVec3::new(i, j, k) + 0.5) * edge;
        let distance = footprint.distance([centre.x, centre.y]);
        if distance > 0.0 && distance <= NEAR {
            voxel.entropy[0] = voxel.entropy[0].saturating_add(fixed(nats));
        }
    }
    let by_class: Vec<Vec<u32>> =
        (0..classes.len()).map(|class| content.voxels_of_class(class).to_vec()).collect();
    let content =
        Content::new(classes.to_vec(), occupied, &by_class, content.has_detection());
    Ok(problem.with_content(content))
}
