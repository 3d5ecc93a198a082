//! Cost against triangles, beams, voxels along them, placements and frames, and what a second thread gains.
//!
//! `cargo bench --bench scaling` measures in turns and fits a power to the medians of each series:
//! an exponent of 1 is linear. `-- --help` lists what can be varied.
#![allow(clippy::disallowed_methods)]
#![allow(clippy::unwrap_used)]

mod scene;
mod setup;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Parser;
use glam::{DVec3, Vec3};
use lidar_cast::bvh::{Bvh, Hit};
use lidar_cast::cast::Caster;
use lidar_cast::cover::{BitOrder, WalkScratch, cover_sensor, cover_voxels};
use lidar_cast::task::DevicePose;
use serde_json::{Value, json};
use setup::RANGE;
use sightline::engine::Backend;
use sightline::engine::CpuBackend;
use sightline::geom::{Pose, TriangleSoup};
use sightline::problem::Task;
use sightline::problem::{Frame, Instance, Problem, World};
use sightline::psog::Roi;
use sightline::vehicle::BeamTable;

/// Triangles where they are not what varies.
const TRIANGLES: usize = 20_000;
/// Bytes of work buffers.
const MEMORY: u64 = 4 << 30;
/// Sensors whose coverage is timed.
const SENSORS: usize = 8;

#[derive(Parser)]
struct Args {
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Placements of a batch where they are not what varies
    #[arg(long, default_value_t = 64)]
    placements: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where to write all figures
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// A way to take the time of something at one size.
type Timed<'a> = Box<dyn FnMut() -> f64 + 'a>;

/// Median seconds of each after `rounds` rounds in turns, the first of which warms up.
fn medians(rounds: usize, ways: &mut [Timed<'_>]) -> Vec<f64> {
    let mut runs = vec![Vec::new(); ways.len()];
    for round in 0..rounds + 1 {
        for (way, runs) in ways.iter_mut().zip(&mut runs) {
            let seconds = way();
            if round > 0 {
                runs.push(seconds);
            }
        }
    }
    runs.iter_mut().for_each(|runs| runs.sort_by(f64::total_cmp));
    runs.iter().map(|runs| runs[runs.len() / 2]).collect()
}

/// Exponent of the power of `x` that fits `y` best in logarithms, and the largest relative error.
fn fit(x: &[f64], y: &[f64]) -> (f64, f64) {
    let logs: Vec<(f64, f64)> = x.iter().zip(y).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let (mean_x, mean_y) =
        (logs.iter().map(|l| l.0).sum::<f64>() / n, logs.iter().map(|l| l.1).sum::<f64>() / n);
    let along: f64 = logs.iter().map(|l| (l.0 - mean_x) * (l.1 - mean_y)).sum();
    let exponent = along / logs.iter().map(|l| (l.0 - mean_x).powi(2)).sum::<f64>();
    let error = |l: &(f64, f64)| (l.1 - mean_y - exponent * (l.0 - mean_x)).exp_m1().abs();
    (exponent, logs.iter().map(error).fold(0.0, f64::max))
}

/// Prints a series with its fit; `y` in seconds.
fn series(what: &str, unit: &str, x: &[f64], y: &[f64]) -> Value {
    let (exponent, error) = fit(x, y);
    println!("{what} against {unit}: power {exponent:.2}, off by at most {:.0} %", 1e2 * error);
    for (x, y) in x.iter().zip(y) {
        println!("  {x:>12.0} {:>12.3} ms", 1e3 * y);
    }
    json!({ "cost": what, "against": unit, "x": x, "seconds": y, "power": exponent, "largest_error": error })
}

fn seconds(run: impl FnOnce()) -> f64 {
    let start = Instant::now();
    run();
    start.elapsed().as_secs_f64()
}

/// Metres from one copy of a street scene to the next: as long as the scene.
const SCENE: f32 = 300.0;
/// Copies along either side of the larger scenes, odd so that the sensors stand in the middle.
const COPIES: [i32; 4] = [1, 3, 5, 11];

/// Copies of a scene side by side, so many along either side.
fn side_by_side(scene: &TriangleSoup, copies: i32) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let half = copies / 2;
    for (column, row) in (-half..=half).flat_map(|x| (-half..=half).map(move |y| (x, y))) {
        let base = soup.vertices.len() as u32;
        let (x, y) = (SCENE * column as f32, SCENE * row as f32);
        soup.vertices.extend(scene.vertices.iter().map(|v| [v[0] + x, v[1] + y, v[2]]));
        soup.faces.extend(scene.faces.iter().map(|face| face.map(|v| base + v)));
        soup.face_class.extend(&scene.face_class);
    }
    soup
}

/// Closest hits of a batch in scenes of 10 000 to 1.3 million triangles: in one that becomes finer, so
/// that rays pass more triangles on the same way, and in one that becomes larger.
fn triangles(args: &Args) -> Vec<Value> {
    let (roi, caster) = (setup::roi(0.2), Caster::new(&setup::table(720)));
    let poses = setup::poses(&setup::placements(args.placements, 0.0, args.seed), &roi);
    let street = |triangles: usize| scene::street_scene(triangles, args.seed);
    let coarse = street(TRIANGLES / 2);
    let finer: Vec<_> = (0..4).map(|k| street((TRIANGLES / 2) << (7 * k / 3))).collect();
    let larger: Vec<_> = COPIES.iter().map(|&copies| side_by_side(&coarse, copies)).collect();
    let trees = [finer, larger]
        .map(|scenes| scenes.iter().map(|soup| Bvh::build(soup, RANGE)).collect::<Vec<Bvh>>());
    let mut hits = Vec::new();
    let hits = std::cell::RefCell::new(&mut hits);
    let mut ways: Vec<Timed<'_>> = Vec::new();
    for bvh in trees.iter().flatten() {
        let (poses, caster, hits) = (&poses, &caster, &hits);
        ways.push(Box::new(move || {
            seconds(|| caster.closest_hits(poses, bvh, RANGE, &mut hits.borrow_mut()))
        }));
    }
    let all = medians(args.rounds, &mut ways);
    let mut values = Vec::new();
    for ((trees, y), scene) in trees.iter().zip(all.chunks(COPIES.len())).zip(["finer", "larger"]) {
        let x: Vec<f64> = trees.iter().map(|bvh| bvh.triangles.len() as f64).collect();
        let logs: Vec<f64> = x.iter().map(|n| n.log2()).collect();
        let what = format!("closest hits in a {scene} scene");
        values.push(series(&what, "triangles", &x, y));
        values.push(series(&what, "log2 of triangles", &logs, y));
    }
    values
}

/// A grid, its sensors' beams and hits, to be covered.
struct Cover {
    roi: Roi,
    table: BeamTable,
    poses: Vec<DevicePose>,
    hits: Vec<Hit>,
    scratch: WalkScratch,
    bitmap: Vec<u64>,
}

impl Cover {
    fn new(args: &Args, bvh: &Bvh, edge: f64, azimuth_steps: u32) -> Self {
        let (roi, table) = (setup::roi(edge), setup::table(azimuth_steps));
        let placements = setup::placements(SENSORS.div_ceil(4), 0.1, args.seed);
        let poses = setup::poses(&placements, &roi);
        let mut hits = Vec::new();
        Caster::new(&table).closest_hits(&poses, bvh, RANGE, &mut hits);
        let bitmap = vec![0; BitOrder::rows(&roi).words()];
        Self { roi, table, poses, hits, scratch: WalkScratch::default(), bitmap }
    }

