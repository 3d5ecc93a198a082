//! The result against every baseline: differences with intervals, guards in words, all scores, each scene.

use maud::{Markup, html};

use super::layout::{bar, difference, prose, table, table_of, text};
use super::{Figures, Subject};
use crate::json::counted;
use crate::report::tables::rows_by_scene;
use crate::report::text::{Against, COUNTED_FROM, against as compared, value_in_words};
use crate::report::view::sight::InformationShare;
use crate::report::warnings::{KINDS, kinds_beside};
use crate::report::{RunRecord, ScoreColumn};
use crate::score::{HOLDS, Scores, Seen, percent_down, percent_up};
use crate::search::{MANY_SCENES, Scored};

/// The gain over each baseline, or the near gain where that was maximized.
pub(super) fn against(subject: &Subject<'_>, run: Option<&RunRecord>) -> Markup {
    let Some(best) = subject.result else { return html! {} };
    let seed = run.map_or(1, |run| run.seed);
    let column = ScoreColumn::argued(subject.objective);
    let all = compared(best, subject.baselines, subject.scenes, seed, column);
    let several = !subject.scenes.is_empty();
    // A rig that was given has a name; one that was found is the result.
    let who = if run.is_some() { "the result" } else { &*best.placement.name };
    let caption = format!(
        "Percentage points that {who} gains more than each baseline, or less where negative"
    );
    let places = subject.scenes.iter().filter(|scene| !scene.mirrored).count();
    let (titles, rows) = rows_against(subject, best, &all, who);
    html! {
        @if !all.is_empty() {
            p {
                @if near_gain(column).is_some() {
                    a href="#near-gain" { "Near gain" } ", in per cent of what "
                } @else {
                    "Information gained, in per cent of what "
                }
                (if several { "the scenes hold, a mean over them" } else { "the scene holds" })
                ": " (who) " has "
                (column.cell(&best.scores)) " %. "
                @if several {
                    "The interval resamples the " (places) " scenes: one that does not hold 0 is more than their \
                     own spread"
                    @if places < MANY_SCENES { "; so few make it too narrow rather than too wide" }
                    "."
                } @else {
                    "One scene gives no interval: give several to learn whether a difference is more than \
                     the scenes' own spread."
                }
            }
            (table(&caption, &titles, rows))
        }
    }
}

/// Titles and rows of the result against some baselines, with the warnings of these where any has one.
fn rows_against(
    subject: &Subject<'_>,
    best: &Scored,
    all: &[Against<'_>],
    who: &str,
) -> (Vec<&'static str>, Vec<(bool, Vec<Markup>)>) {
    let ends = |one: &Against| one.interval.map_or([one.difference; 2], |i| [i.low, i.high]);
    let widest = all.iter().flat_map(ends).map(f64::abs).fold(1e-12, f64::max);
    let several = !subject.scenes.is_empty();
    let titles = [
        "",
        ScoreColumn::argued(subject.objective).title(),
        "more by",
        "95 % interval",
        "",
        "warnings",
    ];
    let as_here = format!("as {who}");
    let warned = |name: &str| {
        let of = subject.baselines.iter().find(|baseline| baseline.placement.name == name);
        of.map(|of| kinds_beside(of, best, &as_here)).unwrap_or_default()
    };
    let is_warned = all.iter().any(|one| !warned(one.name).is_empty());
    let percent = |share: f64| format!("{:+.2}", 100.0 * share);
    let rows = all.iter().map(|one| {
        let interval = one.interval.map(|i| [i.low, i.high]);
        let words = interval
            .map_or("–".into(), |[low, high]| format!("{} to {}", percent(low), percent(high)));
        let scaled = interval.map(|ends| ends.map(|end| end / widest));
        let mut row = vec![text(one.name), text(format!("{:.2}", 100.0 * one.gain))];
        row.push(text(percent(one.difference)));
        row.extend(several.then(|| text(words)));
        row.push(difference(one.difference / widest, scaled));
        row.extend(is_warned.then(|| text(warned(one.name))));
        (false, row)
    });
    let rows = rows.collect();
    let is_shown = |title: &&str| match *title {
        "95 % interval" => several,
        "warnings" => is_warned,
        _ => true,
    };
    (titles.into_iter().filter(is_shown).collect(), rows)
}

const NEAR_GAIN: &str = "Near gain: share of the scene's uncertainty that beams reach. Beyond 10 m a voxel counts less the \
                         farther it is. Ground within 10 m makes up a fifth of the score.";

/// More of the meaning of a near gain; `None` of another score.
fn near_gain(column: ScoreColumn) -> Option<&'static str> {
    match column {
        ScoreColumn::NearGain => Some(""),
        ScoreColumn::NearGain2 => {
            Some(" Each voxel counts for every LiDAR that covers it, up to two.")
        }
        ScoreColumn::NearGain3 => {
            Some(" Each voxel counts for every LiDAR that covers it, up to three.")
        }
        _ => None,
    }
}

