//! Frames on demand: a search begins over a few frames that stand for all, goes on over more when they no
//! longer tell the best apart, and its finalists are confirmed over all.

mod words;

use serde::{Deserialize, Serialize};

use super::error::SearchError;
use super::generations::MOST_COUNTED;
use super::pilot::{Known, Pilot};
use super::settings::Settings;
use super::suite::Suite;
use crate::score::{Objective, Scores, Standing};
use crate::vehicle::{Constraints, Placement, random_placements};

/// Fewest placements by which the frames are chosen: the baselines, or random ones beside them.
const SAMPLE: usize = 8;
/// Most baselines by which the frames are chosen: they are cast in every frame.
const MOST_SAMPLED: usize = 32;
/// Draws for each random placement wanted, before the rules of the mount are given up.
const DRAWS: usize = 50;
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
/// error of the first is below [`LATE_ERROR`]: the gains left then are smaller than that error.
const LATE: f64 = 0.5;
/// Error of a level that is enough for all generations. Swaps are over the second level at least: they
/// end at the best placement they see, which one frame flatters most.
const LATE_ERROR: f64 = 0.5 * TOLERANCE;
/// Least frames of the first swaps. At equal work, many poses over two frames find more than half as many over four.
const FRAMES_OF_SWAPS: usize = 2;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Finalist {
    placement: Placement,
    /// Over the frames of the present level.
    standing: Standing,
    /// Over all frames, once it is known.
    confirmed: Option<Standing>,
}

/// Levels of frames, the present one, and the finalists.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct FramesOnDemand {
    /// Frames of each level, numbered through all scenes, ever more; the last is all of them.
    levels: Vec<Vec<usize>>,
    /// Error of each level against all frames, as the pilot saw it; see [`super::Level`].
    errors: Vec<Option<f64>>,
    at: usize,
    finalists: Vec<Finalist>,
    work: PlacementFrames,
    /// (generation, frames from then on), the start first.
    steps: Vec<(u64, u32)>,
    /// Largest loss from following a level that was seen, as a share of the best score; `None` where none was compared.
    #[serde(default)]
    worst_loss: Option<f64>,
}

/// Placements × frames that were scored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
struct PlacementFrames {
    levels: u64,
    search: u64,
    /// Sensor poses × frames.
    swaps: u64,
    confirm: u64,
}

/// Frames that a search on demand used, the work that they saved, and the loss that they risked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FramesUsed {
    /// Number of frames of each level.
    pub levels: Vec<usize>,
    /// Numbers of the frames of each level.
    pub frames: Vec<Vec<usize>>,
    /// Error of each level against all frames, as a share of the score.
    pub errors: Vec<Option<f64>>,
    /// (generation, frames from then on), the start first.
    pub steps: Vec<(u64, u32)>,
    /// Placements × frames by purpose.
    pub placement_frames: WorkByPurpose,
    /// Work as a share of that of a search over all frames.
    pub share_of_full: f64,
    /// Placements confirmed over all frames.
    pub finalists: usize,
    /// Largest loss that was seen, as a share of the best score; `None` where no finalists were compared over all frames.
    pub worst_loss_seen: Option<f64>,
    /// These facts in a sentence.
    pub words: String,
}

/// Placements × frames by purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct WorkByPurpose {
    /// To choose the levels.
    pub levels: u64,
    /// By the generations.
    pub search: u64,
    /// By the swaps: sensor poses, counted as whole placements.
    pub swaps: u64,
    /// To check and to confirm.
    pub confirm: u64,
    /// For comparison, by a search over all frames.
    pub full: u64,
}

/// The end of a search, as far as the levels do not hold it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SearchEnd {
    /// Frames that the result is scored over.
    pub frames: usize,
    /// Why it ended early, in words; empty where it did not.
    pub early: &'static str,
}

