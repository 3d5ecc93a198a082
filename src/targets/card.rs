//! The range card of a rig: distances at which a car, an adult and a tyre are met, by bearing, and blind sectors.

use std::sync::{Arc, OnceLock};

use serde::Serialize;

use super::beams::{PlacedTarget, TargetSite};
use crate::maths;
use crate::scene::{Target, preset_targets};
use crate::vehicle::{SensorPose, UnknownSensor};

/// Least beams on a target that is met.
pub const CARD_BEAMS: u32 = 5;
/// Presets on a card. The first is the one that sectors are blind to.
const TARGETS: [&str; 3] = ["car", "adult", "tyre"];
/// Bearings on a card, counter-clockwise from straight ahead.
const BEARINGS: usize = 16;
/// Bearings at which sectors are tested: three a bearing of the card.
const FINE: usize = 3 * BEARINGS;
/// Fine bearings to either side of a sector's middle: 15°.
const HALF_SECTOR: usize = 2;
/// Distances between which a sector must not lose a car, metres.
pub const SECTOR_RANGE: [f64; 2] = [5.0, 50.0];
/// Most distances of a card, in metres.
const FARTHEST: f64 = 200.0;

/// Distances at which targets are met, by bearing; on level ground without a scene, phases at 0.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RangeCard {
    /// Least beams on a target that is met.
    pub beams: u32,
    /// Distances that were looked at, from the ego origin to the target's middle, metres.
    pub distances: Vec<f64>,
    /// A car, an adult, a tyre.
    pub targets: Vec<TargetRanges>,
    /// Sectors that lose a car between 5 and 50 m.
    pub blind: Vec<BlindSector>,
}

/// Distances at which one target is met.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetRanges {
    /// Name of the target.
    pub target: String,
    /// Length, width and height, metres.
    pub size: [f64; 3],
    /// Sixteen, counter-clockwise from straight ahead.
    pub bearings: Vec<BearingRanges>,
}

/// Distances at which a target is met at one bearing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BearingRanges {
    /// Degrees counter-clockwise from straight ahead.
    pub bearing: f64,
    /// First and last of neighbouring distances at which enough beams meet the target, metres.
    pub met: Vec<[f64; 2]>,
}

/// Neighbouring bearings at which a car is lost somewhere between 5 and 50 m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BlindSector {
    /// First and last bearing, degrees counter-clockwise from straight ahead; −180 and 180 all round.
    pub bearings: [f64; 2],
    /// Nearest and farthest distance at which a car is lost in it, metres.
    pub distances: [f64; 2],
}

impl BlindSector {
    /// Width in degrees; 360 all round.
    pub fn degrees(&self) -> f64 {
        match self.bearings {
            [-180.0, 180.0] => 360.0,
            [from, to] => (to - from).rem_euclid(360.0),
        }
    }

    /// The four directions that a sector holds, in words: `ahead and left`.
    fn sides(&self) -> String {
        let [from, to] = self.bearings;
        let holds = |side: f64| {
            let to = if to < from { to + 360.0 } else { to };
            [side, side + 360.0].iter().any(|side| (from..=to).contains(side))
        };
        let sides = [("ahead", 0.0), ("left", 90.0), ("behind", 180.0), ("right", -90.0)];
        let held: Vec<&str> =
            sides.iter().filter(|side| holds(side.1)).map(|side| side.0).collect();
        match held[..] {
            [] => String::new(),
            [_, _, _, _] => "all round ".to_owned(),
            _ => format!("{} ", held.join(" and ")),
        }
    }
}

impl std::fmt::Display for BlindSector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ([from, to], [near, far]) = (self.bearings, self.distances);
        let sides = self.sides();
        let range = if near == far { format!("{near} m") } else { format!("{near} to {far} m") };
        write!(
            f,
            "{sides}({from}° to {to}°) a car at {range} is met by fewer than {CARD_BEAMS} beams"
        )
    }
}

/// Distances of a card for sensors of a range: closer together where a rig may be blind near the vehicle.
fn distances(range: f64) -> Vec<f64> {
    let steps = [(2.5, 20.0), (5.0, 60.0), (10.0, FARTHEST)];
    let mut all = vec![2.5];
    for (step, end) in steps {
        while all[all.len() - 1] + step <= end.min(range.max(SECTOR_RANGE[1])) {
            all.push(all[all.len() - 1] + step);
        }
    }
    all
}

/// Position of a target's middle on level ground, at degrees counter-clockwise from straight ahead.
pub(super) fn position(distance: f64, bearing: f64) -> [f64; 3] {
    let (sin, cos) = maths::sin_cos(bearing.to_radians());
    [distance * cos, distance * sin, 0.0]
}

/// Targets of a card; the first is the car.
pub(super) fn card_targets() -> &'static [Arc<Target>] {
    static TARGETS_OF_CARD: OnceLock<Vec<Arc<Target>>> = OnceLock::new();
    TARGETS_OF_CARD.get_or_init(|| {
        let named = |name: &&str| preset_targets().iter().find(|target| target.name == **name);
        TARGETS.iter().filter_map(|name| named(name).cloned().map(Arc::new)).collect()
    })
}

