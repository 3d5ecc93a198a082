mod bench;
mod kinds;
mod session;

use std::path::PathBuf;
use std::process::ExitCode;

use serde_json::json;
use sightline::scene::Scene;
use sightline::score::Objective;
use sightline::study::Region;

use super::args::{Compute, Format, at_least_one, whole};
use super::error::Error;
use super::inputs::Input;
use super::interrupt::{INTERRUPTED, Interrupt};
use super::output::Missing;
use super::table;
use bench::Bench;
use session::Session;

/// Frames to average over where nothing else is said.
const FRAMES: u32 = 2;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study lidars scenes/highway.json
  sightline study channels scenes/highway.json --sensor velodyne_vlp_32c.json --sensor os1_64.json
  sightline study regions scenes/residential.json --box crossing:10,-5,0,30,5,2
  sightline study transfer scenes/highway.json scenes/residential.json

A study writes study.json, table.csv and chart.svg into its folder. The same command goes on with an
interrupted one.")]
pub struct Args {
    /// What to study
    #[arg(value_enum)]
    kind: Kind,
    /// Scene file; `transfer` takes several
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Folder for the study [default: studies/SCENE-KIND]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Score to maximize where placements are searched
    #[arg(long, default_value = "information_gain")]
    objective: String,
    /// Placements that each search evaluates before swaps
    #[arg(long, value_name = "N", default_value_t = 120,
          value_parser = at_least_one)]
    evaluations: u64,
    /// Frames to average over, spread evenly [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Random placements, where the study draws some
    #[arg(long, value_name = "N", default_value_t = 200,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    random: u32,
    /// Sensor file to compare, for `channels`; may be given several times
    #[arg(long, value_name = "FILE")]
    sensor: Vec<PathBuf>,
    /// Further region, for `regions`: NAME:x0,y0,z0,x1,y1,z1 in metres; may be given several times
    #[arg(long = "box", value_name = "BOX", value_parser = parse_box)]
    boxes: Vec<Region>,
    /// Edge of a voxel in metres, for `published` [default: 0.1, as in the paper]
    #[arg(long, value_name = "M", value_parser = parse_length)]
    voxel: Option<f64>,
    /// Seed of all randomness
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

/// What can be studied.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// One to eight LiDARs: the best placement of each number, marginal gains, the knee
    Lidars,
    /// 16 to 128 channels, and real sensors (--sensor)
    Channels,
    /// The four voxel sizes of the paper with the layouts of Table 7
    Voxels,
    /// Random placements against hand-made ones and an optimized one
    Random,
    /// One placement for two tasks: weights between segmentation and detection
    Tasks,
    /// All LiDARs at one height, against free heights
    Height,
    /// Near, middle and far; front, side and rear; any --box; every class
    Regions,
    /// Each LiDAR lost in turn, and the placement that is best after the worst loss
    Loss,
    /// A placement optimized on one scene, scored on the others
    Transfer,
    /// Every score of the eight published placements against the published results
    Published,
}

impl Kind {
    fn name(self) -> String {
        clap::ValueEnum::to_possible_value(&self).map_or_else(String::new, |v| v.get_name().into())
    }
}

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    args.compute.start()?;
    if args.scenes.len() > 1 && args.kind != Kind::Transfer {
        return Err(Error::Usage(format!(
            "`study {}` takes one scene, not {}; only `transfer` compares several",
            args.kind.name(),
            args.scenes.len()
        )));
    }
    if args.scenes.len() < 2 && args.kind == Kind::Transfer {
        return Err(Error::Usage(
            "`study transfer` compares scenes; name two or more scene files".into(),
        ));
    }
    let objective: Objective = args.objective.parse()?;
    let interrupt = Interrupt::listen(args.compute.talk);
    let stem = args.scenes[0].file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from("studies").join(format!("{stem}-{}", args.kind.name())));
    let mut bench = Bench::new(args, &objective, &interrupt)?;
    let _made = Missing::of(&folder);
    let mut session = Session::open(&folder, &settings(args)?, &interrupt, args.compute.talk)?;
    let study = match args.kind {
        Kind::Lidars => kinds::lidars(&mut bench, &mut session),
        Kind::Channels => kinds::channels(&mut bench, &mut session),
        Kind::Voxels => kinds::voxels(&mut bench, &mut session),
        Kind::Random => kinds::random(&mut bench, &mut session),
        Kind::Tasks => kinds::tasks(&mut bench, &mut session),
        Kind::Height => kinds::height(&mut bench, &mut session),
        Kind::Regions => kinds::regions(&mut bench, &mut session),
        Kind::Loss => kinds::loss(&mut bench, &mut session),
        Kind::Transfer => kinds::transfer(&mut bench, &mut session),
        Kind::Published => kinds::published(&mut bench, &mut session),
    }?;
    session.finish(&study)?;
    match args.format {
        Format::Json => outln!("{}", json!(study.table))?,
        Format::Text => {
            outln!("{}", study.table.title)?;
            out!("{}", table::study(&study.table))?;
            outln!("\n{}: study.json, table.csv, chart.svg", folder.display())?;
        }
    }
    if interrupt.is_set() {
        args.compute.talk.note("interrupted; the same command goes on");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// All that decides about the numbers of a study.
fn settings(args: &Args) -> Result<serde_json::Value, Error> {
    let absolute = |paths: &[PathBuf]| -> Result<Vec<PathBuf>, Error> {
        paths.iter().map(|p| std::path::absolute(p).map_err(Error::io(p))).collect()
    };
    let mut inputs = Vec::new();
    for scene in &args.scenes {
        inputs.extend(Input::of(&Scene::read(scene)?)?);
    }
    for sensor in &args.sensor {
        inputs.push(Input::read(sensor)?);
    }
    Ok(json!({
        "sightline": env!("CARGO_PKG_VERSION"),
        "study": args.kind.name(),
        "scenes": absolute(&args.scenes)?,
        "inputs": inputs,
        "objective": args.objective,
        "evaluations": args.evaluations,
        "frames": args.frames.unwrap_or(FRAMES),
        "random": args.random,
        "sensors": absolute(&args.sensor)?,
        "boxes": args.boxes.iter().map(|region| format!("{region:?}")).collect::<Vec<_>>(),
        "voxel": args.voxel,
        "seed": args.seed,
    }))
}

fn parse_box(text: &str) -> Result<Region, String> {
    let wrong = || {
        format!("`{text}` is no box; write NAME:x0,y0,z0,x1,y1,z1 in metres, lower corner first")
    };
    let (name, numbers) = text.split_once(':').ok_or_else(wrong)?;
    let numbers: Vec<f64> = numbers
        .split(',')
        .map(|n| n.trim().parse().map_err(|_| wrong()))
        .collect::<Result<_, _>>()?;
    let [x0, y0, z0, x1, y1, z1] = numbers[..] else { return Err(wrong()) };
    if name.is_empty() || !(x0 < x1 && y0 < y1 && z0 < z1) {
        return Err(wrong());
    }
    Ok(Region::of_box(name, [x0, y0, z0], [x1, y1, z1]))
}

fn parse_length(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is no length; write metres, as 0.1");
    text.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite()).ok_or_else(wrong)
}
