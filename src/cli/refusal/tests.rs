//! Refusals of arguments in one sentence each.

use super::super::usage::{is_help, with_examples};
use super::*;
use crate::cli::{Refused, parse, program};

fn words(line: &str) -> Vec<OsString> {
    "sightline".split(' ').chain(line.split(' ')).map(OsString::from).collect()
}

fn refused(line: &str) -> String {
    match parse(&words(line)) {
        Err(Refused::Sentence(told)) => told,
        _ => panic!("{line}: is not refused"),
    }
}

#[test]
fn wrong_arguments_are_one_sentence() {
    for (line, told) in [
        ("scan s.json", "arguments were not provided: --placement <PLACEMENTS>, --out <DIR>"),
        (
            "score s.json p.json --fromat json",
            "unexpected argument '--fromat' found; a similar argument exists: '--format'",
        ),
        ("score s.json --format jsn", "for '--format <FORMAT>' [possible values: text, json, csv]"),
        (
            "scan s.json --seed -1",
            "'--seed <N>': give a whole number from 0 to 18446744073709551615",
        ),
        ("score s.json --frames 0", "0 is not a whole number from 1 on"),
        ("chart --out c", "; `sightline scene new --out street.json` makes a scene"),
        ("scene make", "unrecognized subcommand 'make'"),
    ] {
        let said = refused(line);
        assert!(said.contains(told), "{line}: {said}");
        assert!(!said.contains('\n') && !said.contains("error:"), "{line}: {said}");
        let command = line.split(' ').next().unwrap();
        assert!(said.ends_with(&format!("; see `sightline {command} --help`")), "{said}");
    }
    let help = with_examples(program()).try_get_matches_from(["sightline", "scan", "--help"]);
    assert!(is_help(&help.unwrap_err()));
}

#[test]
fn a_mend_is_named_that_fits_the_mistake() {
    for (line, told) in [
        (
            "optimize s.json --backend cuda",
            "[possible values: auto, gpu, cpu]; gpu takes any Vulkan device; see `sightline optimize --help`",
        ),
        (
            "scene new --kind city --out t.json",
            "; town has blocks of houses on a grid of streets; see",
        ),
        (
            "scan s.json --placement p.json --out o --layout kitti",
            "; semantickitti is KITTI's layout with labels; see",
        ),
        (
            "study weather s.json --conditon fog",
            "'--condition'; see `sightline study weather --help`",
        ),
        (
            "optimize s.json --resume run",
            "--resume: a resumed run knows its scenes; leave them out; see `sightline optimize --help`",
        ),
    ] {
        let said = refused(line);
        assert!(said.contains(told) && !said.contains("similar value"), "{line}: {said}");
    }
    assert!(refused("score s.json --backend cpuu").contains("a similar value exists: 'cpu'"));
}

#[test]
fn an_option_of_another_command_is_named_with_its_command() {
    for (line, told) in [
        ("optimize s.json --random 4", "`--random` is an option of `verify`"),
        (
            "score s.json --budget=3",
            "`--budget` is an option of `optimize` and `study`, not of `score`;",
        ),
        (
            "optimize s.json --of 0.pitch",
            "`--of` is an option of `study sweep`, not of `optimize`;",
        ),
        ("score s.json --frame 3", "not of `score`; a similar argument exists: '--frames';"),
        (
            "cast s.json --figures f",
            "`--figures` is an option of `optimize`, `score`, `view` and others, not of `cast`; see",
        ),
        ("view s.json p.json --frames 2", "not of `view`; see"),
        (
            "rig import a.urdf --vehicle v.json",
            "not of `rig import`; --sensor FRAME=MODEL names the model of a LiDAR, and",
        ),
        ("rig compare a.urdf b.urdf --vehicle v.json", "not of `rig compare`; see"),
        ("--seed 3 optimize", "and others; write it behind the command;"),
        ("optimize s.json --gui", "unexpected argument '--gui' found; see"),
        ("optimize s.json -z", "unexpected argument '-z' found; see"),
    ] {
        let said = refused(line);
        assert!(said.contains(told), "{line}: {said}");
        assert!(!said.contains("to pass"), "{line}: {said}");
    }
}

