//! A drawing on a sheet of paper as a list of shapes, written as SVG and as PDF.
//!
//! | file | holds |
//! |---|---|
//! | `pdf` | the drawing as PDF, with the standard font Helvetica |
//! | `outline` | outline of flat triangles |

mod outline;
mod pdf;

use maud::{Markup, html};

pub(super) use outline::{Flat, outline};

/// A point on the sheet: millimetres from its left and its upper edge.
pub(super) type Point = [f64; 2];

/// A colour, `#rrggbb`, and how opaque it is: 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ink(pub &'static str, pub f64);

impl Ink {
    /// An opaque colour.
    pub(super) const fn full(colour: &'static str) -> Self {
        Self(colour, 1.0)
    }

    /// Red, green and blue from 0 to 1.
    fn rgb(self) -> [f64; 3] {
        let part = |k: usize| self.0.get(1 + 2 * k..3 + 2 * k);
        let value = |k: usize| part(k).and_then(|hex| u8::from_str_radix(hex, 16).ok());
        [0, 1, 2].map(|k| f64::from(value(k).unwrap_or(0)) / 255.0)
    }
}

/// A line of a width in millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stroke {
    pub ink: Ink,
    pub width: f64,
    /// Length of dashes and of the gaps between them, millimetres; 0 for a solid line.
    pub dash: f64,
}

impl Stroke {
    pub(super) const fn solid(colour: &'static str, width: f64) -> Self {
        Self { ink: Ink::full(colour), width, dash: 0.0 }
    }

    pub(super) const fn dashed(colour: &'static str, width: f64) -> Self {
        Self { ink: Ink::full(colour), width, dash: 1.2 }
    }
}

/// Part of a text that stands at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// Share of the width of words that lies left of their point.
    pub(super) fn share(self) -> f64 {
        0.5 * f64::from(self as u8)
    }
}

/// One shape of a drawing; later ones lie over earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    /// Closed loops, filled where an odd number of them lies around a point.
    Area { loops: Vec<Vec<Point>>, fill: Option<Ink>, stroke: Option<Stroke> },
    /// An open line.
    Line { points: Vec<Point>, stroke: Stroke },
    /// A disc.
    Disc { at: Point, radius: f64, fill: Ink },
    /// A line of words; `size` is that of the font in millimetres, the point lies on the base line.
    Words { at: Point, words: String, size: f64, anchor: Anchor, bold: bool, ink: Ink },
}

/// A sheet of paper with shapes on it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Drawing {
    /// Width and height in millimetres.
    pub(super) size: [f64; 2],
    /// Title for readers that show one.
    pub(super) title: String,
    pub(super) shapes: Vec<Shape>,
}

impl Drawing {
    /// An empty sheet.
    pub(super) fn new(size: [f64; 2], title: &str) -> Self {
        Self { size, title: title.to_owned(), shapes: Vec::new() }
    }

    pub(super) fn area(
        &mut self,
        loops: Vec<Vec<Point>>,
        fill: Option<Ink>,
        stroke: Option<Stroke>,
    ) {
        if loops.iter().any(|corners| !corners.is_empty()) {
            self.shapes.push(Shape::Area { loops, fill, stroke });
        }
    }

    pub(super) fn line(&mut self, points: impl Into<Vec<Point>>, stroke: Stroke) {
        self.shapes.push(Shape::Line { points: points.into(), stroke });
    }

    pub(super) fn disc(&mut self, at: Point, radius: f64, fill: Ink) {
        self.shapes.push(Shape::Disc { at, radius, fill });
    }

    /// Words of a size, dark and beginning at a point.
    pub(super) fn words(&mut self, at: Point, size: f64, words: impl Into<String>) {
        self.text(at, size, words, Anchor::Start, false, Ink::full(super::svg::INK));
    }

    pub(super) fn text(
        &mut self,
        at: Point,
        size: f64,
        words: impl Into<String>,
        anchor: Anchor,
        bold: bool,
        ink: Ink,
    ) {
        self.shapes.push(Shape::Words { at, words: words.into(), size, anchor, bold, ink });
    }
}

/// Colour of the paper, and of words on a sign, which have no halo.
const WHITE: &str = "#ffffff";
/// Width of the white line around words, which keeps them clear of other lines, as a share of the size of the font.
const HALO: f64 = 0.3;

/// A number of the sheet to a thousandth of a millimetre.
fn mm(value: f64) -> String {
    super::svg::trimmed(value, 3)
}

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
                @let halo = (ink.0 != WHITE).then(|| mm(HALO * size));
                text x=(mm(*x)) y=(mm(*y)) font-size=(mm(*size)) fill=(ink.0) fill-opacity=[opacity(*ink)]
                    stroke=[halo.is_some().then_some(WHITE)] stroke-width=[halo.as_ref()]
                    stroke-linejoin=[halo.is_some().then_some("round")] paint-order=[halo.is_some().then_some("stroke")]
                    text-anchor=[anchor] font-weight=[bold.then_some("bold")] { (words) }
            }
        }
    }
}
