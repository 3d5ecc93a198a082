//! Rules of a mount, and the ways in which a placement breaks them.

use super::mirror::{SLACK, pairs};
use super::{Mount, Placement, SensorPose};

/// Rules of a mount, in the ego frame: bounds of the poses, distances, keep-out boxes, ties.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Constraints {
    /// Lower bounds of x, y, z (m), roll, pitch, yaw (rad).
    pub lower: [f64; 6],
    /// Upper bounds, same order; equal to the lower one where nothing may vary.
    pub upper: [f64; 6],
    /// Least distance between two LiDARs, in metres.
    pub min_distance: f64,
    /// Number of LiDARs of a placement.
    pub lidars: usize,
    /// Lower and upper corners of the boxes that LiDARs keep out of, in metres; faces are allowed.
    pub keep_out: Vec<[[f64; 3]; 2]>,
    /// Rules that tie the LiDARs of a placement together.
    pub ties: Ties,
}

impl From<&Mount> for Constraints {
    fn from(mount: &Mount) -> Self {
        let angles = [mount.roll, mount.pitch, mount.yaw];
        let bound = |side: usize, corner: [f64; 3]| {
            let [x, y, z] = corner;
            [x, y, z, angles[0][side], angles[1][side], angles[2][side]]
        };
        Self {
            lower: bound(0, mount.min),
            upper: bound(1, mount.max),
            min_distance: mount.min_distance,
            lidars: mount.lidars as usize,
            keep_out: mount.keep_out.clone(),
            ties: Ties { equal_height: mount.equal_height, symmetric: mount.symmetric },
        }
    }
}

/// Rules between the LiDARs of a placement; a search keeps them by having fewer variables.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Ties {
    /// All LiDARs stand at one height.
    pub equal_height: bool,
    /// LiDARs come in pairs mirrored at the plane y = 0: y, roll and yaw change sign. An odd one lies in
    /// the plane, with roll and yaw 0.
    pub symmetric: bool,
}

impl Ties {
    /// Whether any rule ties LiDARs together.
    pub fn any(&self) -> bool {
        self.equal_height || self.symmetric
    }
}

/// One broken rule of a placement.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Violation {
    /// A LiDAR lies outside the bounds.
    OutsideMount {
        /// Index of the LiDAR.
        lidar: usize,
        /// `x`, `y`, `z`, `roll`, `pitch` or `yaw`.
        field: &'static str,
        /// Distance from the bound, in m or rad.
        by: f64,
    },
    /// Two LiDARs are closer than allowed.
    TooClose {
        /// Indices of the LiDARs.
        lidars: [usize; 2],
        /// Missing distance in metres.
        by: f64,
    },
    /// A LiDAR lies inside a keep-out box.
    KeptOut {
        /// Index of the LiDAR.
        lidar: usize,
        /// Index of the box.
        keep_out: usize,
        /// Distance to its nearest face in metres.
        by: f64,
    },
    /// The LiDARs stand at different heights against the rule.
    UnequalHeight {
        /// Height of the highest above the lowest, in metres.
        by: f64,
    },
    /// A LiDAR has no mirror image among the others, and does not lie in the plane of symmetry.
    NotMirrored {
        /// Index of the LiDAR.
        lidar: usize,
        /// Sum of the differences of its pose fields from the nearest mirror image, in m and rad.
        by: f64,
    },
}

impl Violation {
    /// Distance from keeping the rule, in m or rad.
    pub fn amount(&self) -> f64 {
        match self {
            Self::OutsideMount { by, .. }
            | Self::TooClose { by, .. }
            | Self::KeptOut { by, .. }
            | Self::UnequalHeight { by }
            | Self::NotMirrored { by, .. } => *by,
        }
    }
}

impl std::fmt::Display for Violation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutsideMount { lidar, field, by } => {
                write!(f, "LiDAR {lidar}: {field} is {by:.3} outside the mount")
            }
            Self::TooClose { lidars: [a, b], by } => {
                write!(f, "LiDARs {a} and {b} are {by:.3} m too close")
            }
            Self::KeptOut { lidar, keep_out, by } => {
                write!(f, "LiDAR {lidar} is {by:.3} m inside of keep_out[{keep_out}]")
            }
            Self::UnequalHeight { by } => {
                write!(f, "heights differ by {by:.3} m, and are to be equal")
            }
            Self::NotMirrored { lidar, by } => {
                write!(f, "LiDAR {lidar} is off by {by:.3} from a mirror image at the plane y = 0")
            }
        }
    }
}

impl Constraints {
    /// Broken rules; empty for a placement that keeps all.
    pub fn violations(&self, placement: &Placement) -> Vec<Violation> {
        let mut found = Vec::new();
        for (lidar, pose) in placement.lidars.iter().enumerate() {
            for (k, (field, value)) in pose.fields().into_iter().enumerate() {
                let by = (self.lower[k] - value).max(value - self.upper[k]);
                if by > SLACK {
                    found.push(Violation::OutsideMount { lidar, field, by });
                }
            }
        }
        for (a, first) in placement.lidars.iter().enumerate() {
            for (b, second) in placement.lidars.iter().enumerate().skip(a + 1) {
                let by = self.min_distance - first.position().distance(second.position());
                if by > SLACK {
                    found.push(Violation::TooClose { lidars: [a, b], by });
                }
            }
        }
        for (lidar, pose) in placement.lidars.iter().enumerate() {
            let inside = self.depths(pose.position().to_array());
            found.extend(inside.map(|(keep_out, by)| Violation::KeptOut { lidar, keep_out, by }));
        }
        if self.ties.equal_height {
            let heights = placement.lidars.iter().map(|pose| pose.z);
            let by = heights.clone().fold(f64::MIN, f64::max) - heights.fold(f64::MAX, f64::min);
            found.extend((by > SLACK).then_some(Violation::UnequalHeight { by }));
        }
        if self.ties.symmetric {
            for lidar in pairs(&placement.lidars).alone {
                let image = placement.lidars[lidar].mirrored();
                let off = placement.lidars.iter().map(|other| image.difference(other));
                let by = off.fold(f64::MAX, f64::min).max(SLACK);
                found.push(Violation::NotMirrored { lidar, by });
            }
        }
        found
    }

    /// Keep-out boxes around a point, and its depth in each.
    fn depths(&self, point: [f64; 3]) -> impl Iterator<Item = (usize, f64)> {
        let depths = self.keep_out.iter().enumerate().map(move |(index, [min, max])| {
            let to_face = (0..3).map(|k| (point[k] - min[k]).min(max[k] - point[k]));
            (index, to_face.fold(f64::MAX, f64::min))
        });
        depths.filter(|&(_, by)| by > SLACK)
    }

    /// Whether a pose lies outside of every keep-out box.
    pub fn is_clear(&self, pose: &SensorPose) -> bool {
        self.depths(pose.position().to_array()).next().is_none()
    }

    /// Rules without the ties.
    pub fn untied(&self) -> Self {
        Self { ties: Ties::default(), ..self.clone() }
    }

    /// Indices of the pose fields that may vary.
    pub fn free_fields(&self) -> Vec<usize> {
        (0..6).filter(|&k| self.upper[k] > self.lower[k]).collect()
    }
}
