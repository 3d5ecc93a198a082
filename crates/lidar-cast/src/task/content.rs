//! Voxel information (entropies and classes of occupied voxels, areas with a required coverage), and the sums over it
//! that a placement is scored by, with the time they took.

use std::ops::{AddAssign, SubAssign};
use std::time::Duration;

use super::{KINDS, OccupiedVoxel, REPEATS};
use crate::grid::Roi;

/// A part of space around the vehicle with a required coverage.
#[derive(Debug, Clone, PartialEq)]
pub struct Requirement {
    /// Name on the vehicle.
    pub name: String,
    /// Lower and upper corner in the ego frame, metres.
    pub inside: [[f64; 3]; 2],
    /// Boxes that do not belong to it, such as the vehicle itself.
    pub without: Vec<[[f64; 3]; 2]>,
    /// Least share of its voxels that beams pass, from 0 to 1, a mean over frames.
    pub share: f64,
}

impl Requirement {
    /// A copy mirrored at the plane y = 0.
    pub fn mirrored(&self) -> Self {
        let image =
            |[low, high]: &[[f64; 3]; 2]| [[low[0], -high[1], low[2]], [high[0], -low[1], high[2]]];
        let without = self.without.iter().map(image).collect();
        Self { inside: image(&self.inside), without, ..self.clone() }
    }

    /// True if a point belongs to the area.
    pub fn contains(&self, point: [f64; 3]) -> bool {
        let within =
            |[low, high]: &[[f64; 3]; 2]| (0..3).all(|k| low[k] <= point[k] && point[k] < high[k]);
        within(&self.inside) && !self.without.iter().any(within)
    }
}

/// A required area and its number of voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct RequiredArea {
    /// Requirement from the vehicle file.
    pub required: Requirement,
    /// Number of its voxels.
    pub voxels: u64,
}

/// Information in the voxels: occupied voxels of a P-SOG with their entropies and classes.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    classes: Vec<String>,
    occupied: Vec<OccupiedVoxel>,
    /// Linear indices, class after class, then area after area.
    pub(crate) class_voxels: Vec<u32>,
    /// Where each class begins in `class_voxels`, then each area, and the end.
    pub(crate) class_starts: Vec<u32>,
    areas: Vec<RequiredArea>,
    entropy_total: [u64; KINDS],
    has_detection: bool,
}

impl Content {
    /// From occupied voxels in rising order and, for each class, the voxels in which it occurs.
    pub fn new(
        classes: Vec<String>,
        occupied: Vec<OccupiedVoxel>,
        voxels_by_class: &[Vec<u32>],
        has_detection: bool,
    ) -> Self {
        let mut class_starts = vec![0];
        for voxels in voxels_by_class {
            class_starts.push(class_starts[class_starts.len() - 1] + voxels.len() as u32);
        }
        let mut entropy_total = [0; KINDS];
        for voxel in &occupied {
            for (sum, entropy) in entropy_total.iter_mut().zip(voxel.entropy) {
                *sum += u64::from(entropy);
            }
        }
        let class_voxels = voxels_by_class.concat();
        let areas = Vec::new();
        Self { classes, occupied, class_voxels, class_starts, areas, entropy_total, has_detection }
    }

    /// Takes all required areas away.
    pub(super) fn without_areas(mut self) -> Self {
        self.class_starts.truncate(self.classes.len() + 1);
        self.class_voxels.truncate(self.class_starts[self.classes.len()] as usize);
        self.areas.clear();
        self
    }

    /// Adds required areas: each is the set of voxels whose centres lie in it.
    pub fn with_areas(mut self, roi: &Roi, required: &[Requirement]) -> Self {
        let ([_, ny, nz], min, voxel) = (roi.shape(), roi.min(), roi.voxel());
        let middle = |k: usize, i: u32| min[k] + (f64::from(i) + 0.5) * voxel[k];
        for requirement in required {
            let before = self.class_voxels.len();
            let [low, high] = requirement.inside;
            let [xs, ys, zs] = [0, 1, 2].map(|k| {
                let within = |i: &u32| (low[k]..high[k]).contains(&middle(k, *i));
                (0..roi.shape()[k]).filter(within).collect::<Vec<u32>>()
            });
            for &i in &xs {
                for &j in &ys {
                    let column = zs.iter().filter(|&&k| {
                        requirement.contains([middle(0, i), middle(1, j), middle(2, k)])
                    });
                    self.class_voxels.extend(column.map(|&k| (i * ny + j) * nz + k));
                }
            }
            let voxels = (self.class_voxels.len() - before) as u64;
            self.areas.push(RequiredArea { required: requirement.clone(), voxels });
            self.class_starts.push(self.class_voxels.len() as u32);
        }
        self
    }

    /// Areas with a required coverage.
    pub fn areas(&self) -> &[RequiredArea] {
        &self.areas
    }

    /// Sets of voxels whose covered ones are counted: classes, then areas.
    pub fn set_count(&self) -> usize {
        self.class_starts.len() - 1
    }

    /// Class names by class id.
    pub fn classes(&self) -> &[String] {
        &self.classes
    }

    /// Voxels occupied in at least one frame, in rising order.
    pub fn occupied(&self) -> &[OccupiedVoxel] {
        &self.occupied
    }

    /// Linear indices of the voxels in which a class occurs in at least one frame, rising. Ids past the
    /// classes name areas.
    pub fn voxels_of_class(&self, class: usize) -> &[u32] {
        let range = self.class_starts[class] as usize..self.class_starts[class + 1] as usize;
        &self.class_voxels[range]
    }

    /// Σ of the information of all voxels, by kind, in the units of [`OccupiedVoxel::entropy`].
    pub fn entropy_total(&self) -> [u64; KINDS] {
        self.entropy_total
    }

    /// True if any class counts as detection target.
    pub fn has_detection(&self) -> bool {
        self.has_detection
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        (size_of_val(self.occupied.as_slice()) + size_of_val(self.class_voxels.as_slice())) as u64
    }
}

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
    /// Σ of the information of kind [`super::Entropy::Near`] over the voxels that at least two, and at least three, LiDARs
    /// cover.
    pub near_repeated: [u64; REPEATS],
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
    pub(crate) fn add_times(&mut self, other: &Self, times: u64) {
        self.change(other, |sum, value| *sum += times * value);
    }

    /// Changes each sum by its counterpart.
    fn change(&mut self, other: &Self, by: impl Fn(&mut u64, u64)) {
        by(&mut self.covered, other.covered);
        by(&mut self.covered_nonzero, other.covered_nonzero);
        by(&mut self.hits, other.hits);
        by(&mut self.beams, other.beams);
        let each = |sums: &mut [u64], values: &[u64]| {
            sums.iter_mut().zip(values).for_each(|(sum, &value)| by(sum, value));
        };
        each(&mut self.entropy, &other.entropy);
        each(&mut self.near_repeated, &other.near_repeated);
        each(&mut self.by_class, &other.by_class);
        each(&mut self.unique, &other.unique);
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
        self.change(other, |sum, value| *sum -= value);
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
