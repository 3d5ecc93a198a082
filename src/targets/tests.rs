//! Beams on targets against closed forms and against brute force that shares no code with the finder and the trees.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::card::position;
use super::*;
use crate::bvh::Bvh;
use crate::geom::TriangleSoup;
use crate::problem::{Frame, Problem};
use crate::psog::Psog;
use crate::scene::{Scene, Target};
use crate::vehicle::{BeamTable, SensorModel, SensorName, SensorPose, Sensors};

/// Directions of a spinning sensor.
pub(super) fn directions(elevations: &[f64], steps: usize) -> Vec<DVec3> {
    let of = |elevation: f64| {
        (0..steps).map(move |k| {
            let azimuth = k as f64 * std::f64::consts::TAU / steps as f64;
            let (e, a) = (elevation.sin_cos(), azimuth.sin_cos());
            DVec3::new(e.1 * a.1, e.1 * a.0, e.0)
        })
    };
    elevations.iter().flat_map(|&elevation| of(elevation)).collect()
}

pub(super) fn site(directions: &[DVec3], range: f64, body: &TriangleSoup) -> TargetSite {
    let table = BeamTable::from_directions(directions.iter().copied(), range).unwrap();
    TargetSite::new(Sensors::from(table), Frame::from(Arc::new(Bvh::build(body, 300.0))))
}

/// A wall across x at `x`, from y = −3 to 3 and z = 0 to 3.
pub(super) fn wall(x: f32) -> TriangleSoup {
    TriangleSoup {
        vertices: vec![[x, -3.0, 0.0], [x, 3.0, 0.0], [x, 3.0, 3.0], [x, -3.0, 3.0]],
        faces: vec![[0, 1, 2], [0, 2, 3]],
        face_class: vec![0; 2],
    }
}

/// The sight of a vehicle on level ground.
pub(super) fn posed(vehicle: &str) -> Sight {
    let text = r#"{ "sightline": 1, "coverage": "first-hit",
        "roi": { "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] },
        "static": [{ "class": "road", "plane": { "min": [-99, -99], "max": [99, 99], "z": 0 } }],
        "ego": { "poses": [{ "x": 0, "y": 0, "z": 0 }] }, "vehicle": VEHICLE }"#;
    let text = text.replace("VEHICLE", vehicle);
    let scene = Scene::from_json(&text, Path::new(""), "level.json").unwrap();
    let roi = scene.roi().grid().unwrap();
    let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
    let problem = Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
    Sight::of([(&Arc::new(problem), false)], Cars::Nowhere).unwrap()
}

/// Metres along a ray to a box by slabs, in `f64`; `None` where the ray misses it or passes closer than a tenth of a
/// millimetre to an edge, in which case no one can tell.
fn slabs(from: DVec3, along: DVec3, low: DVec3, high: DVec3) -> Option<Option<f64>> {
    let through = |slack: f64| {
        let (low, high) = (low - slack, high + slack);
        let (a, b) = ((low - from) / along, (high - from) / along);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        (near <= far && near > 0.0).then_some(near)
    };
    match (through(-1e-4), through(1e-4)) {
        (Some(_), Some(_)) => Some(through(0.0)),
        (None, None) => Some(None),
        _ => None,
    }
}

#[test]
fn level_beams_on_a_box_are_those_of_its_angle() {
    // A ring of level beams 0.1° apart at 1 m: the car's front is 1.8 m wide at 20 − 2.25 m.
    let beams = directions(&[0.0], 3600);
    let site = site(&beams, 100.0, &TriangleSoup::default());
    let car = Target::named("car").unwrap();
    let lidar = SensorPose::at(0.0, 0.0, 1.0);
    let count = |distance: f64| {
        let standing = [PlacedTarget { target: &car, at: position(distance, 0.0) }];
        site.beams(&lidar, &standing, u32::MAX).unwrap()[0]
    };
    for distance in [5.0, 20.0, 60.0, 90.0] {
        let half = (0.9_f64 / (distance - 2.25)).atan().to_degrees();
        assert_eq!(count(distance), 2 * (half / 0.1).floor() as u32 + 1, "{distance} m");
    }
    // The front is beyond the range of the beams.
    assert_eq!(count(103.0), 0);
    // Counting ends early where it may.
    let standing = [PlacedTarget { target: &car, at: position(5.0, 0.0) }];
    assert_eq!(site.beams(&lidar, &standing, 5).unwrap(), [5]);
}

