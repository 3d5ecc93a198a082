//! Warnings about likely slips in a placement: degrees, millimetres, a sensor beside the mount.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use super::constraints::HOLDS_NONE;
use super::{Constraints, Lidar, Placement, Region, SensorPose};
use sightline_files::json::check::ROUNDED;

/// Farthest coordinate of a sensor that stands on a vehicle, in metres: larger ones are most likely millimetres.
pub const FARTHEST: f64 = 100.0;
/// Smallest whole number of radians that is more likely degrees.
const WHOLE: f64 = 2.0;
/// Metres and radians beside a mount that poses lose where they are written with three decimals.
pub(super) const SLACK: f64 = 2e-3;

/// Ranges in metres that LiDARs have.
const RANGE: [f64; 2] = [1.0, 1000.0];
/// Smallest field of view across in degrees; smaller numbers are radians.
const ACROSS: f64 = PI;
/// Elevation in degrees above which no sensor has all its channels.
const STEEP: f64 = 45.0;
/// Largest noise and rated range in metres, and most turns a second, that sensors have.
const NOISE: f64 = 0.5;
const RATED: f64 = 2000.0;
const RATE: f64 = 100.0;

/// True if an angle in radians is most likely one in degrees: more than a turn, or a whole number from 2 up.
pub(crate) fn is_degrees(angle: f64) -> bool {
    in_degrees(angle).is_some()
}

/// True if an angle in radians is more than a turn.
fn is_beyond_a_turn(angle: f64) -> bool {
    angle.abs() > TAU + ROUNDED
}

/// A sign that an angle in radians is one in degrees, in words.
fn in_degrees(angle: f64) -> Option<String> {
    if is_beyond_a_turn(angle) {
        return Some("is more than a turn".to_owned());
    }
    let is_whole = angle.fract() == 0.0 && angle.abs() >= WHOLE;
    is_whole.then(|| format!("rad is {:.0}°", angle.to_degrees()))
}

/// Radians of pitch above a quarter turn that a LiDAR has which looks straight down or up: mounts are given some room.
const OVER_UPRIGHT: f64 = 0.1;

/// Largest angle of a pose in radians that is usual, and its words: a half turn, and a quarter turn of pitch.
fn usual_turn(field: &str) -> (f64, &'static str) {
    if field == "pitch" {
        (FRAC_PI_2 + OVER_UPRIGHT, "a quarter turn")
    } else {
        (PI, "half a turn")
    }
}

/// The angle of a pose outside its mount where it is most likely in degrees: beyond a half turn, or a quarter turn of pitch,
/// on a mount whose own bounds stay within it.
pub(super) fn likely_degrees(region: &Region, pose: &SensorPose, field: &str) -> Option<f64> {
    let index = SensorPose::FIELDS[3..].iter().position(|name| *name == field)? + 3;
    let (angle, most) = (pose.values()[index], usual_turn(field).0 + ROUNDED);
    let is_usual = [region.lower[index], region.upper[index]].iter().all(|a| a.abs() <= most);
    (is_usual && angle.abs() > most).then_some(angle)
}

/// Words on a value that is `by` outside a mount, and the question whether its angle is in degrees.
pub(super) fn outside_in_words(by: f64, unit: &str, degrees: Option<f64>) -> (String, String) {
    // Turns beyond one say nothing about the direction: the angle is most likely in degrees.
    if unit == "rad" && by > TAU {
        return ("more than a turn".to_owned(), "; degrees? Angles are in radians".to_owned());
    }
    let doubt =
        degrees.map(|angle| format!("; degrees? {angle}° are {:.4} rad", angle.to_radians()));
    (format!("{by:.3} {unit}"), doubt.unwrap_or_default())
}

