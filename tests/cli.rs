//! The program driven as a user would: scores, hits, devices, verify; and scenes that other files share.

use std::io::BufReader;

use sightline::psog::{Psog, Roi, write_psog};

pub(crate) use crate::program::*;

/// A corridor of 10 × 2 × 1 voxels of a metre, seen along x by one beam; T = 4 frames of two classes.
///
/// Voxel (i, 0, 0) has index 2 i. Listed: index 4 (car in 1 of 4 frames), 6 (car in 2, pole in 1),
/// 7 (pole in 2: the other row, never covered), 12 (car in all four).
pub(crate) fn corridor() -> TempDir {
    let dir = TempDir::new().unwrap();
    let roi = Roi::new([0.0, 0.0, 0.0], [1.0; 3], [10, 2, 1]).unwrap();
    let counts = vec![1, 0, 2, 1, 0, 2, 4, 0];
    let classes = vec!["car".to_owned(), "pole".to_owned()];
    let psog = Psog::new(roi, 4, classes, vec![4, 6, 7, 12], counts).unwrap();
    let file = fs::File::create(dir.path().join("corridor.psog.npz")).unwrap();
    write_psog(file, &psog).unwrap();
    write(&dir, "scene.json", &scene());
    let placements = json!({ "placements": [
        { "name": "ahead", "lidars": [{ "x": 0.5, "y": 0.5, "z": 0.5 }] },
        { "name": "twice", "lidars": [{ "x": 0.5, "y": 0.5, "z": 0.5 }, { "x": 0.5, "y": 0.5, "z": 0.5 }] },
        { "name": "away", "lidars": [{ "x": -1.0, "y": 0.5, "z": 0.5, "yaw": std::f64::consts::PI }] },
    ]});
    write(&dir, "placements.json", &placements);
    dir
}

pub(crate) fn scene() -> Value {
    json!({
        "sightline": 1, "name": "corridor",
        "roi": { "min": [0, 0, 0], "max": [10, 2, 1], "voxel": [1, 1, 1] },
        "psog": { "file": "corridor.psog.npz" },
        "lidar": { "channels": 1, "fov": [0, 0], "azimuth_steps": 1, "range": 100 },
        "mount": { "min": [0.1, 0.1, 0.1], "max": [0.9, 1.9, 0.9], "roll": [0, 0],
                   "min_distance": 0.0, "lidars": 1 },
        "coverage": "through"
    })
}

#[test]
fn scores_of_a_corridor_worked_out_by_hand() {
    let dir = corridor();
    let p = |n: f64| if n == 0.0 { 0.0 } else { -(n / 4.0) * (n / 4.0).ln() };
    // Along the row: 10 voxels. H: {1, empty 3}, {2, 1, empty 1}, {4}. Bernoulli: 1/4, 3/4, 1.
    let gain = (p(1.0) + p(3.0)) + (p(2.0) + p(1.0) + p(1.0)) + 0.0;
    let bernoulli = 2.0 * (p(1.0) + p(3.0));
    let total = gain + p(2.0) + p(2.0);
    for backend in ["cpu", "gpu"] {
        let args = ["score", "scene.json", "placements.json", "--backend", backend];
        let answer = ok(&dir, &args);
        assert_eq!(answer["scene"], "corridor");
        assert_eq!(answer["backend"], backend);
        assert_eq!(answer["coverage"], "through");
        assert_eq!(answer["frames"], 1);
        for key in ["load", "build", "cast", "cover", "reduce", "total"] {
            assert!(answer["timings"][key].number() >= 0.0, "{key}");
        }
        let ahead = &answer["scores"][0];
        assert_eq!(ahead["name"], "ahead");
        let close = |key: &str, want: f64| {
            let got = ahead[key].number();
            assert!((got - want).abs() <= 1e-6 * want.abs(), "{key}: {got} is not {want}");
        };
        close("information_gain", gain);
        close("entropy_sum", gain);
        close("information_gain_share", gain / total);
        close("m_sog", -gain / 10.0);
        close("m_sog_scaled", -gain / 100.0);
        // Without ground and within 10 m all information counts alike.
        close("near_gain", gain / total);
        close("s_mig", -bernoulli);
        assert_eq!((&ahead["covered"], &ahead["covered_nonzero"]), (&json!(10), &json!(3)));
        assert_eq!(ahead["covered_by_class"], json!({ "car": 3, "pole": 1 }));
        // The target is the P-SOG's `car`; all others together are its `pole`.
        let detection = ahead["detection"]["information_gain"].number();
        assert!((detection - gain).abs() <= 1e-6 * gain, "{detection} is not {gain}");
        assert_eq!(ahead["beams"], 1);
        assert!(ahead["hit_share"].is_null());
        assert_eq!(ahead["guards"], json!([]));
        // One pose twice covers as much, and each LiDAR is redundant.
        let twice = &answer["scores"][1];
        assert_eq!((&twice["covered"], &twice["beams"]), (&json!(10), &json!(2)));
        assert_eq!(twice["guards"].list().len(), 2);
        // A placement that looks away covers nothing: no number, but a reason.
        let away = &answer["scores"][2];
        assert!(away["m_sog_scaled"].is_null() && away["information_gain"].is_null());
        assert!(away["guards"][0].text().starts_with("covers_nothing"));
    }
}

