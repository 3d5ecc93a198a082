//! Sums that a placement is scored by, and the time they took.

use std::ops::{AddAssign, SubAssign};
use std::time::Duration;

use super::KINDS;

/// Integer sums over the covered voxels of one placement, added up over frames.
///
/// Entropies are fixed-point numbers, in the unit of the caller.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tally {
    /// Covered voxels.
    pub covered: u64,
    /// Covered voxels that are occupied in at least one frame of the P-SOG.
    pub covered_nonzero: u64,
    /// Σ of the information of covered voxels, by kind, in the units of [`super::OccupiedVoxel::entropy`].
    pub entropy: [u64; KINDS],
    /// Covered voxels in which a class occurs in at least one frame, by class id; then covered voxels by area.
    pub by_class: Vec<u64>,
    /// Σ H (all classes) over the voxels that only this LiDAR covers, by LiDAR.
    pub unique: Vec<u64>,
    /// Beams that hit a surface.
    pub hits: u64,
    /// Beams cast.
    pub beams: u64,
}

impl Tally {
    /// All sums zero, for a scene of `classes` classes and a placement of `lidars` LiDARs.
    pub fn zero(classes: usize, lidars: usize) -> Self {
        Self { by_class: vec![0; classes], unique: vec![0; lidars], ..Self::default() }
    }

    /// Adds the sums of a frame that stands for `times` equal ones.
    pub fn add_times(&mut self, other: &Self, times: u64) {
        self.covered += times * other.covered;
        self.covered_nonzero += times * other.covered_nonzero;
        for (sum, value) in self.entropy.iter_mut().zip(other.entropy) {
            *sum += times * value;
        }
        for (sum, value) in self.by_class.iter_mut().zip(&other.by_class) {
            *sum += times * value;
        }
        for (sum, value) in self.unique.iter_mut().zip(&other.unique) {
            *sum += times * value;
        }
        self.hits += times * other.hits;
        self.beams += times * other.beams;
    }
}

impl AddAssign<&Self> for Tally {
    fn add_assign(&mut self, other: &Self) {
        self.add_times(other, 1);
    }
}

impl SubAssign<&Self> for Tally {
    /// Takes the sums of a frame out again that were added before.
    fn sub_assign(&mut self, other: &Self) {
        self.covered -= other.covered;
        self.covered_nonzero -= other.covered_nonzero;
        self.entropy.iter_mut().zip(other.entropy).for_each(|(sum, value)| *sum -= value);
        self.by_class.iter_mut().zip(&other.by_class).for_each(|(sum, value)| *sum -= value);
        self.unique.iter_mut().zip(&other.unique).for_each(|(sum, value)| *sum -= value);
        self.hits -= other.hits;
        self.beams -= other.beams;
    }
}

/// Wall time of each stage.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Finding the closest hits.
    pub cast: Duration,
    /// Walking the beams through the voxels.
    pub cover: Duration,
    /// Summing over the covered voxels.
    pub reduce: Duration,
}

impl AddAssign for StageTimes {
    fn add_assign(&mut self, other: Self) {
        self.cast += other.cast;
        self.cover += other.cover;
        self.reduce += other.reduce;
    }
}
