//! `completions` and `man`: what the shells and groff at hand make of them.

use std::path::Component;

use sightline::score::{Objective, ObjectiveError};

use crate::cli::*;

fn is_there(program: &str) -> bool {
    let mut asked = Command::new(program);
    let there = asked.arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !there {
        eprintln!("left out: {program} is not installed");
    }
    there
}

#[test]
fn shells_complete_commands_and_options() {
    let dir = TempDir::new().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = stdout(&dir, &["completions", shell]);
        script.says("optimize").says("condition");
        write(&dir, shell, &script);
    }
    fails(&dir, "completions tcsh");
    if !is_there("bash") {
        return;
    }
    let complete = "source ./bash && COMP_WORDS=(sightline $1 $2) COMP_CWORD=$3 && \
                    _sightline sightline \"$4\" sightline && echo ${COMPREPLY[@]}";
    for (words, wanted) in [
        (["opt", "", "1", "opt"], "optimize"),
        (["scene", "imp", "2", "imp"], "import"),
        (["scan", "--lay", "2", "--lay"], "--layout"),
        (["completions", "po", "2", "po"], "powershell"),
    ] {
        let mut bash = Command::new("bash");
        bash.args(["--norc", "-c", complete, "bash"]).args(words).current_dir(dir.path());
        let output = bash.output().unwrap();
        let found = String::from_utf8_lossy(&output.stdout);
        assert_eq!(found.trim(), wanted, "{words:?}: {output:?}");
    }
}

#[test]
fn pages_are_there_for_all_commands_and_groff_finds_no_fault() {
    let dir = TempDir::new().unwrap();
    stdout(&dir, "man --out man1");
    let mut pages: Vec<String> = fs::read_dir(dir.path().join("man1"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    pages.sort();
    assert!(pages.len() > 25, "{pages:?}");
    for name in ["sightline.1", "sightline-optimize.1", "sightline-scene-new.1"] {
        assert!(pages.iter().any(|page| page == name), "{name} of {pages:?}");
    }
    let one = stdout(&dir, "man scene new");
    assert_eq!(one, read_text(&dir, "man1/sightline-scene-new.1"));
    one.says(".TH sightline-scene-new 1");
    fails(&dir, "man scene old").says("has no command `old`; it has ");
    if !is_there("groff") {
        return;
    }
    for page in pages {
        let mut groff = Command::new("groff");
        groff.args(["-man", "-Tutf8", "-ww", "-Kutf8", "-z"]).arg(&page);
        let output = groff.current_dir(dir.path().join("man1")).output().unwrap();
        let faults = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && faults.is_empty(), "{page}: {faults}");
    }
}

/// Files of a package, as Cargo packs them from a folder of the workspace.
fn packed(package: &str) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let args = ["package", "--list", "--allow-dirty", "--offline", "--package", package];
    let output = Command::new(env!("CARGO")).args(args).current_dir(root).output().unwrap();
    let faults = String::from_utf8_lossy(&output.stderr);
    // The program has no address of its own yet that a manifest could name.
    let known = "warning: manifest has no documentation, homepage or repository";
    let mut warnings = faults.lines().filter(|line| line.starts_with("warning"));
    assert!(output.status.success() && warnings.all(|line| line == known), "{package}: {faults}");
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

/// Contents of the program's package; `cargo publish --workspace --dry-run` also builds it.
#[test]
fn packages_hold_what_a_user_builds_and_nothing_else() {
    for (package, wanted) in [
        ("sightline", &["src/main.rs", "README.md", "LICENSE", "scenes/highway.json"][..]),
        ("sightline-cma", &["src/lib.rs", "README.md"]),
    ] {
        let files = packed(package);
        for file in wanted {
            assert!(files.iter().any(|packed| packed == file), "{package} lacks {file}");
        }
        let foreign = |file: &&String| ["fuzz/", "python/"].iter().any(|dir| file.starts_with(dir));
        assert!(files.iter().find(foreign).is_none(), "{package}");
    }
}

/// Path with its `..` resolved; `None` where they lead out of the folder that it begins in.
fn resolved(path: &Path) -> Option<PathBuf> {
    let mut found = PathBuf::new();
    for part in path.components() {
        let fits = match part {
            Component::ParentDir => found.pop(),
            part => {
                found.push(part);
                true
            }
        };
        if !fits {
            return None;
        }
    }
    Some(found)
}

/// A package is compiled where the rest of the project is not: shaders and tables must be in it.
#[test]
fn packages_hold_every_file_that_their_sources_include() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut included = 0;
    for (folder, package) in [
        ("", "sightline"),
        ("crates/cma", "sightline-cma"),
        ("crates/files", "sightline-files"),
        ("crates/formats", "sightline-formats"),
        ("crates/lidar-cast", "lidar-cast"),
        ("crates/scan", "sightline-scan"),
        ("crates/scene", "sightline-scene"),
        ("crates/worlds", "sightline-worlds"),
    ] {
        let files = packed(package);
        let is_source = |file: &&String| {
            file.starts_with("src/") && file.ends_with(".rs") && !file.contains("/tests")
        };
        for file in files.iter().filter(is_source) {
            let text = fs::read_to_string(root.join(folder).join(file)).unwrap();
            for rest in text.split("include_str!(\"").skip(1) {
                let name = rest.split('"').next().unwrap();
                let target = resolved(&Path::new(file).parent().unwrap().join(name));
                let target = target.map(|path| path.to_str().unwrap().to_owned());
                assert!(
                    target.is_some_and(|path| files.contains(&path)),
                    "{package}: {file}: {name}"
                );
                included += 1;
            }
        }
    }
    assert!(included >= 10, "{included} files are included");
}

/// Names in the help of `--objective` are those that an unknown one is answered with.
#[test]
fn the_help_names_every_score_that_may_be_maximized() {
    let help = stdout(".", "optimize --help");
    let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let (_, names) = help.split_once("--objective <OBJECTIVE>").unwrap();
    let unknown = "no_score".parse::<Objective>().unwrap_err();
    let ObjectiveError::UnknownMetric { known, .. } = unknown else { panic!("{unknown}") };
    for name in known.split(", ") {
        let is_named = |word: &str| word.trim_end_matches([',', ';']) == name;
        assert!(names.split(' ').take(60).any(is_named), "{name} is not in the help");
    }
}