/// A doubt about angles that a file states in radians; `what` names the angles.
pub(crate) fn of_angles(what: &str, angles: &[f64]) -> Option<String> {
    // A range from 3 to 3.3 is around π: a fraction beside a whole number says radians.
    let beside = |angle: f64| angles.iter().any(|a| a.fract() != 0.0 && (a - angle).abs() < 1.0);
    // From 2.3 to 4 is a usual range of yaw around the rear. A tilt of 2 rad is none.
    let is_yaw = angles.len() == 2 && what.trim_end_matches('`').ends_with("yaw");
    let is_range = is_yaw && angles.iter().any(|a| a.fract() != 0.0 && !is_beyond_a_turn(*a));
    let is_radians = |angle: f64| is_range || beside(angle);
    let is_doubted = |a: &&f64| is_beyond_a_turn(**a) || (is_degrees(**a) && !is_radians(**a));
    let mut doubted = angles.iter().filter(is_doubted);
    let angle = doubted.next()?;
    Some(format!("{what} is {angle} rad; degrees? {angle}° are {:.4} rad", angle.to_radians()))
}

/// A doubt about angles that a file states in degrees: one of them is a quarter, a half or a whole of π.
pub fn of_degrees(what: &str, degrees: &[f64]) -> Option<String> {
    let of_pi = |angle: &f64| {
        let parts = angle.abs() / (PI / 4.0);
        (1.0..=8.0).contains(&parts.round()) && (parts - parts.round()).abs() < 1e-3
    };
    let angle = degrees.iter().find(|angle| of_pi(angle))?;
    Some(format!("{what} is {angle}°; radians? {angle} rad are {:.2}°", angle.to_degrees()))
}

/// Doubts about a LiDAR, which `who` names: its range and its field of view across. Elevations are doubted where they are
/// read.
pub(crate) fn of_lidar(who: &str, lidar: &Lidar) -> Vec<String> {
    let mut doubts = Vec::new();
    let range = lidar.range();
    if !(RANGE[0]..=RANGE[1]).contains(&range) {
        let mend = match range > RANGE[1] {
            true => format!("{range} mm would be {} m", range / 1000.0),
            false => "write 100 for 100 m".to_owned(),
        };
        doubts.push(format!("{who} has a range of {range} m; ranges are in metres: {mend}"));
    }
    let Lidar::Spinning { azimuth, elevations, .. } = lidar else { return doubts };
    let lowest = elevations.iter().copied().fold(f64::INFINITY, f64::min);
    if lowest > STEEP && lowest.is_finite() {
        doubts.push(format!(
            "{who} looks up by {lowest}° and more with every channel; zenith angles? Elevations count from the horizon: \
             {lowest}° from the zenith are {}°",
            90.0 - lowest
        ));
    }
    let across = azimuth.map_or(360.0, |[from, to]| to - from);
    if across > 0.0 && across < ACROSS {
        doubts.push(format!(
            "{who} has a field of view of {across:.3}° (`azimuth`); radians? degrees are expected, {across:.3} rad \
             are {:.1}°",
            across.to_degrees()
        ));
    }
    doubts
}

/// Doubts about how a sensor measures: units of its noise, rated range and rate. `place` names each key.
pub(super) fn of_measures(
    place: impl Fn(&str) -> String,
    [noise, rated_range, rate]: [Option<f64>; 3],
) -> Vec<String> {
    let lengths = [("noise", noise, NOISE), ("rated_range", rated_range, RATED)];
    let large = lengths.into_iter().filter_map(|(key, value, most)| {
        let value = value.filter(|value| *value > most)?;
        let (at, metres) = (place(key), value / 1000.0);
        Some(format!("{at}: {value} m; millimetres? {value} mm are {metres} m"))
    });
    let mut doubts: Vec<String> = large.collect();
    if let Some(rate) = rate.filter(|rate| *rate > RATE) {
        let (at, turns) = (place("rate"), rate / 60.0);
        doubts.push(format!("{at}: {rate} turns a second; a minute? {rate} rpm are {turns}"));
    }
    doubts
}

/// Looks for likely slips in placements. None of them is an error: a placement is taken as it is.
#[derive(Debug, Clone, Default)]
pub struct Doubts {
    /// Where sensors may stand, each once; empty where that is nobody's matter.
    regions: Vec<Arc<Region>>,
    /// Mounts that hold none.
    closed: Vec<Arc<Region>>,
}

