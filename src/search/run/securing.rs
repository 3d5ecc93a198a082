//! Requirements that are to hold within the mounting tolerance, too.

use super::seeing::places_lost;
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
    /// No move adds the guard `self_hit` or `below_ground`, or loses a car at more places around the vehicle. A move is chosen by copies that flatter it: after each, other copies are drawn, and of all placements on the way the one
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

    /// Placements after one move that hold in most copies, as far as few frames tell, and look no more at the own body.
    fn offers(
        &mut self,
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
        }
        // Stable: of equal ones the first.
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let of_body = now.scores.guards.iter().filter(|guard| guard.is_of_body()).count();
        let car = self.car_all_round();
        let most_lost = places_lost(car.as_ref(), &now.placement)?;
        let mut offers = Vec::new();
        for (_, offer) in ranked {
            if offers.len() == SCORED || watch.is_over() {
                break;
            }
            let lost = places_lost(car.as_ref(), &offer)?;
            if lost <= most_lost && self.guards_of_body(&offer, watch)?.len() <= of_body {
                offers.push(offer);
            }
        }
        Ok(offers)
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
        let scored = self.scored(&offers, judged, watch)?;
        let go_on = &mut || !watch.is_over();
        let columns = moved.columns_beside(&now.placement, &offers, evaluator, go_on)?;
        let Some(columns) = columns else { return Ok(None) };
        let (guards, before) = (now.standing().guards, found(now));
        let (mut best, mut best_rank) = (None, (holds.min(SOUGHT), f64::INFINITY));
        for (scored, instead) in scored.into_iter().zip(columns) {
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

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use serde_json::json;

    use super::*;
    use crate::engine::EngineChoice;
    use crate::problem::Problem;
    use crate::psog::Psog;
    use crate::scene::Scene;
    use crate::search::settings::Settings;

    /// A LiDAR that turns about a mast, with a low wall on its left. The further it turns left, the more copies see the cars
    /// that are required there, and the more beams end at the wall: 24.9 % at 0.025 rad, 25.3 % at 0.05 rad.
    pub(in crate::search::run) fn walled() -> Arc<Scene> {
        let scene = json!({ "sightline": 1, "name": "walled", "coverage": "first-hit",
            "roi": { "min": [-8, -8, -0.5], "max": [8, 8, 2.5], "voxel": [0.5, 0.5, 0.5] },
            "static": [{ "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } }],
            "ego": { "poses": [{ "x": 0, "y": 0, "z": 0 }] },
            "vehicle": {
                "body": [{ "class": "vehicle", "box": { "min": [-0.5, 0.5, 0.5], "max": [0.84, 0.52, 1.465] } }],
                "sensors": [{ "name": "half", "phase": 0, "lidar": { "channels": 32, "fov": [-24, 4],
                    "azimuth": [-90, 90], "azimuth_steps": 180, "range": 60 } }],
                "mounts": [{ "name": "mast", "min": [0, 0, 1.5], "max": [0, 0, 1.5], "yaw": [-1, 1], "count": 1 }],
                "require": [{ "target": "car", "from": 10, "within": 15, "bearing": [0, 120], "share": 0.82 }] } });
        Arc::new(Scene::from_json(&scene.to_string(), Path::new(""), "walled.json").unwrap())
    }

    pub(in crate::search::run) fn run_in(scene: &Scene) -> Run {
        let (roi, classes) = (scene.roi().grid().unwrap(), scene.classes().to_vec());
        // Every third voxel is occupied in one of two frames, by the first class.
        let index: Vec<u64> = (0..roi.voxel_count()).step_by(3).collect();
        let row = (0..classes.len()).map(|class| u16::from(class == 0));
        let counts = row.collect::<Vec<u16>>().repeat(index.len());
        let psog = Psog::new(roi, 2, classes, index, counts).unwrap();
        let problem = Problem::from_scene(scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
        let settings = Settings {
            baselines: Vec::new(),
            tolerance: Some("5mm,2deg".parse().unwrap()),
            engine: EngineChoice::cpu(),
            ..Settings::default()
        };
        Run::new(problem, &settings).unwrap()
    }

    #[test]
    fn no_move_turns_a_lidar_into_the_own_body() {
        let scene = walled();
        let secured = |looks_at_body: bool| {
            let mut run = run_in(&scene);
            if looks_at_body {
                run.look_at_body_in(scene.clone());
            }
            let mut goes_on = |_: &Event| true;
            let watch = &mut Watch::new(&mut goes_on, false);
            let lidars = run.suite.constraints().poses_of(&[0.0]);
            let start = [Placement { name: "start".into(), lidars }];
            let judged = run.judged_over_all(&start, watch).unwrap().unwrap();
            let mut result = run.scored(&start, judged, watch).unwrap().remove(0);
            assert!(run.secure(&mut result, watch).unwrap() > 0);
            run.look_at_body_in(scene.clone());
            let guards = run.guards_of_body(&result.placement, watch).unwrap();
            (result.placement.lidars[0].yaw, guards.len())
        };
        let (free, guards) = secured(false);
        assert!(free > 0.04 && guards == 1, "turned by {free} rad, with {guards} guards");
        // The one move that leaves a quarter of the beams free is still taken.
        let (yaw, guards) = secured(true);
        assert!((yaw - 0.025).abs() < 1e-9 && guards == 0, "turned by {yaw} rad, {guards} guards");
    }
}
