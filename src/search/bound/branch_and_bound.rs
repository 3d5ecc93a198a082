//! A bound on the information gain of every placement on a grid.

use std::collections::BinaryHeap;

use serde::{Deserialize, Serialize};

use super::pair_overlaps::PairBound;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::{GridPlacement, GridSearch, better_first};

/// Rounding that the sums of gains behind a bound may have gathered, relative.
const ROUNDING: f64 = 1e-12;
/// Candidates that are looked at through pairs alone, at most.
const PAIR_WORK: u64 = 1 << 24;
/// Of so many poses the best one alone is typical of those in good placements.
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
/// the gains of at most `nodes` sets of sensors are looked at. Every pose must fit into the atlas at
/// once.
///
/// The gain is monotone and submodular in the set of sensors, so the gains of the best poses beside
/// any set of sensors, added to that set's value, are above every placement (Nemhauser, Wolsey,
/// Fisher 1978); and a union is below its sensors' sum less the overlaps along a tree (Hunter 1976).
/// The bound holds for other objectives only if they are such gains too, see
/// [`crate::score::Objective::is_information_gain`].
///
/// # Errors
/// As [`GridSearch::hold`].
pub fn bound_gain(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    found: &GridPlacement,
    nodes: u64,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<GainBound, SearchError> {
    let (lidars, poses) = (search.lidars(), search.atlas().grid().len());
    let all: Vec<u32> = (0..poses).collect();
    search.hold(evaluator, &all)?;
    let mut best = found.clone();
    // What the best poses gain beside the placement found bounds every placement; those that do not
    // fit beside it too, since they may stand in another.
    let mut beside = search.values_with(&found.poses, &all);
    beside.sort_by(better_first);
    let value = found.value.max(0.0);
    let beside: f64 = beside.iter().take(lidars).map(|c| c.1.max(value) - value).sum();
    let mut upper_at_root = (value + beside) * (1.0 + ROUNDING);
    let mut typical = search.values_with(&[], &all);
    typical.sort_by(better_first);
    typical.truncate(all.len().div_ceil(TYPICAL));
    let typical: Vec<u32> = typical.into_iter().map(|(pose, _)| pose).collect();
    let units = search.worth_units();
    let (pairs, upper) = PairBound::tightest(search.atlas(), lidars, units, &typical, |pairs| {
        let mut open = Open { heap: BinaryHeap::new(), lidars, floor: best.value };
        open.push(root(pairs));
        let (mut looked_at, most) = (1, pair_nodes(pairs));
        while looked_at < most
            && let Some(node) = open.pop()
        {
            if node.chosen.len() + 1 == lidars {
                open.heap.push(node);
                break;
            }
            let (child, node) = split(search, pairs, node);
            looked_at += 1;
            open.push(node);
            open.push(child);
        }
        open.upper()
    });
    upper_at_root = upper_at_root.min(upper).max(best.value);
    let mut open = Open { heap: BinaryHeap::new(), lidars, floor: best.value };
    open.push(root(&pairs));
    let (mut looked_at, mut cheaply) = (1, 0);
    while looked_at < nodes
        && cheaply < pair_nodes(&pairs)
        && go_on(looked_at)
        && let Some(mut node) = open.pop()
    {
        let left = lidars - node.chosen.len();
        if !node.exact && (left == 1 || (left == 2 && lidars > 2)) {
            let some: Vec<u32> = node.candidates[node.next..].iter().map(|c| c.0).collect();
            let others = node.chosen.clone();
            let value = search.held_value(&others);
            node = gains(search, others, value, &some, node.bound);
            looked_at += 1;
            open.push(node);
            continue;
        }
        if left == 1 {
            // Candidates come by falling gain: the first is the best of this node.
            let (pose, gain) = node.candidates[node.next];
            let value = node.value + gain;
            if value > best.value {
                best = GridPlacement { poses: [&node.chosen[..], &[pose]].concat(), value };
                open.floor = value;
            }
            continue;
        }
        if node.exact {
            let (pose, gain) = node.candidates[node.next];
            let rest: Vec<u32> = node.candidates[node.next + 1..].iter().map(|c| c.0).collect();
            let chosen = [&node.chosen[..], &[pose]].concat();
            let rest: Vec<u32> = rest.into_iter().filter(|&c| search.fits(c, &chosen)).collect();
            let child = gains(search, chosen, node.value + gain, &rest, node.bound);
            looked_at += 1;
            node.next += 1;
            open.push(node);
            open.push(child);
        } else {
            let (child, node) = split(search, &pairs, node);
            cheaply += 1;
            open.push(node);
            open.push(child);
        }
    }
    let left = open.upper();
    let upper = left.min(upper_at_root).max(best.value);
    let proven = left <= best.value;
    Ok(GainBound { poses, best, upper, upper_at_root, nodes: looked_at, proven })
}

/// Sets of sensors to look at through pairs: the root alone where no overlaps are known.
fn pair_nodes(pairs: &PairBound) -> u64 {
    if pairs.has_overlaps() { PAIR_WORK / pairs.singles().len() as u64 } else { 1 }
}

/// The empty set, extended by bounds from pairs.
fn root(pairs: &PairBound) -> Node {
    let mut candidates = pairs.singles();
    candidates.sort_by(better_first);
    let (value, bound) = (pairs.base, f64::INFINITY);
    Node { chosen: vec![], value, candidates, next: 0, bound, exact: false }
}

/// Takes the next candidate out of a node, as a child with bounds from pairs.
fn split(search: &GridSearch, pairs: &PairBound, mut node: Node) -> (Node, Node) {
    let (pose, added) = node.candidates[node.next];
    node.next += 1;
    let rest = node.candidates[node.next..].iter().filter(|c| search.fits(c.0, &[pose]));
    let mut candidates: Vec<(u32, f64)> =
        rest.map(|&(other, added)| (other, pairs.added(other, pose, added))).collect();
    candidates.sort_by(better_first);
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
