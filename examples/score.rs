//! Scores of known placements in a scene: `cargo run --release --example score [SCENE [PLACEMENTS]]`.

use std::env::args;

use sightline::{Job, Scene, read_placements};

fn main() -> Result<(), sightline::Error> {
    let scene = args().nth(1).unwrap_or("scenes/urban-crossing.json".into());
    let placements = args().nth(2).unwrap_or("scenes/placements.json".into());

    let job = Job::new(Scene::read(scene)?);
    println!("{:14} {:>10} {:>7}  guards", "placement", "nats", "share");
    for judged in job.score(&read_placements(placements)?)? {
        let scores = judged.scores;
        let gain = scores.segmentation.information_gain.unwrap_or(0.0);
        let share = 100.0 * scores.segmentation.information_gain_share.unwrap_or(0.0);
        println!("{:14} {gain:10.0} {share:6.2} %  {}", scores.name, scores.guards.len());
    }
    Ok(())
}
