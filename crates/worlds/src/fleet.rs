//! Shapes of things that move: vehicles of several bodies, riders, people. x is ahead, the foot at z = 0.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// One primitive in the keys of a scene file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BodyPart {
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
pub struct ActorModel {
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
pub fn model(kind: &'static str, number: usize, rng: &mut ChaCha8Rng) -> ActorModel {
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

fn wheels(parts: &mut Vec<BodyPart>, size: [f64; 2], axles: &[f64], radius: f64) {
    let side = 0.5 * size[1] - 0.12;
    let mut wheel = cuboid(VEHICLE, [0.0; 3], [2.0 * radius, 0.22, 2.0 * radius]);
    let axle = |x: &f64| [[round(x * size[0]), side], [round(x * size[0]), -side]];
    wheel.at = axles.iter().flat_map(axle).map(|p| p.map(round)).collect();
    parts.push(wheel);
}

/// Limousine, estate or hatchback, by number.
fn car(number: usize, length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let (l, w) = (0.5 * length, 0.5 * width);
    let waist = 0.58 * height;
    let lower = prism(
        VEHICLE,
        &[
            [-l, -0.92 * w],
            [-0.9 * l, -w],
            [0.85 * l, -w],
            [l, -0.75 * w],
            [l, 0.75 * w],
            [0.85 * l, w],
            [-0.9 * l, w],
            [-l, 0.92 * w],
        ],
        [0.2, waist],
    );
    // The cabin: where it begins and ends tells the bodies apart.
    let [rear, front] = [[-0.75, 0.35], [-0.97, 0.4], [-0.9, 0.5]][number % 3];
    let cabin = |inset: f64, z: [f64; 2]| {
        let (a, b, y) = ((rear + inset) * l, (front - 1.6 * inset) * l, (0.9 - 0.7 * inset) * w);
        prism(VEHICLE, &[[a, -y], [b, -y], [b, y], [a, y]], z)
    };
    let middle = 0.5 * (waist + height);
    let mut parts = vec![lower, cabin(0.0, [waist, middle]), cabin(0.12, [middle, height])];
    wheels(&mut parts, [length, width], &[0.3, -0.3], 0.32);
    ([length, width, height], parts)
}

fn van(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let bonnet = 0.9;
    let box_length = length - bonnet;
    let mut parts = vec![
        cuboid(VEHICLE, [-0.5 * bonnet, 0.0, 0.3], [box_length, width, height - 0.3]),
        cuboid(VEHICLE, [0.5 * (length - bonnet), 0.0, 0.3], [bonnet, width - 0.1, 0.85]),
    ];
    wheels(&mut parts, [length, width], &[0.32, -0.3], 0.35);
    ([length, width, height], parts)
}

fn truck(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let cab = 2.1;
    let load = length - cab - 0.5;
    let mut parts = vec![
        cuboid(VEHICLE, [0.5 * (length - cab), 0.0, 0.5], [cab, width, 2.3]),
        cuboid(VEHICLE, [-0.5 * length + 0.5 * load, 0.0, 1.0], [load, width, height - 1.0]),
        cuboid(VEHICLE, [-0.3, 0.0, 0.55], [length - 0.8, 0.9, 0.4]),
    ];
    wheels(&mut parts, [length, width], &[0.36, -0.26, -0.38], 0.5);
    ([length, width, height], parts)
}

fn bus(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let mut parts = vec![
        cuboid(VEHICLE, [0.0, 0.0, 0.3], [length, width, height - 0.55]),
        cuboid(VEHICLE, [-0.1 * length, 0.0, height - 0.25], [0.4 * length, 0.7 * width, 0.25]),
    ];
    wheels(&mut parts, [length, width], &[0.28, -0.25], 0.48);
    ([length, width, height], parts)
}

fn forklift(length: f64, width: f64, height: f64) -> ([f64; 3], Vec<BodyPart>) {
    let mut parts = vec![
        cuboid(VEHICLE, [-0.12 * length, 0.0, 0.2], [0.56 * length, width, 0.9]),
        cuboid(VEHICLE, [-0.1 * length, 0.0, height - 0.1], [0.35 * length, 0.9 * width, 0.1]),
        cuboid(VEHICLE, [0.2 * length, 0.0, 0.1], [0.12, 0.6 * width, height - 0.1]),
        cuboid(VEHICLE, [0.35 * length, 0.0, 0.15], [0.3 * length, 0.5 * width, 0.08]),
    ];
    wheels(&mut parts, [length, width], &[0.1, -0.3], 0.3);
    ([length, width, height], parts)
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
pub fn ego() -> (Vec<BodyPart>, [f64; 3]) {
    let size = [4.5, 1.8, 1.5];
    let (_, parts) = car(0, size[0], size[1], size[2]);
    (parts, size)
}
