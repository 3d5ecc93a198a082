//! A network of roads from OpenDRIVE.
//!
//! The crate `xodr` evaluates reference lines, widths, elevations, superelevations and links in `f64`
//! and hands them over as lanes of `f32` points; here they become strips and lanes.

mod attributes;
mod curves;
mod document;
mod doubts;
mod objects;
mod stations;
mod values;
mod widths;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};
use xodr::{Direction, LaneHeight, LaneType, Layer, Provenance, RoadNetwork, RoadPosition};

use crate::network::{KERB, Lane, Line, Network, Plate, Post, Street, Strip, StripUse, left_of};
use crate::world::WorldError;
use document::RoadFacts;
use lidar_cast::maths;
use objects::{MAX_FAR, point};
use sightline_files::Note;
use sightline_files::json::is_utf_16;
use stations::Profile;

/// Largest file in bytes.
pub(crate) const MAX_FILE: u64 = 128 << 20;
/// Most points of lanes and paint.
const MAX_POINTS: usize = 8_000_000;
/// Limits of a town with trees and houses along all roads: metres of road, metres of lane width.
const MAX_LENGTH: f64 = 60_000.0;
const MAX_WIDTH: f64 = 60.0;
/// Most signs and lights that are taken over.
const MAX_POSTS: usize = 20_000;

/// Metres between the middles of a section's outermost lanes from which on they give the way across the road.
const LEAST_APART: f64 = 0.5;
/// Least cosine between the left of a lane and of its road's reference line by which the line is taken to be the lane's.
const LEAST_TOWARDS_LEFT: f64 = 0.2;
/// Height in metres between a road's surface and the chord across a lane, above which it is told.
const GAP_ACROSS: f64 = 0.01;

/// Edges of a lane in the direction of its road, left and right.
struct Ribbon {
    left: Vec<DVec3>,
    right: Vec<DVec3>,
    raised: Vec<[f64; 2]>,
}

impl Ribbon {
    /// The strip between the edges; its sides show where it stands higher than the road.
    fn strip(self, used: StripUse) -> Strip {
        let level = used != StripUse::Walk && self.raised.iter().flatten().all(|up| *up == 0.0);
        let raised = if level { Vec::new() } else { self.raised };
        Strip { used, left: self.left, right: self.right, raised }
    }
}

/// Reads an OpenDRIVE file as text.
///
/// # Errors
/// A file that cannot be read, is compressed, or is too large.
pub fn read_opendrive(path: &Path) -> Result<String, WorldError> {
    let file = path.display().to_string();
    let failed = |source| WorldError::File { file: file.clone(), source };
    let bytes = match sightline_files::files::read(path, MAX_FILE) {
        Err(error) if error.kind() == std::io::ErrorKind::FileTooLarge => {
            let (most, mend) = (MAX_FILE >> 20, "cut a region out of the map");
            return Err(WorldError::Refused(format!("{file}: is larger than {most} MiB; {mend}")));
        }
        bytes => bytes.map_err(failed)?,
    };
    if bytes.starts_with(&[0x1f, 0x8b]) {
        return Err(WorldError::Refused(format!(
            "{file}: is compressed; unpack it first: gunzip --keep {file}"
        )));
    }
    let invalid = |problem| failed(std::io::Error::new(std::io::ErrorKind::InvalidData, problem));
    if is_utf_16(&bytes) {
        return Err(invalid("is UTF-16 text; save it as UTF-8"));
    }
    let not_utf_8 = "is not UTF-8 text, such as Latin-1; save it as UTF-8";
    String::from_utf8(bytes).map_err(|_| invalid(not_utf_8))
}

