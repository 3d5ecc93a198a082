//! The voxel grid of the region of interest, and the rule that gives a hit its voxel.

use glam::DVec3;
use serde::Serialize;

/// Most voxels of a grid: indices fit 31 bits.
const VOXEL_LIMIT: u64 = 1 << 31;
/// Most voxels along one axis: plane numbers are exact in `f32`.
const AXIS_LIMIT: u32 = 1 << 24;

/// Longest edge of a voxel, in metres.
const EDGE_LIMIT: f64 = 1e6;

/// Error of a voxel grid. Field names (`roi_min`, `voxel`, `shape`) match the P-SOG file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum GridError {
    /// A coordinate is NaN or infinite.
    #[error("{field} along {axis} is {value}; give a finite number of metres")]
    NotFinite { field: &'static str, axis: char, value: f64 },
    /// A voxel edge is zero, negative or beyond any scene.
    #[error("voxel along {axis} is {value} m; give an edge above 0, at most {EDGE_LIMIT} m")]
    VoxelSize { axis: char, value: f64 },
    /// The box ends before it begins.
    #[error(
        "the region of interest ends at {max} m along {axis}, before or where it begins ({min} m); swap or move its ends"
    )]
    Reversed { axis: char, min: f64, max: f64 },
    /// The grid has no voxel along an axis.
    #[error("shape along {axis} is 0; a grid needs at least one voxel along each axis")]
    NoVoxels { axis: char },
    /// Too many voxels along one axis.
    #[error(
        "shape along {axis} is {voxels} voxels, at most {AXIS_LIMIT} fit; use larger voxels or a smaller region"
    )]
    AxisTooLong { axis: char, voxels: f64 },
    /// Too many voxels in all.
    #[error(
        "the grid has {voxels} voxels, at most {VOXEL_LIMIT} fit; use larger voxels or a smaller region"
    )]
    TooManyVoxels { voxels: u128 },
    /// Neighbouring voxel faces are the same number in double precision.
    #[error(
        "voxel along {axis} is {voxel} m, too fine for coordinates near {near} m; use larger voxels or move the region nearer to the origin"
    )]
    TooFine { axis: char, voxel: f64, near: f64 },
}

/// A hit is pushed this far along its beam before its voxel is looked up, in metres.
///
/// A road that lies exactly on a voxel face would otherwise flicker between two layers.
pub const HIT_PUSH: f64 = 1e-3;

const AXES: [char; 3] = ['x', 'y', 'z'];

