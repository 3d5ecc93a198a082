//! A closer look at requirements on targets: between their places, and at places that are missed.

use super::{Job, JobError, without};
use crate::engine::BackendError;
use crate::score::Scores;
use crate::targets::{BodyPoses, look_between, missed_places};
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

    /// Looks at places closer together for requirements on targets. Names places that one misses where
    /// enough others are seen; without the worst LiDAR where the requirement must hold whichever one is lost.
    ///
    /// # Errors
    /// See [`Job::problem`]; a sensor that the vehicle does not have.
    pub(super) fn look_at_targets(
        &self,
        all: &mut [(&Placement, &mut Scores)],
    ) -> Result<(), JobError> {
        let Some(bodies) = self.bodies_of_rules()? else { return Ok(()) };
        let problem = self.problem()?;
        for (placement, scores) in all {
            let placement: &Placement = placement;
            for seen in &mut scores.required {
                let rule = problem.target_rules().iter().find(|rule| rule.name == seen.name);
                let Some(rule) = rule else { continue };
                let between = look_between(&bodies, rule, &placement.lidars);
                seen.between = Some(between.map_err(BackendError::from)?);
                if !seen.is_met() || seen.share >= 1.0 {
                    continue;
                }
                let lost = seen.lost.as_ref().map(|lost| lost.worst.unwrap_or(0));
                let lost = lost.filter(|&lost| lost < placement.lidars.len());
                let left = lost.map(|lost| without(placement, lost));
                let lidars = &left.as_ref().unwrap_or(placement).lidars;
                let words = missed_places(&bodies, rule, lidars).map_err(BackendError::from)?;
                let words = words.map(|words| match lost {
                    Some(lost) => format!("{words} (without LiDAR {lost})"),
                    None => words,
                });
                seen.missing = words.or(seen.missing.take());
            }
        }
        Ok(())
    }
}
