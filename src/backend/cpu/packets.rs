use glam::Vec3;
use rayon::prelude::*;

use super::beam::{beam_direction, beam_origin};
use super::beam_order::sorted_beams;
use super::cast::cast_closest;
use crate::backend::DevicePose;
use crate::bvh::{
    Bvh, CHUNK, FAN_DIRECTIONS, Fan, Hit, NO_HIT, PACKET_RAYS, Packet, PacketHits, Scratch,
    major_axis,
};
use crate::placement::BeamTable;

/// How closest hits are found on the CPU: each way gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Beam by beam, as [`super::cast_closest`] does.
    Beams,
    /// Packets of beams that are likely to end near each other.
    Mixed,
    /// Packets of one direction, where sensors share a rotation; see [`Fan`].
    Fans,
}

/// Directions that follow one another, cast by one parallel task and written together.
const DIRECTIONS_PER_BLOCK: usize = 112;
/// Bytes that the memory moves at a time.
const CACHE_LINE: usize = 64;
/// Farthest that a direction of a fan is from its first one, as a share of a unit vector.
const FAN_WIDTH: f32 = 0.3;
/// How much narrower a packet is made upwards than sideways: beams meet the ground at a flat angle,
/// which stretches their upward spread.
const FLATNESS: f32 = 3.0;
/// Sensors of one rotation from which on their equal directions are cast together.
const PARALLEL_SENSORS: usize = 32;
/// Most sensors whose beams are sorted together.
const SORTED_SENSORS: usize = 256;
/// Parallel tasks that are aimed at for each thread.
const TASKS: usize = 2;
/// Most beams that one task sorts: 16 bytes each while it does.
const SORTED_BEAMS: usize = 4 << 20;

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
///
/// Where many sensors share a rotation, neighbouring directions from origins that lie side by side as
/// seen along them go down the tree together. The beams of other sensors are sorted by where they are
/// likely to end, and cut into packets in that order. `hits` becomes `[poses × directions]`.
pub fn cast_packets(
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    cast_packets_by(None, poses, table, bvh, range, hits);
}

/// [`cast_packets`] in the way that is told, however slow; chosen by the rotations where there is none.
pub fn cast_packets_by(
    told: Option<Casting>,
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    let fans_from = match told {
        None => PARALLEL_SENSORS,
        Some(Casting::Fans) => 1,
        Some(Casting::Mixed) => usize::MAX,
        Some(Casting::Beams) => {
            *hits = cast_closest(poses, table, bvh, range);
            return;
        }
    };
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
        if rows.len() >= fans_from {
            parallel.extend(blocks(rows, directions));
        } else {
            alone.extend(rows);
        }
    }
    parallel.into_par_iter().for_each(|mut block| block.cast(bvh, range));
    mixed_tasks(alone, directions).into_par_iter().for_each(|mut task| task.cast(bvh, range));
}

/// Directions that follow one another, with the hits of every sensor of one rotation.
struct Block<'a> {
    rotation: &'a DevicePose,
    directions: &'a [[f32; 3]],
    /// Origin of each sensor and the hits of its beams.
    rows: Vec<(Vec3, &'a mut [Hit])>,
}

/// The directions of sensors of one rotation, cut into blocks.
fn blocks<'a>(
    sensors: Vec<(&'a DevicePose, &'a mut [Hit])>,
    directions: &'a [[f32; 3]],
) -> Vec<Block<'a>> {
    let rotation = sensors[0].0;
    // Blocks begin where cache lines do: two that share one would each fetch and write it.
    let begin = sensors[0].1.as_ptr().align_offset(CACHE_LINE).min(directions.len());
    let (first, others) = directions.split_at(begin);
    let mut blocks: Vec<Block<'a>> = std::iter::once(first)
        .chain(others.chunks(DIRECTIONS_PER_BLOCK))
        .map(|directions| Block { rotation, directions, rows: Vec::with_capacity(sensors.len()) })
        .collect();
    for (pose, row) in sensors {
        let (first, others) = row.split_at_mut(begin);
        let rows = std::iter::once(first).chain(others.chunks_mut(DIRECTIONS_PER_BLOCK));
        for (block, row) in blocks.iter_mut().zip(rows) {
            block.rows.push((beam_origin(pose), row));
        }
    }
    blocks.retain(|block| !block.directions.is_empty());
    blocks
}

