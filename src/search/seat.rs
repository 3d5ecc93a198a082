//! One scene and its engine: tallies, and scores with the guards of that scene, at once or a few frames at a time.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::suite::Member;
use crate::engine::{Backend, BackendError, CpuBackend};
use crate::problem::{Problem, Tally};
use crate::score::{Scores, reference_layout, short_sight};
use crate::vehicle::{Placement, SensorName, SensorPose};

/// Frames that are scored at once where a run may be told to stop in between; also the most frames that a run scores
/// whatever the time.
pub(crate) const FRAMES_AT_ONCE: usize = 32;
/// Least placements that are scored at once in such a run.
const PLACEMENTS_AT_ONCE: usize = 4;
/// Placements × frames that each thread of the host scores at once: a few seconds at most.
const HOST_AT_ONCE: usize = 64;
/// Placements × frames that a device scores at once.
const DEVICE_AT_ONCE: usize = 1 << 14;

/// Tallies placements over all frames, with beams of a range in metres; `None` where the run is to end before.
type TallyOf<'a> = dyn FnMut(&mut Seat, &[Placement], Option<f32>) -> Result<Option<Vec<Tally>>, BackendError>
    + 'a;

/// A member of a suite with its engine.
pub(super) struct Seat {
    pub member: Member,
    pub backend: Box<dyn Backend>,
    /// Bytes of work buffers on the host.
    memory: u64,
    /// Tallies of reference layouts by the models of their LiDARs; see [`crate::score::Guard`].
    references: BTreeMap<Vec<SensorName>, Tally>,
}

impl Seat {
    pub(crate) fn new(member: Member, backend: Box<dyn Backend>, memory: u64) -> Self {
        Self { member, backend, memory, references: BTreeMap::new() }
    }

    /// Groups of frames that are cast one after the other (none: all at once), and placements that are cast together.
    fn parts(&self) -> (Vec<Vec<usize>>, usize) {
        let problem = self.member.problem();
        let frames = problem.distinct_frames().len().max(1);
        let (groups, at_once) = match self.backend.name() {
            "cpu" => {
                let at_once = HOST_AT_ONCE * rayon::current_num_threads();
                (frame_groups(problem), at_once / frames.min(FRAMES_AT_ONCE))
            }
            _ => (Vec::new(), DEVICE_AT_ONCE / frames),
        };
        (groups, at_once.max(PLACEMENTS_AT_ONCE))
    }

    /// Number of calls of `go_on` by [`Self::scores_while`] for so many placements; a reference layout adds some.
    pub(crate) fn looks(&self, placements: usize) -> usize {
        let (groups, at_once) = self.parts();
        groups.len().max(1) * placements.div_ceil(at_once)
    }

