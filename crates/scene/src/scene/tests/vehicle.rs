//! Vehicles in scenes: inline, in a file, in place of the scene's LiDAR and mount, and their errors; sensor files, over
//! whose numbers the scene's own win.

use glam::DVec3;

use super::*;
use crate::vehicle::{Placement, Response, SensorName, SensorPose, SpinPhase, Violation};

const VEHICLE: &str = r#"{ "sightline": 1, "name": "van", "body": [
    { "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [4, 2, 1] } }],
  "sensors": [
    { "name": "spinning", "price": 900, "lidar": { "channels": 4, "fov": [-20, 10], "azimuth_steps": 60, "range": 80 } },
    { "name": "solid", "price": 200, "phase": 0.1,
      "lidar": { "channels": 3, "fov": [-10, 10], "azimuth": [-40, 40], "azimuth_steps": 21, "range": 30 } }],
  "mounts": [
    { "name": "roof", "min": [-0.5, -0.5, 1.3], "max": [0.5, 0.5, 1.6], "sensors": ["spinning"], "count": 1 },
    { "name": "left", "polygon": [[1, 1.05, 0.5], [-1, 1.05, 0.5], [-1, 1.05, 0.9], [1, 1.05, 0.9]],
      "offset": [0, 0.1], "yaw": [-0.2, 0.2], "sensors": ["solid"], "count": [0, 2] }],
  "min_distance": 0.3,
  "require": [{ "name": "left side", "min": [-2, 1, 0.2], "max": [2, 3, 0.8], "share": 0.5 }] }"#;

fn with(vehicle: &str) -> String {
    with_vehicle(vehicle, BOX, "")
}

