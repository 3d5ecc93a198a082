//! A search with progress: `cargo run --release --example optimize [SCENE]`.

use std::env::args;

use sightline::{Event, Job, Scene};

fn main() -> Result<(), sightline::Error> {
    let scene = args().nth(1).unwrap_or("scenes/urban-crossing.json".into());
    let job = Job::new(Scene::read(scene)?);

    let mut observer = |event: &Event| {
        match event {
            Event::Generation(record) => {
                let best = record.best_so_far.unwrap_or(f64::NAN);
                eprintln!("{:4} evaluations, best {best:.0} nats", record.evaluations);
            }
            Event::Note(sentence) => eprintln!("{sentence}"),
            _ => {}
        }
        true
    };
    let Some(found) = job.optimize(&mut observer)? else { return Ok(()) };
    let outcome = found.outcome;

    for scored in outcome.best.iter().chain(&outcome.baselines) {
        let gain = scored.objective.unwrap_or(f64::NAN);
        println!("{:14} {gain:8.0} nats", scored.placement.name);
    }
    for pose in outcome.best.iter().flat_map(|best| &best.placement.lidars) {
        println!("{pose:?}");
    }
    Ok(())
}
