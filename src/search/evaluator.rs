//! Scores of placements: one scene or several, an engine for each, and the scores over all of them.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use rayon::prelude::*;
use serde::Serialize;

use super::pilot::Known;
use super::seat::Seat;
use super::suite::{Member, Suite};
use crate::engine::{Backend, BackendError, CpuBackend, EngineChoice, open};
use crate::near_field::self_hits;
use crate::problem::{Problem, Tally};
use crate::scene::Scene;
use crate::score::{Guard, Objective, Scores, Seen, totals};
use crate::targets::{Cars, Sight, SightBeams};
use crate::vehicle::{Constraints, Placement, SensorName, SensorPose, UnknownSensor};

/// Scores placements on an engine for each scene; most have one scene.
pub struct Evaluator {
    /// At least one.
    seats: Vec<Seat>,
    /// Targets and ground that must be met, and a car all round where a search looks for it.
    sight: Option<Arc<Sight>>,
    /// Where a search looks whether LiDARs look at the own body.
    own_body: Option<OwnBodyLooks>,
}

/// A scene whose own body LiDARs may look at, and whether poses do: more than a quarter of their beams end there.
struct OwnBodyLooks {
    scene: Arc<Scene>,
    known: HashMap<([u64; 6], SensorName), bool>,
}

fn key_of(lidar: &SensorPose) -> ([u64; 6], SensorName) {
    (lidar.values().map(f64::to_bits), lidar.sensor)
}

/// The scores of a placement in one of several scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneScores {
    /// Name of the scene.
    pub scene: String,
    /// The scores there.
    pub scores: Scores,
}

/// The scores of a placement over all scenes, see `Scores::over_scenes`, and in each of several.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// Scores over all scenes.
    pub scores: Scores,
    /// Scores in each of several scenes, mirror images included; empty where there is one.
    pub by_scene: Vec<SceneScores>,
}

/// A placement as the rules on targets, ground and overlap see it.
struct Met {
    /// Share of beams on a car that are missing, if a search looks.
    car_missing: Option<f64>,
    seen: Vec<Seen>,
    /// `[scenes][rules]`; empty where there is one scene.
    by_scene: Vec<Vec<Seen>>,
    /// LiDARs, among those looked at, that a rule needs.
    needed: Vec<usize>,
}

/// Looks at a placement, and whether a rule needs some of its LiDARs that gain little.
fn met(
    sight: &Sight,
    (placement, scenes): (&Placement, usize),
    idle: &[usize],
) -> Result<Met, UnknownSensor> {
    let each = placement.lidars.iter().map(|lidar| sight.beams(lidar));
    let each = each.collect::<Result<Vec<_>, _>>()?;
    let mut all = SightBeams::default();
    each.iter().for_each(|beams| all.add(beams));
    let each: Vec<&SightBeams> = each.iter().collect();
    let mut seen = sight.rules_met(&each);
    let needed = idle.iter().copied().filter(|lidar| sight.needs(&each, *lidar)).collect();
    for lost in seen.iter_mut().filter_map(|seen| seen.lost.as_mut()) {
        lost.mount = lost.worst.and_then(|lidar| sight.mount_of(placement, lidar));
    }
    let by_scene = if scenes > 1 { sight.in_each_scene(&each, &seen, scenes) } else { Vec::new() };
    Ok(Met { car_missing: sight.car_missing(&all), seen, by_scene, needed })
}

fn scores_of(judged: Vec<Judged>) -> Vec<Scores> {
    judged.into_iter().map(|judged| judged.scores).collect()
}

/// Targets and ground that the rules of the vehicle name, and a car all round.
fn sight_of(seats: &[Seat], cars: Cars) -> Option<Arc<Sight>> {
    let scenes = seats.iter().map(|seat| (seat.member.problem(), seat.member.is_mirrored()));
    Sight::of(scenes, cars).map(Arc::new)
}

impl Evaluator {
    fn of_seats(seats: Vec<Seat>) -> Self {
        let sight = sight_of(&seats, Cars::Nowhere);
        Self { seats, sight, own_body: None }
    }

    /// An evaluator on the CPU, with half of the free memory for work buffers.
    pub fn on_cpu(problem: impl Into<Arc<Problem>>) -> Self {
        let problem = problem.into();
        let memory = EngineChoice::cpu().memory_budget();
        let engine = Box::new(CpuBackend::new(problem.task().clone(), memory));
        Self::new(problem, engine)
    }

