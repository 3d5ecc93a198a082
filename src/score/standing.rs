//! The order of placements: rules before guards before value.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use super::{Objective, Scores};
use crate::problem::{Content, KINDS, OccupiedVoxel, REPEATS, Tally};
use crate::vehicle::Placement;

/// Rank of a placement.
///
/// A smaller violation of the mount's rules comes first, then fewer violated guards, then a larger worth. The first
/// of equal standings counts as the better, everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Standing {
    /// Broken rules of the mount in m and rad, or missing shares of requirements, summed; 0 where all are kept.
    pub violation: f64,
    /// Guards that are violated.
    pub guards: usize,
    /// The objective; `None` where it does not exist.
    pub value: Option<f64>,
    /// Penalty for a car that is not seen all round, in the objective's unit; 0 where a search does not look.
    #[serde(default)]
    pub blind: f64,
}

impl Standing {
    /// A placement that keeps the rules of the mount, by its scores.
    pub fn of(scores: &Scores, objective: &Objective) -> Self {
        Self {
            violation: scores.missing(),
            guards: scores.doubts(),
            value: objective.value(scores),
            blind: scores.blindness(),
        }
    }

    /// A placement that breaks rules of the mount by `violation` m and rad together, and was not scored.
    pub fn outside(violation: f64) -> Self {
        Self { violation, guards: 0, value: None, blind: 0.0 }
    }

    /// True if no rule is broken and no guard violated.
    pub fn is_sound(&self) -> bool {
        self.violation == 0.0 && self.guards == 0
    }

    /// The objective less the penalty for cars that are not seen.
    pub(crate) fn worth(&self) -> Option<f64> {
        self.value.map(|value| value - self.blind)
    }

    /// The better one first.
    pub(crate) fn compare(&self, other: &Self) -> Ordering {
        let value = |standing: &Self| standing.worth().unwrap_or(f64::NEG_INFINITY);
        self.violation
            .total_cmp(&other.violation)
            .then(self.guards.cmp(&other.guards))
            .then(value(other).total_cmp(&value(self)))
    }

    /// True if it ranks before another; false for equal ones.
    pub fn beats(&self, other: &Self) -> bool {
        self.compare(other) == Ordering::Less
    }

    /// Position of the best, the first of equal ones; `None` of none.
    pub fn best(standings: &[Self]) -> Option<usize> {
        (0..standings.len()).min_by(|&a, &b| standings[a].compare(&standings[b]))
    }

    /// Ranks from 0, for a strategy that only looks at the order: equal standings have equal ranks.
    pub fn ranks(standings: &[Self]) -> Vec<f64> {
        let mut order: Vec<usize> = (0..standings.len()).collect();
        order.sort_by(|&a, &b| standings[a].compare(&standings[b]));
        let mut ranks = vec![0.0; standings.len()];
        for pair in order.windows(2) {
            let is_next = standings[pair[0]].beats(&standings[pair[1]]);
            ranks[pair[1]] = ranks[pair[0]] + f64::from(u8::from(is_next));
        }
        ranks
    }

    /// −worth of a sound placement; NaN of the others, which compare by standing alone.
    pub fn cost(&self) -> f64 {
        self.worth().filter(|_| self.is_sound()).map_or(f64::NAN, |worth| -worth)
    }
}

/// Mean height of a placement's LiDARs above the ground, in metres: the null model that every
/// correlation stands beside, because height alone ranks placements much as a score does.
pub(crate) fn mean_height(placement: &Placement) -> f64 {
    placement.lidars.iter().map(|l| l.z).sum::<f64>() / placement.lidars.len() as f64
}

/// Kendall's τ-b of two equally long lists; `None` where one of them is constant.
pub(crate) fn kendall_tau(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mut agree, mut a_pairs, mut b_pairs) = (0.0, 0.0, 0.0);
    for i in 0..a.len() {
        for j in 0..i {
            let sign = |x: f64, y: f64| match x.total_cmp(&y) {
                _ if x == y => 0.0,
                std::cmp::Ordering::Less => -1.0,
                _ => 1.0,
            };
            let (da, db): (f64, f64) = (sign(a[i], a[j]), sign(b[i], b[j]));
            agree += da * db;
            a_pairs += da.abs();
            b_pairs += db.abs();
        }
    }
    (a_pairs > 0.0 && b_pairs > 0.0).then(|| agree / f64::sqrt(a_pairs * b_pairs))
}

