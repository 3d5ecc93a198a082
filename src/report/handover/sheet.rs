//! Places of the views on the sheet, at the largest usual scale that fits.

use super::views::{Flat, View, Views};
use crate::report::drawing::Point;

/// A3 across, millimetres.
pub(super) const A3: [f64; 2] = [420.0, 297.0];
/// Millimetres at the sheet's edges.
const EDGE: f64 = 10.0;
/// Millimetres over each row of views, for its titles, and below, for measures.
const OVER: f64 = 7.0;
const BELOW: f64 = 11.0;
/// Millimetres between two views of a row, for a measure.
const BETWEEN: f64 = 14.0;
/// Least width of the legend.
const LEGEND: f64 = 135.0;
/// Height of the scale bar with its numbers.
const BAR: f64 = 8.0;
/// Millimetres on the vehicle that one on the sheet stands for.
const SCALES: [f64; 13] =
    [5.0, 10.0, 20.0, 25.0, 50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 500.0, 1000.0, 2000.0];

/// A view on the sheet.
#[derive(Clone, Copy)]
pub(super) struct Panel {
    /// Metres at the panel's left and lower edge.
    low: Flat,
    /// Metres at its right and upper edge.
    high: Flat,
    /// Its lower left corner on the sheet.
    corner: Point,
    /// Millimetres a metre.
    pub scale: f64,
}

impl Panel {
    /// Place on the sheet of metres to the right and upwards.
    pub fn at(&self, [right, up]: Flat) -> Point {
        [
            self.corner[0] + (right - self.low[0]) * self.scale,
            self.corner[1] - (up - self.low[1]) * self.scale,
        ]
    }

    pub fn all(&self, points: &[Flat]) -> Vec<Point> {
        points.iter().map(|point| self.at(*point)).collect()
    }

    /// Left, right, upper and lower edge on the sheet.
    pub fn edges(&self) -> [f64; 4] {
        let ([left, lower], [right, upper]) = (self.at(self.low), self.at(self.high));
        [left, right, upper, lower]
    }
}

/// All panels, the legend's corner, and the scale.
pub(super) struct Sheet {
    /// One millimetre on the sheet stands for as many.
    pub one_to: f64,
    pub top: Panel,
    pub side: Panel,
    pub front: Panel,
    /// Upper left corner of the legend.
    pub legend: Point,
    /// Left end of the scale bar.
    pub bar: Point,
}

/// Height of the legend of so many LiDARs.
fn legend_height(lidars: usize) -> f64 {
    82.0 + 4.2 * lidars as f64
}

fn size(view: &View) -> [f64; 2] {
    [0, 1].map(|k| view.high[k] - view.low[k])
}

impl Sheet {
    pub fn of(views: &Views, lidars: usize) -> Self {
        let [top, side, front] = [&views.top, &views.side, &views.front].map(size);
        let legend = legend_height(lidars);
        let free =
            [A3[0] - 2.0 * EDGE - BETWEEN, A3[1] - 2.0 * EDGE - 2.0 * OVER - 2.0 * BELOW - BAR];
        let fits = |one_to: f64| {
            let scale = 1000.0 / one_to;
            let width = scale * top[0] + (scale * front[0]).max(LEGEND);
            let height = (scale * top[1]).max(legend) + scale * side[1];
            width <= free[0] && height <= free[1]
        };
        let usual = SCALES.into_iter().find(|one_to| fits(*one_to));
        let larger =
            || (1..).map(|k| 5000.0 * f64::from(k)).take(10_000).find(|one_to| fits(*one_to));
        let one_to = usual.or_else(larger).unwrap_or(5e7);
        let scale = 1000.0 / one_to;
        let panel = |view: &View, left: f64, lower: f64| Panel {
            low: view.low,
            high: view.high,
            corner: [left, lower],
            scale,
        };
        let first = EDGE + OVER + (scale * top[1]).max(legend);
        let second = first + BELOW + OVER + scale * side[1];
        let right = EDGE + scale * top[0] + BETWEEN;
        Self {
            one_to,
            top: panel(&views.top, EDGE, EDGE + OVER + scale * top[1]),
            side: panel(&views.side, EDGE, second),
            front: panel(&views.front, right, second),
            legend: [right, EDGE],
            bar: [EDGE, second + BELOW + BAR],
        }
    }
}
