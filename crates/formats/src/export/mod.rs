//! Scans as data sets that public loaders read: SemanticKITTI, nuScenes with lidarseg, arrays of NumPy.
//!
//! A [`Dataset`] is a folder that grows scan by scan. Every frame is written whole, its record last, into the hidden
//! folder `.sightline`. [`Dataset::finish`] makes the loaders' other files from the records, so that memory does not
//! grow with the frames, and a run that was ended goes on.
//!
//! [`Glb`] shows one frame with its rigs in any viewer of glTF.

mod dataset;
mod folder;
mod glb;
mod kitti;
mod nuscenes;
mod plan;
mod record;
#[cfg(test)]
mod tests;

use crate::error::Checked;
pub use crate::error::FormatError;
pub use dataset::{Dataset, Summary};
pub use glb::{Glb, GltfView};
pub use plan::{DatasetSettings, Layout, SceneFacts, Split, Splits};
pub use record::record;
pub use sightline_files::files::Input;
