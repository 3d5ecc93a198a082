//! Doubts about mounts: inside the body, far from it, too close for their LiDARs.

use glam::DVec3;

use super::{Scene, Solid, corners, inside};
use crate::scene::parts;
use crate::vehicle::Region;
use sightline_files::json::Location;

/// Metres between a body and the nearest place of a mount, and its farthest, that a mast or a beam explains.
const BESIDE: f64 = 2.5;
const REACH: f64 = 8.0;
/// Metres of a mount above the body that a mast explains.
const MAST: f64 = 3.0;
/// Places of a patch that are looked at, and triangles of the body for all of them, each as often as it must be.
const MOST_PLACES: usize = 16;
const MOST_LOOKS: usize = 20_000_000;

/// Doubts about mounts inside the body, or far from it.
pub(super) fn all(scene: &Scene, places: &[Location]) -> Vec<String> {
    let body = parts::standing(&scene.body, &scene.bodies, 0);
    let Some([low, high]) = corners(&body) else { return Vec::new() };
    let far = scene.vehicle.mounts.iter().zip(places).filter_map(|(mount, at)| {
        let [from, to] = mount.region.corners().map(DVec3::from);
        let corner = |k: usize| DVec3::from([0, 1, 2].map(|i| if k >> i & 1 == 0 { from[i] } else { to[i] }));
        let is_box = mount.region.ego_from_region.is_none();
        let swept = swept(scene, &[0, 1, 2, 3, 4, 5, 6, 7].map(corner)).filter(|_| is_box);
        if let Some((body, frame)) = swept {
            return Some(format!(
                "{at}: the whole mount lies inside the ego's body {body} that moves in frame {frame}, where every beam ends at \
                 once; move it out of the way of that body, or correct its `poses`"
            ));
        }
        if is_box && (0..8).all(|k| inside(&scene.body, corner(k))) {
            return Some(format!(
                "{at}: the whole mount lies inside the ego body, where every beam ends at once; move it onto the body: \
                 heights are in metres from the ground"
            ));
        }
        if !is_box && leads_inside(&scene.body, &mount.region) {
            return Some(format!(
                "{at}: `offset` leads into the ego body, where every beam ends at once; offsets count along the outer side: \
                 give positive ones, list the corners of a polygon counter-clockwise as seen from outside, or say with \
                 `facing` which side of a mesh is meant"
            ));
        }
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
    });
    far.collect()
}

/// Number of a body that moves and the first frame in which all corners of a mount lie inside it; `None` where none does.
fn swept(scene: &Scene, corners: &[DVec3; 8]) -> Option<(usize, usize)> {
    let faces: usize = scene.bodies.iter().map(|body| body.parts.faces.len()).sum();
    let most = MOST_LOOKS / (8 * faces.max(1));
    (0..scene.frames.min(most)).find_map(|t| {
        let holds = |body: &parts::OwnBody| {
            let body_from_ego = body.motion.pose(t).inverse();
            corners.iter().all(|corner| inside(&body.parts, body_from_ego.apply(*corner)))
        };
        Some((scene.bodies.iter().position(holds)?, t))
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
    let corners: Vec<DVec3> = corners.map(DVec3::from).collect();
    let low = corners.iter().copied().reduce(DVec3::min)?;
    let high = corners.iter().copied().reduce(DVec3::max)?;
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
    use super::super::Scene;
    use sightline_files::Note;

    fn told(mount: &str) -> String {
        told_with(mount, "")
    }

    fn told_with(mount: &str, bodies: &str) -> String {
        let text = format!(
            r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
            "vehicle": {{"sightline": 1, {bodies}
              "body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
              "sensors": [{{"name": "a", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 50}}}}],
              "mounts": [{{"name": "m", "count": 1, {mount}}}]}},
            "frames": 2, "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
        );
        let scene = Scene::from_json(&text, std::path::Path::new(""), "s.json").unwrap();
        let doubts = scene.notes().iter().filter(|note| note.is_doubt());
        doubts.map(Note::text).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn patches_whose_offsets_lead_into_the_body_are_doubted() {
        let side = "[[-1, 1, 0.5], [-1, 1, 1.5], [1, 1, 1.5], [1, 1, 0.5]]";
        let turned = "[[1, 1, 0.5], [1, 1, 1.5], [-1, 1, 1.5], [-1, 1, 0.5]]";
        let patch = |corners: &str, offset: &str| told(&format!(r#""polygon": {corners}{offset}"#));
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

    #[test]
    fn a_mount_that_a_moving_body_sweeps_over_is_doubted_with_the_frame() {
        let trailer = r#""bodies": [{"parts": [{"class": "vehicle", "box": {"min": [-5, -1, 0.2], "max": [-1, 1, 1.8]}}],
            "poses": [{"x": -2, "y": 0}, {"x": -2, "y": 0, "yaw": -1.5708}]}],"#;
        let at = |y: f64| {
            let mount = format!(r#""min": [-2.2, {y}, 0.8], "max": [-2, {}, 1.2]"#, y + 0.2);
            told_with(&mount, trailer)
        };
        let words = "mounts[0]: the whole mount lies inside the ego's body 0 that moves in frame 1";
        assert!(at(3.0).contains(words), "{}", at(3.0));
        assert_eq!(at(-2.0), "");
    }
}
