//! Swaps on a grid of sensor poses, over the frames of the search, and bounds, over those that it began with.

use super::state::{Phase, Run};
use crate::score::Standing;
use crate::search::bound::bounds;
use crate::search::error::SearchError;
use crate::search::observer::{Event, Watch, Work};
use crate::search::outcome::Scored;
use crate::search::seat::FRAMES_AT_ONCE;
use crate::search::settings::Method;
use crate::search::swaps::{SWAP_SPACING, SwapSettings, swap_anywhere, swap_from};
use crate::vehicle::{Placement, PoseGrid};

impl Run {
    /// Moves single LiDARs on the grid, from the best of the generations and from the best baseline.
    pub(super) fn swap(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let settings = self.state.settings.clone();
        // The result of the generations first: it has most to gain where casts run out.
        let best = self.state.generations.best().map(|best| &best.placement);
        let mut starts: Vec<Placement> =
            self.state.chosen.as_ref().or(best).cloned().into_iter().collect();
        let has_result = !starts.is_empty();
        starts.extend(self.best_baseline(watch)?);
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
        let on_grid = SwapSettings {
            spacing: settings.delta.unwrap_or(SWAP_SPACING),
            casts: settings.poses_for_swaps(self.suite.constraints().lidars()),
            memory: self.memory() / 2,
            seed: settings.seed,
        };
        // Greedy may find a placement that keeps the rules where no candidate of the generations did.
        let anywhere = settings.method == Method::Swaps || starts.is_empty();
        let grid = PoseGrid::new(self.suite.constraints(), on_grid.spacing)?;
        let total = if anywhere { u64::from(grid.len()) } else { on_grid.casts };
        let evaluator = self.evaluator(watch)?;
        let mut go_on = |cast: u64| {
            let done = cast.min(total);
            watch.tell(&Event::Progress { work: Work::Swaps, done, total })
        };
        let objective = &settings.objective;
        let swaps = match settings.method {
            Method::Cma => None,
            _ if anywhere => swap_anywhere(evaluator, objective, &on_grid, &starts, &mut go_on)?,
            _ => swap_from(evaluator, objective, &on_grid, &starts, &mut go_on)?,
        };
        if watch.is_over() {
            self.cut(watch);
            if swaps.is_none() && !has_result && self.frames().len() > FRAMES_AT_ONCE {
                // Once more, over few frames: a run ends with something.
                self.hurry(watch);
                return Ok(());
            }
        }
        self.state.swaps = swaps;
        self.state.phase = Phase::Bounds;
        Ok(())
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
