//! LiDARs and their mirror images at the plane y = 0.

use glam::DVec3;

use super::SensorPose;

/// Largest violation of a rule that counts as rounding, in m or rad: in `f64`, 0.6 − 0.4 is not 0.2.
pub(super) const SLACK: f64 = 1e-9;

/// Pose fields that change sign in a mirror image: y, roll and yaw.
pub(super) const MIRRORED: [usize; 3] = [1, 3, 5];

/// A point or direction mirrored at the plane y = 0.
pub(super) fn flipped(point: DVec3) -> DVec3 {
    DVec3 { y: 0.0 - point.y, ..point }
}

/// LiDARs of a placement by their position to the plane y = 0, as indices.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Pairs {
    /// Pairs of mirror images, the LiDAR of larger y first.
    pub(super) mirrored: Vec<[usize; 2]>,
    /// LiDARs in the plane, with roll and yaw 0.
    pub(super) in_plane: Vec<usize>,
    /// LiDARs outside of the plane without a mirror image.
    pub(super) alone: Vec<usize>,
}

/// Sorts LiDARs into pairs, those in the plane and those alone.
pub(super) fn pairs(lidars: &[SensorPose]) -> Pairs {
    let mut pairs = Pairs::default();
    let mut open: Vec<usize> = (0..lidars.len()).collect();
    while !open.is_empty() {
        let first = open.remove(0);
        let image = lidars[first].mirrored();
        let near = |other: &SensorPose| image.difference(other) <= SLACK;
        if near(&lidars[first]) {
            pairs.in_plane.push(first);
        } else if let Some(at) = open.iter().position(|&other| near(&lidars[other])) {
            let second = open.remove(at);
            let left_first = lidars[first].y >= lidars[second].y;
            pairs.mirrored.push(if left_first { [first, second] } else { [second, first] });
        } else {
            pairs.alone.push(first);
        }
    }
    pairs
}
