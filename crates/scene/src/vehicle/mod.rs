//! The vehicle: sensors and their beams, the mount, placements and the rules they must keep.

pub mod constraints;
mod description;
mod doubts;
mod equipment;
mod joints;
mod lidar;
mod lidar_reading;
mod mesh_mount;
mod mount;
mod mounting;
mod pairing;
pub mod placement_file;
pub mod placements;
pub mod pose_grid;
mod region;
mod room;
mod rules;
pub mod sensor_file;
mod surface;
mod variables;
mod vehicle_file;

pub use self::rules::{
    ANY_LOST, FARTHEST_GROUND, GroundAsked, GroundRule, ON_SCENE, OverlapRule, Side, TargetRule,
};
pub use constraints::{Constraints, OtherModel, Slot, Ties, Violation};
pub(crate) use description::{
    LidarDescription, MountDescription, MountingDescription, VehicleDescription,
};
pub use doubts::{
    Doubts, FARTHEST as FARTHEST_ON_VEHICLE, doubt_of_ground, doubts_of_units, of_degrees,
};
pub(crate) use doubts::{is_degrees, of_angles, of_lidar};
pub use equipment::{
    Equipment, Vehicle, VehicleMount, VehicleSensor, is_within_budget, sum_of_prices,
};
pub use joints::UrdfJoint;
pub use lidar::{LIDAR, Lidar, OtherSensor};
pub use lidar_cast::sensor::{
    BeamGrid, BeamTable, Echoes, ForeignLidar, MAX_LIDARS, Placement, Response, SensorError,
    SensorModel, SensorName, SensorPose, Sensors, SpinPhase, UnknownSensor,
};
pub use lidar_cast::task::Requirement;
pub use mount::{MountRules, UNNAMED};
#[cfg(all(test, feature = "mesh"))]
pub(crate) use pairing::tests::check_pairs;
pub use placement_file::{PlacementFileError, PlacementReader, read_placements};
pub use placements::{
    SensorChoice, in_millimetres, millimetres, name_lidars, placement_to_nanometres,
    random_placements, random_placements_by_the_rules, table_7, table_7_held_by, to_nanometres,
};
pub use pose_grid::{PoseGrid, PoseGridError, Spacing};
pub use region::{Outline, Region};
pub use room::NoRoom;
pub use surface::Surface;
pub(crate) use vehicle_file::read as read_vehicle;
