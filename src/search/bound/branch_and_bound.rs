//! A bound on the information gain of every placement on a grid.

use std::cell::RefCell;

use serde::{Deserialize, Serialize};

use super::first_poses::{FirstPoses, FirstPosesBound};
use super::open_sets::{Candidates, Node, Open, ROUNDING};
use super::pair_overlaps::{PairBound, Worths};
use super::required::BoundRequirements;
use super::voxel_groups::Columns;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::{GridPlacement, GridSearch, Places, better_first};

/// Candidates that are looked at through pairs alone for each evaluation of a search.
const PAIR_CANDIDATES: u64 = 1 << 14;
/// Candidates of all sets that wait to be split, at most: they take 16 bytes each.
const MOST_CANDIDATES: u64 = 1 << 27;
/// Sets that are split between two looks at the time.
const SPLITS_AT_ONCE: u64 = 64;
/// One in this many candidates is spent on choosing a split of the voxels.
const CHOOSING: u64 = 8;
/// Words of bitmaps that are read for the overlaps of pairs for each evaluation of a search.
const PAIR_WORDS: u64 = 1 << 25;
/// Words that are read for the overlaps of pairs beside a first pose for each evaluation of a search.
const FIRST_WORDS: u64 = 1 << 24;
/// Gap to the best placement met that sets by their first pose are to close where no other is asked for.
const GAP: f64 = 0.01;
/// Gap up to which the best placement met counts as proven: worths of several kinds or scenes are rounded to integers.
const PROVEN: f64 = 1e-6;
/// One in this many poses, the best ones, is typical of poses in good placements.
const TYPICAL: usize = 4;
/// Shares of the typical poses that cover a voxel by which voxels are grouped, as multiples of
/// [`Worths::even_share`].
const SHARES: [f64; 7] = [0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2];

/// Bound on the information gain of every placement on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainBound {
    /// Poses of the grid.
    pub poses: u32,
    /// The best placement met while bounding, the one given included.
    pub best: GridPlacement,
    /// No placement on the grid that meets what `heeds` says has an objective above this.
    pub upper: f64,
    /// Requirements that the bound heeds, in words; `None` where it is on all placements. One over a few frames heeds them
    /// over these.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heeds: Option<String>,
    /// `upper` from single poses and pairs alone, without sets by their first pose.
    pub upper_at_root: f64,
    /// Sets of sensors whose gains were looked at.
    pub nodes: u64,
    /// True if the best placement is proven to be the best on the grid, or within a millionth of it.
    pub proven: bool,
    /// Why the gap asked for was not reached, where one was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub short: Option<String>,
}

/// Work that a bound may take. It is counted, not timed, so that equal runs give equal bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Candidates that are looked at through pairs alone, for each split of the voxels.
    pub pair_candidates: u64,
    /// Words of bitmaps that are read for the overlaps of pairs.
    pub pair_words: u64,
    /// Words that may be read for overlaps beside a first pose; where they take more, no set is looked at by its first pose.
    pub first_words: u64,
    /// Gap to the best placement met that sets by their first pose are to close, as a share of it.
    pub gap: f64,
    /// True if the gap was asked for.
    pub is_asked: bool,
    /// Bytes that sets by their first pose may take.
    pub memory: u64,
}

impl Effort {
    /// Work allowed for a search of `evaluations` evaluations within about `memory` bytes; with a `gap` asked for, as much as
    /// closing it takes.
    pub fn of(evaluations: u64, gap: Option<f64>, memory: u64) -> Self {
        let first_words = evaluations.saturating_mul(FIRST_WORDS);
        Self {
            pair_candidates: evaluations.saturating_mul(PAIR_CANDIDATES).min(MOST_CANDIDATES),
            pair_words: evaluations.saturating_mul(PAIR_WORDS),
            first_words: gap.map_or(first_words, |_| u64::MAX),
            gap: gap.unwrap_or(GAP),
            is_asked: gap.is_some(),
            memory,
        }
    }

    /// Looks at all sets that may be above the gap to a placement.
    fn look(
        &self,
        firsts: &FirstPoses,
        found: &GridPlacement,
        go_on: &mut dyn FnMut([u64; 2]) -> bool,
    ) -> FirstPosesBound {
        let each = self.first_words / firsts.count().max(1);
        let most_words = if self.is_asked { u64::MAX } else { each };
        firsts.look(found.value * (1.0 + self.gap), most_words, go_on)
    }

