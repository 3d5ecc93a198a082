//! Likely mistakes of a scene or a vehicle file: sizes, axes, ways, heights, ranges.

mod riding;
mod shared;
pub(super) mod size;
mod standing;
mod swept;

use glam::DVec3;

pub(super) use self::shared::Filled;
pub(super) use self::size::{far, of_moving_body, of_still_body};
use super::route::Motion;
use super::settings::doubts_of_scan;
use super::{Coverage, Ground, Scene, Solid, around};
use crate::vehicle;
use sightline_files::Note;
use sightline_files::json::Location;

/// Largest edge of a voxel that is no doubt, metres: larger ones hold a car and the street around it.
const LARGEST_VOXEL: f64 = 5.0;
/// Widest and highest world, in metres: national coordinates move a world, and do not stretch it.
const WORLD: [f64; 2] = [20_000.0, 500.0];
/// Longest actor, in metres: a train.
const ACTOR: f64 = 400.0;
/// Longest way from one frame to the next, in metres.
const LONGEST_STEP: f64 = 100.0;
/// Metres between two frames from which a way has a direction.
const STEP: f64 = 0.05;
/// Metres between the ego's origin and the ground under it that a kerb or a suspension explains.
const GROUND: f64 = 1.0;
/// Where scene, vehicle and body are described.
pub(super) struct SceneLocations {
    /// The scene file.
    pub scene: String,
    pub vehicle: Location,
    pub mounts: Vec<Location>,
    /// File of the body.
    pub body: String,
    pub scales: size::BodyScales,
}

impl Scene {
    /// Doubts about the scene, and the error of a search over mounts that lie inside the body.
    pub(super) fn doubts(&self, places: &SceneLocations) -> (Vec<Note>, Option<String>) {
        let scene = self;
        // A body of a wrong size among several was told by its own name.
        let size = size_of("ego body", &scene.body, places.scales.first);
        let size = size.filter(|_| !places.scales.told);
        let own = size.or_else(|| shape_of("ego body", &scene.body));
        let own = own.or_else(|| standing::off_ground("ego body", &scene.body));
        let mut of_body: Vec<String> = own.into_iter().collect();
        of_body.extend(size::tiny_parts("ego body", &scene.body, &places.scales.parts));
        of_body.extend(standing::of_ground(scene, "ego body", &scene.body));
        for (i, other) in scene.bodies.iter().enumerate() {
            let who = format!("ego's {}", scene.own_body_in_words(i));
            let own = shape_of(&who, &other.parts);
            of_body.extend(own.or_else(|| standing::of_ground(scene, &who, &other.parts)));
        }
        let mut doubts: Vec<String> = Vec::new();
        doubts.extend(world(&scene.world));
        doubts.extend(actors(scene));
        doubts.extend(spacing("ego", &scene.ego));
        doubts.extend(sideways("ego", scene.frames, |t| scene.ego_pose(t)));
        doubts.extend(ground(scene));
        doubts.extend(standing::in_world(scene));
        doubts.extend(standing::in_actor(scene));
        doubts.extend(doubts_of_scan(&scene.psog));
        doubts.extend(sensors(scene));
        doubts.extend(voxels(scene));
        let in_file = |file: &str, doubts: Vec<String>| {
            let doubts = doubts.into_iter().map(|doubt| Note::doubt(format!("{file}: {doubt}")));
            doubts.collect::<Vec<_>>()
        };
        let mut all = in_file(&places.body, of_body);
        all.extend(in_file(&places.scene, doubts));
        let of_mounts = standing::mounts(scene, &places.mounts);
        let buried = standing::all_buried(scene, &of_mounts);
        all.extend(of_mounts.into_iter().map(|(_, _, told)| Note::doubt(told)));
        all.extend(riding::mounts(scene, &places.mounts).into_iter().map(Note::fact));
        all.extend(standing::apart(scene, &places.vehicle).map(Note::doubt));
        all.extend(no_body(scene, places));
        (all, buried)
    }
}

