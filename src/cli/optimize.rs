mod auto;
mod finalists;
mod folder;
mod follow;
mod generations;
mod grid;
mod outcome;
mod pages;
mod rules;
mod settings;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use sightline::chart::merged_over;
use sightline::problem::Problem;
use sightline::problem::spread;
use sightline::report::{Figures, RunTimes, Scored};
use sightline::score::Objective;
use sightline::search::{Evaluator, GenerationRecord, SWAP_SPACING, Search, SearchStop};
use sightline::vehicle::Constraints;
use sightline::vehicle::{Placement, PoseGrid, Spacing, read_placements};

use super::args::{Compute, Format, Talk, at_least_one, finite, parse_seconds, parse_size, whole};
use super::error::Error;
use super::inputs::Input;
use super::interrupt::{INTERRUPTED, Interrupt};
use super::load;
use auto::{Auto, FidelityChoice};
use folder::{RunFolder, Spent};
use follow::scores_with;
use grid::{Method, parse_spacing};
use outcome::{body_of, print};
use rules::{Rules, left_out};
use settings::RunSettings;

/// Share of `--max-seconds` that the generations may take; the swaps have what is left.
const GENERATIONS_SHARE: f64 = 0.4;

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
        default_value = "m_sog_scaled",
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
    /// Placements wanted at once: further instances of the CMA-ES run beside the first while they fit,
    /// so that a large device is kept busy. It changes the result [default: one instance at a time]
    #[arg(long, value_name = "N", conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(4..=1_000_000))]
    batch: Option<u32>,
    /// How much of the scene the search models: as few frames as keep the ranking, more when they no
    /// longer tell the best apart (auto), or all (full); the result is confirmed over all
    #[arg(long, value_enum, default_value_t = FidelityChoice::Auto, conflicts_with = "resume")]
    fidelity: FidelityChoice,
    /// Frames that the search averages over, spread evenly, whatever they lose
    #[arg(long, value_name = "N", conflicts_with_all = ["resume", "fidelity"],
          value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to search
    #[arg(long, value_enum, default_value_t = Method::Both, conflicts_with = "resume")]
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
    /// Keep what each sensor pose of a grid covers in this folder, for later runs
    #[arg(long, value_name = "DIR")]
    atlas: Option<PathBuf>,
    /// Size of that folder; what was used longest ago goes first
    #[arg(long, value_name = "SIZE", default_value = "4G", requires = "atlas",
          value_parser = parse_size)]
    atlas_size: u64,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    rules: Rules,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let deadline = |share: f64| {
        args.max_seconds.map(|seconds| start + Duration::from_secs_f64(share * seconds))
    };
    let (mut settings, resumed) = match &args.resume {
        Some(folder) => {
            let resumed = RunFolder::resume(folder)?;
            (resumed.settings.clone(), Some(resumed))
        }
        None => (RunSettings::of(args)?, None),
    };
    let objective: Objective = settings.search.objective.parse()?;
    let (scene, psog, mut times) = load::scene_and_psog(&settings.scene, args.compute.talk)?;
    load::note_frames(&scene, args.frames, args.compute.talk);
    let inputs = Input::of(&scene)?;
    if let Some(resumed) = &resumed {
        resumed.folder.check(&inputs)?;
    }
    let scene = scene
        .with_rules(&settings.rules, &settings.scene.display().to_string())
        .map_err(|error| Error::Usage(format!("options for the mount: {error}")))?;
    let building = Instant::now();
    let constraints = Constraints::from(scene.mount());
    let all_frames: Vec<usize> = (0..scene.frame_count()).collect();
    let whole = Arc::new(Problem::with_psog(&scene, &psog, &all_frames)?);
    let auto = match (&resumed, settings.frames) {
        (Some(resumed), _) => resumed.auto.clone(),
        (None, Some(_)) => None,
        (None, None) => Some(Auto::new(
            (&scene, &whole),
            &constraints,
            &settings.baselines,
            &objective,
            settings.search.seed,
            args.compute.memory_budget(),
        )?),
    };
    let frames = match &auto {
        Some(auto) => auto.frames().to_vec(),
        None => spread(whole.frame_count(), settings.frames),
    };
    let open_on = |frames: &[usize], cell: Option<f64>, compute: &Compute| {
        let problem = match cell {
            Some(cell) => Arc::new(merged_over(&whole, &scene, frames, cell)),
            None if frames.len() < whole.frame_count() => Arc::new(whole.over(frames)),
            None => whole.clone(),
        };
        load::evaluator(problem, compute)
    };
    let mut evaluator = open_on(&frames, auto.as_ref().and_then(Auto::cell), &args.compute)?;
    if let Some(merging) = auto.as_ref().and_then(Auto::merging) {
        args.compute.talk.detail(merging.words());
    }
    if auto.is_some() {
        evaluator.keep_last();
    }
    times.build += building.elapsed().as_secs_f64();
    if objective.needs_detection() && !evaluator.problem().content().has_detection() {
        return Err(Error::Usage(format!(
            "{}: the objective `{objective}` needs a detection target; name its classes under \
             `detection` in the scene",
            settings.scene.display()
        )));
    }
    let store = pages::open(args)?;
    PoseGrid::new(&constraints, settings.search.delta.unwrap_or(SWAP_SPACING))?;
    let (folder, search, history, mut spent) = match resumed {
        Some(resumed) => (resumed.folder, resumed.search, resumed.history, resumed.spent),
        None => {
            let mut start = settings.baselines.clone();
            if let Some(file) = &args.inject {
                let injected = read_placements(file)?;
                settings.left_out = left_out(&constraints, &injected, args.compute.talk);
                start.extend(injected);
            }
            let search = Search::new(settings.search.clone(), &constraints, &start)?;
            // Before the search, so that a folder that cannot be written is found out now.
            let folder = RunFolder::create(args.out.as_deref(), &settings.scene, inputs)?;
            (folder, search, Vec::new(), Spent::default())
        }
    };
    let quiet = Compute { talk: Talk { quiet: true, verbose: false }, ..args.compute.clone() };
    let open = |frames: &[usize], cell: Option<f64>| open_on(frames, cell, &quiet);
    let whole = whole.clone();
    spent.times.load += times.load;
    spent.times.build += times.build;
    let (full, chosen, searching) = (None, None, Instant::now());
    let mut run = Run {
        settings,
        objective,
        evaluator,
        search,
        history,
        folder,
        auto,
        whole,
        full,
        chosen,
        spent,
        start,
        searching,
    };

    let interrupt = Interrupt::listen(args.compute.talk);
    if run.settings.method != Method::Swaps {
        let until = interrupt.until(deadline(GENERATIONS_SHARE));
        run.search(&args.compute, &until, &open)?;
    }
    run.settle(&args.compute, &open)?;
    let generations_spent = run.spent_so_far();
    let (mut swaps, mut bounds) = (None, None);
    let until = interrupt.until(deadline(1.0));
    if !interrupt.is_pressed() && run.search.stopped() != Some(SearchStop::Target) {
        if let Some(store) = &store {
            run.evaluator.keep_pages(store.clone());
        }
        (swaps, bounds) = run.on_the_grid(&args.compute, &until)?;
    }
    if let (Some(store), Some(folder)) = (store, &args.atlas) {
        store.shrink();
        pages::note(&store.report(), folder, args.compute.talk);
    }
    let interrupted = interrupt.is_pressed();
    let is_over = until.is_set() || run.is_cut_short();
    let stopped = match run.search.stopped() {
        _ if interrupted => "interrupted".to_owned(),
        Some(SearchStop::Target) => SearchStop::Target.to_string(),
        _ if is_over => "time: the seconds given are over".to_owned(),
        Some(why) => why.to_string(),
        None => "settled: no swap gains any more".to_owned(),
    };
    run.say_stopped(&stopped, interrupted || is_over, args.compute.talk);
    let search_spent = run.spent_so_far();
    let confirming = Instant::now();
    let searched_all = run.is_over_all();
    let search_frames = run.evaluator.problem().frame_count();
    let mut backend_changes = Vec::new();
    let mut searched_with = None;
    if !searched_all {
        backend_changes = run.evaluator.backend().changes().to_vec();
        let on_cpu = run.evaluator.backend().name() == "cpu";
        let mut all = match run.full.take().filter(|_| on_cpu) {
            Some(full) => full,
            None => open(&all_frames, None)?,
        };
        if let Some(auto) = &run.auto {
            all.remember(auto.known());
        }
        searched_with = Some(std::mem::replace(&mut run.evaluator, all));
    }
    let others = swaps.as_ref().map_or(0, |swaps| 1 + swaps.others.len());
    let bar = run.confirming(1 + others + run.settings.baselines.len(), args.compute.talk);
    let finding = run.confirm(swaps, bounds, searched_with, &bar)?;
    let mut record = run.record(&scene, finding, stopped, &bar)?;
    bar.finish_and_clear();
    let map = run.map(record.best.as_ref())?;
    for change in run.evaluator.backend().changes() {
        // What confirms the result was opened without a word.
        if !searched_all {
            args.compute.talk.note(change);
        }
        backend_changes.push(change.clone());
    }
    record.backend_changes = backend_changes;
    record.search_frames = search_frames;
    record.rate = generations_spent.searched as f64 / generations_spent.seconds;
    record.timings = RunTimes {
        confirm: run.spent.times.confirm + confirming.elapsed().as_secs_f64(),
        total: run.spent_so_far().times.total,
        ..search_spent.times
    };
    let figures = Figures::new(
        &record,
        &run.history,
        run.evaluator.constraints(),
        &body_of(&scene),
        map.as_ref(),
    );
    let spent = Spent { times: record.timings, ..generations_spent };
    run.folder.finish(&record, &figures, &spent)?;
    if record.best.is_none() && !interrupted {
        return Err(Error::Usage(format!(
            "{}: mount: no candidate kept its rules ({}); widen the mount or relax them",
            run.settings.scene.display(),
            record.constraints.join("; ")
        )));
    }
    print(args, &record, run.folder.path())?;
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Opens an evaluator over some of the scene's frames, with vertices merged in cells of an edge.
type Open<'a> = dyn Fn(&[usize], Option<f64>) -> Result<Evaluator, Error> + 'a;

