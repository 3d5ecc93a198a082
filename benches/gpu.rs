//! Speed of the GPU backend's stages, by the tree and by shafts, beside the CPU backend's.
//!
//! `cargo bench --bench gpu` prints medians of alternating runs with their spread; `-- --help` lists
//! what can be varied. A software device takes its threads from the environment: set
//! `LP_NUM_THREADS` to `--threads` for lavapipe.

#![allow(clippy::unwrap_used)]

mod scene;

use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sightline::backend::cpu::CpuBackend;
use sightline::backend::gpu::{Casting, GpuBackend};
use sightline::backend::{Backend, Content, OccupiedVoxel, Problem, StageTimes};
use sightline::bvh::Bvh;
use sightline::grid::Roi;
use sightline::placement::{BeamTable, Placement, SensorPose};

/// Metres.
const RANGE: f32 = 100.0;
/// Bytes of work buffers.
const MEMORY: u64 = 4 << 30;

#[derive(Parser)]
struct Args {
    /// Triangles of the scenes, about
    #[arg(long, value_delimiter = ',', default_value = "2000,20000,200000")]
    triangles: Vec<usize>,
    /// Placements of a batch, four LiDARs of 16 x 720 beams each
    #[arg(long, default_value_t = 64)]
    placements: usize,
    /// Largest roll, pitch and yaw in radians; 0 gives all sensors one rotation
    #[arg(long, default_value_t = 0.0)]
    turn: f64,
    #[arg(long, default_value_t = 1)]
    threads: usize,
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn placements(args: &Args) -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(args.seed);
    let mut within = |low: f64, high: f64| rng.random_range(low..=high);
    let mut pose = || SensorPose {
        x: within(-0.6, 0.6),
        y: within(-0.6, 0.6),
        z: within(2.2, 2.8),
        roll: within(-args.turn, args.turn),
        pitch: within(-args.turn, args.turn),
        yaw: within(-args.turn, args.turn),
    };
    (0..args.placements)
        .map(|i| Placement { name: format!("p{i}"), lidars: (0..4).map(|_| pose()).collect() })
        .collect()
}

fn problem(args: &Args, triangles: usize) -> Problem {
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(args.seed);
    let occupied: Vec<OccupiedVoxel> = (0..roi.voxel_count() as u32)
        .filter(|_| rng.random_bool(0.03))
        .map(|index| OccupiedVoxel { index, entropy: [index & 0xff_ffff; 3] })
        .collect();
    let voxels = occupied.iter().map(|voxel| voxel.index).collect();
    let content = Content::new(vec!["any".into()], occupied, &[voxels], true);
    let channels: Vec<(f64, f64)> =
        (0..16).map(|k| (-24.8 + 26.8 * f64::from(k) / 15.0, 0.0)).collect();
    let table = BeamTable::spinning(&channels, 720, f64::from(RANGE)).unwrap();
    let bvh = Arc::new(Bvh::build(&scene::street_scene(triangles, args.seed), RANGE));
    Problem::new(roi, content, table, vec![bvh], true)
}

/// One way to evaluate the batch, and what its stages and the whole took, round after round.
struct Row {
    name: &'static str,
    backend: Box<dyn Backend>,
    rounds: Vec<[Duration; 4]>,
}

impl Row {
    fn run(&mut self, batch: &[Placement]) -> Vec<sightline::backend::Tally> {
        let before = self.backend.times();
        let start = Instant::now();
        let tallies = self.backend.tally(batch, RANGE).unwrap();
        let StageTimes { cast, cover, reduce } = self.backend.times();
        self.rounds.push([
            cast - before.cast,
            cover - before.cover,
            reduce - before.reduce,
            start.elapsed(),
        ]);
        tallies
    }

    fn print(&self, batch: usize, beams: usize) {
        let sorted = |stage: usize| {
            let mut times: Vec<f64> = self.rounds.iter().map(|r| r[stage].as_secs_f64()).collect();
            times.sort_by(f64::total_cmp);
            times
        };
        let median = |stage: usize| sorted(stage)[self.rounds.len() / 2];
        let whole = sorted(3);
        let each = 1e3 / batch as f64;
        println!(
            "  {:<22} cast {:>6.2}  cover {:>6.2}  reduce {:>6.2}  whole {:>6.2} ({:.2} to {:.2})  \
             {:>6.2} million rays a second",
            self.name,
            each * median(0),
            each * median(1),
            each * median(2),
            each * median(3),
            each * whole[0],
            each * whole[whole.len() - 1],
            1e-6 * beams as f64 / median(0),
        );
    }
}

fn main() {
    let args = Args::parse();
    rayon::ThreadPoolBuilder::new().num_threads(args.threads).build_global().unwrap();
    let batch = placements(&args);
    for &triangles in &args.triangles {
        let problem = Arc::new(problem(&args, triangles));
        let beams = 4 * batch.len() * problem.table().directions().len();
        println!(
            "{triangles} triangles, {} placements, turn {}, {} thread(s); ms a placement, medians of {} \
             rounds (range)",
            args.placements, args.turn, args.threads, args.rounds
        );
        let gpu = |casting| -> Box<dyn Backend> {
            let mut gpu = GpuBackend::new(problem.clone(), None, MEMORY).unwrap();
            gpu.cast_by(casting);
            Box::new(gpu)
        };
        let row = |name, backend| Row { name, backend, rounds: Vec::new() };
        let mut rows = [
            row("CPU", Box::new(CpuBackend::new(problem.clone(), MEMORY))),
            row("GPU, by the tree", gpu(Casting::Tree)),
            row("GPU, by shafts", gpu(Casting::Shafts)),
        ];
        // The first round warms up.
        for round in 0..=args.rounds {
            let tallies: Vec<_> = rows.iter_mut().map(|row| row.run(&batch)).collect();
            assert!(tallies.windows(2).all(|pair| pair[0] == pair[1]), "the sums differ");
            if round == 0 {
                rows.iter_mut().for_each(|row| row.rounds.clear());
            }
        }
        rows.iter().for_each(|row| row.print(batch.len(), beams));
    }
}
