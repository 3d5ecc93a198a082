//! Ground near the vehicle that a placement sees, and the surfaces that its beams end at.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::ground::{CLOSE, Cell, CellGrid, MOST_BODY};
use super::zone::BlindZone;
use super::{CELL, Footprint, NEAR, NearFieldError, Pole, RING, WheelPlane, ground};
use crate::bvh::Hit;
use crate::engine::{Backend, BackendError};
use crate::geom::Pose;
use crate::problem::{Frame, Instance, Problem, SensorBatch, ground_triangles};
use crate::scene::{Ground, Scene};
use crate::score::{Scores, WorstFrame};
use crate::vehicle::{BeamTable, Placement, SensorPose};

/// Near field of a scene, as far as it is the same for every placement.
#[derive(Debug)]
pub struct NearSite {
    pub(super) problem: Arc<Problem>,
    pub(super) footprint: Footprint,
    pub(super) cells: CellGrid,
    /// By triangle of a frame; the own body's triangles, which come last, have no entry.
    is_ground: Vec<bool>,
    /// One for each distinct frame: its number, frames that it stands for, which cells are ground.
    pub(super) frames: Vec<(usize, u64, Vec<bool>)>,
    /// Frames, by their place in that list, in which the own bodies stand alike: all of them where no body moves.
    pub(super) poses: Vec<Vec<usize>>,
}

/// Cells in a frame by the LiDARs that see them; lists have an entry a cell.
pub(crate) struct SeenInFrame {
    /// Frames that this one stands for.
    pub weight: u64,
    /// Ground within [`NEAR`].
    pub near: Vec<bool>,
    /// Ground within [`RING`].
    pub ring: Vec<bool>,
    /// Cells that each LiDAR sees.
    pub seen_by: Vec<Vec<bool>>,
}

/// Shares of a LiDAR's beams by the surface that they end at; means over frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct BeamShares {
    /// Surfaces of the ground's classes.
    pub ground: f64,
    /// The own body: wasted.
    pub own: f64,
    /// Any other surface.
    pub other: f64,
    /// Nothing within range.
    pub nothing: f64,
}

/// Shares of ground seen in the frames in which bodies that move leave least of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorstShares {
    /// Ground within 10 m; `None` where it is the same in all.
    pub near_field: Option<WorstFrame>,
    /// Ground within 3 m; `None` where it is the same in all, or no cell there is ground.
    pub ring: Option<WorstFrame>,
}

/// The near field of a placement.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct NearField {
    /// Name of the placement.
    pub name: String,
    /// Share of the ground cells within 10 m that are seen.
    pub near_field: f64,
    /// Share of the ground cells within 3 m that are seen; `None` where no cell there is ground.
    pub ring: Option<f64>,
    /// Both shares in their worst frames; `None` where no body moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_frame: Option<WorstShares>,
    /// Square metres of ground within 10 m that are not seen.
    pub blind_area: f64,
    /// Blind zone: ground between the body and the nearest ground seen. Where bodies move, each side has the lanes of the
    /// frame in which they are deepest.
    pub zone: BlindZone,
    /// Frames that means are over.
    #[serde(skip)]
    pub frames: u64,
    /// Shares of beams by the surface they end at, for each LiDAR.
    pub beams: Vec<BeamShares>,
    /// Every pole of the preset.
    pub poles: Vec<Pole>,
    /// Centres of the cells that count in some frame, metres, and the share of those frames in which each
    /// is seen.
    #[serde(skip)]
    pub cells: Vec<([f64; 2], f64)>,
}

impl NearField {
    /// Both shares in their worst frames, in words behind the means; empty where no body moves.
    pub(crate) fn worst_in_words(&self) -> [String; 2] {
        let Some(worst) = self.worst_frame else { return Default::default() };
        let near = worst.near_field.map(|worst| worst.beside(self.near_field));
        let ring = worst.ring.zip(self.ring).map(|(worst, ring)| worst.beside(ring));
        [near, ring].map(Option::unwrap_or_default)
    }
}

/// Sums over frames: all of them, or those in which the own bodies stand alike.
#[derive(Clone)]
struct FrameSums {
    /// One for each cell, frames in which it is ground, and in which it is seen too.
    ground: Vec<u64>,
    seen: Vec<u64>,
    /// Shares of the frames, added up: near, ring; and the frames that have such cells.
    shares: [f64; 2],
    frames: [u64; 2],
}

