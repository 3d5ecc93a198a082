//! Boxes around CARLA's actors, from their points: CARLA's scans number the actors and say no more.
//!
//! A box holds the visible points of its actor. Sides that no beam reached are not in it, so it may be too short,
//! and its middle lies nearer to the LiDAR than the actor's.

use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3};

use super::super::{BoxTrack, TrackPose};
use super::tags::Tag;
use lidar_cast::geom::Pose;
use lidar_cast::maths;

/// Shortest step between frames whose direction is a heading, metres.
const STEP: f64 = 0.3;
/// Least edge of a box, metres.
const LEAST: f64 = 0.1;

/// Points of an actor, by frame, in the world.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub tag: Option<(&'static str, Tag)>,
    pub frames: BTreeMap<u32, Vec<DVec3>>,
}

impl Seen {
    /// The track through its frames.
    pub(super) fn track(&self) -> Option<BoxTrack> {
        let (name, (class, _, kind)) = self.tag?;
        let middles: Vec<DVec2> = self.frames.values().map(|points| middle(points)).collect();
        let headings = headings(&middles, self.frames.values().next()?);
        let mut size = DVec3::splat(LEAST);
        let mut poses = Vec::new();
        for ((&frame, points), heading) in self.frames.iter().zip(headings) {
            let rotation = DMat3::from_rotation_z(heading);
            let own = points.iter().map(|&point| rotation.transpose() * point);
            let (low, high) = own.fold((DVec3::MAX, DVec3::MIN), |(low, high), point| {
                (low.min(point), high.max(point))
            });
            size = size.max(high - low);
            let translation = rotation * ((low + high) / 2.0);
            poses.push(TrackPose { frame, world_from_box: Pose { rotation, translation } });
        }
        let (name, size) = (name.to_owned(), size.to_array());
        Some(BoxTrack { name, kind, class: class?, size, poses })
    }
}

fn middle(points: &[DVec3]) -> DVec2 {
    points.iter().map(|point| point.truncate()).sum::<DVec2>() / points.len().max(1) as f64
}

/// Heading in each frame: along the way from the frame before to the one after, where that is a step; else the
/// last one known, or the first to come. An actor that never moves heads along the longest axis of its first points.
fn headings(middles: &[DVec2], first: &[DVec3]) -> Vec<f64> {
    let last = middles.len() - 1;
    let step = |k: usize| middles[(k + 1).min(last)] - middles[k.saturating_sub(1)];
    let known = |k: usize| Some(step(k)).filter(|step| step.length() > STEP).map(DVec2::to_angle);
    let start = (0..=last).find_map(known).unwrap_or_else(|| long_axis(first));
    let mut heading = start;
    let mut all = Vec::with_capacity(middles.len());
    for k in 0..=last {
        heading = known(k).unwrap_or(heading);
        all.push(heading);
    }
    all
}

/// Direction in which points seen from above spread most: the first axis of their covariance.
fn long_axis(points: &[DVec3]) -> f64 {
    let middle = middle(points);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let d = point.truncate() - middle;
        (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
    }
    0.5 * maths::atan2(2.0 * xy, xx - yy)
}
