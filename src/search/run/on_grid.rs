//! Swaps on a grid of sensor poses, over the frames of the search, and bounds, over those that it began with.

use super::seeing::Flaw;
use super::state::{Phase, Run};
use crate::score::Standing;
use crate::search::bound::bounds;
use crate::search::error::SearchError;
use crate::search::observer::{Event, Watch, Work};
use crate::search::outcome::Scored;
use crate::search::seat::FRAMES_AT_ONCE;
use crate::search::settings::{Method, Settings};
use crate::search::swaps::{Climbing, SwapSettings, Swapped, swap_anywhere, swap_from};
use crate::targets::Cars;
use crate::vehicle::{Placement, PoseGrid, Spacing};

/// Swaps over more frames than the first swaps.
struct Refinement {
    /// Multiple of the frames of the first swaps, or of [`LEAST_FRAMES`] if these are more.
    frames: usize,
    /// Steps along a pose field, at most.
    radius: u32,
    /// Halvings of the grid's spacing.
    halvings: i32,
}

/// Work of refinements, in casts of a pose in a frame.
struct Refining {
    /// Limit of one refinement.
    casts: u64,
    /// Done so far; a finished refinement counts with its limit.
    done: u64,
}

/// Refinements, in order: of the ends of the swaps on the grid, then of the best of them between its poses. If sensors are
/// of several kinds and the frames are few, swaps anywhere over all frames take the place of the first.
const REFINEMENTS: [Refinement; 2] = [
    Refinement { frames: 2, radius: 2, halvings: 0 },
    Refinement { frames: 12, radius: 1, halvings: 2 },
];

/// Frames of each scene that refinements count from if the first swaps are over fewer.
const LEAST_FRAMES: usize = 4;

/// Spacings of the grids, as shares of the first one, on which a flaw is mended: the next only where it stays on the one
/// before.
const AWAY: [f64; 2] = [0.25, 1.0];
/// Steps along a pose field, at most, by which a LiDAR moves then.
const AWAY_STEPS: u32 = 8;

/// Casts of the swaps over all frames, as a multiple of a refinement's.
const AGAIN: f64 = 1.2;
/// Least sensor poses a LiDAR of these swaps, or they are left out: fewer are spread too thin. On a van with 40 frames they
/// found less than the first refinement, in twice the time.
const LEAST_AGAIN: f64 = 50.0;

impl Run {
    /// Moves single LiDARs anywhere on the grid, of whose poses [`Method::Both`] casts as many as the swaps may, from the
    /// best of the generations and from the best baseline.
    pub(super) fn swap(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let settings = self.state.settings.clone();
        let starts = self.starts_of_swaps(watch)?;
        let has_result = self.best_of_generations().is_some();
        if watch.is_over() && self.heeds_time() {
            self.cut(watch);
            if has_result {
                self.state.phase = Phase::Bounds;
                return Ok(());
            }
            if self.frames().len() > FRAMES_AT_ONCE {
                self.hurry(watch);
            }
        }
        let swaps = match settings.method {
            Method::Cma => None,
            method => {
                let lidars = self.suite.constraints().lidars();
                let (casts, whole) = (settings.poses_for_swaps(lidars), method == Method::Swaps);
                self.swap_present(casts, whole, &starts, watch)?
            }
        };
        if watch.is_over() {
            self.cut(watch);
            if swaps.is_none() && !has_result && self.frames().len() > FRAMES_AT_ONCE {
                // Once more, over few frames: a run ends with something.
                self.hurry(watch);
                return Ok(());
            }
        }
        self.note_swaps(swaps.as_ref().map_or(0, |swaps| swaps.poses_cast));
        self.state.swaps = swaps;
        self.state.phase = Phase::Refine;
        Ok(())
    }

