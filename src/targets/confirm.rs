//! Places of a rule on targets, and the closer look at a rule that must be met at all of them, in each pose of the own bodies.

use rayon::prelude::*;

use super::beams::{PlacedTarget, TargetSite};
use super::bodies::{BodyPoses, together, worst_frame};
use super::card::position;
use super::missing::Missing;
use crate::maths;
use crate::problem::Problem;
use crate::score::{RulePlaces, Seen, WorstFrame};
use crate::vehicle::{Placement, SensorPose, TargetRule, UnknownSensor};

/// Degrees between bearings of a rule at most, and metres between its distances at most.
const RULE_DEGREES: f64 = 7.5;
const RULE_METRES: f64 = 2.5;
/// Parts of a short way between its first and last distance at least, where these are not below [`LEAST_METRES`].
const LEAST_PARTS: f64 = 4.0;
/// Degrees between bearings of a closer look at least, and metres between its distances at least.
const LEAST_DEGREES: f64 = 1.0;
const LEAST_METRES: f64 = 0.5;

/// Places of a rule: bearings and distances spread evenly with both ends among them, as few as are at most 7.5° and
/// 2.5 m apart; on a short way four parts, or parts of 0.5 m. The middle bearing is one of them; all round the last
/// bearing is the first.
pub(crate) fn places_of(rule: &TargetRule) -> Vec<[f64; 3]> {
    spread(rule, [1, 1])
}

/// Number of the places of a rule.
pub(super) fn place_count(rule: &TargetRule) -> usize {
    let [bearings, distances] = numbers(rule, [1, 1]);
    bearings.count * distances.count
}

/// Numbers spread evenly: the first, the last or for a whole turn the one after the last, parts between, and how many.
struct Spread {
    from: f64,
    to: f64,
    parts: usize,
    count: usize,
}

impl Spread {
    fn each(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { from, to, parts, count } = *self;
        (0..count).map(move |k| from + (to - from) * k as f64 / parts as f64)
    }
}

/// Bearings and distances of a rule, closer together by whole factors.
fn numbers(rule: &TargetRule, closer: [usize; 2]) -> [Spread; 2] {
    let [from, to] = rule.bearings;
    let is_round = to - from >= 360.0;
    // Even, so that a sector ahead or behind looks straight ahead or behind.
    let parts = closer[0] * (2 * ((to - from) / (2.0 * RULE_DEGREES)).ceil() as usize).max(1);
    let count = if to > from { parts + usize::from(!is_round) } else { 1 };
    let bearings = Spread { from, to, parts, count };
    let [from, to] = [rule.from, rule.within];
    let least = ((to - from) / LEAST_METRES).ceil().min(LEAST_PARTS);
    let parts = closer[1] * (((to - from) / RULE_METRES).ceil().max(least) as usize).max(1);
    let count = if to > from { parts + 1 } else { 1 };
    [bearings, Spread { from, to, parts, count }]
}

/// Like [`places_of`], with bearings and distances closer together by whole factors.
fn spread(rule: &TargetRule, closer: [usize; 2]) -> Vec<[f64; 3]> {
    let [bearings, distances] = numbers(rule, closer);
    let at = |bearing: f64| distances.each().map(move |metres| position(metres, bearing));
    bearings.each().flat_map(at).collect()
}

/// Factors by which bearings and distances of a rule come closer together. Bearings: until the target at the farthest
/// distance is as wide as they are apart, or they are 1° apart. Distances: until the target is as deep, or 0.5 m.
fn factors(rule: &TargetRule) -> [usize; 2] {
    let width = rule.target.size[0].min(rule.target.size[1]);
    let angle = maths::atan2(width, rule.within).to_degrees().max(LEAST_DEGREES);
    let [_, distances] = numbers(rule, [1, 1]);
    let step = (distances.to - distances.from) / distances.parts as f64;
    [RULE_DEGREES / angle, step / width.max(LEAST_METRES)]
        .map(|factor| factor.ceil().max(1.0) as usize)
}

/// Beams of each LiDAR at close places of a rule.
struct CloseLook<'a> {
    rule: &'a TargetRule,
    /// Places with room for the target or without.
    asked: usize,
    places: Vec<[f64; 3]>,
    /// `[lidars][places]`.
    beams: Vec<Vec<u32>>,
}

