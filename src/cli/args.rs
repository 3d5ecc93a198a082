//! Options that several commands share.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::json;

use super::output::{Exit, Talk, Terminal};
use crate::engine::{EngineChoice, EngineKind};
use crate::runs::{Computing, RunError, TableFormat};
use crate::vehicle::SensorChoice;

/// Options of every command that computes scores.
#[derive(Args, Debug, Clone)]
pub(super) struct Compute {
    /// Where to compute: the best hardware Vulkan device, or the CPU where there is none (auto); any
    /// Vulkan device, also one in software (gpu); the CPU (cpu)
    #[arg(long, value_enum, default_value_t = BackendChoice::Auto)]
    pub backend: BackendChoice,
    /// Take the Vulkan device whose name contains this
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    /// Take a Vulkan device that fails its self-test, too: scores are then not those of the CPU, and each result
    /// names the device as inexact
    #[arg(long)]
    pub inexact: bool,
    /// Threads of the CPU backend [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Memory for work buffers, as 800M or 2G [default: half of what is free]
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub memory: Option<u64>,
    /// Vehicle file: sensors, mounts, body
    ///
    /// They replace those of the scene.
    #[arg(long, value_name = "FILE")]
    pub vehicle: Option<PathBuf>,
    #[command(flatten)]
    pub talk: Talk,
}

/// Models of LiDARs that placements leave without a name.
#[derive(Args, Debug, Clone, Default)]
pub(super) struct UnnamedModelArgs {
    /// Model of a LiDAR whose placement names none, for a vehicle with several: its index from 0, or all
    #[arg(long, value_name = "N=MODEL")]
    pub sensor: Vec<SensorChoice>,
}

impl UnnamedModelArgs {
    /// Engine, vehicle and watcher of the command, with these models.
    pub(super) fn computing<'a>(&self, compute: &Compute, terminal: &'a Terminal) -> Computing<'a> {
        Computing { sensors: self.sensor.clone(), ..compute.computing(terminal) }
    }
}

/// A command that computes: its request, the form of its answer, and where it is computed.
#[derive(Args)]
pub(super) struct Asked<R, F = Format>
where
    R: Args,
    F: ValueEnum + Default + Send + Sync + 'static,
{
    #[command(flatten)]
    pub request: R,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    pub format: F,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    pub compute: Compute,
}

impl<R: Args, F: ValueEnum + Default + Send + Sync + 'static> Asked<R, F> {
    /// Engine, vehicle, models and watcher of the command.
    pub(super) fn computing<'a>(&self, terminal: &'a Terminal) -> Computing<'a> {
        self.named.computing(&self.compute, terminal)
    }
}

/// A command that computes, and whose request says how to print.
#[derive(Args)]
pub(super) struct Computed<R: Args> {
    #[command(flatten)]
    pub request: R,
    #[command(flatten)]
    pub named: UnnamedModelArgs,
    #[command(flatten)]
    pub compute: Compute,
}

impl<R: Args> Computed<R> {
    /// Engine, vehicle, models and watcher of the command.
    pub(super) fn computing<'a>(&self, terminal: &'a Terminal) -> Computing<'a> {
        self.named.computing(&self.compute, terminal)
    }
}

impl<R: Args> Asked<R, TableFormat> {
    /// Prints the answer of `ask`, all of it as JSON, its table as CSV, or as `text` has it.
    pub(super) fn answer<A: Serialize>(
        &self,
        ask: fn(&R, &Computing<'_>) -> Result<A, RunError>,
        table: fn(&A) -> String,
        text: fn(&A) -> String,
    ) -> Result<(Exit, A), RunError> {
        let terminal = self.compute.start()?;
        let found = ask(&self.request, &self.computing(&terminal))?;
        match self.format {
            TableFormat::Json => outln!("{}", json!(found))?,
            TableFormat::Csv => out!("{}", table(&found))?,
            TableFormat::Text => out!("{}", text(&found))?,
        }
        Ok((terminal.exit(), found))
    }
}

/// Value of `--backend`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum BackendChoice {
    /// The best hardware device, or the CPU where there is none.
    Auto,
    /// A Vulkan device, software among them.
    Gpu,
    /// The host processor.
    Cpu,
}

/// Value of `--format`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Tables to read.
    #[default]
    Text,
    /// For programs.
    Json,
}

