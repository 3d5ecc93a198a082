use glam::Vec3;
use multiversion::multiversion;
use rayon::prelude::*;

use super::beam_order::sorted_rows;
use super::costs::{Choice, Costs, Group};
use super::reference::cast_rows;
use super::{CHUNK, FAN_DIRECTIONS, Fan, PACKET_RAYS, Packet, PacketHits, Scratch};
use crate::bvh::{Bvh, Hit, NO_HIT, major_axis};
use crate::problem::{DevicePose, beam_direction, beam_origin};
use crate::vehicle::BeamTable;

/// How closest hits are found on the CPU: each way gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Beam by beam, as [`super::cast_closest`] does.
    Beams,
    /// Packets of beams that are likely to end near each other.
    Mixed,
    /// Packets of one direction, of sensors that share a rotation; see [`Fan`].
    Fans,
}

/// Hits of a chunk's rays in some directions, those of each ray side by side.
type HitsByRay = [[Hit; FAN_DIRECTIONS]; CHUNK];
const NO_HITS: HitsByRay = [[Hit { t: 0.0, prim: NO_HIT }; FAN_DIRECTIONS]; CHUNK];

/// Directions that follow one another, cast by one parallel task and written together: sensors are
/// sorted once for all of them, which is closer to each where there are fewer.
const DIRECTIONS_PER_BLOCK: usize = 112;
/// The same in scenes of many triangles, where rays have to lie closer to meet the same ones.
const DIRECTIONS_AMONG_MANY: usize = 48;
/// Triangles from which on a scene has many; measured.
const MANY_TRIANGLES: usize = 1 << 18;
/// Bytes that the memory moves at a time.
const CACHE_LINE: usize = 64;
/// Farthest that a direction of a fan is from its first one, as a share of a unit vector.
const FAN_WIDTH: f32 = 0.3;
/// How much narrower a packet is made upwards than sideways: beams meet the ground at a flat angle,
/// which stretches their upward spread.
const FLATNESS: f32 = 3.0;
/// Most sensors whose beams are sorted together.
const SORTED_SENSORS: usize = 256;
/// Parallel tasks that are aimed at for each of several threads.
const TASKS: usize = 4;
/// Pieces that a sensor's directions are cut into, to be shared out among tasks.
const PIECES: usize = 64;
/// Fewest beams of a task, about: fewer hardly fill packets.
const LEAST_BEAMS: usize = 2048;
/// Most beams that one task sorts: 16 bytes each while it does.
const SORTED_BEAMS: usize = 4 << 20;

/// [`super::cast_closest`] with the beams of many sensors in packets: the same bits.
///
/// Where sensors share a rotation, neighbouring directions from origins that lie side by side as seen
/// along them may go down the tree together. The beams of other sensors are sorted by where they are
/// likely to end, and cut into packets in that order; beams that are few among many triangles are cast
/// one by one. Which sensors go which way is chosen by an estimate of the cost from the numbers of
/// triangles, directions and sensors of each rotation. `hits` becomes `[poses × directions]`.
pub fn cast_packets(
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    cast_packets_by(None, poses, table, bvh, range, hits);
}

