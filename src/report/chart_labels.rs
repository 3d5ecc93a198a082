//! Numbers beside the points of a chart, each where least is in its way.

use crate::maths;
use maud::{Markup, html};

use super::svg::{INK, px};

/// Numbers beside points.
pub(super) struct Labels<'a> {
    /// Left, right, top and bottom of the plot area, in pixels.
    pub area: [f64; 4],
    /// Points, and numbers written so far.
    pub taken: Vec<(f64, f64)>,
    /// The Pareto front.
    pub line: &'a [(f64, f64)],
}

impl Labels<'_> {
    /// A number where least is in its way, joined to its point where that is not near.
    pub fn write(&mut self, (x, y): (f64, f64), number: usize) -> Markup {
        let around = (0..16).map(|k| std::f64::consts::TAU * (f64::from(k) / 16.0 - 0.125));
        let places = [15.0, 22.0, 30.0, 40.0].into_iter().flat_map(|r| {
            around.clone().map(move |a: f64| (r, (x + r * maths::cos(a), y + r * maths::sin(a))))
        });
        let best = places.min_by(|a, b| self.crowding(*a).total_cmp(&self.crowding(*b)));
        let (radius, (to_x, to_y)) = best.unwrap_or((0.0, (x, y)));
        self.taken.push((to_x, to_y));
        let near = |from: f64, to: f64, along: f64| px(from + (to - from) * along / radius);
        html! {
            @if radius > 16.0 {
                @let (begin, end) = (6.0, radius - 8.0);
                path d={ "M" (near(x, to_x, begin)) " " (near(y, to_y, begin)) "L" (near(x, to_x, end))
                         " " (near(y, to_y, end)) } stroke=(INK) stroke-width=".6" {}
            }
            text x=(px(to_x)) y=(px(to_y + 4.3)) text-anchor="middle" font-size="12" font-weight="600" {
                (number)
            }
        }
    }

    /// Overlap of a number with points, numbers and the front at a place, plus its distance from its point.
    fn crowding(&self, (radius, at): (f64, (f64, f64))) -> f64 {
        let [left, right, top, bottom] = self.area;
        let overlap = |distance: f64, free: f64| ((free - distance) / free).max(0.0);
        let points = self.taken.iter().map(|t| overlap(maths::hypot(t.0 - at.0, t.1 - at.1), 14.0));
        let line =
            self.line.windows(2).map(|ends| overlap(from_segment(at, ends[0], ends[1]), 9.0));
        let is_inside = (left + 6.0..right).contains(&at.0) && (top..bottom - 6.0).contains(&at.1);
        points.chain(line).sum::<f64>() + 0.004 * radius + if is_inside { 0.0 } else { 1.0 }
    }
}

/// Distance of a point from a line between two others.
fn from_segment((x, y): (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let along = ((x - a.0) * dx + (y - a.1) * dy) / (dx * dx + dy * dy).max(f64::MIN_POSITIVE);
    let along = along.clamp(0.0, 1.0);
    maths::hypot(a.0 + along * dx - x, a.1 + along * dy - y)
}
