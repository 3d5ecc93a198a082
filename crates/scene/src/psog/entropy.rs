//! Entropy of voxels in nats and in fixed point, and sums of a P-SOG for people and for JSON.

use rayon::prelude::*;
use serde::Serialize;

use super::{BuildReport, Psog};
use lidar_cast::maths;

/// One nat in fixed point.
///
/// Entropies are summed as integers, so that no order of addition matters. The largest entropy,
/// ln(65 536 classes with empty), is below 2³² in this unit.
pub const ENTROPY_ONE: f64 = (1u64 << 28) as f64;

/// An entropy in nats as a fixed-point number: round(h · [`ENTROPY_ONE`]).
pub fn fixed(h: f64) -> u32 {
    (h * ENTROPY_ONE).round() as u32
}

/// A sum of fixed-point entropies in nats.
pub fn to_nats(sum: u64) -> f64 {
    sum as f64 / ENTROPY_ONE
}

/// Which outcomes of a voxel are told apart; empty always is an outcome of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum EntropyKind {
    /// Every class for itself.
    Segmentation,
    /// The target class against all other classes merged (Place3D, detection).
    Detection {
        /// Class id of the target.
        target: u16,
    },
    /// Occupied or not (Hu et al., CVPR 2022).
    Bernoulli,
}

/// The terms −p ln p for p = 0/T, 1/T, …, T/T, in nats.
#[derive(Debug, Clone)]
pub struct EntropyTable {
    frames: u32,
    terms: Vec<f64>,
}

impl EntropyTable {
    /// The terms for T = `frames`, which must not be 0.
    pub fn new(frames: u32) -> Self {
        let terms = (0..=frames.min(u32::from(u16::MAX))).map(|n| term(n, frames)).collect();
        Self { frames, terms }
    }

    /// −p ln p for p = n/T; 0 at n = 0 and n = T.
    pub(super) fn term(&self, n: u32) -> f64 {
        self.terms.get(n as usize).copied().unwrap_or_else(|| term(n, self.frames))
    }

    /// Entropy in nats of a voxel with these frame counts `[M]`, whose sum is at most T:
    /// H = −Σ_c p̂_c ln p̂_c − p̂_∅ ln p̂_∅ with p̂_∅ = (T − Σ)/T, classes first, empty last.
    pub fn entropy(&self, row: &[u16], kind: EntropyKind) -> f64 {
        let occupied: u32 = row.iter().map(|&c| u32::from(c)).sum();
        let classes: f64 = match kind {
            EntropyKind::Segmentation => row.iter().map(|&c| self.term(u32::from(c))).sum(),
            EntropyKind::Detection { target } => {
                let target = row.get(usize::from(target)).map_or(0, |&c| u32::from(c));
                return self.entropy_of_two(target, occupied - target);
            }
            EntropyKind::Bernoulli => self.term(occupied),
        };
        classes + self.term(self.frames - occupied)
    }

    /// Entropy in nats of a voxel that one class holds in `one` frames and another in `other` frames, together
    /// at most T.
    pub(crate) fn entropy_of_two(&self, one: u32, other: u32) -> f64 {
        self.term(one) + self.term(other) + self.term(self.frames - one - other)
    }
}

fn term(n: u32, frames: u32) -> f64 {
    if n == 0 || n >= frames {
        return 0.0;
    }
    let p = f64::from(n) / f64::from(frames);
    -p * maths::ln(p)
}

impl Psog {
    /// Entropies `[K]` of the listed voxels in fixed point, in the order of [`Psog::index`]; every
    /// other voxel has entropy 0.
    pub fn entropies(&self, kind: EntropyKind) -> Vec<u32> {
        let table = EntropyTable::new(self.frames());
        self.counts()
            .par_chunks_exact(self.classes().len())
            .with_min_len(4096)
            .map(|row| fixed(table.entropy(row, kind)))
            .collect()
    }

