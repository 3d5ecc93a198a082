//! Scores of known placements in a scene: `cargo run --release --example score [SCENE [PLACEMENTS]]`.

use std::env::args;

use sightline::{Evaluator, Problem, Scene, read_placements};

fn main() -> Result<(), sightline::Error> {
    let scene = args().nth(1).unwrap_or("scenes/urban-crossing.json".into());
    let placements = args().nth(2).unwrap_or("scenes/placements.json".into());

    let scene = Scene::read(scene)?;
    let mut evaluator = Evaluator::on_cpu(Problem::of(&scene)?);
    println!("{:14} {:>10} {:>7}  guards", "placement", "nats", "share");
    for scores in evaluator.scores(&read_placements(placements)?)? {
        let gain = scores.segmentation.information_gain.unwrap_or(0.0);
        let share = 100.0 * scores.segmentation.information_gain_share.unwrap_or(0.0);
        println!("{:14} {gain:10.0} {share:6.2} %  {}", scores.name, scores.guards.len());
    }
    Ok(())
}
