//! Errors of a setting's scores and ranking against the reference.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::score::kendall_tau;

/// Resamples of the bootstrap.
const RESAMPLES: usize = 500;

/// A value with the 95 % interval of its bootstrap over placements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BootstrapInterval {
    /// Over all placements.
    pub value: f64,
    /// 2.5 % of the resamples lie below.
    pub low: f64,
    /// 2.5 % of the resamples lie above.
    pub high: f64,
}

/// Errors of a setting's scores and ranking against the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RankingError {
    /// Largest |score − reference| / |reference|.
    pub score_largest: f64,
    /// Median of |score − reference| / |reference|.
    pub score_median: f64,
    /// Kendall's τ-b of the two rankings; `None` where one of them is constant.
    pub tau: Option<BootstrapInterval>,
    /// Loss by taking the setting's best placement: (best − its reference score) / |best|.
    pub regret: BootstrapInterval,
    /// Share that changes places of the pairs whose reference scores are farther apart than the tolerance, a share of
    /// |best|; a pair that the setting scores alike counts as half of one.
    pub swapped: BootstrapInterval,
}

impl RankingError {
    /// Compares scores of the same placements; `None` ranks last. `None` if there are none to compare.
    pub fn new(
        reference: &[Option<f64>],
        scores: &[Option<f64>],
        tolerance: f64,
        seed: u64,
    ) -> Option<Self> {
        let (reference, scores) = comparable(reference, scores);
        if reference.is_empty() {
            return None;
        }
        let mut errors: Vec<f64> = reference
            .iter()
            .zip(&scores)
            .map(|(r, s)| if r == s { 0.0 } else { ((s - r) / r).abs() })
            .collect();
        errors.sort_by(f64::total_cmp);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let count = reference.len();
        let (mut taus, mut regrets, mut swaps) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..RESAMPLES {
            let drawn: Vec<usize> = (0..count).map(|_| rng.random_range(0..count)).collect();
            let pick = |of: &[f64]| drawn.iter().map(|&i| of[i]).collect::<Vec<f64>>();
            let (r, s) = (pick(&reference), pick(&scores));
            taus.extend(kendall_tau(&r, &s));
            regrets.push(regret(&r, &s));
            swaps.push(swapped(&r, &s, tolerance));
        }
        let tau = kendall_tau(&reference, &scores);
        Some(Self {
            score_largest: errors[count - 1],
            score_median: errors[count / 2],
            tau: tau.map(|tau| interval(tau, taus)),
            regret: interval(regret(&reference, &scores), regrets),
            swapped: interval(swapped(&reference, &scores, tolerance), swaps),
        })
    }
}

/// [`RankingError::swapped`] alone, for the first placements of a setting; `None` if there are none to compare.
pub(super) fn swapped_interval(
    reference: &[Option<f64>],
    scores: &[Option<f64>],
    tolerance: f64,
    seed: u64,
) -> Option<BootstrapInterval> {
    let (reference, scores) = comparable(reference, scores);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = reference.len();
    let resampled = (0..RESAMPLES).map(|_| {
        let drawn: Vec<usize> = (0..count).map(|_| rng.random_range(0..count)).collect();
        let pick = |of: &[f64]| drawn.iter().map(|&i| of[i]).collect::<Vec<f64>>();
        swapped(&pick(&reference), &pick(&scores), tolerance)
    });
    (count > 0).then(|| interval(swapped(&reference, &scores, tolerance), resampled.collect()))
}

/// Scores of the placements that the reference scores; those without a score rank last.
fn comparable(reference: &[Option<f64>], scores: &[Option<f64>]) -> (Vec<f64>, Vec<f64>) {
    let known = reference.iter().zip(scores);
    known.filter_map(|(r, s)| Some(((*r)?, s.unwrap_or(f64::NEG_INFINITY)))).unzip()
}

