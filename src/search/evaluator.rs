use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;

use crate::engine::{Backend, BackendError, CpuBackend, EngineChoice};
use crate::problem::{Problem, Tally};
use crate::score::{Scores, reference_layout, short_sight};
use crate::search::atlas::PageStore;
use crate::vehicle::{Constraints, Placement};

/// Scores placements on one backend.
pub struct Evaluator {
    problem: Arc<Problem>,
    backend: Box<dyn Backend>,
    /// Tallies of the reference layout by number of LiDARs; see [`crate::score::Guard`].
    references: BTreeMap<usize, Tally>,
    /// Placements whose tallies are known.
    known: Vec<(Placement, Tally)>,
    /// The last batch and its scores, where they are kept.
    last: Option<Vec<(Placement, Scores)>>,
    /// Where the atlases of its searches keep their pages.
    store: Option<Arc<PageStore>>,
    /// Wall time spent on scores.
    spent: Duration,
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
        let (references, known, last, store) = (BTreeMap::new(), Vec::new(), None, None);
        let spent = Duration::ZERO;
        Self { problem, backend, references, known, last, store, spent }
    }

    /// Lets searches on a grid keep what each pose covers in a store, and read it from there.
    pub fn keep_pages(&mut self, store: Arc<PageStore>) {
        self.store = Some(store);
    }

    /// The store of [`Self::keep_pages`].
    pub fn page_store(&self) -> Option<&Arc<PageStore>> {
        self.store.as_ref()
    }

    /// Wall time of all scores so far.
    pub fn spent(&self) -> Duration {
        self.spent
    }

    /// Takes tallies over all frames of the problem, which are then not computed again.
    pub fn remember(&mut self, known: Vec<(Placement, Tally)>) {
        self.known.extend(known);
    }

    /// Keeps every batch with its scores until the next one, for [`Self::take_last`].
    pub fn keep_last(&mut self) {
        self.last = Some(Vec::new());
    }

    /// The last batch and its scores; empty when it was taken before, or nothing is kept.
    pub fn take_last(&mut self) -> Vec<(Placement, Scores)> {
        self.last.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// What is scored.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// What is scored, to be shared with an [`crate::search::atlas::Atlas`].
    pub fn shared_problem(&self) -> Arc<Problem> {
        self.problem.clone()
    }

    /// The rules of the mount.
    pub fn constraints(&self) -> &Constraints {
        self.problem.constraints()
    }

    /// What computes.
    pub fn backend(&self) -> &dyn Backend {
        &*self.backend
    }

    /// What computes, to look into single steps.
    pub fn backend_mut(&mut self) -> &mut dyn Backend {
        &mut *self.backend
    }

    /// Scores and guards of each placement, in order.
    ///
    /// # Errors
    /// As [`Backend::tally`].
    pub fn scores(&mut self, placements: &[Placement]) -> Result<Vec<Scores>, BackendError> {
        self.scores_at(placements, self.problem.table().range())
    }

    /// As [`Self::scores`], with beams that end at `range` metres, as in fog; the guards still compare
    /// with a layout that sees all.
    ///
    /// # Errors
    /// As [`Backend::tally`].
    pub fn scores_at(
        &mut self,
        placements: &[Placement],
        range: f32,
    ) -> Result<Vec<Scores>, BackendError> {
        let start = Instant::now();
        for lidars in placements.iter().map(|p| p.lidars.len()) {
            if !self.references.contains_key(&lidars) {
                let layout = reference_layout(self.problem.constraints(), lidars);
                // Seen without limit, so that a placement whose range is cut, by fog say, compares
                // with one that sees all.
                let tally = self.backend.tally(&[layout], self.problem.far_range())?.remove(0);
                self.references.insert(lidars, tally);
            }
        }
        let tallies = self.tallies(placements, range)?;
        let unlimited = self.unlimited_tallies(placements, range)?;
        let scores =
            placements.iter().zip(&tallies).enumerate().map(|(index, (placement, tally))| {
                let mut scores = Scores::new(
                    &placement.name,
                    tally,
                    self.problem.content(),
                    self.problem.frame_count(),
                    self.problem.ends_at_hits(),
                    self.references.get(&placement.lidars.len()),
                );
                let unlimited = unlimited.get(&index);
                scores.guards.extend(unlimited.and_then(|far| short_sight(tally, far)));
                scores
            });
        let scores: Vec<Scores> = scores.collect();
        if let Some(last) = &mut self.last {
            *last = placements.iter().cloned().zip(scores.iter().cloned()).collect();
        }
        self.spent += start.elapsed();
        Ok(scores)
    }

    fn tallies(
        &mut self,
        placements: &[Placement],
        range: f32,
    ) -> Result<Vec<Tally>, BackendError> {
        if self.known.is_empty() || range != self.problem.table().range() {
            return self.backend.tally(placements, range);
        }
        let known = |p: &Placement| self.known.iter().find(|(k, _)| k.lidars == p.lidars);
        let found: Vec<Option<Tally>> =
            placements.iter().map(|p| known(p).map(|(_, tally)| tally.clone())).collect();
        let missing = placements.iter().zip(&found).filter(|(_, found)| found.is_none());
        let missing: Vec<Placement> = missing.map(|(placement, _)| placement.clone()).collect();
        let mut computed = self.backend.tally(&missing, range)?.into_iter();
        Ok(found.into_iter().filter_map(|found| found.or_else(|| computed.next())).collect())
    }

    /// Tallies without a limit of range of those placements that have voxels beyond it, by index.
    fn unlimited_tallies(
        &mut self,
        placements: &[Placement],
        range: f32,
    ) -> Result<BTreeMap<usize, Tally>, BackendError> {
        let roi = self.problem.roi();
        let (min, max) = (DVec3::from(roi.min()), DVec3::from(roi.max()));
        let farthest = |p: &Placement| {
            let reach = p.lidars.iter().map(|l| {
                let position = l.position();
                (position - min).abs().max((position - max).abs()).length()
            });
            reach.fold(0.0, f64::max)
        };
        let limited: Vec<usize> = (0..placements.len())
            .filter(|&index| farthest(&placements[index]) > f64::from(range))
            .collect();
        let chosen: Vec<Placement> = limited.iter().map(|&i| placements[i].clone()).collect();
        let tallies = self.backend.tally(&chosen, self.problem.far_range())?;
        Ok(limited.into_iter().zip(tallies).collect())
    }
}
