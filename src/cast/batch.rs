//! A whole batch of sensors: which of their beams go down the tree together, and in which way.

use rayon::prelude::*;

use super::fan_blocks::blocks;
use super::groups::equal_rotations;
use super::mixed::mixed_tasks;
use super::reference::cast_rows;
use super::sight::Sight;
use crate::bvh::{Bvh, Hit};
use crate::geom::Pose;
use crate::problem::{DevicePose, Frame};
use crate::vehicle::BeamTable;

/// Sensors of one rotation from which on their beams go in fans. Fans of 32 sensors cost about half
/// of mixed packets, fans of 16 as much.
const FAN_SENSORS: usize = 32;
/// Triangles a beam above which beams go down the tree alone: few beams among many triangles share
/// hardly a node.
const LONE_TRIANGLES: usize = 25;

/// Triangles below which sorting beams takes longer than casting them.
const SMALL: usize = 64;

/// A way to find closest hits; each gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Beam by beam, as [`super::cast_closest`] does.
    Beams,
    /// Packets of beams that are likely to end near each other.
    Mixed,
    /// Packets of one direction, of sensors that share a rotation; see [`super::Fan`].
    Fans,
}

/// Closest hits of all beams in a frame, with the bits of [`super::cast_frame_closest`]: instance after
/// instance, each replacing the hits that it is closer to. `hits` becomes `[sensors × directions]`.
pub fn cast_frame(
    sensors: &[Pose],
    table: &BeamTable,
    frame: &Frame,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    hits.clear();
    hits.resize(sensors.len() * table.directions().len(), Hit::none(range));
    for instance in frame.instances() {
        let poses: Vec<DevicePose> = sensors.iter().map(|s| instance.pose_of(s)).collect();
        cast_packets(&poses, table, &instance.tree, instance.first_prim, range, hits);
    }
}

/// Replaces the hits of many sensors' beams, `[poses × directions]`, by closer ones among the triangles of
/// one tree, which are numbered from `first_prim` on; no hit lies beyond `range`.
///
/// Sensors that share their rotation with at least 31 others are cast in fans: neighbouring
/// directions from origins that lie side by side go down the tree together. The beams of all others
/// are sorted by where they are likely to end, and cut into packets in that order, or go alone where
/// there are more than 25 triangles a beam, and where the tree is seen from outside.
pub fn cast_packets(
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    first_prim: u32,
    range: f32,
    hits: &mut [Hit],
) {
    cast_packets_by(None, poses, table, bvh, first_prim, range, hits);
}

/// [`cast_packets`] in one way for all beams, to compare the ways.
pub fn cast_packets_by(
    way: Option<Casting>,
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    first_prim: u32,
    range: f32,
    hits: &mut [Hit],
) {
    let directions = table.directions();
    let mut rows: Vec<Option<&mut [Hit]>> = hits.chunks_mut(directions.len()).map(Some).collect();
    let mut others = Vec::new();
    let mut in_fans = Vec::new();
    for sensors in equal_rotations(poses) {
        let rows: Vec<_> = sensors
            .iter()
            .filter_map(|&sensor| Some((&poses[sensor], rows[sensor].take()?)))
            .collect();
        if way.map_or(rows.len() >= FAN_SENSORS, |way| way == Casting::Fans) {
            in_fans.extend(blocks(rows, directions, bvh, range));
        } else {
            others.extend(rows);
        }
    }
    in_fans.into_par_iter().for_each(|mut block| block.cast(bvh, first_prim, range));
    let triangles = bvh.triangles.len();
    let few = triangles > LONE_TRIANGLES * others.len() * directions.len() || triangles < SMALL;
    let (alone, mixed): (Vec<_>, Vec<_>) = others.into_iter().partition(|(pose, _)| {
        let apart = || Sight::new(pose, bvh, range).is_none_or(|sight| sight.is_apart());
        way.map_or_else(|| few || apart(), |way| way == Casting::Beams)
    });
    cast_rows(alone, directions, bvh, first_prim, range);
    let mixed = mixed_tasks(mixed, directions).into_par_iter();
    mixed.for_each(|mut task| task.cast(bvh, first_prim, range));
}
