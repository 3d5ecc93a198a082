//! Commands that are interrupted, hung up or run twice at once, and the page's command that repeats a run.

use std::io::{BufRead, BufReader, Read};
use std::process::ChildStderr;

use crate::cli::*;
use crate::cli_files::{all_files, is_litter, world};

/// The program, running, with a pipe of what it tells.
pub(crate) fn spawn(dir: &Path, args: &(impl Words + ?Sized)) -> Child {
    program(dir, args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Text that the program tells up to the first sentence of the engine: scoring begins. The rest is still to be read.
fn told_until_work(child: &mut Child) -> (BufReader<ChildStderr>, String) {
    let (mut told, mut words) = (BufReader::new(child.stderr.take().unwrap()), String::new());
    while !words.contains("computing on cpu") {
        assert!(told.read_line(&mut words).unwrap() > 0, "{words}");
    }
    (told, words)
}

#[test]
fn scores_of_many_placements_go_on_where_they_stopped() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    many(dir.path(), 30_000);
    let timings = |text: Vec<u8>| {
        let text = String::from_utf8(text).unwrap();
        text.split("\"timings\"").next().unwrap().to_owned()
    };
    for format in ["text", "json"] {
        let with = |more: &str| {
            format!("score scene.json many.jsonl --backend cpu --format {format} --out {more}")
        };
        printed(&dir, &with("whole"));
        for signal in ["-INT", "-KILL", "-TERM"] {
            let mut child = spawn(dir.path(), &with("cut"));
            let partial = at("cut.partial");
            wait_for(|| fs::metadata(&partial).is_ok_and(|meta| meta.len() > 2000));
            let second = fails(&dir, &with("cut --resume"));
            assert!(
                second.contains("another run writes into it") || second.contains("already exists"),
                "{second}"
            );
            interrupt(&child, signal);
            let status = child.wait().unwrap();
            assert!(
                partial.exists() && !at("cut").exists(),
                "{signal}: ended before it was told to"
            );
            assert_eq!(status.code(), (signal != "-KILL").then_some(130), "{signal}");
            fails(&dir, &with("cut")).says("cut.partial: holds the scores");
            fails(&dir, &with("cut --resume --frames 1")).says("was begun with other");
            // A torn end, as a full disk leaves it.
            let mut bytes = fs::read(&partial).unwrap();
            bytes.extend_from_slice(b"{\"scored\":99999,\"bytes\":40,\"sha256\":\"");
            fs::write(&partial, bytes).unwrap();
            printed(&dir, &with("cut --resume"));
            assert!(!partial.exists());
            let (cut, whole) = (fs::read(at("cut")).unwrap(), fs::read(at("whole")).unwrap());
            assert!(timings(cut) == timings(whole), "{format} {signal}");
            fs::remove_file(at("cut")).unwrap();
        }
        fs::remove_file(at("whole")).unwrap();
    }
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

#[test]
fn no_picture_of_some_placements_is_left_under_its_name() {
    let dir = world();
    let pose = |k: u32| json!({ "x": 0, "y": 0.01 * f64::from(k % 40), "z": 2 });
    let many = |k: u32| json!({ "name": format!("p{k}"), "lidars": [pose(k), pose(k + 1)] });
    write(&dir, "many.json", &json!({ "placements": (0..4000).map(many).collect::<Vec<_>>() }));
    for study in ["nearfield", "targets"] {
        let args = format!("study {study} town.json many.json --backend cpu --out o.svg");
        let mut child = spawn(dir.path(), &args);
        let (mut told, mut words) = told_until_work(&mut child);
        std::thread::sleep(Duration::from_millis(300));
        assert!(child.try_wait().unwrap().is_none(), "{study}: ended before it was told to");
        interrupt(&child, "-INT");
        told.read_to_string(&mut words).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{study}: {words}");
        words.says("interrupted: the table holds").says("o.svg is not written");
        assert!(!dir.path().join("o.svg").exists(), "{study}");
        assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
    }
}

#[test]
fn of_two_scans_at_once_one_is_refused() {
    let dir = world();
    for _ in 0..10 {
        let args = "scan town.json --placement p.json --backend cpu --threads 1 --out set --seed";
        let both = ["1", "2"].map(|seed| spawn(dir.path(), &(args, [seed])));
        let codes = both.map(|child| child.wait_with_output().unwrap().status.code());
        assert!(codes.contains(&Some(0)) && codes.contains(&Some(2)), "{codes:?}");
        fs::remove_dir_all(dir.path().join("set")).unwrap();
    }
}

#[test]
fn the_command_on_the_page_gives_the_same_run() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("a b's")).unwrap();
    for name in ["town.json", "m.obj", "p.json"] {
        fs::copy(at(name), at("a b's").join(name)).unwrap();
    }
    let files =
        ["optimize", "a b's/town.json", "--baselines", "a b's/p.json", "--inject", "p.json"];
    let objective = ["--objective", "0.5*near_gain + 0.5*information_gain"];
    let more = "--backend cpu --evaluations 24 --seed 7 --symmetric --fix roll=0 --frames 1 --condition fog:mor=50";
    stdout(&dir, &(&files, &objective, (more, "--out first")))
        .says(" over 2 frames, under fog:mor=50\n");
    let page = fs::read_to_string(at("first/report.html")).unwrap();
    assert!(!page.contains("near field %"), "a column that nobody looked for");
    page.says("sightline · town, under fog:mor=50<");
    let begin = page.find("<code>sightline").unwrap() + "<code>".len();
    let command = page[begin..].split("</code>").next().unwrap();
    let command = command
        .replace("&quot;", "\"")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    let command = command.replacen("sightline", env!("CARGO_BIN_EXE_sightline"), 1);
    // Files below the folder of the first run are named from there.
    for words in
        [r" optimize 'a b'\''s/town.json' ", r" --baselines 'a b'\''s/p.json' --inject p.json"]
    {
        assert!(command.contains(words), "{words}: {command}");
    }
    let run = Command::new("sh").args(["-c", &command]).current_dir(dir.path()).output().unwrap();
    assert!(run.status.success(), "{command}: {run:?}");
    let folder = at("runs/town");
    for name in ["history.jsonl", "placements.json", "placement.svg", "map.svg"] {
        let (first, again) =
            (fs::read(at("first").join(name)).unwrap(), fs::read(folder.join(name)).unwrap());
        assert!(first == again, "{name} differs");
    }
    let result = |path: PathBuf| {
        let mut result = read_json(path);
        for key in ["timings", "peak_memory", "evaluations_per_second"] {
            result.as_object_mut().unwrap().remove(key);
        }
        result
    };
    let (first, again) = (result(at("first/result.json")), result(folder.join("result.json")));
    for (key, value) in first.as_object().unwrap() {
        let is_time = key == "rate"
            || key.contains("second")
            || key.contains("memory")
            || key.contains("time");
        assert!(is_time || value == &again[key], "{key}: {value} and {}", again[key]);
    }
}

