//! Distances at which targets are met, by bearing: as text, and as polar plots for a slide.

use maud::{Markup, html};

use super::svg::{COLOURS, FAINT, INK, SOFT, corners, page, px, trimmed};
use super::text::align_columns;
use crate::maths;
use crate::targets::{
    BlindSector, Detection, RangeCard, TargetQuestion, TargetRanges, TargetTable,
};

/// Pixels of a panel, of the radius of its circle, of its title.
const PANEL: f64 = 400.0;
const RADIUS: f64 = 150.0;
const TITLE: f64 = 44.0;
/// Panels beside each other.
const COLUMNS: usize = 3;
/// Bearing of the labels of circles, between two of sixteen bearings, in degrees; and the halo around them.
const LABELS: f64 = -11.25;
const PAPER: &str = "#fff";
/// Circles of a panel.
const RINGS: usize = 4;
/// Widest wedge of a bearing, in degrees, and the share of it that is drawn.
const WIDEST: f64 = 22.5;
const DRAWN: f64 = 0.86;

/// One bearing of one target: where it is met.
struct MetRuns<'a> {
    target: &'a str,
    bearing: f64,
    runs: &'a [[f64; 2]],
}

/// Runs of distances in metres: `2.5–60, 80`; a dash where there are none.
fn runs_in_words(runs: &[[f64; 2]]) -> String {
    let metres = |value: f64| trimmed(value, 2);
    let run = |[from, to]: &[f64; 2]| match from == to {
        true => metres(*from),
        false => format!("{}–{}", metres(*from), metres(*to)),
    };
    match runs {
        [] => "–".to_owned(),
        runs => runs.iter().map(run).collect::<Vec<_>>().join(", "),
    }
}

/// Name of a bearing in degrees: `ahead`, `left`, `-45°`.
fn bearing_in_words(bearing: f64) -> String {
    let turned = (bearing + 180.0).rem_euclid(360.0) - 180.0;
    match turned {
        0.0 => "ahead 0°".to_owned(),
        90.0 => "left 90°".to_owned(),
        -90.0 => "right -90°".to_owned(),
        -180.0 => "behind 180°".to_owned(),
        _ => format!("{}°", trimmed(turned, 2)),
    }
}

/// A line a bearing, a column a target.
fn block(met: &[MetRuns<'_>]) -> String {
    let mut targets: Vec<&str> = Vec::new();
    let mut bearings: Vec<f64> = Vec::new();
    for one in met {
        if !targets.contains(&one.target) {
            targets.push(one.target);
        }
        if !bearings.contains(&one.bearing) {
            bearings.push(one.bearing);
        }
    }
    let title = std::iter::once("bearing".to_owned());
    let mut rows = vec![title.chain(targets.iter().map(|t| format!("{t} m"))).collect::<Vec<_>>()];
    for bearing in bearings {
        let mut row = vec![bearing_in_words(bearing)];
        row.extend(targets.iter().map(|target| {
            let of = met.iter().find(|one| one.target == *target && one.bearing == bearing);
            of.map_or_else(String::new, |one| runs_in_words(one.runs))
        }));
        rows.push(row);
    }
    align_columns(&rows)
}

/// Every bearing of every target of a card.
fn of_card(card: &RangeCard) -> Vec<MetRuns<'_>> {
    let of_target = card.targets.iter().map(|target| (&*target.target, &target.bearings));
    let all = of_target.flat_map(|(target, bearings)| {
        bearings.iter().map(move |of| MetRuns { target, bearing: of.bearing, runs: &of.met })
    });
    all.collect()
}

/// The range card of a placement: a line a bearing.
pub fn range_card_text(card: &RangeCard) -> String {
    let on_card = |sector: &&BlindSector| {
        let bearings = card.targets.first().map_or(&[][..], |target| &target.bearings);
        !bearings.iter().any(|of| of.bearing == sector.worst)
    };
    let between = card.blind.iter().filter(on_card);
    let between: String = between
        .map(|sector| {
            let (bearing, lost) = (bearing_in_words(sector.worst), runs_in_words(&sector.lost));
            format!("between these bearings: at {bearing} a car is lost at {lost} m\n")
        })
        .collect();
    format!(
        "Range card: metres from the vehicle's origin at which {} beams or more meet a target on level ground\n{}{between}",
        card.beams,
        block(&of_card(card))
    )
}

