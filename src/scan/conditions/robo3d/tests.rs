//! Acceptance of the published rules: their ranges, densities, shares and counts.

use std::sync::Arc;

use super::cloud::Draws;
use super::fog::{ALPHAS, Rule};
use super::wedge::{self, discs};
use super::{Corruptions, wet};
use crate::geom::Pose;
use crate::scan::conditions::snow_law::Balls;
use crate::scan::conditions::specs::Kind;
use crate::scan::conditions::tests::{ks, uniform};
use crate::scan::conditions::{Condition, sort};
use crate::scan::{NO_CLASS, NO_INSTANCE, Return, Scan, ScanLidar, Status, TrackedBox};
use crate::scene::ActorKind;

const CLASSES: [&str; 4] = ["road", "vehicle", "building", "pedestrian"];
const ROAD: u16 = 0;
const VEHICLE: u16 = 1;
const BUILDING: u16 = 2;
const HEIGHT: f64 = 2.2;

/// A scan of a LiDAR above the origin with a point for each range: on a class, with an incidence.
fn scan(points: impl Iterator<Item = (f64, u16, f64)>) -> Scan {
    let lidar = Pose::new(glam::DVec3::new(0.0, 0.0, HEIGHT), 0.0, 0.0, 0.0);
    let point = |(k, (range, class, incidence)): (usize, (f64, u16, f64))| {
        let azimuth = k as f64 * 1e-3;
        let down = if class == ROAD { (HEIGHT / range).min(1.0) } else { 0.0 };
        let across = (1.0 - down * down).sqrt();
        let beam = glam::DVec3::new(across * azimuth.cos(), across * azimuth.sin(), -down);
        let position = lidar.apply(beam * range).as_vec3().to_array();
        Return {
            position,
            raw: position,
            range: range as f32,
            intensity: (0.3 * incidence) as f32,
            time: 0.0,
            lidar: 0,
            channel: 0,
            column: k as u32,
            class,
            clean_class: class,
            instance: NO_INSTANCE,
            incidence: incidence as f32,
            status: Status::Hit,
        }
    };
    Scan {
        scene: "test".into(),
        frame: 3,
        time: 0.3,
        classes: CLASSES.map(str::to_owned).to_vec().into(),
        lidars: vec![ScanLidar {
            model: String::new(),
            ego_from_sensor: lidar,
            ego_from_mount: lidar,
            channels: 1,
            columns: 100_000,
            range: 200.0,
        }],
        world_from_ego: Pose::IDENTITY,
        returns: points.enumerate().map(point).collect(),
        boxes: Vec::new(),
    }
}

fn walls(number: usize) -> Scan {
    scan((0..number).map(|k| (5.0 + 0.01 * k as f64, BUILDING, 0.8)))
}

fn corrupted(scan: &Scan, conditions: &[&str], seed: u64) -> Scan {
    let conditions: Vec<Condition> = conditions.iter().map(|text| text.parse().unwrap()).collect();
    let mut scan = scan.clone();
    let corruptions: Corruptions = sort(&conditions).unwrap().1;
    corruptions.apply(&mut scan, seed);
    scan
}

fn with(scan: &Scan, status: Status) -> Vec<&Return> {
    scan.returns.iter().filter(|beam| beam.status == status).collect()
}

/// Bits, so that what is not a number equals itself.
fn bits(scan: &Scan) -> Vec<[u32; 5]> {
    let of = |beam: &Return| {
        let [x, y, z] = beam.position;
        [x, y, z, beam.range, beam.intensity].map(f32::to_bits)
    };
    scan.returns.iter().map(of).collect()
}

/// Range beyond which all is fog.
fn critical(alpha: f64, beta: f64) -> f64 {
    let rule = Rule::new(alpha, beta);
    let (mut low, mut high) = (5.0, 1000.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let [hard, soft] = rule.hard_and_soft(middle);
        if soft < hard { low = middle } else { high = middle }
    }
    low
}

#[test]
fn fog_begins_at_the_18_published_ranges() {
    let table = [
        (0.05, [37.1, 31.9, 28.4, 23.8, 20.9, 15.9]),
        (0.008, [92.6, 66.9, 54.6, 41.7, 34.6, 24.1]),
        (0.2, [18.6, 17.2, 16.1, 14.4, 13.2, 10.8]),
    ];
    for (beta, ranges) in table {
        for (alpha, wanted) in ALPHAS.into_iter().zip(ranges) {
            let found = critical(alpha, beta);
            // Given is the first row of the published tables, which go by 0.1 m.
            let row = (found * 10.0).ceil() / 10.0;
            assert!((row - wanted).abs() < 1e-9, "β {beta}, α {alpha}: {found}, not {wanted}");
            // And so in a scan.
            let fog = format!("fog:mode=robo3d,beta={beta},alpha={alpha}");
            let clean = walls(9500);
            for (beam, clean) in corrupted(&clean, &[&fog], 1).returns.iter().zip(&clean.returns) {
                let beyond = f64::from(clean.range) > found;
                let near = (f64::from(clean.range) - found).abs() < 1e-3;
                assert!(near || (beam.status == Status::Fog) == beyond, "{clean:?}");
            }
        }
    }
}

