//! Places of a rule that are not met, in words: runs of neighbouring bearings, and distances.

use super::beams::PlacedTarget;
use super::bodies::BodyPoses;
use super::places::places_of;
use crate::json::trimmed;
use crate::maths;
use crate::vehicle::{SensorPose, TargetRule, UnknownSensor};

/// Runs of bearings that are named, at most.
const MOST_RUNS: usize = 3;

/// Bearings of a rule at which places are not met, and the distances of these places.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Missing {
    /// Bearings that the rule tests, degrees counter-clockwise from straight ahead, rising.
    bearings: Vec<f64>,
    /// One for each: whether a place is not met.
    is_missing: Vec<bool>,
    /// True if the last bearing is beside the first.
    is_round: bool,
    /// Nearest and farthest distance, metres.
    distances: [f64; 2],
    /// True if no place between these distances is met.
    is_whole: bool,
}

impl Missing {
    /// Bearings and distances of places of a rule that are not met, from its places in order, each with `true` where it is
    /// met; `None` where all are met.
    pub(super) fn new(
        rule: &TargetRule,
        places: impl IntoIterator<Item = ([f64; 3], bool)>,
    ) -> Option<Self> {
        let [first, last] = rule.bearings;
        let mut each: Vec<(f64, bool)> = Vec::new();
        let mut distances: Option<[f64; 2]> = None;
        let mut met: Vec<f64> = Vec::new();
        for ([x, y, _], is_met) in places {
            let turned = maths::atan2(y, x).to_degrees() - first;
            // Rounding must not turn the first bearing into the last. Places stand bearing by bearing.
            let bearing = first + (turned + 1e-6).rem_euclid(360.0) - 1e-6;
            if each.last().is_none_or(|(known, _)| (known - bearing).abs() > 1e-3) {
                each.push((bearing, false));
            }
            // Rounding must not turn one distance into two.
            let distance = (1e6 * maths::hypot(x, y)).round() / 1e6;
            if is_met {
                met.push(distance);
                continue;
            }
            each.last_mut().into_iter().for_each(|(_, is_missing)| *is_missing = true);
            let [near, far] = distances.unwrap_or([distance; 2]);
            distances = Some([near.min(distance), far.max(distance)]);
        }
        let (bearings, is_missing) = each.into_iter().unzip();
        let [near, far] = distances?;
        let is_whole = !met.iter().any(|metres| (near..=far).contains(metres));
        let is_round = last - first >= 360.0;
        Some(Self { bearings, is_missing, is_round, distances: [near, far], is_whole })
    }

    /// First bearing and length of each run of neighbours, the longest first.
    fn runs(&self) -> Vec<[usize; 2]> {
        let count = self.bearings.len();
        let is_missing = |k: usize| self.is_missing[k % count];
        let begins = |&k: &usize| match k {
            0 if !self.is_round => is_missing(0),
            _ => is_missing(k) && !is_missing(k + count - 1),
        };
        let most = |k: usize| if self.is_round { count } else { count - k };
        let length = |k: usize| (0..most(k)).take_while(|more| is_missing(k + more)).count();
        let mut runs: Vec<[usize; 2]> = (0..count).filter(begins).map(|k| [k, length(k)]).collect();
        runs.sort_by_key(|run| std::cmp::Reverse(run[1]));
        runs
    }
}

/// Places of a rule that LiDARs do not meet in the worst pose of the own bodies or the worst scene, in words; `None` where they
/// meet all.
///
/// # Errors
/// A model that the vehicle does not have.
pub(crate) fn missed_places(
    bodies: &BodyPoses,
    rule: &TargetRule,
    lidars: &[SensorPose],
) -> Result<Option<String>, UnknownSensor> {
    let target = &*rule.target;
    let (mut most, mut worst) = (-1.0, Vec::new());
    for (site, _) in bodies.each(rule) {
        let places = places_of(rule).into_iter();
        let places: Vec<_> = places.filter_map(|at| site.standing(target, at)).collect();
        let standing: Vec<_> = places.iter().map(|&at| PlacedTarget { target, at }).collect();
        let met = site.met(lidars, &standing, rule.beams)?;
        let missed = met.iter().filter(|is_met| !**is_met).count() as f64;
        let missed = missed / met.len().max(1) as f64;
        if missed > most {
            (most, worst) = (missed, places.into_iter().zip(met).collect());
        }
    }
    Ok(Missing::new(rule, worst).map(|missing| missing.to_string()))
}

/// A bearing in degrees from -180 to 180, as tables have it; a rule may count from 0 to 360.
fn within_half_turn(bearing: f64) -> f64 {
    match bearing {
        // Straight behind.
        -180.0 => 180.0,
        _ if bearing.abs() > 180.0 => bearing - 360.0_f64.copysign(bearing),
        _ => bearing,
    }
}

