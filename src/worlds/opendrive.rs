//! A network of roads from OpenDRIVE.
//!
//! The crate `xodr` evaluates reference lines, widths, elevations, superelevations and links in `f64`
//! and hands them over as lanes of `f32` points; here they become strips and lanes.

use crate::maths;
use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use xodr::{Direction, LaneType, Layer, Point, RoadNetwork};

use super::error::WorldError;
use super::line::{Line, left_of};
use super::network::{KERB, Lane, Network, Post, Street, Strip, Use};

/// Largest file in bytes.
pub(crate) const MAX_FILE: u64 = 128 << 20;
/// Most points of lanes and paint.
const MAX_POINTS: usize = 8_000_000;
/// Most metres of road, and widest lane: what a town may have, with trees and houses along all of it.
const MAX_LENGTH: f64 = 60_000.0;
const MAX_WIDTH: f64 = 60.0;
/// Farthest coordinate: beyond it the reader's `f32` is coarser than a centimetre.
const MAX_FAR: f64 = 1e5;
/// Most signs and lights that are taken over.
const MAX_POSTS: usize = 20_000;

/// Edges of a lane in the direction of its road, left and right.
struct Ribbon {
    left: Vec<DVec3>,
    right: Vec<DVec3>,
}

/// Reads an OpenDRIVE document; `file` names it in errors.
///
/// # Errors
/// XML that does not parse, no road with a lane, no lane to drive in, more than a world can hold.
pub(crate) fn network(text: &str, file: &str) -> Result<Network, WorldError> {
    let (roads, _) = xodr::load_str_with_provenance(text).map_err(|source| {
        WorldError::OpenDrive { file: file.to_owned(), source: Box::new(source) }
    })?;
    let permanent = |l: &&xodr::Lane| l.layer == Layer::Permanent;
    check(&roads, file)?;
    let mut network = Network::default();
    let mut lane_of: BTreeMap<usize, usize> = BTreeMap::new();
    for lane in roads.lanes().iter().filter(permanent) {
        let Some(used) = used(lane.kind) else { continue };
        let Some(ribbon) = ribbon(lane, if used == Use::Walk { KERB } else { 0.0 }) else {
            continue;
        };
        if lane.kind == LaneType::Driving {
            lane_of.insert(lane.id.0, network.lanes.len());
            network.lanes.push(driven(&roads, lane, &ribbon));
        }
        network.strips.push(Strip { used, left: ribbon.left, right: ribbon.right });
    }
    for (&id, &lane) in &lane_of {
        let next = roads.successors(xodr::LaneId(id));
        network.lanes[lane].next = next.filter_map(|l| lane_of.get(&l.id.0).copied()).collect();
    }
    if network.lanes.is_empty() {
        return Err(WorldError::NoLane { file: file.to_owned() });
    }
    network.streets = streets(&roads);
    let pieces = roads.road_marks().iter().flat_map(|m| &m.lines).flat_map(|l| &l.pieces);
    network.marks = pieces.map(|q| q.map(|p| point(p) + DVec3::Z * super::network::MARK)).collect();
    network.posts = roads.signals().iter().take(MAX_POSTS).map(post).collect();
    Ok(network)
}

/// Refuses what a world cannot hold before it is made.
fn check(roads: &RoadNetwork, file: &str) -> Result<(), WorldError> {
    let large = |what, value: f64, most: f64| WorldError::TooLarge {
        file: file.to_owned(),
        what,
        value: value.round(),
        most,
    };
    let lanes = roads.lanes();
    let painted = roads.road_marks().iter().flat_map(|m| &m.lines).map(|l| 4 * l.pieces.len());
    let points = lanes.iter().map(|l| l.center.points().len()).chain(painted).sum::<usize>();
    if points > MAX_POINTS {
        return Err(large("points of its lanes", points as f64, MAX_POINTS as f64));
    }
    let length: f64 = roads.roads().iter().map(|r| r.length()).sum();
    if length > MAX_LENGTH {
        return Err(large("metres of its roads", length, MAX_LENGTH));
    }
    let widths = lanes.iter().flat_map(|l| l.widths.iter().chain([&l.width]));
    let width = widths.fold(0.0, |most: f64, w| most.max(f64::from(*w)));
    if width > MAX_WIDTH {
        return Err(large("metres of its widest lane", width, MAX_WIDTH));
    }
    let points = lanes.iter().flat_map(|l| l.center.points());
    let far =
        points.flat_map(|p| p.to_array()).fold(0.0, |most: f64, v| most.max(f64::from(v.abs())));
    if far > MAX_FAR {
        return Err(large("metres of its farthest coordinate from 0", far, MAX_FAR));
    }
    Ok(())
}

fn point(p: Point) -> DVec3 {
    DVec3::from(p.to_array().map(f64::from))
}

