//! Tests of `words`.

use serde_json::json;

use super::*;
use crate::near_field::{BlindLane, BlindZone, LostGround, NearField};
use crate::report::warnings::unmet_in_words;
use crate::score::{Guard, Scores, Seen, TaskScores};
use crate::search::bound::bound_of;
use crate::targets::{BearingRanges, BlindSector, RangeCard, TargetRanges};
use crate::vehicle::{Placement, SensorName, SensorPose};

/// The verdict on a result that has no price and no near field.
fn verdict(best: Option<&Scored>, baselines: &[Scored], objective: &str) -> String {
    verdict_at(&OfRun::default(), best, baselines, objective)
}

/// A planted placement: name, M-SOG/N, nats gained of 1000.
pub(in crate::report) fn planted(name: &str, m_sog_scaled: f64, gain: f64) -> Scored {
    let segmentation = TaskScores {
        m_sog_scaled: Some(m_sog_scaled),
        information_gain: Some(gain),
        information_gain_share: Some(gain / 1000.0),
        ..TaskScores::default()
    };
    let scores = Scores {
        name: name.to_owned(),
        segmentation,
        entropy_sum: Some(gain),
        covered: 1.0,
        covered_nonzero: 1.0,
        beams: 1,
        unique_share: vec![1.0],
        ..Scores::default()
    };
    let placement = Placement { name: name.to_owned(), lidars: Vec::new() };
    let (objective, by_scene) = (Some(m_sog_scaled), Vec::new());
    Scored { placement, scores, by_scene, objective, violations: Vec::new(), price: None }
}

fn first_sentence(best: &Scored, baselines: &[Scored], objective: &str) -> String {
    let words = verdict(Some(best), baselines, objective);
    words.split_once(". ").map_or(words.clone(), |(first, _)| first.to_owned())
}

/// Objective up, down or equal × gain up, down or equal, against one baseline.
#[test]
fn the_first_sentence_compares_by_objective_and_by_gain() {
    let centre = planted("Center", -2.0, 500.0);
    for (m_sog, gain, [than, gains]) in [
        (-1.5, 550.0, ["25.0 % better than", "and it gains 10.0 % more information than"]),
        (-1.5, 450.0, ["25.0 % better than", "but it gains 10.0 % less information than"]),
        (-1.5, 500.0, ["25.0 % better than", "but it gains as much information as"]),
        (-3.0, 550.0, ["50.0 % worse than", "but it gains 10.0 % more information than"]),
        (-3.0, 450.0, ["50.0 % worse than", "and it gains 10.0 % less information than"]),
        (-2.0, 450.0, ["as good as", "but it gains 10.0 % less information than"]),
        (
            -1.9999,
            500.1,
            ["less than 0.1 % better than", "and it gains less than 0.1 % more information than"],
        ),
    ] {
        let found = planted("found", m_sog, gain);
        let first = first_sentence(&found, std::slice::from_ref(&centre), "m_sog_scaled");
        let start =
            format!("The placement found is {than} Center, the only baseline, by m_sog_scaled");
        assert_eq!(first, format!("{start}, {gains} that one"));
    }
}

#[test]
fn a_result_that_gains_less_than_any_honest_baseline_says_so() {
    let baselines = [planted("Center", -2.0, 400.0), planted("Pyramid", -3.0, 600.0)];
    // More than the best baseline by the objective, less than another one.
    let first = first_sentence(&planted("found", -1.0, 500.0), &baselines, "m_sog_scaled");
    let words = "but it gains 16.7 % less information than Pyramid, the baseline that gains most";
    assert!(first.ends_with(words), "{first}");
}

#[test]
fn plain_alone_is_told_by_its_meaning() {
    let plain = [planted("plain", -2.0, 500.0), planted("other", -3.0, 400.0)];
    let found = planted("found", -1.5, 550.0);
    let start = "The placement found is 25.0 % better than";
    let first = first_sentence(&found, &plain[..1], "m_sog_scaled");
    let alone = "`plain`, the same sensors placed without a search, by m_sog_scaled";
    assert!(first.starts_with(&format!("{start} {alone}")), "{first}");
    let first = first_sentence(&found, &plain, "m_sog_scaled");
    assert!(first.starts_with(&format!("{start} plain, the best baseline, by")), "{first}");
}