    /// Entropy of the whole grid in nats: the exact sum of its fixed-point entropies.
    pub fn entropy_total(&self, kind: EntropyKind) -> f64 {
        to_nats(self.entropies(kind).into_iter().map(u64::from).sum())
    }

    /// The class that detection entropy is about: `car`, else `vehicle`, if there is one.
    pub fn detection_target(&self) -> Option<u16> {
        self.class_id("car").or_else(|| self.class_id("vehicle"))
    }
}

/// Sums of a P-SOG, printed or written as JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PsogInfo {
    /// Lower corner, metres.
    pub min: [f64; 3],
    /// Upper corner, metres.
    pub max: [f64; 3],
    /// Edges of a voxel, metres.
    pub voxel: [f64; 3],
    /// Voxels along x, y, z.
    pub shape: [u32; 3],
    /// Voxels of the grid.
    pub voxels: u64,
    /// Frames T.
    pub frames: u32,
    /// Voxels that have a class in at least one frame.
    pub occupied: u64,
    /// Voxels whose entropy is above 0: not the same in all frames.
    pub informative: u64,
    /// Entropy of the grid in nats, every class for itself.
    pub entropy_segmentation: f64,
    /// Entropy of the grid in nats, target class against all others; `None` without a target.
    pub entropy_detection: Option<f64>,
    /// Name of the target class.
    pub detection_target: Option<String>,
    /// Entropy of the grid in nats, occupied or not.
    pub entropy_bernoulli: f64,
    /// The part of each class in the segmentation entropy, in class order.
    pub classes: Vec<ClassEntropy>,
    /// The part of empty, Σ −p̂_∅ ln p̂_∅, in nats.
    pub entropy_empty: f64,
    /// Bytes of the indices and counts in memory.
    pub memory_bytes: u64,
    /// Share of voted voxels that were ties; known only where the P-SOG was just built.
    pub tie_share: Option<f64>,
}

/// Voxels and entropy of one class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassEntropy {
    /// Class name.
    pub name: String,
    /// Voxels that have the class in at least one frame.
    pub voxels: u64,
    /// Σ −p̂_c ln p̂_c over all voxels, in nats.
    pub entropy: f64,
}

impl PsogInfo {
    /// Sums up a P-SOG; `report` says how the vote went, if it was built just now.
    pub fn new(psog: &Psog, report: Option<&BuildReport>) -> Self {
        let (roi, frames) = (psog.roi(), psog.frames());
        let table = EntropyTable::new(frames);
        let mut classes: Vec<ClassEntropy> = psog
            .classes()
            .iter()
            .map(|name| ClassEntropy { name: name.clone(), voxels: 0, entropy: 0.0 })
            .collect();
        let (mut occupied, mut informative, mut entropy_empty) = (0, 0, 0.0);
        for row in psog.rows() {
            let mut sum = 0;
            for (class, &count) in classes.iter_mut().zip(row).filter(|(_, c)| **c > 0) {
                class.voxels += 1;
                class.entropy += table.term(count.into());
                sum += u32::from(count);
            }
            occupied += u64::from(sum > 0);
            informative += u64::from(sum > 0 && row.iter().all(|&c| u32::from(c) != frames));
            entropy_empty += table.term(frames - sum);
        }
        let target = psog.detection_target();
        Self {
            min: roi.min(),
            max: roi.max(),
            voxel: roi.voxel(),
            shape: roi.shape(),
            voxels: roi.voxel_count(),
            frames,
            occupied,
            informative,
            entropy_segmentation: psog.entropy_total(EntropyKind::Segmentation),
            entropy_detection: target
                .map(|target| psog.entropy_total(EntropyKind::Detection { target })),
            detection_target: target.map(|t| psog.classes()[usize::from(t)].clone()),
            entropy_bernoulli: psog.entropy_total(EntropyKind::Bernoulli),
            classes,
            entropy_empty,
            memory_bytes: psog.memory_bytes(),
            tie_share: report.map(BuildReport::tie_share),
        }
    }
}
