//! The Pareto front of cost and ranking error, and the cheapest setting that keeps the ranking.

use rayon::prelude::*;
use serde::Serialize;

use super::{Engine, Measured, RankingError, Setting};

/// A measured setting, and its errors against the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Rated {
    /// Cost and scores.
    pub measured: Measured,
    /// Against the reference.
    pub error: RankingError,
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
pub const MOST_SWAPPED: f64 = 0.05;

/// Compares every setting with the first, which is the reference; scores within `tolerance` of the best
/// one of each other need not be told apart.
pub fn rate(measured: &[Measured], tolerance: f64, seed: u64) -> Vec<Rated> {
    let Some(reference) = measured.first() else { return Vec::new() };
    let mut rated: Vec<Rated> = measured
        .par_iter()
        .filter_map(|m| {
            let error = RankingError::new(&reference.scores, &m.scores, tolerance, seed)?;
            Some(Rated { measured: m.clone(), error, on_front: false })
        })
        .collect();
    for index in pareto(&rated) {
        rated[index].on_front = true;
    }
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
pub fn pareto(rated: &[Rated]) -> Vec<usize> {
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
pub fn cheapest(rated: &[Rated], tolerance: f64) -> Option<Advice> {
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
    use crate::chart::{SceneDetail, Setting};

    fn measured(seconds: f64, scores: &[f64]) -> Measured {
        let fidelity =
            SceneDetail { voxel: 1.0, azimuth: 1, frames: 1, through: false, detail: 0.0 };
        Measured {
            setting: Setting { fidelity, engine: Engine::Cpu },
            seconds,
            spread: [seconds; 2],
            bytes: 0,
            beams: 0,
            triangles: 0,
            pose: None,
            left: None,
            repeats: 1,
            scores: scores.iter().copied().map(Some).collect(),
        }
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
