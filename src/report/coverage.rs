//! Near field, and things that several LiDARs see, as text and figures.

use std::fmt::Write;

use maud::{Markup, html};

use super::columns::{align_columns, table_text};
use super::optional;
use super::svg::{ACCENT, FAINT, GREY, INK, SECOND, SOFT, corners, page, px, trimmed};
use super::text::shortened;
use crate::json::{counted, fixed};
use crate::maths;
use crate::near_field::{CELL, CLOSE, Footprint, NEAR, NearField, RING, Standard};
use crate::score::{metres_up, percent_down, percent_up};
use crate::shared::{Overlap, Redundancy, SeenBy, SeenByTechnologies, Technologies};
use crate::vehicle::{Placement, SensorName};

/// Drawings beside each other.
const COLUMNS: usize = 3;
/// Pixels of a metre, and of the lines of words over a drawing.
const SCALE: f64 = 14.0;
const TITLE: f64 = 56.0;
/// Pixels of the lines on frames where bodies move.
const FRAMES: f64 = 32.0;
/// Most characters of a line over a drawing: the drawing of the smallest body is 294 pixels wide.
const LONGEST_LINE: usize = 36;
/// Metres ahead of the body at which the arrow to the front begins: behind the farthest pole.
const ARROW: f64 = 5.0;
const UNSEEN: &str = "#e2cf94";
/// Least width of a drawing: that of its legend.
const LEGEND: f64 = 560.0;
const GOOD: &str = "#3d8f5f";

/// A line a placement: shares, blind ground, depth of the blind zone in four directions; then ground lost again, poles seen by standard and
/// wasted beams.
pub(crate) fn near_field_text(all: &[NearField]) -> String {
    let titles = [
        "placement", "near %", "3 m %", "blind m²", "zone m²", "blind ahead m", "behind", "left",
        "right",
    ];
    let ground = all.iter().map(|near| {
        let zone = &near.zone;
        let mut row = vec![near.name.clone(), format!("{:.1}", percent_down(near.near_field))];
        row.push(optional(near.ring.map(percent_down), 1));
        row.extend([near.blind_area, zone.area].map(|area| format!("{area:.0}")));
        let depth = |depth: Option<f64>| {
            depth.map_or(format!("> {NEAR}"), |d| format!("{:.1}", metres_up(d)))
        };
        row.extend([zone.ahead, zone.behind, zone.left, zone.right].map(depth));
        row
    });
    let ground = table_text(&titles, ground);
    let standards = Standard::ALL.map(|(_, name)| name);
    let titles = [&["placement"][..], &standards, &["own body %, by LiDAR"]].concat();
    let poles = all.iter().map(|near| {
        let mut row = vec![near.name.clone()];
        row.extend(Standard::ALL.map(|(standard, _)| {
            let [seen, poles] = seen_of(near, standard);
            format!("{seen}/{poles}")
        }));
        let wasted = near.beams.iter().map(|beams| trimmed(percent_up(beams.own), 1));
        row.push(wasted.collect::<Vec<_>>().join(" "));
        row
    });
    let poles = table_text(&titles, poles);
    let (worst, lost) = (worst_text(all), lost_text(all));
    let moves = all.iter().find(|near| near.worst_frame.is_some());
    let own = moves.map_or(String::new(), |near| {
        format!("own body % is a mean over {} frames\n", near.frames)
    });
    format!("{ground}{worst}{lost}\n{poles}{own}{}\n{POLES}\n", seen_ground())
}

/// Lines on the frames in which bodies that move leave most ground unseen; empty where none moves.
fn worst_text(all: &[NearField]) -> String {
    let of_near = |near: &NearField| {
        let [worst, ring] = near.worst_in_words();
        let sides = near.zone.worst_frames.iter();
        let sides: Vec<String> =
            sides.map(|(side, frame)| format!("{side} in frame {frame}")).collect();
        (!sides.is_empty()).then(|| {
            let shares = [("10", worst), ("3", ring)];
            let shares = shares.iter().filter(|(_, words)| !words.is_empty());
            let shares = shares.map(|(within, words)| format!("; ground to {within} m{words}"));
            let shares = shares.collect::<String>();
            format!("{}: deepest blind zone {}{shares}\n", near.name, sides.join(", "))
        })
    };
    all.iter().filter_map(of_near).collect()
}

