//! Bundles against single rays.

use glam::{DMat3, DVec3};
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::bundle::{Bundle, OUTSIDE};
use crate::bvh::major_axis;
use crate::cast::PACKET_RAYS;
use crate::psog::Roi;

fn small_roi() -> Roi {
    Roi::new([-1.0, -2.0, -0.5], [0.5, 0.25, 1.0], [4, 16, 2]).unwrap()
}

fn random_directions(rng: &mut ChaCha8Rng, count: usize) -> Vec<DVec3> {
    let mut random = || DVec3::from_array([0; 3].map(|_| rng.random_range(-1.0..1.0)));
    (0..count).map(|_| random().normalize_or(DVec3::X)).collect()
}

/// Points at faces included: distances that end on one, just before it and just behind it.
#[test]
fn voxels_are_those_of_the_hits_one_by_one() {
    let (roi, mut rng) = (small_roi(), ChaCha8Rng::seed_from_u64(3));
    let (mut inside, mut outside) = (0, 0);
    for round in 0..200 {
        let origin = DVec3::from_array([0; 3].map(|_| rng.random_range(-1.5..1.5)));
        let mut directions = random_directions(&mut rng, PACKET_RAYS);
        directions[..4].copy_from_slice(&[DVec3::X, DVec3::Y, DVec3::NEG_Z, DVec3::NEG_X]);
        let t: [f64; PACKET_RAYS] = std::array::from_fn(|lane| match lane {
            0..64 => rng.random_range(0.0..3.0),
            64 => 0.0,
            _ => {
                let (axis, steps) = (lane % 3, rng.random_range(0..=16));
                let face = roi.min()[axis] + f64::from(steps) * roi.voxel()[axis];
                let t = (face - origin[axis]) / directions[lane][axis] - crate::psog::PUSH;
                [t, t.next_down(), t.next_up()][round % 3]
            }
        });
        let mut voxels = [0; PACKET_RAYS];
        Bundle::new(directions.iter().copied()).voxels_of_hits(origin, &t, &roi, &mut voxels);
        for (lane, &voxel) in voxels.iter().enumerate() {
            let point = origin + directions[lane] * t[lane];
            let one = roi.voxel_of_hit(origin, point);
            assert_eq!((voxel != OUTSIDE).then_some(voxel.into()), one, "{point} from {origin}");
            if one.is_some() { inside += 1 } else { outside += 1 }
        }
    }
    assert!(inside > 3_000 && outside > 3_000, "{inside} {outside}");
}

#[test]
fn rays_are_told_apart_by_way_and_none_is_lost() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let turn = DMat3::from_rotation_z(0.3);
    for narrow in [true, false] {
        let mut directions = random_directions(&mut rng, 100);
        if narrow {
            directions
                .iter_mut()
                .for_each(|d| *d = (*d * 0.01 + DVec3::new(2.0, 1.0, 0.5)).normalize());
        }
        let mut bundle = Bundle::new([DVec3::X]);
        bundle.turn(&Bundle::new(directions.iter().copied()), &turn);
        let mut turned: Vec<DVec3> = directions.iter().map(|&d| turn * d).collect();
        let mut bundles = 0;
        bundle.each_way(|bundle, lanes| {
            bundles += 1;
            assert!(lanes.iter().zip(bundle.directions()).all(|(&l, d)| turn * directions[l] == d));
            let way = |d: DVec3| (major_axis(d.as_vec3()), d.as_vec3().signum());
            for d in bundle.directions() {
                assert_eq!(way(d), way(bundle.directions().next().unwrap()));
                turned.swap_remove(turned.iter().position(|&other| other == d).unwrap());
            }
        });
        assert!(turned.is_empty(), "{turned:?}");
        assert!(if narrow { bundles == 1 } else { (16..=24).contains(&bundles) }, "{bundles}");
    }
}

#[test]
fn the_reach_ends_where_the_last_ray_leaves_the_grid() {
    let roi = small_roi();
    let reach = |origin: [f64; 3], directions: &[DVec3]| {
        Bundle::new(directions.iter().copied()).reach(origin.into(), &roi)
    };
    assert_eq!(reach([0.0, 0.0, 0.5], &[DVec3::X]), 1.0);
    assert_eq!(reach([0.0, 0.0, 0.5], &[DVec3::X, DVec3::NEG_Y]), 2.0);
    assert_eq!(reach([-3.0, 0.0, 0.5], &[DVec3::X]), 4.0);
    assert_eq!(reach([-3.0, 0.0, 0.5], &[DVec3::NEG_X]), 0.0);
    assert_eq!(reach([1.0, 0.0, 0.5], &[DVec3::Z]), 0.0, "a face above is outside");
}
