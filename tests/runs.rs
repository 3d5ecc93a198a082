//! Work on files as a library's caller does it, without the program: answers as values, stopped and gone on with.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use sightline::EngineChoice;
use sightline::export::Layout;
use sightline::rig::ImportSettings;
use sightline::runs::optimize::{OptimizeRequest, optimize};
use sightline::runs::rig::{ExportRequest, Mounted, compare_files, export_file, import_files};
use sightline::runs::scan::{ScanRequest, scan};
use sightline::runs::score::{ScoreRequest, score};
use sightline::runs::{Bar, Computing, Silent, TableFormat, Watcher};

use crate::cli::*;

/// Stops after so many questions whether to go on, and keeps what it is told.
struct Patience {
    left: AtomicU64,
    told: Mutex<Vec<String>>,
}

impl Patience {
    fn of(questions: u64) -> Self {
        Self { left: AtomicU64::new(questions), told: Mutex::default() }
    }

    fn told(&self) -> String {
        self.told.lock().unwrap().join("\n")
    }
}

impl Watcher for Patience {
    fn note(&self, sentence: &str) {
        self.told.lock().unwrap().push(sentence.to_owned());
    }

    fn bar(&self, _total: u64, _unit: Option<&str>) -> Box<dyn Bar> {
        Box::new(Silent)
    }

    fn goes_on(&self) -> bool {
        let spent = |left: u64| Some(left.saturating_sub(1));
        self.left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, spent).is_ok_and(|left| left > 0)
    }
}

/// On the CPU, as the watcher says.
fn on_cpu(watcher: &dyn Watcher) -> Computing<'_> {
    Computing { engine: EngineChoice::cpu(), vehicle: None, sensors: Vec::new(), watcher }
}

/// A scene and two placements in it.
fn given(dir: &TempDir) -> [PathBuf; 2] {
    let placements = dir.path().join("p.json");
    let lidar = |x: f64| json!({ "x": x, "y": 0.0, "z": 1.5 });
    let all = json!({ "placements": [
        { "name": "one", "lidars": [lidar(0.0), lidar(0.4)] },
        { "name": "two", "lidars": [lidar(0.5), lidar(-0.5)] },
    ]});
    fs::write(&placements, all.to_string()).unwrap();
    [room(dir.path()), placements]
}

/// Files of a folder with their bytes, but for those that hold times.
fn files(folder: &Path, but: &[&str]) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, but));
        } else if !but.iter().any(|name| path.ends_with(name)) {
            found.insert(path.file_name().unwrap().into(), fs::read(&path).unwrap());
        }
    }
    found
}

#[test]
fn scores_go_to_any_writer_and_the_engine_is_named_to_the_watcher() {
    let dir = TempDir::new().unwrap();
    let files = given(&dir).to_vec();
    let watcher = Patience::of(u64::MAX);
    let mut written = Vec::new();
    let request =
        ScoreRequest { files: files.clone(), format: TableFormat::Json, ..ScoreRequest::default() };
    score(&request, &on_cpu(&watcher), &mut written).unwrap();
    let found: Value = serde_json::from_slice(&written).unwrap();
    assert_eq!(found["scores"][1]["name"], "two");
    assert!(watcher.told().contains("computing on cpu"), "{}", watcher.told());
    assert!(watcher.told().contains("2 placements × 3 frames"), "{}", watcher.told());
    let wrong = ScoreRequest { draw: 1, files: [files.clone(), files].concat(), ..request };
    let error = score(&wrong, &on_cpu(&watcher), &mut written).unwrap_err().to_string();
    error.says("--draw: takes one scene");
}

