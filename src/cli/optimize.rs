mod folder;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use sightline::placement::{Constraints, Placement, read_placements};
use sightline::report::{Figures, InformationMap, RunRecord, RunTimes, Scored};
use sightline::scene::{EgoBody, Scene};
use sightline::score::Objective;
use sightline::search::{Evaluator, GenerationRecord, Search, SearchSettings};

use super::args::{Compute, Format, format_or_default};
use super::error::Error;
use super::load::{self, Loaded};
use super::{progress, table};
use folder::RunFolder;

/// The layouts of Table 7 of the paper, in our frame.
const TABLE_7: &str = include_str!("../../scenes/placements.json");
/// Exit code after Ctrl-C, as shells expect of it.
const INTERRUPTED: u8 = 130;
/// Frames that the map of the gained information averages over.
const MAP_FRAMES: u32 = 4;
/// Distance from a bound, as a share of the range, that counts as on it.
const ON_BOUND: f64 = 1e-3;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline optimize scenes/urban-crossing.json
  sightline optimize scenes/highway.json --objective '0.5*m_sog_scaled + 0.5*detection.m_sog_scaled'
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
    #[arg(long, default_value = "m_sog_scaled", conflicts_with = "resume")]
    objective: String,
    /// Placements to evaluate
    #[arg(long, value_name = "N", default_value_t = 360, conflicts_with = "resume",
          value_parser = clap::value_parser!(u64).range(1..))]
    evaluations: u64,
    /// Placements of a generation [default: chosen from the number of variables]
    #[arg(long, value_name = "N", conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(4..=10_000))]
    population: Option<u32>,
    /// Frames that the search averages over, spread evenly; the result is confirmed over all
    #[arg(long, value_name = "N", default_value_t = 4, conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Seed of all randomness
    #[arg(long, default_value_t = 1, conflicts_with = "resume")]
    seed: u64,
    /// Placements to compare with, and to start from where the mount allows them
    /// [default: Table 7 of the paper]
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    baselines: Option<PathBuf>,
    /// More placements to start from where the mount allows them; not compared with
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    inject: Option<PathBuf>,
    /// How to print the result [default: text on a terminal, else json]
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    compute: Compute,
}

/// Everything that decides about a run's result; kept in its checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RunSettings {
    scene: PathBuf,
    frames: u32,
    baselines: Vec<Placement>,
    search: SearchSettings,
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start_threads()?;
    let (settings, resumed) = match &args.resume {
        Some(folder) => {
            let (folder, settings, search, history) = RunFolder::resume(folder)?;
            (settings, Some((folder, search, history)))
        }
        None => (settings_of(args)?, None),
    };
    let objective: Objective = settings.search.objective.parse()?;
    let loaded = load::scene(&settings.scene, Some(settings.frames), &args.compute)?;
    let Loaded { scene, evaluator, psog, times } = loaded;
    if objective.needs_detection() && !evaluator.problem().content().has_detection() {
        return Err(Error::Usage(format!(
            "{}: the objective `{objective}` needs a detection target; name its classes under \
             `detection` in the scene",
            settings.scene.display()
        )));
    }
    let (folder, search, history) = match resumed {
        Some(resumed) => resumed,
        None => {
            let constraints = evaluator.constraints();
            let mut start = settings.baselines.clone();
            if let Some(file) = &args.inject {
                start.extend(read_placements(file)?);
            }
            let search = Search::new(settings.search.clone(), constraints, &start)?;
            // Before the search, so that a folder that cannot be written is found out now.
            let folder = RunFolder::create(args.out.as_deref(), &settings.scene)?;
            (folder, search, Vec::new())
        }
    };
    let mut run = Run { settings, objective, evaluator, search, history, folder };

    let searching = Instant::now();
    let interrupted = run.search(&args.compute)?;
    let search_seconds = searching.elapsed().as_secs_f64();
    let confirming = Instant::now();
    let all_frames: Vec<usize> = (0..scene.frame_count()).collect();
    let searched_all = run.evaluator.problem().frame_count() == all_frames.len()
        || !run.evaluator.problem().ends_at_hits();
    let search_frames = run.evaluator.problem().frame_count();
    if !searched_all {
        let quiet = Compute {
            talk: super::args::Talk { quiet: true, verbose: false },
            ..args.compute.clone()
        };
        run.evaluator = load::evaluator(&scene, &psog, &all_frames, &quiet)?;
    }
    let map = run.map()?;
    let evaluations = run.search.evaluations() - run.evaluations_before();
    let mut record = run.record(&scene)?;
    record.search_frames = search_frames;
    record.rate = (evaluations * search_frames as u64) as f64 / search_seconds;
    record.timings = RunTimes {
        load: times.load,
        build: times.build,
        search: search_seconds,
        confirm: confirming.elapsed().as_secs_f64(),
        total: start.elapsed().as_secs_f64(),
    };
    let figures = Figures::new(
        &record,
        &run.history,
        run.evaluator.constraints(),
        &body_of(&scene),
        map.as_ref(),
    );
    run.folder.finish(&record, &figures)?;
    print(args, &record, run.folder.path(), interrupted);
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

