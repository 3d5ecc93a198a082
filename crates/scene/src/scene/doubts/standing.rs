//! Doubts about where things stand: the own body under the ground, above it, or inside the static world; mounts inside the
//! body, far from it, or too close for their LiDARs.

use std::cell::Cell;

use glam::DVec3;
use lidar_cast::geom::Pose;

use super::super::{around, clipped};
use super::swept::{swept, swept_in_words};
use super::{Ground, Scene, Solid, corners, inside, inside_faces};
use crate::scene::parts::{self, OwnBody};
use crate::vehicle::{Region, VehicleMount};
use sightline_files::json::Location;

/// Metres below and above the ground z = 0 that the lowest point of a body may lie: wheels sink in, a body may be without
/// wheels.
const LOWEST: [f64; 2] = [-0.1, 1.0];
/// Metres by which a surface must reach into the body: things may touch it.
const TOUCH: f64 = 0.05;
/// Triangles that a doubt looks at, in all frames, bodies and mounts together.
const MOST_LOOKS: usize = 20_000_000;

/// Triangles that a doubt may still look at. Where they are spent, it finds nothing more.
pub(super) struct Looks(Cell<usize>);

impl Looks {
    pub(super) fn new() -> Self {
        Self(Cell::new(MOST_LOOKS))
    }

    pub(super) fn is_left(&self) -> bool {
        self.0.get() > 0
    }

    /// Spends a look at some triangles; the last one may be at more than are left. False where none are.
    pub(super) fn spend(&self, triangles: usize) -> bool {
        let left = self.0.get();
        self.0.set(left.saturating_sub(triangles));
        left > 0
    }

    /// [`inside`] closed triangles, and false where no look is left.
    pub(super) fn inside(&self, solid: &Solid, p: DVec3) -> bool {
        self.spend(solid.faces.len()) && inside(solid, p)
    }
}

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
        let [low, high] = around(faces.iter().flatten().map(|v| world.vertices[*v as usize]))?;
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
    let (looks, middle) = (Looks::new(), middle_of_ego(scene));
    let holds = |solid: &Solid, ends: Option<[DVec3; 2]>, p: DVec3| {
        let within = ends.is_some_and(|[low, high]| p.cmpge(low).all() && p.cmple(high).all());
        within && looks.inside(solid, p)
    };
    let own_ends = corners(&scene.body);
    let body_ends: Vec<_> = scene.bodies.iter().map(|body| corners(&body.parts)).collect();
    let actor_ends: Vec<_> = scene.actors.iter().map(|actor| corners(&actor.parts)).collect();
    (0..scene.frames).take_while(|_| looks.is_left()).find_map(|t| {
        let ego_from_world = scene.ego_pose(t).inverse();
        let meets = |(i, ends): (usize, &Option<[DVec3; 2]>)| {
            let [low, high] = (*ends)?;
            let actor = &scene.actors[i];
            let ego_from_actor = ego_from_world.compose(&actor.motion.pose(t));
            let of_actor = ego_from_actor.apply(0.5 * (low + high));
            let in_this = |p: DVec3| holds(&actor.parts, *ends, ego_from_actor.inverse().apply(p));
            let in_moving = scene.bodies.iter().zip(&body_ends).position(|(body, body_ends)| {
                let ego_from_body = body.motion.pose(t);
                let middle = body_ends.map(|[low, high]| ego_from_body.apply(0.5 * (low + high)));
                holds(&body.parts, *body_ends, ego_from_body.inverse().apply(of_actor))
                    || middle.is_some_and(&in_this)
            });
            let in_first = || holds(&scene.body, own_ends, of_actor) || in_this(middle);
            (in_moving.is_some() || in_first()).then_some((i, in_moving))
        };
        let (actor, body) = actor_ends.iter().enumerate().find_map(meets)?;
        let class = scene.actors[actor].parts.classes.first();
        let class = class.and_then(|class| scene.classes.names.get(usize::from(*class)));
        let class = class.map_or(String::new(), |class| format!(", a `{class}`,"));
        let body = body.map_or(String::new(), |body| format!("'s {}", scene.own_body_in_words(body)));
        Some(format!(
            "actors[{actor}]{class} stands inside the ego{body} in frame {t}: move its poses, or those of `ego`"
        ))
    })
}