#[test]
fn a_single_scene_calls_a_loss_no_gain_and_names_the_penalty() {
    let words = |best: &Scored, objective: &str| {
        single_scene_in_words(best, &planted("plain", -2.0, 500.0), objective)
    };
    let none = "One scene only: give several to see whether";
    let gain = words(&planted("found", -1.5, 500.0), "near_gain");
    assert!(gain.starts_with(&format!("{none} the lead over plain holds")), "{gain}");
    let equal = words(&planted("found", -2.0, 500.0), "near_gain");
    assert!(equal.starts_with(&format!("{none} the tie with plain holds")), "{equal}");
    let mut worse = planted("found", -2.5, 500.0);
    let told = words(&worse, "near_gain");
    assert!(
        told.starts_with(&format!("By near_gain the result is below plain. {none} the ")),
        "{told}"
    );
    let targets = Vec::new();
    worse.scores.range_card = Some(RangeCard { targets, ..RangeCard::default() });
    let told = words(&worse, "near_gain");
    let penalty =
        "below plain, but a search ranks by near_gain less a penalty: the share of places";
    assert!(told.contains(penalty), "{told}");
    let told = words(&worse, "m_sog_scaled");
    assert!(told.starts_with("By m_sog_scaled the result is below plain. "), "{told}");
}

#[test]
fn a_baseline_of_other_sensors_has_their_number_and_price_beside_it() {
    let with = |mut scored: Scored, lidars: usize, price: Option<f64>| {
        scored.placement.lidars = vec![SensorPose::default(); lidars];
        scored.price = price;
        scored
    };
    let found = |price| with(planted("found", -1.5, 550.0), 3, price);
    let centre = |lidars, price| with(planted("Center", -2.0, 500.0), lidars, price);
    for (best, rival, beside) in [
        (found(None), centre(3, None), ""),
        (found(Some(900.0)), centre(3, Some(900.0)), ""),
        (found(None), centre(1, None), " (1 LiDAR; here 3 LiDARs)"),
        (
            found(Some(900.0)),
            centre(4, Some(1200.5)),
            " (4 LiDARs at a price of 1200.5; here 3 LiDARs at a price of 900)",
        ),
    ] {
        let first = first_sentence(&best, std::slice::from_ref(&rival), "m_sog_scaled");
        let words = format!("better than Center, the only baseline{beside}, by m_sog_scaled");
        assert!(first.contains(&words), "{first}");
        let words = single_scene_in_words(&best, &rival, "m_sog_scaled");
        assert!(words.contains(&format!("the lead over Center{beside} holds")), "{words}");
    }
}

#[test]
fn baselines_with_a_guard_or_a_broken_rule_are_no_yardstick() {
    let mut gamed = planted("sky", -0.1, 900.0);
    gamed.scores.guards = vec![Guard::CoversNothing];
    let mut broken = planted("roof rack", -0.1, 900.0);
    broken.violations = vec!["too near".to_owned()];
    let baselines = [gamed.clone(), broken.clone(), planted("Center", -2.0, 500.0)];
    let found = planted("found", -1.5, 550.0);
    let words = verdict(Some(&found), &baselines, "m_sog_scaled");
    let start =
        "The placement found is 25.0 % better than Center, the best baseline without a warning";
    assert!(words.starts_with(start) && words.contains("10.0 % more information"), "{words}");
    let alone = verdict(Some(&found), &[gamed, broken], "m_sog_scaled");
    let why =
        "no baseline keeps every rule and requirement without a warning (sky: covers_nothing: ";
    assert!(alone.contains(why), "{alone}");
    assert!(!alone.contains("differences from baselines"), "{alone}");
    assert_eq!(broken_in_words(&baselines), ["roof rack: too near"]);
    let mut on_paper = planted("Center", -2.0, 500.0);
    on_paper.scores.required = vec![Seen::of("child", 1.0)];
    on_paper.scores.requirements_hold_in = Some(0.9);
    let words = verdict(Some(&found), &[on_paper], "m_sog_scaled");
    assert!(words.contains(" than Center, the only baseline (on paper only), by "), "{words}");
}

