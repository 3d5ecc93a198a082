//! Two rigs LiDAR by LiDAR, and how far each is from being its own mirror image.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;

use serde::Serialize;

use super::frames::{tilt, turn};
use super::{Rig, RigError, RigLidar};
use sightline_scene::vehicle::SensorPose;

/// Largest difference of angles that are taken for equal, in radians.
const SAME: f64 = 1e-9;

/// A LiDAR before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moved {
    /// Its frame, as the first rig calls it.
    pub frame: String,
    /// Distance between the optical centres, in metres.
    pub moved: f64,
    /// Angle between the rotations, in radians.
    pub turned: f64,
    /// Angle between the sensors' own z axes, in radians: a turn about z changes no beam of a full circle.
    pub tilted: f64,
}

/// How far a pair of LiDARs is from being mirror images at the plane y = 0, or one LiDAR from being its own.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Asymmetry {
    /// The LiDAR of larger y.
    pub left: String,
    /// Its partner; the same LiDAR where it stands near the plane.
    pub right: String,
    /// Distance between the left one and the right one's image, in metres.
    pub moved: f64,
    /// Angle between their rotations, in radians.
    pub turned: f64,
    /// Angle between their z axes, in radians.
    pub tilted: f64,
    /// True if both have the same roll other than 0: in a mirror image roll changes its sign.
    pub same_roll: bool,
}

/// Two rigs compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// LiDARs in the order of the first rig.
    pub lidars: Vec<Moved>,
    /// Asymmetry of the first rig.
    pub before: Vec<Asymmetry>,
    /// Asymmetry of the second rig.
    pub after: Vec<Asymmetry>,
}

/// Compares LiDARs of the same frames, or by their order where the frames differ.
///
/// # Errors
/// Rigs of other frames and another number of LiDARs.
pub fn compare(before: &Rig, after: &Rig) -> Result<Comparison, RigError> {
    let by_frame: HashMap<&str, &RigLidar> =
        after.lidars.iter().map(|lidar| (lidar.frame.as_str(), lidar)).collect();
    let same_count = before.lidars.len() == after.lidars.len();
    let named = before.lidars.iter().map(|lidar| by_frame.get(lidar.frame.as_str()).copied());
    let pairs: Vec<(&RigLidar, &RigLidar)> = match named.collect::<Option<Vec<_>>>() {
        Some(partners) if same_count => before.lidars.iter().zip(partners).collect(),
        _ if same_count => before.lidars.iter().zip(&after.lidars).collect(),
        _ => {
            let frames = |rig: &Rig| rig.lidars.iter().map(|l| l.frame.clone()).collect();
            return Err(RigError::Unmatched { before: frames(before), after: frames(after) });
        }
    };
    let moved = |(a, b): (&RigLidar, &RigLidar)| {
        let [moved, turned, tilted] = difference(&a.pose, &b.pose);
        Moved { frame: a.frame.clone(), moved, turned, tilted }
    };
    Ok(Comparison {
        lidars: pairs.into_iter().map(moved).collect(),
        before: asymmetries(before),
        after: asymmetries(after),
    })
}

/// Distance in metres, angle between rotations and angle between z axes in radians.
fn difference(a: &SensorPose, b: &SensorPose) -> [f64; 3] {
    let (ego_from_a, ego_from_b) = (a.ego_from_sensor(), b.ego_from_sensor());
    let (ra, rb) = (ego_from_a.rotation, ego_from_b.rotation);
    [a.position().distance(b.position()), turn(&ra, &rb), tilt(ra.z_axis, rb.z_axis)]
}

/// Pairs whose images are nearest, each LiDAR once; those that are left are compared with themselves.
fn asymmetries(rig: &Rig) -> Vec<Asymmetry> {
    let lidars = &rig.lidars;
    let gap = |a: usize, b: usize| {
        lidars[a].pose.position().distance(lidars[b].pose.mirrored().position())
    };
    let all = (0..lidars.len()).flat_map(|a| (a..lidars.len()).map(move |b| (a, b)));
    let mut candidates: Vec<(usize, usize)> = all.collect();
    candidates.sort_by(|&(a, b), &(c, d)| gap(a, b).total_cmp(&gap(c, d)));
    let mut taken = vec![false; lidars.len()];
    let mut pairs = Vec::new();
    for (a, b) in candidates {
        if !taken[a] && !taken[b] {
            (taken[a], taken[b]) = (true, true);
            pairs.push(if lidars[a].pose.y >= lidars[b].pose.y { (a, b) } else { (b, a) });
        }
    }
    pairs.sort_unstable();
    pairs.into_iter().map(|(left, right)| asymmetry(&lidars[left], &lidars[right])).collect()
}

fn asymmetry(left: &RigLidar, right: &RigLidar) -> Asymmetry {
    let [moved, turned, tilted] = difference(&left.pose, &right.pose.mirrored());
    let (a, b) = (&left.pose, &right.pose);
    // Only where roll means the same for both: neither looks straight up or down, and they are two.
    let level = a.pitch.abs() < FRAC_PI_2 && b.pitch.abs() < FRAC_PI_2;
    let same_roll = left.frame != right.frame
        && level
        && a.roll.abs() > SAME
        && (a.roll - b.roll).abs() <= SAME;
    Asymmetry {
        left: left.frame.clone(),
        right: right.frame.clone(),
        moved,
        turned,
        tilted,
        same_roll,
    }
}
