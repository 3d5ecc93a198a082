//! Sections of the page about LiDARs together: things by the number that sees them, the loss of each, overlap of pairs.

use maud::{Markup, html};

use super::layout::{table, table_of, text};
use super::{Figures, Subject};
use crate::job::Loss;
use crate::json::fixed;
use crate::report::ScoreColumn;
use crate::report::coverage::{redundancy_rows, technology_rows};
use crate::score::percent_down;
use sightline_files::json::counted;

/// Voxels, ground and targets by the number of LiDARs that see them, and by technology where the vehicle has several.
pub(super) fn redundancy(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some(found) = &figures.several.redundancy else { return html! {} };
    html! {
        section aria-labelledby="redundancy" {
            h2 #redundancy { "Seen by how many LiDARs" }
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
                    @for note in &figures.several.notes { "Note: " (note) ". " }
                }
                (table_of("Per cent seen by technologies", &technology_rows(all), |_| false))
            }
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
        row.extend(requires.then(|| text(loss.broken.len().to_string())));
        row.push(text(blind));
        (false, row)
    };
    let mut titles = vec!["lost", column.title()];
    titles.extend(requires.then_some("requirements that fail"));
    titles.push("blind °");
    let told = |loss: &Loss| loss.told().join("; ");
    html! {
        section aria-labelledby="lost" {
            h2 #lost { "If one LiDAR fails" }
            p {
                "Left when one LiDAR fails: " (column.title()) " (" (column.cell(&found.scores)) " with all)"
                @if requires { ", requirements that are met with all and fail without it (others are told as " code { "already" } ")" }
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
}

/// Words where nothing was lost, since it takes long.
fn not_lost(subject: &Subject<'_>) -> Markup {
    let lidars = subject.result.map_or(0, |best| best.placement.lidars.len());
    html! {
        @if lidars > 1 {
            section aria-labelledby="lost" {
                h2 #lost { "If one LiDAR fails" }
                p { "Not looked at here, since it takes long. " code { "sightline study loss" } " looks at it." }
            }
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
        section aria-labelledby="overlap" {
            h2 #overlap { "Overlap of the LiDARs" }
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
}
