//! Coverage, a beam and a voxel at a time: the specification.

use glam::Vec3;
use rayon::prelude::*;

use super::BitOrder;
use crate::bvh::{Hit, NO_HIT};
use crate::grid::Roi;
use crate::sensor::BeamTable;
use crate::task::{DevicePose, HIT_PUSH, NO_CROSSING, beam_direction};

/// Marks the voxels that each sensor's beams traverse, one bitmap a sensor.
///
/// A beam runs from its origin to its hit, pushed by a millimetre, or to `range` where it hits
/// nothing or `hits` is `None`. `bitmaps` becomes `[poses × words]` in the order of
/// [`BitOrder::linear`].
///
/// CPU twin of `shaders/cover_voxels.wgsl`.
pub fn cover_voxels(
    poses: &[DevicePose],
    table: &BeamTable,
    roi: &Roi,
    hits: Option<&[Hit]>,
    range: f32,
    bitmaps: &mut Vec<u64>,
) {
    let directions = table.directions();
    let words = BitOrder::linear(roi).words();
    bitmaps.clear();
    bitmaps.resize(poses.len() * words, 0);
    bitmaps.par_chunks_mut(words).zip(poses).enumerate().for_each(|(sensor, (bitmap, pose))| {
        for (index, &direction) in directions.iter().enumerate() {
            let hit = hits.map(|hits| hits[sensor * directions.len() + index]);
            let walk = VoxelWalk::new(roi, grid_origin(pose), beam_direction(pose, direction));
            walk.visit(beam_end(hit, range), |voxel| bitmap[voxel >> 6] |= 1 << (voxel & 63));
        }
    });
}

/// Metres after which a beam ends: pushed into the voxel of its hit, or at `range`.
#[inline(always)]
pub(crate) fn beam_end(hit: Option<Hit>, range: f32) -> f32 {
    match hit {
        Some(hit) if hit.prim != NO_HIT => hit.t + HIT_PUSH,
        _ => range,
    }
}

/// Position of the sensor in voxels.
pub(crate) fn grid_origin(pose: &DevicePose) -> Vec3 {
    Vec3::from_slice(&pose.in_grid)
}

/// A beam's way through the voxel planes.
///
/// A beam crosses plane i of an axis at `t = (i − p) · d⁻¹`, from the plane's number alone, so no
/// error builds up along the beam. Its voxel at time t is the one reached after every crossing up to
/// and including t; the voxels of [t0, t1] are a set that depends on no order of steps. Where
/// crossings coincide, all are taken at once: a beam through an edge or a corner goes diagonally
/// across and does not traverse the voxels that it only touches. (Amanatides, Woo 1987, without the
/// accumulated `t`.)
#[derive(Debug, Clone, Copy)]
pub(crate) struct VoxelWalk {
    shape: [i32; 3],
    /// Origin in voxels.
    p: [f32; 3],
    /// Metres a voxel along each axis: voxel size over direction; [`NO_CROSSING`] where it stays level.
    inverse: [f32; 3],
    /// Voxels a metre along each axis.
    slope: [f32; 3],
    forward: [bool; 3],
}

impl VoxelWalk {
    pub(crate) fn new(roi: &Roi, in_grid: Vec3, direction: Vec3) -> Self {
        let voxel = roi.voxel().map(|v| v as f32);
        let mut walk = Self {
            shape: roi.shape().map(|n| n as i32),
            p: in_grid.to_array(),
            inverse: [NO_CROSSING; 3],
            slope: [0.0; 3],
            forward: [true; 3],
        };
        for axis in 0..3 {
            let d = direction[axis];
            if d != 0.0 {
                walk.inverse[axis] = voxel[axis] / d;
                walk.slope[axis] = d / voxel[axis];
                walk.forward[axis] = d > 0.0;
            }
        }
        walk
    }

    fn crossing(&self, axis: usize, plane: i32) -> f32 {
        (plane as f32 - self.p[axis]) * self.inverse[axis]
    }

    /// Voxel coordinate after every crossing up to and including `t` ≥ 0.
    fn cell_at(&self, axis: usize, t: f32) -> i32 {
        let start = self.p[axis].floor() as i32;
        // The guess may be off where rounding differs from that of `crossing`, which decides.
        let guess = (self.p[axis] + t * self.slope[axis]).floor();
        let mut cell = guess.clamp(-2e9, 2e9) as i32;
        if self.forward[axis] {
            cell = cell.max(start);
            while cell > start && self.crossing(axis, cell) > t {
                cell -= 1;
            }
            while self.crossing(axis, cell + 1) <= t {
                cell += 1;
            }
        } else {
            cell = cell.min(start);
            while cell < start && self.crossing(axis, cell + 1) > t {
                cell += 1;
            }
            while self.crossing(axis, cell) <= t {
                cell -= 1;
            }
        }
        cell
    }

