//! Draws what blur, crosstalk and incomplete echoes do to scans of a scene, in both modes:
//! `cargo run --release --example faults moved > src/scan/conditions/moved.svg`, and `left-of-vehicles`.

use std::collections::BTreeMap;
use std::env::args;

use sightline::internals::{Axis, Plot, Series};
use sightline::scan::conditions::Condition;
use sightline::scan::{NO_INSTANCE, Return, Scanner, Scanning};
use sightline::vehicle::Placement;
use sightline::{Scene, read_placements};

/// Frames that are looked at.
const FRAMES: usize = 8;
/// Points of each curve.
const STEPS: usize = 60;
/// Points of a vehicle from which on it counts.
const LEAST: usize = 10;

type Failure = Box<dyn std::error::Error>;

/// All returns of the first frames.
fn returns(scene: &Scene, placement: &Placement, condition: &str) -> Result<Vec<Return>, Failure> {
    let conditions = match condition {
        "" => vec![],
        text => vec![text.parse::<Condition>()?],
    };
    let scanning = Scanning { conditions, ..Scanning::default() };
    let scanner = Scanner::new(scene, placement, &scanning)?;
    Ok(scanner.scans().take(FRAMES).flat_map(|scan| scan.returns).collect())
}

/// (metres, per cent of the points that moved that moved no farther): against the same beams in clear air.
fn moved(clear: &[Return], there: &[Return]) -> Vec<(f64, f64)> {
    let pairs = clear.iter().zip(there).filter(|(a, b)| a.status.is_point() && b.status.is_point());
    let distance = |(a, b): (&Return, &Return)| {
        let apart = (0..3).map(|axis| f64::from(a.position[axis] - b.position[axis]).powi(2));
        apart.sum::<f64>().sqrt()
    };
    let mut far: Vec<f64> = pairs.map(distance).filter(|&far| far > 1e-4).collect();
    far.sort_by(f64::total_cmp);
    let share = |k: usize| k * far.len().saturating_sub(1) / STEPS;
    let point = |k| Some((*far.get(share(k))?, 100.0 * k as f64 / STEPS as f64));
    (0..=STEPS).filter_map(point).filter(|(far, _)| *far <= 15.0).collect()
}

/// (vehicles so far, per cent of its points that are left) of each vehicle and frame, those with most first.
fn left(clear: &[Return], there: &[Return], beams: usize, vehicle: usize) -> Vec<(f64, f64)> {
    let mut points: BTreeMap<(usize, u16), [usize; 2]> = BTreeMap::new();
    for (beam, (a, b)) in clear.iter().zip(there).enumerate() {
        let is_vehicle = usize::from(a.class) == vehicle && a.instance != NO_INSTANCE;
        if a.status.is_point() && is_vehicle {
            let counts = points.entry((beam / beams, a.instance)).or_default();
            counts[0] += 1;
            counts[1] += usize::from(b.status.is_point());
        }
    }
    let whole = points.values().filter(|[all, _]| *all >= LEAST);
    let mut shares: Vec<f64> =
        whole.map(|[all, left]| 100.0 * *left as f64 / *all as f64).collect();
    shares.sort_by(|a, b| b.total_cmp(a));
    (1..).zip(shares).map(|(k, share)| (f64::from(k), share)).collect()
}

fn main() -> Result<(), Failure> {
    let scene = Scene::read("scenes/urban-crossing.json")?;
    let placements = read_placements("scenes/placements.json")?;
    let placement = placements.iter().find(|p| p.name == "Ours-seg").ok_or("no Ours-seg")?;
    let clear = returns(&scene, placement, "")?;
    let beams = clear.len() / FRAMES;
    let vehicle = scene.classes().iter().position(|name| name == "vehicle").ok_or("no vehicle")?;
    let vehicles = args().nth(1).as_deref() == Some("left-of-vehicles");
    let names: &[&str] = if vehicles { &["echo"] } else { &["blur", "crosstalk"] };
    let mut series = Vec::new();
    for name in names {
        for mode in ["physical", "robo3d"] {
            let there = returns(&scene, placement, &format!("{name}:mode={mode},level=moderate"))?;
            let points = match vehicles {
                true => left(&clear, &there, beams, vehicle),
                false => moved(&clear, &there),
            };
            let name = format!("{name}, {mode}");
            series.push(Series { name, points, line: true, labels: Vec::new() });
        }
    }
    let plot = Plot {
        title: match vehicles {
            true => "Points left of each vehicle with incomplete echoes",
            false => "How far points are moved by blur and crosstalk",
        }
        .into(),
        x_title: if vehicles { "vehicles" } else { "metres at most" }.into(),
        y_title: if vehicles { "points left, %" } else { "points that moved, %" }.into(),
        x: Axis::Numbers,
        series,
    };
    print!("{}", plot.svg());
    Ok(())
}
