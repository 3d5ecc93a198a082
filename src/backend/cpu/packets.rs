use glam::Vec3;
use rayon::prelude::*;

use super::beam::{beam_direction, beam_origin};
use crate::backend::DevicePose;
use crate::bvh::{Bvh, Hit, NO_HIT, PACKET_RAYS, Packet, Scratch, major_axis};
use crate::placement::BeamTable;

/// Directions of one parallel task.
const DIRECTIONS_PER_TASK: usize = 48;
/// Directions whose hits are written together: a cache line of each sensor's row.
const DIRECTIONS_PER_WRITE: usize = 8;
/// How much narrower a packet is made upwards than sideways: beams meet the ground at a flat angle,
/// which stretches their upward spread.
const FLATNESS: f32 = 2.0;

/// Triangles above which half a packet is faster: it is narrower, and meets fewer of them.
const FINE_MESH: usize = 500_000;
/// Sensors of one rotation from which on their equal directions are cast together.
const PARALLEL_SENSORS: usize = 32;
/// Most sensors whose beams are sorted together.
const SORTED_SENSORS: usize = 64;
/// Sensors below which beams are not sorted, since few would go the same way: they are taken in the
/// table's order, where neighbours mostly do.
const FEW_SENSORS: usize = 16;
/// Rays of a packet in sorted order.
const SORTED_RAYS: usize = 64;
/// Rays of a packet in the table's order, which is less narrow.
const UNSORTED_RAYS: usize = 16;
/// Least parallel tasks that are aimed at.
const TASKS: usize = 32;

/// Origin of a sensor and the hits of its beams.
type Row<'a> = (Vec3, &'a mut [Hit]);

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
///
/// Where many sensors share a rotation, a packet holds one direction from origins that lie side by
/// side as seen along it. The beams of other sensors are sorted by direction, those of sensors near
/// each other together, and cut into packets in that order. `hits` becomes `[poses × directions]`.
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
        let fine = bvh.triangles.len() > FINE_MESH;
        let most = if fine { PACKET_RAYS / 2 } else { PACKET_RAYS };
        split(&mut self.rows, &[sideways, upwards], most, &mut |group| {
            cast_parallel(group, &directions, bvh, range);
        });
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
    let most = if sensors.len() < FEW_SENSORS { 1 } else { SORTED_SENSORS };
    let groups = sensors.len().div_ceil(most).max(1);
    let block = directions.len().div_ceil(TASKS.div_ceil(groups)).max(PACKET_RAYS);
    let mut tasks = Vec::new();
    split(&mut sensors, &[Vec3::X, Vec3::Y, FLATNESS * Vec3::Z], most, &mut |group| {
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
        let count = self.directions.len();
        let mut rays = Vec::with_capacity(self.sensors.len() * count);
        for (pose, _) in &self.sensors {
            let origin = beam_origin(pose);
            rays.extend(self.directions.iter().map(|&d| (origin, beam_direction(pose, d))));
        }
        let keys: Vec<u32> = rays.iter().map(|(_, direction)| sort_key(*direction)).collect();
        let (order, most) = if self.sensors.len() > 1 {
            (sorted(&keys), SORTED_RAYS)
        } else {
            ((0..keys.len() as u32).collect(), UNSORTED_RAYS)
        };
        let mut packet = Packet::default();
        let mut scratch = Scratch::default();
        let mut gathered = Vec::with_capacity(PACKET_RAYS);
        for same_way in
            order.chunk_by(|&a, &b| keys[a as usize] >> CELL_BITS == keys[b as usize] >> CELL_BITS)
        {
            for beams in same_way.chunks(most) {
                gathered.clear();
                gathered.extend(beams.iter().map(|&beam| rays[beam as usize]));
                packet.gather(&gathered, range);
                bvh.closest_hits(&mut packet, &mut scratch);
                for (&beam, hit) in beams.iter().zip(packet.hits()) {
                    self.sensors[beam as usize / count].1[beam as usize % count] = hit;
                }
            }
        }
    }
}

/// Bits of the upward and of the sideward cell of a sort key; narrow and high packets measured fastest.
const UP_BITS: u32 = 5;
const SIDE_BITS: u32 = 8;
const CELL_BITS: u32 = UP_BITS + SIDE_BITS;
const KEYS: usize = 24 << CELL_BITS;

/// Directions of neighbouring keys are near each other; bits above [`CELL_BITS`] are equal where the
/// largest component and all signs are.
fn sort_key(direction: Vec3) -> u32 {
    let major = major_axis(direction);
    let (up, side) = if major == 2 { (0, 1) } else { (2, 1 - major) };
    let negative = |axis: usize| u32::from(direction[axis] < 0.0);
    let cell = |axis: usize, bits: u32| {
        let slope = direction[axis].abs() / direction[major].abs();
        ((slope * (1 << bits) as f32) as u32).min((1 << bits) - 1)
    };
    let way = 8 * major as u32 + 4 * negative(major) + 2 * negative(up) + negative(side);
    way << CELL_BITS | cell(up, UP_BITS) << SIDE_BITS | cell(side, SIDE_BITS)
}

/// Indices in rising order of their keys.
fn sorted(keys: &[u32]) -> Vec<u32> {
    let mut ends = vec![0_u32; KEYS + 1];
    for &key in keys {
        ends[key as usize + 1] += 1;
    }
    for key in 0..KEYS {
        ends[key + 1] += ends[key];
    }
    let mut order = vec![0; keys.len()];
    for (index, &key) in keys.iter().enumerate() {
        let end = &mut ends[key as usize];
        order[*end as usize] = index as u32;
        *end += 1;
    }
    order
}

/// Casts the same directions from all origins of a group into its rows.
fn cast_parallel(group: &mut [Row<'_>], directions: &[Vec3], bvh: &Bvh, range: f32) {
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
