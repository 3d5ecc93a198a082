//! A network of roads as the rest of a world needs it: surfaces, lanes, marks, and where houses may face it.

use glam::{DVec2, DVec3};

use super::line::Line;
use sightline_files::Note;

/// Use of a strip of the road network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// Paved, for vehicles that drive, stop or park.
    Road,
    /// A side walk, a kerb above the road.
    Walk,
    /// A strip of green between lanes.
    Green,
    /// A track of rails.
    Rail,
}

/// A surface between two edges with as many points each.
#[derive(Debug, Clone)]
pub struct Strip {
    pub used: Use,
    pub left: Vec<DVec3>,
    pub right: Vec<DVec3>,
    /// Metres above the road, left and right at each point; empty where all of it is level with the road.
    pub raised: Vec<[f64; 2]>,
}

/// A lane for vehicles in the direction in which they drive.
#[derive(Debug, Clone)]
pub struct Lane {
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
pub struct Street {
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
    pub fn kerb(&self, side: usize, s: f64) -> f64 {
        let line = &self.kerbs[side];
        line.at(s.clamp(0.0, line.length())).z
    }
}

/// Height of a walk that is the same everywhere, for [`Street::kerbs`].
pub fn even_kerb(height: f64) -> Line {
    Line::new([DVec3::new(0.0, 0.0, height)])
}

/// A solid, or paint, that the network itself brings.
#[derive(Debug, Clone)]
pub struct MapShape {
    pub class: u16,
    pub faces: Vec<[DVec3; 3]>,
    /// Stands on the ground and keeps other things away.
    pub solid: bool,
}

/// A plate that a map describes: its lower edge, its width and its height in metres.
#[derive(Debug, Clone, Copy)]
pub struct Plate {
    pub low: f64,
    pub width: f64,
    pub height: f64,
}

/// A sign or light that the network itself brings.
#[derive(Debug, Clone, Copy)]
pub struct Post {
    pub foot: DVec3,
    /// Where the board looks.
    pub faces: DVec2,
    pub light: bool,
    /// `None`: as is usual.
    pub plate: Option<Plate>,
}

/// Roads of a world.
#[derive(Debug, Clone, Default)]
pub struct Network {
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
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let mut points = self.strips.iter().flat_map(|s| s.left.iter().chain(&s.right));
        let first = *points.next()?;
        Some(points.fold([first; 2], |[low, high], p| [low.min(*p), high.max(*p)]))
    }

    /// Applies `height` (metres at a place) to everything.
    pub fn lift(&mut self, height: impl Fn(f64, f64) -> f64) {
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
    pub fn paint(&mut self, line: &Line, width: f64, dash: f64) {
        let step = if dash > 0.0 { dash } else { 4.0 };
        let period = if dash > 0.0 { 3.0 * dash } else { step };
        let mut s = 0.0;
        while s < line.length() {
            let (from, to) = (s, (s + step).min(line.length()));
            let side = |s: f64| (super::line::left_of(line.heading(s)) * 0.5 * width).extend(0.0);
            let [a, b] = [line.at(from), line.at(to)].map(|p| p + DVec3::Z * MARK);
            self.marks.push([a - side(from), b - side(to), b + side(to), a + side(from)]);
            s += period;
        }
    }
}

/// Metres of paint above the road.
pub const MARK: f64 = 0.008;
/// Metres of a side walk above the road.
pub const KERB: f64 = 0.13;
