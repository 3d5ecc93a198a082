//! Requirements in a bound: sets of sensors that no further poses complete to a placement that meets them.

use rayon::prelude::*;

use super::open_sets::{Candidates, Node};
use crate::score::percent_up;
use crate::search::atlases::Atlases;
use crate::search::grid_search::Places;
use crate::targets::SightBeams;

/// Rounding error of a share, at most.
const SLACK: f64 = 1e-9;
/// Poses that one thread looks at at once.
const FEW_POSES: usize = 32;

/// A requirement with a bound on its share to which each sensor adds less the more there are.
struct Bounded {
    name: String,
    /// Share that is required.
    least: f64,
    number: Number,
}

/// Kind of a requirement, and its number among others of this kind.
#[derive(Clone, Copy)]
enum Number {
    Area(usize),
    /// On targets or ground.
    Rule(usize),
}

/// Requirements of a vehicle, and the shares of them that the held poses of an atlas meet.
///
/// The best additions to the share of a set, added to that share, are above every placement with the set in it, as they are
/// for a gain. Where they leave less than is required, no such placement meets the requirement. Blind zones have no such
/// bound: whole placements alone are held against them. Overlap is left out, since an atlas has a sample of it.
pub(super) struct BoundRequirements<'a> {
    atlas: &'a Atlases,
    bounded: Vec<Bounded>,
}

impl<'a> BoundRequirements<'a> {
    /// Requirements other than overlap; `None` without any.
    pub(crate) fn of(atlas: &'a Atlases) -> Option<Self> {
        let areas = atlas.areas().enumerate().map(|(area, required)| Bounded {
            name: required.name.clone(),
            least: required.share,
            number: Number::Area(area),
        });
        let rules = atlas.sight().into_iter().flat_map(|sight| sight.bounded_rules());
        let rules = rules.map(|(rule, name, least)| Bounded {
            name: name.to_owned(),
            least,
            number: Number::Rule(rule),
        });
        let is_any = atlas.has_areas() || atlas.sight().is_some_and(|s| s.has_rules_but_overlap());
        is_any.then(|| Self { atlas, bounded: areas.chain(rules).collect() })
    }

    pub(crate) fn words(&self) -> &'static str {
        match self.atlas.sight().is_some_and(|sight| sight.requires_overlap()) {
            true => "the requirements but those on overlap",
            false => "the requirements",
        }
    }

    /// True if a placement of held poses meets all requirements but those on overlap.
    pub(crate) fn meets(&self, poses: &[u32]) -> bool {
        let shares = self.atlas.area_shares(poses);
        let mut areas = self.atlas.areas().zip(shares);
        let each: Vec<&SightBeams> =
            poses.iter().filter_map(|&pose| self.atlas.beams_of(pose)).collect();
        areas.all(|(required, share)| share + SLACK >= required.share)
            && self.atlas.sight().is_none_or(|sight| sight.is_met_but_overlap(&each, SLACK))
    }

    /// Drops candidates that stand in no extension of a set that meets the requirements. False if no extension does.
    pub(crate) fn cut(&self, node: &mut Node) -> bool {
        self.cut_by(&self.bounded.iter().collect::<Vec<_>>(), node)
    }

    /// Requirements that no placement on the grid meets, in words; `None` where none is known.
    pub(crate) fn out_of_reach(&self, places: &Places) -> Option<String> {
        let poses = |kind: usize| {
            let all = 0..self.atlas.grid().len();
            all.filter(move |&pose| places.kind(pose) == kind && places.fits(pose, &[]))
        };
        let kinds = places.lidars_by_kind.iter().enumerate();
        let kinds: Vec<([usize; 2], Vec<u32>)> =
            kinds.map(|(kind, &lidars)| ([lidars; 2], poses(kind).collect())).collect();
        let unseen = self.atlas.out_of_reach(&kinds);
        if !unseen.is_empty() {
            let words: Vec<String> = unseen.into_iter().map(|of| of.words).collect();
            return Some(words.join("; "));
        }
        let too_few = self.bounded.iter().find(|rule| {
            let kinds = kinds.iter().map(|(left, poses)| Candidates {
                left: left[1],
                poses: poses.iter().map(|&pose| (pose, 0.0)).collect(),
            });
            !self.cut_by(&[rule], &mut Node::root(vec![], 0.0, kinds.collect()))
        });
        too_few.map(|rule| {
            let least = percent_up(rule.least);
            let name = &rule.name;
            format!(
                "{name}: shares of the best poses add up to less than the {least:.1} % required"
            )
        })
    }

    fn cut_by(&self, rules: &[&Bounded], node: &mut Node) -> bool {
        let mut chosen = SightBeams::default();
        let beams = node.chosen.iter().filter_map(|&pose| self.atlas.beams_of(pose));
        beams.for_each(|beams| chosen.add(beams));
        let shares = self.shares(rules, &node.chosen, &chosen);
        let unmet = rules.iter().zip(shares).filter(|(rule, share)| *share < rule.least);
        let (unmet, shares): (Vec<&Bounded>, Vec<f64>) = unmet.map(|(rule, s)| (*rule, s)).unzip();
        if unmet.is_empty() {
            return true;
        }
        let with = |&(pose, _): &(u32, f64)| {
            let mut all = chosen.clone();
            if let Some(beams) = self.atlas.beams_of(pose) {
                all.add(beams);
            }
            let poses = [&node.chosen[..], &[pose]].concat();
            (pose, self.shares(&unmet, &poses, &all))
        };
        let kinds = node.kinds.iter();
        let kinds = kinds.map(|kind| kind.poses.par_iter().with_min_len(FEW_POSES).map(&with));
        let mut kinds: Vec<Vec<(u32, Vec<f64>)>> = kinds.map(|kind| kind.collect()).collect();
        for (k, (rule, share)) in unmet.iter().zip(shares).enumerate() {
            let by_share = node.kinds.iter().zip(&kinds).map(|(kind, poses)| Candidates {
                left: kind.left,
                poses: poses.iter().map(|(pose, with)| (*pose, with[k] - share)).collect(),
            });
            let mut by_share = Node::root(vec![], share, by_share.collect());
            if !by_share.cut(rule.least - SLACK) {
                return false;
            }
            for (poses, kept) in kinds.iter_mut().zip(&by_share.kinds) {
                keep(poses, kept.poses.iter().map(|c| c.0), |c| c.0);
            }
        }
        for (kind, kept) in node.kinds.iter_mut().zip(&kinds) {
            keep(&mut kind.poses, kept.iter().map(|c| c.0), |c| c.0);
        }
        true
    }

    /// Bounds on the shares of requirements for some poses and the sum of their beams.
    fn shares(&self, rules: &[&Bounded], poses: &[u32], all: &SightBeams) -> Vec<f64> {
        let has_area = rules.iter().any(|rule| matches!(rule.number, Number::Area(_)));
        let areas = if has_area { self.atlas.area_shares(poses) } else { Vec::new() };
        let sight = self.atlas.sight();
        let share = |rule: &&Bounded| match rule.number {
            Number::Area(area) => areas[area],
            Number::Rule(rule) => sight.map_or(1.0, |sight| sight.share_at_most(rule, all)),
        };
        rules.iter().map(share).collect()
    }
}

/// Keeps the candidates of some poses, which stand in the order of the candidates.
fn keep<T>(candidates: &mut Vec<T>, poses: impl Iterator<Item = u32>, pose: impl Fn(&T) -> u32) {
    let mut poses = poses.peekable();
    candidates.retain(|candidate| poses.next_if_eq(&pose(candidate)).is_some());
}
