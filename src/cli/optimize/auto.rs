//! `--fidelity auto`: search over a few frames that stand for all, with merged triangles where these are
//! many and small, over more frames when they no longer tell the best apart, and confirm the finalists
//! over all with every triangle.

use std::sync::Arc;

use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use sightline::chart::{Merging, Pilot, candidates};
use sightline::problem::{Problem, Tally};
use sightline::scene::Scene;
use sightline::score::{Objective, Scores};
use sightline::search::Evaluator;
use sightline::vehicle::{Constraints, Placement};

use super::follow::scores_with;
use crate::cli::error::Error;

/// Fewest placements by which the frames are chosen: the baselines, or random ones beside them.
const SAMPLE: usize = 8;
/// Share of the best score that a search may lose.
const TOLERANCE: f64 = 0.01;
/// Error of the level at which a search begins: candidates then differ by many times as much.
const FIRST_ERROR: f64 = 2.0 * TOLERANCE;
/// Placements that are confirmed over all frames at the end.
const FINALISTS: usize = 6;
/// Finalists whose order is checked over all frames.
const CHECKED: usize = 3;
/// Generations between two checks.
const GENERATIONS: u64 = 10;
/// Share of the evaluations after which a search is over the second level or a later one, unless the
/// error of the first is below [`LATE_ERROR`]: what is left to gain then is smaller than what it knows.
const LATE: f64 = 0.5;
/// Error of a level that is enough for all generations. Swaps are over the second level at least: they
/// end at the best placement they see, which one frame flatters most.
const LATE_ERROR: f64 = 0.5 * TOLERANCE;
/// Error that merged triangles may add to that of few frames. On a street of 200 000 triangles whose
/// merging had an error of 0.3 %, results of 13 seeds were 0.3 ± 0.2 % (standard error) below those of
/// every triangle in 0.74 of the time; swaps over every triangle after merged generations left as much.
const MERGING_ERROR: f64 = 0.5 * TOLERANCE;

/// Value of `--fidelity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum FidelityChoice {
    /// As few frames as keep the ranking.
    Auto,
    /// Every frame.
    Full,
}

/// A candidate for the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Finalist {
    placement: Placement,
    guards: usize,
    /// Objective over the frames of the present level.
    value: f64,
    /// Objective over all frames, once it is known.
    confirmed: Option<f64>,
}

/// What `auto` has decided so far; kept in the checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Auto {
    /// Frames of each level, ever more; the last is all of them, with every triangle.
    levels: Vec<Vec<usize>>,
    /// How far each level is from all frames, as the pilot saw it; see [`sightline::chart::Level`].
    errors: Vec<Option<f64>>,
    /// What merging small triangles does in the first level; `None` without triangles.
    merging: Option<Merging>,
    /// Present level.
    pub(super) at: usize,
    finalists: Vec<Finalist>,
    /// Placements × frames: to find the levels, to search, to check and confirm.
    spent: [u64; 3],
    /// Placements × frames of the search in this sitting.
    #[serde(skip)]
    pub(super) searched: u64,
    /// Sensor poses cast by swaps, as so many placements.
    #[serde(skip)]
    swapped: u64,
    /// What the pilot has scored over all frames in this sitting.
    #[serde(skip)]
    known: Vec<(Placement, Tally)>,
    /// (generation, frames from then on), the start first.
    steps: Vec<(u64, u32)>,
    /// Most that was lost by following a level, as a share of the best score, as the checks saw it.
    worst: f64,
}

impl Auto {
    /// Finds the level to begin with; `whole` is the problem over all frames of the scene.
    pub(super) fn new(
        (scene, whole): (&Scene, &Arc<Problem>),
        constraints: &Constraints,
        baselines: &[Placement],
        objective: &Objective,
        seed: u64,
        memory: u64,
    ) -> Result<Self, Error> {
        let count = whole.frame_count();
        let (mut levels, mut errors) = (vec![(0..count).collect()], vec![None]);
        let (mut spent, mut known) = (0, Vec::new());
        let mut merging = Merging::count(whole, scene);
        let may_merge = merging.as_ref().is_some_and(Merging::may_save);
        if count > 1 || may_merge {
            let alike = baselines.iter().filter(|b| b.lidars.len() == constraints.lidars);
            let given: Vec<Placement> = alike.cloned().collect();
            let random = SAMPLE.saturating_sub(given.len());
            let pilot = Pilot::new(whole, candidates(constraints, &given, random, seed), memory)?;
            let found = pilot.levels(objective, FIRST_ERROR);
            (levels, errors) = found.into_iter().map(|l| (l.frames, l.error)).unzip();
            (spent, known) = (pilot.work(), pilot.tallies());
            if let Some(merging) = merging.as_mut().filter(|m| m.may_save()) {
                let error = MERGING_ERROR;
                spent += merging.measure(&pilot, scene, &levels[0], objective, error, memory)?;
                if merging.used && levels.len() == 1 {
                    levels.insert(0, levels[0].clone());
                    errors.insert(0, merging.error);
                }
            }
        }
        let steps = vec![(0, levels[0].len() as u32)];
        Ok(Self {
            levels,
            errors,
            merging,
            at: 0,
            finalists: vec![],
            spent: [spent, 0, 0],
            searched: 0,
            swapped: 0,
            known,
            steps,
            worst: 0.0,
        })
    }

