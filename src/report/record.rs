//! All of `result.json`.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::chart::Merging;
use crate::problem::Modelled;
use crate::score::Scores;
use crate::search::Certificate;
use crate::study::Finding;
use crate::vehicle::Placement;

/// A placement with its scores.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scored {
    /// Name and poses.
    pub placement: Placement,
    /// Scores over all frames of the scene.
    pub scores: Scores,
    /// Its objective; `None` where a score it needs does not exist.
    pub objective: Option<f64>,
    /// Rules of the mount that it breaks, in words.
    pub violations: Vec<String>,
}

/// Wall times of a run in seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTimes {
    /// Reading files.
    pub load: f64,
    /// P-SOG and trees.
    pub build: f64,
    /// The search.
    pub search: f64,
    /// Of it the generations, without what choosing other frames took.
    pub generations: f64,
    /// Of these all but scoring: asking, telling, ranking, writing the checkpoint.
    pub bookkeeping: f64,
    /// Scoring result and baselines over all frames.
    pub confirm: f64,
    /// All together.
    pub total: f64,
}

/// What one way of searching has found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodRecord {
    /// `cma-es` or `swaps`.
    pub method: &'static str,
    /// Its placement's objective over all frames of the scene.
    pub objective: Option<f64>,
    /// Placements that it looked at.
    pub evaluations: u64,
    /// Sensor poses that it cast.
    pub poses_cast: u64,
    /// Whether its placement is the result.
    pub won: bool,
}

/// A layout to start from that was not used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Rules that it breaks, in words.
    pub why: Vec<String>,
}

/// How much of a scene a run modelled.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelledRun {
    /// By what it scored the result and the baselines.
    #[serde(flatten)]
    pub scores: Modelled,
    /// What merging small triangles does to the search, and whether it went by them; `None` where that
    /// was not asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub merging: Option<Merging>,
}

/// All of `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunRecord {
    /// Version of the program.
    pub sightline: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// Every setting that decides about the result.
    pub settings: Value,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Device as reported.
    pub adapter: String,
    /// Devices lost during the run, and what took over, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub backend_changes: Vec<String>,
    /// Threads of the CPU backend.
    pub threads: usize,
    /// Seed of the search.
    pub seed: u64,
    /// What was maximized.
    pub objective: String,
    /// How much of the scene the scores below are taken over.
    pub modelled: ModelledRun,
    /// Frames that the search averaged over.
    pub search_frames: usize,
    /// Frames that the scores below average over.
    pub frames: usize,
    /// Why the search ended: a name, and after a colon what it means.
    pub stopped: String,
    /// Instances of the CMA-ES that ended before it, and why, in words.
    pub ended: Vec<String>,
    /// Layouts of `--inject` that were not used.
    pub left_out: Vec<LeftOut>,
    /// Rules that every placement of the search keeps, in words.
    pub constraints: Vec<String>,
    /// Generations run.
    pub generations: u64,
    /// Placements evaluated by the search.
    pub evaluations: u64,
    /// The result; `None` when no candidate kept the rules of the mount.
    pub best: Option<Scored>,
    /// Hand-made layouts to compare with.
    pub baselines: Vec<Scored>,
    /// How much better than the result another placement could be; `None` without a result.
    pub certificate: Option<Certificate>,
    /// What each way of searching found, and which one gave the result.
    pub methods: Vec<MethodRecord>,
    /// How properties of layouts go with the objective, over random placements on the grid.
    pub findings: Vec<Finding>,
    /// What `--fidelity auto` used, saved and risked; `None` where the frames were given.
    pub fidelity: Option<Value>,
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
