//! Fields of view as sets of directions, and the share of the sphere that two of them have in common.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use rayon::prelude::*;

use crate::bvh::Hit;
use crate::engine::cast_rays;
use crate::geom::Pose;
use crate::maths;
use crate::problem::Frame;
use crate::vehicle::{BeamTable, OtherSensor};

/// Directions all over the sphere that shares are counted over, each of an equal part of it.
const DIRECTIONS: u32 = 200_000;
/// Azimuth sectors of a sensor whose directions are a list.
const SECTORS: usize = 180;
/// Radians by which a border may be off through rounding.
const SLACK: f64 = 1e-9;
/// Least gap between azimuths, radians, that makes a field of view a sector: 20°.
const LEAST_GAP: f64 = PI / 9.0;
/// Radians around an azimuth in which listed directions count for it: 3°.
const NEARBY: f64 = PI / 60.0;

/// Directions that a sensor looks into, in its own frame: a range of elevations in a range of azimuths.
///
/// A sensor of channels and azimuth steps looks from its lowest to its highest channel, all round if it turns, else
/// from its first to its last azimuth. A list of directions is cut into 180 sectors of azimuth; in each it looks from
/// the lowest to the highest beam.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FieldOfView {
    /// First azimuth and width; lowest and highest elevation; radians.
    parts: Vec<([f64; 2], [f64; 2])>,
}

/// Azimuth and elevation of a direction, radians.
fn angles(direction: DVec3) -> [f64; 2] {
    let flat = maths::hypot(direction.x, direction.y);
    [maths::atan2(direction.y, direction.x), maths::atan2(direction.z, flat)]
}

fn widened([low, high]: [f64; 2], value: f64) -> [f64; 2] {
    [low.min(value), high.max(value)]
}

impl FieldOfView {
    pub(crate) fn of(table: &BeamTable) -> Self {
        const NONE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];
        if let Some(grid) = table.grid() {
            let of_channels =
                |value: fn(&(f64, f64)) -> f64| grid.channels.iter().map(value).fold(NONE, widened);
            let (elevation, offset) = (of_channels(|c| c.0), of_channels(|c| c.1));
            let swept = grid.step * (grid.steps - 1) as f64 + offset[1] - offset[0];
            let azimuth = match grid.turn {
                true => [0.0, TAU],
                false => [grid.start + offset[0], swept.min(TAU)],
            };
            return Self { parts: vec![(azimuth, elevation)] };
        }
        let mut elevations = vec![NONE; SECTORS];
        let width = TAU / SECTORS as f64;
        for direction in table.directions() {
            let [azimuth, elevation] = angles(DVec3::from(direction.map(f64::from)));
            let sector = ((azimuth + PI) / width) as usize;
            let range = &mut elevations[sector.min(SECTORS - 1)];
            *range = widened(*range, elevation);
        }
        let sectors = elevations.into_iter().enumerate();
        let part = |(k, elevation)| ([k as f64 * width - PI, width], elevation);
        Self { parts: sectors.map(part).filter(|(_, [low, high])| low <= high).collect() }
    }

    /// First azimuth and width of the narrowest sector that all directions lie in, radians; `None` where they leave no
    /// gap of 20° or more.
    pub(crate) fn sector(&self) -> Option<[f64; 2]> {
        let mut parts: Vec<[f64; 2]> = self.parts.iter().map(|(azimuth, _)| *azimuth).collect();
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let next = parts.iter().map(|part| part[0]).cycle().skip(1);
        // The gap behind each part, up to the next one or around to the first.
        let gap = |([from, width], next): (&[f64; 2], f64)| {
            let end = from + width;
            let gap = if next > *from { next - end } else { next + TAU - end };
            (gap, next)
        };
        let (gap, from) = parts.iter().zip(next).map(gap).max_by(|a, b| a.0.total_cmp(&b.0))?;
        (gap >= LEAST_GAP).then_some([from, TAU - gap])
    }

    /// Lowest and highest elevation at an azimuth, radians; of listed directions those within 3° of it.
    pub(crate) fn elevations(&self, azimuth: f64) -> Option<[f64; 2]> {
        let beside = if self.parts.len() > 1 { NEARBY } else { SLACK };
        let near = self.parts.iter().filter(|([from, width], _)| {
            (azimuth - from + beside).rem_euclid(TAU) <= width + 2.0 * beside
        });
        near.map(|(_, range)| *range).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// True if a direction in the sensor's frame lies in it.
    fn holds(&self, direction: DVec3) -> bool {
        let [azimuth, elevation] = angles(direction);
        self.parts.iter().any(|([from, width], [low, high])| {
            let turned = (azimuth - from + SLACK).rem_euclid(TAU);
            elevation >= low - SLACK && elevation <= high + SLACK && turned <= width + 2.0 * SLACK
        })
    }
}

/// Unit directions spread evenly over the sphere: a Fibonacci lattice.
fn direction(k: u32) -> DVec3 {
    let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(DIRECTIONS);
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let flat = (1.0 - z * z).sqrt();
    let (sin, cos) = maths::sin_cos((golden * f64::from(k)).rem_euclid(TAU));
    DVec3::new(flat * cos, flat * sin, z)
}