/// Rows of a card for a page: the bearing, then the distances at which each target is met; the titles come first.
pub(super) fn range_card_rows(card: &RangeCard) -> Vec<Vec<String>> {
    let title = |target: &TargetRanges| {
        let [length, width, height] = target.size.map(|side| trimmed(side, 2));
        format!("{}, {length} × {width} × {height} m", target.target)
    };
    let titles = std::iter::once("bearing".to_owned()).chain(card.targets.iter().map(title));
    let bearings = card.targets.first().map_or(0, |target| target.bearings.len());
    let row = |index: usize| {
        let words = |target: &TargetRanges| runs_in_words(&target.bearings[index].met);
        let bearing = bearing_in_words(card.targets[0].bearings[index].bearing);
        std::iter::once(bearing).chain(card.targets.iter().map(words)).collect()
    };
    std::iter::once(titles.collect()).chain((0..bearings).map(row)).collect()
}

/// Metres at the outer circle of a plot: the farthest detection, rounded up to whole circles of 5 m.
fn farthest(all: &[MetRuns<'_>]) -> f64 {
    let step = 5.0 * RINGS as f64;
    let most = all.iter().flat_map(|one| one.runs).map(|run| run[1]).fold(0.0, f64::max);
    (most / step).ceil().max(1.0) * step
}

/// The card of a placement as a polar plot.
pub(super) fn range_card_svg(name: &str, card: &RangeCard) -> String {
    let names: Vec<&str> = card.targets.iter().map(|target| &*target.target).collect();
    let all = of_card(card);
    let body = panel(name, &all, &names, farthest(&all));
    let body = html! { (body) (legend(&names, PANEL + TITLE)) };
    page(
        [PANEL, PANEL + TITLE + legend_height(&names)],
        "Distances at which targets are met",
        &body,
    )
}

/// Detections by scene and placement, in order.
fn by_placement(table: &TargetTable) -> Vec<&[Detection]> {
    table.detections.chunk_by(|a, b| (&a.scene, &a.placement) == (&b.scene, &b.placement)).collect()
}

fn heading(of: &Detection) -> String {
    match &of.scene {
        Some(scene) => format!("{} in {scene}", of.placement),
        None => of.placement.clone(),
    }
}

fn of_detections(detections: &[Detection]) -> Vec<MetRuns<'_>> {
    let mut all = Vec::new();
    for Detection { target, bearing, detected, .. } in detections {
        all.push(MetRuns { target, bearing: *bearing, runs: detected });
    }
    all
}

/// Distances of detection, a block a placement.
pub fn targets_text(table: &TargetTable) -> String {
    let of = |detections: &&[Detection]| {
        format!("{}\n{}", heading(&detections[0]), block(&of_detections(detections)))
    };
    by_placement(table).iter().map(of).collect::<Vec<_>>().join("\n")
}

/// A polar plot a placement: for each bearing the distances of detection, a strip a target. Ahead is up, left is left.
pub fn targets_svg(question: &TargetQuestion, table: &TargetTable) -> String {
    let panels = by_placement(table);
    let all: Vec<MetRuns<'_>> = panels.iter().flat_map(|of| of_detections(of)).collect();
    panels_svg(question, &panels, farthest(&all))
}

/// The polar plot of each placement on its own, with its name; all have one scale.
pub(crate) fn targets_figures(
    question: &TargetQuestion,
    table: &TargetTable,
) -> Vec<(String, String)> {
    let panels = by_placement(table);
    let all: Vec<MetRuns<'_>> = panels.iter().flat_map(|of| of_detections(of)).collect();
    let farthest = farthest(&all);
    let figure = |of: &&[Detection]| {
        let scene = of[0].scene.as_ref().map_or(String::new(), |scene| format!("-in-{scene}"));
        (format!("targets-{}{scene}", of[0].placement), panels_svg(question, &[*of], farthest))
    };
    panels.iter().map(figure).collect()
}