#[test]
fn tied_backscatter_puts_fog_where_the_original_has_it() {
    for (alpha, wanted) in [(0.01, 151.0), (0.02, 87.0), (0.03, 62.0), (0.06, 36.0)] {
        let found = critical(alpha, 0.046 * alpha / 20_f64.ln());
        assert!((found - wanted).abs() < 0.51, "{alpha}: {found}");
    }
}

#[test]
fn fog_points_lie_on_their_beams_and_belong_to_nothing() {
    let clean = walls(9500);
    let foggy = corrupted(&clean, &["fog:mode=robo3d,beta=0.05,alpha=0"], 2);
    let origin = glam::Vec3::new(0.0, 0.0, HEIGHT as f32);
    for (beam, clean) in foggy.returns.iter().zip(&clean.returns) {
        assert_eq!(beam.clean_class, BUILDING);
        if beam.status != Status::Fog {
            assert_eq!(beam, clean, "α = 0 dims nothing");
            continue;
        }
        assert_eq!((beam.class, beam.instance, beam.incidence), (NO_CLASS, NO_INSTANCE, 0.0));
        let (to, from) =
            (glam::Vec3::from(beam.position) - origin, glam::Vec3::from(clean.position) - origin);
        assert!(to.normalize().dot(from.normalize()) > 0.999_999);
        assert!((to.length() - beam.range).abs() < 1e-4);
        let part = 4.7 * clean.range / beam.range;
        assert!((part - clean.range).abs() < 10.01, "U(r ± 10): {part} of {}", clean.range);
    }
    // α is drawn for each frame among six.
    let mut hard: Vec<u32> = (0..60)
        .map(|frame| {
            let scan = Scan { frame, ..walls(1) };
            corrupted(&scan, &["fog:mode=robo3d"], 2).returns[0].intensity.to_bits()
        })
        .collect();
    hard.sort_unstable();
    hard.dedup();
    assert_eq!(hard.len(), 6);
}

/// Road points, evenly by range, of a sensor 2.2 m up.
fn road() -> Scan {
    scan((0..3000).map(|k| 2.5 + 0.02 * f64::from(k)).map(|r| (r, ROAD, (HEIGHT / r).min(1.0))))
}

#[test]
fn wet_ground_of_mean_reflectance_is_lost_at_the_published_ranges() {
    let limit = |height: f64, water: f64, floor: f64| {
        let lost = |r: f64| wet::reflectance(1.0 / 15.0, height / r, water) <= floor / 15.0;
        (30..2000).map(|k| f64::from(k) / 10.0).find(|&r| lost(r))
    };
    for (height, wanted) in [(2.2, [27.0, 7.0]), (1.84, [22.8, 5.9])] {
        let light = limit(height, 0.2, 0.2);
        let [moderate, heavy] =
            [(1.0, 0.3), (1.2, 0.7)].map(|(water, floor)| limit(height, water, floor));
        println!("{height} m up: {light:?} {moderate:?} {heavy:?}");
        assert_eq!(light, None);
        let near =
            |found: Option<f64>, wanted: f64| found.is_some_and(|r| (r - wanted).abs() < 0.51);
        assert!(near(moderate, wanted[0]) && near(heavy, wanted[1]), "{moderate:?} {heavy:?}");
    }
}

#[test]
fn a_wet_scan_loses_its_ground_from_there_on() {
    let dry = road();
    for (level, wanted) in [("moderate", 27.0), ("heavy", 7.0)] {
        let text = format!("wet:mode=robo3d,level={level}");
        let wet = corrupted(&dry, &[&text], 1);
        let first = dry.returns.iter().zip(&wet.returns).find(|(_, w)| w.status == Status::Lost);
        let first = f64::from(first.expect("some is lost").0.range);
        assert!((first - wanted).abs() < 0.6, "{level}: {first}");
        assert!(wet.returns.iter().all(|beam| beam.clean_class == ROAD));
        let bright = wet.returns.iter().zip(&dry.returns).filter(|(w, _)| w.status.is_point());
        assert!(bright.clone().all(|(wet, dry)| wet.intensity <= dry.intensity));
    }
    // Too little ground, other classes, no water: nothing changes.
    let mut little = dry.clone();
    little.returns.truncate(999);
    for same in [&little, &walls(2000)] {
        assert_eq!(&corrupted(same, &["wet:mode=robo3d"], 1), same);
    }
    assert_eq!(corrupted(&dry, &["wet:mode=robo3d,water=0"], 1), dry);
}

