//! Beams of LiDARs at the places of rules and of a car all round, and the ground and surfaces that they see.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::beams::{LookingOut, PlacedTarget, TargetSite};
use super::bodies::{BodyPoses, RuleSite, SitePlace, SitePose};
use super::card::{CARD_BEAMS, car_places, card_targets, position};
use super::places::places_of;
use super::rules::Rule;
use crate::near_field::RequiredGround;
use crate::overlap::{RequiredOverlap, Surfaces};
use crate::problem::Problem;
use crate::scene::Target;
use crate::vehicle::{Placement, SensorPose, UnknownSensor};

/// Penalty for a car that is seen nowhere, in the unit of a near gain. docs/targets.md has trials of other weights.
pub const CAR_WEIGHT: f64 = 1.0;

/// Weight of the share of places that lose a car, beside the share of beams that lack, where all places are watched: one
/// lost place costs about a fifth of a percentage point of near gain.
const LOST_WEIGHT: f64 = 5.0;

/// Places around the vehicle at which a search watches a car.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cars {
    /// No car is watched.
    Nowhere,
    /// At few bearings and distances.
    AtSome,
    /// At every place of a range card, each of which must not lose it.
    AtAll,
}

/// Bearings of the car.
const BEARINGS: usize = 24;
/// Distances of the car, metres: between them a sector must not lose it.
const DISTANCES: [f64; 8] = [5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0];

/// Places of targets around a vehicle on level ground, ground near it in each scene, and surfaces there.
pub struct Sight {
    /// Sensors and own bodies: a car all round stands beside the first.
    pub(super) bodies: BodyPoses,
    /// Group after group.
    pub(super) places: Vec<SitePlace>,
    /// Places of the car all round; empty where a search does not look.
    car: Range<usize>,
    /// True if each place that loses the car counts beside the beams that lack.
    counts_lost: bool,
    pub(super) rules: Vec<Rule>,
    /// Beams that count at each place.
    pub(super) enough: Vec<u8>,
    /// Ground near the vehicle in each scene and mirror image; empty where none is required.
    pub(super) ground: Vec<RequiredGround>,
    /// Surfaces of each scene and mirror image; empty where no overlap is required.
    pub(super) overlap: Vec<RequiredOverlap>,
    /// The scenes' problem, for the names of mounts.
    problem: Arc<Problem>,
}

/// Beams of a LiDAR at each place, counted as far as they matter, and the cells and surfaces that it sees.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SightBeams {
    pub(super) beams: Box<[u8]>,
    /// Bits scene after scene.
    pub(super) ground: Box<[u64]>,
    /// Distinct frames scene after scene. A sum over LiDARs has none.
    pub(super) surfaces: Surfaces,
    /// Range of the LiDAR in millimetres, of several the longest.
    pub(super) range_mm: u32,
}

impl SightBeams {
    /// Adds the beams and the ground of another LiDAR; surfaces are left out.
    pub fn add(&mut self, other: &Self) {
        self.range_mm = self.range_mm.max(other.range_mm);
        if self.beams.is_empty() && self.ground.is_empty() {
            (self.beams, self.ground) = (other.beams.clone(), other.ground.clone());
            return;
        }
        let beams = self.beams.iter_mut().zip(&other.beams);
        beams.for_each(|(sum, beams)| *sum = sum.saturating_add(*beams));
        self.ground.iter_mut().zip(&other.ground).for_each(|(sum, bits)| *sum |= bits);
    }
}