fn extent(solid: &Solid) -> Option<DVec3> {
    corners(solid).map(|[low, high]| high - low)
}

/// Lower and upper corner of the box around triangles.
pub(super) fn corners(solid: &Solid) -> Option<[DVec3; 2]> {
    around(solid.faces.iter().flatten().map(|v| solid.vertices[*v as usize]))
}

/// Share of the area whose normal lies along each axis.
fn facing(solid: &Solid) -> DVec3 {
    let normal = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| solid.vertices[v as usize]);
        (b - a).cross(c - a)
    };
    let (sum, all) = solid.faces.iter().map(normal).fold((DVec3::ZERO, 0.0), |(sum, all), n| {
        let n = n.abs();
        let most = n.cmpge(DVec3::splat(n.max_element()));
        (sum + DVec3::select(most, n, DVec3::ZERO), all + n.max_element())
    });
    sum / f64::max(all, 1e-300)
}

/// A doubt about a body far larger or smaller than a vehicle.
fn size_of(who: &str, solid: &Solid, scale: Option<f64>) -> Option<String> {
    size::too_large(who, solid, scale).or_else(|| size::too_small(who, solid, scale))
}

/// A doubt about the axes of a body, or about one that is cut off; its size is looked at before.
fn shape_of(who: &str, solid: &Solid) -> Option<String> {
    let size = extent(solid)?;
    if size::is_odd(solid) {
        return None;
    }
    if size.z > 2.5 && size.z > 1.5 * size.x.max(size.y) {
        return Some(format!(
            "the {who} is {:.1} m high, but {:.1} m long and {:.1} m wide; z is up: give its mesh other \
             `axes` (\"y-up\" if y is up in its file, \"z-up\" if z is), or turn it",
            size.z, size.x, size.y
        ));
    }
    if solid.faces.len() == 1 {
        return Some(format!(
            "the {who} is 1 triangle; is its mesh cut off? Give all of its shapes"
        ));
    }
    (size.y > 2.5 && size.y > 1.3 * size.x).then(|| {
        format!(
            "the {who} is {:.1} m wide, but {:.1} m long; x is forward, y to the left: turn its mesh by a yaw of \
             1.5708",
            size.y, size.x
        )
    })
}

fn world(solid: &Solid) -> Option<String> {
    let size = extent(solid)?;
    if !solid.has_area() {
        return Some(
            "no triangle of the static world has an area, so that no beam hits it".to_owned(),
        );
    }
    let wide = size.x.max(size.y);
    if wide > WORLD[0] || size.z > WORLD[1] {
        return Some(format!(
            "the static world is {wide:.0} m wide and {:.0} m high, too large for a street; lengths are in metres: \
             give its mesh `\"scale\": 0.001` for millimetres, or 0.01 for centimetres",
            size.z
        ));
    }
    let on_side = size.z > 20.0 && size.z > 3.0 * size.y && facing(solid).y > 0.5;
    on_side.then(|| {
        format!(
            "the static world is {:.0} m high and {:.0} m deep, and most of its faces look along y; z is up: give \
             its mesh other `axes` (\"y-up\" if y is up in its file, \"z-up\" if z is), or turn it",
            size.z, size.y
        )
    })
}

fn actors(scene: &Scene) -> Vec<String> {
    let mut doubts = Vec::new();
    for (i, actor) in scene.actors.iter().enumerate() {
        let longest = extent(&actor.parts).map_or(0.0, DVec3::max_element);
        doubts.extend(spacing(&format!("actors[{i}]"), &actor.motion));
        if longest > ACTOR {
            doubts.push(format!(
                "actors[{i}] is {longest:.0} m large; lengths are in metres: give its mesh `\"scale\": 0.001` for \
                 millimetres, or 0.01 for centimetres"
            ));
        }
        let way = actor
            .kind
            .rolls()
            .then(|| sideways(&format!("actors[{i}]"), scene.frames, |t| actor.motion.pose(t)));
        doubts.extend(way.flatten());
    }
    // Many actors of one file share one mistake.
    let more = doubts.len().saturating_sub(3);
    doubts.truncate(3);
    if more > 0 {
        doubts.push(format!("{more} more actors are doubted as the three before"));
    }
    doubts
}

