//! A device lost in the middle of a run: the run ends with the same bits, and says what happened.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use lidar_cast::engine::Failover;
use sightline::engine::BackendError;
use sightline::engine::gpu::GpuBackend;

use crate::cli::*;
use crate::common::*;

/// Batches that a device survives, the first one and those opened after it; `None` cannot be opened.
type Lives = [Option<u32>];

fn device(problem: &Arc<Problem>, lives: Option<u32>) -> Result<Box<dyn Backend>, BackendError> {
    let lives = lives.ok_or(BackendError::NoDevice { name: None })?;
    let mut gpu = GpuBackend::new(problem.task().clone(), None, MEMORY)?;
    gpu.lose_device_after(lives);
    Ok(Box::new(gpu))
}

/// A backend that loses its devices, and what it notes.
fn failing(problem: &Arc<Problem>, lives: &'static Lives) -> (Failover, Arc<Mutex<Vec<String>>>) {
    let first = device(problem, lives[0]).unwrap();
    let opened = AtomicU32::new(1);
    let for_gpu = problem.clone();
    let reopen = Box::new(move || {
        let index = opened.fetch_add(1, Ordering::SeqCst) as usize;
        device(&for_gpu, lives.get(index).copied().unwrap_or(Some(1000)))
    });
    let for_cpu = problem.clone();
    let cpu = move || Box::new(CpuBackend::new(for_cpu.task().clone(), MEMORY)) as Box<dyn Backend>;
    let notes = Arc::new(Mutex::new(Vec::new()));
    let sink = notes.clone();
    let note = move |line: &str| sink.lock().unwrap().push(line.to_owned());
    (Failover::new(first, reopen, cpu, note), notes)
}

#[test]
fn batches_go_on_with_the_same_bits() {
    // (lives of the devices, where the last batch is computed, changes on the way)
    let cases: [(&Lives, &str, usize); 5] = [
        (&[Some(1000)], "gpu", 0),
        (&[Some(2)], "gpu", 1),
        (&[Some(2), Some(0)], "cpu", 2),
        (&[Some(2), None], "cpu", 1),
        (&[Some(1), Some(1), Some(1), Some(1)], "cpu", 4),
    ];
    let problem = random_problem(81, true);
    let placements = random_placements(81, 28, 6.0);
    let want = cpu(&problem).tally(&placements, Some(12.0)).unwrap();
    for (lives, last, changes) in cases {
        let (mut backend, notes) = failing(&problem, lives);
        let batches = placements.chunks(4);
        let got: Vec<_> =
            batches.flat_map(|batch| backend.tally(batch, Some(12.0)).unwrap()).collect();
        assert_eq!(got, want, "{lives:?}");
        assert_eq!(backend.name(), last, "{lives:?}");
        assert_eq!(backend.changes().len(), changes, "{lives:?}: {:?}", backend.changes());
        assert_eq!(*notes.lock().unwrap(), backend.changes());
        let covered = backend.covered(&placements[3], 1).unwrap();
        assert_eq!(covered, cpu(&problem).covered(&placements[3], 1).unwrap());
        if let [first, ..] = backend.changes() {
            assert!(first.contains("scores so far are kept"), "{first}");
        }
    }
}

#[test]
fn errors_that_are_not_the_devices_are_handed_on() {
    let problem = random_problem(82, true);
    let (mut backend, notes) = failing(&problem, &[Some(1000)]);
    let placement = &random_placements(82, 1, 6.0)[0];
    let error = backend.hits(&placement.lidars, 99).unwrap_err();
    assert!(matches!(error, BackendError::NoFrame { .. }), "{error}");
    assert!(notes.lock().unwrap().is_empty());
}