/// Spearman's rank correlation, ties at their mean rank; `None` where one list is constant.
pub(crate) fn spearman(a: &[f64], b: &[f64]) -> Option<f64> {
    let ranks = |values: &[f64]| -> Vec<f64> {
        let rank = |v: f64| {
            let below = values.iter().filter(|&&w| w < v).count() as f64;
            let equal = values.iter().filter(|&&w| w == v).count() as f64;
            below + (equal - 1.0) / 2.0
        };
        values.iter().map(|&v| rank(v)).collect()
    };
    let (a, b) = (ranks(a), ranks(b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let dot = |x: &[f64], y: &[f64]| -> f64 {
        x.iter().zip(y).map(|(p, q)| (p - mean) * (q - mean)).sum()
    };
    let (aa, bb) = (dot(&a, &a), dot(&b, &b));
    (aa > 0.0 && bb > 0.0).then(|| dot(&a, &b) / (aa * bb).sqrt())
}

/// Sums over covered voxels that an objective needs, beside the number of occupied ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Needed {
    /// True if empty voxels count.
    pub empty: bool,
    /// Kinds of information whose sums count.
    pub entropies: [bool; KINDS],
    /// Levels of [`Tally::near_repeated`] that count: 1 up to voxels that two LiDARs cover, 2 up to three.
    pub repeats: usize,
}

impl Needed {
    /// The sums of every kind, with or without empty voxels.
    pub fn all(empty: bool) -> Self {
        Self { empty, entropies: [true; KINDS], repeats: REPEATS }
    }
}

impl Objective {
    /// The sums over covered voxels that the objective depends on.
    pub fn needed(&self) -> Needed {
        let (entropy, near_repeated) = ([1 << 28; KINDS], [1 << 28; REPEATS]);
        let least =
            Tally { covered: 1, covered_nonzero: 1, entropy, near_repeated, ..Tally::default() };
        let occupied = vec![OccupiedVoxel { index: 0, entropy: [1 << 28; KINDS] }];
        let content = Content::new(Vec::new(), occupied, &[], true);
        let differs = |change: &dyn Fn(&mut Tally)| {
            let mut other = least.clone();
            change(&mut other);
            let [one, other] =
                [&least, &other].map(|tally| self.value_of_tally(tally, &content, 1));
            one != other
        };
        let counts = |level: &usize| differs(&|tally| tally.near_repeated[*level] += 1 << 28);
        Needed {
            repeats: (0..REPEATS).rev().find(counts).map_or(0, |level| level + 1),
            empty: differs(&|tally| tally.covered += 1),
            entropies: std::array::from_fn(|kind| differs(&|tally| tally.entropy[kind] += 1 << 28)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Guard;

    #[test]
    fn a_lidar_that_could_be_left_out_is_a_fact_and_ranks_nothing() {
        let redundant = |lidar| Guard::RedundantLidar { lidar, share: 0.001 };
        let elsewhere = Guard::InScene { scene: "street".into(), guard: Box::new(redundant(1)) };
        let scores = |guards| Scores { near_gain: Some(0.5), guards, ..Scores::default() };
        let of = |guards| Standing::of(&scores(guards), &Objective::default());
        let idle = of(vec![redundant(0), elsewhere]);
        assert_eq!(idle.compare(&of(Vec::new())), Ordering::Equal);
        assert!(idle.is_sound() && idle.beats(&of(vec![Guard::CoversNothing])));
    }

    #[test]
    fn rules_rank_before_guards_before_the_objective() {
        let standing = |violation, guards, value| Standing { violation, guards, value, blind: 0.0 };
        let standings = [
            standing(0.0, 1, Some(9.0)),
            standing(0.0, 0, Some(-2.0)),
            standing(0.3, 0, None),
            standing(0.0, 0, Some(-1.0)),
            standing(0.1, 0, None),
            standing(0.0, 0, Some(-2.0)),
            standing(0.0, 0, None),
        ];
        assert_eq!(Standing::ranks(&standings), [3.0, 1.0, 5.0, 0.0, 4.0, 1.0, 2.0]);
        assert_eq!(Standing::best(&standings), Some(3));
        assert_eq!(
            Standing::best(&[standings[1], standings[5]]),
            Some(0),
            "the first of equal ones"
        );
        assert!(!standings[5].beats(&standings[1]) && standings[3].beats(&standings[1]));
        let costs = standings.map(|standing| standing.cost());
        assert!(costs[0].is_nan() && costs[2].is_nan() && costs[6].is_nan());
        assert_eq!((costs[1], costs[3]), (2.0, 1.0));
    }

    #[test]
    fn correlations_by_hand() {
        let a = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(kendall_tau(&a, &[10.0, 20.0, 30.0, 40.0]), Some(1.0));
        assert_eq!(kendall_tau(&a, &[4.0, 3.0, 2.0, 1.0]), Some(-1.0));
        // One of six pairs is the other way round.
        assert_eq!(kendall_tau(&a, &[1.0, 2.0, 4.0, 3.0]), Some(4.0 / 6.0));
        assert_eq!(spearman(&a, &[1.0, 2.0, 4.0, 3.0]), Some(0.8));
        assert_eq!(spearman(&a, &[5.0; 4]), None);
        assert_eq!(kendall_tau(&a, &[5.0; 4]), None);
    }

    #[test]
    fn what_an_objective_needs() {
        let objective = |text: &str| text.parse::<Objective>().unwrap();
        for (text, all_covered, gain) in [
            ("m_sog_scaled", true, false),
            ("detection.m_sog", true, false),
            ("m_sog_nonzero", false, false),
            ("s_mig", false, false),
            ("near_gain", false, true),
            ("information_gain", false, true),
            ("0.5*information_gain_share + 2*detection.information_gain", false, true),
            ("-1*information_gain", false, false),
            ("information_gain + m_sog", true, false),
            ("near_gain + information_gain_share + m_sog", true, false),
            ("near_gain_2", false, true),
            ("information_gain + 0.5*near_gain_3", false, true),
            ("near_gain + -1*near_gain_2", false, false),
        ] {
            let level = ["near_gain_2", "near_gain_3"].iter().rposition(|name| text.contains(name));
            assert_eq!(objective(text).needed().repeats, level.map_or(0, |k| k + 1), "{text}");
            assert_eq!(objective(text).needed().empty, all_covered, "{text}");
            assert_eq!(objective(text).is_information_gain(), gain, "{text}");
        }
    }
}
