//! One sentence for each wrong argument; numbers below 0 as values of options.

use std::ffi::OsString;

use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::json::nearest;

use crate::study::Kind;

/// Most commands that a sentence names as owners of an option.
const MOST_OWNERS: usize = 3;

/// Values that begin with a minus and a digit, joined to the option before them: `--tolerance -1mm,2deg` becomes
/// `--tolerance=-1mm,2deg`, so that the option's own message refuses it. Plain numbers reach options anyway.
pub(super) fn with_values_below_0(arguments: &[OsString]) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::with_capacity(arguments.len());
    for word in arguments {
        let is_value = word.to_str().is_some_and(is_below_0);
        match joined.last_mut().filter(|last| is_value && last.to_str().is_some_and(is_option)) {
            Some(option) => {
                option.push("=");
                option.push(word);
            }
            None => joined.push(word.clone()),
        }
    }
    joined
}

/// True for `-1mm`, `-.5,2`: no option begins so, and it is no plain number.
fn is_below_0(word: &str) -> bool {
    let digits = word.strip_prefix('-').map(|rest| rest.trim_start_matches('.'));
    digits.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
        && word.parse::<f64>().is_err()
}

/// True for `--name`, without a value behind it.
fn is_option(word: &str) -> bool {
    word.len() > 2 && word.starts_with("--") && !word.contains('=')
}

/// The mend for numbers that are words of their own behind an option that takes them with commas: `--base-link 0.3 0 0`.
pub(super) fn numbers_apart(program: &Command, arguments: &[OsString]) -> Option<String> {
    let (command, names) = command_of(program, arguments);
    let words: Vec<&str> = arguments.iter().map(|word| word.to_str().unwrap_or_default()).collect();
    let takes_list = |arg: &clap::Arg, name: &str| {
        let names = arg.get_value_names().unwrap_or_default();
        arg.get_long() == Some(name) && names.iter().any(|name| name.contains(','))
    };
    words.iter().enumerate().find_map(|(k, option)| {
        let name = option.strip_prefix("--")?;
        let behind = words[k + 1..].iter().copied();
        let numbers: Vec<&str> = behind.take_while(|word| word.parse::<f64>().is_ok()).collect();
        let is_apart =
            numbers.len() > 1 && command.get_arguments().any(|arg| takes_list(arg, name));
        let (given, mend) = (numbers.join(" "), numbers.join(","));
        is_apart.then(|| {
            let told = format!("{option} {given}: write it with commas: {option}={mend}");
            with_help(&told, &names)
        })
    })
}

/// A refusal with the command that prints the help.
fn with_help(told: &str, names: &[&str]) -> String {
    format!("{told}; see `{} --help`", names.join(" "))
}

/// An error of the arguments in one line: the mistake, a near name, the command that prints the help.
pub(super) fn sentence(error: &clap::Error, program: &Command, arguments: &[OsString]) -> String {
    let (command, names) = command_of(program, arguments);
    let its_name = names[1..].join(" ");
    let told = unknown_option(error, program, (command, its_name.as_str()))
        .or_else(|| one_too_many(error, command, &its_name))
        .or_else(|| unknown_study(error, command))
        .or_else(|| known_elsewhere(error))
        .or_else(|| scenes_of_a_resumed_run(error))
        .or_else(|| no_scene(error))
        .or_else(|| unknown_command(error, program, command))
        .unwrap_or_else(|| told(error));
    with_help(&told, &names)
}

/// A text that clap keeps of the mistake.
fn text(error: &clap::Error, kind: ContextKind) -> Option<&str> {
    match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text),
        _ => None,
    }
}

/// Values that users of other programs write: the option, the values, and the own one in words.
const KNOWN_ELSEWHERE: [(&str, &[&str], &str); 3] = [
    (
        "--backend ",
        &["cuda", "vulkan", "opencl", "metal", "nvidia", "rocm"],
        "gpu takes any Vulkan device",
    ),
    ("--kind ", &["city", "urban"], "town has blocks of houses on a grid of streets"),
    ("--layout ", &["kitti"], "semantickitti is KITTI's layout with labels"),
];

/// Refusal of a value of [`KNOWN_ELSEWHERE`], with the own one in place of a similar word.
fn known_elsewhere(error: &clap::Error) -> Option<String> {
    let (option, value) =
        (text(error, ContextKind::InvalidArg)?, text(error, ContextKind::InvalidValue)?);
    let is_it = |of: &&(&str, &[&str], &str)| option.starts_with(of.0) && of.1.contains(&value);
    let (.., hint) = KNOWN_ELSEWHERE.iter().find(is_it)?;
    let told = told(error);
    let (told, _) = told.split_once("; a similar ").unwrap_or((told.as_str(), ""));
    Some(format!("{told}; {hint}"))
}

