//! `sightline optimize`: options to settings, progress on stderr, a run folder, the result on stdout.

mod record;
mod settings;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use sightline::Problem;
use sightline::report;
use sightline::report::{RunRecord, certificate_in_words, methods_in_words, verdict};
use sightline::scene::Scene;
use sightline::search::{Event, Method, Outcome, Run, SearchError, TimeLimit, Work};
use sightline::vehicle::Spacing;

use super::args::{Compute, Format, Talk, at_least_one, finite, parse_seconds, whole};
use super::error::Error;
use super::interrupt::{INTERRUPTED, Interrupt};
use super::load::{self, LoadTimes};
use super::progress;
use record::{Spent, finish, read_spent, save};
use settings::{Rules, Saved, parse_spacing};
use sightline::files::Input;
use sightline::files::RunDir;

/// Time between two checkpoints: one after each generation would take longer than the search itself
/// where generations are quick.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(1);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline optimize scenes/urban-crossing.json
  sightline optimize scenes/highway.json --objective '0.5*m_sog_scaled + 0.5*detection.m_sog_scaled'
  sightline optimize scenes/highway.json --symmetric --equal-height --max-seconds 30
  sightline optimize --resume runs/highway")]
pub struct Args {
    /// Scene file
    #[arg(required_unless_present = "resume", conflicts_with = "resume")]
    scene: Option<PathBuf>,
    /// Folder for the run [default: runs/SCENE, numbered if it is taken]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with an interrupted run, to the same bytes that it would have given
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Score to maximize, or a weighted sum of several
    #[arg(
        long,
        default_value = "information_gain",
        allow_hyphen_values = true,
        conflicts_with = "resume"
    )]
    objective: String,
    /// Placements that the generations evaluate; the swaps then cast one and a half times as many
    /// sensor poses as those did
    #[arg(long, value_name = "N", default_value_t = 180, conflicts_with = "resume",
          value_parser = at_least_one)]
    evaluations: u64,
    /// Seconds from the start after which the search ends, generations after two fifths of them;
    /// --resume goes on from there. Confirming the result and writing it come on top
    #[arg(long, value_name = "S", visible_alias = "time", value_parser = parse_seconds)]
    max_seconds: Option<f64>,
    /// Score over all frames at which the search ends
    #[arg(long, value_name = "SCORE", conflicts_with = "resume", allow_hyphen_values = true,
          value_parser = finite)]
    target: Option<f64>,
    /// Placements of a generation [default: chosen from the number of variables]
    #[arg(long, value_name = "N", conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(4..=10_000))]
    population: Option<u32>,
    /// Frames of the scene that the search models: as few as keep the ranking, and more when they no
    /// longer tell the best apart (auto), or all (full); the result is confirmed over all
    #[arg(long, value_enum, default_value_t = Fidelity::Auto, conflicts_with = "resume")]
    fidelity: Fidelity,
    /// Frames that the search averages over, spread evenly, whatever they lose
    #[arg(long, value_name = "N", conflicts_with_all = ["resume", "fidelity"],
          value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to search: CMA-ES and then swaps of single LiDARs (both), the first alone (cma), or swaps over
    /// every pose of a grid (swaps)
    #[arg(long, value_parser = method, default_value = "both", conflicts_with = "resume")]
    method: Method,
    /// Search on a grid of sensor poses alone, as in the paper: metres and radians between
    /// neighbours, as 0.1 or 0.2,0.1. Swaps always use one [default for them: 0.1]
    #[arg(long, value_name = "M[,RAD]", conflicts_with = "resume", value_parser = parse_spacing)]
    delta: Option<Spacing>,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>, conflicts_with = "resume")]
    seed: u64,
    /// Placements to compare with, and to start from where the mount allows them
    /// [default: Table 7 of the paper]
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    baselines: Option<PathBuf>,
    /// More placements to start from where the mount allows them; not compared with
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    inject: Option<PathBuf>,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    rules: Rules,
    #[command(flatten)]
    compute: Compute,
}

