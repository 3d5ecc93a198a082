//! One scene and its engine: tallies, and scores with the guards of that scene.

use std::collections::BTreeMap;

use glam::DVec3;

use super::suite::Member;
use crate::engine::{Backend, BackendError};
use crate::problem::Tally;
use crate::score::{Scores, reference_layout, short_sight};
use crate::vehicle::{Placement, SensorName, SensorPose};

/// A member of a suite with its engine.
pub(super) struct Seat {
    pub member: Member,
    pub backend: Box<dyn Backend>,
    /// Tallies of the reference layout by number of LiDARs; see [`crate::score::Guard`].
    references: BTreeMap<Vec<SensorName>, Tally>,
}

impl Seat {
    pub fn new(member: Member, backend: Box<dyn Backend>) -> Self {
        Self { member, backend, references: BTreeMap::new() }
    }

    /// Tallies over all frames, with beams of `range` metres.
    pub fn tally(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Tally>, BackendError> {
        self.backend.tally(&self.member.seen(placements), range)
    }

    /// Scores and guards of placements whose tallies over all frames, with beams of `range` metres, are
    /// known.
    pub fn scores_from(
        &mut self,
        placements: &[Placement],
        tallies: &[Tally],
        range: Option<f32>,
    ) -> Result<Vec<Scores>, BackendError> {
        let problem = self.member.problem().clone();
        for models in placements.iter().map(models_of) {
            if !self.references.contains_key(&models) {
                let layout = reference_layout(problem.constraints(), &models);
                // With unlimited range, so that a placement whose range is cut, by fog say, compares
                // with a layout that sees all.
                let tally = self.tally(&[layout], Some(problem.far_range()))?.remove(0);
                self.references.insert(models, tally);
            }
        }
        let unlimited = self.unlimited_tallies(placements, range)?;
        let scores = placements.iter().zip(tallies).enumerate();
        let scores = scores.map(|(index, (placement, tally))| {
            let mut scores = Scores::new(
                &placement.name,
                tally,
                problem.content(),
                problem.frame_count(),
                problem.ends_at_hits(),
                self.references.get(&models_of(placement)),
            );
            let unlimited = unlimited.get(&index);
            scores.guards.extend(unlimited.and_then(|far| short_sight(tally, far)));
            scores
        });
        Ok(scores.collect())
    }

    /// Tallies without a limit of range, by index, of the placements that have voxels beyond it.
    fn unlimited_tallies(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<BTreeMap<usize, Tally>, BackendError> {
        let problem = self.member.problem();
        let roi = problem.roi();
        let (min, max) = (DVec3::from(roi.min()), DVec3::from(roi.max()));
        let sensors = problem.sensors();
        let is_limited = |pose: &SensorPose| {
            let position = pose.position();
            let farthest = (position - min).abs().max((position - max).abs()).length();
            let own = sensors.number(pose).map(|model| sensors.table(model).range());
            own.is_ok_and(|own| farthest > f64::from(range.unwrap_or(own)))
        };
        let seen = self.member.seen(placements);
        let limited: Vec<usize> =
            (0..placements.len()).filter(|&p| seen[p].lidars.iter().any(is_limited)).collect();
        let chosen: Vec<Placement> = limited.iter().map(|&i| seen[i].clone()).collect();
        let tallies = self.backend.tally(&chosen, Some(problem.far_range()))?;
        Ok(limited.into_iter().zip(tallies).collect())
    }
}

/// Names of the models of a placement's sensors, sorted.
fn models_of(placement: &Placement) -> Vec<SensorName> {
    let mut models: Vec<SensorName> = placement.lidars.iter().map(|pose| pose.sensor).collect();
    models.sort_unstable();
    models
}
