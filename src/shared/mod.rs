//! How many LiDARs of a placement see a thing, and how far pairs of them see the same things.
//!
//! - **Seen by k LiDARs**, of voxels: exactly k LiDARs cover the voxel, as in scores. Of ground: exactly k LiDARs see
//!   the cell, as in the near field. Of targets: exactly k LiDARs meet the target with five beams each, alone on level
//!   ground with the own body in the way.
//! - **Surface voxel** of a LiDAR: a voxel of the region in which one of its beams ends at a surface other than the own
//!   body. Shared by two LiDARs: both have a hit in it in the same frame.
//! - **Shared directions** of two LiDARs: share of the sphere that lies in both fields of view, at their attitudes.
//!   Positions, ranges and the own body play no part, as for a point far away.
//!
//! | file | holds |
//! |---|---|
//! | `counts` | things seen by no, one, two, three and more LiDARs, from sets of bits |
//! | `redundancy` | voxels, ground and targets of a scene by the number of LiDARs that see them |
//! | `field_of_view` | the directions that a sensor looks into |
//! | `overlap` | shared voxels and directions of pairs, and whether pairs connect all LiDARs |

mod counts;
mod field_of_view;
mod overlap;
mod redundancy;

pub use counts::{SeenAlone, SeenBy};
pub(crate) use field_of_view::FieldOfView;
pub use overlap::{LEAST_SHARED, Overlap, OverlapError, SharedPair};
pub use redundancy::{
    REDUNDANCY_TARGETS, Redundancy, RedundancySite, TargetSeenBy, redundancy_question,
};