/// A doubt where a surface of the static world that is no ground lies inside the body in frame 0, or inside one that moves in
/// any frame.
fn surface_inside(scene: &Scene) -> Option<String> {
    let moving = || {
        // One budget for the world's triangles, one for triangles of the bodies that may hold them.
        let (walks, looks) = (Looks::new(), Looks::new());
        let all = (0..scene.frames).flat_map(|t| scene.bodies.iter().map(move |body| (t, body)));
        let walked = |body: &OwnBody| scene.world.faces.len() + body.parts.faces.len();
        all.take_while(|(_, body)| walks.spend(walked(body)))
            .find_map(|(t, body)| surface_in(scene, &body.parts, t, body.motion.pose(t), &looks))
    };
    surface_in(scene, &scene.body, 0, Pose::IDENTITY, &Looks::new()).or_else(moving)
}

/// A doubt where a surface of the static world that is no ground lies inside a body where it stands in a frame.
fn surface_in(
    scene: &Scene,
    body: &Solid,
    t: usize,
    ego_from_body: Pose,
    looks: &Looks,
) -> Option<String> {
    let [low, high] = corners(body)?;
    let [low, high] = [low + TOUCH, high - TOUCH];
    let is_ground = Ground::among(&scene.classes.names);
    let body_from_world = ego_from_body.inverse().compose(&scene.ego_pose(t).inverse());
    let world = &scene.world;
    let others = world.faces.iter().zip(&world.classes).take_while(|_| looks.is_left());
    let others =
        others.filter(|(_, class)| !is_ground.get(usize::from(**class)).is_some_and(|g| *g));
    let mut near = others.filter_map(|(face, class)| {
        let triangle = face.map(|v| body_from_world.apply(world.vertices[v as usize]));
        Some((middle_within(&triangle, low, high)?, class))
    });
    let (at, class) = near.find(|(at, _)| looks.inside(body, *at))?;
    let class = scene.classes.names.get(usize::from(*class)).map_or("", String::as_str);
    let at = ego_from_body.apply(at);
    Some(format!(
        "a `{class}` of the static world stands inside the ego body in frame {t}, at x = {:.2}, y = {:.2}, z = {:.2} m of the \
         ego: move the poses of `ego`, or the shape",
        at.x, at.y, at.z
    ))
}

/// Middle of the part of a triangle that lies in a box; `None` where there is none.
pub(super) fn middle_within(triangle: &[DVec3; 3], low: DVec3, high: DVec3) -> Option<DVec3> {
    let polygon: Vec<[DVec3; 1]> = triangle.iter().map(|corner| [*corner]).collect();
    let polygon = clipped(polygon, [low.to_array(), high.to_array()]);
    let count = polygon.len() as f64;
    (count > 0.0).then(|| polygon.into_iter().map(|[corner]| corner).sum::<DVec3>() / count)
}

/// Metres between a body and the nearest place of a mount, and its farthest, that a mast or a beam explains.
const BESIDE: f64 = 2.5;
const REACH: f64 = 8.0;
/// Metres of a mount above the body that a mast explains.
const MAST: f64 = 3.0;
/// Places of a patch that are looked at.
const MOST_PLACES: usize = 16;

/// Doubts about mounts inside the body, or far from it, with the number of each mount, and true for one inside of it.
pub(super) fn mounts(scene: &Scene, places: &[Location]) -> Vec<(usize, bool, String)> {
    let body = parts::standing(&scene.body, &scene.bodies, 0);
    let Some([low, high]) = corners(&body) else { return Vec::new() };
    let looks = Looks::new();
    let doubt = |(number, at): (usize, &Location)| {
        let mount = &scene.vehicle.mounts[number];
        if let Some((in_all_frames, told)) = buried(scene, mount, at, &looks) {
            return Some((number, in_all_frames, told));
        }
        let told = far(at, mount.region.corners().map(DVec3::from), [low, high])?;
        Some((number, false, told))
    };
    (0..scene.vehicle.mounts.len()).zip(places).filter_map(doubt).collect()
}

