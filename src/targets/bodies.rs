//! Surroundings of the targets of rules: the own bodies in every pose that they take, on level ground or in each scene.

use std::ops::Range;
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

/// Site in which the own bodies stand in one of their poses.
#[derive(Debug, Clone, Copy)]
pub(super) struct SitePose {
    /// Number of the site in [`BodyPoses`].
    pub site: usize,
    /// Number of the first frame in which the bodies stand so.
    pub frame: usize,
    /// Number of the scene or mirror image; 0 on level ground, where poses of all scenes are looked at as one list.
    pub scene: usize,
}

/// Places of a rule on a target at one of its sites.
pub(super) struct RuleSite {
    pub places: Range<usize>,
    pub pose: SitePose,
}

/// A vehicle on level ground, and in the first frame of some scenes, with its own bodies in every pose that they take in the
/// frames of these scenes.
#[derive(Debug, Clone)]
pub(crate) struct BodyPoses {
    /// Sensors and bodies; the first as in frame 0.
    pub(super) sites: Vec<TargetSite>,
    /// On level ground.
    poses: Vec<SitePose>,
    /// In each scene and mirror image; none where no rule stands there.
    scenes: Vec<SitePose>,
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
            let Some(site) = sites[0].with_bodies_at(&bodies, frame) else { continue };
            let known = sites.iter().position(|known| known.stands_as(&site));
            let number = known.unwrap_or_else(|| {
                sites.push(site);
                sites.len() - 1
            });
            if !poses.iter().any(|known: &SitePose| known.site == number) {
                poses.push(SitePose { site: number, frame, scene: 0 });
            }
        }
        if poses.is_empty() {
            poses.push(SitePose { site: 0, frame: 0, scene: 0 });
        }
        let mut scenes = Vec::new();
        for (scene, (problem, is_mirrored)) in problems.into_iter().enumerate() {
            for (site, frame) in in_scene(problem, is_mirrored) {
                scenes.push(SitePose { site: sites.len(), frame, scene });
                sites.push(site);
            }
        }
        Self { sites, poses, scenes }
    }

    /// Some sites, each a pose.
    #[cfg(test)]
    pub(super) fn of_sites(
        sites: Vec<TargetSite>,
        frames: impl IntoIterator<Item = usize>,
    ) -> Self {
        let poses = frames.into_iter().enumerate();
        let poses = poses.map(|(site, frame)| SitePose { site, frame, scene: 0 }).collect();
        Self { sites, poses, scenes: Vec::new() }
    }

    /// Poses of the bodies in which a rule is looked at, scene after scene.
    pub(super) fn of_rule(&self, rule: &TargetRule) -> &[SitePose] {
        if rule.on_scene { &self.scenes } else { &self.poses }
    }

    /// Each site in which a rule is looked at, with the number of its scene.
    pub(super) fn each(&self, rule: &TargetRule) -> impl Iterator<Item = (&TargetSite, usize)> {
        self.of_rule(rule).iter().map(|pose| (&self.sites[pose.site], pose.scene))
    }
}

/// The surface of a scene with the own bodies in every pose that they take in its frames, each with the number of the first
/// such frame; none where no rule stands there.
fn in_scene(problem: &Problem, is_mirrored: bool) -> Vec<(TargetSite, usize)> {
    let Some(site) = TargetSite::in_scene(problem, is_mirrored) else { return Vec::new() };
    let poses = body_poses(problem).into_iter();
    let posed =
        poses.filter_map(|(bodies, frame)| Some((site.with_bodies_at(&bodies, frame)?, frame)));
    let posed: Vec<_> = posed.collect();
    match posed.is_empty() {
        true => vec![(site, problem.surface().map_or(0, |surface| surface.frame))],
        false => posed,
    }
}

/// Least of the shares of each scene over the poses of the own bodies there, from the shares with the numbers of their
/// scenes; level ground is one scene.
pub(super) fn by_scene(shares: impl IntoIterator<Item = (usize, f64)>) -> Vec<(usize, f64)> {
    let mut least: Vec<(usize, f64)> = Vec::new();
    for (scene, share) in shares {
        match least.last_mut().filter(|(last, _)| *last == scene) {
            Some((_, least)) => *least = least.min(share),
            None => least.push((scene, share.min(1.0))),
        }
    }
    least
}

/// Share of a rule from its shares by site, with the numbers of their scenes: the least over poses of the own bodies, and
/// the mean over scenes that have free ground at some of its places.
pub(super) fn together(shares: impl IntoIterator<Item = (usize, f64)>) -> f64 {
    mean(by_scene(shares).into_iter().map(|(_, share)| share))
}

/// Frame of the least share over poses of the own bodies, by sites with their shares; of scenes the one with the least share
/// in which the poses tell shares apart.
pub(super) fn worst_frame(sites: &[RuleSite], shares: &[f64]) -> Option<WorstFrame> {
    let scenes = sites.chunk_by(|a, b| a.pose.scene == b.pose.scene);
    let mut first = 0;
    let frames = scenes.filter_map(|of_scene| {
        let shares = &shares[first..first + of_scene.len()];
        first += of_scene.len();
        let frames = of_scene.iter().map(|site| site.pose.frame);
        WorstFrame::among(frames.zip(shares.iter().copied()))
    });
    frames.reduce(|least, of| if of.share < least.share { of } else { least })
}

/// Mean of some numbers; 0 of none.
pub(super) fn mean(numbers: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = numbers.len().max(1);
    numbers.sum::<f64>() / count as f64
}
