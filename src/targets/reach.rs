//! Requirements beyond any rig: too few beams even from the best pose of every mount, ground that no pose sees, or no place
//! that counts.

use std::ops::Range;

use super::beams::TargetSite;
use super::bodies::{BodyPoses, together};
use super::confirm::places_of;
use super::places::{Sight, SightBeams};
use super::rules::Rule;
use crate::near_field::least_metres;
use crate::problem::{Problem, ProblemError};
use crate::score::{percent_down, percent_up};
use crate::vehicle::{GroundAsked, GroundRule, TargetRule, Vehicle};

/// Poses of the sensors that may stand on a mount.
pub(crate) struct MountPoses<'a> {
    /// Most sensors that it holds.
    pub most: usize,
    /// Beams of a sensor of any allowed model at each pose.
    pub poses: Vec<&'a SightBeams>,
}

/// A requirement that no rig on some poses meets.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OutOfReach {
    /// Sentence without its full stop: name, bound, requirement, how to mend it.
    pub words: String,
    /// Most beams at any of its places, with every mount full; `None` for ground.
    pub beams: Option<u32>,
    /// Largest share of its places at which enough beams are possible, or of its ground that is seen.
    pub share: f64,
    /// True if it follows from beams of poses, not from the number of LiDARs alone.
    pub is_measured: bool,
}

impl Sight {
    /// Rules on targets and on the ground that no rig on these poses meets.
    ///
    /// At each place the bound takes the most beams of any pose of a mount, times the sensors that the mount holds.
    /// Ground counts that any pose sees. Distances, prices and poses that do not go together are passed over, so that
    /// every rig on the poses has at most as much. A rule that must hold without any one LiDAR has no more: see
    /// [`Self::target_bound`]; with one seat in all, nothing is left.
    pub(crate) fn out_of_reach(&self, mounts: &[MountPoses<'_>]) -> Vec<OutOfReach> {
        let most: Vec<u32> = (0..self.places.len())
            .map(|place| {
                let beams = |mount: &MountPoses<'_>| {
                    let each = mount.poses.iter().filter_map(|pose| pose.beams.get(place));
                    each.copied().max().map_or(0, u32::from) * mount.most as u32
                };
                mounts.iter().map(beams).sum()
            })
            .collect();
        let mut all = SightBeams::default();
        let used = mounts.iter().filter(|mount| mount.most > 0);
        used.flat_map(|mount| &mount.poses).for_each(|pose| all.add(pose));
        let seats: usize = mounts.iter().map(|mount| mount.most).sum();
        let largest: Vec<u32> = (0..self.places.len())
            .map(|place| {
                let used = mounts.iter().filter(|mount| mount.most > 0);
                let poses = used.flat_map(|mount| &mount.poses);
                let beams = poses.filter_map(|pose| pose.beams.get(place).copied()).max();
                beams.map_or(0, u32::from)
            })
            .collect();
        let bound = |rule: &Rule| match rule {
            _ if rule.least() <= 0.0 => None,
            _ if rule.without_any_one() && seats < 2 => Some(one_seat(rule.name())),
            Rule::Target(rule, sites) => {
                self.target_bound(rule, sites, (&most[..], &largest[..], seats))
            }
            Rule::Ground(rule, number) => self.ground_bound(rule, *number, &all),
            Rule::Overlap(rule) if seats < 2 => Some(one_seat(&rule.name)),
            Rule::Overlap(_) => None,
        };
        self.rules.iter().filter_map(bound).collect()
    }

    /// The bound on a rule on the ground, for the ground that all poses see together; `None` if it may be met.
    fn ground_bound(
        &self,
        rule: &GroundRule,
        number: usize,
        all: &SightBeams,
    ) -> Option<OutOfReach> {
        let share = self.ground_share(all, number);
        if share >= rule.share {
            return None;
        }
        let mend = match rule.asked {
            GroundAsked::Within(_) => "lower `share`",
            GroundAsked::BlindZone(..) => "raise `depth`, lower `share`",
        };
        let lacks = self.ground_missing(all, number).unwrap_or_default();
        let words = format!(
            "{}: even a LiDAR at every pose of each mount leaves it {:.1} % seen, {:.1} % required, {lacks}; {mend}, add or \
             widen mounts, or take other sensors",
            rule.name,
            percent_down(share),
            percent_up(rule.share)
        );
        Some(OutOfReach { words, beams: None, share, is_measured: true })
    }

