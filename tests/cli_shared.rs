//! `study redundancy` and `study overlap` against counts by hand, from outside.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use sightline::scene::Target;
use sightline::shared::{LEAST_SHARED, REDUNDANCY_TARGETS, redundancy_question};
use sightline::{EngineChoice, Job, Scene, read_placements};

use crate::cli::*;

/// Classes of the yard by id.
const CLASSES: [&str; 4] = ["road", "wall", "thing", "vehicle"];
/// Half length and half width of the own body, metres.
const BODY: [f64; 2] = [2.0, 0.9];

/// A road between two walls, something that comes nearer, and a vehicle with LiDARs of two models.
pub(crate) fn yard() -> TempDir {
    let dir = TempDir::new().unwrap();
    let write = |name: &str, value: &Value| fs::write(dir.path().join(name), value.to_string());
    let [x, y] = BODY;
    let body = json!([{ "class": "vehicle", "box": { "min": [-x, -y, 0.2], "max": [x, y, 1.6] } }]);
    let vehicle = json!({ "sightline": 1, "name": "cart", "body": body, "sensors": [
        { "name": "wide", "price": 2, "phase": 0,
          "lidar": { "channels": 24, "fov": [-40, 5], "azimuth_steps": 240, "range": 60 } },
        { "name": "front", "price": 1,
          "lidar": { "channels": 16, "fov": [-25, 5], "azimuth": [-60, 60], "azimuth_steps": 121, "range": 60 } }],
        "mounts": [{ "name": "roof", "min": [-2.2, -1, 0.5], "max": [2.2, 1, 2.5], "pitch": [-0.3, 0.3],
            "yaw": [-3.2, 3.2], "sensors": ["wide", "front"], "count": 4 }] });
    write("cart.json", &vehicle).unwrap();
    let lidars = json!([
        { "x": 0.5, "y": 0.5, "z": 1.9, "sensor": "wide" },
        { "x": -0.6, "y": -0.4, "z": 2.0, "pitch": 0.1, "sensor": "wide" },
        { "x": 2.1, "y": 0, "z": 1.0, "sensor": "front" },
        { "x": -2.1, "y": 0, "z": 1.0, "yaw": PI, "sensor": "front" }]);
    let alone = |k: usize| json!({ "name": format!("l{k}"), "lidars": [lidars[k]] });
    let fronts = json!({ "name": "fronts", "lidars": [lidars[2], lidars[3]] });
    let rigs = json!({ "placements": [{ "name": "four", "lidars": lidars }, fronts] });
    write("rigs.json", &rigs).unwrap();
    let each: Vec<Value> = (0..4).map(alone).collect();
    write("each.json", &json!({ "placements": each })).unwrap();
    for (name, far) in [("yard", 16.0), ("other", 12.0)] {
        let actor = json!({ "name": "box", "poses": [{ "x": 40, "y": 2 }, { "x": far, "y": 1 }, { "x": far, "y": 1 }],
            "parts": [{ "class": "thing", "box": { "foot": [0, 0, 0], "size": [1, 2, 2] } }] });
        let scene = json!({ "sightline": 1, "name": name, "frames": 3, "coverage": "first-hit", "classes": CLASSES,
            "vehicle": "cart.json", "psog": { "scan": { "window": 2, "stride": 1 } },
            "roi": { "min": [-16, -16, -0.3], "max": [16, 16, 3.3], "voxel": [0.4, 0.4, 0.4] },
            "static": [
                { "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } },
                { "class": "wall", "box": { "min": [-40, 13.13, 0], "max": [40, 14, 4] } },
                { "class": "wall", "box": { "min": [-40, -14, 0], "max": [40, -13.13, 4] } }],
            "actors": [actor] });
        write(&format!("{name}.json"), &scene).unwrap();
    }
    dir
}

/// Middles of the cells on the ground within 10 m of a box in plan around the origin, and their distance from it.
pub(crate) fn cells(half: [f64; 2]) -> Vec<([f64; 2], f64)> {
    let grid = (-60..60).flat_map(|i| (-60..60).map(move |j| [i, j]));
    let middles = grid.map(|place| place.map(|k| 0.25 * f64::from(k) + 0.125));
    let beyond = |v: f64, half: f64| (v.abs() - half).max(0.0);
    let all = middles.map(|[x, y]| ([x, y], beyond(x, half[0]).hypot(beyond(y, half[1]))));
    all.filter(|(_, distance)| *distance > 0.0 && *distance <= 10.0).collect()
}

fn study(dir: &Path, kind: &str, more: &str) -> Value {
    ok(dir, &format!("study {kind} yard.json rigs.json --backend cpu {more}"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.list().iter().map(|v| v.number()).collect()
}

/// One beam that hits a surface: its LiDAR, its class, its end and a point a millimetre behind it.
struct End {
    lidar: usize,
    class: u16,
    at: [f64; 3],
    behind: [f64; 3],
}

/// Ends of the beams of `four` in a frame, as `cast` writes them.
fn ends(dir: &Path, frame: usize) -> Vec<End> {
    let out = format!("hits{frame}.npz");
    if !dir.join(&out).exists() {
        ok(dir, &format!("cast yard.json rigs.json --backend cpu --frame {frame} --out {out}"));
    }
    let mut npz = zip::ZipArchive::new(fs::File::open(dir.join(&out)).unwrap()).unwrap();
    let [origin, direction] = ["origin", "direction"].map(|name| array::<f32>(&mut npz, name));
    let distance: Vec<f32> = array(&mut npz, "distance");
    let (class, lidar): (Vec<u16>, Vec<u16>) = (array(&mut npz, "class"), array(&mut npz, "lidar"));
    let placement: Vec<u32> = array(&mut npz, "placement");
    let beams = (0..distance.len()).filter(|&b| placement[b] == 0 && distance[b].is_finite());
    let along = |b: usize, more: f64| {
        std::array::from_fn(|k| {
            let (o, d) = (f64::from(origin[3 * b + k]), f64::from(direction[3 * b + k]));
            o + d * (f64::from(distance[b]) + more)
        })
    };
    let end = |b: usize| {
        let (lidar, class) = (usize::from(lidar[b]), class[b]);
        End { lidar, class, at: along(b, 0.0), behind: along(b, 1e-3) }
    };
    beams.map(end).collect()
}

#[test]
fn voxels_seen_by_several_are_those_of_each_lidar_alone() {
    let dir = yard();
    let found = study(dir.path(), "redundancy", "--frames 1");
    ok(&dir, &("score yard.json each.json --backend cpu --frames 1", "--coverage-out each"));
    let mut seen: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    for lidar in 0..4 {
        let bytes = fs::read(dir.path().join(format!("each/l{lidar}.npy"))).unwrap();
        let covered: Vec<u64> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
        covered.into_iter().for_each(|voxel| seen.entry(voxel).or_default().push(lidar));
    }
    let psog = sightline(&dir, "psog build yard.json --out yard.psog.npz");
    assert!(psog.status.success());
    let file = fs::File::open(dir.path().join("yard.psog.npz")).unwrap();
    let occupied: Vec<u64> = array(&mut zip::ZipArchive::new(file).unwrap(), "index");
    let all: Vec<u64> = (0..80 * 80 * 9).collect();
    for (key, voxels) in [("occupied", occupied), ("voxels", all)] {
        let (mut by, mut alone) = ([0_u64; 4], [0_u64; 2]);
        for voxel in &voxels {
            let seers = seen.get(voxel).cloned().unwrap_or_default();
            by[seers.len().min(3)] += 1;
            let models: BTreeSet<usize> = seers.iter().map(|lidar| lidar / 2).collect();
            if models.len() == 1 {
                alone[*models.first().unwrap()] += 1;
            }
        }
        let one = &found["rows"][0][key];
        assert_eq!(one["all"], voxels.len() as f64, "{key}");
        assert_eq!(numbers(&one["by"]), by.map(|n| n as f64), "{key}");
        assert!(by.iter().chain(&alone).all(|n| *n > 20), "{key}: {by:?} {alone:?}");
        for (k, model) in ["wide", "front"].into_iter().enumerate() {
            let of = &one["alone"][k];
            assert_eq!(
                (&of["sensor"], of["count"].as_f64()),
                (&json!(model), Some(alone[k] as f64))
            );
        }
    }
    // Both LiDARs of the second rig are of one model.
    assert!(found["rows"][1]["voxels"].get("alone").is_none());
}

#[test]
fn one_word_has_one_number_in_every_study() {
    let dir = yard();
    let clear = numbers_agree(dir.path(), "");
    let fog = numbers_agree(dir.path(), "--condition fog:mor=40");
    assert!(clear[0] < 60.0 && fog[0] > 80.0, "places without a car: {clear:?} {fog:?}");
}

/// Compares the studies in some weather; places of a car by the number of LiDARs of the first rig that see it.
fn numbers_agree(dir: &Path, weather: &str) -> [f64; 4] {
    let found = study(dir, "redundancy", weather);
    let args = "yard.json rigs.json --backend cpu";
    let near = ok(dir, &("study nearfield", args, weather));
    let scores = ok(dir, &("score", args, weather));
    let mut of_car = [0.0; 4];
    let places = "--target car --target tyre --distances 5,10,15,20,25,30,35,40,45,50";
    let targets = ok(dir, &("study targets rigs.json --vehicle cart.json", places, weather));
    for (k, row) in found["rows"].list().iter().enumerate() {
        let (near, scores) = (&near["near_fields"][k], &scores["scores"][k]);
        let is = |seen: &Value, share: &Value| {
            let not_seen = seen["share"][0].number();
            assert!((1.0 - not_seen - share.number()).abs() < 1e-12, "{seen} {share}");
        };
        is(&row["ground_10m"], &near["near_field"]);
        is(&row["ground_3m"], &near["ring"]);
        let covered = |seen: &Value| seen["all"].number() - seen["by"][0].number();
        for (part, score) in [("voxels", "covered"), ("occupied", "covered_nonzero")] {
            let wanted = scores[score].number();
            assert!((covered(&row[part]) - wanted).abs() < 1e-9 * wanted, "{part}");
        }
        for target in ["car", "tyre"] {
            let mut by = [0.0; 4];
            let of = |place: &&Value| {
                place["placement"] == row["placement"] && place["target"] == target
            };
            for place in targets["rows"].list().iter().filter(of) {
                if place["overlaps"] != true {
                    let seers =
                        numbers(&place["by_lidar"]).into_iter().filter(|beams| *beams >= 5.0);
                    by[seers.count().min(3)] += 1.0;
                }
            }
            let of = |of: &&Value| of["target"] == target;
            let seen = row["targets"].list().iter().find(of).unwrap();
            assert_eq!(numbers(&seen["by"]), by, "{target}");
            assert!(by[0] + by[1] + by[2] + by[3] > 140.0, "{by:?}");
            if (k, target) == (0, "car") {
                of_car = by;
            }
        }
        let names: Vec<&Value> = row["targets"].list().iter().map(|of| &of["target"]).collect();
        assert_eq!(json!(names), json!(["car", "adult", "child", "tyre"]));
    }
    of_car
}

#[test]
fn ground_seen_by_several_is_that_of_the_ends_of_beams() {
    let dir = yard();
    let found = study(dir.path(), "redundancy", "--frames 1");
    let on_road: Vec<End> = ends(dir.path(), 0)
        .into_iter()
        .filter(|end| CLASSES[usize::from(end.class)] == "road")
        .collect();
    for (key, within) in [("ground_3m", 3.0), ("ground_10m", 10.0)] {
        let mut by = [0.0; 4];
        for ([x, y], _) in cells(BODY).into_iter().filter(|(_, distance)| *distance <= within) {
            let near = on_road.iter().filter(|end| (end.at[0] - x).hypot(end.at[1] - y) <= 0.5);
            let seers: BTreeSet<usize> = near.map(|end| end.lidar).collect();
            by[seers.len().min(3)] += 1.0;
        }
        let seen = numbers(&found["rows"][0][key]["by"]);
        // A hit on the border of half a metre is rounded to either side.
        let off = seen.iter().zip(by).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off <= 2.0 && by[..3].iter().all(|n| *n > 10.0), "{key}: {seen:?} {by:?}");
    }
}

#[test]
fn shared_surfaces_are_voxels_in_which_both_have_a_hit() {
    let dir = yard();
    let found = study(dir.path(), "overlap", "");
    let mut sums = [[0.0; 4]; 4];
    for frame in 0..3 {
        let mut voxels = [(); 4].map(|()| BTreeSet::new());
        for end in ends(dir.path(), frame)
            .into_iter()
            .filter(|end| CLASSES[usize::from(end.class)] != "vehicle")
        {
            let place: [f64; 3] =
                std::array::from_fn(|k| (end.behind[k] - [-16.0, -16.0, -0.3][k]) / 0.4);
            if place.iter().zip([80.0, 80.0, 9.0]).all(|(p, n)| (0.0..n).contains(p)) {
                voxels[end.lidar].insert(place.map(|p| p.floor() as i64));
            }
        }
        for a in 0..4 {
            for b in 0..4 {
                sums[a][b] += voxels[a].intersection(&voxels[b]).count() as f64 / 3.0;
            }
        }
    }
    let row = &found["rows"][0];
    for a in 0..4 {
        let shared = numbers(&row["shared_voxels"][a]);
        for b in 0..4 {
            // A hit on the face between two voxels is rounded to either side.
            assert!((shared[b] - sums[a][b]).abs() <= 2.0, "{a} {b}: {} {}", shared[b], sums[a][b]);
        }
        assert!(sums[a][a] > 200.0);
        let overlap = numbers(&row["overlap"][a]);
        for b in 0..4 {
            let share = sums[a][b] / sums[a][a].min(sums[b][b]);
            assert!((overlap[b] - share).abs() < 0.01, "{a} {b}: {} {share}", overlap[b]);
        }
    }
    assert!(sums[0][1] > 100.0 && sums[2][3] == 0.0, "{sums:?}");
    // The front LiDARs look opposite ways: 120° of azimuth between sin −25° and sin 5° each.
    let directions = |k: usize| numbers(&found["rows"][1]["shared_directions"][k]);
    let own = (5_f64.to_radians().sin() + 25_f64.to_radians().sin()) / 6.0;
    assert!((directions(0)[0] - own).abs() < 3e-4 && (directions(1)[1] - own).abs() < 3e-4);
    assert_eq!((directions(0)[1], directions(1)[0]), (0.0, 0.0));
    // They share no surface: cut off at any number.
    let fronts = &found["rows"][1];
    assert_eq!((&fronts["connected"], &fronts["connected_up_to"]), (&json!(false), &json!(0.0)));
    assert_eq!((&fronts["cut_off"], &fronts["groups"]), (&json!([1]), &json!([[0], [1]])));
    // All four are connected up to the weakest pair of the chain, and at no more.
    let most = row["connected_up_to"].number();
    assert_eq!(row["chain"][2]["voxels"], most);
    // By its definition: at every smaller share of a pair all are joined, at no larger one.
    let shares: Vec<Vec<f64>> = (0..4).map(|a| numbers(&row["overlap"][a])).collect();
    let joined = |least: f64| {
        let mut reached = BTreeSet::from([0]);
        for _ in 0..4 {
            let more = (0..4).filter(|&b| reached.iter().any(|&a: &usize| shares[a][b] >= least));
            reached = more.collect::<BTreeSet<usize>>().union(&reached).copied().collect();
        }
        reached.len() == 4
    };
    let up_to = row["overlap_up_to"].number();
    assert!(up_to > 0.0 && joined(up_to) && !joined(up_to + 1e-9), "{up_to} {shares:?}");
    assert_eq!(fronts["overlap_up_to"], 0.0);
    let at = |least: f64| {
        let least = (least as u64).to_string();
        let found = study(dir.path(), "overlap", &format!("--least-shared {least}"));
        found["rows"][0]["connected"].clone()
    };
    assert_eq!((at(most.floor()), at(most.floor() + 1.0)), (json!(true), json!(false)));
}

#[test]
fn engines_agree_and_scenes_have_a_mean() {
    let dir = yard();
    for kind in ["redundancy", "overlap"] {
        let cpu = study(dir.path(), kind, "");
        #[cfg(feature = "gpu")]
        {
            let gpu = ["study", kind, "yard.json", "rigs.json", "--backend", "gpu"];
            assert_eq!(ok(&dir, &gpu), cpu, "{kind}");
        }
        let both = ["study", kind, "yard.json", "other.json", "rigs.json", "--backend", "cpu"];
        let found = ok(&dir, &both);
        assert_eq!(found["rows"].list().len(), 4);
        assert_eq!([&found["rows"][0], &found["rows"][1]], [&cpu["rows"][0], &cpu["rows"][1]]);
        assert_eq!(found["rows"][2]["scene"], "other");
        if kind == "redundancy" {
            assert!(cpu.get("mean").is_none());
            for (part, k) in [("occupied", 0), ("ground_10m", 2), ("voxels", 3)] {
                let of = |row: &Value| row[part]["by"][k].number();
                let mean = 0.5 * (of(&found["rows"][1]) + of(&found["rows"][3]));
                assert!((of(&found["mean"][1]) - mean).abs() < 1e-9, "{part}");
            }
            assert_eq!(found["mean"][1]["scene"], "mean of 2 scenes");
        }
    }
}

#[test]
fn the_library_has_the_rows_of_the_program() {
    let dir = yard();
    let rigs = read_placements(dir.path().join("rigs.json")).unwrap();
    let job = Job::new(Scene::read(dir.path().join("yard.json")).unwrap());
    let job = job.engine(EngineChoice::cpu());
    let targets = REDUNDANCY_TARGETS.map(|name| Target::named(name).unwrap());
    let rows = job.redundancy(&rigs, &redundancy_question(targets.to_vec())).unwrap();
    assert_eq!(json!(rows), study(dir.path(), "redundancy", "")["rows"]);
    let rows = json!(job.overlap(&rigs, LEAST_SHARED).unwrap());
    assert_eq!(rows, study(dir.path(), "overlap", "")["rows"]);
}

#[test]
fn tables_for_people() {
    let dir = yard();
    let text = |args: &str| stdout(&dir, &format!("study {args} --backend cpu"));
    let told = text("redundancy rigs.json --vehicle cart.json --target car");
    told.says("four in level ground: 4 LiDARs, 1 frame");
    told.says("wide alone  front alone").says("\ncar ");
    assert!(told.contains("ground to 3 m") && !told.contains("tyre"), "{told}");
    text("overlap yard.json rigs.json")
        .says("NOT CONNECTED at 500 shared voxels; cut off from 0 front: 1 front (shares nothing with any other)");
    let told = text("overlap yard.json rigs.json --least-shared 20");
    told.says("Connected at 20 shared voxels, and up to ");
    // One pair has the overlap that connects all: matrix and sentence say the same number.
    let up_to = told.split("All connected up to an overlap of ").nth(1).unwrap();
    let up_to = up_to.split_whitespace().next().unwrap();
    let matrix = told.split("overlap %").nth(1).unwrap().split("% of the sphere").next().unwrap();
    assert!(matrix.split_whitespace().any(|cell| cell == up_to), "{up_to}: {matrix}");
}

#[test]
fn wrong_input_is_one_sentence_each() {
    let dir = yard();
    let at = |name: &str| dir.path().join(name);
    write_rig(&dir, "none.json", "a", json!([]));
    let through = fs::read_to_string(at("yard.json")).unwrap().replace("first-hit", "through");
    fs::write(at("through.json"), through).unwrap();
    let cases: [(&str, &str); 9] = [
        ("redundancy yard.json rigs.json --target chidl", "did you mean `child`?"),
        (
            "redundancy yard.json rigs.json --target car --target car",
            "is given twice; leave one out",
        ),
        (
            "redundancy yard.json none.json",
            "none.json: placement `a` has 0 LiDARs; give it 1 to 16",
        ),
        (
            "redundancy rigs.json",
            "rigs.json: there is neither a scene nor a vehicle; give --vehicle",
        ),
        ("overlap rigs.json --vehicle cart.json", "rigs.json: holds placements; give a scene"),
        ("overlap yard.json none.json", "none.json: placement `a` has 0 LiDARs; give it 1 to 16"),
        (
            "overlap yard.json each.json",
            "each.json: placement `l0` has one LiDAR, and overlap is between two; add a second",
        ),
        ("overlap yard.json rigs.json --least-shared 0", "give a whole number from 1 to"),
        (
            "overlap through.json rigs.json",
            "through.json: beams end at nothing, so that no two LiDARs have a surface in common; give",
        ),
    ];
    for (args, words) in cases {
        let args = format!("study {args} --backend cpu --quiet");
        let told = fails(&dir, &args);
        assert!(told.contains(words) && told.lines().count() == 1, "{args}: {told}");
    }
    // Without hits there is no ground, which is said, and no target.
    let found = ok(&dir, "study redundancy through.json rigs.json --backend cpu");
    let row = &found["rows"][0];
    assert_eq!((&row["ground_3m"], &row["targets"]), (&Value::Null, &json!([])));
    assert!(row["no_ground"].text().contains("beams end at nothing"), "{row}");
}