/// A doubt about a mount inside a body, and true if it lies there in every frame.
fn buried(
    scene: &Scene,
    mount: &VehicleMount,
    at: &Location,
    looks: &Looks,
) -> Option<(bool, String)> {
    let [from, to] = mount.region.corners().map(DVec3::from);
    let corner =
        |k: usize| DVec3::from([0, 1, 2].map(|i| if k >> i & 1 == 0 { from[i] } else { to[i] }));
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(corner);
    let is_box = mount.region.ego_from_region.is_none();
    let rides_on = mount.region.rides_on;
    let swept = is_box.then(|| swept(scene, &corners, rides_on, looks)).flatten();
    if let Some((body, frame)) = swept {
        let is_carrier = body.is_some_and(|body| {
            !rides_on.is_none() && scene.own_body_name(body) == rides_on.as_str()
        });
        return Some((is_carrier, swept_in_words(scene, at, rides_on, body, frame)));
    }
    if is_box && corners.iter().all(|corner| inside(&scene.body, *corner)) {
        let told = format!(
            "{at}: the whole mount lies inside the ego body, where every beam ends at once; move it onto the body: \
             heights are in metres from the ground"
        );
        return Some((rides_on.is_none(), told));
    }
    (!is_box && leads_inside(&scene.body, &mount.region)).then(|| {
        let told = format!(
            "{at}: `offset` leads into the ego body, where every beam ends at once; offsets count along the outer side: \
             give positive ones, list the corners of a polygon counter-clockwise as seen from outside, or say with \
             `facing` which side of a mesh is meant"
        );
        (rides_on.is_none(), told)
    })
}

/// A doubt about a mount far from the body or above it; both with their lower and upper corner.
fn far(at: &Location, [from, to]: [DVec3; 2], [low, high]: [DVec3; 2]) -> Option<String> {
    let nearest = (low - to).max(from - high).max(DVec3::ZERO).length();
    let farthest = (low - from).max(to - high).max(DVec3::ZERO).length();
    let outside = if nearest > BESIDE { nearest } else { farthest };
    let above = to.z - high.z;
    if nearest <= BESIDE && farthest <= REACH {
        return (above > MAST).then(|| {
            format!(
                "{at}: reaches {above:.1} m above the ego body; heights are in metres from the ground, not from the roof: \
                 check `max`"
            )
        });
    }
    Some(format!(
        "{at}: reaches {outside:.1} m outside the ego body; positions are in metres, from the ego's origin: \
         check `min` and `max`, and the place of the body"
    ))
}

/// Error of a search over mounts from which no beam gets out: every mount that must hold a LiDAR lies inside the body, or
/// every one that may.
pub(super) fn all_buried(scene: &Scene, told: &[(usize, bool, String)]) -> Option<String> {
    let inside = |number: usize| told.iter().find(|(of, inside, _)| *of == number && *inside);
    let mounts = scene.vehicle.mounts.iter().enumerate();
    let of = |least: bool| {
        let chosen = mounts.clone().filter(|(_, mount)| mount.count[usize::from(!least)] > 0);
        chosen.map(|(number, _)| number).collect::<Vec<_>>()
    };
    [(of(true), "must"), (of(false), "may")].into_iter().find_map(|(numbers, holds)| {
        let first = inside(*numbers.first()?)?;
        let end = match numbers.len() {
            1 => String::new(),
            count => format!("; all {count} mounts that {holds} hold a LiDAR lie inside"),
        };
        numbers.iter().all(|number| inside(*number).is_some()).then(|| format!("{}{end}", first.2))
    })
}

/// True if a patch with an offset lies inside the body with its nearer and its farther places. One without an offset lies on
/// the body, a little inside where it is drawn so.
fn leads_inside(body: &Solid, region: &Region) -> bool {
    let most = (MOST_LOOKS / body.faces.len().max(1)).min(MOST_PLACES);
    let depths = region.patch_offsets().filter(|range| *range != [0.0; 2]);
    let places = depths.map(|[from, to]| {
        [0.25, 0.75].map(|share| region.patch_places(from + share * (to - from), most))
    });
    places.is_some_and(|places| {
        let mut all = places.iter().flatten().peekable();
        all.peek().is_some() && all.all(|place| inside(body, *place))
    })
}

