//! Voxels that beams cover: the plain reference and the fast copy that gives its bits.
//!
//! `README.md` beside this file names the job of each file and the evidence for each path.

mod bit_order;
mod fast;
mod lockstep;
mod reference;

pub use bit_order::{BitOrder, Bitmaps, Ranks};
pub use fast::{WalkScratch, cover_sensor};
pub use reference::cover_voxels;
