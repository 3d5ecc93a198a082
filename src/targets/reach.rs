//! Requirements beyond any rig: too few beams even from the best pose of every mount, ground that no pose sees, or no place
//! that counts.

use super::beams::TargetSite;
use super::bodies::{BodyPoses, RuleSite, together};
use super::places::places_of;
use super::rules::Rule;
use super::sight::{Sight, SightBeams};
use crate::near_field::least_metres;
use crate::problem::{Problem, ProblemError};
use crate::score::{percent_down, percent_up};
use crate::vehicle::{GroundAsked, GroundRule, TargetRule, Vehicle};

/// Poses of the sensors that may stand on a mount.
pub(crate) struct MountPoses<'a> {
    /// Fewest and most sensors that it holds.
    pub count: [usize; 2],
    /// Beams of a sensor of any allowed model at each pose.
    pub poses: Vec<&'a SightBeams>,
}

impl MountPoses<'_> {
    /// Most beams of a pose at a place.
    fn best_at(&self, place: usize) -> u32 {
        let beams = self.poses.iter().filter_map(|pose| pose.beams.get(place).copied());
        beams.max().map_or(0, u32::from)
    }
}

/// A requirement that no rig on some poses meets.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OutOfReach {
    /// Sentence without its full stop: name, bound, requirement, how to mend it.
    pub words: String,
    /// Most beams at any of its places, with every mount full; `None` for ground and overlap.
    pub beams: Option<u32>,
    /// Largest share of its places at which enough beams are possible, of its ground that is seen, or largest overlap.
    pub share: f64,
    /// True if it follows from beams of poses, not from the number of LiDARs alone.
    pub is_measured: bool,
}

/// Fewest LiDARs that can meet a rule.
fn fewest(rule: &Rule) -> usize {
    1 + usize::from(rule.without_any_one()) + usize::from(matches!(rule, Rule::Overlap(_)))
}

