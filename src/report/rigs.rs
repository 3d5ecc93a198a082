//! Rigs beside each other: price, range card and the better of several below their scores; two rigs compared.

use std::cmp::Ordering;

use super::columns::table_text;
use super::next_steps::NO_REQUIREMENT;
use super::svg::trimmed;
use super::tables::{header, titles};
use super::targets::runs_in_words;
use crate::csv::{csv, number};
use crate::json::{counted, fixed};
use crate::near_field::BlindDepths;
use crate::rig::{Asymmetry, Comparison, MovedLidar};
use crate::score::{Objective, Scores, Standing, percent_down};
use crate::targets::{RangeCard, stands_in_words};
use crate::vehicle::{Placement, Vehicle};

/// Price of the sensors of each placement, the range card in short and the blind zone, a line a placement; then the better of several
/// placements: rules first, then requirements, then the default objective. Empty where nothing is known.
pub(crate) fn rigs_text(vehicle: &Vehicle, placements: &[Placement], all: &[Scores]) -> String {
    let mut text = String::new();
    for (placement, scores) in placements.iter().zip(all) {
        let price = vehicle.price_of_rig(placement).map(|price| format!("price {price}"));
        let card = scores.range_card.as_ref().map(card_in_words);
        let zone = scores.blind_zone.as_ref().map(zone_in_words);
        let facts: Vec<String> = price.into_iter().chain(card).chain(zone).collect();
        if !facts.is_empty() {
            text += &format!("{}: {}\n", scores.name, facts.join("; "));
        }
    }
    text += &better_in_words(all).unwrap_or_default();
    let has_none = |of: &Scores| of.required.is_empty() && of.range_card.is_some();
    if !vehicle.is_nameless() && all.first().is_some_and(has_none) {
        text += &format!("{NO_REQUIREMENT} The page of `view` has three to copy.\n");
    }
    text
}

/// Depth of the blind zone on each side: `blind zone over 4 frames: ahead 2.1 m, …`.
fn zone_in_words(zone: &BlindDepths) -> String {
    let frames = counted(zone.frames() as usize, "frame");
    format!("blind zone over {frames}: {}", zone.in_words())
}

fn card_in_words(card: &RangeCard) -> String {
    let each = card.targets.iter().map(|of| match &of.in_all_directions()[..] {
        [] => format!("{} none", of.target),
        runs => format!("{} {} m", of.target, runs_in_words(runs)),
    });
    let each: Vec<String> = each.collect();
    format!(
        "distances from the origin met in all {} directions{}: {}",
        card.targets.first().map_or(0, |target| target.bearings.len()),
        stands_in_words(card.ground.as_ref(), card.bodies_move),
        each.join(", ")
    )
}

/// The better of several placements, and why; `None` of one.
fn better_in_words(all: &[Scores]) -> Option<String> {
    let objective = Objective::default();
    let standings: Vec<Standing> = all.iter().map(|one| Standing::of(one, &objective)).collect();
    let on_paper = |k: usize| all[k].holds_on_paper().is_some();
    let rules = |k: usize| all[k].broken_rules.len();
    let order = |a: usize, b: usize| {
        let rules = rules(a).cmp(&rules(b));
        let violation = standings[a].violation.total_cmp(&standings[b].violation);
        let paper = on_paper(a).cmp(&on_paper(b));
        rules.then(violation).then(paper).then_with(|| standings[a].compare(&standings[b]))
    };
    let best = (0..all.len()).min_by(|&a, &b| order(a, b)).filter(|_| all.len() > 1)?;
    let others = (0..all.len()).filter(|&k| k != best);
    let rival = others.min_by(|&a, &b| order(a, b))?;
    let word = if all.len() == 2 { "better" } else { "best" };
    let (name, next) = (&all[best].name, &all[rival].name);
    if order(best, rival) != Ordering::Less {
        return Some(format!("{word}: {name} and {next} are level\n"));
    }
    // Guards are compared where requirements are level.
    let by_guards = standings[best].violation == standings[rival].violation
        && standings[best].guards != standings[rival].guards;
    let facts = |k: usize| {
        let guards = by_guards.then_some(standings[k].guards);
        facts_in_words(&all[k], standings[k].violation, guards, &objective)
    };
    let by_copies = standings[best].violation == standings[rival].violation
        && on_paper(best) != on_paper(rival);
    let decided = match (rules(best) < rules(rival), by_copies) {
        (true, _) => decided_by_rules(&all[best], &all[rival]),
        (false, true) => decided_by_copies(&all[best], &all[rival]),
        (false, false) => decided_in_words(&all[best], &standings[best], &standings[rival]),
    };
    Some(format!("{word}: {name} ({}), before {next} ({}); {decided}\n", facts(best), facts(rival)))
}