#[test]
fn a_vehicle_brings_sensors_mounts_and_body() {
    let scene = read(&with(VEHICLE)).unwrap();
    let vehicle = scene.vehicle();
    assert_eq!((vehicle.name.as_str(), vehicle.min_distance), ("van", 0.3));
    let phases: Vec<SpinPhase> = vehicle.sensors.iter().map(|sensor| sensor.phase).collect();
    assert_eq!(phases, [SpinPhase::Free, SpinPhase::Locked(0.1)]);
    let chosen = read(&with(&VEHICLE.replace("\"phase\": 0.1", "\"phase\": [0, 0.1]"))).unwrap();
    assert_eq!(chosen.vehicle().sensors[1].phase, SpinPhase::Between(0.0, 0.1));
    // A turn with four decimals is a turn, for phases and for mounts.
    let rounded = VEHICLE.replace("\"phase\": 0.1", "\"phase\": [-3.1416, 3.1416]");
    let turn = read(&with(&rounded.replace("[-0.2, 0.2]", "[-3.1416, 6.2832]"))).unwrap();
    let half: f64 = "3.1416".parse().unwrap();
    let whole = SpinPhase::Between(-half, std::f64::consts::TAU - half);
    assert_eq!(turn.vehicle().sensors[1].phase, whole);
    let models = scene.sensors().unwrap();
    assert_eq!((models.table(0).directions().len(), models.table(1).directions().len()), (240, 63));
    assert_eq!(models.longest_range(), 80.0);
    // The building of the scene and the body of the vehicle: two boxes.
    assert_eq!(scene.frame(0, EgoBody::Include).faces.len(), 24);
    assert_eq!(scene.frame(0, EgoBody::Exclude).faces.len(), 12);
    let cheapest = vehicle.cheapest();
    assert_eq!((cheapest.len(), vehicle.cost(&cheapest), vehicle.has_choice()), (1, 900.0, true));
    let solid = SensorName::new("solid").unwrap();
    let rules = vehicle.constraints(&vec![(1, solid), (0, cheapest[0].1), (1, solid)]);
    let names: Vec<&str> = rules.slots.iter().map(|slot| slot.region.name.as_str()).collect();
    assert_eq!(names, ["roof", "left", "left"]);
    // At rest a sensor on the side looks along the normal, upright.
    let rest = rules.slots[1].region.pose([0.05, 0.0, 0.0, 0.0, 0.0, 0.0], solid);
    assert!((rest.position() - DVec3::new(0.0, 1.1, 0.7)).length() < 1e-12, "{rest:?}");
    assert!((rest.yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-12 && rest.roll.abs() < 1e-12);
    let required = &vehicle.require[0];
    assert!(required.contains([0.0, 2.0, 0.5]) && !required.contains([0.0, 0.5, 0.5]));
}

#[test]
fn a_lidar_and_a_mount_are_a_vehicle_of_one_model_on_one_mount() {
    let scene = read(&full(BOX, "")).unwrap();
    let written = r#"{ "sensors": [{ "name": "a", "phase": 0,
            "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 100 } }],
        "mounts": [{ "name": "mount", "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3], "count": 4 }],
        "min_distance": 0.2 }"#;
    let written = read(&with(written)).unwrap();
    let (nameless, written) = (scene.vehicle(), written.vehicle());
    assert!(nameless.is_nameless() && !written.is_nameless());
    let (mut named, name) = (nameless.clone(), written.sensors[0].name);
    named.sensors[0].name = name;
    named.mounts[0].sensors = vec![name];
    assert_eq!(&named, written);
    let on_it = [SensorPose::at(0.0, 0.0, 2.5)];
    assert_eq!(nameless.mount_names(&on_it), [None]);
    assert_eq!(written.mount_names(&on_it), [Some("mount")]);
}

#[test]
fn placements_keep_the_rules_of_a_vehicle_in_any_order() {
    let scene = read(&with(VEHICLE)).unwrap();
    let vehicle = scene.vehicle();
    let [spinning, solid] = ["spinning", "solid"].map(|name| SensorName::new(name).unwrap());
    let rules = vehicle.constraints(&vec![(0, spinning), (1, solid), (1, solid)]);
    let side = |x: f64, sensor| SensorPose {
        yaw: std::f64::consts::FRAC_PI_2,
        sensor,
        ..SensorPose::at(x, 1.1, 0.7)
    };
    let top = SensorPose { sensor: spinning, ..SensorPose::at(0.0, 0.0, 1.5) };
    let of = |lidars: Vec<SensorPose>| crate::vehicle::Placement { name: "x".into(), lidars };
    let good = of(vec![side(0.8, solid), top, side(-0.8, solid)]);
    assert_eq!(rules.violations(&good), []);
    let ordered = rules.in_slots(&good.lidars).unwrap();
    assert_eq!(ordered[0], top);
    let variables = rules.variables_of(&good).unwrap();
    let back = rules.poses_of(&variables);
    for (a, b) in ordered.iter().zip(&back) {
        assert!(a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < 1e-9), "{back:?}");
    }
    for (bad, word) in [
        (vec![side(0.8, solid), top, side(0.7, solid)], "too close"),
        (vec![side(1.8, solid), top, side(-0.8, solid)], "outside the mount"),
        (vec![side(0.8, spinning), top, side(-0.8, solid)], "no mount for one more `spinning`"),
    ] {
        let found = rules.violations(&of(bad));
        assert!(found.iter().any(|v| v.to_string().contains(word)), "{found:?} lacks {word}");
    }
}

#[test]
fn a_vehicle_file_takes_the_place_of_what_a_scene_says() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, vehicle) = (dir.path().join("s.json"), dir.path().join("van.json"));
    std::fs::write(&scene, full(BOX, "")).unwrap();
    std::fs::write(&vehicle, VEHICLE).unwrap();
    let given = Scene::read_with(&scene, Some(&vehicle)).unwrap();
    assert_eq!(given.vehicle().name, "van");
    assert!(given.files().contains(&vehicle));
    assert_eq!(given.frame(0, EgoBody::Include).faces.len(), 24);
    std::fs::write(&scene, with("\"van.json\"")).unwrap();
    let named = Scene::read(&scene).unwrap();
    assert_eq!(named.vehicle(), given.vehicle());
    std::fs::write(&vehicle, VEHICLE.replace("\"name\": \"van\", ", "")).unwrap();
    assert_eq!(Scene::read(&scene).unwrap().vehicle().name, "van", "after its file");
}

