//! The vehicle: sensors and their beams, the mount, placements and the rules they must keep.

mod beam_table;
pub(crate) mod constraints;
mod description;
mod equipment;
mod lidar;
mod lidar_reading;
mod mirror;
mod mount;
mod mounting;
mod placement;
pub(crate) mod placement_file;
pub(crate) mod pose_grid;
mod published;
pub(crate) mod random;
mod region;
pub mod sensor_file;
mod sensor_name;
mod sensors;
mod variables;
pub(crate) mod vehicle_file;

pub use beam_table::{BeamGrid, BeamTable, SensorError};
pub use constraints::{Constraints, Slot, Ties, Violation};
pub(crate) use description::{LidarDescription, MountDescription, VehicleDescription};
pub use equipment::{Equipment, Requirement, Vehicle, VehicleMount, VehicleSensor};
pub use lidar::Lidar;
pub use mount::{Mount, MountRules};
pub use placement::{MAX_LIDARS, Placement, PlacementError, SensorPose};
pub use placement_file::{PlacementFileError, PlacementReader, read_placements};
pub(crate) use pose_grid::{PoseGrid, PoseGridError, Spacing};
pub use published::table_7;
pub use random::random_placements;
pub(crate) use random::random_placements_by_the_rules;
pub use region::{Outline, Region};
pub use sensor_name::SensorName;
pub use sensors::{Phase, SensorModel, Sensors, UnknownSensor};
pub(crate) use vehicle_file::read as read_vehicle;
