//! Findings of a run as sentences: result against baselines, search methods, certificate.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::RunRecord;
use super::text::value_in_words;
use super::warnings::{Blind, blind_in_words, kinds_beside, unseen_in_words};
use crate::csv::rounded;
use crate::json::counted;
use crate::score::{Guard, HOLDS, NEAR_GAIN, Objective, lidar_name, percent_down};
use crate::search::{COPIES, Certificate, Climbs, LAYOUT_GIVEN, PLAIN, Scored, Tolerance};

/// The result of a run against the best baselines, by the objective and by information gain.
///
/// It names the guards that the result violates, the price of its sensors where these have one, and sides on which it
/// sees no ground near the vehicle. Many blind places follow as a list, a line each.
///
/// A baseline counts if it keeps the rules of the mount and violates no guard. A result that gains less information
/// than such a baseline is never called better without saying so.
pub(crate) fn run_verdict(run: &RunRecord) -> String {
    let near = run.near_field.as_ref().map(|near| unseen_in_words(&near.near)).unwrap_or_default();
    let frames = match run.confirmed_frames < run.frames {
        true => format!(
            " over {}, as far as the run got",
            frames_in_words(run.confirmed_frames, run.frames)
        ),
        false => String::new(),
    };
    let tolerance = run.settings["tolerance"].as_str().and_then(|text| text.parse().ok());
    let has_copies = tolerance.is_some_and(|tolerance: Tolerance| tolerance.is_some());
    let of_run = OfRun { price: price_in_words(&run.settings), near, frames, has_copies };
    let verdict = verdict_at(&of_run, run.best.as_ref(), &run.baselines, &run.objective);
    let Some(untried) = &run.untried else { return verdict };
    let (sentences, list) = verdict.split_at(verdict.find('\n').unwrap_or(verdict.len()));
    format!("{sentences} Not tried: {untried}.{list}")
}

/// Unmet requirements that a verdict tells with share and places; of more it has the names, and the rest stands below.
const MOST_LACKING: usize = 2;

/// Sentence without its full stop where every entropy is 0.
const NO_INFORMATION: &str = "NO INFORMATION: no voxel of the scene changes between its frames, so that a near gain counts \
                              near ground alone";

/// Parts of a verdict that only a run has; either may be empty.
#[derive(Default)]
struct OfRun {
    price: String,
    near: Blind,
    /// Frames that the result is scored over, such as ` over 4 of 40 frames, as far as the run got`; empty where
    /// these are all.
    frames: String,
    /// True if the run was to look at copies within a mounting tolerance.
    has_copies: bool,
}

/// Price of the sensors and the budget, such as ` at a price of 9200 (budget 12000)`; empty where nothing has a price.
fn price_in_words(settings: &Value) -> String {
    let cost = settings["equipped"]["cost"].as_f64().filter(|cost| *cost > 0.0);
    let budget = settings["budget"].as_f64().filter(|_| cost.is_some());
    cost.map_or(String::new(), at_price)
        + &budget.map_or(String::new(), |b| format!(" (budget {b})"))
}

fn at_price(price: f64) -> String {
    format!(" at a price of {price}")
}

fn verdict_at(
    of_run: &OfRun,
    best: Option<&Scored>,
    baselines: &[Scored],
    objective: &str,
) -> String {
    let Some(best) = best else {
        return format!(
            "No candidate both kept the rules of the mount and had a value of {objective}; widen the mount or lower \
             its min_distance."
        );
    };
    judged_at("The placement found", of_run, best, baselines, objective)
}

/// Like [`run_verdict`], for a placement that was given.
pub(crate) fn judged(best: &Scored, baselines: &[Scored], objective: &str) -> String {
    let of_run = OfRun { price: best.price.map_or(String::new(), at_price), ..OfRun::default() };
    judged_at(&best.placement.name, &of_run, best, baselines, objective)
}

