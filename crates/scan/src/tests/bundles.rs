//! Beams that go down a tree together against the reference, ray by ray.

use glam::{DQuat, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use lidar_cast::bvh::{Bvh, Hit, Ray};
use lidar_cast::cast::{self, FiringWalk, Instructions, Rays, SweptPart};
use lidar_cast::geom::{Glide, Pose, TriangleSoup};
use sightline_scene::problem::{DevicePose, beam_direction, beam_origin};
use sightline_scene::vehicle::BeamTable;

/// Triangles of a few metres everywhere, and one out there.
fn crowd(rng: &mut ChaCha8Rng, out: Option<f32>) -> Bvh {
    let mut soup = TriangleSoup::default();
    for _ in 0..700 {
        let at = Vec3::from([0; 3].map(|_| rng.random_range(-20.0..20.0)));
        let corner = |rng: &mut ChaCha8Rng| {
            (at + Vec3::from([0; 3].map(|_| rng.random_range(-2.0..2.0)))).to_array()
        };
        let base = soup.vertices.len() as u32;
        soup.vertices.extend([corner(rng), corner(rng), corner(rng)]);
        soup.faces.push([base, base + 1, base + 2]);
        soup.face_class.push(0);
    }
    if let Some(out) = out {
        let base = soup.vertices.len() as u32;
        soup.vertices.extend([[out, 0.0, 0.0], [out, 1.0, 0.0], [out, 0.0, 1.0]]);
        soup.faces.push([base, base + 1, base + 2]);
        soup.face_class.push(0);
    }
    Bvh::build(&soup, 60.0)
}

/// A pose among them.
fn anywhere(rng: &mut ChaCha8Rng) -> Pose {
    let turn = [0; 3].map(|_| rng.random_range(-3.0..3.0));
    let at = DVec3::from([0; 3].map(|_| rng.random_range(-15.0..15.0)));
    Pose::new(at, turn[0], turn[1], turn[2])
}

/// Middle and seven rays around it, none farther away than `width` radians.
fn wide(rng: &mut ChaCha8Rng, middle: [f32; 3], width: f64) -> Rays {
    let middle = DVec3::from(middle.map(f64::from));
    let beside = middle.any_orthonormal_vector();
    let rays: [[f32; 3]; cast::RAYS] = std::array::from_fn(|lane| {
        let off = if lane == 0 { 0.0 } else { rng.random_range(0.0..0.99) * width };
        let round = DQuat::from_axis_angle(middle, rng.random_range(0.0..7.0)) * beside;
        (middle * off.cos() + round * off.sin()).as_vec3().to_array()
    });
    [0, 1, 2].map(|axis: usize| rays.map(|ray| ray[axis]))
}

/// The closest hit of a ray among all triangles, faces counted from 7.
fn alone(bvh: &Bvh, pose: &DevicePose, direction: [f32; 3]) -> Hit {
    let (origin, direction) = (beam_origin(pose), beam_direction(pose, direction));
    let hit = bvh.closest_hit_brute_force(&Ray::new(origin, direction, 40.0));
    if hit.is_hit() { Hit { prim: hit.prim + 7, ..hit } } else { hit }
}

#[test]
fn azimuth_steps_that_go_down_together_give_the_bits_of_the_reference() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    // Coordinates of the second tree are too large for angles.
    let trees = [crowd(&mut rng, None), crowd(&mut rng, Some(2e7))];
    let channels = |count: usize, offset: f64| -> Vec<(f64, f64)> {
        let channel = |k: usize| (60.0 - 120.0 * k as f64 / count as f64, (k % 3) as f64 * offset);
        (0..count).map(channel).collect()
    };
    let tables = [
        BeamTable::spinning(&channels(16, 0.0), 50, 40.0),
        // Offsets of a column and a half; windows of a single step; to one side.
        BeamTable::spinning(&channels(33, 13.5), 40, 40.0),
        BeamTable::spinning(&channels(300, -0.2), 12, 40.0),
        BeamTable::sector(&channels(20, 0.3), [-30.0, 2.0], 30, 40.0),
    ];
    let (mut hits_seen, mut beams, mut differ) = (0, 0, 0);
    for (table, bvh) in
        tables.map(Result::unwrap).iter().flat_map(|t| trees.iter().map(move |b| (t, b)))
    {
        let (grid, directions) = (table.grid().unwrap(), table.directions());
        let count = grid.channels.len();
        for instructions in [Instructions::Best, Instructions::Avx2, Instructions::Plain] {
            for width in [0.0, 0.003, 0.04] {
                let walk = FiringWalk::new(table, width as f32, instructions).unwrap();
                let together = walk.together();
                let first = rng.random_range(0..grid.steps.div_ceil(together)) * together;
                let steps = first..(first + together).min(grid.steps);
                // A step that is as fast as it may be, and none.
                let (from, speed) = (anywhere(&mut rng), if width == 0.003 { 0.0 } else { 0.1 });
                let turn =
                    Pose::new(DVec3::new(speed, -speed, 0.3 * speed), speed, -0.2 * speed, speed);
                let glide = Glide::new(&from, &from.compose(&turn));
                let pose = |k: usize| DevicePose::from(&glide.at(k as f64 / 10.0));
                let poses: Vec<_> =
                    steps.clone().map(|k| (k % 7 != 3).then(|| pose(k - first))).collect();
                let fired =
                    steps.clone().flat_map(|step| (0..count).map(move |k| k * grid.steps + step));
                let rays: Vec<Rays> =
                    fired.map(|beam| wide(&mut rng, directions[beam], width)).collect();
                let mut hits = vec![Hit::none(0.0); rays.len()];
                let mut rims = vec![[Hit::none(0.0); 7]; rays.len()];
                let parts = [SweptPart { bvh, first_prim: 7, poses: poses.clone() }];
                walk.closest_hits(steps, &parts, &rays, 40.0, &mut hits, &mut rims);
                for (beam, rays) in rays.iter().enumerate().step_by(7) {
                    let found = [&[hits[beam]][..], &rims[beam]].concat();
                    for (lane, hit) in found.into_iter().enumerate() {
                        let ray = [rays[0][lane], rays[1][lane], rays[2][lane]];
                        let pose = &poses[beam / count];
                        let expected = pose.map_or(Hit::none(40.0), |pose| alone(bvh, &pose, ray));
                        assert_eq!(
                            hit, expected,
                            "{instructions:?}, {width}, beam {beam}, lane {lane}"
                        );
                        hits_seen += u32::from(hit.is_hit());
                        differ += u32::from(hit.prim != hits[beam].prim);
                        beams += 1;
                    }
                }
            }
        }
    }
    assert!(hits_seen > beams / 8 && differ > beams / 100, "{hits_seen} {differ} of {beams}");
}