#[test]
fn what_is_wrong_with_a_vehicle_is_said_with_its_place() {
    let cases = [
        (
            "\"sensors\": [\"solid\"]",
            "\"sensors\": [\"solud\"]",
            "mounts[1].sensors[0]: `solud` is not a sensor",
        ),
        ("\"sensors\": [\"solid\"]", "\"sensors\": []", "mounts[1].sensors: an empty list is not"),
        (
            "[[1, 1.05, 0.5], [-1, 1.05, 0.5], [-1, 1.05, 0.9], [1, 1.05, 0.9]]",
            "[]",
            "mounts[1].polygon: a list of 0",
        ),
        ("[-1, 1.05, 0.9], [1, 1.05, 0.9]]", "[-3, 1.05, 0.5]]", "its corners lie on a line"),
        ("[1, 1.05, 0.9]]", "[1, 1.25, 0.9]]", "of the plane of the others"),
        ("\"count\": 1", "\"count\": 17", "mounts[0].count: 17 is not a whole number from 0 to 16"),
        ("\"count\": [0, 2]", "\"count\": [3, 2]", "mounts[1].count: [3, 2] is not [least, most]"),
        ("\"count\": 1", "\"count\": \"two\"", "a number of sensors, 4 for example"),
        ("\"count\": 1", "\"cuont\": 1", "unknown key `cuont`"),
        ("\"phase\": 0.1", "\"phase\": [0.2, 0.1]", "sensors[1].phase: [0.2, 0.1] is not a range"),
        ("\"phase\": 0.1", "\"phase\": [-4, 4]", "sensors[1].phase: [-4.0, 4.0] is not a range"),
        ("\"phase\": 0.1", "\"phase\": [0, 1, 2]", "a range of them"),
        ("\"phase\": 0.1", "\"phase\": \"loose\"", "sensors[1].phase: \"loose\" is not \"free\""),
        ("\"price\": 900", "\"price\": -1", "sensors[0].price: -1 is not a price from 0 to 1e12"),
        ("\"name\": \"solid\"", "\"name\": \"spinning\"", "it is used twice"),
        (
            "\"name\": \"solid\"",
            "\"name\": \"\"",
            "sensors[1].name: \"\" is not the name of a sensor: give 1 to 64 printable characters",
        ),
        (
            "\"max\": [2, 3, 0.8]",
            "\"max\": [2, 1, 0.8]",
            "require[0].max[1]: 1 is not above min (1): the area would hold nothing",
        ),
        (
            "\"share\": 0.5",
            "\"share\": 0.5, \"without\": [{ \"min\": [0, 1, 0], \"max\": [1, 2, -1] }]",
            "require[0].without[0].max[2]: -1 is below min (0); are `min` and `max` swapped?",
        ),
        ("\"share\": 0.5", "\"share\": 2", "require[0].share: 2 is not a share"),
        ("\"offset\": [0, 0.1]", "\"offset\": [0.1, 0]", "mounts[1].offset"),
        (
            "\"min_distance\": 0.3",
            "\"symmetric\": true",
            "symmetric: true is not possible with `left`, which has no mirror image",
        ),
        (
            "\"count\": [0, 2] }],\n  \"min_distance\": 0.3",
            "\"count\": 2 }],\n  \"symmetric\": true",
            "possible with `left`, which has no mirror image at the plane y = 0",
        ),
        (
            "\"min_distance\": 0.3",
            "\"equal_height\": true",
            "equal_height: true is not possible with several mounts unless all are boxes, and `left`",
        ),
        (
            "\"mounts\": [",
            "\"equal_height\": true, \"mounts\": [{ \"name\": \"low\", \"min\": [1, 0, 0.5], \"max\": [1, 0, 0.6], \"count\": 1 },",
            "is not possible with several mounts unless all are boxes",
        ),
        ("\"azimuth\": [-40, 40]", "\"azimuth\": [-180, 180]", "azimuth"),
    ];
    for (from, to, wanted) in cases {
        let text = VEHICLE.replacen(from, to, 1);
        assert_ne!(text, VEHICLE, "{from}");
        assert_holds!(message(&with(&text)), wanted);
    }
    let cut = VEHICLE.find("\"mounts\"").unwrap();
    let end = VEHICLE.find("\"min_distance\"").unwrap();
    let none = format!("{}\"mounts\": [], {}", &VEHICLE[..cut], &VEHICLE[end..]);
    assert_holds!(message(&with(&none)), "mounts: a list of 0 is not");
    let cut = VEHICLE.find("\"sensors\"").unwrap();
    let bare = format!("{{ \"sightline\": 1, \"body\": [], {}", &VEHICLE[cut..]);
    let wanted = "vehicle.body: an empty list is not a list of shapes; leave `body` out to keep";
    assert_holds!(message(&with(&bare)), wanted);
    let mount = r#""mount": { "min": [0,0,2], "max": [0,0,2], "lidars": 1 }, "vehicle":"#;
    let both = with(VEHICLE).replacen("\"vehicle\":", mount, 1);
    assert_holds!(message(&both), "`mount` cannot stand here");
    assert_holds!(message(&full(BOX, "").replace("\"lidar\"", "\"x\"")), "unknown key");
    assert_holds!(message(&with("\"none.json\"")), "none.json: cannot be read");
    assert_holds!(message(&with("3")), "the name of a vehicle file, or a vehicle");
}

/// True if each LiDAR of a rig can have a place of its own; tries every order of the places.
fn can_be_seated(lidars: &[SensorPose], places: &[(&str, Vec<&str>)]) -> bool {
    let Some((first, rest)) = lidars.split_first() else { return true };
    (0..places.len()).any(|k| {
        let (mount, models) = &places[k];
        let is_there = if *mount == "low" { first.x <= 0.2 } else { first.x >= -0.2 };
        let mut others = places.to_vec();
        others.remove(k);
        is_there && models.contains(&first.sensor.as_str()) && can_be_seated(rest, &others)
    })
}

