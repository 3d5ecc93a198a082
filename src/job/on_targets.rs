//! A closer look at requirements on targets: between the places of a search, and at places that are missed.

use super::{Job, JobError, without};
use crate::engine::BackendError;
use crate::score::Scores;
use crate::targets::{BodyPoses, confirm, missed_places};
use crate::vehicle::Placement;

impl Job {
    /// The first scene's vehicle, its bodies in every pose that they take in the scenes, and these; `None` without rules on
    /// targets.
    fn bodies_of_rules(&self) -> Result<Option<BodyPoses>, JobError> {
        let (Some(site), problem) = (self.target_site()?, self.problem()?) else { return Ok(None) };
        if problem.target_rules().is_empty() {
            return Ok(None);
        }
        let suite = self.suite()?;
        let members = suite.members().iter();
        let members = members.map(|member| (&**member.problem(), member.is_mirrored()));
        Ok(Some(BodyPoses::of(site.clone(), members)))
    }

    /// Looks again, at bearings as close together as the target is wide, at targets that are required everywhere and met
    /// everywhere. Returns the bodies for [`Self::name_missed_places`]; `None` without rules on targets.
    ///
    /// # Errors
    /// See [`Job::problem`]; a sensor that the vehicle does not have.
    pub(super) fn confirm_targets(
        &self,
        all: &mut [(&Placement, &mut Scores)],
    ) -> Result<Option<BodyPoses>, JobError> {
        let Some(bodies) = self.bodies_of_rules()? else { return Ok(None) };
        let problem = self.problem()?;
        for (placement, scores) in all {
            confirm(&bodies, &problem, placement, &mut scores.required)
                .map_err(BackendError::from)?;
        }
        Ok(Some(bodies))
    }

    /// Names places that a requirement on targets misses where enough others are seen; without the worst LiDAR where the
    /// requirement must hold whichever one is lost.
    ///
    /// # Errors
    /// See [`Self::confirm_targets`].
    pub(super) fn name_missed_places(
        &self,
        bodies: &BodyPoses,
        all: &mut [(&Placement, &mut Scores)],
    ) -> Result<(), JobError> {
        let problem = self.problem()?;
        for (placement, scores) in all {
            let (placement, required): (&Placement, _) = (placement, scores.required.iter_mut());
            for seen in required.filter(|seen| seen.is_met() && seen.share < 1.0) {
                let rule = problem.target_rules().iter().find(|rule| rule.name == seen.name);
                let Some(rule) = rule else { continue };
                let lost = seen.lost.as_ref().map(|lost| lost.worst.unwrap_or(0));
                let lost = lost.filter(|&lost| lost < placement.lidars.len());
                let left = lost.map(|lost| without(placement, lost));
                let lidars = &left.as_ref().unwrap_or(placement).lidars;
                let words = missed_places(bodies, rule, lidars).map_err(BackendError::from)?;
                let words = words.map(|words| match lost {
                    Some(lost) => format!("{words} (without LiDAR {lost})"),
                    None => words,
                });
                // Places that only a closer look misses are named already.
                seen.missing = words.or(seen.missing.take());
            }
        }
        Ok(())
    }
}
