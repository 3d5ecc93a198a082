//! The placement: its drawing, its poses, and the gain of each LiDAR.

use maud::{Markup, PreEscaped, html};

use super::{Figures, Subject};
use crate::json::fixed;
use crate::report::RunRecord;
use crate::report::svg::{COLOURS, colour};
use crate::report::text::{mount_text, phase_text};
use crate::vehicle::millimetres;

/// Titles of positions and of angles in the units of a workshop.
const SMALL: [[&str; 3]; 2] = [["x mm", "y mm", "z mm"], ["roll °", "pitch °", "yaw °"]];
/// Columns of a table beyond which a phone shows some alone.
const FEW_COLUMNS: usize = 6;

/// Poses of the result, and for each LiDAR its gain alone and the gain that only it has.
pub(super) fn layout(subject: &Subject<'_>, figures: &Figures, run: Option<&RunRecord>) -> Markup {
    let Some(best) = subject.result else { return html! {} };
    let poses = &best.placement.lidars;
    let named = poses.iter().any(|pose| !pose.sensor.is_none());
    let mut titles = vec!["LiDAR", "x m", "y m", "z m", "roll rad", "pitch rad", "yaw rad"];
    let mounts = &figures.mounts;
    let phased = poses.iter().any(|pose| pose.phase.is_some());
    titles.extend(phased.then_some("phase rad"));
    let rows = poses.iter().enumerate().map(|(index, pose)| {
        let mut row = vec![text(index.to_string())];
        row.extend(pose.fields().map(|(_, value)| text(fixed(value, 3))));
        row.extend(phased.then(|| text(phase_text(pose))));
        (false, row)
    });
    let mut positions = vec!["LiDAR"];
    positions.extend((!mounts.is_empty()).then_some("mount"));
    positions.extend(named.then_some("sensor"));
    positions.extend(SMALL[0]);
    let angles: Vec<&str> = ["LiDAR"].into_iter().chain(SMALL[1]).collect();
    // Two tables, each of which fits a phone.
    let small = poses.iter().enumerate().map(|(index, pose)| {
        let mut at = vec![text(index.to_string())];
        let mut turned = at.clone();
        at.extend((!mounts.is_empty()).then(|| text(mount_text(mounts, index))));
        at.extend(named.then(|| text(pose.sensor.to_string())));
        let mut values = millimetres(pose).map(|(_, value)| text(value.to_string())).into_iter();
        at.extend(values.by_ref().take(3));
        turned.extend(values);
        ((false, at), (false, turned))
    });
    let (at, turned): (Vec<_>, Vec<_>) = small.unzip();
    let active = run.map_or(&[][..], |run| &run.active_bounds);
    html! {
        @if let Some(svg) = &figures.placement { (figure(svg, "The placement on the vehicle")) }
        div.beside {
            (table("Positions in millimetres: x ahead, y left, z up", &positions, at))
            (table("Angles in degrees: positive pitch looks down, positive yaw turns left", &angles, turned))
        }
        details {
            summary { "Poses in metres and radians, for programs" }
            (table("Poses in metres and radians", &titles, rows))
        }
        @if !active.is_empty() {
            p { (active.join("; ")) "." }
        }
        (each_lidar(subject, figures))
    }
}

fn each_lidar(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let unique = subject.result.map_or(&[][..], |best| &best.scores.unique_share);
    let gains = figures.views.first().map(|view| &view.sight.gains);
    let whole = gains.map_or(0.0, |gains| gains.gained()).max(f64::MIN_POSITIVE);
    let rows = unique.iter().enumerate().map(|(index, only)| {
        let alone = gains.and_then(|gains| gains.alone.get(index)).map(|nats| nats / whole);
        let mut row = vec![text(index.to_string())];
        row.push(text(alone.map_or("–".into(), |share| format!("{:.1}", 100.0 * share))));
        row.push(text(format!("{:.1}", 100.0 * only)));
        row.push(bar(alone.unwrap_or(0.0), Some(*only)));
        (false, row)
    });
    html! {
        h3 { "Gain of each LiDAR" }
        (table(
            "Each LiDAR alone, and the loss if it fails, in % of the gain of all",
            &["LiDAR", "alone %", "lost with it %", ""],
            rows,
        ))
        p.small {
            "Bar: alone"
            @if figures.views.len() > 1 { ", in the first scene" }
            "; mark: lost with it."
        }
    }
}

