//! Speed of the stages against their references and against other ray casters, interleaved.
//!
//! `cargo bench --bench speed` prints medians of alternating runs with their spread; `-- --help` lists
//! what can be varied. A row that cannot be measured says why. Figures are of this machine in its state
//! of the moment: the ratios count. A software device takes as many threads as `LP_NUM_THREADS` says.
#![allow(clippy::disallowed_methods)]
#![allow(clippy::unwrap_used)]

mod cases;
mod peer;
mod row;
mod scene;
mod setup;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Parser;
use lidar_cast::bvh::Bvh;
use lidar_cast::cast::{Caster, cast_closest};
use lidar_cast::cover::{BitOrder, WalkScratch, cover_sensor, cover_voxels};
use lidar_cast::reduce::reduce;
use rayon::prelude::*;
use serde_json::{Value, json};
use setup::RANGE;
use sightline::engine::Backend;
use sightline::engine::CpuBackend;
use sightline::engine::gpu::GpuBackend;
use sightline::problem::Task;
use sightline::problem::{Problem, Tally};
use sightline::vehicle::Placement;

use peer::{Peer, Rays};
use row::{Rival, Row, print, same_bits};

/// Placements that the slow references are run on.
const REFERENCE: usize = 4;
/// Most placements that a device is given, software as it may be.
const DEVICE: usize = 256;
/// Bytes of work buffers.
const MEMORY: u64 = 8 << 30;

#[derive(Parser)]
struct Args {
    /// Triangles of the scenes, about
    #[arg(long, value_delimiter = ',', default_value = "20000,200000,2000000")]
    triangles: Vec<usize>,
    /// Placements of a batch, four LiDARs of 16 x 720 beams each
    #[arg(long, default_value_t = 256)]
    placements: usize,
    /// Largest roll and pitch in radians; 0 gives all sensors one rotation
    #[arg(long, default_value_t = 0.0)]
    turn: f64,
    #[arg(long, default_value_t = 1)]
    threads: usize,
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only the closest hits of the sets of sensors that come first
    #[arg(long)]
    casting: bool,
    /// Embree 4, for example from `pip download embreex`; LD_LIBRARY_PATH names its folder
    #[arg(long, value_name = "LIBRARY")]
    embree: Option<PathBuf>,
    /// Python with Open3D, or with trimesh and embreex; Open3D needs the system's libusb-1.0-0
    #[arg(long, value_name = "INTERPRETER")]
    python: Option<PathBuf>,
    /// Where to write all runs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// The GPU backend and its rows.
struct Device {
    backend: Result<GpuBackend, String>,
    hits: Row,
    score: Row,
}

impl Device {
    fn open(problem: &Arc<Problem>) -> Self {
        let backend = GpuBackend::new(problem.task().clone(), None, MEMORY)
            .map_err(|error| error.to_string());
        let short =
            |gpu: &GpuBackend| gpu.adapter().split(" (").next().unwrap_or_default().to_owned();
        let name = match &backend {
            Ok(gpu) if gpu.is_software() => format!("GPU backend, software {}", short(gpu)),
            Ok(gpu) => format!("GPU backend, {}", short(gpu)),
            Err(_) => "GPU backend".into(),
        };
        let row = || {
            let mut row = Row::new(name.as_str());
            row.missing = backend.as_ref().err().cloned();
            row
        };
        let (hits, score) = (row(), row());
        Self { backend, hits, score }
    }

