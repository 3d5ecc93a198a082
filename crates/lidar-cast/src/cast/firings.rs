//! Groups of rays that leave one place at one moment: the batches that a device casts for scans.

use super::bundle::Target;
use crate::bvh::{Hit, Ray};
use crate::task::{beam_direction, beam_origin};

/// Rays that leave one place at the same moment, and the trees as that place sees them.
pub struct Firing<'a> {
    /// Trees that the rays may meet.
    pub targets: Vec<Target<'a>>,
    /// Unit directions in the sensor's frame.
    pub rays: Vec<[f32; 3]>,
}

/// Casts firings.
pub trait FiringCaster: Send {
    /// Closest hit of every ray up to `range`, in order, with the bits of [`Firing::closest_hit`].
    ///
    /// # Errors
    /// What kept the device from it, as a sentence.
    fn closest_hits(&mut self, firings: &[Firing<'_>], range: f32) -> Result<Vec<Hit>, String>;
}

impl Firing<'_> {
    /// The closest hit of a ray of a direction, by the reference's way down each tree.
    ///
    /// CPU twin of `shaders/cast_closest.wgsl` where its sensors are firings.
    pub fn closest_hit(&self, direction: [f32; 3], range: f32) -> Hit {
        let mut hit = Hit::none(range);
        for target in &self.targets {
            let pose = target.standing.pose();
            let ray = Ray::new(beam_origin(pose), beam_direction(pose, direction), hit.t);
            target.tree.closer_hit(&ray, target.first_prim, &mut hit);
        }
        hit
    }
}
