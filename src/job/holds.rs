//! Requirements in copies of a placement that are mounted a little off.

use super::{Job, JobError};
use crate::score::Scores;
use crate::search::{Evaluator, FRAMES_OF_COPIES, Moved};
use crate::vehicle::Placement;

impl Job {
    /// Adds to each requirement the share of copies that still meet it: copies whose LiDARs are off by the job's
    /// tolerance, each in one of 16 poses. Nothing without a tolerance or requirements.
    ///
    /// Targets are looked at as the requirement asks. Areas and ground are looked at in four frames of each scene, and
    /// the change there is added to the share over all frames.
    ///
    /// False once `go_on`, which is asked after every few poses and frames, says no: nothing is added to the others.
    ///
    /// # Errors
    /// An engine that fails, a sensor that the vehicle does not have.
    pub(super) fn add_holds(
        &self,
        all: &mut [(&Placement, &mut Scores)],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<bool, JobError> {
        let Some(tolerance) = self.tolerance.filter(|tolerance| tolerance.is_some()) else {
            return Ok(true);
        };
        let all = all.iter_mut().filter(|(_, scores)| !scores.required.is_empty());
        let mut all: Vec<_> = all.collect();
        if all.is_empty() {
            return Ok(true);
        }
        let suite = self.suite()?;
        let few = suite.over(&suite.spread(Some(FRAMES_OF_COPIES)));
        let mut evaluator = Evaluator::suite_on_cpu(&few, self.settings.engine.memory_budget() / 2);
        for (placement, scores) in &mut all {
            let moved = Moved::new(tolerance, placement, &mut evaluator, go_on)?;
            let Some(moved) = moved else { return Ok(false) };
            let found: Vec<_> =
                scores.required.iter().map(|seen| (seen.share, seen.least)).collect();
            let holds = moved.holds(&[], &found);
            scores.requirements_hold_in = Some(holds.all);
            for (seen, share) in scores.required.iter_mut().zip(holds.each) {
                seen.holds_in = Some(share);
            }
        }
        Ok(true)
    }
}
