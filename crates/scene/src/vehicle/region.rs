//! A region of a vehicle where sensors may be mounted.

use std::f64::consts::TAU;
use std::sync::Arc;

use glam::DVec3;

use super::pairing::{ROUNDED, SLACK};
use super::{SensorName, SensorPose, Surface};
use crate::scene::around;
use lidar_cast::geom::Pose;
use lidar_cast::maths;

/// Number of the first angle among the fields of a pose.
const FIRST_ANGLE: usize = 3;

/// Where sensors may stand: a box, a flat patch with an outline, or a curved surface, in a frame of its own.
///
/// The six fields of a pose count from the region's frame. For a box along the axes it is the ego frame. For a patch
/// the outward normal is z on a roof, and x on a side. On a surface the frame is that of its mean normal: the field
/// along it counts from the surface, and angles count from a sensor at rest on the surface there.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Name on the vehicle.
    pub name: String,
    /// The region's frame; `None` is the ego frame.
    pub ego_from_region: Option<Pose>,
    /// Lower bounds of x, y, z (m), roll, pitch, yaw (rad) in the region's frame.
    pub lower: [f64; 6],
    /// Upper bounds, same order; equal to the lower one where nothing may vary.
    pub upper: [f64; 6],
    /// Corners of a patch in the plane of two of its axes; empty: the whole box.
    pub outline: Outline,
    /// Curved surface that sensors stand on; `None` where the region is flat.
    pub surface: Option<Arc<Surface>>,
    /// Own body in poses of its own that carries it; none: the vehicle's frame.
    pub rides_on: SensorName,
}

/// A simple polygon across two axes of a region.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// Fields that the corners count along: 0 and 1 on a roof, 1 and 2 on a side.
    pub axes: [usize; 2],
    /// Corners in order, metres; none: no outline.
    pub corners: Vec<[f64; 2]>,
}

/// Name of the one mount of a scene, which has none in its file.
const NAMELESS: &str = "mount";

impl Default for Region {
    fn default() -> Self {
        Self {
            name: NAMELESS.to_owned(),
            ego_from_region: None,
            lower: [0.0; 6],
            upper: [0.0; 6],
            outline: Outline::default(),
            surface: None,
            rides_on: SensorName::NONE,
        }
    }
}

impl Region {
    /// Its name; empty for the one mount of a scene, which has none in its file.
    pub fn own_name(&self) -> &str {
        if self.name == NAMELESS { "" } else { &self.name }
    }

    /// Pose in the ego frame of six fields in the region's.
    ///
    /// On a surface a position over no triangle is moved to the nearest that has one.
    pub fn pose(&self, fields: [f64; 6], sensor: SensorName) -> SensorPose {
        let (pose, rides_on) = (SensorPose::from_values(fields), self.rides_on);
        if let (Some(surface), Some(frame)) = (&self.surface, &self.ego_from_region) {
            let foot = surface.foot(surface.axes.map(|k| fields[k]));
            let rest = surface.rest(frame, &foot, fields[surface.along()]);
            let turned = Pose::new(DVec3::ZERO, fields[3], fields[4], fields[5]);
            let pose = SensorPose::from(&rest.compose(&turned));
            return SensorPose { sensor, rides_on, ..pose };
        }
        let pose = match &self.ego_from_region {
            None => pose,
            Some(frame) => SensorPose::from(&frame.compose(&pose.ego_from_sensor())),
        };
        SensorPose { sensor, rides_on, ..pose }
    }

    /// Six fields in the region's frame of a pose in the ego frame. Angles have the whole turns that bring them nearest to the
    /// bounds: half a turn to the left is half a turn to the right.
    pub fn fields(&self, pose: &SensorPose) -> [f64; 6] {
        let mut fields = self.plain_fields(pose);
        for (k, value) in fields.iter_mut().enumerate().skip(FIRST_ANGLE) {
            let is_nearer = |turned: &f64| self.beyond(k, *turned) < self.beyond(k, *value);
            let turned = [*value - TAU, *value + TAU].into_iter().find(is_nearer);
            if let Some(turned) = turned.filter(|_| self.beyond(k, *value) > ROUNDED) {
                *value = turned;
            }
        }
        fields
    }

    fn plain_fields(&self, pose: &SensorPose) -> [f64; 6] {
        if let (Some(surface), Some(frame)) = (&self.surface, &self.ego_from_region) {
            let mut point = frame.inverse().apply(pose.position());
            let foot = surface.foot(surface.axes.map(|k| point[k]));
            point[surface.along()] -= foot.point[surface.along()];
            let rest = surface.rest(frame, &foot, 0.0);
            let turned = rest.inverse().compose(&pose.ego_from_sensor());
            let [.., roll, pitch, yaw] = SensorPose::from(&turned).values();
            return [point.x, point.y, point.z, roll, pitch, yaw];
        }
        match &self.ego_from_region {
            None => pose.values(),
            Some(frame) => {
                SensorPose::from(&frame.inverse().compose(&pose.ego_from_sensor())).values()
            }
        }
    }

