//! The own body: its footprint and wheels, and the guards `self_hit` and `below_ground`.

use std::f64::consts::TAU;

use glam::DVec3;

use super::outline;
use crate::cast::closest_hit_in;
use crate::engine::{Backend, BackendError};
use crate::geom::Pose;
use crate::maths;
use crate::problem::{Frame, Problem, SensorBatch, ground_triangles, own_bodies};
use crate::scene::{EgoBody, Scene};
use crate::score::{Guard, MOST_SELF_HITS, percent_up};
use crate::vehicle::{Placement, Region, SensorName, Sensors, UnknownSensor};

/// Convex hull of the own body seen from above: corners in the ego frame, metres, counter-clockwise.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(transparent)]
pub struct Footprint {
    corners: Vec<[f64; 2]>,
}

/// Twice the signed area of a triangle, positive where it turns left.
fn turn([ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]) -> f64 {
    (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
}

impl Footprint {
    /// The hull of points; `None` where they enclose no area.
    ///
    /// Monotone chain (Andrew 1979).
    pub fn of(points: impl IntoIterator<Item = [f64; 2]>) -> Option<Self> {
        let mut points: Vec<[f64; 2]> = points.into_iter().collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        points.dedup();
        let chain = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
            let mut chain: Vec<[f64; 2]> = Vec::new();
            for &point in points {
                while let [.., a, b] = chain[..] {
                    if turn(a, b, point) > 0.0 {
                        break;
                    }
                    chain.pop();
                }
                chain.push(point);
            }
            chain.pop();
            chain
        };
        let mut corners = chain(&mut points.iter());
        corners.extend(chain(&mut points.iter().rev()));
        let footprint = Self { corners };
        (footprint.corners.len() > 2 && footprint.area() > 0.0).then_some(footprint)
    }

    /// Corners, counter-clockwise.
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners
    }

    fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(a, b)| (*a, *b))
    }

    /// Lower and upper corner of the box around it along the axes.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        let fold = |start: f64, least: fn(f64, f64) -> f64| {
            [0, 1].map(|k| self.corners.iter().map(|c| c[k]).fold(start, least))
        };
        [fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max)]
    }

    /// Longer side of the box around it, metres.
    pub fn length(&self) -> f64 {
        let [low, high] = self.bounds();
        (high[0] - low[0]).max(high[1] - low[1])
    }

    /// Middle of the box around it.
    pub fn middle(&self) -> [f64; 2] {
        let [low, high] = self.bounds();
        [0, 1].map(|k| 0.5 * (low[k] + high[k]))
    }

    /// Square metres.
    pub fn area(&self) -> f64 {
        polygon_area(&self.corners)
    }

    /// Metres from the outline to a point outside; 0 inside.
    pub fn distance(&self, point: [f64; 2]) -> f64 {
        if self.edges().all(|(a, b)| turn(a, b, point) >= 0.0) {
            return 0.0;
        }
        let from_edge = |(a, b): ([f64; 2], [f64; 2])| {
            let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
            let length = along[0] * along[0] + along[1] * along[1];
            let share = ((to[0] * along[0] + to[1] * along[1]) / length).clamp(0.0, 1.0);
            maths::hypot(to[0] - share * along[0], to[1] - share * along[1])
        };
        self.edges().map(from_edge).fold(f64::INFINITY, f64::min)
    }

    /// Metres from the middle to the outline in a direction of unit length.
    pub fn reach(&self, direction: [f64; 2]) -> f64 {
        let middle = self.middle();
        let leaving = self.edges().filter_map(|(a, b)| {
            // Outward normal of an edge of a counter-clockwise polygon.
            let normal = [b[1] - a[1], a[0] - b[0]];
            let towards = direction[0] * normal[0] + direction[1] * normal[1];
            let gap = (a[0] - middle[0]) * normal[0] + (a[1] - middle[1]) * normal[1];
            (towards > 0.0).then(|| gap / towards)
        });
        leaving.fold(f64::INFINITY, f64::min).max(0.0)
    }
}

/// Metres above the ground from which on somebody may stand or lie under a part of the body.
const RAISED: f64 = 1.0;
/// Least ground under raised parts of the body that is told of, square metres.
const LEAST_RAISED: f64 = 0.5;

