//! Mounts inside a body of the ego in some frame: bodies move, and so do mounts that ride on one.

use glam::DVec3;
use lidar_cast::geom::Pose;

use super::standing::Looks;
use super::{Scene, Solid};
use crate::scene::parts::OwnBody;
use crate::vehicle::SensorName;
use sightline_files::json::Location;

/// Body that holds all corners of a mount, and the first frame in which it does; `None` where none does. The body is the
/// number of one that moves, or `None` for the first body. A mount moves with the body that it rides on; the first body is
/// looked at for these mounts alone, since others stand still in it.
pub(super) fn swept(
    scene: &Scene,
    corners: &[DVec3; 8],
    rides_on: SensorName,
    looks: &Looks,
) -> Option<(Option<usize>, usize)> {
    let carrier = scene.bodies.iter().find(|body| body.name == rides_on.as_str());
    let carrier = carrier.filter(|_| !rides_on.is_none());
    (0..scene.frames).take_while(|_| looks.is_left()).find_map(|t| {
        let ride = carrier.map_or(Pose::IDENTITY, |body| {
            body.motion.pose(t).compose(&body.motion.pose(0).inverse())
        });
        let holds = |parts: &Solid, body_from_ego: Pose| {
            let body_from_mount = body_from_ego.compose(&ride);
            corners.iter().all(|corner| looks.inside(parts, body_from_mount.apply(*corner)))
        };
        let moving = |body: &OwnBody| match carrier {
            // Rounding of its poses takes no mount into the body that carries it.
            Some(own) if std::ptr::eq(own, body) => {
                t == 0 && holds(&body.parts, body.motion.pose(0).inverse())
            }
            _ => holds(&body.parts, body.motion.pose(t).inverse()),
        };
        let first =
            || (t > 0 && carrier.is_some() && holds(&scene.body, Pose::IDENTITY)).then_some(None);
        let body = scene.bodies.iter().position(moving).map(Some).or_else(first)?;
        Some((body, t))
    })
}

/// Words on a mount inside a body in a frame; see [`swept`].
pub(super) fn swept_in_words(
    scene: &Scene,
    at: &Location,
    rides_on: SensorName,
    body: Option<usize>,
    frame: usize,
) -> String {
    let moves = |body: usize| scene.bodies[body].name.as_str();
    if let Some(body) = body.filter(|body| !rides_on.is_none() && moves(*body) == rides_on.as_str())
    {
        return format!(
            "{at}: the whole mount lies inside the ego's {}, on which it rides and where every beam ends at once; move it \
             onto that body, as that stands in frame 0",
            scene.own_body_in_words(body)
        );
    }
    let body = body.map_or("ego's first body".to_owned(), |body| {
        format!("ego's {}", scene.own_body_in_words(body))
    });
    let poses = match rides_on.is_none() {
        true => "its `poses`".to_owned(),
        false => format!("the `poses` of `{rides_on}`"),
    };
    format!(
        "{at}: the whole mount lies inside the {body} in frame {frame}, where every beam ends at once; move it out of the way \
         of that body, or correct {poses}"
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Notes on a mount that rides on a trailer, which turns by a quarter to the right and then stands 6 m farther ahead.
    fn told_of_mount(min: [f64; 3], max: [f64; 3]) -> String {
        let text = format!(
            r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
            "frames": 3, "vehicle": {{"sightline": 1,
              "body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
              "bodies": [{{"name": "trailer",
                "parts": [{{"class": "vehicle", "box": {{"min": [-5, -1, 0.2], "max": [-1, 1, 1.8]}}}}],
                "poses": [{{"x": -2, "y": 0}}, {{"x": -2, "y": 0, "yaw": -1.5708}}, {{"x": 4, "y": 0}}]}}],
              "sensors": [{{"name": "a", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 50}}}}],
              "mounts": [{{"name": "m", "count": 1, "rides_on": "trailer", "min": {min:?}, "max": {max:?}}}]}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
        );
        let scene = Scene::from_json(&text, Path::new(""), "s.json").unwrap();
        scene.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn mounts_that_all_lie_inside_the_body_are_an_error_of_a_search() {
        // Inside and above the body, each with a least and a most number of LiDARs.
        let told = |inside: &[[u32; 2]], above: &[[u32; 2]]| {
            let mount = |z: f64, k: usize, count: &[u32; 2]| {
                format!(
                    r#"{{"name": "m{z}-{k}", "count": {count:?}, "min": [0, 0, {z}], "max": [0.5, 0, {z}]}}"#
                )
            };
            let inside = inside.iter().enumerate().map(|(k, count)| mount(1.0, k, count));
            let above = above.iter().enumerate().map(|(k, count)| mount(2.0, k, count));
            let mounts = inside.chain(above).collect::<Vec<_>>().join(", ");
            let text = format!(
                r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
                "vehicle": {{"sightline": 1,
                  "body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
                  "sensors": [{{"name": "a", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 50}}}}],
                  "mounts": [{mounts}]}},
                "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
            );
            let scene = Scene::from_json(&text, Path::new(""), "s.json").unwrap();
            scene.buried_mounts().map(str::to_owned)
        };
        let one = told(&[[1, 1]], &[]).unwrap();
        assert_begins!(one, "s.json: vehicle.mounts[0]: the whole mount lies inside the ego body");
        assert!(one.ends_with("heights are in metres from the ground"), "{one}");
        let two = told(&[[0, 1], [0, 2]], &[]).unwrap();
        assert!(two.ends_with("; all 2 mounts that may hold a LiDAR lie inside"), "{two}");
        // The one above may stay empty, or must.
        for above in [[0, 1], [0, 0]] {
            assert!(told(&[[1, 2]], &[above]).is_some(), "{above:?}");
        }
        assert!(told(&[[0, 2]], &[[0, 0]]).is_some());
        for (inside, above) in [([0, 1], [0, 1]), ([0, 1], [1, 1]), ([1, 1], [1, 1])] {
            assert_eq!(told(&[inside], &[above]), None, "{inside:?} {above:?}");
        }
    }

    #[test]
    fn a_mount_moves_with_the_body_that_it_rides_on() {
        // Left of the hitch, where the trailer stands in frame 1; the mount is ahead of the hitch then.
        let left = told_of_mount([-2.2, 4.5, 0.8], [-2.0, 4.7, 1.2]);
        assert!(!left.contains("the whole mount"), "{left}");
        // 5.1 m behind the hitch: in frame 2 the trailer takes it to x = −1.1 m.
        let ahead = told_of_mount([-7.2, 0.0, 0.8], [-7.05, 0.3, 1.2]);
        assert_holds!(
            ahead,
            "mounts[0]: the whole mount lies inside the ego's first body in frame 2",
            "or correct the `poses` of `trailer`"
        );
        let within = told_of_mount([-6.0, 0.0, 0.8], [-5.0, 0.3, 1.2]);
        assert_holds!(
            within,
            "mounts[0]: the whole mount lies inside the ego's body `trailer`, on which it rides and where every beam ends at once"
        );
    }
}
