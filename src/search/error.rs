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
    /// Less money than the cheapest sensors cost that the mounts must hold.
    #[error(
        "a budget of {budget} is below the cheapest rig of this vehicle, which costs {least}; raise it"
    )]
    Budget {
        /// As given.
        budget: f64,
        /// Price of the cheapest equipment.
        least: f64,
    },
    /// Equipment is chosen by a sum over voxels only.
    #[error(
        "models and numbers of sensors are chosen by information_gain, not by `{objective}`: only the gain grows \
         with every sensor; leave --objective out, or give each mount one model and one count"
    )]
    NotForEquipment {
        /// The objective.
        objective: String,
    },
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