fn settings_of(args: &Args) -> Result<RunSettings, Error> {
    let scene = args.scene.clone().expect("clap requires a scene or --resume");
    let baselines = match &args.baselines {
        Some(file) => read_placements(file)?,
        None => table_7()?,
    };
    Ok(RunSettings {
        scene: std::path::absolute(&scene).map_err(Error::io(&scene))?,
        frames: args.frames,
        baselines,
        search: SearchSettings {
            objective: args.objective.clone(),
            evaluations: args.evaluations,
            population: args.population.map(|p| p as usize),
            seed: args.seed,
        },
    })
}

/// The layouts of Table 7 of the paper.
pub fn table_7() -> Result<Vec<Placement>, Error> {
    #[derive(Deserialize)]
    struct File {
        placements: Vec<Placement>,
    }
    serde_json::from_str(TABLE_7)
        .map(|file: File| file.placements)
        .map_err(|source| Error::Json { path: "scenes/placements.json".into(), source })
}

/// A run under way.
struct Run {
    settings: RunSettings,
    objective: Objective,
    evaluator: Evaluator,
    search: Search,
    history: Vec<GenerationRecord>,
    folder: RunFolder,
}

impl Run {
    /// Evaluations of earlier sittings of a resumed run.
    fn evaluations_before(&self) -> u64 {
        self.folder.evaluations_before()
    }

    /// Runs generations until the search stops or Ctrl-C; true if interrupted.
    fn search(&mut self, compute: &Compute) -> Result<bool, Error> {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = stop.clone();
        // A second Ctrl-C ends the program at once.
        let handler = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(i32::from(INTERRUPTED));
            }
        });
        if let Err(error) = handler {
            compute.talk.detail(format!("Ctrl-C ends at once: {error}"));
        }
        let bar = progress::bar(self.settings.search.evaluations, "placements", compute.talk);
        bar.set_position(self.search.evaluations());
        bar.reset_eta();
        while self.search.stopped().is_none() && !stop.load(Ordering::SeqCst) {
            let record = self.search.step(&mut self.evaluator, &self.objective)?;
            self.history.push(record);
            self.folder.save(&self.settings, &self.search, &self.history)?;
            bar.set_position(self.search.evaluations());
            if let Some(best) = self.search.best() {
                bar.set_message(format!("best {:.4e}", best.value));
            }
        }
        bar.finish_and_clear();
        if stop.load(Ordering::SeqCst) {
            compute.talk.note(format!(
                "interrupted after generation {}; go on with --resume {}",
                self.search.generation(),
                self.folder.path().display()
            ));
        }
        Ok(self.search.stopped().is_none())
    }

    fn scored(&mut self, placements: &[Placement]) -> Result<Vec<Scored>, Error> {
        let scores = self.evaluator.scores(placements)?;
        let constraints = self.evaluator.constraints();
        let scored = placements.iter().zip(scores).map(|(placement, scores)| Scored {
            objective: self.objective.value(&scores),
            violations: constraints.violations(placement).iter().map(ToString::to_string).collect(),
            placement: placement.clone(),
            scores,
        });
        Ok(scored.collect())
    }

    /// What the result gains over some frames, seen from above.
    fn map(&mut self) -> Result<Option<InformationMap>, Error> {
        let Some(best) = self.search.best() else { return Ok(None) };
        let frames = load::spread(self.evaluator.problem().frame_count(), Some(MAP_FRAMES));
        let problem = self.evaluator.problem();
        let (roi, mut map) =
            (*problem.roi(), InformationMap::new(problem.roi(), problem.content()));
        for &frame in &frames {
            let covered = self.evaluator.backend_mut().covered(&best.placement, frame)?;
            map.add_frame(&roi, self.evaluator.problem().content(), &covered, frames.len());
        }
        Ok(Some(map))
    }

    fn record(&mut self, scene: &Scene) -> Result<RunRecord, Error> {
        let baselines = self.settings.baselines.clone();
        let baselines = self.scored(&baselines)?;
        let best = match self.search.best().map(|best| best.placement.clone()) {
            Some(placement) => {
                let named = Placement { name: "optimized".into(), ..placement };
                Some(self.scored(std::slice::from_ref(&named))?.remove(0))
            }
            None => None,
        };
        let constraints = self.evaluator.constraints();
        Ok(RunRecord {
            sightline: env!("CARGO_PKG_VERSION"),
            scene: scene.name().to_owned(),
            settings: serde_json::json!(self.settings),
            backend: self.evaluator.backend().name().to_owned(),
            adapter: self.evaluator.backend().adapter().to_owned(),
            threads: rayon::current_num_threads(),
            seed: self.settings.search.seed,
            objective: self.objective.to_string(),
            search_frames: 0,
            frames: self.evaluator.problem().frame_count(),
            stopped: self.search.stopped().unwrap_or("interrupted").to_owned(),
            generations: self.search.generation(),
            evaluations: self.search.evaluations(),
            active_bounds: best
                .as_ref()
                .map(|best| active_bounds(&best.placement, constraints))
                .unwrap_or_default(),
            best,
            baselines,
            certificate: None,
            rate: 0.0,
            timings: RunTimes::default(),
            peak_memory: peak_memory(),
        })
    }
}