/// Refusal of scenes beside --resume.
fn scenes_of_a_resumed_run(error: &clap::Error) -> Option<String> {
    let told = told(error);
    let names_both = told.contains("[SCENE]") && told.contains("--resume ");
    (error.kind() == ErrorKind::ArgumentConflict && names_both)
        .then(|| "--resume: a resumed run knows its scenes; leave them out".to_owned())
}

/// Refusal of a command without its scene, with a way to have one.
fn no_scene(error: &clap::Error) -> Option<String> {
    let told = told(error);
    (error.kind() == ErrorKind::MissingRequiredArgument && told.contains("<SCENE"))
        .then(|| format!("{told}; `sightline scene new --out street.json` makes a scene"))
}

/// Words of clap: the fault, lists that belong to it, and tips but for the one to write `--` before an option.
fn told(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines = text.lines().map(str::trim);
    // The usage, which is long, stands in the help.
    let told = lines
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"))
        .filter(|line| !line.is_empty() && !line.starts_with("tip: to pass "));
    let mut words = String::new();
    for line in told {
        let (between, line) = match (line.strip_prefix("tip: "), words.ends_with(':')) {
            _ if words.is_empty() => ("", line.strip_prefix("error: ").unwrap_or(line)),
            (Some(tip), _) => ("; ", tip),
            (None, true) => (" ", line),
            (None, false) if line.starts_with('[') => (" ", line),
            (None, false) => (", ", line),
        };
        words += between;
        words += line;
    }
    in_words(&words)
}

/// Clap's whole numbers in words, without a largest value that is a limit of the computer.
fn in_words(told: &str) -> String {
    let faults = ["invalid digit found in string", "cannot parse integer from empty string"];
    if let Some(start) = faults.iter().find_map(|fault| told.strip_suffix(fault)) {
        return format!("{start}give a whole number");
    }
    let parts = told.split_once(" is not in ").and_then(|(given, range)| {
        let (least, most) = range.split_once("..=")?;
        Some((given, least, most))
    });
    match parts {
        Some((given, least, most)) if most == u32::MAX.to_string() => {
            format!("{given} is not a whole number from {least} on")
        }
        Some((given, least, most)) => {
            format!("{given} is not a whole number from {least} to {most}")
        }
        None => told.to_owned(),
    }
}

/// An option that the command does not have: the commands that have it, and the command's own option of a near name.
fn unknown_option(
    error: &clap::Error,
    program: &Command,
    (command, its_name): (&Command, &str),
) -> Option<String> {
    if error.kind() != ErrorKind::UnknownArgument {
        return None;
    }
    let given = text(error, ContextKind::InvalidArg)?;
    let name = given.strip_prefix("--")?.split('=').next()?;
    let owners = owners(program, name, "");
    let near = nearest(name, command.get_arguments().filter_map(clap::Arg::get_long));
    // A name that another command knows is no slip, unless one of the two is the other's beginning.
    let begins = |near: &str| near.starts_with(name) || name.starts_with(near);
    let near = near.filter(|near| owners.is_empty() || begins(near));
    let near = near.map(|near| format!("; a similar argument exists: '--{near}'"));
    let said = match &owners[..] {
        [] => format!("unexpected argument '{given}' found"),
        _ => format!("`--{name}` is an option of {}", listed(&owners)),
    };
    let mend = match (owners.is_empty(), std::ptr::eq(command, program)) {
        (false, true) => "; write it behind the command".to_owned(),
        (false, false) => {
            format!(", not of `{its_name}`{}", super::rig::instead_of(name, its_name))
        }
        (true, _) => String::new(),
    };
    Some(format!("{said}{mend}{}", near.unwrap_or_default()))
}

/// A file more than the command takes; `None` where it takes none, or many.
fn one_too_many(error: &clap::Error, command: &Command, its_name: &str) -> Option<String> {
    let is_unknown = error.kind() == ErrorKind::UnknownArgument;
    let given = text(error, ContextKind::InvalidArg).filter(|_| is_unknown)?;
    let name = |arg: &clap::Arg| match arg.get_value_names() {
        Some([name, ..]) => format!("one {name}"),
        _ => format!("one {}", arg.get_id().as_str().to_uppercase()),
    };
    let taken: Vec<String> = command.get_positionals().map(name).collect();
    (!given.starts_with('-') && !taken.is_empty()).then(|| {
        format!(
            "'{given}' is one too many: `{its_name}` takes {}; give one, then another in a run of its own",
            taken.join(" and ")
        )
    })
}

