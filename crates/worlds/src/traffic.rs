//! Who moves where, frame by frame: each is planned against those planned before and keeps its distance.

use glam::{DVec2, DVec3};
use lidar_cast::maths;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::network::{Line, Network, left_of};

/// Frames a second of all worlds.
pub(crate) const RATE: f64 = 10.0;
/// Metres that no two boxes come nearer than.
const CLEARANCE: f64 = 0.25;
/// Seconds of a vehicle's own speed that it keeps free ahead, and metres at rest.
const HEADWAY: f64 = 1.0;
const STANDSTILL: f64 = 1.5;
/// Metres a second squared.
const BRAKE: f64 = 5.0;
const GAS: f64 = 2.0;
const SIDEWAYS: f64 = 2.2;

/// Where something stands in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ActorPose {
    pub at: DVec3,
    pub yaw: f64,
    pub pitch: f64,
}

/// Something planned: a stand a frame, or one for all.
#[derive(Debug, Clone)]
pub(crate) struct Trajectory {
    /// Length, width, height.
    pub size: [f64; 3],
    pub stands: Vec<ActorPose>,
    /// Metres kept free ahead in each frame.
    ahead: Vec<f64>,
}

impl Trajectory {
    /// Something at rest, or that walks at its own speed: it keeps nothing free.
    pub(crate) fn walking(size: [f64; 3], stands: Vec<ActorPose>) -> Self {
        Self { size, ahead: vec![0.0; stands.len()], stands }
    }

    pub(crate) fn stand(&self, t: usize) -> &ActorPose {
        &self.stands[t.min(self.stands.len() - 1)]
    }

    /// Plan view of the box in frame `t`: grown by `grow`, and by `ahead` metres to the front.
    fn rect(&self, t: usize, grow: f64, ahead: f64) -> Rect {
        let stand = self.stand(t);
        let direction = DVec2::from_angle(stand.yaw);
        let half = DVec2::new(0.5 * (self.size[0] + ahead) + grow, 0.5 * self.size[1] + grow);
        let middle = stand.at.truncate() + direction * (0.5 * ahead);
        Rect { middle, direction, half, low: stand.at.z, high: stand.at.z + self.size[2] }
    }

    fn ahead(&self, t: usize) -> f64 {
        self.ahead[t.min(self.ahead.len() - 1)]
    }
}

#[derive(Debug, Clone, Copy)]
struct Rect {
    middle: DVec2,
    direction: DVec2,
    half: DVec2,
    low: f64,
    high: f64,
}

impl Rect {
    fn overlaps(&self, other: &Self) -> bool {
        let apart = other.middle - self.middle;
        let reach = self.half.length() + other.half.length();
        if apart.length_squared() > reach * reach || self.low > other.high || other.low > self.high
        {
            return false;
        }
        let axes = [self, other].map(|r| [r.direction, left_of(r.direction)]);
        let shadow = |r: &Self, axis: DVec2| {
            r.half.x * r.direction.dot(axis).abs() + r.half.y * left_of(r.direction).dot(axis).abs()
        };
        let separates =
            |axis: &DVec2| apart.dot(*axis).abs() > shadow(self, *axis) + shadow(other, *axis);
        !axes.iter().flatten().any(separates)
    }
}

#[derive(Debug, Default)]
pub(crate) struct Traffic {
    pub tracks: Vec<Trajectory>,
    pub frames: usize,
}

impl Traffic {
    /// True if `track` keeps clear of all others in every frame, and they keep their distance from it.
    pub(crate) fn fits(&self, track: &Trajectory) -> bool {
        let near = |other: &&Trajectory| {
            let apart = other.stand(0).at - track.stand(0).at;
            apart.length() < 60.0 + 6.0 * (self.frames as f64)
        };
        self.tracks.iter().filter(near).all(|other| {
            let still = track.stands.len() == 1 && other.stands.len() == 1;
            (0..if still { 1 } else { self.frames }).all(|t| {
                let mine = track.rect(t, 0.5 * CLEARANCE, 0.0);
                let others = other.rect(t, 0.5 * CLEARANCE, 0.0);
                let [my_way, their_way] =
                    [track.rect(t, 0.0, track.ahead(t)), other.rect(t, 0.0, other.ahead(t))];
                !mine.overlaps(&others) && !my_way.overlaps(&others) && !their_way.overlaps(&mine)
            })
        })
    }

    /// Adds a track that fits.
    pub(crate) fn add(&mut self, track: Trajectory) -> bool {
        let fits = self.fits(&track);
        if fits {
            self.tracks.push(track);
        }
        fits
    }

