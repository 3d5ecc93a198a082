//! Rules of a vehicle on targets, near ground and overlap, and how far LiDARs meet them.

use std::ops::Range;

use super::beams::LookingOut;
use super::bodies::{RuleSite, by_scene, mean, together, worst_frame};
use super::missing::Missing;
use super::places::place_count;
use super::sight::{Sight, SightBeams};
use crate::near_field::RequiredGround;
use crate::overlap::{Shares, connected_without, cut_off, part_connected};
use crate::score::{Lost, RulePlaces, SEEN, SHARED, Seen, WorstFrame};
use crate::vehicle::{GroundRule, OverlapRule, SensorPose, TargetRule, UnknownSensor};

/// Extra share that a search wants beyond a rule, since other places lie between the tested ones.
const MARGIN: f64 = 0.01;
/// Weight of a missing part of that extra share, where a missing share of the rule weighs 1.
const MARGIN_WEIGHT: f64 = 1e-3;
/// Places beyond a rule on targets that a search wants where LiDARs may be mounted a little off.
const ROOM: f64 = 2.0;
/// Weight of a missing share of them: each place that is missing of 75 takes 0.4 % off the objective (docs/requirements.md).
const ROOM_WEIGHT: f64 = 3e-5;
/// Weight of single beams at places that are not met, where a met place weighs 1.
const PARTIAL: f64 = 0.1;

/// A rule of the vehicle.
pub(super) enum Rule {
    /// On a target, with its places beside the own bodies in each of their poses, in each scene that has some.
    Target(TargetRule, Vec<RuleSite>),
    /// On the ground, with its number among these.
    Ground(GroundRule, usize),
    /// On the overlap of LiDARs.
    Overlap(OverlapRule),
}

impl Rule {
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Target(rule, _) => &rule.name,
            Self::Ground(rule, _) => &rule.name,
            Self::Overlap(rule) => &rule.name,
        }
    }

    /// Share that is required.
    pub(super) fn least(&self) -> f64 {
        match self {
            Self::Target(rule, _) => rule.share,
            Self::Ground(rule, _) => rule.share,
            Self::Overlap(rule) => rule.share,
        }
    }

    /// The word for its share.
    fn done(&self) -> &'static str {
        match self {
            Self::Target(..) | Self::Ground(..) => SEEN,
            Self::Overlap(_) => SHARED,
        }
    }

    /// Places of a target at all of its sites.
    fn places(&self) -> Option<RulePlaces> {
        let Self::Target(_, sites) = self else { return None };
        self.places_at(sites)
    }

    /// Places of a target at some of its sites.
    pub(super) fn places_at(&self, sites: &[RuleSite]) -> Option<RulePlaces> {
        let Self::Target(rule, _) = self else { return None };
        let judged: usize = sites.iter().map(|site| site.places.len()).sum();
        let left_out = (sites.len() * place_count(rule)).saturating_sub(judged);
        Some(RulePlaces { judged, left_out, on_scene: rule.on_scene })
    }

    pub(super) fn without_any_one(&self) -> bool {
        match self {
            Self::Target(rule, _) => rule.without_any_one,
            Self::Ground(rule, _) => rule.without_any_one,
            Self::Overlap(rule) => rule.without_any_one,
        }
    }
}

/// LiDARs of a placement as rules look at them.
pub(super) struct Looked<'a> {
    pub(super) each: &'a [&'a SightBeams],
    /// Overlap of pairs in each scene; empty where no rule asks for it.
    overlaps: Vec<Shares>,
}

/// Share of the ground of a rule that is seen in a scene, with its bits; 0 where there is no such ground.
fn seen_in((scene, bits): (&RequiredGround, &[u64]), number: usize) -> f64 {
    scene.share(number, bits).share.unwrap_or(0.0)
}

/// Words on distances of a rule that lie beyond the range of every LiDAR; empty where none do, or where no LiDAR is left.
fn beyond(rule: &TargetRule, range_mm: u32) -> String {
    let range = f64::from(range_mm) / 1e3;
    match (rule.from > range, rule.within > range) {
        _ if range_mm == 0 => String::new(),
        (true, _) => format!("; the LiDARs reach {range} m at most: this lies beyond their range"),
        (_, true) => format!("; the LiDARs reach {range} m at most"),
        _ => String::new(),
    }
}

