//! Voxels that beams cover: the plain reference and the fast copy that gives its bits.
//!
//! `README.md` beside this file says which file does what, and what each path earns.

mod bit_order;
mod fast;
mod lockstep;
mod reference;
mod transpose;

pub use bit_order::{BitOrder, Bitmaps};
pub use fast::{WalkScratch, cover_sensor};
pub use reference::cover_voxels;
