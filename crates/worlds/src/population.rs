//! Who is about: parked vehicles, people who walk, wait and cross, the ego, traffic, bicycles, in that order.

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::network::{Line, Network, Street, left_of};
use crate::style::Style;
use crate::traffic::{self, ActorModel, ActorPose, RATE, Traffic, Trajectory, stand_on, way};

/// Metres from the ego's way within which things move.
const NEAR: f64 = 95.0;
/// Metres that the ego keeps from where roads end, if it can.
const FROM_END: f64 = 70.0;
/// Least metres of an ego's way beyond the part that it drives.
const WAY: f64 = 100.0;
/// Share of its speed that the ego drives at in networks of short lanes.
const SLOWEST: f64 = 0.5;

/// An actor: the model that it has, and its track's number in the scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RoadUser {
    pub model: usize,
    pub track: usize,
}

#[derive(Debug, Default)]
pub(crate) struct Population {
    pub models: Vec<ActorModel>,
    pub actors: Vec<RoadUser>,
    pub ego: usize,
    pub scene: Traffic,
}

/// Kinds of models and how many of each are made.
#[rustfmt::skip] // Words of a list stand side by side.
const MODELS: [(&str, usize); 8] = [
    ("car", 7), ("van", 3), ("truck", 3), ("bus", 1), ("construction", 2), ("motorcycle", 2), ("bicycle", 2),
    ("pedestrian", 6),
];

/// A population that is being made.
pub(crate) struct PopulationDraft<'a> {
    pub network: &'a Network,
    pub style: &'a Style,
    pub frames: usize,
    pub people: Population,
    pub rng: ChaCha8Rng,
}

