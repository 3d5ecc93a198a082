//! Why a run cannot begin or go on.

use sightline_cma::CmaError;

use crate::engine::BackendError;
use crate::vehicle::{NoRoom, PoseGridError};

/// Why a search cannot begin or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum SearchError {
    #[error(transparent)]
    Backend(#[from] BackendError),
    #[error(transparent)]
    Cma(#[from] CmaError),
    #[error(transparent)]
    Grid(#[from] PoseGridError),
    /// No rig that keeps the rules of the mounts.
    #[error(transparent)]
    NoRoom(#[from] NoRoom),
    /// Less money than the cheapest sensors cost that the mounts must hold.
    #[error(
        "--budget: {budget} is below the cheapest rig of this vehicle, which costs {least}; raise it, or lower \
         `count` of the vehicle's mounts or `price` of its sensors"
    )]
    Budget { budget: f64, least: f64 },
    /// Equipment is chosen by a sum over voxels only.
    #[error(
        "models and numbers of sensors are chosen by near_gain, near_gain_2, near_gain_3 or information_gain, not by \
         `{objective}`: only a gain grows with every sensor; leave --objective out, or give each mount one model and one count"
    )]
    NotForEquipment { objective: String },
    /// Swaps over every pose of a grid that has too many.
    #[error(
        "--method swaps: the grid has {poses} sensor poses, and the bitmaps of {room} fit into memory; raise --memory, \
         widen --delta, or take --method both"
    )]
    WholeGrid { poses: u64, room: u64 },
    /// A suite without a scene.
    #[error("there is no scene to search over; give one at least")]
    NoScene,
    /// A scene with other beams than the first: one placement then is two.
    #[error(
        "the scene `{name}` has another LiDAR than `{first}`; give all scenes of a run the same `lidar`, or \
         run them one by one"
    )]
    OtherLidar { scene: usize, name: String, first: String },
    /// A scene with other rules of the mount than the first.
    #[error(
        "the scene `{name}` has another mount than `{first}`; give all scenes of a run the same `mount`, or \
         run them one by one"
    )]
    OtherMount { scene: usize, name: String, first: String },
    /// One of several scenes whose P-SOG tells nothing: no gain is a share of it.
    #[error(
        "the scene `{name}` has a P-SOG in which nothing is uncertain, so that no gain is a share of it; leave \
         it out, or give it frames in which something moves"
    )]
    NothingUncertain { scene: usize, name: String },
    /// An objective of a task that the scene does not have.
    #[error(
        "the objective `{objective}` needs a detection target; name its classes under `detection` in the \
         scene"
    )]
    NoDetection { objective: String, scene: usize },
}

impl SearchError {
    /// Number of the scene that it is about, from 0.
    pub fn scene(&self) -> Option<usize> {
        match self {
            Self::OtherLidar { scene, .. }
            | Self::OtherMount { scene, .. }
            | Self::NothingUncertain { scene, .. }
            | Self::NoDetection { scene, .. } => Some(*scene),
            _ => None,
        }
    }
}
