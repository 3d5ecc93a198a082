mod summary;

use std::cell::Cell;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::json;
use sightline::chart::{
    Engine, FidelityError, Ladder, Measured, Rung, Workshop, World, candidates, cheapest, rate,
};
use sightline::engine::{Backend, BackendError};
use sightline::problem::Problem;
use sightline::report::{ChartFrame, fidelity_csv, fidelity_svg};
use sightline::score::Objective;
use sightline::vehicle::Constraints;
use sightline::vehicle::{Placement, read_placements, table_7};

use super::args::{BackendChoice, Compute, Format, whole};
use super::error::Error;
use super::inputs::Input;
use super::interrupt::{INTERRUPTED, Interrupt};
use super::output::{Missing, writable_folder, write_whole};
use super::{load, progress};
use summary::Summary;

/// Version of the state in `chart.json`.
const VERSION: u32 = 2;
/// Repeats of a timing, and of a quick one.
const REPEATS: [usize; 2] = [5, 3];
/// Numbered folders that are tried before giving up.
const MOST_RUNS: u32 = 10_000;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline chart scenes/urban-crossing.json --out runs/chart
  sightline chart scenes/highway.json --quick --objective information_gain
  sightline chart --resume runs/chart")]
pub struct Args {
    /// Scene file
    #[arg(required_unless_present = "resume", conflicts_with = "resume")]
    scene: Option<PathBuf>,
    /// Placements to rank beside the random ones [default: Table 7 of the paper]
    #[arg(conflicts_with = "resume")]
    placements: Option<PathBuf>,
    /// Folder for chart.svg, chart.csv and chart.json [default: runs/SCENE-chart, numbered if it is taken]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with an interrupted run; settings that were measured are kept
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Score that ranks the placements, or a weighted sum of several
    #[arg(long, default_value = "m_sog_scaled", conflicts_with = "resume")]
    objective: String,
    /// Random placements within the mount, ranked together with the given ones
    #[arg(long = "placements", value_name = "N", default_value_t = 100, conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(0..=2_000))]
    random: u32,
    /// Share of the best score that taking a setting's best placement may lose; placements farther apart
    /// must keep their order, but for 5 % of their pairs
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    tolerance: f64,
    /// Edge of the finest voxels in metres, to which all else is compared
    /// [default: half of the scene's, where that is 0.1 or more; with --quick the scene's]
    #[arg(long, value_name = "METRES", conflicts_with = "resume", value_parser = metres)]
    finest: Option<f64>,
    /// Fewer combinations and repeats, and no voxels finer than the scene's
    #[arg(long, conflicts_with = "resume")]
    quick: bool,
    /// Seed of the random placements and of the bootstrap
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>, conflicts_with = "resume")]
    seed: u64,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number, as in 0.01".to_owned())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err("give 0 to 1, as in 0.01".into()) }
}

fn metres(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number, as in 0.1".to_owned())?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("give metres above 0".into()) }
}

/// Everything that decides about the result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Settings {
    scene: PathBuf,
    given: Vec<Placement>,
    random: u32,
    objective: String,
    finest: Option<f64>,
    quick: bool,
    seed: u64,
}