impl Doubts {
    /// Checks units only, for placements whose other rules the caller checks.
    pub fn of_units() -> Self {
        Self::default()
    }

    /// About units, and LiDARs that stand beside every mount.
    pub fn of(constraints: &Constraints) -> Self {
        let mut regions: Vec<Arc<Region>> = Vec::new();
        for slot in &constraints.slots {
            if !regions.iter().any(|known| Arc::ptr_eq(known, &slot.region)) {
                regions.push(slot.region.clone());
            }
        }
        Self { regions, closed: constraints.closed.clone() }
    }

    /// Sentences about LiDARs, with the name of the placement.
    pub fn about(&self, placement: &Placement) -> Vec<String> {
        let lidars = placement.lidars.iter().enumerate();
        let doubts = lidars.flat_map(|(lidar, pose)| {
            self.about_pose(pose).into_iter().map(move |doubt| (lidar, doubt))
        });
        doubts
            .chain(twice(placement))
            .map(|(lidar, doubt)| format!("placement `{}`, LiDAR {lidar}: {doubt}", placement.name))
            .collect()
    }

    fn about_pose(&self, pose: &SensorPose) -> Vec<String> {
        // A search puts LiDARs anywhere in the mount, and its own poses are sound. Degrees, as 15 or 90, lie outside: ranges
        // of a mount are at most a turn, and looked at where the vehicle is read.
        let is_meant = self.regions.iter().any(|region| region.outside(pose).is_empty());
        let phase = SensorPose { phase: pose.phase, ..SensorPose::at(0.0, 0.0, 1.0) };
        let units = doubts_of_units(if is_meant { &phase } else { pose });
        let is_far = pose.position().abs().max_element() > FARTHEST;
        let beside = self.regions.iter().map(|region| beside(region, pose));
        let beside = beside.min_by(f64::total_cmp).filter(|beside| !is_far && *beside > SLACK);
        let closed = self.closed.iter().find(|region| stands_on(region, pose));
        let beside = beside.map(|beside| {
            let place = match closed {
                Some(mount) => format!("on mount {}, which {HOLDS_NONE}", mount.name),
                None => format!("{beside:.3} m outside its mount"),
            };
            format!("it stands {place}; it is looked at there anyway")
        });
        units.into_iter().chain(doubt_of_ground(pose)).chain(beside).collect()
    }
}

/// Sentences about a pose whose angles are most likely degrees, or its position millimetres.
pub fn doubts_of_units(pose: &SensorPose) -> Vec<String> {
    let fields = pose.fields();
    let (metres, radians) = fields.split_at(3);
    let phase = pose.phase.map(|phase| ("phase", phase));
    let turned = radians.iter().copied().chain(phase).find_map(|(field, value)| {
        // Yaw and phase may be counted up to a whole turn.
        let (most, turn) = usual_turn(field);
        let most = if matches!(field, "yaw" | "phase") { TAU } else { most };
        let is_beyond = value.abs() > most + ROUNDED;
        let fault = in_degrees(value).or(is_beyond.then(|| format!("is more than {turn}")))?;
        Some(beyond_in_words(field, value, &fault))
    });
    let far = metres.iter().find(|(_, value)| value.abs() > FARTHEST).map(|(field, value)| {
        format!(
            "{field} = {value} is far from any vehicle; positions are in metres, {value} mm are {}",
            value / 1000.0
        )
    });
    turned.into_iter().chain(far).collect()
}

/// A doubt about an angle in radians with a fault of degrees.
fn beyond_in_words(field: &str, angle: f64, fault: &str) -> String {
    let radians = angle.to_radians();
    format!("{field} = {angle} {fault}; angles are in radians, {angle}° are {radians:.4}")
}

