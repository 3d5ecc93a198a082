//! Chart of cost against ranking error of every setting, with a table of the numbered ones.

use maud::{Markup, html};

use super::chart_text::{seconds, table};
use super::svg::{ACCENT, Axes, GREY, INK, SECOND, SOFT, Scale, corners, page, px, trimmed};
use crate::chart::{Chart, Engine, Rated, pareto};
use crate::maths;

/// Pixels of the picture's width, and of a row of its table.
const WIDTH: f64 = 1000.0;
const ROW: f64 = 19.0;
/// Left, right, top and bottom of the plot area.
const AREA: [f64; 4] = [76.0, 976.0, 62.0, 490.0];
/// Height of the table's titles, in pixels from the top.
const TABLE: f64 = 600.0;

/// Cost against ranking error of every setting, both logarithmic; the Pareto front, the setting to take
/// and the atlases are numbered, with a table below.
///
/// A point is at (seconds a placement, 1 − τ), its whisker the 95 % interval of 1 − τ; rankings equal
/// to the reference's stand on the line marked 0. Settings whose τ does not exist are left out.
pub(crate) fn fidelity_svg(chart: &Chart) -> String {
    let (rated, chosen) = (&chart.rated[..], chart.verdict.map(|verdict| verdict.setting));
    let points: Vec<usize> = (0..rated.len()).filter(|&i| rated[i].error.tau.is_some()).collect();
    let front: Vec<usize> = pareto(rated).into_iter().filter(|i| points.contains(i)).collect();
    // The setting to take may lie off the front, which knows τ and not the regret; an atlas does.
    let atlas = points.iter().filter(|&&i| rated[i].measured.setting.engine == Engine::Atlas);
    let off = chosen.iter().filter(|c| !front.contains(c) && points.contains(c)).chain(atlas);
    let listed: Vec<usize> = front.iter().chain(off).copied().collect();
    let rows: Vec<(f64, usize)> =
        (1..).zip(&listed).map(|(n, &i)| (TABLE + ROW * f64::from(n), i)).collect();
    let body = html! {
        text x="20" y="26" font-size="16" font-weight="600" {
            (chart.scene) ": " (chart.placements.len()) " placements ranked by " (chart.objective)
        }
        @if points.is_empty() {
            text x="20" y="60" { "No two placements differ: there is no ranking." }
        } @else {
            (points_and_axes(rated, &points, &front, &listed, chosen))
            (table(chart, TABLE, &rows))
        }
    };
    let height = TABLE + ROW * (listed.len() as f64 + 2.0);
    page([WIDTH, height], "Cost against ranking error", &body)
}

fn points_and_axes(
    rated: &[Rated],
    points: &[usize],
    front: &[usize],
    listed: &[usize],
    chosen: Option<usize>,
) -> Markup {
    let area = Area::around(rated, points);
    let line: Vec<(f64, f64)> = front.iter().map(|&i| area.at(&rated[i])).collect();
    let taken = points.iter().map(|&i| area.at(&rated[i])).collect();
    let mut labels = PointLabels { area: AREA, taken, line: &line };
    let numbers: Vec<Markup> =
        (1..).zip(listed).map(|(number, &i)| labels.write(area.at(&rated[i]), number)).collect();
    let ink = |i: usize| match i {
        i if chosen == Some(i) => (ACCENT, ACCENT),
        i if front.contains(&i) => (SECOND, "#fff"),
        _ => (INK, "#fff"),
    };
    html! {
        (area.draw())
        @for &i in points.iter().filter(|i| !listed.contains(i)) {
            (area.point(&rated[i], (GREY, "#fff"), 3.5))
        }
        polyline points=(corners(line.iter().copied())) fill="none" stroke=(SECOND) stroke-width="1.6" {}
        @for &i in listed { (area.point(&rated[i], ink(i), 4.5)) }
        @for number in numbers { (number) }
    }
}

/// 1 − τ, and the ends of its interval.
fn misranked(rated: &Rated) -> [f64; 3] {
    rated.error.tau.map_or([1.0; 3], |tau| [tau.value, tau.low, tau.high].map(|t| 1.0 - t))
}

/// The plot area: seconds a placement to the right, 1 − τ upwards.
struct Area {
    axes: Axes,
}