fn judged_at(
    subject: &str,
    of_run: &OfRun,
    best: &Scored,
    baselines: &[Scored],
    objective: &str,
) -> String {
    let cheaper = cheaper_in_words(best, baselines);
    let OfRun { near, frames, .. } = of_run;
    let required = required_in_words(subject, of_run, best, &cheaper);
    let last = if required.is_empty() { &*cheaper } else { "" };
    let mut against = against(subject, best, baselines, objective)
        .unwrap_or_else(|| alone_in_words(subject, best, baselines, objective));
    if required.is_empty() && !frames.is_empty() {
        against += &format!("; all this{frames}");
    }
    let held = match best.by_scene.len() {
        0 => "the scene holds",
        _ => "the scenes hold, a mean over them",
    };
    let gained = best.scores.segmentation.information_gain_share;
    let share = gained.map_or(format!(" {NO_INFORMATION}."), |share| {
        format!(" Its beams gain {:.1} % of the information that {held}.", 100.0 * share)
    });
    let (below, blind) = (below_in_words(best), blind_in_words(best));
    let list: String = blind.list.iter().chain(&near.list).map(|of| format!("\n{of}")).collect();
    let blind = format!("{}{}", blind.sentence, near.sentence);
    let warnings = warnings_in_words(best, !blind.is_empty() || gained.is_none());
    format!("{below}{required}{blind}{against}{last}.{share}{warnings}{list}")
}

/// Sentence on LiDARs below the ground; empty where there are none.
fn below_in_words(best: &Scored) -> String {
    let below = |guard: &Guard| {
        let Guard::BelowGround { lidar, mount, depth } = guard else { return None };
        Some(format!("{} by {depth:.2} m", lidar_name(*lidar, mount.as_deref())))
    };
    let each: Vec<String> = best.scores.guards.iter().filter_map(below).collect();
    if each.is_empty() { String::new() } else { format!("BELOW THE GROUND: {}. ", each.join(", ")) }
}

/// Start of a sentence on a placement that no baseline is compared with, and why.
fn alone_in_words(subject: &str, best: &Scored, baselines: &[Scored], objective: &str) -> String {
    // A requirement that it misses tells more than a guard, which may stand against the result, too.
    let reason = |b: &Scored| {
        let unmet = b.scores.required.iter().filter(|seen| !seen.is_met());
        let unmet: Vec<&str> = unmet.map(|seen| &*seen.name).collect();
        match unmet[..] {
            [] => Some(format!("{}: {}", b.placement.name, b.reasons().into_iter().next()?)),
            _ => Some(format!("{} misses {}", b.placement.name, unmet.join("; "))),
        }
    };
    let first = baselines.iter().find_map(reason);
    let why = match first {
        None if baselines.is_empty() => "there is no baseline to compare it with".to_owned(),
        None => format!("{objective} has no value for any baseline"),
        Some(reason) => {
            format!("no baseline keeps every rule and requirement without a warning ({reason})")
        }
    };
    let allowed = baselines.iter().filter(|of| of.violations.is_empty());
    let least = allowed.min_by(|a, b| a.scores.missing().total_cmp(&b.scores.missing()));
    let closer = least.filter(|of| of.scores.missing() < best.scores.missing()).map(|of| {
        let ([met, all], price) = (of.scores.met(), of.price.map_or(String::new(), at_price));
        format!("{} misses less: {met} of {all} requirements met{price}; ", of.placement.name)
    });
    let closer = closer.unwrap_or_default();
    let lidars = counted(best.placement.lidars.len(), "LiDAR");
    let gain = match best.scores.required.is_empty() {
        true => near_gain_in_words(best),
        false => String::new(),
    };
    format!("{subject} has {lidars}{gain}; {closer}{why}")
}

/// The near gain, such as ` with a near gain of 45.32 %`; empty where there is none.
fn near_gain_in_words(best: &Scored) -> String {
    let words = |gain: f64| format!(" with a near gain of {:.2} %", 100.0 * gain);
    best.scores.near_gain.map_or(String::new(), words)
}