#[test]
fn the_gain_as_objective_is_said_once_and_guards_are_named() {
    let mut found = planted("found", 550.0, 550.0);
    let centre = [planted("Center", 500.0, 500.0)];
    let words = verdict(Some(&found), &centre, "information_gain");
    assert_eq!(
        words,
        "The placement found is 10.0 % better than Center, the only baseline, by \
         information_gain. Its beams gain 55.0 % of the information that the scene holds. No warning: \
         all checks passed."
    );
    found.scores.guards = vec![Guard::CoversNothing];
    let words = verdict(Some(&found), &centre, "information_gain");
    assert!(words.contains("Warning: covers_nothing"), "{words}");
    assert!(verdict(None, &centre, "information_gain").starts_with("No candidate"));
}

#[test]
fn nothing_to_gain_is_compared_without_shares() {
    let none = [planted("Center", 0.0, 0.0)];
    let first = first_sentence(&planted("found", 0.0, 0.0), &none, "m_sog_scaled");
    assert!(first.starts_with("The placement found is as good as Center"), "{first}");
    assert!(first.ends_with("gains as much information as that one"), "{first}");
    let first = first_sentence(&planted("found", 1.0, 1.0), &none, "m_sog_scaled");
    assert!(first.starts_with("The placement found is better than Center"), "{first}");
}

#[test]
fn sides_on_which_no_ground_is_seen_are_said_before_scores() {
    let left = Some(2.0);
    let lane =
        |side, depth| BlindLane { side, along: [0.0, 0.25], depth, own_body: 0.0, lost: vec![] };
    let zone = BlindZone {
        lanes: vec![lane("ahead", None), lane("behind", None), lane("behind", Some(0.125))],
        left,
        right: left,
        ..BlindZone::default()
    };
    let mut near = NearField { zone, ..NearField::default() };
    let told = unseen_in_words(&near).sentence;
    let want = "BLIND ZONE: no ground is seen within 10 m ahead; no ground is seen within 10 m in 1 of 2 lanes behind. ";
    assert_eq!(told, want);
    let of_run = OfRun { near: unseen_in_words(&near), ..OfRun::default() };
    let words = verdict_at(&of_run, Some(&planted("found", 1.0, 500.0)), &[], "near_gain");
    assert!(words.starts_with(&told) && words.ends_with(" No other check warns."), "{words}");
    // A side is told with its worst frame where bodies move.
    near.zone.worst_frames.insert("ahead", 3);
    let told = unseen_in_words(&near).sentence;
    assert!(told.contains("within 10 m ahead in frame 3; no ground"), "{told}");
    near.zone.worst_frames.clear();
    (near.zone.ahead, near.zone.behind) = (left, Some(10.0));
    assert_eq!(unseen_in_words(&near), Blind::default());
    let slit = LostGround { side: "behind", from: 1.25, to: 10.0, lanes: 1, of: 2, frame: None };
    near.zone.lost = vec![slit];
    let want = "BLIND ZONE: ground behind is unseen again in 1 of 2 lanes, the longest stretch from 1.3 to 10 m. ";
    assert_eq!(unseen_in_words(&near).sentence, want);
    near.zone.lost[0].frame = Some(4);
    let told = unseen_in_words(&near).sentence;
    assert!(told.ends_with("the longest stretch from 1.3 to 10 m in frame 4. "), "{told}");
    near.zone.lost[0].of = 3;
    assert_eq!(unseen_in_words(&near), Blind::default(), "few lanes are said with the depths");
}

