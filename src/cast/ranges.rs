//! Least and largest numbers of each chunk of a packet, and the plane that its bounds are taken in.

use super::lanes::{CHUNK, CHUNKS, ChunkRange};
use super::packet::Packet;

/// Ranges of every chunk: distance of the origins before the plane, crossings of it, and shears.
pub(super) struct PacketRanges {
    pub(super) shift: ChunkRange,
    pub(super) crossing: [ChunkRange; 2],
    pub(super) shear: [ChunkRange; 2],
}

impl PacketRanges {
    #[inline(always)]
    pub(super) fn new(packet: &Packet, plane: f32) -> Self {
        let axes = packet.axes();
        let filled = packet.chunks();
        let mut shift = [[0.0; CHUNK]; CHUNKS];
        let mut at = [[[0.0; CHUNK]; CHUNKS]; 2];
        for chunk in 0..filled {
            for i in 0..CHUNK {
                let before = plane - packet.origin[axes[2]][chunk][i];
                shift[chunk][i] = before * packet.inverse[axes[2]][chunk][i];
                for k in 0..2 {
                    at[k][chunk][i] =
                        packet.origin[axes[k]][chunk][i] + packet.shear[k][chunk][i] * before;
                }
            }
        }
        Self {
            shift: ChunkRange::of(&shift[..filled]),
            crossing: [ChunkRange::of(&at[0][..filled]), ChunkRange::of(&at[1][..filled])],
            shear: [
                ChunkRange::of(&packet.shear[0][..filled]),
                ChunkRange::of(&packet.shear[1][..filled]),
            ],
        }
    }
}

/// Where rays of several directions lie closest together, on their way up to `t_max`: the variance of
/// the crossings x + s·(z − z₀) is least at z₀ − cov(x, s) / var(s).
#[inline(always)]
pub(super) fn narrowest_plane(packet: &Packet) -> f32 {
    let axes = packet.axes();
    let filled = packet.chunks();
    let rays = (filled * CHUNK) as f32;
    let start = ChunkRange::of(&packet.origin[axes[2]][..filled]).all();
    let start = 0.5 * (start[0] + start[1]);
    let (mut covariance, mut variance) = (0.0, 0.0);
    for k in 0..2 {
        let (first_x, first_s) = (packet.origin[axes[k]][0][0], packet.shear[k][0][0]);
        let (mut x, mut s, mut xs, mut ss) =
            ([0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK], [0.0; CHUNK]);
        for chunk in 0..filled {
            for i in 0..CHUNK {
                let shear = packet.shear[k][chunk][i];
                let before = start - packet.origin[axes[2]][chunk][i];
                let at = packet.origin[axes[k]][chunk][i] + shear * before - first_x;
                let shear = shear - first_s;
                x[i] += at;
                s[i] += shear;
                xs[i] += at * shear;
                ss[i] += shear * shear;
            }
        }
        let [x, s, xs, ss] = [x, s, xs, ss].map(|sums| sums.iter().sum::<f32>());
        covariance += xs - x * s / rays;
        variance += ss - s * s / rays;
    }
    let sign = packet.direction[axes[2]][0][0].signum();
    let ahead = -covariance / variance * sign;
    // Not a number where all directions are the same.
    if ahead > 0.0 { start + sign * ahead.min(packet.t_max) } else { start }
}
