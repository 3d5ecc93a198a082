//! Rules of a vehicle in each of several scenes.

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
                        let site = self.bodies.numbers(rule).nth(scene);
                        sites.iter().position(|of| Some(self.places[of.start].site) == site)
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
                    seen.places = rule.places_at(&sites[position..=position]);
                }
            }
        }
        by_scene
    }

    /// Frame in which bodies that move leave least of a rule's ground in one scene without a LiDAR; `None` of other rules.
    fn worst_frame_in(
        &self,
        looked: &Looked<'_>,
        lost: Option<usize>,
        (rule, scene): (&Rule, usize),
    ) -> Option<WorstFrame> {
        let Rule::Ground(_, number) = rule else { return None };
        let all = Self::sum_without(looked.each, lost);
        let (scene, bits) = self.ground_of(&all).nth(scene).filter(|(scene, _)| scene.moves())?;
        scene.worst_frame(*number, bits)
    }
}
