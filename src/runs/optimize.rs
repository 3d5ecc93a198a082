//! A search in a run folder: begun or resumed, saved on the way, recorded at its end.

mod early;
mod finished;
mod front;
mod request;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::opening::LoadTimes;
use super::{Bar, Computing, GRACE, RunError, Watcher, opening, outputs};
use crate::export::GltfView;
use crate::files::{RunDir, Session, holds_run, read_own};
use crate::job::{Job, JobError, JobRun, JobState, JobStep};
use crate::problem::Content;
use crate::report::record::peak_memory;
use crate::report::run_tables::run_csv;
use crate::report::words::from_here;
use crate::report::{Figures, Looks, RunRecord, RunTimes, report_html};
use crate::search::{
    Event, FrameChoice, LeftOut, Outcome, PATIENCE, Run, Scored, Settings, Stopped, TimeLimit, Work,
};
use crate::vehicle::Placement;
use request::{Begun, RunCheckpoint, command, in_full, note_choice, tolerance_command};

pub use finished::{Finished, finished};
pub use front::{Fronted, front, holds_front};
pub use request::{Fidelity, OptimizeRequest};

/// Command that a run's folder names.
const COMMAND: &str = "optimize";

/// Record and folder of a finished search.
#[derive(Debug)]
pub struct Optimized {
    /// All of `result.json`.
    pub record: RunRecord,
    /// The run folder.
    pub folder: PathBuf,
}

/// Searches in a run folder to the end, or until the watcher stops it; `None` if it stopped while sensors were chosen.
///
/// # Errors
/// Files that cannot be read or written, settings that do not fit the scenes, no candidate that keeps the rules.
pub fn optimize(
    request: &OptimizeRequest,
    computing: &Computing<'_>,
) -> Result<Option<Optimized>, RunError> {
    let _session = Session::begin();
    let start = Instant::now();
    let (folder, begun, mut going_on, mut settings) = match &request.resume {
        Some(path) => {
            check_no_front(path)?;
            let (folder, RunCheckpoint { begun, state }) =
                RunDir::<RunCheckpoint>::resume(COMMAND, path)?;
            (Some(folder), begun, Some(state), Settings::default())
        }
        None => {
            let (begun, settings) = request.checked(computing)?;
            (None, begun, None, settings)
        }
    };
    let length = request.max_seconds.map(Duration::from_secs_f64);
    let time = length.map(|length| TimeLimit { start, length });
    let loaded = request.open(&begun.files, time, computing)?;
    let inputs = loaded.inputs()?;
    for scene in loaded.job.scenes() {
        opening::note_frames(scene.scene(), request.frames, computing.watcher);
    }
    check_before(request, computing)?;
    if going_on.is_none() {
        request.look(&mut settings, &*loaded.job.problem()?, computing)?;
    }
    let (is_given, baselines) = (begun.baselines.is_some(), settings.baselines.clone());
    let files = &begun.files;
    if going_on.is_none() && (files.budget.is_some() || files.fewest) {
        note_choice(files, loaded.job.scene().vehicle(), computing.watcher);
    }
    let job = loaded.job.search(settings).engine(computing.engine.clone()).within(time);
    let job = if is_given { job.baselines(baselines) } else { job };
    if going_on.is_none() {
        job.check_room()?;
        check_value(&begun, &job)?;
    }
    computing.watcher.listen(GRACE);
    let folder = request.folder((COMMAND, folder), &begun, inputs)?;
    let earlier = earlier_times::<Spent>(folder.path(), request.resume.is_none());
    let times = loaded.times;
    let mut run = begin(&job, going_on.take(), &folder, computing.watcher)?;
    earlier.kept.iter().for_each(|kept| run.keep(kept.clone()));
    let mut sitting =
        RunSession { request, computing, begun, job: &job, folder, run, times, earlier, start };
    let found = sitting.search_and_write();
    found.map_err(|error| error.discarding(&sitting.folder))
}

/// Checks device and outputs, which need no work.
fn check_before(request: &OptimizeRequest, computing: &Computing<'_>) -> Result<(), RunError> {
    computing.engine.check_adapter().map_err(JobError::from)?;
    outputs::check_gltf(request.gltf.gltf.as_deref())?;
    outputs::check_figures(request.figures.figures.as_deref())?;
    Ok(())
}

/// Refuses the folder of a front that an earlier program wrote, without a checkpoint.
fn check_no_front(folder: &Path) -> Result<(), RunError> {
    if holds_run(folder) || !folder.join("front.svg").exists() {
        return Ok(());
    }
    Err(RunError::Usage(format!(
        "{}: holds a front without a checkpoint, which does not go on; run `sightline optimize … --front …` again, into \
         another folder or with --force",
        folder.display()
    )))
}

