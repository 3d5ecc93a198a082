//! Sets of sensors that branch and bound has yet to look at, the largest bound first.

use std::collections::BinaryHeap;

use crate::search::grid_search::better_first;
use crate::vehicle::MAX_LIDARS;

/// Relative rounding error of the sums of gains behind a bound, at most.
pub(super) const ROUNDING: f64 = 1e-12;

/// A set of sensors to be extended by candidates.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub chosen: Vec<u32>,
    /// Worth that the set covers; an upper bound of it where `exact` is false.
    pub value: f64,
    /// (pose, most worth that it adds); an extension takes `candidates[next]` or a later one first.
    pub candidates: Vec<(u32, f64)>,
    /// True if the candidates are sorted, the largest addition first.
    pub sorted: bool,
    pub next: usize,
    /// No extension is above this.
    pub bound: f64,
    /// True if values are gains, and not bounds from pairs.
    pub exact: bool,
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

    /// Drops candidates that stay below `floor` even beside the best of the others.
    fn drop_below(&mut self, floor: f64, lidars: usize) {
        let others = lidars - self.chosen.len() - 1;
        let rest = &self.candidates[self.next..];
        let others: f64 = rest.iter().take(others).map(|c| c.1).sum();
        let least = floor / (1.0 + ROUNDING) - self.value - others;
        self.candidates.truncate(self.next + rest.partition_point(|c| c.1 > least));
        self.candidates.shrink_to_fit();
    }

    /// [`Self::tighten`] and [`Self::drop_below`] for candidates in any order, which are sorted only if the node is
    /// extended: most never are. False if no extension is above `floor`.
    fn cut(&mut self, floor: f64, lidars: usize) -> bool {
        let wanted = lidars - self.chosen.len();
        // The `wanted` largest additions, falling.
        let mut top = [f64::NEG_INFINITY; MAX_LIDARS];
        let top = &mut top[..wanted];
        for &(_, added) in &self.candidates {
            if added <= top[wanted - 1] {
                continue;
            }
            let mut added = added;
            for held in top.iter_mut() {
                if added > *held {
                    std::mem::swap(held, &mut added);
                }
            }
        }
        let bound = (self.value + top.iter().sum::<f64>()) * (1.0 + ROUNDING);
        if self.candidates.len() < wanted || bound <= floor {
            return false;
        }
        let others: f64 = top[..wanted - 1].iter().sum();
        let least = floor / (1.0 + ROUNDING) - self.value - others;
        self.candidates.retain(|c| c.1 > least);
        self.candidates.shrink_to_fit();
        self.sorted = false;
        self.bound = self.bound.min(bound);
        self.candidates.len() >= wanted && self.bound > floor
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
    pub heap: BinaryHeap<Node>,
    pub lidars: usize,
    /// Nodes with no bound above this are dropped.
    pub floor: f64,
}

impl Open {
    /// Adds a set, unless no extension of it is above the floor.
    pub fn push(&mut self, mut node: Node) {
        node.drop_below(self.floor, self.lidars);
        if node.tighten(self.lidars) && node.bound > self.floor {
            self.heap.push(node);
        }
    }

    /// Adds a set whose candidates come in any order.
    pub fn push_unsorted(&mut self, mut node: Node) {
        if node.cut(self.floor, self.lidars) {
            self.heap.push(node);
        }
    }

    /// The largest bound.
    pub fn upper(&self) -> f64 {
        self.heap.peek().map_or(f64::NEG_INFINITY, |node| node.bound)
    }

    /// The node of largest bound, unless nothing above the floor is left.
    pub fn pop(&mut self) -> Option<Node> {
        let mut node = self.heap.pop().filter(|node| node.bound > self.floor)?;
        if !node.sorted {
            node.candidates.sort_unstable_by(better_first);
            node.sorted = true;
        }
        Some(node)
    }
}
