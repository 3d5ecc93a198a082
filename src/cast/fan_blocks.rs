//! Fans of a batch: sensors of one rotation, block after block of their directions.

use glam::Vec3;
use multiversion::multiversion;

use super::fan::Fan;
use super::groups::{FLATNESS, split};
use super::lanes::{CHUNK, FAN_DIRECTIONS, PACKET_RAYS, PacketHits};
use crate::bvh::{Bvh, Hit, NO_HIT, major_axis};
use crate::problem::{DevicePose, beam_direction, beam_origin};

/// Hits of a chunk's rays in some directions, `[ray][direction]`.
type HitsByRay = [[Hit; FAN_DIRECTIONS]; CHUNK];
const NO_HITS: HitsByRay = [[Hit { t: 0.0, prim: NO_HIT }; FAN_DIRECTIONS]; CHUNK];

/// Directions that follow one another, cast by one parallel task and written together: sensors are
/// sorted once for all of them, which is closer to each where there are fewer.
const DIRECTIONS_PER_BLOCK: usize = 112;
/// The same in scenes of many triangles, where rays have to lie closer to meet the same ones.
const DIRECTIONS_AMONG_MANY: usize = 48;
/// Triangles from which on a scene has many; measured.
const MANY_TRIANGLES: usize = 1 << 18;
/// Bytes of a cache line.
const CACHE_LINE: usize = 64;
/// Farthest that a direction of a fan is from its first one, as a share of a unit vector.
const FAN_WIDTH: f32 = 0.3;
/// Directions that follow one another, with the hits of every sensor of one rotation.
pub(super) struct Block<'a> {
    rotation: &'a DevicePose,
    directions: &'a [[f32; 3]],
    /// Origin of each sensor and the hits of its beams.
    rows: Vec<(Vec3, &'a mut [Hit])>,
}

/// The directions of sensors of one rotation, cut into blocks.
pub(super) fn blocks<'a>(
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
    pub(super) fn cast(&mut self, bvh: &Bvh, range: f32) {
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
            // Sixteen rows at a time: rows lie a multiple of many cache lines apart, so that the lines of
            // more rows would push each other out of the cache.
            for (group, by_ray) in group.chunks(CHUNK).zip(by_ray.chunks_exact(pieces)) {
                write_rows(by_ray, group, &mut self.rows);
            }
        });
    }
}

/// Writes the hits of a chunk's rays in some directions into their rows.
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

/// A function of its own, so that copies of fixed length in the caller need no call.
#[cold]
#[inline(never)]
fn write_some(row: &mut [Hit], hits: &[Hit; FAN_DIRECTIONS]) {
    row.copy_from_slice(&hits[..row.len()]);
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
