//! Gain of a result over the best baseline: beside its spread between scenes, and at draws that the search has not seen.

use serde::Serialize;

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::suite::{Member, SEARCHING, Suite};
use crate::problem::Entropy;
use crate::score::{Interval, Objective, bootstrap};
use crate::vehicle::Placement;

/// Times that scenes and frames are drawn.
const RESAMPLES: usize = 10_000;
/// Scenes from which on an interval of resampled scenes is about as wide as it should be.
pub(crate) const MANY_SCENES: usize = 10;

/// The gain that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Gain {
    /// Share of a scene's information.
    #[serde(rename = "information_gain")]
    Information,
    /// The near gain.
    #[serde(rename = "near_gain")]
    Near,
    /// The near gain where a voxel counts for up to two LiDARs.
    #[serde(rename = "near_gain_2")]
    NearTwice,
    /// The near gain where a voxel counts for up to three LiDARs.
    #[serde(rename = "near_gain_3")]
    NearThrice,
}

impl Gain {
    /// The near gain of fewest LiDARs that an objective holds, the information gain where it holds none.
    pub(super) fn of(objective: &Objective) -> Self {
        match objective.near_most() {
            None => Self::Information,
            Some(1) => Self::Near,
            Some(2) => Self::NearTwice,
            Some(_) => Self::NearThrice,
        }
    }

    /// Its kind of information, and the number of LiDARs that a voxel counts for at most.
    pub(super) fn kind(self) -> (Entropy, usize) {
        match self {
            Self::Information => (Entropy::Classes, 1),
            Self::Near => (Entropy::Near, 1),
            Self::NearTwice => (Entropy::Near, 2),
            Self::NearThrice => (Entropy::Near, 3),
        }
    }
}

/// Gain of a result over the best baseline in several scenes, as shares of each scene's information.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainSpread {
    /// Name of the baseline.
    pub baseline: String,
    /// The gain that is compared.
    pub gain: Gain,
    /// Scenes, mirror images not counted, nor scenes that are given again.
    pub scenes: usize,
    /// Mean difference of the shares in each scene, in the order given; a scene that is given again has its own entry.
    pub by_scene: Vec<f64>,
    /// Mean over the scenes, each counted once, and the interval of 95 %.
    pub difference: Interval,
    /// Times that scenes and frames were drawn.
    pub resamples: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// The result in a sentence.
    pub words: String,
}

impl GainSpread {
    /// From the shares that result and baseline gain in each frame, `[scenes][frames]` of either; `None` where a
    /// scene has no frame, and for one scene that is given again and again.
    pub(super) fn new(
        baseline: &str,
        gain: Gain,
        [ours, theirs]: &[Vec<Vec<f64>>; 2],
        seed: u64,
    ) -> Option<Self> {
        let paired = ours.iter().zip(theirs).map(|(ours, theirs)| {
            ours.iter().zip(theirs).map(|(ours, theirs)| ours - theirs).collect()
        });
        let differences: Vec<Vec<f64>> = paired.collect();
        let mean = |frames: &Vec<f64>| frames.iter().sum::<f64>() / frames.len() as f64;
        let by_scene: Vec<f64> = differences.iter().map(mean).collect();
        // A scene that is given again has the bits of the first in every frame.
        let pairs: Vec<_> = ours.iter().zip(theirs).collect();
        let is_first = |&scene: &usize| {
            let (ours, theirs) = pairs[scene];
            let nothing_seen = ours.iter().chain(theirs).all(|share| *share == 0.0);
            nothing_seen || !pairs[..scene].contains(&pairs[scene])
        };
        let once: Vec<usize> = (0..pairs.len()).filter(is_first).collect();
        let scenes = once.len();
        if scenes < 2 {
            return None;
        }
        let distinct: Vec<Vec<f64>> = once.iter().map(|&k| differences[k].clone()).collect();
        let difference = bootstrap(&distinct, RESAMPLES, seed)?;
        let means: Vec<f64> = once.iter().map(|&scene| by_scene[scene]).collect();
        let words = words(baseline, gain, &means, difference);
        let (baseline, resamples) = (baseline.to_owned(), RESAMPLES);
        Some(Self { baseline, gain, scenes, by_scene, difference, resamples, seed, words })
    }
}