fn used(kind: LaneType) -> Option<Use> {
    Some(match kind {
        LaneType::Sidewalk => Use::Walk,
        LaneType::Median => Use::Green,
        LaneType::Rail => Use::Rail,
        LaneType::None | LaneType::Unknown => return None,
        _ => Use::Road,
    })
}

fn junction(roads: &RoadNetwork, lane: &xodr::Lane) -> bool {
    let road = roads.road_lane(lane.id).and_then(|l| roads.road(l.road));
    road.is_some_and(|road| road.junction().is_some_and(|id| id != "-1"))
}

/// Edges of a lane `raised` metres above the road; `None` where it has no width.
fn ribbon(lane: &xodr::Lane, raised: f64) -> Option<Ribbon> {
    let (points, tangents) = (lane.center.points(), lane.center.tangents());
    let last = |list: &[f32], i: usize, none: f32| {
        f64::from(list.get(i).or(list.last()).copied().unwrap_or(none))
    };
    let mut ribbon = Ribbon { left: Vec::new(), right: Vec::new() };
    let mut widest = 0.0_f64;
    for (i, (p, t)) in points.iter().zip(tangents).enumerate() {
        let [x, y, _] = t.to_array().map(f64::from);
        let (sin, cos) = maths::sin_cos(last(&lane.bank, i, 0.0));
        let half = 0.5 * last(&lane.widths, i, lane.width);
        let across = (left_of(DVec2::new(x, y).normalize_or(DVec2::X)) * cos).extend(sin) * half;
        let middle = point(*p) + DVec3::Z * raised;
        widest = widest.max(half);
        ribbon.left.push(middle + across);
        ribbon.right.push(middle - across);
    }
    let finite = ribbon.left.iter().chain(&ribbon.right).all(|p| p.is_finite());
    (widest > 0.02 && finite && ribbon.left.len() > 1).then_some(ribbon)
}

fn driven(roads: &RoadNetwork, lane: &xodr::Lane, ribbon: &Ribbon) -> Lane {
    let middle = ribbon.left.iter().zip(&ribbon.right).map(|(l, r)| (*l + *r) * 0.5);
    let centre = Line::new(middle);
    let backward = lane.direction == Direction::Backward;
    let centre = if backward { centre.reversed() } else { centre };
    let widths = ribbon.left.iter().zip(&ribbon.right).map(|(l, r)| (*l - *r).length());
    let width = widths.fold(f64::INFINITY, f64::min);
    Lane { centre, width, next: Vec::new(), junction: junction(roads, lane) }
}

/// The outermost lanes of each section of a road outside junctions.
fn streets(roads: &RoadNetwork) -> Vec<Street> {
    let mut sections: BTreeMap<(usize, usize), Vec<(i32, &xodr::Lane)>> = BTreeMap::new();
    for lane in roads.lanes().iter().filter(|l| l.layer == Layer::Permanent) {
        if used(lane.kind).is_none() || junction(roads, lane) || lane.width < 0.02 {
            continue;
        }
        if let Some(at) = roads.road_lane(lane.id) {
            sections.entry((at.road.0, at.section)).or_default().push((at.od_id, lane));
        }
    }
    sections.into_values().filter_map(|lanes| street(roads, &lanes)).collect()
}

fn street(roads: &RoadNetwork, lanes: &[(i32, &xodr::Lane)]) -> Option<Street> {
    let left = lanes.iter().max_by_key(|(id, _)| *id)?;
    let right = lanes.iter().min_by_key(|(id, _)| *id)?;
    let walk = |(_, lane): &(i32, &xodr::Lane)| {
        if lane.kind == LaneType::Sidewalk { f64::from(lane.width) } else { 0.0 }
    };
    let parking = |side: i32| {
        let here = lanes.iter().filter(|(id, l)| id * side > 0 && l.kind == LaneType::Parking);
        here.map(|(_, l)| f64::from(l.width)).fold(0.0, f64::max)
    };
    let edges = [Line::new(ribbon(left.1, 0.0)?.left), Line::new(ribbon(right.1, 0.0)?.right)];
    let leads = |backward: bool| {
        let driving = lanes.iter().filter(|(_, l)| l.kind == LaneType::Driving);
        let mut same = driving.filter(|(_, l)| (l.direction == Direction::Backward) == backward);
        same.any(|(_, l)| roads.successors(l.id).any(|next| junction(roads, next)))
    };
    Some(Street {
        edges,
        walks: [walk(left), walk(right)],
        parking: [parking(1), parking(-1)],
        meets: [leads(true), leads(false)],
    })
}

fn post(signal: &xodr::Signal) -> Post {
    let foot = signal.applies_at.first().copied().unwrap_or(signal.position);
    let foot =
        DVec3::new(f64::from(signal.position.x), f64::from(signal.position.y), f64::from(foot.z));
    let faces = DVec2::from_angle(f64::from(signal.heading));
    Post { foot, faces, light: signal.dynamic || signal.kind == "1000001" }
}
