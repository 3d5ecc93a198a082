//! The rigid parts of a scene, each in a frame of its own, and where they stand in each frame.
//!
//! In the order of [`Scene::frame`]: static world, actors as listed, ego body. The static world's frame
//! has its origin in the middle of the ego's way, an actor's in the middle of its box, both rounded to
//! whole metres: coordinates are moved there in `f64` before they are rounded to `f32`.

use super::solid::Solid;
use super::{EgoBody, Scene};
use lidar_cast::geom::{Pose, TriangleSoup};

impl Scene {
    /// Parts, the empty ones counted too; the last is the body of the ego vehicle.
    pub fn part_count(&self) -> usize {
        self.actors.len() + 2
    }

    fn solid(&self, part: usize) -> &Solid {
        match part {
            0 => &self.world,
            _ => self.actors.get(part - 1).map_or(&self.body, |actor| &actor.parts),
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

    /// Class of every triangle of a frame, by its number; the same in every frame.
    pub fn face_classes(&self, body: EgoBody) -> Vec<u16> {
        let parts = self.part_count() - usize::from(body == EgoBody::Exclude);
        (0..parts).flat_map(|part| self.solid(part).classes.iter().copied()).collect()
    }

    /// Triangles of the ego body in the ego frame; none where the scene has no geometry.
    pub fn body(&self) -> Vec<[[f32; 3]; 3]> {
        let soup = self.part(self.part_count() - 1);
        (0..soup.faces.len() as u32).map(|prim| soup.corners(prim)).collect()
    }
}
