//! A front in words: its sentences, and its table as text.

use super::{
    FrontRecord, REQUIRED, all_shown, blind_in_words, copies, front_rows, has_copies,
    has_requirements,
};
use crate::job::{Front, FrontPoint, FrontStopped};
use crate::json::counted;
use crate::report::columns::align_with_notes;
use crate::report::svg::trimmed;
use crate::scan::conditions::under;
use crate::score::{Seen, percent_down, percent_up};

/// The requirement that a point misses most, and how many it misses; `None` where it misses none.
fn most_missed(point: &FrontPoint) -> Option<(&Seen, usize)> {
    let missed: Vec<&Seen> = point.scores.required.iter().filter(|seen| !seen.is_met()).collect();
    let short = |seen: &Seen| seen.least - seen.share;
    // The first of equal ones.
    let most = missed.iter().rev().max_by(|a, b| short(a).total_cmp(&short(b)))?;
    Some((*most, missed.len()))
}

/// Line below the row of a point that misses a requirement.
fn missed_in_words(point: &FrontPoint) -> Option<String> {
    let (most, count) = most_missed(point)?;
    let Seen { share, done, least, .. } = most;
    let [share, least] = [percent_down(*share), percent_up(*least)];
    let more = match count {
        1 => String::new(),
        count => format!(", and {}", counted(count - 1, "more requirement")),
    };
    Some(format!("  ! {}: {share:.1} % {done}, {least:.1} % required{more}", most.title()))
}

/// `met`, or the requirement that a point misses most.
pub(super) fn met_in_words(point: &FrontPoint) -> String {
    match most_missed(point) {
        Some((most, _)) => {
            let [share, least] = [percent_down(most.share), percent_up(most.least)];
            format!("NOT MET: {}, {share:.1} of {least:.1} %", most.title())
        }
        None if point.meets => "met".to_owned(),
        None => "NOT MET".to_owned(),
    }
}

/// Names of the objectives in a sentence: `price and near gain`.
pub(super) fn names_in_words(front: &Front) -> String {
    let names: Vec<String> =
        front.objectives.names().iter().map(|name| name.replace('_', " ")).collect();
    match names.split_last() {
        Some((last, first)) if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => names.concat(),
    }
}

/// The front in sentences: how many points, and which is the cheapest that meets all requirements.
pub(in crate::report) fn front_verdict(front: &Front) -> String {
    let names = names_in_words(front);
    let each = if front.objectives.all().len() == 2 { "both" } else { "all of them" };
    let mut words = match front.points.len() {
        0 => return format!("No placement was found by {names}"),
        1 => {
            format!("One placement is the best in each of {}", front.objectives.names().join(", "))
        }
        count if has_requirements(front) => format!(
            "{count} placements by {names}. No other placement found is better in {each} and meets the requirements as \
             well"
        ),
        count => {
            format!("{count} placements by {names}. No other placement found is better in {each}")
        }
    };
    if has_requirements(front) {
        let met = front.points.iter().filter(|point| point.meets);
        let cheapest = met.min_by(|a, b| a.price.total_cmp(&b.price));
        words += &match cheapest {
            Some(point) => {
                let held = copies(point).map_or(String::new(), |share| {
                    let on_paper = point.scores.holds_on_paper().map_or("in", |_| "on paper only:");
                    format!(
                        ", {on_paper} {} % of copies mounted within the tolerance",
                        percent_down(share)
                    )
                });
                let (price, name) = (trimmed(point.price, 2), &point.placement.name);
                let found = if front.is_whole { "" } else { " found" };
                format!(
                    ". The cheapest{found} that meets all requirements costs {price} ({name}{held})"
                )
            }
            None => ". NOT MET: no point meets all requirements".to_owned(),
        };
    }
    words
}

/// Sentence on how far the poses of the points were searched, and how one is refined.
pub(in crate::report) fn refined_in_words(front: &Front, record: &FrontRecord) -> String {
    let refined = match record.settings["search"]["evaluations"].as_u64() {
        Some(evaluations) if evaluations > 0 => {
            let as_far = match front.stopped {
                FrontStopped::Complete => "",
                FrontStopped::Time | FrontStopped::Interrupted => ", as far as the time allowed",
            };
            format!("poses of the points were searched with {evaluations} evaluations each{as_far}")
        }
        _ => "points of the front stand on the coarse grid of poses and are not refined".to_owned(),
    };
    match front.points.iter().any(|point| point.price > 0.0) {
        true => format!("{refined}; `sightline optimize` with --budget PRICE refines one"),
        false => refined,
    }
}

/// The table of a front as text: below each row the requirement that is missed most, below all the picks and the baselines.
pub(super) fn front_table(front: &Front) -> String {
    let mut rows = front_rows(front);
    // Names of requirements would make the column as wide as a line.
    let requirements = rows[0].iter().position(|title| title == REQUIRED);
    let mut notes: Vec<Vec<String>> = Vec::new();
    for (row, point) in rows.iter_mut().skip(1).zip(all_shown(front)) {
        row.pop();
        if let Some(cell) = requirements.map(|column| &mut row[column]) {
            cell.truncate(cell.find(':').unwrap_or(cell.len()));
        }
        notes.push(missed_in_words(point).into_iter().collect());
    }
    rows[0].pop();
    let picks = front.picks.iter().map(|(pick, point)| {
        let name = &front.points[*point].placement.name;
        format!("{pick}: {name}\n")
    });
    let baselines = front.baselines.iter().map(|of| format!("baseline: {}\n", of.placement.name));
    let named: String = picks.chain(baselines).collect();
    let gap = if named.is_empty() { "" } else { "\n" };
    format!("{}{gap}{named}", align_with_notes(&rows, &notes))
}

/// A front and its folder as text: the sentence, the table, the picks, the sensors of each point.
pub(crate) fn front_text(front: &Front, record: &FrontRecord, folder: &std::path::Path) -> String {
    let mut text = format!("{}\n\n", front_verdict(front));
    if !front.points.is_empty() {
        let under = under(&record.conditions);
        text +=
            &format!("{}: front of {}{under}\n", record.scene, front.objectives.names().join(", "));
        text += &front_table(front);
        text += "\nsensors\n";
        for point in all_shown(front) {
            text += &format!("  {}: {}\n", point.placement.name, point.equipment);
        }
        if has_copies(front) {
            text += "\ncopies %: copies mounted within the tolerance that meet all requirements; ";
        } else {
            text += "\n";
        }
        text += &format!("{}\n", blind_in_words(front));
        text += &format!("{}\n", refined_in_words(front, record));
    }
    text + &format!(
        "\nstopped: {}, after {} placements scored over all frames in {:.1} s on {}; report: {}\n",
        record.stopped,
        record.scored,
        record.seconds,
        record.backend,
        folder.join("report.html").display()
    )
}