#[test]
fn every_model_that_a_mount_lists_may_stand_there_and_no_more_than_it_holds() {
    let vehicle = r#"{ "sightline": 1, "sensors": [
        { "name": "a", "lidar": { "channels": 4, "fov": [-20, 10], "azimuth_steps": 60, "range": 80 } },
        { "name": "b", "lidar": { "channels": 3, "fov": [-10, 10], "azimuth_steps": 21, "range": 30 } },
        { "name": "c", "lidar": { "channels": 2, "fov": [-10, 10], "azimuth_steps": 20, "range": 30 } }],
      "mounts": [
        { "name": "low", "min": [-1, 0, 2], "max": [0.2, 0, 2], "sensors": ["a", "b"], "count": [0, 2] },
        { "name": "high", "min": [-0.2, 0, 2], "max": [1, 0, 2], "sensors": ["c", "b"], "count": [0, 1] }] }"#;
    let scene = read(&with(vehicle)).unwrap();
    let rules = scene.rules();
    let low = || ("low", vec!["a", "b"]);
    let places = [low(), low(), ("high", vec!["c", "b"])];
    let kinds: Vec<SensorPose> = ["a", "b", "c"]
        .iter()
        .flat_map(|name| {
            let sensor = SensorName::new(name).unwrap();
            [-0.7, 0.0, 0.7].map(|x| SensorPose { sensor, ..SensorPose::at(x, 0.0, 2.0) })
        })
        .collect();
    let mut kept = [0; 2];
    // Rigs of one to four LiDARs, of three models at three places.
    for rig in 0..9_usize.pow(4) + 9_usize.pow(3) + 90 {
        let (count, number) = match rig {
            0..9 => (1, rig),
            9..90 => (2, rig - 9),
            90..819 => (3, rig - 90),
            _ => (4, rig - 819),
        };
        let lidars: Vec<SensorPose> =
            (0..count).map(|k| kinds[number / 9_usize.pow(k) % 9]).collect();
        let wanted = can_be_seated(&lidars, &places);
        let rig = Placement { name: "rig".into(), lidars };
        let broken = rules.violations(&rig);
        let is_seated = |v: &Violation| {
            use Violation::{NoPlace, NotTaken, OutsideMount};
            !matches!(v, NoPlace { .. } | OutsideMount { .. } | NotTaken { .. })
        };
        assert_eq!(broken.iter().all(is_seated), wanted, "{rig:?}: {broken:?}");
        kept[usize::from(wanted)] += 1;
    }
    assert!(kept[0] > 100 && kept[1] > 100, "{kept:?}");
    // A LiDAR on a mount that does not take it, or is full, is measured against no other mount.
    for (lidars, words) in [
        (vec![kinds[2]], "LiDAR 0: it stands on mount high, which takes `b` or `c`, not `a`"),
        (vec![kinds[5]; 2], "LiDAR 1: it stands on mount high, which holds 1 LiDAR at most"),
        (vec![kinds[8]; 2], "LiDAR 1: there is no mount for one more `c`"),
    ] {
        let broken = rules.violations(&Placement { name: "rig".into(), lidars });
        let broken: Vec<String> = broken.iter().map(ToString::to_string).collect();
        assert_eq!(broken, [words]);
    }
}

#[test]
fn the_scan_of_a_scene_reaches_as_far_as_the_farthest_sensor_in_any_order() {
    let scan_range = |vehicle: &str| {
        let scene = read(&with(vehicle)).unwrap();
        let PsogSource::Scan(scan) = scene.psog_source() else { panic!("scans") };
        assert_eq!(ScanSettings::default_of(&scene).range, scan.range);
        scan.range
    };
    assert_eq!(scan_range(VEHICLE), 80.0);
    assert_eq!(scan_range(&VEHICLE.replace("\"range\": 80", "\"range\": 20")), 30.0);
}