/// End of a sentence on a cheaper baseline, such as `; low costs 300 less at 4.1 % less near gain`; empty without one.
///
/// Baselines count that cost less than the placement and keep every rule and requirement without a warning. The one of
/// most near gain is told.
fn cheaper_in_words(best: &Scored, baselines: &[Scored]) -> String {
    let Some((price, ours)) = best.price.zip(best.scores.near_gain) else { return String::new() };
    let honest = baselines.iter().filter(|baseline| baseline.is_honest());
    let known = honest.filter_map(|of| Some((of, of.price?, of.scores.near_gain?)));
    let cheaper = known.filter(|(_, cost, _)| *cost < price);
    let Some((of, cost, theirs)) = cheaper.max_by(|a, b| a.2.total_cmp(&b.2)) else {
        return String::new();
    };
    let gain = compare(theirs, ours, ["more", "less", "as much"]);
    format!("; {} costs {} less at {gain} near gain", of.placement.name, rounded(price - cost, 2))
}

/// Sentences on requirements with the price, the near gain and a cheaper baseline; empty where nothing is required.
fn required_in_words(subject: &str, of_run: &OfRun, best: &Scored, cheaper: &str) -> String {
    let facts = format!("{}{}{}", of_run.frames, of_run.price, near_gain_in_words(best));
    let met = match best.scores.met() {
        [_, 0] => return String::new(),
        [met, of] if met == of => met_in_words(subject, &facts, best, of_run.has_copies),
        [_, 1] => format!("The requirement is not met{facts}"),
        [met, of] => format!("{met} of {of} requirements met{facts}"),
    };
    let lacking = || best.scores.required.iter().filter(|seen| !seen.is_met());
    let lacking = match lacking().count() {
        count if count > MOST_LACKING => {
            let names: Vec<String> = lacking().map(|seen| seen.title()).collect();
            format!("NOT MET: {}. ", names.join("; "))
        }
        _ => lacking().map(|seen| format!("{seen}. ")).collect(),
    };
    format!("{met}{cheaper}. {lacking}")
}

/// Sentence on the warnings, after a blank; empty if all are told before. `is_blind` if blind places are told before.
fn warnings_in_words(best: &Scored, is_blind: bool) -> String {
    let warnings = best.warnings();
    match &warnings[..] {
        [] if is_blind => " No other check warns.".to_owned(),
        [] => " No warning: all checks passed.".to_owned(),
        _ if best.scores.doubts() == 0 => match untold_in_words(best) {
            untold if untold.is_empty() => untold,
            untold => format!(" Warning: {untold}."),
        },
        [one] => format!(" Warning: {one}."),
        [first, ..] => {
            let with =
                if best.scores.missing() > 0.0 { " with the unmet requirements" } else { "" };
            format!(" {}{with}, the first: {first}.", counted(warnings.len(), "warning"))
        }
    }
}

/// Warnings of a placement that violates no guard, but for requirements and blind sectors, which are said before.
fn untold_in_words(best: &Scored) -> String {
    let broken = best.violations.first().map(|first| match best.violations.len() {
        1 => first.clone(),
        count => format!("{count} rules of the mount are broken, the first: {first}"),
    });
    let idle: BTreeSet<usize> =
        best.scores.guards.iter().filter_map(Guard::redundant_lidar).collect();
    let numbers = idle.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let lost = "less than 1 % of the information is lost, so that";
    let idle = match idle.len() {
        0 => None,
        1 => Some(format!("without LiDAR {numbers} {lost} it could be left out")),
        _ => Some(format!(
            "without any one of LiDARs {numbers} {lost} one of them could be left out"
        )),
    };
    [broken, idle].into_iter().flatten().collect::<Vec<_>>().join(", and ")
}

