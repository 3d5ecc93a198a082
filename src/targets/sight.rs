//! Sight of targets and of the ground near the vehicle as numbers that a search can raise: rules of the vehicle, and a
//! car all round, so that no placement wins by looking away.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::beams::{Standing, TargetSite};
use super::card::{CARD_BEAMS, card_targets, position};
use crate::maths;
use crate::near_field::RequiredGround;
use crate::problem::Problem;
use crate::scene::Target;
use crate::vehicle::{GroundRule, SensorPose, TargetRule, UnknownSensor};

/// Penalty for a car that is seen nowhere, in the unit of a near gain. docs/targets.md has the trials of other
/// weights.
pub const CAR_WEIGHT: f64 = 1.0;

/// Bearings of the car.
const BEARINGS: usize = 24;
/// Distances of the car, metres: between them a sector must not lose it.
const DISTANCES: [f64; 8] = [5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0];
/// Degrees between bearings of a rule at most, and metres between its distances at most.
const RULE_DEGREES: f64 = 7.5;
const RULE_METRES: f64 = 2.5;
/// Extra share that a search wants beyond a rule, since other places lie between the tested ones.
const MARGIN: f64 = 0.01;
/// Weight of a missing part of that extra share, where a missing share of the rule weighs 1.
const MARGIN_WEIGHT: f64 = 1e-3;
/// Weight of single beams at places that are not met, where a met place weighs 1.
const PARTIAL: f64 = 0.1;

/// Places of targets around a vehicle on level ground, and ground near it in each scene.
pub struct Sight {
    site: TargetSite,
    /// Targets and their positions, group after group.
    places: Vec<(Arc<Target>, [f64; 3])>,
    /// Places of the car all round; empty where a search does not look.
    car: Range<usize>,
    rules: Vec<Rule>,
    /// Beams that count at each place.
    enough: Vec<u8>,
    /// Ground near the vehicle in each scene and mirror image; empty where none is required.
    ground: Vec<RequiredGround>,
}

/// A rule of the vehicle.
enum Rule {
    /// On a target, with its places.
    Target(TargetRule, Range<usize>),
    /// On the ground, with its number among these.
    Ground(GroundRule, usize),
}

impl Rule {
    fn name(&self) -> &str {
        match self {
            Self::Target(rule, _) => &rule.name,
            Self::Ground(rule, _) => &rule.name,
        }
    }

    /// Share that is required.
    fn least(&self) -> f64 {
        match self {
            Self::Target(rule, _) => rule.share,
            Self::Ground(rule, _) => rule.share,
        }
    }

    fn without_any_one(&self) -> bool {
        match self {
            Self::Target(rule, _) => rule.without_any_one,
            Self::Ground(rule, _) => rule.without_any_one,
        }
    }
}

/// Beams of a LiDAR at each place, counted as far as they matter, and cells of the ground that it sees.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SightBeams {
    beams: Box<[u8]>,
    /// Bits scene after scene.
    ground: Box<[u64]>,
}

impl SightBeams {
    /// Adds the beams and the ground of another LiDAR.
    pub fn add(&mut self, other: &Self) {
        if self.beams.is_empty() && self.ground.is_empty() {
            *self = other.clone();
            return;
        }
        let beams = self.beams.iter_mut().zip(&other.beams);
        beams.for_each(|(sum, beams)| *sum = sum.saturating_add(*beams));
        self.ground.iter_mut().zip(&other.ground).for_each(|(sum, bits)| *sum |= bits);
    }
}

/// A rule, and the share of its places or ground that is met.
#[derive(Debug, Clone, PartialEq)]
pub struct RuleMet<'a> {
    /// Name of the rule.
    pub name: &'a str,
    /// Share that is required.
    pub least: f64,
    /// Share of its places at which enough beams meet the target, or of its ground that is seen, a mean over scenes. For
    /// a rule that must hold without any one LiDAR, the least share over the LiDARs left out.
    pub share: f64,
    /// LiDAR whose loss leaves least, of a rule that must hold without any one.
    pub without: Option<usize>,
    /// Missing places or ground, in words; `None` where the rule is met.
    pub missing: Option<String>,
}

