//! Ranges of what a packet's rays have, chunk by chunk, and the plane that bounds are taken in.

use super::packet::{CHUNK, CHUNKS, Packet, least, most};

/// Least and largest of a number over each chunk's rays.
#[derive(Clone, Copy)]
pub(super) struct Range {
    pub(super) low: [f32; CHUNKS],
    pub(super) high: [f32; CHUNKS],
}

impl Range {
    pub(super) const EMPTY: Self =
        Self { low: [f32::INFINITY; CHUNKS], high: [f32::NEG_INFINITY; CHUNKS] };

    #[inline(always)]
    pub(super) fn grow(&mut self, numbers: &[f32; CHUNKS]) {
        for (chunk, &number) in numbers.iter().enumerate() {
            self.low[chunk] = least(number, self.low[chunk]);
            self.high[chunk] = most(number, self.high[chunk]);
        }
    }

    /// From lanes that lie chunk by chunk; chunks without rays repeat the last one's range.
    #[inline(always)]
    pub(super) fn of(lanes: &[[f32; CHUNK]]) -> Self {
        let mut range = Self::EMPTY;
        for chunk in 0..CHUNKS {
            let lanes = &lanes[chunk.min(lanes.len() - 1)];
            let (mut low, mut high) = ([0.0; 8], [0.0; 8]);
            for i in 0..8 {
                low[i] = least(lanes[i], lanes[i + 8]);
                high[i] = most(lanes[i], lanes[i + 8]);
            }
            range.low[chunk] = fold(&low, least);
            range.high[chunk] = fold(&high, most);
        }
        range
    }

    /// Over all rays.
    #[inline(always)]
    pub(super) fn all(&self) -> [f32; 2] {
        [fold(&self.low, least), fold(&self.high, most)]
    }

    #[inline(always)]
    pub(super) fn middle_and_half(&self) -> ([f32; CHUNKS], [f32; CHUNKS]) {
        let (mut middle, mut half) = ([0.0; CHUNKS], [0.0; CHUNKS]);
        for chunk in 0..CHUNKS {
            middle[chunk] = 0.5 * (self.low[chunk] + self.high[chunk]);
            half[chunk] = 0.5 * (self.high[chunk] - self.low[chunk]);
        }
        (middle, half)
    }
}

/// Of every chunk: how far its origins lie before the plane, where rays cross it, how they are sheared.
pub(super) struct Ranges {
    pub(super) shift: Range,
    pub(super) crossing: [Range; 2],
    pub(super) shear: [Range; 2],
}

impl Ranges {
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
            shift: Range::of(&shift[..filled]),
            crossing: [Range::of(&at[0][..filled]), Range::of(&at[1][..filled])],
            shear: [Range::of(&packet.shear[0][..filled]), Range::of(&packet.shear[1][..filled])],
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
    let start = Range::of(&packet.origin[axes[2]][..filled]).all();
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

/// Puts eight together, halving them: what is joined at a time does not depend on each other.
#[inline(always)]
pub(super) fn fold(numbers: &[f32; 8], join: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = [0.0; 4];
    for i in 0..4 {
        half[i] = join(numbers[i], numbers[i + 4]);
    }
    join(join(half[0], half[1]), join(half[2], half[3]))
}
