//! A vehicle, a scene and a P-SOG from their descriptions, and the problem that they pose.
//!
//! | module | holds |
//! |---|---|
//! | [`mesh`] | OBJ, PLY, STL, glTF and URDF files |
//! | [`vehicle`] | sensors, mounts, placements and their rules |
//! | [`scene`] | the scene file, meshes and primitives, one triangle soup a frame |
//! | [`psog`] | P-SOG: how often each voxel was of each class, and its entropy |
//! | [`problem`] | the task of the engines and the rules of the mount, from a scene and a P-SOG |
//! | `schema` | JSON Schemas of the files that users write; with the feature `schema` |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod mesh;
pub mod problem;
pub mod psog;
pub mod scene;
#[cfg(feature = "schema")]
pub mod schema;
pub mod vehicle;
