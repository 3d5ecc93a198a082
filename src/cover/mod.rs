//! Voxels that beams cover: the plain reference and the fast copy that gives its bits.

mod bit_order;
mod lockstep;
mod reference;
mod rows;
mod runs;

pub use bit_order::{BitOrder, Bitmaps};
pub use lockstep::{WalkScratch, cover_sensor};
pub use reference::cover_voxels;