    /// Why no set is looked at by its first pose, if so.
    fn leaves_out(&self, firsts: &FirstPoses, worths: &Worths) -> Option<String> {
        let bytes = firsts.bytes();
        if !worths.is_plain() {
            return Some("voxels of this objective count again for a second LiDAR".into());
        }
        if bytes > self.memory / 2 {
            let mib = bytes >> 20;
            return Some(format!(
                "its sets of sensors take up to {mib} MiB; raise --memory, widen --delta or use fewer --threads"
            ));
        }
        (firsts.words() > self.first_words).then(|| "they are too many".into())
    }

    /// Sets of sensors to look at through pairs: the root alone where no overlaps are known.
    fn pair_nodes(&self, pairs: &PairBound) -> u64 {
        if pairs.can_split() { self.pair_candidates / pairs.singles().len() as u64 } else { 1 }
    }
}

/// Bounds an information gain over all placements on the grid. Every pose must fit into the atlas at once.
///
/// The gain is monotone and submodular in the set of sensors. The gains of the best poses beside any
/// set of sensors, added to that set's value, are therefore above every placement (Nemhauser, Wolsey,
/// Fisher 1978). A union is below its sensors' sum less the overlaps along a tree (Hunter 1976); sets by their first pose
/// count overlaps outside that pose, and are looked at exactly where this leaves them above the gap.
/// Sets that no poses complete to a placement that meets the requirements are left out, see `BoundRequirements`; overlap is not
/// looked at. Where `found` misses a requirement the bound is not below it.
/// The bound holds for other objectives only if they are such gains too, see
/// `crate::score::Objective::is_information_gain`.
///
/// `go_on` is asked while overlaps are added up, with the first poses done and all of them; a bound that it ends is
/// valid, too.
pub fn bound_gain(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    found: &GridPlacement,
    effort: &Effort,
    go_on: &mut dyn FnMut([u64; 2]) -> bool,
) -> Result<GainBound, SearchError> {
    let (lidars, poses) = (search.lidars(), search.atlas().grid().len());
    let all: Vec<u32> = (0..poses).collect();
    search.hold(evaluator, &all)?;
    let (beside, typical) = (beside(search, found, &all), typical(search, &all));
    let (units, places) = (search.atlas.worth_units(&search.objective), search.places());
    let worths = Worths::new(search.atlas(), lidars, &units);
    let required = BoundRequirements::of(search.atlas());
    let is_met = required.as_ref().is_none_or(|required| required.meets(&found.poses));
    let asked = RefCell::new(go_on);
    let ask = || (asked.borrow_mut())([0, 1]);
    let shares = SHARES.map(|share| share * worths.even_share(lidars));
    let heeds = required.as_ref().map(|required| required.words().to_owned());
    let mut bound = GainBound { heeds, ..GainBound::beside(poses, found, beside) };
    bound.proven &= is_met;
    let Some(columns) = Columns::new(search.atlas(), poses, &worths.once, &shares, &typical, &ask)
    else {
        return Ok(bound);
    };
    let root_of = |pairs: &PairBound, required: Option<&BoundRequirements>, nodes: u64| {
        by_pairs(pairs, (&places, required), Open::new(found.value), nodes, &ask)
    };
    let (pairs, chosen_by) =
        PairBound::tightest(&columns, &worths, effort.pair_words, &ask, |pairs| {
            root_of(pairs, None, effort.pair_nodes(pairs) / CHOOSING)
        });
    let by_pairs = root_of(&pairs, required.as_ref(), effort.pair_nodes(&pairs)).min(chosen_by);
    bound.upper_at_root = bound.upper.min(by_pairs).max(found.value);
    bound.upper = bound.upper_at_root;
    if bound.upper > found.value * (1.0 + effort.gap) {
        let firsts =
            FirstPoses::new(&columns, &places, required.as_ref(), worths.unit, effort.memory / 4);
        let why = match effort.leaves_out(&firsts, &worths) {
            Some(why) => why,
            None => {
                let looked = effort.look(&firsts, found, &mut **asked.borrow_mut());
                bound.take(search, evaluator, looked)?.into()
            }
        };
        let is_short = bound.upper > bound.best.value * (1.0 + effort.gap) * (1.0 + PROVEN);
        bound.short = (effort.is_asked && is_short).then_some(why);
    }
    let is_met = is_met || bound.best != *found;
    bound.proven = is_met && bound.upper <= bound.best.value * (1.0 + PROVEN);
    Ok(bound)
}

