use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use crate::bvh::Hit;
use crate::cast::beam_order::sorted_beams;
use crate::engine::gpu::layout::{NO_SLOT, PACKET_FOURS, WORKGROUP_SIZE};
use crate::problem::beam_direction;
use crate::problem::{DevicePose, Problem};

/// Beams of a packet.
pub(super) const RAYS: usize = 4 * PACKET_FOURS as usize;
/// Fewest sensors of a packet of one direction.
const LEAST_PARALLEL: usize = 32;
/// Most sensors whose beams are sorted together.
const SORTED_SENSORS: usize = 256;
/// Most orders that the sensors are put in, each for neighbouring directions.
const ORDERS: usize = 256;
/// How much narrower packets are made upwards than sideways: beams meet the ground at a flat
/// angle, which stretches their upward spread.
const FLATNESS: f32 = 2.0;

/// x, y and z of four origins or directions, as the kernels read them.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(super) struct Four([[f32; 4]; 3]);

/// How the beams of a chunk are put together: packets of one direction where many sensors share a
/// rotation; the beams of all other sensors are mixed.
#[derive(Default)]
pub(super) struct Plan {
    /// Packets of sensors.
    pub(super) packets: u32,
    /// By order of sensors, packet and slot; [`NO_SLOT`] where there is none.
    pub(super) slots: Vec<u32>,
    pub(super) origins: Vec<Four>,
    /// Blocks of directions in the order of [`scattered`]: the first four of the block's order of
    /// sensors, and the block.
    pub(super) blocks: Vec<[u32; 2]>,
    /// The other sensors.
    pub(super) alone: Vec<u32>,
}

impl Plan {
    /// Bytes on the device for each sensor at most, with those of the marks.
    pub(super) fn bytes(directions: usize) -> u64 {
        let blocks = directions.div_ceil(WORKGROUP_SIZE as usize);
        let slot = size_of::<Four>() / 4 + 4;
        let marks = blocks * WORKGROUP_SIZE as usize * 16;
        // A packet holds at least so many sensors.
        ((blocks.min(ORDERS) * slot * RAYS + marks) / LEAST_PARALLEL) as u64
    }

    /// Whether some sensors' beams are mixed.
    pub(super) fn mixes(poses: &[DevicePose], problem: &Problem) -> bool {
        let rotations = equal_rotations(poses);
        let in_packets = in_packets(&rotations, poses, problem);
        rotations.iter().zip(in_packets).any(|(sensors, packed)| packed < sensors.len())
    }

    pub(super) fn new(poses: &[DevicePose], problem: &Problem) -> Self {
        let directions = problem.table().directions();
        let mut plan = Self::default();
        let mut packed = Vec::new();
        let rotations = equal_rotations(poses);
        let in_packets = in_packets(&rotations, poses, problem);
        for (mut sensors, in_packets) in rotations.into_iter().zip(in_packets) {
            plan.alone.extend(sensors.drain(in_packets..));
            plan.packets += sensors.len().div_ceil(RAYS) as u32;
            packed.push(sensors);
        }
        if plan.packets == 0 {
            return plan;
        }
        let blocks = directions.len().div_ceil(WORKGROUP_SIZE as usize);
        let orders = blocks.min(ORDERS);
        let fours = plan.packets as usize * PACKET_FOURS as usize;
        plan.blocks = scattered(blocks)
            .into_iter()
            .map(|block| [(block as usize * orders / blocks * fours) as u32, block])
            .collect();
        plan.slots = vec![NO_SLOT; orders * 4 * fours];
        plan.origins = vec![Four::default(); orders * fours];
        let parts = plan.slots.par_chunks_mut(4 * fours).zip(plan.origins.par_chunks_mut(fours));
        parts.enumerate().for_each(|(order, (slots, origins))| {
            let middle = directions[(2 * order + 1) * directions.len() / (2 * orders)];
            let mut at = 0;
            for sensors in packed.iter().filter(|sensors| !sensors.is_empty()) {
                let middle = beam_direction(&poses[sensors[0] as usize], middle);
                put_in_order(sensors, poses, middle, |group| {
                    for slot in 0..RAYS {
                        // Slots that are left over repeat the last sensor's origin.
                        let sensor = group[slot.min(group.len() - 1)];
                        for axis in 0..3 {
                            origins[(at + slot) / 4].0[axis][slot % 4] =
                                poses[sensor as usize].rows[axis][3];
                        }
                    }
                    slots[at..at + group.len()].copy_from_slice(group);
                    at += RAYS;
                });
            }
        });
        plan
    }
}

/// So many numbers from 0, in an order in which every stretch holds numbers from everywhere: a software
/// device gives each of its threads a stretch of the workgroups, and these are to take equally long.
pub(super) fn scattered(count: usize) -> Vec<u32> {
    /// The golden ratio's share of 2³²: its multiples lie apart from each other.
    const STEP: u32 = 0x9e37_79b9;
    let mut numbers: Vec<u32> = (0..count as u32).collect();
    numbers.sort_unstable_by_key(|number| number.wrapping_mul(STEP));
    numbers
}

/// How many sensors of each rotation are put in packets of one direction: what costs least in the frame
/// of the most triangles.
fn in_packets(rotations: &[Vec<u32>], poses: &[DevicePose], problem: &Problem) -> Vec<usize> {
    let least = if poses.is_empty() || problem.geometry_frame_count() == 0 { 0 } else { 32 };
    rotations.iter().map(|of| if of.len() >= least { of.len() } else { 0 }).collect()
}