/// Lines on sides of placements on which ground behind the nearest ground seen is lost again.
fn lost_text(all: &[NearField]) -> String {
    let of_near = |near: &NearField| {
        let sides = near.zone.depths().into_iter().filter_map(|(side, depth)| {
            let (depth, but) = (depth?, near.zone.but_lost(side));
            (!but.is_empty())
                .then(|| format!("! {}: {side} {:.1} m{but}\n", near.name, metres_up(depth)))
        });
        sides.collect::<String>()
    };
    all.iter().map(of_near).collect()
}

/// Meaning of ground that is seen.
pub(super) fn seen_ground() -> String {
    format!("ground is seen where a beam ends on ground within {CLOSE} m")
}

/// Caveat of the columns of poles.
const POLES: &str = "poles after the standards' positions, partly unconfirmed; no type approval (docs/nearfield.md)";

/// Poles seen, and poles, of a standard.
pub(super) fn seen_of(near: &NearField, standard: Standard) -> [usize; 2] {
    let poles = near.poles.iter().filter(|pole| pole.standard == standard);
    poles.fold([0; 2], |[seen, all], pole| [seen + usize::from(pole.seen), all + 1])
}

/// One drawing a placement, from above: ground that is not seen, the blind zone, poles and LiDARs. Forward
/// is to the right, left is up.
pub(crate) fn near_field_svg(footprint: &Footprint, all: &[(&Placement, &NearField)]) -> String {
    let [low, high] = footprint.bounds();
    let size = [0, 1].map(|k| (high[k] - low[k] + 2.0 * NEAR + 1.0) * SCALE);
    let moves = all.iter().any(|(_, near)| !near.zone.worst_frames.is_empty());
    let title = if moves { TITLE + FRAMES } else { TITLE };
    let at = |[x, y]: [f64; 2]| {
        ((x - low[0] + NEAR + 0.5) * SCALE, title + (high[1] - y + NEAR + 0.5) * SCALE)
    };
    let columns = all.len().clamp(1, COLUMNS);
    let rows = all.len().div_ceil(columns);
    let drawing = html! {
        @for (k, (placement, near)) in all.iter().enumerate() {
            @let left = (k % columns) as f64 * size[0];
            @let top = (k / columns) as f64 * (size[1] + title);
            g transform={ "translate(" (px(left)) " " (px(top)) ")" } {
                (panel(footprint, placement, near, &at))
            }
        }
        g transform={ "translate(8 " (px(rows as f64 * (size[1] + title) + 18.0)) ")" } { (legend(moves)) }
    };
    let width = (columns as f64 * size[0]).max(LEGEND).round();
    let below = if moves { 106.0 } else { 84.0 };
    let height = (rows as f64 * (size[1] + title) + below).round();
    page([width, height], "Ground near the vehicle that is not seen, from above", &drawing)
}

fn panel(
    footprint: &Footprint,
    placement: &Placement,
    near: &NearField,
    at: &dyn Fn([f64; 2]) -> (f64, f64),
) -> Markup {
    let seen = near.poles.iter().filter(|pole| pole.seen).count();
    let down = |share: f64| percent_down(share).floor();
    let words = [
        format!(
            "seen: {:.0} % to 10 m, {} % of the ring,",
            down(near.near_field),
            optional(near.ring.map(down), 0)
        ),
        format!("{seen} of {} poles", near.poles.len()),
    ];
    html! {
        text x="8" y="18" font-weight="600" { (shortened(&near.name, LONGEST_LINE)) }
        @for (words, y) in words.iter().zip(["34", "50"]) { text x="8" y=(y) fill=(SOFT) { (words) } }
        @for (words, y) in frames_in_words(near).iter().zip(["66", "82"]) { text x="8" y=(y) fill=(SOFT) { (words) } }
        path d=(unseen(near, at)) stroke=(UNSEEN) stroke-width=(px(CELL * SCALE)) {}
        @for within in [RING, NEAR] {
            polygon points=(corners(around(footprint, within).into_iter().map(at))) fill="none"
                stroke=(GREY) stroke-dasharray="3 3" stroke-width=".7" {}
        }
        path d=(around_box(footprint, near, at)) fill=(ACCENT) fill-opacity=".18" fill-rule="evenodd" {}
        polygon points=(corners(near.zone.polygon.iter().map(|c| at(*c)))) fill="none" stroke=(ACCENT) {}
        polygon points=(corners(footprint.corners().iter().map(|c| at(*c)))) fill=(FAINT) stroke=(INK) {}
        @for pole in &near.poles {
            @let (x, y) = at(pole.at);
            circle cx=(px(x)) cy=(px(y)) r="2.6" stroke="#fff" stroke-width=".6"
                fill=(if pole.seen { GOOD } else { INK }) {}
        }
        @for pose in &placement.lidars {
            @let (x, y) = at([pose.x, pose.y]);
            rect x=(px(x - 3.0)) y=(px(y - 3.0)) width="6" height="6" fill=(SECOND) stroke="#fff" {}
        }
        (front(footprint, at))
    }
}