    /// Range of the offsets of a patch, metres outward; `None` of a box.
    pub(crate) fn patch_offsets(&self) -> Option<[f64; 2]> {
        let along = self.patch_normal()?;
        Some([self.lower[along], self.upper[along]])
    }

    /// Places of a patch with an offset, at most so many, in the ego frame: near the corners of its outline, or in the middle
    /// of triangles of its surface.
    pub(crate) fn patch_places(&self, offset: f64, most: usize) -> Vec<DVec3> {
        let (Some(along), Some(frame)) = (self.patch_normal(), &self.ego_from_region) else {
            return Vec::new();
        };
        let flat: Vec<DVec3> = match &self.surface {
            Some(surface) => {
                let middles = surface.facets().map(|f| f.corners.iter().sum::<DVec3>() / 3.0);
                middles.collect()
            }
            None => {
                let place = |corner: &[f64; 2]| {
                    let mut place = DVec3::ZERO;
                    let axes = self.outline.axes.into_iter().zip(corner);
                    axes.for_each(|(axis, metres)| place[axis] = 0.9 * metres);
                    place
                };
                self.outline.corners.iter().map(place).collect()
            }
        };
        let step = flat.len().div_ceil(most.max(1)).max(1);
        let outward = |mut place: DVec3| {
            place[along] += offset;
            frame.apply(place)
        };
        flat.into_iter().step_by(step).take(most).map(outward).collect()
    }

    /// Field along the outward normal of a patch; `None` of a box.
    fn patch_normal(&self) -> Option<usize> {
        let frame = self.ego_from_region.as_ref();
        let [a, b] = frame.map(|_| self.surface.as_ref().map_or(self.outline.axes, |s| s.axes))?;
        (a != b).then(|| 3 - a - b)
    }

    /// Indices of the fields that may vary.
    pub fn free_fields(&self) -> Vec<usize> {
        (0..6).filter(|&k| self.upper[k] > self.lower[k]).collect()
    }

    /// Amount by which a field is out of bounds, below 0 within them.
    fn beyond(&self, k: usize, value: f64) -> f64 {
        (self.lower[k] - value).max(value - self.upper[k])
    }

    /// Fields that are out of bounds and how far, in m or rad; a position beside the outline or over no
    /// triangle of the surface counts for its first axis.
    pub fn outside(&self, pose: &SensorPose) -> Vec<(&'static str, f64)> {
        // A region with a frame is read back through it, which rounds.
        let slack = if self.ego_from_region.is_some() { 1e3 * SLACK } else { SLACK };
        let fields = self.fields(pose);
        let least = |k: usize| if k < FIRST_ANGLE { slack } else { ROUNDED };
        let mut found: Vec<(&'static str, f64)> = (0..6)
            .filter(|&k| self.beyond(k, fields[k]) > least(k))
            .map(|k| (SensorPose::FIELDS[k], self.beyond(k, fields[k])))
            .collect();
        let (beside, axis) = match &self.surface {
            None => (self.outline.distance(fields), self.outline.axes[0]),
            Some(surface) => (surface.foot(surface.axes.map(|k| fields[k])).off, surface.axes[0]),
        };
        if beside > slack {
            found.push((SensorPose::FIELDS[axis], beside));
        }
        found
    }

    /// Height of sensors that are put up plainly, in the region's frame: the top, on the side of a body the
    /// middle, since a surface bends away at its edges.
    pub fn plain_height(&self) -> f64 {
        match &self.surface {
            Some(surface) if surface.along() != 2 => 0.5 * (self.lower[2] + self.upper[2]),
            _ => self.upper[2],
        }
    }

    /// Corners of the outline or of the surface's triangles, in the region's frame, each at both bounds of the third axis.
    pub(super) fn rim(&self) -> Vec<[f64; 3]> {
        let (points, along): (Vec<[f64; 3]>, usize) = match &self.surface {
            Some(surface) => {
                (surface.corners().map(|corner| corner.to_array()).collect(), surface.along())
            }
            None => {
                let Outline { axes: [a, b], corners } = &self.outline;
                let point = |&[x, y]: &[f64; 2]| {
                    let mut point = [0.0; 3];
                    (point[*a], point[*b]) = (x, y);
                    point
                };
                (corners.iter().map(point).collect(), 3 - (a + b).min(3))
            }
        };
        let at = |mut point: [f64; 3], bound: f64| {
            point[along] = bound;
            point
        };
        let bounds = [self.lower[along], self.upper[along]];
        points.into_iter().flat_map(|point| bounds.map(|bound| at(point, bound))).collect()
    }

    /// Corners of the smallest box in the ego frame around all positions.
    pub fn corners(&self) -> [[f64; 3]; 2] {
        let bounds = [self.lower, self.upper];
        let points: Vec<DVec3> = match &self.surface {
            Some(surface) => {
                let lifted = |mut point: DVec3, offset: f64| {
                    point[surface.along()] += offset;
                    point
                };
                let offsets = bounds.map(|bound| bound[surface.along()]);
                let corners = surface.corners();
                corners.flat_map(|point| offsets.map(|offset| lifted(point, offset))).collect()
            }
            None => {
                let side = |corner: usize, k: usize| bounds[corner >> k & 1][k];
                (0..8).map(|c| DVec3::new(side(c, 0), side(c, 1), side(c, 2))).collect()
            }
        };
        let place = |point| self.ego_from_region.map_or(point, |frame| frame.apply(point));
        let ends = around(points.into_iter().map(place));
        ends.unwrap_or_default().map(|corner| corner.to_array())
    }
}

impl Outline {
    /// Metres from the nearest point of the outline; 0 inside of it and where there is none.
    fn distance(&self, fields: [f64; 6]) -> f64 {
        let [x, y] = self.axes.map(|k| fields[k]);
        let corners = &self.corners;
        if corners.is_empty() {
            return 0.0;
        }
        let (mut inside, mut nearest) = (false, f64::INFINITY);
        for (k, &[ax, ay]) in corners.iter().enumerate() {
            let [bx, by] = corners[(k + 1) % corners.len()];
            if (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax) {
                inside = !inside;
            }
            let (dx, dy) = (bx - ax, by - ay);
            let along = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy);
            let along = along.clamp(0.0, 1.0);
            nearest = nearest.min(maths::hypot(ax + along * dx - x, ay + along * dy - y));
        }
        if inside { 0.0 } else { nearest }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn side() -> Region {
        // A door that faces left and up a little.
        let frame = Pose::new(DVec3::new(0.5, 0.9, 1.0), 0.0, -0.2, std::f64::consts::FRAC_PI_2);
        let outline = Outline { axes: [1, 2], corners: vec![[-0.5, 0.0], [0.5, 0.0], [0.0, 0.4]] };
        Region {
            ego_from_region: Some(frame),
            lower: [0.0, -0.5, 0.0, 0.0, -0.1, -0.3],
            upper: [0.0, 0.5, 0.4, 0.0, 0.1, 0.3],
            outline,
            ..Region::default()
        }
    }

