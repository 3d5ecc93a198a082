//! A view on the sheet: body, mounts, fields of view, blind zone, LiDARs and measures.

use super::fans::REACH;
use super::labels::{Labels, RADIUS, end_of_leader, half_width, signs};
use super::{BETWEEN, DRAWN, DrawnMount, DrawnRig, Flat, Panel, Sheet, View, Views};
use crate::maths;
use crate::report::columns::in_lines;
use crate::report::drawing::{Anchor, Drawing, Ink, Point, Stroke};
use crate::report::svg::{ACCENT, FAINT, GREY, INK, LidarSign, SOFT, colour, trimmed};
use crate::report::text::shortened;
use crate::score::metres_up;

/// Font sizes, millimetres.
pub(super) const TITLE: f64 = 3.6;
pub(super) const WORDS: f64 = 2.7;
const SMALL: f64 = 2.1;
/// Least millimetres between the name of the blind zone ahead and the legend.
const CLEAR: f64 = 5.0;
pub(super) const BODY: Ink = Ink::full(FAINT);
const BODY_EDGE: Stroke = Stroke::solid(INK, 0.3);
pub(super) const MOUNT: Stroke = Stroke::dashed(SOFT, 0.2);
const ZONE: Ink = Ink(ACCENT, 0.18);
const ZONE_EDGE: Stroke = Stroke::solid(ACCENT, 0.3);
const THIN: Stroke = Stroke::solid(INK, 0.15);
/// Half of a cross at the place of a LiDAR whose number stands aside, millimetres.
const CROSS: f64 = 1.2;
/// Metres ahead of the body at which the arrow to the front begins and ends.
const ARROW: [f64; 2] = [0.3, 1.3];
/// Corners of the box that stands in for a missing body.
const BARE: [Flat; 2] = [[-1.0; 2], [1.0; 2]];
/// Line from a mount to its name where other words keep both apart.
const LEADER: Stroke = Stroke::solid(SOFT, 0.12);

pub(super) fn top(drawing: &mut Drawing, rig: &DrawnRig<'_>, views: &Views, sheet: &Sheet) {
    let panel = &sheet.top;
    title(drawing, panel, "From above");
    zone(drawing, panel, &views.zone, &views.around_body);
    view(drawing, rig, &views.top, panel);
    let lidars = signs(rig, &views.top, panel);
    let mut labels = Labels::default();
    labels.keep_signs(&lidars);
    datum(drawing, panel, ["x", "y"], &mut labels);
    let [low, high] = bounds(&views.top.outline).unwrap_or(BARE);
    let [from, to] = ARROW.map(|by| panel.at([high[0] + by, 0.5 * (low[1] + high[1])]));
    arrow(drawing, from, to);
    let front = [to[0] + 1.0, to[1] + 1.0];
    labels.keep(front, WORDS, "front", Anchor::Start);
    drawing.text(front, WORDS, "front", Anchor::Start, true, Ink::full(INK));
    depths(drawing, rig, panel, [low, high], &mut labels);
    for mount in rig.mounts.iter().filter(|mount| !mount.name.is_empty()) {
        let [[left, below], [right, up]] = rectangle(&views.top, mount);
        let ([left, above], [right, under]) = (panel.at([left, up]), panel.at([right, below]));
        let places = [
            ([right, above - 0.6], Anchor::End),
            ([left, above - 0.6], Anchor::Start),
            ([right, under + SMALL], Anchor::End),
            ([left, under + SMALL], Anchor::Start),
        ];
        let placed = labels.place(&places, SMALL, &mount.name);
        let (at, anchor) = placed;
        // A name that stands beside its box needs no line to it.
        if !places.contains(&placed) {
            let from = [0.5 * (left + right), 0.5 * (above + under)];
            let to = end_of_leader(from, placed, SMALL, &mount.name);
            drawing.line([from, to], LEADER);
        }
        drawing.text(at, SMALL, &mount.name, anchor, false, Ink::full(SOFT));
    }
    numbers(drawing, &lidars);
}

