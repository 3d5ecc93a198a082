//! The scores that an objective is made of, from integer tallies.

use super::{Scores, TaskScores};
use crate::problem::{Content, Entropy, Tally};
use crate::psog::to_nats;

/// The scores that an objective is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tasks {
    pub segmentation: TaskScores,
    pub detection: Option<TaskScores>,
    pub s_mig: Option<f64>,
    pub near_gain: Option<f64>,
    pub near_gain_2: Option<f64>,
    pub near_gain_3: Option<f64>,
}

impl Tasks {
    /// From sums over `frames` frames.
    pub fn new(tally: &Tally, content: &Content, frames: usize) -> Self {
        let mean = |sum: u64| sum as f64 / frames as f64;
        let gain = |kind: Entropy| to_nats(kind.of(&tally.entropy)) / frames as f64;
        let task = |kind: Entropy| {
            let total = to_nats(kind.of(&content.entropy_total()));
            task_scores(gain(kind), total, mean(tally.covered), mean(tally.covered_nonzero))
        };
        let all = Entropy::Near.of(&content.entropy_total());
        let once = Entropy::Near.of(&tally.entropy);
        let [twice, thrice] = tally.near_repeated;
        let exists = tally.covered > 0 && all > 0;
        let share = |sum: u64, times: f64| {
            exists.then(|| sum as f64 / (times * frames as f64 * all as f64))
        };
        Self {
            segmentation: task(Entropy::Classes),
            detection: content.has_detection().then(|| task(Entropy::Detection)),
            s_mig: (tally.covered > 0).then(|| negated(gain(Entropy::Occupancy))),
            near_gain: share(once, 1.0),
            near_gain_2: share(once + twice, 2.0),
            near_gain_3: share(once + twice + thrice, 3.0),
        }
    }

    /// Tasks among the scores of a placement.
    pub fn of(scores: &Scores) -> Self {
        let Scores { segmentation, detection, s_mig, near_gain, near_gain_2, near_gain_3, .. } =
            *scores;
        Self { segmentation, detection, s_mig, near_gain, near_gain_2, near_gain_3 }
    }
}

/// −`value`, without a minus before zero.
fn negated(value: f64) -> f64 {
    0.0 - value
}

fn task_scores(gain: f64, total: f64, covered: f64, nonzero: f64) -> TaskScores {
    if covered == 0.0 {
        return TaskScores::default();
    }
    let of_nonzero = |value: f64| (nonzero > 0.0).then_some(value);
    TaskScores {
        m_sog: Some(negated(gain / covered)),
        m_sog_scaled: Some(negated(gain / (covered * covered))),
        m_sog_nonzero: of_nonzero(negated(gain / nonzero)),
        m_sog_scaled_nonzero: of_nonzero(negated(gain / (nonzero * nonzero))),
        information_gain: Some(gain),
        information_gain_share: (total > 0.0).then(|| gain / total),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_minus() {
        assert!(negated(0.0).is_sign_positive());
    }
}
