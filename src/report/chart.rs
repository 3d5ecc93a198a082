use std::fmt::Write;

use super::svg::{ACCENT, FAINT, INK, SECOND, escape, open, scale};
use crate::fidelity::{Engine, Rated, pareto};

const GREY: &str = "#8a97a5";
/// Left, right, top and bottom of the plot area in pixels.
const PLOT: [f64; 4] = [86.0, 596.0, 62.0, 500.0];
/// Where the key begins.
const KEY_X: f64 = 624.0;

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

/// Cost against ranking error of every setting, both logarithmic; the Pareto front numbered, with a key.
///
/// A point is at (seconds a placement, 1 − τ), its whisker the 95 % interval of 1 − τ; rankings equal
/// to the reference's stand on the line marked 0. Settings whose τ does not exist are left out.
pub fn fidelity_svg(rated: &[Rated], chart: &ChartFrame) -> String {
    let mut svg = open(1040.0, 570.0, "Cost against ranking error");
    let _ = writeln!(
        svg,
        "<text x=\"20\" y=\"26\" font-size=\"16\" font-weight=\"600\">{}</text>",
        escape(chart.title)
    );
    let points: Vec<usize> = (0..rated.len()).filter(|&i| rated[i].error.tau.is_some()).collect();
    if points.is_empty() {
        svg +=
            "<text x=\"20\" y=\"60\">No two placements differ: there is no ranking.</text></svg>\n";
        return svg;
    }
    let axes = Axes::around(rated, &points);
    axes.draw(&mut svg);
    let front: Vec<usize> = pareto(rated).into_iter().filter(|i| points.contains(i)).collect();
    for &i in points.iter().filter(|i| !front.contains(i)) {
        axes.point(&mut svg, &rated[i], GREY, 4.0);
    }
    let line: Vec<String> =
        front.iter().map(|&i| axes.at(&rated[i])).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{SECOND}\" stroke-width=\"1.6\"/>",
        line.join(" ")
    );
    for &i in &front {
        let colour = if chart.chosen == Some(i) { ACCENT } else { SECOND };
        axes.point(&mut svg, &rated[i], colour, 5.0);
    }
    let mut taken: Vec<(f64, f64)> = front.iter().map(|&i| axes.at(&rated[i])).collect();
    for (number, &i) in front.iter().enumerate() {
        axes.number(&mut svg, &rated[i], number + 1, &mut taken);
    }
    // The setting to take may lie off the front, which knows τ and not the regret; an atlas does.
    let atlas = points.iter().filter(|&&i| rated[i].measured.rung.engine == Engine::Atlas);
    let off = chart.chosen.iter().filter(|c| !front.contains(c) && points.contains(c)).chain(atlas);
    let mut listed = front.clone();
    for &i in off {
        let colour = if chart.chosen == Some(i) { ACCENT } else { INK };
        axes.point(&mut svg, &rated[i], colour, 5.0);
        listed.push(i);
        axes.number(&mut svg, &rated[i], listed.len(), &mut taken);
    }
    key(&mut svg, rated, &listed, chart);
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
        for tick in decades(self.x) {
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {top}V{bottom}\" stroke=\"{FAINT}\" stroke-width=\".6\"/>\
                 <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                bottom + 19.0,
                seconds(tick),
                x = self.at_x(tick),
            );
        }
        for tick in decades(self.y).into_iter().filter(|t| t.log10() > self.y.0 + 0.12) {
            let y = self.at_y(tick);
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {y:.1}H{right}\" stroke=\"{FAINT}\" stroke-width=\".6\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 8.0,
                y + 4.5,
                trimmed(tick)
            );
        }
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"{INK}\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\">0</text>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">wall time of a placement</text>\
             <text x=\"20\" y=\"50\">1 − Kendall τ against the finest setting in f64, with 95 % intervals</text>\
             <text x=\"20\" y=\"560\" fill=\"#5a6b7b\">□ f64 · ○ CPU f32 · ◇ GPU f32 · △ warm pose atlas · \
             line: Pareto front · 0: the same ranking · grey: not on the front</text>",
            left - 8.0,
            bottom + 4.5,
            (left + right) / 2.0,
            bottom + 40.0,
        );
    }

    fn point(&self, svg: &mut String, rated: &Rated, colour: &str, r: f64) {
        let (x, y) = self.at(rated);
        let [_, low, high] = misranked(rated).map(|m| self.at_y(m));
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} {low:.1}V{high:.1}\" stroke=\"{colour}\" stroke-width=\".8\" opacity=\".7\"/>"
        );
        let style = format!("fill=\"#fff\" stroke=\"{colour}\" stroke-width=\"1.8\"");
        let _ = match rated.measured.rung.engine {
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

    /// Writes a number beside a point, where nothing is written yet.
    fn number(&self, svg: &mut String, rated: &Rated, number: usize, taken: &mut Vec<(f64, f64)>) {
        let (x, y) = self.at(rated);
        let offsets =
            [(14.0, -9.0), (-14.0, 10.0), (-14.0, -9.0), (14.0, 10.0), (0.0, -17.0), (0.0, 18.0)];
        let free = |&(dx, dy): &(f64, f64)| {
            taken.iter().all(|t| (t.0 - x - dx).abs() > 12.0 || (t.1 - y - dy).abs() > 12.0)
        };
        let (dx, dy) = offsets.into_iter().find(free).unwrap_or((16.0, -20.0));
        taken.push((x + dx, y + dy));
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-weight=\"600\">{number}</text>",
            x + dx,
            y + dy + 4.5
        );
    }
}

