//! Rays under the tree of instances against a loop over all triangles.

use std::f64::consts::FRAC_PI_2;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// The plane x = 2, |y|, |z| ≤ 1, as two triangles, in a thing that is turned by 90° and moved.
fn wall() -> Frame {
    let vertices = vec![[2.0, -1.0, -1.0], [2.0, 1.0, -1.0], [2.0, 1.0, 1.0], [2.0, -1.0, 1.0]];
    let faces = vec![[0, 1, 2], [0, 2, 3]];
    let soup = TriangleSoup { vertices, faces, face_class: vec![0, 0] };
    let tree = Arc::new(Bvh::build(&soup, 100.0));
    let turned = Pose::new(DVec3::new(0.0, 10.0, 0.0), 0.0, 0.0, FRAC_PI_2);
    let here = Instance { tree: tree.clone(), ego_from_instance: Pose::IDENTITY, first_prim: 0 };
    Frame::new([here, Instance { tree, ego_from_instance: turned, first_prim: 2 }])
}

#[test]
fn a_ray_of_any_length_hits_what_stands_before_it() {
    let rays = [
        [0.0, 0.2, 0.1, 1.0, 0.0, 0.0],
        // Four metres a unit: the wall is half a unit away.
        [0.0, 0.2, 0.1, 4.0, 0.0, 0.0],
        // The turned wall is the plane y = 12.
        [0.1, 9.0, 0.5, 0.0, 2.0, 0.0],
        [0.0, 0.2, 0.1, -1.0, 0.0, 0.0],
        [f32::NAN, 0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ];
    let hits = cast_rays(&wall(), &rays, 100.0);
    let close = |hit: &Hit, t: f32| hit.is_hit() && (hit.t - t).abs() < 1e-5;
    assert!(close(&hits[0], 2.0) && hits[0].prim < 2, "{hits:?}");
    assert!(close(&hits[1], 0.5) && hits[1].prim < 2, "{hits:?}");
    assert!(close(&hits[2], 1.5) && hits[2].prim >= 2, "{hits:?}");
    assert!(hits[3..].iter().all(|hit| !hit.is_hit()), "{hits:?}");
}

#[test]
fn hits_beyond_the_range_do_not_count() {
    let ray = [0.0, 0.2, 0.1, 1.0, 0.0, 0.0];
    assert!(!cast_rays(&wall(), &[ray], 1.9)[0].is_hit());
}

/// Crates of many sizes at random places and angles, each with faces of its own.
fn crates(count: u32, rng: &mut ChaCha8Rng) -> Frame {
    let cube = |half: f32| {
        let corner = |k: u32| [0, 1, 2].map(|axis| if k >> axis & 1 == 0 { -half } else { half });
        let sides =
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let halves = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        TriangleSoup {
            vertices: (0..8).map(corner).collect(),
            faces: halves.collect(),
            face_class: vec![0; 12],
        }
    };
    let trees = [0.1, 0.7, 2.0].map(|half| Arc::new(Bvh::build(&cube(half), 200.0)));
    let mut drawn = |most: f64| rng.random_range(-most..most);
    Frame::new((0..count).map(|k| Instance {
        tree: trees[k as usize % 3].clone(),
        ego_from_instance: Pose::new(
            DVec3::new(drawn(40.0), drawn(40.0), drawn(10.0)),
            drawn(3.0),
            drawn(1.5),
            drawn(3.0),
        ),
        first_prim: 12 * k,
    }))
}

/// All triangles of all instances one after the other: closest hit, number of hits.
fn without_trees(frame: &Frame, ray: &[f32; 6], range: f32, t_max: f32) -> (Hit, u32) {
    let at = |k: usize| DVec3::from([0, 1, 2].map(|axis| f64::from(ray[k + axis])));
    let (origin, length) = (at(0), at(3).length());
    let (mut closest, mut count) = (Hit::none(range), 0);
    if !(origin.is_finite() && length.is_finite() && length > 0.0) {
        return (closest, count);
    }
    let most = (f64::from(t_max) * length).min(f64::from(range)) as f32;
    closest.t = most;
    for instance in frame.instances() {
        let from_ego = instance.ego_from_instance.inverse();
        let unit = from_ego.rotation * (at(3) / length);
        let ray = Ray::new(from_ego.apply(origin).as_vec3(), unit.as_vec3(), most);
        for triangle in &instance.tree.triangles {
            let mut own = Hit::none(most);
            ray.intersect(triangle, instance.tree.pad, instance.first_prim, &mut own);
            count += u32::from(own.is_hit());
            ray.intersect(triangle, instance.tree.pad, instance.first_prim, &mut closest);
        }
    }
    if closest.is_hit() {
        closest.t = (f64::from(closest.t) / length) as f32;
    }
    (closest, count)
}

/// Compares closest hits, counts and occlusion of rays with the loop, bit by bit, by all instructions; returns how many hit.
fn same_as_without_trees(frame: &Frame, rays: &[[f32; 6]], range: f32, t_max: f32) -> usize {
    let expected: Vec<(Hit, u32)> =
        rays.iter().map(|ray| without_trees(frame, ray, range, t_max)).collect();
    for instructions in [Instructions::Best, Instructions::Plain] {
        let scene = RayScene::new(frame).with_instructions(instructions);
        let hits = scene.closest_hits(rays, range, t_max);
        let counts = scene.counts(rays, range, t_max);
        let any = scene.occluded(rays, range, t_max);
        for (k, (ray, (hit, number))) in rays.iter().zip(&expected).enumerate() {
            let found = (hits[k].t.to_bits(), hits[k].prim);
            assert_eq!(found, (hit.t.to_bits(), hit.prim), "{instructions:?} {k} {ray:?}");
            assert_eq!(
                (counts[k], any[k]),
                (*number, hit.is_hit()),
                "{instructions:?} {k} {ray:?}"
            );
        }
    }
    expected.iter().filter(|(hit, _)| hit.is_hit()).count()
}

#[test]
fn hits_under_the_tree_of_instances_are_those_of_a_loop_over_all_triangles() {
    let mut rng = ChaCha8Rng::seed_from_u64(45);
    for count in [1, 2, 16, 17, 300] {
        let frame = crates(count, &mut rng);
        let rays: Vec<[f32; 6]> = (0..3000)
            .map(|k| {
                let spread = if k % 2 == 0 { 40.0 } else { 2000.0 };
                let from: [f32; 3] = std::array::from_fn(|_| rng.random_range(-spread..spread));
                let to: [f32; 3] = std::array::from_fn(|_| rng.random_range(-30.0..30.0));
                let to = [0, 1, 2].map(|axis| to[axis] - from[axis]);
                [from[0], from[1], from[2], to[0], to[1], to[2]]
            })
            .collect();
        let met = same_as_without_trees(&frame, &rays, 3000.0, f32::INFINITY);
        assert!(count < 300 || met > 300, "{met} of {} rays hit", rays.len());
    }
}

#[test]
fn rays_that_go_down_together_hit_what_each_hits_alone() {
    let mut rng = ChaCha8Rng::seed_from_u64(46);
    for count in [1, 200] {
        let frame = crates(count, &mut rng);
        // Rings of one place, and rows of parallel rays from places beside each other; not a multiple of eight.
        let ring = |k: u16| {
            let (up, round) = (f32::from(k / 315) * 0.1 - 0.3, f32::from(k % 315) * 0.02);
            [0.5, -0.5, 1.5, round.cos(), round.sin(), up]
        };
        let row =
            |k: u16| [-60.0, f32::from(k % 70) - 35.0, f32::from(k / 70) * 0.5, 1.0, 0.01, -0.02];
        let rays: Vec<[f32; 6]> = (0..1899).map(ring).chain((0..701).map(row)).collect();
        for (range, t_max) in [(3000.0, f32::INFINITY), (20.0, f32::INFINITY), (3000.0, 9.0)] {
            let met = same_as_without_trees(&frame, &rays, range, t_max);
            assert!(count == 1 || met > 20, "{met} of {} rays hit", rays.len());
        }
    }
}

/// A floor of squares on whole coordinates with one corner of each lifted, all triangles twice, and such without area.
fn folded_floor() -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    for k in 0..20_u16 * 20 {
        let (x, y) = (f32::from(k % 20) - 10.0, f32::from(k / 20) - 10.0);
        let first = soup.vertices.len() as u32;
        let lift = f32::from(k % 3);
        soup.vertices.extend([
            [x, y, 0.0],
            [x + 1.0, y, 0.0],
            [x + 1.0, y + 1.0, lift],
            [x, y + 1.0, 0.0],
        ]);
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| first + k);
        soup.faces.extend([[a, b, c], [a, c, d], [a, b, c], [a, a, a], [a, b, a], [c, d, a]]);
    }
    soup.face_class.resize(soup.faces.len(), 0);
    soup
}

