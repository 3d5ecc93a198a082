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
mod tests;
