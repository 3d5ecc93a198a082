//! Voxels that beams cover: the plain reference and the fast copy that gives its bits.

mod lockstep;
mod reference;
mod rows;
mod runs;

pub(crate) use lockstep::cover_rows;
pub use lockstep::{WalkScratch, cover_sensor};
pub use reference::{bitmap_words, cover_voxels};
pub(crate) use rows::Rows;
