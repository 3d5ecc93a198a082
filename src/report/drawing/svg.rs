//! A drawing as SVG, in millimetres.

use maud::{Markup, html};

use super::{Anchor, Drawing, Ink, Point, Shape, Stroke, mm};

impl Drawing {
    /// The drawing as an SVG file of the sheet's size.
    pub(crate) fn svg(&self) -> String {
        let [width, height] = self.size.map(mm);
        html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width={ (width) "mm" }
                height={ (height) "mm" } role="img" font-family="Helvetica,Arial,sans-serif" {
                title { (self.title) }
                rect width="100%" height="100%" fill="#fff" {}
                @for shape in &self.shapes { (markup(shape)) }
            }
        }
        .into_string()
            + "\n"
    }
}

/// Attribute of an opacity below 1.
fn opacity(ink: Ink) -> Option<String> {
    (ink.1 < 1.0).then(|| mm(ink.1))
}

fn dashes(stroke: Stroke) -> Option<String> {
    (stroke.dash > 0.0).then(|| mm(stroke.dash))
}

fn path(points: &[Point], close: &str) -> String {
    let corners: Vec<String> =
        points.iter().map(|[x, y]| format!("{} {}", mm(*x), mm(*y))).collect();
    format!("M{}{close}", corners.join("L"))
}

fn markup(shape: &Shape) -> Markup {
    match shape {
        Shape::Area { loops, fill, stroke } => {
            let d: String = loops.iter().map(|corners| path(corners, "Z")).collect();
            html! {
                path d=(d) fill=(fill.map_or("none", |ink| ink.0)) fill-rule="evenodd"
                    fill-opacity=[fill.and_then(opacity)] stroke=[stroke.map(|s| s.ink.0)]
                    stroke-width=[stroke.map(|s| mm(s.width))] stroke-dasharray=[stroke.and_then(dashes)]
                    stroke-opacity=[stroke.and_then(|s| opacity(s.ink))] {}
            }
        }
        Shape::Line { points, stroke } => html! {
            path d=(path(points, "")) fill="none" stroke=(stroke.ink.0) stroke-width=(mm(stroke.width))
                stroke-dasharray=[dashes(*stroke)] stroke-opacity=[opacity(stroke.ink)] {}
        },
        Shape::Disc { at: [x, y], radius, fill } => html! {
            circle cx=(mm(*x)) cy=(mm(*y)) r=(mm(*radius)) fill=(fill.0) fill-opacity=[opacity(*fill)] {}
        },
        Shape::Words { at: [x, y], words, size, anchor, bold, ink } => {
            let anchor = match anchor {
                Anchor::Start => None,
                Anchor::Middle => Some("middle"),
                Anchor::End => Some("end"),
            };
            html! {
                text x=(mm(*x)) y=(mm(*y)) font-size=(mm(*size)) fill=(ink.0) fill-opacity=[opacity(*ink)]
                    text-anchor=[anchor] font-weight=[bold.then_some("bold")] { (words) }
            }
        }
    }
}
