//! LiDARs: their beams, their models, their poses, and placements of several on a vehicle.

mod beam_table;
mod models;
mod placement;
mod ride;

pub use beam_table::{BeamGrid, BeamTable, Echoes, Response};
pub use models::{ForeignLidar, SensorModel, Sensors, SpinPhase, UnknownSensor};
pub use placement::{MAX_LIDARS, Placement, SensorError, SensorName, SensorPose, nearest};
pub use ride::Ride;