    /// The bound on a rule on a target, by the most beams at each place and the most of a single LiDAR there; `None` if it
    /// may be met.
    ///
    /// Where a rule must hold without any one LiDAR, a place that lacks beams without the largest share of them fails for at
    /// least one loss. Some loss then fails at as many of these places as there are, divided by the seats.
    fn target_bound(
        &self,
        rule: &TargetRule,
        sites: &[Range<usize>],
        (most, largest, seats): (&[u32], &[u32], usize),
    ) -> Option<OutOfReach> {
        let enough = |place: usize, beams: u32| beams >= u32::from(self.enough[place]);
        // Share of some places that all LiDARs may meet, and after a loss.
        let bound = |places: &Range<usize>| {
            let count = places.len().max(1) as f64;
            let whole = places.clone().filter(|&place| enough(place, most[place])).count() as f64;
            let left = |&place: &usize| enough(place, most[place] - largest[place]);
            let fragile = count - places.clone().filter(left).count() as f64;
            let after_loss = 1.0 - fragile / (count * seats.max(1) as f64);
            if places.is_empty() { [1.0; 2] } else { [whole / count, after_loss] }
        };
        let bounds: Vec<[f64; 2]> = sites.iter().map(bound).collect();
        let [whole, after_loss] = [0, 1].map(|k| together(rule, bounds.iter().map(|of| of[k])));
        let is_loss = rule.without_any_one && after_loss < whole;
        let share = if is_loss { after_loss } else { whole };
        if share >= rule.share {
            return None;
        }
        let beams = sites.iter().cloned().flatten().map(|place| most[place]).max().unwrap_or(0);
        let (name, wanted) = (&rule.name, rule.beams);
        let lost = if is_loss { ", the worst LiDAR lost," } else { "" };
        let words = if beams < wanted {
            format!(
                "{name}: even the best pose of each mount meets it with at most {beams} of {wanted} beams; lower \
                 `beams` or take a sensor of finer spacing"
            )
        } else {
            format!(
                "{name}: even the best pose of each mount{lost} leaves it at most {:.1} % seen, {:.1} % required; lower \
                 `share` or `within`, add or widen mounts, or take other sensors",
                // Rounded up, as a bound from above.
                percent_up(share),
                100.0 * rule.share
            )
        };
        Some(OutOfReach { words, beams: Some(beams), share, is_measured: true })
    }
}

/// The bound on a rule that takes two LiDARs where the mounts hold one.
fn one_seat(name: &str) -> OutOfReach {
    let words = format!(
        "{name}: the mounts hold one LiDAR, and this takes two; raise `count` of a mount, add a mount, or leave the \
         requirement out"
    );
    OutOfReach { words, beams: None, share: 0.0, is_measured: false }
}