    /// Seconds for all sensors.
    fn run(&mut self) -> f64 {
        let beams = self.table.directions();
        let mut sum = 0.0;
        for (pose, hits) in self.poses.iter().zip(self.hits.chunks(beams.len())) {
            self.bitmap.fill(0);
            let (scratch, bitmap) = (&mut self.scratch, &mut self.bitmap);
            sum += seconds(|| {
                cover_sensor(pose, beams, &self.roi, Some(hits), RANGE, scratch, bitmap)
            });
        }
        sum
    }

    /// Voxels that the beams pass, each as often as it is passed: covered by a sensor of one beam.
    fn visits(&self) -> f64 {
        let beams = self.table.directions();
        // Every 97th beam, since each needs a bitmap.
        let few = (0..self.hits.len()).step_by(97);
        let mut bitmaps = Vec::new();
        let (mut visits, mut count) = (0, 0);
        for beam in few {
            let pose = &self.poses[beam / beams.len()..][..1];
            let direction = Vec3::from(beams[beam % beams.len()]).as_dvec3();
            let one = BeamTable::from_directions([direction], f64::from(RANGE)).unwrap();
            let hit = Some(&self.hits[beam..beam + 1]);
            cover_voxels(pose, &one, &self.roi, hit, RANGE, &mut bitmaps);
            visits += bitmaps.iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
            count += 1;
        }
        visits as f64 * self.hits.len() as f64 / f64::from(count)
    }
}

/// Coverage by finer sensors, and in finer grids.
fn beams_and_voxels(args: &Args, bvh: &Bvh) -> Vec<Value> {
    let run = |mut of: Vec<Cover>| {
        let mut ways: Vec<Timed<'_>> = Vec::new();
        for cover in &mut of {
            ways.push(Box::new(|| cover.run()));
        }
        medians(args.rounds, &mut ways)
    };
    let steps = [180, 360, 720, 1440, 2880];
    let finer: Vec<Cover> = steps.iter().map(|&n| Cover::new(args, bvh, 0.2, n)).collect();
    let beams: Vec<f64> = finer.iter().map(|cover| cover.hits.len() as f64).collect();
    let edges: Vec<Cover> =
        [0.8, 0.4, 0.2, 0.1].iter().map(|&edge| Cover::new(args, bvh, edge, 720)).collect();
    let visits: Vec<f64> =
        edges.iter().map(|cover| cover.visits() / cover.hits.len() as f64).collect();
    vec![
        series("coverage", "beams", &beams, &run(finer)),
        series("coverage", "voxels along a beam", &visits, &run(edges)),
    ]
}

/// Scores of batches, and of one placement with one thread and with all.
fn placements(args: &Args, bvh: &Arc<Bvh>) -> Vec<Value> {
    let (roi, table) = (setup::roi(0.2), setup::table(720));
    let sizes = [1, 4, 16, 64, 256];
    let batch = setup::placements(256, 0.1, args.seed);
    let poses = setup::poses(&batch[..16], &roi);
    let content = setup::content(&roi, &poses, &table, bvh, args.seed);
    let problem = |frames: usize| {
        // Trees of their own: frames that share one would be cast once.
        let frames: Vec<_> = (0..frames).map(|_| Arc::new(Bvh::clone(bvh))).collect();
        Arc::new(Problem::from(Task::new(roi, content.clone(), table.clone(), frames, true)))
    };
    let (one, three) = (problem(1), problem(3));
    let mut backend = CpuBackend::new(one.task().clone(), MEMORY);
    let backend = std::cell::RefCell::new(&mut backend);
    let mut ways: Vec<Timed<'_>> = Vec::new();
    for size in sizes {
        let (batch, backend) = (&batch[..size], &backend);
        ways.push(Box::new(move || {
            seconds(|| assert!(backend.borrow_mut().tally(batch, Some(RANGE)).is_ok()))
        }));
    }
    let y = medians(args.rounds, &mut ways);
    let mut values = vec![series("whole score", "placements", &sizes.map(|n| n as f64), &y)];
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    println!("whole score with one thread, and with {threads}");
    let pools =
        [1, threads].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap());
    for (problem, frames) in [(&one, 1), (&three, 3)] {
        for size in [1, 2, 3, 64] {
            let mut ways: Vec<Timed<'_>> = Vec::new();
            for pool in &pools {
                let (batch, mut backend) =
                    (&batch[..size], CpuBackend::new(problem.task().clone(), MEMORY));
                ways.push(Box::new(move || {
                    let mut run = || assert!(backend.tally(batch, Some(RANGE)).is_ok());
                    seconds(|| pool.install(&mut run))
                }));
            }
            let y = medians(args.rounds, &mut ways);
            println!(
                "  {size:>3} placements, {frames} frames {:>9.2} ms {:>9.2} ms  x{:.2}",
                1e3 * y[0],
                1e3 * y[1],
                y[0] / y[1]
            );
            values.push(json!({ "placements": size, "frames": frames, "threads": [1, threads], "seconds": y }));
        }
    }
    values
}

