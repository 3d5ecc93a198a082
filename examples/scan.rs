//! Scans without files, and how fast: `cargo run --release --example scan [SCENE [PLACEMENTS NAME [CONDITION…]]]`.

use std::env::args;
use std::time::Instant;

use sightline::scan::conditions::Condition;
use sightline::scan::{Scanner, Scanning};
use sightline::{Scene, read_placements};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = args().nth(1).unwrap_or("scenes/urban-crossing.json".into());
    let file = args().nth(2).unwrap_or("scenes/placements.json".into());
    let name = args().nth(3).unwrap_or("Center".into());
    let conditions = args().skip(4).map(|text| text.parse::<Condition>());
    let conditions = conditions.collect::<Result<_, _>>()?;

    let scene = Scene::read(scene)?;
    let placements = read_placements(file)?;
    let placement = placements.iter().find(|placement| placement.name == name);
    let placement = placement.ok_or(format!("no placement is called `{name}`"))?;
    let scanner = Scanner::new(&scene, placement, &Scanning { conditions, ..Scanning::default() })?;
    let start = Instant::now();
    let points: usize = scanner.scans().map(|scan| scan.points().count()).sum();
    let seconds = start.elapsed().as_secs_f64();
    let rate = points as f64 / seconds / 1e6;
    println!(
        "{} frames, {points} points, {seconds:.2} s: {rate:.2} million a second",
        scanner.frames()
    );
    Ok(())
}