#[test]
fn lidars_meet_a_target_together() {
    let beams = directions(&[0.0], 900);
    let (site, car) =
        (site(&beams, 100.0, &TriangleSoup::default()), Target::named("car").unwrap());
    let lidars = [0.7, 0.9, 1.1].map(|z| SensorPose::at(0.0, 0.0, z));
    let at = |distance: f64| PlacedTarget { target: &car, at: position(distance, 0.0) };
    let standing: Vec<PlacedTarget<'_>> = (2..20).map(|k| at(5.0 * f64::from(k))).collect();
    let sums: Vec<u32> = site
        .beams_by_lidar(&lidars, &standing)
        .unwrap()
        .iter()
        .map(|each| each.iter().sum())
        .collect();
    for enough in [1, 4, 7, 30] {
        let wanted: Vec<bool> = sums.iter().map(|&sum| sum >= enough).collect();
        assert_eq!(site.met(&lidars, &standing, enough).unwrap(), wanted, "{enough} of {sums:?}");
        let alone = site.met(&lidars[..1], &standing, enough).unwrap();
        assert!(enough == 1 || wanted != alone, "one LiDAR sees as much: {sums:?}");
    }
}

#[test]
fn every_beam_is_counted_once_whatever_the_pose() {
    let elevations: Vec<f64> = (0..24).map(|k| (-25.0 + 1.6 * f64::from(k)).to_radians()).collect();
    let beams = directions(&elevations, 720);
    let body = wall(2.0);
    let site = site(&beams, 80.0, &body);
    let lidars = [
        SensorPose::from_values([0.4, 0.2, 1.9, 0.1, 0.2, 2.0]),
        SensorPose::from_values([1.5, -0.8, 0.6, -0.3, -0.1, -0.7]),
        SensorPose::from_values([-0.6, 0.0, 2.5, 0.0, 1.3, 0.0]),
    ];
    let mut seen = 0;
    for name in ["car", "adult", "tyre"] {
        let target = Target::named(name).unwrap();
        for (distance, bearing) in [(3.0, 200.0), (6.0, 0.0), (12.0, 40.0), (35.0, -90.0)] {
            let at = position(distance, bearing);
            let standing = [PlacedTarget { target: &target, at }];
            let found = site.beams_by_lidar(&lidars, &standing).unwrap();
            let [low, high] = target.corners.map(|corner| DVec3::from(corner) + DVec3::from(at));
            for (lidar, found) in lidars.iter().zip(&found[0]) {
                let pose = lidar.ego_from_sensor();
                let (mut sure, mut unsure) = (0, 0);
                for direction in &beams {
                    let along = pose.rotation * *direction;
                    let hit = slabs(pose.translation, along, low, high);
                    let edge = DVec3::new(1.9999, -3.0, 0.0);
                    let wall = slabs(pose.translation, along, edge, DVec3::new(2.0001, 3.0, 3.0));
                    match (hit, wall) {
                        (Some(None), _) => {}
                        (Some(Some(t)), Some(wall)) => {
                            sure += u32::from(t <= 80.0 && wall.is_none_or(|wall| t < wall));
                        }
                        _ => unsure += 1,
                    }
                }
                assert!(
                    (sure..=sure + unsure).contains(found),
                    "{name} {distance}: {found}, {sure}"
                );
                assert!(unsure < 20);
                seen += sure;
            }
        }
    }
    assert!(seen > 1000, "the places are not trivial: {seen}");
}

