//! Kinds of generated worlds, and how each is furnished.

use glam::DVec2;
use lidar_cast::maths;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::network::{Line, curve, left_of};
use crate::roads::{CrossSection, RoadPlan};

/// Kind of a generated world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WorldKind {
    /// A street through a town, with side streets.
    Street,
    /// A motorway between barriers, under a bridge.
    Highway,
    /// Narrow streets between houses with gardens.
    Residential,
    /// Halls, containers and lorries behind a fence.
    Yard,
    /// Blocks of houses on a grid of streets with much traffic.
    Town,
}

impl WorldKind {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Street, Self::Highway, Self::Residential, Self::Yard, Self::Town];

    /// Name as written on the command line.
    pub fn name(self) -> &'static str {
        ["street", "highway", "residential", "yard", "town"][self as usize]
    }

    /// Each row has a number for each kind, in the order of [`Self::ALL`].
    pub(crate) fn style(self) -> Style {
        let kind = self as usize;
        let house = House {
            width: [[8.0, 20.0], [18.0, 40.0], [8.0, 13.0], [20.0, 45.0], [10.0, 24.0]][kind],
            depth: [[8.0, 15.0], [12.0, 25.0], [7.0, 11.0], [15.0, 30.0], [9.0, 16.0]][kind],
            storeys: [[1, 5], [1, 4], [1, 2], [2, 3], [2, 7]][kind],
            setback: [[0.5, 6.0], [18.0, 35.0], [4.0, 8.0], [5.0, 11.0], [0.2, 2.5]][kind],
            gap: [[0.0, 9.0], [15.0, 60.0], [4.0, 12.0], [6.0, 22.0], [0.0, 5.0]][kind],
            pitched: [0.5, 0.2, 0.9, 0.35, 0.3][kind],
            built: [0.88, 0.4, 0.95, 0.75, 0.93][kind],
        };
        Style {
            house,
            trees: [16.0, 18.0, 20.0, 60.0, 14.0][kind],
            lamps: [28.0, 50.0, 35.0, 40.0, 28.0][kind],
            hedges: [0.2, 0.0, 0.45, 0.0, 0.05][kind],
            fences: [0.15, 0.0, 0.35, 0.3, 0.05][kind],
            parked: [0.6, 0.0, 0.4, 0.5, 0.7][kind],
            heavy: [0.15, 0.3, 0.08, 0.7, 0.15][kind],
            vehicles: [20, 40, 9, 8, 26][kind],
            bicycles: [4, 0, 3, 1, 5][kind],
            pedestrians: [14, 0, 9, 8, 24][kind],
            speed: [[9.0, 14.0], [22.0, 33.0], [6.0, 9.0], [3.5, 6.0], [7.0, 12.0]][kind],
            goods: [false, false, false, true, false][kind],
        }
    }
}

/// Numbers by which a network is furnished; lengths in metres, shares from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Style {
    pub house: House,
    /// Metres between trees, and between lamps, along a kerb; 0 for none.
    pub trees: f64,
    pub lamps: f64,
    /// Share of plots with a hedge, and with a fence, in front.
    pub hedges: f64,
    pub fences: f64,
    /// Share of parking places taken.
    pub parked: f64,
    /// Share of lorries and buses in the traffic.
    pub heavy: f64,
    pub vehicles: usize,
    pub bicycles: usize,
    pub pedestrians: usize,
    /// Metres a second on a straight road, least and most.
    pub speed: [f64; 2],
    pub goods: bool,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct House {
    pub width: [f64; 2],
    pub depth: [f64; 2],
    pub storeys: [u32; 2],
    /// Metres behind the walk.
    pub setback: [f64; 2],
    pub gap: [f64; 2],
    /// Share with a pitched roof.
    pub pitched: f64,
    /// Share of plots that are built on.
    pub built: f64,
}

/// Metres between the points of a generated line.
const STEP: f64 = 2.0;

const STREET_SECTION: CrossSection =
    CrossSection { lanes: 1, lane_width: 3.4, median: 0.0, parking: 2.3, shoulder: 0.0, walk: 3.0 };

/// A plan of a kind by lot.
pub(crate) fn plan(kind: WorldKind, rng: &mut ChaCha8Rng) -> RoadPlan {
    let plans: [fn(&mut ChaCha8Rng) -> RoadPlan; 5] = [street, highway, residential, yard, town];
    plans[kind as usize](rng)
}

