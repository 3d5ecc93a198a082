//! Help with examples, completions for shells, manual pages, schemas for editors.

use std::ffi::OsString;
use std::io::Write;
use std::path::Path;

use crate::json::FileKind;
use clap::Command;
use clap::error::ErrorKind;
use clap_complete::Shell;
use clap_mangen::Man;

use super::output::Exit;
use super::short::{COLUMNS, broken};
use crate::files::{shared_folder, write_whole};
use crate::runs::RunError;

/// True if clap has only been asked to print, or has nothing to say but the help.
pub(super) fn is_help(error: &clap::Error) -> bool {
    !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
}

/// Why names of files cannot be written, where one is not UTF-8: results and checkpoints are JSON.
pub(super) fn not_utf8(arguments: &[OsString]) -> Option<String> {
    if let Some(argument) = arguments.iter().find(|argument| argument.to_str().is_none()) {
        let shown = argument.to_string_lossy();
        return Some(format!(
            "{shown}: is not UTF-8, and results name their files in JSON; rename it"
        ));
    }
    let folder = std::env::current_dir().ok().filter(|folder| folder.to_str().is_none())?;
    let shown = folder.display();
    Some(format!(
        "{shown}: this folder's name is not UTF-8, and results name it in JSON; rename it"
    ))
}

/// A text in lines of at most [`COLUMNS`]: prose broken anew, and commands, which begin with a blank, so that they can be copied.
fn narrow(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    let is_prose = |line: &str| !line.is_empty() && !line.starts_with(' ');
    let mut goes_on = false;
    for line in text.lines() {
        if !is_prose(line) {
            lines.push(broken(line));
        }
        for word in line.split(' ').filter(|_| is_prose(line)) {
            let last = lines.last_mut().filter(|_| goes_on);
            match last.filter(|last| last.chars().count() + 1 + word.chars().count() <= COLUMNS) {
                Some(last) => *last += &format!(" {word}"),
                None => lines.push(word.to_owned()),
            }
            goes_on = true;
        }
        goes_on = is_prose(line);
    }
    lines.join("\n")
}

/// Prints the text below the options as [`narrow`] has it: clap would break commands anywhere.
pub(super) fn with_examples(command: Command) -> Command {
    let examples = command.get_after_help().map(ToString::to_string);
    let command = command.mut_subcommands(with_examples);
    match examples {
        // Clap prints a template unchanged but for its tags.
        Some(examples) => command.help_template(format!(
            "{{before-help}}{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{{all-args}}\n\n{}",
            narrow(&examples)
        )),
        None => command,
    }
}

/// Kinds of files that a schema describes.
#[derive(Clone, Copy, clap::ValueEnum)]
pub(super) enum SchemaKind {
    Scene,
    Vehicle,
    Placements,
    Targets,
}

/// Prints the JSON Schema of a kind of file.
pub(super) fn schema(kind: SchemaKind) -> Result<Exit, RunError> {
    let kind = match kind {
        SchemaKind::Scene => FileKind::Scene,
        SchemaKind::Vehicle => FileKind::Vehicle,
        SchemaKind::Placements => FileKind::Placements,
        SchemaKind::Targets => FileKind::Target,
    };
    out!("{:#}\n", sightline_scene::schema::schema(kind))?;
    Ok(Exit::Done)
}

/// Prints the completions of the program for a shell.
pub(super) fn completions(shell: Shell, mut program: Command) -> Result<Exit, RunError> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut program, "sightline", &mut text);
    out!("{}", String::from_utf8_lossy(&text))?;
    Ok(Exit::Done)
}

/// Prints a page, or writes all of them.
pub(super) fn man(
    words: &[String],
    out: Option<&Path>,
    program: Command,
) -> Result<Exit, RunError> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    if let Some(folder) = out {
        shared_folder(folder)?;
        for command in with_commands(&program) {
            let path = folder.join(Man::new(command.clone()).get_filename());
            let page = page(command)?;
            write_whole(&path, |file| file.write_all(&page).map_err(RunError::io(&path)))?;
        }
        return Ok(Exit::Done);
    }
    let mut command = &program;
    for word in words {
        command = command.find_subcommand(word).ok_or_else(|| {
            let known: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
            let of = command.get_display_name().unwrap_or(command.get_name());
            RunError::Usage(match &known[..] {
                [] => format!("man: {of} has no command `{word}`, nor any other; leave it out"),
                _ => format!("man: {of} has no command `{word}`; it has {}", known.join(", ")),
            })
        })?;
    }
    out!("{}", String::from_utf8_lossy(&page(command)?))?;
    Ok(Exit::Done)
}

/// A command, and all below it.
fn with_commands(command: &Command) -> Vec<&Command> {
    let below = command.get_subcommands().filter(|command| !command.is_hide_set());
    std::iter::once(command).chain(below.flat_map(with_commands)).collect()
}

fn page(command: &Command) -> Result<Vec<u8>, RunError> {
    let mut page = Vec::new();
    let rendered = Man::new(command.clone()).render(&mut page);
    rendered.map_err(RunError::io(Path::new("man")))?;
    Ok(page)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    /// Every command below one, with its names.
    fn each(command: &Command, names: &str, look: &mut impl FnMut(&str, &Command)) {
        look(names, command);
        for below in command.get_subcommands().filter(|below| below.get_name() != "help") {
            each(below, &format!("{names} {}", below.get_name()), look);
        }
    }

    #[test]
    fn every_help_has_examples_that_survive_copying() {
        let mut program = with_examples(Cli::command()).term_width(COLUMNS);
        program.build();
        let (mut commands, mut long) = (0, 0);
        each(&program, "sightline", &mut |names, command| {
            let written = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let help = command.clone().render_long_help().to_string();
            let mut examples = written.lines().filter(|line| line.starts_with("  "));
            assert!(written.starts_with("Example"), "{names}: {written}");
            assert!(examples.clone().count() > 0, "{names}");
            assert!(examples.all(|line| line.contains("sightline ")), "{names}: {written}");
            let whole = help.replace(" \\\n    ", " ");
            let shown: Vec<&str> = whole.split_whitespace().collect();
            let words: Vec<&str> = written.split_whitespace().collect();
            assert!(shown.ends_with(&words), "{names}: {written}\n{help}");
            for line in written.lines().filter(|line| line.starts_with("  ")) {
                assert!(whole.lines().any(|shown| shown == line), "{names}: {line}\n{help}");
                long += usize::from(line.len() > COLUMNS);
            }
            let (_, below) = help.split_once("\nExample").unwrap();
            for line in below.lines().chain(help.lines().filter(|line| !line.starts_with(' '))) {
                assert!(line.chars().count() <= COLUMNS, "{names}: {line}");
            }
            commands += 1;
        });
        assert!(commands > 25 && long > 10, "{commands} commands, {long} long lines");
    }

    #[cfg(unix)]
    #[test]
    fn an_argument_that_is_no_utf8_is_named_before_any_work() {
        use std::os::unix::ffi::OsStringExt;
        let odd = OsString::from_vec(b"a\xffb.json".to_vec());
        let told = not_utf8(&["sightline".into(), odd]).expect("a sentence");
        assert!(told.starts_with("a\u{fffd}b.json: is not UTF-8"), "{told}");
        assert_eq!(not_utf8(&["sightline".into(), "é.json".into()]), None);
    }
}
