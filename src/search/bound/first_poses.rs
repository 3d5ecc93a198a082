//! A bound from sets of sensors by their first pose: overlaps of pairs count outside that pose.

use rayon::prelude::*;

use super::open_sets::{Candidates, Node, Open};
use super::required::BoundRequirements;
use super::voxel_groups::Columns;
use crate::search::grid_search::Places;

/// Candidates that the sets of one first pose may hold, at most: 16 bytes each.
const MOST_CANDIDATES: usize = 1 << 24;
/// Words whose reading takes as long as all else of a pair and the sets with it.
const WORDS_OF_PAIR: u64 = 1024;

/// Sets of sensors by their first pose.
///
/// Each placement has one pose, its best, of the kind of slot that has the fewest poses. Beside that pose the others add
/// their worth outside it, less their overlaps outside it along a tree (Hunter 1976). A set that this leaves above the
/// floor is looked at exactly.
pub(super) struct FirstPoses<'a> {
    columns: &'a Columns,
    places: &'a Places,
    required: Option<&'a BoundRequirements<'a>>,
    /// Worth of an integer unit of the columns.
    unit: f64,
    /// Poses of the kind with the fewest, the largest worth first.
    firsts: Vec<u32>,
    /// Number in `firsts` of each pose; that of other kinds is the largest there is.
    rank: Vec<usize>,
    /// Candidates that the sets of one first pose may hold.
    most_candidates: usize,
}

/// Outcome of a look at all sets.
#[derive(Debug, Clone, Default)]
pub(super) struct FirstPosesBound {
    /// No set that was looked at is above this.
    pub upper: f64,
    /// True if every set was looked at.
    pub is_whole: bool,
    /// The best set above the floor, if any.
    pub best: Option<(Vec<u32>, f64)>,
    /// Sets whose gains were looked at.
    pub sets: u64,
}

impl<'a> FirstPoses<'a> {
    /// All sets of the poses of the columns that may meet the requirements, within about `memory` bytes.
    pub(crate) fn new(
        columns: &'a Columns,
        places: &'a Places,
        required: Option<&'a BoundRequirements<'a>>,
        unit: f64,
        memory: u64,
    ) -> Self {
        let poses = columns.poses as u32;
        let of_kind = |kind: usize| (0..poses).filter(move |&pose| places.kind(pose) == kind);
        let lidars = &places.lidars_by_kind;
        let kinds = (0..lidars.len()).filter(|&kind| lidars[kind] > 0);
        let fewest = kinds.min_by_key(|&kind| of_kind(kind).count()).unwrap_or(0);
        let mut firsts: Vec<u32> = of_kind(fewest).filter(|&p| places.fits(p, &[])).collect();
        firsts.sort_by_key(|&pose| (std::cmp::Reverse(columns.single(pose)), pose));
        let mut rank = vec![usize::MAX; poses as usize];
        for pose in of_kind(fewest) {
            // Poses that break a rule by themselves come before all.
            rank[pose as usize] = 0;
        }
        firsts.iter().enumerate().for_each(|(at, &pose)| rank[pose as usize] = at);
        let each = memory / (64 * rayon::current_num_threads() as u64);
        let most_candidates = (each as usize).min(MOST_CANDIDATES);
        Self { columns, places, required, unit, firsts, rank, most_candidates }
    }

    /// Words of bitmaps that could be read in the time that all sets take, about.
    pub(crate) fn words(&self) -> u64 {
        let of = |at: usize| self.rank.iter().filter(|&&rank| rank > at).count() as u64;
        let pairs = (0..self.firsts.len()).map(|at| of(at).pow(2) / 2).sum::<u64>();
        pairs * (self.columns.lead().len() as u64 + WORDS_OF_PAIR)
    }

    pub(crate) fn count(&self) -> u64 {
        self.firsts.len() as u64
    }

    /// Bytes that a look takes beside the columns, at most.
    pub(crate) fn bytes(&self) -> u64 {
        let poses = self.columns.poses as u64;
        let overlaps = 8 * poses * (poses + self.columns.lead().len() as u64);
        rayon::current_num_threads() as u64 * (overlaps + 16 * self.most_candidates as u64)
    }

    /// Looks at every set that may be above `floor`, for at most `most_words` words of bitmaps a first pose. `go_on` is asked
    /// after some first poses, with the number done and that of all.
    pub(crate) fn look(
        &self,
        floor: f64,
        most_words: u64,
        go_on: &mut dyn FnMut([u64; 2]) -> bool,
    ) -> FirstPosesBound {
        let mut looked = FirstPosesBound { upper: floor, ..FirstPosesBound::default() };
        let numbers: Vec<usize> = (0..self.firsts.len()).collect();
        let mut done = 0;
        for some in numbers.chunks(rayon::current_num_threads()) {
            if !go_on([done, numbers.len() as u64]) {
                return looked;
            }
            let each = some.par_iter().map(|&at| self.sets_of(at, floor, most_words));
            for one in each.collect::<Vec<FirstPosesBound>>() {
                looked.upper = looked.upper.max(one.upper);
                looked.sets += one.sets;
                let value =
                    |best: &Option<(_, f64)>| best.as_ref().map_or(f64::NEG_INFINITY, |b| b.1);
                if value(&one.best) > value(&looked.best) {
                    looked.best = one.best;
                }
            }
            done += some.len() as u64;
        }
        go_on([done; 2]);
        FirstPosesBound { is_whole: true, ..looked }
    }