    /// Frames of the present level.
    pub(super) fn frames(&self) -> &[usize] {
        &self.levels[self.at]
    }

    /// Edge in metres of the cells within which vertices of the present level are merged, if they are.
    pub(super) fn cell(&self) -> Option<f64> {
        self.merging.as_ref().filter(|m| m.used && !self.is_full()).map(|m| m.cell)
    }

    /// What merging small triangles does.
    pub(super) fn merging(&self) -> Option<Merging> {
        self.merging.clone()
    }

    /// What the pilot has scored over all frames.
    pub(super) fn known(&self) -> Vec<(Placement, Tally)> {
        self.known.clone()
    }

    /// Takes note of the sensor poses that swaps cast over the present level.
    pub(super) fn note_swaps(&mut self, poses: u64, lidars: u64) {
        self.swapped = poses.div_ceil(lidars.max(1));
    }

    /// Position of the next level; that of the last one where there is none.
    pub(super) fn next(&self) -> usize {
        (self.at + 1).min(self.levels.len() - 1)
    }

    /// Position of the least level that is enough after this share of the evaluations.
    pub(super) fn least(&self, progress: f64) -> usize {
        let exact = self.errors[0].is_some_and(|error| error <= LATE_ERROR);
        if progress < LATE || exact { 0 } else { self.second() }
    }

    /// Position of the second level, or of the only one.
    pub(super) fn second(&self) -> usize {
        1.min(self.levels.len() - 1)
    }

    /// Whether the present level is all frames with every triangle.
    fn is_full(&self) -> bool {
        self.at + 1 == self.levels.len()
    }

    /// Whether the order of the finalists is to be checked after this generation.
    pub(super) fn is_due(&self, generation: u64) -> bool {
        !self.is_full() && generation.is_multiple_of(GENERATIONS)
    }

    /// Takes note of a generation: placements that keep the rules of the mount, and their scores.
    pub(super) fn note(&mut self, scored: Vec<(Placement, Scores)>, objective: &Objective) {
        let searched = (scored.len() * self.frames().len()) as u64;
        self.spent[1] += searched;
        self.searched += searched;
        for (placement, scores) in scored {
            let Some(value) = objective.value(&scores) else { continue };
            let guards = scores.guards.len();
            self.finalists.push(Finalist { placement, guards, value, confirmed: None });
        }
        self.sort();
        self.finalists.truncate(FINALISTS);
    }

    fn sort(&mut self) {
        self.finalists.sort_by(|a, b| a.guards.cmp(&b.guards).then(b.value.total_cmp(&a.value)));
    }

    /// Scores the first finalists over all frames; true if following the level loses more than half
    /// the tolerance.
    pub(super) fn is_unsure(
        &mut self,
        full: &mut Evaluator,
        objective: &Objective,
    ) -> Result<bool, Error> {
        self.confirm(CHECKED, full, objective, &ProgressBar::hidden())?;
        let of_all: Vec<f64> =
            self.finalists.iter().take(CHECKED).filter_map(|f| f.confirmed).collect();
        let best = of_all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lost =
            of_all.first().map_or(0.0, |first| (best - first) / best.abs().max(f64::MIN_POSITIVE));
        self.worst = self.worst.max(lost);
        Ok(lost > 0.5 * TOLERANCE)
    }

    /// Goes on over the present level, which has more frames than the last.
    pub(super) fn widen(
        &mut self,
        generation: u64,
        evaluator: &mut Evaluator,
        objective: &Objective,
    ) -> Result<(), Error> {
        self.steps.push((generation, self.frames().len() as u32));
        let placements: Vec<Placement> =
            self.finalists.iter().map(|f| f.placement.clone()).collect();
        self.spent[2] += (placements.len() * self.frames().len()) as u64;
        for (finalist, scores) in self.finalists.iter_mut().zip(evaluator.scores(&placements)?) {
            finalist.guards = scores.guards.len();
            finalist.value = objective.value(&scores).unwrap_or(f64::NEG_INFINITY);
        }
        self.sort();
        Ok(())
    }