/// A doubt about LiDARs that are to be farther apart than any two places of the mounts are.
pub(super) fn apart(scene: &Scene, at: &Location) -> Option<String> {
    let least = scene.vehicle.min_distance;
    let corners = scene.vehicle.mounts.iter().flat_map(|mount| mount.region.corners());
    let [low, high] = around(corners.map(DVec3::from))?;
    let most = low.distance(high);
    let room: usize = scene.vehicle.mounts.iter().map(|mount| mount.count[1]).sum();
    (least > most && room > 1).then(|| {
        format!(
            "{}: {least} m is more than any two places of the mounts are apart, {most:.2} m, so that one LiDAR has room at \
             most; millimetres? {least} mm are {} m",
            at.key("min_distance"),
            least / 1000.0
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::tests::told;

    /// Notes on a body of two shapes in a scene with a building along y, from and to some x.
    fn told_of_body(boxes: [[f64; 2]; 2], wall: [f64; 2]) -> String {
        let shape = |[low, high]: [f64; 2]| {
            format!(
                r#"{{"class": "vehicle", "box": {{"min": [-2, -1, {low}], "max": [2, 1, {high}]}}}}"#
            )
        };
        told(&format!(
            r#""lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}},
            "mount": {{"min": [-1, -0.6, 2], "max": [1, 0.6, 2.5], "lidars": 1}},
            "ego": {{"body": [{}, {}], "poses": [{{"x": 1, "y": 0}}]}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}},
              {{"class": "building", "box": {{"min": [{}, -40, 0], "max": [{}, 40, 8]}}}}]"#,
            shape(boxes[0]),
            shape(boxes[1]),
            wall[0],
            wall[1]
        ))
    }

    #[test]
    fn looks_end_once_their_triangles_are_spent() {
        let corner = |k: u32| DVec3::from([0_u32, 1, 2].map(|axis| f64::from(k >> axis & 1)));
        let sides = [[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4]];
        let others = [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 3, 7], [1, 7, 5]];
        let cube = Solid {
            vertices: (0..8).map(corner).collect(),
            faces: [sides, others].concat(),
            ..Solid::default()
        };
        let looks = Looks(Cell::new(cube.faces.len() + 1));
        let within = DVec3::new(0.4, 0.5, 0.3);
        assert!(!looks.inside(&cube, within + DVec3::X));
        // One triangle is left, and then none.
        assert!(looks.inside(&cube, within) && !looks.is_left());
        assert!(!looks.inside(&cube, within));
    }

    #[test]
    fn bodies_under_the_ground_and_high_above_it_are_doubted() {
        let text = |low: f64| told_of_body([[low, 1.5], [1.2, 1.8]], [20.0, 21.0]);
        assert_eq!([0.3, 0.0, -0.09, 0.9].map(text).concat(), "");
        assert_holds!(text(-0.8), "the ego body reaches 0.80 m below the ground");
        assert_holds!(text(1.1), "the ego body begins 1.10 m above the ground");
    }

    #[test]
    fn a_wall_inside_the_body_is_doubted_and_one_beside_it_is_not() {
        // The ego stands at x = 1 and is 4 m long.
        let told = |wall| told_of_body([[0.2, 1.5], [1.5, 1.8]], wall);
        for beside in [[3.0, 3.3], [-1.3, -1.0], [10.0, 19.0]] {
            assert_eq!(told(beside), "", "{beside:?}");
        }
        let through =
            "a `building` of the static world stands inside the ego body in frame 0, at x = -0.70";
        assert_holds!(told([0.0, 0.3]), through);
        let within = "the ego stands inside a `building` of the static world in frame 0";
        assert_holds!(told([-5.0, 10.0]), within);
        assert_eq!(told([-60.0, 60.0]), "", "a hall");
    }

    #[test]
    fn an_actor_in_the_ego_is_doubted_with_its_frame_and_one_beside_it_is_not() {
        let told = |y: f64| {
            told(&format!(
                r#""lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}}, "frames": 2,
                "mount": {{"min": [-1, -0.6, 1], "max": [1, 0.6, 1.2], "lidars": 1}},
                "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}],
                "actors": [{{"parts": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0], "max": [2, 1, 1.5]}}}}],
                  "poses": [{{"x": 9, "y": 0}}, {{"x": 0, "y": {y}}}]}}]"#
            ))
        };
        // The scene has no body: the middle of the mounts counts.
        let words = "actors[0], a `vehicle`, stands inside the ego in frame 1";
        assert!(told(0.3).contains(words) && !told(2.5).contains("inside"), "{}", told(0.3));
    }

    #[test]
    fn things_in_a_body_that_moves_are_doubted_in_the_frame_in_which_it_stands_there() {
        let told_at = |actor: [f64; 2], wall: [f64; 2]| {
            let text = format!(
                r#""lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100}}, "frames": 2,
                "mount": {{"min": [-1, -0.6, 2], "max": [1, 0.6, 2.5], "lidars": 1}},
                "ego": {{"body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
                  "bodies": [{{"name": "trailer",
                    "parts": [{{"class": "vehicle", "box": {{"min": [-6, -1, 0.2], "max": [-1, 1, 1.8]}}}}],
                    "poses": [{{"x": -2, "y": 0}}, {{"x": -2, "y": 0, "yaw": 1.5708}}]}}]}},
                "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}},
                  {{"class": "wall", "box": {{"foot": [{}, {}, 0], "size": [0.3, 0.3, 1.5]}}}}],
                "actors": [{{"parts": [{{"class": "vehicle", "box": {{"min": [-0.3, -0.3, 0], "max": [0.3, 0.3, 1.5]}}}}],
                  "poses": [{{"x": {x}, "y": {y}}}, {{"x": {x}, "y": {y}}}]}}]"#,
                wall[0],
                wall[1],
                x = actor[0],
                y = actor[1]
            );
            told(&text)
        };
        let (away, straight, bent) = ([12.0, 9.0], [-5.5, 0.0], [-2.0, -5.0]);
        assert!(!told_at(away, away).contains("inside"), "{}", told_at(away, away));
        for (place, frame) in [(straight, 0), (bent, 1)] {
            let words = format!(
                "actors[0], a `vehicle`, stands inside the ego's body `trailer` in frame {frame}"
            );
            assert_holds!(told_at(place, away), &words);
            let words = format!("world stands inside the ego body in frame {frame}, at");
            assert_holds!(told_at(away, place), "a `wall` of the static", &words);
        }
    }

    #[test]
    fn a_mount_that_a_moving_body_sweeps_over_is_doubted_with_the_frame() {
        let trailer = r#""bodies": [{"parts": [{"class": "vehicle", "box": {"min": [-5, -1, 0.2], "max": [-1, 1, 1.8]}}],
            "poses": [{"x": -2, "y": 0}, {"x": -2, "y": 0, "yaw": -1.5708}]}],"#;
        let at = |y: f64| {
            let mount = format!(r#""min": [-2.2, {y}, 0.8], "max": [-2, {}, 1.2]"#, y + 0.2);
            told_of_mount_beside(&mount, trailer)
        };
        let words = "mounts[0]: the whole mount lies inside the ego's body 0 that moves in frame 1";
        assert_holds!(at(3.0), words);
        assert!(!at(-2.0).contains("the whole mount"), "{}", at(-2.0));
    }

    fn told_of_mount_beside(mount: &str, bodies: &str) -> String {
        told(&format!(
            r#""frames": 2, "vehicle": {{"sightline": 1, {bodies}
              "body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
              "sensors": [{{"name": "a", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 50}}}}],
              "mounts": [{{"name": "m", "count": 1, {mount}}}]}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]"#
        ))
    }

    #[test]
    fn patches_whose_offsets_lead_into_the_body_are_doubted() {
        let side = "[[-1, 1, 0.5], [-1, 1, 1.5], [1, 1, 1.5], [1, 1, 0.5]]";
        let turned = "[[1, 1, 0.5], [1, 1, 1.5], [-1, 1, 1.5], [-1, 1, 0.5]]";
        let patch = |corners: &str, offset: &str| {
            told_of_mount_beside(&format!(r#""polygon": {corners}{offset}"#), "")
        };
        let away = r#", "offset": [0, 0.1]"#;
        for sound in [patch(side, ""), patch(turned, ""), patch(side, away)] {
            assert_eq!(sound, "");
        }
        for inside in [
            patch(turned, away),
            patch(side, r#", "offset": [-0.1, 0]"#),
            patch(side, r#", "offset": [-0.1, -0.1]"#),
        ] {
            assert!(inside.contains("mounts[0]: `offset` leads into the ego body"), "{inside}");
        }
    }
}
