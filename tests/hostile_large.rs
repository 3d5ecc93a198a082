//! Sizes that methods fail at: many beams at a closed mesh, one voxel and 10⁸, one triangle and
//! 2·10⁶, batches beyond every limit of a device.
//!
//! `SIGHTLINE_FULL=1 cargo test --release --test main hostile_large` runs them at full size (10⁷ beams,
//! 2·10⁶ triangles); otherwise they are a tenth or less of it.

use lidar_cast::task::{DevicePose, KINDS, beam_direction};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use sightline::engine::gpu::GpuBackend;
use sightline::internals::{Explanation, explain};

use crate::common::*;

/// `full` where the whole size is asked for, else `part`.
fn sized(full: usize, part: usize) -> usize {
    if std::env::var_os("SIGHTLINE_FULL").is_some() { full } else { part }
}

fn single(x: f64, y: f64, z: f64) -> Placement {
    let pose = SensorPose { x, y, z, ..SensorPose::default() };
    Placement { name: "single".into(), lidars: vec![pose] }
}

fn problem(
    roi: Roi,
    directions: &[DVec3],
    range: f64,
    soup: Option<&TriangleSoup>,
) -> Arc<Problem> {
    let table = BeamTable::from_directions(directions.iter().copied(), range).unwrap();
    let frames: Vec<_> = soup.iter().map(|soup| Arc::new(Bvh::build(soup, range as f32))).collect();
    let content = random_content(5, &roi);
    Arc::new(Problem::from(Task::new(roi, content, table, frames, soup.is_some())))
}

/// A uv sphere of uneven radius: closed, with poles at which many triangles share one vertex.
fn closed_mesh(rings: u32, sectors: u32, rng: &mut ChaCha8Rng) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let radius = 20.0_f64;
    soup.vertices.extend([[0.0, 0.0, radius as f32], [0.0, 0.0, -radius as f32]]);
    for ring in 1..rings {
        let (sin, cos) = (std::f64::consts::PI * f64::from(ring) / f64::from(rings)).sin_cos();
        for sector in 0..sectors {
            let turn = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
            let r = radius * rng.random_range(0.9..1.1);
            let v = r * DVec3::new(sin * turn.cos(), sin * turn.sin(), cos);
            soup.vertices.push(v.as_vec3().to_array());
        }
    }
    let at = |ring: u32, sector: u32| match ring {
        0 => 0,
        r if r == rings => 1,
        r => 2 + (r - 1) * sectors + sector % sectors,
    };
    for ring in 0..rings {
        for sector in 0..sectors {
            let (a, b) = (at(ring, sector), at(ring, sector + 1));
            let (c, d) = (at(ring + 1, sector + 1), at(ring + 1, sector));
            soup.faces.extend(
                [[a, d, c], [a, c, b]]
                    .into_iter()
                    .filter(|f| f[0] != f[1] && f[1] != f[2] && f[2] != f[0]),
            );
        }
    }
    soup.face_class = vec![0; soup.faces.len()];
    soup
}

/// No beam from inside a closed mesh gets out, where it is aimed at a shared vertex, at a shared edge
/// or anywhere.
#[test]
fn no_beam_leaks_out_of_a_closed_mesh() {
    let mut rng = rng(91);
    let soup = closed_mesh(60, 90, &mut rng);
    let vertex = |v: u32| Vec3::from(soup.vertices[v as usize]).as_dvec3();
    let roi = Roi::new([-4.0; 3], [1.0; 3], [8, 8, 8]).unwrap();
    // Several origins; the directions of a table are aimed from one of them.
    let origins =
        [[0.0; 3], [0.25, -0.5, 0.125], [3.7, 1.3, -2.9], [-9.1, 4.4, 6.3], [0.0, 0.0, 15.5]];
    let each = sized(2_000_000, 120_000);
    let mut cast = 0;
    for [x, y, z] in origins {
        let origin = DVec3::new(x, y, z);
        let directions: Vec<DVec3> = (0..each)
            .map(|n| {
                let [a, b, _] = soup.faces[rng.random_range(0..soup.faces.len())];
                let target = match n % 3 {
                    0 => vertex(a),
                    1 => vertex(a).lerp(vertex(b), rng.random_range(0.0..1.0)),
                    _ => origin + DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0))),
                };
                target - origin
            })
            .collect();
        let problem = problem(roi, &directions, 100.0, Some(&soup));
        let [mut cpu, mut gpu] = both(&problem);
        let hits = cpu.hits(&single(x, y, z).lidars, 0).unwrap();
        let leaks = hits.iter().filter(|hit| !hit.is_hit()).count();
        assert_eq!(leaks, 0, "of {} beams from {origin}", hits.len());
        assert_eq!(bits(&hits), bits(&gpu.hits(&single(x, y, z).lidars, 0).unwrap()));
        cast += hits.len();
    }
    assert!(cast >= sized(10_000_000, 600_000));
}

