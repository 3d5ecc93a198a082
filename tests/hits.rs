//! Closest hits against all triangles in f64, by a test that shares nothing with ours.

use lidar_cast::bvh::{NO_HIT, Ray};

use crate::common::*;

/// Möller and Trumbore 1997 over every triangle, in f64: (t, prim, distance to the nearest edge in
/// barycentric units) of the closest hit.
fn oracle(soup: &TriangleSoup, origin: Vec3, direction: Vec3) -> Option<(f64, u32, f64)> {
    let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
    let mut best: Option<(f64, u32, f64)> = None;
    for prim in 0..soup.faces.len() as u32 {
        let [a, b, c] = soup.corners(prim).map(|v| Vec3::from(v).as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(e2);
        let det = e1.dot(p);
        if det == 0.0 {
            continue;
        }
        let s: DVec3 = o - a;
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = d.dot(q) / det;
        let t = e2.dot(q) / det;
        let edge = u.min(v).min(1.0 - u - v);
        if edge >= 0.0 && t > 0.0 && best.is_none_or(|(closest, ..)| t < closest) {
            best = Some((t, prim, edge));
        }
    }
    best
}

#[test]
fn closest_hits_agree_with_f64_brute_force() {
    let (mut hits, mut rays, mut grazing) = (0, 0, 0);
    for seed in 0..8 {
        let soup = random_soup(100 + seed, 200, 10.0);
        let bvh = Bvh::build(&soup, 50.0);
        let mut rng = rng(200 + seed);
        for _ in 0..1000 {
            let origin = random_vec(&mut rng, 12.0);
            let direction = random_vec(&mut rng, 1.0).normalize();
            let hit = bvh.closest_hit(&Ray::new(origin, direction, 50.0));
            let want = oracle(&soup, origin, direction);
            rays += 1;
            match want {
                Some((t, prim, edge)) if edge > 1e-4 => {
                    hits += 1;
                    assert_eq!(hit.prim, prim, "ray {origin} {direction}: t {t} and {}", hit.t);
                    assert!((f64::from(hit.t) - t).abs() < 1e-4 * (1.0 + t), "{} {t}", hit.t);
                }
                Some(_) => grazing += 1,
                None => assert_eq!(hit.prim, NO_HIT, "ray {origin} {direction}"),
            }
        }
    }
    assert!(hits * 4 > rays, "only {hits} of {rays} rays hit: the scene is trivial");
    assert!(grazing * 100 < rays, "{grazing} grazing rays went unchecked");
}

#[test]
fn the_tree_gives_the_bits_of_no_tree() {
    for seed in 0..4 {
        let soup = random_soup(300 + seed, 500, 10.0);
        let bvh = Bvh::build(&soup, 50.0);
        bvh.validate().unwrap();
        let mut rng = rng(400 + seed);
        for _ in 0..2000 {
            let origin = random_vec(&mut rng, 12.0);
            let ray = Ray::new(origin, random_vec(&mut rng, 1.0).normalize(), 50.0);
            let (tree, all) = (bvh.closest_hit(&ray), bvh.closest_hit_brute_force(&ray));
            assert_eq!((tree.t.to_bits(), tree.prim), (all.t.to_bits(), all.prim));
        }
    }
}

/// A square in the plane x = 5, twice, split along both diagonals: many equal distances.
fn doubled_square() -> TriangleSoup {
    let corners = [[5.0, -1.0, -1.0], [5.0, 1.0, -1.0], [5.0, 1.0, 1.0], [5.0, -1.0, 1.0]];
    let faces = vec![[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]];
    TriangleSoup { vertices: corners.to_vec(), faces, face_class: vec![0; 4] }
}

#[test]
fn ties_go_to_the_lowest_triangle() {
    let soup = doubled_square();
    let bvh = Bvh::build(&soup, 10.0);
    let towards = |y: f32, z: f32| {
        let target = Vec3::new(5.0, y, z);
        bvh.closest_hit(&Ray::new(Vec3::ZERO, target.normalize(), 10.0)).prim
    };
    assert_eq!(towards(0.5, -0.2), 0);
    assert_eq!(towards(-0.5, 0.2), 1);
    // On the diagonal that 0 and 1 share, and at the corners.
    assert_eq!(towards(0.0, 0.0), 0);
    let ahead = bvh.closest_hit(&Ray::new(Vec3::ZERO, Vec3::X, 10.0));
    assert_eq!(ahead, Hit { t: 5.0, prim: 0 });
}

#[test]
fn the_ends_of_a_ray_have_stated_results() {
    let bvh = Bvh::build(&doubled_square(), 10.0);
    let cast = |x: f32, direction: Vec3, t_max: f32| {
        bvh.closest_hit(&Ray::new(Vec3::new(x, 0.3, 0.1), direction, t_max))
    };
    // A range that ends on the surface reaches it; one that ends before does not.
    assert_eq!(cast(0.0, Vec3::X, 5.0), Hit { t: 5.0, prim: 0 });
    assert_eq!(cast(0.0, Vec3::X, 4.999), Hit { t: 4.999, prim: NO_HIT });
    // A ray that starts on a surface does not hit it, one that lies in it neither.
    assert_eq!(cast(5.0, Vec3::X, 10.0).prim, NO_HIT);
    assert_eq!(cast(5.0, -Vec3::X, 10.0).prim, NO_HIT);
    assert_eq!(cast(5.0, Vec3::Y, 10.0).prim, NO_HIT);
    // Behind the origin there is nothing to hit.
    assert_eq!(cast(6.0, Vec3::X, 10.0).prim, NO_HIT);
}

#[test]
fn degenerate_triangles_are_never_hit() {
    let mut soup = doubled_square();
    soup.vertices.push([3.0, 0.0, 0.0]);
    soup.faces.splice(0..0, [[4, 4, 4], [0, 2, 2], [0, 4, 4]]);
    soup.face_class = vec![0; 7];
    let bvh = Bvh::build(&soup, 10.0);
    bvh.validate().unwrap();
    assert_eq!(bvh.closest_hit(&Ray::new(Vec3::ZERO, Vec3::X, 10.0)), Hit { t: 5.0, prim: 3 });
}

#[test]
fn no_ray_leaks_through_a_closed_box() {
    // A cube of 12 triangles seen from inside: towards edges, corners and diagonals.
    let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { 2.0_f32 } else { -2.0 });
    let quads =
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let faces: Vec<[u32; 3]> =
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let soup = TriangleSoup {
        vertices: (0..8).map(corner).collect(),
        face_class: vec![0; faces.len()],
        faces,
    };
    let bvh = Bvh::build(&soup, 50.0);
    let mut rng = rng(7);
    for _ in 0..100_000 {
        let origin = random_vec(&mut rng, 1.5);
        // A point on a random edge or face diagonal of the cube.
        let [a, b, c] = soup.corners(rand::RngExt::random_range(&mut rng, 0..12));
        let along = rand::RngExt::random_range(&mut rng, 0.0_f32..=1.0);
        let ends = [[a, b], [b, c], [c, a], [a, a]];
        let [from, to] = ends[rand::RngExt::random_range(&mut rng, 0..4)];
        let target = Vec3::from(from).lerp(to.into(), along);
        let direction = (target - origin).normalize();
        let hit = bvh.closest_hit(&Ray::new(origin, direction, 50.0));
        assert!(hit.is_hit(), "leak from {origin} to {target}");
        assert!((hit.t - origin.distance(target)).abs() < 1e-4, "{} {target}", hit.t);
    }
}
