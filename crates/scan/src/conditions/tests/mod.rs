//! Acceptance of the conditions: closed forms, published figures, and brute force.

mod fog;
mod snow;

use super::*;

/// Greatest distance between the distribution of a sample and one in closed form (Kolmogorov and Smirnov).
pub(super) fn ks(sample: &mut [f64], cumulative: impl Fn(f64) -> f64) -> f64 {
    sample.sort_by(f64::total_cmp);
    let n = sample.len() as f64;
    let gap = |(k, &x): (usize, &f64)| {
        let p = cumulative(x);
        (p - k as f64 / n).abs().max(((k + 1) as f64 / n - p).abs())
    };
    sample.iter().enumerate().map(gap).fold(0.0, f64::max)
}

/// Random numbers from 0 to below 1 by another generator than the program's.
pub(super) fn uniform(seed: u64) -> impl FnMut() -> f64 {
    use rand::{RngExt, SeedableRng};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    move || random.random::<f64>()
}

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

fn read(text: &str) -> Result<Condition, ScanError> {
    text.parse()
}

#[test]
fn what_is_written_out_reads_as_the_same() {
    for text in [
        "fog", "fog:mor=50", "fog:mor=inf,gain=0", "wet:water=1.0", "rain", "rain:rate=12.5",
        "blur", "crosstalk:share=0.01", "echo:ratio=0.85", "snow:level=light",
    ] {
        let condition = read(text).unwrap();
        assert_eq!(read(&condition.to_string()), Ok(condition), "{text} → {condition}");
    }
    let fog = read("fog:level=heavy").unwrap();
    assert_eq!(
        (fog.kind(), fog.value("mor"), fog.value("rate")),
        (ConditionKind::Fog, Some(50.0), None)
    );
    assert_eq!(read("rain:level=heavy").unwrap().to_string(), "rain:rate=25");
    assert_eq!(read("fog").unwrap().to_string(), "fog:mor=200");
    assert_eq!(read("fog:gain=2").unwrap().to_string(), "fog:mor=200,gain=2");
    assert_eq!(read("snow:rate=0.1,level=heavy").unwrap().to_string(), "snow:rate=0.1");
}

#[test]
fn what_cannot_be_is_said_in_a_sentence() {
    let table = [
        (
            "",
            "there is no condition ``; known are fog, wet, snow, rain, blur, crosstalk and echo, with values behind \
             a colon, as in fog:mor=200",
        ),
        (
            "fog=200",
            "there is no condition `fog=200`; known are fog, wet, snow, rain, blur, crosstalk and echo, with values \
             behind a colon, as in fog:mor=200",
        ),
        ("fog:50", "`50` in the condition `fog:50` is no KEY=VALUE; fog takes level, mor, gain"),
        ("fog:", "`` in the condition `fog:` is no KEY=VALUE; fog takes level, mor, gain"),
        ("fog:mor=0.5", "`mor=0.5` of fog: wanted is a number from 1 m on"),
        ("fog:mor=-50", "`mor=-50` of fog: wanted is a number from 1 m on"),
        ("fog:mor=NaN", "`mor=NaN` of fog: wanted is a number from 1 m on"),
        ("wet:water=1e9", "`water=1e9` of wet: wanted is a number from 0 to 100 mm"),
        ("echo:ratio=much", "`ratio=much` of echo: wanted is a number from 0 to 1"),
        ("fog:beta=0.05", "fog has no key `beta`; it takes level, mor, gain"),
        ("snow:depth=1", "snow has no key `depth`; it takes level, rate, speed"),
        ("fog:mor=50,mor=60", "the condition `fog:mor=50,mor=60` gives `mor` twice; give it once"),
        (
            "snow:mode=robo3d",
            "snow has no key `mode`; it takes level, rate, speed; for the corruptions of Robo3D run its own \
             program on a set of `--layout semantickitti` (docs/scans.md)",
        ),
        ("rain:rate=-1", "`rate=-1` of rain: wanted is a number from 0 to 200 mm/h"),
        ("fog:level=dense", "`level=dense` of fog: `dense` is not one of light, moderate, heavy"),
    ];
    for (text, wanted) in table {
        assert_eq!(read(text).unwrap_err().to_string(), wanted);
    }
}

#[test]
fn a_condition_may_stand_once() {
    let all = ["fog", "snow", "rain"].map(|text| read(text).unwrap());
    let found = weather(&all).unwrap();
    assert!(found.fog.is_some() && found.snow.is_some() && found.wet.is_none());
    assert_eq!(found.falls().count(), 2, "snow and rain");
    let twice = ["fog", "fog:mor=50"].map(|text| read(text).unwrap());
    let words = weather(&twice).unwrap_err().to_string();
    assert_eq!(words, "the condition fog is given twice; give it once");
}