impl Area {
    fn around(rated: &[Rated], points: &[usize]) -> Self {
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let x = range(&mut points.iter().map(|&i| maths::log10(rated[i].measured.seconds)));
        let above = points.iter().flat_map(|&i| misranked(&rated[i]));
        let (low, high) = range(&mut above.filter(|v| *v > 1e-9).map(maths::log10));
        let (low, high) = if low <= high { (low, high) } else { (-3.0, 0.0) };
        let [left, right, top, bottom] = AREA;
        let x = Scale::log((half_below(x.0 - 0.15), x.1 + 0.2), (left, right));
        let y = Scale::log((half_below(low - 0.35), high + 0.15), (bottom, top));
        Self { axes: Axes { x, y } }
    }

    /// Pixel of 1 − τ; 0 stands on the x axis.
    fn at_y(&self, misranked: f64) -> f64 {
        let lowest = maths::pow(10_f64, self.axes.y.range.0);
        self.axes.y.at(if misranked > 1e-9 { misranked.max(lowest) } else { lowest })
    }

    fn at(&self, rated: &Rated) -> (f64, f64) {
        (self.axes.x.at(rated.measured.seconds), self.at_y(misranked(rated)[0]))
    }

    fn draw(&self) -> Markup {
        let [left, right, _, bottom] = AREA;
        let lowest = self.axes.y.range.0;
        let mut y = self.axes.y.ticks(|v| trimmed(v, 6));
        // No tick in the way of the line for 0.
        y.retain(|tick| maths::log10(tick.value) > lowest + 0.12);
        html! {
            (self.axes.draw(&self.axes.x.ticks(seconds), &y, false))
            text x=(left - 8.0) y=(bottom + 4.5) text-anchor="end" { "0" }
            text x=((left + right) / 2.0) y=(bottom + 40.0) text-anchor="middle" {
                "wall time of a placement, all threads at work"
            }
            text x="20" y="50" {
                "1 − Kendall τ against the reference, with 95 % intervals; 0: the same ranking"
            }
            text x="20" y=(bottom + 62.0) font-size="12" fill=(SOFT) {
                "□ f64 · ○ CPU f32 · ◇ GPU f32 · line: Pareto front · filled, red: cheapest that keeps the \
                 ranking within the tolerance · grey: others, in chart.csv"
            }
            text x="20" y=(bottom + 78.0) font-size="12" fill=(SOFT) {
                "△ warm pose atlas: scores only poses it has, snapped to its grid, which is most of its \
                 error; not on the front"
            }
        }
    }

    /// The mark of a setting in the shape of its engine, with its whisker.
    fn point(&self, rated: &Rated, (colour, fill): (&str, &str), r: f64) -> Markup {
        let (x, y) = self.at(rated);
        let [_, low, high] = misranked(rated).map(|m| self.at_y(m));
        let (left, d) = (x - r, 2.0 * r);
        let path = match rated.measured.setting.engine {
            Engine::F64 => format!("M{left:.1} {:.1}h{d}v{d}h-{d}z", y - r),
            Engine::Cpu => format!("M{left:.1} {y:.1}a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0z"),
            Engine::Gpu => {
                format!("M{x:.1} {:.1}l{d} {d}l-{d} {d}l-{d} -{d}z", y - 1.25 * r, d = 1.25 * r)
            }
            Engine::Atlas => {
                let (d, h, w) = (1.3 * r, 2.2 * r, 2.6 * r);
                format!("M{x:.1} {:.1}l{d} {h}h-{w}z", y - 1.3 * r)
            }
        };
        html! {
            path d={ "M" (px(x)) " " (px(low)) "V" (px(high)) } stroke=(colour) stroke-width=".8"
                opacity=".7" {}
            path d=(path) fill=(fill) stroke=(colour) stroke-width="1.8" {}
        }
    }
}

/// The last multiple of a half that is not above `value`.
fn half_below(value: f64) -> f64 {
    (2.0 * value).floor() / 2.0
}

pub(super) struct PointLabels<'a> {
    /// Left, right, top and bottom of the plot area, in pixels.
    pub area: [f64; 4],
    /// Points, and numbers written so far.
    pub taken: Vec<(f64, f64)>,
    pub line: &'a [(f64, f64)],
}

impl PointLabels<'_> {
    /// A number where least is in its way, joined to its point where that is not near.
    pub(super) fn write(&mut self, (x, y): (f64, f64), number: usize) -> Markup {
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

fn from_segment((x, y): (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let along = ((x - a.0) * dx + (y - a.1) * dy) / (dx * dx + dy * dy).max(f64::MIN_POSITIVE);
    let along = along.clamp(0.0, 1.0);
    maths::hypot(a.0 + along * dx - x, a.1 + along * dy - y)
}