impl Sight {
    pub(super) fn looked<'a>(&self, each: &'a [&'a SightBeams]) -> Looked<'a> {
        Looked { each, overlaps: self.overlaps(each) }
    }

    /// Sum of the beams of all LiDARs but one.
    pub(super) fn sum_without(each: &[&SightBeams], lidar: Option<usize>) -> SightBeams {
        let mut sum = SightBeams::default();
        let kept = each.iter().enumerate().filter(|(k, _)| Some(*k) != lidar);
        kept.for_each(|(_, beams)| sum.add(beams));
        sum
    }

    /// Bits of each scene with its ground.
    pub(super) fn ground_of<'a>(
        &'a self,
        all: &'a SightBeams,
    ) -> impl Iterator<Item = (&'a RequiredGround, &'a [u64])> {
        let mut rest = &all.ground[..];
        self.ground.iter().map(move |scene| {
            let (bits, others) = rest.split_at(scene.words().min(rest.len()));
            rest = others;
            (scene, bits)
        })
    }

    /// Mean over scenes of a number of the ground.
    fn over_scenes(&self, all: &SightBeams, of: impl Fn(&RequiredGround, &[u64]) -> f64) -> f64 {
        let sum: f64 = self.ground_of(all).map(|(scene, bits)| of(scene, bits)).sum();
        sum / self.ground.len().max(1) as f64
    }

    /// Share of the ground of a rule, by its number among these, that is seen; scenes without such ground count as not seen.
    pub(super) fn ground_share(&self, all: &SightBeams, number: usize) -> f64 {
        self.over_scenes(all, |scene, bits| seen_in((scene, bits), number))
    }

