//! Closest hits of all beams in a frame's instances: the plain reference and the fast copies that give its
//! bits.
//!
//! `README.md` beside this file names the job of each file and the evidence for each path.

mod batch;
mod bundle;
mod rays;
mod reference;
mod sight;
mod walk;

pub use batch::Caster;
pub use bundle::{
    BundleOrigin, BundleTree, Firing, FiringCaster, TraversalStack, all_hit, closer_hits_of_beams,
    closer_hits_of_bundle,
};
pub use rays::{RayScene, cast_rays};
pub use reference::{cast_closest, cast_frame_closest, closest_hit_in};
#[cfg(feature = "gpu")]
pub(crate) use sight::SightSphere;
pub use walk::{FiringWalk, Instructions, RAYS, Rays, SweptPart, TreeView};