/// Rolling ground of 2·`cells`² triangles.
fn terrain(cells: u32) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let step = 200.0 / f64::from(cells);
    for i in 0..=cells {
        for j in 0..=cells {
            let (x, y) = (f64::from(i) * step - 100.0, f64::from(j) * step - 100.0);
            let z = (0.11 * x).sin() * (0.07 * y).cos() + 0.1 * (1.3 * x + 0.9 * y).sin();
            soup.vertices.push([x as f32, y as f32, z as f32]);
        }
    }
    for i in 0..cells {
        for j in 0..cells {
            let a = i * (cells + 1) + j;
            let (b, c, d) = (a + cells + 1, a + cells + 2, a + 1);
            soup.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup.face_class = vec![0; soup.faces.len()];
    soup
}

#[test]
fn two_million_triangles_are_hit_where_brute_force_says() {
    let cells = sized(1000, 250) as u32;
    let soup = terrain(cells);
    assert_eq!(soup.faces.len(), 2 * (cells * cells) as usize);
    let mut rng = rng(92);
    let directions: Vec<DVec3> = (0..sized(1000, 300))
        .map(|_| DVec3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), -0.06))
        .collect();
    let roi = Roi::new([-40.0, -40.0, -2.0], [1.0; 3], [80, 80, 6]).unwrap();
    let problem = problem(roi, &directions, 120.0, Some(&soup));
    let [mut cpu, mut gpu] = both(&problem);
    let placement = single(0.3, 0.7, 3.1);
    let hits = cpu.hits(&placement.lidars, 0).unwrap();
    assert!(hits.iter().filter(|hit| hit.is_hit()).count() > hits.len() / 2);
    assert_eq!(bits(&hits), bits(&gpu.hits(&placement.lidars, 0).unwrap()));
    let bvh = &problem.geometry(0).unwrap().instances()[0].tree;
    // Rounded like in the backends.
    let pose = DevicePose::new(&placement.lidars[0].ego_from_sensor(), problem.roi());
    let origin = Vec3::from(pose.rows.map(|row| row[3]));
    hits.par_iter().zip(problem.sensors().table(0).directions()).for_each(|(hit, &direction)| {
        let direction = beam_direction(&pose, direction);
        let found = explain(bvh, origin, direction, 120.0, *hit);
        assert_ne!(found, Explanation::Unexplained, "{hit:?} along {direction}");
    });
}

#[test]
fn one_triangle_and_one_voxel_are_enough() {
    let mut soup = TriangleSoup::default();
    soup.vertices.extend([[2.5, -1.0, -1.0], [2.5, 1.0, -1.0], [2.5, 0.0, 1.0]]);
    soup.faces.push([0, 1, 2]);
    soup.face_class.push(0);
    let roi = Roi::new([2.0, -0.5, -0.5], [1.0; 3], [1, 1, 1]).unwrap();
    let problem = problem(roi, &[DVec3::X, DVec3::NEG_X, DVec3::Y], 10.0, Some(&soup));
    for backend in &mut both(&problem) {
        let hits = backend.hits(&single(0.0, 0.0, 0.0).lidars, 0).unwrap();
        assert_eq!(bits(&hits)[0], (2.5_f32.to_bits(), 0));
        assert_eq!(hits.iter().filter(|hit| hit.is_hit()).count(), 1);
        assert_eq!(backend.covered(&single(0.0, 0.0, 0.0), 0).unwrap(), [0]);
        let tally = backend.tally(&[single(0.0, 0.0, 0.0)], Some(10.0)).unwrap().remove(0);
        assert_eq!((tally.covered, tally.hits, tally.beams), (1, 1, 3));
    }
}