/// Reads an OpenDRIVE document; `file` names it in errors.
///
/// # Errors
/// XML that does not parse, no road with a lane, no lane to drive in, more than a world can hold.
pub(crate) fn network(text: &str, file: &str) -> Result<Network, WorldError> {
    let document = document::checked(text, file)?;
    let text = document.text.as_deref().unwrap_or(text);
    let (roads, origins) = loaded(text, file)?;
    let permanent = |l: &&xodr::Lane| l.layer == Layer::Permanent;
    check(&roads, file)?;
    let mut network = Network { notes: document.notes.clone(), ..Network::default() };
    network.notes.extend(doubts::notes(&origins.warnings, file)?);
    let map = Map::new(&roads, &origins, &document);
    network.notes.extend(map.lanes_left_out(file));
    network.notes.extend(map.bent_across(file));
    let mut lane_of: BTreeMap<usize, usize> = BTreeMap::new();
    for lane in roads.lanes().iter().filter(permanent) {
        let Some(used) = used(lane.kind) else { continue };
        let Some(ribbon) = map.ribbon(lane) else { continue };
        if lane.kind == LaneType::Driving {
            lane_of.insert(lane.id.0, network.lanes.len());
            network.lanes.push(map.driven(lane, &ribbon));
        }
        network.strips.push(ribbon.strip(used));
    }
    for (&id, &lane) in &lane_of {
        let next = roads.successors(xodr::LaneId(id));
        network.lanes[lane].next = next.filter_map(|l| lane_of.get(&l.id.0).copied()).collect();
    }
    if network.lanes.is_empty() {
        return Err(WorldError::Refused(format!(
            "{file}: has no lane of the type `driving`; the ego vehicle needs one to drive on"
        )));
    }
    network.streets = map.streets();
    let pieces = roads.road_marks().iter().flat_map(|m| &m.lines).flat_map(|l| &l.pieces);
    network.marks = pieces.map(|q| q.map(|p| point(p) + DVec3::Z * super::network::MARK)).collect();
    network.posts = roads.signals().iter().map(post).collect();
    let posts = network.posts.len();
    if posts > MAX_POSTS {
        return Err(WorldError::too_large(file, "signals", posts as f64, MAX_POSTS as f64));
    }
    objects::add(&roads, &origins, &document, &mut network, file)?;
    Ok(network)
}

/// A road of one lane, which the library can read.
const PLAIN_ROAD: &str = "<road id='sightline' length='1' junction='-1'><planView><geometry s='0' x='0' y='0' hdg='0' \
    length='1'><line/></geometry></planView><lanes><laneSection s='0'><center><lane id='0' type='none'/></center><right>\
    <lane id='-1' type='driving'><width sOffset='0' a='3' b='0' c='0' d='0'/></lane></right></laneSection></lanes></road>";

/// The network of a document.
///
/// # Errors
/// A document without lanes, with the reason why the library skips its roads: it says so beside a road that it reads.
fn loaded(text: &str, file: &str) -> Result<(RoadNetwork, Provenance), WorldError> {
    xodr::load_str_with_provenance(text).map_err(|source| {
        let end = text.rsplit_once("</OpenDRIVE>");
        let beside = end.map(|(head, _)| format!("{head}{PLAIN_ROAD}</OpenDRIVE>"));
        let again = beside.and_then(|text| xodr::load_str_with_provenance(&text).ok());
        let told = again.and_then(|(_, origins)| doubts::notes(&origins.warnings, file).err());
        told.unwrap_or_else(|| WorldError::OpenDrive {
            file: file.to_owned(),
            source: Box::new(source),
        })
    })
}

/// Refuses documents too large for a world, before it is made.
fn check(roads: &RoadNetwork, file: &str) -> Result<(), WorldError> {
    let large =
        |what, value: f64, most: f64| WorldError::too_large(file, what, value.round(), most);
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

fn used(kind: LaneType) -> Option<StripUse> {
    Some(match kind {
        LaneType::Sidewalk => StripUse::Walk,
        LaneType::Median => StripUse::Green,
        LaneType::Rail => StripUse::Rail,
        LaneType::None | LaneType::Unknown => return None,
        _ => StripUse::Road,
    })
}

/// Lanes with their numbers in the file, by road and section.
fn by_section<'a>(
    roads: &RoadNetwork,
    lanes: impl Iterator<Item = &'a xodr::Lane>,
) -> BTreeMap<(usize, usize), Vec<(i32, &'a xodr::Lane)>> {
    let mut sections: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for lane in lanes {
        if let Some(at) = roads.road_lane(lane.id) {
            sections.entry((at.road.0, at.section)).or_default().push((at.od_id, lane));
        }
    }
    sections
}

