//! All of `result.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::columns::align_columns;
use super::coverage::seen_ground;
use super::next_steps::next_in_text;
use super::plot::{Change, ReferenceLine};
use super::tables::rows_by_scene;
use super::targets::range_card_text;
use super::text::{
    findings_text, limit_of, poses_text, rule_lines, scores_text_by, stopped_in_words,
};
use super::words::{
    bound_in_words, broken_in_words, climbs_in_words, frames_in_words, methods_in_words,
    run_verdict, spread_in_words,
};
use super::{Axis, Plot, Series};
use crate::json::counted;
use crate::near_field::{BlindDepths, NEAR, NearField, RING};
use crate::problem::Modelled;
use crate::scan::conditions::under;
use crate::score::percent_down;
use crate::search::{
    Certificate, Climbs, Finding, FramesUsed, GainSpread, GenerationRecord, LeftOut, Member,
    MethodRecord, Outcome, PLAIN, PhaseCheck, Scored, Suite, rules_in_words,
};

/// Wall times of a run in seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTimes {
    /// Reading files.
    pub load: f64,
    /// P-SOG and trees.
    pub build: f64,
    /// Choosing sensors of a vehicle, before the search.
    #[serde(default)]
    pub equip: f64,
    /// The search.
    pub search: f64,
    /// Generations of the search, without going to other frames.
    pub generations: f64,
    /// Generations without scoring: asking, telling, ranking, writing the checkpoint.
    pub bookkeeping: f64,
    /// Swaps of the search.
    #[serde(default)]
    pub swaps: f64,
    /// Bounds of the search behind the certificate.
    #[serde(default)]
    pub bounds: f64,
    /// Scoring result and baselines over all frames.
    pub confirm: f64,
    /// Looking at the result for its page, and drawing it.
    #[serde(default)]
    pub page: f64,
    /// All together.
    pub total: f64,
}

/// All of `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunRecord {
    /// Version of the program.
    pub sightline: &'static str,
    /// Name of the scene; all names where there are several.
    pub scene: String,
    /// Each of several scenes, and their mirror images; empty where there is one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<SceneRecord>,
    /// Every setting that decides about the result.
    pub settings: Value,
    /// Command line that repeats the run but for its engine; empty where no program ran.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub command: String,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Device as reported.
    pub adapter: String,
    /// Devices lost during the run and their replacements, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub backend_changes: Vec<String>,
    /// Threads of the CPU backend.
    pub threads: usize,
    /// Seed of the search.
    pub seed: u64,
    /// Objective that was maximized.
    pub objective: String,
    /// Weather and faults that it was maximized under, as they are written; empty in clear air.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Size of the model that the scores below are taken over.
    pub modelled: Modelled,
    /// Frames that the search averaged over.
    pub search_frames: usize,
    /// Frames that the scores below average over.
    pub frames: usize,
    /// Frames that result and baselines are scored over; `stopped` tells where these are not all.
    #[serde(skip)]
    pub confirmed_frames: usize,
    /// Why the search ended: a name, and after a colon its meaning.
    pub stopped: String,
    /// Rigs that `--fewest` did not try for want of time, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub untried: Option<String>,
    /// Instances of the CMA-ES that ended before it, and why, in words.
    pub ended: Vec<String>,
    /// Layouts of `--inject` that were not used.
    pub left_out: Vec<LeftOut>,
    /// Models on each mount of a vehicle, and their price together, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub equipment: Option<String>,
    /// Rules that every placement of the search keeps, in words.
    pub constraints: Vec<String>,
    /// Generations run.
    pub generations: u64,
    /// Placements evaluated by the search.
    pub evaluations: u64,
    /// The result; `None` when no candidate kept the rules of the mount.
    pub best: Option<Scored>,
    /// Mount of each LiDAR of the result, where mounts have names; `None` for one that stands on none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mounts: Vec<Option<String>>,
    /// Ground near the vehicle that the result sees in the first scene; `None` without a result, own body or ground, and
    /// before anybody looked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_field: Option<NearRecord>,
    /// Hand-made layouts to compare with.
    pub baselines: Vec<Scored>,
    /// Gain over the best baseline beside the scenes' own spread; `None` for one scene, or without a baseline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spread: Option<GainSpread>,
    /// Objectives of result and best baseline at random draws that the search has not seen; `None` if nothing is
    /// random.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phases: Option<PhaseCheck>,
    /// Bounds on how much better than the result another placement could be; `None` without a result.
    pub certificate: Option<Certificate>,
    /// Result of each search method, and which one won.
    pub methods: Vec<MethodRecord>,
    /// How far apart the climbs of the swaps ended; `None` without swaps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub climbs: Option<Climbs>,
    /// Correlations of layout properties with the objective, over random placements on the grid.
    pub findings: Vec<Finding>,
    /// Frames that `--fidelity auto` used, saved and risked; `None` where the frames were given.
    pub fidelity: Option<FramesUsed>,
    /// Pose fields of the result that lie on a bound of the mount, and other rules that it just keeps,
    /// in words.
    pub active_bounds: Vec<String>,
    /// Placements × frames a second during the search.
    pub rate: f64,
    /// Wall times.
    pub timings: RunTimes,
    /// Most bytes of memory that the process held; `None` where the system does not tell.
    pub peak_memory: Option<u64>,
}

