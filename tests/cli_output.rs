//! Where results go: pipes that are closed or full, files that are none, and numbers below 0.

use std::fs::File;
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};

use crate::cli::*;

const SCORE: &str = "score scene.json placements.json --backend cpu";

fn with_stdout(dir: &Path, args: &impl Words, stdout: impl Into<Stdio>) -> Output {
    let child = program(dir, args).stdout(stdout).stderr(Stdio::piped()).spawn();
    child.unwrap().wait_with_output().unwrap()
}

#[test]
fn a_closed_pipe_ends_quietly_and_a_full_disk_in_a_sentence() {
    let dir = corridor();
    let optimize = "optimize scene.json --evaluations 4 --backend cpu --quiet";
    for args in [SCORE, "psog info corridor.psog.npz", "devices", optimize] {
        for format in ["text", "json"] {
            let args = format!("{args} --format {format}");
            let (reader, writer) = std::io::pipe().unwrap();
            drop(reader);
            let closed = with_stdout(dir.path(), &args, writer);
            assert!(closed.status.success(), "{args}: {closed:?}");
            if cfg!(target_os = "linux") {
                let full = File::options().write(true).open("/dev/full").unwrap();
                let full = with_stdout(dir.path(), &args, full);
                let message = String::from_utf8(full.stderr).unwrap();
                let is_told = message.contains("sightline: stdout: the disk is full; make room");
                assert!(full.status.code() == Some(2) && is_told, "{args}: {message}");
            }
        }
    }
    // Its words on stderr are lost, and no more than that.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let deaf = program(&dir, SCORE).stderr(writer).output().unwrap();
    assert!(deaf.status.success() && deaf.stdout.starts_with(b"corridor: "), "{deaf:?}");
}

#[test]
fn out_leaves_pipes_links_and_permissions_as_they_are() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    let to = |name: &str| {
        let output = sightline(&dir, &(SCORE, ["--format", "json", "--force", "--out", name]));
        assert!(output.status.success(), "{name}: {output:?}");
        output.stdout
    };
    assert!(Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = at("pipe");
        move || fs::read(pipe).unwrap()
    });
    to("pipe");
    let is_scores = |bytes: &[u8]| bytes.starts_with(b"{\"scene\"") && bytes.ends_with(b"}\n");
    assert!(is_scores(&reader.join().unwrap()));
    assert!(fs::symlink_metadata(at("pipe")).unwrap().file_type().is_fifo());

    write(&dir, "private", "");
    fs::set_permissions(at("private"), fs::Permissions::from_mode(0o600)).unwrap();
    symlink("private", at("link")).unwrap();
    symlink("new", at("dangling")).unwrap();
    to("link");
    to("dangling");
    for (link, file) in [("link", "private"), ("dangling", "new")] {
        assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink());
        assert!(is_scores(&fs::read(at(file)).unwrap()));
    }
    assert_eq!(fs::metadata(at("private")).unwrap().permissions().mode() & 0o777, 0o600);
    assert!(is_scores(&to("/dev/stdout")));

    for input in ["scene.json", "./placements.json", "corridor.psog.npz"] {
        let before = fs::read(at(input)).unwrap();
        fails(&dir, &(SCORE, ["--out", input])).says("is read by this command");
        assert_eq!(fs::read(at(input)).unwrap(), before);
    }
}

#[test]
fn results_are_text_in_a_pipe_and_in_a_file_unless_json_is_asked_for() {
    let dir = corridor();
    let psog = "psog info corridor.psog.npz";
    for (args, head) in [(SCORE, "corridor: through over 1 frame"), (psog, "region")] {
        let text = sightline(&dir, args).stdout;
        assert!(text.starts_with(head.as_bytes()), "{}", String::from_utf8_lossy(&text));
        assert!(ok(&dir, args).is_object());
    }
    let plain = sightline(&dir, SCORE).stdout;
    sightline(&dir, &(SCORE, "--out scores.txt"));
    assert_eq!(fs::read(dir.path().join("scores.txt")).unwrap(), plain);
}

#[test]
fn numbers_below_0_reach_the_options() {
    let dir = corridor();
    let optimize = "optimize scene.json --evaluations 4 --backend cpu";
    let run = ok(&dir, &(optimize, "--target -8e-8"));
    assert_eq!(run["settings"]["target"], -8e-8);
    // A score that no share reaches ends nothing, and is told.
    let (_, [_, said]) = ran(&dir, &(optimize, "--objective near_gain --enough 40 --out on"));
    let words = "--enough 40: no placement has more than 1 by near_gain, so the search goes on to its end; 40 % is \
                 --enough 0.4";
    said.says(words);
    for (option, value, words) in [
        ("--enough", "nan", "give a number"),
        ("--threads", "-1", "-1 is not a whole number from 1 to 65535"),
        ("--seed", "-1", "give a whole number from 0 to 18446744073709551615"),
        ("--max-seconds", "-1", "give 0 to 1000000000 seconds"),
    ] {
        fails(&dir, &(optimize, [option, value])).says(option).says(words);
    }
    fails(&dir, "chart scene.json --regret -1").says("give 0 to 1, as 0.01");
    for other in ["0", "fine"] {
        fails(&dir, &["chart", "scene.json", "--finest", other])
            .says("give metres above 0, as 0.1");
    }
}

#[test]
fn a_street_is_not_written_where_its_mesh_cannot_stand_beside_it() {
    let dir = corridor();
    fails(&dir, "scene new --triangles 20000 --out /dev/stdout")
        .says("/dev/stdout: is no regular file");
}
