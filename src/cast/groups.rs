//! Sensors in groups: of one rotation, and side by side.

use crate::problem::DevicePose;

/// Height of a group that counts as one of its width: beams meet the ground at a flat angle, which
/// stretches their upward spread, so a packet is made a third as high as it is wide.
pub(super) const FLATNESS: f32 = 3.0;

/// Sensors by rotation.
pub(super) fn equal_rotations(poses: &[DevicePose]) -> Vec<Vec<usize>> {
    let rotation =
        |&sensor: &usize| poses[sensor].rows.map(|[x, y, z, _]| [x, y, z].map(f32::to_bits));
    let mut sensors: Vec<usize> = (0..poses.len()).collect();
    sensors.sort_by_key(rotation);
    sensors.chunk_by(|a, b| rotation(a) == rotation(b)).map(<[usize]>::to_vec).collect()
}

/// Halves along the longest axis until a group has at most `most` members.
pub(super) fn split<const AXES: usize, T>(
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
