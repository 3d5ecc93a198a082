//! The worst driver that Vulkan allows, played on a device at hand: the bits of hits and voxels stay.

mod rewrite;

use std::sync::Arc;

use glam::DVec3;
use lidar_cast::bvh::Bvh;
use lidar_cast::cover::BitOrder;
use sightline::engine::Backend;
use sightline::geom::TriangleSoup;
use sightline::problem::Problem;
use sightline::problem::Task;
use sightline::psog::Roi;
use sightline::vehicle::{BeamTable, Placement, SensorPose};

use crate::common::{cpu, gpu, random_content, random_placements, random_soup};
use crate::own_scenes::{Own, SCENES, description, table_7};
use rewrite::{hostile, hostile_to_plain_arithmetic};

const RANGE: f64 = 40.0;

/// A problem whose beams end at hits, or go through, in a scene of `scale` times the size. Beams run in all directions, and
/// through edges and corners of voxels, where the order of crossings is decided by their last bits.
fn problem(scale: f64, ends_at_hits: bool) -> Arc<Problem> {
    let roi = Roi::new([-9.0, -7.0, -5.0], [0.5, 0.25, 0.125], [36, 56, 80]).unwrap();
    let cells = (0..343).map(|k| [k / 49 - 3, k / 7 % 7 - 3, k % 7 - 3].map(f64::from));
    let edges = cells.map(DVec3::from).filter(|&d| d != DVec3::ZERO);
    let any = (0..400).map(|k| {
        let (turn, rise) = (0.37 * f64::from(k), 1.9 * f64::from(k % 61) / 61.0 - 0.95);
        DVec3::new(turn.cos(), turn.sin(), rise)
    });
    let table = BeamTable::from_directions(edges.chain(any), RANGE).unwrap();
    let mut soup: TriangleSoup = random_soup(91, 200, 12.0);
    for (index, vertex) in soup.vertices.iter_mut().enumerate() {
        let on_grid = vertex.map(|v| if index % 5 == 0 { v.round() } else { v });
        *vertex = on_grid.map(|v| (f64::from(v) * scale) as f32);
    }
    let bvh = Arc::new(Bvh::build(&soup, RANGE as f32));
    Arc::new(Problem::from(Task::new(roi, random_content(3, &roi), table, vec![bvh], ends_at_hits)))
}

/// Sensors within a metre and a half of the origin, times `scale`.
fn sensors(scale: f64) -> Vec<SensorPose> {
    let pose = |k: u32| {
        let at = |step: u32| scale * (f64::from(k * step % 7) * 0.5 - 1.5);
        let turn = 0.4 * f64::from(k % 2);
        SensorPose { x: at(1), y: at(2), z: at(3), roll: turn, yaw: -turn, ..SensorPose::default() }
    };
    (0..8).map(pose).collect()
}

/// Hits and voxels that differ from those of the CPU, and how many there are of each.
fn differences(
    problem: &Arc<Problem>,
    sensors: &[SensorPose],
    rewrite: fn(&str, String) -> String,
) -> [usize; 4] {
    let (mut host, mut device) = (cpu(problem), gpu(problem));
    device.rewrite_kernels(rewrite);
    let (want, got) = (host.hits(sensors, 0).unwrap(), device.hits(sensors, 0).unwrap());
    let pairs = want.iter().zip(&got);
    let hits = pairs.filter(|(a, b)| (a.t.to_bits(), a.prim) != (b.t.to_bits(), b.prim)).count();
    let hit = want.iter().filter(|hit| hit.is_hit()).count();
    let order = BitOrder::linear(problem.roi());
    let (want, got) = (host.bitmaps(sensors, 0).unwrap(), device.bitmaps(sensors, 0).unwrap());
    let (mut voxels, mut covered) = (0, 0);
    for (ours, theirs) in want.sensors().zip(got.sensors()) {
        let (ours, theirs) = (want.order.convert(ours, &order), got.order.convert(theirs, &order));
        voxels += ours
            .iter()
            .zip(theirs.iter())
            .map(|(a, b)| (a ^ b).count_ones() as usize)
            .sum::<usize>();
        covered += ours.iter().map(|word| word.count_ones() as usize).sum::<usize>();
    }
    [hits, hit, voxels, covered]
}

