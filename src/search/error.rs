//! Why a run cannot begin or go on.

use sightline_cma::CmaError;

use crate::engine::BackendError;
use crate::vehicle::PoseGridError;

/// Why a search cannot begin or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// From evaluating.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// From the CMA-ES.
    #[error(transparent)]
    Cma(#[from] CmaError),
    /// From the grid of poses.
    #[error(transparent)]
    Grid(#[from] PoseGridError),
    /// An objective of a task that the scene does not have.
    #[error(
        "the objective `{objective}` needs a detection target; name its classes under `detection` in the \
         scene"
    )]
    NoDetection {
        /// The objective.
        objective: String,
    },
}
