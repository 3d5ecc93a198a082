//! Rigs and data sets of other programs.
//!
//! | module | holds |
//! |---|---|
//! | [`rig`] | rigs in URDF, SDF, launch files, YAML and JSON |
//! | [`datasets`] | labelled scans of public data sets, to P-SOGs and to scenes of boxes |
//! | [`export`] | scans as data sets that public loaders read |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

#[cfg(test)]
#[macro_use]
extern crate sightline_files;

#[macro_use]
mod error;

pub mod datasets;
pub mod export;
pub mod rig;

pub use error::FormatError;