    /// Settings of swaps on a grid. Where LiDARs may be mounted a little off, more places of targets are wanted.
    fn settings_on(&self, spacing: Spacing, casts: u64, whole: bool) -> SwapSettings {
        let Settings { seed, tolerance, .. } = self.state.settings;
        let roomy = tolerance.is_some_and(|tolerance| tolerance.is_some());
        let (memory, looks_away) = (self.memory() / 2, false);
        SwapSettings { spacing, casts, whole, memory, seed, roomy, looks_away }
    }

    /// Swaps anywhere over the present frames, with about `casts` casts of a pose, or all poses of the whole grid.
    fn swap_present(
        &mut self,
        casts: u64,
        whole: bool,
        starts: &[Placement],
        watch: &mut Watch,
    ) -> Result<Option<Swapped>, SearchError> {
        self.swap_over(self.frames(), (casts, whole, Cars::AtSome), starts, watch)
    }

    /// Swaps anywhere over some frames, with about `casts` casts of a pose or all poses of the whole grid.
    fn swap_over(
        &mut self,
        frames: Vec<usize>,
        (casts, whole, cars): (u64, bool, Cars),
        starts: &[Placement],
        watch: &mut Watch,
    ) -> Result<Option<Swapped>, SearchError> {
        let settings = self.state.settings.clone();
        let (grid, spacing) = settings.grid(self.suite.constraints())?;
        let all = u64::from(grid.len());
        let total = if whole { all } else { all.min(casts) };
        let on_grid = self.settings_on(spacing, casts, whole);
        let climbing = Climbing::default();
        let (evaluator, objective) = (self.evaluator_over(frames, watch)?, &settings.objective);
        evaluator.watch_cars(objective, cars);
        let mut go_on = |cast: u64| {
            let (work, [done, total]) = match climbing.progress() {
                Some(climbs) => (Work::Climbs, climbs),
                None => (Work::Swaps, [cast.min(total), total]),
            };
            watch.tell(&Event::Progress { work, done, total })
        };
        let found = swap_anywhere(evaluator, objective, &on_grid, starts, &climbing, &mut go_on);
        evaluator.watch_cars(objective, Cars::AtSome);
        found
    }

    /// Swaps anywhere once more, over all frames, and adds the ends to the starts of the refinement that follows:
    /// with sensors of several kinds few frames prefer some layouts that more frames do not.
    fn swap_again(
        &mut self,
        work: &mut Refining,
        starts: &mut Vec<Placement>,
        watch: &mut Watch,
    ) -> Result<(), SearchError> {
        let casts = (AGAIN * work.casts as f64) as u64 / self.frames().len() as u64;
        let others = self.starts_of_swaps(watch)?;
        work.done += work.casts;
        let Some(found) = self.swap_present(casts, false, &others, watch)? else { return Ok(()) };
        self.count_swaps(&found);
        if let Some(swaps) = &mut self.state.swaps {
            swaps.climbs = found.climbs;
        }
        starts.splice(0..0, std::iter::once(found.placement).chain(found.others));
        Ok(())
    }

    /// Moves single LiDARs of the ends of the swaps to poses nearby, over more frames and on finer grids. In each
    /// refinement as many casts, of a pose in a frame, as in the swaps before at most, counted over four frames of each scene at least.
    pub(super) fn refine(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let before = self.state.clone();
        self.state.phase = Phase::Bounds;
        let Some(swaps) = self.state.swaps.clone() else { return Ok(()) };
        let mut starts = vec![swaps.placement];
        starts.extend(swaps.others);
        starts.extend(self.starts_of_swaps(watch)?);
        let lidars = self.suite.constraints().lidars();
        let poses = self.state.settings.poses_for_swaps(lidars);
        let (frames, all) = (self.frames().len(), self.suite.frame_count());
        let counted = frames.max(LEAST_FRAMES * self.suite.members().len());
        let mut work = Refining { casts: poses.saturating_mul(counted as u64), done: 0 };
        let is_mixed = self.suite.constraints().kinds().len() > 1;
        let needed = LEAST_AGAIN * (lidars * all) as f64;
        let again = is_mixed && all > frames && AGAIN * work.casts as f64 >= needed;
        for (index, refinement) in REFINEMENTS.iter().enumerate() {
            let again = again && index == 0;
            let most = if again { all } else { refinement.frames * counted };
            let generation = self.state.generations.generation;
            if let Some(levels) = &mut self.state.levels {
                levels.go_to_within(most, generation);
            }
            if again {
                self.swap_again(&mut work, &mut starts, watch)?;
            } else {
                self.refine_over(refinement, &mut work, &mut starts, watch)?;
            }
            if watch.is_over() {
                self.cut_at(before, watch);
                return Ok(());
            }
        }
        let casts = work.casts / self.frames().len() as u64;
        for flaw in [Flaw::AtBody, Flaw::Blind] {
            self.mend(flaw, &mut starts, casts, watch)?;
            if watch.is_over() {
                self.cut_at(before, watch);
                break;
            }
        }
        Ok(())
    }

