//! The gain or near gain of a result over every baseline, with intervals over scenes.

use super::{SceneRecord, ScoreColumn};
use crate::score::{Interval, Scores, bootstrap};
use crate::search::Scored;

/// Times that scenes are drawn.
const RESAMPLES: usize = 10_000;

/// A result against one baseline.
#[derive(Debug, Clone, PartialEq)]
pub struct Against<'a> {
    /// Name of the baseline.
    pub name: &'a str,
    /// Gain of the baseline, as a share.
    pub gain: f64,
    /// Gain of the result less that of the baseline.
    pub difference: f64,
    /// 95 % interval of the difference over scenes, mirror images counting with their scene; `None` for one scene.
    pub interval: Option<Interval>,
}

/// The result against every baseline that gains anything, in their order, by a share: see [`ScoreColumn::argued`].
pub fn against<'a>(
    best: &Scored,
    baselines: &'a [Scored],
    scenes: &[SceneRecord],
    seed: u64,
    column: ScoreColumn,
) -> Vec<Against<'a>> {
    let share = |scores: &Scores| column.share(scores);
    let compare = |baseline: &'a Scored| {
        let (ours, theirs) = (share(&best.scores)?, share(&baseline.scores)?);
        // A scene and its mirror image are two frames of one place.
        let mut differences: Vec<Vec<f64>> = Vec::new();
        let pairs = best.by_scene.iter().zip(&baseline.by_scene);
        for (scene, (ours, theirs)) in scenes.iter().zip(pairs) {
            let difference =
                share(&ours.scores).unwrap_or(0.0) - share(&theirs.scores).unwrap_or(0.0);
            match differences.last_mut().filter(|_| scene.mirrored) {
                Some(place) => place.push(difference),
                None => differences.push(vec![difference]),
            }
        }
        let several = differences.len() > 1;
        let interval = several.then(|| bootstrap(&differences, RESAMPLES, seed)).flatten();
        let (name, difference) = (baseline.placement.name.as_str(), ours - theirs);
        Some(Against { name, gain: theirs, difference, interval })
    };
    baselines.iter().filter_map(compare).collect()
}
