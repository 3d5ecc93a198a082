//! Climbs of a [`GridSearch`]: LiDARs take turns to move to the pose that gains most.

use std::ops::Range;

use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::grid_search::{GridPlacement, GridSearch};
use crate::engine::BackendError;
use crate::score::Standing;
use crate::search::atlases::Unions;
use crate::vehicle::SensorPose;

/// Best swaps of a sensor that are offered to the guards before the sensor stays where it is.
const OFFERS: usize = 4;

/// Poses that one thread looks at at once.
const FEW_POSES: usize = 4096;

/// Poses that a climb may move a LiDAR to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moves {
    /// At most this many steps along one pose field.
    Along(u32),
    /// To any pose of the grid, or of those that the search keeps to.
    Anywhere,
}

#[derive(Debug, Clone, Copy)]
enum Turn {
    /// A LiDAR, by index.
    Lidar(usize),
    /// A LiDAR and its mirror image, which follows it.
    Pair(usize),
    /// The height of all.
    Height,
}

impl Turn {
    /// Poses of a placement that the turn moves.
    fn of(self, poses: &[u32]) -> &[u32] {
        match self {
            Self::Lidar(lidar) => &poses[lidar..lidar + 1],
            Self::Pair(lidar) => &poses[lidar..lidar + 2],
            Self::Height => poses,
        }
    }
}

enum Swap {
    /// A better placement, and its standing where swaps are checked.
    To(GridPlacement, Option<Standing>),
    /// No placement is better.
    Stay,
    /// The climb is to end; nothing is known of the turn.
    Cut,
}

/// When a climb asks the guards about its swaps.
#[derive(Debug, Clone, Copy)]
pub(super) enum Check {
    /// Never: the caller checks the end, or needs a bound, which bounds placements that violate a guard, too.
    Nothing,
    EachSwap,
}

