use std::fmt::Write;

use super::svg::{ACCENT, FAINT, INK, LIDAR_COLOURS, escape, number, open, scale, ticks};

/// Pixels of the plot area.
const LEFT: f64 = 90.0;
const TOP: f64 = 50.0;
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 300.0;
/// Pixels of the whole.
const ALL: (f64, f64) = (900.0, 470.0);
/// Pixels that a character takes at most, on average.
const LETTER: f64 = 7.0;
/// Characters that have room: over the chart, in the legend, turned under the axis.
const TITLE: usize = 100;
const LEGEND: usize = 30;
const TURNED: usize = 22;

/// A text of at most so many characters; the rest is left out.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most - 1).chain(['…']).collect()
}

/// What stands along the x axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Axis {
    /// Names at equal distances; the points of a series come in their order.
    Names(Vec<String>),
    /// Numbers.
    Numbers,
}

/// One set of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// For the legend.
    pub name: String,
    /// (x, y); with [`Axis::Names`], x is the number of the name.
    pub points: Vec<(f64, f64)>,
    /// Whether the points are joined.
    pub line: bool,
    /// Words beside single points, by their number.
    pub labels: Vec<(usize, String)>,
}

/// A plain chart of some series.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// Over the chart.
    pub title: String,
    /// Under the x axis.
    pub x_title: String,
    /// Over the y axis.
    pub y_title: String,
    /// What stands along x.
    pub x: Axis,
    /// At most eight are told apart by colour.
    pub series: Vec<Series>,
}