#[test]
fn covered_voxels_are_written_as_numpy_arrays() {
    let dir = corridor();
    ok(&dir, "score scene.json placements.json --coverage-out cover");
    for (file, want) in
        [("cover/ahead.npy", (0..10).map(|i| 2 * i).collect()), ("cover/away.npy", vec![])]
    {
        let bytes = fs::read(dir.path().join(file)).unwrap();
        let covered: Vec<u64> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
        assert_eq!(covered, want, "{file}");
    }
}

#[test]
fn a_stream_of_placements_gives_the_scores_of_a_document() {
    let dir = corridor();
    let lines: Vec<String> = (0..3000)
        .map(|i| {
            let y = 0.1 + 1.8 * f64::from(i) / 3000.0;
            json!({ "name": format!("p{i}"), "lidars": [{ "x": 0.2, "y": y, "z": 0.5 }] })
                .to_string()
        })
        .collect();
    fs::write(dir.path().join("many.jsonl"), lines.join("\n")).unwrap();
    let document = format!("{{\"placements\": [{}]}}", lines.join(","));
    fs::write(dir.path().join("many.json"), document).unwrap();
    let score = |file: &str| ok(&dir, &["score", "scene.json", file, "--backend", "cpu"]);
    let (stream, document) = (score("many.jsonl"), score("many.json"));
    assert_eq!(stream["scores"].list().len(), 3000);
    assert_eq!(stream["scores"], document["scores"]);
    assert_eq!(stream["scores"][2999]["name"], "p2999");
}

#[test]
fn devices_names_the_one_that_auto_takes() {
    let dir = TempDir::new().unwrap();
    let answer = ok(&dir, "devices");
    let devices = answer["devices"].list();
    let hardware = devices.iter().filter(|d| d["kind"] != "software").count();
    let taken = || devices.iter().filter(|d| d["auto"] == true);
    assert_eq!(taken().count(), hardware.min(1), "{answer}");
    assert!(taken().all(|d| d["kind"] != "software"), "{answer}");
    assert!(devices[0]["max_binding"].as_u64().unwrap() >= 128 << 20);
    for device in devices {
        let test = &device["self_test"];
        assert_eq!((&test["passed"], &test["wrong"]), (&true.into(), &0.into()), "{device}");
        assert!(device["refused"].is_null() && test["cases"].as_u64() > Some(50_000), "{device}");
    }
}

/// A room of 8 × 6 m with a pillar: a full-form scene small enough for many generations.
pub(crate) fn room(dir: &Path) -> PathBuf {
    let scene = json!({
        "sightline": 1, "name": "room",
        "roi": { "min": [-4, -3, 0], "max": [4, 3, 3], "voxel": [0.5, 0.5, 0.5] },
        "psog": { "scan": { "channels": 24, "fov": [-60, 40], "azimuth_steps": 120 } },
        "lidar": { "channels": 8, "fov": [-30, 10], "azimuth_steps": 60, "range": 20 },
        "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 2 },
        "coverage": "first-hit", "frames": 3,
        "static": [
            { "class": "ground", "plane": { "min": [-4, -3], "max": [4, 3], "z": 0.1 } },
            { "class": "wall", "box": { "center": [3.9, 0, 1.5], "size": [0.2, 6, 3] } },
            { "class": "wall", "box": { "center": [-3.9, 0, 1.5], "size": [0.2, 6, 3] } },
        ],
        "actors": [
            { "name": "walker", "parts": [
                { "class": "pedestrian", "box": { "center": [0, 0, 0.9], "size": [0.5, 0.5, 1.8] } }],
              "poses": [{ "x": 2, "y": -1 }, { "x": 2, "y": 0 }, { "x": 2, "y": 1 }] }
        ]
    });
    let path = dir.join("room.json");
    fs::write(&path, scene.to_string()).unwrap();
    path
}

/// A folder with the room alone.
pub(crate) fn in_room() -> TempDir {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    dir
}

