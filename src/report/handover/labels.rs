//! Places of words and of the numbers of LiDARs on a view, so that none lies over another.

use super::{DrawnRig, Panel, View};
use crate::report::drawing::{Anchor, Point};
use crate::report::svg::LidarSign;

/// Radius of the disc behind a LiDAR's number, millimetres.
pub(super) const RADIUS: f64 = 1.7;
/// Millimetres between two LiDARs that are one place on the sheet.
const ONE_PLACE: f64 = 0.3;
/// Width of a character, and its height above and depth below the base line, as shares of the size of the font.
const CHARACTER: [f64; 3] = [0.56, 0.8, 0.25];
/// Least height between two lines of words, as a share of the size of the font.
const APART: f64 = 0.15;
/// Lines by which words are moved away at most.
const MOST_LINES: usize = 12;

/// Half of the width of a sign, millimetres.
pub(super) fn half_width(sign: &LidarSign) -> f64 {
    match sign.lidars.len() {
        0 | 1 => RADIUS,
        _ => RADIUS.max(0.5 * CHARACTER[0] * 2.4 * sign.words().chars().count() as f64 + 0.8),
    }
}

fn around(sign: &LidarSign) -> [f64; 4] {
    let ([x, y], half) = (sign.label, half_width(sign));
    [x - half, y - RADIUS, x + half, y + RADIUS]
}

/// The LiDARs of a view: those behind one another as one, numbers that would touch side by side.
pub(super) fn signs(rig: &DrawnRig<'_>, shown: &View, panel: &Panel) -> Vec<LidarSign> {
    let places =
        rig.lidars.iter().map(|drawn| panel.at((shown.flat)(drawn.ego_from_sensor.translation)));
    let touches = |a: &LidarSign, b: &LidarSign| overlap(&around(a), &around(b));
    LidarSign::all(places, ONE_PLACE, 0.5 * RADIUS, touches)
}

fn overlap(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// End of a line to words that were moved away from a place: the middle of their nearer long side.
pub(super) fn end_of_leader(
    towards: Point,
    (at, anchor): (Point, Anchor),
    size: f64,
    words: &str,
) -> Point {
    let [left, upper, right, lower] = bounds(at, size, words, anchor);
    [0.5 * (left + right), if towards[1] < upper { upper } else { lower }]
}

/// Box around words, millimetres: left, upper, right, lower.
fn bounds([x, y]: Point, size: f64, words: &str, anchor: Anchor) -> [f64; 4] {
    let [wide, above, below] = CHARACTER.map(|share| share * size);
    let width = wide * words.chars().count() as f64;
    let left = x - anchor.share() * width;
    [left, y - above, left + width, y + below]
}

/// Places that are taken.
#[derive(Default)]
pub(super) struct Labels(Vec<[f64; 4]>);

impl Labels {
    /// Keeps the places of LiDARs' numbers.
    pub(super) fn keep_signs(&mut self, signs: &[LidarSign]) {
        self.0.extend(signs.iter().map(around));
    }

    /// Keeps the place of words that stand where they stand.
    pub(super) fn keep(&mut self, at: Point, size: f64, words: &str, anchor: Anchor) {
        self.0.push(bounds(at, size, words, anchor));
    }

    /// The first of some places at which words lie over nothing, else the first line above or below that is free, which is
    /// none of them; the place is then taken.
    pub(super) fn place(
        &mut self,
        candidates: &[(Point, Anchor)],
        size: f64,
        words: &str,
    ) -> (Point, Anchor) {
        let is_free = |&([x, y], anchor): &(Point, Anchor)| {
            let [left, upper, right, lower] = bounds([x, y], size, words, anchor);
            // Lines that touch read as one.
            let own = [left, upper - APART * size, right, lower + APART * size];
            !self.0.iter().any(|taken| overlap(taken, &own))
        };
        let lines = (1..=MOST_LINES).flat_map(|k| [-(k as f64), k as f64]);
        let moved = lines.flat_map(|line| {
            let by = 1.1 * size * line;
            candidates.iter().map(move |&([x, y], anchor)| ([x, y + by], anchor))
        });
        let found = candidates.iter().copied().chain(moved).find(is_free);
        let (at, anchor) = found.unwrap_or(candidates[0]);
        self.keep(at, size, words, anchor);
        (at, anchor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_want_one_place_are_moved_apart() {
        let mut labels = Labels::default();
        let wanted = [([10.0, 20.0], Anchor::End), ([10.0, 20.0], Anchor::Start)];
        let placed: Vec<(Point, Anchor)> =
            (0..12).map(|_| labels.place(&wanted, 2.0, "side-front-left")).collect();
        // By plain areas: no two of the boxes share any.
        let around = |(at, anchor): &(Point, Anchor)| bounds(*at, 2.0, "side-front-left", *anchor);
        let boxes: Vec<[f64; 4]> = placed.iter().map(around).collect();
        for (k, a) in boxes.iter().enumerate() {
            for b in &boxes[k + 1..] {
                let side = |k: usize| (a[k + 2].min(b[k + 2]) - a[k].max(b[k])).max(0.0);
                assert!(side(0) * side(1) < 1e-9, "{placed:?}");
            }
        }
        assert_eq!((placed[0], placed[1]), (wanted[0], wanted[1]));
    }
}
