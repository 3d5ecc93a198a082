//! Rules of a vehicle as the bound of a search asks for them: upper bounds on their shares.

use std::ops::Range;

use super::bodies::{RuleSite, mean};
use super::rules::Rule;
use super::sight::{Sight, SightBeams};
use crate::vehicle::GroundAsked;

impl Sight {
    /// Number, name and least share of each rule that [`Self::share_at_most`] bounds: on targets, and on ground within a
    /// distance. Lanes of a blind zone end where several cells are seen, so that a LiDAR may add more to it beside others.
    pub(crate) fn bounded_rules(&self) -> impl Iterator<Item = (usize, &str, f64)> {
        let rules = self.rules.iter().enumerate().filter(|(_, rule)| match rule {
            Rule::Target(_, sites) => sites.iter().any(|site| !site.places.is_empty()),
            Rule::Ground(rule, _) => matches!(rule.asked, GroundAsked::Within(_)),
            Rule::Overlap(_) => false,
        });
        rules.map(|(number, rule)| (number, rule.name(), rule.least()))
    }

    /// Upper bound on the share of a rule among [`Self::bounded_rules`], by the sum of the beams of all LiDARs. Each LiDAR
    /// adds less to it the more there are.
    ///
    /// # Panics
    /// There is no such rule.
    pub(crate) fn share_at_most(&self, rule: usize, all: &SightBeams) -> f64 {
        match &self.rules[rule] {
            // A loss leaves less than all see.
            // The mean over poses of the bodies is not below the worst of them.
            Rule::Target(_, sites) => {
                self.over_sites(
                    sites,
                    |places| {
                        if places.is_empty() { 1.0 } else { self.soft(all, places) }
                    },
                )
            }
            Rule::Ground(_, number) => self.ground_share(all, *number),
            Rule::Overlap(_) => 1.0,
        }
    }

    /// Mean over scenes of the mean over poses of the bodies, of a number of the places of a rule on a target.
    pub(super) fn over_sites(&self, sites: &[RuleSite], of: impl Fn(Range<usize>) -> f64) -> f64 {
        let scenes: Vec<_> = sites.chunk_by(|a, b| a.pose.scene == b.pose.scene).collect();
        let of = |site: &RuleSite| of(site.places.clone());
        mean(scenes.into_iter().map(|sites| mean(sites.iter().map(&of))))
    }

    /// True if there are rules other than those on overlap.
    pub(crate) fn has_rules_but_overlap(&self) -> bool {
        self.rules.iter().any(|rule| !matches!(rule, Rule::Overlap(_)))
    }

    /// True if there are rules on overlap.
    pub(crate) fn requires_overlap(&self) -> bool {
        self.rules.iter().any(|rule| matches!(rule, Rule::Overlap(_)))
    }

    /// True if all rules other than those on overlap are met up to a rounding error, by the beams of each LiDAR.
    pub(crate) fn is_met_but_overlap(&self, each: &[&SightBeams], rounding: f64) -> bool {
        let is_wanted = |rule: &Rule| !matches!(rule, Rule::Overlap(_));
        let wanted: Vec<bool> = self.rules.iter().map(is_wanted).collect();
        let shares = self.shares(each, &wanted).into_iter().zip(&self.rules);
        shares
            .zip(wanted)
            .all(|((share, rule), wanted)| !wanted || share + rounding >= rule.least())
    }
}