/// Free pose fields that lie on a bound, in words.
fn active_bounds(placement: &Placement, constraints: &Constraints) -> Vec<String> {
    let mut found = Vec::new();
    for (lidar, pose) in placement.lidars.iter().enumerate() {
        let fields = pose.fields();
        for k in constraints.free_fields() {
            let (low, high) = (constraints.lower[k], constraints.upper[k]);
            let (field, value) = fields[k];
            let near = ON_BOUND * (high - low);
            if value - low <= near {
                found.push(format!("LiDAR {lidar}: {field} at its lower bound {low}"));
            } else if high - value <= near {
                found.push(format!("LiDAR {lidar}: {field} at its upper bound {high}"));
            }
        }
    }
    found
}

/// Triangles of the ego body, for the drawing.
fn body_of(scene: &Scene) -> Vec<[[f32; 3]; 3]> {
    if !scene.has_geometry() {
        return Vec::new();
    }
    let without = scene.frame(0, EgoBody::Exclude).faces.len() as u32;
    let soup = scene.frame(0, EgoBody::Include);
    (without..soup.faces.len() as u32).map(|prim| soup.corners(prim)).collect()
}

/// Most bytes the process has held, where the kernel tells.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes << 10)
}

fn print(args: &Args, record: &RunRecord, folder: &Path, interrupted: bool) {
    if format_or_default(args.format) == Format::Json {
        println!("{}", serde_json::json!(record));
        return;
    }
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    println!("{}: maximizing {} over {} frame(s)", record.scene, record.objective, record.frames);
    print!("{}", table::scores(&rows));
    match &record.best {
        Some(best) => {
            println!("\noptimized placement (m, rad):");
            let titles = ["LiDAR", "x", "y", "z", "roll", "pitch", "yaw"];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            for (index, pose) in best.placement.lidars.iter().enumerate() {
                let mut row = vec![index.to_string()];
                row.extend(pose.fields().map(|(_, value)| format!("{value:.3}")));
                rows.push(row);
            }
            print!("{}", table::align(&rows));
            for bound in &record.active_bounds {
                println!("  on a bound: {bound}");
            }
        }
        None => println!("\nno candidate kept the rules of the mount; widen it"),
    }
    println!(
        "\n{} after {} evaluations in {:.1} s ({:.1} placements × frames/s on {}); report: {}",
        if interrupted { "interrupted" } else { "done" },
        record.evaluations,
        record.timings.total,
        record.rate,
        record.backend,
        folder.join("report.html").display()
    );
}