/// Relief of the ground of a kind: metres up and metres from hill to hill.
pub(crate) fn relief(kind: WorldKind, rng: &mut ChaCha8Rng) -> impl Fn(f64, f64) -> f64 + use<> {
    let most = match kind {
        WorldKind::Yard => 0.0,
        WorldKind::Highway => 2.5,
        _ => 1.5,
    };
    let waves: [[f64; 4]; 2] = [0; 2].map(|_| {
        let turn = rng.random_range(0.0..std::f64::consts::TAU);
        let length = rng.random_range(180.0..420.0);
        [
            maths::cos(turn) / length,
            maths::sin(turn) / length,
            turn,
            rng.random_range(0.0..0.5) * most,
        ]
    });
    move |x, y| {
        let wave = |[u, v, phase, high]: &[f64; 4]| {
            high * maths::sin(std::f64::consts::TAU * (u * x + v * y) + phase)
        };
        waves.iter().map(wave).sum()
    }
}

/// A smooth line through points, one piece from each to the next.
fn smooth(points: &[DVec2]) -> Vec<Line> {
    let last = points.len() - 1;
    let along =
        |i: usize| (points[(i + 1).min(last)] - points[i.saturating_sub(1)]).normalize_or(DVec2::X);
    let piece = |i: usize| {
        let [a, b] = [points[i], points[i + 1]].map(|p| p.extend(0.0));
        curve(a, along(i), b, along(i + 1), STEP)
    };
    (0..last).map(piece).collect()
}

/// A winding line about the x axis from −`half` to `half`, `sway` metres to both sides.
fn winding(half: f64, pieces: u32, sway: f64, rng: &mut ChaCha8Rng) -> Line {
    let point = |k: u32, rng: &mut ChaCha8Rng| {
        let x = half * (2.0 * f64::from(k) / f64::from(pieces) - 1.0);
        DVec2::new(x, rng.random_range(-sway..sway))
    };
    let points: Vec<DVec2> = (0..=pieces).map(|k| point(k, rng)).collect();
    let mut line = Line::default();
    smooth(&points).iter().for_each(|piece| line.extend(piece));
    line
}

/// Cuts a line at crossings and adds the pieces and the nodes at the cuts.
fn cut(plan: &mut RoadPlan, line: &Line, at: &[f64], profile: CrossSection) -> Vec<usize> {
    let mut from = (plan.node(line.at(0.0).truncate()), 0.0);
    let mut crossings = Vec::new();
    for &s in at {
        let node = plan.node(line.at(s).truncate());
        plan.road(from.0, node, line.part(from.1, s), profile);
        crossings.push(node);
        from = (node, s);
    }
    let end = plan.node(line.at(line.length()).truncate());
    plan.road(from.0, end, line.part(from.1, line.length()), profile);
    crossings
}

/// A road from a node that leaves in one direction and bends on its way to an open end.
fn stub(
    plan: &mut RoadPlan,
    node: usize,
    out: DVec2,
    length: f64,
    profile: CrossSection,
    rng: &mut ChaCha8Rng,
) {
    let at = plan.nodes[node];
    for shorter in [1.0, 0.85, 0.7, 0.6] {
        let bend = rng.random_range(-0.5..0.5);
        let end = at + DVec2::from_angle(0.5 * bend).rotate(out) * (length * shorter);
        let into = DVec2::from_angle(bend).rotate(out);
        let line = curve(at.extend(0.0), out, end.extend(0.0), into, STEP);
        if clear(plan, &line) {
            let end = plan.node(end);
            plan.road(node, end, line, profile);
            return;
        }
    }
}

/// True if a line, but for its first metres, keeps away from all roads.
fn clear(plan: &RoadPlan, line: &Line) -> bool {
    /// Metres of the line beside its own junction.
    const START: f64 = 40.0;
    /// Metres between the middles of two roads.
    const APART: f64 = 32.0;
    let start = line.at(0.0);
    let points = || line.points().iter().filter(|p| p.distance(start) > START);
    let mut others = plan.roads.iter().flat_map(|r| r.line.points());
    others.all(|other| points().all(|p| p.distance(*other) > APART))
}

/// Places along a line, `gap` metres apart or more.
fn places(length: f64, gap: [f64; 2], margin: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut s = margin + rng.random_range(0.0..gap[1] - gap[0]);
    let mut found = Vec::new();
    while s < length - margin {
        found.push(s);
        s += rng.random_range(gap[0]..gap[1]);
    }
    found
}

fn street(rng: &mut ChaCha8Rng) -> RoadPlan {
    let main = CrossSection {
        lanes: rng.random_range(1..=2),
        median: if rng.random_bool(0.3) { 3.0 } else { 0.0 },
        parking: if rng.random_bool(0.7) { 2.3 } else { 0.0 },
        walk: rng.random_range(2.2..4.5),
        ..STREET_SECTION
    };
    let mut plan = RoadPlan::default();
    let line = winding(190.0, 4, 22.0, rng);
    let at = places(line.length(), [80.0, 140.0], 60.0, rng);
    let nodes = cut(&mut plan, &line, &at, main);
    for (node, s) in nodes.into_iter().zip(at) {
        let across = left_of(line.heading(s));
        let sides = [[true, false], [false, true], [true, true], [true, true]];
        let sides = sides[rng.random_range(0..sides.len())];
        for (out, here) in [across, -across].into_iter().zip(sides) {
            if here {
                let side = CrossSection { walk: main.walk.min(3.0), ..STREET_SECTION };
                stub(&mut plan, node, out, rng.random_range(90.0..140.0), side, rng);
            }
        }
    }
    plan
}

