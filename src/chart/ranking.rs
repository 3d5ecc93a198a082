//! Errors of a setting's scores and ranking against the reference.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;

use super::{Engine, Measured, Setting};
use crate::score::kendall_tau;

/// Resamples of the bootstrap.
const RESAMPLES: usize = 500;

/// A value with the 95 % interval of its bootstrap over placements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct BootstrapInterval {
    /// Over all placements.
    pub value: f64,
    /// 2.5 % of the resamples lie below.
    pub low: f64,
    /// 2.5 % of the resamples lie above.
    pub high: f64,
}

/// Errors of a setting's scores and ranking against the reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct RankingError {
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
    pub(crate) fn new(
        reference: &[Option<f64>],
        scores: &[Option<f64>],
        tolerance: f64,
        seed: u64,
    ) -> Option<Self> {
        let (reference, scores) = comparable(reference, scores);
        if reference.is_empty() {
            return None;
        }
        let error = |(r, s): (&f64, &f64)| if r == s { 0.0 } else { ((s - r) / r).abs() };
        let mut errors: Vec<f64> = reference.iter().zip(&scores).map(error).collect();
        errors.sort_by(f64::total_cmp);
        let count = reference.len();
        let (mut taus, mut regrets, mut swaps) = (Vec::new(), Vec::new(), Vec::new());
        for (r, s) in resampled(&reference, &scores, seed) {
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

/// Scores of the same placements, drawn with replacement [`RESAMPLES`] times.
fn resampled(
    reference: &[f64],
    scores: &[f64],
    seed: u64,
) -> impl Iterator<Item = (Vec<f64>, Vec<f64>)> {
    let (mut rng, count) = (ChaCha8Rng::seed_from_u64(seed), reference.len());
    (0..RESAMPLES).map(move |_| {
        (0..count).map(|_| rng.random_range(0..count)).map(|k| (reference[k], scores[k])).unzip()
    })
}

/// [`RankingError::swapped`] alone, for the first placements of a setting; `None` if there are none to compare.
pub(super) fn swapped_interval(
    reference: &[Option<f64>],
    scores: &[Option<f64>],
    tolerance: f64,
    seed: u64,
) -> Option<BootstrapInterval> {
    let (reference, scores) = comparable(reference, scores);
    let resampled = resampled(&reference, &scores, seed);
    let resampled = resampled.map(|(r, s)| swapped(&r, &s, tolerance));
    (!reference.is_empty())
        .then(|| interval(swapped(&reference, &scores, tolerance), resampled.collect()))
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
    let order = |&a: &usize, &b: &usize| scores[a].total_cmp(&scores[b]).then(b.cmp(&a));
    let top = (0..scores.len()).max_by(order).unwrap_or(0);
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

/// A measured setting, and its errors against the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Rated {
    /// Cost and scores.
    pub measured: Measured,
    /// Against the reference.
    pub(crate) error: RankingError,
    /// No other setting is cheaper and ranks at least as well.
    pub on_front: bool,
}

/// The setting to take.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Advice {
    /// Position in the list of settings.
    pub setting: usize,
    /// Seconds of the finest setting in `f64` as a multiple of this setting's, where that was measured.
    pub saves_over_f64: Option<f64>,
    /// Seconds of the finest setting in `f32` as a multiple of this setting's, where that was measured.
    pub saves_over_f32: Option<f64>,
}

/// Largest share of the pairs farther apart than the tolerance that may change places in a ranking that counts as
/// kept.
pub(crate) const MOST_SWAPPED: f64 = 0.05;

/// Compares every setting with the first, which is the reference; scores within `tolerance` of the best
/// one of each other need not be told apart.
pub(crate) fn rate(measured: &[Measured], tolerance: f64, seed: u64) -> Vec<Rated> {
    let Some(reference) = measured.first() else { return Vec::new() };
    let rated = |m: &Measured| {
        let error = RankingError::new(&reference.scores, &m.scores, tolerance, seed)?;
        Some(Rated { measured: m.clone(), error, on_front: false })
    };
    let mut rated: Vec<Rated> = measured.par_iter().filter_map(rated).collect();
    pareto(&rated).into_iter().for_each(|index| rated[index].on_front = true);
    rated
}

/// 1 − τ, the error of a ranking: 0 keeps it, 1 has nothing to do with it.
fn misranked(rated: &Rated) -> f64 {
    rated.error.tau.map_or(1.0, |tau| 1.0 - tau.value)
}

/// True if a setting was measured with all placements and scores any other: a warm atlas only those whose poses were
/// cast before.
fn is_general(rated: &Rated) -> bool {
    rated.measured.left.is_none() && rated.measured.setting.engine != Engine::Atlas
}

/// Settings that no other one beats in both seconds a placement and 1 − τ, the cheapest first; a warm
/// atlas is none of them, nor is a setting that was left early.
pub(crate) fn pareto(rated: &[Rated]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rated.len()).filter(|&i| is_general(&rated[i])).collect();
    let key = |i: usize| (rated[i].measured.seconds, misranked(&rated[i]));
    order.sort_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let better = key(i).1 < least;
        least = least.min(key(i).1);
        better
    });
    order
}

