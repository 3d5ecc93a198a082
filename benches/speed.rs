//! Speed of the CPU stages against their references and against Embree, interleaved.
//!
//! `cargo bench --bench speed` prints medians of alternating runs with their spread; `-- --help` lists
//! what can be varied. Figures are of this machine in its state of the moment: the ratios count.

#![allow(clippy::unwrap_used)]

mod peer;
mod scene;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Parser;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use sightline::backend::cpu::{
    CpuBackend, WalkScratch, beam_direction, bitmap_words, cast_closest, cast_packets,
    cover_sensor, cover_voxels, reduce,
};
use sightline::backend::{Backend, Content, DevicePose, OccupiedVoxel, Problem};
use sightline::bvh::{Bvh, Hit};
use sightline::grid::Roi;
use sightline::placement::{BeamTable, Placement, SensorPose};

/// Metres.
const RANGE: f32 = 100.0;
/// Placements that the slow references are run on.
const REFERENCE: usize = 4;

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
    /// Embree 4, for example from `pip download embreex`
    #[arg(long, value_name = "LIBRARY")]
    embree: Option<PathBuf>,
    /// Where to write all runs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// Times of one way to do a stage, in seconds for one unit of work.
struct Row {
    name: &'static str,
    runs: Vec<f64>,
    /// Why there are no runs.
    missing: Option<String>,
}

impl Row {
    fn new(name: &'static str) -> Self {
        Self { name, runs: Vec::new(), missing: None }
    }

    /// Runs and times one pass over `work` units.
    fn time<T>(&mut self, work: usize, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = run();
        self.runs.push(start.elapsed().as_secs_f64() / work as f64);
        result
    }

    fn sorted(&self) -> Vec<f64> {
        let mut runs = self.runs.clone();
        runs.sort_by(f64::total_cmp);
        runs
    }

    fn median(&self) -> f64 {
        self.sorted().get(self.runs.len() / 2).copied().unwrap_or(f64::NAN)
    }
}

/// Prints the rows of a stage; ratios are those of the last row to the others.
fn print(stage: &str, rows: &[&Row], unit: &str, scale: impl Fn(f64) -> f64) -> Value {
    println!("  {stage}, {unit}");
    let own = rows[rows.len() - 1].median();
    for row in rows {
        if let Some(why) = &row.missing {
            println!("    {:<34} missing: {why}", row.name);
            continue;
        }
        let runs = row.sorted();
        let (low, high) = (scale(runs[0]), scale(runs[runs.len() - 1]));
        println!(
            "    {:<34} {:>9.2}  ({:.2} to {:.2}){}",
            row.name,
            scale(row.median()),
            low.min(high),
            low.max(high),
            if row.median() == own {
                String::new()
            } else {
                format!("  x{:.1}", row.median() / own)
            },
        );
    }
    let rows = rows
        .iter()
        .map(|row| json!({ "name": row.name, "seconds": row.runs, "missing": row.missing }));
    json!({ "stage": stage, "rows": rows.collect::<Vec<_>>() })
}

fn placements(count: usize, turn: f64, seed: u64) -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut within = |low: f64, high: f64| rng.random_range(low..=high);
    let mut pose = || SensorPose {
        x: within(-0.6, 0.6),
        y: within(-0.6, 0.6),
        z: within(2.2, 2.8),
        roll: within(-turn, turn),
        pitch: within(-turn, turn),
        yaw: 0.0,
    };
    (0..count)
        .map(|i| Placement { name: format!("p{i}"), lidars: (0..4).map(|_| pose()).collect() })
        .collect()
}

/// The voxels in which beams of some sensors end, with arbitrary entropies, in five classes.
fn content(roi: &Roi, poses: &[DevicePose], table: &BeamTable, bvh: &Bvh, seed: u64) -> Content {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut hits = Vec::new();
    cast_packets(poses, table, bvh, RANGE, &mut hits);
    let mut voxels = Vec::new();
    for (pose, hits) in poses.iter().zip(hits.chunks(table.directions().len())) {
        let origin = DVec3::from(pose.rows.map(|row| f64::from(row[3])));
        for (&direction, hit) in table.directions().iter().zip(hits).filter(|(_, hit)| hit.is_hit())
        {
            let along = beam_direction(pose, direction).as_dvec3() * f64::from(hit.t);
            voxels.extend(roi.voxel_of_hit(origin, origin + along).map(|voxel| voxel as u32));
        }
    }
    voxels.sort_unstable();
    voxels.dedup();
    let mut by_class = vec![Vec::new(); 5];
    let mut occupied = Vec::new();
    for index in voxels {
        let entropy = [0; 3].map(|_| rng.random_range(0..1_u32 << 28));
        occupied.push(OccupiedVoxel { index, entropy });
        by_class[rng.random_range(0..5_usize)].push(index);
    }
    Content::new((0..5).map(|c| c.to_string()).collect(), occupied, &by_class, true)
}

fn same_bits(a: &[Hit], b: &[Hit]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a.t.to_bits(), a.prim) == (b.t.to_bits(), b.prim))
}

