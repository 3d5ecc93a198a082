//! The program: arguments and commands, one file a command; parses, calls the library, prints.

// Both panic where nothing can be written; `output` has its own.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod lines;
#[macro_use]
mod output;

mod answers;
mod args;
mod checks;
mod kinds;
mod optimize;
mod psog;
mod refusal;
mod rig;
mod scan;
mod scene;
mod score;
mod short;
mod study;
mod usage;

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;

use crate::files::{Session, trust_paths};
use crate::runs::RunError;
use args::{Format, start_default_threads};

pub use output::Exit;

/// Where on this vehicle should the LiDARs go?
///
/// Casts every beam of candidate LiDAR placements through a scene, finds the voxels the beams cover,
/// and scores how much they tell about a probabilistic semantic occupancy grid (P-SOG).
#[derive(Parser)]
#[command(name = "sightline", version, arg_required_else_help = true)]
#[command(after_help = "Examples:
  sightline optimize scenes/urban-crossing.json --max-seconds 30
  sightline score scenes/urban-crossing.json scenes/placements.json
  sightline scan scenes/urban-crossing.json --placement scenes/placements.json:Pyramid --out scans")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Search for the best placement and write a run folder
    #[command(
        after_help = "Examples:
  sightline optimize scenes/urban-crossing.json
  sightline optimize scenes/highway.json --objective '0.5*m_sog_scaled + 0.5*detection.m_sog_scaled'
  sightline optimize scenes/highway.json scenes/residential.json --mirror
  sightline optimize scenes/highway.json --symmetric --equal-height --max-seconds 30
  sightline optimize scenes/highway.json scenes/residential.json --vehicle scenes/vehicles/car.json --budget 12000
  sightline optimize scenes/urban-crossing.json --vehicle scenes/vehicles/car.json --front price,near_gain
  sightline optimize --resume runs/highway",
        mut_args(optimize::of_new_run)
    )]
    Optimize(Box<optimize::OptimizeArgs>),
    /// Score a batch of placements
    ///
    /// Ends with exit code 1 where the vehicle has requirements and no placement of the file meets all of them.
    #[command(after_help = "Examples:
  sightline score scenes/highway.json scenes/placements.json
  sightline score scenes/highway.json million.jsonl --format json --out scores.json
  sightline score scenes/highway.json scenes/residential.json mine.json")]
    Score(score::ScoreArgs),
    /// Write a page about a placement: 3-D view, scores, baselines
    #[command(after_help = "Examples:
  sightline view scenes/highway.json mine.json:roof --out view.html
  sightline view scenes/highway.json scenes/residential.json mine.json:roof \
    --baselines mine.json:bumper --out view.html")]
    View(score::ViewArgs),
    /// Write every beam's hit
    #[command(after_help = "Examples:
  sightline cast scenes/highway.json mine.json --frame 3 --out hits.npz
  sightline cast scenes/highway.json scenes/placements.json --gltf highway.glb")]
    Cast(scan::CastArgs),
    /// Write labelled scans as data sets, in good and bad weather
    Scan(scan::ScanArgs),
    /// Compare the GPU with the CPU bit by bit, and the CPU with f64
    #[command(after_help = "Examples:
  sightline verify scenes/highway.json
  sightline verify scenes/highway.json scenes/placements.json --frames 20 --format json
  sightline verify scenes/highway.json --condition snow:rate=2.5 --condition wet:water=1.2")]
    Verify(checks::VerifyArgs),
    /// Find the cheapest model of a scene that keeps the ranking
    #[command(after_help = "Examples:
  sightline chart scenes/urban-crossing.json --out runs/chart
  sightline chart scenes/highway.json --full --objective information_gain
  sightline chart scenes/highway.json scenes/residential.json --quick
  sightline chart --resume runs/chart")]
    Chart(checks::ChartArgs),
    /// Try to make the scores fail, and say which guard notices
    #[command(after_help = "Examples:
  sightline audit scenes/highway.json
  sightline audit scenes/highway.json scenes/residential.json mine.json")]
    Audit(checks::AuditArgs),
    /// Answer a question about rigs: near field, loss, tolerance, cost
    Study(study::StudyCommand),
    /// Build, inspect and merge P-SOG files
    #[command(
        subcommand,
        after_help = "Examples:
  sightline psog build scenes/highway.json --out highway.psog.npz
  sightline psog info highway.psog.npz"
    )]
    Psog(psog::PsogCommand),
    /// Look into sensor files of the vendors
    #[command(subcommand, after_help = "Example:\n  sightline sensor info os1-metadata.json")]
    Sensor(psog::SensorCommand),
    /// Read, write, compare and hand over rigs; Autoware, URDF, CARLA
    #[command(
        subcommand,
        after_help = "Examples:
  sightline rig export mine.json:roof --format urdf --out roof.urdf
  sightline rig compare center.urdf scenes/placements.json:Center"
    )]
    Rig(rig::RigCommand),
    /// Make scenes, import maps, count what scenes hold
    #[command(
        subcommand,
        after_help = "Examples:
  sightline scene new --kind town --seed 7 --out town.json
  sightline scene info town.json"
    )]
    Scene(scene::SceneCommand),
    /// List Vulkan devices and which one is taken by default
    #[command(after_help = "Example:\n  sightline devices")]
    Devices {
        /// How to print
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Measure this machine
    #[command(
        subcommand,
        after_help = "Example:\n  sightline bench device scenes/highway.json > device.md"
    )]
    Bench(checks::BenchCommand),
    /// Print the JSON Schema of a kind of file, for editors
    #[command(after_help = "Examples:
  sightline schema scene > scene.schema.json
  sightline schema vehicle | check-jsonschema --schemafile /dev/stdin van.json")]
    Schema {
        /// The kind of file
        kind: usage::SchemaKind,
    },
    /// Print the completions for a shell
    #[command(after_help = "Examples:
  sightline completions fish > ~/.config/fish/completions/sightline.fish
  sightline completions zsh > ~/.zfunc/_sightline
  sightline completions bash > ~/.local/share/bash-completion/completions/sightline
  sightline completions powershell >> $PROFILE")]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Print or write manual pages, as packages hold them
    #[command(hide = true)]
    #[command(after_help = "Examples:
  sightline man | man -l -
  sightline man scene new | man -l -
  sightline man --out ~/.local/share/man/man1")]
    Man {
        /// The command, of several words where it has commands of its own [default: the program]
        command: Vec<String>,
        /// Write the pages of all commands to this folder instead: sightline.1, sightline-optimize.1, …
        #[arg(long, value_name = "DIR", conflicts_with = "command")]
        out: Option<PathBuf>,
    },
}

