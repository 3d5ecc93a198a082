//! Points and boxes that sensors of other technologies see: in the cone, and nothing of a frame in between.

use glam::DVec3;
use rayon::prelude::*;

use crate::bvh::Hit;
use crate::engine::cast_rays;
use crate::problem::Frame;
use crate::vehicle::OtherSensor;

/// Metres before a point within which a surface does not hide it: a point of a surface must not hide itself by rounding.
const SLACK: f64 = 0.01;
/// Directions of a cone, squared, by which the share that the own body blocks is found.
const LOOKS: usize = 24;

/// Lower and upper corner in the ego frame, metres; equal ones for a point.
pub(super) type Box3 = [DVec3; 2];

/// Sensors of a vehicle by technology.
#[derive(Debug, Clone, Default)]
pub(super) struct Cones {
    /// Each technology with its sensors, in the order of the vehicle.
    pub technologies: Vec<(String, Vec<OtherSensor>)>,
}

impl Cones {
    pub fn new(sensors: &[OtherSensor]) -> Self {
        let mut technologies: Vec<(String, Vec<OtherSensor>)> = Vec::new();
        for sensor in sensors {
            match technologies.iter_mut().find(|(word, _)| *word == sensor.technology) {
                Some((_, of)) => of.push(sensor.clone()),
                None => technologies.push((sensor.technology.clone(), vec![sensor.clone()])),
            }
        }
        Self { technologies }
    }

    /// True for each box that at least one sensor of a technology sees, a list a technology; nothing is in between where
    /// there is no frame.
    pub fn see(&self, frame: Option<&Frame>, boxes: &[Box3]) -> Vec<Vec<bool>> {
        let seen_by = |(_, sensors): &(String, Vec<OtherSensor>)| {
            let mut seen = vec![false; boxes.len()];
            sensors.iter().for_each(|sensor| mark_seen(sensor, frame, boxes, &mut seen));
            seen
        };
        self.technologies.iter().map(seen_by).collect()
    }
}

/// Share of a sensor's field of view in which the own body is within its range.
pub(super) fn blocked_share(sensor: &OtherSensor, body: &Frame) -> f64 {
    let from = sensor.position();
    let rays: Vec<[f32; 6]> = sensor.directions(LOOKS).map(|along| ray(from, along)).collect();
    let hits = cast_rays(body, &rays, sensor.range as f32);
    hits.iter().filter(|hit| hit.is_hit()).count() as f64 / hits.len() as f64
}

/// Marks the boxes that a sensor sees: the middle first, then the middles of up to three faces that are turned to it.
fn mark_seen(sensor: &OtherSensor, frame: Option<&Frame>, boxes: &[Box3], seen: &mut [bool]) {
    for point in 0..4 {
        let look = |(k, of): (usize, &Box3)| -> Option<(usize, DVec3)> {
            let at = point_of(of, sensor.position(), point).filter(|_| !seen[k])?;
            sensor.holds(at).then_some((k, at))
        };
        let looks: Vec<(usize, DVec3)> = boxes.par_iter().enumerate().filter_map(look).collect();
        let open = match frame {
            Some(frame) => are_open(sensor.position(), frame, boxes, &looks),
            None => vec![true; looks.len()],
        };
        looks.iter().zip(open).for_each(|((k, _), open)| seen[*k] |= open);
    }
}

/// The middle of a box for 0; for 1 to 3 the middle of its face across x, y and z that is turned to a place, `None` where
/// none is. A point has no faces.
fn point_of([low, high]: &Box3, from: DVec3, point: usize) -> Option<DVec3> {
    let mut middle = 0.5 * (*low + *high);
    let Some(axis) = point.checked_sub(1) else { return Some(middle) };
    let is_beside = from[axis] < low[axis] || from[axis] > high[axis];
    if low == high || !is_beside {
        return None;
    }
    middle[axis] = from[axis].clamp(low[axis], high[axis]);
    Some(middle)
}

/// True for each look at a point of a box if no surface is hit before the ray to the point enters the box.
fn are_open(from: DVec3, frame: &Frame, boxes: &[Box3], looks: &[(usize, DVec3)]) -> Vec<bool> {
    let rays: Vec<[f32; 6]> = looks.par_iter().map(|(_, at)| ray(from, *at - from)).collect();
    // Distances count in lengths of the ray: the point lies at 1.
    let farthest = looks.iter().map(|(_, at)| from.distance(*at)).fold(0.0, f64::max);
    let hits = cast_rays(frame, &rays, farthest as f32);
    let is_open = |((k, at), hit): (&(usize, DVec3), &Hit)| {
        let along = *at - from;
        let enters = entry(&boxes[*k], from, along) * along.length();
        !hit.is_hit() || f64::from(hit.t) * along.length() >= enters - SLACK
    };
    looks.par_iter().zip(&hits).map(is_open).collect()
}

fn ray(from: DVec3, along: DVec3) -> [f32; 6] {
    [from.x, from.y, from.z, along.x, along.y, along.z].map(|v| v as f32)
}

/// Share of the way to a point of a box after which the way is in the box; 0 from inside.
fn entry([low, high]: &Box3, from: DVec3, along: DVec3) -> f64 {
    let enters = (0..3).map(|axis| {
        let to_face = from[axis].clamp(low[axis], high[axis]) - from[axis];
        if to_face == 0.0 { 0.0 } else { to_face / along[axis] }
    });
    enters.fold(0.0, f64::max).min(1.0)
}
