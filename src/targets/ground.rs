//! Ground of a scene below a place, and whether a target has room there.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::bvh::Hit;
use crate::cast::closest_hit_in;
use crate::geom::Pose;
use crate::maths;
use crate::near_field::{Footprint, WheelPlane, outline};
use crate::problem::{Frame, SceneSurface};
use crate::scene::{EgoBody, Ground, Scene, Target};

/// Metres above and below the wheel plane in which ground is looked for at the vehicle.
const REACH: f64 = 30.0;
/// Metres more for each metre of distance: roads are less steep.
const STEEPEST: f64 = 0.3;
/// Metres below a surface from which the next one is looked for.
const STEP: f64 = 1e-3;
/// Surfaces above each other that are looked at, at most.
const MOST_SURFACES: usize = 64;
/// Metres along which a level line looks for the walls of a closed thing.
const WIDEST: f64 = 200.0;
/// Level lines from a point; the first is oblique to the axes, so that it rarely runs along a wall.
const LEVEL_LINES: u32 = 5;
const FIRST_ANGLE: f64 = 0.2;
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
        Self { is_ground, footprint: outline(scene, 0).ok() }
    }

    /// On the surface of a scene, around an own body.
    pub(super) fn of(surface: &SceneSurface, body: &Frame) -> Self {
        let footprint = Footprint::of(body.corners().map(|at| [at.x, at.y]));
        Self { is_ground: surface.is_ground.clone(), footprint }
    }

    /// Plane of the ground under the wheels in a frame; z = 0 without a body.
    pub(super) fn wheels(&self, geometry: &Frame) -> WheelPlane {
        let plane = |footprint| WheelPlane::of(footprint, geometry, &self.is_ground);
        self.footprint.as_ref().map(plane).unwrap_or_default()
    }

    /// Height of the ground under a point of the ego frame in a frame.
    ///
    /// `None` where there is none within 30 m of the wheel plane, and 0.3 m more a metre from the origin. Also `None`
    /// where another surface is between the lowest and the highest point of the target, or the place is inside a closed
    /// thing.
    pub(super) fn height(
        &self,
        geometry: &Frame,
        wheels: &WheelPlane,
        target: &Target,
        [x, y]: [f64; 2],
    ) -> Option<f64> {
        let (ground, others) = self.below(geometry, wheels, [x, y]);
        let ground = ground?;
        let [low, high] = target.corners.map(|corner| ground + corner[2]);
        let above: Vec<f64> = others.into_iter().filter(|&z| z >= low).collect();
        let is_free = above.iter().all(|&z| z > high)
            && (above.len().is_multiple_of(2)
                || !self.is_closed(geometry, [x, y, 0.5 * (low + high)]));
        is_free.then_some(ground)
    }

    /// Height of the ground under a point, free or not, and heights of the other surfaces under and over it.
    ///
    /// Where there are several grounds (a bridge over a road) the one nearest to the wheel plane counts. Grounds less
    /// than a metre above each other are one, and the lowest of them counts.
    pub(super) fn below(
        &self,
        geometry: &Frame,
        wheels: &WheelPlane,
        [x, y]: [f64; 2],
    ) -> (Option<f64>, Vec<f64>) {
        let (plane, reach) = (wheels.at([x, y]), (REACH + STEEPEST * maths::hypot(x, y)).ceil());
        let from = DVec3::new(x, y, plane + reach);
        let down = self.surfaces(geometry, from, [0.0, 0.0, -1.0], 2.0 * reach);
        let (grounds, others): (Vec<_>, Vec<_>) =
            down.into_iter().partition(|(_, is_ground)| *is_ground);
        let [grounds, others] = [grounds, others].map(|found| -> Vec<f64> {
            found.into_iter().map(|(metres, _)| from.z - metres).collect()
        });
        (nearest(&grounds, plane), others)
    }

    /// Surfaces along a line: metres from its start, and whether each is ground.
    fn surfaces(
        &self,
        geometry: &Frame,
        start: DVec3,
        direction: [f32; 3],
        length: f64,
    ) -> Vec<(f64, bool)> {
        let along = DVec3::from(direction.map(f64::from));
        let (mut found, mut metres) = (Vec::new(), 0.0);
        while found.len() < MOST_SURFACES && metres < length {
            let pose = Pose { translation: start + metres * along, ..Pose::IDENTITY };
            let hit: Hit = closest_hit_in(geometry, &pose, direction, (length - metres) as f32);
            if !hit.is_hit() {
                break;
            }
            metres += f64::from(hit.t);
            found.push((metres, self.is_ground[hit.prim as usize]));
            metres += STEP;
        }
        found
    }

    /// True if most level lines from a point cross an odd number of surfaces. A roof that hangs over it has none.
    fn is_closed(&self, geometry: &Frame, at: [f64; 3]) -> bool {
        let is_odd = |line: &u32| {
            let angle = FIRST_ANGLE + TAU * f64::from(*line) / f64::from(LEVEL_LINES);
            let direction = [maths::cos(angle) as f32, maths::sin(angle) as f32, 0.0];
            let surfaces = self.surfaces(geometry, DVec3::from(at), direction, WIDEST);
            surfaces.iter().filter(|(_, is_ground)| !is_ground).count() % 2 == 1
        };
        (0..LEVEL_LINES).filter(is_odd).count() as u32 * 2 > LEVEL_LINES
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
    use crate::problem::Problem;
    use crate::psog::Psog;

    /// Heights of the ground for a child at places, from an ego at `z`, over a road at z = 0 and under or on a bridge
    /// whose deck is 6 m up.
    fn heights(z: f64, places: &[[f64; 2]]) -> Vec<Option<f64>> {
        let bridge = r#"{ "class": "bridge", "box": { "min": [-50, -9, 5], "max": [50, 9, 6] } }"#;
        heights_among(bridge, &Target::named("child").unwrap(), z, places)
    }

    /// Like [`heights`], for a target among other shapes.
    fn heights_among(
        shapes: &str,
        target: &Target,
        z: f64,
        places: &[[f64; 2]],
    ) -> Vec<Option<f64>> {
        let text = format!(
            r#"{{ "sightline": 1,
            "roi": {{ "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] }},
            "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }},
            "mount": {{ "min": [-2, -1, 2], "max": [2, 1, 2.5], "lidars": 1 }},
            "static": [{{ "class": "road", "plane": {{ "min": [-99, -99], "max": [99, 99], "z": 0 }} }},
                       {shapes}],
            "ego": {{ "poses": [{{ "x": 0, "y": 0, "z": {z} }}],
                     "body": [{{ "class": "vehicle", "box": {{ "min": [-2, -1, 0.2], "max": [2, 1, 1.5] }} }}] }} }}"#
        );
        let scene = Scene::from_json(&text, Path::new(""), "bridge.json").unwrap();
        let roi = scene.roi().grid().unwrap();
        let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
        let problem = Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
        let ground = GroundBelow::new(&scene);
        let geometry = problem.geometry(0).unwrap();
        let wheels = ground.wheels(geometry);
        let height = |at: &[f64; 2]| ground.height(geometry, &wheels, target, *at);
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

    #[test]
    fn a_roof_that_hangs_leaves_room_and_a_closed_thing_does_not() {
        // A sheet 4 m up, a house 6 m high on the ground, a plate on the road.
        let shapes = r#"{ "class": "building", "plane": { "min": [10, -9], "max": [30, 9], "z": 4 } },
            { "class": "building", "box": { "min": [40, -9, 0], "max": [60, 9, 6] } },
            { "class": "static", "plane": { "min": [-30, -9], "max": [-10, 9], "z": 0.05 } }"#;
        let child = Target::named("child").unwrap();
        let places = [[20.0, 0.0], [50.0, 0.0], [-20.0, 0.0], [70.0, 0.0]];
        let on_road = |found: Vec<Option<f64>>| {
            found
                .into_iter()
                .map(|height| height.is_some_and(|z| z.abs() < 1e-5))
                .collect::<Vec<_>>()
        };
        let found = heights_among(shapes, &child, 0.0, &places);
        assert_eq!(on_road(found), [true, false, false, true]);
        // Between 2 and 3 m above the ground there is room over the plate, and none in the house.
        let floating = Target { corners: [[-0.5, -0.5, 2.0], [0.5, 0.5, 3.0]], ..child };
        let found = heights_among(shapes, &floating, 0.0, &places);
        assert_eq!(on_road(found), [true, false, true, true]);
    }
}