    /// Drives along `way` from `start` metres at `speed`, slower in bends and behind obstacles.
    pub(crate) fn drive(&self, way: &Line, start: f64, speed: f64, size: [f64; 3]) -> Trajectory {
        let mut track = Trajectory { size, stands: Vec::new(), ahead: Vec::new() };
        let (mut s, mut v) = (start, speed.min(bend_speed(way, start)));
        for t in 0..self.frames {
            let free = self.free_ahead(way, s, v, t, size);
            let stop = (2.0 * BRAKE * 0.6 * (free - STANDSTILL).max(0.0)).sqrt();
            let follow = ((free - STANDSTILL) / HEADWAY).max(0.0).min(stop.max(0.0));
            let wanted = speed.min(bend_speed(way, s)).min(follow);
            if t == 0 {
                v = wanted;
            }
            track.stands.push(stand_on(way, s, size[0]));
            track.ahead.push(v * 0.5 * HEADWAY);
            v = wanted.clamp(v - BRAKE / RATE, v + GAS / RATE).max(0.0);
            s += v / RATE;
        }
        track
    }

    /// Metres from the front to the nearest box on the way in frame `t`, at most a stopping distance.
    fn free_ahead(&self, way: &Line, s: f64, v: f64, t: usize, size: [f64; 3]) -> f64 {
        let look = STANDSTILL + v * HEADWAY * 1.5 + v * v / (2.0 * BRAKE * 0.6) + 4.0;
        let here = way.at(s).truncate();
        let reach = look + size[0] + 15.0;
        let near = self
            .tracks
            .iter()
            .filter(|o| o.stand(t).at.truncate().distance_squared(here) < reach * reach);
        let near: Vec<Rect> = near.map(|o| o.rect(t, 0.15, 0.0)).collect();
        if near.is_empty() {
            return look;
        }
        let front = s + 0.5 * size[0];
        let steps = (look / 1.0).ceil() as usize;
        (0..steps)
            .map(|k| k as f64 + 0.5)
            .find(|d| {
                let at = way.at(front + d);
                let probe = Rect {
                    middle: at.truncate(),
                    direction: way.heading(front + d),
                    half: DVec2::new(0.5, 0.5 * size[1] + 0.1),
                    low: at.z,
                    high: at.z + size[2],
                };
                near.iter().any(|r| r.overlaps(&probe))
            })
            .map_or(look, |d| d - 0.5)
    }
}

/// The stand of a vehicle whose middle is `s` metres along a way: axles on the line, pitch with it.
pub(crate) fn stand_on(way: &Line, s: f64, length: f64) -> ActorPose {
    let (rear, front) = (way.at(s - 0.3 * length), way.at(s + 0.3 * length));
    let chord = front - rear;
    let at = (rear + front) * 0.5;
    let flat = chord.truncate();
    let yaw = if flat.length() > 1e-6 { flat.to_angle() } else { 0.0 };
    // A nose up is a negative pitch about y to the left.
    ActorPose { at, yaw, pitch: -maths::atan2(chord.z, flat.length().max(1e-6)) }
}

/// Metres a second in the sharpest bend just ahead.
fn bend_speed(way: &Line, s: f64) -> f64 {
    let turn = |d: f64| {
        let angle = way.heading(s + d).angle_to(way.heading(s + d + 3.0)).abs();
        angle / 3.0
    };
    let sharpest = [0.0, 4.0, 8.0, 12.0].into_iter().map(turn).fold(0.0, f64::max);
    (SIDEWAYS / sharpest.max(1e-3)).sqrt().max(2.5)
}

/// A way along lanes from `first`, at least `length` metres where lanes go on; branches by lot.
pub(crate) fn way(network: &Network, first: usize, length: f64, rng: &mut ChaCha8Rng) -> Line {
    let mut line = network.lanes[first].centre.clone();
    let mut lane = first;
    for _ in 0..1000 {
        let next = &network.lanes[lane].next;
        if line.length() >= length || next.is_empty() {
            break;
        }
        lane = next[rng.random_range(0..next.len())];
        line.extend(&network.lanes[lane].centre);
    }
    line
}

/// One primitive in the keys of a scene file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct BodyPart {
    class: &'static str,
    #[serde(flatten)]
    solid: Primitive,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    at: Vec<[f64; 2]>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Primitive {
    Box { foot: [f64; 3], size: [f64; 3] },
    Prism { base: Vec<[f64; 2]>, z: [f64; 2] },
    Cylinder { foot: [f64; 3], radius: f64, height: f64, sides: u32 },
}