/// A sentence about a LiDAR below the ground.
pub fn doubt_of_ground(pose: &SensorPose) -> Option<String> {
    (pose.z < 0.0 && pose.z >= -FARTHEST).then(|| {
        let z = pose.z;
        format!(
            "z = {z:.3} is below the ground; heights are counted from the ground below the vehicle"
        )
    })
}

/// Doubts about LiDARs in exactly the pose of one before.
fn twice(placement: &Placement) -> impl Iterator<Item = (usize, String)> {
    let all = &placement.lidars;
    all.iter().enumerate().filter_map(|(lidar, pose)| {
        let first = all[..lidar].iter().position(|other| other.values() == pose.values())?;
        Some((lidar, format!("stands exactly where LiDAR {first} does; leave it out, or move it")))
    })
}

/// Metres from a position to a region; 0 inside.
fn beside(region: &Region, pose: &SensorPose) -> f64 {
    let outside = region.outside(pose).into_iter();
    let metres = outside.filter(|(field, _)| SensorPose::FIELDS[..3].contains(field));
    metres.map(|(_, by)| by * by).sum::<f64>().sqrt()
}

/// True if a position lies in a region, to what poses lose where they are written with three decimals.
pub(super) fn stands_on(region: &Region, pose: &SensorPose) -> bool {
    beside(region, pose) <= SLACK
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doubts(doubts: &Doubts, pose: SensorPose) -> String {
        let placement =
            Placement { name: "roof".into(), lidars: vec![SensorPose::at(0.5, 0.0, 2.0), pose] };
        doubts.about(&placement).join("; ")
    }

    fn lidar(elevations: [f64; 2], azimuth: Option<[f64; 2]>, range: f64) -> Lidar {
        let (elevations, azimuth_offsets) = (elevations.to_vec(), vec![0.0; 2]);
        Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps: 100, azimuth, range }
    }

    #[test]
    fn whole_numbers_from_2_and_more_than_a_turn_are_degrees() {
        assert!([90.0, -180.0, 5.0, 2.0, 7.5].into_iter().all(is_degrees));
        assert!(![0.0, 1.0, -1.0, 2.5, PI / 2.0, -PI, TAU].into_iter().any(is_degrees));
        let told = of_angles("`yaw`", &[0.1, 90.0]).unwrap();
        assert_eq!(told, "`yaw` is 90 rad; degrees? 90° are 1.5708 rad");
        assert_eq!(of_angles("`yaw`", &[3.0, 3.3]), None);
        for range in [[2.3, 4.0], [-4.0, -2.3], [0.5, 2.0]] {
            assert_eq!(of_angles("mounts[0].yaw", &range), None);
        }
        assert!(of_angles("mounts[0].yaw", &[2.0, 4.0]).is_some());
        assert!(of_angles("mounts[0].pitch", &[0.5, 2.0]).is_some());
        // Half a turn and a whole one with four decimals.
        let [half, turn, more]: [f64; 3] =
            ["3.1416", "6.2832", "3.1417"].map(|text| text.parse().unwrap());
        let rounded = SensorPose { roll: -half, yaw: turn, ..SensorPose::at(0.0, 0.0, 2.0) };
        assert!(doubts_of_units(&rounded).is_empty());
        let beyond = SensorPose { roll: more, ..rounded };
        assert!(doubts_of_units(&beyond)[0].starts_with("roll = 3.1417 is more than half a turn"));
        // Straight down, with some room.
        assert!(doubts_of_units(&SensorPose { pitch: 1.58, ..rounded }).is_empty());
        let pitched = SensorPose { pitch: 1.7, ..rounded };
        assert!(
            doubts_of_units(&pitched)[0].starts_with("pitch = 1.7 is more than a quarter turn")
        );
        assert!(of_angles("`yaw`", &[-5.0, 5.0]).is_some());
        assert!(of_angles("`pitch`", &[0.05, 5.0]).is_some());
    }

    #[test]
    fn parts_of_pi_are_radians() {
        for angle in [PI / 2.0 + 4e-6, -PI + 3e-6, PI / 4.0, TAU + 2e-5] {
            assert!(of_degrees("`yaw`", &[0.0, angle]).is_some(), "{angle}");
        }
        assert_eq!(of_degrees("`yaw`", &[0.0, 90.0, -1.5, 3.0, 0.8, 57.3, 45.0, -180.0]), None);
        let told = of_degrees("`yaw`", &["1.5708".parse().unwrap()]).unwrap();
        assert_eq!(told, "`yaw` is 1.5708°; radians? 1.5708 rad are 90.00°");
    }

    #[test]
    fn views_in_radians_and_ranges_in_kilometres_are_doubted() {
        assert!(of_lidar("a", &lidar([-25.0, 15.0], Some([-60.0, 60.0]), 100.0)).is_empty());
        for (lidar, word) in [
            (lidar([-25.0, 15.0], Some([-1.0, 1.0]), 100.0), "2.000° (`azimuth`)"),
            (lidar([-25.0, 15.0], None, 0.1), "a range of 0.1 m"),
        ] {
            assert_holds!(of_lidar("a", &lidar).join("; "), word);
        }
    }

    #[test]
    fn degrees_millimetres_and_places_beside_the_mount_are_doubted() {
        let box_of = |x: [f64; 2], count| {
            let level = |x, y, z| [x, y, z, 0.0, 0.0, 0.0];
            Constraints::in_box(level(x[0], -1.0, 1.5), level(x[1], 1.0, 2.5), count)
        };
        let mount = box_of([-1.0, 1.0], 2);
        let all = Doubts::of(&mount);
        let at = SensorPose::at;
        for pose in [at(1.001, -1.0, 2.5), SensorPose { yaw: -TAU, roll: 0.4, ..at(0.0, 0.0, 2.0) }]
        {
            assert_eq!(doubts(&all, pose), "");
        }
        let turned = "placement `roof`, LiDAR 1: yaw = 90 is more than a turn; angles are in radians, 90° are 1.5708";
        assert_eq!(doubts(&all, SensorPose { yaw: 90.0, ..at(0.0, 0.0, 2.0) }), turned);
        let far = "z = 2500 is far from any vehicle; positions are in metres, 2500 mm are 2.5";
        assert_ends!(doubts(&all, at(0.0, 0.0, 2500.0)), far);
        assert_ends!(doubts(&Doubts::of_units(), at(0.0, 0.0, 2500.0)), far);
        let outside = "LiDAR 1: it stands 0.500 m outside its mount; it is looked at there anyway";
        assert_ends!(doubts(&all, at(1.3, 0.0, 2.9)), outside);
        assert_eq!(doubts(&Doubts::of_units(), at(1.3, 0.0, 2.9)), "");
        // Three radians are sound on mounts that allow them, and doubted on one that looks ahead.
        let looks = |yaw: [f64; 2]| {
            let pose = |x, z, yaw| [x, -1.0, z, 0.0, 0.0, yaw];
            Doubts::of(&Constraints::in_box(pose(-1.0, 1.5, yaw[0]), pose(1.0, 2.5, yaw[1]), 2))
        };
        let back = SensorPose { yaw: 3.0, ..at(0.0, -1.0, 2.0) };
        for allowed in [[2.6, 3.7], [-3.2, 3.2]] {
            assert!(!doubts(&looks(allowed), back).contains("radians"), "{allowed:?}");
        }
        assert_holds!(doubts(&looks([-0.5, 0.5]), back), "yaw = 3 rad is 172°");
        // Degrees lie outside of any mount, and the phase is no matter of one.
        let turned = |yaw, phase| SensorPose { yaw, phase, ..at(0.0, -1.0, 2.0) };
        assert_holds!(doubts(&looks([-3.2, 3.2]), turned(15.0, None)), "15° are 0.2618");
        assert_holds!(doubts(&looks([-3.2, 3.2]), turned(0.0, Some(100.0))), "phase = 100");
        // A pose of a search on a mount whose pitch ends beyond a quarter turn by more than usual.
        let down = Doubts::of(&Constraints::in_box(
            [-1.0, -1.0, 1.5, 0.0, -0.1, 0.0],
            [1.0, 1.0, 2.5, 0.0, 1.75, 0.0],
            1,
        ));
        let pitched = |pitch| SensorPose { pitch, ..at(0.0, 0.0, 2.0) };
        assert!(!doubts(&down, pitched(1.74)).contains("1.74"), "{}", doubts(&down, pitched(1.74)));
        // A mount that holds none is named, in the doubt and in the broken rule alike.
        let rear = box_of([-3.0, -2.0], 1);
        let region = Region { name: "rear".into(), ..Region::clone(&rear.slots[0].region) };
        let mount = Constraints { closed: vec![Arc::new(region)], ..mount };
        let lidars = vec![at(0.5, 0.0, 2.0), at(-2.5, 0.0, 2.0)];
        let rig = Placement { name: "roof".into(), lidars };
        let none = "LiDAR 1: it stands on mount rear, which holds no LiDAR (`count` is 0)";
        let doubt = format!("placement `roof`, {none}; it is looked at there anyway");
        assert_eq!(Doubts::of(&mount).about(&rig), [doubt]);
        let broken: Vec<String> = mount.violations(&rig).iter().map(ToString::to_string).collect();
        assert_eq!(broken, [none]);
    }

    #[test]
    fn two_lidars_in_one_pose_are_doubted() {
        let units = Doubts::of_units();
        let twice = doubts(&units, SensorPose::at(0.5, 0.0, 2.0));
        assert!(twice.contains("LiDAR 1: stands exactly where LiDAR 0 does"), "{twice}");
        assert_eq!(doubts(&units, SensorPose { yaw: 0.1, ..SensorPose::at(0.5, 0.0, 2.0) }), "");
    }

    #[test]
    fn noise_in_millimetres_turns_a_minute_and_zenith_angles_are_doubted() {
        let told = |numbers| of_measures(|key| format!("response.{key}"), numbers).join("\n");
        assert_eq!(told([Some(0.02), Some(150.0), Some(20.0)]) + &told([None; 3]), "");
        assert_eq!(
            told([Some(20.0), Some(150_000.0), Some(600.0)]),
            "response.noise: 20 m; millimetres? 20 mm are 0.02 m\n\
             response.rated_range: 150000 m; millimetres? 150000 mm are 150 m\n\
             response.rate: 600 turns a second; a minute? 600 rpm are 10"
        );
        let told = of_lidar("a", &lidar([75.0, 88.0], None, 100.0)).join("; ");
        assert!(told.contains("75° from the zenith are 15°"), "{told}");
    }

    #[test]
    fn small_whole_angles_half_turns_and_the_ground_are_doubted() {
        let units = Doubts::of_units();
        let at = SensorPose::at(0.0, 0.0, 2.0);
        for (pose, words) in [
            (
                SensorPose { pitch: 5.0, ..at },
                "= 5 rad is 286°; angles are in radians, 5° are 0.0873",
            ),
            (
                SensorPose { phase: Some(100.0), ..at },
                "phase = 100 is more than a turn; angles are in radians, 100° are 1.7453",
            ),
            (SensorPose { roll: -3.5, ..at }, "roll = -3.5 is more than half a turn; angles are"),
            (
                SensorPose { z: -0.25, ..at },
                "z = -0.250 is below the ground; heights are counted from the ground below the vehicle",
            ),
        ] {
            assert_holds!(doubts(&units, pose), words);
        }
        let both = doubts(&units, SensorPose { x: 900.0, pitch: 15.0, ..at });
        assert_holds!(both, "15° are 0.2618", "900 mm are 0.9");
        for fine in [
            SensorPose { yaw: 3.5, ..at },
            SensorPose { phase: Some(3.5), ..at },
            SensorPose { roll: PI, pitch: 1.0, ..at },
            SensorPose { z: 0.0, ..at },
        ] {
            assert_eq!(doubts(&units, fine), "");
        }
    }
}