/// The cheapest setting that keeps the ranking. Up to the upper ends of the intervals, its top-1 regret stays within
/// `tolerance`, and at most [`MOST_SWAPPED`] of the pairs farther apart change places. The reference itself always
/// does; a warm atlas and a setting that was left early do not count. `None` of an empty list.
pub(crate) fn cheapest(rated: &[Rated], tolerance: f64) -> Option<Advice> {
    let reference = rated.first()?;
    let seconds = |i: usize| rated[i].measured.seconds;
    let setting = (0..rated.len())
        .filter(|&i| is_general(&rated[i]))
        .filter(|&i| i == 0 || keeps_ranking(&rated[i].error, tolerance))
        .min_by(|&a, &b| seconds(a).total_cmp(&seconds(b)))?;
    let finest = reference.measured.setting.fidelity;
    let saves_over = |engine: Engine| {
        let is_finest = |r: &&Rated| r.measured.setting == Setting { engine, fidelity: finest };
        rated.iter().find(is_finest).map(|r| r.measured.seconds / seconds(setting))
    };
    Some(Advice {
        setting,
        saves_over_f64: saves_over(Engine::F64),
        saves_over_f32: saves_over(Engine::Cpu),
    })
}

/// True if the errors of a setting over all placements allow it to be taken.
pub(super) fn keeps_ranking(error: &RankingError, tolerance: f64) -> bool {
    error.regret.high <= tolerance && error.swapped.high <= MOST_SWAPPED
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

    fn measured(seconds: f64, scores: &[f64]) -> Measured {
        super::super::early::tests::measured(Engine::Cpu, seconds, &some(scores))
    }

    #[test]
    fn the_front_and_the_cheapest_within_tolerance() {
        let all = [
            measured(8.0, &[-1.00, -1.02, -1.3, -1.4]),
            measured(4.0, &[-1.00, -1.02, -1.3, -1.4]),
            measured(5.0, &[-1.02, -1.00, -1.4, -1.3]),
            measured(2.0, &[-1.02, -1.00, -1.3, -1.4]),
            measured(1.0, &[-1.4, -1.3, -1.02, -1.00]),
        ];
        let rated = rate(&all, 0.03, 1);
        assert_eq!(pareto(&rated), [4, 3, 1]);
        let front: Vec<bool> = rated.iter().map(|r| r.on_front).collect();
        assert_eq!(front, [false, true, false, true, true]);
        // Setting 3 takes the second best, which is 2 % worse.
        let verdict = cheapest(&rated, 0.03).unwrap();
        assert_eq!((verdict.setting, verdict.saves_over_f32), (3, Some(4.0)));
        assert_eq!(verdict.saves_over_f64, None, "no setting is in f64");
        assert_eq!(cheapest(&rate(&all, 0.001, 1), 0.001).unwrap().setting, 1);
        assert_eq!(cheapest(&[], 0.1), None);
        assert!(rate(&[], 0.1, 1).is_empty());
    }

    #[test]
    fn a_setting_that_finds_the_best_but_mixes_up_the_others_does_not_keep_the_ranking() {
        let best = [-1.0, -1.004, -1.008, -1.012, -1.016];
        let scores = |others: [f64; 3]| [&best[..], &others].concat();
        let finest = scores([-1.3, -1.4, -1.5]);
        let mixed = scores([-1.5, -1.4, -1.3]);
        let all = [measured(8.0, &finest), measured(2.0, &finest), measured(1.0, &mixed)];
        let rated = rate(&all, 0.03, 1);
        assert_eq!(rated[2].error.regret.high, 0.0);
        assert_eq!(rated[2].error.swapped.value, 3.0 / 18.0);
        assert_eq!(cheapest(&rated, 0.03).unwrap().setting, 1);
    }
}
