//! Ground near the vehicle that counts more in a search.

use std::collections::HashSet;

use serde::Serialize;

#[cfg(doc)]
use super::NearField;
use super::NearFieldError;
use super::ground::NEAR;
use super::look::outline;
use crate::problem::Problem;
use crate::psog::fixed;
use crate::scene::{GROUND_CLASSES, Scene};

/// Most nats that a voxel of near ground may be given.
pub const MOST_WEIGHT: f64 = 4.0;

/// What a placement gains in truth, and what it sees near the vehicle: stands beside a weighted search.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnweightedGain {
    /// Of the scene, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Of the placement.
    pub name: String,
    /// Σ H over covered voxels without the weight, in nats.
    pub information_gain: Option<f64>,
    /// As [`NearField::near_field`].
    pub near_field: f64,
    /// As [`NearField::ring`].
    pub ring: Option<f64>,
}

/// The problem with `nats` more entropy in every voxel of ground within 10 m of the own body: voxels in which
/// a class of the ground occurs in the P-SOG, whose centres lie outside the footprint.
///
/// Only the entropy of all classes grows, and with it `information_gain`; coverage and counts stay. What is
/// searched, bounded and reported as information then holds the weight.
///
/// # Errors
/// A scene without an own body, or a weight outside 0 to 4 nats.
pub fn weighted(scene: &Scene, problem: Problem, nats: f64) -> Result<Problem, NearFieldError> {
    if !(0.0..=MOST_WEIGHT).contains(&nats) {
        return Err(NearFieldError::Weight { given: nats, most: MOST_WEIGHT });
    }
    changed(scene, problem, i64::from(fixed(nats)))
}

/// The problem as it was before [`weighted`] with the same number of nats.
///
/// # Errors
/// As [`weighted`].
pub fn unweighted(scene: &Scene, problem: Problem, nats: f64) -> Result<Problem, NearFieldError> {
    changed(scene, problem, -i64::from(fixed(nats)))
}

fn changed(scene: &Scene, problem: Problem, more: i64) -> Result<Problem, NearFieldError> {
    let (footprint, roi, content) = (outline(scene)?, *problem.roi(), problem.content());
    let (min, edge) = (roi.min(), roi.voxel());
    let classes = content.classes().iter().enumerate();
    let ground = classes.filter(|(_, name)| GROUND_CLASSES.contains(&name.as_str()));
    let voxels = ground.flat_map(|(class, _)| content.voxels_of_class(class).iter().copied());
    let is_near = |&voxel: &u32| {
        let at = roi.coords(u64::from(voxel));
        let middle = [0, 1].map(|k| min[k] + (f64::from(at[k]) + 0.5) * edge[k]);
        let distance = footprint.distance(middle);
        distance > 0.0 && distance <= NEAR
    };
    let near: HashSet<u32> = voxels.filter(is_near).collect();
    let content = content.with_more_entropy(|voxel| if near.contains(&voxel) { more } else { 0 });
    Ok(problem.with_content(content))
}