/// A shape that several actors share.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ActorModel {
    /// Name among the shapes of the scene.
    pub name: String,
    /// `kind` of the actors that have it.
    pub kind: &'static str,
    /// Length, width, height of the box around it; its middle is above the origin.
    pub size: [f64; 3],
    pub parts: Vec<BodyPart>,
}

fn round(v: f64) -> f64 {
    (v * 1000.0).round() / 1000.0
}

fn cuboid(class: &'static str, foot: [f64; 3], size: [f64; 3]) -> BodyPart {
    let solid = Primitive::Box { foot: foot.map(round), size: size.map(round) };
    BodyPart { class, solid, at: Vec::new() }
}

fn prism(class: &'static str, base: &[[f64; 2]], z: [f64; 2]) -> BodyPart {
    let base = base.iter().map(|p| p.map(round)).collect();
    BodyPart { class, solid: Primitive::Prism { base, z: z.map(round) }, at: Vec::new() }
}

fn cylinder(class: &'static str, foot: [f64; 3], radius: f64, height: f64) -> BodyPart {
    let [radius, height] = [radius, height].map(round);
    let solid = Primitive::Cylinder { foot: foot.map(round), radius, height, sides: 8 };
    BodyPart { class, solid, at: Vec::new() }
}

const VEHICLE: &str = "vehicle";
const PERSON: &str = "pedestrian";

/// A model of `kind`, of random size within its body's range.
pub(crate) fn model(kind: &'static str, number: usize, rng: &mut ChaCha8Rng) -> ActorModel {
    let mut draw = |[low, high]: [f64; 2]| round(rng.random_range(low..high));
    let (size, parts) = match kind {
        "van" => van(draw([4.6, 6.2]), draw([1.9, 2.1]), draw([2.0, 2.7])),
        "truck" => truck(draw([7.0, 11.5]), draw([2.4, 2.55]), draw([3.0, 3.9])),
        "bus" => bus(draw([10.5, 13.0]), draw([2.5, 2.55]), draw([2.9, 3.3])),
        "construction" => forklift(draw([2.6, 4.5]), draw([1.2, 1.9]), draw([2.1, 2.7])),
        "motorcycle" => rider(draw([2.0, 2.3]), draw([0.75, 0.9]), true),
        "bicycle" => rider(draw([1.65, 1.85]), draw([0.6, 0.7]), false),
        "pedestrian" => person(draw([1.45, 1.92]), draw([0.42, 0.58])),
        _ => car(number, draw([3.6, 5.0]), draw([1.68, 1.95]), draw([1.4, 1.82])),
    };
    ActorModel { name: format!("{kind}-{number}"), kind, size, parts }
}

/// A body of some length, width and height with pairs of wheels at shares of its length.
fn wheeled(
    size: [f64; 3],
    mut parts: Vec<BodyPart>,
    axles: &[f64],
    radius: f64,
) -> ([f64; 3], Vec<BodyPart>) {
    let side = 0.5 * size[1] - 0.12;
    let mut wheel = cuboid(VEHICLE, [0.0; 3], [2.0 * radius, 0.22, 2.0 * radius]);
    let axle = |x: &f64| [[round(x * size[0]), side], [round(x * size[0]), -side]];
    wheel.at = axles.iter().flat_map(axle).map(|p| p.map(round)).collect();
    parts.push(wheel);
    (size, parts)
}

/// Limousine, estate or hatchback, by number.
fn car(number: usize, length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let (l, w) = (0.5 * length, 0.5 * width);
    let waist = 0.58 * height;
    let right = [[-1.0, -0.92], [-0.9, -1.0], [0.85, -1.0], [1.0, -0.75]]
        .map(|[x, y]: [f64; 2]| [x * l, y * w]);
    let left = [3, 2, 1, 0].map(|k: usize| [right[k][0], -right[k][1]]);
    let lower = prism(VEHICLE, &[right, left].concat(), [0.2, waist]);
    // The cabin: where it begins and ends tells the bodies apart.
    let [rear, front] = [[-0.75, 0.35], [-0.97, 0.4], [-0.9, 0.5]][number % 3];
    let cabin = |inset: f64, z: [f64; 2]| {
        let (a, b, y) = ((rear + inset) * l, (front - 1.6 * inset) * l, (0.9 - 0.7 * inset) * w);
        prism(VEHICLE, &[[a, -y], [b, -y], [b, y], [a, y]], z)
    };
    let middle = 0.5 * (waist + height);
    let parts = vec![lower, cabin(0.0, [waist, middle]), cabin(0.12, [middle, height])];
    wheeled([length, width, height], parts, &[0.3, -0.3], 0.32)
}