    fn sets_of(&self, at: usize, floor: f64, most_words: u64) -> FirstPosesBound {
        let mut open = Open::new(floor);
        let mut first = self.first(at);
        if self.may_meet(&mut first) {
            open.push(first);
        }
        let Some(node) = open.pop() else {
            return FirstPosesBound { upper: floor, ..FirstPosesBound::default() };
        };
        let pairs = Beside::new(self, &node);
        let mut words = (node.candidates() as u64).pow(2) / 2 * self.columns.lead().len() as u64;
        open.push(node);
        let (mut looked, mut held) = (FirstPosesBound::default(), 0);
        while held <= self.most_candidates
            && words <= most_words
            && let Some(mut node) = open.pop()
        {
            if node.left() == 0 {
                let value = self.unit * self.columns.union(&node.chosen) as f64;
                let meets = || self.required.is_none_or(|required| required.meets(&node.chosen));
                if value > open.floor && meets() {
                    open.floor = value;
                    looked.best = Some((node.chosen, value));
                }
            } else if node.exact {
                let child = node.split(self.places, |pose, beside| pairs.added(pose, beside));
                held += child.candidates() + 1;
                open.push(node);
                open.push(child);
            } else if self.may_meet(&mut node) {
                self.make_exact(&mut node);
                words += node.candidates() as u64 * self.columns.words as u64;
                looked.sets += 1;
                open.push(node);
            }
        }
        looked.upper = open.floor.max(open.upper());
        looked
    }

    /// Drops candidates that the requirements rule out. False if they rule out every extension of a set.
    fn may_meet(&self, node: &mut Node) -> bool {
        self.required.is_none_or(|required| required.cut(node))
    }

    /// The set of one first pose alone. Its candidates are all poses of other kinds, and later poses of its own.
    fn first(&self, at: usize) -> Node {
        let first = self.firsts[at];
        let outside = self.columns.outside(&[first]);
        let kinds = self.places.lidars_by_kind.iter().enumerate().map(|(kind, &lidars)| {
            let left = lidars - usize::from(kind == self.places.kind(first));
            let later = |&pose: &u32| {
                let is_of_kind = left > 0 && self.places.kind(pose) == kind;
                is_of_kind && self.rank[pose as usize] > at && self.places.fits(pose, &[first])
            };
            let all = (0..self.columns.poses as u32).filter(later);
            let poses =
                all.map(|pose| (pose, self.unit * self.columns.most(pose, &outside) as f64));
            Candidates { left, poses: poses.collect() }
        });
        let value = self.unit * self.columns.single(first) as f64;
        Node { exact: true, ..Node::root(vec![first], value, kinds.collect()) }
    }

    /// Puts the gains of candidates beside the whole set in the place of bounds.
    fn make_exact(&self, node: &mut Node) {
        let outside = self.columns.outside(&node.chosen);
        for (pose, added) in node.kinds.iter_mut().flat_map(|kind| &mut kind.poses) {
            *added = added.min(self.unit * self.columns.most(*pose, &outside) as f64);
        }
        (node.exact, node.sorted) = (true, false);
    }
}

/// Worths of the candidates of a first pose, and of what two of them share, outside that pose.
struct Beside {
    /// Number of each pose of the grid among the candidates.
    number: Vec<u32>,
    singles: Vec<f64>,
    /// `[candidates × candidates]`; lower bounds, since they are of the leading columns alone.
    overlaps: Vec<f64>,
}

impl Beside {
    fn new(firsts: &FirstPoses, first: &Node) -> Self {
        let candidates: Vec<(u32, f64)> =
            first.kinds.iter().flat_map(|kind| kind.poses.clone()).collect();
        let mut number = vec![u32::MAX; firsts.columns.poses];
        for (index, &(pose, _)) in candidates.iter().enumerate() {
            number[pose as usize] = index as u32;
        }
        let poses: Vec<u32> = candidates.iter().map(|c| c.0).collect();
        let overlaps = firsts.columns.lead_overlaps(&poses, &firsts.columns.outside(&first.chosen));
        let overlaps = overlaps.into_iter().map(|sum| firsts.unit * sum as f64).collect();
        Self { number, singles: candidates.iter().map(|c| c.1).collect(), overlaps }
    }

    /// Most worth that a pose adds to a set with `beside` in it.
    fn added(&self, pose: u32, beside: u32) -> f64 {
        let [pose, beside] = [pose, beside].map(|pose| self.number[pose as usize] as usize);
        self.singles[pose] - self.overlaps[beside * self.singles.len() + pose]
    }
}
