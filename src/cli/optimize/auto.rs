//! `--fidelity auto`: search over few frames, more when they no longer tell the best apart, and confirm
//! the finalists over all.

use serde::{Deserialize, Serialize};
use sightline::fidelity::{Level, World, candidates, frame_levels};
use sightline::placement::{Constraints, Placement};
use sightline::score::{Objective, Scores};
use sightline::search::Evaluator;

use super::Run;
use crate::cli::args::Compute;
use crate::cli::error::Error;
use crate::cli::load;

/// Placements by which the levels are found, beside the baselines.
const SAMPLE: usize = 8;
/// Share of the best score that a level may lose.
const TOLERANCE: f64 = 0.01;
/// Placements that are confirmed over all frames at the end.
const FINALISTS: usize = 8;
/// Finalists whose order is checked over all frames.
const CHECKED: usize = 3;
/// Generations between two checks.
const GENERATIONS: u64 = 8;

/// Value of `--fidelity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum FidelityChoice {
    /// As few frames as keep the ranking.
    Auto,
    /// Every frame.
    Full,
}

/// Share of the evaluations after which a search is over no less than [`LATE_FRAMES`] of the frames:
/// what is left to gain then is smaller than what few frames know.
const LATE: f64 = 2.0 / 3.0;
/// Share of all frames.
const LATE_FRAMES: f64 = 0.25;

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
    /// Frames of each level, rising; the last is all of them.
    levels: Vec<u32>,
    /// Present level.
    at: usize,
    finalists: Vec<Finalist>,
    /// Placements × frames: to find the levels, to search, to check and confirm.
    spent: [u64; 3],
    /// Placements × frames of the search in this sitting.
    #[serde(skip)]
    pub(super) searched: u64,
    /// (generation, frames from then on), the start first.
    steps: Vec<(u64, u32)>,
    /// Most that was lost by following a level, as a share of the best score, as the checks saw it.
    worst: f64,
}

impl Auto {
    /// Finds the level to begin with.
    pub(super) fn new(
        world: &mut World,
        constraints: &Constraints,
        baselines: &[Placement],
        objective: &Objective,
        seed: u64,
        memory: u64,
    ) -> Result<Self, Error> {
        let sample = candidates(constraints, baselines, SAMPLE, seed);
        let levels = frame_levels(world, &sample, objective, TOLERANCE, seed, memory)?;
        let frames = |level: &Level| level.frames;
        let levels: Vec<u32> = levels.iter().map(frames).collect();
        let all = u64::from(levels[levels.len() - 1]);
        let spent = if all > 1 { sample.len() as u64 * all } else { 0 };
        let steps = vec![(0, levels[0])];
        Ok(Self {
            levels,
            at: 0,
            finalists: vec![],
            spent: [spent, 0, 0],
            searched: 0,
            steps,
            worst: 0.0,
        })
    }

    /// Frames of the present level.
    pub(super) fn frames(&self) -> u32 {
        self.levels[self.at]
    }

    /// Position of the next level; that of the last one where there is none.
    fn next(&self) -> usize {
        (self.at + 1).min(self.levels.len() - 1)
    }

    /// Position of the least level that is enough after this share of the evaluations.
    fn least(&self, progress: f64) -> usize {
        let all = f64::from(self.levels[self.levels.len() - 1]);
        let enough = |frames: &u32| progress < LATE || f64::from(*frames) >= LATE_FRAMES * all;
        self.levels.iter().position(enough).unwrap_or(0)
    }

    /// Whether the present level is all frames.
    fn is_full(&self) -> bool {
        self.at + 1 == self.levels.len()
    }

    /// Whether the order of the finalists is to be checked after this generation.
    fn is_due(&self, generation: u64) -> bool {
        !self.is_full() && generation.is_multiple_of(GENERATIONS)
    }