/// Value of `--fidelity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Fidelity {
    /// As few frames as keep the ranking
    Auto,
    /// Every frame
    Full,
}

/// `--method`.
fn method(text: &str) -> Result<Method, String> {
    match text {
        "both" => Ok(Method::Both),
        "cma" => Ok(Method::Cma),
        "swaps" => Ok(Method::Swaps),
        _ => Err("write both, cma or swaps".into()),
    }
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let resumed =
        args.resume.as_deref().map(|path| RunDir::<Saved>::resume("optimize", path)).transpose()?;
    let begun = match &resumed {
        Some((_, saved)) => saved.begun.clone(),
        None => settings::begun(args)?,
    };
    let opened = open(&begun, args)?;
    if let Some((folder, _)) = &resumed {
        folder.check(&opened.inputs)?;
    }
    let (folder, run) = match resumed {
        Some((folder, saved)) => (folder, Run::resume(opened.problem.clone(), saved.run)),
        None => {
            let run = Run::new(opened.problem.clone(), &settings::of(args)?);
            let run = run.map_err(|error| in_scene(error, &begun.scene))?;
            // Before the search, so that a folder that cannot be written is found out now.
            let name = begun.scene.file_stem().unwrap_or_default().to_string_lossy();
            let inputs = opened.inputs.clone();
            (RunDir::create("optimize", args.out.as_deref(), &name, inputs)?, run)
        }
    };
    let earlier = read_spent(&folder);
    let mut sitting = Sitting { args, begun, opened, folder, run, earlier, start };
    let interrupt = Interrupt::listen(args.compute.talk);
    let outcome = sitting.search(&interrupt)?;
    let is_interrupted = interrupt.is_set();
    let record = finish(&sitting, &outcome)?;
    if record.best.is_none() && !is_interrupted {
        return Err(Error::Usage(format!(
            "{}: mount: no candidate kept its rules ({}); widen the mount or relax them",
            sitting.begun.scene.display(),
            record.constraints.join("; ")
        )));
    }
    print(args, &record, sitting.folder.path())?;
    Ok(if is_interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// A scene with the rules of the options, and its problem over all frames.
struct Opened {
    scene: Scene,
    problem: Arc<Problem>,
    inputs: Vec<Input>,
    times: LoadTimes,
}

fn open(begun: &settings::Begun, args: &Args) -> Result<Opened, Error> {
    let talk = args.compute.talk;
    let (scene, psog, mut times) = load::scene_and_psog(&begun.scene, talk)?;
    load::note_frames(&scene, args.frames, talk);
    let inputs = Input::of(&scene)?;
    let scene = scene
        .with_rules(&begun.rules, &begun.scene.display().to_string())
        .map_err(|error| Error::Usage(format!("options for the mount: {error}")))?;
    let building = Instant::now();
    let all: Vec<usize> = (0..scene.frame_count()).collect();
    let problem = Arc::new(Problem::with_psog(&scene, &psog, &all)?);
    talk.detail(problem.modelled().to_string());
    talk.detail(format!(
        "scene and P-SOG take {} MiB, work buffers at most {} MiB",
        problem.bytes() >> 20,
        args.compute.memory_budget() >> 20
    ));
    times.build += building.elapsed().as_secs_f64();
    Ok(Opened { scene, problem, inputs, times })
}

/// An error of the settings, with the scene that they do not fit.
fn in_scene(error: SearchError, scene: &Path) -> Error {
    match error {
        SearchError::NoDetection { .. } => Error::Usage(format!("{}: {error}", scene.display())),
        error => error.into(),
    }
}

/// One run of the program on a run folder.
struct Sitting<'a> {
    args: &'a Args,
    begun: settings::Begun,
    opened: Opened,
    folder: RunDir<Saved>,
    run: Run,
    /// Of earlier sittings.
    earlier: Spent,
    start: Instant,
}

impl Sitting<'_> {
    /// Runs to the outcome; the state is saved on the way.
    fn search(&mut self, interrupt: &Interrupt) -> Result<Outcome, Error> {
        let talk = self.args.compute.talk;
        let time = self.args.max_seconds.map(|seconds| TimeLimit {
            start: self.start,
            length: Duration::from_secs_f64(seconds),
        });
        self.run.open_with(self.args.compute.engine(), time);
        let mut bars = Bars { shown: None, talk };
        let mut saved: Option<Instant> = None;
        let outcome = loop {
            let mut observe = |event: &Event| {
                bars.show(event);
                !interrupt.is_set()
            };
            let outcome = self.run.step(&mut observe)?;
            let is_due = saved.is_none_or(|saved| saved.elapsed() > BETWEEN_CHECKPOINTS);
            if outcome.is_some() || is_due {
                save(self)?;
                saved = Some(Instant::now());
            }
            if let Some(outcome) = outcome {
                break outcome;
            }
        };
        bars.clear();
        let generation = outcome.history.len();
        let mut line = format!("stopped after generation {generation}: {}", outcome.stopped);
        if outcome.stopped.is_unfinished() {
            line += &format!("; go on with --resume {}", self.folder.path().display());
        }
        talk.note(line);
        Ok(outcome)
    }
}

