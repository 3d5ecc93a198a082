//! Every long command, interrupted at moments of its run or out of time, ends soon, and leaves whole files or none.

use crate::cli::*;

/// Milliseconds from the start to the signal: before the scene is read, while it is scanned, in the midst of the work.
const MOMENTS: [u64; 4] = [3, 60, 250, 800];

/// Bound on the time from a signal or a deadline to the end, for a machine that is busy with other tests.
const HANGS: Duration = Duration::from_secs(30);

/// Commands that would run for minutes.
const COMMANDS: [&str; 10] = [
    "optimize scene.json --method cma --evaluations 10000000 --backend cpu --out out",
    "optimize scene.json --method swaps --evaluations 10000000 --backend cpu --out out",
    "optimize scene.json --vehicle many.json --budget 9000 --evaluations 10000000 --backend cpu --out out",
    "study lidars scene.json --evaluations 1000000 --backend cpu --out out",
    "chart scene.json --placements 400 --backend cpu --out out",
    "score scene.json many.jsonl --backend cpu --out out.jsonl",
    "scan busy.json --placement one.json --backend cpu --out out",
    "audit busy.json --backend cpu",
    "study sweep scene.json some.json --of 0.z --from 1 --to 2 --values 1000 --backend cpu",
    "study tolerance scene.json some.json --vehicle required.json --sensor all=spinning-32 --steps 1000 --backend cpu",
];

/// A scene that is scanned in milliseconds, one of many frames, placements, and a vehicle with many choices, once with a requirement.
fn write_inputs(dir: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| read_json(root.join(path));
    let write = |name: &str, value: &Value| write(dir, name, value);
    let mut scene = read("scenes/urban-crossing.json");
    scene["frames"] = json!(2);
    scene["lidar"]["channels"] = json!(8);
    scene["lidar"]["azimuth_steps"] = json!(90);
    write("scene.json", &scene);
    scene["frames"] = json!(10000);
    scene["rate"] = json!(200);
    write("busy.json", &scene);
    let mut vehicle = read("scenes/vehicles/car.json");
    for price in 1..30 {
        let mut sensor = vehicle["sensors"][2].clone();
        sensor["name"] = json!(format!("solid-{price}"));
        sensor["price"] = json!(1000 + price);
        vehicle["sensors"].as_array_mut().unwrap().push(sensor);
        for mount in 1..5 {
            let names = vehicle["mounts"][mount]["sensors"].as_array_mut().unwrap();
            names.push(json!(format!("solid-{price}")));
        }
    }
    write("many.json", &vehicle);
    vehicle["require"] = json!([{ "target": "car", "within": 20, "share": 0.05 }]);
    write("required.json", &vehicle);
    let at = |x: f64| json!({ "x": x, "y": 0.1, "z": 2.3 });
    let placement =
        |name: &str| json!({ "name": name, "lidars": [at(0.5), at(0.2), at(-0.2), at(-0.5)] });
    write("one.json", &json!({ "placements": [placement("one")] }));
    let some: Vec<Value> = (0..100).map(|i| placement(&format!("p{i}"))).collect();
    write("some.json", &json!({ "placements": some }));
}

/// More placements than are scored in seconds, one a line.
fn write_many(dir: &Path) {
    let some = read_json(dir.join("some.json"));
    let lines: String = some["placements"].list().iter().map(|one| format!("{one}\n")).collect();
    let lines = (0..1000).map(|i| lines.replace("\"p", &format!("\"p{i}-")));
    fs::write(dir.join("many.jsonl"), lines.collect::<String>()).unwrap();
}

/// Runs a command, sends it a signal after some time, and waits: how it ended, how long after the signal, what it said.
fn stopped(
    dir: &Path,
    line: &str,
    signal: &str,
    after: Duration,
) -> (ExitStatus, Duration, String) {
    let said = dir.join("said.txt");
    let mut command = program(dir, line);
    let child =
        command.stdout(Stdio::null()).stderr(fs::File::create(&said).unwrap()).spawn().unwrap();
    std::thread::sleep(after);
    let kill = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(
        kill.success(),
        "{line} ended before {after:?}: {}",
        fs::read_to_string(&said).unwrap()
    );
    let sent = Instant::now();
    let status = end_within(HANGS, child, line);
    (status, sent.elapsed(), fs::read_to_string(&said).unwrap())
}

/// Files whose name says that they are not whole, in a folder and below; `score` keeps `.partial` to go on from.
fn left_over(dir: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).unwrap().map(Result::unwrap) {
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type().unwrap().is_dir() {
            found.extend(left_over(&entry.path()));
        } else if name.contains(".tmp") {
            found.push(name);
        }
    }
    found
}

