//! Beams of many sensors in an order in which neighbours end near each other.

use glam::Vec3;
use multiversion::multiversion;

use crate::problem::{DevicePose, TINY_COMPONENT, beam_origin};

/// Bits of the cell in which a beam is likely to end, as seen from the middle of the sensors: upwards
/// and sideways.
const CELL_BITS: u32 = 14;
const SIDE_BITS: u32 = 8;
/// Six directions of the largest component with the signs of the others.
const WAY_BITS: u32 = 5;
const ROW_BITS: u32 = 15;
const BEAM_BITS: u32 = 64 - WAY_BITS - CELL_BITS - ROW_BITS;
/// Keys are sorted by half of their bits at a time.
const DIGIT_BITS: u32 = (WAY_BITS + CELL_BITS).div_ceil(2);

/// Guess of a beam's end, in metres: where it meets level ground 2.4 m below the sensor, at least 4
/// and at most 30 m along the beam.
const GROUND: f32 = -2.4;
const NEAREST: f32 = 4.0;
const FARTHEST: f32 = 30.0;

/// A beam and the key it is sorted by, 64 bits: 5 of its way, 14 of its cell, 15 of its row and 30 of
/// its number in the row, from the highest down. E.g. way 2, cell 3, row 4, beam 5:
/// `2 << 59 | 3 << 45 | 4 << 30 | 5`.
#[derive(Clone, Copy, Default)]
pub(crate) struct KeyedBeam(u64);

impl KeyedBeam {
    /// Major axis and signs of the direction: equal within a packet.
    pub(crate) fn way(self) -> u64 {
        self.0 >> (64 - WAY_BITS)
    }

    /// Number of the row, and of the beam in it.
    pub(crate) fn of(self) -> (usize, usize) {
        let row = self.0 >> BEAM_BITS & ((1 << ROW_BITS) - 1);
        (row as usize, (self.0 & ((1 << BEAM_BITS) - 1)) as usize)
    }
}

/// All beams of some rows, fewer than 2¹⁵, by way and by where they are likely to end. A row is a
/// sensor with some of its directions, `all_around` the number of beams of all sides together.
pub(crate) fn sorted_rows<'a>(
    rows: impl ExactSizeIterator<Item = (&'a DevicePose, &'a [[f32; 3]])> + Clone,
    all_around: usize,
) -> Vec<KeyedBeam> {
    // Four times the beams share cells of half the height; measured with 128 beams a packet.
    let up_bits = (all_around.max(1).ilog2().saturating_sub(9) / 2).min(CELL_BITS - SIDE_BITS);
    let origins = rows.clone().map(|(pose, _)| beam_origin(pose));
    let middle = origins.sum::<Vec3>() / rows.len() as f32;
    let count = rows.clone().map(|(_, directions)| directions.len()).sum();
    let mut beams = vec![KeyedBeam::default(); count];
    let mut left = &mut beams[..];
    for (row, (pose, directions)) in rows.enumerate() {
        let (beams, others) = std::mem::take(&mut left).split_at_mut(directions.len());
        left = others;
        let from = beam_origin(pose) - middle;
        let row = (row as u64) << BEAM_BITS;
        write_keys(pose, directions, from.to_array(), up_bits, row, beams);
    }
    let mut other = vec![KeyedBeam::default(); beams.len()];
    for digit in 0..2 {
        let shift = 64 - WAY_BITS - CELL_BITS + digit * DIGIT_BITS;
        let digit = |beam: &KeyedBeam| (beam.0 >> shift) as usize & ((1 << DIGIT_BITS) - 1);
        let mut ends = vec![0; (1 << DIGIT_BITS) + 1];
        beams.iter().for_each(|beam| ends[digit(beam) + 1] += 1);
        for at in 0..1 << DIGIT_BITS {
            ends[at + 1] += ends[at];
        }
        for beam in &beams {
            let end: &mut usize = &mut ends[digit(beam)];
            other[*end] = *beam;
            *end += 1;
        }
        std::mem::swap(&mut beams, &mut other);
    }
    beams
}

/// Keys of one row's beams, with its number in its place.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn write_keys(
    pose: &DevicePose,
    directions: &[[f32; 3]],
    from: [f32; 3],
    up_bits: u32,
    row: u64,
    beams: &mut [KeyedBeam],
) {
    let turned = |row: [f32; 4], [x, y, z]: [f32; 3]| {
        let d = row[0] * x + row[1] * y + row[2] * z;
        if d.abs() < TINY_COMPONENT { 0.0 } else { d }
    };
    for (index, (&direction, keyed)) in directions.iter().zip(beams).enumerate() {
        let dx = turned(pose.rows[0], direction);
        let dy = turned(pose.rows[1], direction);
        let dz = turned(pose.rows[2], direction);
        let (x, y, z) = (dx.abs(), dy.abs(), dz.abs());
        let [nx, ny, nz] = [dx, dy, dz].map(|d| u32::from(d < 0.0));
        // As `major_axis` has it.
        let x_leads = (x > y) & (x > z);
        let y_leads = (x <= y) & (y > z);
        let down = GROUND / dz;
        let away = if down > 0.0 { down.clamp(NEAREST, FARTHEST) } else { FARTHEST };
        let [tx, ty, tz] =
            [(from[0], dx), (from[1], dy), (from[2], dz)].map(|(o, d)| (away * d + o) * d.signum());
        let (major, up, side) = if x_leads {
            (tx, tz, ty)
        } else if y_leads {
            (ty, tz, tx)
        } else {
            (tz, tx, ty)
        };
        let way = if x_leads {
            nx << 2 | nz << 1 | ny
        } else if y_leads {
            8 | ny << 2 | nz << 1 | nx
        } else {
            16 | nz << 2 | nx << 1 | ny
        };
        let scale = 1.0 / major.max(1e-3);
        let cell = |slope: f32, bits: u32| {
            (slope * (1 << bits) as f32).clamp(0.0, ((1 << bits) - 1) as f32) as i32 as u32
        };
        let (up, side) = (cell(up * scale, up_bits), cell(side * scale, SIDE_BITS));
        // To and fro: each row of cells begins where the last one ended.
        let turn = ((1 << SIDE_BITS) - 1) * (up & 1);
        let cells = up << SIDE_BITS | (side ^ turn);
        let key = u64::from(way << CELL_BITS | cells);
        *keyed = KeyedBeam(key << (64 - WAY_BITS - CELL_BITS) | row | index as u64);
    }
}
