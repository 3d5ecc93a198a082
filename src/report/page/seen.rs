//! Sections of the page about sight: range card, blind zone, maps from above, and LiDARs together.

use maud::{Markup, html};

use super::layout::{figure, prose, table, table_of, text};
use super::{Figures, Subject};
use crate::job::Loss;
use crate::json::{counted, fixed};
use crate::report::ScoreColumn;
use crate::report::coverage::{redundancy_rows, technology_rows};
use crate::report::losses::margin_points;
use crate::report::svg::trimmed;
use crate::report::targets::{
    overlap_in_words, range_card_rows, range_card_svgs, reach_in_words, sizes_in_words,
};
use crate::score::{Scores, Seen, percent_down};

/// Distances of detection, and the sectors in which the result is blind.
pub(super) fn range_card(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some((best, card)) =
        subject.result.and_then(|best| Some((best, best.scores.range_card.as_ref()?)))
    else {
        return html! {};
    };
    html! {
        @if card.blind.is_empty() {
            p { "A car is met by " (card.beams) " beams or more from 5 to " (trimmed(card.blind_between[1], 2)) " m all round, wherever it does not touch the own body." }
        } @else {
            p { "Blind sectors:" }
            ul.guards { @for sector in &card.blind { li { (prose(&sector.to_string())) } } }
        }
        p {
            "Metres from the vehicle's origin to the middle of a target "
            @match &card.ground {
                Some(ground) => { (prose(&ground.to_string())) ", which is not level, with nothing else in the way, at which " }
                None => "on level ground, alone, at which ",
            }
            (card.beams) " beams or more end at it, the own body in the way. Bearings count to the left from \
             straight ahead."
        }
        @if figures.has_moving_bodies && card.ground.is_none() {
            p { "Bodies of the vehicle move: range card and blind sectors are for frame 0." }
        }
        p.small {
            (sizes_in_words(card))
            @for words in overlap_in_words(card).into_iter().chain(reach_in_words(card)) { " " (prose(&words)) }
        }
        @if let Some(zone) = &best.scores.blind_zone {
            p {
                "Blind zone, ground straight before the body that no beam reaches, over "
                (counted(zone.frames() as usize, "frame")) ": " (prose(&zone.in_words())) "."
            }
        }
        @if let Some(words) = &figures.relief { p { "Note: " (prose(words)) "." } }
        div.polar {
            @for (title, svg) in range_card_svgs(&best.placement.name, card) { (figure(&svg, &title)) }
        }
        (table_of("Metres from the origin at which a target is met", &range_card_rows(card), |_| false))
    }
}

pub(super) fn near_field(figures: &Figures) -> Markup {
    html! {
        @match &figures.near_field {
            Ok(svg) => {
                p {
                    "From above, the front is right: ground within 10 m that no beam sees, and the blind zone: \
                     ground straight before an edge, up to the nearest ground within 0.5 m of a beam (corners are not counted), over " (counted(figures.near_frames, "frame")) " spread evenly"
                    @if figures.views.len() > 1 { " over the first scene" }
                    @if figures.has_moving_bodies { "; each side of the zone in the frame in which it is deepest" }
                    "."
                }
                (figure(svg, "Blind zone from above"))
            }
            Err(why) => p { "Not drawn: " (why) "." }
        }
    }
}

/// Information gained from above, scene by scene.
pub(super) fn maps(figures: &Figures) -> Markup {
    html! {
        @if !figures.maps.is_empty() {
            section #map aria-labelledby="seen" {
                h2 #seen { "Voxels seen, from above" }
                p.meaning {
                    "Information of each column of voxels: red where the beams gain it, grey where it stays \
                     unseen."
                }
                @for (scene, map) in &figures.maps {
                    @if figures.maps.len() > 1 { h3 { (scene) } }
                    div.paper.information { (figure(map, "Information gained, from above")) }
                }
                @if !figures.lidars.is_empty() { p { "Columns by the number of LiDARs that see a voxel of them." } }
                @for (scene, map) in &figures.lidars {
                    @if figures.maps.len() > 1 { h3 { (scene) } }
                    div.paper { (figure(map, "Columns by the number of LiDARs that see them, from above")) }
                }
            }
        }
    }
}

