//! Volume that two bodies share, by places in them.

use glam::DVec3;
use lidar_cast::geom::Pose;

use super::{Solid, corners, inside};

/// Places along each axis of a box at which a body is looked at.
const PLACES: u32 = 6;
/// Triangles that all looks at places of one body may take.
const MOST_LOOKS: usize = 2_000_000;

/// A body with places spread evenly in it.
pub(in crate::scene) struct Filled {
    solid: Solid,
    ends: [DVec3; 2],
    places: Vec<DVec3>,
    /// Cubic metres, about.
    volume: f64,
}

impl Filled {
    /// `None` for a body without an inside, and for one of so many triangles that the look would take long.
    pub(in crate::scene) fn of(solid: &Solid) -> Option<Self> {
        let ends = corners(solid)?;
        let count = PLACES.pow(3);
        if solid.faces.len().saturating_mul(count as usize) > MOST_LOOKS {
            return None;
        }
        let size = ends[1] - ends[0];
        let step = |k: u32| (f64::from(k % PLACES) + 0.5) / f64::from(PLACES);
        let at = |k: u32| {
            ends[0] + size * DVec3::new(step(k), step(k / PLACES), step(k / PLACES / PLACES))
        };
        let places: Vec<DVec3> = (0..count).map(at).filter(|at| inside(solid, *at)).collect();
        let volume = size.element_product() * places.len() as f64 / f64::from(count);
        (volume > 0.0).then(|| Self { solid: solid.clone(), ends, places, volume })
    }

    fn holds(&self, at: DVec3) -> bool {
        let [low, high] = self.ends;
        at.cmpge(low).all() && at.cmple(high).all() && inside(&self.solid, at)
    }

    /// Share of the smaller volume that lies in both, with another body in a pose in the frame of this one.
    pub(in crate::scene) fn shared(&self, other: &Self, pose: &Pose) -> f64 {
        let back = pose.inverse();
        let (places, held) = if other.volume < self.volume {
            let held = other.places.iter().filter(|at| self.holds(pose.apply(**at))).count();
            (other.places.len(), held)
        } else {
            let held = self.places.iter().filter(|at| other.holds(back.apply(**at))).count();
            (self.places.len(), held)
        };
        held as f64 / places as f64
    }
}