impl Sight {
    /// Sight of the vehicle of some scenes: its rules and a car all round. Each scene is given with
    /// `true` for a mirror image, whose problem has mirrored sensors. `None` where there is nothing to look for, and
    /// with coverage `through`, where nothing is known of a body.
    pub fn of<'a>(
        scenes: impl IntoIterator<Item = (&'a Arc<Problem>, bool)>,
        cars: Cars,
    ) -> Option<Self> {
        let scenes: Vec<_> = scenes.into_iter().collect();
        let &(problem, is_mirrored) = scenes.first()?;
        if !(cars != Cars::Nowhere || problem.requires_sight()) || !problem.ends_at_hits() {
            return None;
        }
        let site = match is_mirrored {
            // The mirror image of a mirror image is the scene as it is.
            true => TargetSite::of(&problem.mirrored()),
            false => TargetSite::of(problem),
        };
        // Bodies that move matter to rules on targets alone.
        let posing = if problem.target_rules().is_empty() { &[][..] } else { &scenes[..] };
        let posing = posing.iter().map(|&(problem, is_mirrored)| (&**problem, is_mirrored));
        let bodies = BodyPoses::of(site, posing);
        let (mut places, mut enough, mut rules) = (Vec::new(), Vec::new(), Vec::new());
        let mut group = |site: usize, target: &Arc<Target>, at: Vec<[f64; 3]>, beams: u32| {
            let begin = places.len();
            let free = at.into_iter().filter_map(|at| bodies.sites[site].standing(target, at));
            places.extend(free.map(|at| SitePlace { target: target.clone(), at, site }));
            enough.resize(places.len(), beams.min(u32::from(u8::MAX)) as u8);
            begin..places.len()
        };
        let round = match cars {
            Cars::Nowhere => Vec::new(),
            Cars::AtSome => {
                let step = 360.0 / BEARINGS as f64;
                let at = |b: usize| DISTANCES.map(|d| position(d, step * b as f64));
                (0..BEARINGS).flat_map(at).collect()
            }
            Cars::AtAll => car_places(&bodies.sites[0]),
        };
        let car = group(0, &card_targets()[0], round, CARD_BEAMS);
        let counts_lost = cars == Cars::AtAll;
        for rule in problem.target_rules() {
            let in_pose = |pose: &SitePose| {
                let places = group(pose.site, &rule.target, places_of(rule), rule.beams);
                RuleSite { places, pose: *pose }
            };
            let mut sites: Vec<RuleSite> = bodies.of_rule(rule).iter().map(in_pose).collect();
            // A mirror image may have no free ground where its scene has some.
            sites.retain(|site| !(rule.on_scene && site.places.is_empty()));
            rules.push(Rule::Target(rule.clone(), sites));
        }
        let ground_in = |&(problem, is_mirrored)| RequiredGround::of(problem, is_mirrored);
        let ground: Vec<_> = scenes.iter().filter_map(ground_in).collect();
        let surfaces_in = |&(problem, is_mirrored)| RequiredOverlap::of(problem, is_mirrored);
        let overlap = scenes.iter().filter_map(surfaces_in).collect();
        let of_ground = problem.ground_required().rules.iter().enumerate();
        rules.extend(of_ground.map(|(number, rule)| Rule::Ground(rule.clone(), number)));
        rules.extend(problem.overlap_required().rules.iter().cloned().map(Rule::Overlap));
        let problem = problem.clone();
        Some(Self { bodies, places, car, counts_lost, rules, enough, ground, overlap, problem })
    }

    /// Mount of a LiDAR of a placement, where it has a name.
    pub(crate) fn mount_of(&self, placement: &Placement, lidar: usize) -> Option<String> {
        let mounts = self.problem.rules().mount_names(placement);
        mounts.get(lidar).copied().flatten().map(str::to_owned)
    }

