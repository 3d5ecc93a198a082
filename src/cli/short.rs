//! `-h` on one screen: the options of each command that matter most, and one example. `--help` has all.

use std::ffi::OsString;

use clap::Command;

use super::kinds;

/// Columns of help.
pub(super) const COLUMNS: usize = 80;

/// Options that `-h` shows, by command; those of the commands below `study` count for each of them alone.
const SHOWN: [(&str, &[&str]); 25] = [
    ("optimize", &["vehicle", "budget", "out"]),
    ("score", &["vehicle", "format", "out"]),
    ("view", &["vehicle", "baselines", "out"]),
    ("cast", &["frame", "vehicle", "out"]),
    ("scan", &["placement", "layout", "out"]),
    ("verify", &["backend", "frames", "random"]),
    ("chart", &["objective", "full", "out"]),
    ("audit", &["objective", "vehicle"]),
    ("study", &["vehicle", "out"]),
    ("study nearfield", &["vehicle", "frames", "out"]),
    ("study targets", &["targets", "vehicle", "out"]),
    ("study redundancy", &["vehicle", "frames"]),
    ("study overlap", &["least_shared", "vehicle", "frames"]),
    ("study sweep", &["field", "from", "to"]),
    ("study tolerance", &["vehicle", "most_mm", "most_deg"]),
    ("psog build", &["kitti", "nuscenes", "out"]),
    ("rig export", &["format", "vehicle", "out"]),
    ("rig import", &["format", "sensor", "out"]),
    ("rig compare", &["base_frame", "base_link", "format"]),
    ("rig handover", &["vehicle", "base_link", "out"]),
    ("scene new", &["kind", "seed", "out"]),
    ("scene import", &["nuscenes", "carla", "out"]),
    ("scene info", &["format"]),
    ("sensor info", &["azimuth_steps", "format", "out"]),
    ("bench device", &["placements", "frames", "rounds"]),
];

/// True where `-h` is asked for, or a command that needs others is given alone: help of one screen.
pub(super) fn is_short(arguments: &[OsString]) -> bool {
    !arguments.iter().skip(1).any(|word| word == "--help" || word == "help")
}

/// Leaves the options of [`SHOWN`] in `-h`, in every command that the table has.
pub(super) fn with_short_help(command: Command) -> Command {
    below(command, "")
}

fn below(command: Command, path: &str) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|it| it.get_name().to_owned()).collect();
    let command = names.iter().fold(command, |command, name| {
        let path = format!("{path} {name}").trim().to_owned();
        command.mut_subcommand(name, |command| below(command, &path))
    });
    match SHOWN.iter().find(|(name, _)| *name == path) {
        Some((_, shown)) => command.mut_args(|arg| {
            let is_hidden = !arg.is_positional() && !shown.contains(&arg.get_id().as_str());
            if is_hidden { arg.hide_short_help(true) } else { arg }
        }),
        None => command,
    }
}

/// One screen: the first example alone, no command `help`; the program and `study` list their commands tightly.
pub(super) fn on_one_screen(command: Command) -> Command {
    let program = with_one_example(command).disable_help_subcommand(true);
    let example = example_of(&program);
    let study = |study: Command| {
        let example = example_of(&study);
        // The help of one kind is like that of a command.
        if study.get_subcommands().all(Command::is_hide_set) {
            return study;
        }
        study.help_template(format!(
            "{{about-with-newline}}\nUsage: sightline study <KIND> [OPTIONS] <SCENE…>...; options: study <KIND> -h\n\n{}{{subcommands}}\n\n{example}",
            kinds::lines()
        ))
    };
    program.mut_subcommand("study", study).help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\nCommands:\n{{subcommands}}\n\
         Options: -h, --help; -V, --version; of a command: sightline COMMAND -h\n{example}"
    ))
}

/// A command in lines of at most [`COLUMNS`]: broken as shells read it, before options and redirections.
pub(super) fn broken(command: &str) -> String {
    if command.chars().count() <= COLUMNS {
        return command.to_owned();
    }
    let mut lines: Vec<String> = Vec::new();
    for part in command.replace(" --", "\n--").replace(" > ", "\n> ").split('\n') {
        let indent = if lines.is_empty() { "" } else { "    " };
        // Two more columns are the backslash's.
        let fits = |line: &&mut String| line.chars().count() + part.chars().count() + 3 <= COLUMNS;
        match lines.last_mut().filter(fits) {
            Some(line) => *line += &format!(" {part}"),
            None => lines.push(format!("{indent}{part}")),
        }
    }
    lines.join(" \\\n")
}

/// The first example of a command: on one line where it fits.
fn example_of(command: &Command) -> String {
    let written = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let example = written.lines().find(|line| line.starts_with("  ")).unwrap_or_default();
    match "Example:".len() + example.chars().count() <= COLUMNS {
        true => format!("Example:{example}"),
        false => format!("Example:\n{}", broken(example)),
    }
}

fn with_one_example(command: Command) -> Command {
    let command = command.mut_subcommands(with_one_example).disable_help_subcommand(true);
    let is_there = command.get_after_help().is_some();
    let example = example_of(&command);
    match is_there {
        true => command.help_template(format!(
            "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{{all-args}}\n\n{example}"
        )),
        false => command,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_command_is_broken_before_options_and_redirections() {
        let scenes = "  sightline score scenes/highway.json scenes/residential.json mine.json";
        assert_eq!(broken(scenes), scenes);
        let long = format!("{scenes} --format json --quiet > scores.json");
        let want = format!("{scenes} \\\n    --format json --quiet > scores.json");
        assert_eq!(broken(&long), want);
    }

    fn option_of<'a>(command: &'a Command, path: &str, id: &str) -> Option<&'a clap::Arg> {
        let command = path.split(' ').try_fold(command, |at, name| at.find_subcommand(name))?;
        command.get_arguments().find(|arg| arg.get_id() == id)
    }

    #[test]
    fn every_entry_names_an_option_that_is_there() {
        let program = crate::cli::program();
        for (path, shown) in SHOWN {
            assert!(shown.len() <= 3, "{path}");
            for id in shown {
                let found = option_of(&program, path, id);
                let found = found.unwrap_or_else(|| panic!("{path} has no option `{id}`"));
                assert!(!found.is_hide_short_help_set(), "{path} {id}");
            }
        }
        let hidden = option_of(&program, "optimize", "adapter").unwrap();
        assert!(hidden.is_hide_short_help_set());
    }
}
