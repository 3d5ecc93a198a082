//! Poles around the own vehicle where the rules on direct vision place theirs, and the beams on each.
//!
//! A pole is an upright cylinder of 0.8 m by 0.3 m on the level z = 0 of the ego frame. Distances count from
//! the box around the body's outline to the axis of the pole, to the front, to the rear and to the sides.
//!
//! | standard | axes of the poles | source |
//! |---|---|---|
//! | R158 detection | 0.2, 0.6, 1.0 m behind; five across the width | 0.2–1 m, 0.8 m by 0.3 m: UNECE press release |
//! | R158 camera | 0.3, 1.9, 3.5 m behind; three across the width | 0.3–3.5 m: the same |
//! | FMVSS 111 | 0.3 m behind, ±1.52 m; 3.05 m, ±1.52 m; 6.1 m, 0 and ±1.52 m | S14.1.4, from memory |
//! | R159 | 0.8, 2.25, 3.7 m ahead; three across the width | 0.8–3.7 m, from memory |
//! | R151 | 0.9, 2.5, 4.25 m beside, both sides; front, middle, rear | 0.9–4.25 m, from memory |

use glam::DVec3;
use serde::Serialize;

use super::Footprint;
use crate::cast::closest_hit_in;
use crate::geom::Pose;
use crate::problem::{Frame, SensorBatch};

/// Height of a pole in metres.
pub const POLE_HEIGHT: f64 = 0.8;
/// Radius of a pole in metres.
pub const POLE_RADIUS: f64 = 0.15;
/// Least beams on a pole that is seen.
pub const POLE_BEAMS: u32 = 5;

/// A rule that says where something must be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub enum Standard {
    /// UN R158, devices for reversing: zone of detection systems.
    #[serde(rename = "R158 detection")]
    R158Detection,
    /// UN R158, close-proximity rear view of cameras.
    #[serde(rename = "R158 camera")]
    R158Camera,
    /// FMVSS 111, rear visibility: test objects A to G.
    #[serde(rename = "FMVSS 111")]
    Fmvss111,
    /// UN R159, moving off: in front.
    #[serde(rename = "R159")]
    R159,
    /// UN R151, blind spot at the side.
    #[serde(rename = "R151")]
    R151,
}

impl Standard {
    /// Every standard and its name.
    pub const ALL: [(Self, &str); 5] = [
        (Self::R158Detection, "R158 detection"),
        (Self::R158Camera, "R158 camera"),
        (Self::Fmvss111, "FMVSS 111"),
        (Self::R159, "R159"),
        (Self::R151, "R151"),
    ];

    /// Axes of its poles around a footprint, metres in the ego frame.
    pub fn poles(self, footprint: &Footprint) -> Vec<[f64; 2]> {
        let ([low, high], [x, y]) = (footprint.bounds(), footprint.middle());
        let across = |count: usize| -> Vec<f64> {
            let step = (high[1] - low[1]) / (count - 1) as f64;
            (0..count).map(|k| low[1] + step * k as f64).collect()
        };
        let behind = |distances: &[f64], ys: &[f64]| grid(distances.iter().map(|d| low[0] - d), ys);
        match self {
            Self::R158Detection => behind(&[0.2, 0.6, 1.0], &across(5)),
            Self::R158Camera => behind(&[0.3, 1.9, 3.5], &across(3)),
            Self::Fmvss111 => {
                let sides = [y - 1.52, y + 1.52];
                let mut poles = behind(&[0.3, 3.05, 6.1], &sides);
                poles.push([low[0] - 6.1, y]);
                poles
            }
            Self::R159 => grid([0.8, 2.25, 3.7].map(|d| high[0] + d).into_iter(), &across(3)),
            Self::R151 => {
                let ys = [0.9, 2.5, 4.25].into_iter().flat_map(|d| [low[1] - d, high[1] + d]);
                grid([low[0], x, high[0]].into_iter(), &ys.collect::<Vec<_>>())
            }
        }
    }
}

fn grid(xs: impl Iterator<Item = f64>, ys: &[f64]) -> Vec<[f64; 2]> {
    xs.flat_map(|x| ys.iter().map(move |&y| [x, y])).collect()
}

/// A pole and the beams on it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pole {
    /// The rule that it is of.
    pub standard: Standard,
    /// Its axis in the ego frame, metres.
    pub at: [f64; 2],
    /// Beams on it, by LiDAR.
    pub beams: Vec<u32>,
    /// True if [`POLE_BEAMS`] or more of all LiDARs together are.
    pub seen: bool,
}

/// Every pole of every standard with the beams on it, each pole alone on level ground with the own body.
pub(super) fn count(
    footprint: &Footprint,
    batch: &SensorBatch<'_>,
    ego_from_sensors: &[Pose],
    body: &Frame,
) -> Vec<Pole> {
    let standing = |(standard, _): (Standard, _)| {
        standard.poles(footprint).into_iter().map(move |at| (standard, at))
    };
    let all = Standard::ALL.into_iter().flat_map(standing);
    let counted = all.map(|(standard, at)| {
        let beams = ego_from_sensors.iter().enumerate().map(|(k, pose)| {
            let (directions, range) = (batch.table(k).directions(), batch.range(k));
            let is_on = |direction: &&[f32; 3]| is_on(pose, **direction, range, at, body);
            directions.iter().filter(is_on).count() as u32
        });
        let beams: Vec<u32> = beams.collect();
        let seen = beams.iter().sum::<u32>() >= POLE_BEAMS;
        Pole { standard, at, beams, seen }
    });
    counted.collect()
}

/// True if a beam ends at a pole.
fn is_on(pose: &Pose, direction: [f32; 3], range: f32, at: [f64; 2], body: &Frame) -> bool {
    let along = pose.rotation * DVec3::from(direction.map(f64::from));
    distance(pose.translation, along, at).is_some_and(|t| {
        t <= f64::from(range) && !closest_hit_in(body, pose, direction, t as f32).is_hit()
    })
}

/// Metres along a beam to a pole; `None` where it passes, or begins inside.
pub(super) fn distance(from: DVec3, along: DVec3, [x, y]: [f64; 2]) -> Option<f64> {
    let (to, flat) = (from - DVec3::new(x, y, 0.0), along.truncate());
    let (a, b) = (flat.length_squared(), to.truncate().dot(flat));
    let c = to.truncate().length_squared() - POLE_RADIUS * POLE_RADIUS;
    let inside = b * b - a * c;
    if c <= 0.0 && (0.0..=POLE_HEIGHT).contains(&to.z) {
        return None;
    }
    let side = (a > 0.0 && inside >= 0.0).then(|| (-b - inside.sqrt()) / a);
    let height = |t: f64| to.z + t * along.z;
    let side = side.filter(|&t| t >= 0.0 && (0.0..=POLE_HEIGHT).contains(&height(t)));
    let top = (along.z < 0.0).then(|| (POLE_HEIGHT - to.z) / along.z);
    let is_on_top = |t: f64| (to + along * t).truncate().length() <= POLE_RADIUS;
    side.or(top.filter(|&t| t >= 0.0 && is_on_top(t)))
}
