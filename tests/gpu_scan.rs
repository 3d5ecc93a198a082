//! Scans whose rays a device casts: the bytes of those of the host, whatever moves and whatever the beams are.

use sightline::engine::{EngineChoice, EngineKind};
use sightline::scan::{Scanner, Scanning, Status};
use sightline::{Placement, Scene, SensorPose, read_placements};

/// Beams with a width, so that rims at edges are cast too.
const RESPONSE: &str = r#"{ "divergence": [0.01, 0.006], "echoes": "dual" }"#;

/// Houses, poles and a car beside a road; the ego goes `way` metres a frame.
fn scene(lidar: &str, way: f64) -> Scene {
    let poles: Vec<String> = (-12..12)
        .map(|k| {
            let (x, y) = (2.5 * f64::from(k), if k % 2 == 0 { 5.5 } else { -6.0 });
            format!(
                r#"{{ "class": "pole", "cylinder": {{ "foot": [{x}, {y}, 0], "radius": 0.15, "height": 4, "sides": 8 }} }}"#
            )
        })
        .collect();
    let text = format!(
        r#"{{ "sightline": 1, "name": "gpu-scan", "rate": 5, "frames": 2, "coverage": "first-hit",
             "roi": {{ "min": [-40, -40, -1], "max": [40, 40, 5], "voxel": [1, 1, 1] }},
             "vehicle": {{ "sensors": [{{ "name": "s", "lidar": {lidar}, "response": {RESPONSE} }}],
                           "mounts": [{{ "name": "roof", "min": [-1, -1, 0], "max": [1, 1, 3], "count": [1, 4] }}] }},
             "static": [ {{ "class": "road", "plane": {{ "min": [-60, -5], "max": [60, 5], "z": 0 }} }},
                         {{ "class": "building", "box": {{ "min": [-30, 8, 0], "max": [40, 20, 6] }} }}, {} ],
             "actors": [{{ "name": "car",
                 "parts": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0.2], "size": [4.2, 1.8, 1.4] }} }}],
                 "poses": [{{ "x": 9, "y": 2 }}, {{ "x": {}, "y": 2, "yaw": 0.1 }}] }}],
             "ego": {{ "body": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0.3], "size": [4, 1.8, 1.3] }} }}],
                       "poses": [{{ "x": 0, "y": -2.5 }}, {{ "x": {way}, "y": -2.4 }}] }} }}"#,
        poles.join(", "),
        9.0 - way,
    );
    Scene::from_json(&text, "".as_ref(), "gpu-scan").unwrap()
}

fn four() -> Placement {
    let pose = |k: i32| {
        let k = f64::from(k);
        SensorPose { roll: 0.1 * k, yaw: k, ..SensorPose::at(0.4 - 0.3 * k, 0.2 * k - 0.3, 2.2) }
    };
    Placement { name: "four".into(), lidars: (0..4).map(pose).collect() }
}

/// Scans of all frames, as text, by the host or a device; and how many beams came back twice.
fn scans(scene: &Scene, placement: &Placement, kind: EngineKind, ideal: bool) -> (String, usize) {
    let scanning = Scanning { ideal, ..Scanning::default() };
    let mut scanner = Scanner::new(scene, placement, &scanning).unwrap();
    let choice = EngineChoice { kind, ..EngineChoice::default() };
    let notes = scanner.cast_on(&choice).unwrap();
    assert_eq!(usize::from(notes.is_some()), usize::from(kind != EngineKind::Cpu), "{notes:?}");
    let scans: Vec<_> = scanner.scans().collect();
    assert_eq!(scanner.device_failure(), None);
    let returns = scans.iter().flat_map(|scan| &scan.returns);
    let second = returns.filter(|found| found.status == Status::Second).count();
    let numbers: Vec<_> = scans.iter().map(|scan| (&scan.returns, &scan.boxes)).collect();
    (format!("{numbers:?}"), second)
}

#[test]
fn the_bytes_are_those_of_the_host() {
    let directions: Vec<String> = (0..1500)
        .map(|k| {
            let (azimuth, z) = (f64::from(k) * 0.71, -0.5 + f64::from(k % 97) / 140.0);
            let across = (1.0 - z * z).sqrt();
            format!("[{}, {}, {z}]", across * azimuth.cos(), across * azimuth.sin())
        })
        .collect();
    let spinning = |channels: u32| {
        format!(
            r#"{{ "channels": {channels}, "fov": [-25, 10], "azimuth_steps": 120, "range": 60 }}"#
        )
    };
    let list = format!(r#"{{ "directions": [{}], "range": 60 }}"#, directions.join(", "));
    for (lidar, way) in [
        (spinning(12), 2.0),
        // With so many channels, the beams of a column go down the host's trees together.
        (spinning(40), 2.0),
        (spinning(12), 0.0),
        (list, 2.0),
    ] {
        let scene = scene(&lidar, way);
        for ideal in [false, true] {
            let (host, second) = scans(&scene, &four(), EngineKind::Cpu, ideal);
            let (device, _) = scans(&scene, &four(), EngineKind::Gpu, ideal);
            assert!(ideal || second > 20, "only {second} rims see two surfaces");
            assert!(host == device, "{way} m a frame, ideal {ideal}: {lidar:.60}");
        }
    }
}

#[test]
fn an_own_scene_too() {
    let scene = Scene::read("scenes/urban-crossing.json").unwrap();
    let placements = read_placements("scenes/placements.json").unwrap();
    let scanner = Scanner::new(&scene, &placements[0], &Scanning::default()).unwrap();
    let mut by_device = Scanner::new(&scene, &placements[0], &Scanning::default()).unwrap();
    let choice = EngineChoice { kind: EngineKind::Gpu, ..EngineChoice::default() };
    by_device.cast_on(&choice).unwrap();
    for frame in [0, 17] {
        let [host, device] = [&scanner, &by_device].map(|scanner| scanner.scan(frame));
        assert!(host.points().count() > 5000);
        assert_eq!(format!("{:?}", host.returns), format!("{:?}", device.returns));
    }
    assert_eq!(by_device.device_failure(), None);
}
