use serde::{Deserialize, Serialize};

/// Width of the bent margin at each bound, as a share of the range.
const MARGIN: f64 = 0.05;

/// Smooth map from all of ℝ onto a box, coordinate by coordinate, each scaled from [0, 1].
///
/// Inside it is the identity; within a margin of a bound it bends quadratically and turns back beyond
/// it, periodically, so that every point is feasible and a bound is reached with slope zero (the
/// transform that N. Hansen's pycma calls `BoundTransform`, with one margin for both sides).
/// Coordinates of no width have no place in the search space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoundTransform {
    bounds: Vec<(f64, f64)>,
    free: Vec<usize>,
}

impl BoundTransform {
    /// A transform onto the box of these (lower, upper) bounds, finite and in order.
    pub(super) fn new(bounds: Vec<(f64, f64)>) -> Self {
        let free = (0..bounds.len()).filter(|&k| bounds[k].1 > bounds[k].0).collect();
        Self { bounds, free }
    }

    /// Variables of the search space.
    pub(super) fn free_count(&self) -> usize {
        self.free.len()
    }

    /// The part of a vector of the caller's space that is free, scaled by `scale`.
    pub(super) fn free_part(
        &self,
        full: &[f64],
        scale: impl Fn(f64, (f64, f64)) -> f64,
    ) -> Vec<f64> {
        self.free.iter().map(|&k| scale(full[k], self.bounds[k])).collect()
    }

    /// The feasible point of a search point.
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

    /// A point in the box with those coordinates on a bound that are within `near`, a share of the
    /// range, of it, by variable of the search space; `None` where that changes nothing.
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

    /// A search point of a point in the box; points outside are moved onto it.
    pub(super) fn preimage(&self, point: &[f64]) -> Vec<f64> {
        self.free_part(point, |v, (low, high)| unbend(((v - low) / (high - low)).clamp(0.0, 1.0)))
    }
}

/// ℝ onto [0, 1].
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

/// The value in [−margin, 1 + margin] that [`bend`] takes to `y`.
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
