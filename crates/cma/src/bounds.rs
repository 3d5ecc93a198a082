//! Smooth map of the unbounded search space onto the caller's box.

use serde::{Deserialize, Serialize};

/// Width of the bent margin at each bound, as a share of the range.
const MARGIN: f64 = 0.05;

/// Smooth map from ℝⁿ onto a box, coordinate by coordinate, each scaled from [0, 1].
///
/// The map is the identity on [m, 1 − m], with the margin m = 0.05. It is quadratic within m of a bound, with
/// slope 0 at x = −m and x = 1 + m. Beyond, it is mirrored with period 2 (1 + 2m). Every search point is feasible.
/// The map is `BoundTransform` of N. Hansen's pycma with one margin for both sides. Variables of width 0
/// are left out of the search space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct BoundTransform {
    bounds: Vec<(f64, f64)>,
    /// Variables of width above 0, by index.
    free: Vec<usize>,
}

impl BoundTransform {
    /// Map onto the box of (lower, upper) bounds, finite and in order.
    pub(super) fn new(bounds: Vec<(f64, f64)>) -> Self {
        let free = (0..bounds.len()).filter(|&k| bounds[k].1 > bounds[k].0).collect();
        Self { bounds, free }
    }

    /// True if each of `all` variables has finite bounds in order, and `free` lists the variables whose bounds differ.
    pub(super) fn is_whole(&self, all: usize) -> bool {
        let usable = |&(low, high): &(f64, f64)| low.is_finite() && high.is_finite() && low <= high;
        self.bounds.len() == all
            && self.bounds.iter().all(usable)
            && *self == Self::new(self.bounds.clone())
    }

    /// Number of variables of the search space.
    pub(super) fn free_count(&self) -> usize {
        self.free.len()
    }

    /// Entries of the free variables in a vector of the caller's space, scaled by `scale(entry, bounds)`.
    pub(super) fn free_part(
        &self,
        full: &[f64],
        scale: impl Fn(f64, (f64, f64)) -> f64,
    ) -> Vec<f64> {
        self.free.iter().map(|&k| scale(full[k], self.bounds[k])).collect()
    }

    /// Point of the box at `x` of the search space.
    pub(super) fn point(&self, x: &[f64]) -> Vec<f64> {
        let mut point: Vec<f64> = self.bounds.iter().map(|b| b.0).collect();
        for (&x, &k) in x.iter().zip(&self.free) {
            let (low, high) = self.bounds[k];
            let share = bend(x);
            // Rounding must neither leave the box nor miss its upper bound.
            point[k] = if share == 1.0 { high } else { (low + share * (high - low)).min(high) };
        }
        point
    }

    /// Moves each coordinate within `near(k)` of a bound onto it; `None` where none moves.
    ///
    /// `k` counts the variables of the search space, `near` is a share of the range.
    pub(super) fn clipped(&self, point: &[f64], near: impl Fn(usize) -> f64) -> Option<Vec<f64>> {
        let mut clipped = point.to_vec();
        for (k, &at) in self.free.iter().enumerate() {
            let (low, high) = self.bounds[at];
            let reach = near(k) * (high - low);
            if clipped[at] - low <= reach {
                clipped[at] = low;
            } else if high - clipped[at] <= reach {
                clipped[at] = high;
            }
        }
        (clipped != point).then_some(clipped)
    }

    /// Search point of a point in the box; coordinates outside count as on the bound.
    pub(super) fn preimage(&self, point: &[f64]) -> Vec<f64> {
        self.free_part(point, |v, (low, high)| unbend(((v - low) / (high - low)).clamp(0.0, 1.0)))
    }
}

/// Map of one coordinate, ℝ onto [0, 1].
fn bend(x: f64) -> f64 {
    let mut x = x;
    if !(-MARGIN..=1.0 + MARGIN).contains(&x) {
        let period = 2.0 * (1.0 + 2.0 * MARGIN);
        x = (x + MARGIN).rem_euclid(period) - MARGIN;
        if x > 1.0 + MARGIN {
            x = 2.0 + 2.0 * MARGIN - x;
        }
    }
    if x < MARGIN {
        (x + MARGIN).powi(2) / (4.0 * MARGIN)
    } else if x > 1.0 - MARGIN {
        1.0 - (x - 1.0 - MARGIN).powi(2) / (4.0 * MARGIN)
    } else {
        x
    }
}

/// Inverse of [`bend`] on [0, 1], with values in [−m, 1 + m].
fn unbend(y: f64) -> f64 {
    if y < MARGIN {
        2.0 * (MARGIN * y).sqrt() - MARGIN
    } else if y > 1.0 - MARGIN {
        1.0 + MARGIN - 2.0 * (MARGIN * (1.0 - y)).sqrt()
    } else {
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bending_is_continuous_feasible_and_undone() {
        let mut last = bend(-5.0);
        for step in -5000..5000 {
            let y = bend(f64::from(step) * 1e-3);
            assert!((0.0..=1.0).contains(&y), "{y}");
            assert!((y - last).abs() < 1.1e-3);
            last = y;
        }
        for step in 0..=1000 {
            let y = f64::from(step) * 1e-3;
            assert!((bend(unbend(y)) - y).abs() < 1e-12, "{y}");
        }
        assert_eq!((bend(-MARGIN), bend(0.3)), (0.0, 0.3));
        assert!((bend(1.0 + MARGIN) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn coordinates_of_no_width_are_fixed() {
        let transform = BoundTransform::new(vec![(2.0, 2.0), (-1.0, 3.0)]);
        assert_eq!(transform.free_count(), 1);
        assert_eq!(transform.point(&[0.5]), [2.0, 1.0]);
        assert_eq!(transform.preimage(&[9.0, 1.0]), [0.5]);
    }
}
