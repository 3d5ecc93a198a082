//! A view on the sheet: body, mounts, fields of view, blind zone, LiDARs and measures.

use super::{BETWEEN, DRAWN, DrawnMount, DrawnRig, Flat, Panel, REACH, Sheet, View, Views};
use crate::report::drawing::{Anchor, Drawing, Ink, Point, Stroke};
use crate::report::svg::{ACCENT, COLOURS, FAINT, GREY, INK, SOFT};
use crate::report::text::shortened;

/// Font sizes and the radius of a LiDAR's number, millimetres.
pub(super) const TITLE: f64 = 3.6;
pub(super) const WORDS: f64 = 2.7;
const SMALL: f64 = 2.1;
/// Least millimetres between the name of the blind zone ahead and the legend.
const CLEAR: f64 = 5.0;
pub(super) const RADIUS: f64 = 1.7;
pub(super) const BODY: Ink = Ink::full(FAINT);
const BODY_EDGE: Stroke = Stroke::solid(INK, 0.3);
pub(super) const MOUNT: Stroke = Stroke::dashed(SOFT, 0.2);
const ZONE: Ink = Ink(ACCENT, 0.18);
const ZONE_EDGE: Stroke = Stroke::solid(ACCENT, 0.3);
const THIN: Stroke = Stroke::solid(INK, 0.15);

/// Colour of a LiDAR.
pub(super) fn colour(lidar: usize) -> &'static str {
    COLOURS[lidar % COLOURS.len()]
}

pub(super) fn top(drawing: &mut Drawing, rig: &DrawnRig<'_>, views: &Views, sheet: &Sheet) {
    let panel = &sheet.top;
    title(drawing, panel, "From above");
    if !views.zone.is_empty() {
        drawing.area(vec![panel.all(&views.zone)], Some(ZONE), Some(ZONE_EDGE));
    }
    view(drawing, rig, &views.top, panel);
    for mount in &rig.mounts {
        let [_, [right, up]] = rectangle(&views.top, mount);
        let [x, y] = panel.at([right, up]);
        drawing.text([x, y - 0.6], SMALL, &mount.name, Anchor::End, false, Ink::full(SOFT));
    }
    lidars(drawing, rig, &views.top, panel);
    let [low, high] = bounds(&views.top.outline).unwrap_or([[-1.0; 2], [1.0; 2]]);
    let [from, to] = [0.3, 1.3].map(|by| panel.at([high[0] + by, 0.5 * (low[1] + high[1])]));
    arrow(drawing, from, to);
    drawing.text([to[0] + 1.0, to[1] + 1.0], WORDS, "front", Anchor::Start, true, Ink::full(INK));
    if let Ok((_, near)) = &rig.near {
        let zone = &near.zone;
        let words = |name: &str, depth: Option<f64>| match depth {
            Some(depth) => format!("{name}: blind to {depth:.1} m"),
            None => format!("{name}: blind beyond 10 m"),
        };
        let [left, right, upper, lower] = panel.edges();
        let middle = panel.at([0.5 * (low[0] + high[0]), 0.0])[0];
        let ink = Ink::full(ACCENT);
        drawing.text(
            [middle, upper + SMALL],
            SMALL + 0.3,
            words("left", zone.left),
            Anchor::Middle,
            false,
            ink,
        );
        drawing.text(
            [middle, lower - 0.6],
            SMALL + 0.3,
            words("right", zone.right),
            Anchor::Middle,
            false,
            ink,
        );
        let behind = [left, panel.at([0.0, low[1]])[1] + 3.0];
        drawing.text(behind, SMALL + 0.3, words("behind", zone.behind), Anchor::Start, false, ink);
        // Ends well before the legend, which begins a gap to the right of the view.
        let ahead = [right + BETWEEN - CLEAR, panel.at([0.0, low[1]])[1] + 3.0];
        drawing.text(ahead, SMALL + 0.3, words("ahead", zone.ahead), Anchor::End, false, ink);
    }
}

pub(super) fn side(drawing: &mut Drawing, rig: &DrawnRig<'_>, views: &Views, sheet: &Sheet) {
    title(drawing, &sheet.side, "From the right");
    let depths = rig.near.as_ref().ok().map(|(_, near)| [near.zone.behind, near.zone.ahead]);
    upright(drawing, rig, &views.side, &sheet.side, depths);
}

pub(super) fn front(drawing: &mut Drawing, rig: &DrawnRig<'_>, views: &Views, sheet: &Sheet) {
    title(drawing, &sheet.front, "From the front");
    let depths = rig.near.as_ref().ok().map(|(_, near)| [near.zone.right, near.zone.left]);
    upright(drawing, rig, &views.front, &sheet.front, depths);
    let Some([low, high]) = bounds(&views.front.outline) else { return };
    // The height stands beside the view from the front.
    let x = sheet.front.edges()[1] + 3.0;
    let [lower, upper] = [0.0, high[1]].map(|up| sheet.front.at([low[0], up])[1]);
    drawing.line([[x, lower], [x, upper]], THIN);
    for y in [lower, upper] {
        drawing.line([[x - 1.0, y], [x + 1.0, y]], THIN);
    }
    let words = format!("{:.2} m", high[1]);
    drawing.text(
        [x + 1.5, 0.5 * (lower + upper)],
        WORDS,
        words,
        Anchor::Start,
        false,
        Ink::full(INK),
    );
}

