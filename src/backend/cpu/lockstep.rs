use multiversion::multiversion;

use super::beam::beam_direction;
use super::cover::{Walk, beam_end, grid_origin};
use crate::backend::DevicePose;
use crate::backend::layout::{FAR, TINY_COMPONENT};
use crate::bvh::Hit;
use crate::grid::Roi;

/// Beams that walk at the same time.
const LANES: usize = 16;
/// Voxels that a lane is taken on between two looks at whether its beam has ended.
const STEPS: usize = 4;
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
    /// Table order with beams far from each other side by side.
    order: Vec<u32>,
}

/// Marks the voxels that one sensor's beams traverse: [`super::cover_voxels`] with sixteen beams in
/// lockstep, each lane taking the next beam when its own has ended. The same bits.
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
    walk_all(&start, scratch, bitmap);
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
    /// First plane ahead.
    plane: [[f32; 2]; 3],
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

/// Fills in every beam's slopes and end.
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
}

/// Beams in flight, a lane each.
struct Lanes {
    index: [i32; LANES],
    last: [f32; LANES],
    plane: [[f32; LANES]; 3],
    next: [[f32; LANES]; 3],
    inverse: [[f32; LANES]; 3],
    /// ±1, and what that is in linear indices.
    step: [[f32; LANES]; 3],
    stride: [[i32; LANES]; 3],
}

impl Lanes {
    #[inline(always)]
    fn load(&mut self, lane: usize, start: &Start, inverse: [f32; 3], last: f32) {
        self.index[lane] = 0;
        self.last[lane] = last;
        for (k, inverse) in inverse.into_iter().enumerate() {
            let way = usize::from(inverse > 0.0);
            self.index[lane] += start.index[k][way];
            self.plane[k][lane] = start.plane[k][way];
            self.inverse[k][lane] = inverse;
            self.next[k][lane] = (start.plane[k][way] - start.p[k]) * inverse;
            self.step[k][lane] = [-1.0, 1.0][way];
            self.stride[k][lane] = start.stride[k][way];
        }
    }

    /// Takes every lane [`STEPS`] voxels on, or to its end, writing down where it has been; returns
    /// whether each goes on.
    #[inline(always)]
    fn advance(&mut self, p: [f32; 3], seen: &mut [[i32; LANES]; STEPS]) -> [u32; LANES] {
        // Copies stay in registers; the lanes themselves are loaded one by one.
        let (mut index, last) = (self.index, self.last);
        let ([mut bx, mut by, mut bz], [mut tx, mut ty, mut tz]) = (self.plane, self.next);
        let ([ix, iy, iz], [sx, sy, sz]) = (self.inverse, self.step);
        let [jx, jy, jz] = self.stride;
        let mut goes_on = [0; LANES];
        for seen in seen {
            *seen = index;
            for i in 0..LANES {
                let xy = if tx[i] < ty[i] { tx[i] } else { ty[i] };
                let t = if xy < tz[i] { xy } else { tz[i] };
                let on = t <= last[i];
                let (on_x, on_y, on_z) = (on & (tx[i] == t), on & (ty[i] == t), on & (tz[i] == t));
                bx[i] = if on_x { bx[i] + sx[i] } else { bx[i] };
                by[i] = if on_y { by[i] + sy[i] } else { by[i] };
                bz[i] = if on_z { bz[i] + sz[i] } else { bz[i] };
                tx[i] = (bx[i] - p[0]) * ix[i];
                ty[i] = (by[i] - p[1]) * iy[i];
                tz[i] = (bz[i] - p[2]) * iz[i];
                index[i] = if on_x { index[i] + jx[i] } else { index[i] };
                index[i] = if on_y { index[i] + jy[i] } else { index[i] };
                index[i] = if on_z { index[i] + jz[i] } else { index[i] };
                goes_on[i] = u32::from(on);
            }
        }
        (self.index, self.plane, self.next) = (index, [bx, by, bz], [tx, ty, tz]);
        goes_on
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn walk_all(start: &Start, scratch: &WalkScratch, bitmap: &mut [u64]) {
    let mut queue = scratch.order.iter().map(|&beam| beam as usize);
    let mut queue = queue.by_ref().filter(|&beam| scratch.last[beam] > NEVER);
    let slopes = |beam: usize| [0, 1, 2].map(|k| scratch.inverse[k][beam]);
    let Some(first) = queue.next() else { return };
    let mut lanes = Lanes {
        index: [0; LANES],
        last: [0.0; LANES],
        plane: [[0.0; LANES]; 3],
        next: [[0.0; LANES]; 3],
        inverse: [[0.0; LANES]; 3],
        step: [[0.0; LANES]; 3],
        stride: [[0; LANES]; 3],
    };
    // Lanes without a beam of their own repeat the first.
    for lane in 0..LANES {
        let beam = if lane == 0 { first } else { queue.next().unwrap_or(first) };
        lanes.load(lane, start, slopes(beam), scratch.last[beam]);
    }
    let mut seen = [[0; LANES]; STEPS];
    loop {
        let goes_on = lanes.advance(start.p, &mut seen);
        for index in seen.as_flattened() {
            bitmap[*index as usize >> 6] |= 1 << (index & 63);
        }
        if goes_on.iter().sum::<u32>() == LANES as u32 {
            continue;
        }
        let mut ended = 0;
        for (lane, on) in goes_on.into_iter().enumerate() {
            if on == 0 {
                match queue.next() {
                    Some(beam) => lanes.load(lane, start, slopes(beam), scratch.last[beam]),
                    None => ended += 1,
                }
            }
        }
        if ended == LANES {
            return;
        }
    }
}
