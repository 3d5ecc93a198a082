//! `completions` and `man`: what shells and `man` want to know of the program, from its own arguments.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;

use super::exit::Exit;
use crate::internals::{shared_folder, write_whole};
use crate::runs::RunError;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline completions bash > ~/.local/share/bash-completion/completions/sightline
  sightline completions zsh > ~/.zfunc/_sightline
  sightline completions fish > ~/.config/fish/completions/sightline.fish
  sightline completions powershell >> $PROFILE")]
pub struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline man | man -l -
  sightline man scene new | man -l -
  sightline man --out ~/.local/share/man/man1")]
pub struct ManArgs {
    /// The command, of several words where it has commands of its own [default: the program]
    command: Vec<String>,
    /// Write the pages of all commands to this folder instead: sightline.1, sightline-optimize.1, …
    #[arg(long, value_name = "DIR", conflicts_with = "command")]
    out: Option<PathBuf>,
}

/// Prints what a shell completes of the program.
pub fn completions(args: &CompletionsArgs, mut program: Command) -> Result<Exit, RunError> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut program, "sightline", &mut text);
    out!("{}", String::from_utf8_lossy(&text))?;
    Ok(Exit::Done)
}

/// Prints a page, or writes all of them.
pub fn man(args: &ManArgs, program: Command) -> Result<Exit, RunError> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    if let Some(folder) = &args.out {
        shared_folder(folder)?;
        for command in with_commands(&program) {
            let path = folder.join(Man::new(command.clone()).get_filename());
            let page = page(command)?;
            write_whole(&path, |file| file.write_all(&page).map_err(RunError::io(&path)))?;
        }
        return Ok(Exit::Done);
    }
    let mut command = &program;
    for word in &args.command {
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
