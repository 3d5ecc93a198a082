//! What a run says at its end.

use std::path::Path;

use sightline::report::{RunRecord, certificate_in_words, methods_in_words};
use sightline::scene::{EgoBody, Scene};

use super::Args;
use crate::cli::args::{Format, format_or_default};
use crate::cli::table;

/// Triangles of the ego body, for the drawing.
pub(super) fn body_of(scene: &Scene) -> Vec<[[f32; 3]; 3]> {
    if !scene.has_geometry() {
        return Vec::new();
    }
    let without = scene.frame(0, EgoBody::Exclude).faces.len() as u32;
    let soup = scene.frame(0, EgoBody::Include);
    (without..soup.faces.len() as u32).map(|prim| soup.corners(prim)).collect()
}

/// Most bytes the process has held, where the kernel tells.
pub(super) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes << 10)
}

pub(super) fn print(args: &Args, record: &RunRecord, folder: &Path) {
    if format_or_default(args.format) == Format::Json {
        println!("{}", serde_json::json!(record));
        return;
    }
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    println!("{}: maximizing {} over {} frame(s)", record.scene, record.objective, record.frames);
    print!("{}", table::scores(&rows));
    match &record.best {
        Some(best) => {
            println!("\noptimized placement (m, rad):");
            let titles = ["LiDAR", "x", "y", "z", "roll", "pitch", "yaw"];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            for (index, pose) in best.placement.lidars.iter().enumerate() {
                let mut row = vec![index.to_string()];
                row.extend(pose.fields().map(|(_, value)| format!("{value:.3}")));
                rows.push(row);
            }
            print!("{}", table::align(&rows));
            for bound in &record.active_bounds {
                println!("  active: {bound}");
            }
            if !record.constraints.is_empty() {
                println!("\nrules kept: {}", record.constraints.join("; "));
            }
            println!("\nfound by: {}", methods_in_words(record));
            println!("certificate: {}", certificate_in_words(record));
            println!("\n{}", table::findings(&record.findings));
        }
        None => println!("\nno candidate kept the rules of the mount; widen it"),
    }
    if let Some(words) = record.fidelity.as_ref().and_then(|f| f["words"].as_str()) {
        println!("\n{words}");
    }
    println!(
        "\nstopped: {}, after {} evaluations in {:.1} s ({:.1} placements × frames/s on {}); report: \
         {}",
        record.stopped,
        record.evaluations,
        record.timings.total,
        record.rate,
        record.backend,
        folder.join("report.html").display()
    );
}