/// Polar plots beside each other, and the colours of the targets.
fn panels_svg(question: &TargetQuestion, panels: &[&[Detection]], farthest: f64) -> String {
    let names: Vec<&str> = question.targets.iter().map(|target| &*target.name).collect();
    let columns = panels.len().clamp(1, COLUMNS);
    let rows = panels.len().div_ceil(columns).max(1);
    let [width, height] = [columns as f64 * PANEL, rows as f64 * (PANEL + TITLE)];
    let body = html! {
        @for (k, detections) in panels.iter().enumerate() {
            @let (x, y) = ((k % columns) as f64 * PANEL, (k / columns) as f64 * (PANEL + TITLE));
            g transform={ "translate(" (px(x)) " " (px(y)) ")" } {
                (panel(&heading(&detections[0]), &of_detections(detections), &names, farthest))
            }
        }
        (legend(&names, height))
    };
    let height = height + legend_height(&names);
    page([width, height], "Distances at which targets are detected, by bearing", &body)
}

fn legend_height(names: &[&str]) -> f64 {
    8.0 + names.len().div_ceil(4) as f64 * 18.0
}

/// Colours of targets below a height of so many pixels.
fn legend(names: &[&str], height: f64) -> Markup {
    html! {
        @for (k, name) in names.iter().enumerate() {
            @let x = 12.0 + (k % 4) as f64 * 96.0;
            @let y = height + 4.0 + (k / 4) as f64 * 18.0;
            rect x=(px(x)) y=(px(y)) width="12" height="12" fill=(COLOURS[k % COLOURS.len()]) {}
            text x=(px(x + 17.0)) y=(px(y + 11.0)) { (name) }
        }
    }
}

/// One polar plot.
fn panel(heading: &str, all: &[MetRuns<'_>], names: &[&str], farthest: f64) -> Markup {
    let (middle, scale) = ([PANEL / 2.0, TITLE + PANEL / 2.0], RADIUS / farthest);
    let at = |bearing: f64, metres: f64| {
        let (sin, cos) = maths::sin_cos(bearing.to_radians());
        (middle[0] - metres * scale * sin, middle[1] - metres * scale * cos)
    };
    let mut bearings: Vec<f64> = all.iter().map(|one| one.bearing.rem_euclid(360.0)).collect();
    bearings.sort_by(f64::total_cmp);
    bearings.dedup();
    let gaps = bearings.windows(2).map(|pair| pair[1] - pair[0]);
    let width = DRAWN * gaps.fold(WIDEST, f64::min);
    let strip = width / names.len().max(1) as f64;
    let wedge = |one: &MetRuns<'_>, run: &[f64; 2]| {
        let index = names.iter().position(|name| *name == one.target).unwrap_or(0);
        let from = one.bearing - 0.5 * width + index as f64 * strip;
        let [inner, outer] = if run[0] == run[1] { [run[0] - 1.0, run[1] + 1.0] } else { *run };
        let arc = |metres: f64| (0..=4).map(move |k| (from + f64::from(k) * strip / 4.0, metres));
        let outline = arc(outer).chain(arc(inner.max(0.0)).rev());
        (index, corners(outline.map(|(bearing, metres)| at(bearing, metres))))
    };
    html! {
        text x="12" y="20" font-weight="600" { (heading) }
        text x="12" y="37" fill=(SOFT) { "metres from the vehicle's origin; front is up" }
        @for ring in 1..=RINGS {
            circle cx=(px(middle[0])) cy=(px(middle[1])) r=(px(RADIUS * ring as f64 / RINGS as f64)) fill="none"
                stroke=(FAINT) {}
        }
        @for one in all {
            @for run in one.runs {
                @let (index, outline) = wedge(one, run);
                polygon points=(outline) fill=(COLOURS[index % COLOURS.len()]) fill-opacity=".85" {}
            }
        }
        @for ring in 1..=RINGS {
            @let share = ring as f64 / RINGS as f64;
            @let (x, y) = at(LABELS, farthest * share);
            text x=(px(x)) y=(px(y + 4.0)) font-size="11" text-anchor="middle" fill=(INK) stroke=(PAPER) stroke-width="3"
                paint-order="stroke" { (trimmed(farthest * share, 1)) }
        }
        polygon points=(corners([(middle[0], middle[1] - 8.0), (middle[0] + 5.0, middle[1] + 6.0),
            (middle[0] - 5.0, middle[1] + 6.0)])) fill=(INK) {}
    }
}
