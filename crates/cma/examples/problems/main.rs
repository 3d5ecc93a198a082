//! The CMA-ES on the 48 problems of `cma_problems.json`, 25 runs each, against pycma.
//!
//! ```text
//! cargo run --release -p sightline-cma --example problems -- ../shared/golden/cma_problems.json \
//!     [--only ID_PREFIX] [--out results.json]
//! cargo run --release -p sightline-cma --example problems -- --timing
//! ```
//!
//! The runs keep to the `settings` of that file: a run ends at its target, at its budget or where the
//! optimizer stops by itself. The counts of pycma in `pycma.json` come from `pycma.py` beside this
//! file, which says how.

#![allow(clippy::disallowed_methods)]

mod problems;
mod runs;
mod timing;

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::{fs, io};

use clap::Parser;
use rayon::prelude::*;
use serde::Deserialize;
use serde_json::json;

use problems::{File, TestFunction};
use runs::Attempt;

/// Runs of pycma, written by `pycma.py`.
const PYCMA: &str = include_str!("pycma.json");

#[derive(Parser)]
struct Args {
    /// The file of problems
    #[arg(required_unless_present = "timing")]
    problems: Option<PathBuf>,
    /// Problems whose id begins like this
    #[arg(long, value_name = "ID_PREFIX", default_value = "")]
    only: String,
    /// Where to write all runs as JSON
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Measure ask and tell instead
    #[arg(long)]
    timing: bool,
}

/// pycma's runs of one problem.
#[derive(Deserialize)]
struct Reference {
    evaluations: Vec<Option<u64>>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    let Some(path) = &args.problems else { return Ok(timing::print()?) };
    let file: File = serde_json::from_reader(io::BufReader::new(fs::File::open(path)?))?;
    let pycma: BTreeMap<String, Reference> = serde_json::from_str(PYCMA)?;
    let runs = file.settings["runs_per_problem"].as_u64().ok_or("no runs_per_problem")? as usize;
    let mut results = Vec::new();
    let mut ratios: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    println!(
        "{:28} {:>7} {:>7} {:>9} {:>9} {:>6}",
        "problem", "success", "pycma", "mean", "pycma", "ratio"
    );
    for problem in file.problems.iter().filter(|p| p.id.starts_with(&args.only)) {
        let done: Vec<Attempt> = (0..runs)
            .into_par_iter()
            .map(|run| runs::run(&file, problem, run))
            .collect::<Result<_, _>>()?;
        let ours: Vec<Option<u64>> = done.iter().map(|run| run.evaluations).collect();
        let theirs = pycma.get(&problem.id).map(|reference| &reference.evaluations[..]);
        let ratio = print_row(problem, &done, &ours, theirs);
        if let Some(ratio) = ratio {
            ratios.entry(set_of(&problem.func)).or_default().push(ratio);
        }
        results.push(json!({ "id": problem.id, "runs": done }));
    }
    for (set, ratios) in &ratios {
        let mean = ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len() as f64;
        let most = ratios.iter().fold(0.0_f64, |m, r| m.max(*r));
        println!(
            "{set}: evaluations over pycma's {:.3} in the geometric mean, at most {most:.3}",
            mean.exp()
        );
    }
    if let Some(out) = &args.out {
        let text = json!({ "schema": file.schema, "settings": file.settings, "results": results });
        fs::write(out, serde_json::to_string_pretty(&text)?)?;
    }
    Ok(())
}

/// The set that a function belongs to.
fn set_of(func: &str) -> &'static str {
    match func {
        "sphere" | "ellipsoid" | "ellipsoid_rot" | "rosenbrock" => "smooth",
        "linear_box" | "sphere_box" => "box",
        "step_sphere" | "step_ellipsoid_rot" | "floor_sphere" => "plateau",
        "noisy_sphere_mult" | "noisy_sphere_add" => "noisy",
        _ => "multimodal",
    }
}

/// Mean over the runs that reached the target.
fn mean(evaluations: &[Option<u64>]) -> Option<f64> {
    let reached: Vec<f64> = evaluations.iter().flatten().map(|&e| e as f64).collect();
    (!reached.is_empty()).then(|| reached.iter().sum::<f64>() / reached.len() as f64)
}

/// One line of the table; the ratio of the means where both have one.
fn print_row(
    problem: &TestFunction,
    done: &[Attempt],
    ours: &[Option<u64>],
    theirs: Option<&[Option<u64>]>,
) -> Option<f64> {
    let successes =
        |runs: &[Option<u64>]| format!("{}/{}", runs.iter().flatten().count(), runs.len());
    let shown = |mean: Option<f64>| mean.map_or("-".into(), |mean| format!("{mean:.0}"));
    let (our_mean, their_mean) = (mean(ours), theirs.and_then(mean));
    let ratio = our_mean.zip(their_mean).map(|(ours, theirs)| ours / theirs);
    let infeasible: u64 = done.iter().map(|run| run.infeasible).sum();
    let mut stops: BTreeMap<&str, usize> = BTreeMap::new();
    let mut spent = 0;
    for run in done.iter().filter(|run| !run.success) {
        *stops.entry(&run.stop).or_default() += 1;
        spent += run.spent;
    }
    let failed: usize = stops.values().sum();
    let mut stops: Vec<String> =
        stops.iter().map(|(stop, count)| format!("{count} {stop}")).collect();
    stops.extend((failed > 0).then(|| format!("{} evaluations each", spent / failed as u64)));
    println!(
        "{:28} {:>7} {:>7} {:>9} {:>9} {:>6} {}{}",
        problem.id,
        successes(ours),
        theirs.map_or("-".into(), successes),
        shown(our_mean),
        shown(their_mean),
        ratio.map_or("-".into(), |ratio| format!("{ratio:.3}")),
        if infeasible > 0 { format!("{infeasible} infeasible; ") } else { String::new() },
        stops.join(", ")
    );
    ratio
}
