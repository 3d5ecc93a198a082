use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::device::Device;
use crate::backend::cpu::beam_direction;
use crate::backend::layout::{NO_SLOT, PACKET_FOURS, WORKGROUP_SIZE};
use crate::backend::{BackendError, DevicePose};

/// Beams of a packet or fan.
const RAYS: usize = 4 * PACKET_FOURS as usize;
/// Sensors of one rotation from which on a packet of them is cast faster than as many fans.
const LEAST_PARALLEL: usize = 24;
/// Most orders that the sensors are put in, each for neighbouring directions.
const ORDERS: usize = 256;
/// How much narrower packets and fans are made upwards than sideways: beams meet the ground at a flat
/// angle, which stretches their upward spread.
const FLATNESS: f32 = 2.0;

/// x, y and z of four origins or directions, as the kernels read them.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(super) struct Four([[f32; 4]; 3]);

/// How the beams of a chunk are put together: packets of sensors of one rotation, and fans of the
/// directions of all other sensors.
#[derive(Default)]
pub(super) struct Plan {
    /// Packets of sensors.
    pub(super) packets: u32,
    /// By order of sensors, packet and slot; [`NO_SLOT`] where there is none.
    pub(super) slots: Vec<u32>,
    pub(super) origins: Vec<Four>,
    /// For each block of directions, the first four of its order.
    pub(super) blocks: Vec<u32>,
    /// Sensors that are cast by fans.
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

    pub(super) fn new(poses: &[DevicePose], directions: &[[f32; 3]]) -> Self {
        let mut plan = Self::default();
        let mut packed = Vec::new();
        for mut sensors in equal_rotations(poses) {
            let rest = sensors.len() % RAYS;
            let full = if rest < LEAST_PARALLEL { sensors.len() - rest } else { sensors.len() };
            plan.alone.extend(sensors.drain(full..));
            plan.packets += full.div_ceil(RAYS) as u32;
            packed.push(sensors);
        }
        if plan.packets == 0 {
            return plan;
        }
        let blocks = directions.len().div_ceil(WORKGROUP_SIZE as usize);
        let orders = blocks.min(ORDERS);
        let fours = plan.packets as usize * PACKET_FOURS as usize;
        plan.blocks = (0..blocks).map(|block| (block * orders / blocks * fours) as u32).collect();
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
    split(&mut sensors, &mut |group| {
        take(&group.iter().map(|&(_, sensor)| sensor).collect::<Vec<_>>());
    });
}

/// Halves along the longer side until groups fill a packet; only the last may be smaller.
fn split(members: &mut [([f32; 2], u32)], take: &mut impl FnMut(&mut [([f32; 2], u32)])) {
    if members.len() <= RAYS {
        take(members);
        return;
    }
    let extent = |axis: usize| {
        let along = members.iter().map(|(at, _)| at[axis]);
        let (low, high) = along.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
        high - low
    };
    let axis = usize::from(extent(1) > extent(0));
    let middle = (members.len() / 2).next_multiple_of(RAYS).min(members.len() - 1);
    members.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    let (below, above) = members.split_at_mut(middle);
    split(below, take);
    split(above, take);
}

/// Sensors by rotation.
fn equal_rotations(poses: &[DevicePose]) -> Vec<Vec<u32>> {
    let rotation =
        |&sensor: &u32| poses[sensor as usize].rows.map(|[x, y, z, _]| [x, y, z].map(f32::to_bits));
    let mut sensors: Vec<u32> = (0..poses.len() as u32).collect();
    sensors.sort_by_key(rotation);
    sensors.chunk_by(|a, b| rotation(a) == rotation(b)).map(<[u32]>::to_vec).collect()
}

/// The directions of a table in fans, on the device.
pub(super) struct Fans {
    /// Directions by fan; [`NO_SLOT`] where there is none.
    pub(super) slots: Vec<u32>,
    pub(super) slot_buffer: wgpu::Buffer,
    pub(super) directions: wgpu::Buffer,
}

impl Fans {
    pub(super) fn new(device: &Device, directions: &[[f32; 3]]) -> Result<Self, BackendError> {
        let seen = |(index, &[x, y, z]): (usize, &[f32; 3])| {
            let up = z.clamp(-1.0, 1.0).asin();
            ([if up.abs() < PI / 2.0 { y.atan2(x) } else { 0.0 }, FLATNESS * up], index as u32)
        };
        let mut members: Vec<_> = directions.iter().enumerate().map(seen).collect();
        let (mut slots, mut fours) = (Vec::new(), Vec::new());
        split(&mut members, &mut |fan| {
            for first in (0..RAYS).step_by(4) {
                let mut four = Four::default();
                for lane in 0..4 {
                    // Slots that are left over repeat the last direction.
                    let index = fan[(first + lane).min(fan.len() - 1)].1;
                    slots.push(if first + lane < fan.len() { index } else { NO_SLOT });
                    for (row, &coordinate) in four.0.iter_mut().zip(&directions[index as usize]) {
                        row[lane] = coordinate;
                    }
                }
                fours.push(four);
            }
        });
        Ok(Self {
            slot_buffer: device.upload("slots of fans", &slots)?,
            directions: device.upload("directions of fans", &fours)?,
            slots,
        })
    }

    pub(super) fn count(&self) -> usize {
        self.slots.len() / RAYS
    }
}
