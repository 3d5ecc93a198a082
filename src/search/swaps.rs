//! Swaps: single LiDARs move to other poses of a grid while that gains.

use std::cell::Cell;
use std::collections::{BTreeSet, HashSet};
use std::fmt;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::atlases::Atlases;
use super::climb::Moves;
use super::error::SearchError;
use super::evaluator::Evaluator;
use super::grid_search::{GridPlacement, GridSearch};
use super::on_demand::drawn;
use super::settings::coarse_grid;
use crate::json::counted;
use crate::score::Objective;
use crate::targets::CAR_WEIGHT;
use crate::vehicle::{Placement, PoseGrid, Spacing};

/// Default grid of the swaps: the spacing of the published placements.
pub(crate) const SWAP_SPACING: Spacing = Spacing { metres: 0.1, radians: 0.1 };

/// Poses spread over the grid, as a multiple of the casts of the settings.
const SPREAD: f64 = 0.75;
/// Most poses in all, as a multiple of them; the others lie next to poses of good ends.
const MOST: f64 = 1.25;
/// Most poses of the grid from which the spread ones are taken, as a multiple of the casts.
const MANY: u64 = 8;
/// Ends of climbs whose neighbours are cast, at most at a time.
const WIDENED: usize = 4;
/// Kicks out of local optima where as many poses are held as were to be cast; more where fewer are.
const KICKS: u64 = 5;
const MOST_KICKS: u64 = 32;
/// LiDARs that a kick moves, one after the other, each anywhere.
const KICKED: usize = 2;
/// Ends of climbs that are kept beside the best, at most.
const OTHERS: usize = 3;
/// Largest distance of their objective from the best, as a share of it: few frames cannot tell closer ends apart.
const AS_GOOD: f64 = 0.03;
/// Distance of an end from the best, as a share of it, below which it counts as near it.
const NEAR_BEST: f64 = 0.005;
/// Random placements, the best of which is a start of the swaps where rules tie LiDARs, so that greedy is left out.
const DRAWN: usize = 64;

/// Poses, and bytes of their bitmaps, that are kept by climbs along a grid: these look at neighbours of where they
/// stand. Next to none in the tests of this crate.
const AMPLE_POSES: usize = if cfg!(test) { 4 } else { 256 };
const AMPLE_BYTES: u64 = if cfg!(test) { 0 } else { 192 << 20 };

/// Penalty for a missing share of 1, as a multiple of a start's objective: no gain makes up for a missing place.
pub(super) const MISSING: f64 = 1e4;

/// Settings of swaps: grid, limits and seed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwapSettings {
    /// Grid of the sensor poses.
    pub spacing: Spacing,
    /// Sensor poses to cast, at most about.
    pub casts: u64,
    /// True if every pose of the grid is cast, however many there are.
    pub whole: bool,
    /// Bytes of bitmaps to keep, at most.
    pub memory: u64,
    /// Seed of the random moves.
    pub seed: u64,
    /// True if more places of targets are wanted than the rules ask for, since LiDARs may be mounted a little off.
    pub roomy: bool,
    /// True if LiDARs are to look away from the own body.
    pub looks_away: bool,
}

/// How far the climbs of swaps are, for whoever is asked whether to go on: among poses that are cast no cast tells it.
#[derive(Debug, Default)]
pub struct Climbing(Cell<Option<[u64; 2]>>);

impl Climbing {
    /// Climbs done and climbs in all, at most; `None` while poses are cast.
    pub fn progress(&self) -> Option<[u64; 2]> {
        self.0.get()
    }

    fn at(&self, done: usize, total: usize) {
        self.0.set(Some([done as u64, total as u64]));
    }

    fn over(&self) {
        self.0.set(None);
    }
}

/// Result of swaps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Swapped {
    /// The best placement, on the grid.
    pub placement: Placement,
    /// Its objective.
    pub value: f64,
    /// Ends of other climbs that are about as good, the best first: over more frames one of them may be
    /// the best.
    pub others: Vec<Placement>,
    /// Ends of the climbs on the first grid.
    pub climbs: Climbs,
    /// Placements looked at.
    pub evaluations: u64,
    /// Sensor poses cast.
    pub poses_cast: u64,
}

