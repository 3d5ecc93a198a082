//! Distances at which targets are met, by bearing: the range card as text, and polar plots for a slide.
//!
//! | file | holds |
//! |---|---|
//! | `beams` | distances of detection as text, or beams where there are few distances |

mod beams;

use maud::{Markup, html};

use super::columns::align_columns;
use super::svg::{FAINT, INK, SOFT, colour, corners, page, px, trimmed};
use crate::json::counted;
use crate::maths;
use crate::targets::{
    BlindSector, Detection, RangeCard, TargetQuestion, TargetRanges, TargetTable,
};

pub(crate) use beams::{in_frames, targets_text};

/// Pixels of a panel, of the radius of its circle, of its title.
const PANEL: f64 = 400.0;
const RADIUS: f64 = 150.0;
const TITLE: f64 = 44.0;
/// Panels beside each other.
const COLUMNS: usize = 3;
/// Bearing of the labels of circles, between two of sixteen bearings, in degrees; and the halo around them.
const LABELS: f64 = -11.25;
const PAPER: &str = "#fff";
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
pub(super) fn runs_in_words(runs: &[[f64; 2]]) -> String {
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
pub(super) fn bearing_in_words(bearing: f64) -> String {
    let turned = (bearing + 180.0).rem_euclid(360.0) - 180.0;
    match turned {
        0.0 => "ahead 0°".to_owned(),
        90.0 => "left 90°".to_owned(),
        -90.0 => "right -90°".to_owned(),
        -180.0 => "behind 180°".to_owned(),
        _ => format!("{}°", trimmed(turned, 2)),
    }
}

fn of_target(target: &TargetRanges) -> Vec<MetRuns<'_>> {
    let each = target.bearings.iter().map(|of| (of.bearing, &of.met[..]));
    each.map(|(bearing, runs)| MetRuns { target: &target.target, bearing, runs }).collect()
}

/// Distance from which on a car is looked for all round, metres.
const ALL_ROUND_FROM: f64 = 5.0;

/// Sentence on bearings at which a car is met, but cannot stand as near as 5 m; `None` where it can everywhere. A car lost
/// closer than its first detection is reported separately.
pub(super) fn overlap_in_words(card: &RangeCard) -> Option<String> {
    let car = card.targets.first()?;
    let is_lost = |bearing: f64, before: f64| {
        card.blind.iter().any(|sector| {
            let behind_first = (bearing - sector.bearings[0]).rem_euclid(360.0);
            behind_first <= sector.degrees() && sector.distances[0] < before
        })
    };
    let mut starts: Vec<(f64, Vec<String>)> = Vec::new();
    for of in &car.bearings {
        let Some([first, _]) = of.met.first().filter(|run| run[0] > ALL_ROUND_FROM) else {
            continue;
        };
        if is_lost(of.bearing, *first) {
            continue;
        }
        let name = bearing_in_words(of.bearing);
        match starts.iter_mut().find(|(metres, _)| metres == first) {
            Some((_, names)) => names.push(name),
            None => starts.push((*first, vec![name])),
        }
    }
    let part = |(metres, names): &(f64, Vec<String>)| {
        format!("{} m ({})", trimmed(*metres, 2), names.join(", "))
    };
    let parts: Vec<String> = starts.iter().map(part).collect();
    (!parts.is_empty()).then(|| {
        format!(
            "Among these distances a {} stands free of the own body from {} on.",
            car.target,
            parts.join(" or ")
        )
    })
}

/// Sentences on sensors that reach less far than blind sectors are looked for.
pub(super) fn reach_in_words(card: &RangeCard) -> Vec<String> {
    let [near, far] = card.blind_between.map(|metres| trimmed(metres, 2));
    let of_all = match near == far {
        true => format!(
            "Blind sectors are not looked for: no sensor of the vehicle reaches farther than {near} m."
        ),
        false => format!(
            "Blind sectors are looked for from {near} to {far} m: no sensor of the vehicle reaches farther."
        ),
    };
    let of_rig = card.reach.map(|metres| {
        let metres = trimmed(metres, 2);
        format!(
            "No LiDAR of this rig reaches farther than {metres} m; other sensors of the vehicle do."
        )
    });
    card.ends_at_range().then_some(of_all).into_iter().chain(of_rig).collect()
}

/// Ground that the targets of a card stand on: `on level ground`.
pub(super) fn ground_in_words(card: &RangeCard) -> String {
    let ground = card.ground.as_ref().map(|ground| format!("{ground}, alone"));
    ground.unwrap_or_else(|| "on level ground".to_owned())
}

pub(crate) fn range_card_text(card: &RangeCard) -> String {
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
    let words = overlap_in_words(card).into_iter().chain(reach_in_words(card));
    let words: String = words.map(|words| words + "\n").collect();
    format!(
        "Range card: metres from the vehicle's origin at which {} beams or more meet a target {}\n{}{between}{words}",
        card.beams,
        ground_in_words(card),
        align_columns(&range_card_rows(card))
    )
}

