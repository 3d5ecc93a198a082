use serde_json::{Value, json};
use sightline::score::Scores;
use sightline::score::{kendall_tau, mean_height, spearman};
use sightline::vehicle::Placement;

/// The default objective, which ranks; the worst there is where it does not exist.
pub(super) fn value_of(scores: &Scores) -> f64 {
    scores.segmentation.m_sog_scaled.unwrap_or(f64::NEG_INFINITY)
}

/// Index of the placement to prefer by `value`: those that violate a guard come after all others.
pub(super) fn preferred(scores: &[Scores], value: impl Fn(&Scores) -> f64) -> Option<usize> {
    (0..scores.len()).max_by(|&a, &b| {
        let free = |k: usize| scores[k].guards.is_empty();
        free(a)
            .cmp(&free(b))
            .then(value(&scores[a]).total_cmp(&value(&scores[b])))
            // Of equal ones the first.
            .then(b.cmp(&a))
    })
}

/// The honest placements before any change.
pub(super) struct Ranking<'a> {
    pub(super) honest: &'a [Placement],
    pub(super) before: &'a [Scores],
    /// Index of the placement whose scores are shown.
    pub(super) base: usize,
}

/// The honest placements under a change that should not matter, or matter little.
pub(super) struct Stability {
    pub(super) name: String,
    /// Scores of the base under the change; the first draw's where there are several.
    pub(super) base: Scores,
    /// Largest and median change of the objective, as a share of it.
    pub(super) worst: f64,
    pub(super) median: f64,
    /// Lowest and median Kendall's τ with the unchanged ranking.
    pub(super) worst_tau: Option<f64>,
    pub(super) median_tau: Option<f64>,
    /// Spearman of the changed ranking with mean height alone.
    pub(super) null: Option<f64>,
    /// The placement to prefer under the change.
    pub(super) first: String,
}

impl Ranking<'_> {
    /// Mean heights of the honest placements, in metres.
    pub(super) fn heights(&self) -> Vec<f64> {
        self.honest.iter().map(mean_height).collect()
    }

    /// What one or several draws of a change do; `draws` is not empty.
    pub(super) fn under(&self, name: &str, draws: &[Vec<Scores>]) -> Stability {
        let values = |scores: &[Scores]| -> Vec<f64> { scores.iter().map(value_of).collect() };
        let before = values(self.before);
        let (mut changes, mut taus) = (Vec::new(), Vec::new());
        for draw in draws {
            let after = values(draw);
            let pairs = before.iter().zip(&after);
            // Where a placement covers nothing there is no score to change.
            changes.extend(
                pairs.map(|(b, a)| ((a - b) / b).abs()).filter(|change| change.is_finite()),
            );
            taus.extend(kendall_tau(&before, &after));
        }
        changes.sort_by(f64::total_cmp);
        taus.sort_by(f64::total_cmp);
        let first = preferred(&draws[0], value_of).map(|k| draws[0][k].name.clone());
        Stability {
            name: name.to_owned(),
            base: draws[0][self.base].clone(),
            worst: changes.last().copied().unwrap_or(0.0),
            median: changes.get(changes.len() / 2).copied().unwrap_or(0.0),
            worst_tau: taus.first().copied(),
            median_tau: taus.get(taus.len() / 2).copied(),
            null: spearman(&values(&draws[0]), &self.heights()),
            first: first.unwrap_or_default(),
        }
    }
}

impl Stability {
    pub(super) fn json(&self) -> Value {
        json!({
            "change": self.name,
            "base": self.base,
            "worst_relative_change": self.worst,
            "median_relative_change": self.median,
            "kendall_tau": self.worst_tau,
            "median_kendall_tau": self.median_tau,
            "ranking_against_mean_height": self.null,
            "first": self.first,
        })
    }
}

#[cfg(test)]
mod tests {
    use sightline::problem::{Content, Tally};

    use super::*;

    fn scores(name: &str, gain: u64, seen: u64) -> Scores {
        let content = Content::new(vec!["a".into()], vec![], &[vec![]], false);
        let tally = |gain: u64| Tally {
            covered: 100,
            entropy: [gain << 28, 0, 0],
            beams: 10,
            ..Tally::zero(1, 1)
        };
        Scores::new(name, &tally(gain), &content, 1, false, Some(&tally(seen)))
    }

    #[test]
    fn a_guarded_placement_is_never_preferred() {
        // The blind one has the better objective, and a guard that says why.
        let all = [scores("blind", 1, 50), scores("seeing", 40, 50), scores("same", 40, 50)];
        assert!(value_of(&all[0]) > value_of(&all[1]) && !all[0].guards.is_empty());
        assert_eq!(preferred(&all, value_of), Some(1));
        assert_eq!(preferred(&all[..1], value_of), Some(0));
        assert_eq!(preferred(&[], value_of), None);
    }

    #[test]
    fn several_draws_give_the_worst_and_the_median() {
        let pose = |z| sightline::vehicle::SensorPose {
            x: 0.0,
            y: 0.0,
            z,
            roll: 0.0,
            pitch: 0.0,
            yaw: 0.0,
        };
        let placement = |z: f64| Placement { name: format!("z{z}"), lidars: vec![pose(z)] };
        let honest = [1.0, 2.0, 3.0].map(placement);
        let draw = |gains: [u64; 3]| gains.map(|gain| scores("x", gain, 40)).to_vec();
        let before = draw([40, 30, 20]);
        let ranking = Ranking { honest: &honest, before: &before, base: 1 };
        let found = ranking.under("test", &[before.clone(), draw([20, 30, 40]), before.clone()]);
        assert_eq!((found.worst_tau, found.median_tau), (Some(-1.0), Some(1.0)));
        assert_eq!((found.worst, found.median), (1.0, 0.0));
        // Less information is the better M-SOG, so that height alone says it all.
        assert_eq!(found.null, Some(1.0));
        assert_eq!(found.base, before[1]);
    }
}
