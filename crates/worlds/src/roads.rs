//! A plan of roads (nodes and curves between them) made into a network: lanes, walks, junctions, paint.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::network::{
    KERB, Lane, Line, MARK, Network, Street, Strip, StripUse, curve, even_kerb, left_of,
};

/// Cross section of a road, the same to both sides, in metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CrossSection {
    /// Lanes in each direction.
    pub lanes: usize,
    pub lane_width: f64,
    pub median: f64,
    /// Strip for parked vehicles between lanes and kerb.
    pub parking: f64,
    /// Paved strip without a lane.
    pub shoulder: f64,
    pub walk: f64,
}

impl CrossSection {
    fn kerb(&self) -> f64 {
        let lanes = self.lanes as f64 * self.lane_width;
        0.5 * self.median + lanes + self.shoulder + self.parking
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Road {
    pub from: usize,
    pub to: usize,
    pub line: Line,
    pub profile: CrossSection,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct RoadPlan {
    pub nodes: Vec<DVec2>,
    pub roads: Vec<Road>,
}

/// The end of a road at a junction.
struct Arm {
    /// Away from the junction.
    away: DVec2,
    end: DVec3,
    profile: CrossSection,
    /// Lanes into and out of the junction, the innermost first.
    into: Vec<usize>,
    out: Vec<usize>,
}

impl Arm {
    /// The point `to_left` metres to the left of the end, as seen from the junction.
    fn beside(&self, to_left: f64) -> DVec3 {
        self.end + (left_of(self.away) * to_left).extend(0.0)
    }
}

impl RoadPlan {
    pub(crate) fn node(&mut self, at: DVec2) -> usize {
        self.nodes.push(at);
        self.nodes.len() - 1
    }

    pub(crate) fn road(&mut self, from: usize, to: usize, line: Line, profile: CrossSection) {
        self.roads.push(Road { from, to, line, profile });
    }

    /// The network of the plan, on level ground at z = 0.
    pub(crate) fn network(&self) -> Network {
        let mut network = Network::default();
        let mut arms: Vec<Vec<Arm>> = self.nodes.iter().map(|_| Vec::new()).collect();
        for road in &self.roads {
            let [start, end] = [self.radius(road.from), self.radius(road.to)];
            let whole = road.line.length();
            let line = road.line.part(start.unwrap_or(0.0), whole - end.unwrap_or(0.0));
            let [forward, backward] = carriageway(&mut network, &line, &road.profile);
            walks(&mut network, &line, &road.profile, [start.is_some(), end.is_some()]);
            let length = line.length();
            let ends = [
                (road.from, line.heading(0.5), 0.0, [backward.clone(), forward.clone()]),
                (road.to, -line.heading(length - 0.5), length, [forward, backward]),
            ];
            for (node, away, s, [into, out]) in ends {
                arms[node].push(Arm { away, end: line.at(s), profile: road.profile, into, out });
            }
        }
        for (node, mut arms) in arms.into_iter().enumerate() {
            if self.radius(node).is_some() {
                arms.sort_by(|a, b| a.away.to_angle().total_cmp(&b.away.to_angle()));
                junction(&mut network, self.nodes[node], &arms);
            }
        }
        network
    }

    /// Metres from a node to the ends of its roads; `None` where roads do not meet.
    fn radius(&self, node: usize) -> Option<f64> {
        let here = self.roads.iter().flat_map(|r| {
            let ends = [r.from, r.to].into_iter().filter(|n| *n == node);
            ends.map(|_| r.profile.kerb() + r.profile.walk)
        });
        let widths: Vec<f64> = here.collect();
        (widths.len() > 1).then(|| 1.2 * widths.iter().copied().fold(0.0, f64::max) + 4.0)
    }
}

/// Lanes of a road, forward and backward, the innermost first, with all that is paved.
fn carriageway(network: &mut Network, line: &Line, profile: &CrossSection) -> [Vec<usize>; 2] {
    let strip = |used, a: f64, b: f64| {
        let (left, right) = (line.offset(a), line.offset(b));
        Strip { used, left, right, raised: Vec::new() }
    };
    let mut lanes = [Vec::new(), Vec::new()];
    let middle = 0.5 * profile.median;
    if middle > 0.0 {
        network.strips.push(strip(StripUse::Green, middle, -middle));
    }
    for (lanes, side) in lanes.iter_mut().zip([-1.0, 1.0]) {
        for i in 0..profile.lanes {
            let inner = middle + i as f64 * profile.lane_width;
            let outer = inner + profile.lane_width;
            network.strips.push(strip(StripUse::Road, side * inner, side * outer));
            let centre = Line::new(line.offset(side * 0.5 * (inner + outer)));
            let centre = if side < 0.0 { centre } else { centre.reversed() };
            lanes.push(network.lanes.len());
            let (width, next) = (profile.lane_width, Vec::new());
            network.lanes.push(Lane { centre, width, next, junction: false, left_hand: false });
            let edge = Line::new(line.offset(side * (outer - 0.1)));
            let last = i + 1 == profile.lanes;
            network.paint(&edge, 0.13, if last { 0.0 } else { 3.0 });
        }
        if middle > 0.0 {
            network.paint(&Line::new(line.offset(side * (middle + 0.1))), 0.13, 0.0);
        }
        let lanes_end = middle + profile.lanes as f64 * profile.lane_width;
        if profile.kerb() > lanes_end {
            network.strips.push(strip(StripUse::Road, side * lanes_end, side * profile.kerb()));
        }
    }
    if middle == 0.0 {
        network.paint(line, 0.13, if profile.lanes > 1 { 0.0 } else { 3.0 });
    }
    lanes
}

/// Side walks of a road, its edges, and the stripes where one crosses it.
fn walks(network: &mut Network, line: &Line, profile: &CrossSection, meets: [bool; 2]) {
    let (kerb, edge) = (profile.kerb(), profile.kerb() + profile.walk);
    if profile.walk > 0.0 {
        for side in [-1.0, 1.0] {
            walk(network, [side * kerb, side * edge].map(|offset| line.offset(offset)));
        }
        for (meets, at) in meets.into_iter().zip([2.5, line.length() - 2.5]) {
            if meets && line.length() > 20.0 {
                zebra(network, line, at, kerb);
            }
        }
    }
    let edges = [Line::new(line.offset(edge)), Line::new(line.offset(-edge))];
    let (walks, parking) = ([profile.walk; 2], [profile.parking; 2]);
    let kerbs = [even_kerb(KERB), even_kerb(KERB)];
    network.streets.push(Street { edges, walks, parking, meets, kerbs, left_hand: false });
}

/// A side walk a kerb above two lines.
fn walk(network: &mut Network, edges: [Vec<DVec3>; 2]) {
    let up = |line: Vec<DVec3>| line.into_iter().map(|p| p + DVec3::Z * KERB).collect();
    let [left, right]: [Vec<DVec3>; 2] = edges.map(up);
    let raised = vec![[KERB; 2]; left.len()];
    network.strips.push(Strip { used: StripUse::Walk, left, right, raised });
}

fn zebra(network: &mut Network, line: &Line, at: f64, kerb: f64) {
    let (middle, ahead) = (line.at(at) + DVec3::Z * MARK, line.heading(at));
    let [along, left] = [(ahead * 1.5).extend(0.0), left_of(ahead).extend(0.0)];
    let stripes = (2.0 * kerb - 0.6) as usize;
    for i in 0..stripes {
        let from = left * (0.3 - kerb + i as f64);
        let to = from + left * 0.5;
        let quad = [from - along, from + along, to + along, to - along];
        network.marks.push(quad.map(|p| middle + p));
    }
}

/// Paves a junction, leads a walk round each corner, and joins lanes.
fn junction(network: &mut Network, node: DVec2, arms: &[Arm]) {
    let middle = node.extend(0.0);
    let mut border: Vec<DVec3> = Vec::new();
    for (i, arm) in arms.iter().enumerate() {
        let next = &arms[(i + 1) % arms.len()];
        let [here, there] = [arm.profile, next.profile];
        let bend = |a: f64, b: f64| {
            let line = curve(arm.beside(a), -arm.away, next.beside(-b), next.away, 1.0);
            let length = line.length();
            (0..=12).map(|k| line.at(length * f64::from(k) / 12.0)).collect::<Vec<_>>()
        };
        let kerb = bend(here.kerb(), there.kerb());
        border.push(arm.beside(-here.kerb()));
        if here.walk > 0.0 && there.walk > 0.0 {
            let outer = bend(here.kerb() + here.walk, there.kerb() + there.walk);
            walk(network, [kerb.clone(), outer]);
        }
        border.extend(kerb);
    }
    border.extend(border.first().copied());
    let right = vec![middle; border.len()];
    network.strips.push(Strip { used: StripUse::Road, left: border, right, raised: Vec::new() });
    for (i, from) in arms.iter().enumerate() {
        for (j, to) in arms.iter().enumerate() {
            if i != j {
                turn(network, from, to);
            }
        }
    }
}

/// Lanes across a junction from one arm to another: turns to the left from the inner lane, to the
/// right from the outer one.
fn turn(network: &mut Network, from: &Arm, to: &Arm) {
    let angle = (to.away.to_angle() - (-from.away).to_angle() + PI).rem_euclid(TAU) - PI;
    let last = from.into.len().saturating_sub(1);
    for (i, &into) in from.into.iter().enumerate() {
        let (j, most) = (i.min(to.out.len().saturating_sub(1)), to.out.len());
        let wanted = (angle <= 0.6 || i == 0) && (angle >= -0.6 || i == last);
        if !wanted || most == 0 {
            continue;
        }
        let out = to.out[if angle < -0.6 { most - 1 } else { j }];
        let [a, b] = [&network.lanes[into], &network.lanes[out]];
        let (start, end) = (a.centre.at(a.centre.length()), b.centre.at(0.0));
        let (width, centre) = (a.width, curve(start, -from.away, end, to.away, 1.0));
        let lane = network.lanes.len();
        network.lanes[into].next.push(lane);
        let next = vec![out];
        network.lanes.push(Lane { centre, width, next, junction: true, left_hand: false });
    }
}