/// Share of the sphere, `[lidars][lidars]`, that lies in the fields of view of two LiDARs at some attitudes; on the
/// diagonal each one's own.
pub(super) fn shared_directions(all: &[(FieldOfView, Pose)]) -> Vec<Vec<f64>> {
    let count = all.len();
    let empty = || vec![0_u32; count * count];
    let add = |mut sums: Vec<u32>, k: u32| {
        let direction = direction(k);
        let held =
            |(view, pose): &(FieldOfView, Pose)| view.holds(pose.rotation.transpose() * direction);
        let held: Vec<usize> = (0..count).filter(|&lidar| held(&all[lidar])).collect();
        for a in &held {
            held.iter().for_each(|b| sums[a * count + b] += 1);
        }
        sums
    };
    let both = |mut sums: Vec<u32>, other: Vec<u32>| {
        sums.iter_mut().zip(other).for_each(|(sum, more)| *sum += more);
        sums
    };
    let sums = (0..DIRECTIONS).into_par_iter().fold(empty, add).reduce(empty, both);
    let share = |&sum: &u32| f64::from(sum) / f64::from(DIRECTIONS);
    sums.chunks(count.max(1)).map(|row| row.iter().map(share).collect()).collect()
}

/// Metres before a point within which a surface does not hide it: a point of a surface must not hide itself by rounding.
const SURFACE_SLACK: f64 = 0.01;
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
    pub(super) fn new(sensors: &[OtherSensor]) -> Self {
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
    pub(super) fn see(&self, frame: Option<&Frame>, boxes: &[Box3]) -> Vec<Vec<bool>> {
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
        !hit.is_hit() || f64::from(hit.t) * along.length() >= enters - SURFACE_SLACK
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

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    /// Shares of two sensors at roll, pitch and yaw: own, own, shared.
    fn shares(tables: [&BeamTable; 2], attitudes: [[f64; 3]; 2]) -> [f64; 3] {
        let posed = |k: usize| {
            let [roll, pitch, yaw] = attitudes[k];
            (
                FieldOfView::of(tables[k]),
                Pose::new(DVec3::new(3.0 * k as f64, 1.0, 2.0), roll, pitch, yaw),
            )
        };
        let found = shared_directions(&[posed(0), posed(1)]);
        assert_eq!(found[0][1], found[1][0]);
        [found[0][0], found[1][1], found[0][1]]
    }

    fn assert_near(found: [f64; 3], wanted: [f64; 3]) {
        assert!(
            found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 2e-4),
            "{found:?} {wanted:?}"
        );
    }

    /// Half of the sphere on the side of +x.
    fn half() -> BeamTable {
        let channels: Vec<(f64, f64)> = (-9..=9).map(|k| (10.0 * f64::from(k), 0.0)).collect();
        BeamTable::sector(&channels, [-90.0, 10.0], 19, 50.0).unwrap()
    }

    #[test]
    fn identical_and_opposite_sensors() {
        let half = half();
        let turned = |yaw: f64| shares([&half, &half], [[0.0; 3], [0.0, 0.0, yaw]]);
        assert_near(turned(0.0), [0.5, 0.5, 0.5]);
        assert_near(turned(PI), [0.5, 0.5, 0.0]);
        assert_near(turned(FRAC_PI_2), [0.5, 0.5, 0.25]);
        // Two half-spaces whose axes are an angle apart share (π − angle) / 2π of the sphere.
        assert_near(turned(0.7), [0.5, 0.5, (PI - 0.7) / TAU]);
        let tilted = shares([&half, &half], [[0.3, 0.4, 0.5], [0.3, 0.4, 0.5]]);
        assert_near(tilted, [0.5; 3]);
    }

    #[test]
    fn bands_of_turning_sensors() {
        let band = |low: f64, high: f64| {
            BeamTable::spinning(&[(low, 0.0), (high, 3.0)], 360, 50.0).unwrap()
        };
        let area = |low: f64, high: f64| 0.5 * (high.to_radians().sin() - low.to_radians().sin());
        let (wide, narrow) = (band(-30.0, 10.0), band(-5.0, 20.0));
        let wanted = [area(-30.0, 10.0), area(-5.0, 20.0), area(-5.0, 10.0)];
        assert_near(shares([&wide, &narrow], [[0.0, 0.0, 1.0], [0.0; 3]]), wanted);
        // Upside down the band runs from −10° to 30°.
        let wanted = [area(-30.0, 10.0), area(-5.0, 20.0), area(-5.0, 20.0)];
        assert_near(shares([&wide, &narrow], [[PI, 0.0, 1.0], [0.0; 3]]), wanted);
        // One channel has no solid angle.
        assert_near(shares([&wide, &band(0.0, 0.0)], [[0.0; 3]; 2]), [area(-30.0, 10.0), 0.0, 0.0]);
    }

    #[test]
    fn a_list_of_directions_looks_where_its_beams_are() {
        // Beams within 20° of +x: a cap of (1 − cos 20°) / 2 of the sphere, to the width of a sector.
        let cap = 20.0_f64.to_radians();
        let beams = (0..DIRECTIONS).map(direction).filter(|d| d.x >= cap.cos());
        let table = BeamTable::from_directions(beams, 50.0).unwrap();
        let [own, _, shared] = shares([&table, &half()], [[0.0; 3], [0.0, 0.0, 1.0]]);
        let wanted = 0.5 * (1.0 - cap.cos());
        assert!((own / wanted - 1.0).abs() < 0.05, "{own} {wanted}");
        // The half that is turned by 1 rad begins at 1 − π/2 = −0.57 rad, beyond the cap's border of −0.35.
        assert_eq!(shared, own);
        let [.., shared] = shares([&table, &half()], [[0.0; 3], [0.0, 0.0, FRAC_PI_2]]);
        assert!((shared / own - 0.5).abs() < 0.03, "{shared} of {own}");
    }
}