/// The search at its beginning, or where a checkpoint left it, with a note on work that no checkpoint holds.
fn begin<'a>(
    job: &'a Job,
    state: Option<JobState>,
    folder: &RunDir<RunCheckpoint>,
    watcher: &dyn Watcher,
) -> Result<JobRun<'a>, RunError> {
    let is_resumed = state.is_some();
    let run = match state {
        Some(state) => job.resume(state),
        None => {
            opening::note_before_search(job, watcher)?;
            job.begin()
        }
    };
    let run = run.map_err(|error| match error {
        JobError::OtherState { why } => RunError::from(folder.refusal(&why)),
        other => other.into(),
    })?;
    if is_resumed && run.run().is_none() {
        watcher.note("the run had not chosen its sensors: the poses to choose from are cast again");
    }
    Ok(run)
}

/// Checks that some placement can have a value.
fn check_value(begun: &Begun, job: &Job) -> Result<(), RunError> {
    let (objective, suite) = (&job.settings().objective, job.suite()?);
    // A missing detection target is reported by the search.
    let exists = |content: &Content| {
        objective.exists_in(content) || objective.needs_detection() && !content.has_detection()
    };
    if suite.members().iter().any(|member| exists(member.problem().content())) {
        return Ok(());
    }
    Err(RunError::Usage(format!(
        "{}: nothing is uncertain in its P-SOG, so that no placement has a value of `{objective}`; give it frames in \
         which something moves",
        begun.files.scene.display()
    )))
}

impl RunSession<'_> {
    /// All of a sitting; `None` after Ctrl-C in the choice of sensors.
    fn search_and_write(&mut self) -> Result<Option<Optimized>, RunError> {
        let Some(outcome) = self.search()? else { return Ok(None) };
        let record = finish(self, &outcome)?;
        self.write_gltf(&record)?;
        Ok(Some(Optimized { record, folder: self.folder.path().to_owned() }))
    }

    /// Runs to the outcome; the state is saved on the way. `None` after Ctrl-C in the choice of sensors.
    fn search(&mut self) -> Result<Option<Outcome>, RunError> {
        let watcher = self.computing.watcher;
        let folder = self.folder.path().display().to_string();
        let mut bars = Bars::new(watcher);
        let mut saved: Option<Instant> = None;
        let outcome = loop {
            let mut observe = |event: &Event| {
                bars.show(event);
                watcher.goes_on()
            };
            let step = self.run.step(&mut observe)?;
            let is_due = saved.is_none_or(|saved| saved.elapsed() > BETWEEN_CHECKPOINTS);
            if is_due || !matches!(step, JobStep::On) {
                save(self)?;
                watcher.resumes(&format!("go on with --resume {folder}"));
                saved = Some(Instant::now());
            }
            match step {
                JobStep::On => {}
                JobStep::Stopped => {
                    bars.clear();
                    watcher.note(&format!(
                        "stopped while the sensors were chosen; go on with --resume {folder}"
                    ));
                    return Ok(None);
                }
                JobStep::Done(outcome) => break outcome,
            }
        };
        bars.clear();
        let generation = outcome.history.len();
        let mut line = format!("stopped after generation {generation}: {}", outcome.stopped);
        if outcome.stopped.is_unfinished() {
            line += &format!("; go on with --resume {folder}");
        }
        watcher.note(&line);
        Ok(Some(*outcome))
    }

    /// A search without a result is an error, unless it was stopped before its end.
    fn check(&self, record: &RunRecord) -> Result<(), RunError> {
        if record.best.is_some() || !self.computing.watcher.goes_on() {
            return Ok(());
        }
        let scene = self.begun.files.scene.display();
        let history = self.run.run().map_or(&[][..], |run| run.state().history());
        let broken: u64 = history.iter().map(|record| record.infeasible as u64).sum();
        let kept = history.last().map_or(0, |record| record.evaluations).saturating_sub(broken);
        Err(RunError::Usage(match kept {
            0 => format!(
                "{scene}: mount: no candidate kept its rules ({}); widen the mount or relax them",
                record.constraints.join("; ")
            ),
            kept => format!(
                "{scene}: mount: {kept} candidates kept its rules, but none has a value of `{}`: their beams reach \
                 nothing in the region of interest that counts; move the mount, or allow other angles",
                record.objective
            ),
        }))
    }

    /// Looks at the result for its page. Where the run is to end, losses of LiDARs have a few seconds.
    fn looks(&self, best: &Scored, baselines: &[Scored]) -> Result<Looks, RunError> {
        let (job, watcher) = (self.job, self.computing.watcher);
        let deadline = job.settings().time.as_ref().map(TimeLimit::deadline);
        let is_early = |deadline: Instant| Instant::now() < deadline;
        let mut patience = None;
        let mut go_on = || {
            is_early(*patience.get_or_insert_with(|| Instant::now() + PATIENCE))
                || (deadline.is_none_or(is_early) && watcher.goes_on())
        };
        Ok(Looks::new(job, self.run.suite(), &best.placement, baselines, &mut go_on)?)
    }

    /// Writes the result in the first scene where the request names a file.
    fn write_gltf(&self, record: &RunRecord) -> Result<(), RunError> {
        let Some(best) = &record.best else { return Ok(()) };
        let (scene, placements) = (&**self.job.scene(), std::slice::from_ref(&best.placement));
        let view = GltfView { scene, frame: 0, placements, points: &[] };
        outputs::write_gltf(self.request.gltf.gltf.as_deref(), self.computing.watcher, &view)
    }

    /// Work and wall times of all sittings up to now.
    fn spent(&self) -> Spent {
        let now = self.run.run().map(Run::times).unwrap_or_default();
        let Spent { searched, seconds, times, ref kept } = self.earlier;
        Spent {
            searched: searched + now.scored,
            seconds: seconds + now.until_swaps,
            kept: kept.clone(),
            times: RunTimes {
                load: times.load + self.times.load,
                build: times.build + self.times.build + now.frames,
                equip: times.equip + self.run.equipped_in.as_secs_f64(),
                search: times.search + now.search,
                generations: times.generations + now.generations,
                bookkeeping: times.bookkeeping + now.bookkeeping,
                swaps: times.swaps + now.swaps,
                bounds: times.bounds + now.bounds,
                confirm: times.confirm + now.confirm,
                page: times.page,
                total: times.total + self.start.elapsed().as_secs_f64(),
            },
        }
    }
}

