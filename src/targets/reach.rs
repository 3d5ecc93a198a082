//! Requirements beyond any rig: too few beams even from the best pose of every mount, or no place that counts.

use super::beams::TargetSite;
use super::places::{Sight, SightBeams, places_of};
use super::rules::Rule;
use crate::near_field::least_metres;
use crate::problem::{Problem, ProblemError};
use crate::vehicle::{GroundAsked, Vehicle};

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
    /// Most beams at any of its places, with every mount full.
    pub beams: u32,
    /// Largest share of its places at which enough beams are possible.
    pub share: f64,
}

impl Sight {
    /// Rules on targets that no rig on these poses meets. At each place the bound takes the most beams of any pose of a
    /// mount, times the sensors that the mount holds: poses that do not go together, distances and prices are passed over,
    /// so that every rig on the poses has at most as many beams.
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
        self.rules.iter().filter_map(|rule| self.bound(rule, &most)).collect()
    }

    /// The bound on a rule; `None` if it may be met, or is not on a target.
    fn bound(&self, rule: &Rule, most: &[u32]) -> Option<OutOfReach> {
        let Rule::Target(rule, places) = rule else { return None };
        let enough = places.clone().filter(|&place| most[place] >= u32::from(self.enough[place]));
        let share = enough.count() as f64 / places.len().max(1) as f64;
        if places.is_empty() || share >= rule.share {
            return None;
        }
        let beams = most[places.clone()].iter().copied().max().unwrap_or(0);
        let (name, wanted) = (&rule.name, rule.beams);
        let words = if beams < wanted {
            format!(
                "{name}: even the best pose of each mount meets it with at most {beams} of {wanted} beams; lower \
                 `beams` or take a sensor of finer spacing"
            )
        } else {
            format!(
                "{name}: even the best pose of each mount leaves it at most {:.1} % seen, {:.1} % required; lower \
                 `share` or `within`, add or widen mounts, or take other sensors",
                // Rounded up, as a bound from above.
                (1e3 * share - 1e-9).ceil() / 10.0,
                100.0 * rule.share
            )
        };
        Some(OutOfReach { words, beams, share })
    }
}

/// Checks that every rule of a vehicle on targets and on the ground has something that counts, in the vehicle's problem.
///
/// # Errors
/// The first rule whose places all lie in the own body, or whose distance reaches no cell; a body from whose outline no
/// ground is counted.
pub(crate) fn check_counting(problem: &Problem, vehicle: &Vehicle) -> Result<(), ProblemError> {
    let Vehicle { require, targets, ground, require_order, .. } = vehicle;
    let index = |number: usize| require_order.get(number).copied().unwrap_or(number);
    let site = (!targets.is_empty()).then(|| TargetSite::of(problem));
    for (number, rule) in targets.iter().enumerate() {
        let has_room = |at: [f64; 3]| site.as_ref().is_none_or(|s| s.has_room(&rule.target, at));
        if !places_of(rule).into_iter().any(has_room) {
            let (index, name) = (index(require.len() + number), rule.name.clone());
            return Err(ProblemError::NoPlace { index, name });
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

    /// The sight of a vehicle that must meet a tyre at one distance, ahead and to the left, with `beams` beams at half of
    /// the places.
    fn sight(beams: u64) -> Sight {
        let text = format!(
            r#"{{ "sightline": 1, "coverage": "first-hit",
            "roi": {{ "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] }},
            "static": [{{ "class": "road", "plane": {{ "min": [-99, -99], "max": [99, 99], "z": 0 }} }}],
            "ego": {{ "poses": [{{ "x": 0, "y": 0, "z": 0 }}] }},
            "vehicle": {{
              "sensors": [{{ "name": "a", "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }} }}],
              "mounts": [{{ "name": "top", "min": [-2, -1, 2], "max": [2, 1, 2.5], "count": [0, 2] }}],
              "require": [{{ "target": "tyre", "from": 20, "within": 20, "bearing": [0, 22.5], "beams": {beams},
                            "share": 0.5 }}] }} }}"#
        );
        let scene = Scene::from_json(&text, Path::new(""), "tyre.json").unwrap();
        let roi = scene.roi().grid().unwrap();
        let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
        let problem = Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
        Sight::of([(&Arc::new(problem), false)], false).unwrap()
    }

    #[test]
    fn no_rig_on_the_poses_is_beyond_the_bound() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut found = [0; 3];
        for round in 0..300 {
            let wanted = 4 + round % 4;
            let sight = sight(wanted);
            assert_eq!(sight.places.len(), 4, "every 7.5 degrees");
            let mut pose = || {
                let beams = (0..4).map(|_| rng.random_range(0..=2_u8)).collect();
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
                    (0..4)
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
                    assert!(best < 2 && one.share >= 0.25 * best as f64, "{best} {one:?}");
                    let is_none = u64::from(one.beams) < wanted;
                    assert_eq!(one.share == 0.0, is_none, "{one:?}");
                    let words = format!("at most {} of {wanted} beams", one.beams);
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