/// Rows of a card: the bearing, then the distances at which each target is met; the titles come first.
pub(super) fn range_card_rows(card: &RangeCard) -> Vec<Vec<String>> {
    let title = |target: &TargetRanges| format!("{} m", target.target);
    let titles = std::iter::once("bearing".to_owned()).chain(card.targets.iter().map(title));
    let bearings = card.targets.first().map_or(0, |target| target.bearings.len());
    let row = |index: usize| {
        let words = |target: &TargetRanges| runs_in_words(&target.bearings[index].met);
        let bearing = bearing_in_words(card.targets[0].bearings[index].bearing);
        std::iter::once(bearing).chain(card.targets.iter().map(words)).collect()
    };
    std::iter::once(titles.collect()).chain((0..bearings).map(row)).collect()
}

/// Length, width and height of the targets of a card, in a sentence.
pub(super) fn sizes_in_words(card: &RangeCard) -> String {
    let size = |target: &TargetRanges| {
        let [length, width, height] = target.size.map(|side| trimmed(side, 2));
        format!("{} {length} × {width} × {height} m", target.target)
    };
    format!("Targets: {}.", card.targets.iter().map(size).collect::<Vec<_>>().join(", "))
}

/// Metres at the outer circle of a plot: the farthest detection, rounded up to whole circles of 5 m.
fn farthest(all: &[MetRuns<'_>]) -> f64 {
    let step = 5.0 * RINGS as f64;
    let most = all.iter().flat_map(|one| one.runs).map(|run| run[1]).fold(0.0, f64::max);
    (most / step).ceil().max(1.0) * step
}

/// The card of a placement as a polar plot for each target, with its own scale, beside each other.
pub(super) fn range_card_svg(name: &str, card: &RangeCard) -> String {
    let body = html! {
        @for (k, panel) in card_panels(name, card).into_iter().enumerate() {
            g transform={ "translate(" (px(k as f64 * PANEL)) " 0)" } { (panel) }
        }
    };
    let width = card.targets.len().max(1) as f64 * PANEL;
    page([width, PANEL + TITLE], "Distances at which targets are met", &body)
}

pub(super) fn range_card_svgs(name: &str, card: &RangeCard) -> Vec<(String, String)> {
    let title =
        |target: &TargetRanges| format!("Distances at which a target is met: {}", target.target);
    let each = card.targets.iter().map(title).zip(card_panels(name, card));
    each.map(|(title, panel)| (title.clone(), page([PANEL, PANEL + TITLE], &title, &panel)))
        .collect()
}

fn card_panels(name: &str, card: &RangeCard) -> Vec<Markup> {
    let of_card = |target: &TargetRanges| {
        let (heading, all) = (format!("{name}: {}", target.target), of_target(target));
        panel(&heading, card.beams, &all, &[&target.target], farthest(&all))
    };
    card.targets.iter().map(of_card).collect()
}

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
    let each = detections.iter().map(|of| (&*of.target, of.bearing, &of.detected[..]));
    each.map(|(target, bearing, runs)| MetRuns { target, bearing, runs }).collect()
}

/// A polar plot a placement: for each bearing the distances of detection, a strip a target. Ahead is up, left is left.
pub(crate) fn targets_svg(question: &TargetQuestion, table: &TargetTable) -> String {
    panels_svg(question, &by_placement(table), farthest(&of_detections(&table.detections)))
}

/// The polar plot of each placement on its own, with its name; all have one scale.
pub(crate) fn targets_figures(
    question: &TargetQuestion,
    table: &TargetTable,
) -> Vec<(String, String)> {
    let farthest = farthest(&of_detections(&table.detections));
    let figure = |of: &&[Detection]| {
        let scene = of[0].scene.as_ref().map_or(String::new(), |scene| format!("-in-{scene}"));
        (format!("targets-{}{scene}", of[0].placement), panels_svg(question, &[*of], farthest))
    };
    by_placement(table).iter().map(figure).collect()
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
                (panel(&heading(&detections[0]), question.beams, &of_detections(detections), &names, farthest))
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
            rect x=(px(x)) y=(px(y)) width="12" height="12" fill=(colour(k)) {}
            text x=(px(x + 17.0)) y=(px(y + 11.0)) { (name) }
        }
    }
}

/// Bearing at which the strip of a target begins, degrees counter-clockwise. The strips of all targets together lie
/// around their bearing: the first target's in the middle, the second one's to its left, the third one's to its right.
fn strip_from(bearing: f64, width: f64, index: usize, count: usize) -> f64 {
    let (strip, step) = (width / count.max(1) as f64, index.div_ceil(2) as f64);
    let from_left = (count / 2) as f64 + if index % 2 == 1 { -step } else { step };
    bearing + 0.5 * width - (from_left + 1.0) * strip
}