/// Start of a sentence on requirements that are all met, which copies were to meet, too, if `has_copies`.
fn met_in_words(subject: &str, facts: &str, best: &Scored, has_copies: bool) -> String {
    let (what, them) = match &best.scores.required[..] {
        [one] => (format!("its requirement ({})", one.title()), "it"),
        all => (format!("all {} requirements", all.len()), "them"),
    };
    let paper = best.scores.holds_on_paper().map_or(String::new(), |share| {
        let off = best.scores.copies_off;
        let off = off.map_or("a little".to_owned(), |[mm, deg]| format!("up to {mm} mm and {deg}°"));
        format!(
            ", but on paper only: of {COPIES} copies mounted {off} off, {} % still meet {them}, and {} % must",
            percent_down(share),
            100.0 * HOLDS
        )
    });
    let is_unknown = has_copies && best.scores.requirements_hold_in.is_none();
    let unknown = if is_unknown { "; copies mounted a little off were not looked at" } else { "" };
    let between = best.scores.missed_between().map_or(String::new(), |words| format!("; {words}"));
    format!("{subject} meets {what}{facts}{paper}{unknown}{between}")
}

/// A line for each placement that breaks rules of the mount, with the first of them.
pub(crate) fn broken_in_words(all: &[Scored]) -> Vec<String> {
    let line = |scored: &Scored| {
        let (first, others) = scored.violations.split_first()?;
        let more =
            if others.is_empty() { String::new() } else { format!("; and {} more", others.len()) };
        Some(format!("{}: {first}{more}", scored.placement.name))
    };
    all.iter().filter_map(line).collect()
}

/// Start of the sentence of [`judged`] on the best baseline; `None` without one to compare with.
fn against(subject: &str, best: &Scored, baselines: &[Scored], objective: &str) -> Option<String> {
    let honest = || baselines.iter().filter(|baseline| baseline.is_honest());
    let gain_of = |scored: &Scored| scored.scores.segmentation.information_gain;
    let rival = Scored::yardstick(baselines)?;
    let theirs = rival.objective?;
    let name = &rival.placement.name;
    let warned = kinds_beside(rival, best, "as here");
    let clean = match (honest().count() == baselines.len(), warned.is_empty()) {
        (true, true) => String::new(),
        (true, false) => format!(" ({warned})"),
        (false, true) => " without a warning or a broken rule".to_owned(),
        (false, false) => format!(" that keeps every rule and requirement ({warned})"),
    };
    let shown = match baselines.len() {
        1 if name == PLAIN => format!("`{PLAIN}`, the same sensors placed without a search"),
        1 => format!("{name}, the only baseline"),
        _ => format!("{name}, the best baseline"),
    };
    let known = format!("{shown}{clean}{},", sensors_beside(best, rival));
    let ours = best.objective?;
    let by_objective = compare(ours, theirs, ["better than", "worse than", "as good as"]);
    let is_first = objective == NEAR_GAIN && best.scores.required.is_empty();
    let value = best.scores.near_gain.filter(|_| is_first);
    let value = value.map_or(String::new(), |gain| format!(" ({:.2} %)", 100.0 * gain));
    let mut sentence = format!("{subject} is {by_objective} {known} by {objective}{value}");
    if objective == GAIN {
        return Some(sentence);
    }
    // The baseline that gains most may be another than the best one by the objective.
    let gains = honest().filter_map(|b| Some((gain_of(b)?, b)));
    let highest = gains.max_by(|a, b| a.0.total_cmp(&b.0));
    if let (Some(ours_gain), Some((most, seer))) = (gain_of(best), highest) {
        let gains = compare(ours_gain, most, ["more", "less", "as much"]);
        let same = ours.total_cmp(&theirs) == ours_gain.total_cmp(&most);
        let link = if same { "and" } else { "but" };
        let than = if ours_gain == most { "as" } else { "than" };
        let seer = if seer.placement.name == *name {
            "that one".to_owned()
        } else {
            format!("{}, the baseline that gains most", seer.placement.name)
        };
        sentence += &format!(", {link} it gains {gains} information {than} {seer}");
    }
    Some(sentence)
}

