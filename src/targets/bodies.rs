//! Surroundings of the targets of rules: the own bodies in every pose that they take, or each scene.

use std::sync::Arc;

use super::beams::TargetSite;
use crate::near_field::body_poses;
use crate::problem::Problem;
use crate::scene::Target;
use crate::score::WorstFrame;
use crate::vehicle::TargetRule;

/// A target at a position of one site.
pub(super) struct SitePlace {
    pub target: Arc<Target>,
    /// Metres in the ego frame.
    pub at: [f64; 3],
    /// Number of the site in [`BodyPoses`].
    pub site: usize,
}

/// A vehicle on level ground, with its own bodies in every pose that they take in the frames of some scenes, and in these
/// scenes.
#[derive(Debug, Clone)]
pub(crate) struct BodyPoses {
    /// Sensors and bodies; the first as in frame 0.
    pub(super) sites: Vec<TargetSite>,
    /// Site of each pose, and the number of the first frame in which the bodies stand so.
    poses: Vec<(usize, usize)>,
    /// Site of each scene and mirror image, and the number of its first frame; none where no rule stands there.
    scenes: Vec<(usize, usize)>,
}

impl BodyPoses {
    /// From the vehicle as in frame 0, and the problems of the scenes, each with `true` for a mirror image; one pose where
    /// its bodies do not move.
    pub(crate) fn of<'a>(
        at_first: TargetSite,
        problems: impl IntoIterator<Item = (&'a Problem, bool)>,
    ) -> Self {
        let problems: Vec<(&Problem, bool)> = problems.into_iter().collect();
        let (mut sites, mut poses) = (vec![at_first], Vec::new());
        for (bodies, frame) in problems.iter().flat_map(|(problem, _)| body_poses(problem)) {
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
        let mut scenes = Vec::new();
        for (problem, is_mirrored) in problems {
            let site = TargetSite::in_scene(problem, is_mirrored);
            let frame = problem.surface().map_or(0, |surface| surface.frame);
            scenes.extend(site.iter().map(|_| (sites.len(), frame)));
            sites.extend(site);
        }
        Self { sites, poses, scenes }
    }

    /// Some sites, each a pose.
    #[cfg(test)]
    pub(super) fn of_sites(
        sites: Vec<TargetSite>,
        frames: impl IntoIterator<Item = usize>,
    ) -> Self {
        Self { sites, poses: (0..).zip(frames).collect(), scenes: Vec::new() }
    }

    fn of_rule(&self, rule: &TargetRule) -> &[(usize, usize)] {
        if rule.on_scene { &self.scenes } else { &self.poses }
    }

    /// Number of each site in which a rule is looked at.
    pub(super) fn numbers(&self, rule: &TargetRule) -> impl Iterator<Item = usize> + '_ {
        self.of_rule(rule).iter().map(|(number, _)| *number)
    }

    /// Each site in which a rule is looked at, with the number of its first frame.
    pub(super) fn each(&self, rule: &TargetRule) -> impl Iterator<Item = (&TargetSite, usize)> {
        self.of_rule(rule).iter().map(|&(number, frame)| (&self.sites[number], frame))
    }
}

/// Share of a rule from its shares by site: the mean over scenes that have free ground at some of its places, or the least
/// over poses of the own bodies.
pub(super) fn together(rule: &TargetRule, shares: impl ExactSizeIterator<Item = f64>) -> f64 {
    if rule.on_scene { mean(shares) } else { shares.fold(1.0, f64::min) }
}

/// Frame of the least of shares by frame, of a rule whose sites are poses.
pub(super) fn worst_frame(
    rule: &TargetRule,
    shares: impl IntoIterator<Item = (usize, f64)>,
) -> Option<WorstFrame> {
    if rule.on_scene { None } else { WorstFrame::among(shares) }
}

/// Mean of some numbers; 0 of none.
pub(super) fn mean(numbers: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = numbers.len().max(1);
    numbers.sum::<f64>() / count as f64
}
