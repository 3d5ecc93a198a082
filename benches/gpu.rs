//! Speed of the GPU backend's stages beside the CPU backend's.
//!
//! `cargo bench --bench gpu` prints medians of alternating runs with their spread; `-- --help` lists
//! what can be varied. A software device takes its threads from the environment: set
//! `LP_NUM_THREADS` to `--threads` for lavapipe.
#![allow(clippy::disallowed_methods)]
#![allow(clippy::unwrap_used)]

mod scene;
mod setup;

use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Parser;
use lidar_cast::bvh::Bvh;
use setup::RANGE;
use sightline::engine::Backend;
use sightline::engine::CpuBackend;
use sightline::engine::gpu::GpuBackend;
use sightline::problem::Task;
use sightline::problem::{Problem, StageTimes, Tally};
use sightline::vehicle::Placement;

#[derive(Parser)]
struct Args {
    /// Triangles of the scenes, about
    #[arg(long, value_delimiter = ',', default_value = "20000,200000")]
    triangles: Vec<usize>,
    /// Placements of a batch, four LiDARs of 16 x 720 beams each
    #[arg(long, default_value_t = 64)]
    placements: usize,
    /// Largest roll and pitch in radians; 0 gives all sensors one rotation
    #[arg(long, default_value_t = 0.0)]
    turn: f64,
    /// MiB of work buffers: what a batch needs beyond them is cut into chunks
    #[arg(long, default_value_t = 4096)]
    memory: u64,
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

/// One way to evaluate the batch, and what its stages and the whole took, round after round.
struct Row {
    name: &'static str,
    backend: Box<dyn Backend>,
    rounds: Vec<[Duration; 4]>,
}

impl Row {
    fn run(&mut self, batch: &[Placement]) -> Vec<Tally> {
        let before = self.backend.times();
        let start = Instant::now();
        let tallies = self.backend.tally(batch, Some(RANGE)).unwrap();
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
    let memory = args.memory << 20;
    rayon::ThreadPoolBuilder::new().num_threads(args.threads).build_global().unwrap();
    let (roi, table) = (setup::roi(0.2), setup::table(720));
    let batch = setup::placements(args.placements, args.turn, args.seed);
    let poses = setup::poses(&batch, &roi);
    let beams = poses.len() * table.directions().len();
    for &triangles in &args.triangles {
        let bvh = Arc::new(Bvh::build(&scene::street_scene(triangles, args.seed), RANGE));
        let content = setup::content(&roi, &poses, &table, &bvh, args.seed);
        let problem =
            Arc::new(Problem::from(Task::new(roi, content, table.clone(), vec![bvh], true)));
        println!(
            "{triangles} triangles, {} placements, turn {}, {} thread(s); ms a placement, medians of {} \
             rounds (range)",
            args.placements, args.turn, args.threads, args.rounds
        );
        let gpu = GpuBackend::new(problem.task().clone(), None, memory).unwrap();
        let cpu = CpuBackend::new(problem.task().clone(), memory);
        let row = |name, backend| Row { name, backend, rounds: Vec::new() };
        let mut rows = [row("CPU", Box::new(cpu) as Box<dyn Backend>), row("GPU", Box::new(gpu))];
        // The first round warms up.
        for round in 0..=args.rounds {
            let tallies: Vec<_> = rows.iter_mut().map(|row| row.run(&batch)).collect();
            assert!(tallies.windows(2).all(|pair| pair[0] == pair[1]), "the sums differ");
            if round == 0 {
                rows.iter_mut().for_each(|row| row.rounds.clear());
            }
        }
        rows.iter().for_each(|row| row.print(batch.len(), beams));
        let mut gpu = GpuBackend::new(problem.task().clone(), None, memory).unwrap();
        let uploaded = gpu.traffic();
        let start = Instant::now();
        gpu.tally(&batch, None).unwrap();
        let took = start.elapsed();
        let (traffic, each) = (gpu.traffic(), batch.len() as u64);
        println!(
            "  {} submission(s) and {} wait(s) of the batch; {} bytes up and {} down a placement; \
             the device worked {:.0} % of the time",
            traffic.submissions - uploaded.submissions,
            traffic.waits - uploaded.waits,
            (traffic.bytes_up - uploaded.bytes_up) / each,
            traffic.bytes_down / each,
            100.0 * traffic.busy.as_secs_f64() / took.as_secs_f64()
        );
    }
}