/// The map of a document: its lanes, their origins, and the document's facts beside geometry.
struct Map<'a> {
    roads: &'a RoadNetwork,
    document: &'a RoadFacts,
    origins: BTreeMap<usize, &'a xodr::LaneProvenance>,
    /// The outermost lanes of each road's sections, right and left.
    outermost: BTreeMap<(usize, usize), [&'a xodr::Lane; 2]>,
}

impl<'a> Map<'a> {
    fn new(roads: &'a RoadNetwork, origins: &'a Provenance, document: &'a RoadFacts) -> Self {
        let origins = origins.lanes.iter().map(|origin| (origin.lane.0, origin)).collect();
        let ends = |(section, mut lanes): (_, Vec<(i32, &'a xodr::Lane)>)| {
            lanes.sort_by_key(|(id, _)| *id);
            Some((section, [lanes.first()?.1, lanes.last()?.1]))
        };
        let outermost = by_section(roads, roads.lanes().iter()).into_iter().filter_map(ends);
        Self { roads, document, origins, outermost: outermost.collect() }
    }

    /// A note of lanes whose type nobody knows.
    fn lanes_left_out(&self, file: &str) -> Option<Note> {
        let unknown = self.roads.lanes().iter().filter(|l| l.kind == LaneType::Unknown);
        let mut places = unknown.filter_map(|lane| self.origins.get(&lane.id.0));
        let first = places.next()?;
        Some(Note::fact(format!(
            "{file}: {} lanes are of an unknown type and left out, first lane {} of road {}; give a type of OpenDRIVE",
            1 + places.count(),
            first.od_id,
            first.road_id
        )))
    }

    fn junction(&self, lane: &xodr::Lane) -> bool {
        let road = self.roads.road_lane(lane.id).and_then(|l| self.roads.road(l.road));
        road.is_some_and(|road| road.junction().is_some_and(|id| id != "-1"))
    }

    fn left_hand(&self, lane: &xodr::Lane) -> bool {
        let road = self.origins.get(&lane.id.0);
        road.is_some_and(|origin| self.document.left_hand.contains(&origin.road_id))
    }

    /// Metres of a lane above its road, left and right at each point: the file's word, or our kerb for a walk.
    fn raised(&self, lane: &xodr::Lane) -> Vec<[f64; 2]> {
        let origin = self.origins.get(&lane.id.0);
        let stated = origin
            .filter(|o| self.document.raised.contains(&(o.road_id.clone(), o.section, o.od_id)));
        let count = lane.center.points().len();
        let Some(origin) = stated else {
            let walk = lane.kind == LaneType::Sidewalk;
            return if walk { vec![[KERB; 2]; count] } else { Vec::new() };
        };
        let sides = |high: &LaneHeight| match origin.od_id > 0 {
            true => [high.outer, high.inner].map(f64::from),
            false => [high.inner, high.outer].map(f64::from),
        };
        let mut raised: Vec<[f64; 2]> = origin.heights.iter().map(sides).collect();
        raised.resize(count, raised.last().copied().unwrap_or_default());
        raised
    }

    /// Unit vector to the left in plan at a lane's point `i`, square to the road's reference line: widths of lanes are measured
    /// along it, also where a lane that tapers turns away from the line. Points of one index of a section's lanes lie on it.
    fn across(&self, lane: &xodr::Lane, i: usize, tangent: DVec2) -> DVec2 {
        let own = left_of(tangent.normalize_or(DVec2::X));
        let Some(at) = self.roads.road_lane(lane.id) else { return own };
        let ends = self.outermost.get(&(at.road.0, at.section));
        let apart = ends.and_then(|[right, left]| {
            let [right, left] = [right, left].map(|l| l.center.points().get(i).copied().map(point));
            left.zip(right).map(|(left, right)| (left - right).truncate())
        });
        let square = match apart.filter(|apart| apart.length() > LEAST_APART) {
            Some(apart) => Some(apart),
            None => self.across_road(at.road, lane.center.points()[i]),
        };
        let square = square.and_then(DVec2::try_normalize);
        square.filter(|square| square.dot(own) > LEAST_TOWARDS_LEFT).unwrap_or(own)
    }

    /// The way to the left across a road where its reference line is nearest to `p`.
    fn across_road(&self, road: xodr::RoadId, p: xodr::Point) -> Option<DVec2> {
        let at = self.roads.road_position_on(road, p)?;
        let [left, right] = [1.0, -1.0].map(|metres| {
            self.roads.road_point(RoadPosition { t: at.t + metres, ..at }).map(point)
        });
        Some((left? - right?).truncate())
    }

    /// Doubts about surfaces that bend inside a lane: the lane with the largest height between surface and chord, and a road
    /// whose surface is not measured.
    fn bent_across(&self, file: &str) -> Vec<Note> {
        let lanes = self.roads.lanes().iter().filter(|lane| used(lane.kind).is_some());
        let of = |lane: &xodr::Lane| {
            let origin = self.origins.get(&lane.id.0)?;
            let profile = self.document.profiles.get(&origin.road_id)?;
            Some((self.gap_across(lane, profile), origin.od_id, &origin.road_id))
        };
        let most = lanes.filter_map(of).max_by(|a, b| a.0.total_cmp(&b.0));
        let bent = most.filter(|(gap, _, _)| *gap > GAP_ACROSS).map(|(gap, lane, road)| {
            format!("<shape> of road {road} bends its surface inside lane {lane} by {gap:.2} m, the most of all lanes")
        });
        let section = self.document.profiles.iter().find(|(_, profile)| profile.section);
        let unknown = section.map(|(road, _)| {
            format!("<crossSectionSurface> of road {road} may bend its surface inside a lane")
        });
        let told = |what| {
            Note::doubt(format!(
                "{file}: {what}, and lanes are flat between their edges; split lanes where the surface bends"
            ))
        };
        bent.into_iter().chain(unknown).map(told).collect()
    }

    /// Largest height in metres between a road's surface inside a lane and the chord between the lane's edges.
    fn gap_across(&self, lane: &xodr::Lane, profile: &Profile) -> f64 {
        let Some(road) = self.roads.road_lane(lane.id).map(|at| at.road) else { return 0.0 };
        let gap = |(i, p): (usize, &xodr::Point)| {
            let half = 0.5 * f64::from(*lane.widths.get(i).unwrap_or(&lane.width));
            let at = self.roads.road_position_on(road, *p)?;
            Some(profile.gap(at.s, [at.t - half, at.t + half]))
        };
        lane.center.points().iter().enumerate().filter_map(gap).fold(0.0, f64::max)
    }

    /// Edges of a lane; `None` where it has no width.
    fn ribbon(&self, lane: &xodr::Lane) -> Option<Ribbon> {
        let stated = |origin: &&xodr::LaneProvenance| !origin.heights.is_empty();
        // Points of the library stand at the heights of the file already.
        let lifted = self.origins.get(&lane.id.0).is_some_and(stated);
        let raised = self.raised(lane);
        let kerb = if lifted { 0.0 } else { raised.first().map_or(0.0, |r| 0.5 * (r[0] + r[1])) };
        let (points, tangents) = (lane.center.points(), lane.center.tangents());
        let last = |list: &[f32], i: usize, none: f32| {
            f64::from(list.get(i).or(list.last()).copied().unwrap_or(none))
        };
        let mut ribbon = Ribbon { left: Vec::new(), right: Vec::new(), raised };
        let mut widest = 0.0_f64;
        for (i, (p, t)) in points.iter().zip(tangents).enumerate() {
            let [x, y, _] = t.to_array().map(f64::from);
            let (sin, cos) = maths::sin_cos(last(&lane.bank, i, 0.0));
            let half = 0.5 * last(&lane.widths, i, lane.width);
            let across = (self.across(lane, i, DVec2::new(x, y)) * cos).extend(sin) * half;
            let middle = point(*p) + DVec3::Z * kerb;
            widest = widest.max(half);
            ribbon.left.push(middle + across);
            ribbon.right.push(middle - across);
        }
        let finite = ribbon.left.iter().chain(&ribbon.right).all(|p| p.is_finite());
        (widest > 0.02 && finite && ribbon.left.len() > 1).then_some(ribbon)
    }

    fn driven(&self, lane: &xodr::Lane, ribbon: &Ribbon) -> Lane {
        let middle = ribbon.left.iter().zip(&ribbon.right).map(|(l, r)| (*l + *r) * 0.5);
        let centre = Line::new(middle);
        let backward = lane.direction == Direction::Backward;
        let centre = if backward { centre.reversed() } else { centre };
        let widths = ribbon.left.iter().zip(&ribbon.right).map(|(l, r)| (*l - *r).length());
        let width = widths.fold(f64::INFINITY, f64::min);
        let (junction, left_hand) = (self.junction(lane), self.left_hand(lane));
        Lane { centre, width, next: Vec::new(), junction, left_hand }
    }

    /// The outermost lanes of each section of a road outside junctions.
    fn streets(&self) -> Vec<Street> {
        let is_part = |lane: &&xodr::Lane| {
            let is_there = lane.layer == Layer::Permanent && lane.width >= 0.02;
            is_there && used(lane.kind).is_some() && !self.junction(lane)
        };
        let sections = by_section(self.roads, self.roads.lanes().iter().filter(is_part));
        sections.into_values().filter_map(|lanes| self.street(&lanes)).collect()
    }

    fn street(&self, lanes: &[(i32, &xodr::Lane)]) -> Option<Street> {
        let left = lanes.iter().max_by_key(|(id, _)| *id)?;
        let right = lanes.iter().min_by_key(|(id, _)| *id)?;
        let walk = |(_, lane): &(i32, &xodr::Lane)| {
            if lane.kind == LaneType::Sidewalk { f64::from(lane.width) } else { 0.0 }
        };
        let parking = |side: i32| {
            let here = lanes.iter().filter(|(id, l)| id * side > 0 && l.kind == LaneType::Parking);
            here.map(|(_, l)| f64::from(l.width)).fold(0.0, f64::max)
        };
        let edges = [(left, 0), (right, 1)].map(|((_, lane), side)| self.edge(lane, side));
        let [(left_edge, left_kerb), (right_edge, right_kerb)] = match edges {
            [Some(left), Some(right)] => [left, right],
            _ => return None,
        };
        let leads = |backward: bool| {
            let driving = lanes.iter().filter(|(_, l)| l.kind == LaneType::Driving);
            let mut same =
                driving.filter(|(_, l)| (l.direction == Direction::Backward) == backward);
            same.any(|(_, l)| self.roads.successors(l.id).any(|next| self.junction(next)))
        };
        Some(Street {
            edges: [left_edge, right_edge],
            walks: [walk(left), walk(right)],
            parking: [parking(1), parking(-1)],
            meets: [leads(true), leads(false)],
            kerbs: [left_kerb, right_kerb],
            left_hand: self.left_hand(left.1),
        })
    }

    /// The outer edge of a lane at the height of its road, and the height of the lane above it.
    fn edge(&self, lane: &xodr::Lane, side: usize) -> Option<(Line, Line)> {
        let ribbon = self.ribbon(lane)?;
        let points = if side == 0 { &ribbon.left } else { &ribbon.right };
        let high = |i: usize| ribbon.raised.get(i).copied().unwrap_or_default();
        let level = points.iter().enumerate().map(|(i, p)| *p - DVec3::Z * high(i)[side]);
        let edge = Line::new(level);
        // Points without a step between them are one point of the edge.
        let mut along = 0.0;
        let kerbs = points.iter().enumerate().map(|(i, p)| {
            along += if i > 0 { (*p - points[i - 1]).truncate().length() } else { 0.0 };
            DVec3::new(along, 0.0, 0.5 * (high(i)[0] + high(i)[1]))
        });
        Some((edge, Line::new(kerbs)))
    }
}

/// A signal as a post with a plate.
fn post(signal: &xodr::Signal) -> Post {
    /// A plate whose lower edge is lower stands on the ground: the map means its foot.
    const LOWEST: f64 = 0.3;
    let ground = signal.applies_at.first().copied().unwrap_or(signal.position);
    let [x, y, low] = signal.position.to_array().map(f64::from);
    let foot = DVec3::new(x, y, f64::from(ground.z));
    let faces = DVec2::from_angle(f64::from(signal.heading));
    let size = [signal.width, signal.height].map(|size| size.map_or(0.0, f64::from));
    let plate = (size[0] > 0.0 && size[1] > 0.0 && low > foot.z + LOWEST).then_some(Plate {
        low,
        width: size[0],
        height: size[1],
    });
    Post { foot, faces, light: signal.dynamic || signal.kind == "1000001", plate }
}
