//! The range card of a rig: distances at which a car, an adult and a tyre are met, by bearing, and blind sectors.

use std::sync::{Arc, OnceLock};

use serde::Serialize;

use super::beams::{PlacedTarget, TargetSite};
use super::missing::range;
use super::on_ground::{CardGround, stands_in_words};
use crate::maths;
use crate::scene::{Target, preset_targets};
use crate::vehicle::{SensorPose, UnknownSensor};

/// Least beams on a target that is met.
pub const CARD_BEAMS: u32 = 5;
/// Presets on a card. The first is the one that sectors are blind to.
const TARGETS: [&str; 3] = ["car", "adult", "tyre"];
/// Bearings on a card, counter-clockwise from straight ahead.
const BEARINGS: usize = 16;
/// Bearings at which sectors are tested, 1.875° apart: at 50 m that is less than the width of a car.
const FINE: usize = 12 * BEARINGS;
/// Fine bearings to either side of a sector's middle: 15°.
const HALF_SECTOR: usize = FINE / 24;
/// Fine bearings between those that a sector names first where a car is lost at as many distances: 7.5°.
const NAMED_FIRST: usize = FINE / 48;
/// Degrees of a sector.
const SECTOR: f64 = 2.0 * HALF_SECTOR as f64 * 360.0 / FINE as f64;
/// Distances between which a sector must not lose a car, metres; sensors that reach less far end them.
pub(super) const SECTOR_RANGE: [f64; 2] = [5.0, 50.0];
/// Most distances of a card, in metres.
const FARTHEST: f64 = 200.0;

/// Distances at which targets are met, by bearing. A target is met by at least [`CARD_BEAMS`] beams.
///
/// Targets stand on level ground, without a scene, and phases stand at 0, or alone on the ground of a scene in a frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RangeCard {
    /// Least beams on a target that is met.
    pub beams: u32,
    /// Distances that were looked at, from the ego origin to the target's middle, metres.
    pub distances: Vec<f64>,
    /// A car, an adult, a tyre.
    pub targets: Vec<TargetRanges>,
    /// Distances between which sectors are looked at, metres: 5 and 50, or the longest range of the sensors.
    pub blind_between: [f64; 2],
    /// Sectors that lose a car between these distances.
    pub blind: Vec<BlindSector>,
    /// Farthest that a LiDAR of the rig reaches, metres, where other sensors of the vehicle reach farther between these
    /// distances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach: Option<f64>,
    /// Ground of a scene that targets stand on; `None` for level ground. Places without ground are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground: Option<CardGround>,
    /// True where bodies of the vehicle move: they stand as in frame 0.
    #[serde(skip)]
    pub bodies_move: bool,
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

impl TargetRanges {
    /// First and last of neighbouring distances at which the target is met at every bearing, metres.
    pub(crate) fn in_all_directions(&self) -> Vec<[f64; 2]> {
        let mut each = self.bearings.iter().map(|of| &of.met[..]);
        let first = each.next().unwrap_or_default().to_vec();
        each.fold(first, |common, met| {
            let both = common.iter().flat_map(|&[from, to]| {
                met.iter().map(move |&[first, last]| [from.max(first), to.min(last)])
            });
            both.filter(|[from, to]| from <= to).collect()
        })
    }
}

/// Distances at which a target is met at one bearing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BearingRanges {
    /// Degrees counter-clockwise from straight ahead.
    pub bearing: f64,
    /// First and last of neighbouring distances at which enough beams meet the target, metres.
    pub met: Vec<[f64; 2]>,
}

/// Neighbouring bearings at which a car is lost somewhere within [`RangeCard::blind_between`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlindSector {
    /// First and last bearing, degrees counter-clockwise from straight ahead; −180 and 180 all round.
    pub bearings: [f64; 2],
    /// Nearest and farthest distance at which a car is lost in it, metres.
    pub distances: [f64; 2],
    /// Bearing of the sector at which a car is lost at most distances, degrees from −180 to 180; it may lie between those
    /// of the card.
    pub worst: f64,
    /// First and last of neighbouring distances at which a car is lost there, metres.
    pub lost: Vec<[f64; 2]>,
    /// Ground of a scene that the car stands on; `None` for level ground.
    #[serde(skip)]
    pub ground: Option<CardGround>,
    /// True where bodies of the vehicle move: they stand as in frame 0.
    #[serde(skip)]
    pub bodies_move: bool,
}

impl BlindSector {
    /// Width in degrees; 360 all round.
    pub fn degrees(&self) -> f64 {
        match self.bearings {
            [-180.0, 180.0] => 360.0,
            [from, to] => (to - from).rem_euclid(360.0),
        }
    }

    /// True if another sector has all its bearings and loses a car at all its distances.
    pub(crate) fn is_within(&self, other: &Self) -> bool {
        let ([near, far], [nearest, farthest]) = (self.distances, other.distances);
        let offset = (self.bearings[0] - other.bearings[0]).rem_euclid(360.0);
        let is_no_wider = other.degrees() >= 360.0 || offset + self.degrees() <= other.degrees();
        let is_known = |[from, to]: &[f64; 2]| other.lost.iter().any(|[a, b]| a <= from && to <= b);
        is_no_wider && nearest <= near && far <= farthest && self.lost.iter().all(is_known)
    }

