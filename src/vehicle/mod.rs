//! The vehicle: sensors and their beams, the mount, placements and the rules they must keep.

mod beam_table;
mod constraints;
mod description;
mod lidar;
mod mirror;
mod mount;
mod placement;
mod placement_file;
mod pose_grid;
mod published;
mod random;
mod variables;

pub use beam_table::{BeamGrid, BeamTable, SensorError};
pub use constraints::{Constraints, Ties, Violation};
pub(crate) use description::{LidarDescription, MountDescription};
pub use lidar::Lidar;
pub use mount::{Mount, MountRules};
pub use placement::{MAX_LIDARS, Placement, PlacementError, SensorPose};
pub use placement_file::{PlacementFileError, PlacementReader, count_placements, read_placements};
pub use pose_grid::{PoseGrid, PoseGridError, Spacing};
pub use published::table_7;
pub use random::{random_placements, random_placements_by_the_rules};
