//! Sensor position when a group of beams fires, and the surfaces that they meet.

use std::ops::Range;
use std::sync::OnceLock;

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};

use super::stage::{Motions, Stage};
use super::{NO_CLASS, NO_INSTANCE};
use lidar_cast::bvh::{Bvh, Hit, NO_HIT};
use lidar_cast::cast::{BundleOrigin, BundleTree, Firing, SweptPart, TreeView};
use lidar_cast::geom::Pose;
use sightline_scene::problem::DevicePose;

/// Metres by which a neighbour must lie off a beam's surface to lie behind an edge, and as a share of their
/// distance.
const APART: f32 = 0.05;
const APART_SHARE: f32 = 0.002;
/// Sensor position when a group of beams fires, and the things in sight of them.
pub(super) struct Station {
    /// Takes the sensor's frame at that moment to the ego frame at the frame's time.
    pub start_from_sensor: Pose,
    /// Numbers of the stage's things that it may see, ascending.
    numbers: Vec<u32>,
    /// Transform of each of them: takes the sensor's frame to the thing's.
    poses: Vec<Pose>,
    /// Range in metres, and half width of a beam in radians.
    reach: [f32; 2],
    /// Poses of the things within reach; filled once single beams or a device ask for them.
    standings: OnceLock<Vec<(u32, BundleOrigin)>>,
}

/// Surface point where a beam ends.
#[derive(Debug, Clone, Copy, Zeroable)]
pub(super) struct SurfaceHit {
    /// Metres; as far as the range goes where it meets nothing.
    pub t: f32,
    pub prim: u32,
    pub class: u16,
    pub instance: u16,
    /// Cosine of the angle of incidence.
    pub incidence: f32,
    /// Normal and position in the ego frame at the frame's time.
    pub normal: Vec3,
    pub position: Vec3,
}

/// Depth edge between two neighbouring beams, seen by one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Edge {
    None,
    /// The beam's own surface ends, and the neighbour sees past it.
    InFront,
    /// The neighbour's surface ends, and the beam sees past it.
    Behind,
}

impl Station {
    /// The sensor `share` of the way from one frame to the next, and the things that it may see.
    pub(crate) fn new(
        motions: &Motions,
        visible: impl Iterator<Item = usize>,
        ego_from_sensor: &Pose,
        share: f64,
        reach: [f32; 2],
    ) -> Self {
        let ego = motions.ego.at(share);
        let sensor_from_world = ego.compose(ego_from_sensor).inverse();
        let pose = |thing: usize| {
            let sensor_from_thing = match motions.world_from_thing(thing, share) {
                Some(world_from_thing) => sensor_from_world.compose(&world_from_thing),
                None => ego_from_sensor.inverse().compose(&motions.ego_from_body(thing)),
            };
            sensor_from_thing.inverse()
        };
        let (numbers, poses) = visible.map(|thing| (thing as u32, pose(thing))).unzip();
        Self {
            start_from_sensor: motions.ego.at(0.0).inverse().compose(&ego).compose(ego_from_sensor),
            numbers,
            poses,
            reach,
            standings: OnceLock::new(),
        }
    }

    /// Trees as the sensor sees them, all of its beams together.
    pub(crate) fn parts<'s>(&self, stage: &'s Stage) -> Vec<TreeView<'s>> {
        let part = |(&number, pose): (&u32, &Pose)| {
            let thing = &stage.things[number as usize];
            let (first_prim, pose) = (thing.first_prim, DevicePose::from(pose));
            TreeView { bvh: &thing.tree, pose, first_prim }
        };
        self.numbers.iter().zip(&self.poses).map(part).collect()
    }

    /// Rays that leave the sensor here, for a device.
    pub(crate) fn firing<'s>(
        &'s self,
        stage: &'s Stage,
        rays: impl Iterator<Item = [f32; 3]>,
    ) -> Firing<'s> {
        Firing { targets: self.targets(stage).collect(), rays: rays.collect() }
    }

    /// Trees as single beams and bundles see them.
    pub(crate) fn targets<'s>(&'s self, stage: &'s Stage) -> impl Iterator<Item = BundleTree<'s>> {
        let standing = |(&number, pose): (&u32, &Pose)| {
            let [range, width] = self.reach;
            let tree = &stage.things[number as usize].tree;
            Some((number, BundleOrigin::new(tree, pose, range, width)?))
        };
        let all = || self.numbers.iter().zip(&self.poses).filter_map(standing).collect();
        let standings = self.standings.get_or_init(all);
        standings.iter().map(|(number, standing)| {
            let thing = &stage.things[*number as usize];
            BundleTree { tree: &thing.tree, first_prim: thing.first_prim, standing }
        })
    }

    /// The thing that a face belongs to: its tree, and the pose of the sensor in its frame.
    pub(crate) fn tree_of<'s>(&self, stage: &'s Stage, prim: u32) -> Option<(&'s Bvh, DevicePose)> {
        let (number, pose) = self.nearby(stage, prim)?;
        Some((&*stage.things[number].tree, DevicePose::from(pose)))
    }

    /// The thing that a face belongs to, by its number.
    fn nearby(&self, stage: &Stage, prim: u32) -> Option<(usize, &Pose)> {
        let number = stage.thing_of(prim);
        let at = self.numbers.iter().position(|&nearby| nearby as usize == number)?;
        Some((number, &self.poses[at]))
    }

    /// The face that is hit; none where nothing is.
    fn face(&self, stage: &Stage, hit: &Hit) -> Option<SeenFace> {
        let (number, pose) =
            if hit.is_hit() { self.nearby(stage, hit.prim)? } else { return None };
        let thing = &stage.things[number];
        let (class, normal) = thing.face(hit.prim);
        let normal = pose.rotation.transpose() * normal.as_dvec3();
        Some(SeenFace { class, instance: thing.instance, normal })
    }
}