impl<'a> CloseLook<'a> {
    fn new(
        site: &TargetSite,
        rule: &'a TargetRule,
        lidars: &[SensorPose],
    ) -> Result<Self, UnknownSensor> {
        let target = &*rule.target;
        let all = spread(rule, factors(rule));
        let asked = all.len();
        let free = all.into_iter().filter_map(|at| site.standing(target, at));
        let places: Vec<_> = free.collect();
        let standing: Vec<_> = places.iter().map(|&at| PlacedTarget { target, at }).collect();
        let beams = lidars.par_iter().map(|lidar| site.beams(lidar, &standing, rule.beams));
        let beams = beams.collect::<Result<Vec<_>, _>>()?;
        Ok(Self { rule, asked, places, beams })
    }

    /// Whether the target is met at each place, without a LiDAR.
    fn met(&self, lost: Option<usize>) -> impl Iterator<Item = bool> {
        (0..self.places.len()).map(move |place| {
            let left = self.beams.iter().enumerate().filter(|(lidar, _)| Some(*lidar) != lost);
            left.map(|(_, beams)| beams[place]).sum::<u32>() >= self.rule.beams
        })
    }

    fn share(&self, lost: Option<usize>) -> f64 {
        let met = self.met(lost).filter(|is_met| *is_met).count();
        if self.places.is_empty() { 1.0 } else { met as f64 / self.places.len() as f64 }
    }

    /// Places that are not met, in words.
    fn missing(&self, lost: Option<usize>) -> Option<String> {
        let places = self.places.iter().copied().zip(self.met(lost));
        Missing::new(self.rule, places).map(|missing| missing.to_string())
    }
}

/// Close looks at a rule with the own bodies in each of their poses or in each scene, by the first frame of each.
struct InSites<'a>(Vec<(usize, CloseLook<'a>)>, &'a TargetRule);

impl<'a> InSites<'a> {
    fn new(
        bodies: &BodyPoses,
        rule: &'a TargetRule,
        lidars: &[SensorPose],
    ) -> Result<Self, UnknownSensor> {
        let look = |(site, frame)| Ok((frame, CloseLook::new(site, rule, lidars)?));
        let mut looks = bodies.each(rule).map(look).collect::<Result<Vec<_>, _>>()?;
        looks.retain(|(_, look)| !(rule.on_scene && look.places.is_empty()));
        Ok(Self(looks, rule))
    }

    /// Share in the worst pose, or the mean over scenes.
    fn share(&self, lost: Option<usize>) -> f64 {
        together(self.1, self.0.iter().map(|(_, look)| look.share(lost)))
    }

    /// Frame of the pose in which least is met.
    fn worst_frame(&self, lost: Option<usize>) -> Option<WorstFrame> {
        worst_frame(self.1, self.0.iter().map(|(frame, look)| (*frame, look.share(lost))))
    }

    fn places(&self) -> RulePlaces {
        let looks = || self.0.iter().map(|(_, look)| look);
        let judged = looks().map(|look| look.places.len()).sum();
        let asked: usize = looks().map(|look| look.asked).sum();
        RulePlaces { judged, left_out: asked - judged, on_scene: self.1.on_scene }
    }

