//! The vehicle: sensors and their beams, the mount, placements and the rules they must keep.

mod beam_table;
pub(crate) mod constraints;
mod description;
mod lidar;
mod lidar_reading;
mod mirror;
mod mount;
mod placement;
pub(crate) mod placement_file;
pub(crate) mod pose_grid;
mod published;
pub(crate) mod random;
pub mod sensor_file;
mod variables;

pub use beam_table::{BeamGrid, BeamTable, SensorError};
pub(crate) use constraints::Ties;
pub use constraints::{Constraints, Violation};
pub(crate) use description::{LidarDescription, MountDescription};
pub use lidar::Lidar;
pub use mount::{Mount, MountRules};
pub use placement::{MAX_LIDARS, Placement, PlacementError, SensorPose};
pub use placement_file::{PlacementFileError, PlacementReader, read_placements};
pub(crate) use pose_grid::{PoseGrid, PoseGridError, Spacing};
pub use published::table_7;
pub use random::random_placements;
pub(crate) use random::random_placements_by_the_rules;