/// The published levels of snow: rate, speed, discs a square metre, mean radius in mm, shares of wedges with a
/// flake before 10, 20 and 40 m.
const SNOW: [(f64, f64, f64, f64, [f64; 3]); 3] = [
    (0.5, 2.0, 1.99, 0.226, [0.27, 0.71, 0.99]),
    (1.0, 1.6, 1.33, 0.437, [0.19, 0.56, 0.96]),
    (2.5, 1.6, 0.89, 0.849, [0.14, 0.43, 0.89]),
];

#[test]
fn discs_and_wedges_are_as_many_as_published() {
    for (rate, speed, density, radius, shares) in SNOW {
        let balls = Balls::new(rate, speed).unwrap();
        assert!((balls.discs_per_square_metre() / density - 1.0).abs() < 0.01, "{balls:?}");
        assert!((balls.mean_disc_radius() * 1e3 / radius - 1.0).abs() < 0.01, "{balls:?}");
        let mut draw = uniform(8);
        for (reach, wanted) in [10.0, 20.0, 40.0].into_iter().zip(shares) {
            let met = (0..40_000).filter(|_| !discs(&balls, reach, &mut draw).is_empty()).count();
            let share = met as f64 / 40_000.0;
            assert!((share - wanted).abs() < 0.01, "{rate} mm/h, {reach} m: {share}");
        }
        // Number and radius of those that are drawn, middles in the wedge and beside it.
        let drawn: Vec<_> = (0..4000).flat_map(|_| discs(&balls, 80.0, &mut draw)).collect();
        let mean = drawn.iter().map(|disc| disc.radius).sum::<f64>() / drawn.len() as f64;
        assert!((mean * 1e3 / radius - 1.0).abs() < 0.03, "{mean}");
        let area = wedge::WEDGE * 80.0 * 80.0 / 2.0 + 2.0 * radius * 1e-3 * 80.0;
        let number = drawn.len() as f64 / 4000.0;
        // Four standard errors.
        let wanted = balls.discs_per_square_metre() * area;
        assert!(
            (number / wanted - 1.0).abs() < 4.0 / (4000.0 * wanted).sqrt(),
            "{number} {wanted}"
        );
    }
}

#[test]
fn shares_of_a_wedge_add_up_and_dim_as_the_slice_does() {
    // Mean loss is 1 − e^(−d/mfp), mfp 1102, 858, 659 m.
    for ((rate, speed, ..), mfp) in SNOW.into_iter().zip([1102.0, 858.0, 659.0]) {
        let balls = Balls::new(rate, speed).unwrap();
        let mut draw = uniform(9);
        let mut sum = 0.0;
        for _ in 0..20_000 {
            let (taken, left) = wedge::shares(&discs(&balls, 40.0, &mut draw));
            assert!((taken.iter().sum::<f64>() + left - 1.0).abs() < 1e-12);
            sum += 1.0 - left;
        }
        let (loss, wanted) = (sum / 20_000.0, 1.0 - (-40.0_f64 / mfp).exp());
        assert!((loss / wanted - 1.0).abs() < 0.05, "{rate}: {loss} {wanted}");
        // The balls in space take less: plain instead of size-biased diameters fill the plane.
        assert!((1.5 * balls.extinction() * mfp - 1.0).abs() < 0.02, "{rate}");
    }
}

#[test]
fn about_one_beam_in_a_hundred_becomes_snow() {
    let mut shares = Vec::new();
    for (rate, speed, ..) in SNOW {
        let text = format!("snow:mode=robo3d,rate={rate},speed={speed}");
        for intensity in [5.0, 20.0, 40.0, 75.0] {
            let mut clean = walls(5500);
            for beam in &mut clean.returns {
                beam.intensity = intensity / 255.0;
            }
            let snowy = corrupted(&clean, &[&text], 4);
            let share = with(&snowy, Status::Snow).len() as f64 / 5500.0;
            println!("{rate} mm/h, {intensity} of 255: {:.2} % become snow", 100.0 * share);
            shares.push(share);
            for (beam, clean) in snowy.returns.iter().zip(&clean.returns) {
                assert!(beam.intensity <= 1.0 && beam.range < clean.range + 0.2);
                assert!(beam.status == Status::Snow || beam.position == clean.position);
            }
        }
    }
    // Published: 0 to 3 %, about 1 % on the mean of targets from 5 to 75.
    assert!(shares.iter().all(|share| *share < 0.035), "{shares:?}");
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    assert!((0.003..0.02).contains(&mean), "{mean}");
}