/// The blind zone around a hole, with a line around it that is open where the zone goes on.
fn zone(drawing: &mut Drawing, panel: &Panel, outline: &[(Flat, bool)], hole: &[Flat]) {
    let corners: Vec<Point> = outline.iter().map(|(corner, _)| panel.at(*corner)).collect();
    let mut line = Vec::new();
    let closed = corners.iter().zip(corners.iter().cycle().skip(1)).zip(outline);
    let mut lines = Vec::new();
    for ((from, to), (_, goes_on)) in closed {
        if line.is_empty() {
            line.push(*from);
        }
        match goes_on {
            true => lines.push(std::mem::take(&mut line)),
            false => line.push(*to),
        }
    }
    lines.push(line);
    let hole = hole.iter().map(|corner| panel.at(*corner)).collect();
    drawing.area(vec![corners, hole], Some(ZONE), None);
    lines.into_iter().filter(|line| line.len() > 1).for_each(|line| drawing.line(line, ZONE_EDGE));
}

/// Depths of the blind zone before each edge of the body, in words at the edges of the view from above.
fn depths(
    drawing: &mut Drawing,
    rig: &DrawnRig<'_>,
    panel: &Panel,
    [low, high]: [Flat; 2],
    labels: &mut Labels,
) {
    let Ok((_, near)) = &rig.near else { return };
    let zone = &near.zone;
    let words = |name: &str, depth: Option<f64>| match (depth, zone.lost_on(name)) {
        (Some(depth), Some(lost)) => {
            let depth = metres_up(depth);
            format!("{name}: blind to {depth:.1} m, again {:.1} to {:.1} m", lost.from, lost.to)
        }
        (Some(depth), None) => format!("{name}: blind to {:.1} m", metres_up(depth)),
        (None, _) => format!("{name}: blind beyond 10 m"),
    };
    let [left, right, upper, lower] = panel.edges();
    let middle = panel.at([0.5 * (low[0] + high[0]), 0.0])[0];
    let beside = panel.at([0.0, low[1]])[1] + 3.0;
    // Ends well before the legend, which begins a gap to the right of the view.
    let ahead = [right + BETWEEN - CLEAR, beside];
    for (at, words, anchor) in [
        ([middle, upper + SMALL], words("left", zone.left), Anchor::Middle),
        ([middle, lower - 0.6], words("right", zone.right), Anchor::Middle),
        ([left, beside], words("behind", zone.behind), Anchor::Start),
        (ahead, words("ahead", zone.ahead), Anchor::End),
    ] {
        let (at, anchor) = labels.place(&[(at, anchor)], SMALL + 0.3, &words);
        drawing.text(at, SMALL + 0.3, words, anchor, false, Ink::full(ACCENT));
    }
}

/// Length of the datum's axes on the sheet, millimetres.
const AXIS: f64 = 7.0;

/// The datum of a view, the origin of the ego frame: a target with two axes, named, to the right and upwards.
fn datum(drawing: &mut Drawing, panel: &Panel, names: [&str; 2], labels: &mut Labels) {
    let [x, y] = panel.at([0.0; 2]);
    let thin = Stroke::solid(INK, 0.3);
    drawing.disc([x, y], 1.3, Ink::full("#ffffff"));
    let rim = |degrees: f64| {
        let (sin, cos) = maths::sin_cos(degrees.to_radians());
        [x + 1.3 * cos, y - 1.3 * sin]
    };
    let quarter = |from: f64| -> Vec<Point> {
        let arc = (0..=6).map(|k| rim(from + 15.0 * f64::from(k)));
        std::iter::once([x, y]).chain(arc).collect()
    };
    drawing.area(vec![quarter(0.0), quarter(180.0)], Some(Ink::full(INK)), None);
    let circle: Vec<Point> = (0..=24).map(|k| rim(15.0 * f64::from(k))).collect();
    drawing.line(circle, thin);
    for (name, [right, up]) in names.into_iter().zip([[1.0, 0.0], [0.0, 1.0]]) {
        let at = |along: f64, across: f64| {
            [x + along * right + across * up, y - along * up - across * right]
        };
        drawing.line([at(1.3, 0.0), at(AXIS, 0.0)], thin);
        let tip = vec![at(AXIS, 0.0), at(AXIS - 1.6, 0.6), at(AXIS - 1.6, -0.6)];
        drawing.area(vec![tip], Some(Ink::full(INK)), None);
        let word = if up > 0.0 { [x + 0.8, y - AXIS] } else { [x + AXIS + 0.5, y - 0.6] };
        labels.keep(word, WORDS, name, Anchor::Start);
        drawing.text(word, WORDS, name, Anchor::Start, true, Ink::full(INK));
    }
}