    #[test]
    fn a_pose_in_a_region_is_found_again() {
        let region = side();
        for fields in [[0.0, 0.1, 0.2, 0.0, 0.05, -0.2], [0.0, -0.3, 0.1, 0.0, -0.1, 0.3]] {
            let pose = region.pose(fields, SensorName::default());
            let back = region.fields(&pose);
            assert!(fields.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
            assert!(region.outside(&pose).is_empty());
        }
        // The door's normal: the sensor looks left, a little up.
        let ahead = region.pose([0.0; 6], SensorName::default()).ego_from_sensor().rotation.x_axis;
        assert!((ahead - DVec3::new(0.0, 0.2_f64.cos(), 0.2_f64.sin())).length() < 1e-12);
    }

    #[test]
    fn what_lies_beside_the_outline_or_the_bounds_is_outside() {
        let region = side();
        let outside = |fields| region.outside(&region.pose(fields, SensorName::default()));
        // A point in the box, beyond the sloping edge from (0.5, 0) to (0, 0.4).
        let found = outside([0.0, 0.4, 0.3, 0.0, 0.0, 0.0]);
        let want = (0.4 * 0.4 + 0.5 * 0.3 - 0.2) / 0.4_f64.hypot(0.5);
        assert_eq!(found.len(), 1);
        assert!(found[0].0 == "y" && (found[0].1 - want).abs() < 1e-9, "{found:?}");
        let found = outside([0.1, 0.0, 0.1, 0.0, 0.0, 0.5]);
        assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), ["x", "yaw"]);
    }

    #[test]
    fn a_yaw_of_few_digits_and_of_another_turn_is_that_of_the_bounds() {
        let back = Region {
            lower: [0.0, 0.0, 0.0, 0.0, 0.0, PI + 7e-6],
            upper: [0.0, 0.0, 0.0, 0.0, 0.0, 3.3],
            ..Region::default()
        };
        let at = |yaw| SensorPose { yaw, ..SensorPose::default() };
        // Written as 3.1416, 3.14159, -3.1416.
        for yaw in [PI + 7e-6, PI - 3e-6, PI, -PI - 7e-6, -3.0, 3.3 - TAU] {
            assert!(back.outside(&at(yaw)).is_empty(), "{yaw}: {:?}", back.outside(&at(yaw)));
        }
        for (yaw, off) in [(PI - 0.0016, 0.0016), (-2.9, 0.083_185), (0.0, 2.983_185)] {
            let found = back.outside(&at(yaw));
            assert!(found[0].0 == "yaw" && (found[0].1 - off).abs() < 1e-5, "{yaw}: {found:?}");
        }
    }

    #[test]
    fn angles_are_found_at_the_poles_too() {
        for fields in [
            [0.0, 0.0, 0.0, 0.3, -0.2, 2.0],
            [0.0, 0.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2, 0.7],
            [0.0, 0.0, 0.0, 0.0, -std::f64::consts::FRAC_PI_2, -0.7],
        ] {
            let pose = SensorPose::from_values(fields).ego_from_sensor();
            let back = SensorPose::from(&pose);
            assert!(back.difference(&SensorPose::from_values(fields)) < 1e-9, "{back:?}");
        }
    }
}
