use super::{Placement, SensorPose};

/// Slack for coordinates that a decimal file cannot give exactly: 0.6 − 0.4 is not 0.2.
const SLACK: f64 = 1e-9;

/// Where LiDARs may be mounted and how far apart, in the ego frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Constraints {
    /// Lower bounds of x, y, z (m), roll, pitch, yaw (rad).
    pub lower: [f64; 6],
    /// Upper bounds, same order; equal to the lower one where nothing may vary.
    pub upper: [f64; 6],
    /// Least distance between two LiDARs, in metres.
    pub min_distance: f64,
    /// LiDARs a placement has.
    pub lidars: usize,
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
        /// How far outside, in m or rad.
        by: f64,
    },
    /// Two LiDARs are closer than allowed.
    TooClose {
        /// Indices of the LiDARs.
        lidars: [usize; 2],
        /// Missing distance in metres.
        by: f64,
    },
}

impl Violation {
    /// How far from being kept, in m or rad.
    pub fn amount(&self) -> f64 {
        match self {
            Self::OutsideMount { by, .. } | Self::TooClose { by, .. } => *by,
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
        }
    }
}

impl Constraints {
    /// Every rule that the placement breaks; empty when it keeps all.
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
        found
    }

    /// Indices of the pose fields that may vary.
    pub fn free_fields(&self) -> Vec<usize> {
        (0..6).filter(|&k| self.upper[k] > self.lower[k]).collect()
    }

    /// Bounds of the search variables: the free fields of every LiDAR, LiDAR after LiDAR.
    pub fn variable_bounds(&self) -> Vec<(f64, f64)> {
        let free = self.free_fields();
        let one = free.iter().map(|&k| (self.lower[k], self.upper[k]));
        (0..self.lidars).flat_map(|_| one.clone()).collect()
    }

    /// Poses from search variables, in the order of [`Self::variable_bounds`].
    pub fn poses_of(&self, variables: &[f64]) -> Vec<SensorPose> {
        let free = self.free_fields();
        (0..self.lidars)
            .map(|lidar| {
                let mut pose = self.lower;
                for (slot, &k) in free.iter().enumerate() {
                    pose[k] = variables[lidar * free.len() + slot];
                }
                let [x, y, z, roll, pitch, yaw] = pose;
                SensorPose { x, y, z, roll, pitch, yaw }
            })
            .collect()
    }

    /// Search variables of a placement, its poses moved into the bounds.
    pub fn variables_of(&self, placement: &Placement) -> Vec<f64> {
        let free = self.free_fields();
        placement
            .lidars
            .iter()
            .flat_map(|pose| {
                let fields = pose.fields();
                free.iter()
                    .map(|&k| fields[k].1.clamp(self.lower[k], self.upper[k]))
                    .collect::<Vec<_>>()
            })
            .collect()
    }
}
