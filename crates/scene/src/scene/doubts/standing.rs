//! Doubts about where the own body stands: under the ground, above it, inside the static world.

use glam::DVec3;
use lidar_cast::geom::Pose;

use super::{Ground, Scene, Solid, corners, inside, inside_faces};

/// Metres below and above the ground z = 0 that the lowest point of a body may lie: wheels sink in, a body may be without
/// wheels.
const LOWEST: [f64; 2] = [-0.1, 1.0];
/// Metres by which a surface must reach into the body: things may touch it.
const TOUCH: f64 = 0.05;
/// Triangles of the body, or of the world in all frames of a body that moves, that are looked at.
const MOST_LOOKS: usize = 20_000_000;

/// A doubt about a body whose lowest point is far from the ground.
pub(super) fn off_ground(who: &str, solid: &Solid) -> Option<String> {
    let [low, _] = corners(solid)?;
    let mend = "z is up from the ground: move its shapes (`translate` of a mesh), or give its mesh other `axes`";
    if low.z < LOWEST[0] {
        return Some(format!("the {who} reaches {:.2} m below the ground, z = 0; {mend}", -low.z));
    }
    let is_high = low.z > LOWEST[1];
    is_high.then(|| format!("the {who} begins {:.2} m above the ground, z = 0; {mend}", low.z))
}

/// A doubt about a body with a class of ground.
pub(super) fn of_ground(scene: &Scene, who: &str, solid: &Solid) -> Option<String> {
    let names = &scene.classes.names;
    let is_ground = Ground::among(names);
    let ground = |class: &&u16| is_ground.get(usize::from(**class)).is_some_and(|is| *is);
    let class = names.get(usize::from(*solid.classes.iter().find(ground)?))?;
    Some(format!(
        "the {who} has a shape of class `{class}`, which is ground, and no body is; give it a class as `vehicle`"
    ))
}

/// A doubt where something of the static world that is no ground lies inside the body in frame 0, or the body in it.
pub(super) fn in_world(scene: &Scene) -> Option<String> {
    surface_inside(scene).or_else(|| within_shape(scene))
}

/// A doubt where the middle of the body lies in a shape. One around the whole region is a hall.
fn within_shape(scene: &Scene) -> Option<String> {
    let (world, pose) = (&scene.world, scene.ego_pose(0));
    let middle = pose.apply(middle_of_ego(scene));
    let [[x0, y0, _], [x1, y1, _]] = [scene.roi.min, scene.roi.max];
    let region = [[x0, y0], [x0, y1], [x1, y0], [x1, y1]];
    let region = region.map(|[x, y]| pose.apply(DVec3::new(x, y, middle.z)));
    let is_ground = Ground::among(&scene.classes.names);
    let begins = std::iter::once(0).chain(world.ends.iter().copied());
    let class = begins.zip(&world.ends).find_map(|(begin, &end)| {
        let (faces, class) = (&world.faces[begin..end], usize::from(*world.classes.get(begin)?));
        if is_ground.get(class).is_some_and(|is_ground| *is_ground) {
            return None;
        }
        let used = || faces.iter().flatten().map(|v| world.vertices[*v as usize]);
        let low = used().reduce(DVec3::min)?;
        let high = used().reduce(DVec3::max)?;
        let holds = |p: &DVec3| (0..2).all(|k| (low[k]..=high[k]).contains(&p[k]));
        let is_hall = region.iter().all(holds);
        (holds(&middle) && !is_hall && inside_faces(world, faces, middle)).then_some(class)
    })?;
    let class = scene.classes.names.get(class).map_or("", String::as_str);
    Some(format!(
        "the ego stands inside a `{class}` of the static world in frame 0: move the poses of `ego`, or the shape"
    ))
}

/// Middle of the own body, or of the mounts where it has none, in the ego frame.
fn middle_of_ego(scene: &Scene) -> DVec3 {
    let own = corners(&scene.body);
    let [low, high] = own.unwrap_or_else(|| scene.vehicle.corners().map(DVec3::from));
    0.5 * (low + high)
}