impl GainBound {
    /// The bound `upper` from one placement alone.
    fn beside(poses: u32, found: &GridPlacement, upper: f64) -> Self {
        Self {
            poses,
            best: found.clone(),
            upper: upper.max(found.value),
            heeds: None,
            upper_at_root: upper.max(found.value),
            nodes: 1,
            proven: upper <= found.value,
            short: None,
        }
    }

    /// Takes what a look at sets by their first pose found; says why a gap may be left.
    fn take(
        &mut self,
        search: &mut GridSearch,
        evaluator: &mut Evaluator,
        looked: FirstPosesBound,
    ) -> Result<&'static str, SearchError> {
        self.nodes += looked.sets;
        if let Some((mut poses, _)) = looked.best {
            // In the order of the slots.
            poses.sort_by_key(|&pose| (search.atlas().grid().kind(pose), pose));
            let value = search.value(evaluator, &poses)?;
            if value > self.best.value {
                self.best = GridPlacement { poses, value };
            }
        }
        if !looked.is_whole {
            return Ok("the time was over");
        }
        self.upper = self.upper.min(looked.upper).max(self.best.value);
        Ok("too many sets of sensors stay above it")
    }
}

/// Poses typical of good placements: the best ones alone.
fn typical(search: &mut GridSearch, all: &[u32]) -> Vec<u32> {
    let mut typical = search.values_with(&[], all);
    typical.sort_by(better_first);
    typical.truncate(all.len().div_ceil(TYPICAL));
    typical.into_iter().map(|(pose, _)| pose).collect()
}

/// A bound from one placement: its value, and the gains of the best poses beside it. Poses that do not fit beside it
/// count too, since they may stand in another placement.
fn beside(search: &mut GridSearch, found: &GridPlacement, all: &[u32]) -> f64 {
    let lidars = search.lidars();
    let mut gains = search.values_with(&found.poses, all);
    gains.sort_by(better_first);
    let value = found.value.max(0.0);
    let gains: f64 = gains.iter().take(lidars).map(|c| c.1.max(value) - value).sum();
    (value + gains) * (1.0 + ROUNDING)
}

/// A bound from pairs alone: sets of sensors are split until their number is used up, or until `go_on` says no. Sets
/// with a pose leave out poses that cannot meet the requirements beside it.
fn by_pairs(
    pairs: &PairBound,
    (places, required): (&Places, Option<&BoundRequirements>),
    mut open: Open,
    most: u64,
    go_on: &dyn Fn() -> bool,
) -> f64 {
    let may_meet = |node: &mut Node| required.is_none_or(|required| required.cut(node));
    let mut all = root(pairs, places);
    if may_meet(&mut all) {
        open.push(all);
    }
    let mut looked_at = 1;
    while looked_at < most
        && (!u64::is_multiple_of(looked_at, SPLITS_AT_ONCE) || go_on())
        && let Some(mut node) = open.pop()
    {
        if node.left() == 1 {
            open.push(node);
            break;
        }
        let mut child = node.split(places, |pose, beside| pairs.added(pose, beside));
        looked_at += 1;
        open.push(node);
        // Larger sets have these candidates or fewer; a look at each takes longer than its split.
        if child.chosen.len() > 1 || may_meet(&mut child) {
            open.push(child);
        }
    }
    open.upper()
}

/// The empty set, extended by bounds from pairs.
fn root(pairs: &PairBound, places: &Places) -> Node {
    let kinds = places.lidars_by_kind.iter().enumerate().map(|(kind, &left)| {
        let poses = pairs.singles().into_iter();
        let fitting = poses.filter(|c| places.kind(c.0) == kind && places.fits(c.0, &[]));
        Candidates { left, poses: fitting.collect() }
    });
    Node::root(vec![], pairs.base, kinds.collect())
}
