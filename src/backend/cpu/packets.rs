use glam::Vec3;
use rayon::prelude::*;

use super::beam::{beam_direction, beam_origin};
use crate::backend::DevicePose;
use crate::bvh::{Bvh, Hit, NO_HIT, PACKET_RAYS, Packet, Scratch};
use crate::placement::BeamTable;

/// Directions of one parallel task.
const DIRECTIONS_PER_TASK: usize = 48;
/// Directions whose hits are written together: a cache line of each sensor's row.
const DIRECTIONS_PER_WRITE: usize = 8;
/// How much narrower a packet is made upwards than sideways: beams meet the ground at a flat angle,
/// which stretches their upward spread.
const FLATNESS: f32 = 2.0;

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
pub fn cast_packets(poses: &[DevicePose], table: &BeamTable, bvh: &Bvh, range: f32) -> Vec<Hit> {
    let directions = table.directions();
    let mut hits = vec![Hit { t: range, prim: NO_HIT }; poses.len() * directions.len()];
    let mut rows: Vec<Vec<&mut [Hit]>> = hits
        .chunks_mut(directions.len())
        .map(|row| row.chunks_mut(DIRECTIONS_PER_TASK).collect())
        .collect();
    let mut tasks = Vec::new();
    for sensors in equal_rotations(poses) {
        for (block, directions) in directions.chunks(DIRECTIONS_PER_TASK).enumerate() {
            let beams: Vec<(Vec3, &mut [Hit])> = sensors
                .iter()
                .map(|&sensor| {
                    (beam_origin(&poses[sensor]), std::mem::take(&mut rows[sensor][block]))
                })
                .collect();
            tasks.push((&poses[sensors[0]], directions, beams));
        }
    }
    tasks.into_par_iter().for_each(|(rotation, directions, mut beams)| {
        let directions: Vec<Vec3> =
            directions.iter().map(|&direction| beam_direction(rotation, direction)).collect();
        let middle = directions[directions.len() / 2];
        let sideways = Vec3::Z.cross(middle).try_normalize().unwrap_or(Vec3::X);
        let upwards = middle.cross(sideways) * FLATNESS;
        split(&mut beams, [sideways, upwards], &mut |group| {
            cast_group(group, &directions, bvh, range);
        });
    });
    hits
}

/// Casts the same directions from all origins of a group into its rows.
fn cast_group(group: &mut [(Vec3, &mut [Hit])], directions: &[Vec3], bvh: &Bvh, range: f32) {
    let origins: Vec<Vec3> = group.iter().map(|(origin, _)| *origin).collect();
    let mut scratch = Scratch::default();
    let mut packet = Packet::from_origins(&origins);
    let mut written = [[Hit { t: range, prim: NO_HIT }; DIRECTIONS_PER_WRITE]; PACKET_RAYS];
    for (block, directions) in directions.chunks(DIRECTIONS_PER_WRITE).enumerate() {
        for (column, &direction) in directions.iter().enumerate() {
            packet.point(direction, range);
            bvh.closest_hits(&mut packet, &mut scratch);
            for (row, hit) in written.iter_mut().zip(packet.hits()) {
                row[column] = hit;
            }
        }
        let first = block * DIRECTIONS_PER_WRITE;
        for ((_, row), written) in group.iter_mut().zip(&written) {
            row[first..first + directions.len()].copy_from_slice(&written[..directions.len()]);
        }
    }
}

/// Sensors by rotation.
fn equal_rotations(poses: &[DevicePose]) -> Vec<Vec<usize>> {
    let rotation =
        |&sensor: &usize| poses[sensor].rows.map(|[x, y, z, _]| [x, y, z].map(f32::to_bits));
    let mut sensors: Vec<usize> = (0..poses.len()).collect();
    sensors.sort_by_key(rotation);
    sensors.chunk_by(|a, b| rotation(a) == rotation(b)).map(<[usize]>::to_vec).collect()
}

/// Halves along the longer of two axes until a group fits a packet.
fn split<T>(beams: &mut [(Vec3, T)], axes: [Vec3; 2], cast: &mut impl FnMut(&mut [(Vec3, T)])) {
    if beams.len() <= PACKET_RAYS {
        return cast(beams);
    }
    let extent = |axis: Vec3| {
        let along = beams.iter().map(|(origin, _)| origin.dot(axis));
        let (low, high) = along.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let axis = if extent(axes[0]) > extent(axes[1]) { axes[0] } else { axes[1] };
    // Whole packets below, so that only the last one is partly filled.
    let middle = (beams.len() / 2).next_multiple_of(PACKET_RAYS).min(beams.len() - 1);
    beams.select_nth_unstable_by(middle, |a, b| a.0.dot(axis).total_cmp(&b.0.dot(axis)));
    let (below, above) = beams.split_at_mut(middle);
    split(below, axes, cast);
    split(above, axes, cast);
}
