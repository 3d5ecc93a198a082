//! Settings of a study.

use std::path::PathBuf;

use super::region::Subregion;
use crate::engine::EngineChoice;
use crate::scan::conditions::Condition;
use crate::score::Objective;
use crate::vehicle::Placement;

/// Settings of a study: with its scenes they decide about every number.
#[derive(Debug, Clone)]
pub struct StudySettings {
    /// Score that searches maximize.
    pub objective: Objective,
    /// Placements that each search evaluates before swaps.
    pub evaluations: u64,
    /// Frames to average over, spread evenly over the scene.
    pub frames: u32,
    /// Random placements, where the study draws some.
    pub random: u32,
    /// Edge of a voxel in metres, for [`Kind::Published`](super::Kind::Published).
    pub voxel: f64,
    /// Seed of all randomness.
    pub seed: u64,
    /// Sensor files to compare beside the channels.
    pub sensors: Vec<PathBuf>,
    /// Regions to look at beside the standard ones.
    pub regions: Vec<Subregion>,
    /// Own rigs to look at, for kinds that [take some](super::Kind::takes_placements), in place of placements that are
    /// searched and of the layouts of the paper.
    pub placements: Vec<Placement>,
    /// Most that the sensors of a placement that is searched may cost, in the currency of the vehicle's prices; `None`
    /// sets no limit.
    pub budget: Option<f64>,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
    /// Engine that computes; every engine gives the same bits.
    pub engine: EngineChoice,
}

impl Default for StudySettings {
    fn default() -> Self {
        Self {
            objective: Objective::default(),
            evaluations: 120,
            frames: 2,
            random: 200,
            voxel: 0.1,
            seed: 1,
            sensors: Vec::new(),
            regions: Vec::new(),
            placements: Vec::new(),
            budget: None,
            conditions: Vec::new(),
            engine: EngineChoice::cpu(),
        }
    }
}
