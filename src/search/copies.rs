//! Copies of a placement whose LiDARs are mounted a little off, and requirements in them.

use std::sync::{Arc, Mutex};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::atlas::AreaBits;
use super::evaluator::Evaluator;
use super::suite::Member;
use super::tolerance::Tolerance;
use crate::engine::BackendError;
use crate::problem::Problem;
use crate::score::Seen;
use crate::targets::{Sight, SightBeams};
use crate::vehicle::{Placement, SensorPose, UnknownSensor};

pub(crate) const COPIES: usize = 200;
/// Poses of each LiDAR: its own, and one for each copy, in which targets are looked at.
const POSES_OF_COPIES: usize = 1 + COPIES;
/// Copies by which the first choice among many moves is made.
const FEW_COPIES: usize = 40;
/// Poses of each LiDAR in which areas, ground and overlap are looked at: the first is its own, copies draw from the other 15.
const POSES: usize = 16;
/// Poses whose ground and surfaces are looked at between two questions whether to go on, and copies whose targets are.
const AT_ONCE: usize = 8;
/// Frames of each scene over which areas are looked at in copies, spread evenly.
pub(crate) const FRAMES_OF_COPIES: u32 = 4;
/// Seeds of the moves: every placement is moved alike. A search chooses by other copies than its result is judged by, since
/// the copies that chose it would flatter it.
pub(crate) const SEED_OF_RESULT: u64 = 0x746f_6c65;
pub(crate) const SEED_OF_SEARCH: u64 = 0x7365_6172;

/// Draws behind the share of copies of so many LiDARs that meet the requirements not set aside. For areas, ground and overlap the
/// copies are made of 15 poses of each LiDAR, which are fewer than copies where there are few LiDARs; for targets each has its own.
pub(crate) fn drawn(required: &[Seen], lidars: usize) -> usize {
    let mut judged = required.iter().filter(|seen| seen.least.is_finite());
    if judged.all(|seen| seen.places.is_some()) {
        COPIES
    } else {
        ((POSES - 1) * lidars).min(COPIES)
    }
}

/// Two standard errors of a share of so many draws (Agresti and Coull 1998).
pub(crate) fn error_of_share(share: f64, drawn: usize) -> f64 {
    let drawn = drawn as f64;
    let middle = (share * drawn + 2.0) / (drawn + 4.0);
    2.0 * (middle * (1.0 - middle) / (drawn + 4.0)).sqrt()
}

/// A LiDAR in each of its poses.
pub(crate) struct LidarInPoses {
    own: SensorPose,
    /// Beams on targets in it; empty where no rule looks for targets.
    on_targets: SightBeams,
    /// Ground and surfaces, `[poses]`, one where it is never off; empty where no rule looks for them.
    near: Vec<SightBeams>,
    /// Bits of areas, `[members][poses]`, frame after frame; of members where an area is required.
    areas: Vec<Vec<Vec<u64>>>,
}

/// Thing of a pose among one for each; a list of one holds for all poses.
fn in_pose<T>(all: &[T], pose: usize) -> &T {
    if let [still] = all { still } else { &all[pose] }
}

/// Numbers of LiDARs, each with the column that replaces its own.
pub(crate) type Instead = Vec<(usize, LidarInPoses)>;

/// A placement whose LiDARs each stand in one of some poses within the tolerance.
pub(crate) struct Moved {
    seed: u64,
    offsets: Vec<Vec<[f64; 6]>>,
    columns: Vec<LidarInPoses>,
    /// Required areas of each member; empty where none is required.
    areas: Vec<AreaBits>,
    /// Requirements that are looked at: areas, then the rules of `sight`.
    wanted: Vec<bool>,
    /// Copies that are looked at: all of them, or the first.
    copies: usize,
    /// Problem that says the order of requirements.
    problem: Arc<Problem>,
    sight: Option<Arc<Sight>>,
}

pub(crate) struct Holds {
    /// Share for each requirement, in the order of the scores.
    pub each: Vec<f64>,
    /// Share that meets all of them.
    pub all: f64,
}

