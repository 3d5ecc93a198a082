//! One LiDAR lost: scores, requirements and blind sectors of a placement without each of its LiDARs.

use serde::Serialize;

use super::{Job, JobError};
use crate::engine::BackendError;
use crate::score::{Scores, Seen, lidar_name};
use crate::search::Evaluator;
use crate::targets::BlindSector;
use crate::vehicle::Placement;

/// A placement with all its LiDARs, and with each lost in turn.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Losses {
    /// Scores with all LiDARs. A requirement that must hold without any one LiDAR has its least share over all losses.
    pub scores: Scores,
    /// A row a LiDAR, in the order of the placement; empty for a placement of one LiDAR.
    pub losses: Vec<Loss>,
}

/// A placement without one LiDAR.
#[derive(Debug, Clone, Serialize)]
pub struct Loss {
    /// Number of the LiDAR that is lost, from 0.
    pub lidar: usize,
    /// Its number and, where the vehicle names some, its mount: `LiDAR 2 (roof)`.
    pub name: String,
    /// Scores of the other LiDARs. A requirement that must hold without any one LiDAR is looked at with this one lost,
    /// and no second.
    pub scores: Scores,
    /// Requirements that all LiDARs together meet, and the others do not.
    pub broken: Vec<Seen>,
    /// Requirements that all LiDARs together miss already, and the others, too.
    pub already_missed: Vec<Seen>,
    /// Blind sectors of the others that all LiDARs together do not have; empty with coverage `through`.
    pub blind: Vec<BlindSector>,
}

impl Losses {
    /// Sectors that are blind with all LiDARs; empty with coverage `through`.
    pub fn blind(&self) -> &[BlindSector] {
        blind(&self.scores)
    }

    /// True if all LiDARs together meet every requirement, none of them lost.
    pub fn is_met(&self) -> bool {
        self.scores.required.iter().cloned().all(|seen| as_it_is(seen).is_met())
    }
}

impl Loss {
    /// Requirements that the other LiDARs do not meet, whether or not all together do.
    pub fn unmet(&self) -> impl Iterator<Item = &Seen> {
        self.scores.required.iter().filter(|seen| !seen.is_met())
    }

    /// Requirements that are not met and sectors that are blind without this LiDAR, in words; requirements that all LiDARs
    /// together miss are told as `already`.
    pub(crate) fn told(&self) -> Vec<String> {
        let new = self.broken.iter().map(Seen::to_string);
        let old = self.already_missed.iter().map(|seen| format!("already {seen}"));
        let blind = self.blind.iter().map(|sector| format!("BLIND: {sector}"));
        new.chain(blind).chain(old).collect()
    }

    /// Width of all sectors that are blind without this LiDAR, degrees; `None` with coverage `through`.
    pub fn blind_degrees(&self) -> Option<f64> {
        self.scores.range_card.as_ref()?;
        // A sum of nothing is −0.
        Some(0.0 + blind(&self.scores).iter().map(BlindSector::degrees).sum::<f64>())
    }
}

fn blind(scores: &Scores) -> &[BlindSector] {
    scores.range_card.as_ref().map_or(&[], |card| &card.blind)
}

/// A requirement that must hold without any one LiDAR, as that on the LiDARs there are.
fn as_it_is(mut seen: Seen) -> Seen {
    if let Some(lost) = seen.lost.take() {
        (seen.share, seen.missing) = (lost.intact, None);
    }
    seen
}

/// The placement without one of its LiDARs.
pub(crate) fn without(placement: &Placement, lost: usize) -> Placement {
    let mut lidars = placement.lidars.clone();
    lidars.remove(lost);
    Placement { name: format!("without-{lost}"), lidars }
}

impl Job {
    /// Scores a placement as it is, and without each of its LiDARs in turn.
    ///
    /// # Errors
    /// See [`Self::evaluator`]; an engine that fails, a sensor that the vehicle does not have.
    pub fn losses(&self, placement: &Placement) -> Result<Losses, JobError> {
        let (mut evaluator, _) = self.evaluator(|_| {})?;
        Ok(self.losses_while(&mut evaluator, placement, &mut || true)?.unwrap_or_default())
    }

    /// Like [`Self::losses`]; `None` once `go_on`, which is asked often, says no.
    ///
    /// # Errors
    /// An engine that fails, a sensor that the vehicle does not have.
    pub fn losses_while(
        &self,
        evaluator: &mut Evaluator,
        placement: &Placement,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Losses>, JobError> {
        let lost = if placement.lidars.len() > 1 { 0..placement.lidars.len() } else { 0..0 };
        let all = std::iter::once(placement.clone());
        let all: Vec<Placement> =
            all.chain(lost.clone().map(|lost| without(placement, lost))).collect();
        let Some(mut scores) = evaluator.scores_while(&all, go_on)? else { return Ok(None) };
        self.add_range_cards(all.iter().zip(&mut scores))?;
        let left = scores.split_off(1);
        let whole = scores.pop().unwrap_or_default();
        let met: Vec<bool> =
            whole.required.iter().cloned().map(|seen| as_it_is(seen).is_met()).collect();
        let known = blind(&whole);
        let problem = evaluator.shared_problem();
        let mounts = problem.rules().mount_names(placement);
        let missing = evaluator.missing_without_each(placement).map_err(BackendError::from)?;
        let row = |(lidar, mut scores): (usize, Scores)| {
            scores.required = scores.required.into_iter().map(as_it_is).collect();
            // Words name LiDARs by their numbers in the whole rig.
            for seen in &mut scores.required {
                let words = missing[lidar].iter().find(|(name, _)| *name == seen.name);
                seen.missing = words.map(|(_, words)| words.clone()).or(seen.missing.take());
            }
            let unmet = scores.required.iter().zip(&met).filter(|(seen, _)| !seen.is_met());
            let (broken, missed): (Vec<_>, Vec<_>) = unmet.partition(|(_, met)| **met);
            let [broken, already_missed] =
                [broken, missed].map(|all| all.into_iter().map(|(seen, _)| seen.clone()).collect());
            let new = blind(&scores)
                .iter()
                .filter(|sector| !known.iter().any(|known| sector.is_within(known)));
            let blind = new.cloned().collect();
            let name = lidar_name(lidar, mounts.get(lidar).copied().flatten());
            Loss { lidar, name, scores, broken, already_missed, blind }
        };
        let losses = lost.zip(left).map(row).collect();
        Ok(Some(Losses { scores: whole, losses }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SensorPose;

    #[test]
    fn one_lidar_less_each_time() {
        let pose = |x| SensorPose { x, y: 0.0, z: 2.0, ..SensorPose::default() };
        let placement = Placement { name: "p".into(), lidars: [1.0, 2.0, 3.0].map(pose).to_vec() };
        let left = [0, 1, 2].map(|lost| without(&placement, lost));
        let xs = left.map(|p| p.lidars.iter().map(|l| l.x).collect::<Vec<_>>());
        assert_eq!(xs, [[2.0, 3.0], [1.0, 3.0], [1.0, 2.0]]);
    }
}
