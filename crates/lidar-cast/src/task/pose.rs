//! Sensors and voxels as every engine reads them, rounded to `f32` once.

use bytemuck::{Pod, Zeroable};

use crate::geom::Pose;
use crate::grid::Roi;

/// Metres by which a hit is pushed along the beam before its voxel is looked up.
pub const HIT_PUSH: f32 = crate::grid::HIT_PUSH as f32;
/// Direction components smaller than this count as zero: below a micrometre in a kilometre.
pub const TINY_COMPONENT: f32 = 1e-9;
/// Stands for 1/0 in planes a beam never reaches; finite, as shaders may assume.
pub const NO_CROSSING: f32 = 1e20;
/// Grid coordinates closer to zero than this are zero, so that `NO_CROSSING` keeps its meaning.
const TINY_COORDINATE: f64 = 1e-12;
/// Grid coordinates stay convertible to `i32`.
const MAX_COORDINATE: f64 = 1e9;
/// One sensor as the kernels read it, 64 bytes: in the ego frame, or in an instance's frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct DevicePose {
    /// Rows of the rotation that turns sensor coordinates, each followed by that coordinate of the position (m).
    pub rows: [[f32; 4]; 3],
    /// Position in voxels from the grid's lower corner, and zero; zeros in the frame of an instance.
    pub in_grid: [f32; 4],
}

impl DevicePose {
    /// Rounds each number of a sensor-to-ego transform once.
    pub fn new(pose: &Pose, roi: &Roi) -> Self {
        let (min, voxel) = (roi.min(), roi.voxel());
        let p = [0, 1, 2].map(|k| {
            let p = (pose.translation[k] - min[k]) / voxel[k];
            let p = if p.abs() < TINY_COORDINATE { 0.0 } else { p };
            p.clamp(-MAX_COORDINATE, MAX_COORDINATE) as f32
        });
        Self { in_grid: [p[0], p[1], p[2], 0.0], ..Self::from(pose) }
    }
}

impl From<&Pose> for DevicePose {
    /// Rounds each number once; the sensor is in no grid.
    fn from(Pose { rotation, translation }: &Pose) -> Self {
        let rows = [0, 1, 2].map(|k| {
            let row = rotation.row(k);
            [row.x as f32, row.y as f32, row.z as f32, translation[k] as f32]
        });
        Self { rows, in_grid: [0.0; 4] }
    }
}

/// Ways in which the information of a voxel is counted: the variants of [`Entropy`].
pub const KINDS: usize = 4;

/// Way in which the information of a voxel is counted: the order of every list of [`KINDS`] sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entropy {
    /// All classes told apart.
    Classes,
    /// Detection target against the rest.
    Detection,
    /// Occupied or not.
    Occupancy,
    /// Share that counts for more near the vehicle, for the near gain.
    Near,
}

impl Entropy {
    /// The sum of this kind.
    pub fn of<T: Copy>(self, sums: &[T; KINDS]) -> T {
        sums[self as usize]
    }
}

/// One voxel that is occupied in some frame, 20 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct OccupiedVoxel {
    /// Linear index in the grid.
    pub index: u32,
    /// Fixed-point information by [`Entropy`]: nats, and of the last kind shares of all in a unit of the content's own.
    pub entropy: [u32; KINDS],
}