#[test]
fn snow_loses_what_is_below_the_noise_of_the_ground() {
    // Every third point is of a dark car.
    let mut mixed = road();
    for beam in mixed.returns.iter_mut().step_by(3) {
        (beam.class, beam.clean_class, beam.intensity) = (VEHICLE, VEHICLE, 0.005);
    }
    let snowy = corrupted(&mixed, &["snow:mode=robo3d"], 4);
    let share = |class: u16, to: f32| {
        let pairs = || snowy.returns.iter().zip(&mixed.returns);
        let of = || pairs().filter(move |(_, c)| c.class == class && c.range < to);
        let lost = of().filter(|(s, _)| s.status == Status::Lost).count();
        lost as f64 / of().count() as f64
    };
    // A square polynomial fits cos θ badly, so that a part of the road goes with them: as published.
    assert!(share(VEHICLE, 25.0) > 0.95 && share(ROAD, 25.0) < 0.4);
    let few = corrupted(&walls(2000), &["snow:mode=robo3d"], 4);
    assert!(with(&few, Status::Lost).is_empty(), "without ground there is no noise");
}

#[test]
fn blur_has_the_published_deviations() {
    let clean = walls(5000);
    let mut means = Vec::new();
    for frame in 0..200 {
        let mut clean = clean.clone();
        clean.frame = frame;
        let blurred = corrupted(&clean, &["blur:mode=robo3d,sigma=0.30"], 5);
        let pairs = blurred.returns.iter().zip(&clean.returns);
        let moves: Vec<glam::DVec3> = pairs
            .map(|(b, c)| (glam::Vec3::from(b.position) - glam::Vec3::from(c.position)).as_dvec3())
            .collect();
        let mean = moves.iter().sum::<glam::DVec3>() / 5000.0;
        let squares = moves.iter().map(|m| (*m - mean) * (*m - mean)).sum::<glam::DVec3>() / 5000.0;
        for (found, wanted) in squares.to_array().into_iter().zip([0.03, 0.03, 0.015]) {
            assert!((found.sqrt() / wanted - 1.0).abs() < 0.05, "{}", found.sqrt());
        }
        assert!(blurred.returns.iter().all(|beam| beam.class == BUILDING), "labels stay");
        means.extend(mean.to_array());
    }
    let deviation = (means.iter().map(|m| m * m).sum::<f64>() / 600.0).sqrt();
    assert!((deviation / 0.30 - 1.0).abs() < 0.1, "{deviation}");
}

#[test]
fn crosstalk_hits_an_exact_number_by_maxwells_distances() {
    let clean = walls(20_000);
    for share in [0.006, 0.07, 1.0] {
        let text = format!("crosstalk:mode=robo3d,share={share}");
        let hit = corrupted(&clean, &[&text], 6);
        let count = with(&hit, Status::Crosstalk).len();
        assert_eq!(count, (share * 20_000.0) as usize);
        if share < 1.0 {
            continue;
        }
        let pairs = hit.returns.iter().zip(&clean.returns);
        let mut moves: Vec<f64> = pairs
            .map(|(a, b)| glam::Vec3::from(a.position).distance(b.position.into()).into())
            .collect();
        let mean = moves.iter().sum::<f64>() / 20_000.0;
        moves.sort_by(f64::total_cmp);
        let median = moves[10_000];
        assert!((mean - 4.787).abs() < 0.06 && (median - 4.614).abs() < 0.08, "{mean} {median}");
        let mut bright: Vec<f64> =
            hit.returns.iter().map(|beam| f64::from(beam.intensity) - 0.24).collect();
        let spread = (bright.iter().map(|b| b * b).sum::<f64>() / 20_000.0).sqrt();
        assert!((spread / 3.0 - 1.0).abs() < 0.03, "{spread}");
        // Even signs, at least.
        let gap = ks(&mut bright, |b| {
            if b < 0.0 { 0.5 * (b / 3.0).exp() } else { 1.0 - 0.5 * (-b / 3.0).exp() }
        });
        assert!(gap < 0.1, "{gap}");
    }
}

