//! The rigid parts of a scene, each in a frame of its own, and where they stand in each frame.
//!
//! Parts come in the order of [`Scene::frame`]: static world, actors as listed, ego body. The static world's frame has
//! its origin in the middle of the ego's way, an actor's in the middle of its box, both rounded to whole metres:
//! coordinates are moved there in `f64` before they are rounded to `f32`.

use std::ops::Range;

use super::solid::Solid;
use super::{EgoBody, Scene};
use lidar_cast::geom::{Pose, TriangleSoup};

/// Owner of a rigid part: it moves with this.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PartOwner {
    /// The static world.
    World,
    /// An actor, by its index in the scene.
    Actor(usize),
    /// The ego vehicle, whose body the part is.
    Ego,
}

impl Scene {
    /// Number of the part that is the body of the ego vehicle: the last.
    pub fn body_part(&self) -> usize {
        1 + self.actors.len()
    }

    /// Numbers of all parts, the empty ones among them, with or without the body of the ego vehicle.
    pub fn parts(&self, body: EgoBody) -> Range<usize> {
        0..self.body_part() + usize::from(body == EgoBody::Include)
    }

    /// Owner of a part.
    ///
    /// # Panics
    /// A part that does not exist.
    pub fn owner(&self, part: usize) -> PartOwner {
        assert!(part <= self.body_part(), "part {part} of {}", self.body_part() + 1);
        match part {
            0 => PartOwner::World,
            part if part == self.body_part() => PartOwner::Ego,
            part => PartOwner::Actor(part - 1),
        }
    }

    fn solid(&self, part: usize) -> &Solid {
        match self.owner(part) {
            PartOwner::World => &self.world,
            PartOwner::Actor(actor) => &self.actors[actor].parts,
            PartOwner::Ego => &self.body,
        }
    }

    /// Triangles of a part in its own frame, in metres; the same for all frames of the scene.
    ///
    /// # Panics
    /// A part that does not exist.
    pub fn part(&self, part: usize) -> TriangleSoup {
        let mut soup = TriangleSoup::default();
        let part_from_owner = Pose { translation: -self.origins[part], ..Pose::IDENTITY };
        self.solid(part).append_to(&mut soup, &part_from_owner);
        soup
    }

    /// Number of triangles of a part.
    ///
    /// # Panics
    /// A part that does not exist.
    pub fn part_triangles(&self, part: usize) -> usize {
        self.solid(part).faces.len()
    }

    /// Takes each part's frame to the ego frame of frame `t`, the ego body's last.
    ///
    /// # Panics
    /// If `t` is not below [`Scene::frame_count`].
    pub fn part_poses(&self, t: usize) -> Vec<Pose> {
        let ego_from_world = self.ego_pose(t).inverse();
        let mut poses = vec![ego_from_world];
        let actors = self.actors.iter().map(|actor| actor.motion.pose(t));
        poses.extend(actors.map(|world_from_actor| ego_from_world.compose(&world_from_actor)));
        poses.push(Pose::IDENTITY);
        for (pose, &origin) in poses.iter_mut().zip(&self.origins) {
            pose.translation = pose.apply(origin);
        }
        poses
    }

    /// Number of triangles of a frame; the ego body's come last.
    pub fn triangles(&self, body: EgoBody) -> usize {
        self.parts(body).map(|part| self.part_triangles(part)).sum()
    }

    /// Class of every triangle of a frame, by its number; the same in every frame.
    pub fn face_classes(&self, body: EgoBody) -> Vec<u16> {
        self.parts(body).flat_map(|part| self.solid(part).classes.iter().copied()).collect()
    }

    /// Triangles of the ego body in the ego frame; none where the scene has no geometry.
    pub fn body(&self) -> Vec<[[f32; 3]; 3]> {
        let soup = self.part(self.body_part());
        (0..soup.faces.len() as u32).map(|prim| soup.corners(prim)).collect()
    }
}