    /// The four directions that a sector holds, in words: `ahead and left`; of one between two of them `ahead left`.
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
            [] => format!(
                "{} {}",
                if from.abs() < 90.0 { "ahead" } else { "behind" },
                if from > 0.0 { "left" } else { "right" }
            ),
            [_, _, _, _] => "all round".to_owned(),
            _ => held.join(" and "),
        }
    }
}

#[cfg(test)]
impl BlindSector {
    /// A sector in which a car is lost at all of the distances, worst in its middle.
    pub(crate) fn lost(bearings: [f64; 2], distances: [f64; 2]) -> Self {
        let worst = bearings[0] + 0.5 * (bearings[1] - bearings[0]).rem_euclid(360.0);
        let (lost, ground, bodies_move) = (vec![distances], None, false);
        Self { bearings, distances, worst, lost, ground, bodies_move }
    }
}

impl std::fmt::Display for BlindSector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (bearings, worst, sides) = (range(self.bearings), self.worst, self.sides());
        let run = |[near, far]: &[f64; 2]| match near == far {
            true => near.to_string(),
            false => format!("{near} to {far}"),
        };
        let lost: Vec<String> = self.lost.iter().map(run).collect();
        let lost = lost.join(" and ");
        let frame = stands_in_words(self.ground.as_ref(), self.bodies_move);
        // Each neighbouring sector has a bearing at which a car is lost; other bearings may meet it.
        let within = match self.degrees() {
            degrees if degrees >= 360.0 => format!("in every sector of {SECTOR}°"),
            degrees if degrees > 180.0 => {
                format!("in sectors of {SECTOR}° over {degrees}°, left round from {bearings}")
            }
            degrees if degrees > SECTOR => {
                format!("in sectors of {SECTOR}° within {bearings}")
            }
            _ => format!("in the sector of {SECTOR}° from {bearings}"),
        };
        write!(
            f,
            "{sides} ({within}{frame}), worst at {worst}°: a car there at {lost} m from the origin is met by fewer than \
             {CARD_BEAMS} beams"
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

/// Places of a car at which sectors are tested, where it stands free.
pub(super) fn car_places(site: &TargetSite) -> Vec<[f64; 3]> {
    let range = f64::from(site.sensors().longest_range());
    let [near, far] = sectors_between(range);
    let distances = distances(range).into_iter().filter(|d| (near..=far).contains(d));
    let at = distances.flat_map(|d| (0..FINE).map(move |fine| position(d, degrees(fine))));
    at.filter_map(|at| site.standing(&card_targets()[0], at)).collect()
}

/// Distances between which sectors are tested, by the longest range of the sensors, metres.
fn sectors_between(range: f64) -> [f64; 2] {
    let [near, far] = SECTOR_RANGE;
    [near, to_millimetres(range).clamp(near, far)]
}

/// A range is an f32: 30.2 is not to read 30.2000008.
fn to_millimetres(metres: f64) -> f64 {
    (1e3 * metres).round() / 1e3
}

/// Targets of a card; the first is the car.
pub(super) fn card_targets() -> &'static [Arc<Target>] {
    static TARGETS_OF_CARD: OnceLock<Vec<Arc<Target>>> = OnceLock::new();
    TARGETS_OF_CARD.get_or_init(|| {
        let named = |name: &&str| preset_targets().iter().find(|target| target.name == **name);
        TARGETS.iter().filter_map(|name| named(name).cloned().map(Arc::new)).collect()
    })
}

