//! Help of every command: `-h` fits one screen and has an example, `--help` names every option.

use std::collections::{BTreeMap, BTreeSet};

use crate::cli::*;

/// Lines and columns of one screen.
const SCREEN: (usize, usize) = (24, 80);

/// Options of every command, by the completions for bash, which know nothing of what help shows.
fn options(script: &str) -> BTreeMap<Vec<String>, BTreeSet<String>> {
    let mut found = BTreeMap::new();
    let mut names: Option<Vec<String>> = None;
    for line in script.lines().map(str::trim) {
        let label = line.strip_suffix(')').filter(|label| label.starts_with("sightline"));
        if let Some(label) = label.filter(|label| !label.contains(',')) {
            let path = label.split("__subcmd__").skip(1).map(str::to_owned);
            names = Some(path.collect());
        } else if let (Some(given), Some(list)) = (&names, line.strip_prefix("opts=\"")) {
            let words = list.trim_end_matches('"').split(' ');
            let long = words.filter(|word| word.starts_with("--")).map(str::to_owned);
            found.insert(given.clone(), long.collect());
            names = None;
        }
    }
    found.retain(|names, _| !names.iter().any(|name| name == "help"));
    found
}

fn help(dir: &TempDir, names: &[String], flag: &str) -> String {
    stdout(dir, &(names.join(" "), flag))
}

fn has_word(text: &str, option: &str) -> bool {
    text.split(|c: char| c.is_whitespace() || ",[]()=".contains(c)).any(|word| word == option)
}

#[test]
fn short_help_fits_one_screen_and_long_help_names_every_option() {
    let dir = TempDir::new().unwrap();
    let all = options(&stdout(&dir, "completions bash"));
    assert!(all.len() > 30, "{} commands", all.len());
    let (lines, columns) = SCREEN;
    let mut hidden = 0;
    for (names, options) in &all {
        let short = help(&dir, names, "-h");
        let count = short.lines().count();
        assert!(count <= lines, "{names:?}: {count} lines\n{short}");
        let widest = short.lines().map(|line| line.chars().count()).max().unwrap();
        assert!(widest <= columns, "{names:?}: {widest} columns\n{short}");
        let example = short.split_once("Example").map(|(_, rest)| rest);
        assert!(example.is_some_and(|rest| rest.contains("  sightline ")), "{names:?}\n{short}");
        let long = help(&dir, names, "--help");
        let (_, below) = long.split_once("\nExample").unwrap();
        for line in below.lines() {
            assert!(line.chars().count() <= columns, "{names:?}: {line}");
        }
        for option in options {
            assert!(has_word(&long, option), "{names:?} lacks {option}\n{long}");
            hidden += usize::from(!has_word(&short, option));
        }
    }
    assert!(hidden > 100, "{hidden} options are left to --help");
}

#[test]
fn help_names_every_option_of_the_command_that_repeats_a_run() {
    let dir = in_room();
    let line = "optimize room.json --backend cpu --evaluations 4 --population 4 --method cma --enough 0.001 \
                --delta 0.3 --frames 1 --mirror --equal-height --fix z=1.5 --condition rain --out run";
    ok(&dir, line);
    let page = read_text(&dir, "run/report.html");
    let code = page.split("<code>").find(|code| code.starts_with("sightline optimize "));
    let (command, _) = code.unwrap().split_once("</code>").unwrap();
    let given: BTreeSet<&str> = command.split(' ').filter(|word| word.starts_with("--")).collect();
    assert!(given.contains("--enough") && given.len() > 10, "{command}");
    let long = help(&dir, &["optimize".to_owned()], "--help");
    for option in given {
        assert!(has_word(&long, option), "{option} of {command}");
    }
}

/// Options whose value differs between commands, and why.
const DIFFERENT: [(&str, &str); 11] = [
    ("--baselines", "a file, of which `view` takes one placement"),
    ("--carla", "a folder, or what the input is"),
    ("--frame", "number of a scene's frame; name of a rig's"),
    ("--nuscenes", "a folder, or what the input is"),
    ("--out", "a file or a folder"),
    ("--resume", "a folder, or the file of --out"),
    ("--scene", "a file, or one of a set"),
    ("--sensor", "a LiDAR by number or by frame"),
    ("--version", "of the program, or of a set's tables"),
    ("--voxel", "one edge or three"),
    ("--window", "frames, or seconds"),
];

/// Value names of an option in the help of a command, such as `<FILE>`; empty for a flag.
fn value(help: &str, option: &str) -> String {
    let line = help.lines().find_map(|line| {
        // Descriptions, which may begin with the name of another option, are indented further.
        let given = line.strip_prefix("      ").or_else(|| line.strip_prefix("  -v, "))?;
        let rest = given.strip_prefix(option)?;
        (rest.is_empty() || rest.starts_with(' ')).then_some(rest)
    });
    let rest = line.unwrap_or_default().trim_start();
    let named = rest.split_once("  ").map_or(rest, |(value, _)| value);
    if named.starts_with('<') { named.trim().to_owned() } else { String::new() }
}

#[test]
fn one_word_names_one_thing_in_all_commands() {
    let dir = TempDir::new().unwrap();
    let all = options(&stdout(&dir, "completions bash"));
    let mut values: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (names, options) in &all {
        let long = help(&dir, names, "--help");
        for option in options {
            values.entry(option).or_default().insert(value(&long, option));
        }
    }
    assert!(values["--vehicle"].contains("<FILE>") && values["--strict"].contains(""));
    let several = values.iter().filter(|(_, values)| values.len() > 1).map(|(option, _)| *option);
    let known: Vec<&str> = DIFFERENT.iter().map(|(option, _)| *option).collect();
    assert_eq!(several.collect::<Vec<_>>(), known, "{values:?}");
}
