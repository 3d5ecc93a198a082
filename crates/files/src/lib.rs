//! Files: written whole, guarded against overwriting, read within bounds; JSON, YAML and NumPy in them.
//!
//! | module | holds |
//! |---|---|
//! | [`csv`] | tables as CSV |
//! | [`files`] | one guard of inputs and outputs, whole files, folders of runs |
//! | [`json`] | JSON and YAML whose errors name the place, the nearest known key, and the mend |
//! | [`npy`] | headers of NumPy arrays |
//! | [`note`] | sentences about an input: facts, and doubts |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod csv;
pub mod files;
pub mod json;
pub mod note;
pub mod npy;

pub use note::Note;