/// One polar plot of places that at least `beams` meet.
fn panel(heading: &str, beams: u32, all: &[MetRuns<'_>], names: &[&str], farthest: f64) -> Markup {
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
        let from = strip_from(one.bearing, width, index, names.len());
        let [inner, outer] = if run[0] == run[1] { [run[0] - 1.0, run[1] + 1.0] } else { *run };
        let arc = |metres: f64| (0..=4).map(move |k| (from + f64::from(k) * strip / 4.0, metres));
        let outline = arc(outer).chain(arc(inner.max(0.0)).rev());
        (index, corners(outline.map(|(bearing, metres)| at(bearing, metres))))
    };
    html! {
        text x="12" y="20" font-weight="600" { (heading) }
        text x="12" y="37" fill=(SOFT) {
            (counted(beams as usize, "beam")) " or more; metres from the origin; front is up"
        }
        @for ring in 1..=RINGS {
            circle cx=(px(middle[0])) cy=(px(middle[1])) r=(px(RADIUS * ring as f64 / RINGS as f64)) fill="none"
                stroke=(FAINT) {}
        }
        @for one in all {
            @for run in one.runs {
                @let (index, outline) = wedge(one, run);
                polygon points=(outline) fill=(colour(index)) fill-opacity=".85" {}
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::targets::BearingRanges;

    #[test]
    fn strips_of_a_bearing_lie_around_it_side_by_side() {
        for count in 1..=6 {
            let mut from: Vec<f64> = (0..count).map(|k| strip_from(45.0, 12.0, k, count)).collect();
            let strip = 12.0 / count as f64;
            if count % 2 == 1 {
                assert!((from[0] + 0.5 * strip - 45.0).abs() < 1e-9, "{count}: {from:?}");
            }
            from.sort_by(f64::total_cmp);
            for (k, from) in from.iter().enumerate() {
                assert!((from - (39.0 + k as f64 * strip)).abs() < 1e-9, "{count}: {from}");
            }
        }
        // Three targets from the left: the second, the first, the third.
        assert_eq!([0, 1, 2].map(|k| strip_from(0.0, 9.0, k, 3)), [-1.5, 1.5, -4.5]);
    }

    #[test]
    fn bearings_at_which_a_car_cannot_stand_near_are_named() {
        let of = |bearing: f64, from: f64| BearingRanges { bearing, met: vec![[from, 140.0]] };
        let car = TargetRanges {
            target: "car".to_owned(),
            size: [4.5, 1.8, 1.5],
            bearings: vec![of(0.0, 7.5), of(90.0, 5.0), of(180.0, 7.5), of(-90.0, 2.5)],
        };
        let (distances, beams) = (vec![2.5, 5.0, 7.5, 140.0], 5);
        let (targets, blind_between) = (vec![car], [5.0, 50.0]);
        let mut card =
            RangeCard { beams, distances, targets, blind_between, ..RangeCard::default() };
        let words = "Among these distances a car stands free of the own body from 7.5 m (ahead 0°, behind 180°) on.";
        assert_eq!(overlap_in_words(&card).as_deref(), Some(words));
        assert!(range_card_text(&card).ends_with(&format!("{words}\n")));
        // Each target has a plot of its own, which says when it is met.
        let drawn = range_card_svg("found", &card);
        assert!(drawn.contains("found: car") && drawn.contains("5 beams or more; "), "{drawn}");
        assert!(
            drawn.contains(&format!(">{}<", trimmed(farthest(&of_target(&card.targets[0])), 1)))
        );
        let each = range_card_svgs("found", &card);
        let [(title, own)] = &each[..] else { panic!("one target") };
        assert_eq!(title, "Distances at which a target is met: car");
        assert!(own.contains("found: car") && own.matches("<polygon").count() == 5, "{own}");
        assert_eq!(sizes_in_words(&card), "Targets: car 4.5 × 1.8 × 1.5 m.");
        // A sector elsewhere takes nothing away; in one a car may be lost where it starts late.
        card.blind = vec![BlindSector::lost([30.0, 120.0], [5.0, 50.0])];
        assert_eq!(overlap_in_words(&card).as_deref(), Some(words));
        card.blind = vec![BlindSector::lost([170.0, -170.0], [5.0, 50.0])];
        let words =
            "Among these distances a car stands free of the own body from 7.5 m (ahead 0°) on.";
        assert_eq!(overlap_in_words(&card).as_deref(), Some(words));
        card.blind.clear();
        card.targets[0].bearings.retain(|of| of.bearing.abs() == 90.0);
        assert_eq!(overlap_in_words(&card), None);
    }
}