impl Moved {
    /// Casts the LiDARs of a placement in each of their poses, over the evaluator's frames, and looks at all of so many
    /// requirements. Where `only` names a LiDAR, no other one is off. `None` once `go_on`, which is asked after every few poses
    /// and frames, says no.
    pub(crate) fn new(
        (tolerance, seed, only): (Tolerance, u64, Option<usize>),
        (placement, required): (&Placement, usize),
        evaluator: &mut Evaluator,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Self>, BackendError> {
        let of_member = |(member, _): (&Member, _)| AreaBits::new(member.problem().content());
        let areas = evaluator.members().map(of_member).filter(|areas| areas.words() > 0).collect();
        let mut offsets = tolerance.offsets([placement.lidars.len(), POSES_OF_COPIES], seed);
        let others = offsets.iter_mut().enumerate();
        let others = others.filter(|(lidar, _)| only.is_some_and(|only| only != *lidar));
        others.for_each(|(_, poses)| poses.fill([0.0; 6]));
        let mut moved = Self {
            seed,
            offsets,
            columns: Vec::new(),
            areas,
            wanted: vec![true; required],
            copies: COPIES,
            problem: evaluator.shared_problem(),
            sight: evaluator.sight().cloned(),
        };
        let lidars: Vec<_> = placement.lidars.iter().copied().enumerate().collect();
        let Some(columns) = moved.columns_of(&lidars, evaluator, go_on)? else { return Ok(None) };
        moved.columns = columns;
        Ok(Some(moved))
    }

    /// A placement none of whose LiDARs is off, by which those of others [beside it](Self::shares_beside) are found; `go_on` and
    /// `None` work as in [`Self::new`].
    pub(crate) fn still(
        looked_at: (&Placement, usize),
        evaluator: &mut Evaluator,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Self>, BackendError> {
        let none = Tolerance { metres: 0.0, radians: 0.0 };
        Self::new((none, 0, None), looked_at, evaluator, go_on)
    }

    /// A question that does not look at some requirements, by their numbers in the order of the scores.
    pub(crate) fn leaving_out(mut self, left_out: &[usize]) -> Self {
        let mut own: Vec<usize> = (0..self.wanted.len()).collect();
        self.problem.in_file_order(&mut own);
        left_out.iter().for_each(|&k| self.wanted[own[k]] = false);
        self
    }

    /// Share of every requirement of other placements than one, in the order of the scores, 1 where it is not looked at. Only
    /// LiDARs are cast that stand elsewhere; `go_on` and `None` work as in [`Self::new`].
    pub(crate) fn shares_beside(
        &self,
        one: &Placement,
        others: &[Placement],
        evaluator: &mut Evaluator,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Vec<f64>>>, BackendError> {
        let beside = self.columns_beside(one, others, evaluator, go_on)?;
        Ok(beside.map(|all| all.par_iter().map(|instead| self.as_it_is(instead)).collect()))
    }

    /// Share of every requirement of the placement as it is, in the order of the scores, 1 where it is not looked at.
    pub(crate) fn shares(&self) -> Vec<f64> {
        self.as_it_is(&Vec::new())
    }

    /// Looks from now on only at requirements that some copies miss, by `holds`; all others count as met.
    pub(crate) fn only_missed(mut self, holds: &Holds) -> Self {
        let mut own: Vec<usize> = (0..self.wanted.len()).collect();
        self.problem.in_file_order(&mut own);
        for (own, share) in own.into_iter().zip(&holds.each) {
            self.wanted[own] = *share < 1.0;
        }
        self
    }

    /// True if each requirement that is not looked at keeps `part` of its margin: share found less share required, `before`
    /// and `after`.
    pub(crate) fn keeps_room(
        &self,
        before: &[(f64, f64)],
        after: &[(f64, f64)],
        part: f64,
    ) -> bool {
        let mut wanted = self.wanted.clone();
        self.problem.in_file_order(&mut wanted);
        let room = |&(share, least): &(f64, f64)| share - least;
        let both = before.iter().zip(after).zip(wanted).filter(|(_, is_wanted)| !is_wanted);
        both.map(|(pair, _)| pair).all(|(before, after)| room(after) >= part * room(before))
    }

    pub(crate) fn at_few(self, few: bool) -> Self {
        Self { copies: if few { FEW_COPIES } else { COPIES }, ..self }
    }

    /// Which areas are looked at, which rules on targets, and which other rules.
    fn wanted(&self) -> (&[bool], Vec<bool>, Vec<bool>) {
        let on_targets = self.sight.as_ref().map_or_else(Vec::new, |sight| sight.on_targets());
        let areas = self.wanted.len().saturating_sub(on_targets.len());
        let (areas, rules) = self.wanted.split_at(areas);
        let both = || rules.iter().zip(&on_targets);
        let targets = both().map(|(is_wanted, on_target)| *is_wanted && *on_target).collect();
        let near = both().map(|(is_wanted, on_target)| *is_wanted && !*on_target).collect();
        (areas, targets, near)
    }

    /// Pose of a LiDAR in a copy: its own with that copy's offset. Copy 0 has none.
    fn pose_in(&self, lidar: usize, own: &SensorPose, copy: usize) -> SensorPose {
        let (values, off) = (own.values(), self.offsets[lidar][copy]);
        let [x, y, z, roll, pitch, yaw] = std::array::from_fn(|k| values[k] + off[k]);
        SensorPose { x, y, z, roll, pitch, yaw, ..*own }
    }

    /// Beams, ground and surfaces of LiDARs at some poses, as far as rules that are `wanted` need them; `go_on` and `None` work
    /// as in [`Self::new`].
    fn looked_at(
        &self,
        poses: &[SensorPose],
        wanted: &[bool],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<SightBeams>>, BackendError> {
        let Some(sight) = self.sight.as_ref().filter(|_| wanted.contains(&true)) else {
            return Ok(Some(vec![SightBeams::default(); poses.len()]));
        };
        let mut found = Vec::new();
        for some in poses.chunks(AT_ONCE) {
            if !go_on() {
                return Ok(None);
            }
            let beams = some.par_iter().map(|pose| sight.beams_for(pose, wanted));
            found.extend(beams.collect::<Result<Vec<_>, UnknownSensor>>()?);
        }
        Ok(Some(found))
    }

    /// Casts LiDARs, each by its number and the pose that it is to have, in each of their poses; `go_on` and `None` work
    /// as in [`Self::new`].
    fn columns_of(
        &self,
        lidars: &[(usize, SensorPose)],
        evaluator: &mut Evaluator,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<LidarInPoses>>, BackendError> {
        let (of_areas, on_targets, on_near) = self.wanted();
        let own: Vec<SensorPose> = lidars.iter().map(|(_, own)| *own).collect();
        let Some(targets) = self.looked_at(&own, &on_targets, go_on)? else { return Ok(None) };
        let in_poses = |(lidar, own): &(usize, SensorPose)| {
            let is_still = self.offsets[*lidar].iter().all(|off| *off == [0.0; 6]);
            let poses = 0..if is_still { 1 } else { POSES };
            poses.map(|copy| self.pose_in(*lidar, own, copy)).collect::<Vec<_>>()
        };
        let each: Vec<Vec<SensorPose>> = lidars.iter().map(in_poses).collect();
        let poses = each.concat();
        let Some(near) = self.looked_at(&poses, &on_near, go_on)? else { return Ok(None) };
        let mut areas = Vec::new();
        let members = if of_areas.contains(&true) { evaluator.members().len() } else { 0 };
        for member in 0..members {
            let Some(of_member) = Self::areas(&poses, member, evaluator, go_on)? else {
                return Ok(None);
            };
            areas.extend(of_member);
        }
        let mut columns = Vec::new();
        let mut first = 0;
        for ((own, on_targets), poses) in own.into_iter().zip(targets).zip(&each) {
            let poses = first..first + poses.len();
            first = poses.end;
            let areas = areas.iter().map(|of: &Vec<Vec<u64>>| of[poses.clone()].to_vec()).collect();
            columns.push(LidarInPoses { own, on_targets, near: near[poses].to_vec(), areas });
        }
        Ok(Some(columns))
    }

    /// Bits of required areas for each pose in one scene; the inner `None` if no area is required. `go_on` and the outer
    /// `None` work as in [`Self::new`].
    fn areas(
        poses: &[SensorPose],
        member: usize,
        evaluator: &mut Evaluator,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Option<Vec<Vec<u64>>>>, BackendError> {
        let (member, backend) = evaluator.member_mut(member);
        let problem = member.problem().clone();
        let areas = AreaBits::new(problem.content());
        if areas.words() == 0 {
            return Ok(Some(None));
        }
        let mut all = poses.to_vec();
        if member.is_mirrored() {
            all.iter_mut().for_each(|pose| *pose = pose.mirrored());
        }
        let (frames, words) = (problem.frame_count(), areas.words());
        let bits: Vec<_> = all.iter().map(|_| Mutex::new(vec![0; frames * words])).collect();
        for frame in 0..frames {
            if !go_on() {
                return Ok(None);
            }
            backend.each_bitmap(&all, frame, &|pose, order, bitmap| {
                let Ok(mut bits) = bits[pose].lock() else { return };
                let seen = &mut bits[frame * words..(frame + 1) * words];
                // Another engine takes over from a device that is lost, and hands out all poses again.
                seen.fill(0);
                areas.take(*order, bitmap, seen);
            })?;
        }
        let bits = bits.into_iter().map(|bits| bits.into_inner().unwrap_or_default());
        Ok(Some(Some(bits.collect())))
    }

    /// Share of every required area, and of every rule that is not on targets, with each LiDAR in one of its poses; 1 where
    /// it is not looked at.
    fn near_shares(&self, columns: &[&LidarInPoses], poses: &[usize]) -> Vec<f64> {
        let (of_areas, _, on_near) = self.wanted();
        let mut shares = vec![1.0; of_areas.len()];
        if of_areas.contains(&true) {
            shares.fill(0.0);
            for (member, areas) in self.areas.iter().enumerate() {
                let mut union = vec![0; columns[0].areas[member][0].len()];
                for (column, &pose) in columns.iter().zip(poses) {
                    let bits = in_pose(&column.areas[member], pose);
                    union.iter_mut().zip(bits).for_each(|(all, bits)| *all |= bits);
                }
                let members = self.areas.len() as f64;
                let found = areas.shares(&union);
                shares.iter_mut().zip(found).for_each(|(mean, share)| *mean += share / members);
            }
        }
        if let Some(sight) = &self.sight {
            let near = columns.iter().zip(poses).map(|(of, pose)| in_pose(&of.near, *pose));
            shares.extend(sight.shares(&near.collect::<Vec<_>>(), &on_near));
        }
        shares
    }

    /// For each of `others`: columns of the LiDARs whose pose differs from that in `one`, with their numbers. `go_on` and
    /// `None` work as in [`Self::new`].
    pub(crate) fn columns_beside(
        &self,
        one: &Placement,
        others: &[Placement],
        evaluator: &mut Evaluator,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Instead>>, BackendError> {
        let differ = |other: &Placement| -> Vec<(usize, SensorPose)> {
            let lidars = other.lidars.iter().copied().enumerate();
            lidars.filter(|(lidar, pose)| one.lidars[*lidar] != *pose).collect()
        };
        let moved: Vec<Vec<(usize, SensorPose)>> = others.iter().map(differ).collect();
        let columns = self.columns_of(&moved.concat(), evaluator, go_on)?;
        let Some(mut columns) = columns.map(Vec::into_iter) else { return Ok(None) };
        let beside = moved
            .iter()
            .map(|moved| moved.iter().map(|(lidar, _)| *lidar).zip(columns.by_ref()).collect());
        Ok(Some(beside.collect()))
    }

    /// The columns, some of them replaced where `instead` says so.
    fn columns<'a>(&'a self, instead: &'a [(usize, LidarInPoses)]) -> Vec<&'a LidarInPoses> {
        let mut columns: Vec<&LidarInPoses> = self.columns.iter().collect();
        instead.iter().for_each(|(lidar, column)| columns[*lidar] = column);
        columns
    }

    /// Share of every requirement with no LiDAR off, over the frames that were cast, in the order of the scores; with
    /// other columns `instead` of LiDARs' own.
    pub(crate) fn as_it_is(&self, instead: &[(usize, LidarInPoses)]) -> Vec<f64> {
        let columns = self.columns(instead);
        let near = self.near_shares(&columns, &vec![0; columns.len()]);
        let each: Vec<_> = columns.iter().map(|column| &column.on_targets).collect();
        let targets = self.sight.as_ref().map(|sight| sight.shares(&each, &self.wanted().1));
        self.joined(near, &targets.unwrap_or_default())
    }

    /// Shares of areas and rules, with those of rules on targets among them, in the order of the scores.
    fn joined(&self, mut shares: Vec<f64>, targets: &[f64]) -> Vec<f64> {
        let areas = shares.len() - targets.len();
        let rules = shares[areas..].iter_mut().zip(targets);
        rules.for_each(|(near, target)| *near = near.min(*target));
        self.problem.in_file_order(&mut shares);
        shares
    }

    /// Shares of the copies that meet the requirements. `found` has the share and the required share of each, over all
    /// frames; columns of `instead` replace LiDARs' own. `go_on` and `None` work as in [`Self::new`].
    pub(crate) fn holds(
        &self,
        instead: &[(usize, LidarInPoses)],
        found: &[(f64, f64)],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Holds>, BackendError> {
        let columns = self.columns(instead);
        let each: Vec<_> = columns.iter().map(|column| &column.on_targets).collect();
        let order = self.sight.as_ref().map_or_else(Vec::new, |of| of.most_beams_first(&each));
        let as_it_is = self.as_it_is(instead);
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 1);
        let mut near = || columns.iter().map(|_| rng.random_range(1..POSES)).collect();
        let copies: Vec<(usize, Vec<usize>)> = (1..=self.copies).map(|k| (k, near())).collect();
        let is_met = |copy: &(usize, Vec<usize>)| -> Result<Vec<bool>, UnknownSensor> {
            let moved = self.shares_in(&columns, copy, &order)?;
            // A share over all frames is taken to change by as much as over these few.
            let of = found.iter().zip(moved.iter().zip(&as_it_is));
            let is_met =
                of.map(|((share, least), (moved, still))| share + (moved - still) >= *least);
            Ok(is_met.collect())
        };
        let mut met: Vec<Vec<bool>> = Vec::new();
        for some in copies.chunks(AT_ONCE) {
            if !go_on() {
                return Ok(None);
            }
            let some = some.par_iter().map(is_met);
            met.extend(some.collect::<Result<Vec<_>, UnknownSensor>>()?);
        }
        let share = |is_met: &dyn Fn(&Vec<bool>) -> bool| {
            met.iter().filter(|met| is_met(met)).count() as f64 / self.copies as f64
        };
        let each = (0..found.len()).map(|k| share(&|met| met[k])).collect();
        Ok(Some(Holds { each, all: share(&|met| met.iter().all(|met| *met)) }))
    }

    /// Share of every requirement in a copy, in the order of the scores; 1 where it is not looked at.
    fn shares_in(
        &self,
        columns: &[&LidarInPoses],
        (copy, near): &(usize, Vec<usize>),
        order: &[Vec<usize>],
    ) -> Result<Vec<f64>, UnknownSensor> {
        let own = columns.iter().enumerate();
        let poses: Vec<_> = own.map(|(k, of)| self.pose_in(k, &of.own, *copy)).collect();
        let targets = match &self.sight {
            Some(sight) => sight.shares_on_targets(&poses, order, &self.wanted().1)?,
            None => Vec::new(),
        };
        Ok(self.joined(self.near_shares(columns, near), &targets))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::RulePlaces;

    #[test]
    fn an_error_of_a_share_covers_what_draws_give() {
        // 30 draws of a chance of 0.9, again and again: 95 % of the shares lie within their own error of 0.9.
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let is_near = |_| {
            let met = (0..30).filter(|_| rng.random::<f64>() < 0.9).count();
            let share = met as f64 / 30.0;
            (share - 0.9).abs() <= error_of_share(share, 30)
        };
        let near = (0..2000).map(is_near).filter(|near| *near).count();
        assert!((1840..2000).contains(&near), "{near} of 2000");
        assert!(error_of_share(1.0, 15) > 0.1 && error_of_share(0.5, COPIES) < 0.08);
        // On targets every copy has poses of its own.
        let places = Some(RulePlaces { judged: 1, left_out: 0, on_scene: false });
        let rules = [Seen { places, ..Seen::of("car", 1.0) }, Seen::of("ring", 1.0)];
        let draws = [&rules[..1], &rules].map(|rules| [2, 16].map(|lidars| drawn(rules, lidars)));
        assert_eq!(draws, [[200, 200], [30, 200]]);
    }
}