#[test]
fn many_blind_sectors_are_counted_first_and_listed_last() {
    let sector = |from: f64| BlindSector::lost([from, from + 30.0], [5.0, 50.0]);
    let mut found = planted("found", 1.0, 500.0);
    let mut first_words = |blind: Vec<BlindSector>| {
        found.scores.range_card = Some(RangeCard { blind, ..RangeCard::default() });
        verdict(Some(&found), &[], "near_gain")
    };
    let one = first_words(vec![sector(-15.0)]);
    assert!(one.starts_with("BLIND: ahead (") && !one.contains('\n'), "{one}");
    let three = first_words(vec![sector(-15.0), sector(75.0), sector(-105.0)]);
    assert!(three.starts_with("BLIND: 3 sectors, listed below. The placement"), "{three}");
    let list: Vec<&str> = three.lines().skip(1).collect();
    assert!(list.len() == 3 && list.iter().all(|line| line.starts_with("BLIND: ")), "{three}");
    let all = three.replace('\n', " ");
    let longest = all.split(". ").map(|words| words.split_whitespace().count()).max();
    assert!(longest <= Some(40), "{three}");
}

#[test]
fn a_lidar_below_the_ground_is_said_first() {
    let mut found = planted("found", 1.0, 500.0);
    found.scores.required = vec![Seen::of("child", 0.95)];
    found.scores.guards = vec![Guard::BelowGround { lidar: 1, mount: None, depth: 0.5 }];
    let words = verdict(Some(&found), &[], "near_gain");
    let start = "BELOW THE GROUND: LiDAR 1 by 0.50 m. The placement found meets its requirement";
    assert!(words.starts_with(start), "{words}");
    assert!(words.contains("Warning: below_ground: LiDAR 1 is 0.50 m below the ground"), "{words}");
}

#[test]
fn a_result_that_no_climb_reached_is_told_with_its_origin() {
    let climbs = |met| Climbs { count: 8, frames: 4, met, near_best: 0, median_below: 0.0 };
    let said = |met, is_met, won| climbs_and_result(&climbs(met), is_met, won);
    let end = "none met all requirements. Another seed takes other starts. The result, which meets all, is from ";
    for (won, from) in [
        (Some("cma-es"), "the other method, CMA-ES"),
        (Some("swaps"), "moves after the climbs, over more frames and finer poses"),
    ] {
        let told = said(Some(0), true, won);
        assert!(told.ends_with(&format!("{end}{from}")), "{told}");
    }
    for told in [said(Some(0), false, Some("swaps")), said(Some(3), true, Some("swaps"))] {
        assert!(told.ends_with("Another seed takes other starts"), "{told}");
    }
}

#[test]
fn copies_that_meet_requirements_decide_before_the_value() {
    let mut best = planted("found", -1.0, 500.0);
    assert_eq!(before_value_in_words(&best), "guards");
    best.scores.required = vec![Seen::of("child", 0.95)];
    assert_eq!(before_value_in_words(&best), "requirements, then guards");
    best.scores.requirements_hold_in = Some(0.9);
    let words = "requirements, then copies that meet them, then guards";
    assert_eq!(before_value_in_words(&best), words);
}

#[test]
fn the_first_sentence_has_the_price_where_there_is_one() {
    let settings = json!({ "budget": 12_000.0, "equipped": { "cost": 9200.0 } });
    let price = price_in_words(&settings);
    assert_eq!(price, " at a price of 9200 (budget 12000)");
    assert_eq!(price_in_words(&json!({ "equipped": { "cost": 9200.5 } })), " at a price of 9200.5");
    assert_eq!(price_in_words(&json!({ "budget": 5.0, "equipped": { "cost": 0.0 } })), "");
    let of_run = OfRun { price, ..OfRun::default() };
    let mut found = planted("found", -1.0, 500.0);
    found.scores.required = vec![Seen::of("child", 0.95), Seen::of("ring", 0.9)];
    let words = verdict_at(&of_run, Some(&found), &[], "m_sog_scaled");
    let start = "The placement found meets all 2 requirements at a price of 9200 (budget 12000). ";
    assert!(words.starts_with(start), "{words}");
    (found.scores.requirements_hold_in, found.scores.copies_off) = (Some(0.92), Some([5.0, 0.5]));
    let words = verdict_at(&of_run, Some(&found), &[], "m_sog_scaled");
    let start = "The placement found meets all 2 requirements at a price of 9200 (budget 12000), but on paper only: \
                 of 200 copies mounted up to 5 mm and 0.5° off, 92 % still meet them, and 95 % must. ";
    assert!(words.starts_with(start), "{words}");
    // Nothing is left to warn of that the first sentence does not tell.
    assert!(words.ends_with("of the information that the scene holds."), "{words}");
    found.scores.requirements_hold_in = Some(0.95);
    let words = verdict_at(&of_run, Some(&found), &[], "m_sog_scaled");
    assert!(!words.contains("paper"), "{words}");
    found.scores.required[1].between = Some(crate::score::Between { places: 9, found: 0.1 });
    let words = verdict_at(&of_run, Some(&found), &[], "m_sog_scaled");
    assert!(words.contains("; at places closer together too little is seen (ring). "), "{words}");
    found.scores.required[1].share = 0.8;
    let words = verdict_at(&of_run, Some(&found), &[], "m_sog_scaled");
    let start = "1 of 2 requirements met at a price of 9200 (budget 12000). NOT MET: ring: 80.0 % seen, 90.0 % required";
    assert!(words.starts_with(start), "{words}");
    found.price = Some(9200.0);
    let words = judged(&found, &[], "m_sog_scaled");
    assert!(words.starts_with("1 of 2 requirements met at a price of 9200. NOT MET: "), "{words}");
    found.scores.required.extend([Seen::of("a", 0.1), Seen::of("b", 0.2)]);
    let words = judged(&found, &[], "m_sog_scaled");
    let start = "1 of 4 requirements met at a price of 9200. NOT MET: ring; a; b. ";
    assert!(words.starts_with(start), "{words}");
}

