//! What a run leaves and says at its end.

use std::path::Path;

use indicatif::ProgressBar;
use sightline::problem::spread;
use sightline::report::{
    InformationMap, ModelledRun, RunRecord, RunTimes, Scored, certificate_in_words,
    methods_in_words, verdict,
};
use sightline::scene::{EgoBody, Scene};

use super::auto::Auto;
use super::finalists::Finding;
use super::rules::{active_bounds, in_words};
use super::{Args, Run};
use crate::cli::args::Format;
use crate::cli::error::Error;
use crate::cli::table;

/// Frames that the map of the gained information averages over.
const MAP_FRAMES: u32 = 4;

impl Run {
    /// What the result gains over some frames, seen from above.
    pub(super) fn map(&mut self, best: Option<&Scored>) -> Result<Option<InformationMap>, Error> {
        let Some(best) = best else { return Ok(None) };
        let frames = spread(self.evaluator.problem().frame_count(), Some(MAP_FRAMES));
        let problem = self.evaluator.problem();
        let (roi, mut map) =
            (*problem.roi(), InformationMap::new(problem.roi(), problem.content()));
        for &frame in &frames {
            let covered = self.evaluator.backend_mut().covered(&best.placement, frame)?;
            map.add_frame(&roi, self.evaluator.problem().content(), &covered, frames.len());
        }
        Ok(Some(map))
    }

    /// All of `result.json` but the times.
    pub(super) fn record(
        &mut self,
        scene: &Scene,
        finding: Finding,
        stopped: String,
        bar: &ProgressBar,
    ) -> Result<RunRecord, Error> {
        let baselines = self.settings.baselines.clone();
        let baselines = self.scored(&baselines, bar)?;
        let Finding { best, methods, mut certificate, findings } = finding;
        let constraints = self.evaluator.constraints();
        if let Some(certificate) = certificate.as_mut().filter(|c| c.gain.is_some()) {
            if constraints.ties.any() {
                certificate.gain_says += " (over placements that need not be symmetric or level)";
            }
            if let Some(cell) = self.auto.as_ref().and_then(Auto::cell) {
                certificate.gain_says += &format!(" (over triangles merged within {cell} m)");
            }
        }
        Ok(RunRecord {
            sightline: env!("CARGO_PKG_VERSION"),
            scene: scene.name().to_owned(),
            settings: serde_json::json!(self.settings),
            backend: self.evaluator.backend().name().to_owned(),
            adapter: self.evaluator.backend().adapter().to_owned(),
            backend_changes: Vec::new(),
            threads: rayon::current_num_threads(),
            seed: self.settings.search.seed,
            objective: self.objective.to_string(),
            modelled: ModelledRun {
                scores: self.evaluator.problem().modelled(),
                merging: self.auto.as_ref().and_then(Auto::merging),
            },
            search_frames: 0,
            frames: self.evaluator.problem().frame_count(),
            stopped,
            ended: self.ended_in_words(),
            left_out: self.settings.left_out.clone(),
            constraints: in_words(constraints),
            generations: self.search.generation(),
            evaluations: self.search.evaluations(),
            active_bounds: best
                .as_ref()
                .map(|best| active_bounds(&best.placement, constraints))
                .unwrap_or_default(),
            best,
            baselines,
            fidelity: self.auto.as_ref().map(|auto| auto.report(self.search.evaluations())),
            certificate,
            methods,
            findings,
            rate: 0.0,
            timings: RunTimes::default(),
            peak_memory: peak_memory(),
        })
    }
}

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
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes << 10)
}

pub(super) fn print(args: &Args, record: &RunRecord, folder: &Path) -> Result<(), Error> {
    if args.format == Format::Json {
        return outln!("{}", serde_json::json!(record));
    }
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    outln!("{}\n", verdict(record.best.as_ref(), &record.baselines, &record.objective))?;
    outln!("{}: maximizing {} over {} frame(s)", record.scene, record.objective, record.frames)?;
    out!("{}", table::scores(&rows))?;
    match &record.best {
        Some(best) => {
            outln!("\noptimized placement (m, rad):")?;
            let titles = ["LiDAR", "x", "y", "z", "roll", "pitch", "yaw"];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            for (index, pose) in best.placement.lidars.iter().enumerate() {
                let mut row = vec![index.to_string()];
                row.extend(pose.fields().map(|(_, value)| format!("{value:.3}")));
                rows.push(row);
            }
            out!("{}", table::align(&rows))?;
            for bound in &record.active_bounds {
                outln!("  active: {bound}")?;
            }
            if !record.constraints.is_empty() {
                outln!("\nrules kept: {}", record.constraints.join("; "))?;
            }
            outln!("\nfound by: {}", methods_in_words(record))?;
            outln!("certificate: {}", certificate_in_words(record))?;
            outln!("\n{}", table::findings(&record.findings))?;
        }
        None => outln!("\nno candidate kept the rules of the mount; widen it")?,
    }
    if let Some(words) = record.fidelity.as_ref().and_then(|f| f["words"].as_str()) {
        outln!("\n{words}")?;
    }
    outln!(
        "\nstopped: {}, after {} evaluations in {:.1} s ({:.1} placements × frames/s on {}); report: \
         {}",
        record.stopped,
        record.evaluations,
        record.timings.total,
        record.rate,
        record.backend,
        folder.join("report.html").display()
    )
}
