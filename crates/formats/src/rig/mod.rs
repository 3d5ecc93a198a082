//! Rigs in the formats of other programs: the LiDARs of one vehicle, read, written and compared.
//!
//! A [`Rig`] holds optical centres in the ego frame. Other conventions of files (the foot of a sensor, nested
//! frames, degrees, a left-handed frame, another origin) are converted in this module only.

mod beams;
mod carla;
mod format;
mod frames;
mod import;
mod launch;
mod model;
mod sdf;
mod urdf;
mod yaml;

use crate::error::Checked;
pub use crate::error::FormatError;
use beams::Fan;
pub use beams::Models;
pub(crate) use carla::mirrored;
use format::sources;
pub use format::{Exported, MODELS_FILE, NamedText, RigFormat, RigSource, export};
pub use frames::Mounting;
pub use import::{
    ImportSettings, ImportedRig, from_carla_sensors, import, import_texts, placement_doubts,
};
use model::BASE_LINK;
pub use model::{
    Asymmetry, Comparison, MovedLidar, Rig, RigLidar, compare, default_frame, read_rig, rig_json,
};

#[cfg(test)]
mod tests;
