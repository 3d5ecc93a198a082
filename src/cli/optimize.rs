//! `sightline optimize`: options to a request, the result on stdout.

use std::path::PathBuf;

use super::args::{Compute, UnnamedModelArgs, parse_seconds};
use super::output::{Exit, Terminal};
use crate::job::{FRONT_EVALUATIONS, FrontError, FrontObjectives, JobFiles};
use crate::report::front::{front_csv, front_text};
use crate::report::record::record_text;
use crate::report::run_tables::run_csv;
use crate::runs::optimize::{
    FrontStart, NewRun, OptimizeRequest, Start, finished, front, holds_front, optimize,
};
use crate::runs::parse::{number_as, number_that, price, whole};
use crate::runs::{Conditions, FiguresOut, Gltf, MountingArgs};
use crate::runs::{RunError, TableFormat, Watcher};
use crate::scan::conditions::in_words;
use crate::score::Seen;
use crate::search::{FrameChoice, Method, Settings};
use crate::vehicle::pose_grid::Spacing;
use crate::vehicle::{MountRules, SensorPose};

#[derive(clap::Args)]
#[command(
    after_help = "Examples:
  sightline optimize scenes/urban-crossing.json
  sightline optimize scenes/highway.json --objective '0.5*m_sog_scaled + 0.5*detection.m_sog_scaled'
  sightline optimize scenes/highway.json scenes/residential.json --mirror
  sightline optimize scenes/highway.json --symmetric --equal-height --max-seconds 30
  sightline optimize scenes/highway.json scenes/residential.json --vehicle scenes/vehicles/car.json --budget 12000
  sightline optimize scenes/urban-crossing.json --vehicle scenes/vehicles/car.json --front price,near_gain
  sightline optimize --resume runs/highway",
    mut_args(of_new_run)
)]
pub(super) struct OptimizeArgs {
    /// Scene files; of several the mean is maximized
    ///
    /// They share LiDAR and mount; each is normalized by its own total.
    #[arg(value_name = "SCENE", required_unless_present = "resume", conflicts_with = "resume")]
    scenes: Vec<PathBuf>,
    /// Add each scene mirrored left to right, so that a result is not lopsided because one street is
    #[arg(long, conflicts_with = "resume")]
    mirror: bool,
    /// Folder for the run [default: runs/SCENE, numbered if it is taken]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with an interrupted run, to the same bytes that it would have given; a finished one says where its result is
    ///
    /// Options that the run was begun with, the vehicle and the seed among them, belong to the run and are refused here.
    /// Where time ended the choice of sensors, its poses are cast anew: give more --max-seconds than before.
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Score to maximize, or a weighted sum of several [default: near_gain]
    ///
    /// near_gain, near_gain_2, near_gain_3, information_gain, information_gain_share, m_sog, m_sog_nonzero, m_sog_scaled,
    /// m_sog_scaled_nonzero, s_mig; all but the near gains and s_mig also of detection, as detection.m_sog_scaled.
    /// m_sog_scaled is the paper's. The default is justified by the near ground that its optima see, not by what learners
    /// recognize (docs/evidence.md).
    /// A rig that may lose a LiDAR wants near_gain_2: a voxel counts half if one LiDAR sees it, and in full if two do.
    /// Likewise near_gain_3 counts thirds up to three.
    #[arg(long, allow_hyphen_values = true, conflicts_with = "resume")]
    objective: Option<String>,
    /// Placements that the generations evaluate; casts of the swaps and their refinements grow with them
    /// [default: 180; with --front 40]
    ///
    /// The swaps cast up to twice as many sensor poses as the generations, with --method swaps every pose of the grid.
    /// With --front that many around each point of the front; 0 leaves the points on the coarse grid.
    #[arg(long, value_name = "N", conflicts_with = "resume", value_parser = whole::<u64>)]
    evaluations: Option<u64>,
    /// Seconds from the start after which the run ends, generations after two fifths of them; --resume goes on
    /// from there
    ///
    /// The last fifth of a run over more than 32 frames is kept to confirm the result over all of them; where that is
    /// not enough, result and baselines are scored over few frames, and `stopped` says so. A P-SOG that is not scanned
    /// in that time ends the run with an error. The scores over few frames and the page, seconds each, come on top.
    /// --resume casts the poses for a choice of sensors anew, where the time ended in that choice: give it more then.
    #[arg(long, value_name = "S", alias = "time", value_parser = parse_seconds)]
    max_seconds: Option<f64>,
    /// Score over all frames at which the search ends; a near gain of 25 % is 0.25
    #[arg(long = "enough", alias = "target", value_name = "SCORE", conflicts_with = "resume", allow_hyphen_values = true,
          value_parser = number_as("0.25"))]
    target: Option<f64>,
    /// Placements of a generation [default: chosen from the number of variables]
    #[arg(long, value_name = "N", conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(4..=10_000))]
    population: Option<u32>,
    /// Frames of the scene that the search models: as few as keep the ranking, and more when they no
    /// longer tell the best apart (auto), or all (full); the result is confirmed over all
    #[arg(long, value_enum, default_value_t = FidelityArg::Auto, conflicts_with = "resume")]
    fidelity: FidelityArg,
    /// Frames of each scene that the search averages over, spread evenly, whatever they lose
    #[arg(long, value_name = "N", conflicts_with_all = ["resume", "fidelity"],
          value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to search: CMA-ES, then swaps of single LiDARs among poses of a grid and their refinement (both), the first alone
    /// (cma), or swaps over every pose of the grid and their refinement (swaps)
    #[arg(long, value_parser = method, default_value = "both", conflicts_with = "resume")]
    method: Method,
    /// Search on a grid of sensor poses alone, as in the paper: metres and radians between
    /// neighbours, as 0.1 or 0.2,0.1. Swaps always use one [default for them: 0.1]
    #[arg(long, value_name = "M[,RAD]", conflicts_with = "resume", value_parser = parse_spacing)]
    delta: Option<Spacing>,
    /// Work on the bound until it shows that no placement on its grid that meets the requirements is better than the best
    /// one there by more than this percentage. It may take a minute or more [default: a bound that takes few seconds]
    #[arg(long, value_name = "PERCENT", conflicts_with = "resume",
          value_parser = number_that(|percent| (0.0..=100.0).contains(&percent), "0 to 100 per cent, as 2"))]
    bound: Option<f64>,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>, conflicts_with = "resume")]
    seed: u64,
    /// Placements to compare with, and to start from where the mount allows them
    /// [default: Table 7 of the paper]
    #[arg(long, value_name = "PLACEMENTS", conflicts_with = "resume")]
    baselines: Option<PathBuf>,
    /// More placements to start from where the mount allows them; not compared with
    #[arg(long, value_name = "PLACEMENTS", conflicts_with = "resume")]
    inject: Option<PathBuf>,
    /// Most that the sensors may cost, in the vehicle's currency
    ///
    /// Models, mounts and numbers of sensors are chosen for the money.
    #[arg(long, value_name = "PRICE", conflicts_with = "resume", value_parser = price)]
    budget: Option<f64>,
    /// Take the fewest sensors of a vehicle that meet all of its requirements: among equal numbers the cheapest, and
    /// their best placement
    #[arg(long, conflicts_with = "resume")]
    fewest: bool,
    /// Search the front of two or three objectives over a vehicle's sensors and poses, as price,near_gain: every
    /// placement that no other one found beats in all of them
    ///
    /// price, sensors (their number) and requirements (also targets: the share that is missing of what the vehicle
    /// requires, summed) are better when less, the scores of --objective when more. Sensors are chosen on a coarse grid of
    /// poses, for each of a row of prices or numbers at most; scores that are no gain are not chosen by, but compared. All
    /// placements are scored over all frames. --evaluations searches around each point, and around cheap sensors that
    /// miss little of the requirements; without it a front takes a quarter of the time. A point that misses a requirement takes the place of none that meets all. The folder gets placements.json in the order of the
    /// first objective, front.svg, report.html and result.json with the front and its picks: the cheapest that meets all
    /// requirements, the knee, the best of each. Exit code 1 if none meets all requirements. --resume goes
    /// on with a stopped front: only the choice or the search that was under way is done again.
    #[arg(long, value_name = "A,B[,C]", value_parser = objectives, conflicts_with_all = ["resume", "fewest", "target",
          "baselines", "inject", "gltf", "bound"])]
    front: Option<FrontObjectives>,
    #[command(flatten)]
    mounting: MountingArgs,
    #[command(flatten)]
    figures: FiguresOut,
    #[command(flatten)]
    conditions: Conditions,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = TableFormat::Text)]
    format: TableFormat,
    #[command(flatten)]
    gltf: Gltf,
    #[command(flatten)]
    rules: RuleArgs,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