/// Smallest range of bearings and distances around places that are not met.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Missing {
    /// First and last bearing, degrees counter-clockwise from straight ahead.
    bearings: [f64; 2],
    /// Nearest and farthest distance, metres.
    distances: [f64; 2],
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ([from, to], [near, far]) = (self.bearings, self.distances);
        write!(f, "missing at {near:.0} to {far:.0} m between {from:.0}° and {to:.0}°")
    }
}

/// Places of a rule: every 7.5° or less between its bearings, every 2.5 m or less between its distances.
fn places_of(rule: &TargetRule) -> Vec<[f64; 3]> {
    let [from, to] = rule.bearings;
    let is_round = to - from >= 360.0;
    let turns = (((to - from) / RULE_DEGREES).ceil() as usize).max(1);
    let bearings = (0..turns + usize::from(!is_round && to > from))
        .map(|k| from + (to - from) * k as f64 / turns as f64);
    let steps = (((rule.within - rule.from) / RULE_METRES).ceil() as usize).max(1);
    let distances = |k: usize| rule.from + (rule.within - rule.from) * k as f64 / steps as f64;
    let count = steps + usize::from(rule.within > rule.from);
    bearings.flat_map(|b| (0..count).map(move |k| position(distances(k), b))).collect()
}

impl Sight {
    /// Sight of the vehicle of some scenes: its rules and, if `watches_cars`, a car all round. Each scene is given with
    /// `true` for a mirror image, whose problem has mirrored sensors. `None` where there is nothing to look for, or beams
    /// end at nothing, so that nothing is known of a body.
    pub fn of<'a>(
        scenes: impl IntoIterator<Item = (&'a Arc<Problem>, bool)>,
        watches_cars: bool,
    ) -> Option<Self> {
        let scenes: Vec<_> = scenes.into_iter().collect();
        let &(problem, is_mirrored) = scenes.first()?;
        if !(watches_cars || problem.requires_sight()) || !problem.ends_at_hits() {
            return None;
        }
        let site = match is_mirrored {
            // The mirror image of a mirror image is the scene as it is.
            true => TargetSite::of(&problem.mirrored()),
            false => TargetSite::of(problem),
        };
        let (mut places, mut enough, mut rules) = (Vec::new(), Vec::new(), Vec::new());
        let mut group = |target: &Arc<Target>, at: Vec<[f64; 3]>, beams: u32| {
            let begin = places.len();
            let free = at.into_iter().filter(|&at| site.has_room(target, at));
            places.extend(free.map(|at| (target.clone(), at)));
            enough.resize(places.len(), beams.min(u32::from(u8::MAX)) as u8);
            begin..places.len()
        };
        let car = match card_targets().first().filter(|_| watches_cars) {
            Some(car) => {
                let step = 360.0 / BEARINGS as f64;
                let round =
                    (0..BEARINGS).flat_map(|b| DISTANCES.map(|d| position(d, step * b as f64)));
                group(car, round.collect(), CARD_BEAMS)
            }
            None => 0..0,
        };
        for rule in problem.target_rules() {
            let range = group(&rule.target, places_of(rule), rule.beams);
            rules.push(Rule::Target(rule.clone(), range));
        }
        let of_scene = |(problem, is_mirrored)| RequiredGround::of(problem, is_mirrored);
        let ground: Vec<_> = scenes.into_iter().filter_map(of_scene).collect();
        let of_ground = problem.ground_required().rules.iter().enumerate();
        rules.extend(of_ground.map(|(number, rule)| Rule::Ground(rule.clone(), number)));
        Some(Self { site, places, car, rules, enough, ground })
    }