    fn pass(&mut self, batch: &[Placement], beams: usize) -> Option<Vec<Tally>> {
        let gpu = self.backend.as_mut().ok()?;
        let before = gpu.times().cast;
        let tallies = self.score.time(batch.len(), || gpu.tally(batch, Some(RANGE)));
        let cast = (gpu.times().cast - before).as_secs_f64();
        self.hits.runs.push(cast / (batch.len() * beams) as f64);
        match tallies {
            Ok(tallies) => Some(tallies),
            Err(error) => {
                (self.hits.missing, self.score.missing) =
                    (Some(error.to_string()), Some(error.to_string()));
                self.backend = Err(error.to_string());
                None
            }
        }
    }
}

fn run(args: &Args, triangles: usize) -> Value {
    let soup = scene::street_scene(triangles, args.seed);
    let start = Instant::now();
    let bvh = Arc::new(Bvh::build(&soup, RANGE));
    let build = start.elapsed();
    println!("{} triangles", soup.faces.len());
    let casting = cases::casting(args, &soup, &bvh);
    if args.casting {
        return json!({ "triangles": soup.faces.len(), "stages": casting });
    }
    let (roi, table) = (setup::roi(0.2), setup::table(720));
    let batch = setup::placements(args.placements, args.turn, args.seed);
    let poses = setup::poses(&batch, &roi);
    let few = &batch[..REFERENCE.min(batch.len())];
    let few_poses = &poses[..4 * few.len()];
    let beams = table.directions().len();
    let content = setup::content(&roi, &poses, &table, &bvh, args.seed);
    let occupied = content.occupied().len();
    let problem = Arc::new(Problem::from(Task::new(
        roi,
        content.clone(),
        table.clone(),
        vec![bvh.clone()],
        true,
    )));
    let caster = Caster::new(&table);
    let mut backend = CpuBackend::new(problem.task().clone(), MEMORY);
    println!(
        "{} triangles, tree built in {build:.2?}, {occupied} occupied voxels, {} beams",
        soup.faces.len(),
        poses.len() * beams
    );

    let [mut single, mut packets] = ["one beam at a time", "Caster"].map(Row::new);
    let [mut walk, mut lockstep] = ["one beam at a time, dense", "cover_sensor"].map(Row::new);
    let [mut voxels, mut words, mut both] =
        ["reduce, a voxel at a time", "Embree and the references", "CpuBackend::tally"]
            .map(Row::new);
    let rays = Rays::write(&soup, &poses, &table).expect("room for the rays");
    let mut embree = Rival::new(
        "Embree 4, 16-wide coherent",
        Peer::embree(args.embree.as_deref(), &rays, args.threads),
    );
    let python = |package| Peer::python(args.python.as_deref(), package, &rays, args.threads);
    let mut open3d = Rival::new("Open3D", python("open3d"));
    let mut trimesh = Rival::new("trimesh, one thread, no range", python("trimesh"));
    let mut device = Device::open(&problem);
    let (mut hits, mut bitmaps) = (Vec::new(), Vec::new());
    let (rows, linear) = (BitOrder::rows(&roi), BitOrder::linear(&roi));
    let len = rows.words();
    let mut ours = vec![0; few_poses.len() * len];
    for round in 0..args.rounds + 1 {
        let want =
            single.time(few_poses.len() * beams, || cast_closest(few_poses, &table, &bvh, RANGE));
        packets.time(poses.len() * beams, || caster.closest_hits(&poses, &bvh, RANGE, &mut hits));
        assert!(same_bits(&want, &hits), "the hits differ");
        let found = hits.iter().filter(|hit| hit.is_hit()).count();
        for rival in [&mut embree, &mut open3d, &mut trimesh] {
            rival.pass(poses.len() * beams, found);
        }
        walk.time(few.len(), || {
            cover_voxels(few_poses, &table, &roi, Some(&want), RANGE, &mut bitmaps)
        });
        lockstep.time(few.len(), || {
            let sensors = ours.par_chunks_mut(len).zip(few_poses).zip(hits.par_chunks(beams));
            sensors.for_each_init(WalkScratch::default, |scratch, ((bitmap, pose), hits)| {
                bitmap.fill(0);
                let beams = table.directions();
                cover_sensor(pose, beams, &roi, Some(hits), RANGE, scratch, bitmap)
            });
        });
        let pairs = ours.chunks(len).zip(bitmaps.chunks(linear.words()));
        for (ours, want) in pairs {
            assert!(rows.convert(ours, &linear) == want, "the voxels differ");
        }
        let sums: Vec<Tally> = voxels.time(few.len(), || {
            let of_each = bitmaps.par_chunks(4 * linear.words());
            of_each.map(|bitmaps| reduce(4, &content, bitmaps)).collect()
        });
        let tallies = both.time(batch.len(), || backend.tally(&batch, Some(RANGE)).unwrap());
        assert!(tallies.iter().zip(&sums).all(|(a, b)| a.entropy == b.entropy), "the sums differ");
        if let Some(sums) = device.pass(&batch[..DEVICE.min(batch.len())], 4 * beams) {
            assert!(tallies.iter().zip(&sums).all(|(a, b)| a == b), "the device's sums differ");
        }
        // The first round warms up.
        if round == 0 {
            for row in [
                &mut single, &mut packets, &mut walk, &mut lockstep, &mut voxels, &mut both,
                &mut embree.row, &mut open3d.row, &mut trimesh.row, &mut device.hits,
                &mut device.score,
            ] {
                row.runs.clear();
            }
        }
    }
    let slow = |k: usize| walk.runs[k] + voxels.runs[k];
    let with = |casting: &[f64]| {
        let casting = casting.iter().enumerate();
        casting.map(|(k, ray)| ray * (4 * beams) as f64 + slow(k)).collect()
    };
    words.runs = with(&embree.row.runs);
    words.missing = embree.row.missing.clone();
    let mut all = Row::new("the references");
    all.runs = with(&single.runs);
    let times = backend.times();
    let mut stages = casting;
    stages.extend([
        print(
            "closest hit",
            &[&single, &embree.row, &open3d.row, &trimesh.row, &device.hits, &packets],
            "million rays a second",
            |s| 1e-6 / s,
        ),
        print("coverage", &[&walk, &lockstep], "ms a placement", |s| 1e3 * s),
        print("sums", &[&voxels], "ms a placement", |s| 1e3 * s),
        print("whole score", &[&all, &words, &device.score, &both], "ms a placement", |s| 1e3 * s),
    ]);
    let tally = [times.cast, times.cover, times.reduce]
        .map(|t| 1e3 * t.as_secs_f64() / (batch.len() * (args.rounds + 1)) as f64);
    println!("  of which cast {:.2}, cover {:.2}, reduce {:.2}", tally[0], tally[1], tally[2]);
    json!({ "triangles": soup.faces.len(), "build_seconds": build.as_secs_f64(), "stages": stages, "tally_ms": tally })
}

fn main() {
    let args = Args::parse();
    rayon::ThreadPoolBuilder::new().num_threads(args.threads).build_global().unwrap();
    println!(
        "{} placements of 4 x 16 x 720 beams, range {RANGE} m, turn {}, {} thread(s), medians of {} interleaved rounds (range)",
        args.placements, args.turn, args.threads, args.rounds
    );
    let scenes: Vec<Value> = args.triangles.iter().map(|&n| run(&args, n)).collect();
    if let Some(path) = &args.json {
        let report = json!({
            "placements": args.placements, "turn": args.turn, "threads": args.threads,
            "seed": args.seed, "scenes": scenes,
        });
        std::fs::write(path, format!("{report:#}\n")).unwrap();
    }
}