pub(super) fn side(drawing: &mut Drawing, rig: &DrawnRig<'_>, views: &Views, sheet: &Sheet) {
    title(drawing, &sheet.side, "From the right");
    let near = rig.near.as_ref().ok();
    let depths = near.map(|(footprint, near)| {
        let [[back, _], [front, _]] = footprint.bounds();
        [(back, near.zone.behind), (front, near.zone.ahead)]
    });
    upright(drawing, rig, &views.side, &sheet.side, ("x", depths));
}

pub(super) fn front(drawing: &mut Drawing, rig: &DrawnRig<'_>, views: &Views, sheet: &Sheet) {
    title(drawing, &sheet.front, "From the front");
    let near = rig.near.as_ref().ok();
    let depths = near.map(|(footprint, near)| {
        let [[_, right], [_, left]] = footprint.bounds();
        [(right, near.zone.right), (left, near.zone.left)]
    });
    upright(drawing, rig, &views.front, &sheet.front, ("y", depths));
    let Some([low, high]) = bounds(&views.front.outline) else { return };
    // The height stands beside the view from the front.
    let x = sheet.front.edges()[1] + 3.0;
    let [lower, upper] = [0.0, high[1]].map(|up| sheet.front.at([low[0], up])[1]);
    drawing.line([[x, lower], [x, upper]], THIN);
    for y in [lower, upper] {
        drawing.line([[x - 1.0, y], [x + 1.0, y]], THIN);
    }
    let words = format!("{:.0}", 1000.0 * high[1]);
    drawing.words([x + 1.5, 0.5 * (lower + upper)], WORDS, words);
}

/// Place of an edge across a view, and the depth of the blind zone before it, both in metres.
type BlindSide = (f64, Option<f64>);

/// A view with the ground, on it the blind depths from the edges to its left and right, and the body's extent below.
fn upright(
    drawing: &mut Drawing,
    rig: &DrawnRig<'_>,
    shown: &View,
    panel: &Panel,
    (across, depths): (&str, Option<[BlindSide; 2]>),
) {
    let ([left, right, ..], [_, ground]) = (panel.edges(), panel.at([0.0; 2]));
    drawing.line([[left, ground], [right, ground]], Stroke::solid(GREY, 0.25));
    view(drawing, rig, shown, panel);
    datum(drawing, panel, [across, "z"], &mut Labels::default());
    numbers(drawing, &signs(rig, shown, panel));
    let Some([low, high]) = bounds(&shown.outline) else { return };
    if let Some([before, behind]) = depths {
        for (sign, (edge, depth)) in [(-1.0, before), (1.0, behind)] {
            let to = edge + sign * depth.unwrap_or(DRAWN).min(DRAWN);
            let to = to.clamp(shown.low[0], shown.high[0]);
            drawing.line([panel.at([edge, 0.0]), panel.at([to, 0.0])], Stroke::solid(ACCENT, 0.9));
        }
    }
    let y = panel.edges()[3] + 3.0;
    let [from, to] = [low[0], high[0]].map(|at| panel.at([at, 0.0])[0]);
    drawing.line([[from, y], [to, y]], THIN);
    for x in [from, to] {
        drawing.line([[x, y - 1.0], [x, y + 1.0]], THIN);
    }
    let words = format!("{:.0}", 1000.0 * (high[0] - low[0]));
    drawing.text([0.5 * (from + to), y + 3.6], WORDS, words, Anchor::Middle, false, Ink::full(INK));
}

