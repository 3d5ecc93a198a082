use glam::Vec3;
use rayon::prelude::*;

use super::beam::{beam_direction, beam_origin};
use super::beam_order::sorted_beams;
use crate::backend::DevicePose;
use crate::bvh::{Bvh, CHUNK, Hit, NO_HIT, PACKET_RAYS, Packet, PacketHits, Scratch};
use crate::placement::BeamTable;

/// Directions of one parallel task.
const DIRECTIONS_PER_TASK: usize = 48;
/// Directions whose hits are written together: two cache lines of each sensor's row.
const DIRECTIONS_PER_WRITE: usize = 16;
/// How much narrower a packet is made upwards than sideways: beams meet the ground at a flat angle,
/// which stretches their upward spread.
const FLATNESS: f32 = 2.0;
/// Sensors of one rotation from which on their equal directions are cast together.
const PARALLEL_SENSORS: usize = 32;
/// Most sensors whose beams are sorted together.
const SORTED_SENSORS: usize = 256;
/// Parallel tasks that are aimed at for each thread.
const TASKS: usize = 2;
/// Most beams that one task sorts: 16 bytes each while it does.
const SORTED_BEAMS: usize = 4 << 20;

/// Origin of a sensor and the hits of its beams.
type Row<'a> = (Vec3, &'a mut [Hit]);

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
///
/// Where many sensors share a rotation, a packet holds one direction from origins that lie side by
/// side as seen along it. The beams of other sensors are sorted by where they are likely to end, and
/// cut into packets in that order. `hits` becomes `[poses × directions]`.
pub fn cast_packets(
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    let directions = table.directions();
    hits.resize(poses.len() * directions.len(), Hit { t: range, prim: NO_HIT });
    let mut rows: Vec<Option<&mut [Hit]>> = hits.chunks_mut(directions.len()).map(Some).collect();
    let mut alone = Vec::new();
    let mut parallel = Vec::new();
    for sensors in equal_rotations(poses) {
        let rows: Vec<_> = sensors
            .iter()
            .filter_map(|&sensor| Some((&poses[sensor], rows[sensor].take()?)))
            .collect();
        if rows.len() >= PARALLEL_SENSORS {
            parallel.extend(parallel_tasks(rows, directions));
        } else {
            alone.extend(rows);
        }
    }
    parallel.into_par_iter().for_each(|mut task| task.cast(bvh, range));
    mixed_tasks(alone, directions).into_par_iter().for_each(|mut task| task.cast(bvh, range));
}

/// Some directions of all sensors of one rotation.
struct ParallelTask<'a> {
    rotation: &'a DevicePose,
    directions: &'a [[f32; 3]],
    rows: Vec<Row<'a>>,
}

fn parallel_tasks<'a>(
    sensors: Vec<(&'a DevicePose, &'a mut [Hit])>,
    directions: &'a [[f32; 3]],
) -> Vec<ParallelTask<'a>> {
    let rotation = sensors[0].0;
    let mut tasks: Vec<ParallelTask<'a>> = directions
        .chunks(DIRECTIONS_PER_TASK)
        .map(|directions| ParallelTask { rotation, directions, rows: Vec::new() })
        .collect();
    for (pose, row) in sensors {
        for (task, row) in tasks.iter_mut().zip(row.chunks_mut(DIRECTIONS_PER_TASK)) {
            task.rows.push((beam_origin(pose), row));
        }
    }
    tasks
}

impl ParallelTask<'_> {
    fn cast(&mut self, bvh: &Bvh, range: f32) {
        let directions = self.directions.iter();
        let directions: Vec<Vec3> = directions.map(|&d| beam_direction(self.rotation, d)).collect();
        let middle = directions[directions.len() / 2];
        let sideways = Vec3::Z.cross(middle).try_normalize().unwrap_or(Vec3::X);
        let upwards = middle.cross(sideways) * FLATNESS;
        // As seen along the directions.
        let seen = |origin: Vec3| Vec3::new(origin.dot(sideways), origin.dot(upwards), 0.0);
        let rows = self.rows.iter().enumerate();
        let mut sensors: Vec<_> =
            rows.map(|(row, (origin, _))| (seen(*origin), row as u32)).collect();
        let axes = [Vec3::X, Vec3::Y];
        split(&mut sensors, &axes, PACKET_RAYS, &mut |group| {
            // Chunks of a packet lie side by side too.
            split(group, &axes, CHUNK, &mut |_| ());
            self.cast_group(group, &directions, bvh, range);
        });
    }

    /// Casts the directions from all origins of a group into its rows.
    fn cast_group(&mut self, group: &[(Vec3, u32)], directions: &[Vec3], bvh: &Bvh, range: f32) {
        let rows = || group.iter().map(|&(_, row)| row as usize);
        let origins: Vec<Vec3> = rows().map(|row| self.rows[row].0).collect();
        let mut scratch = Scratch::default();
        let mut packet = Packet::from_origins(&origins);
        let mut hits = [PacketHits::default(); DIRECTIONS_PER_WRITE];
        for (block, directions) in directions.chunks(DIRECTIONS_PER_WRITE).enumerate() {
            for (hits, &direction) in hits.iter_mut().zip(directions) {
                packet.point(direction, range);
                bvh.closest_hits(&mut packet, &mut scratch);
                *hits = *packet.found();
            }
            let first = block * DIRECTIONS_PER_WRITE;
            for (lane, row) in rows().enumerate() {
                let row = &mut self.rows[row].1[first..first + directions.len()];
                for (hit, hits) in row.iter_mut().zip(&hits) {
                    *hit = hits.get(lane);
                }
            }
        }
    }
}

