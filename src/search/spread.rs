//! Whether a result gains more than the best baseline by more than the scenes differ among themselves.

use serde::Serialize;

use crate::score::{Interval, bootstrap};

/// Times that scenes and frames are drawn.
const RESAMPLES: usize = 10_000;
/// Scenes from which on an interval of resampled scenes is about as wide as it should be.
const MANY_SCENES: usize = 10;

/// The gain of a result over the best baseline, as a share of each scene's information, over several scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainSpread {
    /// Name of the baseline.
    pub baseline: String,
    /// Scenes, mirror images not counted.
    pub scenes: usize,
    /// Mean difference of the shares in each scene, in their order.
    pub by_scene: Vec<f64>,
    /// Mean over the scenes, and the interval of 95 %.
    pub difference: Interval,
    /// Times that scenes and frames were drawn.
    pub resamples: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// What it means, in a sentence.
    pub words: String,
}

impl GainSpread {
    /// From the shares that result and baseline gain in each frame, `[scenes][frames]`; `None` where a scene
    /// has no frame.
    pub(super) fn new(
        baseline: &str,
        ours: &[Vec<f64>],
        theirs: &[Vec<f64>],
        seed: u64,
    ) -> Option<Self> {
        let paired = ours.iter().zip(theirs).map(|(ours, theirs)| {
            ours.iter().zip(theirs).map(|(ours, theirs)| ours - theirs).collect()
        });
        let differences: Vec<Vec<f64>> = paired.collect();
        let difference = bootstrap(&differences, RESAMPLES, seed)?;
        let scenes = differences.len();
        let mean = |frames: &Vec<f64>| frames.iter().sum::<f64>() / frames.len() as f64;
        let by_scene: Vec<f64> = differences.iter().map(mean).collect();
        let words = words(baseline, &by_scene, difference);
        let (baseline, resamples) = (baseline.to_owned(), RESAMPLES);
        Some(Self { baseline, scenes, by_scene, difference, resamples, seed, words })
    }
}

fn words(baseline: &str, by_scene: &[f64], Interval { mean, low, high }: Interval) -> String {
    let verdict = if low > 0.0 {
        "more than the scenes' own spread"
    } else if high < 0.0 {
        "a loss of more than the scenes' own spread"
    } else {
        "not more than the scenes' own spread"
    };
    let [mean, low, high] = [mean, low, high].map(|share| format!("{:+.2}", 100.0 * share));
    let (scenes, above) = (by_scene.len(), by_scene.iter().filter(|gain| **gain > 0.0).count());
    let few = if scenes < MANY_SCENES {
        "; so few scenes make the interval too narrow rather than too wide"
    } else {
        ""
    };
    format!(
        "Over {scenes} scenes it gains {mean} % of the information more than {baseline} (95 % interval {low} \
         to {high}, scenes and frames resampled; above 0 in {above} of {scenes}): {verdict}{few}."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(differences: &[[f64; 2]]) -> GainSpread {
        let ours: Vec<Vec<f64>> =
            differences.iter().map(|d| vec![0.2 + d[0], 0.3 + d[1]]).collect();
        let theirs = vec![vec![0.2, 0.3]; differences.len()];
        GainSpread::new("Center", &ours, &theirs, 1).unwrap()
    }

    #[test]
    fn the_verdict_is_that_of_the_interval() {
        let more = spread(&[[0.02, 0.03], [0.01, 0.02], [0.03, 0.03]]);
        assert!(
            more.words.contains("+2.33 % of the information more than Center"),
            "{}",
            more.words
        );
        assert!(more.words.contains("in 3 of 3): more than the scenes' own"), "{}", more.words);
        let unsure = spread(&[[0.02, 0.03], [-0.03, -0.02], [0.01, 0.0]]);
        assert!(unsure.words.contains(": not more than"), "{}", unsure.words);
        assert!(unsure.difference.low < 0.0 && unsure.difference.high > 0.0);
        let less = spread(&[[-0.02, -0.03], [-0.03, -0.02]]);
        assert!(less.words.contains("): a loss of more than"), "{}", less.words);
    }
}
