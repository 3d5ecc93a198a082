//! Rules on overlap that no rig on some poses meets, as poses of different mounts share too little.

use std::ops::Range;

use rayon::prelude::*;

use super::reach::{MountPoses, OutOfReach};
use super::sight::{Sight, SightBeams};
use crate::score::percent_up;
use crate::vehicle::OverlapRule;

/// Most surface voxels that are compared for a bound on overlap, over all pairs of poses: seconds.
const MOST_COMPARED: usize = 400_000_000;
/// Work for a pose of a pair besides its voxels, in voxels.
const PAIR: usize = 50;

impl Sight {
    /// The bound on a rule on overlap; `None` if it may be met, or where pairs of poses are too many to look at.
    ///
    /// Each LiDAR needs another one that it shares enough with. So a mount that must hold a LiDAR bounds every rig by the
    /// largest overlap of its poses with poses of other mounts. Where no mount must, the largest of all mounts does.
    pub(super) fn overlap_bound(
        &self,
        rule: &OverlapRule,
        used: &[&MountPoses<'_>],
    ) -> Option<OutOfReach> {
        let must = (0..used.len()).filter(|&mount| used[mount].count[0] > 0);
        let mut groups: Vec<Range<usize>> = must.map(|mount| mount..mount + 1).collect();
        let who = match groups.is_empty() {
            true => "even the best two poses of different mounts share",
            false => "even the best pose of a mount that must hold a LiDAR shares",
        };
        if groups.is_empty() {
            groups.push(0..used.len());
        }
        let bounds = groups.into_iter().filter_map(|of| self.most_overlap(of, rule.share, used));
        let share = bounds.reduce(f64::min)?;
        let words = format!(
            "{}: {who} at most {:.1} %, {:.1} % required; lower `overlap`, add or widen mounts, or take sensors of a wider \
             field of view",
            rule.name,
            percent_up(share),
            percent_up(rule.share)
        );
        Some(OutOfReach { words, beams: None, share, is_measured: true })
    }

    /// Largest overlap of a pose of some mounts with a pose of another mount, a mean over scenes of the largest in each.
    /// `None` where it is `enough`, where LiDARs on one mount may share all, and where pairs are too many.
    fn most_overlap(&self, of: Range<usize>, enough: f64, used: &[&MountPoses<'_>]) -> Option<f64> {
        if used[of.clone()].iter().any(|mount| mount.count[1] > 1) {
            return None;
        }
        // Pairs of these mounts come up once.
        let partners = |one: usize| -> Vec<&SightBeams> {
            let mounts = used.iter().enumerate();
            let others = mounts.filter(|(other, _)| *other > one || !of.contains(other));
            others.flat_map(|(_, mount)| mount.poses.iter().copied()).collect()
        };
        let looks = |poses: &[&SightBeams]| {
            poses.iter().map(|pose| PAIR + pose.surfaces.voxels()).sum::<usize>()
        };
        let compared = of.clone().map(|one| {
            let (poses, partners) = (&used[one].poses, partners(one));
            poses.len() * looks(&partners) + partners.len() * looks(poses)
        });
        if compared.sum::<usize>() > MOST_COMPARED {
            return None;
        }
        let mut most = vec![0.0_f64; self.overlap.len()];
        let mean = |most: &[f64]| most.iter().sum::<f64>() / most.len().max(1) as f64;
        for one in of.clone() {
            let partners = partners(one);
            for pose in &used[one].poses {
                let each = partners.par_iter().map(|other| self.pair_overlap([*pose, *other]));
                for shares in each.collect::<Vec<_>>() {
                    most.iter_mut().zip(shares).for_each(|(most, share)| *most = most.max(share));
                }
                if mean(&most) >= enough {
                    return None;
                }
            }
        }
        Some(mean(&most))
    }

    /// Overlap of two LiDARs in each scene, at most.
    fn pair_overlap(&self, pair: [&SightBeams; 2]) -> Vec<f64> {
        let mut first = 0;
        let of_scene = self.overlap.iter().map(|scene| {
            let frames = first..first + scene.frame_count();
            first = frames.end;
            scene.most_shared(pair.map(|of| &of.surfaces.frames[frames.clone()]))
        });
        of_scene.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::targets::tests::posed;
    use crate::vehicle::SensorPose;

    /// The sight of a vehicle whose LiDARs, which look to one side each, must share a part of what they see.
    fn sight(overlap: f64) -> Sight {
        posed(&format!(
            r#"{{
              "sensors": [{{ "name": "a", "lidar": {{ "channels": 16, "fov": [-60, 0], "azimuth": [-100, 100],
                            "azimuth_steps": 60, "range": 30 }} }}],
              "mounts": [{{ "name": "top", "min": [-1, -1, 1.6], "max": [1, 1, 1.8], "count": [0, 3] }}],
              "require": [{{ "overlap": {overlap} }}] }}"#
        ))
    }

    #[test]
    fn no_rig_on_the_poses_shares_more_than_the_bound() {
        let sight = sight(0.97);
        let looking = |yaw: f64| {
            let poses = (0..3).map(|k| {
                let yaw = yaw + 0.2 * f64::from(k);
                SensorPose { y: yaw.sin(), z: 1.7, yaw, ..SensorPose::default() }
            });
            poses.map(|pose| sight.beams(&pose).unwrap()).collect::<Vec<_>>()
        };
        // To the left, to the right, and ahead, where more is shared with either.
        let [left, right, ahead] = [1.2, -1.7, -0.2].map(looking);
        let all = [&left, &right, &ahead];
        let mounts = |counts: &[[usize; 2]]| -> Vec<MountPoses<'_>> {
            let mounts = counts.iter().zip(all);
            mounts.map(|(&count, of)| MountPoses { count, poses: of.iter().collect() }).collect()
        };
        let bound = |counts: &[[usize; 2]]| sight.out_of_reach(&mounts(counts));
        // Every rig, by the pose on each mount or none there.
        let rigs = || (0..64).map(|k| [k % 4, k / 4 % 4, k / 16]);
        let best = |is_kept: &dyn Fn(&[usize; 3]) -> bool| {
            let share = |rig: [usize; 3]| {
                let each = rig.iter().zip(all).filter_map(|(&pose, of)| of.get(pose));
                sight.rules_met(&each.collect::<Vec<_>>())[0].share
            };
            rigs().filter(is_kept).map(share).fold(0.0, f64::max)
        };
        let none = 3;
        for (counts, best, who) in [
            (
                &[[0, 1], [0, 1]][..],
                best(&|rig| rig[2] == none),
                "best two poses of different mounts",
            ),
            (&[[0, 1]; 3][..], best(&|_| true), "best two poses of different mounts"),
            (&[[1, 1], [0, 1], [0, 1]][..], best(&|rig| rig[0] != none), "must hold a LiDAR"),
            (&[[0, 1], [1, 1], [0, 1]][..], best(&|rig| rig[1] != none), "must hold a LiDAR"),
        ] {
            let [one] = &bound(counts)[..] else { panic!("{counts:?}: {:?}", bound(counts)) };
            // Two LiDARs reach it.
            assert!(best > 0.0 && one.share == best, "{counts:?}: {best} {one:?}");
            assert!(one.words.contains(who) && one.words.contains("97.0 % required"), "{one:?}");
        }
        // Two mounts that must hold one: the one that shares less with all others is the bound.
        let [both] = &bound(&[[1, 1], [1, 1], [0, 1]])[..] else { panic!("one rule") };
        let most = best(&|rig| rig[0] != none && rig[1] != none);
        let each = [[[1, 1], [0, 1], [0, 1]], [[0, 1], [1, 1], [0, 1]]];
        let least = each.map(|counts| bound(&counts)[0].share);
        assert!(most <= both.share && both.share == least[0].min(least[1]), "{most} {both:?}");
        // Two LiDARs at one pose share all.
        assert!(bound(&[[0, 1], [0, 2]]).is_empty());
        // One seat is too few for any rule on overlap.
        assert!(
            bound(&[[0, 1]])[0].words.contains("the mounts hold one LiDAR, and this takes two")
        );
    }

    #[test]
    fn an_overlap_that_two_poses_have_is_in_reach() {
        let sight = sight(0.01);
        let beams = [0.5, -0.5]
            .map(|yaw| sight.beams(&SensorPose { z: 1.7, yaw, ..SensorPose::default() }).unwrap());
        let mounts = [0, 1].map(|k| MountPoses { count: [1, 1], poses: vec![&beams[k]] });
        assert!(sight.out_of_reach(&mounts).is_empty());
    }
}