/// The blind zone with the box around the body as a hole: no lane begins within the box, and ground beside a body
/// that narrows may be seen there.
fn around_box(
    footprint: &Footprint,
    near: &NearField,
    at: &dyn Fn([f64; 2]) -> (f64, f64),
) -> String {
    let [[back, right], [front, left]] = footprint.bounds();
    let hole = [[back, right], [front, right], [front, left], [back, left]];
    let zone = corners(near.zone.polygon.iter().map(|c| at(*c)));
    format!("M{zone}zM{}z", corners(hole.into_iter().map(at)))
}

/// Frames that a drawing is of, where bodies move.
fn frames_in_words(near: &NearField) -> Vec<String> {
    let sides = near.zone.worst_frames.iter().map(|(side, frame)| format!("{side} {frame}"));
    let sides: Vec<String> = sides.collect();
    match sides.is_empty() {
        true => Vec::new(),
        false => vec!["body of frame 0; blind zone of frames".to_owned(), sides.join(", ")],
    }
}

/// An arrow ahead of the poles, with its name.
fn front(footprint: &Footprint, at: &dyn Fn([f64; 2]) -> (f64, f64)) -> Markup {
    let [low, high] = footprint.bounds();
    let (x, y) = at([high[0] + ARROW, 0.5 * (low[1] + high[1])]);
    html! {
        path d={ "M" (px(x)) " " (px(y)) "h" (px(1.5 * SCALE)) } stroke=(INK) stroke-width="1.5" {}
        path d={ "M" (px(x + 1.5 * SCALE)) " " (px(y)) "l-7 -4v8z" } fill=(INK) {}
        text x=(px(x)) y=(px(y - 8.0)) fill=(INK) font-size="12" { "front" }
    }
}

/// Cells seen in less than half of their frames, as runs along y.
fn unseen(near: &NearField, at: &dyn Fn([f64; 2]) -> (f64, f64)) -> String {
    let mut path = String::new();
    let mut cells = near.cells.iter().filter(|(_, share)| *share < 0.5).map(|(c, _)| *c).peekable();
    while let Some(first) = cells.next() {
        let mut last = first;
        while let Some(next) = cells.next_if(|c| c[0] == last[0] && c[1] - last[1] < 1.5 * CELL) {
            last = next;
        }
        let (x, y) = at([first[0], first[1] - CELL / 2.0]);
        let _ = write!(path, "M{x:.1} {y:.1}v{:.1}", -(last[1] - first[1] + CELL) * SCALE);
    }
    path
}

/// Points at a distance around a footprint: each corner with a round.
fn around(footprint: &Footprint, within: f64) -> Vec<[f64; 2]> {
    let turns = (0..180).map(|k| maths::sin_cos(f64::from(k).to_radians() * 2.0));
    let farthest = |(sin, cos): (f64, f64)| {
        let along = |c: &&[f64; 2]| c[0] * cos + c[1] * sin;
        let corners = footprint.corners().iter();
        let corner = corners.max_by(|a, b| along(a).total_cmp(&along(b)));
        corner.map(|c| [c[0] + within * cos, c[1] + within * sin])
    };
    turns.filter_map(farthest).collect()
}

