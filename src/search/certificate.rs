//! How far from the best possible placement a result can be.

use std::collections::BinaryHeap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::swaps::better_first;
use super::{Evaluator, GridPlacement, GridSearch, SearchError};
use crate::placement::{Placement, PoseGrid};
use crate::score::Objective;

/// Rounding that the sums of gains behind a bound may have gathered, relative.
const ROUNDING: f64 = 1e-12;

/// Bound on the information gain of every placement on a grid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainBound {
    /// Poses of the grid.
    pub poses: u32,
    /// The best placement met while bounding, the one given included.
    pub best: GridPlacement,
    /// No placement on the grid has an objective above this.
    pub upper: f64,
    /// `upper` without branch and bound: from the gains of single poses alone.
    pub upper_at_root: f64,
    /// Sets of sensors whose gains were looked at.
    pub nodes: u64,
    /// Whether the best placement is proven to be the best on the grid.
    pub proven: bool,
}

/// A set of sensors to be extended, its candidates by falling gain.
struct Node {
    chosen: Vec<u32>,
    value: f64,
    /// (pose, gain) from the first that was not taken yet on.
    candidates: Vec<(u32, f64)>,
    next: usize,
    bound: f64,
}

impl Node {
    /// Bound on extensions of which `candidates[next]` is the first: by submodularity a pose gains at
    /// most what it gains now.
    fn bound(&self, lidars: usize) -> Option<f64> {
        let wanted = lidars - self.chosen.len();
        let gains = self.candidates.get(self.next..self.next + wanted)?;
        Some((self.value + gains.iter().map(|c| c.1).sum::<f64>()) * (1.0 + ROUNDING))
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

/// Bounds an information gain over all placements on the grid: branch and bound, best first, over at
/// most `nodes` sets of sensors. Every pose must fit into the atlas at once.
///
/// The gain is monotone and submodular in the set of sensors, so the gains of the best poses beside
/// any set of sensors, added to that set's value, are above every placement (Nemhauser, Wolsey,
/// Fisher 1978). The bound holds for other objectives only if they are such gains too, see
/// [`Objective::is_information_gain`].
///
/// # Errors
/// As [`GridSearch::hold`].
pub fn bound_gain(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    found: &GridPlacement,
    nodes: u64,
    go_on: &dyn Fn() -> bool,
) -> Result<GainBound, SearchError> {
    let (lidars, poses) = (search.lidars(), search.atlas().grid().len());
    let all: Vec<u32> = (0..poses).collect();
    search.hold(evaluator, &all)?;
    let mut best = found.clone();
    let root = open(search, Vec::new(), 0.0, &all);
    // What the best poses gain beside the placement found bounds every placement as well; those that
    // do not fit beside it too, since they may stand in another.
    let mut beside = search.values_with(&found.poses, &all);
    beside.sort_by(better_first);
    let beside: f64 = beside.iter().take(lidars).map(|c| c.1 - found.value).sum();
    let upper_beside = (found.value + beside) * (1.0 + ROUNDING);
    let mut heap = BinaryHeap::new();
    let mut upper_at_root = best.value;
    let push = |heap: &mut BinaryHeap<Node>, mut node: Node, best: f64| {
        if let Some(bound) = node.bound(lidars)
            && bound > best
        {
            node.bound = bound;
            heap.push(node);
        }
    };
    if let Some(bound) = root.bound(lidars) {
        upper_at_root = bound.min(upper_beside).max(best.value);
    }
    push(&mut heap, root, best.value);
    let mut looked_at = 2;
    while looked_at < nodes && go_on() {
        let Some(mut node) = heap.pop() else { break };
        if node.bound <= best.value {
            break;
        }
        let (pose, gain) = node.candidates[node.next];
        let chosen = [&node.chosen[..], &[pose]].concat();
        let value = node.value + gain;
        if chosen.len() == lidars {
            // Candidates come by falling gain: the first is the best of this node.
            best = GridPlacement { poses: chosen, value };
            continue;
        }
        let rest: Vec<u32> = node.candidates[node.next + 1..].iter().map(|c| c.0).collect();
        node.next += 1;
        push(&mut heap, node, best.value);
        let child = open(search, chosen, value, &rest);
        looked_at += 1;
        push(&mut heap, child, best.value);
    }
    let open_bound = heap.peek().map_or(f64::NEG_INFINITY, |node| node.bound);
    let upper = open_bound.min(upper_at_root).max(best.value);
    let proven = open_bound <= best.value;
    Ok(GainBound { poses, best, upper, upper_at_root, nodes: looked_at, proven })
}

/// A node with the gains of those candidates that fit beside its sensors.
fn open(search: &mut GridSearch, chosen: Vec<u32>, value: f64, candidates: &[u32]) -> Node {
    let fitting = candidates.iter().copied().filter(|&pose| search.fits(pose, &chosen));
    let fitting: Vec<u32> = fitting.collect();
    let mut candidates = search.values_with(&chosen, &fitting);
    for (_, gain) in &mut candidates {
        *gain -= value;
    }
    candidates.sort_by(better_first);
    Node { chosen, value, candidates, next: 0, bound: f64::INFINITY }
}

/// Theorem 1 of Place3D: |G(u*) − G(best sampled)| ≤ C_M + k_G·δ, from measured numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LipschitzBound {
    /// Largest less smallest objective of the placements sampled on the grid.
    pub c_m: f64,
    /// Largest change of the objective a metre (or radian) between neighbours on the grid.
    pub k_g: f64,
    /// Largest spacing of the grid along a pose field that may vary, in m or rad.
    pub delta: f64,
    /// C_M + k_G·δ.
    pub bound: f64,
    /// Placements sampled, their neighbours not counted.
    pub samples: usize,
}

/// Placements sampled on a grid in pairs of neighbours, with their objectives.
#[derive(Debug, Clone, PartialEq)]
pub struct GridSample {
    pairs: Vec<(Placement, Option<f64>)>,
    delta: f64,
}

impl GridSample {
    /// Samples placements, each with one neighbour a step along one pose field away.
    ///
    /// Ties between LiDARs are left out: random poses never keep them.
    /// Placements that break another rule of the mount are drawn again, but not for ever: the sample may be
    /// smaller than asked for, and is empty where nothing may vary.
    ///
    /// # Errors
    /// As [`Evaluator::scores`].
    pub fn draw(
        evaluator: &mut Evaluator,
        grid: &PoseGrid,
        objective: &Objective,
        samples: usize,
        seed: u64,
    ) -> Result<Self, SearchError> {
        let constraints = evaluator.constraints().untied();
        let free = constraints.free_fields();
        let delta = free.iter().map(|&k| grid.step()[k]).fold(0.0, f64::max);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut placements = Vec::new();
        for _ in 0..100 * samples {
            if placements.len() == 2 * samples {
                break;
            }
            let poses: Vec<u32> =
                (0..constraints.lidars).map(|_| rng.random_range(0..grid.len())).collect();
            let lidar = rng.random_range(0..constraints.lidars);
            let mut near = grid.along(poses[lidar], 1);
            near.retain(|&pose| pose != poses[lidar]);
            if near.is_empty() {
                break;
            }
            let mut moved = poses.clone();
            moved[lidar] = near[rng.random_range(0..near.len())];
            let [a, b] = [poses, moved].map(|poses| Placement {
                name: "sample".into(),
                lidars: poses.iter().map(|&pose| grid.pose(pose)).collect(),
            });
            if constraints.violations(&a).is_empty() && constraints.violations(&b).is_empty() {
                placements.extend([a, b]);
            }
        }
        let scores = evaluator.scores(&placements)?;
        let values = scores.iter().map(|scores| objective.value(scores));
        Ok(Self { pairs: placements.into_iter().zip(values).collect(), delta })
    }