/// One run of the program on a run folder.
struct RunSession<'a> {
    request: &'a OptimizeRequest,
    computing: &'a Computing<'a>,
    begun: Begun,
    job: &'a Job,
    folder: RunDir<RunCheckpoint>,
    run: JobRun<'a>,
    /// Seconds until the search could begin.
    times: LoadTimes,
    /// Times of earlier sittings.
    earlier: Spent,
    start: Instant,
}

/// Time between two checkpoints: one after each generation would take longer than the search itself
/// where generations are quick.
const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(1);

/// File of the times and the result of earlier sittings. The checkpoint does not hold them: it is the same bytes however often
/// a run was interrupted.
const TIMES: &str = "times.json";

/// Work and wall times of all sittings of a run, and the result of the last one that had any.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Spent {
    /// Placements × frames that the generations scored.
    searched: u64,
    /// Seconds of the generations, with going to other frames.
    seconds: f64,
    times: RunTimes,
    /// A sitting with less time ends with nothing worse; see [`JobRun::keep`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    kept: Option<Placement>,
}

/// Times of earlier sittings; none where a run was killed before it wrote its first, and for a new one: with --force its
/// folder may hold those of another run.
fn earlier_times<T: DeserializeOwned + Default>(folder: &Path, is_new: bool) -> T {
    if is_new {
        return T::default();
    }
    let text = read_own(&folder.join(TIMES), 1 << 20).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// Saves the state: the history first, so that it is never behind.
fn save(sitting: &RunSession) -> Result<(), RunError> {
    if let Some(run) = sitting.run.run() {
        sitting.folder.write_lines("history.jsonl", run.state().history())?;
    }
    let state = sitting.run.state();
    sitting.folder.save(&RunCheckpoint { begun: sitting.begun.clone(), state })?;
    Ok(sitting.folder.write_json(TIMES, &sitting.spent())?)
}

/// A placement as a file lists it, with the price of its sensors on a vehicle that has prices.
fn priced(job: &Job, placement: &Placement) -> Value {
    let (mut listed, vehicle) = (json!(placement), job.scene().vehicle());
    if !vehicle.is_nameless() {
        listed["price"] = json!(vehicle.price_of_rig(placement).unwrap_or(0.0));
    }
    listed
}

/// Writes result, charts and page, and hands out the record.
fn finish(sitting: &RunSession, outcome: &Outcome) -> Result<RunRecord, RunError> {
    let (folder, suite, job) = (&sitting.folder, sitting.run.suite(), sitting.job);
    let spent = sitting.spent();
    let settings = sitting.run.run().map_or(job.settings(), |run| run.state().settings());
    // A limit that did not end the run does not matter.
    let limit = sitting.request.max_seconds.filter(|_| outcome.stopped == Stopped::Time);
    let mut settled = settings_json(sitting, settings, &outcome.left_out);
    if let Some(seconds) = limit {
        settled["max_seconds"] = json!(seconds);
    }
    let mut record = RunRecord {
        settings: settled,
        command: command(&sitting.begun, settings, limit, in_full),
        equipment: sitting.run.equipment_in_words(),
        seed: settings.seed,
        objective: settings.objective.to_string(),
        conditions: sitting.begun.files.conditions.clone(),
        rate: spent.searched as f64 / spent.seconds,
        timings: spent.times,
        peak_memory: peak_memory(),
        ..RunRecord::new(outcome, suite, job.scene().name())
    };
    sitting.check(&record)?;
    let drawing = Instant::now();
    let (best, baselines) = (&record.best, &record.baselines);
    let looks = best.as_ref().map(|best| sitting.looks(best, baselines)).transpose()?;
    let near_field = looks.as_ref().and_then(Looks::near_field);
    let drawings = Figures::new(best.as_ref(), suite.constraints(), &job.scene().body(), looks)
        .with_search(&record, &outcome.history);
    // All but writing the files is over.
    let mut spent = sitting.spent();
    spent.times.page += drawing.elapsed().as_secs_f64();
    spent.kept = record.best.as_ref().map(|best| best.placement.clone()).or(spent.kept);
    record.timings = spent.times;
    record.near_field = near_field;
    folder.write_json(TIMES, &spent)?;
    folder.write_json("result.json", &record.json())?;
    let found = record.best.iter().chain(&record.baselines);
    let found: Vec<Value> = found.map(|scored| priced(job, &scored.placement)).collect();
    folder.write_json("placements.json", &json!({ "placements": found }))?;
    outputs::write_drawings(folder, &drawings)?;
    // The page is read where the run was made.
    let here = command(&sitting.begun, settings, limit, from_here);
    let whole = std::mem::replace(&mut record.command, here);
    let tolerance = tolerance_command(&sitting.begun, folder.path());
    folder.write_text("report.html", &report_html(&record, &drawings, &tolerance))?;
    record.command = whole;
    let wanted = sitting.request.figures.figures.as_deref();
    let table = wanted.map(|_| ("result", run_csv(&record)));
    outputs::write_figures(wanted, drawings.files(record.best.as_ref()), table)?;
    Ok(record)
}

/// Every setting that decides about the result, in the keys of `result.json`.
fn settings_json(sitting: &RunSession, settings: &Settings, left_out: &[LeftOut]) -> Value {
    let (begun, vehicle) = (&sitting.begun, sitting.job.scene().vehicle());
    let mut all = begun.settings(vehicle);
    all["frames"] = match settings.frames {
        FrameChoice::OnDemand => Value::Null,
        FrameChoice::All => json!(u32::MAX),
        FrameChoice::Count(frames) => json!(frames),
    };
    all["baselines"] = json!(settings.baselines);
    (all["method"], all["target"]) = (json!(settings.method), json!(settings.target));
    all["left_out"] = json!(left_out);
    all["search"] = json!({
        "objective": settings.objective,
        "evaluations": settings.evaluations,
        "population": settings.population,
        "seed": settings.seed,
        "delta": settings.delta,
        "gap": settings.gap,
    });
    if !settings.starts.is_empty() {
        all["starts"] = json!(settings.starts);
    }
    for (key, file) in [("baselines_file", &begun.baselines), ("starts_file", &begun.inject)] {
        if let Some(file) = file {
            all[key] = json!(file.to_string_lossy());
        }
    }
    if let Some(equipped) = sitting.run.equipped() {
        all["budget"] = json!(begun.files.budget);
        all["equipped"] = equipped.record(vehicle);
    }
    all
}

/// Progress of a run.
struct Bars<'a> {
    shown: Option<(Work, Box<dyn Bar>)>,
    watcher: &'a dyn Watcher,
}

impl<'a> Bars<'a> {
    pub(crate) fn new(watcher: &'a dyn Watcher) -> Self {
        Self { shown: None, watcher }
    }

    pub(crate) fn show(&mut self, event: &Event) {
        match *event {
            Event::Asks => {}
            Event::Note(sentence) => self.watcher.note(sentence),
            Event::Generation(record) => {
                if let (Some((_, bar)), Some(best)) = (&self.shown, record.best_so_far) {
                    let missing = record.missing.map_or(String::new(), |missing| {
                        format!(", misses {:.1} % of the requirements", 100.0 * missing)
                    });
                    bar.say(format!("· best {best:.4e}{missing}"));
                }
            }
            Event::Progress { work, done, total } => {
                if self.shown.as_ref().is_none_or(|(shown, _)| *shown != work) {
                    self.clear();
                    let bar = self.watcher.bar(total, Some(&work.to_string()));
                    self.shown = Some((work, bar));
                }
                if let Some((_, bar)) = &self.shown {
                    bar.set(done, total);
                }
            }
        }
    }

    pub(crate) fn clear(&mut self) {
        self.shown = None;
    }
}
