//! Bounding volume hierarchy over the triangles of one rigid thing, and the tests of a ray with its parts.
//!
//! Built once on the host as a binary tree with a binned surface-area heuristic (Wald 2007), which the
//! reference goes down. Devices, single rays and walks go down copies of it with four, eight and
//! sixteen children a node.
//!
//! # Why every traversal gives the same bits
//! A triangle's hit distance is clamped to the interval in which the ray is inside the triangle's own
//! box, or inside its padded one where rounding lets the ray pass beside the bare one.
//! `(bound − origin) · inverse` never decreases when `bound` grows, also in rounded arithmetic, so the
//! interval of every ancestor box contains that of the triangle. A node that is skipped because it
//! begins behind the best hit can therefore not hold a closer or an equal one. The answer is the same
//! for every tree, every order of visits, and for no tree at all ([`Bvh::closest_hit_brute_force`]). So
//! it is for rays cast together (`cast::Caster`).

mod build;
pub(crate) mod bvh16;
#[cfg(feature = "gpu")]
mod bvh4;
pub(crate) mod bvh8;
mod intersect;

pub(crate) use build::PAD_SHARE;
pub use build::{Bvh, BvhNode, MAX_DEPTH, Triangle};
#[cfg(feature = "gpu")]
pub(crate) use bvh4::{Bvh4, QuantizedNode, TRIANGLE};
pub(crate) use intersect::{FAR_INVERSE, axes_of};
pub use intersect::{Hit, NO_HIT, Ray};