fn words(
    baseline: &str,
    gain: Gain,
    by_scene: &[f64],
    Interval { mean, low, high }: Interval,
) -> String {
    let verdict = if low > 0.0 {
        "more than the scenes' own spread"
    } else if high < 0.0 {
        "a loss of more than the scenes' own spread"
    } else {
        "not more than the scenes' own spread"
    };
    let [low, high] = [low, high].map(|share| format!("{:+.2}", 100.0 * share));
    let (scenes, wins) = (by_scene.len(), by_scene.iter().filter(|gain| **gain > 0.0).count());
    let few = if scenes < MANY_SCENES {
        "; so few scenes make the interval too narrow rather than too wide"
    } else {
        ""
    };
    let (mean, more, above) = match mean < 0.0 {
        true => (format!("{:.2}", -100.0 * mean), "less", "below"),
        false => (format!("{:+.2}", 100.0 * mean), "more", "above"),
    };
    let near = |seen: &str| {
        format!("its near gain{seen} is {mean} percentage points {above} that of {baseline}")
    };
    let what = match gain {
        Gain::Information => {
            format!("it gains {mean} % of the information {more} than {baseline}")
        }
        Gain::Near => near(""),
        Gain::NearTwice => near(" seen twice"),
        Gain::NearThrice => near(" seen three times"),
    };
    format!(
        "Over {scenes} scenes {what} (95 % interval {low} to {high}, scenes and frames resampled; above 0 in \
         {wins} of {scenes}): {verdict}{few}."
    )
}

pub(super) const DRAWS: u64 = 8;
/// Two-sided 95 % of Student's distribution with [`DRAWS`] − 1 degrees of freedom.
const STUDENT: f64 = 2.365;

/// Objectives of a result and of the best baseline over several random draws.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseCheck {
    /// Objective of the result, by draw.
    pub ours: Vec<f64>,
    /// Objective of the best baseline, by draw; empty without one.
    pub theirs: Vec<f64>,
    /// The check in a sentence.
    pub words: String,
}

/// Mean, and half the width of its 95 % interval.
fn interval(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    [mean, STUDENT * (variance / count).sqrt()]
}

impl Suite {
    /// True if any sensor of a placement has a phase that differs from frame to frame.
    pub(crate) fn has_free_phase(&self) -> bool {
        let free = |member: &Member| {
            let slots = member.problem().constraints().slots.iter();
            slots.map(|slot| slot.sensor).any(|name| member.problem().sensors().is_free(name))
        };
        self.members().iter().any(free)
    }

    /// True if weather or faults decide by chance which beams return.
    pub(crate) fn has_weather(&self) -> bool {
        self.members().iter().any(|member| member.problem().air().is_some())
    }

    /// True if scores depend on a random draw, of phases or of returning beams.
    pub(super) fn is_left_to_chance(&self) -> bool {
        self.has_free_phase() || self.has_weather()
    }
}