/// A doubt where the middle of an actor lies in the own body in some frame, or the ego's middle in an actor.
pub(super) fn in_actor(scene: &Scene) -> Option<String> {
    let middle = middle_of_ego(scene);
    let holds = |solid: &Solid, p: DVec3| {
        let within =
            corners(solid).is_some_and(|[low, high]| p.cmpge(low).all() && p.cmple(high).all());
        within && inside(solid, p)
    };
    let boxes: Vec<_> = scene.actors.iter().map(|actor| corners(&actor.parts)).collect();
    (0..scene.frames).find_map(|t| {
        let ego_from_world = scene.ego_pose(t).inverse();
        let meets = |(i, corners): (usize, &Option<[DVec3; 2]>)| {
            let [low, high] = (*corners)?;
            let ego_from_actor = ego_from_world.compose(&scene.actors[i].motion.pose(t));
            let own = ego_from_actor.apply(0.5 * (low + high));
            let in_moving = scene.bodies.iter().any(|body| {
                let ego_from_body = body.motion.pose(t);
                let holds_body = |[low, high]: [DVec3; 2]| {
                    let middle = ego_from_body.apply(0.5 * (low + high));
                    holds(&scene.actors[i].parts, ego_from_actor.inverse().apply(middle))
                };
                holds(&body.parts, ego_from_body.inverse().apply(own))
                    || corners(&body.parts).is_some_and(holds_body)
            });
            let met = in_moving
                || holds(&scene.body, own)
                || holds(&scene.actors[i].parts, ego_from_actor.inverse().apply(middle));
            met.then_some(i)
        };
        let actor = boxes.iter().enumerate().find_map(meets)?;
        Some(format!(
            "actors[{actor}] stands inside the ego in frame {t}: move its poses, or those of `ego`"
        ))
    })
}

/// A doubt where a surface of the static world that is no ground lies inside the body in frame 0, or inside one that moves in
/// any frame.
fn surface_inside(scene: &Scene) -> Option<String> {
    let frames = scene.frames.min(MOST_LOOKS / scene.world.faces.len().max(1)).max(1);
    let moving = || {
        let in_frame = |t: usize| {
            let mut bodies = scene.bodies.iter();
            bodies.find_map(|body| surface_in(scene, &body.parts, t, body.motion.pose(t)))
        };
        (0..frames).find_map(in_frame)
    };
    surface_in(scene, &scene.body, 0, Pose::IDENTITY).or_else(moving)
}

/// A doubt where a surface of the static world that is no ground lies inside a body where it stands in a frame.
fn surface_in(scene: &Scene, body: &Solid, t: usize, ego_from_body: Pose) -> Option<String> {
    let [low, high] = corners(body)?;
    let [low, high] = [low + TOUCH, high - TOUCH];
    let is_ground = Ground::among(&scene.classes.names);
    let body_from_world = ego_from_body.inverse().compose(&scene.ego_pose(t).inverse());
    let world = &scene.world;
    let others = world.faces.iter().zip(&world.classes);
    let others =
        others.filter(|(_, class)| !is_ground.get(usize::from(**class)).is_some_and(|g| *g));
    let near = others.filter_map(|(face, class)| {
        let triangle = face.map(|v| body_from_world.apply(world.vertices[v as usize]));
        Some((middle_within(&triangle, low, high)?, class))
    });
    let most = MOST_LOOKS / body.faces.len().max(1);
    let (at, class) = near.take(most).find(|(at, _)| inside(body, *at))?;
    let class = scene.classes.names.get(usize::from(*class)).map_or("", String::as_str);
    let at = ego_from_body.apply(at);
    Some(format!(
        "a `{class}` of the static world stands inside the ego body in frame {t}, at x = {:.2}, y = {:.2}, z = {:.2} m of the \
         ego: move the poses of `ego`, or the shape",
        at.x, at.y, at.z
    ))
}