/// A doubt about a route on which no vehicle is so fast.
fn spacing(who: &str, motion: &Motion) -> Option<String> {
    let Motion::Route(route) = motion else { return None };
    let step = route.spacing;
    (step.abs() > LONGEST_STEP).then(|| {
        format!(
            "{who}.route.spacing is {step} m from frame to frame; lengths are in metres, {step} mm are {} m",
            step / 1000.0
        )
    })
}

/// A doubt where most steps of a way lead across the heading.
fn sideways(
    who: &str,
    frames: usize,
    pose: impl Fn(usize) -> lidar_cast::geom::Pose,
) -> Option<String> {
    let (mut steps, mut across) = (0, 0);
    for t in 1..frames {
        let (before, now) = (pose(t - 1), pose(t));
        let step = (now.translation - before.translation).truncate();
        if step.length() < STEP {
            continue;
        }
        let ahead = (before.apply(DVec3::X) - before.translation).truncate();
        steps += 1;
        across += usize::from(ahead.normalize_or_zero().dot(step.normalize()).abs() < 0.5);
    }
    (steps >= 3 && 5 * across > 4 * steps).then(|| {
        format!(
            "{who} moves sideways: in {across} of {steps} steps its heading is across its way; x is forward and \
             yaw is in radians, counter-clockwise from x: correct `yaw`"
        )
    })
}

/// Height of the ground under the ego that is nearest to z = 0 of its frame in frame 0.
fn ground_height(scene: &Scene) -> Option<f64> {
    let is_ground = Ground::among(&scene.classes.names);
    let ego_from_world = scene.ego_pose(0).inverse();
    let world = &scene.world;
    let mut nearest: Option<f64> = None;
    for (face, class) in world.faces.iter().zip(&world.classes) {
        if !is_ground.get(usize::from(*class)).copied().unwrap_or(false) {
            continue;
        }
        let corners = face.map(|v| ego_from_world.apply(world.vertices[v as usize]));
        if let Some(z) = height_at_origin(corners)
            && nearest.is_none_or(|n| z.abs() < n.abs())
        {
            nearest = Some(z);
        }
    }
    nearest
}

/// Doubts where the ground under the ego is far from z = 0 of its frame, or the region of interest leaves it out.
fn ground(scene: &Scene) -> Vec<String> {
    let Some(z) = ground_height(scene) else { return Vec::new() };
    let [low, high] = [scene.roi.min[2], scene.roi.max[2]];
    let cut = (z < low || z > high).then(|| {
        format!(
            "roi reaches from z = {low} to {high} m, and the ground under the ego at z = {z:.2} m lies outside it; near \
             gain counts the ground near the vehicle: let `roi` hold it"
        )
    });
    off_origin(z).into_iter().chain(cut).collect()
}

/// A doubt about a height of the ground under the ego that is far from z = 0.
fn off_origin(z: f64) -> Option<String> {
    if z.abs() <= GROUND {
        return None;
    }
    let place = if z < 0.0 { "below" } else { "above" };
    Some(format!(
        "the ground under the ego is {:.2} m {place} its origin in frame 0; the origin stands on the ground, z = 0: \
         move the poses of `ego`, and measure sensors from the ground",
        z.abs()
    ))
}

/// Height of a triangle over the origin in plan.
fn height_at_origin([a, b, c]: [DVec3; 3]) -> Option<f64> {
    let side = |p: DVec3, q: DVec3| p.truncate().perp_dot(q.truncate());
    let [u, v, w] = [side(b, c), side(c, a), side(a, b)];
    let area = u + v + w;
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    (inside && area.abs() > 1e-12).then(|| (u * a.z + v * b.z + w * c.z) / area)
}

