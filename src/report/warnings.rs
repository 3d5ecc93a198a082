//! Warnings of a placement: kinds that it shares with another, and sectors, targets and ground that it does not see, in words.

use super::targets::bearing_in_words;
use crate::json::counted;
use crate::near_field::{NEAR, NearField};
use crate::score::Guard;
use crate::search::Scored;
use crate::targets::{RangeCard, TargetRanges};

/// A kind of warning.
pub(super) struct WarningKind {
    /// Words for one placement.
    pub one: &'static str,
    /// Words for several.
    pub many: &'static str,
    /// True if it is a reason not to believe a score.
    pub is_doubt: bool,
    /// True for a placement that has it.
    pub is: fn(&Scored) -> bool,
}

impl WarningKind {
    const fn new(words: [&'static str; 2], is_doubt: bool, is: fn(&Scored) -> bool) -> Self {
        let [one, many] = words;
        Self { one, many, is_doubt, is }
    }
}

/// All kinds, reasons not to believe a score first.
pub(super) static KINDS: [WarningKind; 7] = [
    WarningKind::new(["guard", "guards"], true, |of| of.scores.doubts() > 0),
    WarningKind::new(["broken rule", "broken rules"], true, |of| !of.violations.is_empty()),
    WarningKind::new(["requirement not met", "requirements that are not met"], false, |of| {
        of.scores.required.iter().any(|seen| !seen.is_met())
    }),
    WarningKind::new(["on paper only", "requirements that hold on paper only"], false, |of| {
        of.scores.holds_on_paper().is_some()
    }),
    WarningKind::new(
        ["requirement missed closer together", "requirements missed closer together"],
        false,
        |of| of.scores.missed_between().is_some(),
    ),
    WarningKind::new(["blind sector", "blind sectors"], false, |of| {
        of.scores.guards.iter().any(|guard| matches!(guard, Guard::BlindSector(_)))
    }),
    WarningKind::new(["LiDAR to leave out", "LiDARs that could be left out"], false, |of| {
        of.scores.guards.iter().any(|guard| guard.redundant_lidar().is_some())
    }),
];

/// Kinds of warnings of a rig, as `on paper only; blind sector, as here`: `as_here` stands behind one that another rig has,
/// too. Empty without a warning.
pub(super) fn kinds_beside(rig: &Scored, other: &Scored, as_here: &str) -> String {
    let own = KINDS.iter().filter(|kind| (kind.is)(rig));
    let words = own.map(|kind| match (kind.is)(other) {
        true => format!("{}, {as_here}", kind.one),
        false => kind.one.to_owned(),
    });
    words.collect::<Vec<_>>().join("; ")
}

/// Most words of a sentence; longer ones become a count and a list.
const MOST_WORDS: usize = 40;

/// Blind places as a sentence with a blank behind it, and as a list where the sentence would be long. Empty without any.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Blind {
    pub(super) sentence: String,
    /// A sentence a place.
    pub(super) list: Vec<String>,
}

impl Blind {
    /// `BLIND: behind …; left …. `, or `BLIND: 2 sectors, listed below. ` and the list.
    fn of(head: &str, thing: &str, places: Vec<String>) -> Self {
        let sentence = format!("{head}: {}. ", places.join("; "));
        match places.len() {
            0 => Self::default(),
            _ if sentence.split_whitespace().count() <= MOST_WORDS => {
                Self { sentence, list: Vec::new() }
            }
            count => Self {
                sentence: format!("{head}: {}, listed below. ", counted(count, thing)),
                list: places.iter().map(|place| format!("{head}: {place}.")).collect(),
            },
        }
    }
}

/// Sentence on sides of the vehicle without any ground that is seen, and on sides that lose it again in half of their lanes or
/// more; empty where there is none.
pub(super) fn unseen_in_words(near: &NearField) -> Blind {
    let (mut sides, mut lanes) = (Vec::new(), Vec::new());
    for (side, _) in near.zone.depths().into_iter().filter(|(_, depth)| depth.is_none()) {
        let of_side = near.zone.lanes.iter().filter(|lane| lane.side == side);
        let frame = near.zone.in_frame(side);
        let (blind, all) =
            (of_side.clone().filter(|lane| lane.depth.is_none()).count(), of_side.count());
        match blind == all {
            true => sides.push(format!("{side}{frame}")),
            false => lanes.push(format!("in {blind} of {all} lanes {side}{frame}")),
        }
    }
    let places = [sides.join(" and "), lanes.join(" and ")];
    let each = places.iter().filter(|places| !places.is_empty());
    let mut each: Vec<String> =
        each.map(|places| format!("no ground is seen within {NEAR} m {places}")).collect();
    let lost = near.zone.depths().into_iter().filter_map(|(side, _)| near.zone.lost_on(side));
    let lost = lost.filter(|lost| 2 * lost.lanes >= lost.of);
    each.extend(lost.map(|lost| format!("ground {} is {}", lost.side, lost.in_words())));
    Blind::of("BLIND ZONE", "place", each)
}

/// Sentence on sectors that a placement does not see; empty where it sees a car all round, or nobody looked.
pub(super) fn blind_in_words(placement: &Scored) -> Blind {
    let Some(card) = &placement.scores.range_card else { return Blind::default() };
    let mut blind =
        Blind::of("BLIND", "sector", card.blind.iter().map(ToString::to_string).collect());
    blind.sentence += &unmet_in_words(card);
    blind
}

/// Most bearings that are named one by one.
const FEW_BEARINGS: usize = 4;

/// Sentence on bearings at which a target is met at no distance; blind sectors tell of cars. Empty where there are none.
pub(super) fn unmet_in_words(card: &RangeCard) -> String {
    let of_target = |target: &TargetRanges| {
        let unmet = target.bearings.iter().filter(|of| of.met.is_empty());
        let names: Vec<String> = unmet.map(|of| bearing_in_words(of.bearing)).collect();
        let (name, all) = (&target.target, target.bearings.len());
        match names.len() {
            0 => None,
            count if count == all => Some(format!("{name} all round")),
            count if count > FEW_BEARINGS => Some(format!("{name} at {count} of {all} bearings")),
            _ => Some(format!("{name} ({})", names.join(", "))),
        }
    };
    let unmet: Vec<String> = card.targets.iter().skip(1).filter_map(of_target).collect();
    if unmet.is_empty() {
        return String::new();
    }
    format!("UNSEEN at every distance of the range card: {}. ", unmet.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_on_many_places_is_short_and_a_list_follows() {
        let places =
            |count: usize| vec!["ahead, at 5 to 50 m, by fewer than 5 beams".to_owned(); count];
        let few = Blind::of("BLIND", "sector", places(3));
        assert!(few.sentence.matches("ahead").count() == 3 && few.list.is_empty(), "{few:?}");
        let many = Blind::of("BLIND", "sector", places(4));
        assert_eq!(many.sentence, "BLIND: 4 sectors, listed below. ");
        assert_eq!(many.list, vec![format!("BLIND: {}.", places(1)[0]); 4]);
        assert_eq!(Blind::of("BLIND", "sector", Vec::new()), Blind::default());
    }
}