fn best(scores: &[f64]) -> f64 {
    scores.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

fn swapped(reference: &[f64], scores: &[f64], tolerance: f64) -> f64 {
    let apart = tolerance * best(reference).abs();
    let (mut pairs, mut swapped) = (0.0, 0.0);
    for i in 0..reference.len() {
        for j in 0..reference.len() {
            if reference[i] - reference[j] > apart {
                pairs += 1.0;
                swapped += match scores[i].total_cmp(&scores[j]) {
                    _ if scores[i] == scores[j] => 0.5,
                    std::cmp::Ordering::Less => 1.0,
                    _ => 0.0,
                };
            }
        }
    }
    if pairs > 0.0 { swapped / pairs } else { 0.0 }
}

fn regret(reference: &[f64], scores: &[f64]) -> f64 {
    let best = best(reference);
    let top = (0..scores.len())
        .max_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(b.cmp(&a)))
        .unwrap_or(0);
    if best == reference[top] { 0.0 } else { (best - reference[top]) / best.abs() }
}

fn interval(value: f64, mut resampled: Vec<f64>) -> BootstrapInterval {
    resampled.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * resampled.len() as f64) as usize;
        resampled.get(index.min(resampled.len().saturating_sub(1))).copied().unwrap_or(value)
    };
    BootstrapInterval { value, low: at(0.025).min(value), high: at(0.975).max(value) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some(values: &[f64]) -> Vec<Option<f64>> {
        values.iter().copied().map(Some).collect()
    }

    #[test]
    fn errors_by_hand() {
        let reference = some(&[-4.0, -2.0, -1.0, -5.0]);
        let same = RankingError::new(&reference, &reference, 0.0, 1).unwrap();
        assert_eq!((same.score_largest, same.regret.value), (0.0, 0.0));
        assert_eq!(same.tau.unwrap().value, 1.0);
        // The two best change places: one pair of six, and -2 is taken instead of -1.
        let swapped = some(&[-4.0, -1.0, -1.5, -5.0]);
        let error = RankingError::new(&reference, &swapped, 0.0, 1).unwrap();
        assert_eq!(error.tau.unwrap().value, 4.0 / 6.0);
        assert_eq!(error.regret.value, 1.0);
        assert_eq!((error.score_largest, error.score_median), (0.5, 0.5));
        let tau = error.tau.unwrap();
        assert!(tau.low < tau.value && tau.value < tau.high, "{tau:?}");
        assert_eq!((error.regret.low, error.regret.high), (0.0, 1.0));
        assert_eq!(error.swapped.value, 1.0 / 6.0);
        // The swapped pair lies 100 % of the best apart; four of the six pairs lie farther apart.
        let tolerant = RankingError::new(&reference, &swapped, 1.0, 1).unwrap();
        assert_eq!((tolerant.swapped.value, tolerant.swapped.high), (0.0, 0.0));
        // Four pairs lie more than 150 % apart: one changes places, and one is scored alike.
        let mixed = some(&[-2.0, -4.0, -1.0, -4.0]);
        let error = RankingError::new(&reference, &mixed, 1.5, 1).unwrap();
        assert_eq!(error.swapped.value, 1.5 / 4.0);
        // A scale that changes all scores alike changes no rank.
        let scaled = some(&[-8.0, -4.0, -2.0, -10.0]);
        let error = RankingError::new(&reference, &scaled, 0.0, 1).unwrap();
        assert_eq!((error.score_median, error.regret.high), (1.0, 0.0));
        assert_eq!(error.tau.unwrap().low, 1.0);
    }

    #[test]
    fn placements_without_a_score_rank_last() {
        let reference = [Some(-1.0), None, Some(-2.0)];
        let error = RankingError::new(&reference, &[None, Some(-1.0), Some(-2.0)], 0.0, 1).unwrap();
        assert_eq!(error.regret.value, 1.0);
        assert_eq!(error.tau.unwrap().value, -1.0);
        assert!(RankingError::new(&[None], &[None], 0.0, 1).is_none());
    }
}
