//! Sight of targets and of the ground near the vehicle, and surfaces that LiDARs share, as numbers that a search can raise:
//! rules of the vehicle, and a car all round, so that no placement wins by looking away.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::beams::{PlacedTarget, TargetSite};
use super::card::{CARD_BEAMS, card_targets, position};
use super::rules::Rule;
use crate::near_field::RequiredGround;
use crate::overlap::{RequiredOverlap, Surfaces};
use crate::problem::Problem;
use crate::scene::Target;
use crate::vehicle::{SensorPose, TargetRule, UnknownSensor};

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

/// Places of targets around a vehicle on level ground, ground near it in each scene, and surfaces there.
pub struct Sight {
    site: TargetSite,
    /// Targets and their positions, group after group.
    pub(super) places: Vec<(Arc<Target>, [f64; 3])>,
    /// Places of the car all round; empty where a search does not look.
    car: Range<usize>,
    pub(super) rules: Vec<Rule>,
    /// Beams that count at each place.
    pub(super) enough: Vec<u8>,
    /// Ground near the vehicle in each scene and mirror image; empty where none is required.
    pub(super) ground: Vec<RequiredGround>,
    /// Surfaces of each scene and mirror image; empty where no overlap is required.
    pub(super) overlap: Vec<RequiredOverlap>,
}

/// Beams of a LiDAR at each place, counted as far as they matter, cells of the ground that it sees, and surfaces on which
/// its beams end.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SightBeams {
    pub(super) beams: Box<[u8]>,
    /// Bits scene after scene.
    pub(super) ground: Box<[u64]>,
    /// Distinct frames scene after scene. A sum over LiDARs has none.
    pub(super) surfaces: Surfaces,
}

impl SightBeams {
    /// Adds the beams and the ground of another LiDAR; surfaces are left out.
    pub fn add(&mut self, other: &Self) {
        if self.beams.is_empty() && self.ground.is_empty() {
            (self.beams, self.ground) = (other.beams.clone(), other.ground.clone());
            return;
        }
        let beams = self.beams.iter_mut().zip(&other.beams);
        beams.for_each(|(sum, beams)| *sum = sum.saturating_add(*beams));
        self.ground.iter_mut().zip(&other.ground).for_each(|(sum, bits)| *sum |= bits);
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
        let ground_in = |&(problem, is_mirrored)| RequiredGround::of(problem, is_mirrored);
        let ground: Vec<_> = scenes.iter().filter_map(ground_in).collect();
        let surfaces_in = |&(problem, is_mirrored)| RequiredOverlap::of(problem, is_mirrored);
        let overlap = scenes.iter().filter_map(surfaces_in).collect();
        let of_ground = problem.ground_required().rules.iter().enumerate();
        rules.extend(of_ground.map(|(number, rule)| Rule::Ground(rule.clone(), number)));
        rules.extend(problem.overlap_required().rules.iter().cloned().map(Rule::Overlap));
        Some(Self { site, places, car, rules, enough, ground, overlap })
    }

    /// Beams of a LiDAR.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn beams(&self, lidar: &SensorPose) -> Result<SightBeams, UnknownSensor> {
        let standing = self.places.iter().map(|(target, at)| PlacedTarget { target, at: *at });
        let standing: Vec<PlacedTarget<'_>> = standing.collect();
        let most = self.enough.iter().copied().max().unwrap_or(0);
        let beams = self.site.beams(lidar, &standing, u32::from(most))?;
        let capped = beams.iter().zip(&self.enough).map(|(&beams, &cap)| beams.min(cap.into()));
        let beams = capped.map(|beams| beams as u8).collect();
        let ground = self.ground.par_iter().map(|scene| scene.seen(lidar));
        let ground = ground.collect::<Result<Vec<_>, _>>()?.concat().into();
        let surfaces = self.overlap.par_iter().map(|scene| scene.surfaces(lidar));
        let surfaces = surfaces.collect::<Result<Vec<_>, _>>()?.into_iter();
        let surfaces = Surfaces { frames: surfaces.flat_map(|scene| scene.frames).collect() };
        Ok(SightBeams { beams, ground, surfaces })
    }

    /// Beams of a LiDAR for a search, which looks at a sample of its surfaces.
    ///
    /// # Errors
    /// See [`Self::beams`].
    pub fn sampled_beams(&self, lidar: &SensorPose) -> Result<SightBeams, UnknownSensor> {
        let beams = self.beams(lidar)?;
        let every = self.overlap.first().map_or(1, RequiredOverlap::sample);
        Ok(SightBeams { surfaces: beams.surfaces.sampled(every), ..beams })
    }

    /// Missing share of beams on a car all round: 0 where five meet it at every place, 1 where none meets it anywhere,
    /// `None` where a search does not look. Each LiDAR lowers it, by less the more there are: 1 less the share is
    /// submodular.
    pub fn car_missing(&self, all: &SightBeams) -> Option<f64> {
        let places = self.car.clone();
        (!places.is_empty()).then(|| 1.0 - self.soft(all, places))
    }

    /// Beams at some places as a share of the beams that count there.
    pub(super) fn soft(&self, all: &SightBeams, places: Range<usize>) -> f64 {
        let wanted: u32 = self.enough[places.clone()].iter().map(|&beams| u32::from(beams)).sum();
        let of = |place: usize| all.beams.get(place).copied().unwrap_or(0).min(self.enough[place]);
        let met: u32 = places.map(|place| u32::from(of(place))).sum();
        f64::from(met) / f64::from(wanted.max(1))
    }

    /// Share of some places at which enough beams meet the target; 1 where there is no place.
    pub(super) fn hard(&self, all: &SightBeams, places: Range<usize>) -> f64 {
        let count = places.len();
        let met = |place: &usize| all.beams.get(*place).is_some_and(|b| *b >= self.enough[*place]);
        if count == 0 { 1.0 } else { places.filter(met).count() as f64 / count as f64 }
    }
}