fn title(drawing: &mut Drawing, panel: &Panel, words: &str) {
    let [left, _, upper, _] = panel.edges();
    drawing.text([left, upper - 2.0], TITLE, words, Anchor::Start, true, Ink::full(INK));
}

fn view(drawing: &mut Drawing, rig: &DrawnRig<'_>, shown: &View, panel: &Panel) {
    let loops = shown.outline.iter().map(|corners| panel.all(corners)).collect();
    drawing.area(loops, Some(BODY), Some(BODY_EDGE));
    for mount in &rig.mounts {
        let [[left, low], [right, high]] = rectangle(shown, mount);
        let corners = [[left, low], [right, low], [right, high], [left, high]];
        drawing.area(vec![panel.all(&corners)], None, Some(MOUNT));
    }
    for (lidar, fan) in &shown.fans {
        let colour = colour(*lidar);
        let edge = Stroke { ink: Ink(colour, 0.8), ..Stroke::solid(colour, 0.2) };
        drawing.area(vec![panel.all(fan)], Some(Ink(colour, 0.08)), Some(edge));
    }
}

/// LiDARs as numbers; those behind one another share a sign.
fn numbers(drawing: &mut Drawing, signs: &[LidarSign]) {
    let aside = || signs.iter().filter(|sign| sign.at != sign.label);
    for sign in aside() {
        drawing.line([sign.at, sign.label], Stroke::solid(sign.colour(), 0.4));
    }
    for sign in signs {
        let ([x, y], [lidar, others @ ..]) = (sign.label, &sign.lidars[..]) else { continue };
        if others.is_empty() {
            number(drawing, sign.label, *lidar);
            continue;
        }
        let half = half_width(sign) - RADIUS;
        let ink = Ink::full(sign.colour());
        [x - half, x + half].into_iter().for_each(|x| drawing.disc([x, y], RADIUS, ink));
        let corners = [[-half, -RADIUS], [half, -RADIUS], [half, RADIUS], [-half, RADIUS]];
        drawing.area(vec![corners.map(|[dx, dy]| [x + dx, y + dy]).to_vec()], Some(ink), None);
        let white = Ink::full("#ffffff");
        drawing.text([x, y + 0.85], 2.4, sign.words(), Anchor::Middle, true, white);
    }
    // A number that stands aside hides neither its place nor that of another one.
    for sign in aside() {
        let [x, y] = sign.at;
        for [dx, dy] in [[CROSS, 0.0], [0.0, CROSS]] {
            let ends = [[x - dx, y - dy], [x + dx, y + dy]];
            drawing.line(ends, Stroke::solid("#ffffff", 0.95));
            drawing.line(ends, Stroke::solid(sign.colour(), 0.4));
        }
    }
}

/// A LiDAR's number on its colour.
pub(super) fn number(drawing: &mut Drawing, at: Point, lidar: usize) {
    drawing.disc(at, RADIUS, Ink::full(colour(lidar)));
    let [x, y] = at;
    drawing.text([x, y + 0.85], 2.4, lidar.to_string(), Anchor::Middle, true, Ink::full("#ffffff"));
}

fn rectangle(shown: &View, mount: &DrawnMount) -> [Flat; 2] {
    let [a, b] = mount.corners.map(|corner| (shown.flat)(corner.into()));
    [[a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]]
}

/// Metres ahead of the ego origin at which the arrow to the front ends.
pub(super) fn arrow_end(outline: &[Vec<Flat>]) -> f64 {
    let [_, high] = bounds(outline).unwrap_or(BARE);
    high[0] + ARROW[1]
}

/// Corners of the box around loops; `None` without any.
fn bounds(loops: &[Vec<Flat>]) -> Option<[Flat; 2]> {
    let each = loops.iter().flatten().map(|corner| [*corner, *corner]);
    let of = |of: fn(f64, f64) -> f64, a: Flat, b: Flat| [of(a[0], b[0]), of(a[1], b[1])];
    each.reduce(|[low, high], [at, _]| [of(f64::min, low, at), of(f64::max, high, at)])
}