#[test]
fn rays_through_corners_along_axes_and_of_odd_numbers_hit_as_without_trees() {
    let soup = folded_floor();
    let mut rng = ChaCha8Rng::seed_from_u64(47);
    let mut rays = Vec::new();
    for _ in 0..400 {
        let mut pick = || soup.vertices[rng.random_range(0..soup.vertices.len())];
        let (a, b) = (pick(), pick());
        // From a corner to another, through the middle of an edge, straight down and up, in the floor.
        let middle = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
        rays.push([a[0], a[1], a[2], b[0] - a[0], b[1] - a[1], b[2] - a[2]]);
        rays.push([3.5, 0.25, 7.0, middle[0] - 3.5, middle[1] - 0.25, middle[2] - 7.0]);
        rays.push([a[0], b[1], 5.0, 0.0, 0.0, -2.0]);
        rays.push([a[0] + 0.25, b[1] + 0.5, -5.0, -0.0, 0.0, 1.0]);
        rays.push([-12.0, a[1], 0.0, 1.0, 0.0, 0.0]);
        // A component whose inverse is no finite number, and a length that is nearly none.
        rays.push([a[0], b[1], 5.0, 1e-41, -1e-40, -1.0]);
        rays.push([a[0], b[1], 5.0, 1e-30, 0.0, -1e-25]);
    }
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, 1e20, -1e30, f32::MAX];
    for k in 0..6 {
        for number in odd {
            let mut ray = [0.25, 0.5, 5.0, 0.0, 0.0, -1.0];
            ray[k] = number;
            rays.push(ray);
        }
    }
    let tree = Arc::new(Bvh::build(&soup, 100.0));
    let here = Instance { tree: tree.clone(), ego_from_instance: Pose::IDENTITY, first_prim: 0 };
    let turned = Pose::new(DVec3::new(0.0, 1.0, -2.0), 0.1, 0.2, FRAC_PI_2);
    let faces = soup.faces.len() as u32;
    let there = Instance { tree: tree.clone(), ego_from_instance: turned, first_prim: faces };
    let moved = Pose::new(DVec3::new(0.5, -0.25, 0.125), 0.0, 0.0, 0.0);
    let beside = Instance { tree, ego_from_instance: moved, first_prim: 2 * faces };
    for things in [vec![here.clone()], vec![beside.clone()], vec![here, there, beside]] {
        let frame = Frame::new(things);
        for (range, t_max) in
            [(100.0, f32::INFINITY), (5.0, f32::INFINITY), (100.0, 2.5), (f32::MAX, f32::MAX)]
        {
            let met = same_as_without_trees(&frame, &rays, range, t_max);
            assert!(met > 300, "{met} of {} rays hit", rays.len());
        }
    }
}