fn decided_by_rules(ours: &Scores, theirs: &Scores) -> String {
    let [own, other] = [ours, theirs].map(|scores| scores.broken_rules.len());
    let also = if own > 0 { format!(" and {} {own}", ours.name) } else { String::new() };
    format!("decided by the rules of the mounts, of which {} breaks {other}{also}", theirs.name)
}

fn decided_by_copies(ours: &Scores, theirs: &Scores) -> String {
    let [own, other] = [ours, theirs].map(|scores| scores.requirements_hold_in.unwrap_or(1.0));
    format!(
        "decided by the copies within the mounting tolerance that meet all requirements: {} % against {} %",
        percent_down(own),
        percent_down(other)
    )
}

/// Rules that are broken, requirements met, per cent points missing of the others, violated guards where these decide, and
/// the objective of a rig.
fn facts_in_words(
    scores: &Scores,
    missing: f64,
    guards: Option<usize>,
    objective: &Objective,
) -> String {
    let (broken, [met, of]) = (scores.broken_rules.len(), scores.met());
    let value = objective.value(scores).map_or("–".to_owned(), |value| objective.spoken(value));
    let facts = [
        (broken > 0).then(|| counted(broken, "rule") + " broken"),
        (of > 0).then(|| format!("{met} of {of} requirements met")),
        (missing > 0.0).then(|| points(missing) + " missing"),
        guards.map(|count| counted(count, "guard") + " violated"),
        Some(format!("near_gain {value}")),
    ];
    facts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// A share in per cent points: `4.1 points`.
fn points(share: f64) -> String {
    format!("{} points", trimmed(100.0 * share, 2))
}

/// The first of the things that standings are compared by in which two rigs differ.
fn decided_in_words(scores: &Scores, ours: &Standing, theirs: &Standing) -> String {
    let by = if ours.violation < theirs.violation {
        let fewer = points(theirs.violation - ours.violation);
        format!("decided by the requirements, of which {fewer} fewer are missing")
    } else if ours.guards < theirs.guards {
        "decided by the violated guards, of which it has fewer".to_owned()
    } else if ours.value.zip(theirs.value).is_some_and(|(ours, theirs)| ours <= theirs) {
        "decided by the sectors in which a car is lost, which lower near_gain".to_owned()
    } else {
        "decided by near_gain".to_owned()
    };
    let copies = match scores.requirements_hold_in {
        Some(_) => "then whether copies mounted a little off meet them, ",
        None => "",
    };
    match scores.met() {
        [_, 0] => by,
        _ => format!(
            "{by}; requirements come first, {copies}then the number of violated guards, then near_gain"
        ),
    }
}

/// How far each LiDAR moved, whether its model is another, and how far each pair of either rig is from a mirror image.
pub(crate) fn comparison_text(found: &Comparison) -> String {
    let row = |name: String, values: [f64; 3]| {
        std::iter::once(name).chain(values.map(|value| fixed(value, 5))).collect()
    };
    let name = |lidar: &MovedLidar| match lidar.frame == lidar.partner {
        true => lidar.frame.clone(),
        false => format!("{}, now {}", lidar.frame, lidar.partner),
    };
    let moved = found.lidars.iter().map(|l| row(name(l), [l.moved, l.turned, l.tilted]));
    let mut text = alone_text(found);
    text += &table_text(&["LiDAR", "moved m", "turned rad", "axis rad"], moved);
    for lidar in &found.lidars {
        text += &models_text(&lidar.frame, &lidar.models, ["before", "after"]);
        if let Some(carriers) = lidar.rides_on {
            let [one, other] = carriers.map(|body| match body.as_str() {
                "" => "nothing".to_owned(),
                body => format!("`{body}`"),
            });
            text +=
                &format!("  ! {}: it rides on {one} before and on {other} after\n", lidar.frame);
        }
    }
    let (both, each) =
        (found.lidars.len(), [0, 1].map(|k| found.lidars.len() + found.alone[k].len()));
    let of = match each {
        [first, second] if first == second => counted(both, "LiDAR"),
        [first, second] => format!("the {both} with a partner; {first} and {second} LiDARs in all"),
    };
    text += &format!("different in pose or model: {} of {of}\n", found.different);
    if let Some([x, y, z]) = found.shift.map(|shift| shift.map(|metres| trimmed(metres, 4))) {
        text += &format!("all moved by ({x}, {y}, {z}) m: another base frame? give --base-link\n");
    }
    for (title, all) in [("before: pair", &found.before), ("after: pair", &found.after)] {
        let rows = all.iter().map(|pair| row(named(pair), [pair.moved, pair.turned, pair.tilted]));
        let titles = [title, "off mirror m", "turned rad", "axis rad"];
        text += &format!("\n{}", table_text(&titles, rows));
        for pair in all.iter().filter(|pair| pair.same_roll) {
            text += &format!(
                "  ! {}: both have the same roll; in a mirror image roll changes its sign\n",
                named(pair)
            );
        }
        for pair in all {
            text += &models_text(&named(pair), &pair.models, ["left", "right"]);
        }
    }
    text
}

/// First lines on rigs of different numbers of LiDARs; empty for rigs of the same number.
fn alone_text(found: &Comparison) -> String {
    let (rest, lacks) = match &found.alone {
        [first, second] if first.is_empty() => (second, "first"),
        [first, _] => (first, "second"),
    };
    if rest.is_empty() {
        return String::new();
    }
    let [first, second] = [0, 1].map(|k| found.lidars.len() + found.alone[k].len());
    format!(
        "The first rig has {}, the second {second}: compared by frame, then by least distance.\n\
         Without a partner in the {lacks} rig: {}.\n\n",
        counted(first, "LiDAR"),
        rest.join(", ")
    )
}

/// A row for each LiDAR with its move from one rig to the other, then for each LiDAR without a partner, then for each
/// pair of either rig with its distance from a mirror image.
///
/// Distances are metres, and radians between the rotations and between the sensors' own z axes.
pub(crate) fn comparison_csv(found: &Comparison) -> String {
    let mut rows =
        vec![header("part,lidar,other,moved_m,turned_rad,tilted_rad,same_roll,model,other_model")];
    let width = rows[0].len();
    let model = |name: &Option<String>| name.clone().unwrap_or_default();
    rows.extend(found.lidars.iter().map(|of| {
        let mut row = titles(&["moved", &of.frame, &of.partner]);
        row.extend([of.moved, of.turned, of.tilted].map(number));
        row.push(String::new());
        row.extend(of.models.iter().map(model));
        row
    }));
    for (part, alone) in ["alone_before", "alone_after"].into_iter().zip(&found.alone) {
        rows.extend(alone.iter().map(|frame| {
            let mut row = titles(&[part, frame]);
            row.resize(width, String::new());
            row
        }));
    }
    for (part, pairs) in [("before", &found.before), ("after", &found.after)] {
        rows.extend(pairs.iter().map(|pair| {
            let mut row = titles(&[part, &pair.left, &pair.right]);
            row.extend([pair.moved, pair.turned, pair.tilted].map(number));
            row.push(pair.same_roll.to_string());
            row.extend(pair.models.iter().map(model));
            row
        }));
    }
    csv(rows)
}

/// A line on two LiDARs of different models; empty where a model is not known.
fn models_text(name: &str, models: &[Option<String>; 2], [one, other]: [&str; 2]) -> String {
    match models {
        [Some(a), Some(b)] if a != b => {
            format!("  ! {name}: the model is {a} {one} and {b} {other}\n")
        }
        _ => String::new(),
    }
}

fn named(pair: &Asymmetry) -> String {
    if pair.left == pair.right {
        return format!("{} with itself", pair.left);
    }
    format!("{} with {}", pair.left, pair.right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::{Guard, Seen};
    use crate::targets::{BearingRanges, TargetRanges};

    fn rig(name: &str, shares: [f64; 2], guards: usize, near_gain: f64) -> Scores {
        let name = name.to_owned();
        // Both require 90 %.
        let required = shares.map(|share| Seen::of("area", share)).to_vec();
        let guards = vec![Guard::CoversNothing; guards];
        Scores { name, required, guards, near_gain: Some(near_gain), ..Scores::default() }
    }

    #[test]
    fn distances_are_those_at_which_every_bearing_meets_the_target() {
        let target = |name: &str, met: [&[[f64; 2]]; 2]| TargetRanges {
            target: name.to_owned(),
            size: [1.0; 3],
            bearings: met.map(|met| BearingRanges { bearing: 0.0, met: met.to_vec() }).to_vec(),
        };
        let targets = vec![
            target("car", [&[[2.5, 130.0]], &[[7.5, 110.0], [150.0, 150.0]]]),
            target("adult", [&[[2.5, 5.0]], &[[5.0, 60.0]]]),
            target("child", [&[[2.5, 5.0]], &[[7.5, 60.0]]]),
            target("pole", [&[[7.5, 7.5], [20.0, 90.0]], &[[10.0, 30.0], [40.0, 60.0]]]),
            target("tyre", [&[[2.5, 60.0]], &[]]),
        ];
        let card = RangeCard { targets, ..RangeCard::default() };
        let want = "distances from the origin met in all 2 directions: car 7.5–110 m, adult 5 m, child none, pole 20–30, 40–60 m, tyre none";
        assert_eq!(card_in_words(&card), want);
        let card = RangeCard { bodies_move: true, ..card };
        let first =
            "distances from the origin met in all 2 directions, own bodies as in frame 0: car";
        assert!(card_in_words(&card).starts_with(first), "{}", card_in_words(&card));
    }

    #[test]
    fn a_rig_that_keeps_the_rules_is_better_than_one_that_meets_more() {
        let breaking = |mut rig: Scores, rules: usize| {
            rig.broken_rules =
                vec!["LiDAR 2: z is 1.600 m outside the mount mast".to_owned(); rules];
            rig
        };
        let (high, low) = (rig("high", [0.9, 0.9], 0, 0.6), rig("low", [0.5, 0.9], 1, 0.5));
        let found = better_in_words(&[breaking(high.clone(), 1), low.clone()]).unwrap();
        assert!(found.starts_with("better: low (1 of 2 requirements met, "), "{found}");
        let end = "before high (1 rule broken, 2 of 2 requirements met, near_gain 60.00 %); decided by the rules of the \
                   mounts, of which high breaks 1\n";
        assert!(found.ends_with(end), "{found}");
        let found = better_in_words(&[breaking(high, 2), breaking(low, 1)]).unwrap();
        assert!(found.contains("low (1 rule broken, ") && found.contains("high (2 rules broken, "));
        assert!(found.ends_with("of which high breaks 2 and low 1\n"), "{found}");
    }

    #[test]
    fn the_better_of_two_rigs_says_what_decided() {
        let words = |a: Scores, b: Scores| better_in_words(&[a, b]).unwrap();
        // Equally many requirements met, less gain, and 1.5 points fewer missing.
        let found = words(rig("a", [0.5, 0.95], 0, 0.6), rig("b", [0.515, 0.95], 0, 0.5));
        let want = "better: b (1 of 2 requirements met, 38.5 points missing, near_gain 50.00 %), before a (1 of 2 \
                    requirements met, 40 points missing, near_gain 60.00 %); decided by the requirements, of which 1.5 points \
                    fewer are missing; requirements come first, then the number of violated guards, then near_gain\n";
        assert_eq!(found, want);
        let met = [0.9, 0.9];
        let says = |a: &Scores, b: Scores, parts: [&str; 2]| {
            let found = words(a.clone(), b);
            assert!(found.starts_with(parts[0]) && found.contains(parts[1]), "{found}");
            found
        };
        let guarded = rig("a", met, 1, 0.6);
        let start = "better: b (2 of 2 requirements met, 0 guards violated, near_gain 50.00 %)";
        let end = "1 guard violated, near_gain 60.00 %); decided by the violated";
        says(&guarded, rig("b", met, 0, 0.5), [start, end]);
        let parts = ["better: a ", "; decided by near_gain;"];
        let found = says(&guarded, rig("b", met, 1, 0.5), parts);
        assert!(!found.contains("1 guard"), "{found}");
        let held = |rig: Scores, share| Scores { requirements_hold_in: Some(share), ..rig };
        let (on_paper, firm) =
            (held(rig("a", met, 0, 0.6), 0.92), held(rig("b", met, 1, 0.5), 0.97));
        says(&on_paper, firm, ["better: b ", "meet all requirements: 97 % against 92 %"]);
        let blind = Scores { car_missing: Some(0.5), ..rig("a", met, 0, 0.6) };
        says(&blind, rig("b", met, 0, 0.5), ["better: b ", "decided by the sectors"]);
    }
}