impl FrameSums {
    fn new(cells: usize) -> Self {
        Self { ground: vec![0; cells], seen: vec![0; cells], shares: [0.0; 2], frames: [0; 2] }
    }

    /// Mean share of the ground near or in the ring.
    fn share(&self, which: usize) -> Option<f64> {
        (self.frames[which] > 0).then(|| self.shares[which] / self.frames[which] as f64)
    }

    /// Cells that are ground in some frame.
    fn counting(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.ground.len()).filter(move |&cell| self.ground[cell] > 0)
    }
}

impl NearSite {
    /// The site of a problem that was made of a scene.
    ///
    /// # Errors
    /// A scene without an own body, or without ground near it.
    pub fn new(scene: &Scene, problem: &Arc<Problem>) -> Result<Self, NearFieldError> {
        let site = Self::among(outline(scene, 0)?, ground_triangles(scene), problem);
        if !site.frames.iter().any(|(_, _, ground)| ground.contains(&true)) {
            let (scene, names) = (place(scene), Ground::in_words());
            return Err(NearFieldError::NoGround { scene, within: NEAR, names });
        }
        Ok(site)
    }

    /// The site of a problem whose vehicle has rules on the ground; `None` without an own body.
    pub(super) fn of_rules(problem: &Arc<Problem>) -> Option<Self> {
        let footprint = Footprint::of(problem.body().corners().map(|at| [at.x, at.y]))?;
        Some(Self::among(footprint, problem.ground_required().is_ground.clone(), problem))
    }

    fn among(footprint: Footprint, is_ground: Vec<bool>, problem: &Arc<Problem>) -> Self {
        let cells = CellGrid::around(&footprint);
        let mut frames = Vec::new();
        for (frame, weight) in problem.distinct_frames() {
            let Some(geometry) = problem.geometry(frame) else { continue };
            let wheels = WheelPlane::of(&footprint, geometry, &is_ground);
            let ground = cells.are_ground(geometry, &is_ground, &wheels);
            frames.push((frame, weight, ground));
        }
        let poses = alike(frames.iter().map(|(frame, ..)| *frame), problem, is_ground.len());
        let poses = poses.into_iter().map(|(_, frames)| frames).collect();
        Self { problem: problem.clone(), footprint, cells, is_ground, frames, poses }
    }

    /// Number in the scene of the first frame of a pose of the bodies.
    pub(super) fn first_frame(&self, pose: usize) -> usize {
        self.problem.number_of(self.frames[self.poses[pose][0]].0)
    }

    /// The problem, whose engine [`Self::look`] takes.
    pub(crate) fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Outline of the own body.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Square metres of ground within 10 m, a mean over frames.
    pub fn ground_area(&self) -> f64 {
        let count = |ground: &[bool]| ground.iter().filter(|is| **is).count() as u64;
        let frames: u64 = self.frames.iter().map(|(_, weight, _)| weight).sum();
        let cells: u64 = self.frames.iter().map(|(_, weight, g)| weight * count(g)).sum();
        cells as f64 / frames as f64 * CELL * CELL
    }