/// [`cast_packets`] in the way that is told, however slow; chosen by its cost where there is none.
pub fn cast_packets_by(
    told: Option<Casting>,
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    range: f32,
    hits: &mut Vec<Hit>,
) {
    let directions = table.directions();
    hits.resize(poses.len() * directions.len(), Hit { t: range, prim: NO_HIT });
    let mut rows: Vec<Option<&mut [Hit]>> = hits.chunks_mut(directions.len()).map(Some).collect();
    let rotations = equal_rotations(poses);
    let group = |sensors: &[usize]| Group::new(sensors.iter().map(|&s| beam_origin(&poses[s])));
    let groups: Vec<Group> = rotations.iter().map(|sensors| group(sensors)).collect();
    let choice = match told {
        Some(casting) => Choice::of(casting, &groups),
        None => Costs::new(bvh.triangles.len(), directions)
            .choose(&groups, Group::new(poses.iter().map(beam_origin))),
    };
    let mut others = Vec::new();
    let mut parallel = Vec::new();
    for (sensors, in_fans) in rotations.iter().zip(choice.in_fans) {
        let mut rows: Vec<_> = sensors
            .iter()
            .filter_map(|&sensor| Some((&poses[sensor], rows[sensor].take()?)))
            .collect();
        others.extend(rows.drain(in_fans..));
        if !rows.is_empty() {
            parallel.extend(blocks(rows, directions, bvh));
        }
    }
    parallel.into_par_iter().for_each(|mut block| block.cast(bvh, range));
    if choice.others == Casting::Beams {
        cast_rows(others, directions, bvh, range);
    } else {
        mixed_tasks(others, directions).into_par_iter().for_each(|mut task| task.cast(bvh, range));
    }
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
    bvh: &Bvh,
) -> Vec<Block<'a>> {
    let many = bvh.triangles.len() >= MANY_TRIANGLES;
    let per_block = if many { DIRECTIONS_AMONG_MANY } else { DIRECTIONS_PER_BLOCK };
    let rotation = sensors[0].0;
    // Blocks begin where cache lines do: two that share one would each fetch and write it.
    let begin = sensors[0].1.as_ptr().align_offset(CACHE_LINE).min(directions.len());
    let (first, others) = directions.split_at(begin);
    let mut blocks: Vec<Block<'a>> = std::iter::once(first)
        .chain(others.chunks(per_block))
        .map(|directions| Block { rotation, directions, rows: Vec::with_capacity(sensors.len()) })
        .collect();
    for (pose, row) in sensors {
        let (first, others) = row.split_at_mut(begin);
        let rows = std::iter::once(first).chain(others.chunks_mut(per_block));
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
        let mut hits = vec![PacketHits::default(); FAN_DIRECTIONS];
        let pieces = directions.len().div_ceil(FAN_DIRECTIONS);
        let mut by_ray = vec![NO_HITS; pieces * PACKET_RAYS / CHUNK];
        let mut fan = Fan::new(&[Vec3::ZERO]);
        split(&mut sensors, PACKET_RAYS, &mut |group| {
            // Chunks of a packet lie side by side too.
            split(group, CHUNK, &mut |_| ());
            let origins: Vec<Vec3> =
                group.iter().map(|&(_, row)| self.rows[row as usize].0).collect();
            fan.set_origins(&origins);
            // Hits of few directions, to be turned round while they are in the nearest cache.
            for (piece, directions) in directions.chunks(FAN_DIRECTIONS).enumerate() {
                let mut first = 0;
                while first < directions.len() {
                    let next = fan_of(&directions[first..]);
                    bvh.closest_hits_of_fan(&mut fan, next, range, &mut hits[first..]);
                    first += next.len();
                }
                let chunks = by_ray.chunks_exact_mut(pieces).take(group.len().div_ceil(CHUNK));
                for (chunk, by_ray) in chunks.enumerate() {
                    PacketHits::by_ray(&hits, chunk, &mut by_ray[piece]);
                }
            }
            // A few rows at a time: the lines of many would push each other out of the cache, since rows
            // lie a multiple of many lines apart.
            for (group, by_ray) in group.chunks(CHUNK).zip(by_ray.chunks_exact(pieces)) {
                write_rows(by_ray, group, &mut self.rows);
            }
        });
    }
}

/// Writes what a chunk's rays hit in some directions into their rows.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn write_rows(by_ray: &[HitsByRay], group: &[([f32; 2], u32)], rows: &mut [(Vec3, &mut [Hit])]) {
    for (piece, by_ray) in by_ray.iter().enumerate() {
        for (&(_, row), hits) in group.iter().zip(by_ray) {
            let row = &mut rows[row as usize].1[piece * FAN_DIRECTIONS..];
            match row.first_chunk_mut() {
                Some(row) => *row = *hits,
                None => write_some(row, hits),
            }
        }
    }
}

