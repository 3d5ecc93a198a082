//! Settings that a chart leaves early, or does not begin, since they cannot become its advice.

use serde::{Deserialize, Serialize};

use super::ranking::{keeps_ranking, swapped_interval};
use super::{Engine, MOST_SWAPPED, Measured, RankingError, Setting};

/// Placements that the f64 scorer is given where it is only to tell how far the reference is from it.
pub(super) const IN_F64: usize = 4;
/// Placements after which the pairs that a setting swaps may decide against it.
const ENOUGH: usize = 24;
/// Most seconds of a setting as a multiple of one that keeps the ranking: after a few placements, and after [`ENOUGH`].
/// Both leave room for a busy machine.
const SLOWER: [f64; 2] = [3.0, 1.5];
/// Effort from which on a setting is not begun, as a multiple of one that keeps the ranking. Efforts come from counts
/// of beams and voxels and are mostly right within a factor of 1.5; see [`Setting::effort`].
const DEARER: f64 = 2.0;
/// Share of the placements that a setting scores as a rule, for a forecast of the time: mostly 24 to 40 of some hundred.
const EXPECTED: f64 = 0.4;
/// Effort up to which settings are expected to be begun, as a share of the reference's.
const BEGUN: f64 = 0.25;

/// Reason for which a setting was not measured with all placements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Left {
    /// Even the lower end of its interval has more than `MOST_SWAPPED` of the pairs in another order.
    Swaps,
    /// Measured: it takes over 1.5 times (after fewer than 24 placements 3 times) as long as a setting that keeps the
    /// ranking.
    Slower,
    /// Counted: with its beams and voxels it would take over twice as long as a setting that keeps the ranking.
    Dearer,
}

impl Left {
    /// The reason in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Swaps => "swaps more pairs than allowed even at the lower end of its interval",
            Self::Slower => "takes over 1.5 times as long as a setting that keeps the ranking",
            Self::Dearer => {
                "by beams and voxels over 2 times as dear as a setting that keeps the ranking"
            }
        }
    }
}

/// A setting of which no placement was scored.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Skipped {
    /// The setting.
    pub rung: Setting,
    /// The reason.
    pub left: Left,
}

/// Rule on how far a setting is measured, given the settings before it.
///
/// Settings come in order of their effort, the reference first: the finest setting in `f32`. One is measured to the end
/// unless it cannot be the advice: it swaps too many pairs, or another one keeps the ranking for clearly less time. The
/// f64 scorer comes last and is left after a few placements, which tell how far the reference is from it.
#[derive(Debug, Clone)]
pub(super) struct StoppingRule {
    /// Every setting is measured to the end.
    pub(super) full: bool,
    /// See [`super::rate`].
    pub(super) tolerance: f64,
    /// Seed of the bootstrap.
    pub(super) seed: u64,
    /// Scores of the reference.
    reference: Vec<Option<f64>>,
    /// Least effort, and least seconds a placement, of the settings that keep the ranking.
    kept: Option<[f64; 2]>,
}

impl StoppingRule {
    pub(super) fn new(full: bool, tolerance: f64, seed: u64) -> Self {
        Self { full, tolerance, seed, reference: Vec::new(), kept: None }
    }

