use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::{Evaluator, GridPlacement, GridSearch, Moves, Search, SearchError, SearchSettings};
use crate::score::Objective;
use crate::search::atlas::Atlas;
use crate::vehicle::{Placement, PoseGrid, Spacing};

/// Grid of the swaps where nothing else is said: that of the published placements.
pub const SWAP_SPACING: Spacing = Spacing { metres: 0.1, radians: 0.1 };
/// First steps along single pose fields, then a step along several at once.
const MOVES: [Moves; 2] = [Moves::Along(3), Moves::Around(1)];

/// Most times that a local optimum is left by a random move: on a small grid no casts end this.
const KICKS: usize = 32;
/// Ends of climbs that are told beside the best, at most.
const OTHERS: usize = 3;
/// How far their objective is from the best, at most, as a share of it.
const AS_GOOD: f64 = 0.01;

/// What decides about swaps, beside problem and starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwapSettings {
    /// Grid of the sensor poses.
    pub spacing: Spacing,
    /// Sensor poses to cast, at most about.
    pub casts: u64,
    /// Bytes of bitmaps to keep, at most.
    pub memory: u64,
    /// Seed of the random moves.
    pub seed: u64,
}

/// What swaps have found.
#[derive(Debug, Clone, PartialEq)]
pub struct Swapped {
    /// The best placement, on the grid.
    pub placement: Placement,
    /// Its objective.
    pub value: f64,
    /// Where other climbs ended that are about as good, the best first: over more frames, or with other
    /// triangles, one of these may be the best.
    pub others: Vec<Placement>,
    /// Placements looked at.
    pub evaluations: u64,
    /// Sensor poses cast.
    pub poses_cast: u64,
}

impl Swapped {
    /// The best placement of a search, with its counts; `ends` are the ends of all climbs.
    pub fn new(search: &GridSearch, best: &GridPlacement, mut ends: Vec<GridPlacement>) -> Self {
        ends.sort_by(|a, b| b.value.total_cmp(&a.value));
        ends.retain(|end| (end.value - best.value).abs() <= AS_GOOD * best.value.abs());
        let sorted = |end: &GridPlacement| {
            let mut poses = end.poses.clone();
            poses.sort_unstable();
            poses
        };
        let mut seen = vec![sorted(best)];
        ends.retain(|end| {
            let is_new = !seen.contains(&sorted(end));
            seen.push(sorted(end));
            is_new
        });
        ends.truncate(OTHERS);
        let placed = |end: &GridPlacement| end.placement(search.atlas().grid(), "optimized");
        Self {
            placement: placed(best),
            value: best.value,
            others: ends.iter().map(placed).collect(),
            evaluations: search.evaluations(),
            poses_cast: search.atlas().poses_cast(),
        }
    }
}

/// Swaps single LiDARs to nearby poses of a grid, from each start that the mount allows, until no swap
/// gains; then moves one LiDAR of the best anywhere at random and climbs from there, again and again,
/// while poses may be cast (iterated local search).
///
/// `None` where no start, moved to the grid, keeps the rules of the mount. `go_on` is asked before each
/// LiDAR, with the poses cast so far.
///
/// # Errors
/// A spacing that gives no grid, or from the backend.
pub fn swap_from(
    evaluator: &mut Evaluator,
    objective: &Objective,
    settings: &SwapSettings,
    starts: &[Placement],
    go_on: &dyn Fn(u64) -> bool,
) -> Result<Option<Swapped>, SearchError> {
    let SwapSettings { spacing, casts, memory, seed } = *settings;
    let grid = PoseGrid::new(evaluator.constraints(), spacing)?;
    let counts_all = objective.counts_all_covered();
    let atlas = Atlas::new(evaluator.shared_problem(), grid, counts_all, memory);
    let mut search = GridSearch::new(atlas, objective.clone(), evaluator);
    let go_on = |cast: u64| cast < casts && go_on(cast);
    let mut best: Option<GridPlacement> = None;
    let mut ends = Vec::new();
    for start in starts {
        let Some(poses) = search.start_of(start) else { continue };
        let top = climb_both(&mut search, evaluator, poses, &go_on)?;
        ends.push(top.clone());
        best = Some(match best {
            Some(best) => search.preferred(evaluator, best, top)?,
            None => top,
        });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..KICKS {
        let Some(held) = best.take_if(|_| go_on(search.atlas().poses_cast())) else { break };
        let poses = search.kicked(&held.poses, &mut rng);
        let top = climb_both(&mut search, evaluator, poses, &go_on)?;
        ends.push(top.clone());
        best = Some(search.preferred(evaluator, held, top)?);
    }
    Ok(best.map(|best| Swapped::new(&search, &best, ends)))
}

/// Climbs by each of [`MOVES`] in turn.
fn climb_both(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    poses: Vec<u32>,
    go_on: &dyn Fn(u64) -> bool,
) -> Result<GridPlacement, SearchError> {
    let top = search.climb(evaluator, &poses, MOVES[0], go_on)?;
    search.climb(evaluator, &top.poses, MOVES[1], go_on)
}

/// The best placement that CMA-ES and then swaps find within a number of evaluations: what `optimize`
/// does, as a function.
///
/// `starts` join the first generation where the mount allows them. `None` where no candidate keeps the
/// rules of the mount, or `go_on` said no at once.
///
/// # Errors
/// Settings that the strategy refuses, or from the backend.
pub fn best_placement(
    evaluator: &mut Evaluator,
    objective: &Objective,
    starts: &[Placement],
    settings: &SearchSettings,
    memory: u64,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<(Placement, f64)>, SearchError> {
    let lidars = evaluator.constraints().lidars;
    let mut search = Search::new(settings.clone(), &evaluator.constraints().clone(), starts)?;
    while search.stopped().is_none() && go_on() {
        search.step(evaluator, objective)?;
    }
    let Some(best) = search.best() else { return Ok(None) };
    let swaps = SwapSettings {
        spacing: settings.delta.unwrap_or(SWAP_SPACING),
        casts: settings.evaluations * lidars as u64 / 2,
        memory,
        seed: settings.seed,
    };
    let start = std::slice::from_ref(&best.placement);
    let swapped = swap_from(evaluator, objective, &swaps, start, &|_| go_on())?;
    let named = Placement { name: "optimized".into(), ..best.placement.clone() };
    Ok(Some(match swapped {
        Some(swapped) if swapped.value > best.value || best.guards > 0 => {
            (swapped.placement, swapped.value)
        }
        _ => (named, best.value),
    }))
}
