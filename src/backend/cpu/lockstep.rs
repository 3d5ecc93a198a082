use multiversion::multiversion;

use super::beam::beam_direction;
use super::cover::{Walk, beam_end, grid_origin};
use crate::backend::DevicePose;
use crate::backend::layout::{FAR, TINY_COMPONENT};
use crate::bvh::Hit;
use crate::grid::Roi;

/// Beams that walk at the same time.
const LANES: usize = 16;
/// Voxels that the lanes are taken on between two looks at whether all have ended.
const STEPS: usize = 4;
/// Kinds of beams by the number of voxels on their way.
const LENGTHS: usize = 256;
/// A bitmap of 64-bit words is marked by halves; this finds them on machines that store the high
/// half first.
const SWAP: u32 = cfg!(target_endian = "big") as u32;
/// Planes and origins up to this many voxels from the corner: there, crossings of different planes
/// are different numbers, so that a beam's end can be told from the time at which it leaves.
const PLAIN: f32 = (1 << 22) as f32;
/// End of a beam that covers nothing.
const NEVER: f32 = f32::NEG_INFINITY;

/// Working memory of [`cover_sensor`], to be used again.
#[derive(Default)]
pub struct WalkScratch {
    /// Metres a voxel along each axis, by beam.
    inverse: [Vec<f32>; 3],
    /// Last crossing that a beam takes.
    last: Vec<f32>,
    /// About how many voxels a beam crosses, as a share of the most in 1/[`LENGTHS`].
    length: Vec<u8>,
    /// Table order with beams far from each other side by side.
    order: Vec<u32>,
    /// That order by length: beams of a group end at about the same time.
    sorted: Vec<u32>,
}

/// Marks the voxels that one sensor's beams traverse: [`super::cover_voxels`] with sixteen beams of
/// about the same number of voxels in lockstep. The same bits.
///
/// `hits` is `[directions]`; `bitmap` must be zero and hold all voxels.
pub fn cover_sensor(
    pose: &DevicePose,
    directions: &[[f32; 3]],
    roi: &Roi,
    hits: Option<&[Hit]>,
    range: f32,
    scratch: &mut WalkScratch,
    bitmap: &mut [u64],
) {
    let p = grid_origin(pose);
    let plain = (0..3).all(|k| {
        let n = roi.shape()[k] as f32;
        p[k] >= 0.0 && p[k] < n && n < PLAIN
    });
    if !plain {
        for (index, &direction) in directions.iter().enumerate() {
            let t_end = beam_end(hits.map(|hits| hits[index]), range);
            let walk = Walk::new(roi, p, beam_direction(pose, direction));
            walk.visit(t_end, |voxel| bitmap[voxel >> 6] |= 1 << (voxel & 63));
        }
        return;
    }
    let start = Start::new(roi, p.to_array());
    scratch.fit(directions.len());
    prepare(pose, directions, roi, hits, range, &start, scratch);
    sort(scratch);
    walk_all(&start, scratch, bytemuck::cast_slice_mut(bitmap));
}

impl WalkScratch {
    fn fit(&mut self, beams: usize) {
        if self.order.len() == beams {
            return;
        }
        for inverse in &mut self.inverse {
            inverse.resize(beams, 0.0);
        }
        self.last.resize(beams, 0.0);
        self.length.resize(beams, 0);
        self.sorted.resize(beams, 0);
        // Sixteen runs of the table, each begun elsewhere: lanes that mark the same word at the same
        // time would wait for each other.
        let run = beams.div_ceil(LANES);
        let beam = |at: usize| {
            let (lane, turn) = (at % LANES, at / LANES);
            lane * run + (turn + 8 * lane) % run
        };
        self.order = (0..run * LANES).map(beam).filter(|&b| b < beams).map(|b| b as u32).collect();
    }
}

/// What a sensor's beams have in common: by axis, and by whether they go backward (0) or forward (1).
struct Start {
    p: [f32; 3],
    /// First plane ahead, and what leads from one to the next.
    plane: [[f32; 2]; 3],
    step: [f32; 2],
    /// The plane at which the grid ends.
    exit: [[f32; 2]; 3],
    /// Part of the first voxel's linear index; negative outside the grid.
    index: [[i32; 2]; 3],
    /// From a voxel to the next in linear indices.
    stride: [[i32; 2]; 3],
}

