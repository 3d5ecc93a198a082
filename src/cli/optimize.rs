//! `sightline optimize`: options to settings, progress on stderr, a run folder, the result on stdout.

mod bars;
mod equipment;
mod near_field;
mod record;
mod settings;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::Problem;
use crate::export::GltfView;
use crate::internals::{
    Input, RunDir, align_columns, by_scene, certificate_in_words, findings_text, methods_in_words,
    poses_text, spread_in_words, unweighted_gain_text, verdict,
};
use crate::near_field::weighted;
use crate::report::{self, RunRecord};
use crate::scan::conditions::{Condition, ConditionError};
use crate::scan::in_conditions;
use crate::scene::Scene;
use crate::search::{Event, Outcome, Run, SearchError, Suite, TimeLimit};

use super::args::{Compute, Format};
use super::error::Error;
use super::exit::Exit;
use super::interrupt::Interrupt;
use super::load;
use bars::Bars;
use record::{BETWEEN_CHECKPOINTS, Opened, Sitting, finish, read_spent, save};
pub use settings::Args;
use settings::{Begun, Course, Saved, Wanted};

pub fn run(args: &Args) -> Result<Exit, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let resumed =
        args.resume.as_deref().map(|path| RunDir::<Saved>::resume("optimize", path)).transpose()?;
    let (folder, mut begun, course) = match resumed {
        Some((folder, saved)) => (Some(folder), saved.begun, saved.course),
        None => {
            (None, settings::begun(args)?, Course::Equipping(Box::new(settings::wanted(args)?)))
        }
    };
    args.gltf.check(begun.scenes().map(PathBuf::as_path))?;
    let (mut opened, interrupt) = open(&begun, args)?;
    let folder = match folder {
        Some(folder) => folder,
        // Before the search, so that a folder that cannot be written is found out now.
        None => {
            let inputs = opened.inputs.clone();
            RunDir::create("optimize", args.out.as_deref(), &begun.folder(), inputs)?
        }
    };
    folder.check(&opened.inputs)?;
    let Some(run) = begin(&mut begun, course, &mut opened, &folder, args, &interrupt)? else {
        return Ok(Exit::Interrupted);
    };
    let earlier = read_spent(&folder);
    let mut sitting = Sitting { args, begun, opened, folder, run, earlier, start };
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
    if let Some(best) = &record.best {
        let (scene, placements) =
            (&sitting.opened.scenes[0], std::slice::from_ref(&best.placement));
        let view = GltfView { scene, frame: 0, placements, points: &[] };
        args.gltf.write(args.compute.talk, &view)?;
    }
    print(args, &record, sitting.folder.path())?;
    Ok(if is_interrupted { Exit::Interrupted } else { Exit::Done })
}

/// The search, with a slot for each sensor of the vehicle; `None` after Ctrl-C while the sensors were chosen.
fn begin(
    begun: &mut Begun,
    course: Course,
    opened: &mut Opened,
    folder: &RunDir<Saved>,
    args: &Args,
    interrupt: &Interrupt,
) -> Result<Option<Run>, Error> {
    let wanted = match &course {
        Course::Equipping(wanted) => Some(&**wanted),
        Course::Run(_) => None,
    };
    let suite = equipment::equipped(begun, wanted, opened, folder, args, interrupt)?;
    let Some(suite) = suite else { return Ok(None) };
    opened.suite = suite.clone();
    let Wanted { settings, plainly, .. } = match course {
        Course::Run(state) => return Ok(Some(Run::resume(suite, *state))),
        Course::Equipping(wanted) => *wanted,
    };
    let settings = match &begun.equipped {
        Some(equipped) => equipped.begin(settings, suite.constraints(), plainly),
        None => settings,
    };
    Run::new(suite, &settings).map(Some).map_err(|error| in_scene(error, begun))
}