#[test]
fn hits_of_a_scene_stand_in_the_way_as_a_body_does() {
    use crate::cast::closest_hit_in;
    let beams = directions(&[-0.05, -0.02, 0.0], 900);
    let free = site(&beams, 80.0, &TriangleSoup::default());
    let behind = site(&beams, 80.0, &wall(8.0));
    let car = Target::named("car").unwrap();
    let lidars = [SensorPose::at(0.0, 0.0, 1.2)];
    let poses = [lidars[0].ego_from_sensor()];
    let frame = Frame::from(Arc::new(Bvh::build(&wall(8.0), 300.0)));
    let table = free.sensors().table(0);
    let hits = table.directions().iter().map(|d| closest_hit_in(&frame, &poses[0], *d, 80.0));
    let hits: Vec<_> = hits.collect();
    for (distance, is_hidden) in [(5.0, false), (12.0, true)] {
        let standing = [PlacedTarget { target: &car, at: position(distance, 0.0) }];
        let in_scene = free.beams_in_scene(&lidars, &poses, &[&hits], &standing).unwrap();
        assert_eq!(in_scene, behind.beams_by_lidar(&lidars, &standing).unwrap());
        assert_eq!(in_scene[0][0] == 0, is_hidden, "{distance} m: {in_scene:?}");
    }
}

#[test]
fn a_card_names_the_sector_that_a_rig_does_not_see() {
    // Beams of ±60° around the front, level to 15° down, and a rig that looks ahead.
    let elevations: Vec<f64> = (0..32).map(|k| (-0.5 * f64::from(k)).to_radians()).collect();
    let all = directions(&elevations, 1800);
    let front: Vec<DVec3> =
        all.iter().copied().filter(|d| d.y.atan2(d.x).abs() <= 60_f64.to_radians()).collect();
    let lidar = |yaw: f64| SensorPose { yaw, ..SensorPose::at(0.0, 0.0, 1.6) };
    let round =
        RangeCard::new(&site(&all, 100.0, &TriangleSoup::default()), &[lidar(0.0)]).unwrap();
    assert_eq!((&round.blind[..], round.blind_between), (&[][..], [5.0, 50.0]));
    // A range of 20 m: cars beyond it are no finding, and that is said; within it a rig is as blind as before.
    let short = |beams: &[DVec3]| {
        RangeCard::new(&site(beams, 20.0, &TriangleSoup::default()), &[lidar(0.0)]).unwrap()
    };
    let [seen, lost] = [&all[..], &front[..]].map(short);
    assert_eq!((&seen.blind[..], seen.blind_between), (&[][..], [5.0, 20.0]));
    assert_eq!((lost.blind[0].bearings, lost.blind[0].distances), ([52.5, -52.5], [5.0, 20.0]));
    let said = [&round, &seen].map(|card| RangeCard::between_in_words(Some(card)));
    assert_eq!(said, ["between 5 and 50 m", "between 5 and 20 m"]);
    let text = crate::report::targets::range_card_text(&seen);
    let words = "\nBlind sectors are looked for from 5 to 20 m: no sensor of the vehicle reaches farther.\n";
    assert!(text.ends_with(words), "{text}");
    assert!(!crate::report::targets::range_card_text(&round).contains("Blind sectors"));
    // A rig of the shorter model of a vehicle: the card says how far that one reaches.
    let model = |name: &str, range: f64| SensorModel {
        name: SensorName::new(name).unwrap(),
        ..SensorModel::plain(BeamTable::from_directions(all.iter().copied(), range).unwrap())
    };
    let both = Sensors::new(vec![model("far", 100.0), model("near", 30.0)]).unwrap();
    let body = Frame::from(Arc::new(Bvh::build(&TriangleSoup::default(), 300.0)));
    let both = TargetSite::new(both, body);
    let of = |name| SensorPose { sensor: SensorName::new(name).unwrap(), ..lidar(0.0) };
    let [far, near] = ["far", "near"].map(|name| RangeCard::new(&both, &[of(name)]).unwrap());
    assert_eq!((far.reach, near.reach, near.blind_between), (None, Some(30.0), [5.0, 50.0]));
    let text = crate::report::targets::range_card_text(&near);
    assert!(
        text.contains("No LiDAR of this rig reaches farther than 30 m; other sensors"),
        "{text}"
    );
    let car = &round.targets[0].bearings[0];
    assert_eq!((car.bearing, car.met.last().unwrap()[1]), (0.0, 100.0));
    let site = site(&front, 100.0, &TriangleSoup::default());
    let ahead = RangeCard::new(&site, &[lidar(0.0)]).unwrap();
    let [blind] = &ahead.blind[..] else { panic!("{:?}", ahead.blind) };
    // Sectors around ±45° are seen up to ±60°; the next are around ±67.5°, whose edges lie at 52.5°.
    assert_eq!((blind.bearings, blind.distances), ([52.5, -52.5], [5.0, 50.0]));
    let told = blind.to_string();
    assert!(
        told.starts_with(
            "left and behind and right (in sectors of 30° over 255°, left round from 52.5° over 180° to -52.5°), worst at 90°: a car there at 5 to 50 m from the origin \
             is met"
        ),
        "{told}"
    );
    // A second one that looks back closes it but for the sides.
    let both = RangeCard::new(&site, &[lidar(0.0), lidar(std::f64::consts::PI)]).unwrap();
    let sides: Vec<_> = both.blind.iter().map(|sector| sector.bearings).collect();
    assert_eq!(sides, [[52.5, 127.5], [-127.5, -52.5]]);
    let one = BlindSector { bearings: [165.0, -165.0], ..both.blind[0].clone() };
    assert!(
        one.to_string().starts_with("behind (in the sector of 30° from 165° over 180° to -165°)")
    );
    // A sector within another one, across 180°, and one that is no part of it.
    assert!(one.is_within(blind) && !blind.is_within(&one) && !one.is_within(&both.blind[0]));
    assert!(both.blind.iter().all(|side| side.is_within(blind)));
    let farther = BlindSector { distances: [5.0, 60.0], ..one.clone() };
    assert!(!farther.is_within(blind));
    // A rig that looks at the sky sees no car.
    let sky = RangeCard::new(&site, &[SensorPose { pitch: -0.9, ..lidar(0.0) }]).unwrap();
    assert_eq!(sky.blind[0].bearings, [-180.0, 180.0]);
    assert!(blind.is_within(&sky.blind[0]) && !sky.blind[0].is_within(blind));
    let told = sky.blind[0].to_string();
    assert!(told.starts_with("all round (in every sector of 30°), worst at "), "{told}");
    assert!(sky.targets.iter().all(|target| target.bearings.iter().all(|b| b.met.is_empty())));
}

