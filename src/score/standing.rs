//! The order of placements: rules before guards before value.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use super::{Objective, Scores};

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
            guards: objective.guards_against(scores),
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
    pub fn worth(&self) -> Option<f64> {
        self.value.map(|value| value - self.blind)
    }

    /// The better one first.
    pub fn compare(&self, other: &Self) -> Ordering {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Guard;

    #[test]
    fn a_redundant_lidar_counts_against_a_placement_unless_it_is_wanted() {
        let redundant = |lidar| Guard::RedundantLidar { lidar, share: 0.001 };
        let elsewhere = Guard::InScene { scene: "street".into(), guard: Box::new(redundant(1)) };
        let guards = vec![Guard::CoversNothing, redundant(0), elsewhere];
        let scores = Scores { guards, ..Scores::default() };
        for (text, guards) in [("near_gain", 3), ("near_gain_2", 1), ("m_sog + near_gain_3", 1)] {
            let objective: Objective = text.parse().unwrap();
            assert_eq!(Standing::of(&scores, &objective).guards, guards, "{text}");
        }
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
}