/// Runs the program: `arguments` as a shell gives them, the program's own name first. Prints results to
/// stdout, all else to stderr, an error as one sentence. Help and version end the process.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Exit {
    output::ignore_file_limit_signal();
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let parsed = parse(&arguments);
    let failed = match parsed {
        Ok(Parsed { command, force, trusts_paths }) => {
            let _session = Session::of_program(force);
            trust_paths(trusts_paths);
            match start_default_threads().and_then(|()| dispatch(command)) {
                Ok(exit) => return exit,
                Err(error @ RunError::Interrupted(_)) => {
                    output::say(&error.to_string());
                    return Exit::Interrupted;
                }
                Err(error) => error.to_string(),
            }
        }
        Err(Refused::Help(help)) => help.exit(),
        Err(Refused::Sentence(told)) => told,
    };
    output::fail(&failed);
    Exit::BadInput
}

/// The sentence that refuses arguments; `None` where they are taken, or ask for help. Nothing is run.
pub fn refusal(arguments: &[OsString]) -> Option<String> {
    match parse(arguments) {
        Err(Refused::Sentence(told)) => Some(told),
        Ok(_) | Err(Refused::Help(_)) => None,
    }
}

/// Arguments that were read.
struct Parsed {
    command: Command,
    /// True if outputs may replace files.
    force: bool,
    /// True if files may name others outside their folder.
    trusts_paths: bool,
}

/// Arguments that begin no command.
enum Refused {
    /// Help or version is asked for.
    Help(clap::Error),
    /// One sentence that says why.
    Sentence(String),
}