impl GridSearch {
    /// Moves one LiDAR at a time to the best pose it may move to by `moves`, until none gains any more.
    ///
    /// LiDARs that the rules tie move together: a mirrored pair as one, and where all are to stand at
    /// one height a LiDAR stays at it, and all change it at once. `start` must keep the rules.
    ///
    /// The end violates no guard, so that the climb cannot game the objective, unless `start` violates one and no swap
    /// leads to a placement that does not. Guards take a cast of the whole placement, so they are asked at the end
    /// alone. If one is violated there, the climb is done again and each swap is checked. Requirements need no check: a
    /// missing share is taken off the objective, see [`Self::require`]. Where LiDARs are to look away from the own body,
    /// one turns to it only if fewer places of the requirements are then missing.
    ///
    /// `go_on` is asked before each turn, after every few candidates and as by [`Self::hold_while`], with the poses
    /// cast so far. Once it says no, the turn under way does not count and the climb ends where that turn began,
    /// without a look at guards; `None` where not even the start was cast.
    pub fn climb(
        &mut self,
        evaluator: &mut Evaluator,
        start: &[u32],
        moves: Moves,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<GridPlacement>, SearchError> {
        let Some(end) = self.ascend(evaluator, start, moves, Check::Nothing, go_on)? else {
            return Ok(None);
        };
        let standing = self.standing_while(evaluator, &end, go_on)?;
        // Swaps look away from the own body wherever they can.
        let at_body = self.at_own_body(evaluator, &end.poses)?;
        if standing.is_none_or(|standing| standing.guards <= at_body) {
            return Ok(Some(end));
        }
        self.ascend(evaluator, start, moves, Check::EachSwap, go_on)
    }

    /// A climb that checks its swaps by `check`; `go_on` and `None` work as in [`Self::climb`].
    pub(super) fn ascend(
        &mut self,
        evaluator: &mut Evaluator,
        start: &[u32],
        moves: Moves,
        check: Check,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<GridPlacement>, SearchError> {
        let Some(value) = self.value_while(evaluator, start, go_on)? else { return Ok(None) };
        let mut here = GridPlacement { poses: start.to_vec(), value };
        let mut held = match check {
            Check::Nothing => None,
            Check::EachSwap => match self.standing_while(evaluator, &here, go_on)? {
                None => return Ok(Some(here)),
                known => known,
            },
        };
        let is_sound = held.is_none_or(|held| held.is_sound());
        let mut least = if is_sound { here.value } else { f64::NEG_INFINITY };
        let turns = self.turns(start);
        let (mut settled, mut turn) = (0, 0);
        while settled < turns.len() && self.may_turn(go_on) {
            let from = (&here.poses[..], turns[turn], moves);
            match self.best_swap(evaluator, from, (least, held), go_on)? {
                Swap::Cut => return Ok(Some(here)),
                Swap::To(better, standing) => {
                    (least, held) = (better.value, standing);
                    here = better;
                    settled = 0;
                }
                Swap::Stay => settled += 1,
            }
            turn = (turn + 1) % turns.len();
        }
        Ok(Some(here))
    }

    /// Turns of a placement: each LiDAR, or mirrored pair (by its first), and the height of all.
    fn turns(&self, poses: &[u32]) -> Vec<Turn> {
        let grid = self.atlas.grid();
        let symmetric = self.constraints.ties.symmetric;
        let mut turns = Vec::new();
        let mut lidar = 0;
        while lidar < poses.len() {
            let image = grid.mirrored(poses[lidar]);
            let paired = symmetric && image != poses[lidar] && poses.get(lidar + 1) == Some(&image);
            turns.push(if paired { Turn::Pair(lidar) } else { Turn::Lidar(lidar) });
            lidar += if paired { 2 } else { 1 };
        }
        if self.constraints.ties.equal_height {
            turns.push(Turn::Height);
        }
        turns
    }

    /// The placement after one random turn, which moves a LiDAR, and those tied to it, to any pose of the pool.
    pub(super) fn kicked(&self, poses: &[u32], rng: &mut impl Rng) -> Vec<u32> {
        let turns = self.turns(poses);
        let turn = turns[rng.random_range(0..turns.len())];
        if let Turn::Lidar(lidar) = turn {
            // The choice below, without a list of placements: a fine grid has millions of poses.
            let to = self.targets(poses, lidar, Moves::Anywhere);
            return match to.len() {
                0 => poses.to_vec(),
                count => with(poses, &[(lidar, to[rng.random_range(0..count)])]),
            };
        }
        let mut candidates = self.candidates(poses, turn, Moves::Anywhere);
        match candidates.len() {
            0 => poses.to_vec(),
            count => candidates.swap_remove(rng.random_range(0..count)),
        }
    }

    /// Poses that a LiDAR may move to so that the placement keeps the rules.
    fn targets(&self, here: &[u32], lidar: usize, moves: Moves) -> Vec<u32> {
        let (grid, ties, from) = (self.atlas.grid(), self.constraints.ties, here[lidar]);
        let others = without(here, lidar..lidar + 1);
        let keeps = |&to: &u32| {
            let level = !ties.equal_height || grid.at_height_of(to, from) == to;
            level && (!ties.symmetric || grid.mirrored(to) == to) && self.fits(to, &others)
        };
        self.reach(here, lidar, moves)
            .into_par_iter()
            .with_min_len(FEW_POSES)
            .filter(keeps)
            .collect()
    }

    /// Poses that a LiDAR may move to, whatever the rules.
    fn reach(&self, here: &[u32], lidar: usize, moves: Moves) -> Vec<u32> {
        let grid = self.atlas.grid();
        match moves {
            Moves::Along(radius) => grid.along(here[lidar], radius),
            Moves::Anywhere => {
                let own = grid.poses_of_lidar(lidar);
                match &self.pool {
                    None => own.collect(),
                    Some(pool) => pool.range(own).copied().collect(),
                }
            }
        }
    }

    /// Placements that a turn may lead to and that keep the rules.
    fn candidates(&self, here: &[u32], turn: Turn, moves: Moves) -> Vec<Vec<u32>> {
        let grid = self.atlas.grid();
        let ties = self.constraints.ties;
        let level = |from: u32, to: u32| !ties.equal_height || grid.at_height_of(to, from) == to;
        match turn {
            Turn::Lidar(lidar) => {
                let to = self.targets(here, lidar, moves).into_iter();
                to.map(|to| with(here, &[(lidar, to)])).collect()
            }
            Turn::Pair(lidar) => {
                let from = here[lidar];
                let others = without(here, lidar..lidar + 2);
                let both = |to: u32| (to, grid.mirrored(to));
                let reach = self.reach(here, lidar, moves).into_iter();
                let mut to: Vec<(u32, u32)> = reach.map(both).collect();
                to.retain(|&(to, image)| {
                    let fits = self.fits(to, &others) && self.fits(image, &others);
                    level(from, to) && fits && self.fits(to, &[image])
                });
                let moved = |(to, image)| with(here, &[(lidar, to), (lidar + 1, image)]);
                to.into_iter().map(moved).collect()
            }
            Turn::Height => {
                let levels =
                    self.reach(here, 0, moves).into_iter().map(|to| grid.at_height_of(here[0], to));
                let mut levels: Vec<u32> = levels.collect();
                levels.sort_unstable();
                levels.dedup();
                let moved = |to: u32| here.iter().map(move |&pose| grid.at_height_of(pose, to));
                let mut all: Vec<Vec<u32>> =
                    levels.into_iter().map(|to| moved(to).collect()).collect();
                all.retain(|poses| poses.iter().all(|&pose| self.fits(pose, &[])));
                all
            }
        }
    }

    /// The objective of each candidate of a turn; `−∞` where it does not exist.
    fn values_of(&mut self, candidates: &[Vec<u32>], turn: Turn) -> Vec<f64> {
        if let (Turn::Lidar(lidar), Some(first)) = (turn, candidates.first()) {
            // The others are the same in all: their union is made once.
            let to: Vec<u32> = candidates.iter().map(|poses| poses[lidar]).collect();
            let values = self.values_with(&without(first, lidar..lidar + 1), &to);
            return values.into_iter().map(|(_, value)| value).collect();
        }
        self.evaluations += candidates.len() as u64;
        let value = |union: &mut Unions, poses: &Vec<u32>| {
            let Some((&last, others)) = poses.split_last() else { return f64::NEG_INFINITY };
            self.atlas.union(others, union);
            self.value_with(union, last)
        };
        candidates.par_iter().map_init(Unions::default, value).collect()
    }

    /// Best placement of a turn that beats `least`. Where `held`, the standing before the turn, is known, the result is
    /// sound or breaks the rules by less, and comes with its own standing.
    fn best_swap(
        &mut self,
        evaluator: &mut Evaluator,
        (here, turn, moves): (&[u32], Turn, Moves),
        (least, held): (f64, Option<Standing>),
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Swap, SearchError> {
        // A LiDAR that looks at the own body leaves, whatever the objective loses.
        let leaves = self.at_own_body(evaluator, turn.of(here))? > 0;
        let least = if leaves { f64::NEG_INFINITY } else { least };
        let candidates = self.candidates(here, turn, moves);
        let mut better = Vec::new();
        for (index, some) in candidates.chunks(self.at_once(here, turn)).enumerate() {
            let is_cut = index > 0 && !go_on(self.atlas.poses_cast());
            if is_cut || !self.atlas.hold_while(evaluator, &some.concat(), go_on)? {
                return Ok(Swap::Cut);
            }
            let values = self.values_of(some, turn);
            let placements = some.iter().zip(values).filter(|(_, value)| *value > least);
            better.extend(placements.map(|(p, value)| GridPlacement { poses: p.clone(), value }));
        }
        // Stable: of equal placements the one with the lower number of a pose comes first.
        better.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut offers = 0;
        for placement in better {
            let is_at_body = self.at_own_body(evaluator, turn.of(&placement.poses))? > 0;
            let is_worth_it = match (is_at_body, leaves) {
                (true, _) => self.lacks_less(evaluator, &placement.poses, here)?,
                (false, true) => !self.lacks_less(evaluator, here, &placement.poses)?,
                (false, false) => true,
            };
            if !is_worth_it {
                continue;
            }
            let Some(held) = held else { return Ok(Swap::To(placement, None)) };
            offers += 1;
            if offers > OFFERS {
                break;
            }
            let Some(standing) = self.standing_while(evaluator, &placement, go_on)? else {
                return Ok(Swap::Cut);
            };
            // A swap that is not sound counts if less is missing: requirements may be won back step by step.
            if standing.is_sound() || standing.violation < held.violation {
                return Ok(Swap::To(placement, Some(standing)));
            }
        }
        Ok(Swap::Stay)
    }

    /// Poses that look at the own body, by their number; 0 where that does not matter.
    pub(super) fn at_own_body(
        &self,
        evaluator: &mut Evaluator,
        poses: &[u32],
    ) -> Result<usize, BackendError> {
        if !self.looks_away {
            return Ok(0);
        }
        let lidars: Vec<SensorPose> =
            poses.iter().map(|&pose| self.atlas.grid().pose(pose)).collect();
        evaluator.at_own_body(&lidars)
    }

    /// True if one placement misses less of the requirements than another.
    fn lacks_less(
        &mut self,
        evaluator: &mut Evaluator,
        one: &[u32],
        other: &[u32],
    ) -> Result<bool, SearchError> {
        if !self.has_requirements() {
            return Ok(false);
        }
        // An atlas that forgets may not hold them any more.
        self.hold(evaluator, &[one, other].concat())?;
        Ok(self.lacks(one)[0] < self.lacks(other)[0])
    }

    /// Candidates of a turn between two calls of `go_on`: no more than fit into the atlas.
    fn at_once(&self, here: &[u32], turn: Turn) -> usize {
        let moved = match turn {
            Turn::Lidar(_) => 1,
            Turn::Pair(_) => 2,
            Turn::Height => here.len(),
        };
        let room = self.atlas.capacity().saturating_sub(here.len() - moved) / moved;
        self.poses_at_once(moved).min(room).max(1)
    }
}

fn without(poses: &[u32], lidars: Range<usize>) -> Vec<u32> {
    [&poses[..lidars.start], &poses[lidars.end..]].concat()
}

fn with(poses: &[u32], moved: &[(usize, u32)]) -> Vec<u32> {
    let mut poses = poses.to_vec();
    moved.iter().for_each(|&(lidar, pose)| poses[lidar] = pose);
    poses
}
