//! Scores of placements: one problem, one engine, and the reference layouts that the guards compare with.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::DVec3;

use crate::engine::{Backend, BackendError, CpuBackend, EngineChoice};
use crate::problem::{Problem, Tally};
use crate::score::{Scores, reference_layout, short_sight};
use crate::vehicle::{Constraints, Placement, SensorName, SensorPose};

/// Scores placements on one engine.
pub struct Evaluator {
    problem: Arc<Problem>,
    backend: Box<dyn Backend>,
    /// Tallies of the reference layout by number of LiDARs; see [`crate::score::Guard`].
    references: BTreeMap<Vec<SensorName>, Tally>,
}

impl Evaluator {
    /// An evaluator on the CPU, with half of the free memory for work buffers.
    pub fn on_cpu(problem: impl Into<Arc<Problem>>) -> Self {
        let problem = problem.into();
        let memory = EngineChoice::cpu().memory_budget();
        let engine = Box::new(CpuBackend::new(problem.clone(), memory));
        Self::new(problem, engine)
    }

    /// An evaluator of a problem; its mount decides where the reference layout of the guards stands.
    pub fn new(problem: Arc<Problem>, backend: Box<dyn Backend>) -> Self {
        Self { problem, backend, references: BTreeMap::new() }
    }

    /// An evaluator on the host processor, within half of the free memory.
    pub fn cpu(problem: impl Into<Arc<Problem>>) -> Self {
        let problem = problem.into();
        let memory = EngineChoice::cpu().memory_budget();
        Self::new(problem.clone(), Box::new(CpuBackend::new(problem, memory)))
    }

    /// The problem.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The problem, to be shared.
    pub fn shared_problem(&self) -> Arc<Problem> {
        self.problem.clone()
    }

    /// The rules of the mount.
    pub fn constraints(&self) -> &Constraints {
        self.problem.constraints()
    }

    /// The engine.
    pub fn backend(&self) -> &dyn Backend {
        &*self.backend
    }

    /// The engine, for single stages.
    pub fn backend_mut(&mut self) -> &mut dyn Backend {
        &mut *self.backend
    }

    /// Linear indices of the voxels that a placement covers in any frame, rising.
    ///
    /// # Errors
    /// As [`Backend::covered`].
    pub fn covered(&mut self, placement: &Placement) -> Result<Vec<u64>, BackendError> {
        let mut union = BTreeSet::new();
        let frames = self.problem.frame_count();
        let mut covered = Vec::new();
        for frame in 0..frames {
            covered = self.backend.covered(placement, frame)?;
            if frames > 1 {
                union.extend(covered.iter().copied());
            }
        }
        Ok(if frames > 1 { union.into_iter().collect() } else { covered })
    }

    /// Scores and guards of each placement, in order.
    ///
    /// # Errors
    /// As [`Backend::tally`].
    pub fn scores(&mut self, placements: &[Placement]) -> Result<Vec<Scores>, BackendError> {
        self.scores_at(placements, None)
    }

    /// As [`Self::scores`], with beams that end at `range` metres, as in fog; the guards still compare
    /// with a layout that sees all.
    ///
    /// # Errors
    /// As [`Backend::tally`].
    pub fn scores_at(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Scores>, BackendError> {
        let tallies = self.backend.tally(placements, range)?;
        self.scores_from(placements, &tallies, range)
    }

    /// Scores and guards of placements whose tallies over all frames, with beams of `range` metres, are
    /// known.
    ///
    /// # Errors
    /// As [`Backend::tally`].
    pub(crate) fn scores_from(
        &mut self,
        placements: &[Placement],
        tallies: &[Tally],
        range: Option<f32>,
    ) -> Result<Vec<Scores>, BackendError> {
        for models in placements.iter().map(models_of) {
            if !self.references.contains_key(&models) {
                let layout = reference_layout(self.problem.constraints(), &models);
                // With unlimited range, so that a placement whose range is cut, by fog say, compares
                // with a layout that sees all.
                let tally =
                    self.backend.tally(&[layout], Some(self.problem.far_range()))?.remove(0);
                self.references.insert(models, tally);
            }
        }
        let unlimited = self.unlimited_tallies(placements, range)?;
        let scores = placements.iter().zip(tallies).enumerate();
        let scores = scores.map(|(index, (placement, tally))| {
            let mut scores = Scores::new(
                &placement.name,
                tally,
                self.problem.content(),
                self.problem.frame_count(),
                self.problem.ends_at_hits(),
                self.references.get(&models_of(placement)),
            );
            let unlimited = unlimited.get(&index);
            scores.guards.extend(unlimited.and_then(|far| short_sight(tally, far)));
            scores
        });
        Ok(scores.collect())
    }

    /// Tallies without a limit of range, by index, of the placements that have voxels beyond it.
    fn unlimited_tallies(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<BTreeMap<usize, Tally>, BackendError> {
        let roi = self.problem.roi();
        let (min, max) = (DVec3::from(roi.min()), DVec3::from(roi.max()));
        let sensors = self.problem.sensors();
        let is_limited = |pose: &SensorPose| {
            let position = pose.position();
            let farthest = (position - min).abs().max((position - max).abs()).length();
            let own = sensors.number(pose).map(|model| sensors.table(model).range());
            own.is_ok_and(|own| farthest > f64::from(range.unwrap_or(own)))
        };
        let limited: Vec<usize> = (0..placements.len())
            .filter(|&p| placements[p].lidars.iter().any(is_limited))
            .collect();
        let chosen: Vec<Placement> = limited.iter().map(|&i| placements[i].clone()).collect();
        let tallies = self.backend.tally(&chosen, Some(self.problem.far_range()))?;
        Ok(limited.into_iter().zip(tallies).collect())
    }
}

/// Names of the models of a placement's sensors, sorted.
fn models_of(placement: &Placement) -> Vec<SensorName> {
    let mut models: Vec<SensorName> = placement.lidars.iter().map(|pose| pose.sensor).collect();
    models.sort_unstable();
    models
}