#[test]
fn a_baseline_with_a_warning_that_misses_less_is_told() {
    let rig = |name: &str, share: f64| {
        let mut of = planted(name, 0.5, 500.0);
        of.scores.required = vec![Seen::of("child", share), Seen::of("ring", 0.9)];
        of
    };
    let mut warned = rig("warned", 0.9);
    (warned.price, warned.scores.guards) = (Some(11_400.0), vec![Guard::CoversNothing]);
    let poor = rig("poor", 0.3);
    let told = judged(&rig("hand", 0.5), &[poor, warned], "m_sog_scaled");
    let words = "; warned misses less: 2 of 2 requirements met at a price of 11400; no baseline keeps every rule";
    assert!(told.contains(words), "{told}");
    let told = judged(&rig("hand", 0.5), &[rig("poor", 0.3)], "m_sog_scaled");
    assert!(!told.contains("misses less"), "{told}");
}

#[test]
fn the_first_sentence_says_what_a_run_did_not_look_at() {
    let frames = " over 4 of 40 frames, as far as the run got".to_owned();
    let of_run = OfRun { frames, has_copies: true, ..OfRun::default() };
    let mut found = planted("found", -1.0, 500.0);
    let words = verdict_at(&of_run, Some(&found), &[], "m_sog_scaled");
    assert!(words.contains("; all this over 4 of 40 frames, as far as the run got. "), "{words}");
    found.scores.required = vec![Seen::of("child", 0.95), Seen::of("ring", 0.9)];
    let words = |found: &Scored| verdict_at(&of_run, Some(found), &[], "m_sog_scaled");
    let start =
        "The placement found meets all 2 requirements over 4 of 40 frames, as far as the run got";
    let copies = "; copies mounted a little off were not looked at";
    assert!(words(&found).starts_with(&format!("{start}{copies}. ")), "{}", words(&found));
    found.scores.requirements_hold_in = Some(1.0);
    assert!(words(&found).starts_with(&format!("{start}. ")), "{}", words(&found));
}