#[test]
fn a_search_that_was_stopped_goes_on_to_the_same_bytes() {
    let dir = TempDir::new().unwrap();
    let [scene, _] = given(&dir);
    let new = |folder: &str| OptimizeRequest {
        scenes: vec![scene.clone()],
        out: Some(dir.path().join(folder)),
        evaluations: Some(40),
        ..OptimizeRequest::default()
    };
    let run = |request: OptimizeRequest, watcher: &dyn Watcher| {
        optimize(&request, &on_cpu(watcher)).unwrap().expect("no sensors to choose")
    };
    let whole = run(new("whole"), &Silent);
    assert_eq!(whole.record.seed, 1, "the seed of the command, where none is given");
    assert!(whole.record.best.is_some());
    let patience = Patience::of(4);
    let stopped = run(new("stopped"), &patience);
    assert!(patience.told().contains("go on with --resume"), "{}", patience.told());
    assert_ne!(stopped.record.stopped, whole.record.stopped);
    let resume = Some(stopped.folder.clone());
    run(OptimizeRequest { resume, ..OptimizeRequest::default() }, &Silent);
    // These hold times, of which no two runs have the same.
    let but = ["times.json", "result.json", "report.html", "run.json"];
    let [whole, stopped] = [&whole.folder, &stopped.folder].map(|folder| files(folder, &but));
    assert!(whole.len() >= 3, "{:?}", whole.keys());
    for (name, bytes) in &whole {
        assert!(stopped.get(name) == Some(bytes), "{}", name.display());
    }
}

#[test]
fn scans_that_were_stopped_go_on_to_the_same_bytes() {
    let dir = TempDir::new().unwrap();
    let [scene, placements] = given(&dir);
    let request = |out: &str| ScanRequest {
        scenes: vec![scene.clone()],
        placement: vec![format!("{}:two", placements.display())],
        out: dir.path().join(out),
        layout: Layout::Npz,
        ideal: false,
        condition: Vec::new(),
        seed: 3,
        frames: None,
        splits: None,
        keyframe_every: None,
        with_camera_stubs: false,
        merged_only: false,
        map: Vec::new(),
        gltf: None,
    };
    let whole = scan(&request("whole"), &on_cpu(&Silent)).unwrap().unwrap();
    assert_eq!((whole[0].frames, &*whole[0].placement), (3, "two"));
    let patience = Patience::of(2);
    // More threads would have begun all three frames by then, and what is begun is written.
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let stopped = alone.install(|| scan(&request("stopped"), &on_cpu(&patience)).unwrap());
    assert!(stopped.is_none());
    assert!(patience.told().contains("is not complete"), "{}", patience.told());
    let rest = scan(&request("stopped"), &on_cpu(&Silent)).unwrap().unwrap();
    assert_eq!(rest[0].points, whole[0].points);
    assert!(rest[0].points_now < whole[0].points_now, "all of it was scanned again");
    let [whole, stopped] = ["whole", "stopped"].map(|out| files(&dir.path().join(out), &[]));
    assert!(whole == stopped && whole.len() > 3, "{:?}", whole.keys());
}

#[test]
fn a_rig_that_is_written_and_read_again_is_the_same() {
    let dir = TempDir::new().unwrap();
    let [_, placements] = given(&dir);
    let placement = format!("{}:two", placements.display());
    let urdf = dir.path().join("rig.urdf");
    let request = ExportRequest {
        placement: placement.clone(),
        format: "urdf".parse().unwrap(),
        out: Some(urdf.clone()),
        frame: Vec::new(),
        scene: None,
        vehicle: None,
        mounted: Mounted::default(),
    };
    assert_eq!(export_file(&request, &Silent).unwrap(), None);
    let read = ImportSettings::default();
    let text = import_files(std::slice::from_ref(&urdf), &read, None, &Silent).unwrap().unwrap();
    text.says("0.5").says("lidars");
    let found = compare_files(&placement, &urdf.display().to_string(), &read, &Silent).unwrap();
    assert_eq!(found.lidars.len(), 2);
    assert!(found.lidars.iter().all(|lidar| lidar.moved < 1e-9 && lidar.turned < 1e-9));
}