/// Square metres within the outline of the body that only parts reach which are raised everywhere: ground under a boom,
/// which no cell of the near field looks at.
pub(crate) fn under_raised(scene: &Scene, footprint: &Footprint) -> f64 {
    let reaches_down = |triangle: &[[f32; 3]; 3]| triangle.iter().any(|c| f64::from(c[2]) < RAISED);
    let low = scene.body().into_iter().filter(reaches_down).flatten();
    let low = Footprint::of(low.map(|[x, y, _]| [x, y].map(f64::from)));
    footprint.area() - low.map_or(0.0, |low| low.area())
}

/// Sentence on ground under raised parts of a body, which no number on near ground judges; `None` for little of it.
pub(crate) fn under_raised_in_words(scene: &Scene) -> Option<String> {
    let area = under_raised(scene, &outline(scene, 0).ok()?);
    (area >= LEAST_RAISED).then(|| {
        format!(
            "{area:.1} m² within the outline of the body lie under parts that are {RAISED} m up or more; no number judges that \
             ground: ask for a `target` there in `require`"
        )
    })
}

/// Square metres of a polygon without crossings.
fn polygon_area(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let doubled: f64 = corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum();
    0.5 * doubled.abs()
}

/// Metres above and below z = 0 of the ego frame in which ground under the wheels is looked for.
const REACH: f64 = 2.0;
/// Metres below a surface from which the next one is looked for.
const STEP: f64 = 1e-3;
/// Surfaces above each other that are looked at, at most.
const MOST_SURFACES: usize = 64;

/// Heights over the ego frame's plane z = 0 that grow evenly, metres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct WheelPlane {
    /// Place in plan that `height` is of.
    middle: [f64; 2],
    height: f64,
    /// Metres up a metre along x and y.
    slope: [f64; 2],
}

impl WheelPlane {
    /// The plane through the ground under the four corners of the box around a footprint, by least squares; z = 0 where
    /// there is no ground within 2 m of it under one of them.
    pub(crate) fn of(footprint: &Footprint, frame: &Frame, is_ground: &[bool]) -> Self {
        let [low, high] = footprint.bounds();
        let corners = [low, [high[0], low[1]], [low[0], high[1]], high];
        let heights = corners.map(|corner| ground_under(frame, is_ground, corner));
        let [Some(a), Some(b), Some(c), Some(d)] = heights else { return Self::default() };
        let along =
            |ahead: f64, behind: f64, k: usize| (ahead - behind) / (2.0 * (high[k] - low[k]));
        Self {
            middle: footprint.middle(),
            height: (a + b + c + d) / 4.0,
            slope: [along(b + d, a + c, 0), along(c + d, a + b, 1)],
        }
    }

    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let [dx, dy] = [x - self.middle[0], y - self.middle[1]];
        self.height + self.slope[0] * dx + self.slope[1] * dy
    }
}

/// Height of the ground surface nearest to z = 0 straight above or below a place.
fn ground_under(frame: &Frame, is_ground: &[bool], [x, y]: [f64; 2]) -> Option<f64> {
    let mut from = REACH;
    let mut nearest: Option<f64> = None;
    for _ in 0..MOST_SURFACES {
        let pose = Pose { translation: DVec3::new(x, y, from), ..Pose::IDENTITY };
        let range = (from + REACH).max(STEP) as f32;
        let hit = closest_hit_in(frame, &pose, [0.0, 0.0, -1.0], range);
        if !hit.is_hit() {
            break;
        }
        let height = from - f64::from(hit.t);
        let is_ground = is_ground.get(hit.prim as usize) == Some(&true);
        if is_ground && nearest.is_none_or(|known| height.abs() < known.abs()) {
            nearest = Some(height);
        }
        from = height - STEP;
    }
    nearest
}

/// Most placements for which scores include the guard by default: it takes casts of its own.
pub const FEW_PLACEMENTS: usize = 64;

