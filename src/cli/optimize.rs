//! `sightline optimize`: options to settings, progress on stderr, a run folder, the result on stdout.

mod record;
mod settings;

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use sightline::Problem;
use sightline::internals::{
    Input, RunDir, certificate_in_words, findings_text, methods_in_words, poses_text, verdict,
};
use sightline::report::{self, RunRecord};
use sightline::search::{Event, Outcome, Run, SearchError, TimeLimit, Work};

use super::args::{Format, Talk};
use super::error::Error;
use super::interrupt::{INTERRUPTED, Interrupt};
use super::load;
use super::progress;
use record::{Opened, Sitting, finish, read_spent, save};
pub use settings::Args;
use settings::Saved;

/// Time between two checkpoints: one after each generation would take longer than the search itself
/// where generations are quick.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(1);

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
            out!("{}", poses_text(&best.placement))?;
            for bound in &record.active_bounds {
                outln!("  active: {bound}")?;
            }
            if !record.constraints.is_empty() {
                outln!("\nrules kept: {}", record.constraints.join("; "))?;
            }
            outln!("\nfound by: {}", methods_in_words(record))?;
            outln!("certificate: {}", certificate_in_words(record))?;
            outln!("\n{}", findings_text(&record.findings))?;
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