/// Reads the arguments, the program's own name first.
fn parse(arguments: &[OsString]) -> Result<Parsed, Refused> {
    if let Some(told) = usage::not_utf8(arguments) {
        return Err(Refused::Sentence(told));
    }
    let arguments = &refusal::with_values_below_0(arguments);
    let program = match short::is_short(arguments) {
        true => short::on_one_screen(kinds::with_kind(program(), arguments)),
        false => usage::with_examples(kinds::with_kind(program(), arguments)),
    }
    .term_width(short::COLUMNS);
    if let Some(told) = refusal::numbers_apart(&program, arguments) {
        return Err(Refused::Sentence(told));
    }
    let refused = |error| match usage::is_help(&error) {
        true => Refused::Help(error),
        false => Refused::Sentence(refusal::sentence(&error, &program, arguments)),
    };
    let matches = program.clone().try_get_matches_from(arguments).map_err(refused)?;
    if let Some(option) = dash(&matches) {
        return Err(Refused::Sentence(format!(
            "--{option} -: no file is called `-`; give /dev/stdout to write to stdout, or ./- for a file of that name"
        )));
    }
    let Cli { command } = Cli::from_arg_matches(&matches).map_err(refused)?;
    let (force, trusts_paths) = (is_given(&matches, FORCE), is_given(&matches, "trust_paths"));
    Ok(Parsed { command, force, trusts_paths })
}

fn dispatch(command: Command) -> Result<Exit, RunError> {
    match command {
        Command::Optimize(args) => optimize::run(&args),
        Command::Score(args) => score::run(&args),
        Command::View(args) => score::run_view(&args),
        Command::Cast(args) => scan::run_cast(&args),
        Command::Scan(args) => scan::run(&args),
        Command::Verify(args) => checks::run_verify(&args),
        Command::Chart(args) => checks::run_chart(&args),
        Command::Audit(args) => checks::run_audit(&args),
        Command::Study(command) => study::run(&command),
        Command::Psog(command) => psog::run(&command),
        Command::Sensor(command) => psog::run_sensor(&command),
        Command::Rig(command) => rig::run(&command),
        Command::Scene(command) => scene::run(&command),
        Command::Devices { format } => checks::run_devices(format),
        Command::Bench(command) => checks::run_bench(&command),
        Command::Schema { kind } => usage::schema(kind),
        Command::Completions { shell } => usage::completions(shell, program()),
        Command::Man { command, out } => usage::man(&command, out.as_deref(), program()),
    }
}

/// The program's arguments.
fn program() -> clap::Command {
    short::with_short_help(with_force(taking_negative_numbers(Cli::command())))
}

/// Name of the option that lets outputs replace files.
const FORCE: &str = "force";
/// Names of the options that say where outputs go.
const OUTPUTS: [&str; 4] = ["out", "gltf", "coverage_out", "figures"];

/// Gives every command that writes files the option to replace those that exist.
fn with_force(command: clap::Command) -> clap::Command {
    let command = command.mut_subcommands(with_force);
    if !command.get_arguments().any(|arg| OUTPUTS.contains(&arg.get_id().as_str())) {
        return command;
    }
    let force = clap::Arg::new(FORCE).long(FORCE).action(clap::ArgAction::SetTrue);
    command.arg(
        force.help("Overwrite files that exist; the command's own inputs are never overwritten"),
    )
}

/// True if the command was given a flag.
fn is_given(matches: &clap::ArgMatches, flag: &str) -> bool {
    let below = matches.subcommand().is_some_and(|(_, below)| is_given(below, flag));
    below || matches.try_get_one::<bool>(flag).ok().flatten() == Some(&true)
}

/// The option of an output that was given `-`, which other programs take for stdout.
fn dash(matches: &clap::ArgMatches) -> Option<String> {
    let is_dash = |option: &&&str| {
        let given = matches.try_get_raw(option).ok().flatten();
        given.is_some_and(|mut values| values.any(|value| value == "-"))
    };
    let here = OUTPUTS.iter().find(is_dash).map(|option| option.replace('_', "-"));
    here.or_else(|| matches.subcommand().and_then(|(_, below)| dash(below)))
}

/// Lets numbers below 0 reach the options, whose own messages name the numbers that they take.
fn taking_negative_numbers(command: clap::Command) -> clap::Command {
    command
        .mut_args(|arg| {
            let is_value = !arg.is_positional() && arg.get_action().takes_values();
            if is_value { arg.allow_negative_numbers(true) } else { arg }
        })
        .mut_subcommands(taking_negative_numbers)
}