#[test]
fn beams_one_by_one_and_in_bundles_give_the_bits_of_the_reference() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let bvh = crowd(&mut rng, None);
    let mut left = lidar_cast::cast::TraversalStack::new();
    let mut hits_seen = 0;
    for _ in 0..400 {
        let pose = anywhere(&mut rng);
        let standing = lidar_cast::cast::BundleOrigin::new(&bvh, &pose, 40.0, 0.04);
        let targets = || {
            let target =
                |standing| lidar_cast::cast::BundleTree { tree: &bvh, first_prim: 7, standing };
            standing.iter().map(target)
        };
        let pose = DevicePose::from(&pose);
        let directions: [[f32; 3]; 9] = std::array::from_fn(|k| {
            let off = if k == 0 { [0.0; 2] } else { [0; 2].map(|_| rng.random_range(-0.02..0.02)) };
            Vec3::new(1.0, off[0], off[1]).normalize().to_array()
        });
        let reference = directions.map(|direction| alone(&bvh, &pose, direction));
        let mut single = [lidar_cast::bvh::Hit::none(40.0); 9];
        let mut bundle = single;
        lidar_cast::cast::closer_hits_of_beams(
            targets(),
            directions.into_iter(),
            &mut single,
            &mut left,
        );
        lidar_cast::cast::closer_hits_of_bundle(
            targets(),
            &directions,
            0.04,
            &mut bundle,
            &mut left,
        );
        assert_eq!(single, reference);
        assert_eq!(bundle, reference);
        hits_seen += reference.iter().filter(|hit| hit.is_hit()).count();
    }
    assert!(hits_seen > 500, "{hits_seen}");
}