/// A view with the ground, on it the blind depths to its left and right, and the body's extent below.
fn upright(
    drawing: &mut Drawing,
    rig: &DrawnRig<'_>,
    shown: &View,
    panel: &Panel,
    depths: Option<[Option<f64>; 2]>,
) {
    let ([left, right, ..], [_, ground]) = (panel.edges(), panel.at([0.0; 2]));
    drawing.line([[left, ground], [right, ground]], Stroke::solid(GREY, 0.25));
    view(drawing, rig, shown, panel);
    lidars(drawing, rig, shown, panel);
    let Some([low, high]) = bounds(&shown.outline) else { return };
    if let Some([before, behind]) = depths {
        for (edge, sign, depth) in [(low[0], -1.0, before), (high[0], 1.0, behind)] {
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
    let words = format!("{:.2} m", high[0] - low[0]);
    drawing.text([0.5 * (from + to), y + 3.6], WORDS, words, Anchor::Middle, false, Ink::full(INK));
}

fn title(drawing: &mut Drawing, panel: &Panel, words: &str) {
    let [left, _, upper, _] = panel.edges();
    drawing.text([left, upper - 2.0], TITLE, words, Anchor::Start, true, Ink::full(INK));
}

/// Body, mounts and fields of view.
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

/// LiDARs as numbers; where several stand in one place their numbers stand side by side.
fn lidars(drawing: &mut Drawing, rig: &DrawnRig<'_>, shown: &View, panel: &Panel) {
    let places: Vec<Point> =
        rig.lidars.iter().map(|lidar| panel.at((shown.flat)(lidar.pose.position()))).collect();
    let mut labels: Vec<Point> = Vec::new();
    for at in &places {
        let mut label = *at;
        let is_taken = |label: Point| {
            let near = |k: usize, other: &Point| (other[k] - label[k]).abs() < 1.9 * RADIUS;
            labels.iter().any(|other| near(0, other) && near(1, other))
        };
        while is_taken(label) {
            label[0] += 2.0 * RADIUS;
        }
        labels.push(label);
    }
    for (k, (at, label)) in places.iter().zip(&labels).enumerate() {
        drawing.line([*at, *label], Stroke::solid(colour(k), 0.4));
    }
    labels.into_iter().enumerate().for_each(|(k, label)| number(drawing, label, k));
}

/// A LiDAR's number on its colour.
pub(super) fn number(drawing: &mut Drawing, at: Point, lidar: usize) {
    drawing.disc(at, RADIUS, Ink::full(colour(lidar)));
    let [x, y] = at;
    drawing.text([x, y + 0.85], 2.4, lidar.to_string(), Anchor::Middle, true, Ink::full("#ffffff"));
}

/// Corners of a mount's box in a view.
fn rectangle(shown: &View, mount: &DrawnMount) -> [Flat; 2] {
    let [a, b] = mount.corners.map(|corner| (shown.flat)(corner.into()));
    [[a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]]
}

/// Corners of the box around loops; `None` without any.
fn bounds(loops: &[Vec<Flat>]) -> Option<[Flat; 2]> {
    let each = loops.iter().flatten().map(|corner| [*corner, *corner]);
    each.reduce(|[low, high], [corner, _]| {
        [
            [0, 1].map(|k: usize| low[k].min(corner[k])),
            [0, 1].map(|k: usize| high[k].max(corner[k])),
        ]
    })
}

/// An arrow to the right.
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

/// Millimetres from line to line.
const LINE: f64 = 4.2;
/// Places of the columns of the table, from the legend's left edge: model, mount, then the right ends of six numbers.
const MODEL: f64 = 5.0;
const MOUNT_AT: f64 = 26.0;
const NUMBERS: [f64; 6] = [68.0, 79.0, 90.0, 104.0, 117.0, 130.0];
/// Most characters of a model's and of a mount's name.
const LONGEST: [usize; 2] = [13, 20];

pub(super) fn draw(drawing: &mut Drawing, rig: &DrawnRig<'_>, sheet: &Sheet) {
    let [left, upper] = sheet.legend;
    let mut y = upper + TITLE;
    let heading = format!("{}: {}", shortened(rig.vehicle, 30), shortened(rig.placement, 30));
    drawing.text([left, y], TITLE + 0.6, heading, Anchor::Start, true, Ink::full(INK));
    for words in [
        format!("1 : {} on A3; measures in metres", sheet.one_to),
        "Axes by ISO 8855: x ahead, y left, z up from the ground.".to_owned(),
        "R = Rz(yaw) · Ry(pitch) · Rx(roll); a positive pitch looks down.".to_owned(),
    ] {
        y += LINE;
        drawing.words([left, y], WORDS, words);
    }
    y += 1.8 * LINE;
    y = table(drawing, rig, [left, y]);
    signs(drawing, rig, [left, y + 1.2 * LINE]);
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
                0..3 => format!("{:.0}", 1000.0 * value),
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

fn signs(drawing: &mut Drawing, rig: &DrawnRig<'_>, [left, mut y]: [f64; 2]) {
    let mut sign = |fill: Option<Ink>, stroke: Stroke, words: &str| {
        let corners = [[0.0, -2.2], [6.0, -2.2], [6.0, 0.4], [0.0, 0.4]];
        let corners = corners.map(|[x, up]| [left + x, y + up]).to_vec();
        drawing.area(vec![corners], fill, Some(stroke));
        drawing.words([left + 8.0, y], WORDS, words);
        y += LINE + 0.6;
    };
    sign(Some(BODY), BODY_EDGE, "own body");
    sign(None, MOUNT, "box around a mount");
    let view =
        format!("field of view, level from above and upright from the side, drawn to {REACH} m");
    sign(Some(Ink(colour(0), 0.08)), Stroke::solid(colour(0), 0.2), &view);
    match &rig.near {
        Ok((_, near)) => {
            sign(
                Some(ZONE),
                ZONE_EDGE,
                "blind zone: ground straight before an edge, up to the nearest seen,",
            );
            let area = format!(
                "drawn to {DRAWN} m; {:.1} m² to 10 m; corners are not counted",
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
