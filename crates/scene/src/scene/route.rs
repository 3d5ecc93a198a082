//! Where the ego and the actors stand in each frame.

use glam::DVec3;

use super::description::{PoseDescription, RouteDescription};
use lidar_cast::geom::{Glide, Pose};
use lidar_cast::maths;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location};

/// A pose for every frame.
#[derive(Debug, Clone)]
pub(crate) enum Motion {
    /// No motion: one pose for all frames.
    Still,
    Poses(Vec<Pose>),
    Route(Route),
}

impl Motion {
    /// Reads `poses` or `route` of the object at `at`; `None` where it has neither. On a route things pitch with the slope
    /// unless they stay `upright`.
    pub(crate) fn new(
        at: &Location,
        poses: Option<&[PoseDescription]>,
        route: Option<&RouteDescription>,
        upright: bool,
    ) -> Checked<Option<Self>> {
        match (poses, route) {
            (None, None) => Ok(None),
            (Some(poses), None) => {
                let at = at.key("poses");
                if poses.is_empty() {
                    let wanted = "a list of at least one pose; add one for each frame";
                    return Err(bad(&at, "an empty list", wanted));
                }
                let read = poses.iter().enumerate().map(|(i, p)| pose(&at.item(i), p));
                Ok(Some(Self::Poses(read.collect::<Result<_, _>>()?)))
            }
            (None, Some(route)) => {
                Ok(Some(Self::Route(Route::new(&at.key("route"), route, upright)?)))
            }
            (Some(_), Some(_)) => Err(check::choice(at, &["poses", "route"], &["poses", "route"])),
        }
    }

    /// Checks for one explicit pose a frame.
    pub(crate) fn check_frames(&self, at: &Location, frames: usize) -> Checked<()> {
        match self {
            Self::Poses(poses) if poses.len() != frames => {
                let value = format!("a list of {}", poses.len());
                Err(bad(
                    &at.key("poses"),
                    value,
                    format!("one pose for each of the {frames} frames"),
                ))
            }
            _ => Ok(()),
        }
    }

    /// The way from frame `t` to the next, on a straight line and turning evenly; after the last frame things
    /// go on as they came.
    pub(crate) fn glide(&self, t: usize) -> Glide {
        let here = self.pose(t);
        let next = match self {
            Self::Still => here,
            Self::Poses(poses) => match (poses.get(t + 1), t.checked_sub(1)) {
                (Some(next), _) => *next,
                (None, Some(before)) => Glide::new(&poses[before], &here).at(2.0),
                (None, None) => here,
            },
            Self::Route(route) => route.pose(t + 1),
        };
        Glide::new(&here, &next)
    }

    /// Pose in frame `t`, below the number of frames.
    pub(crate) fn pose(&self, t: usize) -> Pose {
        match self {
            Self::Still => Pose::IDENTITY,
            Self::Poses(poses) => poses[t],
            Self::Route(route) => route.pose(t),
        }
    }
}

fn pose(at: &Location, p: &PoseDescription) -> Checked<Pose> {
    let x = check::metres(&at.key("x"), p.x)?;
    let y = check::metres(&at.key("y"), p.y)?;
    let z = check::metres(&at.key("z"), p.z)?;
    let roll = check::radians(&at.key("roll"), p.roll)?;
    let pitch = check::radians(&at.key("pitch"), p.pitch)?;
    let yaw = check::heading(&at.key("yaw"), p.yaw)?;
    Ok(Pose::new(DVec3::new(x, y, z), roll, pitch, yaw))
}

/// A polyline travelled at `spacing` metres a frame, heading along it, nose up where it climbs.
///
/// The end segments go on straight before the first and after the last point.
#[derive(Debug, Clone)]
pub(crate) struct Route {
    points: Vec<DVec3>,
    /// Length of the line up to each point, in metres.
    along: Vec<f64>,
    start: f64,
    /// Metres from frame to frame.
    pub spacing: f64,
    /// Level on slopes, too.
    upright: bool,
}

impl Route {
    fn new(at: &Location, route: &RouteDescription, upright: bool) -> Checked<Self> {
        let here = at.key("points");
        if route.points.len() < 2 {
            let value = format!("a list of {}", route.points.len());
            return Err(bad(&here, value, "a route: give two points or more"));
        }
        let mut points: Vec<DVec3> = Vec::with_capacity(route.points.len());
        let mut along = vec![0.0];
        for (i, p) in route.points.iter().enumerate() {
            let p = DVec3::from(check::point_2_or_3(&here.item(i), p)?);
            if let (Some(&last), Some(&so_far)) = (points.last(), along.last()) {
                if (p - last).truncate().length() < 1e-6 {
                    let wanted = "ahead of the point before it: a heading needs a step in x or y";
                    return Err(bad(&here.item(i), format!("{:?}", route.points[i]), wanted));
                }
                along.push(so_far + (p - last).length());
            }
            points.push(p);
        }
        let start = check::metres(&at.key("start"), route.start)?;
        let spacing = route.spacing;
        // Capped so that frame 10 000 still lies within the largest coordinate.
        if spacing.abs() > 1.0e4 {
            return Err(bad(&at.key("spacing"), spacing, "a step of at most 10000 m a frame"));
        }
        Ok(Self { points, along, start, spacing, upright })
    }

