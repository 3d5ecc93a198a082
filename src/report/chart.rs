use std::fmt::Write;

use super::svg::{ACCENT, FAINT, INK, SECOND, escape, open, scale};
use crate::chart::{Engine, Rated, pareto};

const GREY: &str = "#8a97a5";
const SOFT: &str = "#5a6b7b";
const PALE: &str = "#e8edf2";
/// Pixels of the picture's width, and of a row of its table.
const WIDTH: f64 = 1000.0;
const ROW: f64 = 19.0;
/// Left, right, top and bottom of the plot area.
const PLOT: [f64; 4] = [76.0, 976.0, 62.0, 490.0];
/// Where the titles of the table stand.
const TABLE: f64 = 600.0;
/// Titles of the table's columns, and where each begins or, from the second on, ends.
const COLUMNS: [(&str, f64); 8] = [
    ("setting", 50.0),
    ("time", 430.0),
    ("MiB", 486.0),
    ("error % (most)", 606.0),
    ("τ (95 %)", 752.0),
    ("regret % (to)", 862.0),
    ("swapped % (to)", 976.0),
    ("", 34.0),
];

/// What the chart says beside its points.
#[derive(Debug, Clone, Copy)]
pub struct ChartFrame<'a> {
    /// Scene, placements, objective.
    pub title: &'a str,
    /// The scene's own voxel edge in metres.
    pub edge: f64,
    /// Position of the setting to take.
    pub chosen: Option<usize>,
}

/// Cost against ranking error of every setting, both logarithmic; the Pareto front, the setting to take
/// and the atlases are numbered, with a table below.
///
/// A point is at (seconds a placement, 1 − τ), its whisker the 95 % interval of 1 − τ; rankings equal
/// to the reference's stand on the line marked 0. Settings whose τ does not exist are left out.
pub fn fidelity_svg(rated: &[Rated], chart: &ChartFrame) -> String {
    let points: Vec<usize> = (0..rated.len()).filter(|&i| rated[i].error.tau.is_some()).collect();
    let front: Vec<usize> = pareto(rated).into_iter().filter(|i| points.contains(i)).collect();
    // The setting to take may lie off the front, which knows τ and not the regret; an atlas does.
    let atlas = points.iter().filter(|&&i| rated[i].measured.setting.engine == Engine::Atlas);
    let off = chart.chosen.iter().filter(|c| !front.contains(c) && points.contains(c)).chain(atlas);
    let listed: Vec<usize> = front.iter().chain(off).copied().collect();
    let height = TABLE + ROW * (listed.len() as f64 + 2.0);
    let mut svg = open(WIDTH, height, "Cost against ranking error");
    let _ = writeln!(
        svg,
        "<text x=\"20\" y=\"26\" font-size=\"16\" font-weight=\"600\">{}</text>",
        escape(chart.title)
    );
    if points.is_empty() {
        svg +=
            "<text x=\"20\" y=\"60\">No two placements differ: there is no ranking.</text></svg>\n";
        return svg;
    }
    let axes = Axes::around(rated, &points);
    axes.draw(&mut svg);
    for &i in points.iter().filter(|i| !listed.contains(i)) {
        axes.point(&mut svg, &rated[i], GREY, "#fff", 3.5);
    }
    let line: Vec<(f64, f64)> = front.iter().map(|&i| axes.at(&rated[i])).collect();
    let corners: Vec<String> = line.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{SECOND}\" stroke-width=\"1.6\"/>",
        corners.join(" ")
    );
    for &i in &listed {
        let colour = if front.contains(&i) { SECOND } else { INK };
        let (colour, fill) =
            if chart.chosen == Some(i) { (ACCENT, ACCENT) } else { (colour, "#fff") };
        axes.point(&mut svg, &rated[i], colour, fill, 4.5);
    }
    let mut labels =
        Labels { taken: points.iter().map(|&i| axes.at(&rated[i])).collect(), line: &line };
    for (number, &i) in listed.iter().enumerate() {
        labels.write(&mut svg, axes.at(&rated[i]), number + 1);
    }
    table(&mut svg, rated, &listed, chart);
    svg += "</svg>\n";
    svg
}

