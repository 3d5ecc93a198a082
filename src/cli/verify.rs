use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use serde_json::json;
use sightline::engine::Backend;
use sightline::engine::ReferenceBackend;
use sightline::engine::gpu::GpuBackend;
use sightline::problem::{Problem, spread};
use sightline::vehicle::random_placements;
use sightline::vehicle::{read_placements, table_7};
use sightline::verify::{EDGE_TOLERANCE, compare_backends, hostile_placements, sample_reference};

use super::args::{Compute, Format, whole};
use super::error::Error;
use super::{load, progress, table};

/// Exit code of a check that failed.
const FAILED: u8 = 1;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline verify scenes/highway.json
  sightline verify scenes/highway.json scenes/placements.json --frames 20 --format json")]
pub struct Args {
    /// Scene file
    scene: PathBuf,
    /// Placements [default: Table 7 of the paper, random ones from the mount, and hostile ones]
    placements: Option<PathBuf>,
    /// Frames to compare, spread evenly over the scene
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Random placements
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = whole::<usize>, conflicts_with = "placements")]
    random: usize,
    /// Hostile placements: on voxel faces, along axes, in solids, underground, far away
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = whole::<usize>, conflicts_with = "placements")]
    hostile: usize,
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

pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let start = Instant::now();
    args.compute.start()?;
    let (scene, psog, _) = load::scene_and_psog(&args.scene, args.compute.talk)?;
    load::note_frames(&scene, Some(args.frames), args.compute.talk);
    let frames = spread(scene.frame_count(), Some(args.frames));
    let problem = Arc::new(Problem::with_psog(&scene, &psog, &frames)?);
    let constraints = problem.constraints().clone();
    let placements = match &args.placements {
        Some(path) => read_placements(path)?,
        None => {
            let mut all = table_7();
            all.extend(random_placements(&constraints, args.random, args.seed));
            all.extend(hostile_placements(problem.roi(), args.hostile, args.seed));
            all
        }
    };
    let memory = args.compute.memory_budget() / 2;
    let mut cpu = ReferenceBackend::new(problem.clone());
    let mut gpu = GpuBackend::new(problem.clone(), args.compute.adapter.as_deref(), memory)?;
    let frames = problem.frame_count().max(problem.geometry_frame_count());
    let steps = (placements.len() * frames) as u64;
    let bar = progress::bar(steps, "placements × frames", args.compute.talk);
    let found = compare_backends(&problem, &mut cpu, &mut gpu, &placements, || bar.inc(1))?;
    bar.finish_and_clear();
    let reference = sample_reference(&problem, &placements, args.sample, args.seed)?;
    let passed = !found.any() && reference.unexplained == 0;
    let format = if args.json { Format::Json } else { args.format };
    match format {
        Format::Json => outln!(
            "{}",
            json!({
                "scene": scene.name(),
                "adapter": gpu.adapter(),
                "placements": placements.len(),
                "frames": frames,
                "gpu_against_cpu": found,
                "cpu_against_f64": reference,
                "edge_tolerance": EDGE_TOLERANCE,
                "passed": passed,
                "seconds": start.elapsed().as_secs_f64(),
            })
        )?,
        Format::Text => {
            let row = |name: &str, value: String| vec![name.to_owned(), value];
            outln!("{}: {} placements × {frames} frame(s)", scene.name(), placements.len())?;
            outln!("GPU ({}) against the CPU reference:", gpu.adapter())?;
            out!(
                "{}",
                table::align(&[
                    row("  beams", found.beams.to_string()),
                    row("  differing triangle ids", found.triangles.to_string()),
                    row("  differing distances", found.distances.to_string()),
                    row(
                        "  largest distance between answers, m",
                        found.largest_distance.to_string()
                    ),
                    row("  covered voxels", found.voxels.to_string()),
                    row("  differing voxels", found.differing_voxels.to_string()),
                    row("  scores", found.scores.to_string()),
                    row("  differing scores", found.differing_scores.to_string()),
                ])
            )?;
            outln!("CPU reference against all triangles in f64:")?;
            out!(
                "{}",
                table::align(&[
                    row("  beams", reference.beams.to_string()),
                    row(
                        &format!("  differing, grazing (an edge within {EDGE_TOLERANCE} m)"),
                        reference.grazing.to_string()
                    ),
                    row("  differing, tie", reference.tie.to_string()),
                    row("  differing, unexplained", reference.unexplained.to_string()),
                ])
            )?;
            outln!("{}", if passed { "passed" } else { "FAILED" })?;
        }
    }
    Ok(if passed { ExitCode::SUCCESS } else { ExitCode::from(FAILED) })
}