/// Placements of the corridor, one a line.
fn many(dir: &Path, count: u32) {
    let line =
        |k: u32| format!("{{\"name\":\"p{k}\",\"lidars\":[{{\"x\":0.5,\"y\":0.5,\"z\":0.5}}]}}\n");
    fs::write(dir.join("many.jsonl"), (0..count).map(line).collect::<String>()).unwrap();
}

#[test]
fn a_hangup_ends_a_batch_unless_it_is_ignored() {
    let dir = corridor();
    let partial = dir.path().join("cut.partial");
    // One that is to end must not be done before the signal comes.
    for (before, code, count) in [("", 130, 500_000), ("trap '' HUP; ", 0, 30_000)] {
        many(dir.path(), count);
        let program = env!("CARGO_BIN_EXE_sightline");
        let words =
            format!("{before}exec {program} score scene.json many.jsonl --backend cpu --out cut");
        let mut child = Command::new("sh")
            .args(["-c", &words])
            .current_dir(dir.path())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        wait_for(|| fs::metadata(&partial).is_ok_and(|meta| meta.len() > 2000));
        interrupt(&child, "-HUP");
        assert_eq!(child.wait().unwrap().code(), Some(code), "{before}");
        assert_eq!((partial.exists(), dir.path().join("cut").exists()), (code > 0, code == 0));
        let _ = fs::remove_file(&partial);
    }
}

#[test]
fn a_batch_that_is_not_kept_says_how_far_it_came() {
    let dir = corridor();
    many(dir.path(), 30_000);
    let second = scene().to_string().replace("\"corridor\"", "\"second\"");
    fs::write(dir.path().join("second.json"), second).unwrap();
    for (files, all) in [
        ("scene.json second.json many.jsonl", " of 30000 placements"),
        ("scene.json -", " placements"),
    ] {
        let mut command =
            program(&dir, &format!("score {files} --backend cpu --verbose --out cut"));
        command.stdin(fs::File::open(dir.path().join("many.jsonl")).unwrap());
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let (mut told, mut words) = told_until_work(&mut child);
        std::thread::sleep(Duration::from_millis(50));
        interrupt(&child, "-INT");
        told.read_to_string(&mut words).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{words}");
        let says = words.contains("interrupted after ") && words.contains(all);
        assert!(says && words.contains("cut is not written"), "{words}");
        assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
        assert!(!dir.path().join("cut").exists());
    }
}