/// Checks that numbers along an axis are finite, and that an edge is a voxel's.
fn check(axis: char, fields: &[(&'static str, f64)], edge: f64) -> Result<(), GridError> {
    if let Some(&(field, value)) = fields.iter().find(|(_, value)| !value.is_finite()) {
        return Err(GridError::NotFinite { field, axis, value });
    }
    match edge > 0.0 && edge <= EDGE_LIMIT {
        true => Ok(()),
        false => Err(GridError::VoxelSize { axis, value: edge }),
    }
}

/// Region of interest: a box in the ego frame, cut into voxels.
///
/// Voxel (i, j, k) is the half-open box `min + [i, i+1)·voxel_x × [j, j+1)·voxel_y × [k, k+1)·voxel_z`
/// in metres; its linear index is `(i·ny + j)·nz + k` (C order, z fastest).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Roi {
    min: [f64; 3],
    voxel: [f64; 3],
    shape: [u32; 3],
}

impl Roi {
    /// A grid of `shape` voxels of edge `voxel` (metres) whose lower corner is `min` (metres).
    ///
    /// # Errors
    /// Numbers that are not finite, edges not above 0, an axis of 0 or more than 2²⁴
    /// voxels, more than 2³¹ voxels in all, or voxels too fine for `f64` at `min`.
    pub fn new(min: [f64; 3], voxel: [f64; 3], shape: [u32; 3]) -> Result<Self, GridError> {
        for (a, axis) in AXES.into_iter().enumerate() {
            check(axis, &[("roi_min", min[a]), ("voxel", voxel[a])], voxel[a])?;
            if shape[a] == 0 {
                return Err(GridError::NoVoxels { axis });
            }
            if shape[a] > AXIS_LIMIT {
                return Err(GridError::AxisTooLong { axis, voxels: f64::from(shape[a]) });
            }
            let max = min[a] + f64::from(shape[a]) * voxel[a];
            for near in [min[a], max] {
                if near + voxel[a] <= near || near - voxel[a] >= near {
                    return Err(GridError::TooFine { axis, voxel: voxel[a], near });
                }
            }
        }
        let voxels = shape.iter().map(|&n| u128::from(n)).product();
        if voxels > u128::from(VOXEL_LIMIT) {
            return Err(GridError::TooManyVoxels { voxels });
        }
        Ok(Self { min, voxel, shape })
    }

    /// The grid that covers the box `min..max` (metres) with voxels of edge `voxel`, as a scene
    /// file gives it.
    ///
    /// An axis whose length is no multiple of the edge ends with a voxel that reaches past `max`.
    ///
    /// # Errors
    /// A box that ends before it begins, and everything that [`Roi::new`] refuses.
    pub fn from_bounds(min: [f64; 3], max: [f64; 3], voxel: [f64; 3]) -> Result<Self, GridError> {
        let mut shape = [0; 3];
        for (a, axis) in AXES.into_iter().enumerate() {
            let fields = [("roi_min", min[a]), ("roi_max", max[a]), ("voxel", voxel[a])];
            check(axis, &fields, voxel[a])?;
            if max[a] <= min[a] {
                return Err(GridError::Reversed { axis, min: min[a], max: max[a] });
            }
            // A millionth of a voxel forgives decimal numbers: 80 m / 0.2 m is 400, not 401.
            let voxels = ((max[a] - min[a]) / voxel[a] - 1e-6).ceil().max(1.0);
            if voxels > f64::from(AXIS_LIMIT) {
                return Err(GridError::AxisTooLong { axis, voxels });
            }
            shape[a] = voxels as u32;
        }
        Self::new(min, voxel, shape)
    }

    /// Lower corner, in metres.
    pub fn min(&self) -> [f64; 3] {
        self.min
    }

    /// Upper corner (outside the grid, as its boxes are half-open), in metres.
    pub fn max(&self) -> [f64; 3] {
        std::array::from_fn(|a| self.face(a, self.shape[a]))
    }

    /// Edges of a voxel, in metres.
    pub fn voxel(&self) -> [f64; 3] {
        self.voxel
    }

    /// Voxels along x, y and z.
    pub fn shape(&self) -> [u32; 3] {
        self.shape
    }

    /// Voxels in all, fewer than 2³¹.
    pub fn voxel_count(&self) -> u64 {
        self.shape.iter().map(|&n| u64::from(n)).product()
    }

    /// Linear index `(i·ny + j)·nz + k`; the coordinates must lie in the grid.
    pub fn linear(&self, [i, j, k]: [u32; 3]) -> u64 {
        debug_assert!(i < self.shape[0] && j < self.shape[1] && k < self.shape[2]);
        let [_, ny, nz] = self.shape.map(u64::from);
        (u64::from(i) * ny + u64::from(j)) * nz + u64::from(k)
    }

    /// The voxel (i, j, k) of a linear index, which must lie in the grid.
    pub fn coords(&self, linear: u64) -> [u32; 3] {
        debug_assert!(linear < self.voxel_count());
        let [_, ny, nz] = self.shape.map(u64::from);
        [(linear / nz / ny) as u32, (linear / nz % ny) as u32, (linear % nz) as u32]
    }

    /// Linear index of the voxel that holds `point` (ego frame, metres); `None` outside the grid.
    pub fn voxel_of(&self, point: DVec3) -> Option<u64> {
        let mut coords = [0; 3];
        for (a, p) in point.to_array().into_iter().enumerate() {
            if !(p >= self.min[a] && p < self.face(a, self.shape[a])) {
                return None;
            }
            // The quotient may fall on the wrong side of a face by rounding; the faces decide.
            let mut i = (((p - self.min[a]) / self.voxel[a]) as u32).min(self.shape[a] - 1);
            if p < self.face(a, i) {
                i -= 1;
            } else if p >= self.face(a, i + 1) {
                i += 1;
            }
            coords[a] = i;
        }
        Some(self.linear(coords))
    }

    /// [`Self::voxel_of`] of many points, axis by axis; `u32::MAX` outside the grid.
    #[inline(always)]
    pub fn voxels_of<const N: usize>(&self, points: &[[f64; N]; 3], voxels: &mut [u32; N]) {
        let mut linear = [0.0; N];
        let mut inside = [true; N];
        for (a, points) in points.iter().enumerate() {
            let (min, edge, count) = (self.min[a], self.voxel[a], f64::from(self.shape[a]));
            let max = self.face(a, self.shape[a]);
            // The faces decide, so a product that rounds otherwise than the quotient does no harm.
            let inverse = 1.0 / edge;
            for (n, &p) in points.iter().enumerate() {
                let i = ((p - min) * inverse).trunc().min(count - 1.0);
                let below = p < min + i * edge;
                let above = !below && p >= min + (i + 1.0) * edge;
                let i = i + f64::from(u8::from(above)) - f64::from(u8::from(below));
                inside[n] &= p >= min && p < max;
                // Whole numbers below 2³¹, so exact.
                linear[n] = linear[n] * count + i;
            }
        }
        for n in 0..N {
            voxels[n] = if inside[n] { linear[n] as u32 } else { u32::MAX };
        }
    }

    /// Linear index of the voxel that a hit at `point`, seen from `origin`, belongs to.
    ///
    /// The voxel of `point + HIT_PUSH·(point − origin)/|point − origin|`: the one rule shared by scoring
    /// and voting. A point at its own origin is not pushed. Ego frame, metres.
    pub fn voxel_of_hit(&self, origin: DVec3, point: DVec3) -> Option<u64> {
        self.voxel_of(point + (point - origin).normalize_or_zero() * HIT_PUSH)
    }

    /// Coordinate of the face below voxel `i` along axis `a`.
    fn face(&self, a: usize, i: u32) -> f64 {
        self.min[a] + f64::from(i) * self.voxel[a]
    }
}
