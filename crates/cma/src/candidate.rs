//! One point of a generation and its origin.

use nalgebra::DVector;

/// Origin of a candidate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Origin {
    /// Drawn from the distribution.
    Sampled,
    /// Given by the caller: [`super::Cma::inject`].
    Injected,
    /// Best point of the generation before, moved onto the bounds near it.
    Clipped,
}

/// A point to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Coordinates in the search space.
    pub(super) x: DVector<f64>,
    /// Coordinates in the caller's space.
    pub(super) point: Vec<f64>,
    pub(super) origin: Origin,
    /// ‖C^(−1/2) (x − m)/σ‖² = ‖z‖² of a sample; 0 of other origins.
    pub(super) length: f64,
}

impl Candidate {
    /// Coordinates in the caller's space, within the bounds.
    pub fn point(&self) -> &[f64] {
        &self.point
    }
}
