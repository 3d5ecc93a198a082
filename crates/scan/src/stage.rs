//! The moving scene shared by all frames of a scan: trees, faces and bounding spheres of parts, and their motion.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

use crate::{EGO_INSTANCE, NO_INSTANCE, ScanError};
use lidar_cast::bvh::{Bvh, Triangle};
use lidar_cast::geom::{Glide, Pose};
use lidar_cast::maths;
use sightline_scene::problem::{Instance, world_of};
use sightline_scene::scene::{EgoBody, PartOwner, Scene};

/// A rigid part of the scene, not empty.
#[derive(Debug)]
pub(super) struct Thing {
    pub(super) tree: Arc<Bvh>,
    /// Number of the part in the scene.
    part: usize,
    pub(super) first_prim: u32,
    pub(super) instance: u16,
    /// Sphere around it in its own frame.
    center: DVec3,
    radius: f64,
    /// Where each face lies among the tree's triangles.
    places: Vec<u32>,
    faces: Vec<Face>,
}

/// Normal and class of one triangle.
#[derive(Debug, Clone, Copy)]
struct Face {
    /// Unit normal in the thing's frame, zero of a face without area.
    normal: [f32; 3],
    class: u16,
}

/// Rigid parts of a scene with their trees and faces: shared by all scans, frames and placements.
#[derive(Debug)]
pub struct Stage {
    pub(super) things: Vec<Thing>,
    /// First face of each thing.
    first_prims: Vec<u32>,
}

impl Stage {
    /// Builds the trees.
    ///
    /// # Errors
    /// A scene without geometry or with a model without beams, trees that do not fit into memory.
    pub fn new(scene: &Scene) -> Result<Self, ScanError> {
        Self::check(scene)?;
        let range = scene.sensors()?.longest_range();
        let world = world_of(scene, &[0], range, EgoBody::Include)?;
        let instances = world.frames().iter().flat_map(|frame| frame.instances());
        Ok(Self::of(scene, instances))
    }

    /// Finds whether there is anything to scan.
    pub(super) fn check(scene: &Scene) -> Result<(), ScanError> {
        match scene.has_geometry() {
            true => Ok(()),
            false => Err(ScanError::Refused(format!(
                "the scene `{}` has no geometry; a scan needs `static`, `actors` or a body",
                scene.name()
            ))),
        }
    }

    /// Reuses the trees of `instances`: one for each part of the scene that has triangles.
    pub(super) fn of<'i>(scene: &Scene, instances: impl Iterator<Item = &'i Instance>) -> Self {
        let full = scene.parts(EgoBody::Include).filter(|&part| scene.part_triangles(part) > 0);
        let classes = scene.face_classes(EgoBody::Include);
        let thing = |(part, instance): (usize, &Instance)| {
            let bounds = instance.tree.bounds();
            let (low, high) =
                bounds.map_or((Vec3::ZERO, Vec3::ZERO), |bounds| (bounds.min, bounds.max));
            let (low, high) = (low.as_dvec3(), high.as_dvec3());
            let first = instance.first_prim as usize;
            let classes = &classes[first..first + scene.part_triangles(part)];
            let places = places(&instance.tree);
            let triangle = |&place: &u32| &instance.tree.triangles[place as usize];
            let face =
                |(place, &class): (&u32, &u16)| Face { normal: triangle(place).normal, class };
            Thing {
                faces: places.iter().zip(classes).map(face).collect(),
                places,
                tree: instance.tree.clone(),
                part,
                first_prim: instance.first_prim,
                instance: match scene.owner(part) {
                    PartOwner::World => NO_INSTANCE,
                    PartOwner::Ego | PartOwner::EgoBody(_) => EGO_INSTANCE,
                    PartOwner::Actor(actor) => u16::try_from(actor + 1).unwrap_or(EGO_INSTANCE - 1),
                },
                center: (low + high) / 2.0,
                radius: (high - low).length() / 2.0,
            }
        };
        let things: Vec<Thing> = full.zip(instances).map(thing).collect();
        let first_prims = things.iter().map(|thing| thing.first_prim).collect();
        Self { things, first_prims }
    }

    /// True if it has a tree for each part of the scene that is not empty.
    pub(super) fn is_of(&self, scene: &Scene) -> bool {
        let full = scene.parts(EgoBody::Include).filter(|&part| scene.part_triangles(part) > 0);
        full.eq(self.things.iter().map(|thing| thing.part))
    }

    /// The trees of all things; equal shapes share one.
    pub(super) fn trees(&self) -> impl Iterator<Item = &Arc<Bvh>> {
        self.things.iter().map(|thing| &thing.tree)
    }

    /// The thing that a face belongs to.
    pub(super) fn thing_of(&self, prim: u32) -> usize {
        self.first_prims.partition_point(|&first| first <= prim).max(1) - 1
    }
}

/// Where each face lies among a tree's triangles, which are in the order of its leaves.
fn places(tree: &Bvh) -> Vec<u32> {
    let mut places = vec![0; tree.triangles.len()];
    for (place, triangle) in (0..).zip(&tree.triangles) {
        places[triangle.prim as usize] = place;
    }
    places
}