/// Number of LiDARs and price of a baseline and of the placement beside it; empty where both have as many at one price.
fn sensors_beside(best: &Scored, rival: &Scored) -> String {
    let of = |scored: &Scored| (scored.placement.lidars.len(), scored.price);
    if of(best) == of(rival) {
        return String::new();
    }
    let words = |scored: &Scored| {
        let price = scored.price.map_or(String::new(), at_price);
        format!("{}{price}", counted(scored.placement.lidars.len(), "LiDAR"))
    };
    format!(" ({}; here {})", words(rival), words(best))
}

/// Name of the objective that is the information gain itself.
const GAIN: &str = "information_gain";

/// Words that compare two values: the difference as a share of `theirs` with `above` or `below`, or `equal`. No share
/// is given where `theirs` is 0.
fn compare(ours: f64, theirs: f64, [above, below, equal]: [&str; 3]) -> String {
    if ours == theirs {
        return equal.to_owned();
    }
    let word = if ours > theirs { above } else { below };
    if theirs == 0.0 {
        return word.to_owned();
    }
    match 100.0 * (ours - theirs).abs() / theirs.abs() {
        percent if percent < 0.05 => format!("less than 0.1 % {word}"),
        percent => format!("{percent:.1} % {word}"),
    }
}

/// Sentence that compares the gain over the best baseline with the spread between scenes; `None` where there is nothing
/// to compare.
pub(crate) fn spread_in_words(run: &RunRecord) -> Option<String> {
    if let Some(spread) = &run.spread {
        return Some(spread.words.clone());
    }
    if run.scenes.iter().filter(|scene| !scene.mirrored).count() > 1 {
        return None;
    }
    let best = run.best.as_ref()?;
    let rival = Scored::yardstick(&run.baselines)?;
    Some(single_scene_in_words(best, rival, &run.objective))
}

/// Sentences on the difference from the best baseline in a single scene, which has no spread.
fn single_scene_in_words(best: &Scored, rival: &Scored, objective: &str) -> String {
    let name = &rival.placement.name;
    let (below, what) = match best.objective.partial_cmp(&rival.objective) {
        Some(Ordering::Greater) => (String::new(), "the lead over"),
        Some(Ordering::Less) => {
            let why = penalty_in_words(best, objective);
            (format!("By {objective} the result is below {name}{why}. "), "the difference from")
        }
        _ => (String::new(), "the tie with"),
    };
    let sensors = sensors_beside(best, rival);
    format!(
        "{below}One scene only: give several to see whether {what} {name}{sensors} holds elsewhere."
    )
}

/// True if a search takes a penalty for unseen cars off the objective.
fn is_penalized(best: &Scored, objective: &str) -> bool {
    let is_near = objective.parse::<Objective>().is_ok_and(|parsed| parsed.weighs_place());
    is_near && best.scores.range_card.is_some()
}

/// The penalty that a search takes off a near gain, after a comma; empty where it takes none off.
fn penalty_in_words(best: &Scored, objective: &str) -> String {
    if !is_penalized(best, objective) {
        return String::new();
    }
    format!(
        ", but a search ranks by {objective} less a penalty: the share of places around the vehicle at which too few beams meet a car"
    )
}

/// How far apart the climbs of the swaps ended; where none met all requirements and the result does, where that is from.
/// `None` without swaps.
pub(crate) fn climbs_in_words(run: &RunRecord) -> Option<String> {
    let is_met = run.best.as_ref().is_some_and(|best| best.scores.missing() == 0.0);
    let won = run.methods.iter().find(|method| method.won).map(|method| method.method);
    Some(climbs_and_result(run.climbs.as_ref()?, is_met, won))
}

fn climbs_and_result(climbs: &Climbs, is_met: bool, won: Option<&str>) -> String {
    let from = match won {
        Some("cma-es") => "the other method, CMA-ES",
        Some("swaps") | None => "moves after the climbs, over more frames and finer poses",
        Some("earlier sitting") => "an earlier sitting",
        Some(_) => "a layout that was given",
    };
    match climbs.met {
        Some(0) if is_met => format!("{climbs}. The result, which meets all, is from {from}"),
        _ => climbs.to_string(),
    }
}