/// Apart, so that copies of whole lines keep their fixed length: those need no call.
#[cold]
#[inline(never)]
fn write_some(row: &mut [Hit], hits: &[Hit; FAN_DIRECTIONS]) {
    row.copy_from_slice(&hits[..row.len()]);
}

/// The first of some directions that make a narrow fan.
pub(super) fn fan_of(directions: &[Vec3]) -> &[Vec3] {
    let first = directions[0];
    let fits = |&direction: &Vec3| {
        major_axis(direction) == major_axis(first)
            && direction.signum() == first.signum()
            && direction.distance(first) < FAN_WIDTH
    };
    let count = directions.iter().take(FAN_DIRECTIONS).take_while(|d| fits(d)).count();
    &directions[..count.max(1)]
}

/// Some directions of a sensor and what its beams hit there.
struct Piece<'a> {
    pose: &'a DevicePose,
    directions: &'a [[f32; 3]],
    hits: &'a mut [Hit],
}

/// Pieces of sensors that are near each other, seen to one side.
struct MixedTask<'a> {
    pieces: Vec<Piece<'a>>,
    /// Beams of the sensors to all sides.
    all_around: usize,
}

fn mixed_tasks<'a>(
    sensors: Vec<(&'a DevicePose, &'a mut [Hit])>,
    directions: &'a [[f32; 3]],
) -> Vec<MixedTask<'a>> {
    let flat = |origin: Vec3| [origin.x, origin.y, FLATNESS * origin.z];
    let mut sensors: Vec<_> =
        sensors.into_iter().map(|s| (flat(beam_origin(s.0)), Some(s))).collect();
    let groups = sensors.len().div_ceil(SORTED_SENSORS).max(1);
    let threads = rayon::current_num_threads();
    let wanted = if threads > 1 { (TASKS * threads).div_ceil(groups) } else { 1 };
    let mut tasks = Vec::new();
    split(&mut sensors, SORTED_SENSORS, &mut |group| {
        let beams = group.len() * directions.len();
        let most = wanted.min(beams / LEAST_BEAMS).max(beams.div_ceil(SORTED_BEAMS)).max(1);
        let length = if most > 1 { directions.len().div_ceil(PIECES) } else { directions.len() };
        let mut pieces = Vec::new();
        for (pose, row) in group.iter_mut().filter_map(|(_, sensor)| sensor.take()) {
            for (directions, hits) in directions.chunks(length).zip(row.chunks_mut(length)) {
                let middle = beam_direction(pose, directions[directions.len() / 2]);
                pieces.push((middle.y.atan2(middle.x), Piece { pose, directions, hits }));
            }
        }
        // Side by side as seen from above: what a task holds is as near to each other as in one of all,
        // and about as much work as another's.
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let length = pieces.len().div_ceil(most);
        let mut pieces = pieces.into_iter().map(|(_, piece)| piece).peekable();
        while pieces.peek().is_some() {
            let pieces = pieces.by_ref().take(length).collect();
            tasks.push(MixedTask { pieces, all_around: beams });
        }
    });
    tasks
}

impl MixedTask<'_> {
    fn cast(&mut self, bvh: &Bvh, range: f32) {
        let mut packet = Packet::default();
        let mut scratch = Scratch::default();
        let rows = self.pieces.iter().map(|piece| (piece.pose, piece.directions));
        let beams = sorted_rows(rows, self.all_around);
        for same_way in beams.chunk_by(|a, b| a.way() == b.way()) {
            for beams in same_way.chunks(PACKET_RAYS) {
                packet.gather(beams.len(), range, |lane| {
                    let (piece, beam) = beams[lane].of();
                    let Piece { pose, directions, .. } = &self.pieces[piece];
                    (beam_origin(pose), beam_direction(pose, directions[beam]))
                });
                bvh.closest_hits(&mut packet, &mut scratch);
                for (beam, hit) in beams.iter().zip(packet.hits()) {
                    let (piece, beam) = beam.of();
                    self.pieces[piece].hits[beam] = hit;
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