    fn pose(&self, t: usize) -> Pose {
        let distance = self.start + t as f64 * self.spacing;
        let last = self.points.len() - 2;
        // Last segment that starts at or before the distance; the end segments go on straight.
        let segment = self.along.partition_point(|&a| a <= distance).saturating_sub(1).min(last);
        let (from, to) = (self.points[segment], self.points[segment + 1]);
        let heading = (to - from).normalize();
        let position = from + heading * (distance - self.along[segment]);
        // A positive pitch lowers the nose.
        let pitch = match self.upright || heading.z == 0.0 {
            true => 0.0,
            false => -maths::atan2(heading.z, heading.truncate().length()),
        };
        Pose::new(position, 0.0, pitch, maths::atan2(heading.y, heading.x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn route(points: &[[f64; 2]], start: f64, spacing: f64) -> Route {
        let points = points.iter().map(|p| p.to_vec()).collect();
        Route::new(&Location::top("t"), &RouteDescription { points, start, spacing }, false)
            .unwrap()
    }

    #[test]
    fn a_route_is_travelled_at_its_spacing_and_goes_on_straight() {
        let r = route(&[[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]], -2.0, 4.0);
        let expected = [
            (-2.0, 0.0),
            (2.0, 0.0),
            (6.0, 0.0),
            (10.0, 0.0),
            (10.0, 4.0),
            (10.0, 8.0),
            (10.0, 12.0),
        ];
        for (t, (x, y)) in expected.into_iter().enumerate() {
            let p = r.pose(t);
            assert!((p.translation - DVec3::new(x, y, 0.0)).length() < 1e-12, "{t}: {p:?}");
            let ahead = if t < 3 { DVec3::X } else { DVec3::Y };
            assert!((p.rotation * DVec3::X - ahead).length() < 1e-12, "{t}: {p:?}");
        }
    }

    #[test]
    fn spacing_zero_parks_and_negative_spacing_reverses_without_turning() {
        assert_eq!(route(&[[0.0, 0.0], [5.0, 0.0]], 3.0, 0.0).pose(7).translation.x, 3.0);
        let p = route(&[[0.0, 0.0], [5.0, 0.0]], 3.0, -1.0).pose(5);
        assert_eq!(p.translation.x, -2.0);
        assert_eq!(p.rotation * DVec3::X, DVec3::X);
    }

    #[test]
    fn between_two_frames_things_move_evenly_and_after_the_last_they_go_on() {
        let at = |x, yaw| Pose::new(DVec3::new(x, 0.0, 0.0), 0.0, 0.0, yaw);
        let motion = Motion::Poses(vec![at(0.0, 3.0), at(2.0, -3.0)]);
        assert_eq!(motion.glide(0).at(0.0), at(0.0, 3.0), "to the bit");
        // From 3 to −3 rad the short way is forward, through π.
        let turn = std::f64::consts::TAU - 6.0;
        for (t, share, x, yaw) in
            [(0, 0.25, 0.5, 3.0 + 0.25 * turn), (1, 0.5, 3.0, 3.0 + 1.5 * turn)]
        {
            let (found, expected) = (motion.glide(t).at(share), at(x, yaw));
            assert!((found.translation - expected.translation).length() < 1e-12, "{found:?}");
            assert!((found.rotation * DVec3::X - expected.rotation * DVec3::X).length() < 1e-12);
        }
        let alone = Motion::Poses(vec![at(1.0, 0.5)]);
        assert_eq!(alone.glide(0).at(0.7), at(1.0, 0.5), "what moves nobody knows");
    }

    #[test]
    fn metres_are_counted_along_the_slope_and_only_what_rolls_pitches_with_it() {
        let slope = RouteDescription {
            points: vec![vec![0.0, 0.0, 0.0], vec![3.0, 0.0, 4.0]],
            start: 0.0,
            spacing: 2.5,
        };
        for (upright, ahead) in [(true, DVec3::X), (false, DVec3::new(0.6, 0.0, 0.8))] {
            let p = Route::new(&Location::top("t"), &slope, upright).unwrap().pose(1);
            assert!((p.translation - DVec3::new(1.5, 0.0, 2.0)).length() < 1e-12);
            assert!((p.rotation * DVec3::X - ahead).length() < 1e-12);
            assert!((p.rotation * DVec3::Y - DVec3::Y).length() < 1e-12);
        }
    }
}