/// Options of several commands that the state of a run decides here: --resume refuses them.
const OF_NEW_RUN: [&str; 4] = ["vehicle", "sensor", "tolerance", "condition"];

/// Refuses an option of [`OF_NEW_RUN`] beside --resume.
fn of_new_run(arg: clap::Arg) -> clap::Arg {
    if OF_NEW_RUN.contains(&arg.get_id().as_str()) { arg.conflicts_with("resume") } else { arg }
}

pub(super) fn run(args: &OptimizeArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    if let Some(objectives) = &args.front {
        let mut new = new_run(args);
        new.settings.evaluations = args.evaluations.unwrap_or(FRONT_EVALUATIONS);
        return run_front(args, &FrontStart::New(Box::new(new), objectives.clone()), &terminal);
    }
    let draws = args.gltf.gltf.is_some() || args.figures.figures.is_some();
    // Drawings and CSV need scores as values; result.json is not read back into them.
    let is_asked_for_more = draws || args.format == TableFormat::Csv;
    if let Some(folder) = args.resume.as_ref().filter(|_| !is_asked_for_more)
        && let Some(finished) = finished(folder)?
    {
        match args.format {
            TableFormat::Json => out!("{}", finished.result)?,
            _ => outln!("{}", finished.words)?,
        }
        return Ok(if finished.is_met { terminal.exit() } else { Exit::CheckFailed });
    }
    if let Some(folder) = args.resume.as_ref().filter(|folder| holds_front(folder)) {
        if args.gltf.gltf.is_some() {
            let words = "holds a front, of which --gltf draws nothing; leave it out";
            return Err(RunError::Usage(format!("{}: {words}", folder.display())));
        }
        return run_front(args, &FrontStart::Resume(folder.clone()), &terminal);
    }
    if args.evaluations == Some(0) {
        let words = "--evaluations: give a whole number from 1 on; 0 is for --front alone";
        return Err(RunError::Usage(words.to_owned()));
    }
    let start = match &args.resume {
        Some(folder) => Start::Resume(folder.clone()),
        None => Start::New(Box::new(new_run(args))),
    };
    let request = OptimizeRequest {
        start,
        max_seconds: args.max_seconds,
        frames: args.frames,
        gltf: args.gltf.gltf.clone(),
        figures: args.figures.figures.clone(),
    };
    let found = optimize(&request, &args.named.computing(&args.compute, &terminal))?;
    match (&found, args.format) {
        (None, _) => return Ok(Exit::Interrupted),
        (Some(found), TableFormat::Json) => outln!("{}", found.record.json())?,
        (Some(found), TableFormat::Csv) => out!("{}", run_csv(&found.record))?,
        (Some(found), TableFormat::Text) => out!("{}", record_text(&found.record, &found.folder))?,
    }
    let best = found.and_then(|found| found.record.best);
    let is_met = best.is_none_or(|best| best.scores.required.iter().all(Seen::is_met));
    Ok(if terminal.goes_on() && !is_met { Exit::CheckFailed } else { terminal.exit() })
}

