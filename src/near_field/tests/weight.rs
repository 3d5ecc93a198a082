//! Which voxels weigh more, and that the weight can be taken off again.

use super::{problem, scene};
use crate::near_field::{MOST_WEIGHT, NearFieldError, unweighted, weighted};
use crate::problem::{Content, OccupiedVoxel};
use crate::psog::fixed;
use glam::DVec3;

#[test]
fn ground_outside_the_body_and_within_ten_metres_gains_the_weight() {
    let scene = scene("");
    let problem = problem(&scene);
    // Middle of a voxel each: beside, under the body, at 9.8 m, at 10.2 m, and a house beside.
    let points =
        [[0.2, 3.0, 0.1], [0.2, 0.2, 0.1], [11.8, 0.2, 0.1], [12.2, 0.2, 0.1], [0.2, -3.0, 0.1]];
    let mut voxels: Vec<(u32, usize)> = points
        .into_iter()
        .zip(0..)
        .map(|(p, k)| (problem.roi().voxel_of(DVec3::from(p)).unwrap() as u32, k))
        .collect();
    voxels.sort_unstable();
    let occupied = |more: f64| -> Vec<OccupiedVoxel> {
        let entropy = |k: usize| fixed(0.5 + if [0, 2].contains(&k) { more } else { 0.0 });
        let voxel =
            |&(index, k): &(u32, usize)| OccupiedVoxel { index, entropy: [entropy(k), 7, 9, 11] };
        voxels.iter().map(voxel).collect()
    };
    let of_class = |is: fn(usize) -> bool| -> Vec<u32> {
        voxels.iter().filter(|(_, k)| is(*k)).map(|(index, _)| *index).collect()
    };
    let by_class = [of_class(|k| k < 4), of_class(|k| k == 4)];
    let content = |more: f64| {
        let names = ["road", "building"].map(str::to_owned).to_vec();
        Content::new(names, occupied(more), &by_class, true)
    };
    let plain = problem.with_content(content(0.0));
    let heavy = weighted(&scene, plain.clone(), 0.25).unwrap();
    assert_eq!(*heavy.content(), content(0.25));
    let back = unweighted(&scene, heavy, 0.25).unwrap();
    assert_eq!(back.content(), plain.content());
    for nats in [-0.1, f64::NAN, MOST_WEIGHT + 1.0] {
        let refused = weighted(&scene, plain.clone(), nats);
        assert!(matches!(refused, Err(NearFieldError::Weight { .. })), "{nats}");
    }
}
