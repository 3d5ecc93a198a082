//! Places of a rule on targets, and a look at places closer together, in each pose of the own bodies.

use rayon::prelude::*;

use super::beams::{PlacedTarget, TargetSite};
use super::bodies::{BodyPoses, together};
use super::card::position;
use crate::maths;
use crate::score::Between;
use crate::vehicle::{SensorPose, TargetRule, UnknownSensor};

/// Degrees between bearings of a rule at most, and metres between its distances at most.
const RULE_DEGREES: f64 = 7.5;
const RULE_METRES: f64 = 2.5;
/// Parts of a short way between its first and last distance at least, where these are not below [`LEAST_METRES`].
const LEAST_PARTS: f64 = 4.0;
/// Degrees between bearings closer together at least, and metres between their distances at least.
const LEAST_DEGREES: f64 = 1.0;
const LEAST_METRES: f64 = 0.5;

/// Places of a rule: bearings and distances spread evenly with both ends among them, as few as are at most 7.5° and
/// 2.5 m apart; on a short way four parts, or parts of 0.5 m. The middle bearing is one of them; all round the last
/// bearing is the first.
///
/// A rule that asks for 100 % has bearings and distances as close together as [`factors`] says: narrow things on the own body
/// and gaps between rings of beams would hide a target between others. As many distances as elsewhere are taken at each
/// bearing, at the next bearing the ones a step farther, so that all are taken at some.
pub(crate) fn places_of(rule: &TargetRule) -> Vec<[f64; 3]> {
    let ([bearings, distances], every) = tested(rule);
    let at = |(k, bearing): (usize, f64)| {
        distances.each().skip(k % every).step_by(every).map(move |metres| position(metres, bearing))
    };
    bearings.each().enumerate().flat_map(at).collect()
}

/// Number of the places of a rule.
pub(super) fn place_count(rule: &TargetRule) -> usize {
    let ([bearings, distances], every) = tested(rule);
    (0..bearings.count).map(|k| (distances.count - k % every).div_ceil(every)).sum()
}

