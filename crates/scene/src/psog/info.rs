//! Sums of a P-SOG, for people and for JSON.

use serde::Serialize;

use super::{BuildReport, EntropyKind, EntropyTable, Psog};

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
