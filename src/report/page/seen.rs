//! Section of the page about sight: range card, blind zone, and the maps from above.

use maud::{Markup, html};

use super::layout::{figure, prose, table_of};
use super::{Figures, Subject};
use crate::report::svg::trimmed;
use crate::report::targets::{
    overlap_in_words, range_card_rows, range_card_svgs, reach_in_words, sizes_in_words,
};
use sightline_files::json::counted;

/// Distances of detection, and the sectors in which the result is blind.
pub(super) fn range_card(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some((best, card)) =
        subject.result.and_then(|best| Some((best, best.scores.range_card.as_ref()?)))
    else {
        return html! {};
    };
    html! {
        section aria-labelledby="range" {
            h2 #range { "Range card" }
            @if card.blind.is_empty() {
                p { "A car is met by " (card.beams) " beams or more from 5 to " (trimmed(card.blind_between[1], 2)) " m all round, wherever it does not touch the own body." }
            } @else {
                p { "Blind sectors:" }
                ul.guards { @for sector in &card.blind { li { (sector.to_string()) } } }
            }
            p {
                "Metres from the vehicle's origin to the middle of a target on level ground, alone, at which "
                (card.beams) " beams or more end at it, the own body in the way. Bearings count to the left from \
                 straight ahead."
            }
            @if figures.has_moving_bodies {
                p { "Bodies of the vehicle move: range card and blind sectors are for frame 0." }
            }
            p.small {
                (sizes_in_words(card))
                @for words in overlap_in_words(card).into_iter().chain(reach_in_words(card)) { " " (words) }
            }
            @if let Some(words) = &figures.relief { p { "Note: " (prose(words)) "." } }
            div.polar {
                @for (title, svg) in range_card_svgs(&best.placement.name, card) { (figure(&svg, &title)) }
            }
            (table_of("Metres from the origin at which a target is met", &range_card_rows(card), |_| false))
        }
    }
}

/// The blind zone from above.
pub(super) fn near_field(figures: &Figures) -> Markup {
    html! {
        section aria-labelledby="near" {
            h2 #near { "Ground near the vehicle" }
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