/// A drawing that may be wider than the page; `label` tells in words what it shows.
pub(super) fn figure(svg: &str, label: &str) -> Markup {
    html! { figure.wide tabindex="0" role="group" aria-label=(label) { (PreEscaped(svg)) } }
}

/// A table that may be wider than the page, which a phone says of many columns; a row is a name and its cells, `best` rows
/// stand out.
pub(super) fn table(
    caption: &str,
    titles: &[impl AsRef<str>],
    rows: impl IntoIterator<Item = (bool, Vec<Markup>)>,
) -> Markup {
    html! {
        div.wide.many[titles.len() > FEW_COLUMNS] tabindex="0" role="group" aria-label=(caption) {
            table {
                caption { span { (caption) } }
                thead { tr { @for title in titles { th scope="col" { (title.as_ref()) } } } }
                tbody {
                    @for (best, cells) in rows {
                        tr.best[best] {
                            @for (index, cell) in cells.iter().enumerate() {
                                @if index == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A table whose first row holds the titles; rows behind it stand out where `is_best` says so of their number.
pub(super) fn table_of(
    caption: &str,
    rows: &[Vec<String>],
    is_best: impl Fn(usize) -> bool,
) -> Markup {
    let Some((titles, rows)) = rows.split_first() else { return html! {} };
    let row = |(k, cells): (usize, &Vec<String>)| (is_best(k), cells.iter().map(text).collect());
    table(caption, titles, rows.iter().enumerate().map(row))
}

pub(super) fn text(text: impl AsRef<str>) -> Markup {
    html! { (text.as_ref()) }
}

/// A sentence, with code where it stands between backticks.
pub(super) fn prose(words: &str) -> Markup {
    prose_of(words, |part| html! { (part) })
}

/// A sentence, with code where it stands between backticks, and the other parts as `plain` has them.
pub(super) fn prose_of(words: &str, plain: impl Fn(&str) -> Markup) -> Markup {
    html! {
        @for (index, part) in words.split('`').enumerate() {
            @if index % 2 == 1 { code { (part) } } @else { (plain(part)) }
        }
    }
}

/// A share as a bar, with a mark at another share.
pub(super) fn bar(share: f64, mark: Option<f64>) -> Markup {
    let per_cent = |share: f64| format!("{:.1}%", 100.0 * share.clamp(0.0, 1.0));
    html! {
        span.bar aria-hidden="true" {
            i style={ "width:" (per_cent(share)) } {}
            @if let Some(mark) = mark { b style={ "left:" (per_cent(mark)) } {} }
        }
    }
}

/// A difference as a bar from the middle, with the ends of its interval; all as shares of the widest.
pub(super) fn difference(value: f64, interval: Option<[f64; 2]>) -> Markup {
    let at = |value: f64| 50.0 + 48.0 * value.clamp(-1.0, 1.0);
    let (left, width) = (at(value.min(0.0)), 48.0 * value.abs().min(1.0));
    html! {
        span.bar.middle aria-hidden="true" {
            i.less[value < 0.0] style={ "left:" (format!("{left:.1}%")) ";width:" (format!("{width:.1}%")) } {}
            @if let Some([low, high]) = interval {
                b.span style={ "left:" (format!("{:.1}%", at(low))) ";width:" (format!("{:.1}%", at(high) - at(low))) } {}
            }
        }
    }
}

/// The view with its controls; hidden until its script has begun.
pub(super) fn stage(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let (views, Some(result)) = (&figures.views[..], subject.result) else { return html! {} };
    let Some(first) = views.first() else { return html! {} };
    let lidars = result.placement.lidars.len();
    let place = if views.len() > 1 { "the scene that is chosen" } else { &first.scene };
    let label = format!(
        "The vehicle with {lidars} LiDARs in {place}, what is around it, and the voxels that hold information"
    );
    html! {
        section #view hidden[true] aria-label="The placement in 3-D" {
            div.stage {
                canvas #canvas tabindex="0" role="img" aria-label=(label) aria-describedby="view-help" {}
                div #lidars aria-hidden="true" {
                    @for index in 0..lidars {
                        span style={ "--own:" (colour(index)) } { b { (index) } }
                    }
                }
                div.buttons {
                    button #zoom-in type="button" aria-label="Zoom in" { "+" }
                    button #zoom-out type="button" aria-label="Zoom out" { "−" }
                    button #reset type="button" { "Reset" }
                }
            }
            ul #legend aria-label="Meaning of the colours" {}
            (controls(subject, figures, lidars))
            p.small #view-help {
                "Drag to turn, with Shift or two fingers to move, pinch or scroll in the picture to zoom; or arrow \
                 keys, Shift and arrow keys, + and −, and 0 for the first view. The vehicle carries the numbered LiDARs; grey stands around it. \
                 Voxels are the larger the more \
                 information they hold. "
                @for (index, view) in views.iter().enumerate() {
                    span.left-out hidden[index > 0] { @for words in view.left_out() { (words) " " } }
                }
            }
        }
        div #view-fallback hidden[true] {
            p { "This browser draws no WebGL2; the map from above stands in for the 3-D view." }
        }
        noscript { p { "The 3-D view needs scripts; the map from above is below." } }
    }
}

fn controls(subject: &Subject<'_>, figures: &Figures, lidars: usize) -> Markup {
    let frames = figures.views.first().map_or(&[][..], |view| &view.frames);
    let rival = subject.rival().map(|rival| &rival.placement.name);
    html! {
        form #controls {
            @if figures.views.len() > 1 {
                label { "Scene "
                    select name="scene" {
                        @for (index, view) in figures.views.iter().enumerate() {
                            option value=(index) { (view.scene) }
                        }
                    }
                }
            }
            label { "Colour voxels by "
                select name="colour" {
                    option value="information" { "information seen" }
                    option value="class" { "class" }
                    option value="seen" { "LiDAR that sees them" }
                    option value="redundancy" { "number of LiDARs that see them" }
                    @if !subject.baselines.is_empty() {
                        option value="difference" { "difference to a baseline" }
                    }
                }
            }
            @if !subject.baselines.is_empty() {
                label #baseline-choice { "Baseline "
                    select name="baseline" {
                        @for (index, baseline) in subject.baselines.iter().enumerate() {
                            option value=(index) selected[rival == Some(&baseline.placement.name)] {
                                (baseline.placement.name)
                            }
                        }
                    }
                }
            }
            label { "Beams of "
                select name="lidar" {
                    option value="none" { "no LiDAR" }
                    @for index in 0..lidars { option value=(index) { "LiDAR " (index) } }
                    @if lidars > 1 { option value="all" { "all LiDARs" } }
                }
            }
            label { "Frame "
                input type="range" name="frame" min="0" max=(frames.len().saturating_sub(1)) value="0"
                    disabled[frames.len() < 2];
                output #frame-number { "0" }
            }
            label.check { input type="checkbox" name="surfaces" checked; "surfaces" }
            label.check { input type="checkbox" name="voxels" checked; "voxels" }
            label.check { input type="checkbox" name="whole"; "walls in full" }
        }
    }
}

/// The view's data and its scripts, at the end of the page.
pub(super) fn script(figures: &Figures) -> Markup {
    if figures.views.is_empty() {
        return html! {};
    }
    // The drawings and the view give a LiDAR the same colour.
    let colours = format!("{COLOURS:?}");
    let code = include_str!("../view/view.js").replace("LIDAR_COLOURS", &colours);
    html! {
        @for (header, bytes) in figures.views.iter().map(|view| view.packed()) {
            script.view-data type="application/json" { (PreEscaped(header)) }
            script.view-bytes type="text/plain" { (PreEscaped(bytes)) }
        }
        script { (PreEscaped(include_str!("../view/gl.js"))) (PreEscaped(code)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_many_columns_says_so_to_a_phone() {
        let is_marked = |columns: usize| {
            let titles = vec!["x"; columns];
            table("numbers", &titles, []).into_string().contains("class=\"wide many\"")
        };
        assert!(is_marked(FEW_COLUMNS + 1) && !is_marked(FEW_COLUMNS));
    }
}