    /// Beams of a LiDAR.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn beams(&self, lidar: &SensorPose) -> Result<SightBeams, UnknownSensor> {
        let standing = self.places.iter().map(|(target, at)| Standing { target, at: *at });
        let standing: Vec<Standing<'_>> = standing.collect();
        let most = self.enough.iter().copied().max().unwrap_or(0);
        let beams = self.site.beams(lidar, &standing, u32::from(most))?;
        let capped = beams.iter().zip(&self.enough).map(|(&beams, &cap)| beams.min(cap.into()));
        let beams = capped.map(|beams| beams as u8).collect();
        let ground = self.ground.par_iter().map(|scene| scene.seen(lidar));
        let ground = ground.collect::<Result<Vec<_>, _>>()?.concat().into();
        Ok(SightBeams { beams, ground })
    }

    /// Missing share of beams on a car all round: 0 where five meet it at every place, 1 where none meets it anywhere,
    /// `None` where a search does not look. Each LiDAR lowers it, by less the more there are: 1 less the share is
    /// submodular.
    pub fn car_missing(&self, all: &SightBeams) -> Option<f64> {
        let places = self.car.clone();
        (!places.is_empty()).then(|| 1.0 - self.soft(all, places))
    }

    /// Beams at some places as a share of the beams that count there.
    fn soft(&self, all: &SightBeams, places: Range<usize>) -> f64 {
        let wanted: u32 = self.enough[places.clone()].iter().map(|&beams| u32::from(beams)).sum();
        let of = |place: usize| all.beams.get(place).copied().unwrap_or(0).min(self.enough[place]);
        let met: u32 = places.map(|place| u32::from(of(place))).sum();
        f64::from(met) / f64::from(wanted.max(1))
    }

    /// Share of some places at which enough beams meet the target; 1 where there is no place.
    fn hard(&self, all: &SightBeams, places: Range<usize>) -> f64 {
        let count = places.len();
        let met = |place: &usize| all.beams.get(*place).is_some_and(|b| *b >= self.enough[*place]);
        if count == 0 { 1.0 } else { places.filter(met).count() as f64 / count as f64 }
    }

    /// Sum of the beams of all LiDARs but one.
    fn sum_without(each: &[&SightBeams], lidar: Option<usize>) -> SightBeams {
        let mut sum = SightBeams::default();
        let kept = each.iter().enumerate().filter(|(k, _)| Some(*k) != lidar);
        kept.for_each(|(_, beams)| sum.add(beams));
        sum
    }

    /// Bits of each scene with its ground.
    fn ground_of<'a>(
        &'a self,
        all: &'a SightBeams,
    ) -> impl Iterator<Item = (&'a RequiredGround, &'a [u64])> {
        let mut rest = &all.ground[..];
        self.ground.iter().map(move |scene| {
            let (bits, others) = rest.split_at(scene.words().min(rest.len()));
            rest = others;
            (scene, bits)
        })
    }

    /// Mean over scenes of a number of the ground.
    fn over_scenes(&self, all: &SightBeams, of: impl Fn(&RequiredGround, &[u64]) -> f64) -> f64 {
        let sum: f64 = self.ground_of(all).map(|(scene, bits)| of(scene, bits)).sum();
        sum / self.ground.len().max(1) as f64
    }

    /// Share of a rule that is met; scenes without the ground that it asks for count as not seen.
    fn met_share(&self, all: &SightBeams, rule: &Rule) -> f64 {
        match rule {
            Rule::Target(_, places) => self.hard(all, places.clone()),
            Rule::Ground(_, number) => {
                self.over_scenes(all, |s, bits| s.share(*number, bits).share.unwrap_or(0.0))
            }
        }
    }

    /// Like [`Self::met_share`], rising with every beam or cell.
    fn soft_share(&self, all: &SightBeams, rule: &Rule) -> f64 {
        match rule {
            Rule::Target(_, places) => self.soft(all, places.clone()),
            Rule::Ground(_, number) => self.over_scenes(all, |s, bits| s.share(*number, bits).soft),
        }
    }

    /// Least share of a rule, and the LiDAR whose loss leaves it; all LiDARs where none is to be lost.
    fn least(&self, each: &[&SightBeams], rule: &Rule) -> (f64, Option<usize>) {
        let share =
            |lost: Option<usize>| (self.met_share(&Self::sum_without(each, lost), rule), lost);
        let lost = (0..each.len()).map(Some).filter(|_| rule.without_any_one());
        // The first of equal ones.
        let least = lost.map(share).reduce(|a, b| if b.0 < a.0 { b } else { a });
        least.unwrap_or_else(|| share(None))
    }

    /// The share of every rule, as [`Self::rules_met`] has it.
    pub fn shares(&self, each: &[&SightBeams]) -> Vec<f64> {
        self.rules.iter().map(|of| self.least(each, of).0).collect()
    }

    /// Every rule with its share, for the beams of each LiDAR.
    pub fn rules_met(&self, each: &[&SightBeams]) -> Vec<RuleMet<'_>> {
        let mut all = Vec::new();
        for rule in &self.rules {
            let (share, without) = self.least(each, rule);
            let (name, least) = (rule.name(), rule.least());
            let missing = (share < least)
                .then(|| self.missing_in_words(&Self::sum_without(each, without), rule))
                .flatten();
            all.push(RuleMet { name, least, share, without, missing });
        }
        all
    }

    fn missing_in_words(&self, all: &SightBeams, rule: &Rule) -> Option<String> {
        match rule {
            Rule::Target(rule, places) => {
                self.missing(all, rule, places.clone()).map(|missing| missing.to_string())
            }
            Rule::Ground(_, number) => {
                let share = |&(scene, bits): &(&RequiredGround, &[u64])| {
                    scene.share(*number, bits).share.unwrap_or(0.0)
                };
                let scenes = self.ground_of(all);
                let worst = scenes.min_by(|a, b| share(a).total_cmp(&share(b)));
                worst.map(|(scene, bits)| scene.missing(*number, bits))
            }
        }
    }

    /// Bearings and distances around the places of a rule that are not met.
    fn missing(
        &self,
        all: &SightBeams,
        rule: &TargetRule,
        places: Range<usize>,
    ) -> Option<Missing> {
        let unmet = places
            .filter(|&place| all.beams.get(place).is_none_or(|&beams| beams < self.enough[place]));
        unmet.fold(None, |range: Option<Missing>, place| {
            let [x, y, _] = self.places[place].1;
            // Bearings count from the rule's first one on, so that a range may cross ±180°.
            let turned = maths::atan2(y, x).to_degrees() - rule.bearings[0];
            // Rounding must not turn the first bearing into the last.
            let bearing = rule.bearings[0] + (turned + 1e-6).rem_euclid(360.0) - 1e-6;
            let distance = maths::hypot(x, y);
            let widened = |range: [f64; 2], value: f64| [range[0].min(value), range[1].max(value)];
            Some(match range {
                None => Missing { bearings: [bearing; 2], distances: [distance; 2] },
                Some(Missing { bearings, distances }) => Missing {
                    bearings: widened(bearings, bearing),
                    distances: widened(distances, distance),
                },
            })
        })
    }

    /// True if there are rules.
    pub fn has_rules(&self) -> bool {
        !self.rules.is_empty()
    }

    /// Missing share of the rules, summed, for a search that goes step by step: each beam lowers it a little for a rule
    /// that is not met.
    pub fn rules_missing(&self, each: &[&SightBeams]) -> f64 {
        let all = Self::sum_without(each, None);
        let lacks = |rule: &Rule| {
            let least = rule.least();
            let wanted = if least > 0.0 { (least + MARGIN).min(1.0) } else { 0.0 };
            let (share, _) = self.least(each, rule);
            let extra = MARGIN_WEIGHT * (wanted - share).max(0.0);
            if share >= least {
                return extra;
            }
            extra + least - share + PARTIAL * (1.0 - self.soft_share(&all, rule))
        };
        self.rules.iter().map(lacks).sum()
    }
}
