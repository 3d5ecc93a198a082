//! From the options of `optimize` to the settings of a run.

use std::path::PathBuf;

use crate::internals::Spacing;
use crate::score::Objective;
use crate::search::{Choosing, Equipped, FrameChoice, Method, Settings, State};
use crate::vehicle::{MountRules, SensorPose, read_placements};
use serde::{Deserialize, Serialize};

use crate::cli::args::{
    Compute, Conditions, Format, at_least_one, finite, parse_seconds, parse_weight, whole,
};
use crate::cli::error::Error;
use crate::cli::glb::Gltf;
use crate::scan::conditions::Condition;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline optimize scenes/urban-crossing.json
  sightline optimize scenes/highway.json --objective '0.5*m_sog_scaled + 0.5*detection.m_sog_scaled'
  sightline optimize scenes/highway.json scenes/residential.json --mirror
  sightline optimize scenes/highway.json --symmetric --equal-height --max-seconds 30
  sightline optimize scenes/highway.json scenes/residential.json --vehicle scenes/vehicles/car.json --budget 12000
  sightline optimize scenes/highway.json --near-weight 0.05
  sightline optimize --resume runs/highway")]
pub struct Args {
    /// Scene file; of several, which share LiDAR and mount, the mean is maximized, each normalized by its own
    /// total
    #[arg(value_name = "SCENE", required_unless_present = "resume", conflicts_with = "resume")]
    scenes: Vec<PathBuf>,
    /// Add each scene mirrored left to right, so that a result is not lopsided because one street is
    #[arg(long, conflicts_with = "resume")]
    mirror: bool,
    /// Folder for the run [default: runs/SCENE, numbered if it is taken]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    pub(super) out: Option<PathBuf>,
    /// Go on with an interrupted run, to the same bytes that it would have given
    #[arg(long, value_name = "DIR")]
    pub(super) resume: Option<PathBuf>,
    /// Score to maximize, or a weighted sum of several [default: near_gain, with --near-weight information_gain]
    #[arg(long, allow_hyphen_values = true, conflicts_with = "resume")]
    objective: Option<String>,
    /// Placements that the generations evaluate; the swaps then cast one and a half times as many
    /// sensor poses as those did
    #[arg(long, value_name = "N", default_value_t = 180, conflicts_with = "resume",
          value_parser = at_least_one)]
    evaluations: u64,
    /// Seconds from the start after which the search ends, generations after two fifths of them;
    /// --resume goes on from there. Confirming the result and writing it come on top
    #[arg(long, value_name = "S", visible_alias = "time", value_parser = parse_seconds)]
    pub(super) max_seconds: Option<f64>,
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
    /// Frames of each scene that the search averages over, spread evenly, whatever they lose
    #[arg(long, value_name = "N", conflicts_with_all = ["resume", "fidelity"],
          value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) frames: Option<u32>,
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
    /// Most that the sensors of a vehicle may cost, in the currency of its prices; its models, mounts and
    /// numbers are chosen for the money
    #[arg(long, value_name = "PRICE", conflicts_with = "resume", value_parser = finite)]
    budget: Option<f64>,
    /// Search with W nats more in every voxel of ground within 10 m of the own body, for information_gain;
    /// the true gain and the near field stand beside the result
    #[arg(long, value_name = "W", conflicts_with = "resume", value_parser = parse_weight)]
    near_weight: Option<f64>,
    #[command(flatten)]
    conditions: Conditions,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub(super) format: Format,
    #[command(flatten)]
    pub(super) gltf: Gltf,
    #[command(flatten)]
    rules: Rules,
    #[command(flatten)]
    pub(super) compute: Compute,
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

/// Scenes and rules that a run was begun with.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Begun {
    pub scene: PathBuf,
    /// Those after the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub more_scenes: Vec<PathBuf>,
    /// Whether each scene is there mirrored, too.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub mirror: bool,
    /// Beside those of the scene.
    pub rules: MountRules,
    /// Vehicle file in place of what the scenes say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle: Option<PathBuf>,
    /// Most that the sensors may cost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<f64>,
    /// Nats that near ground counts more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_weight: Option<f64>,
    /// Weather and faults, as they are written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// What a vehicle carries in this run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equipped: Option<Equipped>,
}

