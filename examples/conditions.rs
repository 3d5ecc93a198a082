//! Draws how much of a scan is left in fog, snow and on wet ground, by range and in both modes:
//! `cargo run --release --example conditions > src/scan/conditions/left.svg`.

use sightline::geom::Pose;
use sightline::internals::{Axis, Plot, Series};
use sightline::scan::conditions::{self, Condition, ConditionError, Corruptions, Weather};
use sightline::scan::{NO_INSTANCE, Return, Scan, ScanLidar, Status};

/// A sensor that sees 10 % at 120 m, 2.2 m above the road.
const THRESHOLD: f64 = 0.1 / (120.0 * 120.0);
const HEIGHT: f64 = 2.2;
const WIDE: [f64; 2] = [3e-3, 1.5e-3];
/// What is looked at: a wall that faces the sensor, and the road.
const TARGETS: [(&str, f64); 2] = [("building", 0.3), ("road", 0.26)];
const POINTS: u32 = 2000;

fn incidence(class: usize, range: f64) -> f64 {
    if class == 0 { 1.0 } else { (HEIGHT / range).min(1.0) }
}

fn ranges() -> impl Iterator<Item = f64> {
    (2..=40).map(|k| f64::from(k) * 2.0)
}

/// Share of the beams at a range whose target is seen, in per cent.
fn physical(weather: &Weather, class: usize, range: f64) -> f64 {
    let cos = incidence(class, range);
    let dry = TARGETS[class].1;
    let wet = weather.wet.filter(|_| class == 1);
    let reflectance = wet.map_or(dry, |wet| wet.reflectance(dry, cos));
    let fog = weather.fog.as_ref().map_or(1.0, |fog| fog.attenuation(range));
    let soft = weather.fog.as_ref().map_or(0.0, |fog| fog.soft_power(range));
    let power = reflectance * cos / (range * range) * fog;
    let mut state = 1_u64;
    let seen = (0..POINTS).filter(|_| {
        // Weyl's sequence is even enough for a picture.
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let fallen = weather.snow.map(|snow| snow.beam(WIDE, range, &mut draw));
        let power = power * fallen.map_or(1.0, |fallen| fallen.passed);
        let flake = fallen.and_then(|fallen| fallen.flake).map_or(0.0, |flake| flake.power);
        power >= THRESHOLD && power >= flake && power >= soft
    });
    100.0 * seen.count() as f64 / f64::from(POINTS)
}

/// The same of a finished scan, on the mean of the frames.
fn published(corruptions: &Corruptions, class: usize) -> Vec<(f64, f64)> {
    let mut left = vec![0.0; ranges().count()];
    let frames = 24;
    for frame in 0..frames {
        let mut scan = scan(frame, class);
        let clean: Vec<f32> = scan.returns.iter().map(|beam| beam.range).collect();
        corruptions.apply(&mut scan, 1);
        for (beam, clean) in scan.returns.iter().zip(clean) {
            let place = (f64::from(clean) / 2.0).round() as usize - 2;
            left[place] += f64::from(u8::from(beam.status == Status::Hit));
        }
    }
    let most = f64::from(POINTS / 8) * frames as f64;
    ranges().zip(left).map(|(range, left)| (range, 100.0 * left / most)).collect()
}

fn scan(frame: usize, class: usize) -> Scan {
    let point = |(column, range): (u32, f64)| {
        let cos = incidence(class, range);
        Return {
            position: [range as f32, 0.0, HEIGHT as f32],
            raw: [range as f32, 0.0, HEIGHT as f32],
            range: range as f32,
            intensity: (TARGETS[class].1 * cos) as f32,
            time: 0.0,
            lidar: 0,
            channel: 0,
            column,
            class: class as u16,
            clean_class: class as u16,
            instance: NO_INSTANCE,
            incidence: cos as f32,
            status: Status::Hit,
        }
    };
    let pose = Pose { translation: [0.0, 0.0, HEIGHT].into(), ..Pose::IDENTITY };
    let lidar = ScanLidar {
        model: String::new(),
        ego_from_sensor: pose,
        ego_from_mount: pose,
        channels: 1,
        columns: POINTS * 16,
        range: 200.0,
    };
    let columns = (0..POINTS / 8).flat_map(|_| ranges());
    Scan {
        scene: "targets".into(),
        frame,
        time: 0.0,
        classes: TARGETS.map(|(name, _)| name.to_owned()).to_vec().into(),
        lidars: vec![lidar],
        world_from_ego: Pose::IDENTITY,
        returns: (0..).zip(columns).map(point).collect(),
        boxes: Vec::new(),
    }
}

fn series(name: &str, class: usize) -> Result<[Series; 2], ConditionError> {
    let read = |text: String| -> Result<_, ConditionError> {
        let condition: Condition = text.parse()?;
        conditions::sort(&[condition])
    };
    let (weather, _) = read(format!("{name}:level=moderate"))?;
    let (_, corruptions) = read(format!("{name}:mode=robo3d,level=moderate"))?;
    let exact = ranges().map(|range| (range, physical(&weather, class, range))).collect();
    let line = |name: String, points| Series { name, points, line: true, labels: Vec::new() };
    let published = published(&corruptions, class);
    Ok([line(format!("{name}, physical"), exact), line(format!("{name}, robo3d"), published)])
}

fn main() -> Result<(), ConditionError> {
    let pairs = [series("fog", 0)?, series("snow", 0)?, series("wet", 1)?];
    let plot = Plot {
        title: "Left of a wall (ρ = 0.3) in fog and snow, of a road (ρ = 0.26) that is wet".into(),
        x_title: "range in metres".into(),
        y_title: "beams that return from the target, %".into(),
        x: Axis::Numbers,
        series: pairs.into_iter().flatten().collect(),
    };
    print!("{}", plot.svg());
    Ok(())
}
