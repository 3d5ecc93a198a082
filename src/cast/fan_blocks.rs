//! Fans of a batch: sensors of one rotation, block after block of their directions.

use std::ops::Range;

use glam::Vec3;

use super::fan::Fan;
use super::groups::{FLATNESS, split};
use super::lanes::{CHUNK, FAN_DIRECTIONS, PACKET_RAYS, PacketHits};
use super::sight::Sight;
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

/// The directions of sensors of one rotation, cut into blocks; beams that surely miss the tree, or have no
/// hit within `range` in it, are in none, but for a few between others.
pub(super) fn blocks<'a>(
    sensors: Vec<(&'a DevicePose, &'a mut [Hit])>,
    directions: &'a [[f32; 3]],
    bvh: &Bvh,
    range: f32,
) -> Vec<Block<'a>> {
    let mut sights = Vec::with_capacity(sensors.len());
    let in_reach = sensors.into_iter().filter(|(pose, _)| {
        let sight = Sight::new(pose, bvh, range);
        sights.extend(sight);
        sight.is_some()
    });
    let sensors: Vec<_> = in_reach.collect();
    let Some(sight) = Sight::around(&sights) else { return Vec::new() };
    let many = bvh.triangles.len() >= MANY_TRIANGLES;
    let per_block = if many { DIRECTIONS_AMONG_MANY } else { DIRECTIONS_PER_BLOCK };
    let rotation = sensors[0].0;
    // Blocks begin where cache lines do: two that share one would each fetch and write it.
    let begin = sensors[0].1.as_ptr().align_offset(CACHE_LINE).min(directions.len());
    let (first, others) = directions.split_at(begin);
    let met = |directions: &[[f32; 3]]| {
        let meets = |direction: &[f32; 3]| !sight.misses(*direction, range);
        let first = directions.iter().position(meets).unwrap_or(directions.len());
        let end = directions.iter().rposition(meets).map_or(first, |last| last + 1);
        first..end
    };
    let pieces = || std::iter::once(first).chain(others.chunks(per_block));
    let met: Vec<_> = pieces().map(met).collect();
    let of_piece = |(directions, met): (&'a [[f32; 3]], &Range<usize>)| {
        let directions = &directions[met.clone()];
        Block { rotation, directions, rows: Vec::with_capacity(sensors.len()) }
    };
    let mut blocks: Vec<Block<'a>> = pieces().zip(&met).map(of_piece).collect();
    for (pose, row) in sensors {
        let (first, others) = row.split_at_mut(begin);
        let rows = std::iter::once(first).chain(others.chunks_mut(per_block));
        for ((block, row), met) in blocks.iter_mut().zip(rows).zip(&met) {
            block.rows.push((beam_origin(pose), &mut row[met.clone()]));
        }
    }
    blocks.retain(|block| !block.directions.is_empty());
    blocks
}

impl Block<'_> {
    /// Replaces the hits by closer ones among the triangles of a tree, numbered from `first_prim` on.
    pub(super) fn cast(&mut self, bvh: &Bvh, first_prim: u32, range: f32) {
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
        let mut by_ray = [NO_HITS; PACKET_RAYS / CHUNK];
        let mut fan = Fan::new(&[Vec3::ZERO]);
        split(&mut sensors, PACKET_RAYS, &mut |group| {
            // Chunks of a packet lie side by side too.
            split(group, CHUNK, &mut |_| ());
            let origins: Vec<Vec3> =
                group.iter().map(|&(_, row)| self.rows[row as usize].0).collect();
            fan.set_origins(&origins);
            // Hits of few directions, to be turned round while they are in the nearest cache.
            for (piece, directions) in directions.chunks(FAN_DIRECTIONS).enumerate() {
                let at = piece * FAN_DIRECTIONS..piece * FAN_DIRECTIONS + directions.len();
                let mut loaded = false;
                let mut first = 0;
                while first < directions.len() {
                    let next = fan_of(&directions[first..]);
                    if bvh.fan_meets(&fan, next, range) {
                        if !loaded {
                            load(group, &self.rows, &at, &mut by_ray, &mut hits);
                        }
                        loaded = true;
                        let hits = &mut hits[first..];
                        bvh.closer_hits_of_fan(&mut fan, next, first_prim, range, hits);
                    }
                    first += next.len();
                }
                // Sixteen rows at a time: rows lie a multiple of many cache lines apart, so that the
                // lines of more rows would push each other out of the cache.
                let chunks = group.chunks(CHUNK).zip(&mut by_ray).filter(|_| loaded);
                for (chunk, (group, by_ray)) in chunks.enumerate() {
                    PacketHits::by_ray(&hits, chunk, by_ray);
                    write_rows(by_ray, group, &at, &mut self.rows);
                }
            }
        });
    }
}

/// Takes over the hits that rows hold at `at`, in [`FAN_DIRECTIONS`] directions or fewer.
fn load(
    group: &[([f32; 2], u32)],
    rows: &[(Vec3, &mut [Hit])],
    at: &Range<usize>,
    by_ray: &mut [HitsByRay],
    hits: &mut [PacketHits],
) {
    for (chunk, (group, by_ray)) in group.chunks(CHUNK).zip(by_ray).enumerate() {
        for (i, by_ray) in by_ray.iter_mut().enumerate() {
            // Lanes that are left over repeat the last ray.
            let (_, row) = group[i.min(group.len() - 1)];
            let row = &rows[row as usize].1[at.start..];
            match row.first_chunk() {
                Some(row) => *by_ray = *row,
                None => by_ray[..at.len()].copy_from_slice(&row[..at.len()]),
            }
        }
        PacketHits::of_rays(by_ray, chunk, hits);
    }
}

/// Writes the hits of a chunk's rays in some directions into their rows.
fn write_rows(
    by_ray: &HitsByRay,
    group: &[([f32; 2], u32)],
    at: &Range<usize>,
    rows: &mut [(Vec3, &mut [Hit])],
) {
    for (&(_, row), hits) in group.iter().zip(by_ray) {
        let row = &mut rows[row as usize].1[at.start..];
        match row.first_chunk_mut() {
            Some(row) => *row = *hits,
            None => row[..at.len()].copy_from_slice(&hits[..at.len()]),
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