fn misranked(rated: &Rated) -> [f64; 3] {
    rated.error.tau.map_or([1.0; 3], |tau| [tau.value, tau.low, tau.high].map(|t| 1.0 - t))
}

struct Axes {
    /// log₁₀ of the seconds at the left and at the right.
    x: (f64, f64),
    /// log₁₀ of 1 − τ at the line for 0 and at the top.
    y: (f64, f64),
}

impl Axes {
    fn around(rated: &[Rated], points: &[usize]) -> Self {
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let x = range(&mut points.iter().map(|&i| rated[i].measured.seconds.log10()));
        let above = points.iter().flat_map(|&i| misranked(&rated[i]));
        let (low, high) = range(&mut above.filter(|v| *v > 1e-9).map(f64::log10));
        let (low, high) = if low <= high { (low, high) } else { (-3.0, 0.0) };
        Self { x: (half_below(x.0 - 0.15), x.1 + 0.2), y: (half_below(low - 0.35), high + 0.15) }
    }

    fn at_x(&self, seconds: f64) -> f64 {
        scale(seconds.log10(), self.x, (PLOT[0], PLOT[1]))
    }

    fn at_y(&self, misranked: f64) -> f64 {
        let log = if misranked > 1e-9 { misranked.log10() } else { self.y.0 };
        scale(log.max(self.y.0), self.y, (PLOT[3], PLOT[2]))
    }

    fn at(&self, rated: &Rated) -> (f64, f64) {
        (self.at_x(rated.measured.seconds), self.at_y(misranked(rated)[0]))
    }

    fn draw(&self, svg: &mut String) {
        let [left, right, top, bottom] = PLOT;
        for (tick, is_named) in ticks(self.x) {
            let x = self.at_x(tick);
            let (colour, width) = if is_named { (FAINT, ".8") } else { (PALE, ".6") };
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {top}V{bottom}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
            );
            if is_named {
                let _ = writeln!(
                    svg,
                    "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                    bottom + 19.0,
                    seconds(tick)
                );
            }
        }
        for (tick, is_named) in ticks(self.y).into_iter().filter(|t| t.0.log10() > self.y.0 + 0.12)
        {
            let y = self.at_y(tick);
            let (colour, width) = if is_named { (FAINT, ".8") } else { (PALE, ".6") };
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {y:.1}H{right}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
            );
            if is_named {
                let _ = writeln!(
                    svg,
                    "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                    left - 8.0,
                    y + 4.5,
                    trimmed(tick)
                );
            }
        }
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"{INK}\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">0</text>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">wall time of a placement, all threads at \
             work</text>\
             <text x=\"20\" y=\"50\">1 − Kendall τ against the finest setting in f64, with 95 % intervals; \
             0: the same ranking</text>\
             <text x=\"20\" y=\"{}\" font-size=\"12\" fill=\"{SOFT}\">□ f64 · ○ CPU f32 · ◇ GPU f32 · line: Pareto front \
             · filled, red: cheapest that keeps the ranking within the tolerance · grey: others, in chart.csv</text>\
             <text x=\"20\" y=\"{}\" font-size=\"12\" fill=\"{SOFT}\">△ warm pose atlas: scores only poses it has, \
             snapped to its grid, which is most of its error; not on the front</text>",
            left - 8.0,
            bottom + 4.5,
            (left + right) / 2.0,
            bottom + 40.0,
            bottom + 62.0,
            bottom + 78.0,
        );
    }

    fn point(&self, svg: &mut String, rated: &Rated, colour: &str, fill: &str, r: f64) {
        let (x, y) = self.at(rated);
        let [_, low, high] = misranked(rated).map(|m| self.at_y(m));
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} {low:.1}V{high:.1}\" stroke=\"{colour}\" stroke-width=\".8\" opacity=\".7\"/>"
        );
        let style = format!("fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.8\"");
        let _ = match rated.measured.setting.engine {
            Engine::F64 => writeln!(
                svg,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{d}\" height=\"{d}\" {style}/>",
                x - r,
                y - r,
                d = 2.0 * r
            ),
            Engine::Cpu => writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r}\" {style}/>"),
            Engine::Gpu => writeln!(
                svg,
                "<path d=\"M{x:.1} {:.1}l{d} {d}l-{d} {d}l-{d} -{d}z\" {style}/>",
                y - 1.25 * r,
                d = 1.25 * r
            ),
            Engine::Atlas => writeln!(
                svg,
                "<path d=\"M{x:.1} {:.1}l{d} {h}h-{w}z\" {style}/>",
                y - 1.3 * r,
                d = 1.3 * r,
                h = 2.2 * r,
                w = 2.6 * r
            ),
        };
    }
}