/// Some directions of sensors that are near each other.
struct MixedTask<'a> {
    directions: &'a [[f32; 3]],
    sensors: Vec<(&'a DevicePose, &'a mut [Hit])>,
}

fn mixed_tasks<'a>(
    sensors: Vec<(&'a DevicePose, &'a mut [Hit])>,
    directions: &'a [[f32; 3]],
) -> Vec<MixedTask<'a>> {
    let mut sensors: Vec<_> = sensors.into_iter().map(|s| (beam_origin(s.0), Some(s))).collect();
    let groups = sensors.len().div_ceil(SORTED_SENSORS).max(1);
    let blocks = (TASKS * rayon::current_num_threads()).div_ceil(groups);
    let most = SORTED_BEAMS / sensors.len().clamp(1, SORTED_SENSORS);
    let block = directions.len().div_ceil(blocks).max(PACKET_RAYS).min(most);
    let mut tasks = Vec::new();
    split(&mut sensors, &[Vec3::X, Vec3::Y, FLATNESS * Vec3::Z], SORTED_SENSORS, &mut |group| {
        let first = tasks.len();
        tasks.extend(
            directions
                .chunks(block)
                .map(|directions| MixedTask { directions, sensors: Vec::new() }),
        );
        for (pose, row) in group.iter_mut().filter_map(|(_, sensor)| sensor.take()) {
            for (task, row) in tasks[first..].iter_mut().zip(row.chunks_mut(block)) {
                task.sensors.push((pose, row));
            }
        }
    });
    tasks
}

impl MixedTask<'_> {
    fn cast(&mut self, bvh: &Bvh, range: f32) {
        let mut packet = Packet::default();
        let mut scratch = Scratch::default();
        let beams = sorted_beams(&self.sensors, self.directions);
        for same_way in beams.chunk_by(|a, b| a.way() == b.way()) {
            for beams in same_way.chunks(PACKET_RAYS) {
                packet.gather(beams.len(), range, |lane| {
                    let (sensor, beam) = beams[lane].of();
                    let pose = self.sensors[sensor].0;
                    (beam_origin(pose), beam_direction(pose, self.directions[beam]))
                });
                bvh.closest_hits(&mut packet, &mut scratch);
                for (beam, hit) in beams.iter().zip(packet.hits()) {
                    let (sensor, beam) = beam.of();
                    self.sensors[sensor].1[beam] = hit;
                }
            }
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

/// Halves along the longest of some axes until a group has at most `most` members.
fn split<T>(
    members: &mut [(Vec3, T)],
    axes: &[Vec3],
    most: usize,
    done: &mut impl FnMut(&mut [(Vec3, T)]),
) {
    if members.len() <= most {
        if !members.is_empty() {
            done(members);
        }
        return;
    }
    let extent = |axis: Vec3| {
        let along = members.iter().map(|(origin, _)| origin.dot(axis));
        let (low, high) = along.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let longest = axes.iter().copied().max_by(|a, b| extent(*a).total_cmp(&extent(*b)));
    let axis = longest.unwrap_or(Vec3::X);
    // Whole groups below, so that only the last one is partly filled.
    let middle = (members.len() / 2).next_multiple_of(most).min(members.len() - 1);
    members.select_nth_unstable_by(middle, |a, b| a.0.dot(axis).total_cmp(&b.0.dot(axis)));
    let (below, above) = members.split_at_mut(middle);
    split(below, axes, most, done);
    split(above, axes, most, done);
}
