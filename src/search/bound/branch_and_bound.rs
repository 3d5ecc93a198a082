//! A bound on the information gain of every placement on a grid.

use std::cell::RefCell;
use std::collections::BinaryHeap;

use serde::{Deserialize, Serialize};

use super::open_sets::{Node, Open, ROUNDING};
use super::pair_overlaps::PairBound;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::{GridPlacement, GridSearch, Places, better_first};

/// Sets of sensors whose gains are looked at for each 100 evaluations of a search.
const SETS: u64 = 28;
/// Least number of sets worth a look: 50 lowered the bound of pairs by less than a thousandth in each of the four scenes.
const LEAST_SETS: u64 = 100;
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
/// Sets of sensors whose gains are looked at together: each bitmap is then read once for all.
const AT_ONCE: usize = 8;
/// One in this many poses, the best ones, is typical of poses in good placements.
const TYPICAL: usize = 4;

/// Bound on the information gain of every placement on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GainBound {
    /// Poses of the grid.
    pub poses: u32,
    /// The best placement met while bounding, the one given included.
    pub best: GridPlacement,
    /// No placement on the grid has an objective above this.
    pub upper: f64,
    /// `upper` without branch and bound: from single poses and pairs alone.
    pub upper_at_root: f64,
    /// Sets of sensors whose gains were looked at.
    pub nodes: u64,
    /// True if the best placement is proven to be the best on the grid.
    pub proven: bool,
}

/// Work that a bound may take. It is counted, not timed, so that equal runs give equal bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Sets of sensors whose gains are looked at.
    pub sets: u64,
    /// Candidates that are looked at through pairs alone, for each split of the voxels.
    pub pair_candidates: u64,
    /// Words of bitmaps that are read for the overlaps of pairs.
    pub pair_words: u64,
}

impl Effort {
    /// Work allowed for a search of `evaluations` evaluations.
    pub fn of(evaluations: u64) -> Self {
        let sets = evaluations.saturating_mul(SETS) / 100;
        Self {
            sets: if sets < LEAST_SETS { 1 } else { sets },
            pair_candidates: evaluations.saturating_mul(PAIR_CANDIDATES).min(MOST_CANDIDATES),
            pair_words: evaluations.saturating_mul(PAIR_WORDS),
        }
    }

    /// Sets of sensors to look at through pairs: the root alone where no overlaps are known.
    fn pair_nodes(&self, pairs: &PairBound) -> u64 {
        if pairs.has_overlaps() { self.split_nodes(pairs) } else { 1 }
    }

    /// Sets of sensors to split before the gains of larger ones are looked at.
    fn split_nodes(&self, pairs: &PairBound) -> u64 {
        if pairs.can_split() { self.pair_candidates / pairs.singles().len() as u64 } else { 1 }
    }
}

