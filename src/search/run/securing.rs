//! Requirements that are to hold within the mounting tolerance, too.

use super::state::Run;
use crate::score::{HOLDS, Scores};
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::observer::Watch;
use crate::search::tolerance::{FRAMES_OF_COPIES, Instead, Moved, Tolerance};
use crate::vehicle::{Placement, placement_to_nanometres};

/// Moves of a LiDAR, one after the other, at most.
const MOVES: usize = 6;
/// Steps of a move of one search variable, at most, and their length in m or rad.
const STEPS: i32 = 3;
const STEP: f64 = 0.025;
/// Moves that hold in most copies, of which all scores are computed.
const SCORED: usize = 12;

/// A placement beside its scores over all frames and the share of its copies that meet all requirements.
struct Secured {
    placement: Placement,
    scores: Scores,
    holds: f64,
}

impl Secured {
    /// Share of the requirements, and their least shares.
    fn found(&self) -> Vec<(f64, f64)> {
        found(&self.scores)
    }
}

fn found(scores: &Scores) -> Vec<(f64, f64)> {
    scores.required.iter().map(|seen| (seen.share, seen.least)).collect()
}

impl Run {
    /// Moves single LiDARs of the swaps' result a little, one after the other, until 95 % of its copies within the mounting
    /// tolerance meet all requirements, or no move makes more of them do so. Of the moves after which enough copies do, the
    /// one of the largest objective is taken; before that, the one after which most do.
    ///
    /// Does nothing without a tolerance or requirements, and where the result itself does not meet these.
    pub(super) fn secure(&mut self, watch: &mut Watch) -> Result<(), SearchError> {
        let tolerance = self.state.settings.tolerance.filter(Tolerance::is_some);
        let (Some(tolerance), Some(swaps)) = (tolerance, &self.state.swaps) else { return Ok(()) };
        let placement = swaps.placement.clone();
        let Some(mut scores) = self.scores_over_all(std::slice::from_ref(&placement), watch)?
        else {
            return Ok(());
        };
        let scores = scores.remove(0);
        if scores.required.is_empty() || scores.missing() > 0.0 {
            return Ok(());
        }
        let few = self.suite.over(&self.suite.spread(Some(FRAMES_OF_COPIES)));
        let mut evaluator = Evaluator::suite_on_cpu(&few, self.memory() / 2);
        let mut moved = Moved::new(tolerance, &placement, &mut evaluator)?;
        let holds = moved.holds(&[], &found(&scores)).all;
        let mut now = Secured { placement, scores, holds };
        for _ in 0..MOVES {
            if now.holds >= HOLDS || watch.is_over() {
                break;
            }
            let Some(next) = self.more_secure(&now, &moved, &mut evaluator, watch)? else { break };
            moved = Moved::new(tolerance, &next.placement, &mut evaluator)?;
            now = next;
        }
        if let Some(swaps) = &mut self.state.swaps {
            swaps.placement = now.placement;
        }
        Ok(())
    }

    /// The placement after one move; `None` where no move makes more copies meet the requirements.
    fn more_secure(
        &mut self,
        now: &Secured,
        moved: &Moved,
        evaluator: &mut Evaluator,
        watch: &mut Watch,
    ) -> Result<Option<Secured>, SearchError> {
        let moves = self.moves(&now.placement);
        let columns = moved.columns_beside(&now.placement, &moves, evaluator)?;
        let (before, still) = (now.found(), moved.as_it_is(&[]));
        let mut ranked: Vec<(f64, Placement, Instead)> = Vec::new();
        for (placement, instead) in moves.into_iter().zip(columns) {
            // Over all frames a share is taken to change as it does over few.
            let changed = moved.as_it_is(&instead).into_iter().zip(&still);
            let found = before.iter().zip(changed);
            let found = found.map(|((share, least), (new, old))| (share + (new - old), *least));
            let holds = moved.holds(&instead, &found.collect::<Vec<_>>()).all;
            ranked.push((holds, placement, instead));
        }
        // Stable: of equal ones the first.
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked.truncate(SCORED);
        let placements: Vec<Placement> = ranked.iter().map(|(_, p, _)| p.clone()).collect();
        let Some(scores) = self.scores_over_all(&placements, watch)? else { return Ok(None) };
        if let Some(swaps) = &mut self.state.swaps {
            swaps.evaluations += placements.len() as u64;
        }
        let objective = self.objective();
        let guards = objective.guards_against(&now.scores);
        let (mut best, mut best_rank) = (None, (now.holds.min(HOLDS), f64::INFINITY));
        for ((_, placement, instead), scores) in ranked.into_iter().zip(scores) {
            let is_sound = scores.missing() <= 0.0 && objective.guards_against(&scores) <= guards;
            let Some(value) = objective.value(&scores).filter(|_| is_sound) else { continue };
            let holds = moved.holds(&instead, &found(&scores)).all;
            let rank = (holds.min(HOLDS), value);
            if rank > best_rank {
                (best, best_rank) = (Some(Secured { placement, scores, holds }), rank);
            }
        }
        Ok(best)
    }

    /// Placements that keep the rules, a few steps of one search variable away; LiDARs that the rules tie move together.
    fn moves(&self, placement: &Placement) -> Vec<Placement> {
        let constraints = self.suite.constraints();
        let Some(here) = constraints.variables_of(placement) else { return Vec::new() };
        let mut moves = Vec::new();
        for (variable, &(low, high)) in constraints.variable_bounds().iter().enumerate() {
            for steps in (-STEPS..=STEPS).filter(|&steps| steps != 0) {
                let mut there = here.clone();
                there[variable] = (here[variable] + f64::from(steps) * STEP).clamp(low, high);
                let lidars = constraints.poses_of(&there);
                let moved = placement_to_nanometres(&Placement { lidars, ..placement.clone() });
                if moved.lidars != placement.lidars && constraints.violations(&moved).is_empty() {
                    moves.push(moved);
                }
            }
        }
        moves
    }
}
