//! Effect of a change of the model on the ranking of honest placements.

use serde::Serialize;

use crate::score::{Objective, Scores};
use crate::score::{kendall_tau, mean_height, spearman};
use crate::vehicle::Placement;

/// The honest placements under one change that should matter little.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stability {
    /// The change.
    pub change: String,
    /// Scores of the base under the change; the first draw's where there are several.
    pub base: Scores,
    /// Largest |after − before| / |before| of the objective over placements and draws.
    pub worst_relative_change: f64,
    /// Median of these relative changes.
    pub median_relative_change: f64,
    /// Lowest Kendall's τ-b of a draw with the unchanged ranking; `None` where either is constant.
    pub kendall_tau: Option<f64>,
    /// Median of Kendall's τ-b over the draws.
    pub median_kendall_tau: Option<f64>,
    /// Spearman's rank correlation of the changed ranking with mean height alone.
    pub ranking_against_mean_height: Option<f64>,
    /// The placement that comes first under the change.
    pub first: String,
}

/// The honest placements before any change.
pub(super) struct Ranking<'a> {
    honest: &'a [Placement],
    objective: &'a Objective,
    values: Vec<f64>,
    base: usize,
}

impl<'a> Ranking<'a> {
    /// Ranks placements by their scores; `None` without a placement.
    pub(super) fn new(
        honest: &'a [Placement],
        scores: &[Scores],
        objective: &'a Objective,
    ) -> Option<Self> {
        let base = first(scores, objective)?;
        Some(Self { honest, objective, values: values(scores, objective), base })
    }

    pub(super) fn honest(&self) -> &[Placement] {
        self.honest
    }

    /// Index of the placement that comes first.
    pub(super) fn base(&self) -> usize {
        self.base
    }

    pub(super) fn against_mean_height(&self) -> Option<f64> {
        spearman(&self.values, &self.heights())
    }

    /// Mean heights of the honest placements, in metres.
    fn heights(&self) -> Vec<f64> {
        self.honest.iter().map(mean_height).collect()
    }

    /// One or several draws of a change, each with a score for each placement; `draws` is not empty.
    pub(super) fn under(&self, change: &str, draws: &[Vec<Scores>]) -> Stability {
        let (mut changes, mut taus) = (Vec::new(), Vec::new());
        for draw in draws {
            let after = values(draw, self.objective);
            let pairs = self.values.iter().zip(&after);
            // A placement that covers nothing has no score to change.
            changes.extend(pairs.map(|(b, a)| ((a - b) / b).abs()).filter(|c| c.is_finite()));
            taus.extend(kendall_tau(&self.values, &after));
        }
        changes.sort_by(f64::total_cmp);
        taus.sort_by(f64::total_cmp);
        let first = first(&draws[0], self.objective).map(|k| draws[0][k].name.clone());
        Stability {
            change: change.to_owned(),
            base: draws[0][self.base].clone(),
            worst_relative_change: changes.last().copied().unwrap_or(0.0),
            median_relative_change: changes.get(changes.len() / 2).copied().unwrap_or(0.0),
            kendall_tau: taus.first().copied(),
            median_kendall_tau: taus.get(taus.len() / 2).copied(),
            ranking_against_mean_height: spearman(
                &values(&draws[0], self.objective),
                &self.heights(),
            ),
            first: first.unwrap_or_default(),
        }
    }
}

/// The objective of each placement; −∞ where it does not exist.
fn values(scores: &[Scores], objective: &Objective) -> Vec<f64> {
    scores.iter().map(|s| objective.value(s).unwrap_or(f64::NEG_INFINITY)).collect()
}

/// Index of the placement that comes first: those without a violated guard before the others, then by
/// the objective; of equal ones the first.
fn first(scores: &[Scores], objective: &Objective) -> Option<usize> {
    let values = values(scores, objective);
    let is_free = |k: usize| scores[k].guards.is_empty();
    (0..scores.len()).max_by(|&a, &b| {
        is_free(a).cmp(&is_free(b)).then(values[a].total_cmp(&values[b])).then(b.cmp(&a))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Content, Tally};
    use crate::vehicle::SensorPose;

    fn scores(name: &str, gain: u64, seen: u64) -> Scores {
        let content = Content::new(vec!["a".into()], vec![], &[vec![]], false);
        let tally = |gain: u64| Tally {
            covered: 100,
            entropy: [gain << 28, 0, 0, 0],
            beams: 10,
            ..Tally::zero(1, 1)
        };
        Scores::new(name, &tally(gain), &content, 1, false, Some(&tally(seen)))
    }

    #[test]
    fn a_guarded_placement_never_comes_first() {
        // By M-SOG the blind one is the best, and a guard says why.
        let objective: Objective = "m_sog_scaled".parse().unwrap();
        let all = [scores("blind", 1, 50), scores("seeing", 40, 50), scores("same", 40, 50)];
        let values = values(&all, &objective);
        assert!(values[0] > values[1] && !all[0].guards.is_empty());
        assert_eq!(first(&all, &objective), Some(1));
        assert_eq!(first(&all[..1], &objective), Some(0));
        assert_eq!(first(&[], &objective), None);
    }

    #[test]
    fn several_draws_give_the_worst_and_the_median() {
        let pose = |z| SensorPose { x: 0.0, y: 0.0, z, ..SensorPose::default() };
        let placement = |z: f64| Placement { name: format!("z{z}"), lidars: vec![pose(z)] };
        let honest = [1.0, 2.0, 3.0].map(placement);
        let draw = |gains: [u64; 3]| gains.map(|gain| scores("x", gain, 40)).to_vec();
        let before = draw([20, 40, 30]);
        let objective = "information_gain".parse().unwrap();
        let ranking = Ranking::new(&honest, &before, &objective).unwrap();
        assert_eq!(ranking.base(), 1);
        // τ by hand: of three pairs the second draw turns all round. Gains change from 20 to 40 (1), 40 to 20 (1/2).
        let found = ranking.under("test", &[before.clone(), draw([40, 20, 30]), before.clone()]);
        assert_eq!((found.kendall_tau, found.median_kendall_tau), (Some(-1.0), Some(1.0)));
        assert_eq!((found.worst_relative_change, found.median_relative_change), (1.0, 0.0));
        // Ranks 1, 3, 2 against heights 1, 2, 3: 1 − 6 · (0 + 1 + 1) / (3 · 8) = 1/2.
        assert_eq!(found.ranking_against_mean_height, Some(0.5));
        assert_eq!(found.base, before[1]);
    }
}