/// How far apart the climbs of one search ended, which shows how much its result owes to luck.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Climbs {
    /// Number of climbs.
    pub count: usize,
    /// Frames over which they were compared.
    pub frames: usize,
    /// Climbs that ended where all requirements are met; `None` where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub met: Option<usize>,
    /// Climbs that ended within half a per cent of the best one; it is counted, too. Where there are requirements, of those
    /// that met all of them.
    pub near_best: usize,
    /// Distance of the median of their ends from the best, as a share of its objective; 0 where none met all requirements.
    pub median_below: f64,
}

impl Climbs {
    /// From the value of each end, and whether it meets all requirements, where there are some; `best` is the value of the
    /// best end, `objective` that value before the penalty for unseen cars, which leaves some values near 0.
    fn new(ends: &[(f64, Option<bool>)], best: f64, objective: f64, frames: usize) -> Self {
        let met = ends.iter().any(|end| end.1.is_some());
        let met = met.then(|| ends.iter().filter(|end| end.1 == Some(true)).count());
        // Penalties of unmet requirements are no per cent of the objective.
        let alike = ends.iter().filter(|end| end.1 != Some(false));
        let mut below: Vec<f64> =
            alike.map(|end| (best - end.0) / objective.abs().max(f64::MIN_POSITIVE)).collect();
        below.sort_by(f64::total_cmp);
        let near_best = below.iter().filter(|&&below| below <= NEAR_BEST).count();
        let median_below = below.get(below.len() / 2).copied().unwrap_or(0.0);
        Self { count: ends.len(), frames, met, near_best, median_below }
    }
}

impl fmt::Display for Climbs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { count, frames, met, near_best, median_below } = self;
        let [climbs, frames] = [counted(*count, "climb"), counted(*frames, "frame")];
        write!(f, "of {climbs} from different starts, over {frames}, ")?;
        match met {
            Some(0) => write!(f, "none met all requirements")?,
            Some(1) if self.count > 1 => write!(f, "one alone met all requirements")?,
            Some(met) => write!(f, "{met} met all requirements, and {near_best} of these")?,
            None => write!(f, "{near_best}")?,
        }
        if *met != Some(0) && (*met != Some(1) || self.count == 1) {
            let near = 100.0 * NEAR_BEST;
            write!(
                f,
                " ended within {near} % of the best; the median end is {:.1} % below it",
                100.0 * median_below
            )?;
        }
        write!(f, ". Another seed takes other starts")
    }
}

impl Swapped {
    /// The best placement of a search, with its counts; `ends` are the ends of all climbs, the best first.
    fn new(
        search: &GridSearch,
        best: &GridPlacement,
        ends: &[&GridPlacement],
        climbs: Climbs,
    ) -> Self {
        let as_good = |end: &&&GridPlacement| {
            set_of(end) != set_of(best)
                && (end.value - best.value).abs() <= AS_GOOD * best.value.abs()
        };
        let placed = |end: &GridPlacement| end.placement(search.atlas().grid(), "optimized");
        Self {
            placement: placed(best),
            value: best.value,
            others: ends.iter().filter(as_good).take(OTHERS).map(|end| placed(end)).collect(),
            climbs,
            evaluations: search.evaluations,
            poses_cast: search.atlas().poses_cast(),
        }
    }

    /// This result of swaps that went on from those `before`, with the work of both.
    pub(super) fn after(self, before: &Self) -> Self {
        Self {
            climbs: before.climbs,
            evaluations: before.evaluations + self.evaluations,
            poses_cast: before.poses_cast + self.poses_cast,
            ..self
        }
    }
}

