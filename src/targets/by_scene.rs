//! Rules of a vehicle in each of several scenes.

use super::bodies::worst_frame;
use super::rules::{Looked, Rule};
use super::sight::{Sight, SightBeams};
use crate::score::{Seen, WorstFrame};

impl Sight {
    /// Every rule as [`Self::rules_met`] has it, with the share of each scene in place of the mean: `[scenes][rules]`, by
    /// the same worst loss. Targets on level ground, and in a scene without a place for them, stay as they are.
    pub(crate) fn in_each_scene(
        &self,
        each: &[&SightBeams],
        met: &[Seen],
        scenes: usize,
    ) -> Vec<Vec<Seen>> {
        let (looked, mut by_scene) = (self.looked(each), vec![met.to_vec(); scenes]);
        for (number, (rule, met)) in self.rules.iter().zip(met).enumerate() {
            let worst = met.lost.as_ref().map(|lost| lost.worst.unwrap_or(0));
            let shares = self.each_share(&looked, worst, rule);
            let intact = self.each_share(&looked, None, rule);
            for (scene, of_scene) in by_scene.iter_mut().enumerate() {
                let position = match rule {
                    Rule::Target(rule, sites) if rule.on_scene => {
                        let mut of_scenes = sites.chunk_by(|a, b| a.pose.scene == b.pose.scene);
                        of_scenes.position(|sites| sites[0].pose.scene == scene)
                    }
                    Rule::Target(..) => None,
                    Rule::Ground(..) | Rule::Overlap(_) => Some(scene),
                };
                let Some(position) = position else { continue };
                let seen = &mut of_scene[number];
                let is_met = shares[position] >= seen.least;
                seen.share = shares[position];
                seen.missing =
                    if is_met { None } else { self.missing_in(&looked, worst, (rule, position)) };
                seen.worst_frame = self.worst_frame_in(&looked, worst, (rule, position));
                let intact_frame = self.worst_frame_in(&looked, None, (rule, position));
                if let Some(lost) = &mut seen.lost {
                    (lost.intact, lost.intact_frame) = (intact[position], intact_frame);
                }
                if let Rule::Target(_, sites) = rule {
                    let mut of_scenes = sites.chunk_by(|a, b| a.pose.scene == b.pose.scene);
                    let sites = of_scenes.nth(position);
                    seen.places = sites.and_then(|sites| rule.places_at(sites));
                }
            }
        }
        by_scene
    }

    /// Frame in which bodies that move leave least of a rule's ground, or of its target, in one scene without a LiDAR; `None`
    /// of other rules.
    fn worst_frame_in(
        &self,
        looked: &Looked<'_>,
        lost: Option<usize>,
        (rule, scene): (&Rule, usize),
    ) -> Option<WorstFrame> {
        let all = || Self::sum_without(looked.each, lost);
        match rule {
            Rule::Target(_, sites) => {
                let sites = sites.chunk_by(|a, b| a.pose.scene == b.pose.scene).nth(scene)?;
                worst_frame(sites, &self.by_site(&all(), sites))
            }
            Rule::Ground(_, number) => {
                let all = all();
                let mut scenes = self.ground_of(&all);
                let (scene, bits) = scenes.nth(scene).filter(|(scene, _)| scene.moves())?;
                scene.worst_frame(*number, bits)
            }
            Rule::Overlap(_) => None,
        }
    }
}
