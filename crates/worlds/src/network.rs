//! A network of roads as the rest of a world needs it: surfaces, lanes, marks, and where houses may face it.
//!
//! A [`Line`] is a polyline in space: length, points along it, offsets, and curves from point to point.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use lidar_cast::geom::TriangleSoup;
use lidar_cast::maths;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use sightline_files::Note;

/// A polyline with the length up to each of its points, in metres in plan.
#[derive(Debug, Clone, Default)]
pub(crate) struct Line {
    points: Vec<DVec3>,
    along: Vec<f64>,
}

impl Line {
    /// Measures `points`; a point that repeats the one before is left out.
    pub(crate) fn new(points: impl IntoIterator<Item = DVec3>) -> Self {
        let mut line = Self::default();
        points.into_iter().for_each(|p| line.push(p));
        line
    }

    fn push(&mut self, p: DVec3) {
        match (self.points.last(), self.along.last()) {
            (Some(&last), Some(&along)) => {
                let step = (p - last).truncate().length();
                if step > 1e-3 {
                    self.points.push(p);
                    self.along.push(along + step);
                }
            }
            _ => {
                self.points.push(p);
                self.along.push(0.0);
            }
        }
    }

    pub(crate) fn extend(&mut self, other: &Self) {
        other.points.iter().for_each(|&p| self.push(p));
    }

    pub(crate) fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Metres along the line up to each of its points.
    pub(crate) fn along(&self) -> &[f64] {
        &self.along
    }

    pub(crate) fn length(&self) -> f64 {
        self.along.last().copied().unwrap_or(0.0)
    }

    /// The point at `s`; the end segments go on straight.
    pub(crate) fn at(&self, s: f64) -> DVec3 {
        let Some(last) = self.points.len().checked_sub(2) else {
            return self.points.first().copied().unwrap_or_default();
        };
        let i = self.along.partition_point(|&a| a <= s).saturating_sub(1).min(last);
        let share = (s - self.along[i]) / (self.along[i + 1] - self.along[i]);
        self.points[i] + (self.points[i + 1] - self.points[i]) * share
    }

    /// Unit direction in plan at `s`, of the chord half a metre to both sides.
    pub(crate) fn heading(&self, s: f64) -> DVec2 {
        let chord = self.at(s + 0.5) - self.at(s - 0.5);
        chord.truncate().normalize_or(DVec2::X)
    }

    pub(crate) fn reversed(&self) -> Self {
        Self::new(self.points.iter().rev().copied())
    }

    pub(crate) fn part(&self, from: f64, to: f64) -> Self {
        let inner = self.points.iter().zip(&self.along);
        let inner = inner.filter(|(_, a)| **a > from && **a < to).map(|(p, _)| *p);
        Self::new(std::iter::once(self.at(from)).chain(inner).chain([self.at(to)]))
    }

    /// The line `to_left` metres to the left, point by point.
    pub(crate) fn offset(&self, to_left: f64) -> Vec<DVec3> {
        let n = self.points.len();
        let side = |i: usize| {
            let before = self.points[i.saturating_sub(1)];
            let after = self.points[(i + 1).min(n - 1)];
            left_of((after - before).truncate().normalize_or(DVec2::X))
        };
        (0..n).map(|i| self.points[i] + (side(i) * to_left).extend(0.0)).collect()
    }
}

/// The direction a quarter turn to the left.
pub(crate) fn left_of(direction: DVec2) -> DVec2 {
    DVec2::new(-direction.y, direction.x)
}

/// A cubic from `a` along `from_a` to `b` along `into_b` (unit directions), in steps of about `step` metres.
pub(crate) fn curve(a: DVec3, from_a: DVec2, b: DVec3, into_b: DVec2, step: f64) -> Line {
    let reach = 0.4 * (b - a).truncate().length();
    let (p, q) = (a + (from_a * reach).extend(0.0), b - (into_b * reach).extend(0.0));
    let pieces = ((b - a).length() / step).ceil().clamp(2.0, 2000.0) as usize;
    Line::new((0..=pieces).map(|i| {
        let t = i as f64 / pieces as f64;
        let u = 1.0 - t;
        a * (u * u * u) + p * (3.0 * u * u * t) + q * (3.0 * u * t * t) + b * (t * t * t)
    }))
}

