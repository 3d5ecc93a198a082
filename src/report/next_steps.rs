//! Steps to take next where a result misses requirements.

use serde::Deserialize;
use serde_json::Value;

use super::RunRecord;
use crate::csv::rounded;
use crate::score::{Guard, Seen};
use crate::search::{OpenMount, PLAIN, Scored, is_about};

/// Mounts with room that are named.
const MOST_MOUNTS: usize = 4;
/// Words before them.
const MOUNTS_WITH_ROOM: &str = "Mounts with room";

/// Line on a vehicle without requirements.
pub(super) const NO_REQUIREMENT: &str =
    "No requirement is set: `require` of the vehicle says what must be seen.";

/// [`next_in_words`] for a terminal, with a line where a vehicle has no requirements: a page has three to copy.
pub(super) fn next_in_text(run: &RunRecord) -> Vec<String> {
    let scores = run.best.iter().map(|best| &best.scores);
    let none = scores.filter(|scores| scores.required.is_empty() && scores.range_card.is_some());
    let has_vehicle = !run.mounts.is_empty();
    let hint = none
        .filter(|_| has_vehicle)
        .map(|_| format!("{NO_REQUIREMENT} report.html has three to copy."));
    next_in_words(run).into_iter().chain(hint).collect()
}

/// Next steps for a user: more time if it ended before the sensors were chosen; requirements out of reach; then
/// money and mounts that are left, and changes that let a search find more. Where all requirements are met: how to make them
/// hold in copies, and that a baseline meets them, too, for which less may be enough.
pub(crate) fn next_in_words(run: &RunRecord) -> Vec<String> {
    let cut = cut_in_words(&run.settings);
    let is_cut = cut.is_some();
    let mut steps: Vec<String> = cut.into_iter().collect();
    let required = run.best.iter().flat_map(|best| &best.scores.required);
    let unmet: Vec<&Seen> = required.filter(|seen| !seen.is_met()).collect();
    if unmet.is_empty() {
        let best = run.best.as_ref();
        steps.extend(best.and_then(|best| firmer_in_words(best, run.seed)));
        steps.extend(best.and_then(|best| fewer_in_words(best, &run.baselines, &run.settings)));
        return steps;
    }
    let beyond = beyond_reach(&run.settings, &unmet);
    steps.extend(beyond.iter().map(|words| format!("Out of reach: {words}.")));
    let is_beyond = |seen: &&Seen| beyond.iter().any(|words| is_about(words, seen));
    if !unmet.iter().all(is_beyond) {
        let room = |names_mounts| room_in_words(&run.settings, names_mounts).filter(|_| !is_cut);
        let budget =
            if is_cut { String::new() } else { dearer(&run.settings, room(true).as_deref()) };
        // The fewest sensors leave mounts empty on purpose.
        steps.extend(room(run.settings["fewest"] != true));
        let evaluations = 2 * run.settings["search"]["evaluations"].as_u64().unwrap_or(180);
        let time = match run.settings["max_seconds"].is_number() {
            true => "more time (--resume goes on), ",
            false => "",
        };
        // Limits that LiDARs stand at tell that the mounts are in the way, not the length of the search.
        let [mounts, last] = match run.active_bounds.len() {
            0 => ["", ", more or wider mounts"],
            _ => {
                ["wider mounts where LiDARs stand at a limit (named below), or more of them, ", ""]
            }
        };
        let best = run.best.as_ref();
        let frames = best.map_or(String::new(), |best| {
            poses_in_words(best, [run.search_frames, run.confirmed_frames])
        });
        steps.push(format!(
            "Next, since requirements are not met, in this order: {time}{frames}{mounts}{budget}another seed (--seed {}), more \
             evaluations (--evaluations {evaluations}){last}.",
            run.seed + 1
        ));
    }
    steps
}

