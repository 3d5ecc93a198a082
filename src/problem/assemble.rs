//! From a scene and a P-SOG to a problem: entropies by voxel, and a tree a frame, shared by equal frames.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use rayon::prelude::*;

use super::{Content, OccupiedVoxel, Problem, ProblemError};
use crate::bvh::Bvh;
use crate::geom::TriangleSoup;
use crate::memory::{self, OutOfMemory};
use crate::psog::{EntropyKind, EntropyTable, Psog, fixed};
use crate::scene::{Coverage, EgoBody, Scene};
use crate::vehicle::BeamTable;

impl Content {
    /// Entropies and classes of a P-SOG's occupied voxels.
    ///
    /// `detection` holds the class ids that count as the detection target; the other classes are
    /// merged into one. The P-SOG must have fewer than 2³¹ voxels, as every grid has.
    pub fn from_psog(psog: &Psog, detection: &[u16]) -> Self {
        let table = EntropyTable::new(psog.frames());
        let is_target: Vec<bool> =
            (0..psog.classes().len()).map(|c| detection.contains(&(c as u16))).collect();
        let occupied = psog
            .index()
            .par_iter()
            .zip(psog.counts().par_chunks(psog.classes().len().max(1)))
            // A voxel may be listed with no frame in which it is occupied.
            .filter(|(_, row)| row.iter().any(|&count| count > 0))
            .map(|(&index, row)| {
                let (mut target, mut rest) = (0, 0);
                for (&count, &is_target) in row.iter().zip(&is_target) {
                    if is_target { target += count } else { rest += count }
                }
                let merged = [target, rest];
                OccupiedVoxel {
                    index: index as u32,
                    entropy: [
                        fixed(table.entropy(row, EntropyKind::Segmentation)),
                        fixed(table.entropy(&merged, EntropyKind::Segmentation)),
                        fixed(table.entropy(row, EntropyKind::Bernoulli)),
                    ],
                }
            })
            .collect();
        let voxels_by_class: Vec<Vec<u32>> = (0..psog.classes().len())
            .into_par_iter()
            .map(|class| {
                let rows = psog.index().iter().zip(psog.rows());
                rows.filter(|(_, row)| row[class] > 0).map(|(&index, _)| index as u32).collect()
            })
            .collect();
        let classes = psog.classes().to_vec();
        Self::new(classes, occupied, &voxels_by_class, !detection.is_empty())
    }
}

impl Problem {
    /// The problem that a scene poses with a P-SOG, over some of the scene's frames.
    ///
    /// # Errors
    /// The P-SOG is on another grid than the scene's region of interest.
    pub fn from_scene(
        scene: &Scene,
        psog: &Psog,
        table: BeamTable,
        frames: &[usize],
    ) -> Result<Self, ProblemError> {
        let bounds = scene.roi();
        let roi = psog.roi();
        let same = |a: [f64; 3], b: [f64; 3]| {
            // Half a thousandth of a voxel: what decimals in two files may differ by.
            (0..3).all(|k| (a[k] - b[k]).abs() <= 5e-4 * bounds.voxel[k])
        };
        if roi.shape() != bounds.shape
            || !same(roi.min(), bounds.min)
            || !same(roi.voxel(), bounds.voxel)
        {
            let words = |min: [f64; 3], voxel: [f64; 3], shape: [u32; 3]| {
                format!("{shape:?} voxels of {voxel:?} m from {min:?} on")
            };
            return Err(ProblemError::GridMismatch {
                psog: words(roi.min(), roi.voxel(), roi.shape()),
                scene: words(bounds.min, bounds.voxel, bounds.shape),
            });
        }
        Self::on_grid_of(psog, scene, table, frames)
    }

    /// As [`Self::from_scene`], over the P-SOG's own grid, whatever the scene's region of interest is.
    ///
    /// # Errors
    /// The trees of the frames do not fit into memory.
    pub fn on_grid_of(
        psog: &Psog,
        scene: &Scene,
        table: BeamTable,
        frames: &[usize],
    ) -> Result<Self, ProblemError> {
        let roi = psog.roi();
        let content = Content::from_psog(psog, &scene.detection_among(psog.classes()));
        let far = Self::far_range_of(roi, table.range());
        let frames = if scene.has_geometry() { frames } else { &[] };
        let frames = shared_trees(frames, far, |t| scene.frame(t, EgoBody::Include))?;
        let ends_at_hits = matches!(scene.coverage(), Coverage::FirstHit);
        let problem = Self::new(*roi, content, table, frames, ends_at_hits);
        Ok(problem.with_constraints(scene.mount().into()))
    }
}

/// Bytes a triangle while a tree is built: soup, triangles twice, items of the builder, nodes, blocks.
const TREE_BYTES: u64 = 300;

/// The tree of each of `frames`, for hits up to `far` metres away; frames whose triangles are equal bit
/// by bit share one.
///
/// # Errors
/// The trees do not fit into memory.
pub fn shared_trees(
    frames: &[usize],
    far: f32,
    soup_of: impl Fn(usize) -> TriangleSoup + Sync,
) -> Result<Vec<Arc<Bvh>>, OutOfMemory> {
    let hash = |&t: &usize| {
        let (soup, mut hasher) = (soup_of(t), DefaultHasher::new());
        bits(&soup).hash(&mut hasher);
        (hasher.finish(), soup.faces.len() as u64)
    };
    let hashes: Vec<(u64, u64)> = frames.par_iter().map(hash).collect();
    let mut distinct = HashMap::new();
    let first: Vec<usize> =
        hashes.iter().enumerate().map(|(k, hash)| *distinct.entry(hash).or_insert(k)).collect();
    let triangles: u64 = distinct.keys().map(|(_, triangles)| triangles).sum();
    memory::check("the trees of the frames", TREE_BYTES * triangles)?;
    let build = |k: usize| {
        let soup = soup_of(frames[k]);
        let is_equal = first[k] < k && bits(&soup_of(frames[first[k]])) == bits(&soup);
        (!is_equal).then(|| Arc::new(Bvh::build(&soup, far)))
    };
    let built: Vec<Option<Arc<Bvh>>> = (0..frames.len()).into_par_iter().map(build).collect();
    let tree = |k: usize| built[k].as_ref().or(built[first[k]].as_ref());
    let trees =
        (0..frames.len()).map(|k| tree(k).expect("the first of equal frames is built").clone());
    Ok(trees.collect())
}

/// All that a frame is.
fn bits(soup: &TriangleSoup) -> [&[u8]; 3] {
    [
        bytemuck::cast_slice(&soup.vertices),
        bytemuck::cast_slice(&soup.faces),
        bytemuck::cast_slice(&soup.face_class),
    ]
}
