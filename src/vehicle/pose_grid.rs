//! Numbered sensor poses on a grid in the mount.

use super::mirror::{MIRRORED, pairs};
use super::{Constraints, Placement, SensorPose, Ties};

/// Grid values are rounded to multiples of 1/`DECIMALS`: 0.1 · 3 becomes 0.3.
const DECIMALS: f64 = 1e12;
/// Most poses of a grid.
const MAX_POSES: u64 = 1 << 31;

/// Spacing of a grid of sensor poses: δ of Algorithm 1 of Place3D.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spacing {
    /// Along x, y and z, in metres.
    pub metres: f64,
    /// Of roll, pitch and yaw, in radians.
    pub radians: f64,
}

/// All sensor poses on a grid of density δ within a mount.
///
/// Along each pose field the grid starts at the lower bound and ends at the last step within the upper
/// one. For mirrored pairs, y, roll and yaw run from −kδ to kδ instead: the mirror image of a pose is on
/// the grid. Poses are numbered from 0, with yaw fastest and x slowest.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseGrid {
    lower: [f64; 6],
    step: [f64; 6],
    count: [u32; 6],
}

/// Why a spacing makes no grid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseGridError {
    /// A spacing that is not positive and finite.
    #[error("a grid spacing of {value} {unit} is not usable; give a positive number")]
    BadSpacing {
        /// Spacing as given.
        value: f64,
        /// `m` or `rad`.
        unit: &'static str,
    },
    /// Too many poses to number.
    #[error("the grid has {poses} sensor poses, at most {MAX_POSES} are possible; widen --delta")]
    TooManyPoses {
        /// Poses of the grid.
        poses: u128,
    },
}

