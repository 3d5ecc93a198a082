//! Why a scene could not be audited.

use crate::engine::{BackendError, OpenError};
use crate::problem::ProblemError;
use crate::psog::GridError;
use crate::vehicle::SensorError;

/// Why a scene could not be audited.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AuditError {
    /// No placement was given.
    #[error("there are no placements to audit; name at least one")]
    NoPlacement,
    /// The P-SOG does not fit the scene.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A changed P-SOG does not make a problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// A changed region does not make a grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The scene's LiDAR casts no beams.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// Scoring failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
}