/// `--front`: the front in place of one result.
fn run_front(
    args: &OptimizeArgs,
    start: &FrontStart,
    terminal: &Terminal,
) -> Result<Exit, RunError> {
    let computing = args.named.computing(&args.compute, terminal);
    let found = front(start, args.max_seconds, args.figures.figures.as_deref(), &computing)?;
    let Some(found) = found else { return Ok(Exit::Interrupted) };
    match args.format {
        TableFormat::Json => outln!("{}", found.record.json())?,
        TableFormat::Csv => out!("{}", front_csv(&found.front))?,
        TableFormat::Text => out!("{}", front_text(&found.front, &found.record, &found.folder))?,
    }
    let is_met = found.front.points.iter().any(|point| point.meets);
    Ok(if terminal.goes_on() && !is_met { Exit::CheckFailed } else { terminal.exit() })
}

fn new_run(args: &OptimizeArgs) -> NewRun {
    let settings = Settings {
        method: args.method,
        evaluations: args.evaluations.unwrap_or(Settings::default().evaluations),
        population: args.population.map(|p| p as usize),
        delta: args.delta,
        gap: args.bound.map(|percent| percent / 100.0),
        seed: args.seed,
        frames: match (args.fidelity, args.frames) {
            (FidelityArg::Full, _) => FrameChoice::All,
            (FidelityArg::Auto, Some(frames)) => FrameChoice::Count(frames),
            (FidelityArg::Auto, None) => FrameChoice::OnDemand,
        },
        target: args.target,
        ..Settings::default()
    };
    let files = JobFiles {
        mirror: args.mirror,
        rules: args.rules.for_mount(),
        budget: args.budget,
        fewest: args.fewest,
        tolerance: Some(args.mounting.tolerance),
        conditions: in_words(&args.conditions.condition),
        ..JobFiles::new(&args.scenes, args.compute.vehicle.as_deref())
    };
    NewRun {
        files,
        out: args.out.clone(),
        objective: args.objective.clone(),
        settings,
        baselines: args.baselines.clone(),
        inject: args.inject.clone(),
    }
}