impl Sight {
    /// Rules on targets, ground and overlap that no rig on these poses meets.
    ///
    /// At each place the bound takes the most beams of any pose of a mount, times the sensors that the mount holds.
    /// Ground counts that any pose sees. Distances, prices and poses that do not go together are passed over, so that
    /// every rig on the poses has at most as much. Where a rule must hold without any one LiDAR, the bound
    /// has one LiDAR less, on the mount that misses it most.
    pub(crate) fn out_of_reach(&self, mounts: &[MountPoses<'_>]) -> Vec<OutOfReach> {
        let used: Vec<_> = mounts.iter().filter(|mount| mount.count[1] > 0).collect();
        let seats: usize = used.iter().map(|mount| mount.count[1]).sum();
        let bound = |rule: &Rule| match rule {
            _ if rule.least() <= 0.0 => None,
            _ if fewest(rule) > seats.max(1) => {
                Some(too_few_seats(rule.name(), seats, fewest(rule)))
            }
            Rule::Target(rule, sites) => self.target_bound(rule, sites, &used),
            Rule::Ground(rule, number) => self.ground_bound(rule, *number, &used),
            Rule::Overlap(rule) => self.overlap_bound(rule, &used),
        };
        self.rules.iter().filter_map(bound).collect()
    }

    /// The bound on a rule on the ground, for the ground that all poses see together; `None` if it may be met.
    ///
    /// A mount that holds one LiDAR has none once that is lost.
    fn ground_bound(
        &self,
        rule: &GroundRule,
        number: usize,
        used: &[&MountPoses<'_>],
    ) -> Option<OutOfReach> {
        let left = |lost: Option<usize>| {
            let mut all = SightBeams::default();
            let left = used.iter().enumerate().filter(|(mount, _)| Some(*mount) != lost);
            left.flat_map(|(_, mount)| &mount.poses).for_each(|pose| all.add(pose));
            (self.ground_share(&all, number), lost, all)
        };
        let single = |mount: &usize| rule.without_any_one && used[*mount].count[1] == 1;
        let losses = (0..used.len()).filter(single).map(|mount| left(Some(mount)));
        let (share, lost, all) =
            losses.fold(left(None), |least, of| if of.0 < least.0 { of } else { least });
        if share >= rule.share {
            return None;
        }
        let mend = match rule.asked {
            GroundAsked::Within(_) => "lower `share`",
            GroundAsked::BlindZone(..) => "raise `depth`, lower `share`",
        };
        let lacks = self.ground_missing(&all, number).unwrap_or_default();
        let but = if lost.is_some() { " but the worst to lose" } else { "" };
        let words = format!(
            "{}: even a LiDAR at every pose looked at on each mount{but} leaves it {:.1} % seen, {:.1} % required, {lacks}; {mend}, add \
             or widen mounts, or take other sensors",
            rule.name,
            percent_down(share),
            percent_up(rule.share)
        );
        Some(OutOfReach { words, beams: None, share, is_measured: true })
    }

    /// The bound on a rule on a target, by the most beams at each place; `None` if it may be met.
    ///
    /// Where a rule must hold without any one LiDAR, one of each mount is lost in turn: every rig then has at most the beams of
    /// the others at their best poses, whether the mount was full or empty.
    fn target_bound(
        &self,
        rule: &TargetRule,
        sites: &[RuleSite],
        used: &[&MountPoses<'_>],
    ) -> Option<OutOfReach> {
        let mut beams = 0;
        // Share of some places that all LiDARs may meet, then without one of each mount.
        let bound = |RuleSite { places, .. }: &RuleSite| {
            let mut met = vec![0; used.len() + 1];
            for place in places.clone() {
                let best: Vec<u32> = used.iter().map(|mount| mount.best_at(place)).collect();
                let most = best.iter().zip(used).map(|(best, mount)| best * mount.count[1] as u32);
                let most: u32 = most.sum();
                beams = most.max(beams);
                let is_met = |lost: u32| usize::from(most - lost >= u32::from(self.enough[place]));
                let lost = std::iter::once(0).chain(best);
                met.iter_mut().zip(lost).for_each(|(met, lost)| *met += is_met(lost));
            }
            let share =
                |met: usize| if places.is_empty() { 1.0 } else { met as f64 / places.len() as f64 };
            met.into_iter().map(share).collect::<Vec<f64>>()
        };
        let bounds: Vec<Vec<f64>> = sites.iter().map(bound).collect();
        let scenes = || sites.iter().map(|site| site.pose.scene);
        let share_of = |lost: usize| together(scenes().zip(bounds.iter().map(|of| of[lost])));
        let whole = share_of(0);
        let after_loss = (1..=used.len()).map(share_of).min_by(f64::total_cmp);
        let after_loss = after_loss.filter(|left| rule.without_any_one && *left < whole);
        let share = after_loss.unwrap_or(whole);
        if share >= rule.share {
            return None;
        }
        let (name, wanted) = (&rule.name, rule.beams);
        let lost = if after_loss.is_some() { ", the worst LiDAR lost," } else { "" };
        let words = if beams < wanted {
            format!(
                "{name}: even the best pose looked at on each mount meets it with at most {beams} of {wanted} beams; lower \
                 `beams` or take a sensor of finer spacing"
            )
        } else {
            format!(
                "{name}: even the best pose looked at on each mount{lost} leaves it at most {:.1} % seen, {:.1} % required; lower \
                 `share` or `within`, add or widen mounts, or take other sensors",
                // Rounded up, as a bound from above.
                percent_up(share),
                100.0 * rule.share
            )
        };
        Some(OutOfReach { words, beams: Some(beams), share, is_measured: true })
    }
}

/// The bound on a rule that takes more LiDARs than the mounts hold.
fn too_few_seats(name: &str, seats: usize, fewest: usize) -> OutOfReach {
    let hold = ["no LiDAR", "one LiDAR", "two LiDARs"][seats.min(2)];
    let takes = if fewest == 2 { "two" } else { "three" };
    let words = format!(
        "{name}: the mounts hold {hold}, and this takes {takes}; raise `count` of a mount, add a mount, or leave the \
         requirement out"
    );
    OutOfReach { words, beams: None, share: 0.0, is_measured: false }
}

/// Words on places of which none is free ground, of which some are bare of ground.
fn not_free(places: usize, bare: usize) -> String {
    let taken = "a thing or the own body stands at";
    match bare {
        0 => format!("{taken} each of its {places} places"),
        _ if bare == places => format!("there is no ground below any of its {places} places"),
        _ => format!(
            "there is no ground below {bare} of its {places} places, and {taken} the others"
        ),
    }
}

/// Number of the first rule of a target for which no place is free, with words behind its place; `None` where each has some.
fn none_free(problem: &Problem, targets: &[TargetRule]) -> Option<(usize, String)> {
    if targets.is_empty() {
        return None;
    }
    let bodies = BodyPoses::of(TargetSite::of(problem), [(problem, false)]);
    let is_taken = |(_, rule): &(usize, &TargetRule)| {
        let places = places_of(rule);
        let is_free = |(site, _): (&TargetSite, usize)| {
            places.iter().any(|&at| site.standing(&rule.target, at).is_some())
        };
        !bodies.each(rule).any(is_free)
    };
    let (number, rule) = targets.iter().enumerate().find(is_taken)?;
    let (name, places) = (&rule.name, places_of(rule));
    let told = if rule.on_scene {
        let is_bare = |at: &&[f64; 3]| bodies.each(rule).all(|(site, _)| !site.has_ground(**at));
        let why = not_free(places.len(), places.iter().filter(is_bare).count());
        format!(
            ": no place of `{name}` is free ground of the scene beside the own body: {why}; change `within` or `bearing`, or \
             leave `ground` out for level ground"
        )
    } else {
        format!(
            ": every place of `{name}` lies in the own body, so that no share of them can be seen; raise `within` beyond the \
             body, or turn `bearing`"
        )
    };
    Some((number, told))
}

/// Checks that every rule of a vehicle on targets and on the ground has something that counts, in the vehicle's problem.
///
/// # Errors
/// The first rule whose places all lie in the own body, or whose distance reaches no cell; a body from whose outline no
/// ground is counted.
pub(crate) fn check_counting(problem: &Problem, vehicle: &Vehicle) -> Result<(), ProblemError> {
    let Vehicle { require, targets, ground, require_order, .. } = vehicle;
    let index = |number: usize| require_order.get(number).copied().unwrap_or(number);
    if let Some((number, told)) = none_free(problem, targets) {
        return Err(ProblemError::Rule(index(require.len() + number), told));
    }
    let least = least_metres(problem, ground)?;
    for ((number, rule), least) in ground.iter().enumerate().zip(least) {
        let index = index(require.len() + targets.len() + number);
        let (key, metres) = match rule.asked {
            GroundAsked::Within(metres) => ("ground", metres),
            GroundAsked::BlindZone(_, metres) => ("depth", metres),
        };
        let name = &rule.name;
        match least {
            None => {
                let told = format!(
                    ".blind_zone: no lane of `{name}` lies before the own body, which is narrower there than the 0.25 m of a \
                     lane; leave it out of `require`, or correct the body"
                );
                return Err(ProblemError::Rule(index, told));
            }
            Some(least) if least > metres => {
                // Rounded up to whole centimetres.
                let least = (100.0 * least - 1e-9).ceil() / 100.0;
                let told = format!(
                    ".{key}: `{name}` holds no cell of ground, so that no share of it can be seen: cells are 0.25 m wide, and \
                     the middle of the nearest one lies {least} m from the own body; give {least} or more"
                );
                return Err(ProblemError::Rule(index, told));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::targets::tests::posed;
    use crate::vehicle::SensorPose;

    /// The sight of a vehicle with up to `most` LiDARs that must meet a tyre at one distance, ahead and to the left, with
    /// `beams` beams at a share of the places.
    fn sight(most: u32, beams: u64, share: &str) -> Sight {
        posed(&format!(
            r#"{{
              "sensors": [{{ "name": "a", "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }} }}],
              "mounts": [{{ "name": "top", "min": [-2, -1, 2], "max": [2, 1, 2.5], "count": [0, {most}] }}],
              "require": [{{ "target": "tyre", "from": 20, "within": 20, "bearing": [0, 15], "beams": {beams},
                            "share": {share} }}] }}"#
        ))
    }

    /// The sight of a vehicle with a body and up to two LiDARs on its roof.
    fn on_roof(require: &str) -> Sight {
        posed(&format!(
            r#"{{
              "body": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0.2], "size": [4, 1.8, 1.2] }} }}],
              "sensors": [{{ "name": "a", "lidar": {{ "channels": 16, "fov": [-60, 0], "azimuth_steps": 72, "range": 30 }} }}],
              "mounts": [{{ "name": "top", "min": [-1, -0.5, 1.6], "max": [1, 0.5, 1.8], "count": [0, 2] }}],
              "require": [{require}] }}"#
        ))
    }

    fn pose(x: f64, y: f64) -> SensorPose {
        SensorPose { x, y, z: 1.7, ..SensorPose::default() }
    }

    /// Poses on a mount for up to two LiDARs, and on another one for one.
    fn two_mounts<'a>(first: &'a [SightBeams], second: &'a [SightBeams]) -> [MountPoses<'a>; 2] {
        [(first, 2), (second, 1)]
            .map(|(of, most)| MountPoses { count: [0, most], poses: of.iter().collect() })
    }

    #[test]
    fn no_rig_on_the_poses_sees_ground_beyond_the_bound() {
        let sight = on_roof(
            r#"{ "ground": 3, "share": 1 }, { "blind_zone": "left", "depth": 1 },
               { "ground": 10, "share": 0.05 }"#,
        );
        let poses = [pose(-0.8, -0.4), pose(0.8, -0.4), pose(-0.8, 0.4), pose(0.8, 0.4)];
        let seen = poses.map(|pose| sight.beams(&pose).unwrap());
        let mount = |most: usize| MountPoses { count: [0, most], poses: seen.iter().collect() };
        let bound = sight.out_of_reach(&[mount(2)]);
        let [ring, left] = &bound[..] else { panic!("ground to 10 m is in reach: {bound:?}") };
        let start = ": even a LiDAR at every pose looked at on each mount leaves it ";
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
    fn no_rig_keeps_more_ground_after_a_loss_than_the_other_mounts_see() {
        let sight = on_roof(
            r#"{ "ground": 3, "share": 1, "without_any_one": true }, { "ground": 3, "share": 1 }"#,
        );
        let seen = |poses: [SensorPose; 2]| poses.map(|pose| sight.beams(&pose).unwrap());
        let front = seen([pose(0.9, -0.4), pose(0.9, 0.4)]);
        let rear = seen([pose(-0.9, 0.2), pose(-0.5, 0.4)]);
        let bound = |seats: usize| {
            let mounts = [&front, &rear]
                .map(|of| MountPoses { count: [0, seats], poses: of.iter().collect() });
            let [lost, whole] = &sight.out_of_reach(&mounts)[..] else { panic!("two rules") };
            (lost.clone(), whole.share)
        };
        let share = |each: &[&SightBeams], rule: usize| sight.rules_met(each)[rule].share;
        let (lost, whole) = bound(1);
        let alone = [&front, &rear].map(|of| share(&[&of[0], &of[1]], 1));
        assert_eq!(lost.share, alone[0].min(alone[1]));
        assert!(lost.share < whole && lost.words.contains(" but the worst to lose leaves it "));
        for (a, b) in (0..4).map(|k| (&front[k / 2], &rear[k % 2])) {
            assert!(share(&[a, b], 0) <= lost.share && share(&[a, b], 1) <= whole);
        }
        // Two on a mount may stand at one pose, so that no loss takes anything.
        let (lost, whole) = bound(2);
        assert!(lost.share == whole && !lost.words.contains("but the worst"), "{lost:?}");
    }

    #[test]
    fn no_rig_keeps_more_after_a_loss_than_the_bound() {
        let mut rng = ChaCha8Rng::seed_from_u64(12);
        let (mut in_reach, mut beyond, mut tight) = (0, 0, 0);
        for round in 0..300_u16 {
            let wanted = 2 + (round % 3) as u8;
            let sight = sight(3, wanted.into(), r#"0.99, "without_any_one": true"#);
            let mut pose = || {
                let beams = (0..3).map(|_| rng.random_range(0..=wanted)).collect();
                SightBeams { beams, ..SightBeams::default() }
            };
            let (first, second): (Vec<_>, Vec<_>) =
                ((0..3).map(|_| pose()).collect(), (0..2).map(|_| pose()).collect());
            let mounts = two_mounts(&first, &second);
            let share = |k: usize| {
                let rig = [&first[k % 3], &first[k / 3 % 3], &second[k / 9]];
                sight.rules_met(&rig)[0].share
            };
            let best = (0..18).map(share).fold(0.0, f64::max);
            match &sight.out_of_reach(&mounts)[..] {
                [] => in_reach += 1,
                [one] => {
                    assert!(best <= one.share && best < 1.0, "{best} {one:?}");
                    (beyond, tight) = (beyond + 1, tight + usize::from(best == one.share));
                }
                _ => panic!("one rule"),
            }
            // One seat leaves nothing.
            let alone = [MountPoses { count: [0, 1], poses: first.iter().collect() }];
            let words = &sight.out_of_reach(&alone)[0].words;
            assert!(
                words.contains("any one LiDAR lost: the mounts hold one LiDAR, and"),
                "{words}"
            );
        }
        assert!(in_reach > 10 && 2 * tight > beyond && beyond > 10, "{in_reach} {beyond} {tight}");
    }

    #[test]
    fn no_rig_on_the_poses_is_beyond_the_bound() {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut found = [0; 3];
        for round in 0..300 {
            let wanted = 4 + round % 4;
            let sight = sight(2, wanted, "0.5");
            assert_eq!(sight.places.len(), 3, "every 7.5 degrees");
            let mut pose = || {
                let beams = (0..3).map(|_| rng.random_range(0..=2_u8)).collect();
                SightBeams { beams, ..SightBeams::default() }
            };
            // Three poses on one mount for two sensors, two on another for one.
            let (first, second): (Vec<_>, Vec<_>) =
                ((0..3).map(|_| pose()).collect(), (0..2).map(|_| pose()).collect());
            let mounts = two_mounts(&first, &second);
            let bound = sight.out_of_reach(&mounts);
            // Every rig: any two poses of the first mount, one of the second.
            let mut best = 0;
            for (a, b, c) in (0..18).map(|k| (&first[k % 3], &first[k / 3 % 3], &second[k / 9])) {
                let beams = |place: usize| -> u64 {
                    [a, b, c].map(|pose| u64::from(pose.beams[place])).iter().sum()
                };
                best = best.max((0..3).filter(|&place| beams(place) >= wanted).count());
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