/// Near field of a result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NearRecord {
    /// Frames that it is taken over.
    pub frames: usize,
    /// Shares, blind zone and poles.
    #[serde(flatten)]
    pub near: NearField,
    /// Near field of the best baseline; `None` without one.
    #[serde(skip)]
    pub rival: Option<NearField>,
}

impl NearRecord {
    /// Depth of the blind zone on each side, and shares of the ground that are seen.
    fn in_words(&self) -> String {
        let near = &self.near;
        let ([worst, of_ring], frames) = (near.worst_in_words(), counted(self.frames, "frame"));
        let ring = |ring| format!(", {:.1} %{of_ring} within {RING} m", percent_down(ring));
        format!(
            "blind zone, ground before the body that no beam reaches, over {frames}: {}\n\
             ground seen: {:.1} %{worst} within {NEAR} m{}\n{}\n",
            BlindDepths::from(near).in_words(),
            percent_down(near.near_field),
            near.ring.map(ring).unwrap_or_default(),
            seen_ground()
        )
    }
}

/// One of several scenes of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneRecord {
    /// Its name, as the scores by scene have it.
    pub name: String,
    /// True if it is the mirror image of the one before it.
    pub mirrored: bool,
    /// Frames that the scores average over.
    pub frames: usize,
    /// Size of the model that they are taken over.
    pub modelled: Modelled,
}

impl SceneRecord {
    /// Each of several scenes of a suite; none where there is one.
    pub fn several(suite: &Suite) -> Vec<Self> {
        let several = suite.members().iter().filter(|_| !suite.is_single());
        several.map(Self::of).collect()
    }

    fn of(member: &Member) -> Self {
        let (name, problem) = (member.name().to_owned(), member.problem());
        let (frames, modelled) = (problem.frame_count(), problem.modelled());
        Self { name, mirrored: member.is_mirrored(), frames, modelled }
    }
}

impl RunRecord {
    /// The record for other programs: scores to the bit, as every engine has them, and poses as they were scored; last the
    /// result in words.
    pub fn json(&self) -> Value {
        let mut all = json!(self);
        all["verdict"] = json!(run_verdict(self).replace('\n', " "));
        all
    }

    /// The record of an outcome over the scenes of a suite, of which `scene` names a single one. Settings, command, seed,
    /// objective and all else that neither holds are left empty.
    pub fn new(outcome: &Outcome, suite: &Suite, scene: &str) -> Self {
        let outcome = outcome.clone();
        let scenes = SceneRecord::several(suite);
        let found = outcome.best.as_ref().map(|best| &best.placement);
        let mounts = found.map(|found| suite.constraints().mount_names(found));
        let mounts =
            mounts.unwrap_or_default().into_iter().map(|name| name.map(str::to_owned)).collect();
        let names: Vec<&str> = scenes.iter().map(|scene| &*scene.name).collect();
        let stopped = stopped(&outcome, suite.frame_count());
        Self {
            sightline: env!("CARGO_PKG_VERSION"),
            scene: if names.is_empty() { scene.to_owned() } else { names.join(", ") },
            scenes,
            settings: Value::Null,
            command: String::new(),
            backend: outcome.backend,
            adapter: outcome.adapter,
            backend_changes: outcome.backend_changes,
            threads: rayon::current_num_threads(),
            seed: 0,
            objective: String::new(),
            conditions: Vec::new(),
            modelled: suite.modelled(),
            search_frames: outcome.search_frames,
            frames: suite.frame_count(),
            confirmed_frames: outcome.confirmed_frames,
            stopped,
            untried: outcome.untried,
            ended: outcome.ended,
            left_out: outcome.left_out,
            equipment: None,
            constraints: rules_in_words(suite.constraints()),
            generations: outcome.history.len() as u64,
            evaluations: outcome.evaluations,
            best: outcome.best,
            mounts,
            near_field: None,
            baselines: outcome.baselines,
            spread: outcome.spread,
            phases: outcome.phases,
            certificate: outcome.certificate,
            methods: outcome.methods,
            climbs: outcome.climbs,
            findings: outcome.findings,
            fidelity: outcome.frames_used,
            active_bounds: outcome.active_bounds,
            rate: 0.0,
            timings: RunTimes::default(),
            peak_memory: None,
        }
    }
}