impl FramesOnDemand {
    /// Checks that loaded levels fit a suite of `frames` frames.
    pub(crate) fn check(&self, frames: usize) -> Result<(), String> {
        let PlacementFrames { levels: chosen, search, swaps, confirm } = self.work;
        let parts = [
            ("the present level is not among them", self.at < self.levels.len()),
            ("one holds no frame", self.levels.iter().all(|level| !level.is_empty())),
            (
                "one holds a frame that the scenes lack, or not in rising order",
                self.levels.iter().all(|level| {
                    level.is_sorted_by(|a, b| a < b) && level.iter().all(|&frame| frame < frames)
                }),
            ),
            ("the last is not all frames", self.levels.last().is_some_and(|l| l.len() == frames)),
            ("their errors are not one a level", self.errors.len() == self.levels.len()),
            ("they have no first step", !self.steps.is_empty()),
            (
                "their counts are beyond any run",
                chosen.max(search).max(swaps).max(confirm) <= MOST_COUNTED,
            ),
        ];
        let fault = parts.into_iter().find(|(_, is_whole)| !is_whole);
        fault.map_or(Ok(()), |(fault, _)| Err(format!("levels of frames: {fault}")))
    }

    pub(crate) fn held(&self) -> impl Iterator<Item = &Placement> {
        self.finalists.iter().map(|finalist| &finalist.placement)
    }

