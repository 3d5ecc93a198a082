//! Coverage of one sensor, fast: its beams sorted by way and length, then walked sixteen at a time.
//!
//! Bitmaps of words along y are turned into the rows along x of [`BitOrder::rows`](super::BitOrder::rows).

use multiversion::multiversion;

use super::BitOrder;
use super::bit_order::{ROW, row_words};
use super::lockstep::{BeamStart, NEVER, ROUND, WORD, Way, walk_all};
use super::reference::{VoxelWalk, beam_end, grid_origin};
use crate::bvh::{Hit, NO_HIT};
use crate::grid::Roi;
use crate::task::{DevicePose, HIT_PUSH, NO_CROSSING, TINY_COMPONENT, beam_direction};

/// Ways of a beam, by its larger horizontal component: −y, +y, −x, +x. A power of two.
const WAYS: usize = 4;
/// Classes of beams of one way by their length, counted in words that they pass.
const LENGTHS: usize = 256;
/// Parts of the beam table that the counting sort takes turns at. Neighbours in the table are of one
/// kind, so that a single pass would add to the same counter again and again, each time waiting for
/// the last addition to be stored.
const SORT_PARTS: usize = 4;
/// Voxels along an axis from which on beams are walked by the reference. Below, f32 leaves 2⁻⁹ of a
/// voxel for the rounding of a plane's number, so that crossings of different planes are different
/// numbers, and a number of planes computed from a slope is off by less than
/// [`PLANES_MARGIN`](super::lockstep::PLANES_MARGIN).
const SLOPE_LIMIT: f32 = (1 << 15) as f32;

/// Working memory of [`cover_sensor`], kept from sensor to sensor.
#[derive(Default)]
pub struct WalkScratch {
    /// Metres a voxel along each axis, by beam.
    inverse: [Vec<f32>; 3],
    /// Metres along each beam; crossings before that are taken.
    stop: Vec<f32>,
    /// Kind of each beam: 256 · way + length class, e.g. 0x2_03 goes along −x for three classes' words.
    kind: Vec<u16>,
    /// Numbers of the beams, sorted by kind.
    sorted: Vec<u32>,
    /// First beam of each way in that order, and the end.
    ways: [usize; WAYS + 1],
    /// Words along y, zero between sensors.
    along_y: Vec<u32>,
}

/// Marks the voxels that one sensor's beams traverse, in the order of [`BitOrder::rows`].
/// Sixteen beams of similar length go in lockstep; the voxels equal those of [`super::cover_voxels`].
///
/// `hits` is `[directions]`; `bitmap` is zero and holds all voxels.
pub fn cover_sensor(
    pose: &DevicePose,
    directions: &[[f32; 3]],
    roi: &Roi,
    hits: Option<&[Hit]>,
    range: f32,
    scratch: &mut WalkScratch,
    bitmap: &mut [u64],
) {
    let order = BitOrder::rows(roi);
    if !walks_in_lockstep(pose, roi, &order) {
        for (index, &direction) in directions.iter().enumerate() {
            let end = beam_end(hits.map(|hits| hits[index]), range);
            let walk = VoxelWalk::new(roi, grid_origin(pose), beam_direction(pose, direction));
            walk.visit(end, |voxel| {
                let bit = order.bit_of(voxel as u32);
                bitmap[bit as usize / 64] |= 1 << (bit % 64);
            });
        }
        return;
    }
    let bitmap: &mut [u32] = bytemuck::cast_slice_mut(bitmap);
    scratch.fit(directions.len());
    let start = BeamStart::new(roi, grid_origin(pose).to_array());
    prepare(pose, directions, roi, hits, range, &start, scratch);
    sort(scratch);
    let mut along_y = std::mem::take(&mut scratch.along_y);
    along_y.resize(row_words(roi.shape(), 1), 0);
    let of = |way: usize| &scratch.sorted[scratch.ways[way]..scratch.ways[way + 1]];
    let (inverse, stop) = (&scratch.inverse, &scratch.stop);
    walk_all::<true>(&Way::new(roi, &start, 1, true), of(0), inverse, stop, &mut along_y);
    walk_all::<false>(&Way::new(roi, &start, 1, false), of(1), inverse, stop, &mut along_y);
    add_transposed(roi.shape(), &mut along_y, bitmap);
    walk_all::<true>(&Way::new(roi, &start, 0, true), of(2), inverse, stop, bitmap);
    walk_all::<false>(&Way::new(roi, &start, 0, false), of(3), inverse, stop, bitmap);
    scratch.along_y = along_y;
}

/// True if beams may be walked in lockstep: from a sensor in the grid, which has rows and fewer than
/// 2¹⁵ voxels an axis.
fn walks_in_lockstep(pose: &DevicePose, roi: &Roi, order: &BitOrder) -> bool {
    let inside = |k: usize| {
        let n = roi.shape()[k] as f32;
        (0.0..n).contains(&grid_origin(pose)[k]) && n < SLOPE_LIMIT
    };
    order.has_rows() && (0..3).all(inside)
}

