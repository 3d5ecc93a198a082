//! A whole batch of sensors: which of their beams go down the tree together, and in which way.

use rayon::prelude::*;

use super::fan_blocks::blocks;
use super::groups::equal_rotations;
use super::mixed::mixed_tasks;
use super::reference::cast_rows;
use crate::bvh::{Bvh, Hit, NO_HIT};
use crate::problem::DevicePose;
use crate::vehicle::BeamTable;

/// Sensors of one rotation from which on their beams go in fans. Fans of 32 sensors cost about half
/// of mixed packets, fans of 16 as much.
const FAN_SENSORS: usize = 32;
/// Triangles a beam above which beams go down the tree alone: few beams among many triangles share
/// hardly a node.
const LONE_TRIANGLES: usize = 25;

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

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
///
/// Sensors that share their rotation with at least 31 others are cast in fans: neighbouring
/// directions from origins that lie side by side go down the tree together. The beams of all others
/// are sorted by where they are likely to end, and cut into packets in that order, or go alone where
/// there are more than 25 triangles a beam. `hits` becomes `[poses × directions]`.
pub fn cast_packets(
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    cast_packets_by(None, poses, table, bvh, range, hits);
}

/// [`cast_packets`] in one way for all beams, to compare the ways.
pub fn cast_packets_by(
    way: Option<Casting>,
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    let directions = table.directions();
    hits.resize(poses.len() * directions.len(), Hit { t: range, prim: NO_HIT });
    let mut rows: Vec<Option<&mut [Hit]>> = hits.chunks_mut(directions.len()).map(Some).collect();
    let mut others = Vec::new();
    let mut in_fans = Vec::new();
    for sensors in equal_rotations(poses) {
        let rows: Vec<_> = sensors
            .iter()
            .filter_map(|&sensor| Some((&poses[sensor], rows[sensor].take()?)))
            .collect();
        if way.map_or(rows.len() >= FAN_SENSORS, |way| way == Casting::Fans) {
            in_fans.extend(blocks(rows, directions, bvh));
        } else {
            others.extend(rows);
        }
    }
    in_fans.into_par_iter().for_each(|mut block| block.cast(bvh, range));
    let few = bvh.triangles.len() > LONE_TRIANGLES * others.len() * directions.len();
    if way.map_or(few, |way| way == Casting::Beams) {
        cast_rows(others, directions, bvh, range);
    } else {
        mixed_tasks(others, directions).into_par_iter().for_each(|mut task| task.cast(bvh, range));
    }
}
