use glam::Vec3;
use rayon::prelude::*;

use super::beam::{beam_direction, beam_origin};
use crate::backend::DevicePose;
use crate::bvh::{Bvh, Hit, NO_HIT, PACKET_RAYS, Packet};
use crate::placement::BeamTable;

/// Directions of one parallel task.
const DIRECTIONS_PER_TASK: usize = 1440;
/// Directions whose hits are written together: a cache line of each sensor's row.
const DIRECTIONS_PER_WRITE: usize = 8;

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
pub fn cast_packets(poses: &[DevicePose], table: &BeamTable, bvh: &Bvh, range: f32) -> Vec<Hit> {
    let directions = table.directions();
    let mut hits = vec![Hit { t: range, prim: NO_HIT }; poses.len() * directions.len()];
    let mut rows: Vec<Vec<&mut [Hit]>> = hits
        .chunks_mut(directions.len())
        .map(|row| row.chunks_mut(DIRECTIONS_PER_TASK).collect())
        .collect();
    let mut tasks = Vec::new();
    for group in groups(poses) {
        for (block, directions) in directions.chunks(DIRECTIONS_PER_TASK).enumerate() {
            let rows: Vec<&mut [Hit]> =
                group.iter().map(|&sensor| std::mem::take(&mut rows[sensor][block])).collect();
            tasks.push((group.clone(), directions, rows));
        }
    }
    tasks.into_par_iter().for_each(|(group, directions, mut rows)| {
        let origins: Vec<Vec3> = group.iter().map(|&sensor| beam_origin(&poses[sensor])).collect();
        cast_group(&poses[group[0]], &origins, directions, bvh, range, &mut rows);
    });
    hits
}

/// Casts the same directions from all origins of a group.
fn cast_group(
    rotation: &DevicePose,
    origins: &[Vec3],
    directions: &[[f32; 3]],
    bvh: &Bvh,
    range: f32,
    rows: &mut [&mut [Hit]],
) {
    let mut packet = Packet::from_origins(origins);
    let mut written = [[Hit { t: range, prim: NO_HIT }; DIRECTIONS_PER_WRITE]; PACKET_RAYS];
    for (block, directions) in directions.chunks(DIRECTIONS_PER_WRITE).enumerate() {
        for (column, &direction) in directions.iter().enumerate() {
            packet.point(beam_direction(rotation, direction), range);
            bvh.closest_hits(&mut packet);
            for (row, hit) in written.iter_mut().zip(packet.hits()) {
                row[column] = hit;
            }
        }
        let first = block * DIRECTIONS_PER_WRITE;
        for (row, written) in rows.iter_mut().zip(&written) {
            row[first..first + directions.len()].copy_from_slice(&written[..directions.len()]);
        }
    }
}

/// Sensors of equal rotation, near each other, at most a packet's rays together.
fn groups(poses: &[DevicePose]) -> Vec<Vec<usize>> {
    let rotation =
        |sensor: usize| poses[sensor].rows.map(|[x, y, z, _]| [x, y, z].map(f32::to_bits));
    let mut sensors: Vec<usize> = (0..poses.len()).collect();
    sensors.sort_by_key(|&sensor| rotation(sensor));
    let mut groups = Vec::new();
    for equal in sensors.chunk_by_mut(|&a, &b| rotation(a) == rotation(b)) {
        split(poses, equal, &mut groups);
    }
    groups
}

/// Halves along the longest axis until a group fits a packet.
fn split(poses: &[DevicePose], sensors: &mut [usize], groups: &mut Vec<Vec<usize>>) {
    if sensors.len() <= PACKET_RAYS {
        groups.push(sensors.to_vec());
        return;
    }
    let origin = |&sensor: &usize| beam_origin(&poses[sensor]);
    let low = sensors.iter().map(origin).reduce(Vec3::min).unwrap_or_default();
    let high = sensors.iter().map(origin).reduce(Vec3::max).unwrap_or_default();
    let axis = (high - low).max_position();
    sensors.sort_by(|a, b| origin(a)[axis].total_cmp(&origin(b)[axis]));
    // Whole packets below, so that only the last one is partly filled.
    let middle = (sensors.len() / 2).next_multiple_of(PACKET_RAYS);
    let (below, above) = sensors.split_at_mut(middle.min(sensors.len() - 1));
    split(poses, below, groups);
    split(poses, above, groups);
}
