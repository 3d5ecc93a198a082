//! The beams of one sensor model, cast for any sensors: which of them go down the tree together.

use glam::Vec3;
use rayon::prelude::*;

use super::fan_blocks::blocks;
use super::groups::equal_rotations;
use super::walk::{Instructions, Part, Walk};
use crate::bvh::{Bvh, Hit, NO_HIT, Ray};
use crate::problem::{DevicePose, beam_direction};
use crate::vehicle::BeamTable;

/// Sensors of one rotation from which on their beams go in fans; measured, see `docs/performance.md`.
const FAN_SENSORS: usize = 40;
/// Sensors for each thread from which on a sensor's windows are not shared out too.
const SENSORS_A_THREAD: usize = 4;
/// Beams of one parallel task where they go one by one.
const BEAMS_PER_TASK: usize = 1024;

/// A way to find closest hits; each gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Beam by beam, as [`super::cast_closest`] does.
    Beams,
    /// One walk down the tree a sensor; beam by beam where the table is no grid.
    Walk,
    /// Packets of one direction, of sensors that share a rotation; see [`super::Fan`].
    Fans,
}

/// Casts the beams of a table: the bits of [`super::cast_closest`].
///
/// Sensors that share their rotation with many others are cast in fans: neighbouring directions from
/// origins that lie side by side go down the tree together. All others walk it by themselves, each with
/// all of its beams at once. Beams that lie in no grid go alone.
pub struct Caster {
    table: BeamTable,
    walk: Option<Walk>,
    way: Option<Casting>,
}

impl Caster {
    /// A caster for all sensors of a table.
    pub fn new(table: &BeamTable) -> Self {
        Self::by(None, Instructions::Best, table)
    }

    /// A caster that goes one way alone, to compare the ways.
    pub fn by(way: Option<Casting>, instructions: Instructions, table: &BeamTable) -> Self {
        let walk = (way != Some(Casting::Beams)).then(|| Walk::new(table, instructions)).flatten();
        Self { table: table.clone(), walk, way }
    }

    /// Closest hits of many sensors up to `range`, in one tree; `hits` becomes `[poses × directions]`.
    pub fn closest_hits(&self, poses: &[DevicePose], bvh: &Bvh, range: f32, hits: &mut Vec<Hit>) {
        let directions = self.table.directions();
        hits.resize(poses.len() * directions.len(), Hit { t: range, prim: NO_HIT });
        let mut rows: Vec<Option<&mut [Hit]>> =
            hits.chunks_mut(directions.len()).map(Some).collect();
        let mut others = Vec::new();
        let mut in_fans = Vec::new();
        for sensors in equal_rotations(poses) {
            let rows: Vec<_> = sensors
                .iter()
                .filter_map(|&sensor| Some((&poses[sensor], rows[sensor].take()?)))
                .collect();
            let many = self.way.map_or(rows.len() >= FAN_SENSORS, |way| way == Casting::Fans);
            if many {
                in_fans.extend(blocks(rows, directions, bvh));
            } else {
                others.extend(rows);
            }
        }
        in_fans.into_par_iter().for_each(|mut block| block.cast(bvh, range));
        let few = others.len() < SENSORS_A_THREAD * rayon::current_num_threads();
        others.into_par_iter().for_each(|(&pose, hits)| {
            hits.fill(Hit { t: range, prim: NO_HIT });
            self.replace(&[Part { bvh, pose, first_prim: 0 }], few, hits);
        });
    }

    /// Replaces the hits of one sensor, in the order of the table's directions, by closer ones in some
    /// trees, and by equally close ones of a lower face; a hit of nothing is as far as it says.
    ///
    /// What a sensor does not see costs next to nothing: bounds of a tree's first boxes.
    pub fn closer_hits(&self, parts: &[Part<'_>], hits: &mut [Hit]) {
        self.replace(parts, true, hits);
    }

    fn replace(&self, parts: &[Part<'_>], shared: bool, hits: &mut [Hit]) {
        let Some(walk) = &self.walk else {
            parts.iter().for_each(|part| self.cast_beams(part, hits));
            return;
        };
        let parallel = shared && rayon::current_num_threads() > 1;
        if parts.iter().all(Walk::fits) {
            walk.cast(parts, parallel, hits);
        } else {
            let (fit, others): (Vec<Part<'_>>, Vec<_>) = parts.iter().partition(|p| Walk::fits(p));
            walk.cast(&fit, parallel, hits);
            others.iter().for_each(|part| self.cast_beams(part, hits));
        }
    }

    /// Beam by beam.
    fn cast_beams(&self, part: &Part<'_>, hits: &mut [Hit]) {
        let origin = Vec3::from(part.pose.rows.map(|row| row[3]));
        let directions = self.table.directions().par_chunks(BEAMS_PER_TASK);
        let tasks = hits.par_chunks_mut(BEAMS_PER_TASK).zip(directions);
        tasks.for_each(|(hits, directions)| {
            for (hit, &direction) in hits.iter_mut().zip(directions) {
                let ray = Ray::new(origin, beam_direction(&part.pose, direction), hit.t);
                let mut found = part.bvh.closest_hit(&ray);
                if found.is_hit() {
                    found.prim = found.prim.wrapping_add(part.first_prim);
                }
                if found.t < hit.t || (found.t == hit.t && found.prim < hit.prim) {
                    *hit = found;
                }
            }
        });
    }
}