/// Use of a strip of the road network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StripUse {
    /// Paved, for vehicles that drive, stop or park.
    Road,
    /// A side walk, a kerb above the road.
    Walk,
    Green,
    Rail,
}

/// A surface between two edges with as many points each.
#[derive(Debug, Clone)]
pub(crate) struct Strip {
    pub used: StripUse,
    pub left: Vec<DVec3>,
    pub right: Vec<DVec3>,
    /// Metres above the road, left and right at each point; empty where all of it is level with the road.
    pub raised: Vec<[f64; 2]>,
}

/// A lane for vehicles in the direction in which they drive.
#[derive(Debug, Clone)]
pub(crate) struct Lane {
    pub centre: Line,
    /// Least width, metres.
    pub width: f64,
    /// Lanes that begin where this one ends.
    pub next: Vec<usize>,
    pub junction: bool,
    /// One drives on the left of the road.
    pub left_hand: bool,
}

/// One stretch of road between junctions, kerbs and outer edges in the direction of the road.
#[derive(Debug, Clone)]
pub(crate) struct Street {
    /// Outer edges of all that belongs to the road, left and right.
    pub edges: [Line; 2],
    /// Metres of side walk inside each edge; 0 without one.
    pub walks: [f64; 2],
    /// Metres from each edge in which vehicles park, beside the walk; 0 where they do not.
    pub parking: [f64; 2],
    /// True if the street meets a junction at its start and at its end.
    pub meets: [bool; 2],
    /// Height of the walk above each edge: metres along the edge as x, the height as z.
    pub kerbs: [Line; 2],
    /// One drives on the left of the road.
    pub left_hand: bool,
}

impl Street {
    /// Metres that the walk of a side stands above its edge.
    pub(crate) fn kerb(&self, side: usize, s: f64) -> f64 {
        let line = &self.kerbs[side];
        line.at(s.clamp(0.0, line.length())).z
    }
}

/// Height of a walk that is the same everywhere, for [`Street::kerbs`].
pub(crate) fn even_kerb(height: f64) -> Line {
    Line::new([DVec3::new(0.0, 0.0, height)])
}

/// A solid, or paint, that the network itself brings.
#[derive(Debug, Clone)]
pub(crate) struct MapShape {
    pub class: u16,
    pub faces: Vec<[DVec3; 3]>,
    /// Stands on the ground and keeps other things away.
    pub solid: bool,
}

/// A plate that a map describes: its lower edge, its width and its height in metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plate {
    pub low: f64,
    pub width: f64,
    pub height: f64,
}

/// A sign or light that the network itself brings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Post {
    pub foot: DVec3,
    /// Where the board looks.
    pub faces: DVec2,
    pub light: bool,
    /// `None`: as is usual.
    pub plate: Option<Plate>,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Network {
    pub strips: Vec<Strip>,
    pub lanes: Vec<Lane>,
    pub streets: Vec<Street>,
    /// Painted quads, a few millimetres above the road.
    pub marks: Vec<[DVec3; 4]>,
    pub posts: Vec<Post>,
    pub shapes: Vec<MapShape>,
    /// Sentences about the map.
    pub notes: Vec<Note>,
}

impl Network {
    /// Lower and upper corner of all strips; `None` without one.
    pub(crate) fn bounds(&self) -> Option<[DVec3; 2]> {
        let mut points = self.strips.iter().flat_map(|s| s.left.iter().chain(&s.right));
        let first = *points.next()?;
        Some(points.fold([first; 2], |[low, high], p| [low.min(*p), high.max(*p)]))
    }