/// Why a run has ended, over how many frames its result is scored where these are not all, and how many baselines are not
/// scored.
fn stopped(outcome: &Outcome, frames: usize) -> String {
    let (mut text, confirmed) = (outcome.stopped.to_string(), outcome.confirmed_frames);
    if confirmed < frames {
        let frames = frames_in_words(confirmed, frames);
        text += &format!("; result and baselines are scored over {frames}");
    }
    match outcome.unscored_baselines {
        0 => text,
        1 => format!("{text}; 1 baseline is not scored"),
        left => format!("{text}; {left} baselines are not scored"),
    }
}

/// Most bytes that the process has held; `None` where the system does not tell.
pub(crate) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes << 10)
}

/// Meaning of the baseline that a choice of sensors comes with.
const PLAIN_IN_WORDS: &str = "these sensors, placed without a search: level in the middle of their mounts or evenly around \
                              their edges";

/// Range card and near field of the result; empty where nobody looked.
fn seen_text(record: &RunRecord) -> String {
    let card = record.best.as_ref().and_then(|best| best.scores.range_card.as_ref());
    let card = card.map(range_card_text);
    let near = record.near_field.as_ref().map(NearRecord::in_words);
    card.into_iter().chain(near).map(|part| part + "\n").collect()
}

/// Result of a run and its folder as text: verdict, range card, near field, scores with requirements, then the rest.
pub(crate) fn record_text(record: &RunRecord, folder: &Path) -> String {
    let mut text = String::new();
    let mut rows: Vec<_> = record.best.iter().map(|best| best.scores.clone()).collect();
    rows.extend(record.baselines.iter().map(|baseline| baseline.scores.clone()));
    text += &format!("{}\n\n", run_verdict(record).replace('\n', "\n- "));
    next_in_text(record).iter().for_each(|step| text += &format!("{step}\n\n"));
    if let Some(words) = spread_in_words(record) {
        text += &format!("{words}\n\n");
    }
    text += &seen_text(record);
    text += &format!(
        "{}: maximizing {} over {}{}\n",
        record.scene,
        record.objective,
        frames_in_words(record.confirmed_frames, record.frames),
        under(&record.conditions)
    );
    text += &scores_text_by(&rows, &record.objective);
    if record.baselines.iter().any(|baseline| baseline.placement.name == PLAIN) {
        text += &format!("{PLAIN}: {PLAIN_IN_WORDS}\n");
    }
    // Guards stand in the table.
    let broken = broken_in_words(&record.baselines);
    if !broken.is_empty() {
        text +=
            "\nbaselines that break rules of the mount, with which the result is not compared:\n";
        broken.iter().for_each(|line| text += &format!("  {line}\n"));
    }
    let best = record.best.as_ref();
    if let Some(rows) = rows_by_scene(&record.scenes, best, &record.baselines, &record.objective) {
        text += "\nscene by scene\n";
        text += &align_columns(&rows);
    }
    if let Some(words) = &record.equipment {
        text += &format!("\nequipment: {words}\n");
    }
    text += &match &record.best {
        Some(best) => best_text(best, record),
        None => {
            let objective = &record.objective;
            format!(
                "\nno candidate both kept the rules of the mount and had a value of {objective}\n"
            )
        }
    };
    if let Some(frames) = &record.fidelity {
        text += &format!("\n{}\n", frames.words);
    }
    text + &format!(
        "\n{} in {:.1} s ({:.1} placements × frames/s on {}); report: {}\n",
        stopped_in_words(&record.stopped, limit_of(record), &evaluations_in_words(record)),
        record.timings.total,
        record.rate,
        record.backend,
        folder.join("report.html").display()
    )
}

