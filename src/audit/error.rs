//! Why a scene could not be audited.

use crate::engine::BackendError;
use crate::job::JobError;
use crate::psog::GridError;
use crate::vehicle::{SensorError, UnknownSensor};

/// Why a scene could not be audited.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AuditError {
    /// No placement was given.
    #[error("there are no placements to audit; name at least one")]
    NoPlacement,
    /// A job in several scenes.
    #[error("an audit is of one scene, not of {given}; audit them one by one")]
    OneScene {
        /// Scenes given.
        given: usize,
    },
    /// A job, or one of its changes, that cannot be posed.
    #[error(transparent)]
    Job(#[from] JobError),
    /// A changed region does not make a grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A LiDAR that casts no beams.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// Scoring failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// A LiDAR of a model that the vehicle does not have.
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
}