    /// Applies `height` (metres at a place) to everything.
    pub(crate) fn lift(&mut self, height: impl Fn(f64, f64) -> f64) {
        let lift = |p: &mut DVec3| p.z += height(p.x, p.y);
        let lifted =
            |line: &Line| Line::new(line.points().iter().map(|p| *p + DVec3::Z * height(p.x, p.y)));
        for strip in &mut self.strips {
            strip.left.iter_mut().chain(&mut strip.right).for_each(lift);
        }
        self.marks.iter_mut().flatten().for_each(lift);
        for lane in &mut self.lanes {
            lane.centre = lifted(&lane.centre);
        }
        for edge in self.streets.iter_mut().flat_map(|s| &mut s.edges) {
            *edge = lifted(edge);
        }
    }

    /// Paints a line of `width` metres along `line`, `dash` metres and as long a gap twice; 0 paints through.
    pub(crate) fn paint(&mut self, line: &Line, width: f64, dash: f64) {
        let step = if dash > 0.0 { dash } else { 4.0 };
        let period = if dash > 0.0 { 3.0 * dash } else { step };
        let mut s = 0.0;
        while s < line.length() {
            let (from, to) = (s, (s + step).min(line.length()));
            let side = |s: f64| (left_of(line.heading(s)) * 0.5 * width).extend(0.0);
            let [a, b] = [line.at(from), line.at(to)].map(|p| p + DVec3::Z * MARK);
            self.marks.push([a - side(from), b - side(to), b + side(to), a + side(from)]);
            s += period;
        }
    }
}

/// Metres of paint above the road.
pub(crate) const MARK: f64 = 0.008;
/// Metres of a side walk above the road.
pub(crate) const KERB: f64 = 0.13;

/// Ids in [`sightline_scene::scene::DEFAULT_CLASSES`].
pub(crate) mod class {
    use sightline_scene::scene::DEFAULT_CLASSES;

    /// Id of the class of a name; another name does not compile.
    const fn id(name: &str) -> u16 {
        let mut id = 0;
        while !is_same(DEFAULT_CLASSES[id].as_bytes(), name.as_bytes()) {
            id += 1;
        }
        id as u16
    }

    const fn is_same(a: &[u8], b: &[u8]) -> bool {
        let mut k = 0;
        while k < a.len() && k < b.len() && a[k] == b[k] {
            k += 1;
        }
        k == a.len() && k == b.len()
    }

    pub(crate) const BUILDING: u16 = id("building");
    pub(crate) const FENCE: u16 = id("fence");
    pub(crate) const OTHER: u16 = id("other");
    pub(crate) const PEDESTRIAN: u16 = id("pedestrian");
    pub(crate) const POLE: u16 = id("pole");
    pub(crate) const ROAD_LINE: u16 = id("road_line");
    pub(crate) const ROAD: u16 = id("road");
    pub(crate) const SIDEWALK: u16 = id("sidewalk");
    pub(crate) const VEGETATION: u16 = id("vegetation");
    pub(crate) const VEHICLE: u16 = id("vehicle");
    pub(crate) const WALL: u16 = id("wall");
    pub(crate) const TRAFFIC_SIGN: u16 = id("traffic_sign");
    pub(crate) const GROUND: u16 = id("ground");
    pub(crate) const BRIDGE: u16 = id("bridge");
    pub(crate) const RAIL_TRACK: u16 = id("rail_track");
    pub(crate) const GUARD_RAIL: u16 = id("guard_rail");
    pub(crate) const TRAFFIC_LIGHT: u16 = id("traffic_light");
    pub(crate) const STATIC: u16 = id("static");
    pub(crate) const TERRAIN: u16 = id("terrain");
}

/// A rectangle in plan: its middle, the direction of its length, half its length and half its width.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroundRect {
    pub middle: DVec2,
    pub ahead: DVec2,
    pub half: DVec2,
}

impl GroundRect {
    pub(crate) fn new(middle: DVec2, ahead: DVec2, half: [f64; 2]) -> Self {
        Self { middle, ahead, half: half.into() }
    }

    /// The point at (x, y) of the half sizes, each from −1 to 1.
    pub(crate) fn at(&self, x: f64, y: f64) -> DVec2 {
        self.middle + self.ahead * (self.half.x * x) + left_of(self.ahead) * (self.half.y * y)
    }

    /// Corners, counter-clockwise.
    pub(crate) fn corners(&self) -> [DVec2; 4] {
        [self.at(-1.0, -1.0), self.at(1.0, -1.0), self.at(1.0, 1.0), self.at(-1.0, 1.0)]
    }