/// Placements that each method looked at, in full numbers: `180 evaluations and 360 of swaps`.
pub(super) fn evaluations_in_words(record: &RunRecord) -> String {
    let swaps = record.methods.iter().find(|method| method.method == "swaps");
    let ran = format!("{} evaluations", record.evaluations);
    match swaps.map(|swaps| swaps.evaluations) {
        Some(swaps) if record.evaluations == 0 => format!("{swaps} evaluations of swaps"),
        Some(swaps) => format!("{ran} and {swaps} of swaps"),
        None => ran,
    }
}

/// Poses, rules and certificate of the placement found.
fn best_text(best: &Scored, record: &RunRecord) -> String {
    let mut text = String::new();
    text += "\noptimized placement (m, rad):\n";
    text += &poses_text(&best.placement, &record.mounts);
    if let Some(phases) = &record.phases {
        text += &format!("\n{}\n", phases.words);
    }
    for bound in &record.active_bounds {
        text += &format!("  {bound}\n");
    }
    if !record.constraints.is_empty() {
        text += &format!(
            "\nrules of the mounts kept: {}\n",
            rule_lines(&record.constraints).join("\n  ")
        );
    }
    text += &format!("\nfound by: {}\n", methods_in_words(record));
    if let Some(climbs) = climbs_in_words(record) {
        text += &format!("how sure: {climbs}.\n");
    }
    // The paper's bound tells nothing about a result; the JSON has it.
    if let Some(certificate) = &record.certificate {
        text += &format!("bound: {}\n", bound_in_words(certificate, best));
    }
    match &*findings_text(&record.findings, &record.objective) {
        "" => text,
        findings => text + "\n" + findings,
    }
}

/// The best and the median objective against evaluations. Baselines and result are lines across, since swaps may find
/// the result after the generations. Curves end at each change of frames in `steps`, (generation, frames), the start
/// first: values over other frames do not compare. An upright line marks it.
pub(crate) fn convergence_svg(
    history: &[GenerationRecord],
    objective: &str,
    baselines: &[Scored],
    best: Option<&Scored>,
    steps: &[(u64, u32)],
) -> String {
    let points = |value: fn(&GenerationRecord) -> Option<f64>| -> Vec<(f64, f64)> {
        history.iter().filter_map(|r| Some((r.evaluations as f64, value(r)?))).collect()
    };
    let series = |name: &str, points| Series {
        name: name.to_owned(),
        points,
        line: true,
        ..Series::default()
    };
    let level = |scored: &'_ Scored, name, accent| {
        Some(ReferenceLine { name, value: scored.objective?, accent })
    };
    let mut levels: Vec<ReferenceLine> =
        baselines.iter().filter_map(|b| level(b, b.placement.name.as_str(), false)).collect();
    levels.extend(best.and_then(|best| level(best, "the result", true)));
    let mut drawn = vec![
        series("best so far", points(|r| r.best_so_far.filter(|_| r.missing.is_none()))),
        series("best that misses requirements", points(|r| r.missing.and(r.best_so_far))),
        series("median of a generation", points(|r| r.median)),
    ];
    drawn.retain(|series| !series.points.is_empty());
    let plot = Plot {
        title: "Convergence of the search".to_owned(),
        x_title: "placements evaluated".to_owned(),
        y_title: format!("{objective} (larger is better)"),
        x: Axis::Numbers,
        series: drawn,
    };
    let change = |&(generation, frames): &(u64, u32)| {
        let last = history.iter().rfind(|record| record.generation <= generation)?;
        let (at, name) = (last.evaluations as f64, counted(frames as usize, "frame"));
        Some(Change { at, name, ends_curves: true })
    };
    let steps = steps_of_generations(steps, history.len() as u64);
    let changes: Vec<Change> = steps.iter().skip(1).filter_map(change).collect();
    plot.svg_with(&levels, &changes)
}

/// Steps that the generations follow; a last step for the swaps alone is left out.
pub(super) fn steps_of_generations(steps: &[(u64, u32)], generations: u64) -> Vec<(u64, u32)> {
    steps.iter().copied().filter(|(generation, _)| *generation < generations).collect()
}

#[cfg(test)]
mod tests;
