//! Placements and swaps a second from a warm pose atlas: `cargo bench --bench atlas [-- SCENE]`.
//!
//! One frame of a scene on one thread, against plain scoring of the same placements in turns. Prints
//! medians of the rounds and the spread between the quartiles.

#![allow(clippy::disallowed_methods)]

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sightline::engine::Backend;
use sightline::engine::CpuBackend;
use sightline::internals::{Atlas, PoseGrid, Spacing, Union};
use sightline::problem::{Problem, Tally};
use sightline::psog::Roi;
use sightline::scan::scan_scene;
use sightline::scene::{ScanSettings, Scene};
use sightline::score::Objective;
use sightline::vehicle::{BeamTable, Lidar, Placement};

const ROUNDS: usize = 15;
/// Poses of the grid that are held, drawn at random.
const POSES: usize = 512;
const MEMORY: u64 = 4 << 30;

fn main() {
    let scene = std::env::args().skip(1).find(|arg| !arg.starts_with('-'));
    let scene = scene.map_or("scenes/urban-crossing.json".into(), PathBuf::from);
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("the first pool");
    let scene = Scene::read(&scene).expect("a scene");
    let bounds = scene.roi();
    let roi = Roi::new(bounds.min, bounds.voxel, bounds.shape).expect("a grid");
    let scan = ScanSettings::default_of(&scene);
    let (psog, _) = scan_scene(&scene, &roi, &scan, |_| true).expect("a P-SOG");
    let Lidar::Spinning { elevations, azimuth_steps, range, .. } = scene.lidars()[0] else {
        panic!("the scene has no spinning LiDAR");
    };
    let channels: Vec<(f64, f64)> = elevations.iter().map(|&e| (e, 0.0)).collect();
    let table = BeamTable::spinning(&channels, *azimuth_steps, *range).expect("a sensor");
    let problem = Arc::new(Problem::from_scene(&scene, &psog, table, &[0]).expect("a problem"));
    let grid =
        PoseGrid::new(&scene.constraints(), Spacing { metres: 0.1, radians: 0.1 }).expect("a grid");
    println!(
        "{}: {} occupied of {} voxels, {} poses on the grid",
        scene.name(),
        problem.content().occupied().len(),
        roi.voxel_count(),
        grid.len()
    );
    for text in ["information_gain", "m_sog_scaled"] {
        measure(&problem, &grid, &text.parse().expect("an objective"));
    }
}

fn measure(problem: &Arc<Problem>, grid: &PoseGrid, objective: &Objective) {
    let mut backend = CpuBackend::new(problem.task().clone(), MEMORY);
    let mut atlas = Atlas::new(problem.clone(), grid.clone(), objective.needed(), MEMORY);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let poses: Vec<u32> = (0..POSES).map(|_| rng.random_range(0..grid.len())).collect();
    let start = Instant::now();
    atlas.hold(&mut backend, &poses).expect("room for the poses");
    let cold = start.elapsed().as_secs_f64() / POSES as f64;
    let mut pick = || poses[rng.random_range(0..poses.len())];
    let placements: Vec<[u32; 4]> = (0..2000).map(|_| [pick(), pick(), pick(), pick()]).collect();
    let few: Vec<Placement> = placements[..16]
        .iter()
        .map(|poses| Placement {
            name: "x".into(),
            lidars: poses.iter().map(|&pose| grid.pose(pose)).collect(),
        })
        .collect();
    let value = |tally: &Tally| objective.value_of_tally(tally, problem.content(), 1);
    let (mut whole, mut swaps, mut plain) = (Vec::new(), Vec::new(), Vec::new());
    let mut union = Union::default();
    let mut checksum = 0.0;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        for [others @ .., last] in &placements {
            atlas.union(others, &mut union);
            checksum += value(&atlas.tally_with(&union, *last)).unwrap_or(0.0);
        }
        whole.push(placements.len() as f64 / start.elapsed().as_secs_f64());
        let start = Instant::now();
        for [.., last] in &placements {
            checksum += value(&atlas.tally_with(&union, *last)).unwrap_or(0.0);
        }
        swaps.push(placements.len() as f64 / start.elapsed().as_secs_f64());
        let start = Instant::now();
        let range = problem.sensors().table(0).range();
        let tallies = backend.tally(&few, Some(range)).expect("scores");
        plain.push(few.len() as f64 / start.elapsed().as_secs_f64());
        checksum += tallies.iter().filter_map(value).sum::<f64>();
    }
    println!(
        "\n{objective}: {} KiB a pose, {:.2} ms to cast one",
        atlas.page_bytes() >> 10,
        1e3 * cold
    );
    let reference = median(&mut plain).0;
    for (what, rates) in
        [("plain scoring", &mut plain), ("placements", &mut whole), ("swaps", &mut swaps)]
    {
        let (rate, spread) = median(rates);
        println!("  {what:14} {rate:9.0}/s ±{spread:.0} %  {:7.1}×", rate / reference);
    }
    assert!(checksum.is_finite());
}

/// The median, and half the distance of the quartiles as a share of it in per cent.
fn median(rates: &mut [f64]) -> (f64, f64) {
    rates.sort_by(f64::total_cmp);
    let at = |share: f64| rates[(share * (rates.len() - 1) as f64).round() as usize];
    (at(0.5), 50.0 * (at(0.75) - at(0.25)) / at(0.5))
}
