//! Files that a run leaves in its folder: checkpoint, times, record, charts and page.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::request::{Begun, OptimizeRequest, RunCheckpoint, command};
use crate::files::{RunDir, read_own};
use crate::job::{Job, JobRun};
use crate::report::record::peak_memory;
use crate::report::{Figures, Looks, RunContext, RunRecord, RunTimes, report_html};
use crate::runs::opening::LoadTimes;
use crate::runs::{Bar, Computing, RunError, Watcher, outputs};
use crate::search::{
    Equipped, Event, FrameChoice, LeftOut, Outcome, Run, Scored, Settings, Stopped, Work,
};
use crate::vehicle::{Placement, SensorName, SensorPose};

/// One run of the program on a run folder.
pub(super) struct RunSession<'a> {
    pub(super) request: &'a OptimizeRequest,
    pub(super) computing: &'a Computing<'a>,
    pub(super) begun: Begun,
    pub(super) job: &'a Job,
    pub(super) folder: RunDir<RunCheckpoint>,
    pub(super) run: JobRun<'a>,
    /// Seconds until the search could begin.
    pub(super) times: LoadTimes,
    /// Times of earlier sittings.
    pub(super) earlier: Spent,
    pub(super) start: Instant,
}

/// Time between two checkpoints: one after each generation would take longer than the search itself
/// where generations are quick.
pub(super) const BETWEEN_CHECKPOINTS: Duration = Duration::from_secs(1);

/// File of the times of earlier sittings. The checkpoint does not hold them: it is the same bytes however often a run
/// was interrupted.
pub(super) const TIMES: &str = "times.json";

/// Work and wall times of all sittings of a run.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Spent {
    /// Placements × frames that the generations scored.
    searched: u64,
    /// Seconds of the generations, with going to other frames.
    seconds: f64,
    times: RunTimes,
}

/// The times of earlier sittings; a run that was killed before it wrote its first times has none.
pub(super) fn read_spent(folder: &RunDir<RunCheckpoint>) -> Spent {
    let text = read_own(&folder.path().join(TIMES), 1 << 20).ok();
    text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
}