/// Bearings and distances that a rule tests. At each bearing every few distances are taken; the first of these is the first
/// distance at the first bearing, and the next one at each next bearing.
fn tested(rule: &TargetRule) -> ([Spread; 2], usize) {
    let closer = if rule.share < 1.0 { [1, 1] } else { factors(rule) };
    let [bearings, distances] = numbers(rule, closer);
    let every = closer[1].min(bearings.count);
    ([bearings, distances], every)
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

/// Places at all bearings and distances, closer together by whole factors.
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

/// A rule at places closer together than its own, as [`factors`] says, with the worst LiDAR lost where the rule says so. Where
/// the own bodies move, in the worst of their poses; on the ground of scenes, a mean over scenes.
///
/// # Errors
/// A model that the vehicle does not have.
pub(crate) fn look_between(
    bodies: &BodyPoses,
    rule: &TargetRule,
    lidars: &[SensorPose],
) -> Result<Between, UnknownSensor> {
    let look = |(site, scene)| CloseLook::new(site, rule, lidars).map(|look| (scene, look));
    let mut looks = bodies.each(rule).map(look).collect::<Result<Vec<_>, _>>()?;
    looks.retain(|(_, look)| !(rule.on_scene && look.count == 0));
    let share = |lost| together(looks.iter().map(|(scene, look)| (*scene, look.share(rule, lost))));
    let lost = (0..lidars.len()).filter(|_| rule.without_any_one).map(Some);
    let found = lost.map(share).fold(share(None), f64::min);
    Ok(Between { places: looks.iter().map(|(_, look)| look.count).sum(), found })
}

/// Beams of each LiDAR at free places of a rule, closer together than its own: `[lidars][count]`.
struct CloseLook {
    count: usize,
    beams: Vec<Vec<u32>>,
}

impl CloseLook {
    fn new(
        site: &TargetSite,
        rule: &TargetRule,
        lidars: &[SensorPose],
    ) -> Result<Self, UnknownSensor> {
        let target = &*rule.target;
        let all = spread(rule, factors(rule)).into_iter();
        let free = all.filter_map(|at| site.standing(target, at));
        let standing: Vec<_> = free.map(|at| PlacedTarget { target, at }).collect();
        let beams = lidars.par_iter().map(|lidar| site.beams(lidar, &standing, rule.beams));
        Ok(Self { count: standing.len(), beams: beams.collect::<Result<_, _>>()? })
    }

    /// Share of the places at which the target is met, without a LiDAR.
    fn share(&self, rule: &TargetRule, lost: Option<usize>) -> f64 {
        let is_met = |place: &usize| {
            let left = self.beams.iter().enumerate().filter(|(lidar, _)| Some(*lidar) != lost);
            left.map(|(_, beams)| beams[*place]).sum::<u32>() >= rule.beams
        };
        let met = (0..self.count).filter(is_met).count();
        if self.count == 0 { 1.0 } else { met as f64 / self.count as f64 }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::missing::missed_places;
    use super::*;
    use crate::scene::Target;
    use crate::targets::tests::{directions, site, wall};

    /// A rule on a car at all places from 10 to 50 m, all round.
    fn rule(share: f64) -> TargetRule {
        TargetRule {
            name: "car".to_owned(),
            target: Arc::new(Target::named("car").unwrap()),
            from: 10.0,
            within: 50.0,
            bearings: [-180.0, 180.0],
            on_scene: false,
            beams: 5,
            share,
            without_any_one: false,
        }
    }

    /// Share of the places of a rule at which enough beams meet its target.
    fn share_of(site: &TargetSite, rule: &TargetRule, lidar: SensorPose) -> f64 {
        let target = &*rule.target;
        let places = places_of(rule).into_iter();
        let standing: Vec<_> = places.map(|at| PlacedTarget { target, at }).collect();
        let met = site.met(&[lidar], &standing, rule.beams).unwrap();
        met.iter().filter(|is_met| **is_met).count() as f64 / met.len() as f64
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
        let (lenient, strict) = (rule(0.9), rule(1.0));
        assert_eq!((place_count(&lenient), place_count(&strict)), (48 * 17, 96 * (17 + 16)));
        assert_eq!(
            share_of(&hidden, &lenient, lidar),
            1.0,
            "at bearings 7.5° apart it is not hidden"
        );
        let share = share_of(&hidden, &strict, lidar);
        assert!(share > 0.98 && share < 1.0, "{share}");
        assert_eq!(share_of(&free, &strict, lidar), 1.0);
        let bodies = |site: &TargetSite| BodyPoses::of(site.clone(), []);
        let missing = missed_places(&bodies(&hidden), &strict, &[lidar]).unwrap().unwrap();
        assert!(missing.contains(" of 192 bearings, "), "{missing}");
        // A look between the places finds it for both rules.
        let between = look_between(&bodies(&hidden), &lenient, &[lidar]).unwrap();
        assert!(between.places == 192 * 33 && (between.found - share).abs() < 2e-3, "{between:?}");
        assert_eq!(look_between(&bodies(&hidden), &strict, &[lidar]).unwrap(), between);
        assert_eq!(look_between(&bodies(&free), &strict, &[lidar]).unwrap().found, 1.0);
        // A second LiDAR beside it looks past the mast, until it is lost; with the only one lost nothing is seen.
        let beside = SensorPose::at(0.0, 0.5, 2.0);
        let lost = TargetRule { without_any_one: true, ..lenient.clone() };
        let found = |rule, lidars: &[SensorPose]| {
            look_between(&bodies(&hidden), rule, lidars).unwrap().found
        };
        assert_eq!(found(&lenient, &[lidar, beside]), 1.0);
        assert!(found(&lost, &[lidar, beside]) <= between.found);
        assert_eq!(found(&lost, &[lidar]), 0.0);
        // The worst of two poses of the bodies counts, whichever comes first.
        for sites in [[&free, &hidden], [&hidden, &free]] {
            let bodies = BodyPoses::of_sites(sites.map(TargetSite::clone).to_vec(), [0, 7]);
            let told = look_between(&bodies, &lenient, &[lidar]).unwrap();
            assert_eq!(told, Between { places: 2 * between.places, ..between });
        }
    }

    #[test]
    fn a_gap_between_two_rings_takes_the_hundred_per_cent() {
        // Rings that meet a tyre 2.5 m apart, and pass below or above one between the nearest of them.
        let elevations = [10.0, 12.5, 15.0, 17.5, 20.0].map(|metres| -maths::atan2(1.9, metres));
        let site = site(&directions(&elevations, 3600), 100.0, &wall(-90.0));
        let target = Arc::new(Target::named("tyre").unwrap());
        let tyre = |share: f64| TargetRule {
            target: target.clone(),
            within: 20.0,
            beams: 1,
            ..rule(share)
        };
        let lidar = SensorPose::at(0.0, 0.0, 2.0);
        assert_eq!(share_of(&site, &tyre(0.9), lidar), 1.0);
        let share = share_of(&site, &tyre(1.0), lidar);
        assert!(share < 0.98, "{share}");
        let bodies = BodyPoses::of(site, []);
        let missing = missed_places(&bodies, &tyre(1.0), &[lidar]).unwrap().unwrap();
        assert!(missing.starts_with("missing at 11.25 to 13.75 m: 60 of 240 "), "{missing}");
    }

    #[test]
    fn places_of_a_rule_for_all_take_every_bearing_and_distance() {
        let strict = TargetRule { within: 20.0, bearings: [-20.0, 20.0], ..rule(1.0) };
        assert_eq!(factors(&strict), [2, 2], "no more than four times as close");
        let all = spread(&strict, factors(&strict));
        let taken = places_of(&strict);
        assert!(taken.iter().all(|place| all.contains(place)), "{taken:?}");
        let polar = |of: &[[f64; 3]]| {
            let bearing = |at: &[f64; 3]| (1e6 * maths::atan2(at[1], at[0])).round() as i64;
            let metres = |at: &[f64; 3]| (1e6 * maths::hypot(at[0], at[1])).round() as i64;
            let sorted =
                |of: &mut dyn Iterator<Item = i64>| of.collect::<std::collections::BTreeSet<_>>();
            [sorted(&mut of.iter().map(bearing)), sorted(&mut of.iter().map(metres))]
        };
        assert_eq!(polar(&taken), polar(&all));
        assert!(2 * taken.len() < all.len() + 20, "{} of {}", taken.len(), all.len());
        for rule in [strict.clone(), rule(1.0), rule(0.9)] {
            assert_eq!(place_count(&rule), places_of(&rule).len());
        }
        // One bearing takes them all.
        let ahead = TargetRule { bearings: [0.0, 0.0], ..strict };
        assert_eq!(places_of(&ahead), spread(&ahead, factors(&ahead)));
    }

    #[test]
    fn a_short_way_has_more_than_its_two_ends() {
        let along = |within: f64| {
            let rule = TargetRule { bearings: [0.0, 0.0], from: 2.0, within, ..rule(0.9) };
            places_of(&rule).into_iter().map(|at| at[0]).collect::<Vec<_>>()
        };
        assert_eq!(along(4.0), [2.0, 2.5, 3.0, 3.5, 4.0]);
        assert_eq!(along(3.0), [2.0, 2.5, 3.0]);
        assert_eq!(along(2.0), [2.0]);
        assert_eq!(along(7.0), [2.0, 3.25, 4.5, 5.75, 7.0]);
        assert_eq!(along(14.5), [2.0, 4.5, 7.0, 9.5, 12.0, 14.5]);
    }
}