impl Start {
    fn new(roi: &Roi, p: [f32; 3]) -> Self {
        let [_, ny, nz] = roi.shape().map(|n| n as i32);
        let strides = [ny * nz, nz, 1];
        let mut start = Self {
            p,
            plane: [[0.0; 2]; 3],
            step: [-1.0, 1.0],
            exit: [[0.0; 2]; 3],
            index: [[0; 2]; 3],
            stride: [[0; 2]; 3],
        };
        for k in 0..3 {
            // A beam that starts on a plane and goes backward has crossed it.
            let cells = [p[k].ceil() as i32 - 1, p[k].floor() as i32];
            start.plane[k] = [cells[0] as f32, (cells[1] + 1) as f32];
            start.exit[k] = [0.0, roi.shape()[k] as f32];
            start.index[k] = cells.map(|cell| cell * strides[k]);
            start.stride[k] = [-strides[k], strides[k]];
        }
        start
    }
}

/// Fills in every beam's slopes, end and length.
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
    start: &Start,
    scratch: &mut WalkScratch,
) {
    let beams = directions.len();
    for k in 0..3 {
        let [r0, r1, r2, _] = pose.rows[k];
        let voxel = roi.voxel()[k] as f32;
        for (inverse, &[x, y, z]) in scratch.inverse[k].iter_mut().zip(directions) {
            let d = r0 * x + r1 * y + r2 * z;
            let d = if d.abs() < TINY_COMPONENT { 0.0 } else { d };
            *inverse = if d != 0.0 { voxel / d } else { FAR };
        }
    }
    for beam in 0..beams {
        scratch.last[beam] = beam_end(hits.map(|hits| hits[beam]), range);
    }
    let [ix, iy, iz] = &scratch.inverse;
    let (ix, iy, iz) = (&ix[..beams], &iy[..beams], &iz[..beams]);
    let last = &mut scratch.last[..beams];
    for beam in 0..beams {
        let leaves = |k: usize, inverse: f32| {
            (start.exit[k][usize::from(inverse > 0.0)] - start.p[k]) * inverse
        };
        let outside = |k: usize, inverse: f32| start.index[k][usize::from(inverse > 0.0)] < 0;
        let exit = leaves(0, ix[beam]).min(leaves(1, iy[beam])).min(leaves(2, iz[beam]));
        let nowhere = outside(0, ix[beam]) | outside(1, iy[beam]) | outside(2, iz[beam]);
        let end = last[beam];
        last[beam] = if nowhere | (end < 0.0) {
            NEVER
        } else if end < exit {
            end
        } else {
            exit.next_down()
        };
    }
    let most: f32 = roi.shape().iter().map(|&n| n as f32).sum();
    let scale = LENGTHS as f32 / most;
    for (beam, length) in scratch.length[..beams].iter_mut().enumerate() {
        let slopes = ix[beam].abs().recip() + iy[beam].abs().recip() + iz[beam].abs().recip();
        *length = (last[beam] * slopes * scale) as u8;
    }
}

/// Sorts the beams by length, those of one length in the order that keeps neighbours apart.
fn sort(scratch: &mut WalkScratch) {
    let mut next = [0_u32; LENGTHS];
    for &length in &scratch.length {
        next[usize::from(length)] += 1;
    }
    let mut first = 0;
    for next in &mut next {
        (*next, first) = (first, first + *next);
    }
    for &beam in &scratch.order {
        let next = &mut next[usize::from(scratch.length[beam as usize])];
        scratch.sorted[*next as usize] = beam;
        *next += 1;
    }
}

/// A number a lane.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Wide<T>([T; LANES]);

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn walk_all(start: &Start, scratch: &WalkScratch, bitmap: &mut [u32]) {
    for group in scratch.sorted.chunks(LANES) {
        let (mut inverse, mut last) = ([Wide([FAR; LANES]); 3], Wide([NEVER; LANES]));
        for (lane, &beam) in group.iter().enumerate() {
            for (to, from) in inverse.iter_mut().zip(&scratch.inverse) {
                to.0[lane] = from[beam as usize];
            }
            last.0[lane] = scratch.last[beam as usize];
        }
        walk(start, &inverse, &last, bitmap);
    }
}