#[test]
fn a_gap_between_the_bearings_of_a_card_is_named() {
    let elevations: Vec<f64> = (0..32).map(|k| (-0.5 * f64::from(k)).to_radians()).collect();
    let all = directions(&elevations, 1800);
    // No beam within 6° of 37.5°: a car at 50 m is 5° wide there, one at 45° is met.
    let is_kept = |d: &DVec3| (d.y.atan2(d.x).to_degrees() - 37.5).abs() > 6.0;
    let kept: Vec<DVec3> = all.into_iter().filter(is_kept).collect();
    let lidar = SensorPose::at(0.0, 0.0, 1.6);
    let card = RangeCard::new(&site(&kept, 100.0, &TriangleSoup::default()), &[lidar]).unwrap();
    let [gap] = &card.blind[..] else { panic!("{:?}", card.blind) };
    assert_eq!((gap.bearings, gap.worst), ([7.5, 60.0], 37.5));
    let [[near, far]] = gap.lost[..] else { panic!("{gap:?}") };
    // Across the line of sight half of a car of 4.5 by 1.8 m is at most 2.1 m wide, and half of the gap r · tan 6°.
    assert!(near > 10.0 && near <= 25.0 && far == 50.0, "{gap:?}");
    let told = gap.to_string();
    assert!(
        told.starts_with(&format!(
            "ahead left (in sectors of 30° within 7.5° to 60°), worst at 37.5°: a car there at {near} to 50 m from the origin"
        )),
        "{told}"
    );
    let text = crate::report::targets::range_card_text(&card);
    let line = format!("between these bearings: at 37.5° a car is lost at {near}–50 m\n");
    assert!(text.ends_with(&line), "{text}");
    let bearings: Vec<f64> = card.targets[0].bearings.iter().map(|of| of.bearing).collect();
    assert_eq!(bearings[7..10], [157.5, 180.0, -157.5]);
}

