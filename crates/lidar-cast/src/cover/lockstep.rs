//! Sixteen beams in lockstep, a run of voxels of one row at a time.
//!
//! The crossings are those of [`super::reference`]: plane i of an axis at t = (i − p) · d⁻¹. A run
//! ends at the next crossing of the two axes across, at the end of the 32-bit word, or of the beam;
//! its voxels are found from the number of planes along the row that are crossed by then.

use multiversion::multiversion;

use crate::grid::Roi;
use crate::task::NO_CROSSING;

/// Beams that walk at the same time.
const LANES: usize = 16;
/// Runs between two checks whether all lanes have ended.
const STEPS: usize = 3;
/// Distance in the sorted list of two beams in neighbouring lanes. Neighbours in the list mark the
/// same words, and one lane's store would have to reach memory before the next lane's load.
const LANE_STRIDE: usize = 6;
/// Voxels of a word, which are marked at once.
pub(crate) const WORD: i32 = 32;
/// Margin taken off the number of planes that a slope says are crossed, in voxels: it may be one too
/// low, which one exact crossing then mends, and is never too high.
pub(crate) const PLANES_MARGIN: f32 = 1.0 / 64.0;
/// 1.5 · 2²³: its last place is 1, so that x + ROUND holds the integer nearest to x (|x| < 2²²) in its
/// lowest bits, e.g. (5.2 + ROUND).to_bits() − ROUND.to_bits() = 5.
pub(crate) const ROUND: f32 = (3 << 22) as f32;
/// End of a beam that covers nothing.
pub(crate) const NEVER: f32 = f32::NEG_INFINITY;

/// The start of a sensor's beams: by axis, and by whether they go backward (0) or forward (1).
pub(crate) struct BeamStart {
    pub p: [f32; 3],
    /// First plane ahead.
    plane: [[f32; 2]; 3],
    /// The plane at which the grid ends.
    pub exit: [[f32; 2]; 3],
    /// Coordinate of the first voxel; negative outside the grid.
    pub cell: [[i32; 2]; 3],
}

impl BeamStart {
    pub(crate) fn new(roi: &Roi, p: [f32; 3]) -> Self {
        // A beam that starts on a plane and goes backward has crossed it.
        let cell = p.map(|p| [p.ceil() as i32 - 1, p.floor() as i32]);
        let plane = cell.map(|[back, ahead]| [back as f32, (ahead + 1) as f32]);
        Self { p, plane, exit: roi.shape().map(|n| [0.0, n as f32]), cell }
    }
}

/// Constants of the beams of one way, which go mainly along axis `u`, across along `v`.
///
/// Where beams go backward along an axis, planes and voxels count down: plane i is −i, voxel i is −i − 1 (`!i`).
/// Both then rise along every beam, and (i − p) · d⁻¹ is (−i + p) · |d⁻¹|, the same number.
pub(crate) struct Way {
    u: usize,
    v: usize,
    /// Minus the origin and the first plane along `u`, the first voxel.
    minus_u: f32,
    plane_u: f32,
    cell_u: i32,
    /// Minus the origin and the first plane, backward and forward.
    minus_v: [f32; 2],
    plane_v: [f32; 2],
    minus_z: [f32; 2],
    plane_z: [f32; 2],
    /// Where the first word is, as a sum over the axes.
    at_u: i32,
    at_v: [i32; 2],
    at_z: [i32; 2],
    /// Words to the next one over a plane.
    step_u: i32,
    step_v: [i32; 2],
    step_z: [i32; 2],
}

impl Way {
    pub(crate) fn new(roi: &Roi, start: &BeamStart, u: usize, back: bool) -> Self {
        let (v, side) = (1 - u, usize::from(!back));
        let n = roi.shape().map(|n| n as i32);
        let layer = (n[u] as u32).div_ceil(WORD as u32) as i32 * n[v];
        let minus = start.p.map(|p| [p, -p]);
        let plane = start.plane.map(|[back, ahead]| [-back, ahead]);
        let cell = start.cell[u][side];
        Self {
            u,
            v,
            minus_u: minus[u][side],
            plane_u: plane[u][side],
            cell_u: if back { !cell } else { cell },
            minus_v: minus[v],
            plane_v: plane[v],
            minus_z: minus[2],
            plane_z: plane[2],
            at_u: cell / WORD * n[v],
            at_v: start.cell[v],
            at_z: start.cell[2].map(|cell| cell * layer),
            step_u: if back { -n[v] } else { n[v] },
            step_v: [-1, 1],
            step_z: [-layer, layer],
        }
    }
}