#[test]
fn a_scan_ends_soon_within_a_long_frame_and_goes_on() {
    let dir = world();
    change_as(&dir, ["town.json", "dense.json"], |town| {
        town["lidar"] =
            json!({ "channels": 128, "fov": [-20, 2], "azimuth_steps": 20_000, "range": 40 })
    });
    let args = "scan dense.json --placement p.json --backend cpu --threads 1";
    let mut child = spawn(dir.path(), &(args, "--out set"));
    wait_for(|| dir.path().join("set").exists());
    let start = Instant::now();
    interrupt(&child, "-TERM");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

#[test]
fn a_page_of_a_run_that_time_ended_says_so() {
    let dir = world();
    let args = "optimize town.json --backend cpu";
    let page = |folder: &str, limit: &str| {
        ok(&dir, &(args, ["--out", folder], limit));
        fs::read_to_string(dir.path().join(folder).join("report.html")).unwrap()
    };
    page("ended", "--max-seconds 2 --evaluations 1000000")
        .says(" --max-seconds 2")
        .says("Time ended this run");
    let whole = page("whole", "--max-seconds 500 --evaluations 8");
    assert!(!whole.contains("--max-seconds") && whole.contains("They give the same bytes"));
}

#[test]
fn a_batch_that_was_killed_at_its_start_begins_anew() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    let args = "score scene.json placements.json --backend cpu --out";
    printed(&dir, &(args, "whole"));
    for begin in ["", "{\"sightline_part"] {
        fs::write(at("cut.partial"), begin).unwrap();
        printed(&dir, &(args, "cut --resume"));
        assert!(fs::read(at("cut")).unwrap() == fs::read(at("whole")).unwrap());
        assert!(!at("cut.partial").exists());
        fs::remove_file(at("cut")).unwrap();
    }
    write(&dir, "cut.partial", "my notes");
    fails(&dir, &(args, "cut --resume")).says("was begun with other");
    assert_eq!(fs::read_to_string(at("cut.partial")).unwrap(), "my notes");
}

#[test]
fn a_front_that_was_killed_goes_on_to_the_same_bytes() {
    let dir = TempDir::new().unwrap();
    let require = json!([{ "target": "car", "from": 5, "within": 15, "share": 0.9 }]);
    crate::front::street(dir.path(), [30, 11], require);
    let line = "optimize street.json --front price,near_gain --backend cpu --evaluations 30 --out";
    let (code, [_, told]) = ran(&dir, &(line, "whole"));
    assert!(matches!(code, Some(0 | 1)), "{told}");
    for signal in ["-KILL", "-INT"] {
        let mut child = spawn(dir.path(), &(line, "cut"));
        wait_for(|| dir.path().join("cut/checkpoint.json").exists());
        interrupt(&child, signal);
        let status = child.wait().unwrap();
        assert_eq!(status.code(), (signal != "-KILL").then_some(130), "{signal}");
        let finished = fs::read_to_string(dir.path().join("cut/result.json")).unwrap_or_default();
        assert!(!finished.contains("complete: "), "{signal}: ended before it was told to");
        let (resumed, [_, told]) = ran(&dir, "optimize --resume cut --backend cpu");
        assert_eq!(resumed, code, "{told}");
        crate::front::assert_same(dir.path(), "whole", "cut");
        fs::remove_dir_all(dir.path().join("cut")).unwrap();
    }
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

#[test]
fn a_run_that_is_ended_at_once_says_how_to_go_on() {
    let dir = world();
    let line = "optimize town.json --backend cpu --evaluations 90000 --method cma --out cut";
    let child = spawn(dir.path(), line);
    wait_for(|| dir.path().join("cut/checkpoint.json").exists());
    // The checkpoint is a moment older than the words.
    std::thread::sleep(Duration::from_millis(300));
    interrupt(&child, "-INT");
    interrupt(&child, "-TERM");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.contains("go on with --resume cut") && !told.contains("stopped"), "{told}");
}
