//! The voxel grid.

use glam::DVec3;
use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::small_roi;
use crate::psog::{GridError, Roi};

#[test]
fn linear_index_is_c_order_and_turns_back() {
    let roi = small_roi();
    assert_eq!(roi.voxel_count(), 128);
    assert_eq!(roi.linear([2, 3, 1]), (2 * 16 + 3) * 2 + 1);
    for linear in 0..roi.voxel_count() {
        assert_eq!(roi.linear(roi.coords(linear)), linear);
    }
    assert_eq!(roi.coords(127), [3, 15, 1]);
    assert_eq!(roi.max(), [1.0, 2.0, 1.5]);
}

#[test]
fn boxes_are_half_open() {
    let roi = small_roi();
    let at = |x, y, z| roi.voxel_of(DVec3::new(x, y, z)).map(|v| roi.coords(v));
    assert_eq!(at(-1.0, -2.0, -0.5), Some([0, 0, 0]));
    assert_eq!(at(-0.5, -1.75, 0.5), Some([1, 1, 1]));
    assert_eq!(
        at((-0.5_f64).next_down(), (-1.75_f64).next_down(), 0.5_f64.next_down()),
        Some([0, 0, 0])
    );
    assert_eq!(at(1.0, 0.0, 0.0), None);
    assert_eq!(at(0.0, 2.0, 0.0), None);
    assert_eq!(at(0.0, 0.0, 1.5), None);
    assert_eq!(at((-1.0_f64).next_up(), -2.0, -0.5), Some([0, 0, 0]));
    assert_eq!(at((-1.0_f64).next_down(), -2.0, -0.5), None);
    assert_eq!(at(f64::NAN, 0.0, 0.0), None);
    assert_eq!(at(f64::INFINITY, 0.0, 0.0), None);
}

/// −40 + 7·0.2 lies on a face, but (−38.6 − −40)/0.2 rounds to 6.999…: the face decides.
#[test]
fn faces_decide_where_division_rounds() {
    let roi = Roi::new([-40.0; 3], [0.2; 3], [400; 3]).unwrap();
    let mut divided_wrong = 0;
    for i in 0..400 {
        let face = -40.0 + f64::from(i) * 0.2;
        divided_wrong += u32::from((face + 40.0) / 0.2 < f64::from(i));
        let voxel = roi.voxel_of(DVec3::splat(face)).unwrap();
        assert_eq!(roi.coords(voxel), [i; 3], "face {i}");
        if i > 0 {
            let voxel = roi.voxel_of(DVec3::splat(face.next_down())).unwrap();
            assert_eq!(roi.coords(voxel), [i - 1; 3], "below face {i}");
        }
    }
    assert!(divided_wrong > 0, "the trap is not in this grid");
}

#[test]
fn a_point_lies_in_the_box_of_its_voxel() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let roi = Roi::new([-3.3, 0.1, 1e3], [0.1, 0.15, 0.2], [37, 11, 5]).unwrap();
    let (min, voxel, max) = (roi.min(), roi.voxel(), roi.max());
    for _ in 0..10_000 {
        let p: [f64; 3] =
            std::array::from_fn(|a| min[a] + (max[a] - min[a]) * rng.random_range(-0.1..1.1));
        let inside = (0..3).all(|a| p[a] >= min[a] && p[a] < max[a]);
        let found = roi.voxel_of(p.into());
        assert_eq!(found.is_some(), inside);
        if let Some(found) = found {
            let coords = roi.coords(found);
            for a in 0..3 {
                let [below, above] = [0, 1].map(|up| min[a] + f64::from(coords[a] + up) * voxel[a]);
                assert!(below <= p[a] && p[a] < above);
            }
        }
    }
}

/// A road at z = 0.5, a voxel face, seen from above and from below.
#[test]
fn a_hit_is_pushed_along_its_beam() {
    let roi = small_roi();
    let hit = |origin: [f64; 3], point: [f64; 3]| {
        roi.voxel_of_hit(origin.into(), point.into()).map(|v| roi.coords(v)[2])
    };
    let road = [0.1, 0.1, 0.5];
    assert_eq!(hit([0.1, 0.1, 1.4], road), Some(0));
    assert_eq!(hit([0.1, 0.1, -0.4], road), Some(1));
    // A millimetre, no more: 0.9 mm above the face ends below it, 1.1 mm does not.
    assert_eq!(hit([0.1, 0.1, 1.4], [0.1, 0.1, 0.5009]), Some(0));
    assert_eq!(hit([0.1, 0.1, 1.4], [0.1, 0.1, 0.5011]), Some(1));
    assert_eq!(hit(road, road), Some(1), "a point at its own origin stays");
}

#[test]
fn bounds_of_a_scene_become_a_shape() {
    let roi = Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [0.2; 3]).unwrap();
    assert_eq!(roi.shape(), [400, 400, 30]);
    let roi = Roi::from_bounds([0.0; 3], [40.0, 40.0, 6.0], [0.1, 0.15, 0.2]).unwrap();
    assert_eq!(roi.shape(), [400, 267, 30], "the last voxel reaches past the end");
}

#[test]
fn bad_grids_are_refused() {
    let new = Roi::new;
    let (m, v, s) = ([0.0; 3], [0.2; 3], [10; 3]);
    let cases = [
        (new([0.0, f64::NAN, 0.0], v, s), "roi_min along y is NaN; give a finite number of metres"),
        (new(m, [0.2, 0.2, f64::INFINITY], s), "voxel along z is inf"),
        (
            new(m, [-0.2, 0.2, 0.2], s),
            "voxel along x is -0.2 m; give an edge above 0, at most 1000000 m",
        ),
        (new(m, [0.0, 0.2, 0.2], s), "voxel along x is 0 m"),
        (new(m, v, [10, 0, 10]), "shape along y is 0"),
        (new(m, v, [1 << 25, 1, 1]), "shape along x is 33554432 voxels, at most 16777216 fit"),
        (new(m, v, [2048, 2048, 513]), "the grid has 2151677952 voxels, at most 2147483648 fit"),
        (new([1e16, 0.0, 0.0], v, s), "voxel along x is 0.2 m, too fine for coordinates near 1"),
        (
            new(m, [2e6, 1.0, 1.0], s),
            "voxel along x is 2000000 m; give an edge above 0, at most 1000000 m",
        ),
        (
            Roi::from_bounds([0.0; 3], [1.0, -1.0, 1.0], v),
            "the region of interest ends at -1 m along y, before or where it begins (0 m)",
        ),
        (Roi::from_bounds([0.0; 3], [1e9, 1.0, 1.0], v), "shape along x is 5000000000 voxels"),
        (Roi::from_bounds([0.0; 3], [1.0; 3], [0.0; 3]), "voxel along x is 0 m"),
    ];
    for (got, wanted) in cases {
        let message = got.map_err(|e: GridError| e.to_string()).unwrap_err();
        assert!(message.starts_with(wanted), "{message}\n  wanted {wanted}");
    }
    assert!(new(m, v, [2048, 2048, 512]).is_ok(), "2³¹ voxels fit");
}
