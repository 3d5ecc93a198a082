//! Requirements that are to hold within the mounting tolerance, too.

use super::state::Run;
use crate::search::copies::{FRAMES_OF_COPIES, Holds, Moved, SEED_OF_SEARCH};
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::observer::{Event, Watch, Work};
use crate::search::outcome::Scored;
use crate::search::tolerance::Tolerance;
use crate::vehicle::{Placement, placement_to_nanometres};

/// Share of the copies that is sought: more than the 95 % that are asked for, since other copies are asked then.
const SOUGHT: f64 = 0.97;
/// Moves of a LiDAR, one after the other, at most.
const MOVES: usize = 6;
/// Moves in a row that bring no more copies to meet all, after which the search for one ends.
const IDLE_MOVES: usize = 2;
/// Moves of one search variable, m or rad.
const STEPS: [f64; 6] = [-0.075, -0.05, -0.025, 0.025, 0.05, 0.075];
/// Share of the room above a requirement that all copies meet which a move must leave.
const ROOM_LEFT: f64 = 0.5;
/// Moves that hold in most copies, of which all scores are computed.
const SCORED: usize = 12;
/// Moves whose beams are cast between two looks at the time: no more LiDARs at once than a placement has.
const CAST_AT_ONCE: usize = 6;

/// Requirements of a placement, and their least shares.
fn found(scored: &Scored) -> Vec<(f64, f64)> {
    scored.scores.required.iter().map(|seen| (seen.share, seen.least)).collect()
}

impl Run {
    /// Moves single LiDARs of a result a little, one after the other, until 97 % of its copies within the mounting tolerance
    /// meet all requirements, or moves make no more of them do so. If enough copies do after several moves, the move
    /// of the largest objective is taken; else the one after which most do. Returns the placements scored for it.
    ///
    /// A move is chosen by copies that flatter it: after each, other copies are drawn, and of all placements on the way the one
    /// that holds in most of the copies it was not chosen by is the result.
    ///
    /// Does nothing without a tolerance or requirements, and where the result itself does not meet these.
    pub(super) fn secure(
        &mut self,
        result: &mut Scored,
        watch: &mut Watch,
    ) -> Result<u64, SearchError> {
        let tolerance = self.state.settings.tolerance.filter(Tolerance::is_some);
        let required = !result.scores.required.is_empty() && result.scores.missing() <= 0.0;
        let Some(tolerance) = tolerance.filter(|_| required) else { return Ok(0) };
        let few = self.suite.over(&self.suite.spread(Some(FRAMES_OF_COPIES)));
        let mut evaluator = Evaluator::suite_on_cpu(&few, self.memory() / 2);
        let (mut now, mut most, mut idle, mut looked_at) =
            (result.clone(), f64::NEG_INFINITY, 0, 0);
        for round in 0..=MOVES {
            let seed = SEED_OF_SEARCH + round as u64;
            let go_on = &mut || !watch.is_over();
            let required = found(&now);
            let rig = (&now.placement, required.len());
            let moved = Moved::new((tolerance, seed, None), rig, &mut evaluator, go_on)?;
            let Some(moved) = moved else { break };
            let Some(each) = moved.holds(&[], &required, go_on)? else { break };
            let holds = each.all;
            idle += 1;
            if holds.min(SOUGHT) > most {
                (*result, most, idle) = (now.clone(), holds.min(SOUGHT), 0);
            }
            if holds >= SOUGHT || round == MOVES || idle == IDLE_MOVES || watch.is_over() {
                break;
            }
            // Requirements that all copies meet keep room enough, or the move is not taken.
            let moved = moved.only_missed(&each).at_few(true);
            let offers = self.offers(&now, &moved, (&mut evaluator, round), watch)?;
            looked_at += offers.len() as u64;
            let moved = moved.at_few(false);
            let next = self.more_secure((&now, holds), (offers, &moved, &mut evaluator), watch)?;
            let Some(next) = next else { break };
            now = next;
        }
        Ok(looked_at)
    }

    /// Placements after one move that hold in most copies, as far as few frames tell.
    fn offers(
        &self,
        now: &Scored,
        moved: &Moved,
        (evaluator, round): (&mut Evaluator, usize),
        watch: &mut Watch,
    ) -> Result<Vec<Placement>, SearchError> {
        let (before, still) = (found(now), moved.as_it_is(&[]));
        let mut ranked: Vec<(f64, Placement)> = Vec::new();
        let moves = self.moves(&now.placement);
        let count = moves.len();
        let mut moves = moves.into_iter().peekable();
        while moves.peek().is_some() {
            let (done, total) = (round * count + count - moves.len(), MOVES * count);
            let (work, done, total) = (Work::Securing, done as u64, total as u64);
            if !watch.tell(&Event::Progress { work, done, total }) {
                break;
            }
            let some: Vec<Placement> = moves.by_ref().take(CAST_AT_ONCE).collect();
            let go_on = &mut || !watch.is_over();
            let columns = moved.columns_beside(&now.placement, &some, evaluator, go_on)?;
            let Some(columns) = columns else { break };
            for (placement, instead) in some.into_iter().zip(columns) {
                // Over all frames a share is taken to change as it does over few.
                let changed = moved.as_it_is(&instead).into_iter().zip(&still);
                let found = before.iter().zip(changed);
                let found = found.map(|((share, least), (new, old))| (share + (new - old), *least));
                let holds = moved.holds(&instead, &found.collect::<Vec<_>>(), go_on)?;
                let Some(holds) = holds else { break };
                ranked.push((holds.all, placement));
            }
            // Stable: of equal ones the first.
            ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
            ranked.truncate(SCORED);
        }
        Ok(ranked.into_iter().map(|(_, offer)| offer).collect())
    }

    /// The best of some offers by the share of their copies that meet all requirements; `None` where this share rises with
    /// none.
    fn more_secure(
        &mut self,
        (now, holds): (&Scored, f64),
        (offers, moved, evaluator): (Vec<Placement>, &Moved, &mut Evaluator),
        watch: &mut Watch,
    ) -> Result<Option<Scored>, SearchError> {
        let Some(judged) = self.judged_over_all(&offers, watch)? else { return Ok(None) };
        let go_on = &mut || !watch.is_over();
        let columns = moved.columns_beside(&now.placement, &offers, evaluator, go_on)?;
        let Some(columns) = columns else { return Ok(None) };
        let (guards, before) = (now.standing().guards, found(now));
        let (mut best, mut best_rank) = (None, (holds.min(SOUGHT), f64::INFINITY));
        for (scored, instead) in self.scored(&offers, judged).into_iter().zip(columns) {
            let standing = scored.standing();
            let is_sound = standing.violation <= 0.0 && standing.guards <= guards;
            let Some(value) = standing.value.filter(|_| is_sound) else { continue };
            if !moved.keeps_room(&before, &found(&scored), ROOM_LEFT) {
                continue;
            }
            let holds = moved.holds(&instead, &found(&scored), go_on)?;
            let Some(Holds { all: holds, .. }) = holds else { break };
            let rank = (holds.min(SOUGHT), value);
            if rank > best_rank {
                (best, best_rank) = (Some(scored), rank);
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
            for step in STEPS {
                let mut there = here.clone();
                there[variable] = (here[variable] + step).clamp(low, high);
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
