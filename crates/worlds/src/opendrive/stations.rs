//! Places along a road at which its surface needs a point, beside the points of the OpenDRIVE library.
//!
//! The library puts points of lanes 2 m apart, closer where a lane turns in plan, and where a `<crossfall>` begins. It steps
//! over records of heights and widths. A crossfall that changes nothing puts a point at each of them.
//!
//! [`Profile`] has the heights across a road that its lanes lose: lanes are flat between their edges.

use std::ops::Range;

use roxmltree::{Document, Node};

use super::document::number_or_0 as number;

/// Largest gap between the surface and its curve, in metres, that a piece of it may leave, and as much at a bend.
const GAP: f64 = 0.005;
/// Farthest points of the library, in metres.
const STEP: f64 = 2.0;
/// Closest places in metres, where a curve asks for closer ones.
const CLOSEST: f64 = 0.25;
/// Shortest record in metres that is followed: programs end a section by a centimetre of any polynomial.
const SHORTEST: f64 = 0.1;
/// Metres within which two places are one.
const SAME: f64 = 0.05;
/// Metres beside the reference line to which tilts are followed.
const REACH: f64 = 10.0;
/// Most places along one road: the library looks through all of them at each point.
const MOST: usize = 10_000;
/// Most places of one road before neighbours are joined.
const MOST_FOUND: usize = 1 << 20;

/// A record: where it begins, in metres along or across the road, and the coefficients a, b, c, d of its cubic.
type Cubic = (f64, [f64; 4]);

/// The places of one road.
pub(super) struct RoadStations<'a, 'i> {
    pub road: Node<'a, 'i>,
    /// In metres along the road, sorted.
    pub places: Vec<f64>,
    /// True if the road needs more than there may be.
    pub is_cut: bool,
}

/// The places of all roads that need any.
pub(super) fn of<'a, 'i>(xml: &'a Document<'i>) -> Vec<RoadStations<'a, 'i>> {
    let roads = xml.root_element().children().filter(|node| node.has_tag_name("road"));
    let all = roads.map(|road| {
        let mut places = places(road);
        let is_cut = places.len() > MOST;
        places.truncate(MOST);
        RoadStations { road, places, is_cut }
    });
    all.filter(|stations| !stations.places.is_empty()).collect()
}

fn places(road: Node<'_, '_>) -> Vec<f64> {
    let length = number(road, "length");
    let mut places = Vec::new();
    let profiles = [
        ("elevationProfile", "elevation", 1.0),
        ("lateralProfile", "superelevation", REACH),
        ("lateralProfile", "crossfall", REACH),
    ];
    for (profile, record, weight) in profiles {
        let records = inside(road, profile).flat_map(|node| cubics(node, record, "s", 0.0));
        follow(records.collect(), [0.0, length], weight, &mut places);
    }
    for lanes in inside(road, "lanes") {
        follow(cubics(lanes, "laneOffset", "s", 0.0), [0.0, length], 1.0, &mut places);
        let mut sections: Vec<Node<'_, '_>> = inside(lanes, "laneSection").collect();
        sections.sort_by(|a, b| number(*a, "s").total_cmp(&number(*b, "s")));
        for (k, section) in sections.iter().enumerate() {
            let from = number(*section, "s");
            let to = sections.get(k + 1).map_or(length, |next| number(*next, "s"));
            let lanes = section.children().flat_map(|side| inside(side, "lane"));
            for lane in lanes {
                for record in ["width", "border"] {
                    let records = cubics(lane, record, "sOffset", from);
                    follow(records, [from, to], 1.0, &mut places);
                }
            }
        }
    }
    places.retain(|s| s.is_finite() && *s > SAME && *s < length - SAME);
    places.sort_by(f64::total_cmp);
    // The first of places that are one stays.
    let mut last = f64::NEG_INFINITY;
    places.retain(|s| {
        let is_new = s - last > SAME;
        last = if is_new { *s } else { last };
        is_new
    });
    places
}

/// Elements of a name in another.
fn inside<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

