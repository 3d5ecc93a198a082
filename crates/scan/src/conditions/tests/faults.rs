//! Crosstalk and incomplete echoes of beams.

use super::{ks, uniform};
use crate::conditions::{IncompleteEcho, false_range};

#[test]
fn false_ranges_are_even_between_the_least_and_the_true_one() {
    let mut draw = uniform(1);
    let mut ranges: Vec<f64> = (0..4000).map(|_| false_range(1.0, 41.0, draw())).collect();
    assert!(ks(&mut ranges, |r| (r - 1.0) / 40.0) < 1.63 / 4000_f64.sqrt());
    assert_eq!(false_range(1.0, 0.5, 0.7), 1.0, "none before the sensor sees anything");
}

#[test]
fn vehicles_are_dark_by_object_and_stay_dark_at_greater_ratios() {
    let dark = |ratio: f64| -> Vec<bool> {
        let echo = IncompleteEcho::new(ratio);
        (0..100).map(|k| echo.reflectance(0.3, Some(f64::from(k) / 100.0)) < 0.3).collect()
    };
    let (some, more) = (dark(0.75), dark(0.85));
    assert_eq!(some.iter().filter(|dark| **dark).count(), 75);
    assert_eq!(more.iter().filter(|dark| **dark).count(), 85);
    assert!(some.iter().zip(&more).all(|(some, more)| !some || *more));
    assert!(dark(0.0).iter().all(|dark| !dark));
    assert_eq!(IncompleteEcho::new(1.0).reflectance(0.02, Some(0.5)), 0.02, "none gets brighter");
    let together = IncompleteEcho::new(0.6).reflectance(0.3, None);
    assert!((together - (0.6 * 0.05 + 0.4 * 0.3)).abs() < 1e-12, "{together}: the mean of all");
}
