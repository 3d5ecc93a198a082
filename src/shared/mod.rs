//! How many LiDARs of a placement see a thing, and how far pairs of them see the same things.
//!
//! - **Seen by k LiDARs**, for voxels: exactly k LiDARs cover the voxel, as in scores. For ground: exactly k LiDARs see
//!   the cell, as in the near field. For targets: exactly k LiDARs meet the target with five beams each, alone on level
//!   ground with the own body in the way.
//! - **Surface voxels** and **overlap** of LiDARs: as in `overlap`.
//! - **Shared directions** of two LiDARs: share of the sphere that lies in both fields of view, at their attitudes.
//!   Positions, ranges and the own body play no part, as for a point far away.
//!
//! - **Cone**: a sensor of another technology, fixed on the vehicle. It sees a box (a voxel, or that around a target)
//!   if it sees the middle of the box, or of one of up to three faces turned to the sensor. The point must be in its
//!   field of view and range, and no surface of the frame may be hit before the ray to it enters the box. Ground is
//!   seen by the cell's middle. Targets stand alone, with the own body in the way. A technology sees a thing if one of
//!   its sensors does, LiDARs as above.
//!
//! | file | holds |
//! |---|---|
//! | `counts` | things seen by no, one, two, three and more LiDARs, from sets of bits |
//! | `technologies` | points and boxes that sensors of other technologies see; things by the technologies that see them |
//! | `redundancy` | voxels, ground and targets of a scene by the number of LiDARs that see them |
//! | `field_of_view` | the directions that a sensor looks into |
//! | `overlap` | shared voxels and directions of pairs, and whether pairs connect all LiDARs |

mod counts;
mod field_of_view;
mod overlap;
mod redundancy;
mod technologies;

pub use counts::{SeenAlone, SeenBy, SeenByTechnologies, SeenByTechnology, TargetSeenBy};
pub(crate) use field_of_view::FieldOfView;
pub use overlap::{LEAST_SHARED, Overlap, OverlapError, SharedPair};
pub use redundancy::{REDUNDANCY_TARGETS, Redundancy, RedundancySite, redundancy_question};
pub use technologies::{SensorsOf, Technologies};