    /// Scene in which least of the ground of a rule is seen, with its bits; of those in which bodies move alone where
    /// that is wanted.
    fn worst_ground<'a>(
        &'a self,
        all: &'a SightBeams,
        number: usize,
        moving: bool,
    ) -> Option<(&'a RequiredGround, &'a [u64])> {
        let share = |scene: &(&RequiredGround, &[u64])| seen_in(*scene, number);
        let scenes = self.ground_of(all).filter(|(scene, _)| !moving || scene.moves());
        scenes.min_by(|a, b| share(a).total_cmp(&share(b)))
    }

    /// Ground that a rule lacks in the scene in which least of it is seen, in words.
    pub(super) fn ground_missing(&self, all: &SightBeams, number: usize) -> Option<String> {
        self.worst_ground(all, number, false).map(|(scene, bits)| scene.missing(number, bits))
    }

    /// Share of places of a target that are met with the bodies in each of their poses, scene after scene.
    pub(super) fn by_site(&self, all: &SightBeams, sites: &[RuleSite]) -> Vec<f64> {
        sites.iter().map(|site| self.hard(all, site.places.clone())).collect()
    }

    /// Frame in which bodies that move leave least of a rule's target or ground without a LiDAR, in the scene with least of
    /// it where they move.
    fn worst_frame(
        &self,
        looked: &Looked<'_>,
        lost: Option<usize>,
        rule: &Rule,
    ) -> Option<WorstFrame> {
        let all = || Self::sum_without(looked.each, lost);
        match rule {
            Rule::Target(_, sites) if sites.len() > 1 => {
                worst_frame(sites, &self.by_site(&all(), sites))
            }
            Rule::Ground(_, number) if self.ground.iter().any(RequiredGround::moves) => {
                let all = all();
                let (scene, bits) = self.worst_ground(&all, *number, true)?;
                scene.worst_frame(*number, bits)
            }
            _ => None,
        }
    }

    /// Overlap of pairs of LiDARs in each scene; none where no rule asks for it.
    fn overlaps(&self, each: &[&SightBeams]) -> Vec<Shares> {
        let mut first = 0;
        let of_scene = self.overlap.iter().map(|scene| {
            let frames = first..first + scene.frame_count();
            first = frames.end;
            let each = each.iter().map(|beams| &beams.surfaces.frames[frames.clone()]);
            scene.shares(&each.collect::<Vec<_>>())
        });
        of_scene.collect()
    }

    /// Shares of a rule that are met: of a target in the worst pose of the bodies, on level ground or in each scene with a
    /// place for it, of the others in each scene. Scenes without the ground that it asks for count as not seen.
    pub(super) fn each_share(
        &self,
        looked: &Looked<'_>,
        lost: Option<usize>,
        rule: &Rule,
    ) -> Vec<f64> {
        let all = || Self::sum_without(looked.each, lost);
        match rule {
            Rule::Target(_, sites) => {
                let scenes = sites.iter().map(|site| site.pose.scene);
                let least = by_scene(scenes.zip(self.by_site(&all(), sites)));
                least.into_iter().map(|(_, share)| share).collect()
            }
            Rule::Ground(_, number) => {
                self.ground_of(&all()).map(|scene| seen_in(scene, *number)).collect()
            }
            Rule::Overlap(_) => {
                looked.overlaps.iter().map(|shares| connected_without(shares, lost)).collect()
            }
        }
    }

    /// Share of a rule that is met, from [`Self::each_share`].
    fn met_share(&self, looked: &Looked<'_>, lost: Option<usize>, rule: &Rule) -> f64 {
        mean(self.each_share(looked, lost, rule).into_iter())
    }

    /// Like [`Self::met_share`], rising with every beam or cell.
    fn soft_share(&self, all: &SightBeams, looked: &Looked<'_>, rule: &Rule) -> f64 {
        match rule {
            Rule::Overlap(rule) => {
                mean(looked.overlaps.iter().map(|shares| part_connected(shares, rule.share)))
            }
            Rule::Target(_, sites) => self.over_sites(sites, |places| self.soft(all, places)),
            Rule::Ground(_, number) => self.over_scenes(all, |s, bits| s.share(*number, bits).soft),
        }
    }

    /// Least share of a rule, and the LiDAR whose loss leaves it; all LiDARs where none is to be lost.
    fn least(&self, looked: &Looked<'_>, rule: &Rule) -> (f64, Option<usize>) {
        let share = |lost: Option<usize>| (self.met_share(looked, lost, rule), lost);
        let lost = (0..looked.each.len()).map(Some).filter(|_| rule.without_any_one());
        // The first of equal ones.
        let least = lost.map(share).reduce(|a, b| if b.0 < a.0 { b } else { a });
        least.unwrap_or_else(|| share(None))
    }

    /// True if there is one LiDAR alone, or the loss of some LiDAR leaves more than the least share of a rule.
    fn has_worst(&self, looked: &Looked<'_>, least: f64, rule: &Rule) -> bool {
        let count = looked.each.len();
        count == 1 || (0..count).any(|lost| self.met_share(looked, Some(lost), rule) > least)
    }

    /// True if a requirement needs this LiDAR: without it for good, the share is lower, and less than required; of one that
    /// must hold whichever one LiDAR is lost, the share after one more loss.
    pub fn needs(&self, each: &[&SightBeams], lidar: usize) -> bool {
        let left: Vec<&SightBeams> = [&each[..lidar], &each[lidar + 1..]].concat();
        let (all, left) = (self.looked(each), self.looked(&left));
        self.rules.iter().any(|rule| {
            let share = self.least(&left, rule).0;
            share < rule.least() && share < self.least(&all, rule).0
        })
    }

    /// The share of every rule that is `wanted`, whichever LiDAR is lost where it says so, for beams that were counted
    /// for these; 1 for the others.
    pub fn shares(&self, each: &[&SightBeams], wanted: &[bool]) -> Vec<f64> {
        let rules = || self.rules.iter().zip(wanted);
        let is_overlap =
            |(rule, is_wanted): (&Rule, &bool)| *is_wanted && matches!(rule, Rule::Overlap(_));
        let overlaps = if rules().any(is_overlap) { self.overlaps(each) } else { Vec::new() };
        let looked = Looked { each, overlaps };
        let share = |(rule, is_wanted): (&Rule, &bool)| {
            if *is_wanted { self.least(&looked, rule).0 } else { 1.0 }
        };
        rules().map(share).collect()
    }

    /// For each place of a target the LiDARs, those with most beams on it first, and of equal ones the first.
    pub(crate) fn most_beams_first(&self, each: &[&SightBeams]) -> Vec<Vec<usize>> {
        let of_place = |place: usize| {
            let beams = |lidar: &usize| each[*lidar].beams.get(place).copied().unwrap_or(0);
            let mut lidars: Vec<usize> = (0..each.len()).collect();
            lidars.sort_by_key(|lidar| std::cmp::Reverse(beams(lidar)));
            lidars
        };
        (0..self.enough.len()).map(of_place).collect()
    }

    /// The share of every rule on targets that is `wanted`, as [`Self::rules_met`] has it; 1 for the others. LiDARs are asked
    /// for beams in an `order` for each place, and only until it is known whether the target is met there.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(crate) fn shares_on_targets(
        &self,
        lidars: &[SensorPose],
        order: &[Vec<usize>],
        wanted: &[bool],
    ) -> Result<Vec<f64>, UnknownSensor> {
        let looking = self.looking_out_of(lidars)?;
        let share = |(rule, is_wanted): (&Rule, &bool)| match rule {
            Rule::Target(rule, sites) if *is_wanted => {
                let of_site = |site: &RuleSite| {
                    self.after_losses(&looking, rule, (site.places.clone(), order))
                };
                let each: Vec<Vec<f64>> = sites.iter().map(of_site).collect();
                let scenes = || sites.iter().map(|site| site.pose.scene);
                let after = |lost| together(scenes().zip(each.iter().map(|shares| shares[lost])));
                (0..each.first().map_or(0, Vec::len)).map(after).fold(1.0, f64::min)
            }
            _ => 1.0,
        };
        Ok(self.rules.iter().zip(wanted).map(share).collect())
    }

    /// Share of some places after the loss of each LiDAR, of a rule that must hold without any one; else of all LiDARs.
    fn after_losses(
        &self,
        looking: &[LookingOut<'_>],
        rule: &TargetRule,
        (places, order): (Range<usize>, &[Vec<usize>]),
    ) -> Vec<f64> {
        let count = places.len();
        let lidars = order.first().map_or(0, Vec::len);
        // Places not met by all LiDARs, or without each one.
        let mut missed = vec![0; if rule.without_any_one { lidars.max(1) } else { 1 }];
        'places: for place in places {
            let (standing, enough) = (self.standing(place), u32::from(self.enough[place]));
            let looking = &looking[self.places[place].site];
            let mut beams = vec![0; lidars];
            let (mut sum, mut most) = (0, 0);
            for &lidar in &order[place] {
                beams[lidar] = looking.beams(lidar, &standing, enough);
                (sum, most) = (sum + beams[lidar], beams[lidar].max(most));
                if sum - if rule.without_any_one { most } else { 0 } >= enough {
                    continue 'places;
                }
            }
            for (lost, missed) in missed.iter_mut().enumerate() {
                let lost = beams.get(lost).filter(|_| rule.without_any_one).unwrap_or(&0);
                *missed += usize::from(sum - lost < enough);
            }
        }
        let share = |missed| if count == 0 { 1.0 } else { (count - missed) as f64 / count as f64 };
        missed.into_iter().map(share).collect()
    }

    /// True for each rule that is on targets.
    pub(crate) fn on_targets(&self) -> Vec<bool> {
        self.rules.iter().map(|rule| matches!(rule, Rule::Target(..))).collect()
    }

    /// Every rule with its share, for the beams of each LiDAR; mounts have no names.
    ///
    /// The share of a target is the share of its places at which enough beams meet it, in the worst pose of the own bodies;
    /// on the surface of scenes a mean over these. Other rules: the share of the ground that is seen, or the largest overlap at which
    /// pairs connect all LiDARs, each a mean over scenes. For a rule that must hold without any one LiDAR it is the least
    /// share over the LiDARs left out.
    pub(crate) fn rules_met(&self, each: &[&SightBeams]) -> Vec<Seen> {
        let looked = self.looked(each);
        let mut all = Vec::new();
        for rule in &self.rules {
            let (share, worst) = self.least(&looked, rule);
            let least = rule.least();
            let missing =
                (share < least).then(|| self.missing_in_words(&looked, worst, rule)).flatten();
            let worst_frame = self.worst_frame(&looked, worst, rule);
            let lost = rule.without_any_one().then(|| {
                let intact = self.met_share(&looked, None, rule);
                let worst = worst.filter(|_| self.has_worst(&looked, share, rule));
                let intact_frame = self.worst_frame(&looked, None, rule);
                Lost { intact, worst, mount: None, intact_frame }
            });
            let (name, done, places) = (rule.name().to_owned(), rule.done(), rule.places());
            let known = Seen { lost, worst_frame, missing, ..Seen::default() };
            all.push(Seen { name, share, done, least, places, ..known });
        }
        all
    }

    /// Missing part of each rule without a LiDAR, in words by the name of the rule; rules that are met are left out. The
    /// other LiDARs keep their numbers.
    pub(crate) fn missing_without(
        &self,
        each: &[&SightBeams],
        lost: usize,
    ) -> Vec<(String, String)> {
        let looked = self.looked(each);
        let missing = |rule: &Rule| {
            let share = self.met_share(&looked, Some(lost), rule);
            let words =
                (share < rule.least()).then(|| self.missing_in_words(&looked, Some(lost), rule));
            Some((rule.name().to_owned(), words.flatten()?))
        };
        self.rules.iter().filter_map(missing).collect()
    }

    fn missing_in_words(
        &self,
        looked: &Looked<'_>,
        lost: Option<usize>,
        rule: &Rule,
    ) -> Option<String> {
        let each = self.each_share(looked, lost, rule);
        // The first of equal ones.
        let worst = (0..each.len()).min_by(|&a, &b| each[a].total_cmp(&each[b]))?;
        self.missing_in(looked, lost, (rule, worst))
    }

    /// Missing part of a rule at one of the shares that [`Self::each_share`] counts, in words: of a target in the first of the
    /// poses of the bodies that leave least.
    pub(super) fn missing_in(
        &self,
        looked: &Looked<'_>,
        lost: Option<usize>,
        (rule, at): (&Rule, usize),
    ) -> Option<String> {
        let all = || Self::sum_without(looked.each, lost);
        match rule {
            Rule::Overlap(rule) => Some(cut_off(&looked.overlaps[at], lost, rule.share)),
            Rule::Target(rule, sites) => {
                let all = all();
                let is_met = |place: usize| {
                    all.beams.get(place).is_some_and(|&beams| beams >= self.enough[place])
                };
                let site = self.worst_site(&all, sites, at)?;
                let places = site.places.clone();
                let places = places.map(|place| (self.places[place].at, is_met(place)));
                Missing::new(rule, places)
                    .map(|missing| format!("{missing}{}", beyond(rule, all.range_mm)))
            }
            Rule::Ground(_, number) => {
                let all = all();
                let (scene, bits) = self.ground_of(&all).nth(at)?;
                Some(scene.missing(*number, bits))
            }
        }
    }

    /// The first of the sites in one scene at which least of a target is met; scenes without a place for it are not counted.
    fn worst_site<'a>(
        &self,
        all: &SightBeams,
        sites: &'a [RuleSite],
        scene: usize,
    ) -> Option<&'a RuleSite> {
        let of_scene = sites.chunk_by(|a, b| a.pose.scene == b.pose.scene).nth(scene)?;
        let share = |site: &&RuleSite| self.hard(all, site.places.clone());
        of_scene.iter().min_by(|a, b| share(a).total_cmp(&share(b)))
    }

    /// True if there are rules.
    pub(crate) fn has_rules(&self) -> bool {
        !self.rules.is_empty()
    }

    /// Missing share of the rules, summed, for a search that goes step by step: each beam lowers it a little for a rule
    /// that is not met. `roomy` also wants a little more places of targets than the rules ask for.
    pub(crate) fn rules_missing(&self, each: &[&SightBeams], roomy: bool) -> f64 {
        let (all, looked) = (Self::sum_without(each, None), self.looked(each));
        let lacks = |rule: &Rule| {
            let least = rule.least();
            let wanted = if least > 0.0 { (least + MARGIN).min(1.0) } else { 0.0 };
            let (share, _) = self.least(&looked, rule);
            let room = match rule {
                Rule::Target(rule, poses) if roomy && rule.share > 0.0 => {
                    let places = poses.iter().map(|site| site.places.len()).max().unwrap_or(0);
                    (rule.share + ROOM / places.max(1) as f64).min(1.0)
                }
                _ => 0.0,
            };
            let extra = MARGIN_WEIGHT * (wanted - share).max(0.0);
            let extra = extra + ROOM_WEIGHT * (room - share).max(0.0);
            if share >= least {
                return extra;
            }
            extra + least - share + PARTIAL * (1.0 - self.soft_share(&all, &looked, rule))
        };
        self.rules.iter().map(lacks).sum()
    }
}