#[test]
fn the_first_sentence_has_the_near_gain_and_a_cheaper_baseline() {
    let rig = |name: &str, near_gain: f64, price: f64| {
        let mut of = planted(name, near_gain, 500.0);
        (of.scores.near_gain, of.price) = (Some(near_gain), Some(price));
        of
    };
    let mut found = rig("found", 0.5, 900.5);
    let dear = rig("dear", 0.4, 2000.0);
    // A broken rule, less near gain than another cheaper one, and the one to name.
    let mut broken = rig("broken", 0.9, 100.0);
    broken.violations = vec!["too near".to_owned()];
    let baselines = [dear.clone(), broken, rig("poor", 0.1, 100.0), rig("low", 0.45, 600.0)];
    let first = first_sentence(&found, &baselines, "near_gain");
    let told = "The placement found is 11.1 % better than low, the best baseline without a warning or a broken rule (0 \
                 LiDARs at a price of 600; here 0 LiDARs at a price of 900.5), by near_gain (50.00 %), but it gains as much \
                 information as that one; low costs 300.5 less at 10.0 % less near gain";
    assert_eq!(first, told);
    let first = first_sentence(&found, std::slice::from_ref(&dear), "near_gain");
    assert!(first.ends_with("as much information as that one"), "{first}");
    // With requirements both stand there, and once.
    found.scores.required = vec![Seen::of("child", 0.95), Seen::of("ring", 0.9)];
    let first = first_sentence(&found, &baselines, "near_gain");
    let start = "The placement found meets all 2 requirements with a near gain of 50.00 %";
    assert_eq!(first, format!("{start}; low costs 300.5 less at 10.0 % less near gain"));
    let words = verdict(Some(&found), &baselines, "near_gain");
    assert_eq!((words.matches("costs").count(), words.matches("50.00 %").count()), (1, 1));
    found.scores.required[0].share = 0.5;
    let words = verdict(Some(&found), &[], "near_gain");
    let start = "1 of 2 requirements met with a near gain of 50.00 %. NOT MET: child: 50.0 % seen, 90.0 % required. The \
                 placement found has 0 LiDARs; there is no baseline to compare it with. ";
    assert!(words.starts_with(start), "{words}");
    found.scores.required.clear();
    let first = first_sentence(&found, &[], "m_sog_scaled");
    let start =
        "The placement found has 0 LiDARs with a near gain of 50.00 %; there is no baseline";
    assert!(first.starts_with(start), "{first}");
}

#[test]
fn checks_are_not_all_passed_where_a_requirement_or_a_sector_is_missed() {
    let mut found = planted("found", -1.0, 500.0);
    let words = |found: &Scored| verdict(Some(found), &[], "m_sog_scaled");
    assert!(words(&found).ends_with("No warning: all checks passed."), "{}", words(&found));
    found.scores.required = vec![Seen::of("child", 0.5), Seen::of("ring", 0.8)];
    let end = "of the information that the scene holds.";
    assert!(words(&found).ends_with(end), "requirements are told above: {}", words(&found));
    found.scores.guards = vec![Guard::RedundantLidar { lidar: 2, share: 0.001 }];
    let idle = "Warning: without LiDAR 2 less than 1 % of the information is lost, so that it could be left out.";
    assert!(words(&found).ends_with(idle), "{}", words(&found));
    found.violations = vec!["LiDAR 0: z is 1 outside the mount".to_owned()];
    let told = "Warning: LiDAR 0: z is 1 outside the mount, and without LiDAR 2 less";
    assert!(words(&found).contains(told), "{}", words(&found));
}

#[test]
fn a_scene_without_information_is_told_and_not_all_checks_pass() {
    let mut found = planted("found", -1.0, 500.0);
    found.scores.segmentation.information_gain_share = None;
    let words = verdict(Some(&found), &[], "near_gain");
    let end = " NO INFORMATION: no voxel of the scene changes between its frames, so that a near gain counts near ground \
               alone. No other check warns.";
    assert!(words.ends_with(end), "{words}");
}

#[test]
fn a_baseline_is_told_by_the_names_of_the_requirements_that_it_misses() {
    let [mut found, mut plain] = ["found", "plain"].map(|name| planted(name, -1.0, 500.0));
    found.scores.required = vec![Seen::of("child", 1.0), Seen::of("ring", 1.0)];
    plain.scores.required = vec![Seen::of("child", 0.0), Seen::of("ring", 0.1)];
    let words = verdict(Some(&found), &[plain], "near_gain");
    assert!(words.contains(" (plain misses child; ring)"), "{words}");
    assert!(!words.contains("NOT MET"), "{words}");
}