/// Middle of the part of a triangle that lies in a box; `None` where there is none.
fn middle_within(triangle: &[DVec3; 3], low: DVec3, high: DVec3) -> Option<DVec3> {
    let mut polygon = triangle.to_vec();
    for axis in 0..3 {
        for (sign, end) in [(1.0, low[axis]), (-1.0, high[axis])] {
            let depth = |p: DVec3| sign * (p[axis] - end);
            let mut kept = Vec::new();
            for (k, &from) in polygon.iter().enumerate() {
                let to = polygon[(k + 1) % polygon.len()];
                let [a, b] = [from, to].map(depth);
                kept.extend((a >= 0.0).then_some(from));
                kept.extend(((a < 0.0) != (b < 0.0)).then(|| from.lerp(to, a / (a - b))));
            }
            polygon = kept;
        }
    }
    let count = polygon.len() as f64;
    (count > 0.0).then(|| polygon.into_iter().sum::<DVec3>() / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sightline_files::Note;

    /// Notes on a body of two shapes in a scene with a building along y, from and to some x.
    fn told(boxes: [[f64; 2]; 2], wall: [f64; 2]) -> String {
        let shape = |[low, high]: [f64; 2]| {
            format!(
                r#"{{"class": "vehicle", "box": {{"min": [-2, -1, {low}], "max": [2, 1, {high}]}}}}"#
            )
        };
        let text = format!(
            r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
            "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}},
            "mount": {{"min": [-1, -0.6, 2], "max": [1, 0.6, 2.5], "lidars": 1}},
            "ego": {{"body": [{}, {}], "poses": [{{"x": 1, "y": 0}}]}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}},
              {{"class": "building", "box": {{"min": [{}, -40, 0], "max": [{}, 40, 8]}}}}]}}"#,
            shape(boxes[0]),
            shape(boxes[1]),
            wall[0],
            wall[1]
        );
        let scene = Scene::from_json(&text, std::path::Path::new(""), "s.json").unwrap();
        let notes = scene.notes().iter().inspect(|note| assert!(note.is_doubt()));
        notes.map(Note::text).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn bodies_under_the_ground_and_high_above_it_are_doubted() {
        let text = |low: f64| told([[low, 1.5], [1.2, 1.8]], [20.0, 21.0]);
        assert_eq!([0.3, 0.0, -0.09, 0.9].map(text).concat(), "");
        let under = text(-0.8);
        assert!(under.contains("the ego body reaches 0.80 m below the ground"), "{under}");
        let above = text(1.1);
        assert!(above.contains("the ego body begins 1.10 m above the ground"), "{above}");
    }

    #[test]
    fn a_wall_inside_the_body_is_doubted_and_one_beside_it_is_not() {
        // The ego stands at x = 1 and is 4 m long.
        let told = |wall| told([[0.2, 1.5], [1.5, 1.8]], wall);
        for beside in [[3.0, 3.3], [-1.3, -1.0], [10.0, 19.0]] {
            assert_eq!(told(beside), "", "{beside:?}");
        }
        let through = told([0.0, 0.3]);
        let words =
            "a `building` of the static world stands inside the ego body in frame 0, at x = -0.70";
        assert!(through.contains(words), "{through}");
        let within = told([-5.0, 10.0]);
        let words = "the ego stands inside a `building` of the static world in frame 0";
        assert!(within.contains(words), "{within}");
        assert_eq!(told([-60.0, 60.0]), "", "a hall");
    }

    #[test]
    fn an_actor_in_the_ego_is_doubted_with_its_frame_and_one_beside_it_is_not() {
        let told = |y: f64| {
            let text = format!(
                r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
                "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}}, "frames": 2,
                "mount": {{"min": [-1, -0.6, 1], "max": [1, 0.6, 1.2], "lidars": 1}},
                "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}],
                "actors": [{{"parts": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0], "max": [2, 1, 1.5]}}}}],
                  "poses": [{{"x": 9, "y": 0}}, {{"x": 0, "y": {y}}}]}}]}}"#
            );
            let scene = Scene::from_json(&text, std::path::Path::new(""), "s.json").unwrap();
            scene.notes().iter().map(Note::text).collect::<Vec<_>>().join("\n")
        };
        // The scene has no body: the middle of the mounts counts.
        let words = "actors[0] stands inside the ego in frame 1";
        assert!(told(0.3).contains(words) && !told(2.5).contains("inside"), "{}", told(0.3));
    }

    #[test]
    fn things_in_a_body_that_moves_are_doubted_in_the_frame_in_which_it_stands_there() {
        let told = |actor: [f64; 2], wall: [f64; 2]| {
            let text = format!(
                r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
                "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}}, "frames": 2,
                "mount": {{"min": [-1, -0.6, 2], "max": [1, 0.6, 2.5], "lidars": 1}},
                "ego": {{"body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
                  "bodies": [{{"parts": [{{"class": "vehicle", "box": {{"min": [-6, -1, 0.2], "max": [-1, 1, 1.8]}}}}],
                    "poses": [{{"x": -2, "y": 0}}, {{"x": -2, "y": 0, "yaw": 1.5708}}]}}]}},
                "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}},
                  {{"class": "wall", "box": {{"foot": [{}, {}, 0], "size": [0.3, 0.3, 1.5]}}}}],
                "actors": [{{"parts": [{{"class": "vehicle", "box": {{"min": [-0.3, -0.3, 0], "max": [0.3, 0.3, 1.5]}}}}],
                  "poses": [{{"x": {x}, "y": {y}}}, {{"x": {x}, "y": {y}}}]}}]}}"#,
                wall[0],
                wall[1],
                x = actor[0],
                y = actor[1]
            );
            let scene = Scene::from_json(&text, std::path::Path::new(""), "s.json").unwrap();
            let doubts = scene.notes().iter().filter(|note| note.is_doubt());
            doubts.map(Note::text).collect::<Vec<_>>().join("\n")
        };
        let (away, straight, bent) = ([12.0, 9.0], [-5.5, 0.0], [-2.0, -5.0]);
        assert_eq!(told(away, away), "");
        for (place, frame) in [(straight, 0), (bent, 1)] {
            let words = format!("actors[0] stands inside the ego in frame {frame}");
            assert!(told(place, away).contains(&words), "{}", told(place, away));
            let words = format!(
                "a `wall` of the static world stands inside the ego body in frame {frame}, at"
            );
            assert!(told(away, place).contains(&words), "{}", told(away, place));
        }
    }
}