/// What `chart.json` keeps of a run, finished or not; other keys are for the reader.
#[derive(Serialize, Deserialize)]
struct State {
    chart: u32,
    settings: Settings,
    inputs: Vec<Input>,
    yardstick_seconds: Option<f64>,
    measured: Vec<Measured>,
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    args.compute.start()?;
    let (folder, mut state) = match &args.resume {
        Some(folder) => (folder.clone(), saved(folder)?),
        None => (new_folder(args)?, fresh(args)?),
    };
    let objective: Objective = state.settings.objective.parse()?;
    let (scene, psog, _) = load::scene_and_psog(&state.settings.scene, args.compute.talk)?;
    let inputs = Input::of(&scene)?;
    if args.resume.is_some() {
        Input::check(&folder, &state.inputs, &inputs)?;
    }
    state.inputs = inputs;
    if objective.needs_detection() && scene.detection_among(psog.classes()).is_empty() {
        return Err(Error::Usage(format!(
            "{}: the objective `{objective}` needs a detection target; name its classes under \
             `detection` in the scene",
            state.settings.scene.display()
        )));
    }
    let edge = scene.roi().voxel[0];
    let finest = state.settings.finest.or(state.settings.quick.then_some(edge));
    if let Some(finest) = finest.filter(|f| *f > edge * (1.0 + 1e-9)) {
        return Err(Error::Usage(format!(
            "--finest {finest}: is coarser than the scene's own voxels of {edge} m; give at most that"
        )));
    }
    let _made = Missing::of(&folder);
    writable_folder(&folder)?;
    let mut ladder = Ladder::new(&scene, finest, state.settings.quick);
    leave_out_engines(&mut ladder, &args.compute);
    let constraints = Constraints::from(scene.mount());
    let placements = candidates(
        &constraints,
        &state.settings.given,
        state.settings.random as usize,
        state.settings.seed,
    );
    let compute = &args.compute;
    let open = |problem: &Arc<Problem>, engine| open_engine(problem, engine, compute);
    let workshop = Workshop::new(
        World::new(scene, psog),
        placements,
        constraints,
        objective,
        Box::new(open),
        REPEATS[usize::from(state.settings.quick)],
        state.yardstick_seconds,
    )?;
    let mut chart = Chart { folder, state, ladder, workshop, edge, tolerance: args.tolerance };
    let interrupted = chart.measure(&args.compute)?;
    chart.finish(args, interrupted)?;
    Ok(if interrupted { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

fn fresh(args: &Args) -> Result<State, Error> {
    let scene = args.scene.clone().expect("clap requires a scene or --resume");
    let given = match &args.placements {
        Some(file) => read_placements(file)?,
        None => table_7(),
    };
    let settings = Settings {
        scene: std::path::absolute(&scene).map_err(Error::io(&scene))?,
        given,
        random: args.random,
        objective: args.objective.clone(),
        finest: args.finest,
        quick: args.quick,
        seed: args.seed,
    };
    let (inputs, measured) = (Vec::new(), Vec::new());
    Ok(State { chart: VERSION, settings, inputs, yardstick_seconds: None, measured })
}

fn new_folder(args: &Args) -> Result<PathBuf, Error> {
    let Some(folder) = &args.out else {
        let scene = args.scene.as_deref().unwrap_or(Path::new("scene"));
        let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
        let first = Path::new("runs").join(format!("{stem}-chart"));
        let numbered = (2..MOST_RUNS).map(|n| Path::new("runs").join(format!("{stem}-chart-{n}")));
        let free = std::iter::once(first.clone()).chain(numbered).find(|path| !path.exists());
        let full = || format!("{}: too many charts; name a folder with --out", first.display());
        return free.ok_or_else(|| Error::Usage(full()));
    };
    if folder.join("chart.json").exists() {
        return Err(Error::Usage(format!(
            "{}: already holds a chart; go on with --resume, or name another folder",
            folder.display()
        )));
    }
    Ok(folder.clone())
}

fn saved(folder: &Path) -> Result<State, Error> {
    let file = folder.join("chart.json");
    let text = std::fs::read_to_string(&file).map_err(Error::io(&file))?;
    let json = |source| Error::Json { path: file.clone(), source };
    let state: State = serde_json::from_str(&text).map_err(json)?;
    if state.chart != VERSION {
        return Err(Error::Usage(format!(
            "{}: is of version {}, this program reads {VERSION}; start a new run",
            file.display(),
            state.chart
        )));
    }
    Ok(state)
}

/// Drops the engines that `--backend` excludes or the machine lacks.
fn leave_out_engines(ladder: &mut Ladder, compute: &Compute) {
    let gpu = || !sightline::engine::gpu::list_adapters().is_empty();
    let why = match compute.backend {
        BackendChoice::Cpu => Some("--backend cpu"),
        _ => (!gpu()).then_some("no Vulkan device"),
    };
    if let Some(why) = why {
        ladder.rungs.retain(|rung| rung.engine != Engine::Gpu);
        ladder.left_out.push(format!("the GPU: {why}"));
    }
}

fn open_engine(
    problem: &Arc<Problem>,
    engine: Engine,
    compute: &Compute,
) -> Result<Box<dyn Backend>, BackendError> {
    use sightline::engine::{CpuBackend, gpu::GpuBackend};
    let budget = compute.memory_budget();
    Ok(match engine {
        Engine::Gpu => {
            Box::new(GpuBackend::new(problem.clone(), compute.adapter.as_deref(), budget)?)
        }
        _ => Box::new(CpuBackend::new(problem.clone(), budget)),
    })
}

/// A ladder being measured.
struct Chart<'a> {
    folder: PathBuf,
    state: State,
    ladder: Ladder,
    workshop: Workshop<'a>,
    edge: f64,
    tolerance: f64,
}

impl Chart<'_> {
    /// Measures what is missing, true if interrupted; the state is written after each setting.
    fn measure(&mut self, compute: &Compute) -> Result<bool, Error> {
        self.check_resumed()?;
        let stop = Interrupt::listen(compute.talk);
        let scene = self.workshop.world().scene();
        let efforts: Vec<f64> = self.ladder.rungs.iter().map(|rung| rung.effort(scene)).collect();
        let count = self.workshop.placements().len();
        // The bar counts millionths of the whole work.
        let unit = 1e6 / (efforts.iter().sum::<f64>() * count as f64);
        let bar = progress::share(1_000_000, compute.talk);
        let mut position = 0.0;
        for (index, rung) in self.ladder.rungs.clone().into_iter().enumerate() {
            let whole = efforts[index] * unit * count as f64;
            if !self.is_measured(&rung) {
                let words = rung.words(self.edge);
                bar.set_message(format!("{}/{}: {words}", index + 1, efforts.len()));
                let done = Cell::new(0.0);
                let go_on = |placements: usize| {
                    done.set(done.get() + placements as f64);
                    bar.set_position((position + efforts[index] * unit * done.get()) as u64);
                    !stop.is_set()
                };
                let before = &self.state.measured;
                match self.workshop.measure(&rung, before, &go_on) {
                    Ok(Some(measured)) => {
                        compute.talk.detail(format!("{words}: {} s", measured.seconds));
                        self.state.measured.push(measured);
                    }
                    Ok(None) => break,
                    // A device that fails at one setting, or an atlas that is too large, does not take
                    // the others along.
                    Err(error @ (FidelityError::Backend(_) | FidelityError::Poses(_)))
                        if matches!(rung.engine, Engine::Gpu | Engine::Atlas) =>
                    {
                        self.ladder.left_out.push(format!("{words}: {error}"));
                    }
                    Err(error) => return Err(error.into()),
                }
                self.state.yardstick_seconds = self.workshop.yardstick_seconds();
                self.write_json(None)?;
            }
            position += whole;
            bar.set_position(position as u64);
            if stop.is_set() {
                break;
            }
        }
        bar.finish_and_clear();
        let missing = self.ladder.rungs.iter().filter(|rung| !self.is_measured(rung)).count();
        let interrupted = stop.is_set() && missing > 0;
        if interrupted {
            compute.talk.note(format!(
                "interrupted with {missing} settings to go; go on with --resume {}",
                self.folder.display()
            ));
        }
        Ok(interrupted)
    }

    fn is_measured(&self, rung: &Rung) -> bool {
        self.state.measured.iter().any(|m| m.rung == *rung)
    }

    /// A scene that has changed since must not be mixed with what was measured.
    fn check_resumed(&mut self) -> Result<(), Error> {
        let Some(first) = self.state.measured.first() else { return Ok(()) };
        let count = self.workshop.placements().len();
        let same = self.state.measured.iter().all(|measured| measured.scores.len() == count)
            && self.ladder.rungs.first() == Some(&first.rung)
            && first.scores[0] == self.workshop.first_score(&first.rung)?;
        if same {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "{}: was begun with another scene or other placements; start a new run",
            self.folder.display()
        )))
    }

    fn finish(&self, args: &Args, interrupted: bool) -> Result<(), Error> {
        let rated = rate(&self.state.measured, self.tolerance, self.state.settings.seed);
        let verdict = cheapest(&rated, self.tolerance);
        let summary = Summary::new(self, &rated, verdict, interrupted);
        let frame = ChartFrame {
            title: &format!(
                "{}: {} placements ranked by {}",
                self.workshop.world().scene().name(),
                self.workshop.placements().len(),
                self.state.settings.objective
            ),
            edge: self.edge,
            chosen: verdict.map(|v| v.setting),
        };
        self.write_text("chart.svg", &fidelity_svg(&rated, &frame))?;
        self.write_text("chart.csv", &fidelity_csv(&rated, self.edge))?;
        self.write_json(Some(&summary))?;
        match args.format {
            Format::Json => outln!("{}", self.json(Some(&summary)))?,
            Format::Text => self.print(&rated, &summary)?,
        }
        Ok(())
    }

    fn json(&self, summary: Option<&Summary>) -> serde_json::Value {
        let mut value = json!(self.state);
        if let (Some(summary), Some(map)) = (summary, value.as_object_mut())
            && let Some(extra) = json!(summary).as_object()
        {
            map.extend(extra.clone());
        }
        value
    }

    fn write_json(&self, summary: Option<&Summary>) -> Result<(), Error> {
        let path = self.folder.join("chart.json");
        write_whole(&path, |file| {
            serde_json::to_writer_pretty(&mut *file, &self.json(summary))
                .map_err(|source| Error::Json { path: path.clone(), source })?;
            file.write_all(b"\n").map_err(Error::io(&path))
        })
    }

    fn write_text(&self, name: &str, text: &str) -> Result<(), Error> {
        let path = self.folder.join(name);
        write_whole(&path, |file| file.write_all(text.as_bytes()).map_err(Error::io(&path)))
    }
}