/// Bytes from `4096`, `800M`, `2G` or `2GiB`; K, M, G and T are powers of 1024.
fn parse_size(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kb" | "kib" => 1_u64 << 10,
        "m" | "mb" | "mib" => 1 << 20,
        "g" | "gb" | "gib" => 1 << 30,
        "t" | "tb" | "tib" => 1 << 40,
        unit => return Err(format!("`{unit}` is no unit; use K, M, G or T")),
    };
    let number: f64 = digits.parse().map_err(|_| "write a number, as in 800M or 2G".to_owned())?;
    let bytes = number * factor as f64;
    if !(1.0..1e18).contains(&bytes) {
        return Err("give at least one byte, and less than a million T".into());
    }
    Ok(bytes as u64)
}

impl Compute {
    /// Engine, vehicle and models, with the terminal as watcher.
    pub(super) fn computing<'a>(&self, terminal: &'a Terminal) -> Computing<'a> {
        let (kind, adapter) = (self.backend.kind(), self.adapter.clone());
        let engine = EngineChoice { kind, adapter, memory: self.memory, inexact: self.inexact };
        let (vehicle, sensors) = (self.vehicle.clone(), Vec::new());
        Computing { engine, vehicle, sensors, watcher: terminal }
    }

    /// Checks the options against each other and starts the threads of the CPU backend.
    pub(super) fn start(&self) -> Result<Terminal, RunError> {
        engine(self.backend, self.adapter.as_deref(), self.memory)?;
        start_threads(self.threads, self.talk)?;
        Ok(Terminal::new(self.talk))
    }
}

impl BackendChoice {
    fn kind(self) -> EngineKind {
        match self {
            Self::Auto => EngineKind::Auto,
            Self::Gpu => EngineKind::Gpu,
            Self::Cpu => EngineKind::Cpu,
        }
    }
}

/// The engine of `--backend`, `--adapter` and `--memory`, checked against each other.
pub(super) fn engine(
    backend: BackendChoice,
    adapter: Option<&str>,
    memory: Option<u64>,
) -> Result<EngineChoice, RunError> {
    if let (Some(adapter), BackendChoice::Cpu) = (adapter, backend) {
        return Err(RunError::Usage(format!(
            "--adapter {adapter}: picks a Vulkan device, which --backend cpu does not use; leave one of \
             them out"
        )));
    }
    let adapter = adapter.map(str::to_owned);
    Ok(EngineChoice { kind: backend.kind(), adapter, memory, inexact: false })
}

/// Starts the threads of `--threads`; says where these are fewer.
pub(super) fn start_threads(wanted: Option<u16>, talk: Talk) -> Result<(), RunError> {
    let Some(wanted) = wanted else { return Ok(()) };
    let threads = start_at_most(usize::from(wanted));
    let threads =
        threads.map_err(|error| RunError::Usage(format!("--threads {wanted}: {error}")))?;
    if threads < usize::from(wanted) {
        talk.note(format!(
            "--threads {wanted}: takes {threads}, four for each core; more are slower"
        ));
    }
    Ok(())
}

/// Refuses a number of threads in the environment that would take minutes to start.
pub(super) fn start_default_threads() -> Result<(), RunError> {
    match too_many_by_environment() {
        None => Ok(()),
        Some(wanted) => Err(RunError::Usage(format!(
            "RAYON_NUM_THREADS={wanted}: is more than is useful here; give at most {}, or leave it out",
            most_threads()
        ))),
    }
}

/// Threads for each core that are still useful.
const A_CORE: usize = 4;
/// Threads that any machine may be asked for.
const ANY_MACHINE: usize = 16;
/// Variables that rayon takes the number of its threads from.
const VARIABLES: [&str; 2] = ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"];

/// Most threads that this machine is given: four a core, and at least 16.
fn most_threads() -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    (A_CORE * cores).max(ANY_MACHINE)
}

/// Starts so many threads, at most [`most_threads`], for all work to come, and returns their number.
///
/// # Errors
/// Threads that were started before, or that the system does not give.
fn start_at_most(wanted: usize) -> Result<usize, rayon::ThreadPoolBuildError> {
    let threads = wanted.clamp(1, most_threads());
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    Ok(threads)
}

/// Number of threads that the environment asks for, where it is more than [`most_threads`].
fn too_many_by_environment() -> Option<usize> {
    let number = |name: &&str| std::env::var(name).ok()?.parse::<usize>().ok();
    VARIABLES.iter().find_map(number).filter(|&wanted| wanted > most_threads())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_machine_gets_more_threads_than_are_useful() {
        assert!((16..65_535).contains(&most_threads()));
        assert!(
            start_at_most(65_535).is_ok_and(|threads| threads == most_threads())
                || start_at_most(1).is_err()
        );
    }
}
