//! A vehicle, a scene and a P-SOG from their descriptions, and the problem that they pose.
//!
//! | module | holds |
//! |---|---|
//! | `mesh` | OBJ, PLY, STL, glTF and URDF files |
//! | [`vehicle`] | sensors, mounts, placements and their rules |
//! | [`scene`] | the scene file, meshes and primitives, one triangle soup a frame |
//! | [`psog`] | P-SOG: how often each voxel was of each class, and its entropy |
//! | [`problem`] | the task of the engines and the rules of the mount, from a scene and a P-SOG |
//! | `schema` | JSON Schemas of the files that users write; with the feature `schema` |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

#[cfg(test)]
#[macro_use]
extern crate sightline_files;

/// Objects of description files, read by serde: a key that is not listed is an error.
macro_rules! described {
    ($($(#[$meta:meta])* $vis:vis struct $name:ident $fields:tt)*) => {$(
        $(#[$meta])*
        #[derive(Debug, serde::Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[serde(deny_unknown_fields)]
        $vis struct $name $fields
    )*};
}

mod mesh;
pub mod problem;
pub mod psog;
pub mod scene;
#[cfg(feature = "schema")]
pub mod schema;
pub mod vehicle;
