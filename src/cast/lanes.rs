//! Numbers of many rays side by side: a lane a ray, sixteen lanes a chunk, eight chunks a packet.

use multiversion::multiversion;

use crate::bvh::{Hit, NO_HIT};

/// Most rays of a packet.
pub const PACKET_RAYS: usize = 128;
/// Rays that are tested against a triangle together; they should lie side by side.
pub const CHUNK: usize = 16;
/// Chunks of a full packet.
pub(super) const CHUNKS: usize = PACKET_RAYS / CHUNK;
/// Most directions of a fan.
pub const FAN_DIRECTIONS: usize = 16;

/// A number of each ray, by chunk.
pub(super) type Lanes = [[f32; CHUNK]; CHUNKS];
/// A number of each ray, the same lane of all chunks side by side.
pub(super) type Across = [[f32; CHUNKS]; CHUNK];
pub(super) const NOTHING: Lanes = [[0.0; CHUNK]; CHUNKS];

/// Closest hits of a packet's rays.
#[derive(Debug, Clone, Copy)]
pub struct PacketHits {
    pub(super) t: Lanes,
    pub(super) prim: [[u32; CHUNK]; CHUNKS],
}

impl Default for PacketHits {
    fn default() -> Self {
        Self { t: NOTHING, prim: [[NO_HIT; CHUNK]; CHUNKS] }
    }
}

impl PacketHits {
    /// The hit of the ray with this number.
    #[inline]
    pub fn get(&self, lane: usize) -> Hit {
        Hit { t: self.t.as_flattened()[lane], prim: self.prim.as_flattened()[lane] }
    }

    /// The way back of [`Self::by_ray`].
    pub(super) fn of_rays(
        by_ray: &[[Hit; FAN_DIRECTIONS]; CHUNK],
        chunk: usize,
        hits: &mut [Self],
    ) {
        transpose_back(by_ray, chunk, hits);
    }

    /// Hits of a chunk's rays in [`FAN_DIRECTIONS`] directions, `[ray][direction]`.
    pub fn by_ray(hits: &[Self], chunk: usize, by_ray: &mut [[Hit; FAN_DIRECTIONS]; CHUNK]) {
        transpose(hits, chunk, by_ray);
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn transpose(hits: &[PacketHits], chunk: usize, by_ray: &mut [[Hit; FAN_DIRECTIONS]; CHUNK]) {
    let (mut t, mut prim) = ([[0.0; CHUNK]; FAN_DIRECTIONS], [[0; CHUNK]; FAN_DIRECTIONS]);
    for (direction, hits) in hits.iter().enumerate() {
        (t[direction], prim[direction]) = (hits.t[chunk], hits.prim[chunk]);
    }
    let mut pairs = [0_u64; CHUNK * FAN_DIRECTIONS];
    for (i, (t, prim)) in t.as_flattened().iter().zip(prim.as_flattened()).enumerate() {
        pairs[i] = u64::from(t.to_bits()) | u64::from(*prim) << 32;
    }
    let mut other = [0_u64; CHUNK * FAN_DIRECTIONS];
    swap(&mut pairs, &mut other);
    shuffle(&other, bytemuck::cast_mut(by_ray));
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn transpose_back(by_ray: &[[Hit; FAN_DIRECTIONS]; CHUNK], chunk: usize, hits: &mut [PacketHits]) {
    let mut pairs = [0_u64; CHUNK * FAN_DIRECTIONS];
    let mut other = [0_u64; CHUNK * FAN_DIRECTIONS];
    for (pair, hit) in pairs.iter_mut().zip(by_ray.as_flattened()) {
        *pair = u64::from(hit.t.to_bits()) | u64::from(hit.prim) << 32;
    }
    swap(&mut pairs, &mut other);
    shuffle(&other, &mut pairs);
    for (hits, pairs) in hits.iter_mut().zip(pairs.chunks_exact(CHUNK)) {
        for (i, pair) in pairs.iter().enumerate() {
            hits.t[chunk][i] = f32::from_bits(*pair as u32);
            hits.prim[chunk][i] = (*pair >> 32) as u32;
        }
    }
}

/// Three of the four rounds that swap rows and columns: both halves in turn, as many times as a row's number
/// has bits. Moving each to its place instead is compiled to scattered stores, which are slower.
#[inline(always)]
fn swap<const N: usize>(pairs: &mut [u64; N], other: &mut [u64; N]) {
    shuffle(pairs, other);
    shuffle(other, pairs);
    shuffle(pairs, other);
}

#[inline(always)]
fn shuffle<const N: usize>(from: &[u64; N], to: &mut [u64; N]) {
    for i in 0..N / 2 {
        to[2 * i] = from[i];
        to[2 * i + 1] = from[i + N / 2];
    }
}

/// Least and largest of a number over each chunk's rays.
#[derive(Clone, Copy)]
pub(super) struct ChunkRange {
    pub(super) low: [f32; CHUNKS],
    pub(super) high: [f32; CHUNKS],
}

impl ChunkRange {
    pub(super) const EMPTY: Self =
        Self { low: [f32::INFINITY; CHUNKS], high: [f32::NEG_INFINITY; CHUNKS] };

    #[inline(always)]
    pub(super) fn grow(&mut self, numbers: &[f32; CHUNKS]) {
        for (chunk, &number) in numbers.iter().enumerate() {
            self.low[chunk] = least(number, self.low[chunk]);
            self.high[chunk] = most(number, self.high[chunk]);
        }
    }

    /// Over all rays.
    #[inline(always)]
    pub(super) fn all(&self) -> [f32; 2] {
        [fold(&self.low, least), fold(&self.high, most)]
    }
}

/// As the vector instruction has it: one compare and select, no care for NaN.
#[inline(always)]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Joins eight numbers in three rounds of 4, 2 and 1 independent pairs.
#[inline(always)]
pub(super) fn fold(numbers: &[f32; 8], join: impl Fn(f32, f32) -> f32) -> f32 {
    let mut half = [0.0; 4];
    for i in 0..4 {
        half[i] = join(numbers[i], numbers[i + 4]);
    }
    join(join(half[0], half[1]), join(half[2], half[3]))
}

/// A bit for each flag; flags are all ones or zero.
#[inline(always)]
pub(super) fn to_bits(flags: [u32; 8]) -> u32 {
    let mut bits = [0; 8];
    for i in 0..8 {
        bits[i] = flags[i] & (1 << i);
    }
    for i in 0..4 {
        bits[i] |= bits[i + 4];
    }
    (bits[0] | bits[1]) | (bits[2] | bits[3])
}