/// Bearings from one counter-clockwise to another, degrees from -180 to 180: `2° to 5°`, `165° over 180° to -165°`, or
/// `2°` where both are written the same.
pub(super) fn range(bearings: [f64; 2]) -> String {
    let [from, to] = bearings.map(|bearing| trimmed(bearing, 1));
    let is_across = bearings[0] > bearings[1] && from != "180" && to != "-180";
    match (from == to, is_across) {
        (true, _) => format!("{from}°"),
        (_, true) => format!("{from}° over 180° to {to}°"),
        _ => format!("{from}° to {to}°"),
    }
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [near, far] = self.distances.map(|metres| trimmed(metres, 2));
        let at = if near == far { near } else { format!("{near} to {far}") };
        let all = self.bearings.len();
        let between = |first: usize, count: usize| {
            range([first, first + count - 1].map(|k| within_half_turn(self.bearings[k % all])))
        };
        let count = self.is_missing.iter().filter(|is_missing| **is_missing).count();
        if all == 1 {
            return write!(f, "missing at {at} m, {}", between(0, 1));
        }
        if count == all {
            let around = if self.is_round { "all round".to_owned() } else { between(0, all) };
            let some = if self.is_whole { "" } else { "some of " };
            return write!(f, "missing at {some}{at} m: all {all} bearings, {around}");
        }
        let runs = self.runs();
        let named: Vec<String> =
            runs.iter().take(MOST_RUNS).map(|&[first, count]| between(first, count)).collect();
        let more = match runs.len().saturating_sub(MOST_RUNS) {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        write!(f, "missing at {at} m: {count} of {all} bearings, {}{more}", named.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words on bearings of a circle, or of a sector from the first of them, of which some are missing.
    fn words(bearings: [f64; 2], count: usize, missing: &[usize], distances: [f64; 2]) -> String {
        let [from, to] = bearings;
        let is_round = to - from >= 360.0;
        let steps = if is_round { count } else { (count - 1).max(1) } as f64;
        let bearings = (0..count).map(|k| from + (to - from) * k as f64 / steps).collect();
        let is_missing = (0..count).map(|k| missing.contains(&k)).collect();
        Missing { bearings, is_missing, is_round, distances, is_whole: true }.to_string()
    }

    #[test]
    fn neighbours_all_round_are_one_run_across_180_degrees() {
        let round = |missing: &[usize]| words([-180.0, 180.0], 48, missing, [25.0, 25.0]);
        assert_eq!(
            round(&[0, 47]),
            "missing at 25 m: 2 of 48 bearings, 172.5° to 180°",
            "two neighbours are not the whole circle"
        );
        assert_eq!(round(&[24]), "missing at 25 m: 1 of 48 bearings, 0°");
        // A rule from 0 to 360° is told like one from -180 to 180°.
        assert_eq!(
            words([0.0, 360.0], 48, &[24, 28], [25.0, 25.0]),
            "missing at 25 m: 2 of 48 bearings, 180°, -150°"
        );
        // Almost all round: not the 105° ahead.
        let behind: Vec<usize> = (31..48).chain(0..18).collect();
        assert_eq!(round(&behind), "missing at 25 m: 35 of 48 bearings, 52.5° over 180° to -52.5°");
        let ends = [[165.0, -165.0], [180.0, -165.0], [165.0, -180.0], [-15.0, 15.0]];
        let told = ["165° over 180° to -165°", "180° to -165°", "165° to -180°", "-15° to 15°"];
        assert_eq!(ends.map(range), told);
        let all: Vec<usize> = (0..48).collect();
        assert_eq!(round(&all), "missing at 25 m: all 48 bearings, all round");
        assert_eq!(
            round(&[2, 10, 11, 20, 21, 22, 30, 40]),
            "missing at 25 m: 8 of 48 bearings, -30° to -15°, -105° to -97.5°, -165°, and 2 more"
        );
    }

    #[test]
    fn both_ends_of_a_sector_are_two_runs() {
        assert_eq!(
            words([-60.0, 60.0], 17, &[0, 16], [10.0, 15.0]),
            "missing at 10 to 15 m: 2 of 17 bearings, -60°, 60°"
        );
        let all: Vec<usize> = (0..17).collect();
        assert_eq!(
            words([-60.0, 60.0], 17, &all, [10.0, 15.0]),
            "missing at 10 to 15 m: all 17 bearings, -60° to 60°"
        );
    }

    #[test]
    fn bearings_that_all_miss_some_distance_are_told_from_ones_that_miss_all() {
        let rule = TargetRule {
            name: "car".to_owned(),
            target: std::sync::Arc::new(crate::scene::Target::named("car").unwrap()),
            from: 10.0,
            within: 15.0,
            bearings: [0.0, 90.0],
            on_scene: false,
            beams: 5,
            share: 0.9,
            without_any_one: false,
        };
        let words = |met: [bool; 4]| {
            let places = [[10.0, 0.0, 0.0], [15.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 15.0, 0.0]];
            Missing::new(&rule, places.into_iter().zip(met)).map(|told| told.to_string())
        };
        assert_eq!(words([true; 4]), None);
        let all = "10 to 15 m: all 2 bearings, 0° to 90°";
        assert_eq!(words([false; 4]), Some(format!("missing at {all}")));
        assert_eq!(words([false, true, true, false]), Some(format!("missing at some of {all}")));
        let near = "missing at 10 m: all 2 bearings, 0° to 90°".to_owned();
        assert_eq!(words([false, true, false, true]), Some(near));
    }

    #[test]
    fn places_that_are_missing_have_their_tenths() {
        // Rounding in the last digit shows nowhere, and one distance is no range.
        let (bearing, far) = (-52.499_999_99, 7.500_000_01);
        assert_eq!(
            words([bearing, 0.0], 8, &[0, 1], [7.5, far]),
            "missing at 7.5 m: 2 of 8 bearings, -52.5° to -45°"
        );
        assert_eq!(
            words([0.0, 0.0], 1, &[0], [50.0, 50.0]),
            "missing at 50 m, 0°",
            "one bearing is no sector"
        );
    }
}
