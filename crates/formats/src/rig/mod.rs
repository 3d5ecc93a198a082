//! Rigs in the formats of other programs: the LiDARs of one vehicle, read, written and compared.
//!
//! A [`Rig`] holds optical centres in the ego frame. Other conventions of files (the foot of a sensor, nested
//! frames, degrees, a left-handed frame, another origin) are converted in this module only.

mod angles;
mod autoware;
mod beams;
mod carla;
mod carla_objects;
mod compare;
mod detect;
mod error;
mod export;
mod fields;
mod format;
mod frames;
mod import;
mod known;
mod launch;
mod model;
mod mounting;
mod pandaset;
mod placements;
mod sdf;
mod simulated;
mod source;
#[cfg(test)]
mod tests;
mod tf;
mod urdf;
mod xml;

pub use beams::Models;
pub use carla::mirrored;
pub use compare::{Asymmetry, Comparison, Moved, compare};
pub use error::RigError;
pub use export::MODELS_FILE;
pub use export::{Exported, export};
pub use format::RigFormat;
pub use import::{ImportSettings, Imported, from_carla_sensors, import, import_texts};
pub use known::Fan;
pub use model::{BASE_LINK, default_frame};
pub use model::{Rig, RigLidar};
pub use mounting::Mounting;
pub use placements::{read_rig, rig_json};
pub use source::NamedText;
pub use source::{Source, sources};
