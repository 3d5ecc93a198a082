//! LiDARs: their beams, their models, their poses, and placements of several on a vehicle.

mod angles;
mod beam_table;
mod mirror;
mod models;
mod name;
mod placement;
mod response;

pub use beam_table::{BeamGrid, BeamTable, SensorError};
pub use models::{ForeignLidar, Phase, SensorModel, Sensors, UnknownSensor};
pub use name::SensorName;
pub use placement::{MAX_LIDARS, Placement, PlacementError, SensorPose};
pub use response::{Echoes, Response};