/// A command that stands below another one, as a study: its whole name.
fn unknown_command(error: &clap::Error, program: &Command, command: &Command) -> Option<String> {
    if error.kind() != ErrorKind::InvalidSubcommand || !std::ptr::eq(command, program) {
        return None;
    }
    let given = text(error, ContextKind::InvalidSubcommand)?;
    let is_kind = Kind::ALL.iter().any(|(_, name, _)| *name == given);
    let study = is_kind.then(|| format!("study {given}"));
    let owners = program.get_subcommands().filter(|above| above.find_subcommand(given).is_some());
    let owners = owners.map(|above| format!("{} {given}", above.get_name()));
    let names: Vec<String> =
        study.into_iter().chain(owners).map(|name| format!("`{name}`")).collect();
    let names = names.join(" or ");
    (!names.is_empty()).then(|| format!("there is no command `{given}`; did you mean {names}?"))
}

/// Refusal of an unknown kind of study, with the names of all kinds.
fn unknown_study(error: &clap::Error, command: &Command) -> Option<String> {
    let is_kind = error.kind() == ErrorKind::InvalidValue
        && command.get_name() == "study"
        && text(error, ContextKind::InvalidArg) == Some("<KIND>");
    let given = text(error, ContextKind::InvalidValue).filter(|_| is_kind)?;
    let own = command.get_subcommands().map(Command::get_name).filter(|name| *name != "help");
    let all: Vec<&str> = Kind::ALL.iter().map(|(_, name, _)| *name).chain(own).collect();
    let near = nearest(given, all.iter().copied());
    let near = near.map(|near| format!("; a similar value exists: '{near}'"));
    Some(format!(
        "invalid value '{given}' for '<KIND>' [possible values: {}]{}",
        all.join(", "),
        near.unwrap_or_default()
    ))
}

/// Names of all commands that have an option.
fn owners(command: &Command, option: &str, names: &str) -> Vec<String> {
    let has = |command: &Command| command.get_arguments().any(|arg| arg.get_long() == Some(option));
    let mut found = Vec::new();
    for below in command.get_subcommands().filter(|below| !below.is_hide_set()) {
        let names = format!("{names} {}", below.get_name()).trim().to_owned();
        let of_below = owners(below, option, &names);
        found.extend(has(below).then_some(names));
        found.extend(of_below);
    }
    found
}

/// The first names in words.
fn listed(owners: &[String]) -> String {
    let quoted = |owners: &[String]| owners.iter().map(|it| format!("`{it}`")).collect::<Vec<_>>();
    match owners.len() {
        0..=1 => quoted(owners).concat(),
        2..=MOST_OWNERS => {
            let (last, first) = owners.split_last().unwrap_or((&owners[0], owners));
            format!("{} and `{last}`", quoted(first).join(", "))
        }
        _ => format!("{} and others", quoted(&owners[..MOST_OWNERS]).join(", ")),
    }
}

/// The command that the arguments begin with, and its names, the program's first; a kind of study counts as a name.
fn command_of<'a>(program: &'a Command, arguments: &[OsString]) -> (&'a Command, Vec<&'a str>) {
    let (mut at, mut path) = (program, vec![program.get_name()]);
    for word in arguments.iter().skip(1) {
        let Some(next) = word.to_str().and_then(|word| at.find_subcommand(word)) else { break };
        at = next;
        path.push(at.get_name());
    }
    let kind = arguments.get(path.len()).and_then(|word| word.to_str());
    let kind = kind.filter(|_| at.get_name() == "study");
    let known = kind.and_then(|kind| Kind::ALL.iter().find(|(_, name, _)| *name == kind));
    path.extend(known.map(|(_, name, _)| *name));
    (at, path)
}

#[cfg(test)]
mod tests {
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
            (
                "score s.json --format jsn",
                "for '--format <FORMAT>' [possible values: text, json, csv]",
            ),
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
                "score s.json --figures f",
                "`--figures` is an option of `optimize`, `view`, `study nearfield` and others, not of `score`; see",
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
            refused("info a")
                .contains("did you mean `psog info` or `sensor info` or `scene info`?")
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
            (
                "optimize s.json --tolerance -1mm,2deg",
                "is not below 0: write a length and an angle",
            ),
            ("optimize s.json --delta -0.1,2", "is no spacing"),
            ("optimize s.json --bound -1", "give 0 to 100 per cent, as 2"),
            ("optimize s.json --memory -1G", "give at least one byte"),
            ("study targets s.json --distances -1,2", "give metres above 0 and up to 1000"),
            ("optimize s.json --budget 12k", "give a number, as 12000"),
            ("optimize s.json --frames abc", "'abc' for '--frames <N>': give a whole number;"),
            (
                "optimize s.json --tolerance 5m,90deg",
                "is no tolerance; at most 1 m and 57.3°: write",
            ),
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
        assert!(
            parse(&words("rig export a.json --format urdf --out b --base-link -1,0,2")).is_ok()
        );
    }
}