/// Checks that every rule of a vehicle on targets and on the ground has something that counts, in the vehicle's problem.
///
/// # Errors
/// The first rule whose places all lie in the own body, or whose distance reaches no cell; a body from whose outline no
/// ground is counted.
pub(crate) fn check_counting(problem: &Problem, vehicle: &Vehicle) -> Result<(), ProblemError> {
    let Vehicle { require, targets, ground, require_order, .. } = vehicle;
    let index = |number: usize| require_order.get(number).copied().unwrap_or(number);
    let bodies =
        (!targets.is_empty()).then(|| BodyPoses::of(TargetSite::of(problem), [(problem, false)]));
    for (number, rule) in targets.iter().enumerate() {
        let mut sites = bodies.iter().flat_map(|bodies| bodies.each(rule));
        let places = places_of(rule);
        let is_free = |(site, _): (&TargetSite, usize)| {
            places.iter().any(|&at| site.standing(&rule.target, at).is_some())
        };
        if !sites.any(is_free) {
            let (index, name) = (index(require.len() + number), rule.name.clone());
            return Err(match rule.on_scene {
                true => ProblemError::NoPlaceInScene { index, name },
                false => ProblemError::NoPlace { index, name },
            });
        }
    }
    let least = least_metres(problem, ground)?;
    for ((number, rule), least) in ground.iter().enumerate().zip(least) {
        let index = index(require.len() + targets.len() + number);
        let (key, metres) = match rule.asked {
            GroundAsked::Within(metres) => ("ground", metres),
            GroundAsked::BlindZone(_, metres) => ("depth", metres),
        };
        let name = rule.name.clone();
        match least {
            None => return Err(ProblemError::NoLane { index, name }),
            Some(least) if least > metres => {
                // Rounded up to whole centimetres.
                let least = (100.0 * least - 1e-9).ceil() / 100.0;
                return Err(ProblemError::NoCell { index, name, key, least });
            }
            Some(_) => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::problem::Problem;
    use crate::psog::Psog;
    use crate::scene::Scene;
    use crate::vehicle::SensorPose;

    /// The sight of a vehicle on level ground.
    fn posed(vehicle: &str) -> Sight {
        let text = r#"{ "sightline": 1, "coverage": "first-hit",
            "roi": { "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] },
            "static": [{ "class": "road", "plane": { "min": [-99, -99], "max": [99, 99], "z": 0 } }],
            "ego": { "poses": [{ "x": 0, "y": 0, "z": 0 }] }, "vehicle": VEHICLE }"#;
        let text = text.replace("VEHICLE", vehicle);
        let scene = Scene::from_json(&text, Path::new(""), "level.json").unwrap();
        let roi = scene.roi().grid().unwrap();
        let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
        let problem = Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
        Sight::of([(&Arc::new(problem), false)], false).unwrap()
    }

    /// The sight of a vehicle that must meet a tyre at one distance, ahead and to the left, with `beams` beams at half of
    /// the places.
    fn sight(beams: u64) -> Sight {
        posed(&format!(
            r#"{{
              "sensors": [{{ "name": "a", "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }} }}],
              "mounts": [{{ "name": "top", "min": [-2, -1, 2], "max": [2, 1, 2.5], "count": [0, 2] }}],
              "require": [{{ "target": "tyre", "from": 20, "within": 20, "bearing": [0, 15], "beams": {beams},
                            "share": 0.5 }}] }}"#
        ))
    }

    #[test]
    fn no_rig_on_the_poses_sees_ground_beyond_the_bound() {
        let sight = posed(
            r#"{
              "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [4, 1.8, 1.2] } }],
              "sensors": [{ "name": "a", "lidar": { "channels": 16, "fov": [-60, 0], "azimuth_steps": 72, "range": 30 } }],
              "mounts": [{ "name": "top", "min": [-1, -0.5, 1.6], "max": [1, 0.5, 1.8], "count": [0, 2] }],
              "require": [{ "ground": 3, "share": 1 }, { "blind_zone": "left", "depth": 1 },
                          { "ground": 10, "share": 0.05 }] }"#,
        );
        let pose = |x: f64, y: f64| SensorPose { x, y, z: 1.7, ..SensorPose::default() };
        let poses = [pose(-0.8, -0.4), pose(0.8, -0.4), pose(-0.8, 0.4), pose(0.8, 0.4)];
        let seen = poses.map(|pose| sight.beams(&pose).unwrap());
        let mount = |most: usize| MountPoses { most, poses: seen.iter().collect() };
        let bound = sight.out_of_reach(&[mount(2)]);
        let [ring, left] = &bound[..] else { panic!("ground to 10 m is in reach: {bound:?}") };
        let start = ": even a LiDAR at every pose of each mount leaves it ";
        for (one, name) in [(ring, "ground to 3 m"), (left, "blind zone left to 1 m")] {
            assert!(one.words.starts_with(&format!("{name}{start}")), "{one:?}");
            assert!(one.beams.is_none() && one.share < 1.0, "{one:?}");
        }
        assert!(ring.share > 0.0 && ring.words.contains("% required, "), "{ring:?}");
        assert!(left.words.contains("the blind zone left ends at "), "{left:?}");
        assert!(left.words.contains("; raise `depth`, lower `share`, "), "{left:?}");
        let shares = |each: &[&SightBeams]| -> Vec<f64> {
            sight.rules_met(each).iter().map(|met| met.share).collect()
        };
        for (a, b) in (0..16).map(|k| (&seen[k / 4], &seen[k % 4])) {
            let found = shares(&[a, b]);
            assert!(found[0] <= ring.share && found[1] <= left.share, "{found:?} {bound:?}");
        }
        // A LiDAR at every pose sees just that.
        let all = shares(&seen.iter().collect::<Vec<_>>());
        assert_eq!([all[0], all[1]], [ring.share, left.share]);
        // A mount that holds none sees nothing.
        let none = sight.out_of_reach(&[mount(0)]);
        assert_eq!(none.iter().map(|one| one.share).collect::<Vec<_>>(), [0.0; 3]);
    }

    #[test]
    fn no_rig_keeps_more_after_a_loss_than_the_bound() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let (mut in_reach, mut beyond) = (0, 0);
        for round in 0..300_u16 {
            let wanted = 2 + (round % 3) as u8;
            let sight = posed(&format!(
                r#"{{
                  "sensors": [{{ "name": "a", "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }} }}],
                  "mounts": [{{ "name": "top", "min": [-2, -1, 2], "max": [2, 1, 2.5], "count": [0, 3] }}],
                  "require": [{{ "target": "tyre", "from": 20, "within": 20, "bearing": [0, 15], "beams": {wanted},
                                "share": 1, "without_any_one": true }}] }}"#
            ));
            let mut pose = || {
                let beams = (0..3).map(|_| rng.random_range(0..=wanted)).collect();
                SightBeams { beams, ..SightBeams::default() }
            };
            let (first, second): (Vec<_>, Vec<_>) =
                ((0..3).map(|_| pose()).collect(), (0..2).map(|_| pose()).collect());
            let mounts = [
                MountPoses { most: 2, poses: first.iter().collect() },
                MountPoses { most: 1, poses: second.iter().collect() },
            ];
            let share = |k: usize| {
                let rig = [&first[k % 3], &first[k / 3 % 3], &second[k / 9]];
                sight.rules_met(&rig)[0].share
            };
            let best = (0..18).map(share).fold(0.0, f64::max);
            match &sight.out_of_reach(&mounts)[..] {
                [] => in_reach += 1,
                [one] => {
                    assert!(best <= one.share && best < 1.0, "{best} {one:?}");
                    beyond += 1;
                }
                _ => panic!("one rule"),
            }
            // One seat leaves nothing.
            let alone = [MountPoses { most: 1, poses: first.iter().collect() }];
            let words = &sight.out_of_reach(&alone)[0].words;
            assert!(
                words.contains("any one LiDAR lost: the mounts hold one LiDAR, and"),
                "{words}"
            );
        }
        assert!(in_reach > 10 && beyond > 10, "{in_reach} {beyond}");
    }

    #[test]
    fn no_rig_on_the_poses_is_beyond_the_bound() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut found = [0; 3];
        for round in 0..300 {
            let wanted = 4 + round % 4;
            let sight = sight(wanted);
            assert_eq!(sight.places.len(), 3, "every 7.5 degrees");
            let mut pose = || {
                let beams = (0..3).map(|_| rng.random_range(0..=2_u8)).collect();
                SightBeams { beams, ..SightBeams::default() }
            };
            // Three poses on one mount for two sensors, two on another for one.
            let (first, second): (Vec<_>, Vec<_>) =
                ((0..3).map(|_| pose()).collect(), (0..2).map(|_| pose()).collect());
            let mounts = [
                MountPoses { most: 2, poses: first.iter().collect() },
                MountPoses { most: 1, poses: second.iter().collect() },
            ];
            let bound = sight.out_of_reach(&mounts);
            // Every rig: any two poses of the first mount, one of the second.
            let mut best = 0;
            for (a, b, c) in (0..18).map(|k| (&first[k % 3], &first[k / 3 % 3], &second[k / 9])) {
                let beams =
                    |place: usize| [a, b, c].map(|p| u64::from(p.beams[place])).iter().sum();
                best = best.max(
                    (0..3)
                        .filter(|&place| {
                            let sum: u64 = beams(place);
                            sum >= wanted
                        })
                        .count(),
                );
            }
            match &bound[..] {
                [] => found[0] += 1,
                [one] => {
                    let beams = one.beams.unwrap();
                    assert!(best < 2 && one.share > best as f64 / 3.0 - 1e-9, "{best} {one:?}");
                    let is_none = u64::from(beams) < wanted;
                    assert_eq!(one.share == 0.0, is_none, "{one:?}");
                    let words = format!("at most {beams} of {wanted} beams");
                    assert_eq!(one.words.contains(&words), is_none, "{one:?}");
                    let is_named = one.words.starts_with("tyre at 20 m");
                    assert!(is_named && one.words.contains(": even the best pose"), "{one:?}");
                    found[1 + usize::from(is_none)] += 1;
                }
                _ => panic!("one rule: {bound:?}"),
            }
        }
        assert!(found.iter().all(|count| *count > 10), "{found:?}");
    }
}