    /// Positions of settings in the order in which they are measured, by their efforts.
    pub(super) fn order(&self, efforts: &[f64]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..efforts.len()).collect();
        if !self.full {
            // Equal efforts keep their order, so that an interrupted chart goes on in the same one.
            order[1..].sort_by(|&a, &b| efforts[a].total_cmp(&efforts[b]));
        }
        order
    }

    /// True if a setting is not worth a placement. A GPU's time does not follow from counts.
    pub(super) fn skips(&self, setting: &Setting, effort: f64) -> bool {
        let is_counted = setting.engine == Engine::Cpu && !self.full;
        is_counted && self.kept.is_some_and(|[least, _]| effort > DEARER * least)
    }

    /// Share of `count` placements that a setting other than the reference is expected to score.
    pub(super) fn expects(
        &self,
        setting: &Setting,
        [effort, of_reference]: [f64; 2],
        count: usize,
    ) -> f64 {
        match setting.engine {
            _ if self.full => 1.0,
            Engine::F64 => (IN_F64 as f64 / count as f64).min(1.0),
            _ if self.skips(setting, effort) => 0.0,
            _ if effort > BEGUN * of_reference => 0.0,
            _ => EXPECTED,
        }
    }

    /// Reason to leave a setting after its first placements, if there is one; `seconds` is its time a placement so far.
    pub(super) fn leaves(&self, scores: &[Option<f64>], seconds: f64) -> Option<Left> {
        if self.full || self.reference.is_empty() || scores.len() >= self.reference.len() {
            return None;
        }
        let slower = SLOWER[usize::from(scores.len() >= ENOUGH)];
        if self.kept.is_some_and(|[_, least]| seconds > slower * least) {
            return Some(Left::Slower);
        }
        let so_far = &self.reference[..scores.len()];
        let swapped = || swapped_interval(so_far, scores, self.tolerance, self.seed);
        let is_over = scores.len() >= ENOUGH && swapped().is_some_and(|s| s.low > MOST_SWAPPED);
        is_over.then_some(Left::Swaps)
    }

    /// True if the scores of all placements keep the ranking.
    pub(super) fn keeps(&self, scores: &[Option<f64>]) -> bool {
        let error = RankingError::new(&self.reference, scores, self.tolerance, self.seed);
        scores.len() == self.reference.len()
            && error.is_some_and(|error| keeps_ranking(&error, self.tolerance))
    }

    /// True if a setting that an interrupted chart has measured needs no more: another tolerance may want more of it.
    pub(super) fn is_settled(&self, measured: &Measured, effort: f64) -> bool {
        let Measured { setting, scores, seconds, .. } = measured;
        let is_enough = match measured.left {
            Some(_) => self.leaves(scores, *seconds).is_some(),
            None => self.full || measured.repeats > 0 || !self.is_candidate(setting, scores),
        };
        is_enough || self.skips(setting, effort)
    }

    /// True if a setting may become the advice, so that its time has to be right. The reference, of which there are no
    /// scores yet when it is measured, has its time from all placements.
    pub(super) fn is_candidate(&self, setting: &Setting, scores: &[Option<f64>]) -> bool {
        matches!(setting.engine, Engine::Cpu | Engine::Gpu) && self.keeps(scores)
    }

    /// Takes note of a setting that was measured, in the order of the settings.
    pub(super) fn note(&mut self, measured: &Measured, effort: f64) {
        if self.reference.is_empty() {
            self.reference.clone_from(&measured.scores);
        }
        if measured.left.is_none() && self.is_candidate(&measured.setting, &measured.scores) {
            let [least, seconds] = self.kept.unwrap_or([f64::INFINITY; 2]);
            self.kept = Some([least.min(effort), seconds.min(measured.seconds)]);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::chart::SceneDetail;

    const TOLERANCE: f64 = 0.01;

    fn setting(engine: Engine) -> Setting {
        let fidelity =
            SceneDetail { voxel: 1.0, azimuth: 1, frames: 1, through: false, detail: 0.0 };
        Setting { fidelity, engine }
    }

    pub(in crate::chart) fn measured(
        engine: Engine,
        seconds: f64,
        scores: &[Option<f64>],
    ) -> Measured {
        let (setting, scores) = (setting(engine), scores.to_vec());
        let (spread, pose, repeats, left) = ([seconds; 2], None, 1, None);
        let (bytes, beams, triangles) = (0, 0, 0);
        Measured { setting, seconds, spread, bytes, beams, triangles, pose, repeats, left, scores }
    }

    /// Scores of 111 placements, and the same with noise of up to `noise`.
    fn scores(noise: f64) -> [Vec<Option<f64>>; 2] {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let pairs = (0..111).map(|_| {
            let score = rng.random_range(-6.0..-1.0);
            (Some(score), Some(score + noise * rng.random_range(-1.0..1.0)))
        });
        let (reference, scores) = pairs.unzip();
        [reference, scores]
    }

    /// A rule that has seen the reference, and a setting that keeps the ranking with an effort of 10 in 1 second.
    fn rule(full: bool) -> StoppingRule {
        let [reference, _] = scores(0.0);
        let mut rule = StoppingRule::new(full, TOLERANCE, 1);
        rule.note(&measured(Engine::F64, 9.0, &reference), 90.0);
        rule.note(&measured(Engine::Cpu, 1.0, &reference), 10.0);
        rule
    }

    /// Reason and number of placements at which a setting that takes `seconds` is left.
    fn left(rule: &StoppingRule, scores: &[Option<f64>], seconds: f64) -> Option<(usize, Left)> {
        let so_far = (8..=scores.len()).step_by(8).chain([scores.len()]);
        so_far.into_iter().find_map(|n| Some((n, rule.leaves(&scores[..n], seconds)?)))
    }

    #[test]
    fn settings_dearer_than_one_that_keeps_the_ranking_are_not_begun() {
        let sparing = rule(false);
        assert_eq!(sparing.order(&[90.0, 30.0, 2.0, 30.0, 1.0]), [0, 4, 2, 1, 3]);
        let cpu = setting(Engine::Cpu);
        assert_eq!([19.9, 20.1].map(|effort| sparing.skips(&cpu, effort)), [false, true]);
        assert!(!sparing.skips(&setting(Engine::Gpu), 99.0), "counts say nothing of a GPU's time");
        assert!(
            !StoppingRule::new(false, TOLERANCE, 1).skips(&cpu, 99.0),
            "nothing keeps the ranking yet"
        );
        assert_eq!(rule(true).order(&[90.0, 30.0, 2.0]), [0, 1, 2]);
        assert!(!rule(true).skips(&cpu, 99.0));
        // One that swaps pairs does not stand in the way of dearer ones.
        let [reference, mixed] = scores(3.0);
        let mut none = StoppingRule::new(false, TOLERANCE, 1);
        none.note(&measured(Engine::F64, 9.0, &reference), 90.0);
        none.note(&measured(Engine::Cpu, 1.0, &mixed), 10.0);
        assert!(!none.skips(&cpu, 99.0));
    }

    #[test]
    fn a_setting_is_left_once_its_interval_or_its_time_has_decided() {
        let sparing = rule(false);
        let [reference, mixed] = scores(3.0);
        assert_eq!(left(&sparing, &mixed, 1.0), Some((24, Left::Swaps)));
        assert_eq!(left(&sparing, &reference, 1.0), None);
        assert_eq!(left(&sparing, &reference, 1.4), None);
        assert_eq!(left(&sparing, &reference, 1.6), Some((24, Left::Slower)));
        assert_eq!(left(&sparing, &reference, 3.1), Some((8, Left::Slower)));
        assert_eq!(left(&rule(true), &mixed, 3.1), None);
    }

    #[test]
    fn a_setting_whose_interval_straddles_the_bound_is_measured_to_the_end() {
        let sparing = rule(false);
        let [reference, noisy] = scores(0.35);
        let whole = swapped_interval(&reference, &noisy, TOLERANCE, 1).unwrap();
        assert!(whole.low < MOST_SWAPPED && MOST_SWAPPED < whole.high, "{whole:?}");
        assert_eq!(left(&sparing, &noisy, 1.0), None);
        assert!(!sparing.keeps(&noisy), "the verdict itself goes by the upper end");
    }

    #[test]
    fn another_tolerance_opens_what_was_left_and_times_what_now_keeps() {
        let [reference, mixed] = scores(3.0);
        let partial = |left| Measured {
            left: Some(left),
            repeats: 0,
            ..measured(Engine::Cpu, 1.0, &mixed[..24])
        };
        let mut wide = StoppingRule::new(false, 6.0, 1);
        wide.note(&measured(Engine::F64, 9.0, &reference), 90.0);
        assert!(rule(false).is_settled(&partial(Left::Swaps), 5.0));
        assert!(!wide.is_settled(&partial(Left::Swaps), 5.0), "no pair is that far apart");
        assert!(rule(false).is_settled(&partial(Left::Dearer), 30.0));
        assert!(!wide.is_settled(&partial(Left::Dearer), 30.0));
        let untimed = Measured { repeats: 0, ..measured(Engine::Cpu, 1.0, &mixed) };
        assert!(rule(false).is_settled(&untimed, 5.0));
        assert!(!wide.is_settled(&untimed, 5.0));
    }
}