    /// Tallies over all frames, with beams of `range` metres: a few placements at a time, and on the host a few frames.
    /// `None` once `go_on`, which is asked before each of them, says no.
    fn tally_while(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Tally>>, BackendError> {
        let problem = self.member.problem().clone();
        let classes = problem.content().set_count();
        let mut sums: Vec<Tally> =
            placements.iter().map(|p| Tally::zero(classes, p.lidars.len())).collect();
        let (groups, at_once) = self.parts();
        let mut add = |backend: &mut dyn Backend| -> Result<bool, BackendError> {
            for (some, sums) in placements.chunks(at_once).zip(sums.chunks_mut(at_once)) {
                if !go_on() {
                    return Ok(false);
                }
                let tallies = backend.tally(&self.member.seen(some), range)?;
                sums.iter_mut().zip(&tallies).for_each(|(sum, tally)| *sum += tally);
            }
            Ok(true)
        };
        if groups.len() < 2 {
            return Ok(add(&mut *self.backend)?.then_some(sums));
        }
        for frames in groups {
            let part = Arc::new(problem.over(&frames));
            if !add(&mut CpuBackend::new(part.task().clone(), self.memory))? {
                return Ok(None);
            }
        }
        Ok(Some(sums))
    }

    /// Scores and guards of placements, with beams of `range` metres.
    pub(crate) fn scores(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Scores>, BackendError> {
        let known = vec![None; placements.len()];
        let at_once = &mut |seat: &mut Self, some: &[Placement], range| {
            seat.backend.tally(&seat.member.seen(some), range).map(Some)
        };
        let scores = self.scores_by(placements, range, &known, at_once)?;
        Ok(scores.expect("nobody stops a tally at once"))
    }

    /// Like [`Self::scores`], to the same bits, with tallies over all frames that are already `known`; `None` once
    /// `go_on`, which is asked before every few placements and frames, says no.
    pub(crate) fn scores_while(
        &mut self,
        placements: &[Placement],
        known: &[Option<Tally>],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Scores>>, BackendError> {
        let in_parts =
            &mut |seat: &mut Self, some: &[Placement], range| seat.tally_while(some, range, go_on);
        self.scores_by(placements, None, known, in_parts)
    }

    /// Scores from tallies that are `known` or that `tally` returns; `None` where it returns none.
    fn scores_by(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
        known: &[Option<Tally>],
        tally: &mut TallyOf<'_>,
    ) -> Result<Option<Vec<Scores>>, BackendError> {
        let open = placements.iter().zip(known).filter(|(_, known)| known.is_none());
        let open: Vec<Placement> = open.map(|(placement, _)| placement.clone()).collect();
        let Some(cast) = tally(self, &open, range)? else { return Ok(None) };
        let mut cast = cast.into_iter();
        let tallies: Vec<Tally> =
            known.iter().filter_map(|known| known.clone().or_else(|| cast.next())).collect();
        let far = Some(self.member.problem().far_range());
        for (models, layout) in self.missing_references(placements) {
            let Some(sums) = tally(self, &[layout], far)? else { return Ok(None) };
            self.references.extend(sums.into_iter().map(|sums| (models.clone(), sums)));
        }
        let limited = self.limited(placements, range);
        let chosen: Vec<Placement> = limited.iter().map(|&i| placements[i].clone()).collect();
        let Some(unlimited) = tally(self, &chosen, far)? else { return Ok(None) };
        let unlimited = limited.into_iter().zip(unlimited).collect();
        Ok(Some(self.assembled(placements, &tallies, &unlimited)))
    }

    /// Reference layouts, by the models of a placement's sensors, that are not tallied yet.
    ///
    /// They are cast with unlimited range, so that a placement whose range is cut, by fog say, compares with a layout
    /// that sees all.
    fn missing_references(&self, placements: &[Placement]) -> BTreeMap<Vec<SensorName>, Placement> {
        let constraints = self.member.problem().constraints();
        let models = placements.iter().map(models_of);
        let missing = models.filter(|models| !self.references.contains_key(models));
        missing.map(|models| (models.clone(), reference_layout(constraints, &models))).collect()
    }

    /// Scores from tallies; `unlimited` holds those without a limit of range, by index.
    fn assembled(
        &self,
        placements: &[Placement],
        tallies: &[Tally],
        unlimited: &BTreeMap<usize, Tally>,
    ) -> Vec<Scores> {
        let problem = self.member.problem();
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
        scores.collect()
    }

    /// Indices of the placements that have voxels beyond the range of their sensors.
    fn limited(&self, placements: &[Placement], range: Option<f32>) -> Vec<usize> {
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
        (0..placements.len()).filter(|&p| seen[p].lidars.iter().any(is_limited)).collect()
    }
}

/// Frames in groups of at most [`FRAMES_AT_ONCE`] distinct ones, each with all that are equal to them.
fn frame_groups(problem: &Problem) -> Vec<Vec<usize>> {
    let distinct: Vec<usize> =
        problem.distinct_frames().into_iter().map(|(frame, _)| frame).collect();
    let mut groups = vec![Vec::new(); distinct.len().div_ceil(FRAMES_AT_ONCE)];
    for frame in 0..problem.frame_count() {
        if let Ok(place) = distinct.binary_search(&problem.first_equal(frame)) {
            groups[place / FRAMES_AT_ONCE].push(frame);
        }
    }
    groups
}

fn models_of(placement: &Placement) -> Vec<SensorName> {
    let mut models: Vec<SensorName> = placement.lidars.iter().map(|pose| pose.sensor).collect();
    models.sort_unstable();
    models
}
