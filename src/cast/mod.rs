//! Closest hits of all beams in a frame's instances: the plain reference and the fast copies that give its
//! bits.
//!
//! `README.md` beside this file names the job of each file and the evidence for each path.

mod batch;
mod beam_order;
mod bounds;
mod fan;
mod fan_blocks;
mod fan_bounds;
mod groups;
mod intersect;
mod lanes;
mod mixed;
mod packet;
mod ranges;
mod reference;
mod sight;
mod traverse;

pub use batch::{Casting, cast_frame, cast_packets, cast_packets_by};
pub use fan::Fan;
pub use lanes::{FAN_DIRECTIONS, PACKET_RAYS, PacketHits};
pub use packet::Packet;
pub(crate) use reference::closest_hit_in;
pub use reference::{cast_closest, cast_frame_closest};
pub(crate) use sight::Sight;
pub use traverse::Scratch;