    /// A part of it, from −1 to 1 along each axis.
    pub(crate) fn part(&self, x: [f64; 2], y: [f64; 2]) -> Self {
        let middle = self.at(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
        let half = self.half * DVec2::new(0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0]));
        Self { middle, half, ..*self }
    }
}

/// Triangles so far.
#[derive(Debug, Default)]
pub(crate) struct Model {
    pub soup: TriangleSoup,
}

impl Model {
    fn vertex(&mut self, p: DVec3) -> u32 {
        self.soup.vertices.push(p.as_vec3().to_array());
        self.soup.vertices.len() as u32 - 1
    }

    /// A triangle; one without an area is left out.
    pub(crate) fn triangle(&mut self, corners: [DVec3; 3], class: u16) {
        let [a, b, c] = corners;
        if (b - a).cross(c - a).length_squared() < 1e-12 {
            return;
        }
        let corners = corners.map(|c| self.vertex(c));
        self.soup.faces.push(corners);
        self.soup.face_class.push(class);
    }

    /// Two triangles that share corners 0 and 2.
    pub(crate) fn quad(&mut self, [a, b, c, d]: [DVec3; 4], class: u16) {
        self.triangle([a, b, c], class);
        self.triangle([a, c, d], class);
    }

    /// Walls and a flat lid over a convex base.
    pub(crate) fn prism(&mut self, base: &[DVec2], [bottom, top]: [f64; 2], class: u16) {
        for (i, &a) in base.iter().enumerate() {
            let b = base[(i + 1) % base.len()];
            let wall = [a.extend(bottom), b.extend(bottom), b.extend(top), a.extend(top)];
            self.quad(wall, class);
            if i > 0 && i + 1 < base.len() {
                self.triangle([base[0].extend(top), a.extend(top), b.extend(top)], class);
            }
        }
    }

    pub(crate) fn block(&mut self, plot: &GroundRect, z: [f64; 2], class: u16) {
        self.prism(&plot.corners(), z, class);
    }

    /// A roof over a plot with its ridge along the plot's length; `hip` moves the ridge's ends in.
    pub(crate) fn roof(&mut self, on: &GroundRect, [eaves, ridge]: [f64; 2], hip: f64, class: u16) {
        let [a, b, c, d] = on.corners().map(|p| p.extend(eaves));
        let [from, to] = [on.at(-1.0 + hip, 0.0), on.at(1.0 - hip, 0.0)].map(|p| p.extend(ridge));
        self.quad([a, b, to, from], class);
        self.quad([c, d, from, to], class);
        self.triangle([d, a, from], class);
        self.triangle([b, c, to], class);
    }

    /// An upright cylinder, open below.
    pub(crate) fn pole(&mut self, foot: DVec3, radius: f64, height: f64, sides: u32, class: u16) {
        let corner = |k: u32| {
            foot.truncate() + DVec2::from_angle(TAU * f64::from(k) / f64::from(sides)) * radius
        };
        let base: Vec<DVec2> = (0..sides).map(corner).collect();
        self.prism(&base, [foot.z, foot.z + height], class);
    }

    /// `count` leaves in an ellipsoid, dense towards its surface: beams pass between them.
    pub(crate) fn leaves(&mut self, at: DVec3, radii: DVec3, count: usize, rng: &mut ChaCha8Rng) {
        let size = 1.5 * radii.max_element() / (count.max(1) as f64).sqrt();
        let size = size.clamp(0.06, 0.6);
        for _ in 0..count {
            let out = ball(rng);
            let out = out.normalize_or(DVec3::Z) * maths::pow(out.length(), 0.4);
            let centre = at + out * radii;
            let corners = [0; 3].map(|_| centre + ball(rng) * size);
            self.triangle(corners, class::VEGETATION);
        }
    }
}

/// A point in the unit ball.
fn ball(rng: &mut ChaCha8Rng) -> DVec3 {
    loop {
        let p = DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
        if p.length_squared() <= 1.0 {
            return p;
        }
    }
}