#[test]
fn bearings_at_which_a_target_is_never_met_are_named() {
    let target = |name: &str, unmet: &[f64]| {
        let bearing = |k: i32| {
            let bearing = 22.5 * f64::from(k);
            let met = if unmet.contains(&bearing) { vec![] } else { vec![[5.0, 20.0]] };
            BearingRanges { bearing, met }
        };
        TargetRanges {
            target: name.into(),
            size: [1.0; 3],
            bearings: (-7..=8).map(bearing).collect(),
        }
    };
    let all: Vec<f64> = (-7..=8).map(|k| 22.5 * f64::from(k)).collect();
    let card = |adult: &[f64], tyre: &[f64]| {
        let targets = vec![target("car", &all), target("adult", adult), target("tyre", tyre)];
        unmet_in_words(&RangeCard { targets, ..RangeCard::default() })
    };
    assert_eq!(card(&[], &[]), "");
    let start = "UNSEEN at every distance of the range card: ";
    assert_eq!(card(&[180.0, 45.0], &[]), format!("{start}adult (45°, behind 180°). "));
    let told = card(&all, &all[..5]);
    assert_eq!(told, format!("{start}adult all round; tyre at 5 of 16 bearings. "));
}

#[test]
fn words_survive_a_shell() {
    assert_eq!(word("scenes/a-b_1.json"), "scenes/a-b_1.json");
    assert_eq!(word("0.5*m_sog + s_mig"), "'0.5*m_sog + s_mig'");
    assert_eq!(word("it's"), r"'it'\''s'");
    assert_eq!(word(""), "''");
    assert_eq!(word("7"), "7");
}

#[test]
fn files_below_the_current_folder_are_named_from_there() {
    let here = std::env::current_dir().unwrap();
    let below = Path::new("scenes").join("a.json");
    assert_eq!(from_here(&here.join(&below)), below.display().to_string());
    for whole in [here.join("-a.json"), here.with_file_name("a.json"), here.clone()] {
        assert_eq!(from_here(&whole), whole.display().to_string());
    }
}

#[test]
fn frames_are_those_that_the_result_is_scored_over() {
    assert_eq!(frames_in_words(4, 40), "4 of 40 frames");
    assert_eq!(frames_in_words(40, 40), "40 frames");
    assert_eq!(frames_in_words(1, 1), "1 frame");
}

#[test]
fn a_bound_that_heeds_no_requirements_says_so() {
    let mut found = planted("found", -1.0, 500.0);
    let mut said = |heeds: Option<&str>, seen: &[f64]| {
        let gain = bound_of(525.0, heeds);
        found.scores.required = seen.iter().map(|&share| Seen::of("child", share)).collect();
        bound_in_words(&Certificate::new(None, Ok(gain), 500.0), &found)
    };
    let more = "is at most 5.00 % better than the result";
    for (heeds, seen, end) in [
        (None, &[][..], ""),
        (None, &[0.5][..], ", whether it meets requirements or not"),
        (Some("the requirements"), &[0.9][..], ""),
        (Some("the requirements"), &[0.5][..], "; the result misses requirements"),
    ] {
        let said = said(heeds, seen);
        assert!(said.ends_with(&format!("{more}{end}")), "{said}");
    }
}

#[test]
fn a_bound_names_the_chosen_sensors_once() {
    let mut found = planted("found", -1.0, 500.0);
    let sensor = SensorName::new("a model of a test").unwrap();
    found.placement.lidars = vec![SensorPose { sensor, ..SensorPose::default() }];
    for over in ["the grid", "the grid, with these sensors on their mounts,"] {
        let gain_says = format!("the best placement on {over} is at most 5 % better");
        let gain = Some(bound_of(525.0, None));
        let bound = Certificate { lipschitz: None, lipschitz_says: String::new(), gain, gain_says };
        let words = bound_in_words(&bound, &found);
        assert_eq!(words.matches("with these sensors on their mounts").count(), 1, "{words}");
    }
}

#[test]
fn a_bound_that_was_not_computed_says_nothing_of_requirements() {
    let mut found = planted("found", -1.0, 500.0);
    found.scores.required = vec![Seen::of("child", 0.5)];
    let gain_says = "no bound was computed: the time was over before".to_owned();
    let none =
        Certificate { lipschitz: None, lipschitz_says: String::new(), gain: None, gain_says };
    assert_eq!(bound_in_words(&none, &found), none.gain_says);
}