    /// Counts the work of more swaps.
    fn count_swaps(&mut self, found: &Swapped) {
        self.note_swaps(found.poses_cast);
        if let Some(swaps) = &mut self.state.swaps {
            swaps.evaluations += found.evaluations;
            swaps.poses_cast += found.poses_cast;
        }
    }

    /// Where the best end has a flaw, swaps once more from the ends against it, with so many `casts` at most on each grid.
    ///
    /// LiDARs look away from the own body then, or each place that loses a car counts. The new end joins the others: the best
    /// of them is the result.
    fn mend(
        &mut self,
        flaw: Flaw,
        starts: &mut Vec<Placement>,
        casts: u64,
        watch: &mut Watch,
    ) -> Result<(), SearchError> {
        let Some(best) = self.state.swaps.as_ref().map(|swaps| swaps.placement.clone()) else {
            return Ok(());
        };
        let (settings, mut end) = (self.state.settings.clone(), best);
        if flaw == Flaw::Blind && !watch.is_over() && self.has(flaw, &end, watch)? {
            // From the first grid on: near an end that few lost places separate from a better one, swaps stay there.
            let all = settings.poses_for_swaps(self.suite.constraints().lidars());
            let frames = self.frames_of_bounds();
            let found = self.swap_over(frames, (all, false, Cars::AtAll), starts, watch)?;
            found.iter().for_each(|found| self.count_swaps(found));
            starts.splice(0..0, found.into_iter().map(|found| found.placement));
        }
        let Spacing { metres, radians } = settings.grid(self.suite.constraints())?.1;
        // Flaws come one after the other, each with its grids.
        let (before, grids) = (usize::from(flaw == Flaw::Blind) * AWAY.len(), 2 * AWAY.len());
        for (k, share) in AWAY.into_iter().enumerate() {
            if watch.is_over() || !self.has(flaw, &end, watch)? {
                break;
            }
            let spacing = Spacing { metres: share * metres, radians: share * radians };
            if PoseGrid::new(self.suite.constraints(), spacing).is_err() {
                continue;
            }
            let looks_away = flaw == Flaw::AtBody;
            let on_grid = SwapSettings { looks_away, ..self.settings_on(spacing, casts, false) };
            let (evaluator, objective) = (self.evaluator(watch)?, &settings.objective);
            evaluator.watch_cars(objective, if looks_away { Cars::AtSome } else { Cars::AtAll });
            let mut go_on = |cast: u64| {
                let done = (before + k) as u64 * casts + cast.min(casts);
                let (work, total) = (Work::Mending, grids as u64 * casts);
                watch.tell(&Event::Progress { work, done, total })
            };
            let found = swap_from(evaluator, objective, &on_grid, AWAY_STEPS, starts, &mut go_on);
            evaluator.watch_cars(objective, Cars::AtSome);
            let Some(found) = found? else { continue };
            self.count_swaps(&found);
            if let Some(swaps) = &mut self.state.swaps {
                swaps.others.insert(0, found.placement.clone());
            }
            starts.insert(0, found.placement.clone());
            end = found.placement;
        }
        Ok(())
    }