impl WalkScratch {
    fn fit(&mut self, beams: usize) {
        for inverse in &mut self.inverse {
            inverse.resize(beams, 0.0);
        }
        self.stop.resize(beams, 0.0);
        self.kind.resize(beams, 0);
        self.sorted.resize(beams, 0);
    }
}

/// Fills in every beam's slopes, end and kind.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn prepare(
    pose: &DevicePose,
    directions: &[[f32; 3]],
    roi: &Roi,
    hits: Option<&[Hit]>,
    range: f32,
    start: &BeamStart,
    scratch: &mut WalkScratch,
) {
    let beams = directions.len();
    for k in 0..3 {
        let [r0, r1, r2, _] = pose.rows[k];
        let voxel = roi.voxel()[k] as f32;
        for (inverse, &[x, y, z]) in scratch.inverse[k].iter_mut().zip(directions) {
            let d = r0 * x + r1 * y + r2 * z;
            let d = if d.abs() < TINY_COMPONENT { 0.0 } else { d };
            *inverse = if d != 0.0 { voxel / d } else { NO_CROSSING };
        }
    }
    // The end of `beam_end`, for all beams at once.
    match hits {
        Some(hits) => {
            for (stop, hit) in scratch.stop.iter_mut().zip(hits) {
                *stop = if hit.prim != NO_HIT { hit.t + HIT_PUSH } else { range };
            }
        }
        None => scratch.stop.fill(range),
    }
    let [ix, iy, iz] = &scratch.inverse;
    let (ix, iy, iz) = (&ix[..beams], &iy[..beams], &iz[..beams]);
    let stop = &mut scratch.stop[..beams];
    let [px, py, pz] = start.p;
    let [[back_x, ahead_x], [back_y, ahead_y], [back_z, ahead_z]] = start.exit;
    let [no_x, no_y, no_z] = start.cell.map(|cell| cell.map(|cell| cell < 0));
    let ([no_back_x, no_ahead_x], [no_back_y, no_ahead_y], [no_back_z, no_ahead_z]) =
        (no_x, no_y, no_z);
    for beam in 0..beams {
        let (x, y, z) = (ix[beam], iy[beam], iz[beam]);
        let exit_x = ((if x > 0.0 { ahead_x } else { back_x }) - px) * x;
        let exit_y = ((if y > 0.0 { ahead_y } else { back_y }) - py) * y;
        let exit_z = ((if z > 0.0 { ahead_z } else { back_z }) - pz) * z;
        let exit = if exit_x < exit_y { exit_x } else { exit_y };
        let exit = if exit < exit_z { exit } else { exit_z };
        let nowhere = (if x > 0.0 { no_ahead_x } else { no_back_x })
            | (if y > 0.0 { no_ahead_y } else { no_back_y })
            | (if z > 0.0 { no_ahead_z } else { no_back_z });
        let end = stop[beam];
        // The crossing at the very end is taken, the one that leaves the grid is not.
        let until = if end < exit { end.next_up() } else { exit };
        stop[beam] = if nowhere | (end < 0.0) { NEVER } else { until };
    }
    let most: f32 = roi.shape().iter().map(|&n| n as f32).sum();
    kinds([ix, iy, iz], stop, 1.5 * LENGTHS as f32 / most, &mut scratch.kind[..beams]);
}

/// The kind of each beam: the axis and the way that it mostly goes, and its length by `scale`.
#[inline(always)]
fn kinds([ix, iy, iz]: [&[f32]; 3], stop: &[f32], scale: f32, kinds: &mut [u16]) {
    let longest = (LENGTHS - 1) as f32;
    for (beam, kind) in kinds.iter_mut().enumerate() {
        let (x, y, z) = (ix[beam], iy[beam], iz[beam]);
        let (a, b, c) = (x.abs().recip(), y.abs().recip(), z.abs().recip());
        let along_x = a >= b;
        let (along, across) = if along_x { (a, b) } else { (b, a) };
        let ahead = (if along_x { x } else { y }) > 0.0;
        let way = (if along_x { 2 } else { 0 }) + (if ahead { 1 } else { 0 });
        let length = stop[beam] * (along / WORD as f32 + across + c) * scale;
        let length = if length < longest { length } else { longest };
        let length = if length > 0.0 { length } else { 0.0 };
        let length = (length + ROUND).to_bits() as u16 & (LENGTHS - 1) as u16;
        *kind = (way * LENGTHS as u16) | length;
    }
}

