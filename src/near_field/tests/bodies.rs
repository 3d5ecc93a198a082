//! Bodies in poses: a trailer that bends against the same trailer written where it stands.

use super::*;

/// A trailer of 6 by 2.5 m, 0.5 to 6 m high, that begins 1 m before its hitch at x = −2.
const TRAILER: &str =
    r#"{ "class": "vehicle", "box": { "min": [-5, -1.25, 0.5], "max": [1, 1.25, 6] } }"#;
const ANGLES: [f64; 3] = [0.0, 0.6, std::f64::consts::FRAC_PI_2];

fn with_bodies(bodies: &str, frames: usize) -> Scene {
    let rest = format!(
        r#""frames": {frames},
        "static": [{{ "class": "road", "plane": {{ "min": [-60, -60], "max": [60, 60], "z": 0 }} }}],
        "ego": {{ "body": [{}], "bodies": [{bodies}] }}"#,
        body()
    );
    written(Path::new(""), &rest)
}

fn pose(yaw: f64) -> String {
    format!(r#"{{ "x": -2, "y": 0, "yaw": {yaw} }}"#)
}

fn bending() -> Scene {
    let poses = ANGLES.map(pose).join(", ");
    with_bodies(&format!(r#"{{ "name": "trailer", "parts": [{TRAILER}], "poses": [{poses}] }}"#), 3)
}

fn standing(yaw: f64) -> Scene {
    with_bodies(&format!(r#"{{ "parts": [{TRAILER}], "poses": [{}] }}"#, pose(yaw)), 1)
}

fn sensor() -> (BeamTable, SensorPose) {
    let channels: Vec<(f64, f64)> = (0..20).map(|k| (-12.3 + 1.7 * f64::from(k), OFFSET)).collect();
    (BeamTable::spinning(&channels, 300, 100.0).unwrap(), SensorPose::at(1.0, 0.2, 2.0))
}

fn whole(scene: &Scene) -> Arc<Problem> {
    let roi = scene.roi().grid().unwrap();
    let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
    let frames: Vec<usize> = (0..scene.frame_count()).collect();
    Arc::new(Problem::from_scene(scene, &psog, sensor().0, &frames).unwrap())
}

#[test]
fn a_trailer_that_bends_wastes_in_each_frame_as_one_that_stands_so() {
    let scene = bending();
    let problem = whole(&scene);
    let placement = one(sensor().1);
    let site = NearSite::new(&scene, &problem).unwrap();
    let near = site.look(&mut cpu(&problem), &placement).unwrap();
    let alone: Vec<f64> =
        ANGLES.map(|yaw| look(&standing(yaw), sensor().0, sensor().1).beams[0].own).to_vec();
    let mean = alone.iter().sum::<f64>() / 3.0;
    // Some beams at edges differ: one trailer is moved as a whole, the others corner by corner.
    assert!((near.beams[0].own - mean).abs() < 2e-3, "{} {alone:?}", near.beams[0].own);
    let spread = alone.iter().fold(0.0, |far: f64, share| far.max((share - mean).abs()));
    assert!(spread > 0.02, "the frames differ: {alone:?}");
    // The guard tells of the worst frame.
    let guards = self_hits(&scene, &problem, &mut cpu(&problem), &placement).unwrap();
    let worst = alone.iter().copied().fold(0.0, f64::max);
    let [crate::score::Guard::SelfHit { share, frame, .. }] = guards[..] else {
        panic!("{alone:?}")
    };
    assert!((share - worst).abs() < 2e-3, "{share} {alone:?}");
    assert_eq!(frame, alone.iter().position(|share| *share == worst));
    let words =
        format!("% of its beams at the own vehicle in frame {}, more than 25 %", frame.unwrap());
    assert!(guards[0].to_string().ends_with(&words), "{}", guards[0]);
    let text = crate::report::coverage::near_field_text(std::slice::from_ref(&near));
    assert!(text.contains("own body % is a mean over 3 frames"), "{text}");
    let svg = crate::report::coverage::near_field_svg(site.footprint(), &[(&placement, &near)]);
    for words in
        ["body of frame 0; blind zone of frames", "blind zone over ground that most frames see"]
    {
        assert!(svg.contains(words), "{words}");
    }
    let still = look(&standing(0.6), sensor().0, sensor().1);
    let svg = crate::report::coverage::near_field_svg(site.footprint(), &[(&placement, &still)]);
    assert!(!svg.contains("frame 0") && !svg.contains("most frames"));
}

#[test]
fn ground_under_the_trailer_counts_in_no_frame_in_which_it_stands_there() {
    let scene = bending();
    let seen = {
        let problem = whole(&scene);
        let site = NearSite::new(&scene, &problem).unwrap();
        site.seen_by_lidar(&mut cpu(&problem), &one(sensor().1)).unwrap()
    };
    let cells = |near: &[bool]| near.iter().filter(|is| **is).count() as f64 / 16.0;
    let [straight, bent, across] = [0, 1, 2].map(|frame| cells(&seen[frame].near));
    // The outline is that of frame 0. Turned by 90° the trailer stands on y = −5 to 1, and the outline has y = −1.25 to 1.25:
    // 2.5 by 3.75 m of ground are gone.
    assert!(straight > bent && bent > across, "{straight} {bent} {across}");
    assert!((straight - across - 2.5 * 3.75).abs() < 0.7, "{straight} {across}");
}

#[test]
fn each_side_of_the_blind_zone_is_that_of_its_worst_frame() {
    let scene = bending();
    let all = whole(&scene);
    let placement = one(sensor().1);
    let looked = |problem: &Arc<Problem>| {
        let site = NearSite::new(&scene, problem).unwrap();
        site.look(&mut cpu(problem), &placement).unwrap()
    };
    let near = looked(&all);
    let alone = [0, 1, 2].map(|frame| looked(&Arc::new(all.over(&[frame]))));
    let mut differs = false;
    for side in ["ahead", "behind", "left", "right"] {
        let depth = |near: &NearField| {
            let (_, depth) =
                near.zone.depths().into_iter().find(|(name, _)| *name == side).unwrap();
            depth.unwrap_or(f64::INFINITY)
        };
        let deepest = alone.iter().map(depth).fold(0.0, f64::max);
        assert_eq!(depth(&near), deepest, "{side}");
        assert_eq!(depth(&alone[near.zone.worst_frames[side]]), deepest, "{side}");
        // A frame looked at alone, as a drawing does, has the lanes that it has among others.
        let lanes = |near: &NearField| {
            let own = near.zone.lanes.iter().filter(|lane| lane.side == side);
            own.cloned().collect::<Vec<_>>()
        };
        assert_eq!(lanes(&alone[near.zone.worst_frames[side]]), lanes(&near), "{side}");
        differs |= alone.iter().any(|near| depth(near) < deepest);
    }
    assert!(differs, "a side is blinder in one frame than in another");
    // No ground of its area lies under the trailer where it stands, 6 by 2.5 m from 1 m before its hitch.
    let mut under = 0.0;
    for (side, frame) in &near.zone.worst_frames {
        let (sin, cos) = ANGLES[*frame].sin_cos();
        let bounds = NearSite::new(&scene, &all).unwrap().footprint().bounds();
        for lane in near.zone.lanes.iter().filter(|lane| lane.side == *side) {
            let [from, to] = lane.along;
            let steps = (1e3 * lane.depth.unwrap_or(10.0)) as usize;
            let is_under = |k: &usize| {
                let (out, along) = (1e-3 * (*k as f64 + 0.5), 0.5 * (from + to));
                let [x, y] = match *side {
                    "ahead" => [bounds[1][0] + out, along],
                    "behind" => [bounds[0][0] - out, along],
                    "left" => [along, bounds[1][1] + out],
                    _ => [along, bounds[0][1] - out],
                };
                let (forward, left) = ((x + 2.0) * cos + y * sin, y * cos - (x + 2.0) * sin);
                (-5.0..1.0).contains(&forward) && left.abs() < 1.25
            };
            let metres = 1e-3 * (0..steps).filter(is_under).count() as f64;
            assert!((metres - lane.own_body).abs() < 0.26, "{side} {frame} {lane:?}: {metres}");
            under += (to - from) * metres;
        }
    }
    let whole = |lane: &BlindLane| (lane.along[1] - lane.along[0]) * lane.depth.unwrap_or(10.0);
    let whole: f64 = near.zone.lanes.iter().map(whole).sum();
    assert!((whole - under - near.zone.area).abs() < 1.5, "{whole} {under} {}", near.zone.area);
    assert!(under > 5.0, "{under} m² lie under the trailer");
    // Shares stay means, and the worst frame stands beside them.
    let shares = alone.each_ref().map(|near| near.near_field);
    assert!((near.near_field - shares.iter().sum::<f64>() / 3.0).abs() < 1e-12, "{shares:?}");
    let worst = near.worst_frame.unwrap().near_field.unwrap();
    assert_eq!(worst.share, shares[worst.frame]);
    assert!(shares.iter().all(|share| *share >= worst.share), "{shares:?}");
    assert_eq!((alone[0].worst_frame, alone[0].zone.worst_frames.len()), (None, 0));
}

#[test]
fn a_mount_that_looks_into_the_body_is_told_with_the_share_of_its_beams() {
    let mounts = r#"
        { "name": "front", "min": [2.1, -0.1, 1.0], "max": [2.2, 0.1, 1.1], "count": 1 },
        { "name": "corner", "min": [2.1, 1.1, 1.0], "max": [2.2, 1.2, 1.1], "yaw": [-2.6, -2.0], "count": 1 },
        { "name": "any way", "min": [0, 1.1, 1.0], "max": [0.2, 1.2, 1.1], "yaw": [-3.1416, 3.1416], "count": 1 },
        { "name": "low", "min": [-0.1, -0.1, 1.88], "max": [0.1, 0.1, 1.92], "yaw": [-3.1416, 3.1416], "count": 1 },
        { "name": "both flanks", "min": [-1, -1.2, 0.5], "max": [1, 1.2, 1.0], "count": 1 }"#;
    let text = format!(
        r#"{{"sightline": 1, "roi": {{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}},
        "vehicle": {{"sightline": 1,
          "body": [{{"class": "vehicle", "box": {{"min": [-2, -1, 0.2], "max": [2, 1, 1.8]}}}}],
          "sensors": [{{"name": "half", "lidar": {{"channels": 4, "fov": [-25, 5], "azimuth": [-60, 60], "azimuth_steps": 121,
                       "range": 50}}}}],
          "mounts": [{mounts}]}},
        "static": [{{"class": "road", "plane": {{"min": [-50, -50], "max": [50, 50], "z": 0}}}}]}}"#
    );
    let scene = Scene::from_json(&text, Path::new(""), "s.json").unwrap();
    let told = mounts_into_body(&scene, &scene.sensors().unwrap()).unwrap();
    let [words, low] = &told[..] else { panic!("{told:?}") };
    let rest = words.strip_prefix("mount corner: in the middle of its range half ends ").unwrap();
    // The box lies between the directions to (2, -1) and (-2, 1): -94° to -178°, 84 of 120 degrees.
    let share: f64 = rest.split(' ').next().unwrap().parse().unwrap();
    assert!((share - 70.0).abs() < 2.0 && rest.contains("turn `yaw` away"), "{words}");
    // The roof is below three of four channels at every yaw, so that no yaw helps.
    assert!(low.starts_with("mount low: "), "{low}");
    let mend = "at the own body; raise the mount, or let `pitch` look up (negative)";
    assert!(low.ends_with(mend), "{low}");
}
