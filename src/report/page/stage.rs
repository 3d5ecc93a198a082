//! The 3-D view at the head of a page, its controls, and its data and scripts.

use maud::{Markup, PreEscaped, html};

use super::figures::Figures;
use super::subject::Subject;
use crate::report::svg::COLOURS;

/// The view with its controls; hidden until its script has begun.
pub(super) fn stage(subject: &Subject<'_>, figures: &Figures) -> Markup {
    let (views, Some(result)) = (&figures.views[..], subject.result) else { return html! {} };
    let Some(first) = views.first() else { return html! {} };
    let lidars = result.placement.lidars.len();
    let place = if views.len() > 1 { "the scene that is chosen" } else { first.scene() };
    let label = format!(
        "The vehicle with {lidars} LiDARs in {place}, what is around it, and the voxels that hold information"
    );
    html! {
        section #view hidden[true] aria-label="The placement in 3-D" {
            div.stage {
                canvas #canvas tabindex="0" role="img" aria-label=(label) aria-describedby="view-help" {}
                div #lidars aria-hidden="true" {
                    @for index in 0..lidars {
                        span style={ "--own:" (COLOURS[index % COLOURS.len()]) } { b { (index) } }
                    }
                }
                div.buttons {
                    button #zoom-in type="button" aria-label="Zoom in" { "+" }
                    button #zoom-out type="button" aria-label="Zoom out" { "−" }
                    button #reset type="button" { "Reset" }
                }
            }
            ul #legend aria-label="What the colours mean" {}
            (controls(subject, figures, lidars))
            p.small #view-help {
                "Drag to turn, with Shift or two fingers to move, pinch or scroll in the picture to zoom; or arrow \
                 keys, Shift and arrow keys, + and −, and 0 for the first view. Voxels are the larger the more \
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
    let frames = figures.views.first().map_or(&[][..], |view| view.frames());
    let rival = subject.rival().map(|rival| &rival.placement.name);
    html! {
        form #controls {
            @if figures.views.len() > 1 {
                label { "Scene "
                    select name="scene" {
                        @for (index, view) in figures.views.iter().enumerate() {
                            option value=(index) { (view.scene()) }
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
