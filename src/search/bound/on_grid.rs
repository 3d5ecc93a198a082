//! Both bounds of a run, before its result is known.

use serde::{Deserialize, Serialize};

use super::branch_and_bound::{Effort, GainBound, bound_gain};
use super::sample::GridSample;
use crate::search::atlases::Atlases;
use crate::search::climb::Moves;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::GridSearch;
use crate::search::observer::{Event, Watch, Work};
use crate::search::settings::Settings;
use crate::search::swaps::SWAP_SPACING;
use crate::vehicle::{Constraints, PoseGrid, Spacing};

/// Grid of the bound on the gain where nothing else is said: every pose of it is cast.
const COARSE_SPACING: Spacing = Spacing { metres: 0.2, radians: 0.2 };
/// Factor by which that grid is widened until its poses are no more than the swaps cast.
const WIDER: f64 = 1.5;
/// Poses of a grid that needs no widening, whatever the swaps cast.
const FEW_POSES: u64 = 100;
/// Pairs of placements sampled for the constants of the paper's bound and for the findings.
const SAMPLES: usize = 24;

/// What is known of all placements on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::search) struct Bounds {
    pub sample: GridSample,
    /// The bound on the gain, or why there is none.
    pub gain: Result<GainBound, String>,
}

/// Samples the grid and bounds the gain over all placements on it, within about `memory` bytes.
///
/// # Errors
/// A spacing that gives no grid, or from the engine.
pub(in crate::search) fn bounds(
    evaluator: &mut Evaluator,
    settings: &Settings,
    memory: u64,
    watch: &mut Watch,
) -> Result<Bounds, SearchError> {
    let spacing = settings.delta.unwrap_or(SWAP_SPACING);
    let grid = PoseGrid::new(evaluator.constraints(), spacing)?;
    let (objective, seed) = (&settings.objective, settings.seed);
    let sample = GridSample::draw(evaluator, &grid, objective, SAMPLES, seed)?;
    Ok(Bounds { sample, gain: gain(evaluator, settings, memory, watch)? })
}

/// The bound on the gain, or why there is none.
fn gain(
    evaluator: &mut Evaluator,
    settings: &Settings,
    memory: u64,
    watch: &mut Watch,
) -> Result<Result<GainBound, String>, SearchError> {
    let objective = &settings.objective;
    if !objective.is_information_gain() {
        return Ok(Err(format!(
            "no bound is known for `{objective}`: only the information gain is submodular in the set of \
             sensors"
        )));
    }
    if watch.is_over() {
        return Ok(Err("no bound was computed: the time was over before".into()));
    }
    let grid = grid(evaluator.constraints(), settings)?;
    let poses = grid.len();
    let counts_all = objective.counts_all_covered();
    let atlas = Atlases::new(evaluator, &grid, counts_all, memory);
    if poses as usize > atlas.capacity() {
        return Ok(Err(format!(
            "no bound was computed: the {poses} sensor poses of the grid take {} MiB, more than half of \
             --memory; widen --delta",
            (poses as usize * atlas.page_bytes()) >> 20
        )));
    }
    let mut search = GridSearch::new(atlas, objective.clone(), evaluator);
    search.untie();
    watch.note(&format!("bounding the gain over {poses} sensor poses"));
    let all: Vec<u32> = (0..poses).collect();
    let Some(greedy) = search.greedy(evaluator, &all)? else {
        return Ok(Err("no placement on the grid keeps the distance asked for".into()));
    };
    let effort = Effort::of(settings.evaluations);
    let total = effort.sets;
    let mut go_on = |done: u64| watch.tell(&Event::Progress { work: Work::Bounds, done, total });
    let top = search.climb(evaluator, &greedy.poses, Moves::Anywhere, &mut |_| go_on(0))?;
    Ok(Ok(bound_gain(&mut search, evaluator, &top, &effort, &mut go_on)?))
}

/// The grid of the bound on the gain: as given, or a coarse one of no more poses than the swaps cast.
fn grid(constraints: &Constraints, settings: &Settings) -> Result<PoseGrid, SearchError> {
    if let Some(spacing) = settings.delta {
        return Ok(PoseGrid::new(constraints, spacing)?);
    }
    let most = settings.poses_for_swaps(constraints.lidars()).max(FEW_POSES);
    let mut spacing = COARSE_SPACING;
    loop {
        let grid = PoseGrid::new(constraints, spacing)?;
        if u64::from(grid.len()) <= most {
            return Ok(grid);
        }
        spacing.metres *= WIDER;
        spacing.radians *= WIDER;
    }
}
