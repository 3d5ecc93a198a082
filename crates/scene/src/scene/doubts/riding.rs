//! Mounts that stand on a body that moves, and do not move with it; mounts that ride on one and stand beside it.

use glam::DVec3;
use lidar_cast::geom::Pose;

use super::standing::{Looks, middle_within};
use super::{Scene, inside};
use crate::scene::parts::OwnBody;
use sightline_files::json::Location;

/// Metres between a body and a mount that stands on it, at most, along each axis.
const BESIDE: f64 = 0.3;

/// Notes on mounts that touch a body that moves where it stands in frame 0, and not in every frame, and on mounts that ride on a
/// body and do not touch it there.
pub(super) fn mounts(scene: &Scene, places: &[Location]) -> Vec<String> {
    let looks = Looks::new();
    let note = |(mount, at): (usize, &Location)| {
        let ends = scene.vehicle.mounts[mount].region.corners().map(DVec3::from);
        let carrier = scene.vehicle.mounts[mount].region.rides_on;
        if !carrier.is_none() {
            let body = scene.bodies.iter().find(|body| body.name == carrier.as_str())?;
            let is_off =
                looks.spend(body.parts.faces.len()) && !is_beside(body, body.motion.pose(0), ends);
            return is_off.then(|| {
                format!(
                    "{at}: rides on `{carrier}`, and stands more than {BESIDE} m beside it in frame 0; give its place as that body \
                     stands in frame 0, and begin with the body straight"
                )
            });
        }
        (0..scene.bodies.len()).find_map(|number| {
            let body = &scene.bodies[number];
            let (metres, frame) = farthest_ride(scene, body, ends, &looks)?;
            let mend = match scene.own_body_name(number) {
                "" => "name the body, and add that name as `rides_on` to the mount".to_owned(),
                name => format!("add \"rides_on\": \"{name}\" to it"),
            };
            Some(format!(
                "{at}: mounts are fixed in the vehicle's frame and do not ride on the ego's {}, which moves away by \
                 {metres:.1} m in frame {frame}; if the body carries this mount, {mend}",
                scene.own_body_in_words(number)
            ))
        })
    };
    (0..scene.vehicle.mounts.len()).zip(places).filter_map(note).collect()
}

/// Metres that the middle of a mount would ride on a body at most, and the frame; `None` where it does not touch the body in
/// frame 0, or touches it in all frames.
fn farthest_ride(
    scene: &Scene,
    body: &OwnBody,
    ends: [DVec3; 2],
    looks: &Looks,
) -> Option<(f64, usize)> {
    let touches = |pose: Pose| looks.spend(body.parts.faces.len()) && is_beside(body, pose, ends);
    let first = body.motion.pose(0);
    if !touches(first) {
        return None;
    }
    let (middle, back) = (0.5 * (ends[0] + ends[1]), first.inverse());
    let ride = |t: usize| {
        let pose = body.motion.pose(t);
        pose.apply(back.apply(middle)).distance(middle)
    };
    let far = (1..scene.frames).map(|t| (ride(t), t));
    let mut far: Vec<(f64, usize)> = far.filter(|(metres, _)| *metres > 0.0).collect();
    // The farthest first, of equal ones the first.
    far.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    far.into_iter()
        .take_while(|_| looks.is_left())
        .find(|(_, t)| !is_beside(body, body.motion.pose(*t), ends))
}

