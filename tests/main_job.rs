//! The main job on real input at small settings: own scenes, a real mesh, real labelled frames.

use crate::cli::*;

/// A file or folder of the real data that `build.rs` looked for.
fn data(file: &str) -> PathBuf {
    Path::new(env!("REAL_DATA")).join(file)
}

pub(crate) fn own_scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let is_scene = |path: &PathBuf| {
        path.extension().is_some_and(|e| e == "json")
            && path.file_stem().is_some_and(|stem| stem != "placements")
    };
    let mut scenes: Vec<_> = entries.filter(is_scene).collect();
    scenes.sort();
    assert!(scenes.len() >= 4, "only {} own scenes", scenes.len());
    scenes
}

/// A copy of an own scene with fewer frames, and with larger voxels where they are given.
pub(crate) fn shortened(dir: &Path, scene: &Path, frames: u32, voxel: Option<f64>) -> PathBuf {
    let mut copy = read_json(scene);
    copy["frames"] = json!(frames);
    if let Some(edge) = voxel {
        copy["roi"]["voxel"] = json!([edge, edge, edge]);
    }
    let path = dir.join(scene.file_name().unwrap());
    fs::write(&path, copy.to_string()).unwrap();
    path
}

/// Optimizes a scene with few evaluations and checks what any user would look at first.
fn optimize(scene: &Path, objective: &str) -> Value {
    let dir = TempDir::new().unwrap();
    let scene = scene.to_string_lossy();
    let args = format!("optimize {scene} --out run --evaluations 12 --frames 1 --seed 3");
    let result = ok(&dir, &(args, ["--objective", objective]));
    let best = &result["best"];
    assert_eq!(best["violations"], json!([]), "{scene}");
    assert!(best["scores"]["covered"].number() > 1000.0, "{scene}: {best}");
    assert!(best["scores"]["information_gain_share"].number() > 0.02, "{scene}: {best}");
    assert!(best["objective"].is_f64());
    assert_eq!(result["baselines"].list().len(), 11);
    assert!(dir.path().join("run/report.html").exists());
    result
}

/// Guards that speak against the scores; blind sectors are facts about the rig.
fn doubts(scores: &Value) -> Vec<&str> {
    let guards = scores["guards"].list().iter().map(|guard| guard.text());
    guards.filter(|guard| !guard.starts_with("blind_sector")).collect()
}

/// The last for two tasks, which are weighed.
#[test]
fn own_scenes_are_optimized() {
    let dir = TempDir::new().unwrap();
    let scenes = own_scenes();
    for (index, scene) in scenes.iter().enumerate() {
        let scene = &shortened(dir.path(), scene, 8, Some(0.4));
        let is_last = index + 1 == scenes.len();
        let both = "0.5*m_sog_scaled + 0.5*detection.m_sog_scaled";
        let result = optimize(scene, if is_last { both } else { "m_sog_scaled" });
        let best = &result["best"];
        assert_eq!(doubts(&best["scores"]), [""; 0], "{}", scene.display());
        assert!(best["scores"]["hit_share"].number() > 0.3, "{best}");
    }
}