#[test]
fn hits_of_a_room_are_where_its_walls_are() {
    let dir = in_room();
    write_rig(&dir, "p.json", "middle", json!([{ "x": 0, "y": 0.75, "z": 1.5 }]));
    for backend in ["cpu", "gpu"] {
        let args =
            format!("cast --force room.json p.json --frame 1 --out hits.npz --backend {backend}");
        let answer = ok(&dir, &args);
        assert_eq!(answer["beams"], 480);
        let file = fs::File::open(dir.path().join("hits.npz")).unwrap();
        let mut npz = zip::ZipArchive::new(BufReader::new(file)).unwrap();
        let distance: Vec<f32> = array(&mut npz, "distance");
        let direction: Vec<f32> = array(&mut npz, "direction");
        let triangle: Vec<u32> = array(&mut npz, "triangle");
        let class: Vec<u16> = array(&mut npz, "class");
        let face_class: Vec<u16> = array(&mut npz, "face_class");
        let lidar: Vec<u16> = array(&mut npz, "lidar");
        assert_eq!((distance.len(), direction.len(), lidar.len()), (480, 1440, 480));
        // Channel 0 points 30° down: straight ahead it meets the ground, 1.4 m below, after 2.8 m.
        assert!((distance[0] - 2.8).abs() < 1e-5, "{}", distance[0]);
        // Channel 6 of 8 rises by 30/7°… the wall stands 3.8 m ahead and behind.
        let beam = 6 * 60;
        let up = (-30.0_f32 + 6.0 * 40.0 / 7.0).to_radians();
        assert!((distance[beam] - 3.8 / up.cos()).abs() < 1e-5, "{}", distance[beam]);
        assert!((distance[beam + 30] - 3.8 / up.cos()).abs() < 1e-5, "{}", distance[beam + 30]);
        // To the left the room is open.
        assert_eq!((distance[beam + 15], triangle[beam + 15]), (f32::INFINITY, u32::MAX));
        assert_eq!(class[beam], face_class[triangle[beam] as usize]);
    }
}

#[test]
fn verify_passes_on_a_room_and_says_what_it_compared() {
    let dir = in_room();
    let args = "verify room.json --frames 2 --random 20 --sample 3000";
    let answer = ok(&dir, args);
    assert_eq!(answer["passed"], true, "{answer}");
    assert_eq!((&answer["placements"], &answer["frames"]), (&json!(81), &json!(2)));
    let found = &answer["gpu_against_cpu"];
    assert!(found["beams"].as_u64().unwrap() > 100_000, "{found}");
    assert!(found["voxels"].as_u64().unwrap() > 50_000, "{found}");
    for key in ["triangles", "distances", "differing_voxels", "differing_scores"] {
        assert_eq!(found[key], 0, "{key}");
    }
    assert_eq!(answer["cpu_against_f64"]["beams"], 3000);
    assert_eq!(answer["cpu_against_f64"]["unexplained"], 0);
    assert!(answer.get("conditions").is_none());
    let fog = &(args, "--hostile 0 --condition fog:mor=5");
    let foggy = ok(&dir, fog);
    assert_eq!((&foggy["passed"], &foggy["conditions"]), (&json!(true), &json!(["fog:mor=5"])));
    let clear = ok(&dir, &(args, "--hostile 0"));
    let covered = |answer: &Value| answer["gpu_against_cpu"]["voxels"].as_u64().unwrap();
    assert!(0 < covered(&foggy) && covered(&foggy) < covered(&clear));
    let [text, said] = printed(&dir, fog);
    text.says("under fog:mor=5");
    // A comparison takes a minute on a scene of many frames: its size is said before.
    said.says(" placements × 2 frames on ");
    said.says(" with the CPU, then 3000 beams with f64\n");
}

