//! Sets of sensors that branch and bound has yet to look at, the largest bound first.

use std::collections::BinaryHeap;

use crate::search::grid_search::{Places, better_first};
use crate::vehicle::MAX_LIDARS;

/// Relative rounding error of the sums of gains behind a bound, at most.
pub(super) const ROUNDING: f64 = 1e-12;

/// Poses that may still join a set, of one kind of slot.
#[derive(Debug, Clone)]
pub(super) struct Candidates {
    /// LiDARs of the kind that the set lacks.
    pub left: usize,
    /// (pose, most worth that it adds); the largest addition comes last once the node is sorted.
    pub poses: Vec<(u32, f64)>,
}

impl Candidates {
    /// Sum of the largest additions, one for each LiDAR left, and the smallest of these.
    fn best(&self, sorted: bool) -> [f64; 2] {
        if self.left == 0 {
            return [0.0; 2];
        }
        if sorted {
            let top = &self.poses[self.poses.len() - self.left..];
            return [top.iter().rev().map(|c| c.1).sum(), top[0].1];
        }
        // Falling.
        let mut top = [f64::NEG_INFINITY; MAX_LIDARS];
        let top = &mut top[..self.left];
        for &(_, added) in &self.poses {
            if added <= top[self.left - 1] {
                continue;
            }
            let mut added = added;
            for held in top.iter_mut() {
                if added > *held {
                    std::mem::swap(held, &mut added);
                }
            }
        }
        [top.iter().sum(), top[self.left - 1]]
    }
}

/// A set of sensors, and the poses that may extend it.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub chosen: Vec<u32>,
    /// Worth that the set covers, or more.
    pub value: f64,
    pub kinds: Vec<Candidates>,
    pub sorted: bool,
    /// No extension is above this.
    pub bound: f64,
    /// True if additions are gains beside all of the set, and not bounds from pairs.
    pub exact: bool,
}

impl Node {
    /// The empty set, or a first sensor.
    pub(crate) fn root(chosen: Vec<u32>, value: f64, kinds: Vec<Candidates>) -> Self {
        Self { chosen, value, kinds, sorted: false, bound: f64::INFINITY, exact: false }
    }

    pub(crate) fn left(&self) -> usize {
        self.kinds.iter().map(|kind| kind.left).sum()
    }

    pub(crate) fn candidates(&self) -> usize {
        self.kinds.iter().map(|kind| kind.poses.len()).sum()
    }

    /// Lowers the bound to the best additions of each kind: a pose never adds more than it does now. Drops
    /// candidates that stay at or below `floor` beside the best of the others. False if no extension is above `floor`.
    pub(crate) fn cut(&mut self, floor: f64) -> bool {
        let (mut sum, mut weakest) = (self.value, [0.0; MAX_LIDARS]);
        for (kind, weakest) in self.kinds.iter().zip(&mut weakest) {
            if kind.poses.len() < kind.left {
                return false;
            }
            let best = kind.best(self.sorted);
            sum += best[0];
            *weakest = best[1];
        }
        self.bound = self.bound.min(sum * (1.0 + ROUNDING));
        let least = floor / (1.0 + ROUNDING) - sum;
        for (kind, weakest) in self.kinds.iter_mut().zip(weakest) {
            kind.poses.retain(|c| kind.left > 0 && c.1 - weakest > least);
            kind.poses.shrink_to_fit();
        }
        self.bound > floor && self.kinds.iter().all(|kind| kind.poses.len() >= kind.left)
    }

    /// Takes the best candidate of the kind with the fewest out of a sorted node that lacks a LiDAR. The child has it and
    /// the candidates that fit beside it, each at the least of its addition and `added(candidate, taken)`.
    pub(crate) fn split(&mut self, places: &Places, added: impl Fn(u32, u32) -> f64) -> Self {
        let lacking = self.kinds.iter().enumerate().filter(|(_, kind)| kind.left > 0);
        let fewest =
            lacking.min_by_key(|(_, kind)| kind.poses.len()).expect("a LiDAR is lacking").0;
        let (taken, gain) = self.kinds[fewest].poses.pop().expect("a cut node has candidates");
        let kinds = self.kinds.iter().enumerate().map(|(index, kind)| {
            let left = kind.left - usize::from(index == fewest);
            let fitting = kind.poses.iter().filter(|c| left > 0 && places.fits(c.0, &[taken]));
            let poses = fitting.map(|&(pose, most)| (pose, most.min(added(pose, taken)))).collect();
            Candidates { left, poses }
        });
        Self {
            chosen: [&self.chosen[..], &[taken]].concat(),
            value: self.value + gain,
            kinds: kinds.collect(),
            sorted: false,
            bound: self.bound,
            exact: false,
        }
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
pub(super) struct Open {
    heap: BinaryHeap<Node>,
    /// Sets none of whose extensions is above this are dropped.
    pub floor: f64,
}

impl Open {
    pub(crate) fn new(floor: f64) -> Self {
        Self { heap: BinaryHeap::new(), floor }
    }

    /// Adds a set, unless no extension of it is above the floor.
    pub(crate) fn push(&mut self, mut node: Node) {
        if node.cut(self.floor) {
            self.heap.push(node);
        }
    }

    pub(crate) fn upper(&self) -> f64 {
        self.heap.peek().map_or(f64::NEG_INFINITY, |node| node.bound)
    }

    /// The set of largest bound, sorted, unless nothing above the floor is left.
    pub(crate) fn pop(&mut self) -> Option<Node> {
        let mut node = self.heap.pop().filter(|node| node.bound > self.floor)?;
        if !node.sorted {
            for kind in &mut node.kinds {
                kind.poses.sort_unstable_by(|a, b| better_first(b, a));
            }
            node.sorted = true;
        }
        Some(node)
    }
}