impl Plot {
    /// As SVG, to stand alone or in a page.
    pub fn svg(&self) -> String {
        let mut svg = open(ALL.0, ALL.1, &self.title);
        let (right, bottom) = (LEFT + WIDTH, TOP + HEIGHT);
        let points = || self.series.iter().flat_map(|s| &s.points);
        let finite = |v: &f64| v.is_finite();
        let range = |values: Vec<f64>| {
            let values = values.into_iter().filter(finite);
            let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            let margin =
                if high > low { 0.06 * (high - low) } else { 0.05 * high.abs().max(1e-12) };
            (low - margin, high + margin)
        };
        let _ = writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"20\" font-weight=\"600\">{}</text>",
            escape(&cut(&self.title, TITLE))
        );
        if points().next().is_none() {
            svg += "<text x=\"90\" y=\"60\">There is nothing to draw.</text></svg>\n";
            return svg;
        }
        let x_range = match &self.x {
            Axis::Names(names) => (-0.5, names.len() as f64 - 0.5),
            Axis::Numbers => range(points().map(|p| p.0).collect()),
        };
        let y_range = range(points().map(|p| p.1).collect());
        let x = |v: f64| scale(v, x_range, (LEFT, right));
        let y = |v: f64| scale(v, y_range, (bottom, TOP));
        for tick in ticks(y_range.0, y_range.1, 6) {
            let at = y(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{LEFT} {at:.1}H{right}\" stroke=\"{FAINT}\" stroke-width=\".6\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 8.0,
                at + 4.5,
                number(tick)
            );
        }
        let marks: Vec<(f64, String)> = match &self.x {
            Axis::Names(names) => {
                names.iter().enumerate().map(|(k, name)| (k as f64, name.clone())).collect()
            }
            Axis::Numbers => {
                ticks(x_range.0, x_range.1, 6).into_iter().map(|t| (t, number(t))).collect()
            }
        };
        let room = WIDTH / marks.len().max(1) as f64;
        let wide = |(_, name): &(f64, String)| name.chars().count() as f64 * LETTER > room;
        let turned = matches!(self.x, Axis::Names(_)) && marks.iter().any(wide);
        for (value, text) in &marks {
            let at = x(*value);
            let place = if turned {
                format!(
                    "text-anchor=\"end\" transform=\"rotate(-30 {at:.1} {:.1})\"",
                    bottom + 18.0
                )
            } else {
                "text-anchor=\"middle\"".to_owned()
            };
            let _ = writeln!(
                svg,
                "<path d=\"M{at:.1} {bottom}v5\" stroke=\"{INK}\"/>\
                 <text x=\"{at:.1}\" y=\"{:.1}\" {place}>{}</text>",
                bottom + 20.0,
                escape(&cut(text, TURNED))
            );
        }
        for (index, series) in self.series.iter().enumerate() {
            let colour = if self.series.len() == 1 { ACCENT } else { LIDAR_COLOURS[index % 8] };
            self.draw(&mut svg, series, colour, &x, &y);
            let at = TOP + 10.0 + 20.0 * index as f64;
            let _ = writeln!(
                svg,
                "<circle cx=\"{}\" cy=\"{at}\" r=\"5\" fill=\"{colour}\"/>\
                 <text x=\"{}\" y=\"{}\">{}</text>",
                right + 20.0,
                right + 32.0,
                at + 4.5,
                escape(&cut(&series.name, LEGEND))
            );
        }
        let _ = writeln!(
            svg,
            "<path d=\"M{LEFT} {TOP}V{bottom}H{right}\" fill=\"none\" stroke=\"{INK}\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\
             <text x=\"{LEFT}\" y=\"40\">{}</text></svg>",
            LEFT + WIDTH / 2.0,
            ALL.1 - 12.0,
            escape(&self.x_title),
            escape(&self.y_title)
        );
        svg
    }

    fn draw(
        &self,
        svg: &mut String,
        series: &Series,
        colour: &str,
        x: &dyn Fn(f64) -> f64,
        y: &dyn Fn(f64) -> f64,
    ) {
        let drawn = series.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
        if series.line {
            let path: Vec<String> =
                drawn.clone().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
                path.join(" ")
            );
        }
        for point in drawn {
            let (px, py) = (x(point.0), y(point.1));
            let _ =
                writeln!(svg, "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"4\" fill=\"{colour}\"/>");
        }
        // Points in one place share a line of words.
        let mut places: Vec<((f64, f64), String)> = Vec::new();
        for (point, words) in &series.labels {
            let Some(&(px, py)) = series.points.get(*point) else { continue };
            let at = (x(px) + 7.0, y(py) - 7.0);
            let near = |place: (f64, f64)| (place.0 - at.0).abs().max((place.1 - at.1).abs()) < 1.0;
            match places.iter_mut().find(|(place, _)| near(*place)) {
                Some((_, others)) => *others += &format!(", {words}"),
                None => places.push((at, words.clone())),
            }
        }
        for ((px, py), words) in places {
            let _ = writeln!(
                svg,
                "<text x=\"{px:.1}\" y=\"{py:.1}\" font-size=\"12\">{}</text>",
                escape(&words)
            );
        }
    }
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
            }],
        };
        let svg = plot.svg();
        // A quarter and three quarters of the width; 6 % of the range as margin.
        assert!(svg.contains("cx=\"230.0\"") && svg.contains("cx=\"510.0\""), "{svg}");
        let low = TOP + HEIGHT * (1.0 - 0.12 / 2.24);
        assert!(svg.contains(&format!("cy=\"{low:.1}\"")), "{svg}");
        assert!(svg.contains("a &lt; b") && svg.contains(">best<") && !svg.contains("NaN"));
        assert!(Plot { series: vec![], ..plot }.svg().contains("nothing to draw"));
    }

    #[test]
    fn words_that_have_no_room_are_turned_shared_or_cut() {
        let series = Series {
            name: "n".repeat(40),
            points: vec![(0.0, 1.0), (1.0, 3.0), (1.0, 3.0)],
            line: false,
            labels: vec![(1, "a".into()), (2, "b".into())],
        };
        let names = [
            "without LiDAR 0",
            "without LiDAR 1",
            "without LiDAR 2",
            "all",
            "after the worst loss",
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
        assert!(svg.contains(&format!(">{}…<", "n".repeat(29))));
        assert!(svg.contains(&format!(">{}…<", "t".repeat(99))), "the whole stands in <title>");
        let short =
            Plot { x: Axis::Names(names[3..].iter().map(|n| (*n).into()).collect()), ..plot };
        assert!(!short.svg().contains("rotate"));
    }
}
