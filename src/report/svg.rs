use std::fmt::Write;

use crate::search::{GenerationRecord, Scored};
use crate::vehicle::Constraints;

pub(super) const FONT: &str = "font-family=\"system-ui,sans-serif\" font-size=\"13\"";
pub(super) const INK: &str = "#1b2a3a";
pub(super) const FAINT: &str = "#c8d2dc";
pub(super) const ACCENT: &str = "#d1495b";
pub(super) const SECOND: &str = "#2f7ebc";
/// One colour a LiDAR, told apart also in grey.
pub(super) const LIDAR_COLOURS: [&str; 8] =
    ["#d1495b", "#2f7ebc", "#3d8f5f", "#c98a1b", "#7a4fa3", "#1f9e9e", "#8a5a3b", "#5a6b7b"];

/// Name of the result's line.
const RESULT: &str = "the result";

/// Pixels of a chart's plot area.
struct Frame {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
}

/// Maps a value range to a pixel range.
pub(super) fn scale(value: f64, from: (f64, f64), to: (f64, f64)) -> f64 {
    to.0 + (value - from.0) / (from.1 - from.0) * (to.1 - to.0)
}

/// About `count` round numbers within a range.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let raw = (high - low) / count as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= raw);
    let step = step.unwrap_or(raw);
    let first = (low / step).ceil() as i64;
    (first..).map(|k| k as f64 * step).take_while(|t| *t <= high + step * 1e-9).collect()
}

pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        "0".into()
    } else if !(1e-3..1e5).contains(&magnitude) {
        format!("{value:.2e}")
    } else {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

pub(super) fn open(width: f64, height: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" role=\"img\" {FONT} fill=\"{INK}\">\
         <title>{}</title><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
        escape(title)
    )
}

/// The best and the median objective against evaluations; the baselines and the result, which swaps may
/// have found after the generations, as lines across.
pub fn convergence_svg(
    history: &[GenerationRecord],
    objective: &str,
    baselines: &[Scored],
    best: Option<&Scored>,
) -> String {
    let frame = Frame { left: 90.0, top: 30.0, width: 560.0, height: 300.0 };
    let mut svg = open(860.0, 390.0, "Convergence of the search");
    let mut lines: Vec<(&str, f64)> =
        baselines.iter().filter_map(|b| Some((b.placement.name.as_str(), b.objective?))).collect();
    let result = best.and_then(|best| best.objective);
    lines.extend(result.map(|value| (RESULT, value)));
    let best: Vec<(f64, f64)> =
        history.iter().filter_map(|r| Some((r.evaluations as f64, r.best_so_far?))).collect();
    let median: Vec<(f64, f64)> =
        history.iter().filter_map(|r| Some((r.evaluations as f64, r.median?))).collect();
    let values = || best.iter().chain(&median).map(|p| p.1).chain(lines.iter().map(|l| l.1));
    let (low, high) = values().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    if best.is_empty() && median.is_empty() {
        svg += "<text x=\"90\" y=\"60\">No candidate was scored.</text></svg>\n";
        return svg;
    }
    let margin = if high > low { 0.06 * (high - low) } else { 0.05 * high.abs().max(1e-12) };
    let y_range = (low - margin, high + margin);
    let x_range = (0.0, history.last().map_or(1.0, |r| r.evaluations as f64).max(1.0));
    let x = |v: f64| scale(v, x_range, (frame.left, frame.left + frame.width));
    let y = |v: f64| scale(v, y_range, (frame.top + frame.height, frame.top));
    let right = frame.left + frame.width;
    let bottom = frame.top + frame.height;
    for tick in ticks(y_range.0, y_range.1, 6) {
        let at = y(tick);
        let _ = writeln!(
            svg,
            "<path d=\"M{} {at:.1}H{right}\" stroke=\"{FAINT}\" stroke-width=\".6\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            frame.left,
            frame.left - 8.0,
            at + 4.5,
            number(tick)
        );
    }
    for tick in ticks(x_range.0, x_range.1, 6) {
        let at = x(tick);
        let _ = writeln!(
            svg,
            "<path d=\"M{at:.1} {bottom}v5\" stroke=\"{INK}\"/>\
             <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            bottom + 20.0,
            number(tick)
        );
    }
    // Names of close baselines are moved apart; a thin line leads to each.
    let mut sorted = lines.clone();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut label_y = f64::MIN;
    for (name, value) in sorted {
        let at = y(value);
        label_y = at.max(label_y + 15.0);
        let (line, text) = if name == RESULT { (ACCENT, INK) } else { ("#8a97a5", "#5a6b7b") };
        let _ = writeln!(
            svg,
            "<path d=\"M{} {at:.1}H{right}L{} {label_y:.1}\" stroke=\"{line}\" fill=\"none\" \
             stroke-width=\".8\" stroke-dasharray=\"4 3\"/>\
             <text x=\"{}\" y=\"{:.1}\" fill=\"{text}\">{}</text>",
            frame.left,
            right + 12.0,
            right + 16.0,
            label_y + 4.5,
            escape(name)
        );
    }
    for (points, colour, width) in [(&median, SECOND, 1.2), (&best, ACCENT, 2.4)] {
        let path: Vec<String> =
            points.iter().map(|&(px, py)| format!("{:.1},{:.1}", x(px), y(py))).collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>",
            path.join(" ")
        );
    }
    let _ = writeln!(
        svg,
        "<path d=\"M{0} {1}V{bottom}H{right}\" fill=\"none\" stroke=\"{INK}\"/>\
         <text x=\"{2}\" y=\"{3}\" text-anchor=\"middle\">placements evaluated</text>\
         <text x=\"{0}\" y=\"18\">{4} (larger is better)</text>\
         <text x=\"{5}\" y=\"18\" text-anchor=\"end\"><tspan fill=\"{ACCENT}\">thick: best so far</tspan> · \
         <tspan fill=\"{SECOND}\">thin: median of a generation</tspan></text></svg>",
        frame.left,
        frame.top,
        frame.left + frame.width / 2.0,
        bottom + 42.0,
        escape(objective),
        right
    );
    svg
}