    /// The placements that have an objective.
    pub fn scored(&self) -> Vec<(Placement, f64)> {
        self.pairs.iter().filter_map(|(p, value)| Some((p.clone(), (*value)?))).collect()
    }

    /// The paper's bound. The sample decides about C_M and k_G: both are estimates from below. C_M
    /// alone is as large as the range of the sampled scores, so the bound tells nothing that the
    /// sample does not; it is reported because the paper does.
    ///
    /// `None` where no sampled placement has an objective.
    pub fn lipschitz(&self) -> Option<LipschitzBound> {
        let scored = self.scored();
        let (low, high) =
            scored.iter().fold((f64::MAX, f64::MIN), |(l, h), (_, v)| (l.min(*v), h.max(*v)));
        let slopes = self.pairs.chunks(2).filter_map(|pair| {
            let fields = pair[0].0.lidars.iter().zip(&pair[1].0.lidars);
            let fields = fields.flat_map(|(a, b)| a.fields().into_iter().zip(b.fields()));
            let apart: f64 = fields.map(|((_, a), (_, b))| (a - b).abs()).sum();
            Some((pair[0].1? - pair[1].1?).abs() / apart)
        });
        let k_g = slopes.fold(0.0, f64::max);
        let (c_m, delta) = (high - low, self.delta);
        let samples = self.pairs.len() / 2;
        let bound = c_m + k_g * delta;
        (!scored.is_empty()).then_some(LipschitzBound { c_m, k_g, delta, bound, samples })
    }
}

/// What is known about how much better than the result another placement could be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// The paper's bound; `None` where nothing could be sampled.
    pub lipschitz: Option<LipschitzBound>,
    /// What it means.
    pub lipschitz_says: String,
    /// The bound on the grid; `None` for objectives that have none, or where it was not computed.
    pub gain: Option<GainBound>,
    /// What it means.
    pub gain_says: String,
}

impl Certificate {
    /// Puts both bounds into words. `found` is the objective of the result; `gain` is the bound, or
    /// why there is none.
    pub fn new(
        lipschitz: Option<LipschitzBound>,
        gain: Result<GainBound, String>,
        found: f64,
    ) -> Self {
        let lipschitz_says = match &lipschitz {
            None => "nothing could be sampled on the grid".to_owned(),
            Some(LipschitzBound { c_m, k_g, delta, bound, samples }) => format!(
                "C_M + k_G·δ = {c_m:.3e} + {k_g:.3e} · {delta} = {bound:.3e}, from {samples} sampled \
                 placements: as large as the whole range of their scores, so it tells nothing about \
                 this result"
            ),
        };
        let (gain, gain_says) = match gain {
            Err(why) => (None, why),
            Ok(gain) => {
                let more = 100.0 * (gain.upper / found - 1.0);
                let poses = gain.poses;
                let says = if more <= 0.0 {
                    format!(
                        "no placement on the grid of {poses} sensor poses is better than the result"
                    )
                } else if gain.proven {
                    format!(
                        "the best placement on the grid of {poses} sensor poses is {more:.2} % better \
                         than the result (proven)"
                    )
                } else {
                    format!(
                        "the best placement on the grid of {poses} sensor poses is at most {more:.2} % \
                         better than the result"
                    )
                };
                (Some(gain), says)
            }
        };
        Self { lipschitz, lipschitz_says, gain, gain_says }
    }
}
