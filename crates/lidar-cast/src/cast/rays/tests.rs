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
fn without_trees(frame: &Frame, ray: &[f32; 6], range: f32) -> (Hit, u32) {
    let at = |k: usize| DVec3::from([0, 1, 2].map(|axis| f64::from(ray[k + axis])));
    let (origin, length) = (at(0), at(3).length());
    let (mut closest, mut count) = (Hit::none(range), 0);
    for instance in frame.instances() {
        let from_ego = instance.ego_from_instance.inverse();
        let unit = from_ego.rotation * (at(3) / length);
        let ray = Ray::new(from_ego.apply(origin).as_vec3(), unit.as_vec3(), range);
        for triangle in &instance.tree.triangles {
            let mut own = Hit::none(range);
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

#[test]
fn hits_under_the_tree_of_instances_are_those_of_a_loop_over_all_triangles() {
    let mut rng = ChaCha8Rng::seed_from_u64(45);
    for count in [1, 2, 16, 17, 300] {
        let frame = crates(count, &mut rng);
        let scene = RayScene::new(&frame);
        let rays: Vec<[f32; 6]> = (0..4000)
            .map(|k| {
                let spread = if k % 2 == 0 { 40.0 } else { 2000.0 };
                let from: [f32; 3] = std::array::from_fn(|_| rng.random_range(-spread..spread));
                let to: [f32; 3] = std::array::from_fn(|_| rng.random_range(-30.0..30.0));
                let to = [0, 1, 2].map(|axis| to[axis] - from[axis]);
                [from[0], from[1], from[2], to[0], to[1], to[2]]
            })
            .collect();
        let (hits, counts) = (
            scene.closest_hits(&rays, 3000.0, f32::INFINITY),
            scene.counts(&rays, 3000.0, f32::INFINITY),
        );
        let any = scene.occluded(&rays, 3000.0, f32::INFINITY);
        let mut met = 0;
        for (k, ray) in rays.iter().enumerate() {
            let (hit, number) = without_trees(&frame, ray, 3000.0);
            assert_eq!((hits[k].t.to_bits(), hits[k].prim), (hit.t.to_bits(), hit.prim), "{ray:?}");
            assert_eq!((counts[k], any[k]), (number, hit.is_hit()), "{ray:?}");
            met += u32::from(hit.is_hit());
        }
        assert!(count < 300 || met > 400, "{met} of {} rays hit", rays.len());
    }
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
