//! The rays that a beam is made of: its middle, and a ring on its rim.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::fires::{Fires, Place};
use lidar_cast::cast::{self, Rays};
use lidar_cast::maths;
use sightline_scene::vehicle::SensorModel;

/// Rays that a beam is made of where its middle is not enough: the middle, and a ring of six on its rim.
pub(super) const RAYS: usize = 7;
/// Rays on the rim.
pub(super) const RING: usize = RAYS - 1;
/// Share of the beam's power in the middle; the ring has the rest.
const MIDDLE: f64 = 0.4;

/// Share of a beam's power that goes with one of its rays.
pub(super) fn ray_share(ray: usize) -> f64 {
    if ray == 0 { MIDDLE } else { (1.0 - MIDDLE) / RING as f64 }
}

/// Middle and rim of each beam of a sensor, in the order in which beams fire: lane 0 is the middle, the next six are
/// on the rim, all others repeat the middle.
pub(super) fn rays_of(model: &SensorModel, fires: &Fires) -> Vec<Rays> {
    let [across, along] = model.response.divergence.map(|width| width / 2.0);
    let ray = |k: usize| {
        // Round the ellipse of the half widths.
        let (sin, cos) = maths::sin_cos(TAU * (k as f64 + 1.5) / RING as f64);
        DVec3::new(1.0, maths::tan(cos * across), maths::tan(sin * along)).normalize()
    };
    let ring: [DVec3; RING] = std::array::from_fn(ray);
    let is_wide = across > 0.0 || along > 0.0;
    let rays = |place: Place| {
        let middle = model.table.directions()[place.beam];
        let mut rays = middle.map(|x| [x; cast::RAYS]);
        if is_wide {
            let turn = turn(middle);
            for (k, ray) in ring.iter().enumerate() {
                let ray = (turn * *ray).as_vec3().to_array();
                (0..3).for_each(|axis| rays[axis][k + 1] = ray[axis]);
            }
        }
        rays
    };
    let firings = (0..fires.firings()).into_par_iter();
    firings.flat_map_iter(|firing| fires.together(firing).map(rays)).collect()
}

/// The ray of a lane.
pub(super) fn lane(rays: &Rays, lane: usize) -> [f32; 3] {
    [rays[0][lane], rays[1][lane], rays[2][lane]]
}

/// The rays on the rim.
pub(super) fn ring(rays: &Rays) -> [[f32; 3]; RING] {
    std::array::from_fn(|k| lane(rays, k + 1))
}

/// Takes +x to a direction: Ry(−elevation), then Rz(azimuth).
fn turn(direction: [f32; 3]) -> DMat3 {
    let direction = DVec3::from(direction.map(f64::from));
    let (azimuth, across) = (maths::atan2(direction.y, direction.x), direction.truncate().length());
    DMat3::from_rotation_z(azimuth) * DMat3::from_rotation_y(-maths::atan2(direction.z, across))
}
