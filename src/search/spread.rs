//! Gain of a result over the best baseline, beside the spread of that gain between scenes.

use serde::Serialize;

use crate::problem::Entropy;
use crate::score::{Interval, Objective, bootstrap};

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
}