    /// Replaces share, places, missing ones and worst frame of a requirement.
    fn tell(&self, lost: Option<usize>, seen: &mut Seen) {
        let shares: Vec<f64> = self.0.iter().map(|(_, look)| look.share(lost)).collect();
        let worst = (0..shares.len()).min_by(|&a, &b| shares[a].total_cmp(&shares[b]));
        let Some(worst) = worst else { return };
        (seen.share, seen.missing) = (self.share(lost), self.0[worst].1.missing(lost));
        seen.worst_frame = self.worst_frame(lost);
        seen.places = Some(self.places());
        let in_scene = |(_, look): &(usize, CloseLook<'_>)| (look.share(lost), look.missing(lost));
        seen.in_scenes =
            if self.1.on_scene { self.0.iter().map(in_scene).collect() } else { vec![] };
    }
}

/// Looks again at each rule on a target that asks for 100 % and has it, in each pose of the own bodies or in each scene.
/// Bearings are then as close together as the target is wide at the farthest distance, and distances as it is deep. Narrow
/// things on the own body and gaps between rings of beams hide a target between the places of a search. Shares and missed places there replace the ones that the search found. Rules that
/// ask for less are judged at the places of the search alone: else a rig met at 100 % of these could fail where one met at
/// fewer does not.
///
/// # Errors
/// A model that the vehicle does not have.
pub(crate) fn confirm(
    bodies: &BodyPoses,
    problem: &Problem,
    placement: &Placement,
    required: &mut [Seen],
) -> Result<(), UnknownSensor> {
    let mounts = problem.rules().mount_names(placement);
    confirm_rules(bodies, problem.target_rules(), (&placement.lidars, &mounts), required)
}

fn confirm_rules(
    bodies: &BodyPoses,
    rules: &[TargetRule],
    (lidars, mounts): (&[SensorPose], &[Option<&str>]),
    required: &mut [Seen],
) -> Result<(), UnknownSensor> {
    let is_whole = |seen: &Seen| seen.lost.as_ref().map_or(seen.share, |lost| lost.intact) >= 1.0;
    for seen in required.iter_mut().filter(|seen| is_whole(seen)) {
        let rule = rules.iter().find(|rule| rule.share >= 1.0 && rule.name == seen.name);
        let Some(rule) = rule else { continue };
        let look = InSites::new(bodies, rule, lidars)?;
        let Some(lost) = &mut seen.lost else {
            look.tell(None, seen);
            continue;
        };
        (lost.intact, lost.intact_frame) = (look.share(None), look.worst_frame(None));
        seen.places = Some(look.places());
        let each: Vec<f64> = (0..lidars.len()).map(|lidar| look.share(Some(lidar))).collect();
        let worst = (0..each.len()).min_by(|&a, &b| each[a].total_cmp(&each[b]));
        let Some(worst) = worst.filter(|&worst| each[worst] < 1.0) else { continue };
        // Where every loss leaves as much, none is the worst.
        let is_worst = each.len() == 1 || each.iter().any(|share| *share > each[worst]);
        let mount = mounts.get(worst).copied().flatten().filter(|_| is_worst);
        (lost.worst, lost.mount) = (is_worst.then_some(worst), mount.map(str::to_owned));
        look.tell(Some(worst), seen);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::Target;
    use crate::score::Lost;
    use crate::targets::tests::{directions, site, wall};

    /// A rule on a car at all places from 10 to 50 m, all round.
    fn rule(without_any_one: bool) -> TargetRule {
        TargetRule {
            name: "car".to_owned(),
            target: Arc::new(Target::named("car").unwrap()),
            from: 10.0,
            within: 50.0,
            bearings: [-180.0, 180.0],
            on_scene: false,
            beams: 5,
            share: 1.0,
            without_any_one,
        }
    }

    /// The share of a rule on some LiDARs, found as 100 % before.
    fn confirmed(site: &TargetSite, rule: TargetRule, lidars: &[SensorPose]) -> Seen {
        let lost = Lost { intact: 1.0, ..Lost::default() };
        let lost = rule.without_any_one.then_some(lost);
        let mut seen = [Seen { lost, ..Seen::of("car", 1.0) }];
        let bodies = BodyPoses::of(site.clone(), []);
        confirm_rules(&bodies, &[rule], (lidars, &[]), &mut seen).unwrap();
        let [seen] = seen;
        seen
    }

    #[test]
    fn a_mast_between_two_bearings_takes_the_hundred_per_cent() {
        let elevations: Vec<f64> = (0..48).map(|k| (-0.3 * f64::from(k)).to_radians()).collect();
        let beams = directions(&elevations, 1800);
        // A mast 9 cm wide 1 m ahead, at a bearing of 3.75°.
        let mut mast = wall(0.998);
        let low = 0.065 - 0.045;
        mast.vertices.iter_mut().for_each(|at| at[1] = low + 0.09 * f32::from(at[1] > 0.0));
        let [free, hidden] = [wall(-90.0), mast].map(|body| site(&beams, 100.0, &body));
        let lidar = SensorPose::at(0.0, 0.0, 2.0);
        let places = places_of(&rule(false));
        assert_eq!((places.len(), place_count(&rule(false))), (48 * 17, 48 * 17));
        assert_eq!(spread(&rule(false), [4, 2]).len(), 192 * 33);
        assert!(places.iter().all(|at| {
            let near = |other: &[f64; 3]| (0..3).all(|k| (at[k] - other[k]).abs() < 1e-9);
            spread(&rule(false), [4, 2]).iter().any(near)
        }));
        // At its own places the rule is met.
        let car = rule(false).target;
        let target = &*car;
        let standing: Vec<_> = places.iter().map(|&at| PlacedTarget { target, at }).collect();
        assert!(hidden.met(&[lidar], &standing, 5).unwrap().iter().all(|is_met| *is_met));
        let seen = confirmed(&hidden, rule(false), &[lidar]);
        assert!(seen.share > 0.98 && seen.share < 1.0, "{seen:?}");
        assert!(seen.missing.as_ref().unwrap().contains(" of 192 bearings, "), "{seen:?}");
        assert_eq!(confirmed(&free, rule(false), &[lidar]).share, 1.0);
        // A rule that asks for less stays at its own places, as for a rig that misses some of them.
        let lenient = TargetRule { share: 0.9, ..rule(false) };
        assert_eq!(confirmed(&hidden, lenient, &[lidar]).share, 1.0);
        // A second LiDAR beside it looks past the mast, until it is lost.
        let beside = SensorPose::at(0.0, 0.5, 2.0);
        let both = confirmed(&hidden, rule(true), &[lidar, beside]);
        let lost = both.lost.as_ref().unwrap();
        assert_eq!((lost.intact, both.share < 1.0), (1.0, true), "{both:?}");
        assert!(lost.worst.is_some() && both.missing.is_some(), "{both:?}");
        // The worst of two poses of the bodies counts, whichever comes first.
        for (sites, frames) in [([&free, &hidden], [0, 7]), ([&hidden, &free], [7, 0])] {
            let sites = sites.map(TargetSite::clone).to_vec();
            let bodies = BodyPoses::of_sites(sites, frames);
            let mut told = [Seen::of("car", 1.0)];
            confirm_rules(&bodies, &[rule(false)], (&[lidar], &[]), &mut told).unwrap();
            let worst_frame = Some(WorstFrame { frame: 7, share: seen.share });
            let places = seen.places.map(|of| RulePlaces { judged: 2 * of.judged, ..of });
            assert_eq!(told[0], Seen { worst_frame, places, ..seen.clone() });
        }
        // A share after the worst loss that was lower before is one of the closer look, too.
        let lost =
            Lost { worst: Some(1), mount: Some("roof".to_owned()), ..both.lost.clone().unwrap() };
        let mut seen = [Seen { lost: Some(lost), ..Seen::of("car", 0.5) }];
        let bodies = BodyPoses::of(hidden, []);
        confirm_rules(&bodies, &[rule(true)], (&[lidar, beside], &[]), &mut seen).unwrap();
        assert_eq!(seen[0], both);
    }

    #[test]
    fn a_gap_between_two_rings_takes_the_hundred_per_cent() {
        // Rings that meet a tyre at its places, and pass below or above one between the nearest of them.
        let elevations = [10.0, 12.5, 15.0, 17.5, 20.0].map(|metres| -maths::atan2(1.9, metres));
        let site = site(&directions(&elevations, 3600), 100.0, &wall(-90.0));
        let tyre = Arc::new(Target::named("tyre").unwrap());
        let rule = TargetRule { target: tyre, within: 20.0, beams: 1, ..rule(false) };
        let lidar = SensorPose::at(0.0, 0.0, 2.0);
        let target = &*rule.target;
        let standing: Vec<_> =
            places_of(&rule).into_iter().map(|at| PlacedTarget { target, at }).collect();
        assert!(site.met(&[lidar], &standing, 1).unwrap().iter().all(|is_met| *is_met));
        let seen = confirmed(&site, rule.clone(), &[lidar]);
        assert!(seen.share < 0.98, "{seen:?}");
        let missing = seen.missing.unwrap();
        assert!(missing.starts_with("missing at 11.25"), "{missing}");
    }

    #[test]
    fn a_short_way_has_more_than_its_two_ends() {
        let along = |within: f64| {
            let rule = TargetRule { bearings: [0.0, 0.0], from: 2.0, within, ..rule(false) };
            places_of(&rule).into_iter().map(|at| at[0]).collect::<Vec<_>>()
        };
        assert_eq!(along(4.0), [2.0, 2.5, 3.0, 3.5, 4.0]);
        assert_eq!(along(3.0), [2.0, 2.5, 3.0]);
        assert_eq!(along(2.0), [2.0]);
        assert_eq!(along(7.0), [2.0, 3.25, 4.5, 5.75, 7.0]);
        assert_eq!(along(14.5), [2.0, 4.5, 7.0, 9.5, 12.0, 14.5]);
    }
}
