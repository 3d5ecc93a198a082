//! Actors as a tracker sees them: boxes, kinds, and where everything is between two frames.

use glam::DVec3;

use super::{ActorKind, Scene};
use crate::geom::Pose;

/// An actor as a box on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Name in the scene file; may be empty, and may be that of others too.
    pub name: String,
    /// What it is.
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

    /// Takes the frame of an actor, counted as listed, to that of the world, `share` of the way from frame
    /// `t` to the next.
    ///
    /// # Panics
    /// An actor or a frame that does not exist.
    pub fn world_from_actor(&self, actor: usize, t: usize, share: f64) -> Pose {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.actors[actor].motion.between(t, share)
    }

    /// Takes the ego frame to that of the world, `share` of the way from frame `t` to the next.
    ///
    /// # Panics
    /// If `t` is not below [`Scene::frame_count`].
    pub fn world_from_ego(&self, t: usize, share: f64) -> Pose {
        assert!(t < self.frames, "frame {t} of {}", self.frames);
        self.ego.between(t, share)
    }
}