/// Sorts the beams by kind; within a kind they keep the order of the table.
fn sort(scratch: &mut WalkScratch) {
    let mut next = [[0_u32; SORT_PARTS]; WAYS * LENGTHS];
    let length = scratch.kind.len().div_ceil(SORT_PARTS).max(1);
    let mut streams = [&scratch.kind[..0]; SORT_PARTS];
    for (stream, kinds) in streams.iter_mut().zip(scratch.kind.chunks(length)) {
        *stream = kinds;
    }
    for at in 0..length {
        for (stream, kinds) in streams.iter().enumerate() {
            if let Some(&kind) = kinds.get(at) {
                next[usize::from(kind)][stream] += 1;
            }
        }
    }
    let mut first = 0;
    for (kind, next) in next.iter_mut().enumerate() {
        if kind % LENGTHS == 0 {
            scratch.ways[kind / LENGTHS] = first as usize;
        }
        for next in next {
            (*next, first) = (first, first + *next);
        }
    }
    scratch.ways[WAYS] = first as usize;
    for at in 0..length {
        for (stream, kinds) in streams.iter().enumerate() {
            if let Some(&kind) = kinds.get(at) {
                let next = &mut next[usize::from(kind)][stream];
                scratch.sorted[*next as usize] = (stream * length + at) as u32;
                *next += 1;
            }
        }
    }
}

/// Distances at which bits are exchanged, and the lower bits of each pair.
const HALVES: [(u32, u32); 5] =
    [(16, 0x0000_ffff), (8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)];

/// Adds a bitmap of words along y, which it clears, to one of words along x.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn add_transposed(shape: [u32; 3], along_y: &mut [u32], along_x: &mut [u32]) {
    let [nx, ny, _] = shape.map(|n| n as usize);
    let (from, to) = (ny.div_ceil(ROW) * nx, nx.div_ceil(ROW) * ny);
    for (from, to) in along_y.chunks_exact_mut(from).zip(along_x.chunks_exact_mut(to)) {
        for (block_y, from) in from.chunks_exact_mut(nx).enumerate() {
            for (block_x, from) in from.chunks_mut(ROW).enumerate() {
                let mut block = load(from);
                if or_of(&block) == 0 {
                    continue;
                }
                from.fill(0);
                transpose(&mut block);
                let first = block_x * ny + block_y * ROW;
                let to = &mut to[first..first + ROW.min(ny - block_y * ROW)];
                for (to, word) in to.iter_mut().zip(block) {
                    *to |= word;
                }
            }
        }
    }
}

/// Up to 32 words, filled up with zeros; all 32 are copied as vectors of fixed length.
#[inline(always)]
fn load(words: &[u32]) -> [u32; ROW] {
    words.first_chunk().copied().unwrap_or_else(|| {
        let mut some = [0; ROW];
        some[..words.len()].copy_from_slice(words);
        some
    })
}

#[inline(always)]
fn or_of(words: &[u32; ROW]) -> u32 {
    words.iter().fold(0, |or, word| or | word)
}

/// Exchanges rows and columns of 32 × 32 bits.
///
/// Each pass exchanges the highest bit of a row's number with one of a column's, and turns the row's
/// number round by a bit: all passes do the same to the same places, so that a compiler sees vectors.
/// (The halving of Warren, Hacker's Delight, 7-3.)
#[inline(always)]
fn transpose(rows: &mut [u32; ROW]) {
    for (shift, low) in HALVES {
        let before = *rows;
        for i in 0..ROW / 2 {
            let (a, b) = (before[i], before[i + ROW / 2]);
            rows[2 * i] = (a & low) | ((b & low) << shift);
            rows[2 * i + 1] = ((a >> shift) & low) | (b & !low);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::BitOrder;
    use super::super::bit_order::row_words;
    use super::*;
    use crate::grid::Roi;

    #[test]
    fn words_along_y_end_as_the_same_voxels() {
        for shape in [[5, 6, 3], [33, 40, 2], [64, 1, 35], [1, 33, 33], [70, 45, 67], [3, 5, 130]] {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            let rows = BitOrder::rows(&roi);
            let [nx, ny, nz] = shape.map(|n| n as usize);
            let (mut along_x, mut along_y) =
                (vec![0_u64; rows.words()], vec![0; row_words(shape, 1)]);
            let mut want = along_x.clone();
            for voxel in (0..nx * ny * nz).filter(|voxel| voxel * voxel % 7 < 2) {
                let bit = rows.bit_of(voxel as u32) as usize;
                want[bit / 64] |= 1 << (bit % 64);
                let [x, y, z] = [voxel / nz / ny, voxel / nz % ny, voxel % nz];
                if voxel % 3 == 0 {
                    along_x[bit / 64] |= 1 << (bit % 64);
                } else {
                    along_y[(z * ny.div_ceil(32) + y / 32) * nx + x] |= 1 << (y % 32);
                }
            }
            assert!(along_x != want, "{shape:?}");
            add_transposed(shape, &mut along_y, bytemuck::cast_slice_mut(&mut along_x));
            assert!(along_x == want, "{shape:?}");
            assert!(along_y.iter().all(|&word| word == 0), "{shape:?}");
        }
    }
}
