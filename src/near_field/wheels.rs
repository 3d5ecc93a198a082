//! The plane of the ground under the wheels, from which ground around a vehicle is looked for on slopes.

use glam::DVec3;

use super::Footprint;
use crate::cast::closest_hit_in;
use crate::geom::Pose;
use crate::problem::Frame;

/// Metres above and below z = 0 of the ego frame in which ground under the wheels is looked for.
const REACH: f64 = 2.0;
/// Metres below a surface from which the next one is looked for.
const STEP: f64 = 1e-3;
/// Surfaces above each other that are looked at, at most.
const MOST_SURFACES: usize = 64;

/// Heights over the ego frame's plane z = 0 that grow evenly, metres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WheelPlane {
    /// Place in plan that `height` is of.
    middle: [f64; 2],
    height: f64,
    /// Metres up a metre along x and y.
    slope: [f64; 2],
}

impl WheelPlane {
    /// The plane through the ground under the four corners of the box around a footprint, by least squares; z = 0 where
    /// there is no ground within 2 m of it under one of them.
    pub fn of(footprint: &Footprint, frame: &Frame, is_ground: &[bool]) -> Self {
        let [low, high] = footprint.bounds();
        let under = |x: f64, y: f64| ground_under(frame, is_ground, [x, y]);
        let [Some(a), Some(b), Some(c), Some(d)] = [
            under(low[0], low[1]),
            under(high[0], low[1]),
            under(low[0], high[1]),
            under(high[0], high[1]),
        ] else {
            return Self::default();
        };
        let along =
            |ahead: f64, behind: f64, k: usize| (ahead - behind) / (2.0 * (high[k] - low[k]));
        Self {
            middle: footprint.middle(),
            height: (a + b + c + d) / 4.0,
            slope: [along(b + d, a + c, 0), along(c + d, a + b, 1)],
        }
    }

    /// Height at a place in plan.
    pub fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let [dx, dy] = [x - self.middle[0], y - self.middle[1]];
        self.height + self.slope[0] * dx + self.slope[1] * dy
    }
}

/// Height of the ground surface nearest to z = 0 straight above or below a place.
fn ground_under(frame: &Frame, is_ground: &[bool], [x, y]: [f64; 2]) -> Option<f64> {
    let mut from = REACH;
    let mut nearest: Option<f64> = None;
    for _ in 0..MOST_SURFACES {
        let pose = Pose { translation: DVec3::new(x, y, from), ..Pose::IDENTITY };
        let range = (from + REACH).max(STEP) as f32;
        let hit = closest_hit_in(frame, &pose, [0.0, 0.0, -1.0], range);
        if !hit.is_hit() {
            break;
        }
        let height = from - f64::from(hit.t);
        let is_ground = is_ground.get(hit.prim as usize) == Some(&true);
        if is_ground && nearest.is_none_or(|known| height.abs() < known.abs()) {
            nearest = Some(height);
        }
        from = height - STEP;
    }
    nearest
}
