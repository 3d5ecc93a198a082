//! Closest hits of all beams: the plain reference and the fast copies that give its bits.

mod batch;
pub(crate) mod beam_order;
mod bounds;
pub(crate) mod costs;
mod fan;
mod fan_bounds;
mod lanes;
mod packet;
mod ranges;
mod reference;

pub use batch::{Casting, cast_packets, cast_packets_by};
pub use fan::{FAN_DIRECTIONS, Fan};
pub use packet::{CHUNK, PACKET_RAYS, Packet, PacketHits, Scratch};
pub use reference::cast_closest;
