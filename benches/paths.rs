//! CPU time of each casting path, and of what the program chooses: `cargo bench --bench paths`.
//!
//! Every line is a batch of sensors of which so many share each rotation, near each other or all over
//! the mount, turned a little or freely. Times are those of the thread, so that a machine with other
//! work does not blur them (Linux only), and the least of a few alternating rounds; the last column is
//! that of the choice to the best. `-- --help` lists what can be varied.

#![allow(clippy::unwrap_used)]

mod scene;
#[allow(dead_code)]
mod setup;

use std::path::PathBuf;

use clap::Parser;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use setup::RANGE;
use sightline::bvh::{Bvh, Hit};
use sightline::cast::{Casting, cast_packets_by};
use sightline::geom::TriangleSoup;
use sightline::problem::DevicePose;
use sightline::scene::{EgoBody, Scene};
use sightline::vehicle::SensorPose;

/// Most beams that are cast one by one.
const SINGLE: usize = 60_000;
/// Nanoseconds that are measured at least.
const LEAST_TIME: u64 = 20_000_000;
/// Triangles of the smallest street with all that stands in it.
const STREET: usize = 22_000;
/// Ways that are measured, and what is chosen.
const WAYS: [Option<Casting>; 4] =
    [Some(Casting::Beams), Some(Casting::Mixed), Some(Casting::Fans), None];

#[derive(Parser)]
struct Args {
    /// Triangles of the scenes, about
    #[arg(long, value_delimiter = ',', default_value = "200,2000,20000,200000,2000000")]
    triangles: Vec<usize>,
    /// Scene files, whose first frames are measured too
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<PathBuf>,
    /// Azimuth steps of the sensors, of 16 channels
    #[arg(long, value_delimiter = ',', default_value = "180,1800")]
    steps: Vec<u32>,
    /// Sensors that share a rotation
    #[arg(long, value_delimiter = ',', default_value = "1,2,4,8,16,32,64,128,256,1024")]
    shared: Vec<usize>,
    /// Sensors of a batch, where as many share a rotation as this or fewer
    #[arg(long, value_delimiter = ',', default_value = "1,256")]
    sensors: Vec<usize>,
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// Nanoseconds that this thread has run.
fn thread_time() -> u64 {
    // Brings the account up to date.
    std::thread::yield_now();
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse().unwrap()
}

/// A street of any size: of a small one some things are left out.
fn street(triangles: usize, seed: u64) -> TriangleSoup {
    let mut soup = scene::street_scene(triangles, seed);
    if triangles < STREET {
        // What stands in the smallest street is boxes and crowns of 12 triangles each.
        let things = 12 * ((soup.faces.len() - triangles / 2) / 12);
        let ground = soup.faces.len() - things;
        let every = things.div_ceil(triangles / 2);
        let kept = |&f: &usize| f < ground || ((f - ground) / 12).is_multiple_of(every);
        soup.faces = (0..soup.faces.len()).filter(kept).map(|f| soup.faces[f]).collect();
        soup.face_class.truncate(soup.faces.len());
    }
    soup
}

/// Sensors of which so many share each rotation.
fn poses(sensors: usize, shared: usize, spread: f64, turn: f64, seed: u64) -> Vec<DevicePose> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut within = |low: f64, high: f64| rng.random_range(low..=high);
    let roi = setup::roi(0.2);
    let mut rotation = [0.0; 3];
    let mut poses = Vec::new();
    for sensor in 0..sensors {
        if sensor % shared == 0 {
            rotation = [within(-turn, turn), within(-turn, turn), within(-turn, turn)];
        }
        let [roll, pitch, yaw] = rotation;
        let [x, y, z] = [[-0.6, 0.6], [-0.6, 0.6], [2.2, 2.8]].map(|[low, high]: [f64; 2]| {
            let half = spread * (high - low) / 2.0;
            let middle = (low + high) / 2.0;
            within(middle - half, middle + half)
        });
        poses.push(DevicePose::new(&SensorPose { x, y, z, roll, pitch, yaw }, &roi));
    }
    poses
}

/// Nanoseconds a beam of each of [`WAYS`].
fn measure(poses: &[DevicePose], steps: u32, bvh: &Bvh, rounds: usize) -> [f64; 4] {
    let table = setup::table(steps);
    let beams = table.directions().len();
    let few = poses.len().min((SINGLE / beams).max(1));
    let mut least = [f64::MAX; 4];
    // Hits of single beams are a list of their own, since they come in a new one.
    let mut lists: [Vec<Hit>; 2] = Default::default();
    for _ in 0..rounds {
        for (way, least) in WAYS.into_iter().zip(&mut least) {
            let poses = if way == Some(Casting::Beams) { &poses[..few] } else { poses };
            let hits = &mut lists[usize::from(way == Some(Casting::Beams))];
            let (start, mut batches) = (thread_time(), 0);
            // Small batches again and again: what was cast before stays in the caches.
            while batches == 0 || thread_time() - start < LEAST_TIME {
                cast_packets_by(way, poses, &table, bvh, RANGE, hits);
                batches += 1;
            }
            let time = (thread_time() - start) as f64 / (batches * poses.len() * beams) as f64;
            *least = least.min(time);
        }
    }
    least
}

fn main() {
    let args = Args::parse();
    let mut scenes: Vec<(String, TriangleSoup)> = Vec::new();
    for path in &args.scenes {
        let scene = Scene::read(path).expect("a scene");
        scenes.push((scene.name().into(), scene.frame(0, EgoBody::Include)));
    }
    for &triangles in &args.triangles {
        scenes.push((format!("street-{triangles}"), street(triangles, args.seed)));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    println!(
        "scene triangles nodes steps spread turn sensors shared beams mixed fans chosen ratio"
    );
    let mut ratios = Vec::new();
    for (name, soup) in &scenes {
        let bvh = Bvh::build(soup, RANGE);
        for &steps in &args.steps {
            for &least in &args.sensors {
                for &shared in &args.shared {
                    let sensors = least.max(shared);
                    if least <= shared && args.sensors.iter().any(|&other| other < least) {
                        continue;
                    }
                    for (spread, turn) in [(1.0, 0.05), (1.0, 1.5), (0.06, 0.05), (0.06, 1.5)] {
                        let poses = poses(sensors, shared, spread, turn, args.seed);
                        let [a, b, c, d] =
                            pool.install(|| measure(&poses, steps, &bvh, args.rounds));
                        let ratio = d / a.min(b).min(c);
                        ratios.push(ratio);
                        println!(
                            "{name} {} {} {steps} {spread} {turn} {sensors} {shared} \
                             {a:.2} {b:.2} {c:.2} {d:.2} {ratio:.2}",
                            bvh.triangles.len(),
                            bvh.nodes.len(),
                        );
                    }
                }
            }
        }
    }
    let above = ratios.iter().filter(|&&ratio| ratio > 1.1).count();
    let worst = ratios.iter().copied().fold(0.0, f64::max);
    println!("{above} of {} choices above 1.1 times the best, {worst:.2} at most", ratios.len());
}