/// All that a checkpoint holds.
#[derive(Serialize, Deserialize)]
pub(super) struct Saved {
    pub begun: Begun,
    #[serde(flatten)]
    pub course: Course,
}

/// Where a run stands.
#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Course {
    /// A vehicle's sensors are to be chosen.
    Equipping(Box<Wanted>),
    /// The search has begun.
    Run(Box<State>),
}

/// A choice of sensors, and the search that is to follow.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Wanted {
    pub choosing: Choosing,
    pub settings: Settings,
    /// Whether the result is compared with the same sensors put up plainly.
    pub plainly: bool,
}

impl Begun {
    /// The scene files, in the order given.
    pub fn scenes(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.scene).chain(&self.more_scenes)
    }

    /// Name of the run's folder where none is given.
    pub fn folder(&self) -> String {
        let stem = self.scene.file_stem().unwrap_or_default().to_string_lossy();
        match self.more_scenes.len() {
            0 => stem.into_owned(),
            more => format!("{stem}-and-{more}-more"),
        }
    }
}

pub(super) fn begun(args: &Args) -> Result<Begun, Error> {
    let absolute = |scene: &PathBuf| std::path::absolute(scene).map_err(Error::io(scene));
    let mut scenes = args.scenes.iter().map(absolute);
    let scene = scenes.next().expect("clap requires a scene or --resume")?;
    let more_scenes = scenes.collect::<Result<_, _>>()?;
    let vehicle = args.compute.vehicle.as_ref().map(absolute).transpose()?;
    let (mirror, rules, budget) = (args.mirror, args.rules.for_mount(), args.budget);
    let (near_weight, equipped) = (args.near_weight, None);
    let conditions = args.conditions.condition.iter().map(Condition::to_string).collect();
    Ok(Begun {
        scene,
        more_scenes,
        mirror,
        rules,
        vehicle,
        budget,
        near_weight,
        conditions,
        equipped,
    })
}

/// What a new run begins with.
pub(super) fn wanted(args: &Args) -> Result<Wanted, Error> {
    let (choosing, plainly) = (Choosing::default(), args.baselines.is_none());
    Ok(Wanted { choosing, settings: of(args)?, plainly })
}

/// The settings of a new run.
fn of(args: &Args) -> Result<Settings, Error> {
    let objective = match (&args.objective, args.near_weight) {
        (Some(text), _) => text.parse()?,
        (None, Some(_)) => "information_gain".parse()?,
        (None, None) => Objective::default(),
    };
    let mut settings = Settings {
        objective,
        method: args.method,
        evaluations: args.evaluations,
        population: args.population.map(|p| p as usize),
        delta: args.delta,
        seed: args.seed,
        frames: match (args.fidelity, args.frames) {
            (Fidelity::Full, _) => FrameChoice::All,
            (Fidelity::Auto, Some(frames)) => FrameChoice::Count(frames),
            (Fidelity::Auto, None) => FrameChoice::OnDemand,
        },
        target: args.target,
        ..Settings::default()
    };
    let objective = &settings.objective;
    if args.near_weight.is_some() && (!objective.is_information_gain() || objective.weighs_place())
    {
        return Err(Error::Usage(format!(
            "--near-weight: adds to information_gain, and `{}` is something else; leave one of them out",
            objective
        )));
    }
    if let Some(file) = &args.baselines {
        settings.baselines = read_placements(file)?;
    }
    if let Some(file) = &args.inject {
        settings.starts = read_placements(file)?;
    }
    Ok(settings)
}

#[derive(clap::Args)]
pub(super) struct Rules {
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

impl Rules {
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
pub(super) fn parse_spacing(text: &str) -> Result<Spacing, String> {
    let (metres, radians) = text.split_once(',').unwrap_or((text, text));
    let number = |text: &str| match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err(format!("`{text}` is no spacing; write metres and radians, as 0.1 or 0.2,0.1")),
    };
    Ok(Spacing { metres: number(metres)?, radians: number(radians)? })
}