    /// An evaluator of a problem; its mount decides where the reference layout of the guards stands.
    pub fn new(problem: Arc<Problem>, backend: Box<dyn Backend>) -> Self {
        let memory = EngineChoice::cpu().memory_budget();
        let seat = |member: &Member| Seat::new(member.clone(), backend, memory);
        let seats = Suite::from(problem).members().first().map(seat).into_iter().collect();
        Self::of_seats(seats)
    }

    /// An evaluator of all members of a suite on the CPU, within about `memory` bytes.
    pub fn suite_on_cpu(suite: &Suite, memory: u64) -> Self {
        let share = memory / suite.members().len().max(1) as u64;
        let seat = |member: &Member| {
            let engine = CpuBackend::new(member.problem().task().clone(), share);
            Seat::new(member.clone(), Box::new(engine), share)
        };
        Self::of_seats(suite.members().iter().map(seat).collect())
    }

    /// Opens an engine for each member of a suite; returns the notes of the first opening, too.
    ///
    /// # Errors
    /// See [`open`].
    pub fn open(
        suite: &Suite,
        choice: &EngineChoice,
        on_change: impl Fn(&str) + Clone + Send + 'static,
    ) -> Result<(Self, Vec<String>), BackendError> {
        let mut choice = choice.clone();
        if !suite.is_single() {
            choice.memory = Some(choice.memory_budget() / suite.members().len().max(1) as u64);
        }
        let (mut seats, mut notes) = (Vec::new(), Vec::new());
        for member in suite.members() {
            let opened = open(member.problem().task(), &choice, on_change.clone())?;
            if seats.is_empty() {
                notes = opened.notes;
            }
            seats.push(Seat::new(member.clone(), opened.engine, choice.memory_budget()));
        }
        Ok((Self::of_seats(seats), notes))
    }

    /// A copy that scores sight of a car all round, too: for a search by an objective that must not win by looking
    /// away.
    #[must_use]
    pub(super) fn watching_cars(mut self, objective: &Objective) -> Self {
        self.watch_cars(objective, Cars::AtSome);
        self
    }

    /// Scores sight of a car at these places from now on, where the objective must not win by looking away.
    pub(super) fn watch_cars(&mut self, objective: &Objective, cars: Cars) {
        let cars = if objective.weighs_place() { cars } else { Cars::Nowhere };
        self.sight = sight_of(&self.seats, cars);
    }

    /// A copy that tells which LiDARs look at the own body of a scene.
    #[must_use]
    pub(super) fn looking_at_body(self, scene: Option<Arc<Scene>>) -> Self {
        let own_body = scene.map(|scene| OwnBodyLooks { scene, known: HashMap::new() });
        Self { own_body, ..self }
    }

    /// Number of LiDARs that end more than a quarter of their beams at the own body, see [`self_hits`]; 0 where no body is
    /// looked at.
    pub(super) fn at_own_body(&mut self, lidars: &[SensorPose]) -> Result<usize, BackendError> {
        let Some(OwnBodyLooks { scene, known }) = &mut self.own_body else { return Ok(0) };
        let new = lidars.iter().filter(|lidar| !known.contains_key(&key_of(lidar)));
        let new = Placement { name: String::new(), lidars: new.copied().collect() };
        if !new.lidars.is_empty() {
            let Seat { member, backend, .. } = &mut self.seats[0];
            let guards = self_hits(scene, member.problem(), &mut **backend, &new)?;
            known.extend(new.lidars.iter().map(|lidar| (key_of(lidar), false)));
            for guard in guards {
                let Guard::SelfHit { lidar, .. } = guard else { continue };
                known.insert(key_of(&new.lidars[lidar]), true);
            }
        }
        Ok(lidars.iter().filter(|lidar| known[&key_of(lidar)]).count())
    }

    pub(super) fn sight(&self) -> Option<&Arc<Sight>> {
        self.sight.as_ref()
    }