/// Share of each LiDAR's beams that end at the own body in the first frame of a problem of the scene;
/// zeros where beams end at nothing. The body stands nearest and is the same in every frame, so that one
/// frame tells; of bodies that move the largest share of all frames counts, with the number of its first frame.
fn own_shares(
    scene: &Scene,
    problem: &Problem,
    engine: &mut dyn Backend,
    placement: &Placement,
) -> Result<Vec<(f64, Option<usize>)>, BackendError> {
    let own = scene.triangles(EgoBody::Exclude);
    if !problem.ends_at_hits() || scene.triangles(EgoBody::Include) == own {
        return Ok(vec![(0.0, None); placement.lidars.len()]);
    }
    let batch = SensorBatch::new(problem, &placement.lidars, None)?;
    let frames = match scene.has_moving_bodies() {
        true => problem.distinct_frames().into_iter().map(|(frame, _)| frame).collect(),
        false => vec![0],
    };
    let mut shares = vec![(0.0_f64, None); batch.len()];
    for frame in frames {
        let hits = engine.hits(&placement.lidars, frame)?;
        let number = scene.has_moving_bodies().then(|| problem.number_of(frame));
        for (lidar, most) in shares.iter_mut().enumerate() {
            let hits = &hits[batch.beams_of(lidar)];
            let own = hits.iter().filter(|hit| hit.is_hit() && hit.prim as usize >= own);
            let share = own.count() as f64 / hits.len() as f64;
            if share > most.0 {
                *most = (share, number);
            }
        }
    }
    Ok(shares)
}

/// Mount of a LiDAR of a placement by its index, where it has a name.
fn mount_of(scene: &Scene, placement: &Placement) -> impl Fn(usize) -> Option<String> {
    let names = scene.vehicle().mount_names(&placement.lidars);
    let names: Vec<Option<String>> =
        names.into_iter().map(|name| name.map(str::to_owned)).collect();
    move |lidar| names[lidar].clone()
}

/// The guards of a placement's LiDARs that waste more than a quarter of their beams on the own vehicle.
///
/// Casts beams itself: tallies count hits of all LiDARs together, whatever is hit. So most steps of a search do not know
/// this guard; it is for results, layouts given, moves within the mounting tolerance, and swaps that look away from the body.
///
/// # Errors
/// A device that fails, a sensor that the vehicle does not have.
pub fn self_hits(
    scene: &Scene,
    problem: &Problem,
    engine: &mut dyn Backend,
    placement: &Placement,
) -> Result<Vec<Guard>, BackendError> {
    let shares = own_shares(scene, problem, engine, placement)?;
    let much = shares.into_iter().enumerate().filter(|(_, (share, _))| *share > MOST_SELF_HITS);
    let mount = mount_of(scene, placement);
    let guard =
        |(lidar, (share, frame))| Guard::SelfHit { lidar, mount: mount(lidar), share, frame };
    Ok(much.map(guard).collect())
}

/// Share of a LiDAR's beams at the own body above which its mount is said to look into it.
const MOST_INTO_BODY: f64 = 0.5;
/// Directions in all of which the body lies around a place inside it, and metres to its far side.
const AXES: [[f32; 3]; 6] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
];
const INSIDE: f32 = 100.0;
/// Yaws at which a mount is looked at that lets its LiDARs turn all round.
const YAWS: usize = 8;

/// Sentences on mounts that look into the own body: from the middle of the range more than half of a model's beams end
/// there, cast at the bodies of frame 0 alone. A mount that leaves the whole turn free is judged at its best yaw. Boxes
/// whose middle lies inside the body, as those around both flanks, are passed over.
///
/// # Errors
/// A mount with a model that the sensors do not have.
pub fn mounts_into_body(scene: &Scene, sensors: &Sensors) -> Result<Vec<String>, UnknownSensor> {
    let (body, mut told) = (own_bodies(scene, sensors.longest_range().max(INSIDE)), Vec::new());
    for mount in scene.vehicle().mounts.iter().filter(|mount| mount.count[1] > 0) {
        for &model in &mount.sensors {
            let share = share_into_body(&body, &mount.region, sensors, model)?;
            if share <= MOST_INTO_BODY {
                continue;
            }
            let model = if model.is_none() { "its LiDAR" } else { model.as_str() };
            let name = mount.region.own_name();
            let name = if name.is_empty() { String::new() } else { format!(" {name}") };
            let mend = match turns_freely(&mount.region) {
                true => "raise the mount, or let `pitch` look up (negative)",
                false => "turn `yaw` away from the body, or move the mount",
            };
            told.push(format!(
                "mount{name}: in the middle of its range {model} ends {:.1} % of its beams at the own body; {mend}",
                percent_up(share)
            ));
        }
    }
    Ok(told)
}

