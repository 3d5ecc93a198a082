//! Redundancy and overlap of the LiDARs of placements, in every scene of a job.

use super::{Job, JobError, JobScene};
use crate::shared::{Overlap, Redundancy, RedundancySite};
use crate::targets::TargetQuestion;
use crate::vehicle::Placement;

impl JobScene {
    /// The scene's voxels, ground and targets, to count the LiDARs that see them. Under conditions a beam meets a target
    /// if enough light comes back; fog, snow and rain dim it, others change no target.
    ///
    /// # Errors
    /// See [`Self::problem`].
    pub fn redundancy_site(&self) -> Result<RedundancySite, JobError> {
        let targets = self.target_site()?.cloned();
        Ok(RedundancySite::new(self.scene(), self.problem()?, targets))
    }
}

impl Job {
    /// Voxels, ground and targets by the number of LiDARs that see them: for each scene, each placement. Targets are
    /// those of [`redundancy_question`](crate::shared::redundancy_question).
    ///
    /// # Errors
    /// See [`Self::evaluator`]; an engine that fails, a sensor that the vehicle does not have.
    pub fn redundancy(
        &self,
        placements: &[Placement],
        question: &TargetQuestion,
    ) -> Result<Vec<Redundancy>, JobError> {
        let (mut evaluator, _) = self.clone().mirrored(false).evaluator(|_| {})?;
        let mut all = Vec::new();
        for (index, scene) in self.scenes.iter().enumerate() {
            let (site, (_, engine)) = (scene.redundancy_site()?, evaluator.member_mut(index));
            for placement in placements {
                all.push(site.look(engine, question, placement)?);
            }
        }
        Ok(all)
    }

    /// Surfaces and directions that pairs of LiDARs share: for each scene, each placement. Pairs of `least_shared` or
    /// more voxels count.
    ///
    /// # Errors
    /// See [`Self::evaluator`] and [`Overlap::new`].
    pub fn overlap(
        &self,
        placements: &[Placement],
        least_shared: u64,
    ) -> Result<Vec<Overlap>, JobError> {
        let (mut evaluator, _) = self.clone().mirrored(false).evaluator(|_| {})?;
        let mut all = Vec::new();
        for (index, scene) in self.scenes.iter().enumerate() {
            let (member, engine) = evaluator.member_mut(index);
            for placement in placements {
                let (scene, problem) = (scene.scene(), member.problem());
                all.push(Overlap::new(scene, problem, engine, placement, least_shared)?);
            }
        }
        Ok(all)
    }
}