/// Marks the voxels of [`LANES`] beams.
///
/// A lane whose beam has ended walks on, and marks nothing. Written so that a compiler sees vectors:
/// a loop over the lanes for each thing that is done to all, what is chosen from loaded before.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
fn walk(start: &Start, inverse: &[Wide<f32>; 3], last: &Wide<f32>, bitmap: &mut [u32]) {
    let [px, py, pz] = start.p;
    let top = bitmap.len() as u32 - 1;
    // The plane after the next one and when it is crossed: known before the next one is, so that
    // no step waits for it.
    let (mut plane, mut after) = ([Wide([0.0; LANES]); 3], [Wide([0.0; LANES]); 3]);
    let (mut next, mut step) = ([Wide([0.0; LANES]); 3], [Wide([0.0; LANES]); 3]);
    let (mut index, mut stride) = (Wide([0_i32; LANES]), [Wide([0_i32; LANES]); 3]);
    for k in 0..3 {
        let (planes, strides, indices) = (start.plane[k], start.stride[k], start.index[k]);
        for i in 0..LANES {
            let forward = inverse[k].0[i] > 0.0;
            let ahead = if forward { planes[1] } else { planes[0] };
            step[k].0[i] = if forward { start.step[1] } else { start.step[0] };
            stride[k].0[i] = if forward { strides[1] } else { strides[0] };
            index.0[i] += if forward { indices[1] } else { indices[0] };
            next[k].0[i] = (ahead - start.p[k]) * inverse[k].0[i];
            plane[k].0[i] = ahead + step[k].0[i];
            after[k].0[i] = (plane[k].0[i] - start.p[k]) * inverse[k].0[i];
        }
    }
    let ([mut bx, mut by, mut bz], [mut ax, mut ay, mut az]) = (plane, after);
    let ([mut tx, mut ty, mut tz], [sx, sy, sz]) = (next, step);
    let ([ix, iy, iz], [jx, jy, jz]) = (*inverse, stride);
    // When each lane came into its voxel.
    let mut entered = Wide([0.0; LANES]);
    let (mut words, mut masks) = ([Wide([0_u32; LANES]); STEPS], [Wide([0_u32; LANES]); STEPS]);
    loop {
        // The sign of what is left of a beam is set behind its end.
        let mut past = u32::MAX;
        for i in 0..LANES {
            past &= (last.0[i] - entered.0[i]).to_bits();
        }
        if past >> 31 == 1 {
            return;
        }
        for (words, masks) in words.iter_mut().zip(&mut masks) {
            for i in 0..LANES {
                let word = index.0[i] as u32 >> 5;
                words.0[i] = if word < top { word } else { top } ^ SWAP;
                let mask = 1 << (index.0[i] & 31);
                masks.0[i] = if entered.0[i] <= last.0[i] { mask } else { 0 };
            }
            for i in 0..LANES {
                let (now_x, now_y, now_z) = (tx.0[i], ty.0[i], tz.0[i]);
                let (after_x, after_y, after_z) = (ax.0[i], ay.0[i], az.0[i]);
                let xy = if now_x < now_y { now_x } else { now_y };
                let t = if xy < now_z { xy } else { now_z };
                let (on_x, on_y, on_z) = (now_x == t, now_y == t, now_z == t);
                let (plane_x, plane_y, plane_z) = (bx.0[i], by.0[i], bz.0[i]);
                let (far_x, far_y, far_z) =
                    (plane_x + sx.0[i], plane_y + sy.0[i], plane_z + sz.0[i]);
                let (stride_x, stride_y, stride_z) = (jx.0[i], jy.0[i], jz.0[i]);
                tx.0[i] = if on_x { after_x } else { now_x };
                ty.0[i] = if on_y { after_y } else { now_y };
                tz.0[i] = if on_z { after_z } else { now_z };
                let plane_x = if on_x { far_x } else { plane_x };
                let plane_y = if on_y { far_y } else { plane_y };
                let plane_z = if on_z { far_z } else { plane_z };
                (bx.0[i], by.0[i], bz.0[i]) = (plane_x, plane_y, plane_z);
                ax.0[i] = (plane_x - px) * ix.0[i];
                ay.0[i] = (plane_y - py) * iy.0[i];
                az.0[i] = (plane_z - pz) * iz.0[i];
                let by_x = if on_x { stride_x } else { 0 };
                let by_y = if on_y { stride_y } else { 0 };
                let by_z = if on_z { stride_z } else { 0 };
                index.0[i] = index.0[i].wrapping_add(by_x).wrapping_add(by_y).wrapping_add(by_z);
                entered.0[i] = t;
            }
        }
        for (words, masks) in words.iter().zip(&masks) {
            for i in 0..LANES {
                bitmap[words.0[i] as usize] |= masks.0[i];
            }
        }
    }
}
