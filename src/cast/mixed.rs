//! Mixed packets of a batch: beams of any rotation, sorted by where they are likely to end.

use glam::Vec3;

use super::beam_order::sorted_rows;
use super::groups::{FLATNESS, split};
use super::lanes::PACKET_RAYS;
use super::packet::Packet;
use super::traverse::Scratch;
use crate::bvh::{Bvh, Hit};
use crate::problem::{DevicePose, beam_direction, beam_origin};

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

/// Some directions of a sensor and the hits of its beams there.
struct Piece<'a> {
    pose: &'a DevicePose,
    directions: &'a [[f32; 3]],
    hits: &'a mut [Hit],
}

/// Pieces of sensors that are near each other, seen to one side.
pub(super) struct MixedTask<'a> {
    pieces: Vec<Piece<'a>>,
    /// Beams of the sensors to all sides.
    all_around: usize,
}

pub(super) fn mixed_tasks<'a>(
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
        // Side by side as seen from above: a task's beams are as near to each other as in one task of
        // all, and each task is about as much work.
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
    /// Replaces the hits by closer ones among the triangles of a tree, numbered from `first_prim` on.
    pub(super) fn cast(&mut self, bvh: &Bvh, first_prim: u32, range: f32) {
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
                packet.set_hits(beams.iter().map(|beam| {
                    let (piece, beam) = beam.of();
                    self.pieces[piece].hits[beam]
                }));
                bvh.closer_hits(&mut packet, first_prim, &mut scratch);
                for (beam, hit) in beams.iter().zip(packet.hits()) {
                    let (piece, beam) = beam.of();
                    self.pieces[piece].hits[beam] = hit;
                }
            }
        }
    }
}