impl PoseGrid {
    /// Grid of a mount.
    ///
    /// # Errors
    /// A spacing that is not positive, or too many poses.
    pub fn new(constraints: &Constraints, spacing: Spacing) -> Result<Self, PoseGridError> {
        for (value, unit) in [(spacing.metres, "m"), (spacing.radians, "rad")] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(PoseGridError::BadSpacing { value, unit });
            }
        }
        let Spacing { metres, radians } = spacing;
        let step = [metres, metres, metres, radians, radians, radians];
        let whole = |extent: f64, k: usize| {
            // Bounds are decimal: 1.2 m is 12 steps of 0.1 m, though 1.2 / 0.1 = 11.999… in `f64`.
            let steps = extent / step[k];
            if (steps - steps.round()).abs() < 1e-9 { steps.round() } else { steps.floor() }
        };
        let centred = |k: usize| constraints.ties.symmetric && MIRRORED.contains(&k);
        let steps = |k: usize| match centred(k) {
            true => 2.0 * whole(constraints.upper[k], k),
            false => whole(constraints.upper[k] - constraints.lower[k], k),
        };
        let poses = (0..6).fold(1u128, |product, k| product.saturating_mul(steps(k) as u128 + 1));
        if poses > u128::from(MAX_POSES) {
            return Err(PoseGridError::TooManyPoses { poses });
        }
        let count = [0, 1, 2, 3, 4, 5].map(|k| steps(k) as u32 + 1);
        let lower = [0, 1, 2, 3, 4, 5].map(|k| match centred(k) {
            true => 0.0 - 0.5 * steps(k) * step[k],
            false => constraints.lower[k],
        });
        Ok(Self { lower, step, count })
    }

    /// Number of poses.
    pub fn len(&self) -> u32 {
        self.count.iter().product()
    }

    /// False: a grid has at least the pose at the lower bounds.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Distance of neighbours along each pose field, in m and rad.
    pub fn step(&self) -> [f64; 6] {
        self.step
    }

    /// Pose of a number below [`Self::len`].
    pub fn pose(&self, number: u32) -> SensorPose {
        let steps = self.steps_of(number);
        let [x, y, z, roll, pitch, yaw] = [0, 1, 2, 3, 4, 5].map(|k| {
            let value = self.lower[k] + f64::from(steps[k]) * self.step[k];
            // + 0.0 turns −0 into 0, which prints without a sign.
            if self.count[k] == 1 { value } else { (value * DECIMALS).round() / DECIMALS + 0.0 }
        });
        SensorPose::from_values([x, y, z, roll, pitch, yaw])
    }

    /// Number of the pose nearest to `pose` along each field.
    pub fn nearest(&self, pose: &SensorPose) -> u32 {
        let fields = pose.fields();
        self.number_of([0, 1, 2, 3, 4, 5].map(|k| {
            let steps = ((fields[k].1 - self.lower[k]) / self.step[k]).round();
            steps.clamp(0.0, f64::from(self.count[k] - 1)) as u32
        }))
    }

    /// Number of the mirror image of a pose, on a grid for mirrored pairs.
    pub fn mirrored(&self, number: u32) -> u32 {
        let mut steps = self.steps_of(number);
        MIRRORED.iter().for_each(|&k| steps[k] = self.count[k] - 1 - steps[k]);
        self.number_of(steps)
    }

    /// Number of a pose moved to the height of another.
    pub fn at_height_of(&self, number: u32, other: u32) -> u32 {
        let mut steps = self.steps_of(number);
        steps[2] = self.steps_of(other)[2];
        self.number_of(steps)
    }

    /// Numbers of the poses nearest to a placement's; for mirrored pairs, the nearest of the LiDAR of
    /// larger y and its mirror image.
    pub fn numbers_of(&self, placement: &Placement, ties: Ties) -> Vec<u32> {
        let lidars = &placement.lidars;
        if !ties.symmetric {
            return lidars.iter().map(|pose| self.nearest(pose)).collect();
        }
        let pairs = pairs(lidars);
        let single = pairs.in_plane.iter().chain(&pairs.alone);
        let single = single.map(|&lidar| self.nearest(&lidars[lidar]));
        let both = pairs.mirrored.iter().flat_map(|&[left, _]| {
            let left = self.nearest(&lidars[left]);
            [left, self.mirrored(left)]
        });
        both.chain(single).collect()
    }

    /// Placement with every LiDAR moved to its pose of [`Self::numbers_of`].
    pub fn snapped(&self, placement: &Placement, ties: Ties) -> Placement {
        let numbers = self.numbers_of(placement, ties);
        let lidars = numbers.into_iter().map(|number| self.pose(number)).collect();
        Placement { name: placement.name.clone(), lidars }
    }

    /// Poses at most `radius` steps from `number` along one field and equal in the others, rising.
    pub fn along(&self, number: u32, radius: u32) -> Vec<u32> {
        let centre = self.steps_of(number);
        let mut found = Vec::new();
        for k in 0..6 {
            let low = centre[k].saturating_sub(radius);
            let high = (centre[k] + radius).min(self.count[k] - 1);
            found.extend((low..=high).map(|s| {
                let mut steps = centre;
                steps[k] = s;
                self.number_of(steps)
            }));
        }
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Poses at most `radius` steps from `number` along every field, itself included, rising.
    pub fn around(&self, number: u32, radius: u32) -> Vec<u32> {
        let centre = self.steps_of(number);
        let mut found = vec![[0u32; 6]];
        for k in 0..6 {
            let low = centre[k].saturating_sub(radius);
            let high = (centre[k] + radius).min(self.count[k] - 1);
            found = found
                .into_iter()
                .flat_map(|steps| {
                    (low..=high).map(move |s| {
                        let mut steps = steps;
                        steps[k] = s;
                        steps
                    })
                })
                .collect();
        }
        found.into_iter().map(|steps| self.number_of(steps)).collect()
    }

    fn steps_of(&self, number: u32) -> [u32; 6] {
        let mut rest = number;
        let mut steps = [0; 6];
        for k in (0..6).rev() {
            steps[k] = rest % self.count[k];
            rest /= self.count[k];
        }
        steps
    }

    fn number_of(&self, steps: [u32; 6]) -> u32 {
        steps.iter().zip(self.count).fold(0, |number, (step, count)| number * count + step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constraints() -> Constraints {
        Constraints {
            lower: [-0.6, -0.6, 2.2, -0.3, 0.0, 0.0],
            upper: [0.6, 0.6, 2.8, 0.3, 0.0, 0.0],
            min_distance: 0.2,
            lidars: 4,
            ..Constraints::default()
        }
    }

    #[test]
    fn table_7_lies_on_the_grid_of_the_paper() {
        let grid = PoseGrid::new(&constraints(), Spacing { metres: 0.1, radians: 0.1 }).unwrap();
        assert_eq!(grid.len(), 13 * 13 * 7 * 7);
        let pose = SensorPose { roll: 0.1, ..SensorPose::at(-0.4, 0.3, 2.7) };
        assert_eq!(grid.pose(grid.nearest(&pose)), pose, "to the bit");
        for number in (0..grid.len()).step_by(97) {
            assert_eq!(grid.nearest(&grid.pose(number)), number);
        }
        let corner = grid.around(0, 1);
        assert_eq!(corner.len(), 16, "two steps along each of four free fields");
        assert!(corner.is_sorted() && corner[0] == 0);
        let number = grid.nearest(&pose);
        assert_eq!(grid.around(number, 2).len(), 5 * 5 * 4 * 5);
        // Two steps down and one up along z, four ways along the other free fields, and itself.
        assert_eq!(grid.along(number, 2).len(), 4 + 4 + 3 + 4 + 1);
    }

    #[test]
    fn a_spacing_that_makes_no_grid_is_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let spacing = Spacing { metres: 0.1, radians: bad };
            let error = PoseGrid::new(&constraints(), spacing).unwrap_err().to_string();
            assert!(error.contains("rad"), "{error}");
        }
        let fine = Spacing { metres: 1e-4, radians: 1e-3 };
        let error = PoseGrid::new(&constraints(), fine).unwrap_err();
        assert!(matches!(error, PoseGridError::TooManyPoses { .. }));
        let wide = Spacing { metres: 9.0, radians: 9.0 };
        assert_eq!(PoseGrid::new(&constraints(), wide).unwrap().len(), 1, "the lower corner");
    }
}