    /// Adds `near_field` and `near_ring` to the scores of placements.
    ///
    /// # Errors
    /// See [`Self::look`].
    pub fn score<'a>(
        &self,
        engine: &mut dyn Backend,
        all: impl IntoIterator<Item = (&'a Placement, &'a mut Scores)>,
    ) -> Result<(), BackendError> {
        for (placement, scores) in all {
            let near = self.look(engine, placement)?;
            (scores.near_field, scores.near_ring) = (Some(near.near_field), near.ring);
        }
        Ok(())
    }

    /// The near field of a placement, by the hits of an engine of the site's problem; in bad weather by those of
    /// beams that come back.
    ///
    /// # Errors
    /// A sensor of a model that the vehicle does not have, or as [`Backend::hits`].
    pub fn look(
        &self,
        engine: &mut dyn Backend,
        placement: &Placement,
    ) -> Result<NearField, BackendError> {
        let batch = SensorBatch::new(&self.problem, &placement.lidars, None)?;
        let mut sums = FrameSums::new(self.cells.cells.len());
        let mut by_pose = vec![sums.clone(); self.poses.len()];
        // By LiDAR: on ground, on the own body, on others, on nothing.
        let mut beams = vec![[0_u64; 4]; batch.len()];
        for (number, (frame, weight, ground)) in self.frames.iter().enumerate() {
            let (poses, hits) = returned_hits(&self.problem, engine, &placement.lidars, *frame)?;
            let mut seen = vec![false; ground.len()];
            for (k, pose) in poses.iter().enumerate() {
                let hits = &hits[batch.beams_of(k)];
                hits.iter().for_each(|hit| beams[k][self.end_of(hit)] += *weight);
                self.mark_seen(batch.table(k), pose, hits, &mut seen);
            }
            let of_pose = by_pose.iter_mut().zip(&self.poses);
            let of_pose = of_pose.filter(|(_, frames)| frames.contains(&number));
            for sums in of_pose.map(|(sums, _)| sums).chain([&mut sums]) {
                self.add_frame(sums, &seen, (*weight, ground));
            }
        }
        let poses = batch.ego_from_sensors(0);
        let poles = ground::count(&self.footprint, &batch, &poses, self.problem.body());
        Ok(self.result(placement, (&sums, &by_pose), &beams, poles))
    }

    /// Cells that each LiDAR of a placement sees, in each distinct frame.
    pub(crate) fn seen_by_lidar(
        &self,
        engine: &mut dyn Backend,
        placement: &Placement,
    ) -> Result<Vec<SeenInFrame>, BackendError> {
        let batch = SensorBatch::new(&self.problem, &placement.lidars, None)?;
        let mut all = Vec::new();
        for (frame, weight, ground) in &self.frames {
            let (poses, hits) = returned_hits(&self.problem, engine, &placement.lidars, *frame)?;
            let seen_by = |(k, pose): (usize, &Pose)| {
                let mut seen = vec![false; ground.len()];
                self.mark_seen(batch.table(k), pose, &hits[batch.beams_of(k)], &mut seen);
                seen
            };
            all.push(SeenInFrame {
                weight: *weight,
                near: self.counting(ground, NEAR),
                ring: self.counting(ground, RING),
                seen_by: poses.iter().enumerate().map(seen_by).collect(),
            });
        }
        Ok(all)
    }

    /// Middles of the cells on the ground in each distinct frame, in the order of [`Self::seen_by_lidar`]: the number of the
    /// frame, and points in the ego frame, metres.
    pub(crate) fn ground_points(&self) -> Vec<(usize, Vec<DVec3>)> {
        let points = |(frame, ..): &(usize, u64, Vec<bool>)| {
            let geometry = self.problem.geometry(*frame)?;
            let wheels = WheelPlane::of(&self.footprint, geometry, &self.is_ground);
            Some((*frame, self.cells.points(geometry, &wheels)))
        };
        self.frames.iter().filter_map(points).collect()
    }

    /// Lowest and highest ground, metres, of the triangles of all frames whose boxes in plan meet that between two
    /// corners.
    pub(super) fn heights_between(&self, [low, high]: [DVec3; 2]) -> [f64; 2] {
        let of_frame = |(frame, ..): &(usize, u64, Vec<bool>)| {
            let mut heights = [f64::INFINITY, f64::NEG_INFINITY];
            for instance in self.problem.geometry(*frame).iter().flat_map(|f| f.instances()) {
                for triangle in &instance.tree.triangles {
                    let prim = (instance.first_prim + triangle.prim) as usize;
                    if self.is_ground.get(prim) != Some(&true) {
                        continue;
                    }
                    let corners = [triangle.a, triangle.b, triangle.c].map(|corner| {
                        instance.ego_from_instance.apply(DVec3::from(corner.map(f64::from)))
                    });
                    let from = corners.into_iter().fold(DVec3::INFINITY, DVec3::min);
                    let to = corners.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max);
                    if (0..2).all(|axis| from[axis] <= high[axis] && to[axis] >= low[axis]) {
                        heights = [heights[0].min(from.z), heights[1].max(to.z)];
                    }
                }
            }
            heights
        };
        let heights = self.frames.par_iter().map(of_frame);
        heights
            .reduce(|| [f64::INFINITY, f64::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// True for each cell that is ground and at most `within` metres from the body.
    fn counting(&self, ground: &[bool], within: f64) -> Vec<bool> {
        let cells = self.cells.cells.iter().zip(ground);
        cells.map(|(cell, ground)| *ground && cell.distance <= within).collect()
    }

    /// Place of a beam's end among ground, own body, others and nothing.
    fn end_of(&self, hit: &Hit) -> usize {
        match hit.prim {
            _ if !hit.is_hit() => 3,
            prim => match self.is_ground.get(prim as usize) {
                Some(true) => 0,
                Some(false) => 2,
                None => 1,
            },
        }
    }

    /// Marks the cells that the beams of a LiDAR see.
    pub(super) fn mark_seen(
        &self,
        table: &BeamTable,
        pose: &Pose,
        hits: &[Hit],
        seen: &mut [bool],
    ) {
        let beams = table.directions().iter().zip(hits);
        for (direction, hit) in beams.filter(|(_, hit)| self.end_of(hit) == 0) {
            let along = DVec3::from(direction.map(f64::from)) * f64::from(hit.t);
            let point = pose.apply(along);
            self.cells.mark_within([point.x, point.y], CLOSE, seen);
        }
    }

    fn add_frame(&self, sums: &mut FrameSums, seen: &[bool], (weight, ground): (u64, &[bool])) {
        for (which, within) in [NEAR, RING].into_iter().enumerate() {
            let cells = self.counting(ground, within).into_iter().zip(seen);
            let [all, seen] = cells
                .filter(|(counts, _)| *counts)
                .fold([0_u64; 2], |[all, both], (_, seen)| [all + 1, both + u64::from(*seen)]);
            if all > 0 {
                sums.shares[which] += weight as f64 * seen as f64 / all as f64;
                sums.frames[which] += weight;
            }
        }
        for (cell, _) in ground.iter().enumerate().filter(|(_, is)| **is) {
            sums.ground[cell] += weight;
            sums.seen[cell] += weight * u64::from(seen[cell]);
        }
    }

    /// Blind zone over the frames of a pose of the bodies.
    fn zone(&self, sums: &FrameSums, pose: usize) -> BlindZone {
        let is_seen = |&cell: &usize| 2 * sums.seen[cell] >= sums.ground[cell];
        let cells = |cell: usize| self.cells.cells[cell];
        let seen: Vec<Cell> = sums.counting().filter(is_seen).map(cells).collect();
        let ground: Vec<Cell> = sums.counting().map(cells).collect();
        let own = self.under_own_bodies(pose).into_iter().map(cells);
        BlindZone::new(&self.footprint, [&ground, &seen, &own.collect::<Vec<_>>()])
    }

    /// Numbers of the cells under the own bodies in one of several poses, high or low; none where they do not move.
    fn under_own_bodies(&self, pose: usize) -> Vec<usize> {
        let frame = self.frames[self.poses[pose][0]].0;
        let Some(geometry) = self.problem.geometry(frame) else { return Vec::new() };
        let own = |of: &&Instance| of.first_prim as usize >= self.is_ground.len();
        let own = Frame::new(geometry.instances().iter().filter(own).cloned());
        let [low, high] = self.footprint.bounds();
        let is_out = |[from, to]: [DVec3; 2]| {
            (0..2).any(|k| from[k] < low[k] - CELL / 2.0 || to[k] > high[k] + CELL / 2.0)
        };
        // Lanes lie around the box: bodies within it, as in frame 0, are over none.
        if !own.instances().iter().filter_map(ground::in_plan).any(is_out) {
            return Vec::new();
        }
        let heights = own.corners().map(|at| at.z);
        let [low, high] = heights
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
        self.cells.covered(&own, [low, high])
    }

    /// Shares of the poses of the bodies with least ground seen; `None` for a single pose.
    fn worst_frame(&self, each: &[FrameSums]) -> Option<WorstShares> {
        let worst = |which: usize| {
            let shares = each.iter().enumerate();
            let shares = shares.filter_map(|(pose, sums)| Some((pose, sums.share(which)?)));
            let (pose, share) = shares.clone().min_by(|a, b| a.1.total_cmp(&b.1))?;
            let is_worse = shares.clone().any(|(_, other)| other > share);
            is_worse.then(|| WorstFrame { frame: self.first_frame(pose), share })
        };
        (each.len() > 1).then(|| WorstShares { near_field: worst(0), ring: worst(1) })
    }

    fn result(
        &self,
        placement: &Placement,
        (sums, by_pose): (&FrameSums, &[FrameSums]),
        beams: &[[u64; 4]],
        poles: Vec<Pole>,
    ) -> NearField {
        let frames: u64 = self.frames.iter().map(|(_, weight, _)| weight).sum();
        let blind: u64 = sums.counting().map(|cell| sums.ground[cell] - sums.seen[cell]).sum();
        let zones =
            by_pose.iter().enumerate().map(|(k, of)| (self.first_frame(k), self.zone(of, k)));
        let shares = |beams: &[u64; 4]| {
            let all = beams.iter().sum::<u64>().max(1) as f64;
            let [ground, own, other, nothing] = beams.map(|count| count as f64 / all);
            BeamShares { ground, own, other, nothing }
        };
        let cell = |cell: usize| {
            let share = sums.seen[cell] as f64 / sums.ground[cell] as f64;
            (self.cells.cells[cell].centre, share)
        };
        NearField {
            name: placement.name.clone(),
            near_field: sums.share(0).unwrap_or_default(),
            ring: sums.share(1),
            worst_frame: self.worst_frame(by_pose),
            blind_area: blind as f64 / frames as f64 * CELL * CELL,
            zone: BlindZone::worst(&self.footprint, zones.collect()),
            frames,
            beams: beams.iter().map(shares).collect(),
            poles,
            cells: sums.counting().map(cell).collect(),
        }
    }
}

/// True if the own bodies of a problem stand in several poses.
pub(crate) fn bodies_move(problem: &Problem) -> bool {
    body_poses(problem).len() > 1
}

/// Poses of the own bodies in the ego frame, each time that they stand otherwise in a frame of a problem, with the number in
/// the scene of the first such frame.
pub(crate) fn body_poses(problem: &Problem) -> Vec<(Vec<Pose>, usize)> {
    let frames = problem.distinct_frames();
    let frames: Vec<usize> = frames.into_iter().map(|(frame, _)| frame).collect();
    let alike = alike(frames.iter().copied(), problem, problem.overlap_required().own);
    let first = |(poses, of): (Vec<Pose>, Vec<usize>)| (poses, problem.number_of(frames[of[0]]));
    alike.into_iter().map(first).collect()
}

/// Poses of the own bodies, with the frames of a list, by their place in it, in which they stand so. Their triangles have the
/// numbers from `own` on.
fn alike(
    frames: impl Iterator<Item = usize>,
    problem: &Problem,
    own: usize,
) -> Vec<(Vec<Pose>, Vec<usize>)> {
    let mut poses: Vec<(Vec<Pose>, Vec<usize>)> = Vec::new();
    for (k, frame) in frames.enumerate() {
        let instances = problem.geometry(frame).map(|frame| frame.instances()).unwrap_or_default();
        let own = instances.iter().filter(|instance| instance.first_prim as usize >= own);
        let stands: Vec<Pose> = own.map(|instance| instance.ego_from_instance).collect();
        match poses.iter_mut().find(|(known, _)| *known == stands) {
            Some((_, frames)) => frames.push(k),
            None => poses.push((stands, vec![k])),
        }
    }
    poses
}

/// Poses of LiDARs in the ego frame and the hits of their beams in a frame; in bad weather of those that come back.
pub(crate) fn returned_hits(
    problem: &Problem,
    engine: &mut dyn Backend,
    lidars: &[SensorPose],
    frame: usize,
) -> Result<(Vec<Pose>, Vec<Hit>), BackendError> {
    let batch = SensorBatch::new(problem, lidars, None)?;
    let (poses, mut hits) = (batch.ego_from_sensors(frame), engine.hits(lidars, frame)?);
    if let Some((air, geometry)) = problem.air().zip(problem.geometry(frame)) {
        air.dim(&batch, &poses, geometry, problem.number_of(frame), &mut hits);
    }
    Ok((poses, hits))
}

pub(crate) fn outline(scene: &Scene, frame: usize) -> Result<Footprint, NearFieldError> {
    let corners = scene.body_in(frame).into_iter().flatten();
    let footprint = Footprint::of(corners.map(|[x, y, _]| [f64::from(x), f64::from(y)]));
    let footprint = footprint.ok_or_else(|| NearFieldError::NoBody { scene: place(scene) })?;
    let length = footprint.length();
    if length > MOST_BODY {
        return Err(NearFieldError::LargeBody { scene: place(scene), length, most: MOST_BODY });
    }
    Ok(footprint)
}

/// File of a scene, or its name where it was read from none.
pub(crate) fn place(scene: &Scene) -> String {
    scene.file().map_or_else(|| scene.name().to_owned(), |file| file.display().to_string())
}
