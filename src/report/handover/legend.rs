//! Words beside the views: names, scale, axes, the LiDARs with their poses, and the signs.

use super::DrawnRig;
use super::draw::{BODY, BODY_EDGE, MOUNT, RADIUS, TITLE, WORDS, ZONE, ZONE_EDGE, colour, number};
use super::sheet::Sheet;
use super::views::{DRAWN, REACH};
use crate::report::drawing::{Anchor, Drawing, Ink, Stroke};
use crate::report::svg::{INK, SOFT};
use crate::report::text::shortened;

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
            sign(Some(ZONE), ZONE_EDGE, "blind zone: ground before the nearest that a LiDAR sees,");
            let area =
                format!("drawn up to {DRAWN} m from the body; {:.1} m² in all", near.zone.area);
            drawing.words([left + 8.0, y - 1.0], WORDS, area);
        }
        Err(why) => {
            let words = format!("no blind zone: {}", shortened(why, 75));
            drawing.words([left, y], WORDS, words);
        }
    }
}