fn run(args: &Args, triangles: usize) -> Value {
    let soup = scene::street_scene(triangles, args.seed);
    let start = Instant::now();
    let bvh = Arc::new(Bvh::build(&soup, RANGE));
    let build = start.elapsed();
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    let channels: Vec<(f64, f64)> =
        (0..16).map(|k| (-24.8 + 26.8 * f64::from(k) / 15.0, 0.0)).collect();
    let table = BeamTable::spinning(&channels, 720, f64::from(RANGE)).unwrap();
    let batch = placements(args.placements, args.turn, args.seed);
    let poses: Vec<DevicePose> =
        batch.iter().flat_map(|p| &p.lidars).map(|l| DevicePose::new(l, &roi)).collect();
    let few = &batch[..REFERENCE.min(batch.len())];
    let few_poses = &poses[..4 * few.len()];
    let beams = table.directions().len();
    let content = content(&roi, &poses, &table, &bvh, args.seed);
    let occupied = content.occupied().len();
    let problem = Problem::new(roi, content.clone(), table.clone(), vec![bvh.clone()], true);
    let mut backend = CpuBackend::new(Arc::new(problem), 8 << 30);
    println!(
        "{} triangles, tree built in {build:.2?}, {occupied} occupied voxels, {} beams",
        soup.faces.len(),
        poses.len() * beams
    );

    let [mut single, mut embree, mut packets] =
        ["one beam at a time", "Embree 4, 16-wide coherent", "cast_packets"].map(Row::new);
    let [mut walk, mut lockstep] = ["one beam at a time, dense", "cover_sensor"].map(Row::new);
    let [mut voxels, mut words, mut both] =
        ["reduce, a voxel at a time", "Embree and the references", "CpuBackend::tally"]
            .map(Row::new);
    let mut peer = peer::Embree::start(args.embree.as_deref(), &soup, &poses, &table, args.threads);
    let (mut hits, mut bitmaps, mut scratch) = (Vec::new(), Vec::new(), WalkScratch::default());
    let mut bitmap = vec![0; bitmap_words(&roi)];
    for round in 0..args.rounds + 1 {
        let want =
            single.time(few_poses.len() * beams, || cast_closest(few_poses, &table, &bvh, RANGE));
        if let Ok(peer) = &mut peer {
            let (seconds, _) = peer.pass().expect("Embree answers until it is told to stop");
            embree.runs.push(seconds / (poses.len() * beams) as f64);
        }
        packets.time(poses.len() * beams, || cast_packets(&poses, &table, &bvh, RANGE, &mut hits));
        assert!(same_bits(&want, &hits), "the hits differ");
        walk.time(few.len(), || {
            cover_voxels(few_poses, &table, &roi, Some(&want), RANGE, &mut bitmaps)
        });
        for (index, pose) in few_poses.iter().enumerate() {
            bitmap.fill(0);
            let own = Some(&hits[index * beams..(index + 1) * beams]);
            lockstep.time(1, || {
                cover_sensor(pose, table.directions(), &roi, own, RANGE, &mut scratch, &mut bitmap)
            });
            assert!(
                bitmap == bitmaps[index * bitmap.len()..(index + 1) * bitmap.len()],
                "the voxels differ"
            );
        }
        let sums = voxels.time(few.len(), || reduce(few, &content, &bitmaps, Some(&want), beams));
        let tallies = both.time(batch.len(), || backend.tally(&batch, RANGE).unwrap());
        assert!(tallies.iter().zip(&sums).all(|(a, b)| a == b), "the sums differ");
        // The first round warms up.
        if round == 0 {
            for row in [
                &mut single,
                &mut embree,
                &mut packets,
                &mut walk,
                &mut lockstep,
                &mut voxels,
                &mut both,
            ] {
                row.runs.clear();
            }
        }
    }
    // A placement has four sensors; `cover_voxels` and `reduce` share the threads, one walk does not.
    lockstep.runs = lockstep
        .runs
        .chunks(few_poses.len())
        .map(|r| r.iter().sum::<f64>() / few.len() as f64)
        .collect();
    let slow = |k: usize| walk.runs[k] + voxels.runs[k];
    match peer {
        Ok(_) => {
            words.runs =
                (0..args.rounds).map(|k| embree.runs[k] * (4 * beams) as f64 + slow(k)).collect()
        }
        Err(why) => (embree.missing, words.missing) = (Some(why.clone()), Some(why)),
    }
    let mut all = Row::new("the references");
    all.runs = (0..args.rounds).map(|k| single.runs[k] * (4 * beams) as f64 + slow(k)).collect();
    let times = backend.times();
    let rows = vec![
        print("closest hit", &[&single, &embree, &packets], "million rays a second", |s| 1e-6 / s),
        print(
            "coverage",
            &[&walk, &lockstep],
            "ms a placement (one thread for cover_sensor)",
            |s| 1e3 * s,
        ),
        print("sums", &[&voxels], "ms a placement", |s| 1e3 * s),
        print("whole score", &[&all, &words, &both], "ms a placement", |s| 1e3 * s),
    ];
    let stages = [times.cast, times.cover, times.reduce]
        .map(|t| 1e3 * t.as_secs_f64() / (batch.len() * (args.rounds + 1)) as f64);
    println!("  of which cast {:.2}, cover {:.2}, reduce {:.2}", stages[0], stages[1], stages[2]);
    json!({ "triangles": soup.faces.len(), "build_seconds": build.as_secs_f64(), "stages": rows, "tally_ms": stages })
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