fn highway(rng: &mut ChaCha8Rng) -> RoadPlan {
    let profile = CrossSection {
        lanes: rng.random_range(2..=4),
        lane_width: 3.75,
        median: rng.random_range(2.5..6.0),
        parking: 0.0,
        shoulder: 2.8,
        walk: 0.0,
    };
    let mut plan = RoadPlan::default();
    let line = winding(420.0, 3, 45.0, rng);
    cut(&mut plan, &line, &[], profile);
    plan
}

fn residential(rng: &mut ChaCha8Rng) -> RoadPlan {
    let profile = CrossSection {
        lane_width: rng.random_range(2.8..3.2),
        parking: if rng.random_bool(0.7) { 2.1 } else { 0.0 },
        walk: rng.random_range(1.5..2.2),
        ..STREET_SECTION
    };
    let mut plan = RoadPlan::default();
    let line = winding(170.0, 5, 30.0, rng);
    let at = places(line.length(), [55.0, 95.0], 45.0, rng);
    let nodes = cut(&mut plan, &line, &at, profile);
    for (k, (node, s)) in nodes.into_iter().zip(at).enumerate() {
        let across = left_of(line.heading(s)) * if k % 2 == 0 { 1.0 } else { -1.0 };
        stub(&mut plan, node, across, rng.random_range(70.0..130.0), profile, rng);
        if rng.random_bool(0.25) {
            stub(&mut plan, node, -across, rng.random_range(70.0..110.0), profile, rng);
        }
    }
    plan
}

fn yard(rng: &mut ChaCha8Rng) -> RoadPlan {
    let profile =
        CrossSection { lane_width: 4.0, parking: 3.2, shoulder: 0.5, walk: 0.0, ..STREET_SECTION };
    let mut plan = RoadPlan::default();
    let line = winding(120.0, 2, 8.0, rng);
    let at = places(line.length(), [60.0, 90.0], 50.0, rng);
    let nodes = cut(&mut plan, &line, &at, profile);
    for (node, s) in nodes.into_iter().zip(at) {
        let across = left_of(line.heading(s));
        let first = if rng.random_bool(0.5) { across } else { -across };
        stub(&mut plan, node, first, rng.random_range(70.0..110.0), profile, rng);
        if rng.random_bool(0.5) {
            stub(&mut plan, node, -first, rng.random_range(70.0..110.0), profile, rng);
        }
    }
    plan
}

/// A grid with shifted nodes, some streets left out.
fn town(rng: &mut ChaCha8Rng) -> RoadPlan {
    let (columns, rows) = (rng.random_range(2..=3_usize), rng.random_range(2..=3_usize));
    let mut widths = |n: usize| {
        let mut x = vec![0.0];
        (0..=n).for_each(|i| x.push(x[i] + rng.random_range(75.0..115.0)));
        let middle = 0.5 * x[n + 1];
        x.into_iter().map(|v| v - middle).collect::<Vec<f64>>()
    };
    let (xs, ys) = (widths(columns), widths(rows));
    let mut plan = RoadPlan::default();
    let mut nodes = Vec::new();
    for x in &xs {
        for y in &ys {
            let shift = DVec2::new(rng.random_range(-9.0..9.0), rng.random_range(-9.0..9.0));
            nodes.push(plan.node(DVec2::new(*x, *y) + shift));
        }
    }
    let id = |i: usize, j: usize| nodes[i * (rows + 2) + j];
    let lines = (1..=columns).map(|i| (0..=rows + 1).map(|j| id(i, j)).collect());
    let across = (1..=rows).map(|j| (0..=columns + 1).map(|i| id(i, j)).collect());
    for line in lines.chain(across).collect::<Vec<Vec<usize>>>() {
        let broad = rng.random_bool(0.4);
        let profile = CrossSection {
            lanes: if broad { 2 } else { 1 },
            median: if broad && rng.random_bool(0.5) { 2.5 } else { 0.0 },
            parking: if rng.random_bool(0.6) { 2.3 } else { 0.0 },
            walk: rng.random_range(2.5..4.5),
            ..STREET_SECTION
        };
        let points: Vec<DVec2> = line.iter().map(|n| plan.nodes[*n]).collect();
        let pieces = smooth(&points);
        let left_out = rng.random_bool(0.35).then(|| rng.random_range(0..pieces.len()));
        for (k, piece) in pieces.into_iter().enumerate() {
            if Some(k) != left_out {
                plan.road(line[k], line[k + 1], piece, profile);
            }
        }
    }
    plan
}
