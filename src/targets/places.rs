//! Places in a scene where a target can stand: the ground below, and nothing else there.

use glam::DVec3;

use crate::bvh::Hit;
use crate::cast::closest_hit_in;
use crate::geom::Pose;
use crate::problem::Problem;
use crate::scene::{EgoBody, Ground, Scene, Target};

/// Metres above and below the level z = 0 of the ego frame in which ground is looked for.
const REACH: f64 = 30.0;
/// Metres below a surface from which the next one is looked for.
const STEP: f64 = 1e-3;
/// Surfaces above each other that are looked at, at most.
const MOST_SURFACES: usize = 64;

/// Surfaces of a scene that are ground.
#[derive(Debug)]
pub struct GroundBelow {
    /// By triangle of a frame.
    is_ground: Vec<bool>,
}

impl GroundBelow {
    /// By the classes of the scene's triangles; the own body is no ground.
    pub fn new(scene: &Scene) -> Self {
        let (own, classes) = (scene.triangles(EgoBody::Exclude), Ground::among(scene.classes()));
        let is_ground = |(face, class): (usize, &u16)| {
            face < own && classes.get(usize::from(*class)) == Some(&true)
        };
        let classes = scene.face_classes(EgoBody::Include);
        Self { is_ground: classes.iter().enumerate().map(is_ground).collect() }
    }

    /// Height of the ground under a point of the ego frame in a frame, the lowest of several; `None` where there is none
    /// within 30 m of the level z = 0, or where another surface is in the target's height above it, or the
    /// place is inside a closed thing.
    pub(super) fn height(
        &self,
        problem: &Problem,
        frame: usize,
        target: &Target,
        [x, y]: [f64; 2],
    ) -> Option<f64> {
        let geometry = problem.geometry(frame)?;
        let mut from = REACH;
        let (mut ground, mut others) = (None, Vec::new());
        for _ in 0..MOST_SURFACES {
            let pose = Pose { translation: DVec3::new(x, y, from), ..Pose::IDENTITY };
            let range = (from + REACH).max(STEP) as f32;
            let hit: Hit = closest_hit_in(geometry, &pose, [0.0, 0.0, -1.0], range);
            if !hit.is_hit() {
                break;
            }
            let height = from - f64::from(hit.t);
            match self.is_ground[hit.prim as usize] {
                true => ground = Some(height),
                false => others.push(height),
            }
            from = height - STEP;
        }
        let (ground, top) = (ground?, target.corners[1][2]);
        let above = others.iter().filter(|&&z| z >= ground);
        // Under an odd number of surfaces the place is inside a closed thing.
        let is_free = above.clone().all(|&z| z > ground + top) && above.count() % 2 == 0;
        is_free.then_some(ground)
    }
}