#[cfg(feature = "mesh")]
#[test]
fn a_mesh_that_is_listed_twice_is_doubted() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("b.obj"), "v 0 0 0.3\nv 1 0 0.3\nv 0 1 1\nf 1 2 3\n").unwrap();
    let mesh = |x: f64| {
        format!(
            r#"{{ "class": "vehicle", "mesh": {{ "file": "b.obj", "translate": [{x}, 0, 0] }} }}"#
        )
    };
    let notes = |second: f64| {
        let (own, rest) = VEHICLE.split_once("\"body\": [").unwrap();
        let rest = rest.split_once("],\n").unwrap().1;
        let text = with(&format!("{own}\"body\": [{}, {}],\n{rest}", mesh(0.0), mesh(second)));
        super::notes(&Scene::from_json(&text, dir.path(), "s.json").unwrap())
    };
    assert!(!notes(0.5).contains("is listed before"), "{}", notes(0.5));
    assert!(notes(0.0).contains("body[1].mesh: is listed before"), "{}", notes(0.0));
}

const PROFILE: &str = r#"{ "profile": { "scanType": "rotary", "nearRangeM": 0.5, "farRangeM": 120,
    "rangeAccuracyM": 0.03, "minReflectance": 0.1, "minReflectanceRange": 55, "scanRateBaseHz": 20,
    "reportRateBaseHz": 20480, "startAzimuthDeg": -45, "endAzimuthDeg": 45,
    "emitterStates": [{ "azimuthDeg": [0, 0], "elevationDeg": [-15, 15] }] } }"#;

/// A scene whose JSON holds `carrier`: its vehicle or its LiDAR.
fn scene(carrier: &str) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("p.json"), PROFILE).unwrap();
    let text = format!(
        r#"{{ "sightline": 1, "roi": {{ "min": [-4, -4, -1], "max": [4, 4, 3], "voxel": [1, 1, 1] }},
            "psog": {{ "file": "x.npz" }}, "coverage": "through", {carrier} }}"#
    );
    Scene::from_json(&text, dir.path(), "scene.json").unwrap()
}

fn in_scene(lidar: &str) -> Scene {
    scene(&format!(
        r#""lidar": {lidar}, "mount": {{ "min": [0, 0, 1], "max": [0, 0, 1], "lidars": 1 }}"#
    ))
}

fn on_vehicle(lidar: &str, response: &str) -> Scene {
    scene(&format!(
        r#""vehicle": {{ "sensors": [{{ "name": "a", "lidar": {lidar}{response} }}],
            "mounts": [{{ "name": "roof", "min": [0, 0, 1], "max": [0, 0, 1], "count": 1 }}] }}"#
    ))
}

fn notes(scene: &Scene) -> String {
    scene.notes().iter().map(|note| note.text().rsplit('/').next().unwrap()).collect()
}

fn response(scene: &Scene) -> Response {
    scene.sensors().unwrap().models()[0].response
}

#[test]
fn ranges_errors_and_windows_are_those_of_the_file() {
    let file = r#"{ "file": "p.json" }"#;
    for scene in [in_scene(file), on_vehicle(file, "")] {
        // 1024 columns a turn, every 0.3516 degrees: 128 on each side of the first one.
        let Lidar::Spinning { azimuth_steps, azimuth, range, .. } = scene.lidars()[0] else {
            panic!()
        };
        assert_eq!((*azimuth_steps, *azimuth, *range), (257, Some([-45.0, 45.0]), 120.0));
        let Response { rate, rated_range, noise, min_range, .. } = response(&scene);
        assert_eq!([rate, rated_range, noise, min_range], [20.0, 55.0, 0.03, 0.5]);
        assert!(notes(&scene).contains("from -45 to 45 degrees; only columns of this window"));
    }
}

#[test]
fn a_scene_that_says_otherwise_counts_and_is_told() {
    let given = r#"{ "file": "p.json", "range": 100, "azimuth_steps": 512 }"#;
    let response_given = r#", "response": { "noise": 0.01, "rate": 20 }"#;
    let scene = on_vehicle(given, response_given);
    let Lidar::Spinning { azimuth_steps, range, .. } = scene.lidars()[0] else { panic!() };
    assert_eq!((*azimuth_steps, *range), (129, 100.0));
    let Response { rated_range, noise, .. } = response(&scene);
    assert_eq!((rated_range, noise), (55.0, 0.01));
    let said = notes(&scene);
    for part in [
        "range: 100; the sensor file states 120.",
        "azimuth_steps: 512; the sensor file states 1024.",
        "noise: 0.01; the sensor file states 0.03.",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!said.contains("rate: "), "{said}");
    let turned = in_scene(r#"{ "file": "p.json", "azimuth": [-10, 10], "azimuth_steps": 21 }"#);
    let Lidar::Spinning { azimuth_steps, azimuth, .. } = turned.lidars()[0] else { panic!() };
    assert_eq!((*azimuth_steps, *azimuth), (21, Some([-10.0, 10.0])));
    assert!(notes(&turned).contains("azimuth: [-10.0, 10.0] degrees; the sensor file states"));
}
