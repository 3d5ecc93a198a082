//! A bound on the information gain of every placement on a grid.

use std::collections::BinaryHeap;

use serde::{Deserialize, Serialize};

use super::pair_overlaps::PairBound;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::{GridPlacement, GridSearch, Places, better_first};

/// Relative rounding error of the sums of gains behind a bound, at most.
const ROUNDING: f64 = 1e-12;
/// Sets of sensors whose gains are looked at for each 100 evaluations of a search.
const SETS: u64 = 111;
/// Candidates that are looked at through pairs alone for each evaluation of a search.
const PAIR_CANDIDATES: u64 = 1 << 14;
/// Words of bitmaps that are read for the overlaps of pairs for each evaluation of a search.
const PAIR_WORDS: u64 = 1 << 25;
/// The best one of so many poses is typical of those in good placements.
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
    /// Whether the best placement is proven to be the best on the grid.
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
    /// As much as goes with a search of so many evaluations.
    pub fn of(evaluations: u64) -> Self {
        Self {
            sets: (evaluations * SETS / 100).max(2),
            pair_candidates: evaluations * PAIR_CANDIDATES,
            pair_words: evaluations * PAIR_WORDS,
        }
    }

    /// Sets of sensors to look at through pairs: the root alone where no overlaps are known.
    fn pair_nodes(&self, pairs: &PairBound) -> u64 {
        if pairs.has_overlaps() { self.pair_candidates / pairs.singles().len() as u64 } else { 1 }
    }
}

/// A set of sensors to be extended, its candidates by what they add, falling.
#[derive(Debug, Clone)]
struct Node {
    chosen: Vec<u32>,
    /// What the set covers; not below it where `exact` is false.
    value: f64,
    /// (pose, what it adds at most) from the first that was not taken yet on.
    candidates: Vec<(u32, f64)>,
    next: usize,
    /// No extension is above this.
    bound: f64,
    /// Whether values are gains, and not bounds from pairs.
    exact: bool,
}

impl Node {
    /// Lowers the bound to that of extensions of which `candidates[next]` is the first: a pose never
    /// adds more than it does now. False if there is no extension.
    fn tighten(&mut self, lidars: usize) -> bool {
        let wanted = lidars - self.chosen.len();
        let Some(added) = self.candidates.get(self.next..self.next + wanted) else { return false };
        let bound = (self.value + added.iter().map(|c| c.1).sum::<f64>()) * (1.0 + ROUNDING);
        self.bound = self.bound.min(bound);
        true
    }

    /// Forgets candidates that stay below `floor` even beside the best of the others.
    fn drop_below(&mut self, floor: f64, lidars: usize) {
        let others = lidars - self.chosen.len() - 1;
        let rest = &self.candidates[self.next..];
        let others: f64 = rest.iter().take(others).map(|c| c.1).sum();
        let least = floor / (1.0 + ROUNDING) - self.value - others;
        self.candidates.truncate(self.next + rest.partition_point(|c| c.1 > least));
        self.candidates.shrink_to_fit();
    }
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Node {}
impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Node {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.bound.total_cmp(&other.bound).then_with(|| other.chosen.cmp(&self.chosen))
    }
}

/// Sets of sensors yet to be looked at, the largest bound first.
struct Open {
    heap: BinaryHeap<Node>,
    lidars: usize,
    /// Nodes with no bound above this are dropped.
    floor: f64,
}

impl Open {
    fn push(&mut self, mut node: Node) {
        node.drop_below(self.floor, self.lidars);
        if node.tighten(self.lidars) && node.bound > self.floor {
            self.heap.push(node);
        }
    }

    fn upper(&self) -> f64 {
        self.heap.peek().map_or(f64::NEG_INFINITY, |node| node.bound)
    }

    /// The node of largest bound, unless nothing above the floor is left.
    fn pop(&mut self) -> Option<Node> {
        self.heap.pop().filter(|node| node.bound > self.floor)
    }
}

/// Bounds an information gain over all placements on the grid: branch and bound, best first, in which
/// the gains of at most `effort.sets` sets of sensors are looked at. Every pose must fit into the atlas at
/// once.
///
/// The gain is monotone and submodular in the set of sensors, so the gains of the best poses beside
/// any set of sensors, added to that set's value, are above every placement (Nemhauser, Wolsey,
/// Fisher 1978); and a union is below its sensors' sum less the overlaps along a tree (Hunter 1976).
/// The bound holds for other objectives only if they are such gains too, see
/// [`crate::score::Objective::is_information_gain`].
///
/// `go_on` is asked before each set, with the number of sets looked at.
///
/// # Errors
/// As [`GridSearch::hold`].
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
    let (units, places) = (search.worth_units(), search.places());
    let open = || Open { heap: BinaryHeap::new(), lidars, floor: found.value };
    let words = effort.pair_words;
    let (pairs, by_pairs) =
        PairBound::tightest(search.atlas(), lidars, units, &typical, words, |pairs| {
            by_pairs(pairs, &places, open(), effort.pair_nodes(pairs))
        });
    let upper_at_root = beside.min(by_pairs).max(found.value);
    let mut tree =
        Tree { search, pairs: &pairs, places: &places, open: open(), best: found.clone() };
    let looked_at = tree.branch(effort, go_on);
    let Tree { open, best, .. } = tree;
    let left = open.upper();
    let upper = left.min(upper_at_root).max(best.value);
    let proven = left <= best.value;
    Ok(GainBound { poses, best, upper, upper_at_root, nodes: looked_at, proven })
}

