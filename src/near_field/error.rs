//! Why a scene has no near field.

use crate::engine::BackendError;
use crate::vehicle::UnknownSensor;

/// Why the near field of a scene cannot be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NearFieldError {
    /// No triangle of an own body, or a body that is a line from above.
    #[error(
        "{scene}: the own vehicle has no body, from whose outline the near field counts; describe it under \
         `ego.body` in the scene"
    )]
    NoBody {
        /// File or name of the scene.
        scene: String,
    },
    /// A body far larger than any vehicle.
    #[error(
        "{scene}: the own vehicle's body is {length:.0} m long or wide, more than {most:.0} m; give `ego.body` \
         in metres"
    )]
    LargeBody {
        /// File or name of the scene.
        scene: String,
        /// Longer side of the body.
        length: f64,
        /// The limit.
        most: f64,
    },
    /// No cell near the body is ground in any frame.
    #[error(
        "{scene}: there is no ground within {within} m of the own vehicle: no surface of a class named {names} \
         within 2 m of z = 0; name the ground's class so"
    )]
    NoGround {
        /// File or name of the scene.
        scene: String,
        /// Metres around the body.
        within: f64,
        /// Names of the classes that count as ground.
        names: String,
    },
    /// A sensor of a model that the vehicle does not have.
    #[error(transparent)]
    UnknownSensor(#[from] UnknownSensor),
    /// Casting failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
}