fn arrow(drawing: &mut Drawing, from: Point, to: Point) {
    drawing.line([from, to], Stroke::solid(INK, 0.5));
    let [x, y] = to;
    let tip = vec![[x, y], [x - 2.4, y - 1.2], [x - 2.4, y + 1.2]];
    drawing.area(vec![tip], Some(Ink::full(INK)), None);
}

/// A bar of 1, 2, 5, 10 … metres with a mark every metre or tenth of it.
pub(super) fn scale_bar(drawing: &mut Drawing, sheet: &Sheet) {
    let scale = sheet.top.scale;
    let lengths = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    let longest = lengths.into_iter().rev().find(|metres| metres * scale <= 90.0).unwrap_or(0.1);
    let parts = if [0.2, 2.0, 20.0].contains(&longest) { 2 } else { 5 };
    let [left, y] = sheet.bar;
    let at = |part: u32| left + longest * scale * f64::from(part) / f64::from(parts);
    drawing.line([[left, y], [at(parts), y]], Stroke::solid(INK, 0.4));
    for part in 0..=parts {
        drawing.line([[at(part), y - 1.2], [at(part), y + 1.2]], Stroke::solid(INK, 0.3));
        let metres = crate::report::svg::number(longest * f64::from(part) / f64::from(parts));
        let words = if part == parts { format!("{metres} m") } else { metres };
        drawing.text([at(part), y - 2.0], WORDS, words, Anchor::Middle, false, Ink::full(INK));
    }
}

/// Most warnings, and most characters of a line of the title block in the narrowest legend.
const MOST_WARNINGS: usize = 6;
const LONGEST_LINE: usize = 96;
/// Width of a bold character as a share of the size of the font.
const BOLD: f64 = 0.54;

/// Lines of the title block on rules that are broken and requirements that are not met, or on paper only, in so many
/// millimetres.
pub(super) fn warnings(rig: &DrawnRig<'_>, room: f64) -> Vec<String> {
    let most = (room / (BOLD * WORDS)) as usize;
    let shown = rig.warnings.iter().take(MOST_WARNINGS);
    let mut lines: Vec<String> = shown.flat_map(|words| broken(words, most)).collect();
    let more = rig.warnings.len().saturating_sub(MOST_WARNINGS);
    lines.extend((more > 0).then(|| format!("and {more} more: see README.txt")));
    lines
}

/// Words on lines of at most so many characters, broken between words.
pub(super) fn broken(words: &str, most: usize) -> Vec<String> {
    let words = words.split(' ').map(|word| shortened(word, most.saturating_sub(2)));
    in_lines(words, most, "  ")
}

/// Millimetres from line to line.
const LINE: f64 = 4.2;
/// Places of the columns of the table, from the legend's left edge: model, mount, then the right ends of six numbers.
const MODEL: f64 = 5.0;
const MOUNT_AT: f64 = 26.0;
const NUMBERS: [f64; 6] = [69.0, 82.0, 95.0, 107.0, 120.0, 133.0];
/// Most characters of a model's and of a mount's name.
const LONGEST: [usize; 2] = [13, 20];

pub(super) fn draw(drawing: &mut Drawing, rig: &DrawnRig<'_>, sheet: &Sheet) {
    let [left, upper] = sheet.legend;
    let mut y = upper + TITLE;
    let heading = format!("{}: {}", shortened(rig.vehicle, 30), shortened(rig.placement, 30));
    drawing.text([left, y], TITLE + 0.6, heading, Anchor::Start, true, Ink::full(INK));
    let facts = [
        &*format!("1 : {} on A3; dimensions in mm, angles in degrees", sheet.one_to),
        "Datum: origin of the vehicle's frame, on the ground; x ahead, y left, z up (ISO 8855).",
        "R = Rz(yaw) · Ry(pitch) · Rx(roll). Positive yaw turns left, positive pitch looks down,",
        "positive roll lifts the left side.",
    ]
    .map(str::to_owned);
    let about = rig.about.iter().map(|words| shortened(words, LONGEST_LINE));
    for words in facts.into_iter().chain(about) {
        y += LINE;
        drawing.words([left, y], WORDS, words);
    }
    for words in warnings(rig, sheet.room) {
        y += LINE;
        drawing.text([left, y], WORDS, words, Anchor::Start, true, Ink::full(ACCENT));
    }
    y += 1.8 * LINE;
    drawing.words([left, y], WORDS, "Optical centres, mm from the datum:");
    y += LINE;
    y = table(drawing, rig, [left, y]);
    key(drawing, rig, [left, y + 1.2 * LINE]);
}