/// Scores a result and a baseline at [`DRAWS`] draws after the one of the search; `None` once `go_on`, which is asked before
/// every few frames, says no.
pub(super) fn check_draws(
    suite: &Suite,
    objective: &Objective,
    best: &Placement,
    baseline: Option<&Placement>,
    memory: u64,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<Option<PhaseCheck>, SearchError> {
    let both: Vec<Placement> = std::iter::once(best).chain(baseline).cloned().collect();
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for draw in 1..=DRAWS {
        let drawn = suite.at_draw(SEARCHING + draw);
        let scores = Evaluator::suite_on_cpu(&drawn, memory).scores_while(&both, go_on)?;
        let Some(scores) = scores else { return Ok(None) };
        ours.extend(objective.value(&scores[0]));
        theirs.extend(scores.get(1).and_then(|scores| objective.value(scores)));
    }
    let drawn = match (suite.has_free_phase(), suite.has_weather()) {
        (_, false) => "azimuth phases",
        (false, true) => "beams that come back",
        (true, true) => "azimuth phases and of the beams that come back",
    };
    let words = words_of_draws(drawn, objective, (&ours, &theirs), baseline);
    Ok(Some(PhaseCheck { ours, theirs, words }))
}

fn words_of_draws(
    drawn: &str,
    objective: &Objective,
    (ours, theirs): (&[f64], &[f64]),
    baseline: Option<&Placement>,
) -> String {
    let [mean, reach] = interval(ours);
    let mut words = format!(
        "At {} other draws of the {drawn} the result has {}, within {} % of it for these draws (95 % interval of \
         the mean)",
        ours.len(),
        objective.spoken(mean),
        at_least_a_hundredth(100.0 * reach / mean.abs())
    );
    if let (Some(baseline), true) = (baseline, theirs.len() == ours.len()) {
        let more: Vec<f64> =
            ours.iter().zip(theirs).map(|(a, b)| 100.0 * (a - b) / b.abs()).collect();
        let [mean, reach] = interval(&more);
        words += &format!(
            ", {:+.2} % (interval {:+.2} to {:+.2}) against {}",
            mean,
            mean - reach,
            mean + reach,
            baseline.name
        );
    }
    words + "; another seed of the search may differ by more."
}

/// Per cent with two digits, 0.01 at least.
fn at_least_a_hundredth(per_cent: f64) -> String {
    if per_cent < 0.01 { "0.01".to_owned() } else { format!("{per_cent:.2}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(gain: Gain, differences: &[[f64; 2]]) -> GainSpread {
        let ours = differences.iter().map(|d| vec![0.2 + d[0], 0.3 + d[1]]).collect();
        let theirs = vec![vec![0.2, 0.3]; differences.len()];
        GainSpread::new("Center", gain, &[ours, theirs], 1).unwrap()
    }

    #[test]
    fn the_verdict_is_that_of_the_interval() {
        let more = spread(Gain::Information, &[[0.02, 0.03], [0.01, 0.02], [0.03, 0.03]]);
        assert!(
            more.words.contains("+2.33 % of the information more than Center"),
            "{}",
            more.words
        );
        assert!(more.words.contains("in 3 of 3): more than the scenes' own"), "{}", more.words);
        let unsure = spread(Gain::Near, &[[0.02, 0.03], [-0.03, -0.02], [0.01, 0.0]]);
        assert!(
            unsure.words.contains("near gain is +0.17 percentage points above that of Center"),
            "{}",
            unsure.words
        );
        assert!(unsure.words.contains(": not more than"), "{}", unsure.words);
        assert!(unsure.difference.low < 0.0 && unsure.difference.high > 0.0);
        let less = spread(Gain::Near, &[[-0.02, -0.03], [-0.03, -0.02]]);
        assert!(less.words.contains("): a loss of more than"), "{}", less.words);
        let below = "near gain is 2.50 percentage points below that of Center (95 % interval -";
        assert!(less.words.contains(below), "{}", less.words);
        let less = spread(Gain::Information, &[[-0.02, -0.03], [-0.03, -0.02]]);
        assert!(
            less.words.contains("2.50 % of the information less than Center"),
            "{}",
            less.words
        );
    }

    #[test]
    fn a_scene_that_is_given_again_counts_once() {
        let ours = [vec![0.3, 0.4], vec![0.25, 0.3], vec![0.3, 0.4]];
        let theirs = [vec![0.2, 0.3], vec![0.2, 0.3], vec![0.2, 0.3]];
        let of = |order: &[usize]| {
            let some = |all: &[Vec<f64>]| order.iter().map(|&k| all[k].clone()).collect();
            GainSpread::new("Center", Gain::Near, &[some(&ours), some(&theirs)], 1)
        };
        let [again, once] = [&[0, 1, 2][..], &[0, 1]].map(|order| of(order).unwrap());
        assert_eq!((again.scenes, again.by_scene.len()), (2, 3));
        assert_eq!((&again.words, again.difference), (&once.words, once.difference));
        assert!(again.words.contains("above 0 in 2 of 2"), "{}", again.words);
        assert_eq!(of(&[0, 2]), None, "one scene has no spread");
    }

    #[test]
    fn the_interval_is_students() {
        let [mean, reach] = interval(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        // By hand: variance 6, standard error √(6/8).
        assert!((mean - 4.5).abs() < 1e-12 && (reach - 2.365 * 0.75_f64.sqrt()).abs() < 1e-12);
        let baseline = Placement { name: "plain".into(), lidars: vec![] };
        let gain: Objective = "information_gain".parse().unwrap();
        let said =
            words_of_draws("azimuth phases", &gain, (&[110.0; 8], &[100.0; 8]), Some(&baseline));
        assert!(said.contains("has 110, within 0.01 % of it"), "{said}");
        let share = words_of_draws("azimuth phases", &Objective::default(), (&[0.5; 8], &[]), None);
        assert!(share.contains("has 50.00 %, within 0.01 % of it"), "{share}");
        assert!(said.contains("+10.00 % (interval +10.00 to +10.00) against plain;"), "{said}");
    }
}