    /// Finalists that are still to be confirmed; none where the search itself is over all frames.
    pub(super) fn unconfirmed(&self) -> usize {
        let open = self.finalists.iter().filter(|f| f.confirmed.is_none()).count();
        if self.levels.len() == 1 { 0 } else { open }
    }

    /// The best of the finalists over all frames; `None` where the search itself was over all.
    pub(super) fn winner(
        &mut self,
        full: &mut Evaluator,
        objective: &Objective,
        bar: &ProgressBar,
    ) -> Result<Option<Placement>, Error> {
        if self.levels.len() == 1 {
            return Ok(None);
        }
        self.confirm(FINALISTS, full, objective, bar)?;
        let value = |f: &Finalist| f.confirmed.unwrap_or(f64::NEG_INFINITY);
        let order = |a: &&Finalist, b: &&Finalist| {
            a.guards.cmp(&b.guards).then(value(b).total_cmp(&value(a)))
        };
        Ok(self.finalists.iter().min_by(order).map(|f| f.placement.clone()))
    }

    fn confirm(
        &mut self,
        count: usize,
        full: &mut Evaluator,
        objective: &Objective,
        bar: &ProgressBar,
    ) -> Result<(), Error> {
        let mut open: Vec<&mut Finalist> =
            self.finalists.iter_mut().take(count).filter(|f| f.confirmed.is_none()).collect();
        let placements: Vec<Placement> = open.iter().map(|f| f.placement.clone()).collect();
        self.spent[2] += (placements.len() * full.problem().frame_count()) as u64;
        for (finalist, scores) in open.iter_mut().zip(scores_with(bar, full, &placements)?) {
            finalist.guards = scores.guards.len();
            finalist.confirmed = objective.value(&scores);
        }
        Ok(())
    }

    /// What was used, saved and risked.
    pub(super) fn report(&self, evaluations: u64) -> serde_json::Value {
        let all = self.levels[self.levels.len() - 1].len();
        let counts: Vec<usize> = self.levels.iter().map(Vec::len).collect();
        let [levels, search, confirm] = self.spent;
        let swaps = self.swapped * self.frames().len() as u64;
        let spent = levels + search + swaps + confirm;
        let full = (evaluations + self.swapped) * all as u64;
        let share = spent as f64 / full.max(1) as f64;
        serde_json::json!({
            "levels": counts,
            "frames": self.levels,
            "errors": self.errors,
            "steps": self.steps,
            "placement_frames": { "levels": levels, "search": search, "swaps": swaps, "confirm": confirm, "full": full },
            "share_of_full": share,
            "finalists": self.finalists.len(),
            "worst_loss_seen": self.worst,
            "words": self.words(share),
        })
    }

    fn words(&self, share: f64) -> String {
        let all = self.levels[self.levels.len() - 1].len();
        if self.levels.len() == 1 && all == 1 {
            return "searched over the only frame that there is".to_owned();
        }
        if self.levels.len() == 1 {
            return format!("searched over all {all} frames: less would not keep the ranking");
        }
        let steps: Vec<String> = self
            .steps
            .iter()
            .map(|(generation, frames)| match generation {
                0 => format!("{frames} of {all} frames"),
                _ => format!("{frames} after generation {generation}"),
            })
            .collect();
        let merging = self.merging.as_ref().filter(|m| m.used);
        let merged = merging.map_or(String::new(), |m| format!(" ({})", m.words()));
        format!(
            "searched over {}{merged}; with {} finalists confirmed over all frames this took {:.0} % of the \
             placements × frames of a search over all; checks saw a loss of {:.3} % at most",
            steps.join(", "),
            self.finalists.len(),
            100.0 * share,
            100.0 * self.worst
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two levels of which the second is all frames, and a merging that is used in the first.
    fn auto() -> Auto {
        let merging =
            Merging { cell: 0.2, triangles: 100, merged: 10, error: Some(0.001), used: true };
        Auto {
            levels: vec![vec![1], vec![0, 1]],
            errors: vec![Some(0.01), Some(0.0)],
            merging: Some(merging),
            at: 0,
            finalists: vec![],
            spent: [0; 3],
            searched: 0,
            swapped: 0,
            known: vec![],
            steps: vec![(0, 1)],
            worst: 0.0,
        }
    }

    #[test]
    fn a_search_over_all_frames_is_over_every_triangle() {
        let mut auto = auto();
        assert_eq!((auto.frames(), auto.cell()), (&[1][..], Some(0.2)));
        auto.at = auto.next();
        assert_eq!((auto.frames(), auto.cell()), (&[0, 1][..], None));
        auto.at = 0;
        auto.merging.as_mut().unwrap().used = false;
        assert_eq!(auto.cell(), None);
    }
}