impl RunSession<'_> {
    /// Work and wall times of all sittings up to now.
    fn spent(&self) -> Spent {
        let now = self.run.run().map(Run::times).unwrap_or_default();
        let Spent { searched, seconds, times } = self.earlier;
        Spent {
            searched: searched + now.scored,
            seconds: seconds + now.until_swaps,
            times: RunTimes {
                load: times.load + self.times.load,
                build: times.build + self.times.build + now.frames,
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

/// Saves the state: the history first, so that it is never behind.
pub(super) fn save(sitting: &RunSession) -> Result<(), RunError> {
    if let Some(run) = sitting.run.run() {
        sitting.folder.write_lines("history.jsonl", run.state().history())?;
    }
    let state = sitting.run.state();
    sitting.folder.save(&RunCheckpoint { begun: sitting.begun.clone(), state })?;
    Ok(sitting.folder.write_json(TIMES, &sitting.spent())?)
}

/// A placement as a file lists it, with the price of its sensors on a vehicle that has prices.
pub(super) fn priced(job: &Job, placement: &Placement) -> Value {
    let (mut listed, vehicle) = (json!(placement), job.scene().vehicle());
    if !vehicle.is_nameless() {
        let first = vehicle.sensors.first().map_or(SensorName::NONE, |sensor| sensor.name);
        let model = |lidar: &SensorPose| if lidar.sensor.is_none() { first } else { lidar.sensor };
        let price: f64 = placement.lidars.iter().map(|lidar| vehicle.price(model(lidar))).sum();
        listed["price"] = json!(price);
    }
    listed
}

/// Writes result, charts and page, and hands out the record.
pub(super) fn finish(sitting: &RunSession, outcome: &Outcome) -> Result<RunRecord, RunError> {
    let (folder, suite, job) = (&sitting.folder, sitting.run.suite(), sitting.job);
    let spent = sitting.spent();
    let settings = sitting.run.run().map_or(job.settings(), |run| run.state().settings());
    // A limit that did not end the run does not matter.
    let limit = sitting.request.max_seconds.filter(|_| outcome.stopped == Stopped::Time);
    let mut settled =
        settings_json(&sitting.begun, sitting.run.equipped(), settings, &outcome.left_out);
    if let Some(seconds) = limit {
        settled["max_seconds"] = json!(seconds);
    }
    let mut record = RunRecord::new(
        outcome,
        RunContext {
            scene: job.scene().name(),
            settings: settled,
            command: command(&sitting.begun, settings, limit),
            suite,
            equipment: sitting.run.equipment_in_words(),
            seed: settings.seed,
            objective: settings.objective.to_string(),
            conditions: sitting.begun.files.conditions.clone(),
            rate: spent.searched as f64 / spent.seconds,
            timings: spent.times,
            peak_memory: peak_memory(),
        },
    );
    let drawing = Instant::now();
    let (best, baselines) = (&record.best, &record.baselines);
    let look = |best: &Scored| Looks::new(job, suite, &best.placement, baselines);
    let looks = best.as_ref().map(look).transpose()?;
    let drawings = Figures::new(best.as_ref(), suite.constraints(), &job.scene().body(), looks)
        .with_search(&record, &outcome.history);
    // All but writing the files is over.
    let mut spent = sitting.spent();
    spent.times.page += drawing.elapsed().as_secs_f64();
    record.timings = spent.times;
    folder.write_json(TIMES, &spent)?;
    folder.write_json("result.json", &record.json())?;
    let found = record.best.iter().chain(&record.baselines);
    let found: Vec<Value> = found.map(|scored| priced(job, &scored.placement)).collect();
    folder.write_json("placements.json", &json!({ "placements": found }))?;
    if let Some(figure) = &drawings.convergence {
        folder.write_text("convergence.svg", figure)?;
    }
    if let Some(figure) = &drawings.placement {
        folder.write_text("placement.svg", figure)?;
    }
    for (index, (_, map)) in drawings.maps.iter().enumerate() {
        let number = if index > 0 { format!("-{}", index + 1) } else { String::new() };
        folder.write_text(&format!("map{number}.svg"), map)?;
    }
    folder.write_text("report.html", &report_html(&record, &drawings))?;
    let wanted = sitting.request.figures.as_deref();
    outputs::write_figures(wanted, drawings.files(record.best.as_ref()))?;
    Ok(record)
}

/// Every setting that decides about the result, in the keys of `result.json`.
fn settings_json(
    begun: &Begun,
    equipped: Option<&Equipped>,
    settings: &Settings,
    left_out: &[LeftOut],
) -> Value {
    let mut all = json!(begun.files);
    all["frames"] = match settings.frames {
        FrameChoice::OnDemand => Value::Null,
        FrameChoice::All => json!(u32::MAX),
        FrameChoice::Count(frames) => json!(frames),
    };
    all["baselines"] = json!(settings.baselines);
    all["method"] = json!(settings.method);
    all["target"] = json!(settings.target);
    all["left_out"] = json!(left_out);
    all["search"] = json!({
        "objective": settings.objective,
        "evaluations": settings.evaluations,
        "population": settings.population,
        "seed": settings.seed,
        "delta": settings.delta,
    });
    if !settings.starts.is_empty() {
        all["starts"] = json!(settings.starts);
    }
    let given = [("baselines_file", &begun.baselines), ("starts_file", &begun.inject)];
    for (key, file) in given {
        if let Some(file) = file {
            all[key] = json!(file.to_string_lossy());
        }
    }
    if let Some(equipped) = equipped {
        all["budget"] = json!(begun.files.budget);
        all["equipped"] = json!(equipped);
    }
    all
}

/// Progress of a run.
pub(super) struct Bars<'a> {
    shown: Option<(Work, Box<dyn Bar>)>,
    watcher: &'a dyn Watcher,
}

impl<'a> Bars<'a> {
    pub fn new(watcher: &'a dyn Watcher) -> Self {
        Self { shown: None, watcher }
    }

    pub fn show(&mut self, event: &Event) {
        match *event {
            Event::Asks => {}
            Event::Note(sentence) => self.watcher.note(sentence),
            Event::Generation(record) => {
                if let (Some((_, bar)), Some(best)) = (&self.shown, record.best_so_far) {
                    bar.say(format!("· best {best:.4e}"));
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

    pub fn clear(&mut self) {
        self.shown = None;
    }
}