#[test]
fn a_mast_between_the_bearings_of_a_card_makes_a_sector_blind() {
    let elevations: Vec<f64> = (0..48).map(|k| (-0.3 * f64::from(k)).to_radians()).collect();
    let beams = directions(&elevations, 1800);
    // 9 cm wide, 1 m ahead, at 3.75°: it hides a car at 30 m, and none at 0° or 7.5°.
    let mut mast = wall(0.998);
    mast.vertices.iter_mut().for_each(|at| at[1] = 0.02 + 0.09 * f32::from(at[1] > 0.0));
    let lidar = [SensorPose::at(0.0, 0.0, 2.0)];
    let card = |body: &TriangleSoup| RangeCard::new(&site(&beams, 100.0, body), &lidar).unwrap();
    assert!(card(&TriangleSoup::default()).blind.is_empty());
    let [ahead] = &card(&mast).blind[..] else { panic!("one sector is blind") };
    assert_eq!((ahead.bearings, ahead.worst), ([-15.0, 15.0], 3.75));
    assert!(ahead.lost.iter().any(|[near, far]| *near <= 30.0 && *far == 50.0), "{ahead:?}");
}

/// A vehicle that stands askew on a plane, `ego` its angles: the ground is a slope in its frame. Cars at 30 m and a bearing each
/// must be met with 30 beams, on the slope and on level ground. A house may stand to the left.
fn askew(ego: &str, bearings: [f64; 2], has_house: bool) -> Arc<Problem> {
    let rule = |bearing: f64, ground: &str| {
        format!(
            r#"{{ "target": "car", "from": 30, "within": 30, "bearing": [{bearing}, {bearing}], "beams": 30, "share": 1 {ground} }}"#
        )
    };
    let rules = bearings.map(|at| [rule(at, r#", "ground": "scene""#), rule(at, "")].join(", "));
    let house = r#", { "class": "building", "box": { "min": [-6, 26, -5], "max": [6, 34, 8] } }"#;
    let house = if has_house { house } else { "" };
    let text = format!(
        r#"{{ "sightline": 1, "coverage": "first-hit",
        "roi": {{ "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] }},
        "static": [{{ "class": "road", "plane": {{ "min": [-99, -99], "max": [99, 99], "z": 0 }} }}{house}],
        "ego": {{ "poses": [{{ "x": 0, "y": 0, "z": 0, {ego} }}] }},
        "vehicle": {{
          "sensors": [{{ "name": "a", "phase": 0,
            "lidar": {{ "channels": 21, "fov": [-10, 0], "azimuth_steps": 720, "range": 100 }} }}],
          "mounts": [{{ "name": "top", "min": [-2, -1, 1], "max": [2, 1, 2.5], "count": [1, 2] }}],
          "require": [{}] }} }}"#,
        rules.join(", ")
    );
    let scene = Scene::from_json(&text, Path::new(""), "askew.json").unwrap();
    let roi = scene.roi().grid().unwrap();
    let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
    Arc::new(Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap())
}

/// Share of each rule for a LiDAR 1.8 m up.
fn shares(scenes: &[(&Arc<Problem>, bool)]) -> Vec<f64> {
    let sight = Sight::of(scenes.iter().copied(), Cars::Nowhere).unwrap();
    let seen = sight.beams(&SensorPose::at(0.0, 0.0, 1.8)).unwrap();
    sight.rules_met(&[&seen]).iter().map(|met| met.share).collect()
}

#[test]
fn a_target_on_a_slope_rises_out_of_the_beams_or_falls_into_them() {
    // The nose points 0.05 rad down: the ground rises 1.5 m to 30 m ahead, and falls as much behind.
    let problem = askew(r#""pitch": 0.05"#, [0.0, 180.0], false);
    let (site, car) =
        (TargetSite::in_scene(&problem, false).unwrap(), Target::named("car").unwrap());
    let lidar = SensorPose::at(0.0, 0.0, 1.8);
    let table = problem.sensors().table(0);
    let mut counts = Vec::new();
    for (rises, own) in [(0.05_f64.tan(), true), (0.0, false)] {
        let at = site.standing(&car, position(30.0, 0.0)).unwrap();
        assert!((at[2] - 30.0 * 0.05_f64.tan()).abs() < 1e-3, "{at:?}");
        let from = DVec3::new(30.0, 0.0, 30.0 * rises);
        let [low, high] = car.corners.map(|corner| DVec3::from(corner) + from);
        let (mut sure, mut unsure) = (0, 0);
        for direction in table.directions() {
            let along = DVec3::from(direction.map(f64::from));
            match slabs(DVec3::new(0.0, 0.0, 1.8), along, low, high) {
                Some(Some(_)) => sure += 1,
                Some(None) => {}
                None => unsure += 1,
            }
        }
        if own {
            let standing = [PlacedTarget { target: &car, at }];
            let found = site.beams(&lidar, &standing, u32::MAX).unwrap()[0];
            assert!((sure..=sure + unsure).contains(&found), "{found}, {sure} and {unsure}");
        }
        counts.push(sure);
    }
    assert!(counts[0] > 5 && counts[0] < 25 && counts[1] > 35, "{counts:?}");
    // On the slope ahead, level ahead, on the slope behind, level behind.
    assert_eq!(shares(&[(&problem, false)]), [0.0, 1.0, 1.0, 1.0]);
}

#[test]
fn a_mirror_image_has_its_slope_on_the_other_side() {
    let problem = askew(r#""roll": 0.07"#, [90.0, -90.0], false);
    let image = Arc::new(problem.mirrored());
    let [plain, mirrored] = [(&problem, false), (&image, true)].map(|scene| shares(&[scene]));
    let mut scene = [plain[0], plain[2]];
    assert_ne!(scene[0], scene[1], "the ground rises on one side");
    scene.reverse();
    assert_eq!([mirrored[0], mirrored[2]], scene);
    // The mean over scenes counts; level ground is the same in all.
    assert_eq!(shares(&[(&problem, false), (&image, true)]), [0.5, 1.0, 0.5, 1.0]);
}

#[test]
fn a_mirror_image_without_free_ground_counts_for_nothing() {
    // The ground rises to the right. To the left, where a mirror image looks instead, stands a house.
    let problem = askew(r#""roll": 0.07"#, [-90.0, -89.0], true);
    let image = Arc::new(problem.mirrored());
    let both = [(&problem, false), (&image, true)];
    assert_eq!(shares(&both[..1]), [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(shares(&both), [0.0, 1.0, 0.0, 1.0]);
    // A closer look leaves it out, too.
    let bodies = BodyPoses::of(TargetSite::of(&problem), both.map(|(of, side)| (&**of, side)));
    let rule = &problem.target_rules()[0];
    let between = look_between(&bodies, rule, &[SensorPose::at(0.0, 0.0, 1.8)]).unwrap();
    assert_eq!(between.found, 0.0);
}

/// A scene of a flat road with a trailer behind a cab, straight in its first frame and bent by `yaw` in the second, whose
/// vehicle asks for the same target on level ground and on the scene's.
fn bending(yaw: f64) -> Arc<Problem> {
    let text = format!(
        r#"{{ "sightline": 1, "frames": 2, "coverage": "first-hit",
        "roi": {{ "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] }},
        "static": [{{ "class": "road", "plane": {{ "min": [-99, -99], "max": [99, 99], "z": 0 }} }}],
        "ego": {{ "poses": [{{ "x": 0, "y": 0, "z": 0 }}, {{ "x": 0, "y": 0, "z": 0 }}],
          "body": [{{ "class": "vehicle", "box": {{ "min": [0, -1, 0.2], "max": [2, 1, 1.5] }} }}],
          "bodies": [{{ "parts": [{{ "class": "vehicle", "box": {{ "min": [-8, -1, 0.2], "max": [-1, 1, 3.5] }} }}],
            "poses": [{{ "x": 0, "y": 0 }}, {{ "x": 0, "y": 0, "yaw": {yaw} }}] }}] }},
        "vehicle": {{
          "sensors": [{{ "name": "a", "phase": 0, "lidar": {{ "channels": 32, "fov": [-30, 0], "azimuth_steps": 360, "range": 100 }} }}],
          "mounts": [{{ "name": "top", "min": [0, -1, 1.6], "max": [2, 1, 2.5], "count": [1, 2] }}],
          "require": [{{ "target": "adult", "within": 20, "share": 0.99 }},
                      {{ "target": "adult", "within": 20, "share": 0.99, "ground": "scene" }}] }} }}"#
    );
    let scene = Scene::from_json(&text, Path::new(""), "bends.json").unwrap();
    let roi = scene.roi().grid().unwrap();
    let psog = Psog::new(roi, 2, scene.classes().to_vec(), vec![], vec![]).unwrap();
    Arc::new(Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0, 1]).unwrap())
}

#[test]
fn a_target_on_the_ground_of_a_scene_counts_in_the_worst_pose_of_the_bodies() {
    let (bends, straight) = (bending(0.9), bending(0.0));
    let image = Arc::new(bends.mirrored());
    let lidar = SensorPose::at(1.0, 0.0, 1.8);
    let met = |scenes: &[(&Arc<Problem>, bool)]| {
        let sight = Sight::of(scenes.iter().copied(), Cars::Nowhere).unwrap();
        let seen = sight.beams(&lidar).unwrap();
        let met = sight.rules_met(&[&seen]);
        let by_scene = sight.in_each_scene(&[&seen], &met, scenes.len());
        let order = sight.most_beams_first(&[&seen]);
        let again = sight.shares_on_targets(&[lidar], &order, &[true; 2]).unwrap();
        assert_eq!(again, [met[0].share, met[1].share]);
        (met, by_scene)
    };
    let (plain, _) = met(&[(&straight, false)]);
    assert!(plain[0].share == plain[1].share && plain[1].worst_frame.is_none(), "{plain:?}");
    // Range cards have the bodies as in frame 0, and say so.
    let card = |problem: &Problem| RangeCard::new(&TargetSite::of(problem), &[lidar]).unwrap();
    let [moves, stands] = [&bends, &straight].map(|problem| card(problem));
    let sector = moves.blind[0].to_string();
    assert!(sector.contains(", own bodies as in frame 0), worst at"), "{sector}");
    assert_eq!(sector.replace(", own bodies as in frame 0", ""), stands.blind[0].to_string());
    // The road is flat: the scene's ground is level.
    let (met_bent, by_scene) = met(&[(&bends, false)]);
    let [level, on_scene] = &met_bent[..] else { panic!("two rules") };
    assert!(level.share == on_scene.share && level.share < plain[0].share, "{met_bent:?}");
    assert_eq!(on_scene.worst_frame.map(|worst| worst.frame), Some(1));
    assert_eq!(on_scene.worst_frame, level.worst_frame);
    assert_eq!(on_scene.missing, level.missing);
    assert_eq!(by_scene[0][1].share, on_scene.share);
    assert_eq!(by_scene[0][1].worst_frame, on_scene.worst_frame);
    // Over scenes the mean of the worst of each counts.
    let (both, by_scene) = met(&[(&bends, false), (&straight, false)]);
    assert_eq!(both[1].share, f64::midpoint(on_scene.share, plain[1].share));
    assert_eq!(both[1].worst_frame, on_scene.worst_frame);
    assert_eq!(by_scene[1][1].worst_frame, None);
    // In a mirror image the trailer bends to the other side, and the places lie there too.
    let (mirrored, _) = met(&[(&image, true)]);
    assert_eq!(mirrored[1].share, on_scene.share);
    let rule = &bends.target_rules()[1];
    let bodies = BodyPoses::of(TargetSite::of(&bends), [(&*bends, false)]);
    let between = look_between(&bodies, rule, &[lidar]).unwrap();
    assert!((between.found - on_scene.share).abs() < 0.05, "{between:?}");
}