#[test]
fn a_placement_too_large_for_a_device_goes_to_the_cpu_if_allowed() {
    let problem = random_problem(84, true);
    let placements = random_placements(84, 4, 6.0);
    let want = cpu(&problem).tally(&placements, Some(12.0)).unwrap();
    for allowed in [false, true] {
        let tiny = Box::new(GpuBackend::new(problem.task().clone(), None, 1000).unwrap());
        let reopen = Box::new(|| panic!("a device that is too small is not opened again"));
        let for_cpu = problem.clone();
        let cpu =
            move || Box::new(CpuBackend::new(for_cpu.task().clone(), MEMORY)) as Box<dyn Backend>;
        let mut backend = Failover::new(tiny, reopen, cpu, |_| ());
        if allowed {
            backend = backend.cpu_for_too_large();
        }
        match backend.tally(&placements, Some(12.0)) {
            Ok(got) => {
                assert!(allowed && got == want);
                assert_eq!(backend.name(), "cpu");
                assert!(backend.changes()[0].starts_with("too large for `"));
            }
            Err(error) => {
                assert!(!allowed && matches!(error, BackendError::TooLarge { .. }), "{error}");
                assert_eq!(backend.changes().len(), 0);
            }
        }
    }
}

/// The program on a device that is lost after so many batches: JSON answer and stderr.
fn losing(dir: &Path, args: &impl Words, batches: u32) -> (Value, String) {
    let mut command = crate::cli::program(dir, &(args, "--format json"));
    let batches = batches.to_string();
    let output = command.env("SIGHTLINE_LOSE_DEVICE_AFTER", batches).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && !stderr.contains("panicked"), "{stderr}");
    (serde_json::from_slice(&output.stdout).unwrap(), stderr)
}

#[test]
fn a_stream_of_scores_outlives_its_device() {
    let dir = in_room();
    let lines: String = random_placements(83, 2100, 0.4)
        .into_iter()
        .map(|mut placement| {
            placement.lidars.iter_mut().for_each(|pose| pose.z = 1.5);
            serde_json::to_string(&placement).unwrap() + "\n"
        })
        .collect();
    fs::write(dir.path().join("many.jsonl"), lines).unwrap();
    let args = "score room.json many.jsonl --frames 1 --backend";
    let want = ok(&dir, &(args, "cpu"));
    assert!(want.get("backend_changes").is_none());
    // The reference layouts and the first block of 1024 are scored, and then it is gone.
    let (got, stderr) = losing(dir.path(), &(args, "gpu"), 6);
    assert_eq!(got["scores"], want["scores"]);
    assert_eq!(got["backend_changes"].list().len(), 1);
    assert!(stderr.contains("opened again, scores so far are kept"), "{stderr}");
}

#[test]
fn a_search_outlives_its_device() {
    let dir = in_room();
    let args = |out: &str, backend: &str| {
        format!(
            "optimize room.json --evaluations 30 --seed 5 --frames 2 --out {out} --backend {backend}"
        )
    };
    let want = ok(&dir, &args("whole", "cpu"));
    let (got, stderr) = losing(dir.path(), &args("broken", "gpu"), 4);
    let read = |run: &str, file: &str| fs::read(dir.path().join(run).join(file)).unwrap();
    assert_eq!(read("whole", "history.jsonl"), read("broken", "history.jsonl"));
    assert_eq!(got["best"], want["best"]);
    assert!(stderr.contains("scores so far are kept"), "{stderr}");
    let result: Value = serde_json::from_slice(&read("broken", "result.json")).unwrap();
    let changes = result["backend_changes"].list();
    assert!(changes[0].text().contains("was lost"), "{changes:?}");
    assert!(want.get("backend_changes").is_none());
}

#[test]
fn a_bound_outlives_its_device() {
    let dir = in_room();
    let run = |out: &str, backend: &str, batches: u32| {
        let fixed = "optimize room.json --evaluations 16 --seed 5 --frames 1";
        let args = format!("{fixed} --out {out} --backend {backend}");
        let (_, told) = losing(dir.path(), &args, batches);
        let result = fs::read(dir.path().join(out).join("result.json")).unwrap();
        (serde_json::from_slice::<Value>(&result).unwrap(), told)
    };
    let (want, _) = run("whole", "cpu", 1);
    // The batch at which the bound is under way is found by halving.
    let (mut low, mut high) = (1, 256);
    while low < high {
        let batches = (low + high) / 2;
        let (got, told) = run(&format!("lost-{batches}"), "gpu", batches);
        assert_eq!((&got["best"], &got["certificate"]), (&want["best"], &want["certificate"]));
        match (told.find("failed at "), told.find("bounding the gain")) {
            (Some(lost), Some(bounding)) if lost > bounding => return,
            (Some(_), _) => low = batches + 1,
            (None, _) => high = batches,
        }
    }
    panic!("no device was lost while the gain was bounded");
}