#[test]
#[cfg_attr(not(has_meshes), ignore = "needs the meshes of ../shared/data or SIGHTLINE_DATA")]
fn a_real_town_is_optimized() {
    let mesh = data("scenes/mcity/mcity.obj");
    let dir = TempDir::new().unwrap();
    let scene = json!({
        "sightline": 1, "name": "mcity",
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.4, 0.4, 0.4] },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 100 },
        "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "first-hit", "frames": 4,
        "static": [{ "class": "static", "mesh": { "file": mesh, "scale": 0.254, "classes": {
            "Road_Blank": "road", "Road_Blank_Light": "road", "Asphalt": "road",
            "Road_DoubleYellowLine": "road_line", "Road_DoubleYellowLine_Light": "road_line",
            "Road_SingleWhiteLine": "road_line", "Crosswalk": "road_line", "Curb": "sidewalk",
            "Concrete_Ground": "sidewalk", "Grass": "terrain", "Gravel": "ground",
            "Buildings": "building", "Brick": "building", "Tunnel": "bridge", "Colors": "traffic_sign"
        } } }],
        "ego": { "route": { "points": [[122, 90], [122, 190]], "start": 0, "spacing": 8 },
                 "body": [{ "class": "vehicle", "box": { "center": [0, 0, 0.75], "size": [4.5, 1.8, 1.5] } }] }
    });
    let path = dir.path().join("mcity.json");
    fs::write(&path, scene.to_string()).unwrap();
    let result = optimize(&path, "m_sog_scaled");
    let classes = &result["best"]["scores"]["covered_by_class"];
    assert!(classes["road"].number() > 100.0, "{classes}");
}

#[test]
#[cfg_attr(not(has_kitti), ignore = "needs SemanticKITTI in ../shared/data or SIGHTLINE_DATA")]
fn real_labelled_frames_are_optimized() {
    let sequence = data("nc/semantickitti/sequences/00");
    let dir = TempDir::new().unwrap();
    let kitti = ["psog", "build", "--kitti", sequence.to_str().unwrap()];
    let region = "--roi-min -40 -40 -0.5 --roi-max 40 40 5.5 --voxel 0.4 0.4 0.4";
    let info = ok(&dir, &(kitti, region, "--out kitti.psog.npz"));
    assert_eq!(info["frames"], 4);
    assert!(info["tie_share"].number() < 0.1, "{info}");
    let scene = json!({
        "sightline": 1, "name": "kitti-00",
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.4, 0.4, 0.4] },
        "psog": { "file": "kitti.psog.npz" },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 100 },
        "mount": { "min": [-0.6, -0.6, 1.5], "max": [0.6, 0.6, 2.1], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "through"
    });
    write(&dir, "kitti.json", &scene);
    let result = optimize(&dir.path().join("kitti.json"), "information_gain");
    assert!(result["best"]["scores"]["covered_by_class"]["car"].number() > 20.0);
}

/// Every own scene and Table 7 placement, three to each scene: hits of one frame, coverage and scores of two frames, on the
/// CPU and on the GPU.
#[test]
fn own_scenes_have_the_same_bits_on_both_backends() {
    let dir = TempDir::new().unwrap();
    let listed = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/placements.json");
    let listed = read_json(listed);
    let listed = listed["placements"].list();
    let (scenes, mut compared) = (own_scenes(), 0);
    for (index, scene) in scenes.iter().enumerate() {
        let scene = shortened(dir.path(), scene, 6, None);
        let scene = scene.to_string_lossy();
        let some: Vec<&Value> = listed.iter().skip(index).step_by(scenes.len()).collect();
        let placements = "placements.json";
        fs::write(dir.path().join(placements), json!({ "placements": some }).to_string()).unwrap();
        let on = |backend: &str| {
            let files = format!("{scene} {placements} --force --backend {backend}");
            ok(&dir, &format!("cast {files} --out {backend}.npz"));
            ok(&dir, &format!("score {files} --frames 2 --coverage-out {backend}"))["scores"].take()
        };
        let (cpu, gpu) = (on("cpu"), on("gpu"));
        assert_eq!(cpu, gpu, "{scene}");
        compared += cpu.list().len();
        let read = |file: &str| fs::read(dir.path().join(file)).unwrap();
        assert!(read("cpu.npz") == read("gpu.npz"), "{scene}: hits differ");
        for score in cpu.list() {
            let name = score["name"].text();
            let file = |backend: &str| read(&format!("{backend}/{name}.npy"));
            assert!(file("cpu") == file("gpu"), "{scene}, {name}: coverage differs");
            assert_eq!(doubts(score), [""; 0], "{scene}, {name}");
        }
    }
    assert_eq!(compared, 11);
}