    /// Missing parts of the rules on targets, ground and overlap without each LiDAR of a placement, in words by the name of
    /// the rule.
    pub(crate) fn missing_without_each(
        &self,
        placement: &Placement,
    ) -> Result<Vec<Vec<(String, String)>>, UnknownSensor> {
        let Some(sight) = &self.sight else { return Ok(vec![Vec::new(); placement.lidars.len()]) };
        let each = placement.lidars.par_iter().map(|lidar| sight.beams(lidar));
        let each = each.collect::<Result<Vec<_>, _>>()?;
        let each: Vec<&SightBeams> = each.iter().collect();
        Ok((0..each.len()).map(|lost| sight.missing_without(&each, lost)).collect())
    }

    /// The problem; of several the first.
    pub fn problem(&self) -> &Problem {
        self.seats[0].member.problem()
    }

    /// The problem, to be shared; of several the first.
    pub fn shared_problem(&self) -> Arc<Problem> {
        self.seats[0].member.problem().clone()
    }

    /// Scenes and mirror images, each with its engine.
    pub fn members(&self) -> impl ExactSizeIterator<Item = (&Member, &dyn Backend)> {
        self.seats.iter().map(|seat| (&seat.member, &*seat.backend))
    }

    /// Frames of all members together.
    pub fn frame_count(&self) -> usize {
        self.seats.iter().map(|seat| seat.member.problem().frame_count()).sum()
    }

    /// The rules of the mount.
    pub fn constraints(&self) -> &Constraints {
        self.problem().constraints()
    }

    /// The engine; with several scenes, the engine of the first.
    pub fn backend(&self) -> &dyn Backend {
        &*self.seats[0].backend
    }

    /// The engine, for single stages; with several scenes, the engine of the first.
    pub fn backend_mut(&mut self) -> &mut dyn Backend {
        &mut *self.seats[0].backend
    }

    /// A scene or mirror image by its number from 0, with its engine for single stages.
    pub(crate) fn member_mut(&mut self, member: usize) -> (&Member, &mut dyn Backend) {
        let Seat { member, backend, .. } = &mut self.seats[member];
        (member, &mut **backend)
    }

    pub(super) fn backends_mut(&mut self) -> impl Iterator<Item = &mut Box<dyn Backend>> {
        self.seats.iter_mut().map(|seat| &mut seat.backend)
    }

    /// Devices lost since the engines were opened and their replacements, in words.
    pub fn changes(&self) -> Vec<String> {
        self.seats.iter().flat_map(|seat| seat.backend.changes().iter().cloned()).collect()
    }

    /// Linear indices of the voxels that a placement covers in any frame, rising; in the first of several
    /// scenes.
    ///
    /// # Errors
    /// See [`Backend::covered`].
    pub fn covered(&mut self, placement: &Placement) -> Result<Vec<u64>, BackendError> {
        Ok(self.covered_in(0, placement, &mut |_, _| true)?.unwrap_or_default())
    }