#[test]
fn a_study_or_another_command_below_one_is_named_whole() {
    let studies = ["nearfield", "targets", "redundancy", "overlap", "sweep", "tolerance"];
    let kinds = Kind::ALL.map(|(_, name, _)| name);
    for name in studies.into_iter().chain(kinds) {
        let said = refused(&format!("{name} s.json"));
        let told = format!("there is no command `{name}`; did you mean `study {name}`?");
        assert!(said.starts_with(&told), "{said}");
    }
    assert!(
        refused("info a").contains("did you mean `psog info` or `sensor info` or `scene info`?")
    );
    assert!(refused("scores a").contains("unrecognized subcommand 'scores'"));
}

#[test]
fn a_run_that_goes_on_takes_no_option_that_its_state_decides() {
    for option in [
        "--vehicle m.json", "--sensor 0=a", "--tolerance 5mm,0.5deg", "--condition fog:mor=50",
        "--budget 3", "--seed 2",
    ] {
        let said = refused(&format!("optimize --resume run {option}"));
        let name = option.split(' ').next().unwrap();
        assert!(said.contains("'--resume <DIR>' cannot be used with '--"), "{said}");
        assert!(said.contains(&format!("'{name} <")), "{said}");
    }
    let taken = [
        "resume", "max_seconds", "figures", "format", "gltf", "backend", "adapter", "inexact",
        "threads", "memory", "verbose", "quiet", "strict", "trust_paths", "force", "help",
    ];
    let program = program();
    let optimize = program.find_subcommand("optimize").unwrap();
    for arg in optimize.get_arguments().filter(|arg| !taken.contains(&arg.get_id().as_str())) {
        let refuses = optimize.get_arg_conflicts_with(arg);
        assert!(refuses.iter().any(|other| other.get_id() == "resume"), "{}", arg.get_id());
    }
}

#[test]
fn a_file_more_than_a_command_takes_is_told_with_those_that_it_takes() {
    for (line, takes) in [
        ("study nearfield a.json b.json c.json", "one SCENE and one PLACEMENTS"),
        ("cast a.json b.json c.json", "one SCENE and one PLACEMENTS"),
        ("psog info a.npz c.json", "one PSOG"),
    ] {
        let said = refused(line);
        let name = line.split(" a.").next().unwrap();
        let told = format!("'c.json' is one too many: `{name}` takes {takes}; give one, then");
        assert!(said.starts_with(&told), "{said}");
    }
    assert!(refused("devices c.json").starts_with("unexpected argument 'c.json' found"));
}

#[test]
fn numbers_apart_are_to_be_written_with_commas() {
    for command in ["rig import", "rig compare"] {
        let line = format!("{command} a.urdf --base-link 0.3 0 -1");
        let mend = "--base-link 0.3 0 -1: write it with commas: --base-link=0.3,0,-1";
        assert_eq!(refused(&line), format!("{mend}; see `sightline {command} --help`"));
    }
    assert!(parse(&words("rig import a.urdf --base-link 0.3 b.urdf")).is_ok());
}

#[test]
fn values_below_0_reach_the_option() {
    let every = |line: &str| with_values_below_0(&words(line));
    assert_eq!(every("a --b -1mm,2 --c -1 -2 -3"), words("a --b=-1mm,2 --c -1 -2 -3"));
    assert_eq!(every("a -- -1mm --b=1 -1mm -q -.5x"), words("a -- -1mm --b=1 -1mm -q -.5x"));
    for (line, told) in [
        ("optimize s.json --tolerance -1mm,2deg", "is not below 0: write a length and an angle"),
        ("optimize s.json --delta -0.1,2", "is no spacing"),
        ("optimize s.json --bound -1", "give 0 to 100 per cent, as 2"),
        ("optimize s.json --memory -1G", "give at least one byte"),
        ("study targets s.json --distances -1,2", "give metres above 0 and up to 1000"),
        ("optimize s.json --budget 12k", "give a number, as 12000"),
        ("optimize s.json --frames abc", "'abc' for '--frames <N>': give a whole number;"),
        ("optimize s.json --tolerance 5m,90deg", "is no tolerance; at most 1 m and 57.3°: write"),
        (
            "rig export a.json --format urfd",
            "`urfd`; rigs are written in autoware, urdf, sdf, ros2-launch, carla, \
          carla-objects, json;",
        ),
        (
            "rig export a.json --format tf",
            "tf is read, but not written; take one of autoware, urdf,",
        ),
    ] {
        let said = refused(line);
        assert!(said.contains(told), "{line}: {said}");
    }
    assert!(parse(&words("rig export a.json --format urdf --out b --base-link -1,0,2")).is_ok());
}
