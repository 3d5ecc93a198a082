use std::sync::Arc;

use super::setting::halvings;
use super::world::spread;
use super::{Fidelity, FidelityError, RankingError, World};
use crate::backend::cpu::CpuBackend;
use crate::backend::{Backend, Tally};
use crate::placement::Placement;
use crate::score::{Objective, Scores};

/// Least Kendall τ of a level at which a search may begin.
const LEAST_TAU: f64 = 0.9;

/// A number of frames, and how far it is from all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Frames, spread evenly from the first on.
    pub frames: u32,
    /// Against all frames; `None` where no placement has a score.
    pub error: Option<RankingError>,
}

/// The fewest frames that keep the ranking of `placements`, then twice as many and so on to all.
///
/// Frames are kept fewer as long as top-1 regret stays within `tolerance` up to the upper end of its
/// interval and τ at 0.9 or more. Each frame is scored once, on the CPU: tallies are sums over
/// frames, so that every level comes from the same ones. Voxels, beams and coverage stay the scene's,
/// because another of these would make the score another quantity. No time is measured: the same
/// scene gives the same levels everywhere. `memory` is in bytes.
///
/// # Errors
/// The scene cannot be scored.
pub fn frame_levels(
    world: &mut World,
    placements: &[Placement],
    objective: &Objective,
    tolerance: f64,
    seed: u64,
    memory: u64,
) -> Result<Vec<Level>, FidelityError> {
    let own = Fidelity::of_scene(world.scene());
    if own.through || own.frames == 1 {
        return Ok(vec![Level { frames: own.frames, error: None }]);
    }
    let count = own.frames as usize;
    let mut by_frame: Vec<Vec<Tally>> = Vec::with_capacity(count);
    let content = {
        let psog = world.psog(own.voxel)?;
        world.content(&psog)
    };
    for frame in 0..count {
        let problem = Arc::new(world.problem_over(&own, &[frame])?);
        let range = problem.table().range();
        by_frame.push(CpuBackend::new(problem, memory).tally(placements, range)?);
    }
    let values = |frames: u32| -> Vec<Option<f64>> {
        let chosen = spread(count, frames as usize);
        let sum = |index: usize| {
            let mut sum = Tally::zero(content.classes().len(), placements[index].lidars.len());
            chosen.iter().for_each(|&frame| sum += &by_frame[frame][index]);
            sum
        };
        let scores = (0..placements.len())
            .map(|index| Scores::new("", &sum(index), &content, chosen.len(), true, None));
        scores.map(|scores| objective.value(&scores)).collect()
    };
    let reference = values(own.frames);
    let all = halvings(own.frames).into_iter().map(|frames| {
        let error = RankingError::new(&reference, &values(frames), seed);
        Level { frames, error }
    });
    let mut levels: Vec<Level> = all.take_while(|level| keeps(level, tolerance)).collect();
    if levels.is_empty() {
        levels.push(Level { frames: own.frames, error: None });
    }
    levels.reverse();
    Ok(levels)
}

fn keeps(level: &Level, tolerance: f64) -> bool {
    level.error.is_some_and(|error| {
        error.regret.high <= tolerance && error.tau.is_some_and(|tau| tau.value >= LEAST_TAU)
    })
}