/// Things that decide before the value: a move that makes more copies meet the requirements may cost value.
fn before_value_in_words(best: &Scored) -> &'static str {
    match (best.scores.required.is_empty(), best.scores.requirements_hold_in) {
        (true, _) => "guards",
        (false, None) => "requirements, then guards",
        (false, Some(_)) => "requirements, then copies that meet them, then guards",
    }
}

/// Objective that each search method reached, and which method gave the result.
pub(crate) fn methods_in_words(run: &RunRecord) -> String {
    let won = run.methods.iter().find(|method| method.won);
    let is_beaten = run.methods.iter().any(|m| won.is_some_and(|won| m.objective > won.objective));
    let is_penalized = run.best.as_ref().is_some_and(|best| is_penalized(best, &run.objective));
    let then = if is_penalized { ", and unseen cars take a penalty off the objective" } else { "" };
    let first = run.best.as_ref().map_or("guards", before_value_in_words);
    let each = run.methods.iter().map(|m| {
        let value = m.objective.map_or("nothing".into(), |m| value_in_words(&run.objective, m));
        let met = match m.requirements {
            [_, 0] => String::new(),
            [met, of] => format!(" with {met} of {of} requirements met"),
        };
        let won = match (m.won, is_beaten) {
            (true, true) => format!(" (the result: {first} come first{then})"),
            (true, false) => " (the result)".to_owned(),
            (false, _) => String::new(),
        };
        // Files have the shorter name.
        let of = if m.method == LAYOUT_GIVEN { "a baseline or start as given" } else { m.method };
        format!("{of} reached {value}{met}, {} poses cast{won}", m.poses_cast)
    });
    each.collect::<Vec<_>>().join("; ")
}

/// Bounds on placements that were not evaluated.
pub(crate) fn certificate_in_words(run: &RunRecord) -> String {
    match &run.certificate {
        None => "nothing is claimed about placements that were not evaluated".into(),
        Some(certificate) => {
            run.best.as_ref().map_or(String::new(), |best| bound_in_words(certificate, best))
        }
    }
}

/// Frames that result and baselines are scored over: `40 frames`, or `4 of 40 frames` where time or a wish to stop ended a
/// search early.
pub(crate) fn frames_in_words(scored: usize, all: usize) -> String {
    let frames = counted(all, "frame");
    if scored < all { format!("{scored} of {frames}") } else { frames }
}

/// How much better than the result another placement on a grid could be.
pub(crate) fn bound_in_words(certificate: &Certificate, best: &Scored) -> String {
    let is_chosen = best.placement.lidars.iter().any(|lidar| !lidar.sensor.is_none());
    let Some(gain) = &certificate.gain else { return certificate.gain_says.clone() };
    let heeds = gain.heeds.is_some();
    let says_so = certificate.gain_says.contains("with these sensors on their mounts");
    let words = [
        (is_chosen && !says_so, ", with these sensors on their mounts"),
        (!heeds && !best.scores.required.is_empty(), ", whether it meets requirements or not"),
        (heeds && best.scores.missing() > 0.0, "; the result misses requirements"),
    ];
    let said = words.iter().filter(|(is_so, _)| *is_so);
    format!("{}{}", certificate.gain_says, said.map(|(_, words)| *words).collect::<String>())
}

/// A text as one word of a shell: as it is, or between quotes where a shell would take it apart.
pub(crate) fn word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-/:=,+%".contains(c);
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

/// An absolute path as a command names it: relative where the file lies below the current folder.
pub(crate) fn from_here(path: &Path) -> String {
    let here = std::env::current_dir().ok();
    let below = here.and_then(|here| path.strip_prefix(here).ok());
    let below = below.map(Path::to_string_lossy);
    // A command takes a word with a dash in front for an option.
    let is_name = |below: &Cow<'_, str>| !below.is_empty() && !below.starts_with('-');
    below.filter(is_name).unwrap_or_else(|| path.to_string_lossy()).into_owned()
}

#[cfg(test)]
pub(super) mod tests;