/// A number of each lane.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct PerLane<T>([T; LANES]);

/// Marks the voxels of the beams of one way; `inverse` and `stops` hold all beams of the sensor.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
pub(crate) fn walk_all<const BACK: bool>(
    way: &Way,
    beams: &[u32],
    inverse: &[Vec<f32>; 3],
    stops: &[f32],
    bitmap: &mut [u32],
) {
    let [iu, iv, iz] = [way.u, way.v, 2].map(|k| &inverse[k][..]);
    for chunk in beams.chunks(LANES * LANE_STRIDE) {
        let groups = chunk.len().div_ceil(LANES);
        for group in 0..groups {
            let (mut inverse, mut stop) =
                ([PerLane([NO_CROSSING; LANES]); 3], PerLane([NEVER; LANES]));
            for lane in 0..LANES {
                let Some(&beam) = chunk.get(lane * groups + group) else { break };
                let beam = beam as usize;
                inverse[0].0[lane] = iu[beam];
                inverse[1].0[lane] = iv[beam];
                inverse[2].0[lane] = iz[beam];
                stop.0[lane] = stops[beam];
            }
            walk::<BACK>(way, &inverse, &stop, bitmap);
        }
    }
}

/// Marks the voxels of [`LANES`] beams.
///
/// A beam is taken from run to run: a run ends at time t, where the beam crosses a plane along `v` or
/// z, comes to the end of a word, or ends. The planes along `u` crossed until t are ⌊t · slope + part
/// of the first voxel behind the origin − margin⌋, or one more: the exact crossing of the next plane
/// decides. A lane whose beam has ended stays where it is, and marks nothing. Compilers make vectors
/// of the loops over lanes, where both sides of each choice are loaded beforehand. It stays one function
/// because the numbers of the lanes stay in registers from the first line to the last.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
fn walk<const BACK: bool>(
    way: &Way,
    inverse: &[PerLane<f32>; 3],
    stop: &PerLane<f32>,
    bitmap: &mut [u32],
) {
    let top = bitmap.len() as u32 - 1;
    let [mut iu, mut iv, mut iz, mut slope] = [PerLane([0.0; LANES]); 4];
    // The next plane and when it is crossed: along v and z, and the end of the word.
    let [mut bv, mut bz, mut bw] = [PerLane([0.0; LANES]); 3];
    let [mut tv, mut tz, mut tw] = [PerLane([0.0; LANES]); 3];
    let [mut minus_v, mut minus_z] = [PerLane([0.0; LANES]); 2];
    let [mut step_v, mut step_z] = [PerLane([0_i32; LANES]); 2];
    // The word, the voxel along u, and whether the beam goes on.
    let [mut at, mut from] = [PerLane([0_i32; LANES]); 2];
    let mut goes_on = PerLane([0_u32; LANES]);
    let (minus_u, plane_u, step_u) = (way.minus_u, way.plane_u, way.step_u);
    let word_end = ((way.cell_u | (WORD - 1)) + 1) as f32;
    let ([minus_vb, minus_va], [minus_zb, minus_za]) = (way.minus_v, way.minus_z);
    let ([plane_vb, plane_va], [plane_zb, plane_za]) = (way.plane_v, way.plane_z);
    let ([at_vb, at_va], [at_zb, at_za]) = (way.at_v, way.at_z);
    let ([step_vb, step_va], [step_zb, step_za]) = (way.step_v, way.step_z);
    for i in 0..LANES {
        let (ahead_v, ahead_z) = (inverse[1].0[i] > 0.0, inverse[2].0[i] > 0.0);
        iu.0[i] = inverse[0].0[i].abs();
        iv.0[i] = inverse[1].0[i].abs();
        iz.0[i] = inverse[2].0[i].abs();
        slope.0[i] = 1.0 / iu.0[i];
        minus_v.0[i] = if ahead_v { minus_va } else { minus_vb };
        minus_z.0[i] = if ahead_z { minus_za } else { minus_zb };
        step_v.0[i] = if ahead_v { step_va } else { step_vb };
        step_z.0[i] = if ahead_z { step_za } else { step_zb };
        let at_v = if ahead_v { at_va } else { at_vb };
        let at_z = if ahead_z { at_za } else { at_zb };
        at.0[i] = way.at_u + at_v + at_z;
        from.0[i] = way.cell_u;
        bv.0[i] = if ahead_v { plane_va } else { plane_vb };
        bz.0[i] = if ahead_z { plane_za } else { plane_zb };
        bw.0[i] = word_end;
        tv.0[i] = (bv.0[i] + minus_v.0[i]) * iv.0[i];
        tz.0[i] = (bz.0[i] + minus_z.0[i]) * iz.0[i];
        tw.0[i] = (word_end + minus_u) * iu.0[i];
        goes_on.0[i] = if stop.0[i] > 0.0 { u32::MAX } else { 0 };
    }
    // Planes crossed until t: t · slope + the part of the first voxel behind the origin, less a half,
    // since adding ROUND rounds to the nearest integer and not down.
    let behind = 1.0 - (plane_u + minus_u) - 0.5 - PLANES_MARGIN;
    let to_plane = plane_u - ROUND;
    let to_voxel = plane_u as i32 - 1 - ROUND.to_bits() as i32;
    // Words and masks of one round are stored in the next, while the processor computes that one.
    let (mut words, mut masks) =
        ([PerLane([0_u32; LANES]); STEPS], [PerLane([0_u32; LANES]); STEPS]);
    loop {
        let mut any = 0;
        for i in 0..LANES {
            any |= goes_on.0[i];
        }
        if any == 0 {
            break;
        }
        for (words, masks) in words.iter_mut().zip(&mut masks) {
            mark(words, masks, bitmap);
            for i in 0..LANES {
                let (now_v, now_z, now_w, end) = (tv.0[i], tz.0[i], tw.0[i], stop.0[i]);
                let vz = if now_v < now_z { now_v } else { now_z };
                let we = if now_w < end { now_w } else { end };
                let t = if vz < we { vz } else { we };
                let crossed = (t * slope.0[i] + behind) + ROUND;
                let crossing = ((crossed + to_plane) + minus_u) * iu.0[i];
                let one_more = if crossing < t { 1 } else { 0 };
                let to = (crossed.to_bits() as i32).wrapping_add(to_voxel).wrapping_add(one_more);
                let (first, left) = (from.0[i] as u32 & 31, !to as u32 & 31);
                let mask = if BACK {
                    (u32::MAX >> first) & (u32::MAX << left)
                } else {
                    (u32::MAX << first) & (u32::MAX >> left)
                };
                masks.0[i] = mask & goes_on.0[i];
                let word = at.0[i] as u32;
                words.0[i] = if word < top { word } else { top };
                // A plane along u that is crossed at the same time is behind the next run.
                from.0[i] = to.wrapping_add(if crossing == t { 1 } else { 0 });
                let (on_v, on_z, on_w) = (now_v == t, now_z == t, now_w == t);
                let by_v = if on_v { step_v.0[i] } else { 0 };
                let by_z = if on_z { step_z.0[i] } else { 0 };
                let by_w = if on_w { step_u } else { 0 };
                at.0[i] = at.0[i].wrapping_add(by_w).wrapping_add(by_v).wrapping_add(by_z);
                let plane_v = bv.0[i] + if on_v { 1.0 } else { 0.0 };
                let plane_z = bz.0[i] + if on_z { 1.0 } else { 0.0 };
                let plane_w = bw.0[i] + if on_w { WORD as f32 } else { 0.0 };
                (bv.0[i], bz.0[i], bw.0[i]) = (plane_v, plane_z, plane_w);
                tv.0[i] = (plane_v + minus_v.0[i]) * iv.0[i];
                tz.0[i] = (plane_z + minus_z.0[i]) * iz.0[i];
                tw.0[i] = (plane_w + minus_u) * iu.0[i];
                goes_on.0[i] = if end == t { 0 } else { goes_on.0[i] };
            }
        }
    }
    for (words, masks) in words.iter().zip(&masks) {
        mark(words, masks, bitmap);
    }
}

#[inline(always)]
#[allow(clippy::needless_range_loop)]
fn mark(words: &PerLane<u32>, masks: &PerLane<u32>, bitmap: &mut [u32]) {
    for i in 0..LANES {
        bitmap[words.0[i] as usize] |= masks.0[i];
    }
}