/// All that is said against the result and the baselines, by name.
pub(super) fn guards(subject: &Subject<'_>, run: Option<&RunRecord>) -> Markup {
    let all = subject.result.iter().copied().chain(subject.baselines);
    let spoken: Vec<(&Scored, Vec<String>)> =
        all.map(|scored| (scored, scored.warnings())).filter(|(_, why)| !why.is_empty()).collect();
    // A rig that was given has a name; one that was found is the result.
    let who = subject.result.filter(|_| run.is_none());
    let who = who.map_or("the result", |best| &*best.placement.name);
    let others = if subject.baselines.is_empty() { " keeps" } else { " and every baseline keep" };
    let passed = if subject.baselines.is_empty() { "passes" } else { "pass" };
    html! {
        @if spoken.is_empty() {
            p { "None: " (who) (others) " all rules and " (passed) " all checks." }
        } @else {
            @if subject.result.is_some_and(|best| best.warnings().is_empty()) {
                p { "Warnings of " (who) ": none. Some baselines have warnings." }
            }
            p { (meaning(&spoken)) }
            ul.guards {
                @for (scored, why) in &spoken {
                    li { b { (scored.placement.name) } ": " (prose(&why.join("; "))) }
                }
            }
        }
    }
}

/// Meaning of the listed kinds of warnings for a score.
fn meaning(spoken: &[(&Scored, Vec<String>)]) -> String {
    let kinds = |is_doubt: bool| {
        let kinds = KINDS.iter().filter(move |kind| kind.is_doubt == is_doubt);
        let told = kinds.filter(|kind| spoken.iter().any(|(scored, _)| (kind.is)(scored)));
        told.map(|kind| kind.many).collect::<Vec<_>>()
    };
    let says = |what: &str, kinds: Vec<&str>| {
        (!kinds.is_empty()).then(|| format!("{what}: {}.", kinds.join(" and ")))
    };
    let doubts = says("Reasons not to believe a score", kinds(true));
    let facts = says("Facts about a rig, which do not make its score doubtful", kinds(false));
    doubts.into_iter().chain(facts).collect::<Vec<_>>().join(" ")
}

pub(super) fn scores(subject: &Subject<'_>) -> Markup {
    let all = || subject.result.into_iter().chain(subject.baselines);
    let columns = ScoreColumn::shown(all().map(|scored| &scored.scores), subject.objective);
    let mut titles: Vec<&str> = columns.iter().map(|column| column.title()).collect();
    let argued = ScoreColumn::argued(subject.objective);
    titles.push("objective");
    let row = |(scored, is_best): (&Scored, bool)| {
        let mut cells: Vec<Markup> =
            columns.iter().map(|column| text(column.cell(&scored.scores))).collect();
        let said = |value| value_in_words(subject.objective, value);
        cells.push(text(scored.objective.map_or("–".into(), said)));
        (is_best, cells)
    };
    let result = subject.result.into_iter().map(|best| (best, true));
    let rows = result.chain(subject.baselines.iter().map(|b| (b, false))).map(row);
    let caption = match subject.baselines {
        [] => "Scores of this rig",
        _ => "Scores of the result and the baselines",
    };
    html! {
        (table(caption, &titles, rows))
        p.small {
            "Scores are means over frames; larger is better. The gain is ΣH over covered voxels, in nats: \
             the more of what changes in the scene the beams reach, the larger it is. M-SOG is the negative \
             mean of the gain, −(1/N)·ΣH, and can be raised by looking at what never changes. The objective is " code { (subject.objective) } "."
        }
        p.small #near-gain {
            (NEAR_GAIN) (near_gain(argued).unwrap_or_default()) " It is the default for the near ground that its optima \
             see, not for what learners recognize."
        }
    }
}

