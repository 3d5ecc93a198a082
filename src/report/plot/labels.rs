//! Words beside points of a chart, and words in lines.

use maud::{Markup, html};

use crate::report::chart::PointLabels;
use crate::report::columns::in_lines;
use crate::report::svg::px;

/// Pixels that a character of a label takes on average, and its height.
const PLOT_LABELS_LETTER: f64 = 6.2;
const PLOT_LABELS_HEIGHT: f64 = 12.0;

pub(in crate::report) struct PlotLabels {
    area: [f64; 4],
    points: Vec<(f64, f64)>,
    /// Points with their words; those in one place share them.
    places: Vec<((f64, f64), String)>,
    /// Lines under the chart that explain the numbers, from the left of the area on; `None` where the words stand beside
    /// their points.
    pub list: Option<Vec<String>>,
}

impl PlotLabels {
    /// Words beside points: `labels` are (number of a point, words), `points` pixels that words keep clear of, `area` (left,
    /// right, top, bottom) within a drawing of `width`.
    pub(crate) fn new<'a>(
        points: &[(f64, f64)],
        labels: impl Iterator<Item = (usize, &'a str)>,
        area: [f64; 4],
        width: f64,
    ) -> Self {
        let is_drawn = |at: &(f64, f64)| at.0.is_finite() && at.1.is_finite();
        let mut places: Vec<((f64, f64), String)> = Vec::new();
        for (point, words) in labels {
            let Some(at) = points.get(point).copied().filter(is_drawn) else { continue };
            let near = |place: (f64, f64)| (place.0 - at.0).abs().max((place.1 - at.1).abs()) < 1.0;
            match places.iter_mut().find(|(place, _)| near(*place)) {
                Some((_, others)) => *others += &format!(", {words}"),
                None => places.push((at, words.to_owned())),
            }
        }
        let points: Vec<(f64, f64)> = points.iter().copied().filter(is_drawn).collect();
        let list = (!have_room(&places, &points, width, [area[0], area[1]])).then(|| {
            let letters = ((width - area[0] - 10.0) / PLOT_LABELS_LETTER) as usize;
            let numbered =
                (1..).zip(&places).map(|(number, (_, words))| format!("{number}: {words}"));
            numbered.flat_map(|item| lines(&item, letters)).collect()
        });
        Self { area, points, places, list }
    }

    pub(crate) fn draw(&self) -> Markup {
        if self.list.is_none() {
            return html! {
                @for (at, words) in &self.places {
                    @let ([left, right, _, y], is_left) = beside(*at, words, [self.area[0], self.area[1]]);
                    @if is_left {
                        text x=(px(right)) y=(px(y)) font-size="12" text-anchor="end" { (words) }
                    } @else {
                        text x=(px(left)) y=(px(y)) font-size="12" { (words) }
                    }
                }
            };
        }
        let mut labels = PointLabels { area: self.area, taken: self.points.clone(), line: &[] };
        html! {
            @for (number, (at, _)) in (1..).zip(&self.places) { (labels.write(*at, number)) }
        }
    }
}

/// A text in lines of at most `letters` letters; lines after the first are set in. A longer word is broken.
pub(super) fn lines(text: &str, letters: usize) -> Vec<String> {
    let pieces = |word: &str| -> Vec<String> {
        let all: Vec<char> = word.chars().collect();
        all.chunks(letters.saturating_sub(1).max(1)).map(|part| part.iter().collect()).collect()
    };
    let words = text.split(' ').flat_map(|word| match word.chars().count() >= letters {
        true => pieces(word),
        false => vec![word.to_owned()],
    });
    // A drawing drops plain spaces at the beginning.
    in_lines(words, letters, "\u{2003}")
}

/// Box of a point's words (left, right, top, bottom); true where they stand left of the point. They do where they would pass
/// the right end of the area, with the legend behind it, and have room before its left end, with the axis.
fn beside((x, y): (f64, f64), words: &str, [begin, end]: [f64; 2]) -> ([f64; 4], bool) {
    let (length, y) = (PLOT_LABELS_LETTER * words.chars().count() as f64, y - 7.0);
    let (left, right) = (x - 7.0 - length, x + 7.0 + length);
    match right > end && left > begin {
        true => ([left, x - 7.0, y - PLOT_LABELS_HEIGHT, y], true),
        false => ([x + 7.0, right, y - PLOT_LABELS_HEIGHT, y], false),
    }
}

/// True if all words end within the drawing, and none stand on others or on a point. The area has a left and a right end.
fn have_room(
    places: &[((f64, f64), String)],
    points: &[(f64, f64)],
    width: f64,
    ends: [f64; 2],
) -> bool {
    let boxes = places.iter().map(|(at, words)| beside(*at, words, ends).0);
    let boxes: Vec<[f64; 4]> = boxes.collect();
    let clear =
        |a: &[f64; 4], b: &[f64; 4]| a[1] < b[0] || b[1] < a[0] || a[3] < b[2] || b[3] < a[2];
    let apart = |k: usize| {
        let words = &boxes[k];
        let mut points = points.iter().map(|(x, y)| [x - 4.0, x + 4.0, y - 4.0, y + 4.0]);
        boxes[..k].iter().all(|other| clear(words, other))
            && points.all(|point| clear(words, &point))
    };
    boxes.iter().all(|words| words[1] < width) && (0..boxes.len()).all(apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_cross_no_axis() {
        let placed =
            |x: f64, letters: usize| beside((x, 50.0), &"w".repeat(letters), [90.0, 650.0]);
        let (words, is_left) = placed(600.0, 50);
        assert!(is_left && words[0] > 90.0 && words[1] < 600.0);
        // Too long for the left, they pass the right end; short ones stand right of their point.
        assert!(!placed(358.0, 50).1 && !placed(358.0, 20).1);
    }

    #[test]
    fn words_without_room_are_numbers_with_a_list() {
        let area = [90.0, 650.0, 50.0, 350.0];
        let named = |points: &[(f64, f64)], words: [&str; 2]| {
            let labels = words.into_iter().enumerate();
            let named = PlotLabels::new(points, labels, area, 900.0);
            (named.draw().into_string(), named.list.clone())
        };
        let apart = [(100.0, 300.0), (500.0, 100.0)];
        let (drawn, list) = named(&apart, ["one roof", "two doors"]);
        assert!(drawn.contains(">one roof<") && list.is_none(), "{drawn}");
        let (drawn, list) = named(&[(100.0, 300.0), (640.0, 100.0)], ["one roof", "two doors"]);
        assert!(drawn.contains("text-anchor=\"end\">two doors<") && list.is_none(), "{drawn}");
        let near = [(100.0, 300.0), (120.0, 296.0)];
        let (drawn, list) = named(&near, ["one roof", "two doors"]);
        assert!(drawn.contains(">1<") && drawn.contains(">2<"), "{drawn}");
        assert_eq!(list.unwrap(), ["1: one roof", "2: two doors"]);
        // A point without words is kept clear, too.
        let with_third = [(100.0, 300.0), (500.0, 100.0), (130.0, 288.0)];
        assert!(named(&with_third, ["one roof", "two doors"]).1.is_some());
        let long = "word ".repeat(40);
        let list = named(&apart, ["one roof", long.trim()]).1.unwrap();
        assert_eq!(list.len(), 3);
        assert!(list[2].starts_with("\u{2003}word") && list[1].chars().count() <= 129, "{list:?}");
    }
}
