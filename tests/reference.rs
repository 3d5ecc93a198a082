//! Coverage and sums in `f64`, straight from the definitions and slow: no tree, no walk, no rounding of
//! poses.
//!
//! Every step keeps its bits when y changes its sign everywhere: products and sums of mirrored numbers
//! are mirrored numbers, and voxel faces are counted from the middle of the grid.

use std::collections::BTreeSet;

use glam::{DVec3, Vec3};
use lidar_cast::grid::HIT_PUSH;
use sightline::geom::Pose;
use sightline::internals::EntropyKind;
use sightline::problem::Tally;
use sightline::vehicle::Placement;

use crate::own_scenes::Own;

/// Entropies of a scene's voxels, and its triangles in `f64`.
pub(crate) struct Reference<'a> {
    own: &'a Own,
    /// Corners of each triangle, in every frame.
    frames: Vec<Vec<[DVec3; 3]>>,
    entropies: Vec<u32>,
}

impl<'a> Reference<'a> {
    pub(crate) fn new(own: &'a Own) -> Self {
        let corners = |soup: &sightline::geom::TriangleSoup| {
            (0..soup.faces.len() as u32)
                .map(|prim| soup.corners(prim).map(|corner| Vec3::from(corner).as_dvec3()))
                .collect()
        };
        let frames = own.soups.iter().map(corners).collect();
        let entropies = own.psog.entropies(EntropyKind::Segmentation);
        Self { own, frames, entropies }
    }

    /// Covered voxels, their information and the hits of a placement in each frame.
    pub(crate) fn tally(&self, placement: &Placement) -> Tally {
        let mut tally = Tally::default();
        for triangles in &self.frames {
            let mut covered = BTreeSet::new();
            for lidar in &placement.lidars {
                let pose = lidar.ego_from_sensor();
                for direction in self.own.problem.sensors().table(0).directions() {
                    tally.beams += 1;
                    tally.hits += u64::from(self.beam(triangles, &pose, *direction, &mut covered));
                }
            }
            tally.covered += covered.len() as u64;
            let listed = covered.iter().filter_map(|&voxel| self.own.psog.find(voxel));
            tally.entropy[0] += listed.map(|k| u64::from(self.entropies[k])).sum::<u64>();
        }
        tally
    }

    /// Adds the voxels of one beam; whether it hit.
    fn beam(
        &self,
        triangles: &[[DVec3; 3]],
        pose: &Pose,
        direction: [f32; 3],
        covered: &mut BTreeSet<u64>,
    ) -> bool {
        let (origin, range) = (pose.translation, self.own.scene.lidars()[0].range());
        let direction = pose.rotation * Vec3::from(direction).as_dvec3();
        let hits = triangles.iter().filter_map(|triangle| distance(triangle, origin, direction));
        let hit = hits.filter(|&t| t <= range).min_by(f64::total_cmp);
        let end = hit.map_or(range, |t| t + HIT_PUSH);
        let roi = self.own.psog.roi();
        let (voxel, shape) = (DVec3::from(roi.voxel()), roi.shape().map(f64::from));
        let middle = [0, 1, 2].map(|k| roi.min()[k] + 0.5 * shape[k] * voxel[k]);
        let from = [0, 1, 2].map(|k| (origin[k] - middle[k]) / voxel[k]);
        let along = [0, 1, 2].map(|k| direction[k] / voxel[k]);
        let mut cuts = vec![0.0, end];
        for k in 0..3 {
            for face in 0..=shape[k] as i32 {
                let t = (f64::from(face) - 0.5 * shape[k] - from[k]) / along[k];
                if t > 0.0 && t < end {
                    cuts.push(t);
                }
            }
        }
        cuts.sort_by(f64::total_cmp);
        for pair in cuts.windows(2) {
            // Between two cuts a beam is in one voxel.
            let t = 0.5 * (pair[0] + pair[1]);
            let at = [0, 1, 2].map(|k| ((from[k] + t * along[k]).floor() + 0.5 * shape[k]) as i64);
            if (0..3).all(|k| (0..roi.shape()[k].into()).contains(&at[k])) && pair[0] < pair[1] {
                covered.insert(roi.linear(at.map(|i| i as u32)));
            }
        }
        hit.is_some()
    }
}

/// Distance at which a line of sight meets a triangle (Möller, Trumbore 1997).
fn distance([a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (e1, e2, s) = (*b - *a, *c - *a, origin - *a);
    let (p, q) = (direction.cross(e2), s.cross(e1));
    let det = e1.dot(p);
    let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, e2.dot(q) / det);
    (det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}
