//! Outcome of a run: scored placements, methods, wall times, and why it stopped.

use std::cmp::Ordering;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::bound::Certificate;
use super::evaluator::{Judged, SceneScores};
use super::generations::{GenerationRecord, GenerationsStop};
use super::on_demand::FramesUsed;
use super::rules::Finding;
use super::spread::{GainSpread, PhaseCheck};
use super::swaps::Climbs;
use crate::score::{Objective, Scores, Standing, all_held_in_words};
use crate::vehicle::{Constraints, Placement};

/// A placement with its scores.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scored {
    /// Name and poses.
    pub placement: Placement,
    /// Scores over all frames of the scene, or of all scenes.
    pub scores: Scores,
    /// Scores in each of several scenes and mirror images; empty where there is one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_scene: Vec<SceneScores>,
    /// Its objective; `None` where a score it needs does not exist.
    pub objective: Option<f64>,
    /// Rules of the mount that it breaks, in words.
    pub violations: Vec<String>,
    /// Price of its sensors in the vehicle's currency; `None` where none has a price, or nobody asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub price: Option<f64>,
}

impl Scored {
    /// A placement with its scores, its value by an objective, and the rules that it breaks. Guards that do not matter
    /// for the objective are left out.
    pub(crate) fn new(
        placement: &Placement,
        mut judged: Judged,
        objective: &Objective,
        constraints: &Constraints,
    ) -> Self {
        let each = judged.by_scene.iter_mut().map(|scene| &mut scene.scores);
        each.chain([&mut judged.scores])
            .for_each(|scores| scores.guards.retain(|guard| objective.tells(guard)));
        Self {
            objective: objective.value(&judged.scores),
            violations: constraints.violations(placement).iter().map(ToString::to_string).collect(),
            placement: placement.clone(),
            scores: judged.scores,
            by_scene: judged.by_scene,
            price: None,
        }
    }

    /// True if it keeps every rule of the mount, raises no doubt of a guard and meets all requirements: only then is it
    /// a baseline to compare with.
    pub(crate) fn is_honest(&self) -> bool {
        self.violations.is_empty() && self.scores.doubts() == 0 && self.scores.missing() == 0.0
    }

    /// Doubts of guards, broken rules of the mount and unmet requirements, in words; none if it is honest.
    pub(crate) fn reasons(&self) -> Vec<String> {
        let guards = self.scores.guards.iter().filter(|guard| guard.is_doubt());
        let guards = guards.map(ToString::to_string);
        let lacking = self.scores.required.iter().filter(|seen| !seen.is_met());
        let broken = self.violations.iter().cloned();
        guards.chain(broken).chain(lacking.map(ToString::to_string)).collect()
    }

    /// Every warning about it: the reasons, then requirements that are met on paper only, blind sectors, and LiDARs that
    /// could be left out. Every sentence and list counts these.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let facts = self.scores.guards.iter().filter(|guard| !guard.is_doubt());
        let paper = self.scores.holds_on_paper().map(all_held_in_words);
        self.reasons().into_iter().chain(paper).chain(facts.map(ToString::to_string)).collect()
    }

    /// The best of the honest baselines by the objective.
    pub(crate) fn yardstick(baselines: &[Self]) -> Option<&Self> {
        let honest = baselines.iter().filter(|baseline| baseline.is_honest());
        let valued = honest.filter_map(|baseline| Some((baseline.objective?, baseline)));
        valued.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, baseline)| baseline)
    }

    /// The yardstick; if no baseline is honest, the best of all.
    pub(super) fn rival(baselines: &[Self]) -> Option<&Self> {
        let best = || {
            baselines
                .iter()
                .max_by(|a, b| a.objective.partial_cmp(&b.objective).unwrap_or(Ordering::Equal))
        };
        Self::yardstick(baselines).or_else(best)
    }

    /// A copy without the parts that only a search asks about, and without guards of the own body, which a job adds to results
    /// by its closer look.
    pub(super) fn settled(mut self) -> Self {
        self.scores.car_missing = None;
        self.scores.guards.retain(|guard| !guard.is_of_body());
        self
    }

    /// Its standing among placements that keep the rules of the mount.
    pub(super) fn standing(&self) -> Standing {
        let (guards, blind) = (self.scores.doubts(), self.scores.blindness());
        Standing { violation: self.scores.missing(), guards, value: self.objective, blind }
    }
}

/// Method of a baseline or a start that is better than all that was found.
pub(crate) const LAYOUT_GIVEN: &str = "layout given";

/// Result of one search method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodRecord {
    /// `cma-es` or `swaps`; `layout given` where a baseline or a start is better than all that was found; `earlier sitting`
    /// where this one was cut short and has found nothing better than the one before.
    pub method: &'static str,
    /// Its placement's objective over all frames of the scene.
    pub objective: Option<f64>,
    /// Requirements that its placement meets, and their number; requirements come before the objective.
    pub requirements: [usize; 2],
    /// Placements that it looked at.
    pub evaluations: u64,
    /// Sensor poses that it cast.
    pub poses_cast: u64,
    /// True if its placement is the result.
    pub won: bool,
}

/// A layout to start from that was not used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Rules that it breaks, in words.
    pub why: Vec<String>,
}

/// Why a run has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stopped {
    /// The observer stopped it.
    Interrupted,
    /// The time limit is over.
    Time,
    /// The generations ended for this reason.
    Generations(GenerationsStop),
    /// No swap gains any more, where there were swaps alone.
    Settled,
}