/// Doubts about sensors and where they may stand.
fn sensors(scene: &Scene) -> Vec<String> {
    // Models with names are doubted where the vehicle is read.
    let nameless = scene.vehicle.sensors.iter().filter(|model| model.name.is_none());
    let doubts = nameless.flat_map(|model| vehicle::of_lidar("the LiDAR", &model.lidar));
    let mut doubts: Vec<String> = doubts.collect();
    let [_, high] = scene.vehicle().corners();
    if high[2] < 0.0 {
        doubts.push(format!(
            "the mount ends {:.2} m under the ground; z is up from the ground: give positive heights",
            -high[2]
        ));
    }
    doubts
}

/// A fact about a vehicle without a body of its own: beams end nowhere on it, or on the body of the scene.
fn no_body(scene: &Scene, places: &SceneLocations) -> Option<Note> {
    let is_bare = scene.body.faces.is_empty() && scene.bodies.is_empty();
    let beams_end = scene.coverage == Coverage::FirstHit && !scene.vehicle.is_nameless();
    let is_apart = places.vehicle.file != places.scene && places.body == places.scene;
    let instead = match is_bare {
        true => "beams pass through the vehicle".to_owned(),
        false if is_apart => format!("the ego body of {} stands for it", places.scene),
        false => return None,
    };
    let mend = "give its boxes or its mesh under `body`";
    beams_end.then(|| Note::fact(format!("{}: has no `body`: {instead}; {mend}", places.vehicle)))
}

/// A doubt about voxels so large that fewer than two fill the region.
fn voxels(scene: &Scene) -> Option<String> {
    let roi = &scene.roi;
    if let Some(axis) = (0..3).find(|&i| roi.voxel[i] > LARGEST_VOXEL) {
        return Some(format!(
            "roi.voxel[{axis}] is {} m; lengths are in metres: centimetres, or millimetres?",
            roi.voxel[axis]
        ));
    }
    let axis = (0..3).find(|&i| roi.voxel[i] > 0.5 * (roi.max[i] - roi.min[i]))?;
    Some(format!(
        "roi.voxel[{axis}] is {} m, more than half of the region, which is {} m there; lengths are in metres: give \
         smaller voxels",
        roi.voxel[axis],
        roi.max[axis] - roi.min[axis]
    ))
}

/// True if a point lies inside closed triangles: rays up and ahead leave them an odd number of times.
pub(super) fn inside(solid: &Solid, p: DVec3) -> bool {
    inside_faces(solid, &solid.faces, p)
}

/// True if triangles lie in all six directions of the axes around a place, as inside a body of parts that overlap.
pub(super) fn encloses(solid: &Solid, p: DVec3) -> bool {
    let between = |turn: fn(DVec3) -> DVec3| {
        let heights = solid.faces.iter().filter_map(|face| {
            // A shift without a common factor keeps rays off edges.
            let shift = DVec3::new(1.37e-5, 2.11e-5, 0.0);
            height_at_origin(face.map(|v| turn(solid.vertices[v as usize] - p) + shift))
        });
        let (low, high) = heights.fold((0.0_f64, 0.0_f64), |(l, h), z| (l.min(z), h.max(z)));
        low < 0.0 && high > 0.0
    };
    between(|v| v)
        && between(|v| DVec3::new(v.y, v.z, v.x))
        && between(|v| DVec3::new(v.z, v.x, v.y))
}