/// Scenes and problems of a run, and Ctrl-C, which counts from then on that the scenes are loaded.
fn open(begun: &Begun, args: &Args) -> Result<(Opened, Interrupt), Error> {
    let mut times = load::LoadTimes::default();
    let (mut scenes, mut problems, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
    for path in begun.scenes() {
        let (scene, problem) = open_scene(path, begun, args, &mut times)?;
        inputs.extend(Input::of(&scene)?);
        problems.push((scene.name().to_owned(), problem));
        scenes.push(scene);
    }
    let suite = Suite::new(problems).map_err(|error| in_scene(error, begun))?;
    load::note_classes(&suite, args.compute.talk);
    let suite = if begun.mirror { suite.with_mirror_images() } else { suite };
    let interrupt = Interrupt::listen(args.compute.talk);
    Ok((Opened { scenes, suite, inputs, times }, interrupt))
}

/// A scene with the rules of the options, and its problem over all frames.
fn open_scene(
    path: &Path,
    begun: &Begun,
    args: &Args,
    times: &mut load::LoadTimes,
) -> Result<(Scene, Arc<Problem>), Error> {
    let talk = args.compute.talk;
    let compute = Compute { vehicle: begun.vehicle.clone(), ..args.compute.clone() };
    let (scene, psog, took) = load::scene_and_psog(path, &compute)?;
    load::note_frames(&scene, args.frames, talk);
    let scene = scene
        .with_rules(&begun.rules, &path.display().to_string())
        .map_err(|error| Error::Usage(format!("options for the mount: {error}")))?;
    let building = Instant::now();
    let all: Vec<usize> = (0..scene.frame_count()).collect();
    let conditions = begun.conditions.iter().map(|text| text.parse());
    let conditions = conditions.collect::<Result<Vec<Condition>, ConditionError>>();
    let conditions = conditions.map_err(crate::Error::from)?;
    let problem = Problem::with_psog(&scene, &psog, &all)?;
    let problem = in_conditions(&scene, problem, &conditions)?;
    let problem = Arc::new(match begun.near_weight {
        Some(nats) => weighted(&scene, problem, nats)?,
        None => problem,
    });
    talk.detail(problem.modelled().to_string());
    talk.detail(format!(
        "scene and P-SOG take {} MiB, work buffers at most {} MiB",
        problem.bytes() >> 20,
        args.compute.memory_budget() >> 20
    ));
    times.load += took.load;
    times.build += took.build + building.elapsed().as_secs_f64();
    Ok((scene, problem))
}

/// An error of the settings, with the scene that they do not fit.
fn in_scene(error: SearchError, begun: &Begun) -> Error {
    let scenes: Vec<&PathBuf> = begun.scenes().collect();
    load::in_scene(error, &scenes)
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
        let mut bars = Bars::new(talk);
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

fn print(args: &Args, record: &RunRecord, folder: &Path) -> Result<(), Error> {
    if args.format == Format::Json {
        return outln!("{}", serde_json::json!(record));
    }
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    outln!("{}\n", verdict(record.best.as_ref(), &record.baselines, &record.objective))?;
    if let Some(words) = spread_in_words(record) {
        outln!("{words}\n")?;
    }
    outln!("{}: maximizing {} over {} frame(s)", record.scene, record.objective, record.frames)?;
    out!("{}", report::scores_text(&rows))?;
    if let Some(rows) = by_scene(record) {
        outln!("\nscene by scene")?;
        out!("{}", align_columns(&rows))?;
    }
    if !record.near_field.is_empty() {
        out!("\n{}", unweighted_gain_text(&record.near_field))?;
    }
    if let Some(words) = &record.equipment {
        outln!("\nequipment: {words}")?;
    }
    match &record.best {
        Some(best) => {
            outln!("\noptimized placement (m, rad):")?;
            out!("{}", poses_text(&best.placement))?;
            if let Some(phases) = &record.phases {
                outln!("\n{}", phases.words)?;
            }
            for seen in &best.scores.required {
                outln!("  must be seen: {seen}")?;
            }
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
