//! Beam tables, placements and the rules a placement must keep.

mod constraints;
mod file;
mod grid;
mod pose;
mod published;
mod random;
mod sensor;
mod variables;

pub use constraints::{Constraints, Ties, Violation};
pub use file::{PlacementReader, ReadError, read_placements};
pub use grid::{PoseGrid, PoseGridError, Spacing};
pub use pose::{MAX_LIDARS, Placement, PlacementError, SensorPose};
pub use published::table_7;
pub use random::random_placements;
pub use sensor::{BeamTable, SensorError};
