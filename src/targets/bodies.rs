//! The own bodies in every pose that they take: rules on targets must be met in the worst of them.

use std::sync::Arc;

use super::beams::TargetSite;
use crate::near_field::body_poses;
use crate::problem::Problem;
use crate::scene::Target;

/// A target at a position, beside the bodies of one site.
pub(super) struct Place {
    pub target: Arc<Target>,
    /// Metres in the ego frame.
    pub at: [f64; 3],
    /// Number of the site among those of [`BodyPoses`].
    pub site: usize,
}

/// A vehicle on level ground, with its own bodies in every pose that they take in the frames of some scenes.
#[derive(Debug, Clone)]
pub(crate) struct BodyPoses {
    /// Sensors and bodies; the first as in frame 0.
    pub(super) sites: Vec<TargetSite>,
    /// Site of each pose, and the number of the first frame in which the bodies stand so.
    pub(super) poses: Vec<(usize, usize)>,
}

impl BodyPoses {
    /// From the vehicle as in frame 0, and the problems of the scenes; one pose where its bodies do not move.
    pub(crate) fn of<'a>(
        at_first: TargetSite,
        problems: impl IntoIterator<Item = &'a Problem>,
    ) -> Self {
        let (mut sites, mut poses) = (vec![at_first], Vec::new());
        for (bodies, frame) in problems.into_iter().flat_map(body_poses) {
            let Some(site) = sites[0].with_bodies_at(&bodies) else { continue };
            let known = sites.iter().position(|known| known.stands_as(&site));
            let number = known.unwrap_or_else(|| {
                sites.push(site);
                sites.len() - 1
            });
            if !poses.iter().any(|(known, _)| *known == number) {
                poses.push((number, frame));
            }
        }
        if poses.is_empty() {
            poses.push((0, 0));
        }
        Self { sites, poses }
    }

    /// Number of the site of each pose.
    pub(super) fn numbers(&self) -> impl Iterator<Item = usize> + '_ {
        self.poses.iter().map(|(number, _)| *number)
    }

    /// Each pose, with the number of its first frame.
    pub(super) fn each(&self) -> impl Iterator<Item = (&TargetSite, usize)> {
        self.poses.iter().map(|&(number, frame)| (&self.sites[number], frame))
    }
}