/// True if a body in a pose reaches into a box, or lies around it, with room on all sides.
fn is_beside(body: &OwnBody, pose: Pose, [low, high]: [DVec3; 2]) -> bool {
    let (parts, low, high) = (&body.parts, low - BESIDE, high + BESIDE);
    let meets = |face: &[u32; 3]| {
        let triangle = face.map(|v| pose.apply(parts.vertices[v as usize]));
        middle_within(&triangle, low, high).is_some()
    };
    parts.faces.iter().any(meets) || inside(parts, pose.inverse().apply(0.5 * (low + high)))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use sightline_files::json::Checked;

    use super::*;

    /// A vehicle with a trailer that bends around x = −1 and one mount.
    fn scene_of(mount: &str) -> Checked<Scene> {
        let text = format!(
            r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
            "frames": 3, "vehicle": {{"sightline": 1,
              "body": [{{"class": "vehicle", "box": {{"min": [0, -1, 0.2], "max": [4, 1, 3]}}}}],
              "bodies": [{{"name": "trailer",
                "parts": [{{"class": "vehicle", "box": {{"min": [-11, -1.2, 0.2], "max": [0, 1.2, 3]}}}}],
                "poses": [{{"x": -1, "y": 0}}, {{"x": -1, "y": 0, "yaw": 0.7}}, {{"x": -1, "y": 0, "yaw": 0.3}}]}}],
              "sensors": [{{"name": "a", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 50}}}}],
              "symmetric": {}, "mounts": [{{"name": "m", "count": 1, {mount}}}]}},
            "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#,
            mount.contains("trailor")
        );
        Scene::from_json(&text, Path::new(""), "s.json")
    }

    fn told_of(mount: &str) -> String {
        let scene = scene_of(mount).unwrap();
        let notes = scene.notes().iter().map(ToString::to_string);
        notes.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_mount_on_a_trailer_that_bends_is_told_with_metres_and_frame() {
        // 11.1 m behind the hitch: a turn by 0.7 rad moves it by 2 · 11.1 · sin 0.35 = 7.61 m.
        let rear = told_of(r#""min": [-12.15, 0, 1.2], "max": [-12.05, 0, 2.2]"#);
        assert_holds!(
            rear,
            "mounts[0]: mounts are fixed in the vehicle's frame and do not ride on the ego's body `trailer`, which moves away by \
             7.6 m in frame 1; if the body carries this mount, add \"rides_on\": \"trailer\" to it"
        );
        let rides =
            told_of(r#""min": [-12.15, 0, 1.2], "max": [-12.05, 0, 2.2], "rides_on": "trailer""#);
        assert!(!rides.contains("do not ride"), "{rides}");
        let front = told_of(r#""min": [3, 0, 3.1], "max": [3.5, 0, 3.3]"#);
        assert!(!front.contains("do not ride"), "{front}");
        // Over the hitch the trailer never leaves it.
        let hitch = told_of(r#""min": [-1.1, -0.1, 3.1], "max": [-0.9, 0.1, 3.2]"#);
        assert!(!hitch.contains("do not ride"), "{hitch}");
    }
    #[test]
    fn a_mount_that_rides_on_a_body_beside_which_it_stands_is_told() {
        let beside =
            told_of(r#""min": [-12.15, 3, 1.2], "max": [-12.05, 4, 2.2], "rides_on": "trailer""#);
        let told = "mounts[0]: rides on `trailer`, and stands more than 0.3 m beside it in frame 0";
        assert_holds!(beside, told);
    }

    #[test]
    fn a_mount_rides_on_one_body_that_there_is() {
        let on = |name: &str| {
            let place = r#""min": [-12.15, 0, 1.2], "max": [-12.05, 0, 2.2]"#;
            scene_of(&format!(r#"{place}, "rides_on": "{name}""#)).unwrap_err().to_string()
        };
        // A slip is named before the vehicle is looked at for symmetry, which it breaks.
        let told =
            "mounts[0].rides_on: `trailor` is not a body of `bodies`; did you mean `trailer`?";
        assert_holds!(on("trailor"), told);
        let tail = r#"trailor"}, {"name": "n", "count": 1, "min": [-12.15, 0, 3], "max": [-12.05, 0, 3.1], "rides_on": "trailer"#;
        let side = tail.replace("0, 3", "1, 3");
        for mounts in [tail, &*side] {
            let symmetric = on(mounts);
            assert_holds!(symmetric, told);
        }
        let refused = on("boom");
        let wanted = "vehicle.mounts[0].rides_on: `boom` is not a body of `bodies`, which are `trailer`; leave it out for what \
                      stands on the first body";
        assert_holds!(refused, wanted);
    }
}