/// Value of `--fidelity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum FidelityArg {
    /// The fewest frames that keep the ranking
    Auto,
    /// Every frame
    Full,
}

/// `--front`.
fn objectives(text: &str) -> Result<FrontObjectives, FrontError> {
    text.parse()
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

#[derive(clap::Args)]
struct RuleArgs {
    /// All LiDARs stand at one height
    #[arg(long, conflicts_with = "resume")]
    equal_height: bool,
    /// LiDARs come in pairs mirrored at the plane y = 0 (y, roll and yaw change sign); an odd one lies
    /// in it
    #[arg(long, conflicts_with = "resume")]
    symmetric: bool,
    /// Keep a pose field of all LiDARs at one value, in metres or radians, as z=2.5 or roll=0; may be
    /// given several times
    #[arg(long, value_name = "FIELD=VALUE", conflicts_with = "resume", value_parser = parse_fixed)]
    fix: Vec<(String, f64)>,
}

impl RuleArgs {
    fn for_mount(&self) -> MountRules {
        MountRules {
            equal_height: self.equal_height,
            symmetric: self.symmetric,
            fixed: self.fix.clone(),
        }
    }
}

/// `--fix`: a pose field and its value.
fn parse_fixed(text: &str) -> Result<(String, f64), String> {
    let parts = text.split_once('=').map(|(field, value)| (field.trim(), value.trim().parse()));
    match parts {
        Some((field, Ok(value))) if SensorPose::FIELDS.contains(&field) => {
            Ok((field.to_owned(), value))
        }
        _ => Err(format!("write one of {} and a number, as z=2.5", SensorPose::FIELDS.join(", "))),
    }
}

/// `--delta`: metres, and radians where they differ, as `0.1` or `0.2,0.1`.
fn parse_spacing(text: &str) -> Result<Spacing, String> {
    let (metres, radians) = text.split_once(',').unwrap_or((text, text));
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is no spacing; write metres and radians, as 0.1 or 0.2,0.1")),
    };
    Ok(Spacing { metres: number(metres)?, radians: number(radians)? })
}