/// Trees as the sensor sees them while some neighbouring columns fire; `stations` are one a firing, or one for all.
pub(super) fn swept_parts<'s>(
    stage: &'s Stage,
    stations: &[Station],
    fired: Range<usize>,
) -> Vec<SweptPart<'s>> {
    let columns = fired.len();
    let mut parts: Vec<(u32, Vec<Option<DevicePose>>)> = Vec::new();
    // Where among the parts each thing is.
    let mut places = vec![usize::MAX; stage.things.len()];
    for (column, firing) in fired.enumerate() {
        let station = &stations[firing.min(stations.len() - 1)];
        for (&number, pose) in station.numbers.iter().zip(&station.poses) {
            let place = &mut places[number as usize];
            if *place == usize::MAX {
                *place = parts.len();
                parts.push((number, vec![None; columns]));
            }
            parts[*place].1[column] = Some(DevicePose::from(pose));
        }
    }
    let part = |(number, poses): (u32, Vec<_>)| {
        let thing = &stage.things[number as usize];
        SweptPart { bvh: &thing.tree, first_prim: thing.first_prim, poses }
    };
    parts.into_iter().map(part).collect()
}

/// Faces that rays from one place hit, one after the other: most neighbours hit the same.
pub(super) struct Faces<'a> {
    station: &'a Station,
    stage: &'a Stage,
    last: (u32, Option<SeenFace>),
}

impl<'a> Faces<'a> {
    pub(crate) fn new(station: &'a Station, stage: &'a Stage) -> Self {
        Self { station, stage, last: (NO_HIT, None) }
    }

    /// The face that is hit; none where nothing is.
    pub(crate) fn of(&mut self, hit: &Hit) -> Option<&SeenFace> {
        if hit.prim != self.last.0 {
            self.last = (hit.prim, self.station.face(self.stage, hit));
        }
        self.last.1.as_ref()
    }

    /// The surface that a beam of the sensor's frame hits.
    pub(crate) fn surface(&mut self, direction: [f32; 3], hit: &Hit) -> SurfaceHit {
        let start_from_sensor = &self.station.start_from_sensor;
        let Some(face) = self.of(hit) else { return SurfaceHit::none(hit.t) };
        let (surface, normal) = face.met(direction, hit);
        let direction = DVec3::from(direction.map(f64::from));
        SurfaceHit {
            normal: (start_from_sensor.rotation * normal).as_vec3(),
            position: start_from_sensor.apply(direction * f64::from(hit.t)).as_vec3(),
            ..surface
        }
    }
}

/// A face as one sensor sees it.
#[derive(Clone, Copy)]
pub(super) struct SeenFace {
    class: u16,
    instance: u16,
    /// Unit normal in the sensor's frame.
    normal: DVec3,
}

impl SeenFace {
    /// The surface that a ray of the sensor's frame hits, without normal and position in the ego frame, and the
    /// normal in the sensor's.
    pub(super) fn met(&self, direction: [f32; 3], hit: &Hit) -> (SurfaceHit, DVec3) {
        let direction = DVec3::from(direction.map(f64::from));
        // Towards the sensor.
        let away = self.normal.dot(direction) > 0.0;
        let normal = if away { -self.normal } else { self.normal };
        let incidence = (-normal.dot(direction)).clamp(0.0, 1.0) as f32;
        let Self { class, instance, .. } = *self;
        let none = SurfaceHit::none(hit.t);
        (SurfaceHit { prim: hit.prim, class, instance, incidence, ..none }, normal)
    }
}

impl SurfaceHit {
    pub(crate) fn is_hit(&self) -> bool {
        self.prim != NO_HIT
    }

    /// Edge between two neighbouring beams, and on which side the nearer surface is. There is an edge if one beam meets
    /// nothing, or if one point lies in front of the other's plane and the other behind the first one's. Two points each in
    /// front of, or each behind, the other's plane belong to an inner or outer corner, which is no edge.
    pub(crate) fn edge_to(&self, other: &Self) -> Edge {
        match (self.is_hit(), other.is_hit()) {
            (false, false) => Edge::None,
            (true, false) => Edge::InFront,
            (false, true) => Edge::Behind,
            (true, true) if self.prim == other.prim => Edge::None,
            (true, true) => {
                let between = other.position - self.position;
                let least = APART + APART_SHARE * self.t.min(other.t);
                // In front of each other's planes, in metres.
                let (there, here) = (self.normal.dot(between), -other.normal.dot(between));
                if there.abs().max(here.abs()) <= least || (there > 0.0) == (here > 0.0) {
                    Edge::None
                } else if here > 0.0 {
                    Edge::InFront
                } else {
                    Edge::Behind
                }
            }
        }
    }

    /// Nothing within `range` metres.
    pub(super) fn none(range: f32) -> Self {
        Self {
            t: range,
            prim: NO_HIT,
            class: NO_CLASS,
            instance: NO_INSTANCE,
            incidence: 0.0,
            normal: Vec3::ZERO,
            position: Vec3::NAN,
        }
    }
}
