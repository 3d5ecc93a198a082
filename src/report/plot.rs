//! Plain charts of some series: points, lines, levels across, changes along x, and a legend.
//!
//! | file | holds |
//! |---|---|
//! | `labels` | words beside points, and words in lines |

mod labels;

use maud::{Markup, html};

use super::svg::{ACCENT, Axes, GREY, INK, SOFT, Scale, Tick, colour, corners, number, page, px};
use super::text::shortened;

pub(super) use labels::PlotLabels;
use labels::lines;

/// Pixels of the plot area.
const LEFT: f64 = 90.0;
const TOP: f64 = 50.0;
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 300.0;
/// Pixels of the whole width.
const ALL: f64 = 900.0;
/// Pixels that a character takes at most, on average.
const LETTER: f64 = 7.0;
/// Pixels between two lines of words.
const LINE: f64 = 15.0;
/// Pixels from the axis to the words under it.
const UNDER: f64 = 20.0;
/// Pixels between two entries of the legend.
const ENTRY: f64 = 20.0;
/// Characters of a line over the chart, and of one in the legend.
const TITLE: usize = 100;
const LEGEND: usize = 30;
/// Characters after which a name ends all the same: a bound for files that are not meant to be drawn.
const LONGEST: usize = 300;
/// Points of a line that are also drawn one by one, if there are no more.
const DOTTED: usize = 60;