/// True if a mount leaves the whole turn of yaw free. Bounds of a whole turn are written with a few digits.
fn turns_freely(region: &Region) -> bool {
    region.upper[5] - region.lower[5] > TAU - 0.01
}

/// Share of a model's beams at the own body from the middle of a region, at the best yaw or one that is good enough; 0 inside
/// the body.
fn share_into_body(
    body: &Frame,
    region: &Region,
    sensors: &Sensors,
    model: SensorName,
) -> Result<f64, UnknownSensor> {
    let mut fields = [0, 1, 2, 3, 4, 5].map(|k| 0.5 * (region.lower[k] + region.upper[k]));
    let yaws = if turns_freely(region) { YAWS } else { 1 };
    let mut least = 1.0_f64;
    for _ in 0..yaws {
        let pose = region.pose(fields, model);
        let level = Pose { translation: pose.position(), ..Pose::IDENTITY };
        let ends = |along: &[f32; 3]| closest_hit_in(body, &level, *along, INSIDE).is_hit();
        if AXES.iter().all(ends) {
            return Ok(0.0);
        }
        let number = sensors.number(&pose)?;
        let (table, stands) = (sensors.table(number), sensors.ego_from_sensor(number, &pose, 0));
        let directions = table.directions();
        let is_own =
            |along: &&[f32; 3]| closest_hit_in(body, &stands, **along, table.range()).is_hit();
        let own = directions.iter().filter(is_own).count();
        least = least.min(own as f64 / directions.len() as f64);
        if least <= MOST_INTO_BODY {
            break;
        }
        fields[5] += TAU / yaws as f64;
    }
    Ok(least)
}

/// The guards of a placement's LiDARs below the ground: below z = 0, and below the plane under the wheels in the first frame,
/// since the origin of a scene's ego frame may be as high as a sensor.
pub fn below_ground(scene: &Scene, problem: &Problem, placement: &Placement) -> Vec<Guard> {
    let lidars = placement.lidars.iter().enumerate();
    let low: Vec<_> = lidars.filter(|(_, pose)| pose.z < 0.0).collect();
    if low.is_empty() {
        return Vec::new();
    }
    // Without an own body nothing says where the wheels stand.
    let (Ok(footprint), Some(frame)) = (outline(scene, 0), problem.geometry(0)) else {
        return Vec::new();
    };
    let plane = WheelPlane::of(&footprint, frame, &ground_triangles(scene));
    let below = low.into_iter().map(|(lidar, pose)| (lidar, plane.at([pose.x, pose.y]) - pose.z));
    let below = below.filter(|(_, depth)| *depth > 0.0);
    let mount = mount_of(scene, placement);
    below.map(|(lidar, depth)| Guard::BelowGround { lidar, mount: mount(lidar), depth }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_with_points_inside_and_on_its_edges() {
        let corners = [[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]];
        let others = [[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [1.0, -1.0]];
        let hull = Footprint::of(others.into_iter().chain(corners)).unwrap();
        assert_eq!(hull.corners(), corners);
        assert_eq!((hull.area(), hull.middle()), (8.0, [0.0, 0.0]));
        assert_eq!(hull.distance([1.9, 0.9]), 0.0);
        assert_eq!(hull.distance([5.0, 0.0]), 3.0);
        assert_eq!(hull.distance([5.0, 5.0]), 5.0);
        assert_eq!(hull.reach([1.0, 0.0]), 2.0);
        assert!((hull.reach([0.6, 0.8]) - 1.25).abs() < 1e-12);
    }

    #[test]
    fn points_on_a_line_are_no_outline() {
        assert_eq!(Footprint::of([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
        assert_eq!(Footprint::of([]), None);
    }
}