/// Hands out the sensors in groups of a packet, which lie side by side as seen along a direction.
fn put_in_order(
    sensors: &[u32],
    poses: &[DevicePose],
    direction: Vec3,
    mut take: impl FnMut(&[u32]),
) {
    let sideways = Vec3::Z.cross(direction).try_normalize().unwrap_or(Vec3::X);
    let upwards = direction.cross(sideways) * FLATNESS;
    let seen = |&sensor: &u32| {
        let origin = Vec3::from(poses[sensor as usize].rows.map(|row| row[3]));
        ([origin.dot(sideways), origin.dot(upwards)], sensor)
    };
    let mut sensors: Vec<_> = sensors.iter().map(seen).collect();
    split(&mut sensors, RAYS, &mut |group| {
        take(&group.iter().map(|&(_, sensor)| sensor).collect::<Vec<_>>());
    });
}

/// Halves along the longer side until groups have at most so many members; only the last may have less.
fn split(
    members: &mut [([f32; 2], u32)],
    most: usize,
    take: &mut impl FnMut(&mut [([f32; 2], u32)]),
) {
    if members.len() <= most {
        take(members);
        return;
    }
    let extent = |axis: usize| {
        let along = members.iter().map(|(at, _)| at[axis]);
        let (low, high) = along.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let axis = usize::from(extent(1) > extent(0));
    let middle = (members.len() / 2).next_multiple_of(most).min(members.len() - 1);
    members.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    let (below, above) = members.split_at_mut(middle);
    split(below, most, take);
    split(above, most, take);
}

/// Sensors by rotation.
fn equal_rotations(poses: &[DevicePose]) -> Vec<Vec<u32>> {
    let rotation =
        |&sensor: &u32| poses[sensor as usize].rows.map(|[x, y, z, _]| [x, y, z].map(f32::to_bits));
    let mut sensors: Vec<u32> = (0..poses.len() as u32).collect();
    sensors.sort_by_key(rotation);
    sensors.chunk_by(|a, b| rotation(a) == rotation(b)).map(<[u32]>::to_vec).collect()
}

/// Packets of beams that go roughly the same way, of any sensors.
#[derive(Default)]
pub(super) struct Mixed {
    /// Where the hits go, by packet: sensor × directions + direction; [`NO_SLOT`] for no beam.
    pub(super) slots: Vec<u32>,
    /// The beams of each four slots: x, y and z of the origins, then of the directions.
    pub(super) beams: Vec<[Four; 2]>,
}

impl Mixed {
    /// Bytes of the beams on the device for each slot.
    pub(super) const BEAM: u64 = (size_of::<[Four; 2]>() / 4) as u64;

    /// Bytes of a sensor's beams on the device, with those of their slots and marks.
    pub(super) fn bytes(directions: usize) -> u64 {
        // An eighth is what packets that are not full add.
        let slots = (directions + directions / 8) as u64;
        slots * (Self::BEAM + 4) + slots / 4
    }

    /// Packets of the beams of some sensors, in parts.
    pub(super) fn of(sensors: &[u32], poses: &[DevicePose], directions: &[[f32; 3]]) -> Vec<Self> {
        let mut groups = Vec::new();
        let seen = |&sensor: &u32| {
            let [x, y, _] = poses[sensor as usize].rows.map(|row| row[3]);
            ([x, y], sensor)
        };
        let mut sensors: Vec<_> = sensors.iter().map(seen).collect();
        if !sensors.is_empty() {
            split(&mut sensors, SORTED_SENSORS, &mut |group| {
                groups.push(group.iter().map(|&(_, sensor)| sensor).collect::<Vec<_>>());
            });
        }
        let blocks = (2 * rayon::current_num_threads()).div_ceil(groups.len().max(1));
        let block = directions.len().div_ceil(blocks).max(RAYS);
        let tasks: Vec<_> = groups
            .iter()
            .flat_map(|group| (0..directions.len()).step_by(block).map(move |first| (group, first)))
            .collect();
        let parts = tasks.into_par_iter().map(|(group, first)| {
            let end = directions.len().min(first + block);
            Self::sorted(group, poses, directions, first..end)
        });
        parts.collect()
    }

    fn sorted(
        sensors: &[u32],
        poses: &[DevicePose],
        directions: &[[f32; 3]],
        block: Range<usize>,
    ) -> Self {
        let own: Vec<(&DevicePose, &mut [Hit])> =
            sensors.iter().map(|&sensor| (&poses[sensor as usize], &mut [][..])).collect();
        let beams = sorted_beams(&own, &directions[block.clone()]);
        let mut mixed = Self::default();
        mixed.slots.reserve(beams.len() + beams.len() / 8);
        mixed.beams.reserve((beams.len() + beams.len() / 8) / 4);
        for same_way in beams.chunk_by(|a, b| a.way() == b.way()) {
            for packet in same_way.chunks(RAYS) {
                for first in (0..RAYS).step_by(4) {
                    let mut four = [Four::default(); 2];
                    for lane in 0..4 {
                        // Slots that are left over repeat the last beam.
                        let (sensor, beam) = packet[(first + lane).min(packet.len() - 1)].of();
                        let (sensor, beam) = (sensors[sensor], block.start + beam);
                        let slot = sensor * directions.len() as u32 + beam as u32;
                        let filled = first + lane < packet.len();
                        mixed.slots.push(if filled { slot } else { NO_SLOT });
                        let pose = &poses[sensor as usize];
                        let direction = beam_direction(pose, directions[beam]);
                        for axis in 0..3 {
                            four[0].0[axis][lane] = pose.rows[axis][3];
                            four[1].0[axis][lane] = direction[axis];
                        }
                    }
                    mixed.beams.push(four);
                }
            }
        }
        mixed
    }
}
