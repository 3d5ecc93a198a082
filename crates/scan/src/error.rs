//! Why a scene cannot be scanned.

use super::conditions::ConditionError;
use lidar_cast::engine::OutOfMemory;
use sightline_scene::vehicle::{SensorError, UnknownSensor};

/// Why a scene cannot be scanned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScanError {
    /// There is nothing to scan.
    #[error("the scene `{scene}` has no geometry; a scan needs `static`, `actors` or a body")]
    NoGeometry {
        /// Name of the scene.
        scene: String,
    },
    /// Instances are numbers of 16 bits.
    #[error(
        "the scene `{scene}` has {actors} actors, a scan tells at most 65534 apart; leave some out"
    )]
    TooManyActors {
        /// Name of the scene.
        scene: String,
        /// Actors that it has.
        actors: usize,
    },
    /// A sensor of a model that the vehicle does not have.
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
    /// A model without beams.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// A condition of an ideal scan.
    #[error(
        "the condition `{condition}` acts on beams, of which an ideal scan has the geometry alone; leave out one \
         of the two"
    )]
    Ideal {
        /// Text as written.
        condition: String,
    },
    /// Conditions that do not go together.
    #[error(transparent)]
    Condition(#[from] ConditionError),
    /// The trees do not fit into memory.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
}
