//! Closest hits of all beams in a frame's instances: the plain reference and the fast copies that give its
//! bits.
//!
//! `README.md` beside this file names the job of each file and the evidence for each path.

mod batch;
mod bundle;
mod firings;
mod rays;
mod reference;
mod sight;
mod walk;

pub use batch::{Caster, Casting};
pub use bundle::{Left, Standing, Target, all_hit, closer_hits_of_beams, closer_hits_of_bundle};
pub use firings::{Firing, FiringCaster};
pub use rays::cast_rays;
pub use reference::closest_hit_in;
pub use reference::{cast_closest, cast_frame_closest};
#[cfg(feature = "gpu")]
pub use sight::Sight;
pub use walk::{FiringWalk, RAYS, Rays, SweptPart};
pub use walk::{Instructions, Part};
