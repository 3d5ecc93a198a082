use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::levels::{Pilot, scatter};
use super::merge_vertices;
use crate::bvh::Bvh;
use crate::engine::CpuBackend;
use crate::engine::{Backend, BackendError};
use crate::problem::Problem;
use crate::scene::{EgoBody, Scene};
use crate::score::Objective;

/// Share of the triangles that may be left for merging to be tried: where more are, casts become no
/// more than a tenth faster.
const MOST_LEFT: f64 = 0.6;
/// Edges of the cells that are tried, as multiples of a voxel's, the coarsest first.
const CELLS: [f64; 2] = [1.0, 0.5];

/// What merging triangles that are small beside a voxel does, as a pilot's placements see it.
///
/// Whether it is used is decided by counts and scores alone, not by a clock, so that a run repeats
/// itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Merging {
    /// Edge in metres of the cells within which vertices are merged; see [`merge_vertices`].
    pub cell: f64,
    /// Triangles of a frame.
    pub triangles: u64,
    /// Those that are left.
    pub merged: u64,
    /// Error of the ranking, as [`super::Level::error`] has it, against every triangle in the same
    /// frames; `None` where too many are left for it to be measured.
    pub error: Option<f64>,
    /// Whether a search goes by it: few enough are left, and the error is within what is allowed.
    pub used: bool,
}

impl Merging {
    /// Counts what merging leaves of the first frame, with the coarsest cells; `None` where beams meet
    /// no triangles.
    pub fn count(whole: &Problem, scene: &Scene) -> Option<Self> {
        if !whole.ends_at_hits() {
            return None;
        }
        let soup = scene.frame(0, EgoBody::Include);
        let cell = CELLS[0] * edge(whole);
        let merged = merge_vertices(&soup, cell).faces.len() as u64;
        let triangles = soup.faces.len() as u64;
        Some(Self { cell, triangles, merged, error: None, used: false })
    }

    /// Whether few enough triangles are left.
    pub fn may_save(&self) -> bool {
        self.merged as f64 <= MOST_LEFT * self.triangles as f64
    }

    /// Scores the pilot's placements over `frames` with merged triangles, with finer cells where the
    /// error is above `tolerance`; returns the placements × frames scored.
    ///
    /// # Errors
    /// One placement does not fit into `memory` bytes.
    pub fn measure(
        &mut self,
        pilot: &Pilot,
        scene: &Scene,
        frames: &[usize],
        objective: &Objective,
        tolerance: f64,
        memory: u64,
    ) -> Result<u64, BackendError> {
        let mut work = 0;
        let reference = pilot.values(objective, frames);
        for cell in CELLS.map(|cell| cell * edge(pilot.problem())) {
            if self.used || !self.may_save() {
                break;
            }
            let problem = Arc::new(merged_over(pilot.problem(), scene, frames, cell));
            let mut backend = CpuBackend::new(problem.clone(), memory);
            let tallies = backend.tally(pilot.placements(), problem.table().range())?;
            let value = |tally| objective.value_of_tally(tally, problem.content(), frames.len());
            let values = tallies.iter().map(value).collect();
            work += (tallies.len() * frames.len()) as u64;
            (self.cell, self.merged) = (cell, problem.modelled().triangles);
            self.error = scatter(&reference, values);
            self.used = self.may_save() && self.error.is_some_and(|error| error <= tolerance);
        }
        Ok(work)
    }

    /// What was found, in words.
    pub fn words(&self) -> String {
        let Self { cell, triangles, merged, .. } = self;
        let counts =
            format!("{merged} of {triangles} triangles are left when merged within {cell} m");
        let error =
            self.error.map_or(String::new(), |e| format!(" with an error of {:.2} %", 100.0 * e));
        match (self.may_save(), self.used) {
            (false, _) => format!("every triangle: {counts}{error}, too many to save time"),
            (true, false) => format!("every triangle: {counts}{error}, which is too much"),
            (true, true) => format!("{counts}{error}"),
        }
    }
}

/// Least edge of a voxel.
fn edge(problem: &Problem) -> f64 {
    problem.roi().voxel().into_iter().fold(f64::INFINITY, f64::min)
}

/// The problem over some frames of `whole`, which is over all frames of the scene, with vertices merged
/// within cells of edge `cell` metres.
///
/// # Panics
/// A frame that does not exist.
pub fn merged_over(whole: &Problem, scene: &Scene, frames: &[usize], cell: f64) -> Problem {
    let mut distinct: Vec<usize> = frames.iter().map(|&t| whole.twin(t)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    let tree = |&t: &usize| {
        let soup = merge_vertices(&scene.frame(t, EgoBody::Include), cell);
        Arc::new(Bvh::build(&soup, whole.far_range()))
    };
    let trees: Vec<Arc<Bvh>> = distinct.par_iter().map(tree).collect();
    let of = |&t: &usize| distinct.partition_point(|&d| d < whole.twin(t));
    whole.with_trees(frames.iter().map(|t| trees[of(t)].clone()).collect())
}