    /// When the beam enters the grid, 0 if it starts inside; `None` if it never does.
    fn entry(&self) -> Option<f32> {
        let mut entry = 0.0_f32;
        for axis in 0..3 {
            let n = self.shape[axis];
            if self.forward[axis] {
                if self.p[axis] >= n as f32 {
                    return None;
                }
                if self.p[axis] < 0.0 {
                    entry = entry.max(self.crossing(axis, 0));
                }
            } else {
                if self.p[axis] < 0.0 {
                    return None;
                }
                if self.p[axis] >= n as f32 {
                    entry = entry.max(self.crossing(axis, n));
                }
            }
        }
        Some(entry)
    }

    /// Calls `mark` with the linear index of every voxel from the entry to `t_end`, in order.
    pub(crate) fn visit(&self, t_end: f32, mut mark: impl FnMut(usize)) {
        let Some(entry) = self.entry() else { return };
        if entry > t_end {
            return;
        }
        let mut cell = [0, 1, 2].map(|axis| self.cell_at(axis, entry));
        let stride = [self.shape[1] * self.shape[2], self.shape[2], 1];
        let step = self.forward.map(|forward| if forward { 1 } else { -1 });
        // The plane ahead of cell c is c + 1 going forward and c going backward.
        let ahead = self.forward.map(i32::from);
        let mut next = [0, 1, 2].map(|axis| self.crossing(axis, cell[axis] + ahead[axis]));
        loop {
            if (0..3).any(|axis| cell[axis] < 0 || cell[axis] >= self.shape[axis]) {
                return;
            }
            mark((cell[0] * stride[0] + cell[1] * stride[1] + cell[2]) as usize);
            let t = next[0].min(next[1]).min(next[2]);
            if t > t_end {
                return;
            }
            for axis in 0..3 {
                if next[axis] == t {
                    cell[axis] += step[axis];
                    next[axis] = self.crossing(axis, cell[axis] + ahead[axis]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(origin: [f32; 3], direction: [f32; 3], t_end: f32) -> Vec<usize> {
        let roi = Roi::new([0.0; 3], [1.0; 3], [4, 4, 4]).unwrap();
        let mut seen = Vec::new();
        let direction = Vec3::from(direction).normalize();
        VoxelWalk::new(&roi, origin.into(), direction).visit(t_end, |v| seen.push(v));
        seen
    }

    fn index(cells: &[[usize; 3]]) -> Vec<usize> {
        cells.iter().map(|[i, j, k]| (i * 4 + j) * 4 + k).collect()
    }

    #[test]
    fn axis_parallel_beams_stay_in_their_row() {
        let want = index(&[[0, 1, 2], [1, 1, 2], [2, 1, 2], [3, 1, 2]]);
        assert_eq!(walk([0.5, 1.5, 2.5], [1.0, 0.0, 0.0], 100.0), want);
        // A beam in a face belongs to the voxel above it: voxels are half-open boxes.
        assert_eq!(walk([0.5, 1.0, 2.0], [1.0, 0.0, -0.0], 100.0), want);
        // From outside, and only as far as the range goes.
        assert_eq!(walk([-2.0, 1.5, 2.5], [1.0, 0.0, 0.0], 3.5), want[..2]);
        assert!(walk([-2.0, 1.5, 2.5], [-1.0, 0.0, 0.0], 100.0).is_empty());
        assert!(walk([-2.0, 4.0, 2.5], [1.0, 0.0, 0.0], 100.0).is_empty());
    }

    #[test]
    fn a_diagonal_beam_does_not_touch_the_neighbours() {
        let want = index(&[[0, 0, 1], [1, 1, 1], [2, 2, 1], [3, 3, 1]]);
        assert_eq!(walk([0.5, 0.5, 1.5], [1.0, 1.0, 0.0], 100.0), want);
        let back: Vec<_> = want.iter().rev().copied().collect();
        assert_eq!(walk([3.5, 3.5, 1.5], [-1.0, -1.0, 0.0], 100.0), back);
        // Through a corner of the grid from outside.
        assert_eq!(walk([-1.0, -1.0, 1.5], [1.0, 1.0, 0.0], 100.0), want);
    }

    #[test]
    fn a_crossing_at_the_very_end_counts() {
        assert_eq!(
            walk([0.5, 0.5, 0.5], [0.0, 1.0, 0.0], 1.5),
            index(&[[0, 0, 0], [0, 1, 0], [0, 2, 0]])
        );
        assert_eq!(walk([0.5, 0.5, 0.5], [0.0, 1.0, 0.0], 1.4999), index(&[[0, 0, 0], [0, 1, 0]]));
    }
}
