//! Places in a scene where a target can stand: the ground below, and nothing else there.

use glam::DVec3;

use crate::bvh::Hit;
use crate::cast::closest_hit_in;
use crate::geom::Pose;
use crate::maths;
use crate::near_field::{Footprint, WheelPlane, outline};
use crate::problem::{Frame, Problem};
use crate::scene::{EgoBody, Ground, Scene, Target};

/// Metres above and below the wheel plane in which ground is looked for at the vehicle.
const REACH: f64 = 30.0;
/// Metres more for each metre of distance: roads are less steep.
const STEEPEST: f64 = 0.3;
/// Metres below a surface from which the next one is looked for.
const STEP: f64 = 1e-3;
/// Surfaces above each other that are looked at, at most.
const MOST_SURFACES: usize = 64;
/// Metres between ground surfaces that are one: a marking on a road, a pavement on the ground under it.
const ONE_GROUND: f64 = 1.0;

/// Surfaces of a scene that are ground.
#[derive(Debug)]
pub struct GroundBelow {
    /// By triangle of a frame.
    is_ground: Vec<bool>,
    /// Outline of the own body; none without a body.
    footprint: Option<Footprint>,
}

impl GroundBelow {
    /// By the classes of the scene's triangles; the own body is no ground.
    pub fn new(scene: &Scene) -> Self {
        let (own, classes) = (scene.triangles(EgoBody::Exclude), Ground::among(scene.classes()));
        let is_ground = |(face, class): (usize, &u16)| {
            face < own && classes.get(usize::from(*class)) == Some(&true)
        };
        let classes = scene.face_classes(EgoBody::Include);
        let is_ground = classes.iter().enumerate().map(is_ground).collect();
        Self { is_ground, footprint: outline(scene).ok() }
    }

    /// Plane of the ground under the wheels in a frame; z = 0 without a body.
    pub(super) fn wheels(&self, geometry: &Frame) -> WheelPlane {
        let plane = |footprint| WheelPlane::of(footprint, geometry, &self.is_ground);
        self.footprint.as_ref().map(plane).unwrap_or_default()
    }

    /// Height of the ground under a point of the ego frame in a frame; `None` where there is none within 30 m of the wheel
    /// plane, and 0.3 m more a metre from the origin, or where another surface is in the target's height above
    /// it, or the place is inside a closed thing.
    ///
    /// Of several grounds, a bridge over a road for example, the one nearest to the wheel plane counts. Grounds less
    /// than a metre above each other are one, and the lowest of them counts.
    pub(super) fn height(
        &self,
        problem: &Problem,
        (frame, wheels): (usize, &WheelPlane),
        target: &Target,
        [x, y]: [f64; 2],
    ) -> Option<f64> {
        let geometry = problem.geometry(frame)?;
        let (plane, reach) = (wheels.at([x, y]), (REACH + STEEPEST * maths::hypot(x, y)).ceil());
        let mut from = plane + reach;
        let (mut grounds, mut others) = (Vec::new(), Vec::new());
        for _ in 0..MOST_SURFACES {
            let pose = Pose { translation: DVec3::new(x, y, from), ..Pose::IDENTITY };
            let range = (from - (plane - reach)).max(STEP) as f32;
            let hit: Hit = closest_hit_in(geometry, &pose, [0.0, 0.0, -1.0], range);
            if !hit.is_hit() {
                break;
            }
            let height = from - f64::from(hit.t);
            match self.is_ground[hit.prim as usize] {
                true => grounds.push(height),
                false => others.push(height),
            }
            from = height - STEP;
        }
        let (ground, top) = (nearest(&grounds, plane)?, target.corners[1][2]);
        let above = others.iter().filter(|&&z| z >= ground);
        // Under an odd number of surfaces the place is inside a closed thing.
        let is_free = above.clone().all(|&z| z > ground + top) && above.count() % 2 == 0;
        is_free.then_some(ground)
    }
}

/// The ground of falling heights that is nearest to one: the lowest of those within [`ONE_GROUND`] below each other.
fn nearest(grounds: &[f64], height: f64) -> Option<f64> {
    let far = |at: usize| (grounds[at] - height).abs();
    let mut at = (0..grounds.len()).min_by(|&a, &b| far(a).total_cmp(&far(b)))?;
    while grounds.get(at + 1).is_some_and(|next| grounds[at] - next < ONE_GROUND) {
        at += 1;
    }
    Some(grounds[at])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::psog::Psog;

    /// Heights of the ground for a child at places, from an ego at `z`, over a road at z = 0 and under or on a bridge
    /// whose deck is 6 m up.
    fn heights(z: f64, places: &[[f64; 2]]) -> Vec<Option<f64>> {
        let text = format!(
            r#"{{ "sightline": 1,
            "roi": {{ "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] }},
            "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }},
            "mount": {{ "min": [-2, -1, 2], "max": [2, 1, 2.5], "lidars": 1 }},
            "static": [{{ "class": "road", "plane": {{ "min": [-99, -99], "max": [99, 99], "z": 0 }} }},
                       {{ "class": "bridge", "box": {{ "min": [-50, -9, 5], "max": [50, 9, 6] }} }}],
            "ego": {{ "poses": [{{ "x": 0, "y": 0, "z": {z} }}],
                     "body": [{{ "class": "vehicle", "box": {{ "min": [-2, -1, 0.2], "max": [2, 1, 1.5] }} }}] }} }}"#
        );
        let scene = Scene::from_json(&text, Path::new(""), "bridge.json").unwrap();
        let roi = scene.roi().grid().unwrap();
        let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
        let problem = Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
        let (ground, child) = (GroundBelow::new(&scene), Target::named("child").unwrap());
        let wheels = ground.wheels(problem.geometry(0).unwrap());
        let height = |at: &[f64; 2]| ground.height(&problem, (0, &wheels), &child, *at);
        places.iter().map(height).collect()
    }

    #[test]
    fn a_target_stands_on_the_bridge_or_under_it_as_the_vehicle_does() {
        let places = [[20.0, 0.0], [20.0, 15.0]];
        let near = |found: Option<f64>, height: f64| (found.unwrap() - height).abs() < 1e-5;
        // Beside the bridge there is the road alone.
        let [on, beside] = heights(6.0, &places)[..] else { panic!("two places") };
        assert!(near(on, 0.0) && near(beside, -6.0), "{on:?} {beside:?}");
        let [under, beside] = heights(0.0, &places)[..] else { panic!("two places") };
        assert!(near(under, 0.0) && near(beside, 0.0), "{under:?} {beside:?}");
    }

    #[test]
    fn the_ground_nearest_to_the_wheels_counts_with_what_lies_close_below() {
        assert_eq!(nearest(&[], 0.0), None);
        // A bridge 6 m up, a marking and the road, from the road, from the bridge, from a valley below.
        let grounds = [6.01, 6.0, 0.02, 0.0, -0.15, -7.0];
        assert_eq!(nearest(&grounds, 0.0), Some(-0.15));
        assert_eq!(nearest(&grounds, 6.0), Some(6.0));
        assert_eq!(nearest(&grounds, -20.0), Some(-7.0));
    }
}