pub(super) fn scenes(subject: &Subject<'_>) -> Markup {
    let column = ScoreColumn::argued(subject.objective);
    let rows = rows_by_scene(subject.scenes, subject.result, subject.baselines, subject.objective);
    let Some(rows) = rows else { return html! {} };
    let caption = match near_gain(column) {
        Some(_) => "Near gain in each scene",
        None => "Share of each scene's information that is gained",
    };
    html! {
        (table_of(caption, &rows, |index| index == 0 && subject.result.is_some()))
        p.small {
            "Over all is the mean, each scene counting the same; the gain in nats above is the share of the \
             information times the mean total."
        }
    }
}

/// Gain by class and by distance, against the best baseline.
pub(super) fn gains(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some(first) = figures.views.first() else { return html! {} };
    let rival = subject.rival().map(|rival| rival.placement.name.as_str());
    let place = subject.baselines.iter().position(|b| Some(b.placement.name.as_str()) == rival);
    let place = place.map(|index| index + 1);
    html! {
        p {
            "Per cent of the information there is that the beams reach, over "
            (counted(first.sight.gains.frames, "frame"))
            @if let Some(name) = rival { "; the mark on a bar is " (name) ", the best baseline" }
            ". A voxel in which several classes occur counts with the rarest of them."
            @if near_gain(ScoreColumn::argued(subject.objective)).is_some() {
                " The " a href="#near-gain" { "near gain" } " weighs this information."
            }
        }
        @for view in &figures.views {
            @if figures.views.len() > 1 { h3 { (view.scene) } }
            (parts("By class", rival, place, &view.sight.gains.by_class))
            (parts("By distance from the vehicle", rival, place, &view.sight.gains.by_distance))
        }
    }
}

fn parts(
    caption: &str,
    rival: Option<&str>,
    place: Option<usize>,
    parts: &[InformationShare],
) -> Markup {
    let mut titles = vec!["", "nats there", "gained %"];
    titles.extend(rival);
    titles.push("");
    let row = |part: &InformationShare| {
        let share = |layout: usize| part.gained[layout] / part.total.max(f64::MIN_POSITIVE);
        let percent = |share: f64| text(format!("{:.1}", 100.0 * share));
        let mut row = vec![text(&part.name), text(format!("{:.0}", part.total)), percent(share(0))];
        row.extend(place.map(|place| percent(share(place))));
        row.push(bar(share(0), place.map(share)));
        (false, row)
    };
    table(caption, &titles, parts.iter().map(row))
}

/// Baselines that stand beside the result, at most.
const BESIDE: usize = 3;

/// Requirements that most vehicles have, as lines of a vehicle file.
const USUAL: &str = r#""require": [
  { "target": "child", "within": 40, "bearing": [-60, 60], "share": 0.95 },
  { "target": "car", "within": 50, "share": 0.95, "without_any_one": true },
  { "ground": 3, "share": 0.9 } ]"#;

/// Requirements of the result and of the first baselines.
pub(super) fn required(subject: &Subject<'_>) -> Markup {
    let Some(best) = subject.result else { return html! {} };
    let all = &best.scores.required;
    html! {
        @if !all.is_empty() {
            div.required { (met_or_not(best, subject.baselines)) }
            p.small { (COUNTED_FROM) }
            ul.guards {
                @for seen in all.iter().filter(|seen| has_more_to_tell(seen)) { li { (prose(&seen.to_string())) } }
            }
            @if let Some(words) = best.scores.holds_in_words() { p { (prose(&words)) "." } }
            @if let Some(words) = breaks_first(all) { p { (prose(&words)) "." } }
            @if let Some([mm, deg]) = best.scores.copies_off {
                p.small { "Copies are mounted up to " (mm) " mm and " (deg) "° off, at random." }
            }
            @if !subject.tolerance.is_empty() {
                p { "How far each LiDAR may be off, and the body may tilt, until a requirement breaks:" }
                pre.wide tabindex="0" role="group" aria-label="Command for tolerances" {
                    code { (subject.tolerance) }
                }
            }
        }
    }
}