/// Advice to search over all frames where a requirement is missed in one of the poses that bodies take, of which the search
/// knew some; empty elsewhere.
fn poses_in_words(best: &Scored, [searched, scored]: [usize; 2]) -> String {
    let is_posed =
        best.scores.required.iter().any(|seen| !seen.is_met() && seen.worst_frame.is_some());
    match is_posed && searched < scored {
        true => format!(
            "a search that knows the bodies' poses in all {scored} frames, not in {searched} (--fidelity full), "
        ),
        false => String::new(),
    }
}

/// Sentences of the choice of sensors on requirements out of reach that are not met. The choice looks at few poses: where the
/// search saw more than all of these together, the bound says nothing.
fn beyond_reach<'a>(settings: &'a Value, unmet: &[&Seen]) -> Vec<&'a str> {
    let [all, ceilings] =
        ["out_of_reach", "ceilings"].map(|key| settings["equipped"][key].as_array());
    let all = all.into_iter().flatten().filter_map(Value::as_str).enumerate();
    let is_unmet = |(k, words): &(usize, &str)| {
        let ceiling = ceilings.and_then(|all| all.get(*k)?.as_f64()).unwrap_or(1.0);
        unmet.iter().any(|seen| is_about(words, seen) && seen.share <= ceiling)
    };
    all.filter(is_unmet).map(|(_, words)| words).collect()
}

/// Advice where requirements hold on paper only; `None` elsewhere.
fn firmer_in_words(best: &Scored, seed: u64) -> Option<String> {
    best.scores.holds_on_paper()?;
    let half = best.scores.copies_off.map(|[mm, deg]| format!("{}mm,{}deg", mm / 2.0, deg / 2.0));
    let half = half.map_or(String::new(), |half| format!(" (`--tolerance {half}` for half of it)"));
    Some(format!(
        "Next, since requirements hold on paper only, one of these: a bracket with a smaller tolerance{half}; a larger \
         `share` or more `beams` than you need in `require`, so that the search leaves room; another seed (`--seed {}`).",
        seed + 1
    ))
}

/// Advice to look for less: where a baseline meets all requirements, too, on more than paper, or the result has a LiDAR too many.
///
/// It names fewer sensors than `plain` has, or the price of a baseline that costs less than the result. `None` where nothing is
/// required, and where the sensors were given or are the fewest.
fn fewer_in_words(best: &Scored, baselines: &[Scored], settings: &Value) -> Option<String> {
    let is_chosen = settings["equipped"].is_object() && settings["fewest"] != true;
    if !is_chosen || best.scores.required.is_empty() {
        return None;
    }
    let firm = |of: &&Scored| of.is_honest() && of.scores.holds_on_paper().is_none();
    let priced = baselines.iter().filter(firm).filter_map(|of| Some((of, of.price?, best.price?)));
    let cheaper = priced.filter(|(_, price, ours)| price < ours);
    if let Some((of, price, ours)) = cheaper.min_by(|(_, a, _), (_, b, _)| a.total_cmp(b)) {
        // Rounded up: the budget pays for the rig. Floating point leaves less than a millionth.
        let price = rounded((100.0 * price - 1e-6).ceil() / 100.0, 2);
        let ours = rounded(ours, 2);
        return Some(format!(
            "`{}` meets all requirements for {price} in place of {ours}; `--budget {price}` looks for the best rig at that \
             price.",
            of.placement.name
        ));
    }
    let is_own = |of: &&Scored| of.placement.name == PLAIN && of.placement.lidars.len() > 1;
    if baselines.iter().filter(firm).any(|of| is_own(&of)) {
        return Some(format!(
            "`{PLAIN}` meets all requirements, too; `--fewest` looks for fewer sensors."
        ));
    }
    best.scores.guards.iter().find_map(Guard::redundant_lidar)?;
    Some(
        "A LiDAR could be left out: `--fewest` looks for the fewest that meet all requirements, `--front price,near_gain` for \
         rigs at every price."
            .to_owned(),
    )
}