#[test]
fn coordinates_whose_products_are_no_numbers_are_cast_by_the_reference() {
    let large = |at: f32| at * 1e18;
    let soup = folded_floor();
    let vertices = soup.vertices.iter().map(|v| v.map(large)).collect();
    let tree = Arc::new(Bvh::build(&TriangleSoup { vertices, ..soup }, 1e19));
    let rays: Vec<[f32; 6]> = (0..200_u8)
        .map(|k| [large(f32::from(k) * 0.1 - 9.3), large(0.3), large(9.0), 0.0, 1e-39, -1.0])
        .collect();
    let met = same_as_without_trees(&Frame::from(tree), &rays, f32::MAX, f32::INFINITY);
    assert!(met > 100, "{met} of {} rays hit", rays.len());
}

#[test]
fn hits_beyond_t_max_lengths_do_not_count() {
    let scene = RayScene::new(&wall());
    // The wall is half a length away.
    let ray = [[0.0, 0.2, 0.1, 4.0, 0.0, 0.0]];
    for (t_max, is_hit) in [(0.51, true), (0.49, false)] {
        assert_eq!(scene.closest_hits(&ray, 100.0, t_max)[0].is_hit(), is_hit);
        assert_eq!(scene.occluded(&ray, 100.0, t_max)[0], is_hit);
        assert_eq!(scene.counts(&ray, 100.0, t_max)[0], u32::from(is_hit));
    }
}

#[test]
fn many_rays_that_are_put_into_an_order_keep_their_hits() {
    let mut rng = ChaCha8Rng::seed_from_u64(57);
    let scene = RayScene::new(&crates(5500, &mut rng));
    let mut rays: Vec<[f32; 6]> =
        (0..40_000).map(|_| [0; 6].map(|_| rng.random_range(-40.0..40.0_f32))).collect();
    (rays[7], rays[8][0]) = ([0.0; 6], f32::NAN);
    let mut order = order::order_of(&rays, &scene).expect("rays at random have no order");
    let turn = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|ray| Vec3::from_slice(&rays[ray as usize][3..]).normalize());
        a.angle_between(b)
    };
    let mean = |order: &[u32]| {
        let turns = order.windows(2).map(|pair| turn(pair[0], pair[1]));
        turns.filter(|turn| turn.is_finite()).sum::<f32>() / order.len() as f32
    };
    let as_given: Vec<u32> = (0..40_000).collect();
    assert!(mean(&order) < 0.4 * mean(&as_given), "{} {}", mean(&order), mean(&as_given));
    order.sort_unstable();
    assert_eq!(order, as_given, "each ray once");
    let few = |rays: &[[f32; 6]]| scene.closest_hits(rays, 100.0, f32::INFINITY);
    let (hits, parts): (_, Vec<Hit>) = (few(&rays), rays.chunks(1000).flat_map(few).collect());
    assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 4000);
    let bits = |hits: &[Hit]| hits.iter().map(|h| (h.t.to_bits(), h.prim)).collect::<Vec<_>>();
    assert_eq!(bits(&hits), bits(&parts));
    // Rays of a scan have an order of their own.
    rays.iter_mut()
        .zip(0..)
        .for_each(|(ray, k)| ray[3..].copy_from_slice(&[1.0, k as f32 * 1e-5, 0.0]));
    assert_eq!(order::order_of(&rays, &scene), None);
}