/// Bounds an information gain over all placements on the grid: branch and bound, best first, in which
/// the gains of at most `effort.sets` sets of sensors are looked at. Every pose must fit into the atlas at
/// once.
///
/// The gain is monotone and submodular in the set of sensors. The gains of the best poses beside any
/// set of sensors, added to that set's value, are therefore above every placement (Nemhauser, Wolsey,
/// Fisher 1978). A union is below its sensors' sum less the overlaps along a tree (Hunter 1976).
/// The bound holds for other objectives only if they are such gains too, see
/// [`crate::score::Objective::is_information_gain`].
///
/// `go_on` is asked before each set and while overlaps of pairs are added up, with the number of sets looked at; a bound
/// that it ends is valid, too.
pub fn bound_gain(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    found: &GridPlacement,
    effort: &Effort,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<GainBound, SearchError> {
    let (lidars, poses) = (search.lidars(), search.atlas().grid().len());
    let all: Vec<u32> = (0..poses).collect();
    search.hold(evaluator, &all)?;
    let beside = beside(search, found, &all);
    let mut typical = search.values_with(&[], &all);
    typical.sort_by(better_first);
    typical.truncate(all.len().div_ceil(TYPICAL));
    let typical: Vec<u32> = typical.into_iter().map(|(pose, _)| pose).collect();
    let (units, places) = (search.atlas.worth_units(&search.objective), search.places());
    let open = || Open { heap: BinaryHeap::new(), lidars, floor: found.value };
    let words = effort.pair_words;
    let asked = RefCell::new(go_on);
    let ask = || (asked.borrow_mut())(0);
    let root_of = |pairs: &PairBound, nodes: u64| by_pairs(pairs, &places, open(), nodes, &ask);
    let (pairs, chosen_by) =
        PairBound::tightest(search.atlas(), lidars, &units, &typical, words, &ask, |pairs| {
            root_of(pairs, effort.pair_nodes(pairs) / CHOOSING)
        });
    let by_pairs = root_of(&pairs, effort.pair_nodes(&pairs)).min(chosen_by);
    let upper_at_root = beside.min(by_pairs).max(found.value);
    let mut tree =
        Tree { search, pairs: &pairs, places: &places, open: open(), best: found.clone() };
    let looked_at = tree.branch(effort, &mut **asked.borrow_mut());
    let Tree { open, best, .. } = tree;
    let left = open.upper();
    let upper = left.min(upper_at_root).max(best.value);
    let proven = left <= best.value;
    Ok(GainBound { poses, best, upper, upper_at_root, nodes: looked_at, proven })
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

/// A bound from pairs alone: sets of sensors are split until their number is used up, or until `go_on` says no.
fn by_pairs(
    pairs: &PairBound,
    places: &Places,
    mut open: Open,
    most: u64,
    go_on: &dyn Fn() -> bool,
) -> f64 {
    open.push_unsorted(root(pairs));
    let mut looked_at = 1;
    while looked_at < most
        && (!u64::is_multiple_of(looked_at, SPLITS_AT_ONCE) || go_on())
        && let Some(node) = open.pop()
    {
        if node.chosen.len() + 1 == open.lidars {
            open.heap.push(node);
            break;
        }
        let (child, node) = split(places, pairs, node);
        looked_at += 1;
        open.push(node);
        open.push_unsorted(child);
    }
    open.upper()
}

/// Sets of sensors under way, and the best placement met.
struct Tree<'a> {
    search: &'a mut GridSearch,
    pairs: &'a PairBound,
    places: &'a Places,
    open: Open,
    best: GridPlacement,
}

impl Tree<'_> {
    /// Branches until the effort is spent or nothing is left; returns the number of sets looked at.
    fn branch(&mut self, effort: &Effort, go_on: &mut dyn FnMut(u64) -> bool) -> u64 {
        let (mut looked_at, mut cheaply) = (1, 0);
        self.open.push_unsorted(root(self.pairs));
        // Sets whose gains are to be looked at, together.
        let mut waiting: Vec<Node> = Vec::new();
        while looked_at < effort.sets
            && cheaply < effort.split_nodes(self.pairs)
            && go_on(looked_at)
        {
            let lidars = self.open.lidars;
            let is_full =
                waiting.len() == AT_ONCE || looked_at + waiting.len() as u64 >= effort.sets;
            let Some(node) = (if is_full { None } else { self.open.pop() }) else {
                if waiting.is_empty() {
                    break;
                }
                let nodes = waiting.len() as u64;
                if !self.make_exact(std::mem::take(&mut waiting), &mut || go_on(looked_at)) {
                    break;
                }
                looked_at += nodes;
                continue;
            };
            let left = lidars - node.chosen.len();
            if !node.exact && (left == 1 || (left == 2 && lidars > 2)) {
                waiting.push(node);
            } else if left == 1 {
                self.finish(&node);
            } else if node.exact {
                let (child, node) = self.extend(node);
                self.open.push(node);
                self.open.push_unsorted(child);
                looked_at += 1;
            } else {
                let (child, node) = split(self.places, self.pairs, node);
                self.open.push(node);
                self.open.push_unsorted(child);
                cheaply += 1;
            }
        }
        waiting.into_iter().for_each(|node| self.open.push(node));
        looked_at
    }

    /// Puts the gains of candidates in the place of bounds. False once `go_on` says no; the bounds then stay.
    fn make_exact(&mut self, nodes: Vec<Node>, go_on: &mut dyn FnMut() -> bool) -> bool {
        let sets: Vec<&[u32]> = nodes.iter().map(|node| &node.chosen[..]).collect();
        let Some(values) = self.search.values_beside(&sets, go_on) else {
            nodes.into_iter().for_each(|node| self.open.push(node));
            return false;
        };
        for (node, values) in nodes.into_iter().zip(values) {
            let value = self.search.held_value(&node.chosen);
            let left = node.candidates[node.next..].iter();
            let values = left.map(|&(pose, _)| (pose, values[pose as usize])).collect();
            self.open.push_unsorted(exact(node.chosen, value, values, node.bound));
        }
        true
    }

    /// A set that lacks one sensor: candidates come by falling gain, so the first is the best.
    fn finish(&mut self, node: &Node) {
        let (pose, gain) = node.candidates[node.next];
        let value = node.value + gain;
        if value > self.best.value {
            let poses = [&node.chosen[..], &[pose]].concat();
            self.best = GridPlacement { poses, value };
            self.open.floor = value;
        }
    }

    /// Takes the next candidate out of a node, as a child with the gains beside it, in no order.
    fn extend(&mut self, mut node: Node) -> (Node, Node) {
        let (pose, gain) = node.candidates[node.next];
        let chosen = [&node.chosen[..], &[pose]].concat();
        let rest = node.candidates[node.next + 1..].iter().map(|c| c.0);
        let rest: Vec<u32> = rest.filter(|&c| self.places.fits(c, &chosen)).collect();
        let values = self.search.values_with(&chosen, &rest);
        let child = exact(chosen, node.value + gain, values, node.bound);
        node.next += 1;
        (child, node)
    }
}

/// The empty set, extended by bounds from pairs in no order.
fn root(pairs: &PairBound) -> Node {
    let (candidates, value, bound) = (pairs.singles(), pairs.base, f64::INFINITY);
    Node { chosen: vec![], value, candidates, next: 0, sorted: false, bound, exact: false }
}

/// Takes the next candidate out of a node, as a child with bounds from pairs, its candidates in no order.
fn split(places: &Places, pairs: &PairBound, mut node: Node) -> (Node, Node) {
    let (pose, added) = node.candidates[node.next];
    node.next += 1;
    let rest = node.candidates[node.next..].iter().filter(|c| places.fits(c.0, &[pose]));
    let candidates = rest.map(|&(other, added)| (other, pairs.added(other, pose, added))).collect();
    let chosen = [&node.chosen[..], &[pose]].concat();
    let value = node.value + added;
    let bound = node.bound;
    (Node { chosen, value, candidates, next: 0, sorted: false, bound, exact: false }, node)
}

/// A set with the gains of candidates, in no order, whose objectives beside it are `values`.
fn exact(chosen: Vec<u32>, value: f64, mut values: Vec<(u32, f64)>, bound: f64) -> Node {
    let value = value.max(0.0);
    for (_, gain) in &mut values {
        // The objective does not exist where nothing is covered; the gain is zero there.
        *gain = gain.max(value) - value;
    }
    Node { chosen, value, candidates: values, next: 0, sorted: false, bound, exact: true }
}