/// The record of an element, whose attribute `place` says where it begins.
fn cubic(node: Node<'_, '_>, place: &str) -> Cubic {
    (number(node, place), ["a", "b", "c", "d"].map(|key| number(node, key)))
}

/// The records of a name in an element, in order; `from` is where their places count from.
fn cubics(node: Node<'_, '_>, name: &'static str, place: &str, from: f64) -> Vec<Cubic> {
    let moved = |(start, terms): Cubic| (from + start, terms);
    let mut all: Vec<Cubic> = inside(node, name).map(|n| moved(cubic(n, place))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// Adds the places of a curve between two places of a road: bends between records, and pieces that are curved. `weight` turns
/// its values to metres.
fn follow(mut records: Vec<Cubic>, [from, to]: [f64; 2], weight: f64, places: &mut Vec<f64>) {
    // No record is a value of 0.
    if records.first().is_some_and(|(start, _)| *start > from) {
        records.insert(0, (from, [0.0; 4]));
    }
    for (i, &(start, [_, b, c, d])) in records.iter().enumerate() {
        let end = records.get(i + 1).map_or(to, |next| next.0.min(to));
        let length = end - start;
        if length.is_nan() || length < SHORTEST || places.len() > MOST_FOUND {
            continue;
        }
        let bends = i.checked_sub(1).is_some_and(|before| {
            let (at, cubic) = records[before];
            let [_, slope, ..] = moved(cubic, start - at);
            // Half a step to the next point on either side.
            (b - slope).abs() * weight * 0.25 * STEP > GAP
        });
        if bends {
            places.push(start);
        }
        let curved = (2.0 * c).abs().max((2.0 * c + 6.0 * d * length).abs()) * weight;
        // A chord of h metres leaves a gap of h²/8 times the second derivative.
        let step = (8.0 * GAP / curved).sqrt();
        if step < STEP {
            let pieces = (length / step.max(CLOSEST)).ceil().min(MOST as f64);
            // An even number has a point in the middle.
            let pieces = if pieces > 1.0 { 2.0 * (0.5 * pieces).ceil() } else { 1.0 };
            places.extend((0..=pieces as usize).map(|k| start + length * k as f64 / pieces));
        }
    }
}

/// The cubic that a cubic is from `x` on.
fn moved([a, b, c, d]: [f64; 4], x: f64) -> [f64; 4] {
    [a + x * (b + x * (c + x * d)), b + x * (2.0 * c + x * 3.0 * d), c + x * 3.0 * d, d]
}

/// The text of a document with a crossfall at each place, which repeats the tilt that holds there anyway.
pub(super) fn write(text: &str, roads: &[RoadStations<'_, '_>]) -> String {
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    for RoadStations { road, places, .. } in roads {
        let Some(lanes) = inside(*road, "lanes").next() else { continue };
        let lateral = inside(*road, "lateralProfile").next();
        let stated: Vec<Node<'_, '_>> =
            lateral.into_iter().flat_map(|node| inside(node, "crossfall")).collect();
        if stated.is_empty() {
            let records = places.iter().map(|s| record(*s, None)).collect::<String>();
            let whole = format!("<lateralProfile>{records}</lateralProfile>");
            edits.push(match lateral.map(|node| (node, node.first_element_child())) {
                None => (lanes.range().start..lanes.range().start, whole),
                Some((node, None)) => (node.range(), whole),
                Some((_, Some(child))) => (child.range().start..child.range().start, records),
            });
            continue;
        }
        for s in places {
            let is_behind = |node: &&Node<'_, '_>| number(**node, "s") > *s;
            let next = stated.iter().find(is_behind);
            let at = next.map_or_else(
                || stated.last().map_or(0, |last| last.range().end),
                |next| next.range().start,
            );
            let before = stated.iter().filter(|node| number(**node, "s") <= *s);
            let before = before.max_by(|a, b| number(**a, "s").total_cmp(&number(**b, "s")));
            if before.is_none_or(|node| s - number(*node, "s") > SAME) {
                edits.push((at..at, record(*s, before)));
            }
        }
    }
    edits.sort_by_key(|(range, _)| range.start);
    let (mut written, mut done) = (String::with_capacity(text.len()), 0);
    for (range, inserted) in edits {
        written += &text[done..range.start];
        written += &inserted;
        done = range.end;
    }
    written + &text[done..]
}

/// A crossfall from `s` on with the values of `before` there; level where there is none before.
fn record(s: f64, before: Option<&Node<'_, '_>>) -> String {
    let (mut cubic, mut side) = ([0.0; 4], "both");
    if let Some(before) = before {
        let own = ["a", "b", "c", "d"].map(|key| number(*before, key));
        cubic = moved(own, s - number(*before, "s").max(0.0));
        side = before
            .attribute("side")
            .filter(|side| ["left", "right"].contains(side))
            .unwrap_or("both");
    }
    let [a, b, c, d] = cubic;
    format!("<crossfall side=\"{side}\" s=\"{s}\" a=\"{a}\" b=\"{b}\" c=\"{c}\" d=\"{d}\"/>")
}

/// Heights across a road beside its banking, from its `<lateralProfile>`.
#[derive(Debug, Default)]
pub(super) struct Profile {
    /// Heights across the road at places along it, by `s` in metres, each a row of cubics by the `t` where it begins.
    places: Vec<(f64, Vec<Cubic>)>,
    /// True if the road has a `<crossSectionSurface>`, whose heights are not read.
    pub section: bool,
}

impl Profile {
    /// The profile of a road that has one that can bend across a lane.
    pub(super) fn of(road: Node<'_, '_>) -> Option<Self> {
        let parts = |name| inside(road, "lateralProfile").flat_map(move |n| inside(n, name));
        let record = |n| (number(n, "s"), cubic(n, "t"));
        let mut records: Vec<(f64, Cubic)> = parts("shape").map(record).collect();
        records.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.0.total_cmp(&b.1.0)));
        let places = records
            .chunk_by(|a, b| a.0 == b.0)
            .map(|rows| (rows[0].0, rows.iter().map(|(_, row)| *row).collect()))
            .collect();
        let section = parts("crossSectionSurface").next().is_some();
        Some(Self { places, section }).filter(|p| p.section || !p.places.is_empty())
    }

    /// Largest height in metres between the surface at `s` and the chord between two places across the road, `t` in metres.
    pub(super) fn gap(&self, s: f64, [right, left]: [f64; 2]) -> f64 {
        let [low, high] = [right, left].map(|t| self.height(s, t));
        let off = |t: f64| {
            let chord = low + (high - low) * (t - right) / (left - right);
            (self.height(s, t) - chord).abs()
        };
        let breaks = self.places.iter().flat_map(|(_, rows)| rows.iter().map(|(t, _)| *t));
        let quarters = [0.25, 0.5, 0.75].map(|share| right + (left - right) * share);
        let inside = breaks.chain(quarters).filter(|t| *t > right && *t < left);
        inside.map(off).fold(0.0, f64::max)
    }

    /// Height in metres at `s` and `t`: linear along the road between places, the last cubic that begins before `t` across it.
    fn height(&self, s: f64, t: f64) -> f64 {
        let across = |rows: &[Cubic]| {
            let begun = rows.partition_point(|(start, _)| *start <= t);
            let (start, cubic) = rows[begun.saturating_sub(1)];
            moved(cubic, if begun == 0 { 0.0 } else { t - start })[0]
        };
        let next = self.places.partition_point(|(place, _)| *place <= s);
        let before = next.checked_sub(1).map(|i| &self.places[i]);
        match (before, self.places.get(next)) {
            (None, None) => 0.0,
            (Some((_, rows)), None) | (None, Some((_, rows))) => across(rows),
            (Some((from, first)), Some((to, second))) => {
                let (first, second) = (across(first), across(second));
                first + (second - first) * (s - from) / (to - from)
            }
        }
    }
}