/// A line a LiDAR; returns the place of the last.
fn table(drawing: &mut Drawing, rig: &DrawnRig<'_>, [left, mut y]: [f64; 2]) -> f64 {
    let soft = Ink::full(SOFT);
    let titles = ["x mm", "y mm", "z mm", "roll °", "pitch °", "yaw °"];
    drawing.text([left + MODEL, y], WORDS, "model", Anchor::Start, false, soft);
    drawing.text([left + MOUNT_AT, y], WORDS, "mount", Anchor::Start, false, soft);
    for (title, at) in titles.into_iter().zip(NUMBERS) {
        drawing.text([left + at, y], WORDS, title, Anchor::End, false, soft);
    }
    for (k, lidar) in rig.lidars.iter().enumerate() {
        y += LINE;
        number(drawing, [left + RADIUS, y - 0.9], k);
        drawing.words([left + MODEL, y], WORDS, shortened(&lidar.model, LONGEST[0]));
        drawing.words([left + MOUNT_AT, y], WORDS, shortened(&lidar.mount, LONGEST[1]));
        for (field, (value, at)) in lidar.pose.values().into_iter().zip(NUMBERS).enumerate() {
            let words = match field {
                // Tenths where the number is no whole millimetre.
                0..3 => trimmed(1000.0 * value, 1),
                _ => format!("{:.2}", value.to_degrees()),
            };
            // No minus before a zero.
            let is_zero = words.trim_start_matches('-').chars().all(|c| "0.".contains(c));
            let words = if is_zero { words.trim_start_matches('-').to_owned() } else { words };
            drawing.text([left + at, y], WORDS, words, Anchor::End, false, Ink::full(INK));
        }
    }
    y
}

fn key(drawing: &mut Drawing, rig: &DrawnRig<'_>, [left, mut y]: [f64; 2]) {
    let mut sign = |fill: Option<Ink>, stroke: Stroke, words: &str| {
        let corners = [[0.0, -2.2], [6.0, -2.2], [6.0, 0.4], [0.0, 0.4]];
        let corners = corners.map(|[x, up]| [left + x, y + up]).to_vec();
        drawing.area(vec![corners], fill, Some(stroke));
        drawing.words([left + 8.0, y], WORDS, words);
        y += LINE + 0.6;
    };
    sign(Some(BODY), BODY_EDGE, "own body");
    let mount = "box around a mount; a cross is where a LiDAR stands whose number stands aside";
    sign(None, MOUNT, mount);
    let view =
        format!("field of view, level from above and upright from the side, drawn to {REACH} m");
    sign(Some(Ink(colour(0), 0.08)), Stroke::solid(colour(0), 0.2), &view);
    match &rig.near {
        Ok((_, near)) => {
            let zone = "blind zone: ground straight before an edge, up to the nearest ground within 0.5 m of a beam,";
            sign(Some(ZONE), ZONE_EDGE, zone);
            let area = format!(
                "drawn to {DRAWN} m, open where it goes on; {:.1} m² to 10 m; corners are not counted",
                near.zone.area
            );
            drawing.words([left + 8.0, y - 1.0], WORDS, area);
        }
        Err(why) => {
            let words = format!("no blind zone: {}", shortened(why, 75));
            drawing.words([left, y], WORDS, words);
        }
    }
}