/// `moves` where bodies of the vehicle move: blind zones may then lie over ground that other frames see.
fn legend(moves: bool) -> Markup {
    let dots = [(GOOD, "pole with 5 beams or more", 0.0), (INK, "pole with fewer", 215.0)];
    html! {
        @for (colour, words, x) in dots {
            circle cx=(x + 5.0) cy="-4" r="4" fill=(colour) {}
            text x=(x + 14.0) y="0" { (words) }
        }
        path d={ "M360 -5h" (px(5.0 * SCALE)) "m0 -4v8m-" (px(5.0 * SCALE)) " 0v-8" } stroke=(INK) fill="none" {}
        text x=(px(366.0 + 5.0 * SCALE)) y="0" { "5 m" }
        rect x="0" y="12" width="12" height="12" fill=(UNSEEN) {}
        text x="17" y="22" { "ground not seen" }
        // Most of the zone lies over ground that is not seen.
        rect x="140" y="12" width="12" height="12" fill=(UNSEEN) {}
        rect x="140" y="12" width="12" height="12" fill=(ACCENT) fill-opacity=".18" stroke=(ACCENT) {}
        text x="157" y="22" { "blind zone before an edge; corners are not counted" }
        rect x="1" y="36" width="8" height="8" fill=(SECOND) {}
        text x="14" y="44" { "LiDAR" }
        rect x="78" y="34" width="12" height="10" fill=(FAINT) stroke=(INK) {}
        text x="96" y="44" { "own body" }
        path d="M200 39h14" stroke=(GREY) stroke-dasharray="3 3" {}
        text x="219" y="44" { "3 m and 10 m from the body" }
        @if moves {
            rect x="0" y="54" width="12" height="12" fill=(ACCENT) fill-opacity=".18" stroke=(ACCENT) {}
            text x="17" y="64" { "blind zone over ground that most frames see, or over the own body of its frame" }
        }
    }
}

/// LiDAR by its number, with its model where it has a name: `0 roof-64`.
fn lidar(number: usize, sensor: SensorName) -> String {
    if sensor.is_none() { number.to_string() } else { format!("{number} {sensor}") }
}

/// A share in percent, rounded down as the near field has it.
fn percent(share: Option<f64>) -> String {
    super::optional(share.map(percent_down), 1)
}

/// A line of a table: a name, how many things there are, shares in percent; the share that none sees is rounded up.
fn line(name: String, seen: &SeenBy) -> Vec<String> {
    let mut row = vec![name, fixed(seen.all, 0)];
    row.push(super::optional(seen.share.map(|share| percent_up(share[0])), 1));
    row.extend((1..seen.by.len()).map(|k| percent(seen.share.map(|share| share[k]))));
    row.extend(seen.alone.iter().map(|alone| percent(alone.share)));
    row
}

/// Title of a row: the scene and the placement.
fn heading(scene: &str, placement: &str, lidars: usize, frames: usize) -> String {
    let [lidars, frames] = [counted(lidars, "LiDAR"), counted(frames, "frame")];
    format!("{placement} in {scene}: {lidars}, {frames}")
}

/// Things that count, and the shares of them in per cent that no, one, two, three and more LiDARs see; titles first.
pub(super) fn redundancy_rows(row: &Redundancy) -> Vec<Vec<String>> {
    let titles = ["% seen by", "of", "0", "1", "2", "3+"].map(str::to_owned);
    let alone = row.voxels.alone.iter().map(|alone| format!("{} alone", alone.sensor));
    let mut rows = vec![titles.into_iter().chain(alone).collect::<Vec<_>>()];
    rows.push(line("voxels, occupied".to_owned(), &row.occupied));
    rows.push(line("voxels, all".to_owned(), &row.voxels));
    let ground = [("ground to 3 m", &row.ground_3m), ("ground to 10 m", &row.ground_10m)];
    for (name, seen) in ground {
        rows.extend(seen.as_ref().map(|seen| line(name.to_owned(), seen)));
    }
    rows.extend(row.targets.iter().map(|of| line(of.target.clone(), &of.seen)));
    rows
}

