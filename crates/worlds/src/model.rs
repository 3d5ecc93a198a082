//! Triangles of a static world under construction, with ids of the default classes.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::network::left_of;
use lidar_cast::geom::TriangleSoup;
use lidar_cast::maths;

/// Ids in [`sightline_scene::scene::DEFAULT_CLASSES`].
pub mod class {
    pub const BUILDING: u16 = 0;
    pub const FENCE: u16 = 1;
    pub const OTHER: u16 = 2;
    pub const POLE: u16 = 4;
    pub const ROAD_LINE: u16 = 5;
    pub const ROAD: u16 = 6;
    pub const SIDEWALK: u16 = 7;
    pub const VEGETATION: u16 = 8;
    pub const WALL: u16 = 10;
    pub const TRAFFIC_SIGN: u16 = 11;
    pub const GROUND: u16 = 12;
    pub const BRIDGE: u16 = 13;
    pub const RAIL_TRACK: u16 = 14;
    pub const GUARD_RAIL: u16 = 15;
    pub const TRAFFIC_LIGHT: u16 = 16;
    pub const STATIC: u16 = 17;
    pub const TERRAIN: u16 = 20;
}

/// A rectangle in plan: its middle, the direction of its length, half its length and half its width.
#[derive(Debug, Clone, Copy)]
pub struct GroundRect {
    pub middle: DVec2,
    pub ahead: DVec2,
    pub half: DVec2,
}

impl GroundRect {
    /// The point at (x, y) of the half sizes, each from −1 to 1.
    pub fn at(&self, x: f64, y: f64) -> DVec2 {
        self.middle + self.ahead * (self.half.x * x) + left_of(self.ahead) * (self.half.y * y)
    }

    /// Corners, counter-clockwise.
    pub fn corners(&self) -> [DVec2; 4] {
        [self.at(-1.0, -1.0), self.at(1.0, -1.0), self.at(1.0, 1.0), self.at(-1.0, 1.0)]
    }

    /// A part of it, from −1 to 1 along each axis.
    pub fn part(&self, x: [f64; 2], y: [f64; 2]) -> Self {
        let middle = self.at(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
        let half = self.half * DVec2::new(0.5 * (x[1] - x[0]), 0.5 * (y[1] - y[0]));
        Self { middle, half, ..*self }
    }
}

/// Triangles so far.
#[derive(Debug, Default)]
pub struct Model {
    pub soup: TriangleSoup,
}

impl Model {
    fn vertex(&mut self, p: DVec3) -> u32 {
        self.soup.vertices.push(p.as_vec3().to_array());
        self.soup.vertices.len() as u32 - 1
    }

    /// A triangle; one without an area is left out.
    pub fn triangle(&mut self, corners: [DVec3; 3], class: u16) {
        let [a, b, c] = corners;
        if (b - a).cross(c - a).length_squared() < 1e-12 {
            return;
        }
        let corners = corners.map(|c| self.vertex(c));
        self.soup.faces.push(corners);
        self.soup.face_class.push(class);
    }

    /// Two triangles that share corners 0 and 2.
    pub fn quad(&mut self, [a, b, c, d]: [DVec3; 4], class: u16) {
        self.triangle([a, b, c], class);
        self.triangle([a, c, d], class);
    }

    /// Walls and a flat lid over a convex base.
    pub fn prism(&mut self, base: &[DVec2], [bottom, top]: [f64; 2], class: u16) {
        for (i, &a) in base.iter().enumerate() {
            let b = base[(i + 1) % base.len()];
            let wall = [a.extend(bottom), b.extend(bottom), b.extend(top), a.extend(top)];
            self.quad(wall, class);
            if i > 0 && i + 1 < base.len() {
                self.triangle([base[0].extend(top), a.extend(top), b.extend(top)], class);
            }
        }
    }

    /// A block on a plot.
    pub fn block(&mut self, plot: &GroundRect, z: [f64; 2], class: u16) {
        self.prism(&plot.corners(), z, class);
    }

    /// A roof over a plot with its ridge along the plot's length; `hip` moves the ridge's ends in.
    pub fn roof(&mut self, plot: &GroundRect, [eaves, ridge]: [f64; 2], hip: f64, class: u16) {
        let [a, b, c, d] = plot.corners().map(|p| p.extend(eaves));
        let [from, to] =
            [plot.at(-1.0 + hip, 0.0), plot.at(1.0 - hip, 0.0)].map(|p| p.extend(ridge));
        self.quad([a, b, to, from], class);
        self.quad([c, d, from, to], class);
        self.triangle([d, a, from], class);
        self.triangle([b, c, to], class);
    }

    /// An upright cylinder, open below.
    pub fn pole(&mut self, foot: DVec3, radius: f64, height: f64, sides: u32, class: u16) {
        let corner = |k: u32| {
            foot.truncate() + DVec2::from_angle(TAU * f64::from(k) / f64::from(sides)) * radius
        };
        let base: Vec<DVec2> = (0..sides).map(corner).collect();
        self.prism(&base, [foot.z, foot.z + height], class);
    }

    /// `count` leaves in an ellipsoid, dense towards its surface: beams pass between them.
    pub fn leaves(&mut self, middle: DVec3, radii: DVec3, count: usize, rng: &mut ChaCha8Rng) {
        let size = 1.5 * radii.max_element() / (count.max(1) as f64).sqrt();
        let size = size.clamp(0.06, 0.6);
        for _ in 0..count {
            let out = ball(rng);
            let out = out.normalize_or(DVec3::Z) * maths::pow(out.length(), 0.4);
            let centre = middle + out * radii;
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