/// A bound from one placement: its value, and what the best poses gain beside it. Poses that do not fit
/// beside it count too, since they may stand in another.
fn beside(search: &mut GridSearch, found: &GridPlacement, all: &[u32]) -> f64 {
    let lidars = search.lidars();
    let mut gains = search.values_with(&found.poses, all);
    gains.sort_by(better_first);
    let value = found.value.max(0.0);
    let gains: f64 = gains.iter().take(lidars).map(|c| c.1.max(value) - value).sum();
    (value + gains) * (1.0 + ROUNDING)
}

/// A bound from pairs alone: sets of sensors are split until their number is used up.
fn by_pairs(pairs: &PairBound, places: &Places, mut open: Open, most: u64) -> f64 {
    open.push(root(pairs));
    let mut looked_at = 1;
    while looked_at < most
        && let Some(node) = open.pop()
    {
        if node.chosen.len() + 1 == open.lidars {
            open.heap.push(node);
            break;
        }
        let (child, node) = split(places, pairs, node);
        looked_at += 1;
        open.push(node);
        open.push(child);
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
    /// Branches until the effort is spent, or nothing is left; how many sets were looked at.
    fn branch(&mut self, effort: &Effort, go_on: &mut dyn FnMut(u64) -> bool) -> u64 {
        let (mut looked_at, mut cheaply) = (1, 0);
        self.open.push(root(self.pairs));
        while looked_at < effort.sets
            && cheaply < effort.pair_nodes(self.pairs)
            && go_on(looked_at)
            && let Some(node) = self.open.pop()
        {
            let lidars = self.open.lidars;
            let left = lidars - node.chosen.len();
            if !node.exact && (left == 1 || (left == 2 && lidars > 2)) {
                let exact = self.exact(&node);
                self.open.push(exact);
                looked_at += 1;
            } else if left == 1 {
                self.finish(&node);
            } else if node.exact {
                let (child, node) = self.extend(node);
                self.open.push(node);
                self.open.push(child);
                looked_at += 1;
            } else {
                let (child, node) = split(self.places, self.pairs, node);
                self.open.push(node);
                self.open.push(child);
                cheaply += 1;
            }
        }
        looked_at
    }

    /// The same set with the gains of its candidates in place of bounds.
    fn exact(&mut self, node: &Node) -> Node {
        let some: Vec<u32> = node.candidates[node.next..].iter().map(|c| c.0).collect();
        let value = self.search.held_value(&node.chosen);
        gains(self.search, node.chosen.clone(), value, &some, node.bound)
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

    /// Takes the next candidate out of a node, as a child with the gains beside it.
    fn extend(&mut self, mut node: Node) -> (Node, Node) {
        let (pose, gain) = node.candidates[node.next];
        let chosen = [&node.chosen[..], &[pose]].concat();
        let rest = node.candidates[node.next + 1..].iter().map(|c| c.0);
        let rest: Vec<u32> = rest.filter(|&c| self.places.fits(c, &chosen)).collect();
        let child = gains(self.search, chosen, node.value + gain, &rest, node.bound);
        node.next += 1;
        (child, node)
    }
}

/// The empty set, extended by bounds from pairs.
fn root(pairs: &PairBound) -> Node {
    let mut candidates = pairs.singles();
    candidates.sort_unstable_by(better_first);
    let (value, bound) = (pairs.base, f64::INFINITY);
    Node { chosen: vec![], value, candidates, next: 0, bound, exact: false }
}

/// Takes the next candidate out of a node, as a child with bounds from pairs.
fn split(places: &Places, pairs: &PairBound, mut node: Node) -> (Node, Node) {
    let (pose, added) = node.candidates[node.next];
    node.next += 1;
    let rest = node.candidates[node.next..].iter().filter(|c| places.fits(c.0, &[pose]));
    let mut candidates: Vec<(u32, f64)> =
        rest.map(|&(other, added)| (other, pairs.added(other, pose, added))).collect();
    candidates.sort_unstable_by(better_first);
    let chosen = [&node.chosen[..], &[pose]].concat();
    let value = node.value + added;
    let bound = node.bound;
    (Node { chosen, value, candidates, next: 0, bound, exact: false }, node)
}

/// A node with the gains of candidates that fit beside its sensors.
fn gains(
    search: &mut GridSearch,
    chosen: Vec<u32>,
    value: f64,
    candidates: &[u32],
    bound: f64,
) -> Node {
    let value = value.max(0.0);
    let mut candidates = search.values_with(&chosen, candidates);
    for (_, gain) in &mut candidates {
        // The objective does not exist where nothing is covered; the gain is zero there.
        *gain = gain.max(value) - value;
    }
    candidates.sort_by(better_first);
    Node { chosen, value, candidates, next: 0, bound, exact: true }
}