    /// Takes note of a generation: placements that keep the rules of the mount, and their scores.
    fn note(&mut self, scored: Vec<(Placement, Scores)>, objective: &Objective) {
        let searched = scored.len() as u64 * u64::from(self.frames());
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

    /// Scores the first finalists over all frames; true if following the level loses more than a
    /// quarter of the tolerance.
    fn is_unsure(&mut self, full: &mut Evaluator, objective: &Objective) -> Result<bool, Error> {
        self.confirm(CHECKED, full, objective)?;
        let of_all: Vec<f64> =
            self.finalists.iter().take(CHECKED).filter_map(|f| f.confirmed).collect();
        let best = of_all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let lost =
            of_all.first().map_or(0.0, |first| (best - first) / best.abs().max(f64::MIN_POSITIVE));
        self.worst = self.worst.max(lost);
        Ok(lost > 0.25 * TOLERANCE)
    }

    /// Goes on with more frames.
    fn widen(
        &mut self,
        level: usize,
        generation: u64,
        evaluator: &mut Evaluator,
        objective: &Objective,
    ) -> Result<(), Error> {
        self.at = level;
        self.steps.push((generation, self.frames()));
        let placements: Vec<Placement> =
            self.finalists.iter().map(|f| f.placement.clone()).collect();
        self.spent[2] += placements.len() as u64 * u64::from(self.frames());
        for (finalist, scores) in self.finalists.iter_mut().zip(evaluator.scores(&placements)?) {
            finalist.guards = scores.guards.len();
            finalist.value = objective.value(&scores).unwrap_or(f64::NEG_INFINITY);
        }
        self.sort();
        Ok(())
    }

    /// The best of the finalists over all frames; `None` where the search itself was over all.
    pub(super) fn winner(
        &mut self,
        full: &mut Evaluator,
        objective: &Objective,
    ) -> Result<Option<Placement>, Error> {
        if self.levels.len() == 1 {
            return Ok(None);
        }
        self.confirm(FINALISTS, full, objective)?;
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
    ) -> Result<(), Error> {
        let mut open: Vec<&mut Finalist> =
            self.finalists.iter_mut().take(count).filter(|f| f.confirmed.is_none()).collect();
        let placements: Vec<Placement> = open.iter().map(|f| f.placement.clone()).collect();
        self.spent[2] += (placements.len() * full.problem().frame_count()) as u64;
        for (finalist, scores) in open.iter_mut().zip(full.scores(&placements)?) {
            finalist.guards = scores.guards.len();
            finalist.confirmed = objective.value(&scores);
        }
        Ok(())
    }

    /// What was used, saved and risked.
    pub(super) fn report(&self, evaluations: u64) -> serde_json::Value {
        let all = self.levels[self.levels.len() - 1];
        let [levels, search, confirm] = self.spent;
        let spent = levels + search + confirm;
        let full = evaluations * u64::from(all);
        let share = spent as f64 / full.max(1) as f64;
        serde_json::json!({
            "levels": self.levels,
            "steps": self.steps,
            "placement_frames": { "levels": levels, "search": search, "confirm": confirm, "full": full },
            "share_of_full": share,
            "finalists": self.finalists.len(),
            "worst_loss_seen": self.worst,
            "words": self.words(share),
        })
    }

    fn words(&self, share: f64) -> String {
        let all = self.levels[self.levels.len() - 1];
        if self.levels.len() == 1 {
            return format!("searched over all {all} frame(s): fewer would not keep the ranking");
        }
        let steps: Vec<String> = self
            .steps
            .iter()
            .map(|(generation, frames)| match generation {
                0 => format!("{frames} of {all} frames"),
                _ => format!("{frames} from generation {} on", generation + 1),
            })
            .collect();
        format!(
            "searched over {}; with {} finalists confirmed over all frames this took {:.0} % of the \
             placements × frames of a search over all; checks saw a loss of {:.3} % at most",
            steps.join(", "),
            self.finalists.len(),
            100.0 * share,
            100.0 * self.worst
        )
    }
}

impl Run {
    /// Lets `auto` look at the last generation, and goes on with more frames where it wants them.
    pub(super) fn widen(
        &mut self,
        compute: &Compute,
        frames: usize,
        open: &dyn Fn(&[usize]) -> Result<Evaluator, Error>,
    ) -> Result<(), Error> {
        let Some(auto) = &mut self.auto else { return Ok(()) };
        let generation = self.search.generation();
        auto.note(self.evaluator.take_last(), &self.objective);
        let progress = self.search.evaluations() as f64 / self.settings.search.evaluations as f64;
        let mut level = auto.least(progress).max(auto.at);
        if level == auto.at && auto.is_due(generation) {
            // Opened anew for each check: two evaluators at a time are two scenes on the device.
            let mut full = open(&load::spread(frames, None))?;
            if auto.is_unsure(&mut full, &self.objective)? {
                level = auto.next();
            }
        }
        if level == auto.at || self.search.stopped().is_some() {
            return Ok(());
        }
        let wider = auto.levels[level];
        compute.talk.note(format!("generation {generation}: on with {wider} frames"));
        self.evaluator = open(&load::spread(frames, Some(wider)))?;
        auto.widen(level, generation, &mut self.evaluator, &self.objective)?;
        self.search.rescore_best(&mut self.evaluator, &self.objective)?;
        self.evaluator.keep_last();
        Ok(())
    }
}
