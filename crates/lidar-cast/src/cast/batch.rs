//! Casts the beams of one sensor model for any number of sensors.

use rayon::prelude::*;

use super::reference::cast_rows;
use super::walk::{Instructions, TreeView, Walk};
use crate::bvh::{Bvh, Hit};
use crate::geom::Pose;
use crate::sensor::BeamTable;
use crate::task::{DevicePose, Frame};

/// Sensors for each thread from which on a sensor's windows are not shared out too.
const SENSORS_A_THREAD: usize = 4;

/// Casts the beams of a table: the bits of [`super::cast_frame_closest`].
///
/// Each sensor walks the tree once with all of its beams. Beams that lie in no grid go alone.
pub struct Caster {
    table: BeamTable,
    walk: Option<Walk>,
}

/// A tree, and the pose of each sensor of a batch in its frame.
struct PlacedTree<'a> {
    bvh: &'a Bvh,
    first_prim: u32,
    poses: Vec<DevicePose>,
}

/// A sensor that is cast by itself: its parts by how their beams go, and its hits.
struct SensorCast<'p, 'h> {
    walked: Vec<TreeView<'p>>,
    alone: Vec<TreeView<'p>>,
    hits: &'h mut [Hit],
}

impl<'a> PlacedTree<'a> {
    /// The tree with the pose of one sensor.
    fn part(&self, sensor: usize) -> TreeView<'a> {
        TreeView { bvh: self.bvh, pose: self.poses[sensor], first_prim: self.first_prim }
    }
}

impl Caster {
    /// A caster for all sensors of a table.
    pub fn new(table: &BeamTable) -> Self {
        Self::by(Instructions::Best, table)
    }

    /// A caster that uses some instructions, to compare them.
    pub fn by(instructions: Instructions, table: &BeamTable) -> Self {
        Self { table: table.clone(), walk: Walk::new(table, instructions) }
    }

    /// Closest hits of many sensors up to `range` in a frame; `sensors` lead to the ego frame, `hits`
    /// becomes `[sensors × directions]`.
    pub fn cast_frame(&self, sensors: &[Pose], frame: &Frame, range: f32, hits: &mut Vec<Hit>) {
        hits.clear();
        hits.resize(sensors.len() * self.table.directions().len(), Hit::none(range));
        self.closer_hits_in(sensors, frame, self.rows(hits));
    }

    /// Replaces the hits of many sensors, a row each, by closer ones in a frame; `sensors` lead to the ego
    /// frame, and a hit of nothing is as far as it says.
    pub fn closer_hits_in(&self, sensors: &[Pose], frame: &Frame, rows: Vec<&mut [Hit]>) {
        let levels = frame.instances().iter().map(|instance| PlacedTree {
            bvh: &instance.tree,
            first_prim: instance.first_prim,
            poses: sensors.iter().map(|sensor| instance.pose_of(sensor)).collect(),
        });
        self.cast_levels(&levels.collect::<Vec<_>>(), rows);
    }

    /// Closest hits of many sensors up to `range` in one tree; `poses` lead to its frame, `hits` becomes
    /// `[poses × directions]`.
    pub fn closest_hits(&self, poses: &[DevicePose], bvh: &Bvh, range: f32, hits: &mut Vec<Hit>) {
        let level = PlacedTree { bvh, first_prim: 0, poses: poses.to_vec() };
        hits.clear();
        hits.resize(poses.len() * self.table.directions().len(), Hit::none(range));
        self.cast_levels(&[level], self.rows(hits));
    }

    fn rows<'h>(&self, hits: &'h mut [Hit]) -> Vec<&'h mut [Hit]> {
        hits.chunks_mut(self.table.directions().len()).collect()
    }

    fn cast_levels(&self, levels: &[PlacedTree<'_>], rows: Vec<&mut [Hit]>) {
        let few = rows.len() < SENSORS_A_THREAD * rayon::current_num_threads();
        let of_sensor = |(k, hits)| {
            let parts: Vec<TreeView<'_>> = levels.iter().map(|level| level.part(k)).collect();
            let (walked, alone) = self.sorted(&parts);
            SensorCast { walked, alone, hits }
        };
        let mut rows: Vec<SensorCast<'_, '_>> =
            rows.into_iter().enumerate().map(of_sensor).collect();
        match &self.walk {
            Some(walk) if few => {
                rows.par_iter_mut().for_each(|row| walk.cast(&row.walked, true, row.hits))
            }
            // Window by window: tree nodes that one sensor meets stay in the cache for the next sensor.
            Some(walk) => (0..walk.windows()).for_each(|window| {
                rows.par_iter_mut().for_each(|row| walk.cast_in(window, &row.walked, row.hits));
            }),
            None => {}
        }
        rows.into_par_iter().for_each(|row| self.cast_alone(row.alone, row.hits));
    }

    /// Replaces the hits of one sensor, in the order of the table's directions, by closer ones in some
    /// trees, and by equally close ones of a lower face; a hit of nothing is as far as it says.
    ///
    /// A tree out of the sensor's sight costs little: a test of its root node's boxes.
    pub fn closer_hits(&self, parts: &[TreeView<'_>], hits: &mut [Hit]) {
        let (walked, alone) = self.sorted(parts);
        if let Some(walk) = &self.walk {
            walk.cast(&walked, false, hits);
        }
        self.cast_alone(alone, hits);
    }

    /// Parts whose tree all beams walk together, and parts into which each beam is cast alone.
    fn sorted<'a>(&self, parts: &[TreeView<'a>]) -> (Vec<TreeView<'a>>, Vec<TreeView<'a>>) {
        parts.iter().partition(|part| self.walk.is_some() && Walk::fits(part))
    }

    fn cast_alone(&self, alone: Vec<TreeView<'_>>, hits: &mut [Hit]) {
        let range = farthest(hits);
        for TreeView { bvh, pose, first_prim } in alone {
            cast_rows(vec![(&pose, &mut *hits)], self.table.directions(), bvh, first_prim, range);
        }
    }
}

/// Largest `t` of some hits in metres, misses included.
fn farthest(hits: &[Hit]) -> f32 {
    hits.iter().map(|hit| hit.t).fold(0.0, f32::max)
}
