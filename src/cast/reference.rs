use rayon::prelude::*;

use crate::bvh::{Bvh, Hit, NO_HIT, Ray};
use crate::problem::{DevicePose, beam_direction, beam_origin};
use crate::vehicle::BeamTable;

/// Beams of one parallel task.
const BEAMS_PER_TASK: usize = 1024;

/// Closest hit of every beam, ordered by sensor, then direction; `[poses × directions]`.
///
/// CPU twin of `shaders/cast_closest.wgsl`.
pub fn cast_closest(poses: &[DevicePose], table: &BeamTable, bvh: &Bvh, range: f32) -> Vec<Hit> {
    let directions = table.directions();
    let mut hits = vec![Hit { t: range, prim: NO_HIT }; poses.len() * directions.len()];
    let rows = poses.iter().zip(hits.chunks_mut(directions.len())).collect();
    cast_rows(rows, directions, bvh, range);
    hits
}

/// [`cast_closest`] of sensors with the hits of each; these may hold anything before.
pub(super) fn cast_rows(
    sensors: Vec<(&DevicePose, &mut [Hit])>,
    directions: &[[f32; 3]],
    bvh: &Bvh,
    range: f32,
) {
    sensors.into_par_iter().for_each(|(pose, row)| {
        let origin = beam_origin(pose);
        let tasks = row.par_chunks_mut(BEAMS_PER_TASK).zip(directions.par_chunks(BEAMS_PER_TASK));
        tasks.for_each(|(row, directions)| {
            for (hit, &direction) in row.iter_mut().zip(directions) {
                let ray = Ray::new(origin, beam_direction(pose, direction), range);
                *hit = bvh.closest_hit(&ray);
            }
        });
    });
}