/// Advice to spend more; none where what is left pays for a LiDAR on a mount with room, or all mounts are full and the budget
/// pays for their dearest models.
fn dearer(settings: &Value, room: Option<&str>) -> String {
    let has_room = room.is_some_and(|words| words.contains(MOUNTS_WITH_ROOM));
    let equipped = &settings["equipped"];
    let is_full = equipped["open_mounts"].as_array().is_some_and(Vec::is_empty);
    let dearest = equipped["dearest"].as_f64().filter(|_| is_full);
    let is_of_use = |budget: &f64| dearest.is_none_or(|dearest| dearest > *budget);
    let budget = settings["budget"].as_f64().filter(|_| !has_room).filter(is_of_use);
    budget.map_or(String::new(), |budget| format!("a --budget above {budget}, "))
}

/// Money that is left, mounts that could hold a LiDAR for it, and the `count` that forces one there; `None` where neither
/// money nor room is left. Mounts with room are left out where `names_mounts` is false.
fn room_in_words(settings: &Value, names_mounts: bool) -> Option<String> {
    let equipped = &settings["equipped"];
    let open = Vec::<OpenMount>::deserialize(&equipped["open_mounts"]).unwrap_or_default();
    let [cost, budget] = [&equipped["cost"], &settings["budget"]].map(Value::as_f64);
    // Prices in cents differ by what floating point leaves.
    let left = cost.zip(budget).map(|(cost, budget)| ((budget - cost) * 100.0).round() / 100.0);
    let unspent = left.zip(budget).filter(|(left, _)| *left > 0.0);
    let unspent = unspent.map(|(left, budget)| format!("{left} of the budget of {budget}"));
    let is_paid = |mount: &&OpenMount| left.is_none_or(|left| mount.price <= left);
    let named: Vec<String> = open.iter().filter(is_paid).map(with_count).collect();
    let more = named.len().saturating_sub(MOST_MOUNTS);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    let list = named.iter().take(MOST_MOUNTS).cloned().collect::<Vec<_>>().join(", ") + &more;
    match (unspent, named.is_empty()) {
        (None, true) => None,
        (unspent, false) if !names_mounts => unspent.map(|unspent| format!("Unspent: {unspent}.")),
        (None, false) => Some(format!("{MOUNTS_WITH_ROOM}: {list}.")),
        (Some(unspent), true) => {
            let why = match open.iter().map(|mount| mount.price).reduce(f64::min) {
                Some(price) => format!("the cheapest that a mount has room for costs {price}"),
                None => "no mount has room for one more sensor".to_owned(),
            };
            Some(format!("Unspent: {unspent}; {why}."))
        }
        (Some(unspent), false) => Some(format!("Unspent: {unspent}. {MOUNTS_WITH_ROOM}: {list}.")),
    }
}

/// LiDARs on a mount with room, and the `count` that forces one more.
fn with_count(mount: &OpenMount) -> String {
    let OpenMount { mount, lidars, most, .. } = mount;
    let wanted = lidars + 1;
    let count = if wanted == *most { most.to_string() } else { format!("[{wanted}, {most}]") };
    let holds = match lidars {
        0 => "no LiDAR".to_owned(),
        held => format!("{held} of {most}"),
    };
    format!("`{mount}` holds {holds} (`\"count\": {count}` forces {wanted} there)")
}

