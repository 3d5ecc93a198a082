//! Why a scene could not be audited.

use crate::job::JobError;
use crate::vehicle::UnknownSensor;

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
    /// A job, or one of its changes, that cannot be posed or scored.
    #[error(transparent)]
    Job(JobError),
    /// A LiDAR of a model that the vehicle does not have.
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
}

impl<E> From<E> for AuditError
where
    JobError: From<E>,
{
    fn from(error: E) -> Self {
        Self::Job(error.into())
    }
}