#[test]
fn hostile_driver_changes_no_bit() {
    for (scale, ends_at_hits) in [(1.0, true), (1.0, false), (1e-19, true), (1e-17, true)] {
        let problem = problem(scale, ends_at_hits);
        let [hits, hit, voxels, covered] = differences(&problem, &sensors(scale), hostile);
        assert_eq!([hits, voxels], [0, 0], "scale {scale:e}: of {hit} hits and {covered} voxels");
        assert!(hit > 2_000 && covered > 1_000, "{hit} hits, {covered} voxels: a trivial scene");
    }
}

/// Table 7, random placements, and hostile ones: on corners of voxels along the axes, underground, in solids, far away.
fn placements() -> Vec<Placement> {
    let mut all = table_7();
    all.extend(random_placements(17, 6, 2.5));
    let poses =
        [[0.0, 0.0, 2.0], [0.5, -1.0, 1.5], [3.0, 2.0, -0.25], [20.5, 8.0, 1.0], [1e5, 0.0, 2.0]];
    all.extend(poses.into_iter().enumerate().map(|(k, [x, y, z])| Placement {
        name: format!("hostile-{k}"),
        lidars: vec![
            SensorPose::at(x, y, z),
            SensorPose { yaw: 0.3, ..SensorPose::at(x, y, z + 0.5) },
        ],
    }));
    all
}

/// Hits, coverage and sums of the own scenes: every sum of every placement.
#[test]
fn hostile_driver_changes_no_sum_of_the_own_scenes() {
    for name in SCENES {
        let problem = Own::new(&description(name)).problem;
        let mut device = gpu(&problem);
        device.rewrite_kernels(hostile);
        let want = cpu(&problem).tally(&placements(), None).unwrap();
        assert!(want.iter().filter(|tally| tally.hits > 0).count() > 15, "{name}");
        assert_eq!(device.tally(&placements(), None).unwrap(), want, "{name}");
        let [hits, hit, voxels, covered] = differences(&problem, &poses(), hostile);
        assert_eq!([hits, voxels], [0, 0], "{name}: of {hit} hits and {covered} voxels");
    }
}

/// Poses of all placements, but those so far away that they meet nothing.
fn poses() -> Vec<SensorPose> {
    placements()
        .into_iter()
        .flat_map(|placement| placement.lidars)
        .filter(|pose| pose.x < 1e3)
        .collect()
}

/// Kernels whose arithmetic is as WGSL has it: the driver shows itself, or the test above could not fail.
#[test]
fn hostile_driver_changes_kernels_of_plain_arithmetic() {
    for (ends_at_hits, least) in [(true, [100, 0]), (false, [100, 10])] {
        let problem = problem(1.0, ends_at_hits);
        let [hits, hit, voxels, covered] =
            differences(&problem, &sensors(1.0), hostile_to_plain_arithmetic);
        println!("{hits} of {hit} hits and {voxels} of {covered} voxels differ");
        assert!(hits >= least[0] && voxels >= least[1], "{hits} of {hit}, {voxels} of {covered}");
    }
    for name in SCENES {
        let problem = Own::new(&description(name)).problem;
        let [hits, hit, ..] = differences(&problem, &poses(), hostile_to_plain_arithmetic);
        println!("{name}: {hits} of {hit} hits differ");
        assert!(hits >= 100, "{name}: {hits} of {hit}");
    }
    // Flushed denormals turn decisions.
    let tiny = 1e-19;
    let [hits, hit, ..] = differences(&problem(tiny, true), &sensors(tiny), |kernel, source| {
        hostile(kernel, source.replace("< SURE", "< -SURE"))
    });
    println!("{hits} of {hit} hits differ where flushed decisions are not handed to the host");
    assert!(hits > 0, "of {hit}");
}