/// Sentence on a time that ended before the sensors were chosen; `None` where they were.
fn cut_in_words(settings: &Value) -> Option<String> {
    let equipped = &settings["equipped"];
    let [cost, budget] = [&equipped["cost"], &settings["budget"]].map(Value::as_f64);
    let spent = cost.zip(budget).map(|(cost, budget)| format!(" ({cost} of {budget} spent)"));
    let spent = spent.unwrap_or_default();
    let had = settings["max_seconds"].as_f64();
    let had = had.map_or("it had".to_owned(), |seconds| format!("the {seconds} s it had"));
    (equipped["is_cut"] == true).then(|| {
        format!(
            "The time ended while the sensors were chosen{spent}: go on with --resume and more time than {had}; \
             poses for the choice are cast anew."
        )
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::report::words::tests::planted;
    use crate::score::WorstFrame;
    use crate::vehicle::SensorPose;

    #[test]
    fn a_baseline_that_meets_all_requirements_hints_at_fewer_sensors() {
        let rig = |name: &str, share: f64, price: f64| {
            let mut rig = planted(name, 1.0, 500.0);
            rig.scores.required = vec![Seen::of("child", share)];
            rig.placement.lidars = vec![SensorPose::default(); 2];
            rig.price = Some(price);
            rig
        };
        let (best, chosen) = (rig("found", 1.0, 900.0), json!({ "equipped": {} }));
        let told = |baseline: Scored| fewer_in_words(&best, &[baseline], &chosen);
        let words = "`plain` meets all requirements, too; `--fewest` looks for fewer sensors.";
        assert_eq!(told(rig("plain", 1.0, 900.0)).as_deref(), Some(words));
        let words = "`by-hand` meets all requirements for 800 in place of 900; `--budget 800` looks for the best rig at that \
                     price.";
        assert_eq!(told(rig("by-hand", 1.0, 800.0)).as_deref(), Some(words));
        // The cheapest counts, and a budget in cents pays for it.
        let two = [rig("dear", 1.0, 850.0), rig("cheap", 1.0, 0.1 + 0.2), rig("odd", 1.0, 799.991)];
        for (baselines, price) in [(&two[..], "0.3"), (&two[2..], "800")] {
            let words = fewer_in_words(&best, baselines, &chosen).unwrap();
            assert!(words.contains(&format!("`--budget {price}` looks for")), "{words}");
        }
        let mut on_paper = rig("by-hand", 1.0, 800.0);
        on_paper.scores.requirements_hold_in = Some(0.8);
        assert_eq!(told(on_paper), None);
        assert_eq!(told(rig("by-hand", 1.0, 900.0)), None);
        assert_eq!(told(rig("plain", 0.5, 900.0)), None);
        let mut idle = rig("found", 1.0, 900.0);
        idle.scores.guards = vec![Guard::RedundantLidar { lidar: 1, share: 0.001 }];
        let words = fewer_in_words(&idle, &[rig("plain", 0.5, 900.0)], &chosen).unwrap();
        assert!(words.starts_with("A LiDAR could be left out: `--fewest` looks for"), "{words}");
        let plain = [rig("plain", 1.0, 900.0)];
        for settings in [json!({}), json!({ "equipped": {}, "fewest": true })] {
            assert_eq!(fewer_in_words(&best, &plain, &settings), None);
        }
        let free = planted("found", 1.0, 500.0);
        assert_eq!(fewer_in_words(&free, &plain, &chosen), None);
    }

    #[test]
    fn a_pose_that_the_search_did_not_know_asks_for_all_frames() {
        let mut best = planted("found", 1.0, 500.0);
        best.scores.required = vec![Seen::of("child", 0.5)];
        assert_eq!(poses_in_words(&best, [4, 40]), "");
        best.scores.required[0].worst_frame = Some(WorstFrame { frame: 7, share: 0.5 });
        assert!(
            poses_in_words(&best, [4, 40]).contains("all 40 frames, not in 4 (--fidelity full)")
        );
        assert_eq!(poses_in_words(&best, [40, 40]), "");
        best.scores.required[0].share = 1.0;
        assert_eq!(poses_in_words(&best, [4, 40]), "");
    }

    #[test]
    fn only_unmet_requirements_are_out_of_reach() {
        let said = ["child: at most 0.0 % seen", "child, one LiDAR lost: at most 20.0 % seen"];
        let settings = json!({ "equipped": { "out_of_reach": said, "ceilings": [0.2, 0.2] } });
        let beyond = |unmet: &str, share: f64| {
            let seen = Seen::of(unmet, share);
            beyond_reach(&settings, &[&seen])
                .iter()
                .map(|&words| words.to_owned())
                .collect::<Vec<_>>()
        };
        assert_eq!(beyond("child", 0.2), [said[0]]);
        assert!(beyond("tyre", 0.2).is_empty());
        // The search saw more than all poses of the choice.
        assert!(beyond("child", 0.21).is_empty());
    }

    #[test]
    fn requirements_on_paper_only_have_a_next_step() {
        let mut best = planted("found", 1.0, 500.0);
        best.scores.required = vec![Seen::of("child", 1.0)];
        best.scores.copies_off = Some([5.0, 0.5]);
        best.scores.requirements_hold_in = Some(0.96);
        assert_eq!(firmer_in_words(&best, 4), None);
        best.scores.requirements_hold_in = Some(0.9);
        let words = firmer_in_words(&best, 4).unwrap();
        for told in ["(`--tolerance 2.5mm,0.25deg` for half of it)", "larger `share`", "`--seed 5`"]
        {
            assert!(words.contains(told), "{words}");
        }
    }

    #[test]
    fn money_and_mounts_that_are_left_are_named_with_the_count_that_uses_them() {
        let told = |budget: Value| {
            let open = |mount: &str, lidars: u32, most: u32, price: f64| json!({ "mount": mount, "lidars": lidars, "most": most, "price": price });
            let mounts = [open("rear", 0, 1, 900.0), open("roof", 1, 3, 2800.0)];
            let equipped = json!({ "cost": 9100.0, "open_mounts": mounts });
            room_in_words(&json!({ "budget": budget, "equipped": equipped }), true)
        };
        let rear = "`rear` holds no LiDAR (`\"count\": 1` forces 1 there)";
        let roof = "`roof` holds 1 of 3 (`\"count\": [2, 3]` forces 2 there)";
        let both = format!("Mounts with room: {rear}, {roof}.");
        assert_eq!(told(Value::Null).as_deref(), Some(&*both));
        let unspent = "Unspent: 2900 of the budget of 12000. ";
        assert_eq!(told(json!(12000)), Some(format!("{unspent}{both}")));
        let unspent = "Unspent: 900 of the budget of 10000. Mounts with room: ";
        assert_eq!(told(json!(10000)), Some(format!("{unspent}{rear}.")));
        let advice = |room: Option<String>| dearer(&json!({ "budget": 10000 }), room.as_deref());
        assert_eq!(advice(told(json!(10000))), "", "900 are left for the rear");
        assert_eq!(advice(told(json!(9200.5))), "a --budget above 10000, ");
        let none = "Unspent: 100.5 of the budget of 9200.5; the cheapest that a mount has room for costs 900.";
        assert_eq!(told(json!(9200.5)).as_deref(), Some(none));
        let mounts = [json!({ "mount": "rear", "lidars": 0, "most": 1, "price": 900.0 })];
        let equipped = json!({ "cost": 9100.0, "open_mounts": mounts });
        let unnamed = |budget: Value| {
            room_in_words(&json!({ "budget": budget, "equipped": equipped }), false)
        };
        assert_eq!(unnamed(Value::Null), None);
        let words = "Unspent: 2900 of the budget of 12000.";
        assert_eq!(unnamed(json!(12000)).as_deref(), Some(words));
        assert_eq!(unnamed(json!(9200.5)).as_deref(), Some(none));
        // Full mounts, and nothing left to spend.
        let full = json!({ "budget": 9900, "equipped": { "cost": 9100.0, "open_mounts": [] } });
        let none = "Unspent: 800 of the budget of 9900; no mount has room for one more sensor.";
        assert_eq!(room_in_words(&full, true).as_deref(), Some(none));
        let full = json!({ "budget": 9100, "equipped": { "cost": 9100.0, "open_mounts": [] } });
        assert_eq!(room_in_words(&full, true), None);
        assert_eq!(room_in_words(&json!({}), true), None);
        // Money cannot help where the dearest models fit in the budget.
        let dearest = |price: f64| {
            let equipped = json!({ "cost": 800.0, "open_mounts": [], "dearest": price });
            dearer(&json!({ "budget": 1000, "equipped": equipped }), None)
        };
        assert_eq!(dearest(1000.0), "");
        assert_eq!(dearest(1000.5), "a --budget above 1000, ");
    }
}