#[test]
fn echoes_go_missing_by_class_in_exact_numbers() {
    let classes = |k: usize| if k < 600 { VEHICLE } else { BUILDING };
    let mut clean = scan((0..1000).map(|k| (10.0, classes(k), 0.5)));
    let tracked = |instance: u16, kind: ActorKind, class: u16| TrackedBox {
        instance,
        name: String::new(),
        kind,
        class,
        ego_from_box: Pose::IDENTITY,
        size: glam::DVec3::ONE,
        velocity: glam::DVec3::ZERO,
        points: 0,
    };
    clean.boxes = vec![
        tracked(1, ActorKind::Car, VEHICLE),
        tracked(2, ActorKind::Truck, VEHICLE),
        tracked(3, ActorKind::Bicycle, VEHICLE),
        tracked(4, ActorKind::Pedestrian, VEHICLE),
    ];
    // 407 points of cars with those of no actor, 53 of a truck, 10 of a bicycle, 130 of a person.
    let parts = [(0, 100), (1, 307), (2, 53), (3, 10), (4, 130)];
    let instances = parts.into_iter().flat_map(|(instance, n)| std::iter::repeat_n(instance, n));
    for (beam, instance) in clean.returns.iter_mut().zip(instances) {
        beam.instance = instance;
    }
    for ratio in [0.75, 0.85, 0.95] {
        let text = format!("echo:mode=robo3d,ratio={ratio}");
        let dropped = corrupted(&clean, &[&text], 7);
        let of = |instances: &[u16]| {
            let pairs = dropped.returns.iter().zip(&clean.returns);
            pairs
                .filter(|(d, c)| d.status == Status::Dropped && instances.contains(&c.instance))
                .count()
        };
        let floor = |n: f64| (ratio * n).floor() as usize;
        assert_eq!(of(&[0, 1]), floor(407.0), "of {ratio}");
        assert_eq!((of(&[2]), of(&[3]), of(&[4])), (floor(53.0), 0, 0));
        assert!(
            with(&dropped, Status::Dropped).iter().all(|b| b.class == NO_CLASS && b.range.is_nan())
        );
    }
}

#[test]
fn conditions_of_nothing_change_nothing() {
    let clean = road();
    for text in [
        "fog:mode=robo3d,beta=0,alpha=0",
        "snow:mode=robo3d,rate=0",
        "blur:mode=robo3d,sigma=0",
        "crosstalk:mode=robo3d,share=0",
        "echo:mode=robo3d,ratio=0",
        "wet:mode=robo3d,water=0",
    ] {
        assert_eq!(corrupted(&clean, &[text], 1), clean, "{text}");
    }
}

#[test]
fn the_same_seed_gives_the_same_on_any_number_of_threads() {
    let all = [
        "snow:mode=robo3d",
        "crosstalk:mode=robo3d,share=0.1",
        "blur:mode=robo3d",
        "fog:mode=robo3d",
    ];
    let clean = road();
    let once = bits(&corrupted(&clean, &all, 11));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(once, one.install(|| bits(&corrupted(&clean, &all, 11))));
    assert_ne!(once, bits(&corrupted(&clean, &all, 12)));
    // A point's numbers do not depend on which others there are.
    let mut half = clean.clone();
    half.returns.retain(|beam| beam.column % 2 == 0);
    let blurred = |scan: &Scan| corrupted(scan, &["blur:mode=robo3d"], 1);
    let (whole, half) = (blurred(&clean), blurred(&half));
    for beam in &half.returns {
        assert_eq!(beam, &whole.returns[beam.column as usize]);
    }
    let draws = Draws::new(1, 3, Kind::Fog);
    let chances = draws.returns(&clean);
    let first = draws.beam(&clean, &clean.returns[0], 0);
    assert_eq!(format!("{:?}", chances[0]), format!("{first:?}"));
}

#[test]
fn the_second_return_of_a_beam_has_numbers_of_its_own() {
    let mut twice = walls(1);
    twice.returns.push(Return { status: Status::Second, ..twice.returns[0] });
    let blurred = corrupted(&twice, &["blur:mode=robo3d"], 1);
    assert_ne!(blurred.returns[0].position, blurred.returns[1].position);
    let classes: Arc<[String]> = blurred.classes.clone();
    assert_eq!(&*classes[usize::from(blurred.returns[1].class)], "building");
}

#[test]
fn snow_that_cannot_be_measured_is_none_and_ends_soon() {
    let clean = walls(20);
    for rate in ["1e-300", "1e-6", "0.0099"] {
        let snowed = corrupted(&clean, &[&format!("snow:mode=robo3d,rate={rate}")], 1);
        assert_eq!(bits(&snowed), bits(&clean), "{rate}");
    }
    let snowed = corrupted(&walls(2000), &["snow:mode=robo3d,rate=0.01"], 1);
    assert_ne!(bits(&snowed), bits(&walls(2000)));
}
