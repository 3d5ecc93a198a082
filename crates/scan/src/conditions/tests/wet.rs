//! Wet ground: Fresnel's equations and the power that is left.

use crate::conditions::condition::mirrored;
use crate::conditions::{WetGround, holds_water};

#[test]
fn water_mirrors_as_fresnel_says() {
    let [s, p] = mirrored(1.0);
    assert!((s - 0.0200).abs() < 1e-4 && (p - s).abs() < 1e-12, "{s} {p}");
    let brewster = (1.33_f64 / 1.0003).atan();
    assert!((brewster.to_degrees() - 53.06).abs() < 0.01);
    assert!(mirrored(brewster.cos())[1] < 1e-20);
    // Transmitted share from the amplitudes: T = (n₂ cos θ₂ / n₁ cos θ₁)·t².
    for degrees in 0..90 {
        let cos = f64::from(degrees).to_radians().cos();
        let (n1, n2) = (1.0003, 1.33);
        let below = (1.0 - (1.0 - cos * cos) * (n1 / n2) * (n1 / n2)).sqrt();
        let s = 2.0 * n1 * cos / (n1 * cos + n2 * below);
        let p = 2.0 * n1 * cos / (n2 * cos + n1 * below);
        for (t, r) in [s, p].into_iter().zip(mirrored(cos)) {
            assert!((n2 * below / (n1 * cos) * t * t + r - 1.0).abs() < 1e-12, "{degrees}°");
        }
    }
}

#[test]
fn a_full_film_leaves_the_power_that_was_worked_out() {
    let film = WetGround::new(1.2);
    for (height, wanted) in [(2.2, [0.86, 0.56, 0.26, 0.09]), (2.8, [0.92, 0.68, 0.35, 0.14])] {
        for (range, wanted) in [5.0, 10.0, 20.0, 40.0].into_iter().zip(wanted) {
            let left = film.reflectance(1.0 / 15.0, height / range) * 15.0;
            assert!((left - wanted).abs() < 0.0051, "{height} m up, {range} m: {left}");
        }
    }
}

#[test]
fn dry_ground_is_clean_and_water_only_takes() {
    for cos in [0.01, 0.1, 0.5, 1.0] {
        assert_eq!(WetGround::new(0.0).reflectance(0.26, cos), 0.26);
        let depths = [0.0, 0.2, 0.6, 1.0, 1.2].map(|d| WetGround::new(d).reflectance(0.26, cos));
        assert!(depths.windows(2).all(|pair| pair[1] < pair[0]), "{depths:?}");
        let deeper = WetGround::new(5.0).reflectance(0.26, cos);
        assert_eq!(deeper, depths[4], "from a full film on");
    }
    // The farther, the more grazing, the less.
    let film = WetGround::new(1.0);
    let left = [2.5, 5.0, 10.0, 20.0, 40.0].map(|r| film.reflectance(0.26, 2.2 / r));
    assert!(left.windows(2).all(|pair| pair[1] < pair[0]), "{left:?}");
}

#[test]
fn water_stands_on_roads_and_not_on_grass() {
    assert!(["road", "lane-marking", "sidewalk", "ground", "parking"].into_iter().all(holds_water));
    assert!(
        !["terrain", "vegetation", "building", "bridge", "vehicle"].into_iter().any(holds_water)
    );
}