/// Progress of a run on stderr.
struct Bars {
    shown: Option<(Work, ProgressBar)>,
    talk: Talk,
}

impl Bars {
    fn show(&mut self, event: &Event) {
        match *event {
            Event::Note(sentence) => self.talk.note(sentence),
            Event::Generation(record) => {
                if let (Some((_, bar)), Some(best)) = (&self.shown, record.best_so_far) {
                    bar.set_message(format!("· best {best:.4e}"));
                }
            }
            Event::Progress { work, done, total } => {
                if self.shown.as_ref().is_none_or(|(shown, _)| *shown != work) {
                    self.clear();
                    let bar = progress::bar(total, &work.to_string(), self.talk);
                    self.shown = Some((work, bar));
                }
                if let Some((_, bar)) = &self.shown {
                    bar.set_length(total);
                    bar.set_position(done);
                }
            }
            _ => {}
        }
    }

    fn clear(&mut self) {
        if let Some((_, bar)) = self.shown.take() {
            bar.finish_and_clear();
        }
    }
}

fn print(args: &Args, record: &RunRecord, folder: &Path) -> Result<(), Error> {
    if args.format == Format::Json {
        return outln!("{}", serde_json::json!(record));
    }
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    outln!("{}\n", verdict(record.best.as_ref(), &record.baselines, &record.objective))?;
    outln!("{}: maximizing {} over {} frame(s)", record.scene, record.objective, record.frames)?;
    out!("{}", report::scores_text(&rows))?;
    match &record.best {
        Some(best) => {
            outln!("\noptimized placement (m, rad):")?;
            out!("{}", report::poses_text(&best.placement))?;
            for bound in &record.active_bounds {
                outln!("  active: {bound}")?;
            }
            if !record.constraints.is_empty() {
                outln!("\nrules kept: {}", record.constraints.join("; "))?;
            }
            outln!("\nfound by: {}", methods_in_words(record))?;
            outln!("certificate: {}", certificate_in_words(record))?;
            outln!("\n{}", report::findings_text(&record.findings))?;
        }
        None => outln!("\nno candidate kept the rules of the mount; widen it")?,
    }
    if let Some(frames) = &record.fidelity {
        outln!("\n{}", frames.words)?;
    }
    outln!(
        "\nstopped: {}, after {} evaluations in {:.1} s ({:.1} placements × frames/s on {}); report: \
         {}",
        record.stopped,
        record.evaluations,
        record.timings.total,
        record.rate,
        record.backend,
        folder.join("report.html").display()
    )
}