#[test]
fn every_long_command_ends_soon_when_it_is_interrupted() {
    let dir = tempfile::tempdir().unwrap();
    write_inputs(dir.path());
    write_many(dir.path());
    let (mut latest, mut ended) = ((Duration::ZERO, String::new()), Vec::new());
    for (index, line) in COMMANDS.iter().enumerate() {
        for (turn, moment) in MOMENTS.iter().enumerate() {
            let signal = ["-INT", "-TERM"][(index + turn) % 2];
            let after = Duration::from_millis(*moment);
            let (status, late, said) = stopped(dir.path(), line, signal, after);
            assert!(!said.contains("panicked"), "{line}: {said}");
            // Before the program listens the system ends it, without an exit code; 2 would be a wrong command.
            let code = status.code();
            assert!(code.is_none_or(|code| ![0, 2].contains(&code)), "{line}: {code:?}, {said}");
            assert!(late < HANGS, "{line}: {late:?} after {signal} at {after:?}");
            assert_eq!(left_over(dir.path()), [""; 0], "{line} after {signal} at {after:?}");
            latest = latest.max((late, (*line).to_owned()));
            if said.contains("before a place to stop") {
                ended.push(format!("{line} after {signal} at {after:?}"));
            }
            for name in ["out", "out.jsonl", "out.jsonl.partial"] {
                let path = dir.path().join(name);
                let _ = fs::remove_dir_all(&path).or_else(|_| fs::remove_file(&path));
            }
        }
    }
    // A command finds a place to stop by itself; one on a busy machine may not.
    assert!(ended.len() <= COMMANDS.len() / 2, "ended with the process: {ended:#?}");
    println!("latest end: {:?} after the signal, {}", latest.0, latest.1);
}

/// Searches in a scene of 1500 frames, each of which would take minutes; @ stands for their seconds. Only `optimize` takes
/// such a limit.
const LIMITED: [&str; 5] = [
    "optimize given.json --max-seconds @",
    "optimize given.json --fidelity full --method cma --max-seconds @",
    "optimize given.json --method swaps --max-seconds @",
    "optimize given.json again.json --max-seconds @",
    "optimize given.json --vehicle many.json --budget 9000 --max-seconds @",
];

/// Seconds that the searches are given.
const LIMIT: u64 = 1;

/// Runs `sightline` on the host to its end, and kills it after `most`: how it ended, how long it took, its stderr.
fn ended(dir: &Path, line: &str, most: Duration) -> (ExitStatus, Duration, String) {
    let (start, said) = (Instant::now(), dir.join("said.txt"));
    let mut command = program(dir, &format!("{line} --backend cpu --out out"));
    let child = command.stdout(Stdio::null()).stderr(fs::File::create(&said).unwrap()).spawn();
    let status = end_within(most, child.unwrap(), line);
    (status, start.elapsed(), fs::read_to_string(&said).unwrap())
}

/// The crossing with 1500 frames: `busy.json` is scanned for its P-SOG, `given.json` and `again.json` have one, and
/// `few.json` is the same over four frames.
fn write_long_scenes(dir: &Path) {
    write_inputs(dir);
    let mut scene = read_json(dir.join("busy.json"));
    scene["roi"]["voxel"] = json!([0.5, 0.5, 0.5]);
    let mut frames = |name: &str, frames: u32, psog: Option<&str>| {
        scene["frames"] = json!(frames);
        if let Some(psog) = psog {
            scene["psog"] = json!({ "file": psog });
        }
        write(dir, name, &scene);
    };
    frames("scanned.json", 4, None);
    frames("few.json", 4, Some("psog.npz"));
    frames("given.json", 1500, Some("psog.npz"));
    frames("again.json", 1500, Some("psog.npz"));
    printed(dir, "psog build scanned.json --out psog.npz");
}

#[test]
fn searches_over_many_frames_end_soon_after_their_time() {
    let dir = tempfile::tempdir().unwrap();
    write_long_scenes(dir.path());
    let limited = |line: &str, seconds: u64, most: Duration| {
        let ended = ended(dir.path(), &line.replace('@', &seconds.to_string()), most);
        assert_eq!(left_over(dir.path()), [""; 0], "{line}");
        ended
    };
    // A run over four frames, all of whose work comes on top, is the measure of this machine.
    let (status, unit, said) =
        limited(&LIMITED[3].replace("given.json again", "few"), 0, 4 * HANGS);
    assert!(status.success(), "{said}");
    let _ = fs::remove_dir_all(dir.path().join("out"));
    let most = Duration::from_secs(LIMIT) + (4 * unit).max(Duration::from_secs(15));
    for line in LIMITED {
        let (status, _, said) = limited(line, LIMIT, most);
        // 1: what the vehicle requires is not met in the time.
        assert!(matches!(status.code(), Some(0 | 1)), "{line}: {said}");
        let result = read_json(dir.path().join("out/result.json"));
        let stopped = result["stopped"].text();
        assert!(stopped.starts_with("time: ") && stopped.contains("frames"), "{line}: {stopped}");
        assert!(said.contains("--resume out"), "{line}: {said}");
        fs::remove_dir_all(dir.path().join("out")).unwrap();
    }
    // Nothing to search with: an error, and nothing is left.
    let (status, _, said) = limited("optimize busy.json --max-seconds @", LIMIT, most);
    assert_eq!(status.code(), Some(2), "{said}");
    said.says("--max-seconds 1 was over before the search").says("psog build");
    assert!(!dir.path().join("out").exists());
}