/// Scores of a batch in more and more frames, all with the same tree seen from further along the street, and
/// the bytes that they take.
fn frames(args: &Args, bvh: &Arc<Bvh>) -> Vec<Value> {
    let (roi, table) = (setup::roi(0.2), setup::table(720));
    let counts = [1, 2, 4, 8, 16, 32, 64];
    let batch = setup::placements(11, 0.1, args.seed);
    let poses = setup::poses(&batch, &roi);
    let content = Arc::new(setup::content(&roi, &poses, &table, bvh, args.seed));
    let frame = |t: usize| {
        let at = DVec3::new(-0.5 * t as f64, 0.0, 0.0);
        let ego_from_instance = Pose::new(at, 0.0, 0.0, 0.0);
        let instance = Instance { tree: bvh.clone(), ego_from_instance, first_prim: 0 };
        Arc::new(Frame::new([instance]))
    };
    let problem = |frames: usize| {
        let world = World::new((0..frames).map(frame).collect());
        Arc::new(Problem::from(Task::new(roi, content.clone(), table.clone(), world, true)))
    };
    let problems = counts.map(problem);
    let bytes = problems.each_ref().map(|problem| problem.bytes() as f64);
    let mut ways: Vec<Timed<'_>> = Vec::new();
    for problem in &problems {
        let (batch, mut backend) = (&batch, CpuBackend::new(problem.task().clone(), MEMORY));
        ways.push(Box::new(move || seconds(|| assert!(backend.tally(batch, Some(RANGE)).is_ok()))));
    }
    let y = medians(args.rounds, &mut ways);
    let x = counts.map(|n| n as f64);
    println!("  bytes of geometry and content: {bytes:?} in {counts:?} frames");
    vec![
        series("whole score", "frames", &x, &y),
        json!({ "cost": "memory", "against": "frames", "x": x, "bytes": bytes }),
    ]
}

fn main() {
    let args = Args::parse();
    println!("medians of {} rounds in turns; only the course counts", args.rounds);
    let bvh = Arc::new(Bvh::build(&scene::street_scene(TRIANGLES, args.seed), RANGE));
    let mut values = triangles(&args);
    values.extend(beams_and_voxels(&args, &bvh));
    values.extend(placements(&args, &bvh));
    values.extend(frames(&args, &bvh));
    if let Some(path) = &args.json {
        std::fs::write(path, format!("{:#}\n", Value::from(values))).unwrap();
    }
}