/// Requirements to begin with, for a subject that has none and where beams end at surfaces.
pub(super) fn usual(subject: &Subject<'_>) -> Markup {
    let scores = subject.result.map(|best| &best.scores);
    let has_none = |scores: &&Scores| scores.required.is_empty() && scores.range_card.is_some();
    html! {
        @if scores.filter(has_none).is_some() {
            p {
                "The score alone decided. Three requirements that most vehicles have, as lines of a vehicle file: a \
                 child ahead, a car all round whichever LiDAR fails, and the ground near the body. Fit the numbers \
                 to your operational domain."
            }
            pre { (USUAL) }
        }
    }
}

/// The met requirement that fewest copies within the mounting tolerance meet, in words; `None` of one requirement, where every
/// copy meets all, or where nobody looked.
fn breaks_first(required: &[Seen]) -> Option<String> {
    let met = required.iter().filter(|seen| seen.is_met());
    let held = met.filter_map(|seen| Some((seen, seen.holds_in?)));
    let (seen, share) = held.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (required.len() > 1 && share < 1.0).then(|| {
        let (title, percent) = (seen.title(), percent_down(share));
        format!("In copies mounted a little off {title} breaks first: {percent:.1} % meet it")
    })
}

/// True if a requirement is not met, misses places, is met by too few copies within the mounting tolerance, or has another
/// share at places closer together.
fn has_more_to_tell(seen: &Seen) -> bool {
    let is_on_paper = seen.holds_in.is_some_and(|share| share < HOLDS);
    !seen.is_met() || seen.missing.is_some() || is_on_paper || seen.told_between().is_some()
}