    /// Refines the best of some starts over the present frames, and puts the ends in their place.
    fn refine_over(
        &mut self,
        refinement: &Refinement,
        work: &mut Refining,
        starts: &mut Vec<Placement>,
        watch: &mut Watch,
    ) -> Result<(), SearchError> {
        let (settings, frames) = (self.state.settings.clone(), self.frames().len() as u64);
        let (first, end) = (work.done, work.done + work.casts);
        let halvings = if settings.delta.is_some() { 0 } else { refinement.halvings };
        let Spacing { metres, radians } = settings.grid(self.suite.constraints())?.1;
        for halving in 0..=halvings {
            let share = 0.5_f64.powi(halving);
            let spacing = Spacing { metres: share * metres, radians: share * radians };
            let is_grid = PoseGrid::new(self.suite.constraints(), spacing).is_ok();
            if watch.is_over() || !is_grid {
                break;
            }
            let casts = (end - work.done) / frames;
            let on_grid = self.settings_on(spacing, casts, false);
            let evaluator = self.evaluator(watch)?;
            let (done, total) = (work.done, REFINEMENTS.len() as u64 * work.casts);
            let mut go_on = |cast: u64| {
                let done = (done + cast * frames).min(end);
                watch.tell(&Event::Progress { work: Work::Refinements, done, total })
            };
            let (objective, radius) = (&settings.objective, refinement.radius);
            let found = swap_from(evaluator, objective, &on_grid, radius, starts, &mut go_on)?;
            let Some(found) = found else { continue };
            work.done = (work.done + found.poses_cast * frames).min(end);
            self.note_swaps(found.poses_cast);
            *starts = std::iter::once(&found.placement).chain(&found.others).cloned().collect();
            self.state.swaps = self.state.swaps.take().map(|swaps| found.after(&swaps));
        }
        work.done = first + work.casts;
        Ok(())
    }

    /// The result of the generations, before the best baseline: it has most to gain where casts run out.
    fn starts_of_swaps(&mut self, watch: &mut Watch) -> Result<Vec<Placement>, SearchError> {
        let mut starts: Vec<Placement> = self.best_of_generations().into_iter().collect();
        starts.extend(self.best_baseline(watch)?);
        Ok(starts)
    }

    fn best_of_generations(&self) -> Option<Placement> {
        let best = self.state.generations.best().map(|best| &best.placement);
        self.state.chosen.as_ref().or(best).cloned()
    }

    fn note_swaps(&mut self, poses: u64) {
        if let Some(levels) = &mut self.state.levels {
            levels.note_swaps(poses);
        }
    }

    /// The best baseline that keeps every rule and violates no guard.
    fn best_baseline(&mut self, watch: &mut Watch) -> Result<Option<Placement>, SearchError> {
        let lidars = self.suite.constraints().lidars();
        let Some(mut good) = self.baselines(watch)? else { return Ok(None) };
        good.retain(|baseline| {
            baseline.violations.is_empty()
                && baseline.standing().is_sound()
                && baseline.objective.is_some()
                && baseline.placement.lidars.len() == lidars
        });
        let standings: Vec<Standing> = good.iter().map(Scored::standing).collect();
        Ok(Standing::best(&standings).map(|best| good.swap_remove(best).placement))
    }

    /// Samples the grid, and bounds the gain of every placement on it.
    pub(super) fn bound(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        if watch.is_over() && self.heeds_time() && self.frames_of_bounds().len() > FRAMES_AT_ONCE {
            self.cut(watch);
            self.state.phase = Phase::Confirm;
            return Ok(());
        }
        let (settings, memory) = (self.state.settings.clone(), self.memory() / 2);
        let bounds = bounds(self.evaluator_of_bounds(watch)?, &settings, memory, watch)?;
        if watch.is_over() {
            self.cut(watch);
        }
        self.state.bounds = Some(bounds);
        self.state.phase = Phase::Confirm;
        Ok(())
    }
}