    /// Chooses the levels of a suite over all frames, by a pilot of the baselines and some random
    /// placements, within about `memory` bytes; hands out the pilot's tallies over all frames. `None` once `go_on`,
    /// which is asked as [`Pilot::new`] does, says no.
    pub(crate) fn choose(
        whole: &Suite,
        settings: &Settings,
        memory: u64,
        go_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Option<(Self, Known)>, SearchError> {
        let count = whole.frame_count();
        let (mut levels, mut errors) = (vec![(0..count).collect()], vec![None]);
        let mut work = PlacementFrames::default();
        let mut known = Vec::new();
        if count > 1 {
            let sample = sample(whole.constraints(), settings);
            let Some(pilot) = Pilot::new(whole, sample, memory, go_on)? else { return Ok(None) };
            let found = pilot.levels(&settings.objective, FIRST_ERROR);
            (levels, errors) = found.into_iter().map(|l| (l.frames, l.error)).unzip();
            (work.levels, known) = (pilot.work(), pilot.tallies());
        }
        Ok(Some((Self { work, ..Self::over(levels, errors) }, known)))
    }

    /// A search over the frames `few`, taken without a comparison with all: there was no time.
    pub(crate) fn hurried(few: Vec<usize>, all: usize) -> Self {
        Self::over(vec![few, (0..all).collect()], vec![None; 2])
    }

    fn over(levels: Vec<Vec<usize>>, errors: Vec<Option<f64>>) -> Self {
        let steps = vec![(0, levels[0].len() as u32)];
        let (at, finalists, worst_loss) = (0, Vec::new(), None);
        let work = PlacementFrames::default();
        Self { levels, errors, at, finalists, work, steps, worst_loss }
    }

    pub(crate) fn frames(&self) -> &[usize] {
        &self.levels[self.at]
    }

    pub(crate) fn first(&self) -> &[usize] {
        &self.levels[0]
    }

    fn is_full(&self) -> bool {
        self.at + 1 == self.levels.len()
    }

    /// True if fewer than all frames were ever searched over.
    fn has_choice(&self) -> bool {
        self.levels.len() > 1
    }

    pub(crate) fn level(&self) -> usize {
        self.at
    }

    /// Position of the least level from the present one on that is enough after a share of the evaluations.
    pub(crate) fn enough(&self, progress: f64) -> usize {
        let exact = self.errors[0].is_some_and(|error| error <= LATE_ERROR);
        let least = if progress < LATE || exact { 0 } else { self.second() };
        least.max(self.at)
    }

    /// Position of the level after the present one; of the last one where there is none.
    pub(crate) fn next(&self) -> usize {
        (self.at + 1).min(self.levels.len() - 1)
    }

    /// Position of the level that swaps are over.
    pub(crate) fn of_swaps(&self) -> usize {
        let enough = self.levels.iter().position(|level| level.len() >= FRAMES_OF_SWAPS);
        enough.unwrap_or(self.levels.len() - 1).max(self.second()).max(self.at)
    }

    /// Position of the second level, or of the only one.
    fn second(&self) -> usize {
        1.min(self.levels.len() - 1)
    }

    /// Goes to a level after a generation; the finalists are to be scored there.
    pub(crate) fn go_to(&mut self, level: usize, generation: u64) {
        self.at = level;
        self.steps.push((generation, self.frames().len() as u32));
    }

    /// Goes to the last level of at most `frames` frames, where that is beyond the present one; the finalists are not
    /// scored there.
    pub(crate) fn go_to_within(&mut self, frames: usize, generation: u64) {
        let within = |level: &usize| self.levels[*level].len() <= frames;
        if let Some(level) = (self.at + 1..self.levels.len()).rev().find(within) {
            self.go_to(level, generation);
        }
    }

    /// Counts sensor poses cast by swaps over the present frames.
    pub(crate) fn note_swaps(&mut self, poses: u64) {
        let casts = poses.saturating_mul(self.frames().len() as u64);
        self.work.swaps = self.work.swaps.saturating_add(casts);
    }

    /// True if the order of the finalists is to be checked after this generation.
    pub(crate) fn is_due(&self, generation: u64) -> bool {
        !self.is_full() && generation.is_multiple_of(GENERATIONS)
    }

    /// Takes note of a generation: placements that keep the rules of the mount, and their scores.
    pub(crate) fn note(&mut self, scored: Vec<(Placement, Scores)>, objective: &Objective) {
        self.work.search += (scored.len() * self.frames().len()) as u64;
        let standings = scored.into_iter().map(|(placement, scores)| Finalist {
            placement,
            standing: Standing::of(&scores, objective),
            confirmed: None,
        });
        self.finalists.extend(standings.filter(|finalist| finalist.standing.value.is_some()));
        self.sort();
        self.finalists.truncate(FINALISTS);
    }

    fn sort(&mut self) {
        self.finalists.sort_by(|a, b| a.standing.compare(&b.standing));
    }

    /// All finalists, to be scored over a new level.
    pub(crate) fn finalists(&self) -> Vec<Placement> {
        self.finalists.iter().map(|finalist| finalist.placement.clone()).collect()
    }

    /// Takes the scores of all finalists over the present level, which has more frames than the last.
    pub(crate) fn rescored(&mut self, scores: &[Scores], objective: &Objective) {
        self.work.confirm += (scores.len() * self.frames().len()) as u64;
        for (finalist, scores) in self.finalists.iter_mut().zip(scores) {
            finalist.standing = Standing::of(scores, objective);
        }
        self.sort();
    }

    /// Finalists whose order is checked, that are not confirmed over all frames yet.
    pub(crate) fn to_check(&self) -> Vec<Placement> {
        self.unconfirmed(CHECKED)
    }

    /// All finalists that are not confirmed over all frames yet; none where the search itself is over all.
    pub(crate) fn to_confirm(&self) -> Vec<Placement> {
        if self.has_choice() { self.unconfirmed(FINALISTS) } else { Vec::new() }
    }

    fn unconfirmed(&self, count: usize) -> Vec<Placement> {
        let some = self.finalists.iter().take(count).filter(|f| f.confirmed.is_none());
        some.map(|finalist| finalist.placement.clone()).collect()
    }

    /// Takes the scores over all frames of the first finalists that were not confirmed yet.
    pub(crate) fn confirmed(&mut self, scores: &[Scores], objective: &Objective) {
        let all = self.levels[self.levels.len() - 1].len();
        self.work.confirm += (scores.len() * all) as u64;
        let open = self.finalists.iter_mut().filter(|f| f.confirmed.is_none());
        for (finalist, scores) in open.zip(scores) {
            let standing = Standing::of(scores, objective);
            finalist.standing.guards = standing.guards;
            finalist.confirmed = Some(standing);
        }
    }

    /// True if following the present level loses more than half the tolerance, as the checked finalists see it.
    pub(crate) fn is_unsure(&mut self) -> bool {
        self.note_loss(CHECKED).is_some_and(|lost| lost > 0.5 * TOLERANCE)
    }

    /// Takes note of the loss from following the last level of the generations, as all confirmed finalists see it.
    pub(crate) fn note_last_loss(&mut self) {
        if !self.is_full() {
            self.note_loss(FINALISTS);
        }
    }

    /// Takes note of the loss that so many finalists see: (best over all frames − that of the first) / |best|. `None` where
    /// the first is not confirmed, or alone.
    fn note_loss(&mut self, count: usize) -> Option<f64> {
        let over_all = |f: &Finalist| f.confirmed.and_then(|standing| standing.value);
        let mut of_all = self.finalists.iter().take(count).map(over_all);
        let first = of_all.next()??;
        let best = of_all.flatten().reduce(f64::max)?.max(first);
        let lost = (best - first) / best.abs().max(f64::MIN_POSITIVE);
        self.worst_loss = Some(self.worst_loss.map_or(lost, |worst| worst.max(lost)));
        Some(lost)
    }

    /// The best of the confirmed finalists; `None` where the search itself was over all frames.
    pub(crate) fn winner(&self) -> Option<Placement> {
        let confirmed: Vec<(&Finalist, Standing)> =
            self.finalists.iter().filter_map(|f| Some((f, f.confirmed?))).collect();
        let standings: Vec<Standing> = confirmed.iter().map(|(_, standing)| *standing).collect();
        let best = Standing::best(&standings).filter(|_| self.has_choice())?;
        Some(confirmed[best].0.placement.clone())
    }

    /// Frames used, saved and risked by a search of `evaluations` placements, whose swaps cast `poses_swapped`
    /// sensor poses, `lidars` of them a placement.
    pub(crate) fn used(
        &self,
        evaluations: u64,
        poses_swapped: u64,
        lidars: usize,
        end: SearchEnd,
    ) -> FramesUsed {
        let all = self.levels[self.levels.len() - 1].len();
        let swapped = poses_swapped.div_ceil(lidars.max(1) as u64);
        let PlacementFrames { levels, search, swaps, confirm } = self.work;
        let swaps = swaps.div_ceil(lidars.max(1) as u64);
        let full = evaluations.saturating_add(swapped).saturating_mul(all as u64);
        let done = [search, swaps, confirm].into_iter().fold(levels, u64::saturating_add);
        let share_of_full = done as f64 / full.max(1) as f64;
        FramesUsed {
            levels: self.levels.iter().map(Vec::len).collect(),
            frames: self.levels.clone(),
            errors: self.errors.clone(),
            steps: self.steps.clone(),
            placement_frames: WorkByPurpose { levels, search, swaps, confirm, full },
            share_of_full,
            finalists: self.confirmed_count(),
            worst_loss_seen: self.worst_loss,
            words: self.words(share_of_full, end),
        }
    }

    fn confirmed_count(&self) -> usize {
        let confirmed = |f: &&Finalist| !self.has_choice() || f.confirmed.is_some();
        self.finalists.iter().filter(confirmed).count()
    }
}

/// Placements by which the levels are chosen: the first [`MOST_SAMPLED`] baselines of as many LiDARs as the mount has, and
/// random ones where these are few, those that keep the rules first.
fn sample(constraints: &Constraints, settings: &Settings) -> Vec<Placement> {
    let alike = settings.baselines.iter().filter(|b| b.lidars.len() == constraints.lidars());
    let mut sample: Vec<Placement> = alike.take(MOST_SAMPLED).cloned().collect();
    let random = SAMPLE.saturating_sub(sample.len());
    sample.extend(drawn(constraints, random, settings.seed));
    sample
}

/// Placements drawn evenly from the mount, those that keep its rules first.
pub(crate) fn drawn(constraints: &Constraints, count: usize, seed: u64) -> Vec<Placement> {
    let mut drawn = random_placements(constraints, count * DRAWS, seed);
    drawn.sort_by_key(|placement| !constraints.violations(placement).is_empty());
    drawn.truncate(count);
    drawn
}