impl PopulationDraft<'_> {
    /// Populates the surroundings of a way for the ego.
    ///
    /// # Errors
    /// No way is long enough: the wanted length and the longest found, in metres.
    pub(crate) fn populate(mut self) -> Result<Population, [f64; 2]> {
        let seconds = self.frames as f64 / RATE;
        let mut longest = 0.0_f64;
        let open = self.open_ends();
        for attempt in 0..80 {
            // Slower after many failures, for networks of short lanes.
            let ease = if attempt < 60 { 1.0 } else { SLOWEST };
            let speed = self.rng.random_range(self.style.speed[0]..self.style.speed[1]) * ease;
            let lane = self.rng.random_range(0..self.network.lanes.len());
            let first = &self.network.lanes[lane];
            let line = way(self.network, lane, WAY + speed * seconds + 40.0, &mut self.rng);
            longest = longest.max(line.length());
            let start = 12.0 + self.rng.random_range(0.0..1.0) * 0.5 * first.centre.length();
            let end = start + speed * seconds + 15.0;
            if first.junction || first.width < 2.2 || line.length() < end.max(WAY) {
                continue;
            }
            // Rather where the world goes on to all sides.
            let far = |s: f64| open.iter().all(|p| p.distance(line.at(s)) > FROM_END);
            if attempt < 40 && !(far(start) && far(end)) {
                continue;
            }
            self.around(&line, start, end);
            let (_, size) = traffic::ego();
            let ego = self.people.scene.drive(&line, start, speed, size);
            let driven = ego.stand(self.frames - 1).at.distance(ego.stand(0).at);
            if (self.frames > 1 && driven < 0.5 * speed * (seconds - 1.0 / RATE))
                || !self.people.scene.add(ego)
            {
                continue;
            }
            self.people.ego = self.people.scene.tracks.len() - 1;
            self.traffic(&line, start, end);
            return Ok(self.people);
        }
        let wanted = WAY.max(12.0 + SLOWEST * self.style.speed[0] * seconds + 15.0);
        Err([wanted, longest])
    }

    /// Where roads end: ends of lanes that lead nowhere, and starts that nothing leads to.
    fn open_ends(&self) -> Vec<DVec3> {
        let lanes = &self.network.lanes;
        let mut led = vec![false; lanes.len()];
        lanes.iter().flat_map(|l| &l.next).for_each(|n| led[*n] = true);
        let ends = lanes.iter().filter(|l| l.next.is_empty());
        let ends = ends.map(|l| l.centre.at(l.centre.length()));
        let starts = lanes.iter().zip(&led).filter(|(_, led)| !**led);
        ends.chain(starts.map(|(l, _)| l.centre.at(0.0))).collect()
    }

    /// Places parked vehicles and people, which do not depend on the ego.
    fn around(&mut self, line: &Line, start: f64, end: f64) {
        let network = self.network;
        self.people = Population::default();
        self.people.scene.frames = self.frames;
        for (kind, count) in MODELS {
            for number in 0..count {
                self.people.models.push(traffic::model(kind, number, &mut self.rng));
            }
        }
        let near = near(line, start, end);
        for street in &network.streets {
            for side in 0..2 {
                self.park(street, side, &near);
            }
        }
        let walks: Vec<(&Street, usize)> = network
            .streets
            .iter()
            .flat_map(|s| [(s, 0), (s, 1)])
            .filter(|(s, side)| s.walks[*side] > 1.0 && s.edges[*side].length() > 8.0)
            .filter(|(s, side)| {
                let edge = &s.edges[*side];
                (0..=8).any(|k| near(edge.at(edge.length() * f64::from(k) / 8.0)))
            })
            .collect();
        if !walks.is_empty() {
            for k in 0..self.style.pedestrians {
                let (street, side) = walks[self.rng.random_range(0..walks.len())];
                match k % 4 {
                    0 => self.cross(street),
                    1 => self.wait(street, side),
                    _ => self.stroll(street, side, &near),
                }
            }
        }
    }

    fn park(&mut self, street: &Street, side: usize, near: &impl Fn(DVec3) -> bool) {
        let (edge, strip) = (&street.edges[side], street.parking[side]);
        if strip < 1.7 {
            return;
        }
        let inward = if side == 0 { -1.0 } else { 1.0 };
        // Metres kept free where the street meets another.
        let mut s = 9.0;
        while s < edge.length() - 9.0 {
            let wide = strip > 2.7 && self.rng.random_bool(self.style.heavy.min(1.0));
            let kind = match wide {
                true => "truck",
                false if self.rng.random_bool(0.15) => "van",
                false => "car",
            };
            let model = self.any(kind);
            let size = self.people.models[model].size;
            let (middle, taken) = (s + 0.5 * size[0], self.rng.random_bool(self.style.parked));
            s += size[0] + self.rng.random_range(0.6..2.0);
            let at = edge.at(middle);
            if !taken || size[1] > strip + 0.1 || !near(at) {
                continue;
            }
            let ahead = edge.heading(middle);
            let shift = left_of(ahead) * inward * (street.walks[side] + 0.5 * strip);
            let reverse = ((side == 0) != street.left_hand) != self.rng.random_bool(0.1);
            let yaw = (if reverse { -ahead } else { ahead }).to_angle()
                + self.rng.random_range(-0.02..0.02);
            let stand = ActorPose { at: at + shift.extend(0.0), yaw, pitch: 0.0 };
            self.people.add(model, Trajectory::walking(size, vec![stand]));
        }
    }

    fn stroll(&mut self, street: &Street, side: usize, near: &impl Fn(DVec3) -> bool) {
        let model = self.any("pedestrian");
        let edge = &street.edges[side];
        let inward = if side == 0 { -1.0 } else { 1.0 };
        let inset = self.rng.random_range(0.35..(street.walks[side] - 1.4).max(0.45));
        let walk = edge.offset(inward * inset).into_iter().zip(edge.along());
        let line = Line::new(walk.map(|(p, s)| p + DVec3::Z * street.kerb(side, *s)));
        let line = if self.rng.random_bool(0.5) { line } else { line.reversed() };
        let from = self.rng.random_range(0.0..1.0) * line.length();
        if near(line.at(from)) {
            self.walk(model, &line, from);
        }
    }

    /// Walks along a line from `from` and stops at its end.
    fn walk(&mut self, model: usize, line: &Line, from: f64) {
        let pace = self.rng.random_range(0.9..1.8);
        let stand = |t: usize| {
            let s = (from + pace * t as f64 / RATE).clamp(0.0, line.length());
            let stand = stand_on(line, s, 0.5);
            ActorPose { at: line.at(s), pitch: 0.0, ..stand }
        };
        let stands = (0..self.frames).map(stand).collect();
        self.people.add(model, Trajectory::walking(self.people.models[model].size, stands));
    }

    /// A place where one crosses: kerb to kerb across the street, if it has walks on both sides.
    fn crossing(&mut self, street: &Street) -> Option<[DVec3; 4]> {
        let [left, right] = &street.edges;
        let length = left.length().min(right.length());
        if street.walks.iter().any(|w| *w < 1.0) || length < 14.0 {
            return None;
        }
        let at_start = match street.meets {
            [true, true] => self.rng.random_bool(0.5),
            [start, _] => start,
        };
        let share = if at_start { 2.5 / length } else { 1.0 - 2.5 / length };
        let [a, b] = [left, right].map(|e| e.at(share * e.length()));
        let across = (b - a).normalize_or_zero();
        let [w, v] = street.walks;
        let [here, there] = [(0, left), (1, right)]
            .map(|(side, edge)| DVec3::Z * street.kerb(side, share * edge.length()));
        Some([a + across * 0.4 + here, a + across * w, b - across * v, b - across * 0.4 + there])
    }

    fn cross(&mut self, street: &Street) {
        let Some(points) = self.crossing(street) else { return };
        let model = self.any("pedestrian");
        let line = Line::new(points);
        let line = if self.rng.random_bool(0.5) { line } else { line.reversed() };
        let from = self.rng.random_range(0.0..0.8) * line.length();
        self.walk(model, &line, from);
    }

    fn wait(&mut self, street: &Street, side: usize) {
        let Some([a, b, c, d]) = self.crossing(street) else { return };
        let model = self.any("pedestrian");
        let (outer, kerb) = if side == 0 { (a, b) } else { (d, c) };
        let over = (kerb - outer).truncate().normalize_or(DVec2::X);
        let aside = (left_of(over) * self.rng.random_range(-1.5..1.5)).extend(0.0);
        let at = (kerb - (over * 0.5).extend(0.0) + aside).truncate().extend(outer.z);
        let yaw = over.to_angle() + self.rng.random_range(-0.4..0.4);
        let size = self.people.models[model].size;
        self.people.add(model, Trajectory::walking(size, vec![ActorPose { at, yaw, pitch: 0.0 }]));
    }

    /// Vehicles and bicycles on the lanes near the ego's way.
    fn traffic(&mut self, line: &Line, start: f64, end: f64) {
        let (network, near) = (self.network, near(line, start, end));
        let lanes: Vec<usize> = (0..network.lanes.len())
            .filter(|l| {
                let centre = &network.lanes[*l].centre;
                (0..=4).any(|k| near(centre.at(centre.length() * f64::from(k) / 4.0)))
            })
            .collect();
        let wanted = [(self.style.vehicles, false), (self.style.bicycles, true)];
        for (count, bicycle) in wanted {
            let mut placed = 0;
            for _ in 0..8 * count {
                placed += usize::from(placed < count && self.vehicle(&lanes, &near, bicycle));
            }
        }
    }

    fn vehicle(&mut self, lanes: &[usize], near: &impl Fn(DVec3) -> bool, bicycle: bool) -> bool {
        if lanes.is_empty() {
            return false;
        }
        let (network, first) = (self.network, lanes[self.rng.random_range(0..lanes.len())]);
        let lane = &network.lanes[first];
        let kind = if bicycle { "bicycle" } else { self.kind() };
        let model = self.any(kind);
        let size = self.people.models[model].size;
        let [low, high] = if bicycle { [3.5, 6.5] } else { self.style.speed };
        let slow = if kind == "truck" || kind == "bus" { 0.8 } else { 1.0 };
        let speed = slow * self.rng.random_range(low..high);
        let drives = speed * self.frames as f64 / RATE;
        let mut line = way(network, first, drives + lane.centre.length() + 20.0, &mut self.rng);
        let from = self.rng.random_range(0.0..1.0) * lane.centre.length();
        if lane.width < size[1] + 0.3
            || from < 0.5 * size[0]
            || from + drives + size[0] > line.length()
            || !near(line.at(from))
        {
            return false;
        }
        if bicycle {
            let aside = (0.5 * lane.width - 0.7).max(0.0);
            line = Line::new(line.offset(if lane.left_hand { aside } else { -aside }));
        }
        let track = self.people.scene.drive(&line, from, speed, size);
        self.people.add(model, track)
    }

    /// A model of a kind by lot.
    fn any(&mut self, kind: &str) -> usize {
        let models = &self.people.models;
        let all: Vec<usize> = (0..models.len()).filter(|&m| models[m].kind == kind).collect();
        all[self.rng.random_range(0..all.len())]
    }

    fn kind(&mut self) -> &'static str {
        if self.style.goods && self.rng.random_bool(0.4) {
            return "construction";
        }
        if self.rng.random_bool(self.style.heavy) {
            return if self.style.speed[1] < 20.0 && self.rng.random_bool(0.4) {
                "bus"
            } else {
                "truck"
            };
        }
        match self.rng.random_range(0..20) {
            0..3 => "van",
            3 => "motorcycle",
            _ => "car",
        }
    }
}

impl Population {
    fn add(&mut self, model: usize, track: Trajectory) -> bool {
        let added = self.scene.add(track);
        if added {
            self.actors.push(RoadUser { model, track: self.scene.tracks.len() - 1 });
        }
        added
    }
}

/// True if a place is near the part of a line from `start` to `end`.
fn near(line: &Line, start: f64, end: f64) -> impl Fn(DVec3) -> bool {
    let points: Vec<DVec3> =
        (0..=10).map(|k| line.at(start + (end - start) * f64::from(k) / 10.0)).collect();
    move |p| points.iter().any(|q| q.distance_squared(p) < NEAR * NEAR)
}
