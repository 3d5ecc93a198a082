mod scene;
use rand::{RngExt, SeedableRng};
use sightline::backend::DevicePose;
use sightline::backend::cpu::{cast_closest, cast_packets};
use sightline::bvh::Bvh;
use sightline::grid::Roi;
use sightline::placement::{BeamTable, SensorPose};
use std::time::Instant;

fn main() {
    let args: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let (triangles, placements) =
        (args.first().copied().unwrap_or(20000), args.get(1).copied().unwrap_or(64));
    let threads = args.get(2).copied().unwrap_or(1);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().unwrap();
    let soup = scene::street_scene(triangles, 1);
    let start = Instant::now();
    let bvh = Bvh::build(&soup, 100.0);
    println!("{} triangles, built in {:.2?}", soup.faces.len(), start.elapsed());
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    let channels: Vec<(f64, f64)> =
        (0..16).map(|k| (-24.8 + 26.8 * k as f64 / 15.0, 0.0)).collect();
    let table = BeamTable::spinning(&channels, 720, 100.0).unwrap();
    let turn = std::env::var("TURN").map(|v| v.parse::<f64>().unwrap()).unwrap_or(0.0);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let poses: Vec<DevicePose> = (0..placements * 4)
        .map(|_| {
            let mut r = |a: f64, b: f64| rng.random_range(a..=b);
            DevicePose::new(
                &SensorPose {
                    x: r(-0.6, 0.6),
                    y: r(-0.6, 0.6),
                    z: r(2.2, 2.8),
                    roll: r(-turn, turn),
                    pitch: r(-turn, turn),
                    yaw: 0.0,
                },
                &roi,
            )
        })
        .collect();
    let rays = poses.len() * table.directions().len();
    let reference = &poses[..poses.len().min(64)];
    let (mut old, mut new) = (vec![], vec![]);
    let mut same = true;
    let mut b = vec![];
    for _ in 0..5 {
        let start = cpu();
        let a = cast_closest(reference, &table, &bvh, 100.0);
        old.push(a.len() as f64 / (cpu() - start) / 1e6);
        let start = cpu();
        cast_packets(&poses, &table, &bvh, 100.0, &mut b);
        new.push(rays as f64 / (cpu() - start) / 1e6);
        same &= a.iter().zip(&b).all(|(a, b)| a.t.to_bits() == b.t.to_bits() && a.prim == b.prim);
    }

    {
        use sightline::backend::cpu::*;
        let words = bitmap_words(&roi); let count = reference.len(); let n = table.directions().len();
        let mut maps = vec![]; let mut map = vec![0u64; words]; let mut ws = WalkScratch::default();
        let (mut o, mut w) = (vec![], vec![]);
        for _ in 0..5 {
            let s = cpu(); cover_voxels(reference, &table, &roi, Some(&b[..count * n]), 100.0, &mut maps); o.push((cpu() - s) / count as f64 * 4e3);
            let s = cpu(); for (i, pose) in reference.iter().enumerate() { map.fill(0); cover_sensor(pose, table.directions(), &roi, Some(&b[i * n..(i + 1) * n]), 100.0, &mut ws, &mut map); same &= map == maps[i * words..(i + 1) * words]; } w.push((cpu() - s) / count as f64 * 4e3);
        }
        o.sort_by(f64::total_cmp); w.sort_by(f64::total_cmp);
        println!("cover old {:.2} ms new {:.2} ms a placement, ratio {:.2}, same {same}", o[2], w[2], o[2] / w[2]);
    }
    old.sort_by(f64::total_cmp);
    new.sort_by(f64::total_cmp);
    println!(
        "old {:.1} new {:.1} Mrays/s, ratio {:.1}, same {same}",
        old[2],
        new[2],
        new[2] / old[2]
    );
}

fn cpu() -> f64 {
    std::fs::read_dir("/proc/self/task")
        .unwrap()
        .map(|t| {
            std::fs::read_to_string(t.unwrap().path().join("schedstat"))
                .unwrap()
                .split(' ')
                .next()
                .unwrap()
                .parse::<f64>()
                .unwrap()
        })
        .sum::<f64>()
        * 1e-9
}