/// Voxels, ground and targets by the number of LiDARs that see them, and by technology where the vehicle has several.
pub(super) fn redundancy(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some(found) = &figures.several.redundancy else { return html! {} };
    html! {
        p {
            "Per cent of the voxels, of the ground near the vehicle and of the places of targets that no, one, two, and \
             three or more LiDARs see, over " (counted(found.frames, "frame"))
            @if figures.views.len() > 1 { " of the first scene" }
            ". A LiDAR sees a target with five beams or more of its own, at 5 to 50 m from the origin on level ground, and ground counts from the body."
        }
        (table_of("Per cent seen by a number of LiDARs", &redundancy_rows(found), |_| false))
        @if let Some(all) = &found.technologies {
            p {
                "Per cent by technology: seen by no technology (blind to all), by one, two, and three or more, and by \
                 each one. "
                @if !subject.conditions.is_empty() { "Other sensors see as in clear air. " }
                @for note in &figures.several.notes { "Note: " (prose(note)) ". " }
            }
            (table_of("Per cent seen by technologies", &technology_rows(all), |_| false))
        }
    }
}

/// Score, requirements and blind sectors without each LiDAR.
pub(super) fn losses(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some(found) = &figures.several.losses else { return not_lost(subject) };
    let column = ScoreColumn::argued(subject.objective);
    let requires = !found.scores.required.is_empty();
    let row = |loss: &Loss| {
        let blind = loss.blind_degrees().map_or("–".into(), |degrees| fixed(degrees, 0));
        let mut row = vec![text(&loss.name), text(column.cell(&loss.scores))];
        if requires {
            row.extend([text(loss.broken.len().to_string()), text(least_margin(&loss.scores))]);
        }
        row.push(text(blind));
        (false, row)
    };
    let mut titles = vec!["lost", column.title()];
    if requires {
        titles.extend(["requirements that fail", "least margin, percentage points"]);
    }
    titles.push("blind °");
    let told = |loss: &Loss| loss.told().join("; ");
    html! {
        p {
            "Left when one LiDAR fails: " (column.title()) " (" (column.cell(&found.scores)) " with all)"
            @if requires {
                ", requirements that are met with all and fail without it (others are told as " code { "already" } ")"
                ", the requirement with the least margin (found less required)"
            }
            ", and the width of all blind sectors."
        }
        (table("Left when one LiDAR fails", &titles, found.losses.iter().map(row)))
        ul.guards {
            @for loss in found.losses.iter().filter(|loss| !told(loss).is_empty()) {
                li { b { "without " (loss.name) } ": " (told(loss)) }
            }
        }
    }
}

/// The requirement with the least margin, found less required: `−1.2 (child)`.
fn least_margin(scores: &Scores) -> String {
    let margin = |seen: &&Seen| seen.share - seen.least;
    let least = scores.required.iter().min_by(|a, b| margin(a).total_cmp(&margin(b)));
    least.map_or_else(String::new, |seen| {
        format!("{} ({})", margin_points(seen.share, seen.least), seen.name)
    })
}

/// Words where nothing was lost, since it takes long.
fn not_lost(subject: &Subject<'_>) -> Markup {
    let lidars = subject.result.map_or(0, |best| best.placement.lidars.len());
    html! {
        @if lidars > 1 {
            p { "Not looked at here, since it takes long. " code { "sightline study loss" } " looks at it." }
        }
    }
}

/// Overlap of every pair of LiDARs in per cent, and whether pairs connect all of them.
pub(super) fn overlap(figures: &Figures) -> Markup {
    let Some(found) = &figures.several.overlap else { return html! {} };
    let count = found.lidars.len();
    let names = (0..count).map(|lidar| lidar.to_string());
    let titles: Vec<String> = std::iter::once("LiDAR".to_owned()).chain(names).collect();
    let percent = |share: f64| format!("{:.1}", percent_down(share));
    let row = |a: usize| {
        let cells = (0..count).map(|b| match a == b {
            true => text("–"),
            false => text(percent(found.overlap[a][b])),
        });
        (false, std::iter::once(text(&titles[a + 1])).chain(cells).collect())
    };
    html! {
        p {
            @if found.overlap_up_to > 0.0 {
                "All LiDARs can be calibrated through pairs that overlap by " (percent(found.overlap_up_to)) " % or more."
            } @else {
                "Not all LiDARs can be calibrated against each other: no chain of pairs connects them."
            }
            " Overlap: surface voxels that two LiDARs share, as a share of those of the LiDAR that has fewer, over "
            (counted(found.frames, "frame")) "."
        }
        (table("Overlap of each pair, %", &titles, (0..count).map(row)))
    }
}
