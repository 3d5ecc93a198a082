//! A close look at the result of a search, and requirements in copies of a placement that are mounted a little off.

use std::time::Instant;

use super::{Job, JobError, Tolerance};
use crate::engine::{EngineChoice, open};
use crate::near_field::FEW_PLACEMENTS;
use crate::score::Scores;
use crate::search::{
    Evaluator, Event, FRAMES_OF_COPIES, Moved, Observer, Outcome, PATIENCE, SEED_OF_RESULT, Scored,
    TimeLimit,
};
use crate::vehicle::Placement;

/// Baselines looked at closely at once; the observer is asked in between.
const LOOKED_AT_ONCE: usize = 8;

impl Job {
    /// Looks closely at the result, and at up to [`FEW_PLACEMENTS`] baselines while there is time.
    pub(super) fn look_closely_at(
        &self,
        outcome: &mut Outcome,
        observer: &mut dyn Observer,
    ) -> Result<(), JobError> {
        let problem = self.problem()?;
        let mut engine = open(problem.task(), &EngineChoice::cpu(), |_| {})?.engine;
        let deadline = self.settings.time.as_ref().map(TimeLimit::deadline);
        let patience = Instant::now() + PATIENCE;
        let mut look = |some: &mut [Scored], observer: &mut dyn Observer| {
            let some = some.iter_mut();
            let some = some.map(|Scored { placement, scores, .. }| (&*placement, scores));
            let is_early = |deadline: Instant| Instant::now() < deadline;
            let mut go_on = || {
                is_early(patience) || (deadline.is_none_or(is_early) && observer.on(&Event::Asks))
            };
            self.look_closely_while(&mut *engine, some, &mut go_on)
        };
        if !look(outcome.best.as_mut_slice(), observer)? {
            observer.on(&Event::Note(
                "it is not known how the requirements hold in copies mounted a little off",
            ));
        }
        let few = outcome.baselines.len().min(FEW_PLACEMENTS);
        let mut looked = 0;
        for some in outcome.baselines[..few].chunks_mut(LOOKED_AT_ONCE) {
            let is_late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
            if looked > 0 && (is_late || !observer.on(&Event::Asks)) {
                break;
            }
            if !look(some, observer)? {
                break;
            }
            looked += some.len();
        }
        if looked < outcome.baselines.len() {
            let all = outcome.baselines.len();
            observer.on(&Event::Note(&format!(
                "range card, tolerance and own body are looked at for {looked} of {all} baselines"
            )));
        }
        Ok(())
    }

    /// An evaluator over the few frames of each scene in which copies are looked at.
    pub(super) fn over_few_frames(&self) -> Result<Evaluator, JobError> {
        let suite = self.suite()?;
        let few = suite.over(&suite.spread(Some(FRAMES_OF_COPIES)));
        Ok(Evaluator::suite_on_cpu(&few, self.settings.engine.memory_budget() / 2))
    }

    /// Adds to each requirement the share of copies that still meet it: copies whose LiDARs are off by the job's tolerance.
    /// Nothing without a tolerance or requirements.
    ///
    /// Targets are looked at as the requirement asks, with poses drawn anew for each copy. Areas, ground and overlap are looked
    /// at in 15 poses of each LiDAR, from which copies draw again, and in four frames of each scene; the change there is added
    /// to the share over all frames.
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
        if all.iter().all(|(_, scores)| scores.required.is_empty()) {
            return Ok(true);
        }
        let mut evaluator = self.over_few_frames()?;
        for (placement, scores) in all.iter_mut().filter(|(_, scores)| !scores.required.is_empty())
        {
            let looked_at = (*placement, &mut **scores);
            if !add_holds_in(&mut evaluator, looked_at, (tolerance, None), go_on)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Adds the shares of copies to one placement that requires something, all LiDARs off by a tolerance, or one of them; the
/// evaluator is [`Job::over_few_frames`]. False once `go_on` says no.
///
/// # Errors
/// See [`Job::add_holds`].
pub(super) fn add_holds_in(
    evaluator: &mut Evaluator,
    (placement, scores): (&Placement, &mut Scores),
    (tolerance, only): (Tolerance, Option<usize>),
    go_on: &mut dyn FnMut() -> bool,
) -> Result<bool, JobError> {
    let found: Vec<_> = scores.required.iter().map(|seen| (seen.share, seen.least)).collect();
    let off = (tolerance, SEED_OF_RESULT, only);
    let moved = Moved::new(off, (placement, found.len()), evaluator, go_on)?;
    let Some(moved) = moved else { return Ok(false) };
    let Some(holds) = moved.holds(&[], &found, go_on)? else { return Ok(false) };
    scores.requirements_hold_in = Some(holds.all);
    scores.copies_off = Some(tolerance.small());
    for (seen, share) in scores.required.iter_mut().zip(holds.each) {
        seen.holds_in = Some(share);
    }
    Ok(true)
}