/// A place of a card: number of its target, fine bearing, number of its distance.
struct CardPlace {
    target: usize,
    bearing: usize,
    distance: usize,
}

impl RangeCard {
    /// The card of a placement.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn new(site: &TargetSite, lidars: &[SensorPose]) -> Result<Self, UnknownSensor> {
        let (targets, distances) =
            (card_targets(), distances(f64::from(site.sensors().longest_range())));
        let mut places = Vec::new();
        for (target, of) in targets.iter().enumerate() {
            for bearing in (0..FINE).step_by(if target == 0 { 1 } else { FINE / BEARINGS }) {
                for (distance, &metres) in distances.iter().enumerate() {
                    if site.has_room(of, position(metres, degrees(bearing))) {
                        places.push(CardPlace { target, bearing, distance });
                    }
                }
            }
        }
        let standing: Vec<PlacedTarget<'_>> = places
            .iter()
            .map(|place| PlacedTarget {
                target: &targets[place.target],
                at: position(distances[place.distance], degrees(place.bearing)),
            })
            .collect();
        let is_met = site.met(lidars, &standing, CARD_BEAMS)?;
        // `None` where the own vehicle stands.
        let mut met = vec![vec![vec![None; distances.len()]; FINE]; targets.len()];
        for (place, is_met) in places.iter().zip(is_met) {
            met[place.target][place.bearing][place.distance] = Some(is_met);
        }
        let of_target = |(target, met): (&Arc<Target>, &Vec<Vec<Option<bool>>>)| TargetRanges {
            target: target.name.clone(),
            size: target.size,
            bearings: (0..BEARINGS)
                .map(|bearing| {
                    let fine = bearing * (FINE / BEARINGS);
                    BearingRanges { bearing: degrees(fine), met: runs(&met[fine], &distances) }
                })
                .collect(),
        };
        let ranges = targets.iter().zip(&met).map(of_target).collect();
        let blind = blind_sectors(&met[0], &distances);
        Ok(Self { beams: CARD_BEAMS, distances, targets: ranges, blind })
    }
}

/// Degrees of a fine bearing.
fn degrees(fine: usize) -> f64 {
    fine as f64 * 360.0 / FINE as f64
}

/// First and last of neighbouring distances at which a target is met.
pub(super) fn runs(met: &[Option<bool>], distances: &[f64]) -> Vec<[f64; 2]> {
    let mut runs: Vec<[f64; 2]> = Vec::new();
    let mut goes_on = false;
    for (met, &distance) in met.iter().zip(distances) {
        match (met == &Some(true), runs.last_mut().filter(|_| goes_on)) {
            (true, Some(run)) => run[1] = distance,
            (true, None) => runs.push([distance; 2]),
            (false, _) => {}
        }
        goes_on = met == &Some(true);
    }
    runs
}

/// Sectors of ±15° around the card's bearings in which a car is lost at some distance from 5 to 50 m; neighbours are
/// one.
fn blind_sectors(met: &[Vec<Option<bool>>], distances: &[f64]) -> Vec<BlindSector> {
    let [near, far] = SECTOR_RANGE;
    let lost = |fine: usize| -> Vec<f64> {
        let at = met[fine].iter().zip(distances);
        let lost = at.filter(|(met, d)| **met == Some(false) && (near..=far).contains(*d));
        lost.map(|(_, &distance)| distance).collect()
    };
    let lost: Vec<Vec<f64>> = (0..FINE).map(lost).collect();
    let around = |bearing: usize| {
        let middle = bearing * (FINE / BEARINGS) + FINE;
        (middle - HALF_SECTOR..=middle + HALF_SECTOR).flat_map(|fine| lost[fine % FINE].iter())
    };
    let is_blind: Vec<bool> = (0..BEARINGS).map(|b| around(b).next().is_some()).collect();
    let half = degrees(HALF_SECTOR);
    let span = |first: usize, count: usize| {
        let of = (first..first + count).flat_map(|b| around(b % BEARINGS));
        let distances = of.fold([far, near], |[low, high], &d| [low.min(d), high.max(d)]);
        let turned = |degrees: f64| if degrees > 180.0 { degrees - 360.0 } else { degrees };
        let middle = |b: usize| degrees((b % BEARINGS) * (FINE / BEARINGS));
        let bearings = match count == BEARINGS {
            true => [-180.0, 180.0],
            false => [turned(middle(first) - half), turned(middle(first + count - 1) + half)],
        };
        BlindSector { bearings, distances }
    };
    if is_blind.iter().all(|blind| *blind) {
        return vec![span(0, BEARINGS)];
    }
    let begins = |b: &usize| is_blind[*b] && !is_blind[(b + BEARINGS - 1) % BEARINGS];
    let run = |b: usize| {
        let count = (0..BEARINGS).take_while(|k| is_blind[(b + k) % BEARINGS]).count();
        span(b, count)
    };
    (0..BEARINGS).filter(begins).map(run).collect()
}