/// 10⁸ voxels: level beams along the axes cover whole rows, and both backends the same everywhere.
#[test]
fn a_hundred_million_voxels_are_covered_alike() {
    let roi = Roi::new([-50.0, -50.0, -5.0], [0.1; 3], [1000, 1000, 100]).unwrap();
    assert_eq!(roi.voxel_count(), 100_000_000);
    let mut rng = rng(93);
    let occupied: Vec<OccupiedVoxel> = (0..roi.voxel_count() as u32)
        .step_by(997)
        .map(|index| OccupiedVoxel {
            index,
            entropy: [0; KINDS].map(|_| rng.random_range(1..1_u32 << 28)),
        })
        .collect();
    let class = occupied.iter().map(|voxel| voxel.index).collect();
    let content = Content::new(vec!["a".into()], occupied, &[class], false);
    let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
    let spread = (0..sized(20_000, 2000)).map(|_| {
        DVec3::new(
            rng.random_range(-1.0..1.0),
            rng.random_range(-1.0..1.0),
            rng.random_range(-0.1..0.1),
        )
    });
    let directions = axes.into_iter().chain(spread);
    let table = BeamTable::from_directions(directions, 200.0).unwrap();
    let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![], false)));
    let placement = single(0.05, 0.05, 0.05);
    let [mut cpu, mut gpu] = both(&problem);
    let covered = cpu.covered(&placement, 0).unwrap();
    let [i, j, k] = [500, 500, 50];
    for n in 0..1000 {
        for voxel in [roi.linear([n, j, k]), roi.linear([i, n, k])] {
            assert!(covered.binary_search(&voxel).is_ok(), "row or column lacks voxel {n}");
        }
    }
    assert_eq!(covered, gpu.covered(&placement, 0).unwrap());
    let placements = [placement];
    let tally = cpu.tally(&placements, Some(200.0)).unwrap();
    assert!(tally[0].entropy[0] > 0 && tally[0].covered == covered.len() as u64);
    assert_eq!(tally, gpu.tally(&placements, Some(200.0)).unwrap());
}

/// More sensors and placements than a dimension has workgroups, and more bytes of bitmaps than a
/// binding holds: the batch is split, and every bit is the same.
#[test]
fn a_batch_beyond_every_limit_is_split() {
    let roi = Roi::new([-4.0, -4.0, -2.0], [0.25; 3], [32, 32, 16]).unwrap();
    let directions = [DVec3::new(1.0, 0.2, 0.1), DVec3::new(-0.7, 1.0, -0.3)];
    // A few voxels of content: bitmaps are split.
    let occupied = (0..roi.voxel_count() as u32)
        .step_by(97)
        .map(|index| OccupiedVoxel { index, entropy: [index + 1; KINDS] });
    let occupied: Vec<OccupiedVoxel> = occupied.collect();
    let class = occupied.iter().map(|voxel| voxel.index).collect();
    let content = Content::new(vec!["a".into()], occupied, &[class], true);
    let table = BeamTable::from_directions(directions, 20.0).unwrap();
    let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![], false)));
    let mut few = random_placements(94, 500, 3.5);
    few.iter_mut().for_each(|placement| placement.lidars.truncate(1));
    let placements: Vec<Placement> = few.iter().cycle().take(66_000).cloned().collect();
    let sensors: usize = placements.iter().map(|p| p.lidars.len()).sum();
    let bitmaps = sensors as u64 * roi.voxel_count() / 8;
    // A dimension of a dispatch has 65 535 workgroups, and software binds 128 MiB at once.
    assert!(placements.len() > 65_535 && bitmaps > 128 << 20, "{bitmaps}");
    let mut gpu = GpuBackend::new(problem.task().clone(), None, 4 << 30).unwrap();
    let want = cpu(&problem).tally(&few, Some(20.0)).unwrap();
    let got = gpu.tally(&placements, Some(20.0)).unwrap();
    assert_eq!(got.len(), placements.len());
    for (index, tally) in got.iter().enumerate() {
        assert_eq!(*tally, want[index % few.len()], "placement {index}");
    }
}

/// One sensor with more beams than 65 535 workgroups hold: the rest spills into another dimension.
#[test]
fn a_sensor_beyond_a_dimension_of_workgroups_is_whole() {
    let mut rng = rng(95);
    let directions: Vec<DVec3> = (0..65_535 * 64 + 77)
        .map(|_| DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0))))
        .collect();
    let roi = Roi::new([-2.0; 3], [1.0; 3], [4, 4, 4]).unwrap();
    let mut soup = TriangleSoup::default();
    soup.vertices.extend([[1.0, -9.0, -9.0], [1.0, 9.0, -9.0], [1.0, 0.0, 9.0]]);
    soup.faces.push([0, 1, 2]);
    soup.face_class.push(0);
    let problem = problem(roi, &directions, 5.0, Some(&soup));
    let placements = [single(0.1, 0.2, 0.3)];
    let [mut cpu, mut gpu] = both(&problem);
    let tally = cpu.tally(&placements, Some(5.0)).unwrap();
    assert_eq!(tally[0].beams, directions.len() as u64);
    assert!(tally[0].hits > 400_000);
    assert_eq!(tally, gpu.tally(&placements, Some(5.0)).unwrap());
}