    /// Beams of a LiDAR.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn beams(&self, lidar: &SensorPose) -> Result<SightBeams, UnknownSensor> {
        let places: Vec<usize> = (0..self.places.len()).collect();
        let (ground, surfaces) = (self.cells(lidar)?, self.surfaces(lidar)?);
        let beams = self.beams_at(lidar, &places)?;
        Ok(SightBeams { beams, ground, surfaces, range_mm: self.range_mm(lidar)? })
    }

    /// Beams, ground and surfaces of a LiDAR that some rules need: `wanted` says which rules, in the order of [`Self::shares`].
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(crate) fn beams_for(
        &self,
        lidar: &SensorPose,
        wanted: &[bool],
    ) -> Result<SightBeams, UnknownSensor> {
        let (mut places, mut found) = (Vec::new(), SightBeams::default());
        for (rule, _) in self.rules.iter().zip(wanted).filter(|(_, is_wanted)| **is_wanted) {
            match rule {
                Rule::Target(_, sites) => {
                    places.extend(sites.iter().flat_map(|site| site.places.clone()));
                }
                Rule::Ground(..) if found.ground.is_empty() => found.ground = self.cells(lidar)?,
                Rule::Overlap(_) if found.surfaces.frames.is_empty() => {
                    found.surfaces = self.surfaces(lidar)?;
                }
                Rule::Ground(..) | Rule::Overlap(_) => {}
            }
        }
        let (beams, range_mm) = (self.beams_at(lidar, &places)?, self.range_mm(lidar)?);
        Ok(SightBeams { beams, range_mm, ..found })
    }

    fn range_mm(&self, lidar: &SensorPose) -> Result<u32, UnknownSensor> {
        let sensors = self.bodies.sites[0].sensors();
        Ok((1e3 * f64::from(sensors.table(sensors.number(lidar)?).range())).round() as u32)
    }

    /// The target at a place.
    pub(super) fn standing(&self, place: usize) -> PlacedTarget<'_> {
        let SitePlace { target, at, .. } = &self.places[place];
        PlacedTarget { target, at: *at }
    }

    /// LiDARs of a placement with nothing but the own vehicle around them, site after site of the bodies.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(super) fn looking_out_of(
        &self,
        lidars: &[SensorPose],
    ) -> Result<Vec<LookingOut<'_>>, UnknownSensor> {
        self.bodies.sites.iter().map(|site| site.looking_out_of(lidars)).collect()
    }

    /// Beams at some places, as far as they count; 0 at the others.
    fn beams_at(&self, lidar: &SensorPose, places: &[usize]) -> Result<Box<[u8]>, UnknownSensor> {
        let mut all = vec![0; self.places.len()];
        let most = places.iter().map(|&place| self.enough[place]).max().unwrap_or(0);
        for (number, site) in self.bodies.sites.iter().enumerate() {
            let here = places.iter().copied().filter(|&place| self.places[place].site == number);
            let here: Vec<usize> = here.collect();
            // The first site tells a model that the vehicle does not have.
            if number > 0 && here.is_empty() {
                continue;
            }
            let standing: Vec<_> = here.iter().map(|&place| self.standing(place)).collect();
            let beams = site.beams(lidar, &standing, u32::from(most))?;
            for (place, beams) in here.into_iter().zip(beams) {
                all[place] = beams.min(u32::from(self.enough[place])) as u8;
            }
        }
        Ok(all.into())
    }

    /// Cells of the required ground that a LiDAR sees.
    fn cells(&self, lidar: &SensorPose) -> Result<Box<[u64]>, UnknownSensor> {
        let cells = self.ground.par_iter().map(|scene| scene.seen(lidar));
        Ok(cells.collect::<Result<Vec<_>, _>>()?.concat().into())
    }

    /// Surfaces on which beams of a LiDAR end, where overlap is required.
    fn surfaces(&self, lidar: &SensorPose) -> Result<Surfaces, UnknownSensor> {
        let surfaces = self.overlap.par_iter().map(|scene| scene.surfaces(lidar));
        let surfaces = surfaces.collect::<Result<Vec<_>, _>>()?.into_iter();
        Ok(Surfaces { frames: surfaces.flat_map(|scene| scene.frames).collect() })
    }

    /// Beams of a LiDAR for a search, which looks at a sample of its surfaces.
    ///
    /// # Errors
    /// See [`Self::beams`].
    pub(crate) fn sampled_beams(&self, lidar: &SensorPose) -> Result<SightBeams, UnknownSensor> {
        let beams = self.beams(lidar)?;
        let every = self.overlap.first().map_or(1, RequiredOverlap::sample);
        Ok(SightBeams { surfaces: beams.surfaces.sampled(every), ..beams })
    }

    /// Missing share of beams on a car all round: 0 where five meet it at every place, 1 where none meets it anywhere,
    /// `None` where a search does not look. Each LiDAR lowers it, by less the more there are: 1 less the share is
    /// submodular. Where every place is watched, the weighted share of places that lose it comes on top.
    pub(crate) fn car_missing(&self, all: &SightBeams) -> Option<f64> {
        let places = self.car.clone();
        let lost = match self.counts_lost {
            true => LOST_WEIGHT * (1.0 - self.hard(all, places.clone())),
            false => 0.0,
        };
        (!places.is_empty()).then(|| 1.0 - self.soft(all, places) + lost)
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::maths;
    use crate::psog::Psog;
    use crate::scene::Scene;
    use crate::vehicle::TargetRule;

    /// A rule on cars, one on tyres without any one LiDAR, one on ground.
    fn sight_of_three_rules() -> Sight {
        let text = r#"{ "sightline": 1, "coverage": "first-hit",
            "roi": { "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] },
            "static": [{ "class": "road", "plane": { "min": [-99, -99], "max": [99, 99], "z": 0 } }],
            "ego": { "poses": [{ "x": 0, "y": 0, "z": 0 }],
                     "body": [{ "class": "vehicle", "box": { "min": [-2, -1, 0.2], "max": [2, 1, 1.5] } }] },
            "vehicle": {
              "sensors": [{ "name": "a", "lidar": { "channels": 32, "fov": [-30, 0], "azimuth_steps": 90, "range": 100 } }],
              "mounts": [{ "name": "top", "min": [-2, -1, 2], "max": [2, 1, 2.5], "count": [1, 2] }],
              "require": [{ "target": "car", "within": 60, "beams": 9, "share": 0.5 }, { "ground": 5, "share": 0.5 },
                          { "target": "tyre", "within": 10, "share": 0.5, "without_any_one": true }] } }"#;
        let scene = Scene::from_json(text, Path::new(""), "rules.json").unwrap();
        let roi = scene.roi().grid().unwrap();
        let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
        let problem = Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap();
        Sight::of([(&Arc::new(problem), false)], Cars::Nowhere).unwrap()
    }

    #[test]
    fn a_sector_has_its_middle_and_both_ends() {
        let bearings = |from: f64, to: f64| {
            let rule =
                TargetRule { bearings: [from, to], from: 10.0, within: 10.0, ..sight_rule() };
            let bearing = |at: &[f64; 3]| maths::atan2(at[1], at[0]).to_degrees().round();
            places_of(&rule).iter().map(bearing).collect::<Vec<_>>()
        };
        assert_eq!(bearings(170.0, 190.0), [170.0, 175.0, 180.0, -175.0, -170.0]);
        assert_eq!(bearings(-5.0, 5.0), [-5.0, 0.0, 5.0]);
        assert_eq!(bearings(30.0, 30.0), [30.0]);
        assert_eq!(bearings(-180.0, 180.0).len(), 48);
    }

    /// A rule on a car.
    fn sight_rule() -> TargetRule {
        let sight = sight_of_three_rules();
        let Rule::Target(rule, _) = &sight.rules[0] else { panic!("the car comes first") };
        rule.clone()
    }

    #[test]
    fn rules_that_are_not_asked_cost_nothing_and_change_nothing() {
        let sight = sight_of_three_rules();
        // Targets come first.
        assert_eq!(sight.on_targets(), [true, true, false]);
        let pose = |x: f64| SensorPose { x, z: 2.2, ..SensorPose::default() };
        let lidars = [pose(-1.0), pose(1.5)];
        let all = lidars.map(|lidar| sight.beams(&lidar).unwrap());
        let shares = sight.shares(&[&all[0], &all[1]], &[true; 3]);
        assert!(shares.iter().all(|share| *share > 0.1 && *share < 1.0), "{shares:?}");
        for bits in 0..8 {
            let wanted = [0, 1, 2].map(|k| bits >> k & 1 == 1);
            let few = lidars.map(|lidar| sight.beams_for(&lidar, &wanted).unwrap());
            let expected = [0, 1, 2].map(|k| if wanted[k] { shares[k] } else { 1.0 });
            assert_eq!(sight.shares(&[&few[0], &few[1]], &wanted), expected, "{wanted:?}");
            assert_eq!(few[0].ground.is_empty(), !wanted[2]);
            let Rule::Target(_, cars) = &sight.rules[0] else { panic!("the car comes first") };
            assert_eq!(
                few[0].beams[cars[0].places.clone()].iter().any(|beams| *beams > 0),
                wanted[0]
            );
        }
    }

    #[test]
    fn shares_on_targets_are_the_same_whatever_the_order_of_the_lidars() {
        let sight = sight_of_three_rules();
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let mut found = [[0; 2]; 2];
        for _ in 0..60 {
            let mut pose = || SensorPose {
                x: rng.random_range(-2.0..2.0),
                z: rng.random_range(1.6..2.5),
                pitch: rng.random_range(-0.3..0.3),
                ..SensorPose::default()
            };
            let lidars = [pose(), pose(), pose()];
            let each = lidars.map(|lidar| sight.beams(&lidar).unwrap());
            let each: Vec<&SightBeams> = each.iter().collect();
            let met = sight.rules_met(&each);
            // Two places more are wanted of a rule on targets.
            let places = |k: usize| match &sight.rules[k] {
                Rule::Target(_, poses) => poses[0].places.len() as f64,
                _ => panic!("targets come first"),
            };
            let lacks =
                |k: usize| ((met[k].least + 2.0 / places(k)).min(1.0) - met[k].share).max(0.0);
            let [plain, roomy] = [false, true].map(|roomy| sight.rules_missing(&each, roomy));
            assert!((roomy - plain - 3e-5 * (lacks(0) + lacks(1))).abs() < 1e-12);
            let mut order = sight.most_beams_first(&each);
            for _ in 0..2 {
                let now = sight.shares_on_targets(&lidars, &order, &[true; 3]).unwrap();
                assert_eq!(now, [met[0].share, met[1].share, 1.0]);
                (0..2).for_each(|k| found[k][usize::from(now[k] >= met[k].least)] += 1);
                order.iter_mut().for_each(|lidars| lidars.reverse());
            }
            assert_eq!(sight.shares_on_targets(&lidars, &order, &[false; 3]).unwrap(), [1.0; 3]);
        }
        assert!(found.concat().iter().all(|times| *times >= 10), "{found:?}");
    }
}
