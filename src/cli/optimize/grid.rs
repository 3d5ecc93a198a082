//! What `optimize` does on a grid of sensor poses: swaps, and bounds on the best placement there.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sightline::chart::candidates;
use sightline::problem::Problem;
use sightline::score::Objective;
use sightline::search::atlas::Atlas;
use sightline::search::{
    Evaluator, GainBound, GridPlacement, GridSample, GridSearch, Moves, SWAP_SPACING, SwapSettings,
    Swapped, bound_gain, swap_from,
};
use sightline::vehicle::{Placement, PoseGrid, Spacing};

use crate::cli::args::Compute;
use crate::cli::error::Error;
use crate::cli::interrupt::Interrupt;
use crate::cli::progress;

/// Grid of the bound where nothing else is said: every pose of it is cast.
const COARSE_SPACING: Spacing = Spacing { metres: 0.2, radians: 0.2 };
/// Sets of sensors that branch and bound looks at.
const BOUND_NODES: u64 = 200;
/// Pairs of placements sampled for the constants of the paper's bound and for the findings.
const SAMPLES: usize = 24;
/// Random placements of which the best is a start of the swaps where greedy has no place.
const DRAWN: usize = 64;

/// How placements are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Method {
    /// CMA-ES, then swaps from its result; the better one wins
    Both,
    /// CMA-ES alone
    Cma,
    /// Greedy and swaps over every pose of the grid
    Swaps,
}

/// What bounds are known, before the result is.
pub(super) struct Bounds {
    pub sample: GridSample,
    pub gain: Result<GainBound, String>,
}

/// The search on a grid over an evaluator's frames.
pub(super) struct GridStage<'a> {
    pub evaluator: &'a mut Evaluator,
    pub objective: &'a Objective,
    pub compute: &'a Compute,
    pub interrupt: &'a Interrupt,
}

impl GridStage<'_> {
    fn search(&self, spacing: Spacing) -> Result<GridSearch, Error> {
        let grid = PoseGrid::new(self.evaluator.constraints(), spacing)?;
        let problem: Arc<Problem> = self.evaluator.shared_problem();
        let counts_all = self.objective.counts_all_covered();
        let atlas = Atlas::new(problem, grid, counts_all, self.compute.memory_budget() / 2);
        Ok(GridSearch::new(atlas, self.objective.clone(), self.evaluator))
    }

    /// Swaps near each start, then from random moves of the best; `casts` bounds the poses cast.
    pub fn climb(
        &mut self,
        spacing: Spacing,
        starts: &[Placement],
        casts: u64,
        seed: u64,
    ) -> Result<Option<Swapped>, Error> {
        let memory = self.compute.memory_budget() / 2;
        let settings = SwapSettings { spacing, casts, memory, seed };
        let bar = progress::bar(casts, "poses for swaps", self.compute.talk);
        let go_on = |cast: u64| {
            bar.set_position(cast.min(casts));
            !self.interrupt.is_set()
        };
        let (evaluator, objective) = (&mut *self.evaluator, self.objective);
        let swapped = swap_from(evaluator, objective, &settings, starts, &go_on)?;
        bar.finish_and_clear();
        Ok(swapped)
    }

    /// Greedy over every pose of the grid, and swaps to any pose from there and from each start. Where
    /// rules tie the LiDARs together the best of some random placements stands in for greedy.
    pub fn everywhere(
        &mut self,
        spacing: Spacing,
        starts: &[Placement],
        seed: u64,
    ) -> Result<Option<Swapped>, Error> {
        let mut search = self.search(spacing)?;
        let constraints = self.evaluator.constraints().clone();
        let mut first: Vec<Vec<u32>> = Vec::new();
        if constraints.ties.any() {
            // One LiDAR after another does not keep the ties: the best of random placements instead.
            let drawn = candidates(&constraints, &[], DRAWN, seed);
            let drawn = drawn.iter().filter_map(|p| search.start_of(p));
            let mut best: Option<GridPlacement> = None;
            for poses in drawn.collect::<Vec<_>>() {
                let value = search.value(self.evaluator, &poses)?;
                let drawn = GridPlacement { poses, value };
                best = Some(match best {
                    Some(best) => search.preferred(self.evaluator, best, drawn)?,
                    None => drawn,
                });
            }
            first.extend(best.map(|best| best.poses));
        } else {
            let poses = search.atlas().grid().len();
            self.compute.talk.note(format!("casting {poses} sensor poses on the grid"));
            let all: Vec<u32> = (0..poses).collect();
            first.extend(search.greedy(self.evaluator, &all)?.map(|greedy| greedy.poses));
        }
        first.extend(starts.iter().filter_map(|start| search.start_of(start)));
        let mut best = None;
        let mut ends = Vec::new();
        let interrupt = self.interrupt.clone();
        for start in first {
            let top =
                search.climb(self.evaluator, &start, Moves::Anywhere, &|_| !interrupt.is_set())?;
            ends.push(top.clone());
            best = Some(match best {
                Some(best) => search.preferred(self.evaluator, best, top)?,
                None => top,
            });
        }
        Ok(best.map(|best| Swapped::new(&search, &best, ends)))
    }

    /// Both bounds; that on the grid for information gain only.
    pub fn bounds(&mut self, spacing: Option<Spacing>, seed: u64) -> Result<Bounds, Error> {
        let grid = PoseGrid::new(self.evaluator.constraints(), spacing.unwrap_or(SWAP_SPACING))?;
        let sample = GridSample::draw(self.evaluator, &grid, self.objective, SAMPLES, seed)?;
        Ok(Bounds { sample, gain: self.bound_gain(spacing.unwrap_or(COARSE_SPACING))? })
    }

    fn bound_gain(&mut self, spacing: Spacing) -> Result<Result<GainBound, String>, Error> {
        if !self.objective.is_information_gain() {
            return Ok(Err(format!(
                "no bound is known for `{}`: only the information gain is submodular in the set of \
                 sensors",
                self.objective
            )));
        }
        if self.interrupt.is_set() {
            return Ok(Err("no bound was computed: the time was over before".into()));
        }
        let mut search = self.search(spacing)?;
        search.untie();
        let atlas = search.atlas();
        let poses = atlas.grid().len();
        if poses as usize > atlas.capacity() {
            return Ok(Err(format!(
                "no bound was computed: the {poses} sensor poses of the grid take {} MiB, more than \
                 half of --memory; widen --delta",
                (poses as usize * atlas.page_bytes()) >> 20
            )));
        }
        self.compute.talk.note(format!("bounding the gain over {poses} sensor poses"));
        let all: Vec<u32> = (0..poses).collect();
        let Some(greedy) = search.greedy(self.evaluator, &all)? else {
            return Ok(Err("no placement on the grid keeps the distance asked for".into()));
        };
        let interrupt = self.interrupt.clone();
        let top = search
            .climb(self.evaluator, &greedy.poses, Moves::Anywhere, &|_| !interrupt.is_set())?;
        let bound =
            bound_gain(&mut search, self.evaluator, &top, BOUND_NODES, &|| !interrupt.is_set())?;
        Ok(Ok(bound))
    }
}

/// `--delta`: metres, and radians where they differ, as `0.1` or `0.2,0.1`.
pub(super) fn parse_spacing(text: &str) -> Result<Spacing, String> {
    let (metres, radians) = text.split_once(',').unwrap_or((text, text));
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is no spacing; write metres and radians, as 0.1 or 0.2,0.1")),
    };
    Ok(Spacing { metres: number(metres)?, radians: number(radians)? })
}