/// A search on the grid of the settings, over the evaluator's frames.
fn grid_search(
    evaluator: &mut Evaluator,
    objective: &Objective,
    settings: &SwapSettings,
    starts: &[Placement],
) -> Result<GridSearch, SearchError> {
    let grid = PoseGrid::new(evaluator.constraints(), settings.spacing)?;
    let atlas = Atlases::new(evaluator, &grid, objective.needed(), settings.memory);
    let mut search = GridSearch::new(atlas, objective.clone(), evaluator);
    search.watch_cars(CAR_WEIGHT);
    search.roomy = settings.roomy;
    search.looks_away = settings.looks_away;
    let required = search.has_requirements();
    if let Some(poses) = starts.iter().filter(|_| required).find_map(|start| search.start_of(start))
    {
        let scale = search.value(evaluator, &poses)?.abs();
        search.require(MISSING * scale);
    }
    Ok(search)
}

#[derive(Default)]
struct Ends {
    all: Vec<GridPlacement>,
    /// For each end, whether it meets all requirements; `None` where there are none.
    met: Vec<Option<bool>>,
    /// For each end, the part taken off its objective for unseen cars.
    unseen: Vec<f64>,
    best: Option<GridPlacement>,
}

impl Ends {
    fn add(
        &mut self,
        search: &mut GridSearch,
        evaluator: &mut Evaluator,
        end: GridPlacement,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<(), SearchError> {
        // An atlas that forgets may not hold the end any more.
        search.hold(evaluator, &end.poses)?;
        let [missing, unseen] = search.lacks(&end.poses);
        self.met.push(search.has_requirements().then_some(missing == 0.0));
        self.unseen.push(unseen);
        self.all.push(end.clone());
        self.best = Some(match self.best.take() {
            Some(best) => search.preferred(evaluator, best, end, go_on)?,
            None => end,
        });
        Ok(())
    }

    /// The ends, the best first, each set of poses once.
    fn distinct(&self) -> Vec<&GridPlacement> {
        let mut ends: Vec<&GridPlacement> = self.all.iter().collect();
        ends.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut seen = HashSet::new();
        ends.retain(|end| seen.insert(set_of(end)));
        ends
    }

    fn swapped(&self, search: &GridSearch, frames: usize) -> Option<Swapped> {
        let best = self.best.as_ref().filter(|best| best.value.is_finite())?;
        let values = self.all.iter().map(|end| end.value);
        let ends: Vec<(f64, Option<bool>)> = values.zip(self.met.iter().copied()).collect();
        let place = self.all.iter().position(|end| end.poses == best.poses);
        let unseen = place.map_or(0.0, |place| self.unseen[place]);
        let climbs = Climbs::new(&ends, best.value, best.value + unseen, frames);
        Some(Swapped::new(search, best, &self.distinct(), climbs))
    }
}

/// Poses of a placement, rising.
fn set_of(placement: &GridPlacement) -> Vec<u32> {
    let mut poses = placement.poses.clone();
    poses.sort_unstable();
    poses
}

/// Swaps single LiDARs to poses of a grid at most `radius` steps away along one pose field, from each start that the
/// mount allows, until no swap gains; the start of the largest objective first, while poses may be cast.
///
/// `None` and `go_on` work as in [`swap_anywhere`].
pub(super) fn swap_from(
    evaluator: &mut Evaluator,
    objective: &Objective,
    settings: &SwapSettings,
    radius: u32,
    starts: &[Placement],
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Option<Swapped>, SearchError> {
    let mut search = grid_search(evaluator, objective, settings, starts)?;
    search.atlas.forget_beyond(AMPLE_POSES, AMPLE_BYTES);
    search.most_casts = settings.casts;
    let mut first: Vec<GridPlacement> = Vec::new();
    for start in starts {
        let Some(poses) = search.start_of(start) else { continue };
        if first.iter().any(|known| known.poses == poses) {
            continue;
        }
        let Some(value) = search.value_while(evaluator, &poses, go_on)? else { break };
        first.push(GridPlacement { poses, value });
    }
    first.sort_by(|a, b| b.value.total_cmp(&a.value));
    let mut ends = Ends::default();
    for start in first {
        if !ends.all.is_empty() && !search.may_turn(go_on) {
            break;
        }
        let moves = Moves::Along(radius);
        let Some(top) = search.climb(evaluator, &start.poses, moves, go_on)? else { break };
        ends.add(&mut search, evaluator, top, go_on)?;
    }
    Ok(ends.swapped(&search, evaluator.frame_count()))
}

/// Swaps single LiDARs anywhere among poses that are spread over a grid; all of them where no more may be cast.
///
/// Swaps begin at greedy's placement and at each start. They then begin at the best end after a kick that moves some of
/// its LiDARs anywhere, again and again. Then the poses next to those of the best ends are cast, too, and the swaps go
/// on from there, until the best ends have no neighbours that were not cast. Where rules tie the LiDARs together the
/// best of some random placements stands in for greedy, which takes one LiDAR after another and so does not keep them.
///
/// `None` where no start, moved to the grid, keeps the rules of the mount. `go_on` is asked as by
/// [`GridSearch::climb`]; once it says no the best end so far is the result, `None` where there is none. `climbing` tells it
/// how far the climbs are.
///
/// # Errors
/// A spacing that gives no grid, a whole grid that does not fit into memory, or from the backend.
pub fn swap_anywhere(
    evaluator: &mut Evaluator,
    objective: &Objective,
    settings: &SwapSettings,
    starts: &[Placement],
    climbing: &Climbing,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Option<Swapped>, SearchError> {
    let mut search = grid_search(evaluator, objective, settings, starts)?;
    let (pool, most) = pool_of(&search, settings)?;
    // Some of them, spread over the grid, where the time is over.
    let held = search.hold_while(evaluator, &pool, go_on)?;
    if pool.len() < search.atlas().grid().len() as usize {
        search.keep_to(held.iter().copied());
    }
    climbing.at(0, 1);
    let mut first: Vec<Vec<u32>> = Vec::new();
    if evaluator.constraints().ties.any() {
        first.extend(best_drawn(&mut search, evaluator, settings.seed, go_on)?);
    } else {
        first.extend(search.greedy(evaluator, &held)?.map(|greedy| greedy.poses));
    }
    first.extend(starts.iter().filter_map(|start| search.start_of(start)));
    let kicks = KICKS.saturating_mul(settings.casts) / pool.len().max(1) as u64;
    let kicks = kicks.min(MOST_KICKS);
    let climbs = first.len() + kicks as usize;
    let mut ends = Ends::default();
    for start in first {
        climbing.at(ends.all.len(), climbs);
        let Some(top) = search.climb(evaluator, &start, Moves::Anywhere, go_on)? else { break };
        ends.add(&mut search, evaluator, top, go_on)?;
    }
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    for _ in 0..kicks {
        climbing.at(ends.all.len(), climbs);
        let Some(best) = ends.best.as_ref().filter(|_| search.may_turn(go_on)) else { break };
        let kick = |poses: Vec<u32>, _| search.kicked(&poses, &mut rng);
        let start = (0..KICKED).fold(best.poses.clone(), kick);
        let Some(top) = search.climb(evaluator, &start, Moves::Anywhere, go_on)? else { break };
        ends.add(&mut search, evaluator, top, go_on)?;
    }
    climbing.over();
    widen(&mut search, evaluator, &mut ends, most, go_on)?;
    Ok(ends.swapped(&search, evaluator.frame_count()))
}

/// Poses to cast first, and the most to cast in all. The first are spread over a grid whose spacing is the least multiple
/// that leaves it at most [`MANY`] times the casts. A larger grid would have too few of them on the bounds of the
/// mount, where good ones often are.
fn pool_of(search: &GridSearch, settings: &SwapSettings) -> Result<(Vec<u32>, u64), SearchError> {
    let grid = search.atlas().grid();
    let (all, room) = (u64::from(grid.len()), search.atlas().capacity() as u64);
    let most = ((MOST * settings.casts as f64) as u64).min(room);
    if settings.whole && all > room {
        return Err(SearchError::WholeGrid { poses: all, room });
    }
    if settings.whole || all <= most {
        return Ok((grid.spread(all), all));
    }
    let rules = &search.constraints;
    let (coarse, _) = coarse_grid(rules, settings.spacing, 1, MANY.saturating_mul(settings.casts))?;
    let first = most.min((SPREAD * settings.casts as f64) as u64);
    let symmetric = rules.ties.symmetric;
    let some = coarse.spread(if symmetric { first / 2 } else { first });
    let both = some.into_iter().flat_map(|pose| {
        let pose = grid.same_as(&coarse, pose);
        [pose, if symmetric { grid.mirrored(pose) } else { pose }]
    });
    let both: BTreeSet<u32> = both.collect();
    Ok((both.into_iter().collect(), most))
}

/// Casts poses next to those of the best ends and climbs on from these, one end after the other, while that gains new
/// poses and no more than `most` are cast.
fn widen(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    ends: &mut Ends,
    most: u64,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<(), SearchError> {
    loop {
        let best = ends.distinct().into_iter().take(WIDENED);
        let mut next = best.map(|end| (end.poses.clone(), search.next_to(&end.poses)));
        let Some((start, new)) = next.find(|(_, new)| !new.is_empty()) else { return Ok(()) };
        if search.atlas().poses_cast() + new.len() as u64 > most || !search.may_turn(go_on) {
            return Ok(());
        }
        let held = search.hold_while(evaluator, &new, go_on)?;
        search.keep_to(held);
        let Some(top) = search.climb(evaluator, &start, Moves::Anywhere, go_on)? else {
            return Ok(());
        };
        ends.add(search, evaluator, top, go_on)?;
    }
}

fn best_drawn(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    seed: u64,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Option<Vec<u32>>, SearchError> {
    let random = drawn(evaluator.constraints(), DRAWN, seed);
    let random: Vec<Vec<u32>> = random.iter().filter_map(|p| search.start_of(p)).collect();
    let mut ends = Ends::default();
    for poses in random {
        if !ends.all.is_empty() && !go_on(search.atlas().poses_cast()) {
            break;
        }
        let Some(value) = search.value_while(evaluator, &poses, go_on)? else { break };
        ends.add(search, evaluator, GridPlacement { poses, value }, go_on)?;
    }
    Ok(ends.best.map(|best| best.poses))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_ends_are_shares_of_the_objective_before_its_penalty() {
        // Cars that are not seen take 0.45 off an objective of 0.5.
        let climbs = Climbs::new(&[(0.05, None), (0.048, None), (-0.094, None)], 0.05, 0.5, 1);
        assert_eq!(climbs.near_best, 2);
        assert!((climbs.median_below - 0.004).abs() < 1e-12, "{climbs}");
        let far = Climbs::new(&[(0.05, None), (-0.094, None)], 0.05, 0.5, 1);
        assert!(far.to_string().contains("the median end is 28.8 % below it"), "{far}");
    }

    #[test]
    fn ends_that_miss_requirements_are_no_per_cent_of_the_best() {
        let said = |ends: &[(f64, Option<bool>)]| Climbs::new(ends, 0.5, 0.5, 4).to_string();
        let plain = said(&[(0.5, None), (0.499, None), (0.4, None)]);
        assert!(
            plain.starts_with(
                "of 3 climbs from different starts, over 4 frames, 2 ended within 0.5 %"
            ),
            "{plain}"
        );
        assert!(plain.contains("the median end is 0.2 % below it"), "{plain}");
        let some = said(&[
            (0.5, Some(true)),
            (-0.04, Some(false)),
            (-0.3, Some(false)),
            (0.45, Some(true)),
        ]);
        let words = "2 met all requirements, and 1 of these ended within 0.5 %";
        assert!(some.contains(words) && some.contains("is 10.0 % below it"), "{some}");
        let one = said(&[(0.5, Some(true)), (-0.04, Some(false))]);
        assert!(one.contains("one alone met all requirements. Another seed"), "{one}");
        let none = said(&[(-0.04, Some(false)), (-0.3, Some(false))]);
        assert!(none.contains("none met all requirements"), "{none}");
        assert!(!none.contains('%') && none.ends_with("Another seed takes other starts"), "{none}");
    }
}
