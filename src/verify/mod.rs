//! Checks that an engine agrees with the CPU reference to the bit, and that the reference agrees with independent
//! arithmetic in `f64`.

pub(crate) mod compare;
pub(crate) mod oracle;
pub(crate) mod placements;

use std::sync::Arc;

use serde::Serialize;

use crate::engine::{Backend, BackendError, ReferenceBackend};
use crate::problem::Problem;
use crate::vehicle::Placement;

pub(crate) use compare::{Differences, compared_frames};
pub(crate) use oracle::{Agreement, EDGE_TOLERANCE};

use compare::compare_engines;
use oracle::sample_reference;

/// Result of a verification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verification {
    /// Device of the engine that was checked, as reported.
    pub adapter: String,
    /// Placements compared.
    pub placements: usize,
    /// Frames in which each was compared.
    pub frames: usize,
    /// The engine against the CPU reference, bit by bit.
    pub gpu_against_cpu: Differences,
    /// A sample of the reference's beams against every triangle in `f64`.
    pub cpu_against_f64: Agreement,
    /// Metres from an edge within which rounding may decide; see [`EDGE_TOLERANCE`].
    pub edge_tolerance: f64,
    /// Causes of differences between the engine and the reference, a sentence each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<String>,
    /// True if the bits are equal and every other difference is explained.
    pub passed: bool,
}

/// Compares hits, covered voxels and sums of an engine with those of the CPU reference, and `sample`
/// beams of the reference, drawn with `seed`, with brute force in `f64`.
///
/// `done` is called after each placement and frame: `placements.len()` × [`compared_frames`] times.
///
/// # Errors
/// An engine failed.
pub fn verify(
    problem: &Arc<Problem>,
    engine: &mut dyn Backend,
    placements: &[Placement],
    sample: u64,
    seed: u64,
    done: &dyn Fn(),
) -> Result<Verification, BackendError> {
    let mut reference = ReferenceBackend::new(problem.task().clone());
    let found = compare_engines(problem, &mut reference, engine, placements, done)?;
    let explained = sample_reference(problem, placements, sample, seed)?;
    Ok(Verification {
        adapter: engine.adapter().to_owned(),
        placements: placements.len(),
        frames: compared_frames(problem),
        passed: !found.any() && explained.unexplained == 0,
        gpu_against_cpu: found,
        cpu_against_f64: explained,
        edge_tolerance: EDGE_TOLERANCE,
        causes: Vec::new(),
    })
}
