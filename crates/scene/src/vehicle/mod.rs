//! The vehicle: sensors and their beams, the mount, placements and the rules they must keep.

pub mod constraints;
mod description;
mod doubts;
mod equipment;
mod lidar;
mod lidar_reading;
mod mesh_mirror;
mod mesh_mount;
mod mirror;
mod mount;
mod mount_names;
mod mounting;
mod pairing;
pub mod placement_file;
pub mod pose_grid;
mod published;
pub mod random;
mod region;
mod response;
mod sensor_choice;
pub mod sensor_file;
mod surface;
mod target_rule;
mod ties;
mod variables;
pub mod vehicle_file;
mod written;

pub use constraints::{Constraints, Slot, Ties, Violation};
pub(crate) use description::{LidarDescription, MountDescription, VehicleDescription};
pub use doubts::Doubts;
pub use doubts::{doubt_of_ground, doubts_of_units, is_degrees, of_angles, of_degrees, of_lidar};
pub use equipment::{Equipment, Vehicle, VehicleMount, VehicleSensor};
pub use lidar::Lidar;
pub use lidar_cast::sensor::{
    BeamGrid, BeamTable, Echoes, ForeignLidar, MAX_LIDARS, Phase, Placement, PlacementError,
    Response, SensorError, SensorModel, SensorName, SensorPose, Sensors, UnknownSensor,
};
pub use lidar_cast::task::Requirement;
pub use lidar_reading::Described;
pub use mount::MountRules;
pub use placement_file::{PlacementFileError, PlacementReader, read_placements};
pub use pose_grid::{PoseGrid, PoseGridError, Spacing};
pub use published::table_7;
pub use random::random_placements;
pub use random::random_placements_by_the_rules;
pub use region::Outline;
pub use region::Region;
pub use response::stated;
pub use sensor_choice::{SensorChoice, name_lidars};
pub use surface::Surface;
pub use target_rule::TargetRule;
pub use vehicle_file::read as read_vehicle;
pub use written::in_millimetres;
pub use written::{millimetres, placement_to_nanometres, to_nanometres};
