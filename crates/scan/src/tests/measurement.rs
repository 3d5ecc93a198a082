//! Echoes of a pulse: power, threshold, noise, edges, weather.

use super::{bits, ideal, scan, scene};
use crate::conditions::Condition;
use crate::{NO_CLASS, Scan, Scanner, Scanning, Status};
use sightline_scene::scene::Scene;
use sightline_scene::vehicle::SensorPose;

/// A wall in front of the sensor, at a distance in metres.
fn wall(distance: f64) -> String {
    format!(
        r#""static": [{{ "class": "building", "box": {{ "min": [{distance}, -60, -60], "max": [{}, 60, 60] }} }}]"#,
        distance + 1.0
    )
}

/// Beams that all but face the wall.
const FORWARD: &str = r#"{ "channels": 40, "fov": [-0.5, 0.5], "azimuth": [-0.5, 0.5], "azimuth_steps": 100, "range": 200 }"#;

fn at_wall(distance: f64, response: &str, conditions: &[&str]) -> Scan {
    let scene = scene(&wall(distance), FORWARD, response);
    let conditions = conditions.iter().map(|text| text.parse::<Condition>().unwrap()).collect();
    let scanning = Scanning { conditions, seed: 5, ..Scanning::default() };
    from_origin(&scene, &scanning)
}

/// The first frame of a sensor in the origin.
fn from_origin(scene: &Scene, scanning: &Scanning) -> Scan {
    scan(scene, &[SensorPose::at(0.0, 0.0, 0.0)], scanning).swap_remove(0)
}

fn ranges(scan: &Scan, status: Status) -> Vec<f32> {
    let found = scan.returns.iter().filter(|beam| beam.status == status);
    found.map(|beam| beam.range).collect()
}

fn share(scan: &Scan, status: Status) -> f64 {
    ranges(scan, status).len() as f64 / scan.returns.len() as f64
}

#[test]
fn a_target_at_the_rated_range_of_its_reflectance_is_seen_half_of_the_time() {
    // Buildings reflect 0.41: as far as √4.1 times the rated range for 0.1.
    let rated = 30.0;
    let limit = rated * 4.1_f64.sqrt();
    let response = r#"{ "rated_range": 30, "divergence": [0, 0] }"#;
    let seen = |distance: f64| share(&at_wall(distance, response, &[]), Status::Hit);
    assert_eq!(seen(0.7 * limit), 1.0);
    assert_eq!(seen(1.3 * limit), 0.0);
    let half = seen(limit);
    // Four standard errors of 4000 draws; beams that do not quite face the wall count for little.
    assert!((half - 0.5).abs() < 0.04, "{half}");
    // One deviation of the threshold, 0.1 of the power: Φ(1) = 0.841.
    let more = seen(limit / 1.1_f64.sqrt());
    assert!((more - 0.841).abs() < 0.03, "{more}");
    let far = at_wall(1.3 * limit, response, &[]);
    assert_eq!(share(&far, Status::Lost), 1.0);
    assert!(far.returns.iter().all(|beam| beam.clean_class != NO_CLASS));
}

