//! `sightline verify`: the GPU against the CPU reference bit by bit, and the reference against f64.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use crate::engine::gpu::GpuBackend;
use crate::internals::{align_columns, compared_frames, usual_placements};
use crate::problem::{Problem, spread};
use crate::vehicle::{Placement, read_placements};
use crate::verify::{Verification, verify};
use serde::Serialize;
use serde_json::json;

use super::args::{Compute, Format, whole};
use super::error::Error;
use super::exit::Exit;
use super::files::Files;
use super::{load, progress};

/// Random placements where nothing else is said.
const RANDOM: usize = 200;
/// Hostile ones.
const HOSTILE: usize = 50;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline verify scenes/highway.json
  sightline verify scenes/highway.json scenes/placements.json --frames 20 --format json")]
pub struct Args {
    /// Scene files, and placements [default: Table 7 of the paper, random ones from the mount, and hostile
    /// ones]
    #[arg(value_name = "SCENE… [PLACEMENTS]", required = true)]
    files: Vec<PathBuf>,
    /// Frames to compare, spread evenly over the scene
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Random placements [default: 200]
    #[arg(long, value_name = "N", value_parser = whole::<usize>)]
    random: Option<usize>,
    /// Hostile placements: on voxel faces, along axes, in solids, underground, far away [default: 50]
    #[arg(long, value_name = "N", value_parser = whole::<usize>)]
    hostile: Option<usize>,
    /// Beams of the CPU reference that are compared with brute force in f64
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = whole::<u64>)]
    sample: u64,
    /// Seed of the random placements and of the sample
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// The same as --format json
    #[arg(long, conflicts_with = "format")]
    json: bool,
    #[command(flatten)]
    compute: Compute,
}

/// The answer in JSON.
#[derive(Serialize)]
struct Answer<'a> {
    scene: &'a str,
    #[serde(flatten)]
    found: &'a Verification,
    seconds: f64,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    args.compute.start()?;
    let Files { scenes, placements } = Files::sort(&args.files)?;
    let given = match &placements {
        Some(path) if args.random.or(args.hostile).is_some() => {
            return Err(Error::Usage(format!(
                "{}: holds the placements; leave out --random and --hostile, or this file",
                path.display()
            )));
        }
        Some(path) => Some(read_placements(path)?),
        None => None,
    };
    let format = if args.json { Format::Json } else { args.format };
    let mut answers = Vec::new();
    let mut passed = true;
    for path in &scenes {
        let start = Instant::now();
        let (scene, found) = of_scene(path, given.as_deref(), args)?;
        passed &= found.passed;
        match format {
            Format::Json => {
                let seconds = start.elapsed().as_secs_f64();
                answers.push(json!(Answer { scene: &scene, found: &found, seconds }));
            }
            Format::Text => print(&scene, &found)?,
        }
    }
    match (format, &answers[..]) {
        (Format::Json, [answer]) => outln!("{answer}")?,
        (Format::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (Format::Text, _) => {}
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}

/// Name of a scene, and what is verified in it.
fn of_scene(
    path: &Path,
    given: Option<&[Placement]>,
    args: &Args,
) -> Result<(String, Verification), Error> {
    let (scene, psog, _) = load::scene_and_psog(path, &args.compute)?;
    load::note_frames(&scene, Some(args.frames), args.compute.talk);
    let frames = spread(scene.frame_count(), Some(args.frames));
    let problem = Arc::new(Problem::with_psog(&scene, &psog, &frames)?);
    let (random, hostile) = (args.random.unwrap_or(RANDOM), args.hostile.unwrap_or(HOSTILE));
    let usual = || usual_placements(&problem, random, hostile, args.seed);
    let placements = given.map_or_else(usual, <[Placement]>::to_vec);
    let memory = args.compute.memory_budget() / 2;
    let mut gpu = GpuBackend::new(problem.clone(), args.compute.adapter.as_deref(), memory)?;
    let steps = (placements.len() * compared_frames(&problem)) as u64;
    let bar = progress::bar(steps, "placements × frames", args.compute.talk);
    let done = || bar.inc(1);
    let found = verify(&problem, &mut gpu, &placements, args.sample, args.seed, &done)?;
    bar.finish_and_clear();
    Ok((scene.name().to_owned(), found))
}

fn print(scene: &str, found: &Verification) -> Result<(), Error> {
    let lines = |rows: &[(&str, String)]| {
        let row = |(name, value): &(&str, String)| vec![format!("  {name}"), value.clone()];
        align_columns(&rows.iter().map(row).collect::<Vec<_>>())
    };
    let (gpu, reference) = (&found.gpu_against_cpu, &found.cpu_against_f64);
    outln!("{scene}: {} placements × {} frame(s)", found.placements, found.frames)?;
    outln!("GPU ({}) against the CPU reference:", found.adapter)?;
    out!(
        "{}",
        lines(&[
            ("beams", gpu.beams.to_string()),
            ("differing triangle ids", gpu.triangles.to_string()),
            ("differing distances", gpu.distances.to_string()),
            ("largest distance between answers, m", gpu.largest_distance.to_string()),
            ("covered voxels", gpu.voxels.to_string()),
            ("differing voxels", gpu.differing_voxels.to_string()),
            ("scores", gpu.scores.to_string()),
            ("differing scores", gpu.differing_scores.to_string()),
        ])
    )?;
    outln!("CPU reference against all triangles in f64:")?;
    let grazing = format!("differing, grazing (an edge within {} m)", found.edge_tolerance);
    out!(
        "{}",
        lines(&[
            ("beams", reference.beams.to_string()),
            (&grazing, reference.grazing.to_string()),
            ("differing, tie", reference.tie.to_string()),
            ("differing, unexplained", reference.unexplained.to_string()),
        ])
    )?;
    outln!("{}", if found.passed { "passed" } else { "FAILED" })
}
