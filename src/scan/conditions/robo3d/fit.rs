//! Polynomials through points by least squares.

use nalgebra::{SMatrix, SVector};

/// A polynomial of N coefficients, constant first; its variable is in units of 100 m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Polynomial<const N: usize>([f64; N]);

const UNIT: f64 = 100.0;

impl<const N: usize> Polynomial<N> {
    /// Through pairs of a distance in metres and a value; none where they do not fix it.
    pub fn through(points: impl Iterator<Item = (f64, f64)>) -> Option<Self> {
        let mut normal = SMatrix::<f64, N, N>::zeros();
        let mut right = SVector::<f64, N>::zeros();
        for (distance, value) in points {
            let row = SVector::<f64, N>::from_fn(|k, _| (distance / UNIT).powi(k as i32));
            normal += row * row.transpose();
            right += row * value;
        }
        let solution = normal.cholesky()?.solve(&right);
        solution.iter().all(|c| c.is_finite()).then(|| Self(solution.into()))
    }

    /// Value at a distance in metres.
    pub fn at(&self, distance: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |sum, c| sum * distance / UNIT + c)
    }
}