fn met_or_not(best: &Scored, baselines: &[Scored]) -> Markup {
    let has_all = |of: &&Scored| of.scores.required.len() == best.scores.required.len();
    let beside: Vec<&Scored> = baselines.iter().filter(has_all).take(BESIDE).collect();
    let mut titles = vec!["", "", "found %", "required %", "margin"];
    // Without a mounting tolerance nobody looked at copies.
    let has_copies = best.scores.required.iter().any(|seen| seen.holds_in.is_some());
    titles.extend(has_copies.then_some("copies that hold %"));
    titles.extend(beside.iter().map(|of| &*of.placement.name));
    let per_cent = |share: f64| format!("{:.1}", percent_down(share));
    let rows = best.scores.required.iter().enumerate().map(|(k, seen)| {
        let mut row = vec![text(seen.title()), text(if seen.is_met() { "met" } else { "NOT MET" })];
        let all = |share: f64| format!(" ({} with all LiDARs)", per_cent(share));
        let intact = seen.lost.as_ref().map(|lost| all(lost.intact));
        let worst = seen.worst_frame.map_or(String::new(), |worst| worst.beside(seen.share));
        row.push(text(per_cent(seen.share) + &intact.unwrap_or_default() + &worst));
        // The margin is the difference of the numbers beside it.
        let least = percent_up(seen.least);
        row.push(text(format!("{least:.1}")));
        row.push(text(format!("{:+.1}", percent_down(seen.share) - least)));
        let copies = || seen.holds_in.map_or("–".into(), |share| percent_down(share).to_string());
        row.extend(has_copies.then(|| text(copies())));
        row.extend(beside.iter().map(|of| text(per_cent(of.scores.required[k].share))));
        (false, row)
    });
    table(
        "Requirements of the vehicle; margins in percentage points; baselines found %",
        &titles,
        rows,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::words::tests::planted;
    use crate::score::Guard;
    use crate::targets::BlindSector;

    #[test]
    fn missed_places_of_met_requirements_are_told() {
        let mut best = planted("found", 1.0, 500.0);
        let words = "missing at 25 m: 2 of 48 bearings, 172.5° to 180°";
        let car = Seen { missing: Some(words.to_owned()), ..Seen::of("car", 0.95) };
        let between = |found: f64| Some(crate::score::Between { places: 375, found });
        let tyre = Seen { between: between(0.981), ..Seen::of("tyre", 1.0) };
        let child = Seen { between: between(1.0), ..Seen::of("child", 1.0) };
        best.scores.required = vec![car, tyre, child];
        let subject = Subject::given("s", &[], &best, &[], "near_gain", String::new());
        let said = required(&subject).into_string();
        let item = format!("<li>car: 95.0 % seen, 90.0 % required; {words}</li>");
        let closer =
            "<li>tyre: 100.0 % seen, 90.0 % required; 98.1 % at 375 places closer together</li>";
        assert!(said.contains(&item) && said.contains(closer), "{said}");
        assert_eq!(said.matches("<li>").count(), 2, "{said}");
    }

    #[test]
    fn the_requirement_that_fewest_copies_meet_breaks_first() {
        let held = |name: &str, share: f64, holds_in: f64| Seen {
            holds_in: Some(holds_in),
            ..Seen::of(name, share)
        };
        // A requirement that is not met breaks in no copy.
        let some = [held("car", 1.0, 0.97), held("child", 0.95, 0.8), held("ground", 0.1, 0.0)];
        let words = "In copies mounted a little off child breaks first: 80.0 % meet it";
        assert_eq!(breaks_first(&some).as_deref(), Some(words));
        assert_eq!(breaks_first(&[held("car", 1.0, 1.0), held("child", 1.0, 1.0)]), None);
        assert_eq!(breaks_first(&[held("car", 1.0, 0.8)]), None);
        assert_eq!(breaks_first(&[Seen::of("car", 1.0), Seen::of("child", 1.0)]), None);
    }

    #[test]
    fn warnings_of_baselines_are_told_where_the_result_has_none() {
        let (best, mut center) = (planted("found", 1.0, 500.0), planted("Center", 0.5, 400.0));
        let plain = center.clone();
        let sector = BlindSector::lost([-15.0, 15.0], [20.0, 25.0]);
        center.scores.guards = vec![Guard::BlindSector(sector)];
        let told = |best: &Scored, baselines: &[Scored]| {
            let subject = Subject::given("s", &[], best, baselines, "near_gain", String::new());
            guards(&subject, None).into_string()
        };
        let mut plain_rig = plain.clone();
        plain_rig.placement.name = "Line".to_owned();
        let said = told(&best, &[plain, center.clone()]);
        assert!(said.contains("Warnings of found: none. Some baselines have warnings."), "{said}");
        let words = "<b>Center</b>: BLIND: ahead (in the sector of 30° from -15° to 15°)";
        assert!(said.contains(words) && said.matches("<li>").count() == 1, "{said}");
        assert!(!said.contains("Reasons not to believe"), "{said}");
        // The comparison says so, too, and that the result has the same.
        const GAIN: &str = "information_gain";
        let table = |best: &Scored| {
            let baselines = [plain_rig.clone(), center.clone()];
            let subject = Subject::given("s", &[], best, &baselines, GAIN, String::new());
            against(&subject, None).into_string()
        };
        assert!(table(&best).contains("<td>blind sector</td>"), "{}", table(&best));
        let mut blind = best.clone();
        blind.scores.guards.clone_from(&center.scores.guards);
        assert!(table(&blind).contains("<td>blind sector, as found</td>"), "{}", table(&blind));
        assert!(told(&best, &[]).contains("None: found keeps all rules and passes all checks."));
        center.violations = vec!["LiDAR 0: z is 1 outside the mount".to_owned()];
        let said = told(&center, &[]);
        assert!(said.contains("Reasons not to believe a score: broken rules. Facts"), "{said}");
        assert!(!said.contains("baseline"), "{said}");
    }
}
