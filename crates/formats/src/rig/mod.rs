//! Rigs in the formats of other programs: the LiDARs of one vehicle, read, written and compared.
//!
//! A [`Rig`] holds optical centres in the ego frame. Other conventions of files (the foot of a sensor, nested
//! frames, degrees, a left-handed frame, another origin) are converted in this module only.

mod beams;
mod carla;
mod error;
mod format;
mod frames;
mod import;
mod launch;
mod model;
mod sdf;
mod urdf;
mod yaml;

pub use beams::{Fan, Models};
pub use carla::mirrored;
pub use error::RigError;
pub use format::{Exported, MODELS_FILE, NamedText, RigFormat, RigSource, export, sources};
pub use frames::Mounting;
pub use import::{
    ImportSettings, ImportedRig, from_carla_sensors, import, import_texts, placement_doubts,
};
pub use model::{
    Asymmetry, BASE_LINK, Comparison, MovedLidar, Rig, RigLidar, compare, default_frame, read_rig,
    rig_json,
};

#[cfg(test)]
mod tests;
