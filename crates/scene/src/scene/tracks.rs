//! Actors as a tracker sees them: boxes, kinds, and where everything is between two frames.

use glam::DVec3;

use super::{ActorKind, Scene};
use lidar_cast::geom::Glide;

/// An actor as a box on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Name in the scene file; may be empty, and several may share it.
    pub name: String,
    /// Kind of file.
    pub kind: ActorKind,
    /// Class of its first triangle.
    pub class: u16,
    /// Extent along its own x (forward), y and z in metres.
    pub size: DVec3,
    /// Middle of the box in the actor's frame.
    pub center: DVec3,
}

impl Scene {
    /// Tracks of the actors as listed; one without triangles is a box without extent.
    pub fn tracks(&self) -> Vec<Track> {
        let track = |actor: &super::Actor| {
            let corners = || actor.parts.vertices.iter().copied();
            let (low, high) = match corners().next() {
                None => (DVec3::ZERO, DVec3::ZERO),
                Some(first) => corners().fold((first, first), |(low, high), corner| {
                    (low.min(corner), high.max(corner))
                }),
            };
            Track {
                name: actor.name.clone(),
                kind: actor.kind,
                class: actor.parts.classes.first().copied().unwrap_or_default(),
                size: high - low,
                center: (low + high) / 2.0,
            }
        };
        self.actors.iter().map(track).collect()
    }

    /// How an actor, counted as listed, moves from frame `t` to the next: takes its frame to the world's.
    ///
    /// # Panics
    /// An actor or a frame that does not exist.
    pub fn actor_glide(&self, actor: usize, t: usize) -> Glide {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.actors[actor].motion.glide(t)
    }

    /// How the ego moves from frame `t` to the next: takes its frame to the world's.
    ///
    /// # Panics
    /// If `t` is not below [`Scene::frame_count`].
    pub fn ego_glide(&self, t: usize) -> Glide {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.ego.glide(t)
    }

    /// Origin of a part's frame in the frame of its owner: world, actor or ego.
    ///
    /// # Panics
    /// A part that does not exist.
    pub fn part_origin(&self, part: usize) -> DVec3 {
        self.origins[part]
    }
}