impl Stopped {
    /// True if a resumed run would find something left to do.
    pub fn is_unfinished(self) -> bool {
        matches!(self, Self::Interrupted | Self::Time)
    }
}

/// A name, and after a colon its meaning.
impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupted => f.write_str("interrupted"),
            Self::Time => f.write_str("time: the seconds given are over"),
            Self::Generations(stop) => stop.fmt(f),
            Self::Settled => f.write_str("settled: no swap gains any more"),
        }
    }
}

/// Wall times of a run in seconds, of this sitting alone.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SearchTimes {
    /// Choosing frames, and opening the engine.
    pub frames: f64,
    /// The search: all after that and before confirming.
    pub search: f64,
    /// Generations of the search, without going to other frames.
    pub generations: f64,
    /// Generations without scoring: asking, telling, ranking.
    pub bookkeeping: f64,
    /// Generations of the search and finalists, going to other frames included.
    pub until_swaps: f64,
    /// Swaps of the search.
    pub swaps: f64,
    /// Bounds of the search.
    pub bounds: f64,
    /// Scoring the result and the baselines over all frames.
    pub confirm: f64,
    /// Placements × frames that the generations scored.
    pub scored: u64,
}

/// Everything that a run found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// The result; `None` where no candidate kept the rules of the mount.
    pub best: Option<Scored>,
    /// Layouts to compare with.
    pub baselines: Vec<Scored>,
    /// Baselines that are not scored for want of time: the last ones of the settings.
    pub unscored_baselines: usize,
    /// Result of each method, and which one won.
    pub methods: Vec<MethodRecord>,
    /// How far apart the climbs of the swaps ended; `None` without swaps.
    pub climbs: Option<Climbs>,
    /// Bounds on how much better than the result another placement could be; `None` without a result, or where
    /// the run ended before its bounds.
    pub certificate: Option<Certificate>,
    /// Gain over the best baseline beside the spread between scenes; `None` for one scene, or without a
    /// baseline.
    pub spread: Option<GainSpread>,
    /// Objectives of result and best baseline at random draws that the search has not seen; `None` if
    /// nothing is random, or the time was over.
    pub phases: Option<PhaseCheck>,
    /// Correlations of layout properties with the objective, over random placements on the grid.
    pub findings: Vec<Finding>,
    /// Frames that were chosen on demand, with work saved and loss risked; `None` where they were given.
    pub frames_used: Option<FramesUsed>,
    /// Frames that the search averaged over.
    pub search_frames: usize,
    /// Frames that result and baselines are scored over: all, unless the run had to end before that.
    pub confirmed_frames: usize,
    /// A record of each generation.
    pub history: Vec<GenerationRecord>,
    /// Placements that the generations evaluated.
    pub evaluations: u64,
    /// Instances of the CMA-ES that ended before the last one, and why, in words.
    pub ended: Vec<String>,
    /// Layouts to start from that the mount does not allow.
    pub left_out: Vec<LeftOut>,
    /// Pose fields of the result that lie on a bound of the mount, and other rules that it just keeps,
    /// in words.
    pub active_bounds: Vec<String>,
    /// Why it ended.
    pub stopped: Stopped,
    /// Rigs that `--fewest` did not try for want of time, in words.
    pub untried: Option<String>,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Device as reported.
    pub adapter: String,
    /// Devices lost during the run and their replacements, in words.
    pub backend_changes: Vec<String>,
    /// Wall times of this sitting.
    pub times: SearchTimes,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Guard;

    #[test]
    fn requirements_on_paper_are_a_warning_but_no_reason() {
        let seen = crate::score::Seen::of("car", 1.0);
        let scores = |hold_in| Scores {
            required: vec![seen.clone()],
            requirements_hold_in: Some(hold_in),
            ..Scores::default()
        };
        let scored = |hold_in| {
            let judged = Judged { scores: scores(hold_in), by_scene: vec![] };
            let placement = Placement { name: "found".into(), lidars: vec![] };
            let rules = Constraints::default();
            let scored = Scored::new(&placement, judged, &Objective::default(), &rules);
            Scored { violations: vec![], ..scored }
        };
        let told =
            "all requirements: ON PAPER ONLY, met by 90 % of copies mounted within the tolerance";
        assert_eq!(scored(0.9).warnings(), [told]);
        assert!(scored(0.9).reasons().is_empty() && scored(0.95).warnings().is_empty());
    }

    #[test]
    fn a_redundant_lidar_is_no_warning_where_redundancy_is_wanted() {
        let guards = vec![Guard::RedundantLidar { lidar: 0, share: 0.001 }, Guard::CoversNothing];
        let scores = Scores { guards, ..Scores::default() };
        let scene = SceneScores { scene: "street".into(), scores: scores.clone() };
        let judged = Judged { scores, by_scene: vec![scene] };
        for (objective, left) in [("near_gain", 2), ("near_gain_2", 1)] {
            let objective: Objective = objective.parse().unwrap();
            let rules = Constraints::default();
            let placement = Placement { name: "none".into(), lidars: vec![] };
            let scored = Scored::new(&placement, judged.clone(), &objective, &rules);
            let guards = [&scored.scores, &scored.by_scene[0].scores].map(|s| s.guards.len());
            assert_eq!((guards, scored.is_honest()), ([left; 2], false));
        }
    }
}