fn van(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let bonnet = 0.9;
    let box_length = length - bonnet;
    let parts = vec![
        cuboid(VEHICLE, [-0.5 * bonnet, 0.0, 0.3], [box_length, width, height - 0.3]),
        cuboid(VEHICLE, [0.5 * (length - bonnet), 0.0, 0.3], [bonnet, width - 0.1, 0.85]),
    ];
    wheeled([length, width, height], parts, &[0.32, -0.3], 0.35)
}

fn truck(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let cab = 2.1;
    let load = length - cab - 0.5;
    let parts = vec![
        cuboid(VEHICLE, [0.5 * (length - cab), 0.0, 0.5], [cab, width, 2.3]),
        cuboid(VEHICLE, [-0.5 * length + 0.5 * load, 0.0, 1.0], [load, width, height - 1.0]),
        cuboid(VEHICLE, [-0.3, 0.0, 0.55], [length - 0.8, 0.9, 0.4]),
    ];
    wheeled([length, width, height], parts, &[0.36, -0.26, -0.38], 0.5)
}

fn bus(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let parts = vec![
        cuboid(VEHICLE, [0.0, 0.0, 0.3], [length, width, height - 0.55]),
        cuboid(VEHICLE, [-0.1 * length, 0.0, height - 0.25], [0.4 * length, 0.7 * width, 0.25]),
    ];
    wheeled([length, width, height], parts, &[0.28, -0.25], 0.48)
}

fn forklift(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let parts = vec![
        cuboid(VEHICLE, [-0.12 * length, 0.0, 0.2], [0.56 * length, width, 0.9]),
        cuboid(VEHICLE, [-0.1 * length, 0.0, height - 0.1], [0.35 * length, 0.9 * width, 0.1]),
        cuboid(VEHICLE, [0.2 * length, 0.0, 0.1], [0.12, 0.6 * width, height - 0.1]),
        cuboid(VEHICLE, [0.35 * length, 0.0, 0.15], [0.3 * length, 0.5 * width, 0.08]),
    ];
    wheeled([length, width, height], parts, &[0.1, -0.3], 0.3)
}

/// A bicycle or a motorcycle with its rider.
fn rider(length: f64, width: f64, motor: bool) -> ([f64; 3], Vec<BodyPart>) {
    let wheel = if motor { 0.3 } else { 0.34 };
    let mut tyres =
        cuboid(VEHICLE, [0.0; 3], [2.0 * wheel, if motor { 0.16 } else { 0.05 }, 2.0 * wheel]);
    let axle = round(0.5 * length - wheel);
    tyres.at = vec![[axle, 0.0], [-axle, 0.0]];
    let body = [if motor { 1.1 } else { 0.9 }, if motor { 0.35 } else { 0.06 }, 0.42];
    let parts = vec![
        tyres,
        cuboid(VEHICLE, [0.0, 0.0, 0.42], body),
        cuboid(VEHICLE, [0.28 * length, 0.0, 0.9], [0.06, width, 0.12]),
        cuboid(PERSON, [-0.1, 0.0, 0.35], [0.32, 0.36, 0.6]),
        cuboid(PERSON, [0.02, 0.0, 0.92], [0.36, 0.46, 0.55]),
        cylinder(PERSON, [0.14, 0.0, 1.47], 0.12, 0.26),
    ];
    ([length, width, 1.73], parts)
}

/// A person in the middle of a step.
fn person(height: f64, width: f64) -> ([f64; 3], Vec<BodyPart>) {
    let (leg, head) = (0.48 * height, 0.14 * height);
    let parts = vec![
        cuboid(PERSON, [0.12, 0.11, 0.0], [0.2, 0.15, leg]),
        cuboid(PERSON, [-0.12, -0.11, 0.0], [0.2, 0.15, leg]),
        cuboid(PERSON, [0.0, 0.0, leg], [0.26, width, height - leg - head]),
        cylinder(PERSON, [0.02, 0.0, height - head], 0.11, head),
    ];
    ([0.5, width, height], parts)
}

/// The ego's own body, a car whose roof leaves room for sensors at 2.2 m.
pub(crate) fn ego() -> (Vec<BodyPart>, [f64; 3]) {
    let size = [4.5, 1.8, 1.5];
    let (_, parts) = car(0, size[0], size[1], size[2]);
    (parts, size)
}
