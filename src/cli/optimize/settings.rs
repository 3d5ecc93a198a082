//! What decides about a run, beside the bytes of its inputs.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use sightline::report::LeftOut;
use sightline::search::SearchSettings;
use sightline::vehicle::{MountRules, Placement, read_placements};

use super::Args;
use super::auto::FidelityChoice;
use super::grid::Method;
use crate::cli::error::Error;

/// The layouts of Table 7 of the paper, in our frame.
const TABLE_7: &str = include_str!("../../../scenes/placements.json");

/// Everything that decides about a run's result; kept in its checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RunSettings {
    pub(super) scene: PathBuf,
    /// Frames of the search; `None` leaves them to `auto`.
    pub(super) frames: Option<u32>,
    pub(super) baselines: Vec<Placement>,
    pub(super) method: Method,
    /// Beside those of the scene.
    pub(super) rules: MountRules,
    /// Objective over all frames at which the search ends.
    pub(super) target: Option<f64>,
    /// Layouts of `--inject` that were not used.
    pub(super) left_out: Vec<LeftOut>,
    pub(super) search: SearchSettings,
}

impl RunSettings {
    /// As the options say.
    pub(super) fn of(args: &Args) -> Result<Self, Error> {
        let scene = args.scene.clone().expect("clap requires a scene or --resume");
        let baselines = match &args.baselines {
            Some(file) => read_placements(file)?,
            None => table_7()?,
        };
        Ok(Self {
            scene: std::path::absolute(&scene).map_err(Error::io(&scene))?,
            frames: match args.fidelity {
                FidelityChoice::Full => Some(u32::MAX),
                FidelityChoice::Auto => args.frames,
            },
            baselines,
            method: args.method,
            rules: args.rules.for_mount(),
            target: args.target,
            left_out: Vec::new(),
            search: SearchSettings {
                delta: args.delta,
                batch: args.batch.map(|batch| batch as usize),
                objective: args.objective.clone(),
                evaluations: args.evaluations,
                population: args.population.map(|p| p as usize),
                seed: args.seed,
            },
        })
    }
}

/// The layouts of Table 7 of the paper.
pub fn table_7() -> Result<Vec<Placement>, Error> {
    #[derive(Deserialize)]
    struct File {
        placements: Vec<Placement>,
    }
    serde_json::from_str(TABLE_7)
        .map(|file: File| file.placements)
        .map_err(|source| Error::Json { path: "scenes/placements.json".into(), source })
}