    /// Like [`Self::covered`], in the member of that number, from 0. `go_on` is told before each frame how many are done, of
    /// how many; `None` once it says no.
    ///
    /// # Errors
    /// See [`Backend::covered`].
    ///
    /// # Panics
    /// There is no such member.
    pub fn covered_in(
        &mut self,
        member: usize,
        placement: &Placement,
        go_on: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<Option<Vec<u64>>, BackendError> {
        let Seat { member, backend, .. } = &mut self.seats[member];
        let mut union = BTreeSet::new();
        let (frames, seen) = (member.problem().frame_count(), std::slice::from_ref(placement));
        let seen = member.seen(seen);
        let mut covered = Vec::new();
        for frame in 0..frames {
            if !go_on(frame, frames) {
                return Ok(None);
            }
            covered = backend.covered(&seen[0], frame)?;
            if frames > 1 {
                union.extend(covered.iter().copied());
            }
        }
        Ok(Some(if frames > 1 { union.into_iter().collect() } else { covered }))
    }

    /// Scores and guards of each placement, in order; over all scenes.
    ///
    /// # Errors
    /// See [`Backend::tally`].
    pub fn scores(&mut self, placements: &[Placement]) -> Result<Vec<Scores>, BackendError> {
        Ok(scores_of(self.judged(placements)?))
    }

    /// Like [`Self::scores`], and the scores in each of several scenes beside them.
    ///
    /// # Errors
    /// See [`Backend::tally`].
    pub fn judged(&mut self, placements: &[Placement]) -> Result<Vec<Judged>, BackendError> {
        self.judged_at(placements, None)
    }

    /// Like [`Self::judged`], to the same bits, with tallies that are already `known`; `None` once `go_on`, which is
    /// asked before every few placements and, on the host, frames, says no.
    pub(crate) fn judged_while(
        &mut self,
        placements: &[Placement],
        known: &Known,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Judged>>, BackendError> {
        let known = |p: &Placement| known.iter().find(|(k, _)| k.lidars == p.lidars).map(|k| &k.1);
        let mut by_member = Vec::new();
        for (index, seat) in self.seats.iter_mut().enumerate() {
            let known = placements.iter().map(|p| known(p).map(|known| known[index].clone()));
            let known: Vec<Option<Tally>> = known.collect();
            let Some(scores) = seat.scores_while(placements, &known, go_on)? else {
                return Ok(None);
            };
            by_member.push(scores);
        }
        Ok(Some(self.together(placements, &by_member)?))
    }

    /// Number of calls of `go_on` by [`Job::losses_while`](crate::Job::losses_while) for so many placements; a
    /// reference layout adds some.
    pub fn looks(&self, placements: usize) -> usize {
        self.seats.iter().map(|seat| seat.looks(placements)).sum()
    }

    /// The scores of [`Self::judged_while`] alone, none known.
    pub(crate) fn scores_while(
        &mut self,
        placements: &[Placement],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Scores>>, BackendError> {
        let judged = self.judged_while(placements, &Known::new(), go_on)?;
        Ok(judged.map(scores_of))
    }

    /// Like [`Self::scores`], with beams that end at `range` metres, as in fog; the guards still compare
    /// with a layout that sees all.
    ///
    /// # Errors
    /// See [`Backend::tally`].
    pub fn scores_at(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Scores>, BackendError> {
        Ok(scores_of(self.judged_at(placements, range)?))
    }

    fn judged_at(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Judged>, BackendError> {
        let scores = self.seats.iter_mut().map(|seat| seat.scores(placements, range));
        let by_member = scores.collect::<Result<Vec<_>, _>>()?;
        Ok(self.together(placements, &by_member)?)
    }

    /// Joins the scores of each member, `[members][placements]`, into those of each placement.
    fn together(
        &self,
        placements: &[Placement],
        by_member: &[Vec<Scores>],
    ) -> Result<Vec<Judged>, UnknownSensor> {
        let sight = self.sight.as_deref();
        let of = |(index, placement): (usize, &Placement)| {
            let guards = by_member.iter().flat_map(|scores| &scores[index].guards);
            let mut idle: Vec<usize> = guards.filter_map(Guard::redundant_lidar).collect();
            idle.sort_unstable();
            idle.dedup();
            sight.map(|sight| met(sight, (placement, by_member.len()), &idle)).transpose()
        };
        let met = placements.par_iter().enumerate().map(of).collect::<Result<Vec<_>, _>>()?;
        let judged = |index: usize| {
            let seats = self.seats.iter().zip(by_member);
            let scenes: Vec<_> = seats
                .map(|(seat, scores)| {
                    let totals = totals(seat.member.problem().content());
                    (seat.member.name(), &scores[index], totals)
                })
                .collect();
            let of_scene = |&(scene, scores, _): &(&str, &Scores, _)| SceneScores {
                scene: scene.to_owned(),
                scores: scores.clone(),
            };
            let mut by_scene =
                if scenes.len() > 1 { scenes.iter().map(of_scene).collect() } else { vec![] };
            let mut scores = Scores::over_scenes(&scenes);
            if let Some(Met { car_missing, seen, by_scene: in_scenes, needed }) = &met[index] {
                let is_idle = |guard: &Guard| {
                    guard.redundant_lidar().is_none_or(|lidar| !needed.contains(&lidar))
                };
                scores.car_missing = *car_missing;
                let own = by_scene.iter_mut().map(|of: &mut SceneScores| &mut of.scores);
                own.zip(in_scenes).chain([(&mut scores, seen)]).for_each(|(of, seen)| {
                    of.guards.retain(is_idle);
                    of.required.extend(seen.iter().cloned());
                    self.problem().in_file_order(&mut of.required);
                });
            }
            Judged { scores, by_scene }
        };
        Ok((0..placements.len()).map(judged).collect())
    }
}
