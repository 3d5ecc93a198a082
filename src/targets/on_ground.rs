//! A vehicle on the ground of a scene alone, for range cards where that ground is not level.

use std::sync::Arc;

use serde::Serialize;

use super::beams::TargetSite;
use super::ground::GroundBelow;
use super::relief::Relief;
use crate::bvh::Bvh;
use crate::geom::TriangleSoup;
use crate::problem::{Frame, Instance, Problem, SceneSurface, ground_triangles};
use crate::scene::Scene;

/// Longest hits in trees of ground, in metres.
const FAR: f32 = 1000.0;

/// Ground of a scene on which the targets of a range card stand; nothing else of the scene is in the way.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CardGround {
    /// Name of the scene.
    pub scene: String,
    /// Number of the frame: the one whose ground lies farthest from z = 0, of four.
    pub frame: usize,
}

impl std::fmt::Display for CardGround {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "on the ground of {} in frame {}", self.scene, self.frame)
    }
}

/// Words that follow others on a range card: the ground that its targets stand on, where that is not level, or that bodies of
/// the vehicle move.
pub(crate) fn stands_in_words(ground: Option<&CardGround>, bodies_move: bool) -> String {
    match ground {
        Some(ground) => format!(", {ground}"),
        None if bodies_move => ", own bodies as in frame 0".to_owned(),
        None => String::new(),
    }
}

impl TargetSite {
    /// Site of a problem on the ground of its scene, with nothing else of the scene there, in the frame whose ground lies
    /// farthest from z = 0; `None` where that is 1.5 m at most.
    pub(crate) fn on_ground(scene: &Scene, problem: &Problem) -> Option<Self> {
        let relief = Relief::of(problem, &GroundBelow::new(scene)).filter(Relief::is_steep)?;
        let geometry = problem.geometry(relief.place())?;
        let is_ground = ground_triangles(scene);
        let ground = ground_alone(geometry, &is_ground);
        let (count, own) = (ground.triangle_count() as usize, is_ground.len());
        let bodies = geometry.instances().iter().filter(|of| of.first_prim as usize >= own);
        // Numbers of triangles follow each other.
        let mut first_prim = count as u32;
        let bodies = bodies.map(|of| {
            let instance = Instance { first_prim, ..Instance::clone(of) };
            first_prim += of.tree.triangles.len() as u32;
            instance
        });
        let geometry = Frame::new(ground.instances().iter().cloned().chain(bodies));
        let mut is_ground = vec![true; count];
        is_ground.resize(geometry.triangle_count() as usize, false);
        let frame = problem.number_of(relief.place());
        let on = CardGround { scene: scene.name().to_owned(), frame };
        let surface = SceneSurface { geometry, frame, is_ground };
        Some(Self::on_surface(problem, &surface, count, (false, Some(on))))
    }
}

/// Ground of a frame, its triangles numbered anew.
fn ground_alone(geometry: &Frame, is_ground: &[bool]) -> Frame {
    let mut first_prim = 0;
    let alone = |of: &Instance| {
        let mut soup = TriangleSoup::default();
        for triangle in &of.tree.triangles {
            let prim = (of.first_prim + triangle.prim) as usize;
            if is_ground.get(prim) == Some(&true) {
                let base = soup.vertices.len() as u32;
                soup.vertices.extend([triangle.a, triangle.b, triangle.c]);
                soup.faces.push([base, base + 1, base + 2]);
                soup.face_class.push(0);
            }
        }
        let instance =
            Instance { tree: Arc::new(Bvh::build(&soup, FAR)), first_prim, ..of.clone() };
        first_prim += soup.faces.len() as u32;
        instance
    };
    Frame::new(geometry.instances().iter().map(alone))
}