impl RangeCard {
    /// The card of a placement.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn new(site: &TargetSite, lidars: &[SensorPose]) -> Result<Self, UnknownSensor> {
        let range = f64::from(site.sensors().longest_range());
        let (targets, distances) = (card_targets(), distances(range));
        // Number of the target, fine bearing, number of the distance; where the target stands.
        let (mut places, mut standing) = (Vec::new(), Vec::new());
        for (target, of) in targets.iter().enumerate() {
            for bearing in (0..FINE).step_by(if target == 0 { 1 } else { FINE / BEARINGS }) {
                let is_on_card = bearing % (FINE / BEARINGS) == 0;
                for (distance, &metres) in distances.iter().enumerate() {
                    // Between the bearings of the card, only sectors are tested.
                    let is_tested = is_on_card || metres <= SECTOR_RANGE[1];
                    let at = position(metres, degrees(bearing));
                    if let Some(at) = is_tested.then(|| site.standing(of, at)).flatten() {
                        places.push([target, bearing, distance]);
                        standing.push(PlacedTarget { target: of, at });
                    }
                }
            }
        }
        let is_met = site.met(lidars, &standing, CARD_BEAMS)?;
        // `None` where the own vehicle stands, and where nobody looks.
        let mut met = vec![vec![vec![None; distances.len()]; FINE]; targets.len()];
        for (&[target, bearing, distance], is_met) in places.iter().zip(is_met) {
            met[target][bearing][distance] = Some(is_met);
        }
        let of_target = |(target, met): (&Arc<Target>, &Vec<Vec<Option<bool>>>)| TargetRanges {
            target: target.name.clone(),
            size: target.size,
            bearings: (0..BEARINGS)
                .map(|bearing| {
                    let fine = bearing * (FINE / BEARINGS);
                    BearingRanges { bearing: turned(fine), met: runs(&met[fine], &distances) }
                })
                .collect(),
        };
        let ranges = targets.iter().zip(&met).map(of_target).collect();
        let blind_between = sectors_between(range);
        let (bodies_move, ground) = (site.bodies_move(), site.card_ground().cloned());
        let mut blind = blind_sectors(&met[0], &distances, blind_between);
        for sector in &mut blind {
            (sector.bodies_move, sector.ground) = (bodies_move, ground.clone());
        }
        let mut reach: f64 = 0.0;
        for lidar in lidars {
            let model = site.sensors().number(lidar)?;
            reach = reach.max(f64::from(site.sensors().table(model).range()));
        }
        let reach = Some(to_millimetres(reach)).filter(|&reach| reach < blind_between[1]);
        let (beams, targets) = (CARD_BEAMS, ranges);
        Ok(Self { beams, distances, targets, blind_between, blind, reach, ground, bodies_move })
    }

    /// Distances in words between which a car counts as lost: `between 5 and 50 m`, or less far where no sensor reaches 50 m.
    /// Without a card, the distances for sensors that reach as far.
    pub(crate) fn between_in_words(card: Option<&Self>) -> String {
        match card.map_or(SECTOR_RANGE, |card| card.blind_between) {
            [near, far] if near == far => format!("at {near} m"),
            [near, far] => format!("between {near} and {far} m"),
        }
    }

    /// True if sectors are looked at less far than cars matter, because no sensor reaches farther.
    pub(crate) fn ends_at_range(&self) -> bool {
        self.blind_between[1] < SECTOR_RANGE[1]
    }
}

/// The sixteen bearings of a range card: degrees above −180 and up to 180, counter-clockwise from straight ahead.
pub fn card_bearings() -> Vec<f64> {
    (0..BEARINGS).map(|bearing| turned(bearing * (FINE / BEARINGS))).collect()
}

/// Degrees of a fine bearing, from −180 (not included) to 180.
fn turned(fine: usize) -> f64 {
    let degrees = degrees(fine % FINE);
    if degrees > 180.0 { degrees - 360.0 } else { degrees }
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

/// Sectors of ±15° around the card's bearings in which a car is lost at some distance between two; neighbours are
/// one.
fn blind_sectors(
    met: &[Vec<Option<bool>>],
    distances_of: &[f64],
    [near, far]: [f64; 2],
) -> Vec<BlindSector> {
    let lost = |fine: usize| -> Vec<f64> {
        let at = met[fine].iter().zip(distances_of);
        let lost = at.filter(|(met, d)| **met == Some(false) && (near..=far).contains(*d));
        lost.map(|(_, &distance)| distance).collect()
    };
    let lost: Vec<Vec<f64>> = (0..FINE).map(lost).collect();
    let around = |bearing: usize| {
        let middle = bearing * (FINE / BEARINGS) + FINE;
        (middle - HALF_SECTOR..=middle + HALF_SECTOR).map(|fine| fine % FINE)
    };
    let is_lost = |bearing: usize| around(bearing).any(|fine| !lost[fine].is_empty());
    let is_blind: Vec<bool> = (0..BEARINGS).map(is_lost).collect();
    let span = |first: usize, count: usize| {
        let of = || (first..first + count).flat_map(|b| around(b % BEARINGS));
        let distances = of().flat_map(|fine| &lost[fine]);
        let distances = distances.fold([far, near], |[low, high], &d| [low.min(d), high.max(d)]);
        let middle = |b: usize| (b % BEARINGS) * (FINE / BEARINGS) + FINE;
        let bearings = match count == BEARINGS {
            true => [-180.0, 180.0],
            false => [
                turned(middle(first) - HALF_SECTOR),
                turned(middle(first + count - 1) + HALF_SECTOR),
            ],
        };
        // The first of equal ones, one that is a multiple of 7.5° before others.
        let rank = |fine: usize| (lost[fine].len(), fine.is_multiple_of(NAMED_FIRST));
        let worse = |a: usize, b: usize| if rank(b) > rank(a) { b } else { a };
        let worst = of().reduce(worse).unwrap_or_default();
        let there: Vec<Option<bool>> =
            distances_of.iter().map(|d| Some(lost[worst].contains(d))).collect();
        let lost = runs(&there, distances_of);
        let (worst, ground, bodies_move) = (turned(worst), None, false);
        BlindSector { bearings, distances, worst, lost, ground, bodies_move }
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
