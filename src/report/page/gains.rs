//! Gain by class and by distance.

use maud::{Markup, html};

use super::figures::Figures;
use super::parts::{bar, table, text};
use super::scores::near_gain;
use super::subject::Subject;
use crate::report::ScoreColumn;
use crate::report::view::sight::InformationShare;

/// Gain by class and by distance, against the best baseline.
pub(super) fn gains(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let Some(first) = figures.views.first() else { return html! {} };
    let rival = subject.rival().map(|rival| rival.placement.name.as_str());
    let place = subject.baselines.iter().position(|b| Some(b.placement.name.as_str()) == rival);
    let place = place.map(|index| index + 1);
    html! {
        section aria-labelledby="gains" {
            h2 #gains { "Where the gain comes from" }
            p {
                "Per cent of the information there is that the beams reach, over " (first.gains().frames)
                " frame(s)"
                @if let Some(name) = rival { "; the mark on a bar is " (name) ", the best baseline" }
                ". A voxel in which several classes occur counts with the rarest of them."
                @if let Some(meaning) = near_gain(ScoreColumn::argued(subject.objective)) {
                    " The near gain weighs this information: it is " (meaning) "."
                }
            }
            @for view in &figures.views {
                @if figures.views.len() > 1 { h3 { (view.scene()) } }
                (parts("By class", rival, place, &view.gains().by_class))
                (parts("By distance from the vehicle", rival, place, &view.gains().by_distance))
            }
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
    let rows: Vec<_> = parts.iter().map(row).collect();
    html! { (table(caption, &titles, &rows)) }
}
