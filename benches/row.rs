//! Rows of a table of times, of our own stages and of other ray casters.

#![allow(clippy::unwrap_used)]

use std::time::Instant;

use lidar_cast::bvh::Hit;
use serde_json::{Value, json};

use crate::peer::Peer;

/// Times of one way to do a stage, in seconds for one unit of work.
pub(crate) struct Row {
    pub name: String,
    pub runs: Vec<f64>,
    /// Hits of a peer for each of ours.
    pub hits: Option<f64>,
    /// Why there are no runs.
    pub missing: Option<String>,
}

impl Row {
    pub(crate) fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), runs: Vec::new(), hits: None, missing: None }
    }

    /// Runs and times one pass over `work` units.
    pub(crate) fn time<T>(&mut self, work: usize, run: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = run();
        self.runs.push(start.elapsed().as_secs_f64() / work as f64);
        result
    }

    pub(crate) fn sorted(&self) -> Vec<f64> {
        let mut runs = self.runs.clone();
        runs.sort_by(f64::total_cmp);
        runs
    }

    pub(crate) fn median(&self) -> f64 {
        self.sorted().get(self.runs.len() / 2).copied().unwrap_or(f64::NAN)
    }
}

/// Prints the rows of a stage; ratios are those of the last row to the others.
pub(crate) fn print(stage: &str, rows: &[&Row], unit: &str, scale: impl Fn(f64) -> f64) -> Value {
    println!("  {stage}, {unit}");
    let own = rows[rows.len() - 1].median();
    for row in rows {
        if let Some(why) = &row.missing {
            println!("    {:<34} missing: {why}", row.name);
            continue;
        }
        let runs = row.sorted();
        let (low, high) = (scale(runs[0]), scale(runs[runs.len() - 1]));
        println!(
            "    {:<34} {:>9.2}  ({:.2} to {:.2}){}",
            row.name,
            scale(row.median()),
            low.min(high),
            low.max(high),
            if row.median() == own {
                String::new()
            } else {
                format!("  x{:.1}", row.median() / own)
            },
        );
        if let Some(hits) = row.hits {
            println!("    {:<34} {:>9.3} hits for each of ours", "", hits);
        }
    }
    let rows = rows
        .iter()
        .map(|row| json!({ "name": row.name, "seconds": row.runs, "hits": row.hits, "missing": row.missing }));
    json!({ "stage": stage, "rows": rows.collect::<Vec<_>>() })
}

/// A peer and its row.
pub(crate) struct Rival {
    pub row: Row,
    pub peer: Result<Peer, String>,
}

impl Rival {
    pub(crate) fn new(name: &str, peer: Result<Peer, String>) -> Self {
        let mut row = Row::new(name);
        row.missing = peer.as_ref().err().cloned();
        Self { row, peer }
    }

    pub(crate) fn pass(&mut self, rays: usize, hits: usize) {
        let Ok(peer) = &mut self.peer else { return };
        match peer.pass() {
            Ok((seconds, found)) => {
                self.row.runs.push(seconds / rays as f64);
                self.row.hits = Some(found as f64 / hits as f64);
            }
            Err(why) => (self.row.missing, self.peer) = (Some(why.clone()), Err(why)),
        }
    }
}

/// Whether all hits of `a` begin `b`, bit by bit.
pub(crate) fn same_bits(a: &[Hit], b: &[Hit]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a.t.to_bits(), a.prim) == (b.t.to_bits(), b.prim))
}