/// A run under way.
struct Run {
    settings: RunSettings,
    objective: Objective,
    evaluator: Evaluator,
    search: Search,
    history: Vec<GenerationRecord>,
    folder: RunFolder,
    auto: Option<Auto>,
    /// The problem over all frames.
    whole: Arc<Problem>,
    /// Scores over all frames, where `auto` has needed that.
    full: Option<Evaluator>,
    /// The best finalist over all frames, where `auto` has confirmed some.
    chosen: Option<Placement>,
    /// Of earlier sittings, and of this one until the search began; of the generations up to now.
    spent: Spent,
    start: Instant,
    /// When the search of this sitting began.
    searching: Instant,
}

impl Run {
    /// Whether the search is now over all frames with every triangle.
    fn is_over_all(&self) -> bool {
        let is_merged = self.auto.as_ref().and_then(Auto::cell).is_some();
        !is_merged && self.evaluator.problem().frame_count() == self.whole.frame_count()
    }

    fn scored(
        &mut self,
        placements: &[Placement],
        bar: &ProgressBar,
    ) -> Result<Vec<Scored>, Error> {
        let scores = scores_with(bar, &mut self.evaluator, placements)?;
        let constraints = self.evaluator.constraints();
        let scored = placements.iter().zip(scores).map(|(placement, scores)| Scored {
            objective: self.objective.value(&scores),
            violations: constraints.violations(placement).iter().map(ToString::to_string).collect(),
            placement: placement.clone(),
            scores,
        });
        Ok(scored.collect())
    }
}
