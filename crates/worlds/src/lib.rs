//! Worlds made by rule: generated streets, motorways, estates, yards and towns, and towns on real road
//! networks (OpenDRIVE).
//!
//! Data goes one way: network of roads → surfaces → houses, trees, signs → who is about → scene file. A
//! generated kind differs from an imported map in its first step alone. Everything depends on the seed
//! and nothing else: the same seed gives the same bytes.

#![cfg_attr(test, allow(clippy::disallowed_methods))]

#[cfg(test)]
#[macro_use]
extern crate sightline_files;

mod network;
mod opendrive;
mod population;
mod roads;
mod style;
mod surfaces;

pub use opendrive::read_opendrive;
pub use style::WorldKind;
pub use world::{GeneratedWorld, WorldError, generate, import_opendrive, mesh_shape, write_ply};

#[cfg(test)]
#[cfg(feature = "mesh")]
mod tests;
mod things;
mod traffic;
mod world;