/// Numbers beside points.
struct Labels<'a> {
    /// Points, and numbers written so far.
    taken: Vec<(f64, f64)>,
    /// The Pareto front.
    line: &'a [(f64, f64)],
}

impl Labels<'_> {
    /// Writes a number where least is in its way, joined to its point where that is not near.
    fn write(&mut self, svg: &mut String, (x, y): (f64, f64), number: usize) {
        let around = (0..16).map(|k| std::f64::consts::TAU * (f64::from(k) / 16.0 - 0.125));
        let places = [15.0, 22.0, 30.0, 40.0].into_iter().flat_map(|r| {
            around.clone().map(move |a: f64| (r, (x + r * a.cos(), y + r * a.sin())))
        });
        let best = places.min_by(|a, b| self.crowding(*a).total_cmp(&self.crowding(*b)));
        let (radius, (to_x, to_y)) = best.unwrap_or((0.0, (x, y)));
        self.taken.push((to_x, to_y));
        if radius > 16.0 {
            let near = |from: f64, to: f64, px: f64| from + (to - from) * px / radius;
            let _ = write!(
                svg,
                "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{INK}\" stroke-width=\".6\"/>",
                near(x, to_x, 6.0),
                near(y, to_y, 6.0),
                near(x, to_x, radius - 8.0),
                near(y, to_y, radius - 8.0)
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{to_x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\" \
             font-weight=\"600\">{number}</text>",
            to_y + 4.3
        );
    }

    /// How much is in the way of a number at a place so far from its point, and how far that is.
    fn crowding(&self, (radius, at): (f64, (f64, f64))) -> f64 {
        let [left, right, top, bottom] = PLOT;
        let overlap = |distance: f64, free: f64| ((free - distance) / free).max(0.0);
        let points = self.taken.iter().map(|t| overlap((t.0 - at.0).hypot(t.1 - at.1), 14.0));
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
    (a.0 + along * dx - x).hypot(a.1 + along * dy - y)
}

/// What the numbers of the chart stand for: cost and error of each setting.
fn table(svg: &mut String, rated: &[Rated], listed: &[usize], chart: &ChartFrame) {
    let mut row = |y: f64, cells: [String; 8], style: &str| {
        for (column, (cell, (_, x))) in cells.iter().zip(COLUMNS).enumerate() {
            let anchor = if column == 0 { "start" } else { "end" };
            let _ = write!(
                svg,
                "<text x=\"{x}\" y=\"{y:.1}\" font-size=\"12\" text-anchor=\"{anchor}\" {style}>{}</text>",
                escape(cell)
            );
        }
        *svg += "\n";
    };
    row(TABLE, COLUMNS.map(|(title, _)| title.to_owned()), &format!("fill=\"{SOFT}\""));
    let finest = rated[0].measured.setting.fidelity;
    for (number, &i) in listed.iter().enumerate() {
        let (measured, error) = (&rated[i].measured, &rated[i].error);
        let percent = |value: f64| format!("{:.2}", 100.0 * value);
        let pose = measured.pose.map_or(String::new(), |pose| {
            let bytes = pose.bytes as f64 / f64::from(1 << 20);
            format!("; a pose {}, {bytes:.2} MiB", seconds(pose.seconds))
        });
        let cells = [
            measured.setting.words(chart.edge) + &pose,
            seconds(measured.seconds),
            format!("{:.1}", measured.bytes as f64 / f64::from(1 << 20)),
            if measured.setting.fidelity.same_quantity(&finest) {
                format!("{} ({})", percent(error.score_median), percent(error.score_largest))
            } else {
                "another quantity".to_owned()
            },
            error.tau.map_or(String::new(), |tau| {
                format!("{:.3} ({:.3}–{:.3})", tau.value, tau.low, tau.high)
            }),
            format!("{} ({})", percent(error.regret.value), percent(error.regret.high)),
            format!("{:.1} ({:.1})", 100.0 * error.swapped.value, 100.0 * error.swapped.high),
            (number + 1).to_string(),
        ];
        let style = if chart.chosen == Some(i) {
            format!("fill=\"{ACCENT}\" font-weight=\"600\"")
        } else {
            String::new()
        };
        row(TABLE + ROW * (number as f64 + 1.0), cells, &style);
    }
}

/// The last multiple of a half that is not above `value`.
fn half_below(value: f64) -> f64 {
    (2.0 * value).floor() / 2.0
}

/// 1, 2, …, 9 times powers of ten within a range of logarithms, and whether each is written out: those
/// of 1, and of 2 and 5 where there is room.
fn ticks((low, high): (f64, f64)) -> Vec<(f64, bool)> {
    let is_named = |digit: u32| digit == 1 || high - low < 2.2 && [2, 5].contains(&digit);
    let powers = low.floor() as i32..=high.ceil() as i32;
    let all = powers.flat_map(|power| {
        (1..10).map(move |digit| (f64::from(digit) * 10_f64.powi(power), is_named(digit)))
    });
    all.filter(|(v, _)| (low..=high).contains(&v.log10())).collect()
}

fn trimmed(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A duration in two or three digits and its unit.
pub fn seconds(value: f64) -> String {
    let (value, unit) = match value {
        v if v < 1e-3 => (v * 1e6, "µs"),
        v if v < 1.0 => (v * 1e3, "ms"),
        v => (v, "s"),
    };
    let decimals = if value < 9.95 { 1 } else { 0 };
    let text = format!("{value:.decimals$}");
    format!("{} {unit}", text.strip_suffix(".0").unwrap_or(&text))
}

/// One line a setting: what it is, its cost and its error.
pub fn fidelity_csv(rated: &[Rated], edge: f64) -> String {
    let mut csv = "setting,engine,voxel_m,azimuth_divisor,frames,coverage,merged_m,seconds,seconds_low,\
                   seconds_high,bytes,beams,triangles,score_error_median,score_error_largest,tau,tau_low,\
                   tau_high,regret,regret_low,regret_high,swapped,swapped_low,swapped_high,pose_seconds,pose_bytes,on_front\n"
        .to_owned();
    for rated in rated {
        let (measured, error) = (&rated.measured, &rated.error);
        let fidelity = measured.setting.fidelity;
        let tau = match error.tau {
            Some(tau) => format!("{},{},{}", tau.value, tau.low, tau.high),
            None => ",,".to_owned(),
        };
        let pose = measured
            .pose
            .map_or(",".to_owned(), |pose| format!("{:.4e},{}", pose.seconds, pose.bytes));
        let _ = writeln!(
            csv,
            "\"{}\",{},{},{},{},{},{},{:.4e},{:.4e},{:.4e},{},{},{},{},{},{tau},{},{},{},{},{},{},{pose},{}",
            measured.setting.words(edge),
            match measured.setting.engine {
                Engine::F64 => "f64",
                Engine::Cpu => "cpu",
                Engine::Gpu => "gpu",
                Engine::Atlas => "atlas",
            },
            trimmed(fidelity.voxel * edge),
            fidelity.azimuth,
            fidelity.frames,
            if fidelity.through { "through" } else { "first-hit" },
            trimmed(fidelity.detail * fidelity.voxel * edge),
            measured.seconds,
            measured.spread[0],
            measured.spread[1],
            measured.bytes,
            measured.beams,
            measured.triangles,
            error.score_median,
            error.score_largest,
            error.regret.value,
            error.regret.low,
            error.regret.high,
            error.swapped.value,
            error.swapped.low,
            error.swapped.high,
            rated.on_front
        );
    }
    csv
}