#[test]
fn a_scene_says_what_its_surfaces_reflect() {
    // Limits follow the square root of the reflectance, which is a tenth at the rated range.
    let response = r#"{ "rated_range": 30, "divergence": [0, 0], "softness": 0 }"#;
    let seen = |said: &str, own: &str, distance: f64| {
        let actor = format!(
            r#""reflectance": {{ {said} }},
               "actors": [{{ {own} "poses": [{{ "x": 0, "y": 0 }}, {{ "x": 0, "y": 0 }}, {{ "x": 0, "y": 0 }}],
                 "parts": [{{ "class": "vehicle",
                             "box": {{ "min": [{distance}, -60, -60], "max": [{}, 60, 60] }} }}] }}]"#,
            distance + 1.0
        );
        let scene = scene(&actor, FORWARD, response);
        share(&from_origin(&scene, &Scanning::default()), Status::Hit) > 0.5
    };
    for (said, own, reflectance) in [
        (r#""vehicle": 0.1"#, "", 0.1_f64),
        (r#""vehicle": 0.9"#, "", 0.9),
        ("", r#""reflectance": 0.4,"#, 0.4),
        (r#""vehicle": 0.9"#, r#""reflectance": 0.2,"#, 0.2),
    ] {
        let limit = 30.0 * (10.0 * reflectance).sqrt();
        assert!(seen(said, own, 0.97 * limit), "{said} {own}");
        assert!(!seen(said, own, 1.03 * limit), "{said} {own}");
    }
}

#[test]
fn range_noise_is_normal_and_three_times_as_wide_at_the_threshold() {
    let deviation = |distance: f64, rated: f64| {
        let response = format!(
            r#"{{ "rated_range": {rated}, "noise": 0.02, "divergence": [0, 0], "softness": 0 }}"#
        );
        let scan = at_wall(distance, &response, &[]);
        let clean =
            at_wall(distance, r#"{ "rated_range": 10000, "noise": 0, "divergence": [0, 0] }"#, &[]);
        let errors = scan.returns.iter().zip(&clean.returns);
        let mut errors: Vec<f64> = errors
            .filter(|(beam, _)| beam.status == Status::Hit)
            .map(|(beam, clean)| f64::from(beam.range - clean.range))
            .collect();
        let n = errors.len() as f64;
        assert!(n > 1000.0);
        let sigma = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        // Kolmogorov and Smirnov: the largest gap to the normal distribution.
        errors.sort_by(f64::total_cmp);
        let gap = errors.iter().enumerate().map(|(k, e)| {
            let expected = 0.5 * libm::erfc(-e / sigma / 2.0_f64.sqrt());
            (expected - (k as f64 + 0.5) / n).abs()
        });
        assert!(gap.fold(0.0, f64::max) < 1.63 / n.sqrt(), "not normal");
        sigma
    };
    let near = deviation(10.0, 1000.0);
    assert!((near - 0.02).abs() < 0.001, "{near}");
    let far = deviation(60.0, 60.0 / 4.1_f64.sqrt() * 1.0005);
    assert!((far - 0.06).abs() < 0.004, "{far}");
}

#[test]
fn a_wide_beam_at_the_edge_of_a_board_sees_both_and_elsewhere_one() {
    // The board's edge at y = 0 fills one half of the beam in the middle.
    let things = r#""static": [
        { "class": "building", "box": { "min": [40, -60, -60], "max": [41, 60, 60] } },
        { "class": "traffic_sign", "box": { "min": [15, 0.001, -5], "max": [15.02, 30, 5] } }]"#;
    let lidar = r#"{ "channels": 3, "fov": [-2, 2], "azimuth": [-4, 4], "azimuth_steps": 9, "range": 100 }"#;
    let returns = |echoes: &str, width: f64| {
        let response = format!(
            r#"{{ "divergence": [{width}, {width}], "echoes": "{echoes}", "noise": 0, "rated_range": 10000 }}"#
        );
        let scene = scene(things, lidar, &response);
        from_origin(&scene, &Scanning::default()).returns
    };
    let range_in_the_middle = |echoes: &str, width: f64| {
        let middle = returns(echoes, width);
        let middle = middle.iter().filter(|beam| beam.channel == 1 && beam.column == 4);
        middle.map(|beam| (beam.range.round() as u32, beam.status)).collect::<Vec<_>>()
    };
    // The middle of the beam passes beside the board.
    assert_eq!(range_in_the_middle("strongest", 0.0), [(40, Status::Hit)]);
    // Two rays of the rim meet the board, the rest the wall: 0.2·0.39/15² against 0.8·0.41/40².
    assert_eq!(range_in_the_middle("strongest", 0.003), [(15, Status::Hit)]);
    assert_eq!(range_in_the_middle("last", 0.003), [(40, Status::Hit)]);
    assert_eq!(range_in_the_middle("dual", 0.003), [(15, Status::Hit), (40, Status::Second)]);
    for (wide, thin) in returns("strongest", 0.003).iter().zip(&returns("strongest", 0.0)) {
        if wide.column != 4 {
            assert_eq!((wide.range, wide.class), (thin.range, thin.class), "away from the edge");
        }
    }
}

#[test]
fn edges_are_seen_as_far_as_a_beam_is_wide_however_fine_the_steps() {
    // A board's edge at y = 0 before a wall; the rim's outermost rays are 1.3 mrad off the middle.
    let things = r#""static": [
        { "class": "building", "box": { "min": [25, -8, -8], "max": [25.1, 8, 8] } },
        { "class": "traffic_sign", "box": { "min": [20, 0, -5], "max": [20.05, 5, 5] } }]"#;
    let both = |steps: u32| {
        let response = r#"{ "divergence": [0.003, 0.0015], "echoes": "dual", "noise": 0, "rated_range": 500 }"#;
        let lidar = format!(
            r#"{{ "channels": 2, "fov": [-0.01, 0.01], "azimuth": [-0.2, 0.2], "azimuth_steps": {steps}, "range": 100 }}"#
        );
        let scene = scene(things, &lidar, response);
        ranges(&from_origin(&scene, &Scanning::default()), Status::Second).len()
    };
    // 1.3 mrad are 7 steps of 0.01 degrees and 74 of 0.001, on both sides of the edge, in two channels. Beside the
    // board the wall is the strongest echo as well as the last: the board comes second.
    let fine = both(41);
    assert!((28..=34).contains(&fine), "{fine}");
    let finer = both(401);
    assert!((280..=306).contains(&finer), "{finer}");
}

#[test]
fn fog_takes_dark_targets_first_and_no_fog_changes_no_byte() {
    let response = r#"{ "rated_range": 60, "divergence": [0.003, 0.0015] }"#;
    let at = |distance: f64, conditions: &[&str]| at_wall(distance, response, conditions);
    let clear = at(40.0, &[]);
    assert_eq!(share(&clear, Status::Hit), 1.0);
    assert_eq!(bits(std::slice::from_ref(&clear)), bits(&[at(40.0, &["fog:mor=inf"])]));
    // From thin to dense: fewer hits, and never more.
    let hits: Vec<f64> = [1000.0, 300.0, 100.0, 50.0, 20.0]
        .map(|mor| share(&at(40.0, &[&format!("fog:mor={mor}")]), Status::Hit))
        .to_vec();
    assert!(hits.windows(2).all(|pair| pair[1] <= pair[0]), "{hits:?}");
    assert!(hits[0] == 1.0 && hits[4] == 0.0, "{hits:?}");
    // A sensor that sees far sees the fog itself: its echo is as weak as a target's of reflectance 0.3 at 36 m.
    let dense = at_wall(40.0, r#"{ "rated_range": 300 }"#, &["fog:mor=20"]);
    for beam in dense.returns.iter().filter(|beam| beam.status == Status::Fog) {
        assert!(beam.range < 40.0 && beam.class == NO_CLASS && beam.clean_class != NO_CLASS);
    }
    let count = ranges(&dense, Status::Fog).len();
    assert!(count > 100, "{count}");
}

#[test]
fn snow_sends_back_flakes_and_weakens_what_is_behind() {
    let response = r#"{ "rated_range": 60, "divergence": [0.003, 0.0015] }"#;
    let snow = at_wall(30.0, response, &["snow:rate=2.5,speed=1.6"]);
    let flakes = ranges(&snow, Status::Snow);
    assert!(!flakes.is_empty() && flakes.iter().all(|range| *range < 30.2), "{flakes:?}");
    let clear = at_wall(30.0, response, &[]);
    let mean = |scan: &Scan| {
        let hits = || scan.returns.iter().filter(|beam| beam.status == Status::Hit);
        hits().map(|beam| f64::from(beam.intensity)).sum::<f64>() / hits().count() as f64
    };
    assert!(mean(&snow) < 0.99 * mean(&clear));
}

#[test]
fn water_darkens_the_ground_and_leaves_the_walls() {
    let things = r#""static": [
        { "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } },
        { "class": "building", "box": { "min": [10, -60, 0], "max": [11, 60, 20] } }]"#;
    let lidar = r#"{ "channels": 16, "fov": [-25, 10], "azimuth_steps": 60, "range": 100 }"#;
    let scene = scene(things, lidar, "{}");
    let pose = [SensorPose::at(0.0, 0.0, 2.0)];
    let dry = scan(&scene, &pose, &Scanning::default()).swap_remove(0);
    let conditions = vec!["wet:water=1.2".parse().unwrap()];
    let wet = scan(&scene, &pose, &Scanning { conditions, ..Scanning::default() }).swap_remove(0);
    let road = scene.classes().iter().position(|name| name == "road").unwrap() as u16;
    let (mut darker, mut lost) = (0, 0);
    for (dry, wet) in dry.returns.iter().zip(&wet.returns) {
        if dry.clean_class == road && dry.status == Status::Hit {
            lost += u32::from(wet.status == Status::Lost);
            darker += u32::from(wet.status == Status::Hit && wet.intensity < dry.intensity);
        } else if dry.status == Status::Hit {
            assert_eq!(dry.range, wet.range);
        }
    }
    assert!(darker > 50 && lost > 10, "{darker} {lost}");
}

#[test]
fn crosstalk_puts_a_share_of_the_points_in_front_of_what_they_met() {
    let scan = at_wall(30.0, "{}", &["crosstalk:share=0.1"]);
    let wrong = share(&scan, Status::Crosstalk);
    assert!((wrong - 0.1).abs() < 0.02, "{wrong}");
    for beam in scan.returns.iter().filter(|beam| beam.status == Status::Crosstalk) {
        assert!(beam.range < 30.2 && beam.class == NO_CLASS && beam.clean_class != NO_CLASS);
        assert!((beam.position[0] / beam.range - 1.0).abs() < 1e-3, "on its beam");
    }
}

#[test]
fn static_vehicles_are_as_dark_as_vehicles_are_on_the_mean_at_any_seed() {
    let things = wall(30.0).replace("building", "vehicle");
    let scene =
        scene(&things, FORWARD, r#"{ "divergence": [0, 0], "rated_range": 10000, "noise": 0 }"#);
    let conditions = vec!["echo:ratio=0.6".parse().unwrap()];
    // 0.225 of clear air is the mean of three dark ones of ten.
    let mean = 0.6 * 0.05 + 0.4 * 0.225;
    for seed in 0..5 {
        let scanning = Scanning { seed, conditions: conditions.clone(), ..Scanning::default() };
        let scan = from_origin(&scene, &scanning);
        let brightest = scan.returns.iter().map(|beam| beam.intensity).fold(0.0, f32::max);
        assert!((f64::from(brightest) - mean).abs() < 1e-4, "seed {seed}: {brightest}");
    }
}

#[test]
fn conditions_of_beams_and_ideal_scans_do_not_go_together() {
    let scene = scene(&wall(10.0), FORWARD, "{}");
    let placement = super::placement(&[SensorPose::at(0.0, 0.0, 0.0)]);
    let check = |condition: &str| {
        let conditions = vec![condition.parse().unwrap()];
        Scanner::check(&scene, &placement, &Scanning { conditions, ..ideal() })
    };
    assert_begins!(check("snow:rate=1").unwrap_err(), "the condition `snow:rate=1` acts on beams");
}

#[test]
fn rain_shortens_the_range_to_a_wall_and_sends_back_drops() {
    // Rated 60 m for ρ = 0.1: the wall of 0.41 is seen half of the time where 0.41·e^(−αr)/r² = 0.1/60².
    let response = r#"{ "rated_range": 60, "divergence": [0.003, 0.0015], "softness": 0.02, "echoes": "last" }"#;
    let seen = |range: f64| share(&at_wall(range, response, &["rain:rate=100"]), Status::Hit);
    let alpha = std::f64::consts::PI * 8e-3 / (4.1 * 100_f64.powf(-0.21)).powi(3);
    let left = |r: f64| 0.41 * (-alpha * r).exp() / (r * r) * 36_000.0;
    let limit = (1..200).map(f64::from).find(|&r| left(r) < 1.0).unwrap();
    assert!((80.0..100.0).contains(&limit), "of 121 m in clear air: {limit}");
    let [near, far] = [0.85, 1.15].map(|share| seen(share * limit));
    assert!(near > 0.8 && far < 0.2, "{near} {far}");
    // A sensor that sees far is hit by near drops.
    let far = at_wall(100.0, r#"{ "rated_range": 1000 }"#, &["rain:rate=100"]);
    let drops = ranges(&far, Status::Rain);
    assert!(drops.len() > 20 && drops.iter().all(|range| *range < 100.2), "{}", drops.len());
    let none = at_wall(30.0, response, &["rain:rate=0"]);
    assert_eq!(bits(&[none]), bits(&[at_wall(30.0, response, &[])]));
}

#[test]
fn nothing_is_left_of_a_sensor_that_sees_no_closer_than_the_wall() {
    let scan = at_wall(10.0, r#"{ "min_range": 12 }"#, &[]);
    assert_eq!(share(&scan, Status::Lost), 1.0);
    let scene = scene(&wall(10.0), FORWARD, r#"{ "min_range": 12 }"#);
    assert_eq!(share(&from_origin(&scene, &ideal()), Status::Hit), 1.0);
}