/// [`inside`] some of the triangles.
fn inside_faces(solid: &Solid, faces: &[[u32; 3]], p: DVec3) -> bool {
    let odd = |turn: fn(DVec3) -> DVec3| {
        let crossed = faces.iter().filter(|face| {
            // A shift without a common factor keeps rays off edges.
            let shift = DVec3::new(1.37e-5, 2.11e-5, 0.0);
            let corners = face.map(|v| turn(solid.vertices[v as usize] - p) + shift);
            height_at_origin(corners).is_some_and(|z| z > 0.0)
        });
        crossed.count() % 2 == 1
    };
    odd(|v| v) && odd(|v| DVec3::new(v.y, v.z, v.x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(body: &str, ego: &str, ground: f64, lidar: &str, mount: &str) -> String {
        crate::scene::tests::told(&format!(
            r#""lidar": {lidar}, "mount": {mount}, "frames": 4,
            "ego": {{"body": [{{"class": "vehicle", "box": {body}}}], {ego}}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": {ground}}}}}]"#
        ))
    }

    /// All notes on a scene.
    fn notes(text: &str) -> String {
        let scene = Scene::from_json(text, std::path::Path::new(""), "s.json").unwrap();
        scene.notes().iter().map(Note::text).collect::<Vec<_>>().join("\n")
    }

    const CAR: &str = r#"{"foot": [0, 0, 0.2], "size": [4.4, 1.8, 1.3]}"#;
    const AHEAD: &str = r#""route": {"points": [[0, 0], [10, 0]], "spacing": 1}"#;
    const ROOF: &str = r#"{"min": [-0.6, -0.6, 2], "max": [0.6, 0.6, 2.6], "lidars": 1}"#;
    const LIDAR: &str = r#"{"channels": 16, "fov": [-25, 5], "azimuth_steps": 180, "range": 100}"#;

    #[test]
    fn a_sound_scene_is_not_doubted() {
        assert_eq!(told(CAR, AHEAD, 0.0, LIDAR, ROOF), "");
    }

    #[test]
    fn a_region_without_the_ground_and_a_body_of_ground_are_doubted() {
        let text = |low: f64, class: &str| {
            format!(
                r#"{{"sightline": 1, "roi": {{"min": [-20, -20, {low}], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.5]}},
                "lidar": {LIDAR}, "mount": {ROOF}, "frames": 1,
                "ego": {{"body": [{{"class": "{class}", "box": {CAR}}}]}},
                "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
            )
        };
        let told = |low: f64, class: &str| notes(&text(low, class));
        assert_eq!(told(-0.5, "vehicle"), "");
        let cut = "roi reaches from z = 1 to 5.5 m, and the ground under";
        assert_holds!(told(1.0, "vehicle"), cut);
        let road = "the ego body has a shape of class `road`, which is ground";
        assert_holds!(told(-0.5, "road"), road);
    }

    #[test]
    fn headings_that_go_on_past_a_turn_are_sound() {
        let poses: Vec<String> = [6.1, 6.25, 6.4, 6.55]
            .iter()
            .map(|yaw| format!("{{\"x\": 0, \"y\": 0, \"yaw\": {yaw}}}"))
            .collect();
        let poses = format!("\"poses\": [{}]", poses.join(", "));
        assert_eq!(told(CAR, &poses, 0.0, LIDAR, ROOF), "");
    }

    #[test]
    fn voxels_larger_than_half_the_region_are_doubted() {
        let text = r#"{"sightline": 1, "roi": {"min": [-20, -20, 0], "max": [20, 20, 5], "voxel": [0.4, 0.4, 4]},
            "lidar": {"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100},
            "mount": {"min": [0, 0, 2], "max": [0, 0, 2], "lidars": 1},
            "static": [{"class": "road", "plane": {"min": [-50, -50], "max": [50, 50], "z": 0}}]}"#;
        assert_holds!(notes(text), "roi.voxel[2] is 4 m, more than half");
        let millimetres =
            text.replace("20, 20", "20000, 20000").replace("-20, -20", "-20000, -20000");
        let millimetres = millimetres.replace("[0.4, 0.4, 4]", "[500, 500, 1]");
        assert_holds!(notes(&millimetres), "roi.voxel[0] is 500 m; lengths are in metres");
    }

    #[test]
    fn each_likely_mistake_is_told_with_its_number() {
        let poses =
            r#""poses": [{"x": 0, "y": 0}, {"x": 0, "y": 1}, {"x": 0, "y": 2}, {"x": 0, "y": 3}]"#;
        let inside = r#"{"min": [-0.1, -0.1, 0.5], "max": [0.1, 0.1, 0.7], "lidars": 1}"#;
        let away = ROOF
            .replace("-0.6, -0.6, 2]", "9.4, -0.6, 1]")
            .replace("[0.6, 0.6, 2.6]", "[9.6, 0.6, 1.5]");
        let degrees = ROOF.replace("\"lidars\"", "\"yaw\": [0, 5], \"lidars\"");
        let turned = r#""poses": [{"x": 0, "y": 0, "yaw": 90}, {"x": 0, "y": 1, "yaw": 90}, {"x": 0, "y": 2, "yaw": 91},
            {"x": 0, "y": 3, "yaw": 92}]"#;
        let tilted = r#""poses": [{"x": 0, "y": 0, "pitch": 2}, {"x": 1, "y": 0}, {"x": 2, "y": 0}, {"x": 3, "y": 0}]"#;
        let mast = ROOF.replace("0.6, 2.6]", "0.6, 4.8]");
        let (level, one_step) = (LIDAR.replace("-25, 5", "5, 5"), LIDAR.replace("180", "1"));
        let short = LIDAR.replace("100}", "0.1}");
        let narrow = LIDAR.replace("-25, 5", "-0.4, 0.1");
        let large = r#"{"foot": [0, 0, 0.2], "size": [4400, 1800, 1300]}"#;
        let upright = r#"{"foot": [0, 0, 0.2], "size": [1.8, 1.3, 4.4]}"#;
        for (told, word) in [
            (told(large, AHEAD, 0.0, LIDAR, ROOF), "4400 mm would be 4.40 m"),
            (told(upright, AHEAD, 0.0, LIDAR, ROOF), "the ego body is 4.4 m high"),
            (told(CAR, poses, 0.0, LIDAR, ROOF), "ego moves sideways: in 3 of 3 steps"),
            (told(CAR, AHEAD, -1.73, LIDAR, ROOF), "1.73 m below its origin"),
            (told(CAR, AHEAD, 0.0, &short, ROOF), "a range of 0.1 m"),
            (told(CAR, AHEAD, 0.0, &narrow, ROOF), "fov: 0.500 degrees for 16 channels: radians?"),
            (told(CAR, AHEAD, 0.0, LIDAR, inside), "s.json: mount: the whole mount lies inside"),
            (told(CAR, AHEAD, 0.0, LIDAR, &away), "reaches 7.2 m outside the ego body"),
            (told(CAR, AHEAD, 0.0, LIDAR, &mast), "mount: reaches 3.3 m above the ego body"),
            (told(CAR, AHEAD, 0.0, &level, ROOF), "fov: all 16 channels look at one elevation, 5°"),
            (told(CAR, AHEAD, 0.0, &one_step, ROOF), "azimuth_steps: 1"),
            (told(CAR, AHEAD, 0.0, LIDAR, &degrees), "mount.yaw is 5 rad; degrees? 5° are 0.0873"),
            (told(CAR, turned, 0.0, LIDAR, ROOF), "ego.poses: yaw of 90 rad; degrees?"),
            (told(CAR, tilted, 0.0, LIDAR, ROOF), "ego.poses: a tilt of 2 rad"),
        ] {
            assert!(told.contains(word), "{word}: {told}");
        }
    }

    #[test]
    fn copies_in_one_place_and_steps_of_kilometres_are_doubted() {
        let box_ = r#"{"class": "vehicle", "box": {"min": [-2, -1, 0], "max": [2, 1, 1.5]}"#;
        let route = r#""route": {"points": [[0, 8], [10, 8]], "spacing": 1000}"#;
        let actor = format!(
            r#", "actors": [{{"parts": [{box_}, "repeat": {{"count": 5, "step": [0, 0, 0]}}}}], {route}}}]"#
        );
        let keys = format!(r#""lidar": {LIDAR}, "mount": {ROOF}, "frames": 3{actor}"#);
        let copies = "actors[0].parts[0].repeat.step: 0 m, so that all 5 copies stand in one place";
        let spacing = "actors[0].route.spacing is 1000 m from frame to frame";
        assert_holds!(crate::scene::tests::told(&keys), copies, spacing);
    }
}
