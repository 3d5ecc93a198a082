//! Who is about: parked vehicles, people who walk, wait and cross, the ego, traffic, bicycles, in that order.

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::network::{Line, Network, Street, left_of};
use crate::style::Style;
use crate::traffic::{self, ActorModel, ActorPose, Traffic, Trajectory, stand_on, way};

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
const MODELS: [(&str, usize); 8] = [
    ("car", 7),
    ("van", 3),
    ("truck", 3),
    ("bus", 1),
    ("construction", 2),
    ("motorcycle", 2),
    ("bicycle", 2),
    ("pedestrian", 6),
];

pub(crate) struct PopulationSettings<'a> {
    pub network: &'a Network,
    pub style: &'a Style,
    pub frames: usize,
    /// Frames a second.
    pub rate: f64,
}

impl PopulationSettings<'_> {
    /// Populates the surroundings of a way for the ego.
    ///
    /// # Errors
    /// No way is long enough: the wanted length and the longest found, in metres.
    pub(crate) fn populate(&self, rng: &mut ChaCha8Rng) -> Result<Population, [f64; 2]> {
        let seconds = self.frames as f64 / self.rate;
        let mut longest = 0.0_f64;
        let open = self.open_ends();
        for attempt in 0..80 {
            // Slower after many failures, for networks of short lanes.
            let ease = if attempt < 60 { 1.0 } else { SLOWEST };
            let speed = rng.random_range(self.style.speed[0]..self.style.speed[1]) * ease;
            let lane = rng.random_range(0..self.network.lanes.len());
            let first = &self.network.lanes[lane];
            let line = way(self.network, lane, WAY + speed * seconds + 40.0, rng);
            longest = longest.max(line.length());
            let start = 12.0 + rng.random_range(0.0..1.0) * 0.5 * first.centre.length();
            let end = start + speed * seconds + 15.0;
            if first.junction || first.width < 2.2 || line.length() < end.max(WAY) {
                continue;
            }
            // Rather where the world goes on to all sides.
            let far = |s: f64| open.iter().all(|p| p.distance(line.at(s)) > FROM_END);
            if attempt < 40 && !(far(start) && far(end)) {
                continue;
            }
            let mut people = self.around(&line, start, end, rng);
            let (_, size) = traffic::ego();
            let ego = people.scene.drive(&line, start, speed, self.rate, size);
            let driven = ego.stand(self.frames - 1).at.distance(ego.stand(0).at);
            if (self.frames > 1 && driven < 0.5 * speed * (seconds - 1.0 / self.rate))
                || !people.scene.add(ego)
            {
                continue;
            }
            people.ego = people.scene.tracks.len() - 1;
            self.traffic(&mut people, &line, [start, end], rng);
            return Ok(people);
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
    fn around(&self, line: &Line, start: f64, end: f64, rng: &mut ChaCha8Rng) -> Population {
        let mut people = Population::default();
        people.scene.frames = self.frames;
        for (kind, count) in MODELS {
            for number in 0..count {
                people.models.push(traffic::model(kind, number, rng));
            }
        }
        let near = near(line, start, end);
        for street in &self.network.streets {
            for side in 0..2 {
                self.park(&mut people, street, side, &near, rng);
            }
        }
        let walks: Vec<(&Street, usize)> = self
            .network
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
                let (street, side) = walks[rng.random_range(0..walks.len())];
                match k % 4 {
                    0 => self.cross(&mut people, street, rng),
                    1 => self.wait(&mut people, street, side, rng),
                    _ => self.stroll(&mut people, street, side, &near, rng),
                }
            }
        }
        people
    }

    fn park(
        &self,
        people: &mut Population,
        street: &Street,
        side: usize,
        near: &impl Fn(DVec3) -> bool,
        rng: &mut ChaCha8Rng,
    ) {
        let (edge, strip) = (&street.edges[side], street.parking[side]);
        if strip < 1.7 {
            return;
        }
        let inward = if side == 0 { -1.0 } else { 1.0 };
        // Metres kept free where the street meets another.
        let mut s = 9.0;
        while s < edge.length() - 9.0 {
            let wide = strip > 2.7 && rng.random_bool(self.style.heavy.min(1.0));
            let kind = match wide {
                true => "truck",
                false if rng.random_bool(0.15) => "van",
                false => "car",
            };
            let model = people.any(kind, rng);
            let size = people.models[model].size;
            let (middle, taken) = (s + 0.5 * size[0], rng.random_bool(self.style.parked));
            s += size[0] + rng.random_range(0.6..2.0);
            let at = edge.at(middle);
            if !taken || size[1] > strip + 0.1 || !near(at) {
                continue;
            }
            let ahead = edge.heading(middle);
            let shift = left_of(ahead) * inward * (street.walks[side] + 0.5 * strip);
            let reverse = ((side == 0) != street.left_hand) != rng.random_bool(0.1);
            let yaw =
                (if reverse { -ahead } else { ahead }).to_angle() + rng.random_range(-0.02..0.02);
            let stand = ActorPose { at: at + shift.extend(0.0), yaw, pitch: 0.0 };
            people.add(model, Trajectory::walking(size, vec![stand]));
        }
    }

    fn stroll(
        &self,
        people: &mut Population,
        street: &Street,
        side: usize,
        near: &impl Fn(DVec3) -> bool,
        rng: &mut ChaCha8Rng,
    ) {
        let model = people.any("pedestrian", rng);
        let edge = &street.edges[side];
        let inward = if side == 0 { -1.0 } else { 1.0 };
        let inset = rng.random_range(0.35..(street.walks[side] - 1.4).max(0.45));
        let walk = edge.offset(inward * inset).into_iter().zip(edge.along());
        let line = Line::new(walk.map(|(p, s)| p + DVec3::Z * street.kerb(side, *s)));
        let line = if rng.random_bool(0.5) { line } else { line.reversed() };
        let from = rng.random_range(0.0..1.0) * line.length();
        if near(line.at(from)) {
            self.walk(people, model, &line, from, rng);
        }
    }

    /// Walks along a line from `from` and stops at its end.
    fn walk(
        &self,
        people: &mut Population,
        model: usize,
        line: &Line,
        from: f64,
        rng: &mut ChaCha8Rng,
    ) {
        let pace = rng.random_range(0.9..1.8);
        let stand = |t: usize| {
            let s = (from + pace * t as f64 / self.rate).clamp(0.0, line.length());
            let stand = stand_on(line, s, 0.5);
            ActorPose { at: line.at(s), pitch: 0.0, ..stand }
        };
        let stands = (0..self.frames).map(stand).collect();
        people.add(model, Trajectory::walking(people.models[model].size, stands));
    }

    /// A place where one crosses: kerb to kerb across the street, if it has walks on both sides.
    fn crossing(&self, street: &Street, rng: &mut ChaCha8Rng) -> Option<[DVec3; 4]> {
        let [left, right] = &street.edges;
        let length = left.length().min(right.length());
        if street.walks.iter().any(|w| *w < 1.0) || length < 14.0 {
            return None;
        }
        let at_start = match street.meets {
            [true, true] => rng.random_bool(0.5),
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

    fn cross(&self, people: &mut Population, street: &Street, rng: &mut ChaCha8Rng) {
        let Some(points) = self.crossing(street, rng) else { return };
        let model = people.any("pedestrian", rng);
        let line = Line::new(points);
        let line = if rng.random_bool(0.5) { line } else { line.reversed() };
        let from = rng.random_range(0.0..0.8) * line.length();
        self.walk(people, model, &line, from, rng);
    }

    fn wait(&self, people: &mut Population, street: &Street, side: usize, rng: &mut ChaCha8Rng) {
        let Some([a, b, c, d]) = self.crossing(street, rng) else { return };
        let model = people.any("pedestrian", rng);
        let (outer, kerb) = if side == 0 { (a, b) } else { (d, c) };
        let over = (kerb - outer).truncate().normalize_or(DVec2::X);
        let aside = (left_of(over) * rng.random_range(-1.5..1.5)).extend(0.0);
        let at = (kerb - (over * 0.5).extend(0.0) + aside).truncate().extend(outer.z);
        let yaw = over.to_angle() + rng.random_range(-0.4..0.4);
        let size = people.models[model].size;
        people.add(model, Trajectory::walking(size, vec![ActorPose { at, yaw, pitch: 0.0 }]));
    }

    /// Vehicles and bicycles on the lanes near the ego's way.
    fn traffic(
        &self,
        people: &mut Population,
        line: &Line,
        [start, end]: [f64; 2],
        rng: &mut ChaCha8Rng,
    ) {
        let near = near(line, start, end);
        let lanes: Vec<usize> = (0..self.network.lanes.len())
            .filter(|l| {
                let centre = &self.network.lanes[*l].centre;
                (0..=4).any(|k| near(centre.at(centre.length() * f64::from(k) / 4.0)))
            })
            .collect();
        let wanted = [(self.style.vehicles, false), (self.style.bicycles, true)];
        for (count, bicycle) in wanted {
            let mut placed = 0;
            for _ in 0..8 * count {
                placed += usize::from(
                    placed < count && self.vehicle(people, &lanes, &near, bicycle, rng),
                );
            }
        }
    }

    fn vehicle(
        &self,
        people: &mut Population,
        lanes: &[usize],
        near: &impl Fn(DVec3) -> bool,
        bicycle: bool,
        rng: &mut ChaCha8Rng,
    ) -> bool {
        if lanes.is_empty() {
            return false;
        }
        let first = lanes[rng.random_range(0..lanes.len())];
        let lane = &self.network.lanes[first];
        let kind = if bicycle { "bicycle" } else { self.kind(rng) };
        let model = people.any(kind, rng);
        let size = people.models[model].size;
        let [low, high] = if bicycle { [3.5, 6.5] } else { self.style.speed };
        let slow = if kind == "truck" || kind == "bus" { 0.8 } else { 1.0 };
        let speed = slow * rng.random_range(low..high);
        let drives = speed * self.frames as f64 / self.rate;
        let mut line = way(self.network, first, drives + lane.centre.length() + 20.0, rng);
        let from = rng.random_range(0.0..1.0) * lane.centre.length();
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
        let track = people.scene.drive(&line, from, speed, self.rate, size);
        people.add(model, track)
    }

    fn kind(&self, rng: &mut ChaCha8Rng) -> &'static str {
        if self.style.goods && rng.random_bool(0.4) {
            return "construction";
        }
        if rng.random_bool(self.style.heavy) {
            return if self.style.speed[1] < 20.0 && rng.random_bool(0.4) {
                "bus"
            } else {
                "truck"
            };
        }
        match rng.random_range(0..20) {
            0..3 => "van",
            3 => "motorcycle",
            _ => "car",
        }
    }
}

impl Population {
    fn any(&self, kind: &str, rng: &mut ChaCha8Rng) -> usize {
        let all: Vec<usize> =
            (0..self.models.len()).filter(|&m| self.models[m].kind == kind).collect();
        all[rng.random_range(0..all.len())]
    }

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
