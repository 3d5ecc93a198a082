//! The ground, the poles and the own body near a vehicle, which no score of voxels sees.
//!
//! To the letter:
//!
//! - **Footprint**: convex hull of the own body seen from above, in the ego frame.
//! - **Cell**: a square of 0.25 m of a grid along the ego frame's axes with lines through its origin. A
//!   cell counts in a frame if it is ground and its centre lies outside the footprint, at most R from its
//!   outline. R is 10 m; for the ring, 3 m.
//! - **Ground**: the first surface straight down from 2 m above the wheel plane is of a ground class and
//!   within 2 m of that plane. It does not lie inside a closed thing (an odd number of other surfaces above it).
//! - **Wheel plane** of a frame: through the ground under the four corners of the box around the footprint,
//!   by least squares. It is z = 0 on level ground, and where a corner has no ground within 2 m of z = 0.
//! - **Seen**: a beam of any LiDAR ends at a surface of a ground class at most 0.5 m from the cell's
//!   centre, counted level: the width of a person. The cell's own square alone would count beams rather than
//!   ground that nothing can hide on, since rings of 16 channels lie up to 1.3 m apart there.
//! - **`near_field`**: share of the cells that count which are seen, a mean over the frames; blind ground is
//!   the mean number of the others times 0.0625 m².
//! - **Blind zone**: lanes one cell wide straight before the edges of the box around the footprint, each up to its
//!   nearest cell that is seen in at least half of the frames in which it counts. Corners lie before no edge, and are not
//!   counted.
//! - **Lost ground**: a stretch of a lane without a cell seen that begins directly behind a seen one; 1 m or more, as rings of
//!   beams leave less between them, and 2 m or more where it is said.
//! - **Bodies that move**: the footprint is of frame 0; ground, hits and wasted beams are looked at in each frame. Frames in
//!   which the bodies stand alike are one pose. On each side the pose with the deepest blind zone counts, and shares of ground
//!   have the worst frame beside them.
//! - **Wasted**: share of a LiDAR's beams that end at the own body, a mean over the frames.
//! - **Poles** stand alone on level ground, with the own body and without the scene; one is seen with five
//!   beams or more.
//!
//! | file | holds |
//! |---|---|
//! | `body` | the outline of the body, the plane under its wheels, the guards of placements that look at the own vehicle or stand below the ground, mounts that look into the body |
//! | `ground` | cells, and which of them are ground |
//! | `look` | ends of beams, cells and poles seen, and their shares: the near field of a placement |
//! | `zone` | the blind zone |
//! | `depths` | its depth on each side, over the few frames of a result |
//! | `required` | ground that the vehicle's rules ask for, as bits that a search adds up |

mod body;
mod depths;
mod ground;
mod look;
mod required;
mod zone;

#[cfg(test)]
pub(crate) use self::body::under_raised;
pub use self::body::{FEW_PLACEMENTS, Footprint, below_ground, mounts_into_body, self_hits};
pub(crate) use self::body::{WheelPlane, under_raised_in_words};
pub use depths::BlindDepths;
pub(crate) use depths::cast_frames;
pub(crate) use ground::{CELL, CLOSE, NEAR, Pole, RING, Standard};
pub use look::{NearField, NearSite};
pub(crate) use look::{bodies_move, body_poses, outline, place, returned_hits};
pub(crate) use required::{RequiredGround, least_metres};
pub use zone::NearFieldError;

pub(crate) use zone::in_frame;
#[cfg(test)]
pub(crate) use zone::{BlindLane, BlindZone, LostGround};

#[cfg(test)]
mod tests;
