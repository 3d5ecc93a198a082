//! Labelled scans of public data sets, to P-SOGs and to scenes of boxes.
//!
//! A data set is a reader: it lists frames, says where the sensor stood, and reads points with labels
//! ([`LabelledSequence`]). All later steps take any reader: [`build_psog`] votes, [`to_scene`] makes plates, boxes
//! and tracks.
//!
//! | file | holds |
//! |---|---|
//! | `sequence` | frames, poses and labelled points of any data set; a P-SOG from them; files of records |
//! | `kitti` | the SemanticKITTI layout |
//! | `nuscenes` | nuScenes with lidarseg: tables, categories, boxes |
//! | `carla` | scans of CARLA's semantic LiDAR with a table of poses |
//! | `import` | a scene from a sequence |
//! | `ground` | height of the labelled road, warnings about poses, plates and boxes of a scene |

mod carla;
mod ground;
mod import;
pub(crate) mod kitti;
mod nuscenes;
mod sequence;

use crate::error::Checked;
pub use crate::error::FormatError;
pub use carla::{CarlaSequence, CarlaTags};
pub use import::{ImportOptions, ImportedScene, to_scene};
pub use kitti::KittiSequence;
pub(crate) use nuscenes::NUSCENES_CATEGORIES;
pub use nuscenes::{NuscenesScene, read_nuscenes};
pub use sequence::{
    BoxTrack, LabelledScan, LabelledSequence, PointLabel, PsogOptions, TrackPose, build_psog,
};

#[cfg(test)]
mod tests;