fn legend_lines(text: &str) -> Vec<String> {
    lines(&shortened(text, LONGEST), LEGEND)
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Axis {
    /// Names at equal distances; the points of a series come in their order.
    Names(Vec<String>),
    Numbers,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Series {
    pub name: String,
    /// (x, y); with [`Axis::Names`], x is the number of the name.
    pub points: Vec<(f64, f64)>,
    /// True if the points are joined.
    pub line: bool,
    /// Words beside single points, by their number.
    pub labels: Vec<(usize, String)>,
    /// Numbers of points that are drawn hollow.
    pub hollow: Vec<usize>,
    /// True if the points are diamonds.
    pub diamonds: bool,
    /// Pixels of each point's radius, where points differ in size. A series of one size without points is a grey line of the
    /// legend.
    pub sizes: Vec<f64>,
}

impl Series {
    /// Radius of a point by its number; in the legend of the first one.
    fn radius(&self, point: usize, other: f64) -> f64 {
        self.sizes.get(point).copied().unwrap_or(other)
    }

    /// True for a line of the legend that explains a size.
    fn is_key(&self) -> bool {
        self.points.is_empty() && !self.sizes.is_empty()
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plot {
    pub title: String,
    pub x_title: String,
    pub y_title: String,
    pub x: Axis,
    /// At most sixteen are told apart by colour.
    pub series: Vec<Series>,
}

/// A line across the chart at a value of y, named at its right end.
pub(super) struct ReferenceLine<'a> {
    pub name: &'a str,
    pub value: f64,
    pub accent: bool,
}

/// A thin line from bottom to top where something changes along x, named at its foot.
pub(super) struct Change {
    pub at: f64,
    pub name: String,
    /// True if values beyond are of another kind, so that curves end there.
    pub ends_curves: bool,
}

impl Plot {
    /// The SVG, to stand alone or in a page.
    pub(crate) fn svg(&self) -> String {
        self.svg_with(&[], &[])
    }

    /// Like [`Self::svg`], with lines across and upwards.
    pub(super) fn svg_with(&self, levels: &[ReferenceLine], changes: &[Change]) -> String {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let is_empty = points().next().is_none();
        let heights = points().map(|p| p.1).chain(levels.iter().map(|l| l.value));
        let marks = self.marks();
        let x_range = match &self.x {
            Axis::Names(names) => (-0.5, names.len() as f64 - 0.5),
            Axis::Numbers => range(points().map(|p| p.0)),
        };
        let axes = Axes {
            x: Scale::linear(x_range, (LEFT, LEFT + WIDTH)),
            y: Scale::linear(range(heights), (TOP + HEIGHT, TOP)),
        };
        let marks = marks.unwrap_or_else(|| axes.x.ticks(number));
        let room = WIDTH / marks.len().max(1) as f64;
        let is_wide = |t: &Tick| {
            t.text.as_ref().is_some_and(|text| text.chars().count() as f64 * LETTER > room)
        };
        let turned = matches!(self.x, Axis::Names(_)) && marks.iter().any(is_wide);
        let x_title = TOP + HEIGHT + UNDER + drop_of(&marks, turned) + UNDER;
        let names: Vec<PlotLabels> =
            self.series.iter().map(|series| self.named(series, &axes)).collect();
        let listed = names.iter().flat_map(|labels| labels.list.iter().flatten());
        let listed: Vec<(f64, &String)> =
            (2..).map(|k| x_title + LINE * f64::from(k)).zip(listed).collect();
        let title = lines(&shortened(&self.title, LONGEST), TITLE);
        let moved = [spill_of(&marks, turned, &axes), LINE * (title.len() as f64 - 1.0)];
        let (legend, legend_end) = self.legend();
        let (levels, levels_end) = self.levels(levels, &axes, legend_end);
        let body = html! {
            g transform=[(moved != [0.0; 2]).then(|| format!("translate({} {})", px(moved[0]), moved[1]))] {
                @for (k, line) in (0_u32..).zip(&title) {
                    text x=(LEFT) y=(20.0 + LINE * f64::from(k) - moved[1]) font-weight="600" { (line) }
                }
                @if is_empty {
                    text x=(LEFT) y="60" { "There is nothing to draw." }
                } @else {
                    (axes.draw(&marks, &axes.y.ticks(number), turned))
                    (levels)
                    @for (index, (series, names)) in self.series.iter().zip(&names).enumerate() {
                        (self.draw(series, self.colour(index), &axes, changes))
                        (names.draw())
                    }
                    (changed(changes, &axes))
                    (legend)
                    text x=(LEFT + WIDTH / 2.0) y=(px(x_title)) text-anchor="middle" { (self.x_title) }
                    text x=(LEFT) y="40" { (self.y_title) }
                    @for (y, name) in &listed { text x=(LEFT) y=(px(*y)) font-size="12" { (name) } }
                }
            }
        };
        let last = listed.last().map_or(x_title, |(y, _)| *y).max(legend_end).max(levels_end);
        page([ALL + moved[0], last + 14.0 + moved[1]], &self.title, &body)
    }

    /// Names of the series with their colours, and the pixel at which they end.
    fn legend(&self) -> (Markup, f64) {
        let (x, mut y) = (LEFT + WIDTH + 20.0, TOP + 10.0);
        let drawn = html! {
            @for (index, series) in self.series.iter().enumerate() {
                @if series.diamonds {
                    (diamond((x, y), 6.0, self.colour(index), false))
                } @else {
                    circle cx=(x) cy=(y) r=(if series.is_key() { series.radius(0, 5.0) } else { 5.0 }) fill=(self.colour(index)) {}
                }
                @for (k, line) in legend_lines(&series.name).iter().enumerate() {
                    ({ y += if k == 0 { 0.0 } else { LINE }; "" })
                    text x=(x + 12.0) y=(y + 4.5) { (line) }
                }
                ({ y += ENTRY; "" })
            }
        };
        (drawn, y - ENTRY)
    }

    fn colour(&self, index: usize) -> &'static str {
        let mut drawn = self.series.iter().filter(|series| !series.is_key());
        match self.series[index].is_key() {
            true => GREY,
            false if drawn.nth(1).is_none() => ACCENT,
            false => colour(index),
        }
    }

    /// Words beside the points of a series, clear of other points.
    fn named(&self, series: &Series, axes: &Axes) -> PlotLabels {
        let area = [LEFT, LEFT + WIDTH, TOP, TOP + HEIGHT];
        let others = self.series.iter().filter(|of| !of.line && !std::ptr::eq(*of, series));
        let all = series.points.iter().chain(others.flat_map(|of| &of.points));
        let points: Vec<(f64, f64)> = all.map(|point| axes.at(*point)).collect();
        let labels = series.labels.iter().map(|(point, words)| (*point, words.as_str()));
        PlotLabels::new(&points, labels, area, ALL)
    }

    /// Names along x; `None` where numbers stand there.
    fn marks(&self) -> Option<Vec<Tick>> {
        let Axis::Names(names) = &self.x else { return None };
        let tick = |(at, name): (usize, &String)| Tick {
            value: at as f64,
            text: Some(shortened(name, LONGEST)),
        };
        Some(names.iter().enumerate().map(tick).collect())
    }

    /// Lines across, and the pixel at which their names end. Names of close ones are moved apart, and below the legend; a
    /// thin line leads to each.
    fn levels(&self, levels: &[ReferenceLine], axes: &Axes, legend_end: f64) -> (Markup, f64) {
        let mut sorted: Vec<&ReferenceLine> = levels.iter().collect();
        sorted.sort_by(|a, b| b.value.total_cmp(&a.value));
        let mut label_y = legend_end + 10.0;
        let right = LEFT + WIDTH;
        let drawn = html! {
            @for level in sorted {
                @let at = axes.y.at(level.value);
                @let label = at.max(label_y + LINE);
                @let (line, ink) = if level.accent { (ACCENT, INK) } else { (GREY, SOFT) };
                path d={ "M" (LEFT) " " (px(at)) "H" (right) "L" (right + 12.0) " " (px(label)) }
                    stroke=(line) fill="none" stroke-width=".8" stroke-dasharray="4 3" {}
                ({ label_y = label - LINE; "" })
                @for words in legend_lines(level.name) {
                    ({ label_y += LINE; "" })
                    text x=(right + 16.0) y=(px(label_y + 4.5)) fill=(ink) { (words) }
                }
            }
        };
        (drawn, if levels.is_empty() { 0.0 } else { label_y })
    }

    /// A series; its line ends at each change, beyond which values are of another kind.
    fn draw(&self, series: &Series, colour: &str, axes: &Axes, changes: &[Change]) -> Markup {
        let is_drawn = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let drawn: Vec<(f64, f64)> = series.points.iter().filter(is_drawn).copied().collect();
        let ends = || changes.iter().filter(|change| change.ends_curves);
        let changes_before = |x: f64| ends().filter(|change| change.at < x).count();
        let is_hollow = |k: &usize| series.hollow.contains(k);
        let all = series.points.iter().enumerate().filter(|(_, p)| is_drawn(p));
        html! {
            @if series.line {
                @for part in drawn.chunk_by(|a, b| changes_before(a.0) == changes_before(b.0)) {
                    polyline points=(corners(part.iter().map(|&p| axes.at(p)))) fill="none"
                        stroke=(colour) stroke-width="2" {}
                }
            }
            @if !series.line || drawn.len() <= DOTTED {
                @for (k, (x, y)) in all.map(|(k, &p)| (k, axes.at(p))) {
                    @if series.diamonds {
                        (diamond((x, y), series.radius(k, 5.5), colour, is_hollow(&k)))
                    } @else if is_hollow(&k) {
                        circle cx=(px(x)) cy=(px(y)) r="4.5" fill="#fff" stroke=(colour) stroke-width="2" {}
                    } @else {
                        circle cx=(px(x)) cy=(px(y)) r=(series.radius(k, 4.0)) fill=(colour)
                            fill-opacity=[(!series.sizes.is_empty()).then_some(".75")] {}
                    }
                }
            }
        }
    }
}

/// A square on its corner, `half` pixels from the middle to each.
fn diamond((x, y): (f64, f64), half: f64, colour: &str, is_hollow: bool) -> Markup {
    let all = corners([(x, y - half), (x + half, y), (x, y + half), (x - half, y)]);
    html! {
        @if is_hollow {
            polygon points=(all) fill="#fff" stroke=(colour) stroke-width="2" {}
        } @else {
            polygon points=(all) fill=(colour) {}
        }
    }
}

/// Pixels that names reach down from where they begin under the axis.
fn drop_of(marks: &[Tick], turned: bool) -> f64 {
    let length = |tick: &Tick| tick.text.as_ref().map_or(0, |text| text.chars().count()) as f64;
    // Turned by 30°.
    if turned { 0.5 * LETTER * marks.iter().map(length).fold(0.0, f64::max) } else { 0.0 }
}

/// Lines upwards, each named at its foot beside it; names of close ones stand above each other.
fn changed(changes: &[Change], axes: &Axes) -> Markup {
    let bottom = TOP + HEIGHT;
    html! {
        @for (index, change) in changes.iter().enumerate() {
            @let x = axes.x.at(change.at);
            @let room = change.name.chars().count() as f64 * LETTER;
            @let (at, anchor) = if x + room < LEFT + WIDTH { (x + 4.0, "start") } else { (x - 4.0, "end") };
            path d={ "M" (px(x)) " " (TOP) "V" (bottom) } stroke=(GREY) stroke-width=".8" {}
            text x=(px(at)) y=(px(bottom - 7.0 - LINE * (index % 4) as f64)) text-anchor=(anchor)
                font-size="12" fill=(SOFT) stroke="#fff" stroke-width="3" paint-order="stroke" { (change.name) }
        }
    }
}

/// Pixels that turned names reach out of the drawing at its left.
fn spill_of(marks: &[Tick], turned: bool, axes: &Axes) -> f64 {
    let left = |tick: &Tick| {
        let letters = tick.text.as_ref().map_or(0, |text| text.chars().count()) as f64;
        // Turned by 30°, as in `drop_of`.
        0.87 * LETTER * letters - axes.x.at(tick.value) + 4.0
    };
    if turned { marks.iter().map(left).fold(0.0, f64::max).ceil() } else { 0.0 }
}

/// The range of the finite values with 6 % of margin at both ends.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values = values.filter(|v| v.is_finite());
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    let margin = if high > low { 0.06 * (high - low) } else { 0.05 * high.abs().max(1e-12) };
    (low - margin, high + margin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_stand_where_the_axes_say() {
        let plot = Plot {
            title: "a < b".into(),
            x_title: "x".into(),
            y_title: "y".into(),
            x: Axis::Names(vec!["one".into(), "two".into()]),
            series: vec![Series {
                name: "s".into(),
                points: vec![(0.0, 1.0), (1.0, 3.0), (0.0, f64::NAN)],
                line: true,
                labels: vec![(1, "best".into())],
                hollow: vec![0],
                ..Series::default()
            }],
        };
        let svg = plot.svg();
        // A quarter and three quarters of the width; 6 % of the range as margin.
        assert!(svg.contains("cx=\"230.0\"") && svg.contains("cx=\"510.0\""), "{svg}");
        assert_eq!(
            svg.matches("fill=\"#fff\" stroke=").count(),
            1,
            "the first point is hollow: {svg}"
        );
        let low = TOP + HEIGHT * (1.0 - 0.12 / 2.24);
        assert!(svg.contains(&format!("cy=\"{low:.1}\"")), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.contains(">best<") && !svg.contains("NaN"));
        assert!(Plot { series: vec![], ..plot }.svg().contains("nothing to draw"));
    }

    #[test]
    fn words_that_have_no_room_are_turned_shared_or_broken() {
        let series = Series {
            name: "n".repeat(40),
            points: vec![(0.0, 1.0), (1.0, 3.0), (1.0, 3.0)],
            labels: vec![(1, "a".into()), (2, "b".into())],
            ..Series::default()
        };
        let names = [
            "without LiDAR 0", "without LiDAR 1", "without LiDAR 2", "all", "after the worst loss",
        ];
        let plot = Plot {
            title: "t".repeat(200),
            x_title: "x".into(),
            y_title: "y".into(),
            x: Axis::Names(names.map(String::from).to_vec()),
            series: vec![series],
        };
        let svg = plot.svg();
        assert_eq!(svg.matches("rotate(-30").count(), 5);
        assert!(svg.contains(">a, b<"), "{svg}");
        // No letter is lost: those of a word without a space follow in the next line.
        assert!(svg.contains(&format!(">{}<", "n".repeat(29))) && !svg.contains('…'), "{svg}");
        assert!(svg.contains(&format!(">\u{2003}{}<", "n".repeat(11))), "{svg}");
        assert!(svg.contains(&format!(">{}<", "t".repeat(99))), "{svg}");
        assert!(
            svg.contains("translate(0.0 30)"),
            "three lines of title push the chart down: {svg}"
        );
        // The first name begins left of the drawing unless all of it moves.
        let long = "a name of a placement that is longer than most of them are".to_owned();
        let wide = Plot { x: Axis::Names(vec![long.clone(), "b".into()]), ..plot.clone() }.svg();
        assert!(
            wide.contains(&format!(">{long}<")) && wide.contains("translate(128.0 30)"),
            "{wide}"
        );
        let short =
            Plot { x: Axis::Names(names[3..].iter().map(|n| (*n).into()).collect()), ..plot };
        assert!(!short.svg().contains("rotate"));
    }
}