/// A table a placement and scene: things that count, and the shares of them that no, one, two, three and more LiDARs
/// see.
pub(crate) fn redundancy_text(all: &[&Redundancy]) -> String {
    let of = |row: &&Redundancy| {
        let heading = heading(&row.scene, &row.placement, row.lidars.len(), row.frames);
        let technologies = row.technologies.as_ref().map(technology_rows);
        let technologies =
            technologies.map_or(String::new(), |rows| format!("\n{}", align_columns(&rows)));
        format!("{heading}\n{}{technologies}", align_columns(&redundancy_rows(row)))
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}

/// Things that count, the shares of them in per cent that no, one, two, three and more technologies see, and that each
/// technology sees; titles first.
pub(super) fn technology_rows(all: &Technologies) -> Vec<Vec<String>> {
    let ground = [("ground to 3 m", &all.ground_3m), ("ground to 10 m", &all.ground_10m)];
    let ground = ground.into_iter().filter_map(|(name, seen)| Some((name, seen.as_ref()?)));
    let targets = all.targets.iter().map(|of| (of.target.as_str(), &of.seen));
    let things = std::iter::once(("voxels, occupied", &all.occupied)).chain(ground).chain(targets);
    let numbers = ["% by technologies", "of", "blind to all", "by 1", "2", "3+"];
    let each = all.sensors.iter().map(|of| format!("{} {}", of.count, of.technology));
    let mut rows = vec![numbers.map(str::to_owned).into_iter().chain(each).collect::<Vec<_>>()];
    rows.extend(things.map(|(thing, seen): (&str, &SeenByTechnologies)| {
        let mut row = line(thing.to_owned(), &seen.number);
        row.extend(seen.each.iter().map(|of| percent(of.share)));
        row
    }));
    rows
}

/// A matrix whose rows and columns are LiDARs.
fn matrix(title: &str, row: &Overlap, cell: impl Fn(usize, usize) -> String) -> String {
    let count = row.lidars.len();
    let titles = std::iter::once(title.to_owned()).chain((0..count).map(|k| k.to_string()));
    let mut rows = vec![titles.collect::<Vec<_>>()];
    for (a, sensor) in row.lidars.iter().enumerate() {
        let cells = (0..count).map(|b| cell(a, b));
        rows.push(std::iter::once(lidar(a, *sensor)).chain(cells).collect());
    }
    align_columns(&rows)
}

/// A sentence on the pairs that connect the LiDARs, or on the LiDARs that none connects.
fn verdict(row: &Overlap) -> String {
    let names = |lidars: &[usize]| {
        let named = lidars.iter().map(|&k| lidar(k, row.lidars[k]));
        named.collect::<Vec<_>>().join(", ")
    };
    let least = row.least_shared;
    if !row.connected {
        let cut_off = row.cut_off.iter().map(|&cut| {
            let others = (0..row.lidars.len()).filter(|&other| other != cut);
            let best = others.max_by(|&a, &b| {
                let shared = &row.shared_voxels[cut];
                shared[a].total_cmp(&shared[b]).then(b.cmp(&a))
            });
            let best = best.filter(|&best| row.shared_voxels[cut][best] > 0.0);
            let most = best.map_or("nothing with any other".to_owned(), |best| {
                format!("{} with {best}", fixed(row.shared_voxels[cut][best], 0))
            });
            format!("{} (shares {most})", lidar(cut, row.lidars[cut]))
        });
        return format!(
            "NOT CONNECTED at {least} shared voxels; cut off from {}: {}",
            names(&row.groups[0]),
            cut_off.collect::<Vec<_>>().join(", ")
        );
    }
    let chain = row.chain.iter().map(|pair| format!("{}–{}", pair.lidars[0], pair.lidars[1]));
    format!(
        "Connected at {least} shared voxels, and up to {}, by the pairs {}",
        fixed(row.connected_up_to.floor(), 0),
        chain.collect::<Vec<_>>().join(", ")
    )
}

/// Three matrices a placement and scene, and whether pairs connect all LiDARs.
pub(crate) fn overlap_text(all: &[Overlap]) -> String {
    let of = |row: &Overlap| {
        let heading = heading(&row.scene, &row.placement, row.lidars.len(), row.frames);
        let voxels = matrix("surface voxels", row, |a, b| fixed(row.shared_voxels[a][b], 0));
        let overlap = matrix("overlap %", row, |a, b| fixed(percent_down(row.overlap[a][b]), 1));
        let directions =
            matrix("% of the sphere", row, |a, b| fixed(100.0 * row.shared_directions[a][b], 1));
        let up_to = percent_down(row.overlap_up_to);
        let up_to = match row.overlap_up_to > 0.0 {
            true => format!("All connected up to an overlap of {up_to:.1} %"),
            false => "No overlap connects all".to_owned(),
        };
        let verdict = format!("{}\n{up_to}", verdict(row));
        format!("{heading}\n{voxels}\n{overlap}\n{directions}\n{verdict}\n")
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_that_none_sees_is_rounded_up_and_others_down() {
        let share = Some([0.006_25, 0.068_75, 0.9, 0.025]);
        let seen = SeenBy { all: 160.0, by: [1.0, 11.0, 144.0, 4.0], share, alone: Vec::new() };
        assert_eq!(line("car".to_owned(), &seen), ["car", "160", "0.7", "6.8", "90.0", "2.5"]);
        let none = SeenBy { share: Some([0.0, 1.0, 0.0, 0.0]), ..seen };
        assert_eq!(line("car".to_owned(), &none)[2..4], ["0.0", "100.0"]);
    }
}