#[test]
fn audit_catches_what_games_the_scores() {
    let dir = in_room();
    let placements = json!({ "placements": [
        { "name": "a", "lidars": [{ "x": 0.5, "y": 0.5, "z": 1.6 }, { "x": -0.5, "y": -0.5, "z": 1.6, "roll": 0.2 }] },
        { "name": "b", "lidars": [{ "x": 0.2, "y": 0.1, "z": 1.3 }, { "x": -0.2, "y": -0.5, "z": 1.8, "roll": 0.1 }] },
        { "name": "c", "lidars": [{ "x": 0.0, "y": 0.3, "z": 1.4 }, { "x": 0.0, "y": -0.3, "z": 1.5 }] },
    ]});
    write(&dir, "p.json", &placements);
    let (code, answer, plain) = answer(&dir, "audit room.json p.json");
    let passed = answer["passed"].as_bool().unwrap();
    assert_eq!(code, Some(i32::from(!passed)), "{answer}");
    let trials = answer["trials"].list();
    assert_eq!(trials.len(), 12);
    let named = |name: &str| trials.iter().find(|t| t["name"] == name).unwrap();
    let guards = |name: &str| named(name)["scores"]["guards"].to_string();
    assert!(guards("all sensors in one pose").contains("redundant_lidar"));
    assert!(guards("one useless sensor more").contains("redundant_lidar"));
    // In a room of 8 m nothing is beyond 20 m.
    assert!(!guards("visibility cut to 20 m").contains("short_sight"));
    let changes = answer["stability"].list();
    assert_eq!(changes.len(), 9, "{changes:?}");
    assert_eq!(changes[8]["change"], "azimuth phases free, not in step");
    for change in changes {
        assert!(change["worst_relative_change"].number() >= 0.0);
        assert!(change.get("ranking_against_mean_height").is_some());

        assert!(change["base"]["m_sog"].is_number(), "{change}");
        assert!(["a", "b", "c"].contains(&change["first"].text()));
    }
    let tau = |of: &Value, key: &str| of[key].as_f64();
    let taus = changes.iter().map(|of| (tau(of, "kendall_tau"), tau(of, "median_kendall_tau")));
    let taus: Vec<(f64, f64)> = taus.filter_map(|(worst, median)| worst.zip(median)).collect();
    assert!(taus.len() > 4 && taus.iter().all(|(worst, median)| worst <= median), "{changes:?}");
    let (_, [text, told]) = ran(&dir, "audit room.json p.json --format text --frames 5");
    let words = "--frames 5: the scene has 3; all of them are used";
    assert_eq!([plain, told].map(|note| note.contains(words)), [false, true]);

    for title in ["S-MIG", "τ median", "τ worst", "height", "first"] {
        assert!(text.contains(title), "no column {title}: {text}");
    }
}

/// Level ground, a walker that comes and goes, and a vehicle of 4 × 2 × 1.5 m.
pub(crate) fn level_yard(lidar: Value, mount: Value) -> Value {
    json!({
        "sightline": 1, "name": "yard", "frames": 3, "coverage": "first-hit", "lidar": lidar, "mount": mount,
        "roi": { "min": [-12, -12, -0.4], "max": [12, 12, 2.8], "voxel": [0.4, 0.4, 0.4] },
        "static": [{ "class": "road", "plane": { "min": [-40, -40], "max": [40, 40], "z": 0 } }],
        "actors": [{ "name": "walker", "poses": [{ "x": 5, "y": 3 }, { "x": 5, "y": 5 }, { "x": -6, "y": 3 }],
            "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.5, 1.8] } }] }],
        "ego": { "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [4, 2, 1.5] } }] },
    })
}

/// `cart.json`: a cart with a LiDAR on its roof, `roof` of them, and up to three that look sideways at its edge; these with
/// their table and the range of their heights in metres.
pub(crate) fn cart(dir: &Path, (side, heights): (Value, [f64; 2]), roof: Value, require: Value) {
    let [low, high] = heights;
    let vehicle = json!({ "sightline": 1, "name": "cart",
        "body": [{ "class": "vehicle", "box": { "min": [-2, -0.9, 0], "max": [1.5, 0.9, 1.4] } }],
        "sensors": [
            { "name": "wide", "price": 3, "phase": 0, "lidar": { "channels": 24, "fov": [-40, 0],
                "azimuth_steps": 180, "range": 60 } },
            { "name": "side", "price": 1, "lidar": side }],
        "mounts": [
            { "name": "roof", "sensors": ["wide"], "min": [-1.5, -0.8, 1.5], "max": [1, 0.8, 2.2], "count": roof },
            { "name": "edge", "sensors": ["side"], "min": [-2, -0.9, low], "max": [1.5, 0.9, high],
              "yaw": [-3.15, 3.15], "count": [0, 3] }],
        "require": require });
    write(dir, "cart.json", &vehicle);
}

/// `yard.json`: things that stand around a cart, and a walker who moves over three frames.
pub(crate) fn yard_of(dir: &Path, things: Value) {
    let scene = json!({ "sightline": 1, "name": "yard", "vehicle": "cart.json", "frames": 3,
        "roi": { "min": [-14, -14, -0.4], "max": [14, 14, 2.8], "voxel": [0.4, 0.4, 0.4] },
        "static": things,
        "actors": [{ "name": "walker",
            "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.6, 1.8] } }],
            "poses": [{ "x": 4, "y": 2 }, { "x": 3, "y": 2.5 }, { "x": -4, "y": 0 }] }] });
    write(dir, "yard.json", &scene);
}