/// The placement from above and from the right, with the mount's box and the ego body's outline.
///
/// `body` holds the triangles of the ego body in the ego frame, in metres.
pub fn placement_svg(
    placement: &Scored,
    constraints: &Constraints,
    body: &[[[f32; 3]; 3]],
) -> String {
    let mut svg = open(860.0, 520.0, "The placement from above and from the right");
    // Half a car beyond the mount is enough to see where things are.
    let reach = |k: usize| {
        let mount = constraints.lower[k].abs().max(constraints.upper[k].abs());
        let mut extent = mount + 0.4;
        for corner in body.iter().flatten() {
            extent = extent.max(f64::from(corner[k].abs()) + 0.1);
        }
        extent.min(mount + 6.0)
    };
    let (half_x, half_y) = (reach(0), reach(1));
    let top = constraints.upper[2] + 0.4;
    let scale = (800.0 / (2.0 * half_x)).min(460.0 / (2.0 * half_y + top + 0.6));
    let centre_x = 430.0;
    let above_y = 30.0 + half_y * scale;
    let ground_y = above_y + (half_y + 0.5 + top) * scale;
    // Forward is to the right in both.
    let above = |x: f64, y: f64| (centre_x + x * scale, above_y - y * scale);
    let aside = |x: f64, z: f64| (centre_x + x * scale, ground_y - z * scale);
    for triangle in body {
        let corners = triangle.map(|c| c.map(f64::from));
        for view in [corners.map(|c| above(c[0], c[1])), corners.map(|c| aside(c[0], c[2]))] {
            let points = view.map(|(px, py)| format!("{px:.1},{py:.1}")).join(" ");
            let _ = writeln!(
                svg,
                "<polygon points=\"{points}\" fill=\"#e4eaf0\" stroke=\"#e4eaf0\" \
                 stroke-width=\".5\"/>"
            );
        }
    }
    let (low, high) = (&constraints.lower, &constraints.upper);
    for (corner, far) in [
        (above(low[0], high[1]), above(high[0], low[1])),
        (aside(low[0], high[2]), aside(high[0], low[2])),
    ] {
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" \
             stroke=\"{INK}\" stroke-dasharray=\"5 4\"/>",
            corner.0,
            corner.1,
            far.0 - corner.0,
            far.1 - corner.1
        );
    }
    let _ = writeln!(
        svg,
        "<path d=\"M20 {ground_y:.1}H840\" stroke=\"{FAINT}\"/>\
         <text x=\"20\" y=\"20\">from above (forward is right)</text>\
         <text x=\"20\" y=\"{:.1}\">from the right</text>\
         <path d=\"M20 505h{scale:.1}m0 -4v8m{:.1} 0v-8\" stroke=\"{INK}\" fill=\"none\"/>\
         <text x=\"{:.1}\" y=\"510\">1 m</text>",
        above_y + (half_y + 0.4) * scale,
        -scale,
        28.0 + scale
    );
    for (index, pose) in placement.placement.lidars.iter().enumerate() {
        let colour = LIDAR_COLOURS[index % LIDAR_COLOURS.len()];
        let (ax, ay) = above(pose.x, pose.y);
        let (sx, sy) = aside(pose.x, pose.z);
        let _ = writeln!(
            svg,
            "<circle cx=\"{ax:.1}\" cy=\"{ay:.1}\" r=\"9\" fill=\"{colour}\"/>\
             <text x=\"{ax:.1}\" y=\"{:.1}\" fill=\"#fff\" text-anchor=\"middle\" \
             font-weight=\"600\">{index}</text>\
             <circle cx=\"{sx:.1}\" cy=\"{sy:.1}\" r=\"9\" fill=\"{colour}\"/>\
             <text x=\"{sx:.1}\" y=\"{:.1}\" fill=\"#fff\" text-anchor=\"middle\" \
             font-weight=\"600\">{index}</text>",
            ay + 4.5,
            sy + 4.5
        );
    }
    svg += "</svg>\n";
    svg
}