impl Thing {
    /// A face as the tree has it, by its number in the frame.
    pub(crate) fn triangle(&self, prim: u32) -> &Triangle {
        &self.tree.triangles[self.places[(prim - self.first_prim) as usize] as usize]
    }

    /// Class of a face, by its number in the frame, and its unit normal in the thing's frame, zero of a face
    /// without area.
    pub(crate) fn face(&self, prim: u32) -> (u16, Vec3) {
        let Face { normal, class } = self.faces[(prim - self.first_prim) as usize];
        (class, Vec3::from(normal))
    }
}

/// How everything moves in a frame.
pub(super) struct Motions {
    pub(super) ego: Glide,
    /// Pose of each thing's owner: takes the owner's frame to the world's, of carried things to the ego's.
    owners: Vec<Glide>,
    /// Position of each thing in the frame of its owner.
    origins: Vec<DVec3>,
    ego_things: Vec<bool>,
    /// True for bodies that move on the ego vehicle: their owner's motion is relative to the ego.
    carried: Vec<bool>,
}

impl Motions {
    pub(crate) fn new(scene: &Scene, stage: &Stage, frame: usize) -> Self {
        let ego = scene.ego_glide(frame);
        let still = Glide::new(&Pose::IDENTITY, &Pose::IDENTITY);
        let glide = |thing: &Thing| match scene.owner(thing.part) {
            PartOwner::World => still,
            PartOwner::Ego => ego,
            PartOwner::EgoBody(body) => scene.own_body_glide(body, frame),
            PartOwner::Actor(actor) => scene.actor_glide(actor, frame),
        };
        Self {
            ego,
            owners: stage.things.iter().map(glide).collect(),
            origins: stage.things.iter().map(|thing| scene.part_origin(thing.part)).collect(),
            ego_things: stage.things.iter().map(|t| t.part == scene.body_part()).collect(),
            carried: stage.things.iter().map(|t| t.part > scene.body_part()).collect(),
        }
    }

    /// True if nothing moves, as seen from the ego.
    pub(crate) fn are_still(&self) -> bool {
        let still = |thing: usize| {
            let is_still = self.owners[thing].is_still();
            self.ego_things[thing] || is_still && (self.carried[thing] || self.ego.is_still())
        };
        (0..self.owners.len()).all(still)
    }

    /// Pose of a thing in the world, `share` of the way to the next frame; `None` for the ego's own body.
    pub(crate) fn world_from_thing(&self, thing: usize, share: f64) -> Option<Pose> {
        (!self.ego_things[thing]).then(|| {
            let mut pose = self.owners[thing].at(share);
            if self.carried[thing] {
                pose = self.ego.at(share).compose(&pose);
            }
            pose.translation = pose.apply(self.origins[thing]);
            pose
        })
    }

    /// Pose of the ego's body in the ego frame.
    pub(crate) fn ego_from_body(&self, thing: usize) -> Pose {
        Pose { translation: self.origins[thing], ..Pose::IDENTITY }
    }

    /// Pose of a thing in the ego frame at the same moment.
    fn ego_from_thing(&self, thing: usize, share: f64) -> Pose {
        let world_from_thing = self.world_from_thing(thing, share);
        world_from_thing.map_or_else(
            || self.ego_from_body(thing),
            |world_from_thing| self.ego.at(share).inverse().compose(&world_from_thing),
        )
    }
}

/// Azimuths of a sensor among which a thing is seen at some moment of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum AzimuthsInView {
    Never,
    Always,
    /// Azimuths around a unit vector, whose cosine to it is at least the number.
    Around(DVec2, f64),
}

impl AzimuthsInView {
    /// Azimuths that see `thing` in a sweep that ends `last` of the way to the next frame; `ego_from_sensor` is fixed.
    /// Beams point up to `wide` radians beside their nominal azimuth.
    ///
    /// The thing's sphere moves in the sensor's frame; all of its way lies in a sphere around its middle
    /// position, larger by the farthest that the ends are from there, and half as much again for the curve.
    pub(crate) fn of(
        motions: &Motions,
        thing: usize,
        sphere: &Thing,
        ego_from_sensor: &Pose,
        last: f64,
        range: f64,
        wide: f64,
    ) -> Self {
        let at = |share: f64| {
            let sensor_from_thing =
                ego_from_sensor.inverse().compose(&motions.ego_from_thing(thing, share));
            sensor_from_thing.apply(sphere.center)
        };
        let (first, middle, end) = (at(0.0), at(last / 2.0), at(last));
        let moved = (first - middle).length().max((end - middle).length());
        let radius = sphere.radius + 1.5 * moved + 0.01;
        if middle.length() - radius > range {
            return Self::Never;
        }
        let across = middle.truncate().length();
        if across <= radius {
            return Self::Always;
        }
        let half = maths::asin(radius / across) + wide;
        if half >= PI {
            return Self::Always;
        }
        Self::Around(middle.truncate() / across, maths::cos(half))
    }

    /// True if a beam may meet it, by the unit vector of its azimuth.
    pub(crate) fn at(&self, azimuth: DVec2) -> bool {
        match *self {
            Self::Never => false,
            Self::Always => true,
            Self::Around(middle, least) => middle.dot(azimuth) >= least,
        }
    }
}