/// What the numbers of the chart stand for.
fn key(svg: &mut String, rated: &[Rated], listed: &[usize], chart: &ChartFrame) {
    let _ = writeln!(
        svg,
        "<text x=\"{KEY_X}\" y=\"50\" fill=\"#5a6b7b\">setting: time a placement, τ, top-1 regret</text>"
    );
    let step = (440.0 / listed.len() as f64).min(40.0);
    for (number, &i) in listed.iter().enumerate() {
        let y = 76.0 + step * number as f64;
        let error = &rated[i].error;
        let (colour, weight) = if chart.chosen == Some(i) { (ACCENT, "600") } else { (INK, "400") };
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{y:.1}\" font-weight=\"600\" text-anchor=\"end\">{}</text>\
             <text x=\"{:.1}\" y=\"{y:.1}\" fill=\"{colour}\" font-weight=\"{weight}\">{}</text>\
             <text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\" font-size=\"11.5\">{}, τ {:.3}, regret {:.2} %{}</text>",
            KEY_X + 16.0,
            number + 1,
            KEY_X + 26.0,
            escape(&rated[i].measured.rung.words(chart.edge)),
            KEY_X + 26.0,
            y + 0.4 * step,
            seconds(rated[i].measured.seconds),
            error.tau.map_or(0.0, |tau| tau.value),
            100.0 * error.regret.value,
            if chart.chosen == Some(i) { ": cheapest within tolerance" } else { "" },
        );
    }
}

/// The last multiple of a half that is not above `value`.
fn half_below(value: f64) -> f64 {
    (2.0 * value).floor() / 2.0
}

/// 1, and where there is room 2 and 5, times powers of ten within a range of logarithms.
fn decades((low, high): (f64, f64)) -> Vec<f64> {
    let digits: &[f64] = if high - low < 2.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let powers = low.floor() as i32..=high.ceil() as i32;
    let all = powers.flat_map(|p| digits.iter().map(move |d| d * 10_f64.powi(p)));
    all.filter(|v| (low..=high).contains(&v.log10())).collect()
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
                   tau_high,regret,regret_low,regret_high,on_front\n"
        .to_owned();
    for rated in rated {
        let (measured, error) = (&rated.measured, &rated.error);
        let fidelity = measured.rung.fidelity;
        let tau = match error.tau {
            Some(tau) => format!("{},{},{}", tau.value, tau.low, tau.high),
            None => ",,".to_owned(),
        };
        let _ = writeln!(
            csv,
            "\"{}\",{},{},{},{},{},{},{:.4e},{:.4e},{:.4e},{},{},{},{},{},{tau},{},{},{},{}",
            measured.rung.words(edge),
            match measured.rung.engine {
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
            rated.on_front
        );
    }
    csv
}
