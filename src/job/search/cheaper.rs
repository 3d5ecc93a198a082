//! A cheaper rig of as many sensors as one whose placement meets all requirements.

use super::{Before, JobRun, JobState};
use crate::job::JobError;
use crate::json::counted;
use crate::score::HOLDS;
use crate::search::{Event, Observer, Outcome};

impl JobRun<'_> {
    /// True while a cheaper rig is searched than one that has met all requirements.
    pub(super) fn has_met(&self) -> bool {
        self.before.as_ref().is_some_and(|before| is_met(&before.outcome))
    }

    /// The result of the cheapest rig searched whose placement meets all requirements, or `None` where a cheaper one is searched
    /// next. One that meets them on paper only is no result where the dearer one holds.
    pub(super) fn met_or_cheaper(
        &mut self,
        outcome: Outcome,
        observer: &mut dyn Observer,
    ) -> Result<Option<Outcome>, JobError> {
        let is_over = outcome.stopped.is_unfinished() || self.is_late;
        let is_met = is_met(&outcome) && (!self.has_met() || self.holds_as_before(&outcome)?);
        let (Some(equipped), Some(fewest)) = (&self.state.equipped, &mut self.state.fewest) else {
            return Ok(Some(outcome));
        };
        let price = equipped.cost;
        // A search that was cut decides nothing about the prices.
        let next = if is_over { None } else { fewest.cheaper(equipped, is_met) };
        if let Some(before) = self.before.as_mut().filter(|_| !is_over && !is_met) {
            before.state.fewest.clone_from(&self.state.fewest);
        }
        let Some(next) = next else {
            let stopped = is_over.then_some(outcome.stopped);
            let before = self.before.take().filter(|_| !is_met);
            let mut outcome = before.map_or(outcome, |before| self.restore(before));
            outcome.stopped = stopped.unwrap_or(outcome.stopped);
            let JobState { equipped, fewest, .. } = &self.state;
            let untried = fewest.as_ref().zip(equipped.as_ref());
            let untried =
                untried.and_then(|(fewest, equipped)| fewest.untried_below(equipped.cost));
            outcome.untried = stopped.and(untried);
            return Ok(Some(outcome));
        };
        if is_met {
            observer.on(&Event::Note(&format!(
                "all requirements are met at a price of {price}; a cheaper rig of {} is searched",
                counted(next.equipment.len(), "sensor")
            )));
            // Without the search before, so that the state is of this one.
            self.before = None;
            if let (state, Some(run)) = (self.state(), self.run.take()) {
                self.before = Some(Before { state, run, outcome });
            }
        }
        self.state.course = self.job.equipping();
        self.search_with(next, observer)?;
        Ok(None)
    }

    /// True if as many copies of a result hold as are asked for, or if the result before does not hold either.
    fn holds_as_before(&self, outcome: &Outcome) -> Result<bool, JobError> {
        let holds = |outcome: &Outcome| {
            let Some(best) = &outcome.best else { return Ok(false) };
            let mut scores = best.scores.clone();
            self.job.add_holds(&mut [(&best.placement, &mut scores)], &mut || true)?;
            Ok::<bool, JobError>(scores.requirements_hold_in.is_none_or(|share| share >= HOLDS))
        };
        let before = || self.before.as_ref().map_or(Ok(false), |before| holds(&before.outcome));
        Ok(holds(outcome)? || !before()?)
    }
}

/// True if the best placement of a search meets all requirements.
pub(super) fn is_met(outcome: &Outcome) -> bool {
    outcome.best.as_ref().is_some_and(|best| best.scores.missing() <= 0.0)
}