impl Block<'_> {
    fn cast(&mut self, bvh: &Bvh, range: f32) {
        let directions = self.directions.iter();
        let directions: Vec<Vec3> = directions.map(|&d| beam_direction(self.rotation, d)).collect();
        let middle = directions[directions.len() / 2];
        let sideways = Vec3::Z.cross(middle).try_normalize().unwrap_or(Vec3::X);
        let upwards = middle.cross(sideways) * FLATNESS;
        // As seen along the directions.
        let seen = |origin: Vec3| [origin.dot(sideways), origin.dot(upwards)];
        let rows = self.rows.iter().zip(0..);
        let mut sensors: Vec<([f32; 2], u32)> = rows.map(|((o, _), row)| (seen(*o), row)).collect();
        let mut hits =
            vec![PacketHits::default(); directions.len().next_multiple_of(FAN_DIRECTIONS)];
        let mut fan = Fan::new(&[Vec3::ZERO]);
        split(&mut sensors, PACKET_RAYS, &mut |group| {
            // Chunks of a packet lie side by side too.
            split(group, CHUNK, &mut |_| ());
            let origins: Vec<Vec3> =
                group.iter().map(|&(_, row)| self.rows[row as usize].0).collect();
            fan.set_origins(&origins);
            self.cast_group(group, &directions, &mut fan, &mut hits, bvh, range);
        });
    }

    /// Casts the directions from the origins of a fan, which are those of a group, into the group's
    /// rows; `hits` is working memory.
    fn cast_group(
        &mut self,
        group: &[([f32; 2], u32)],
        directions: &[Vec3],
        fan: &mut Fan,
        hits: &mut [PacketHits],
        bvh: &Bvh,
        range: f32,
    ) {
        let mut first = 0;
        while first < directions.len() {
            let next = fan_of(&directions[first..]);
            bvh.closest_hits_of_fan(fan, next, range, &mut hits[first..]);
            first += next.len();
        }
        // A few rows at a time: the lines of many would push each other out of the cache, since rows lie
        // a multiple of many lines apart.
        let mut by_ray = [[Hit { t: 0.0, prim: NO_HIT }; FAN_DIRECTIONS]; CHUNK];
        for (chunk, group) in group.chunks(CHUNK).enumerate() {
            for first in (0..directions.len()).step_by(FAN_DIRECTIONS) {
                PacketHits::by_ray(&hits[first..first + FAN_DIRECTIONS], chunk, &mut by_ray);
                let end = directions.len().min(first + FAN_DIRECTIONS);
                for (&(_, row), hits) in group.iter().zip(&by_ray) {
                    self.rows[row as usize].1[first..end].copy_from_slice(&hits[..end - first]);
                }
            }
        }
    }
}

/// The first of some directions that make a narrow fan.
fn fan_of(directions: &[Vec3]) -> &[Vec3] {
    let first = directions[0];
    let fits = |&direction: &Vec3| {
        major_axis(direction) == major_axis(first)
            && direction.signum() == first.signum()
            && direction.distance(first) < FAN_WIDTH
    };
    let count = directions.iter().take(FAN_DIRECTIONS).take_while(|d| fits(d)).count();
    &directions[..count.max(1)]
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
    let flat = |origin: Vec3| [origin.x, origin.y, FLATNESS * origin.z];
    let mut sensors: Vec<_> =
        sensors.into_iter().map(|s| (flat(beam_origin(s.0)), Some(s))).collect();
    let groups = sensors.len().div_ceil(SORTED_SENSORS).max(1);
    let blocks = (TASKS * rayon::current_num_threads()).div_ceil(groups);
    let most = SORTED_BEAMS / sensors.len().clamp(1, SORTED_SENSORS);
    let block = directions.len().div_ceil(blocks).max(PACKET_RAYS).min(most);
    let mut tasks = Vec::new();
    split(&mut sensors, SORTED_SENSORS, &mut |group| {
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

/// Halves along the longest axis until a group has at most `most` members.
fn split<const AXES: usize, T>(
    members: &mut [([f32; AXES], T)],
    most: usize,
    done: &mut impl FnMut(&mut [([f32; AXES], T)]),
) {
    if members.len() <= most {
        if !members.is_empty() {
            done(members);
        }
        return;
    }
    let (mut low, mut high) = ([f32::MAX; AXES], [f32::MIN; AXES]);
    for (at, _) in members.iter() {
        for axis in 0..AXES {
            low[axis] = low[axis].min(at[axis]);
            high[axis] = high[axis].max(at[axis]);
        }
    }
    let extent = |axis: usize| high[axis] - low[axis];
    let axis = (0..AXES).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    // Whole groups below, so that only the last one is partly filled.
    let middle = (members.len() / 2).next_multiple_of(most).min(members.len() - 1);
    members.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    let (below, above) = members.split_at_mut(middle);
    split(below, most, done);
    split(above, most, done);
}
