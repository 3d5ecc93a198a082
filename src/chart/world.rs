//! The problem that a scene poses at a setting, with the P-SOGs and trees that settings share.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::DVec3;

use super::{Engine, SceneDetail, Setting};
use crate::engine::BackendError;
use crate::geom::TriangleSoup;
use crate::memory::OutOfMemory;
use crate::problem::{self, Problem, ProblemError, spread};
use crate::psog::{Psog, PsogError, Roi};
use crate::scan::scan_scene;
use crate::scene::{EgoBody, PsogSource, ScanSettings, Scene};
use crate::vehicle::{PoseGridError, SensorError, SensorName, UnknownSensor};

/// Why a setting could not be measured.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum ChartError {
    /// The voxels of a setting do not make a grid.
    Grid(#[from] PsogError),
    /// The beams of a setting do not make a sensor.
    Sensor(#[from] SensorError),
    /// The trees of the frames do not fit into memory.
    OutOfMemory(#[from] OutOfMemory),
    /// A P-SOG that does not fit the scene or the vehicle.
    Problem(#[from] ProblemError),
    /// A LiDAR of a model that the vehicle does not have.
    UnknownSensor(#[from] UnknownSensor),
    /// A LiDAR of a model that no mount may hold: an atlas has no pose for it.
    #[error(
        "placement `{placement}` has a `{sensor}`, which no mount of the vehicle may hold; the atlas has no pose for it"
    )]
    NoPlace { placement: String, sensor: SensorName },
    /// Scoring failed.
    Backend(#[from] BackendError),
    /// The mount has too many poses for an atlas.
    Poses(#[from] PoseGridError),
    /// The P-SOG of another voxel size is wanted of a scene whose P-SOG is a file.
    #[error("the P-SOG is a file; its voxels cannot become {factor} times as large")]
    FixedVoxels { factor: f64 },
    /// More random placements than are ranked.
    #[error(
        "{random} random placements are more than the {most} that a chart ranks; ask for fewer"
    )]
    TooMany { random: u32, most: u32 },
    /// Nothing to rank.
    #[error("there are no placements to rank; give some, or ask for random ones")]
    NoPlacement,
    /// An objective of a task that the scene does not have.
    #[error(
        "{scene}: the objective `{objective}` needs a detection target; name its classes under \
         `detection` in the scene"
    )]
    NoDetection { scene: String, objective: String },
    /// A reference coarser than the scene.
    #[error(
        "--finest {finest}: is coarser than the scene's own voxels of {edge} m; give at most that"
    )]
    Coarser {
        /// Edge that was given, in metres.
        finest: f64,
        /// The scene's own edge, in metres.
        edge: f64,
    },
    /// A state that does not belong to the scene and the settings.
    #[error("the chart was begun with another scene or other placements; start a new run")]
    OtherState,
    /// The timing of a device that was replaced on the way says nothing.
    #[error("{change}")]
    DeviceLost { change: String },
}

impl ChartError {
    /// True if the other settings can still be measured: a device failed at one setting, or an atlas was too large
    /// for it.
    pub(super) fn spares_others(&self, setting: &Setting) -> bool {
        matches!(
            self,
            Self::Backend(_) | Self::Poses(_) | Self::DeviceLost { .. } | Self::NoPlace { .. }
        ) && matches!(setting.engine, Engine::Gpu | Engine::Atlas)
    }
}

/// A scene with its P-SOGs of several voxel sizes.
pub(super) struct ChartWorld {
    pub(super) scene: Arc<Scene>,
    grids: Vec<(f64, Arc<Psog>)>,
    /// All frames with every triangle, by the range for which trees are built.
    whole: Vec<(f32, problem::World)>,
}

impl ChartWorld {
    pub(super) fn new(scene: Arc<Scene>, own: Arc<Psog>) -> Self {
        Self { scene, grids: vec![(1.0, own)], whole: Vec::new() }
    }

    /// The P-SOG with voxels of `factor` times the scene's own edge, built on first use while `go_on` says yes, which a
    /// scan asks before each band of rings; `None` after a no.
    ///
    /// If the scene leaves the spacing of the scans to the voxels, as many points fall on a voxel's width at every
    /// size. If it sets numbers, scans for smaller voxels are denser by the same factor, and scans for larger ones stay
    /// as they are.
    pub(super) fn psog(
        &mut self,
        factor: f64,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Option<Arc<Psog>>, ChartError> {
        if let Some((_, psog)) = self.grids.iter().find(|(f, _)| *f == factor) {
            return Ok(Some(psog.clone()));
        }
        let PsogSource::Scan(own) = self.scene.psog_source() else {
            return Err(ChartError::FixedVoxels { factor });
        };
        let denser = |steps: u32| (f64::from(steps) / factor.min(1.0)).ceil() as u32;
        let settings = ScanSettings {
            channels: own.channels.map(denser),
            azimuth_steps: own.azimuth_steps.map(denser),
            spacing: own.spacing.map(|spacing| spacing * factor.min(1.0)),
            ..*own
        };
        let bounds = self.scene.roi();
        let roi = Roi::from_bounds(bounds.min, bounds.max, bounds.voxel.map(|v| v * factor))
            .map_err(PsogError::from)?;
        let psog = match scan_scene(&self.scene, &roi, &settings, |_| go_on()) {
            Ok((psog, _)) => Arc::new(psog),
            Err(PsogError::Stopped { .. }) => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        self.grids.push((factor, psog.clone()));
        Ok(Some(psog))
    }

    /// Frames that a setting casts into.
    pub(super) fn frames(&self, fidelity: &SceneDetail) -> Vec<usize> {
        spread(self.scene.frame_count(), Some(fidelity.frames))
    }

    /// All frames with every triangle, built on first use.
    fn whole(&mut self, far: f32) -> Result<&problem::World, OutOfMemory> {
        if !self.whole.iter().any(|(f, _)| *f == far) {
            let all: Vec<usize> = (0..self.scene.frame_count()).collect();
            self.whole.push((far, problem::world_of(&self.scene, &all, far, EgoBody::Include)?));
        }
        let (_, world) = self.whole.iter().find(|(f, _)| *f == far).expect("there now");
        Ok(world)
    }

    pub(super) fn problem(&mut self, fidelity: &SceneDetail) -> Result<Problem, ChartError> {
        let psog = self.psog(fidelity.voxel, &|| true)?.expect("nobody stops the scan");
        let frames = if fidelity.through { Vec::new() } else { self.frames(fidelity) };
        let (scene, cell) = (self.scene.clone(), fidelity.detail * psog.roi().voxel()[0]);
        let sensors = scene.thinned_sensors(fidelity.azimuth)?;
        let world_of = |far| {
            if cell > 0.0 {
                let merged = |part| merge_vertices(&scene.part(part), cell);
                problem::world_of_parts(&scene, &frames, far, EgoBody::Include, merged)
            } else {
                Ok(self.whole(far)?.over(&frames))
            }
        };
        Ok(Problem::in_world(&psog, &scene, sensors, &frames, !fidelity.through, world_of)?)
    }
}

/// Merges the vertices of each cubic cell of edge `cell` metres into their mean, and drops the
/// triangles of which two corners have become one (Rossignac, Borrel 1993), and all but the first of
/// those that have become the same.
///
/// A vertex moves by less than the cell's diagonal and one alone in its cell stays, so that walls and roads keep their
/// corners; things smaller than a cell vanish. Triangles keep their order and class. A `cell` that is not above 0
/// changes nothing.
pub(crate) fn merge_vertices(soup: &TriangleSoup, cell: f64) -> TriangleSoup {
    if cell.is_nan() || cell <= 0.0 {
        return soup.clone();
    }
    let mut slots: HashMap<[i64; 3], u32> = HashMap::new();
    let mut sums: Vec<(DVec3, Vec<[u32; 3]>)> = Vec::new();
    let slot = |vertex: &[f32; 3]| {
        let key = vertex.map(|v| (f64::from(v) / cell).floor() as i64);
        let slot = *slots.entry(key).or_insert_with(|| {
            sums.push((DVec3::ZERO, Vec::new()));
            sums.len() as u32 - 1
        });
        // A corner that several triangles list on their own counts once.
        let bits = vertex.map(f32::to_bits);
        let (sum, seen) = &mut sums[slot as usize];
        if !seen.contains(&bits) {
            seen.push(bits);
            *sum += DVec3::from(vertex.map(f64::from));
        }
        slot
    };
    let slot_of: Vec<u32> = soup.vertices.iter().map(slot).collect();
    let means = sums.iter().map(|(sum, seen)| *sum / seen.len() as f64);
    let vertices = means.map(|mean| mean.as_vec3().to_array()).collect();
    let mut merged = TriangleSoup { vertices, ..TriangleSoup::default() };
    let mut seen = HashSet::new();
    for (face, &class) in soup.faces.iter().zip(&soup.face_class) {
        let [a, b, c] = face.map(|v| slot_of[v as usize]);
        let mut corners = [a, b, c];
        corners.sort_unstable();
        if a != b && b != c && c != a && seen.insert(corners) {
            merged.faces.push([a, b, c]);
            merged.face_class.push(class);
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_things_vanish_and_large_ones_keep_their_corners() {
        let wall = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 0.0, 3.0]];
        let leaf = [[5.1, 5.1, 1.1], [5.2, 5.1, 1.1], [5.1, 5.2, 1.2]];
        let soup = TriangleSoup {
            vertices: [wall, leaf].concat(),
            faces: vec![[0, 1, 2], [3, 4, 5]],
            face_class: vec![4, 7],
        };
        let merged = merge_vertices(&soup, 0.5);
        assert_eq!((merged.faces.len(), &merged.face_class[..]), (1, &[4][..]));
        assert_eq!(merged.corners(0), wall);
        assert_eq!(merge_vertices(&soup, 0.0), soup);
        assert_eq!(merge_vertices(&soup, 0.01).faces.len(), 2);
    }

    #[test]
    fn triangles_that_become_the_same_are_kept_once() {
        let near = |d: f32| [[0.1 + d, 0.1, 0.1], [1.1 + d, 0.1, 0.1], [1.1, 1.1 + d, 0.1]];
        let soup = TriangleSoup {
            vertices: [near(0.0), near(0.1), near(0.2), near(2.0)].concat(),
            // The second turns the other way round, the last lies elsewhere.
            faces: vec![[0, 1, 2], [5, 4, 3], [7, 8, 6], [9, 10, 11]],
            face_class: vec![1, 2, 3, 4],
        };
        let merged = merge_vertices(&soup, 1.0);
        assert_eq!(merged.face_class, [1, 4]);
        assert_eq!(merge_vertices(&soup, 0.01), soup);
    }

    #[test]
    fn a_tessellated_wall_stays_closed() {
        // A wall of 40 × 40 quads of 5 cm, merged in cells of 20 cm.
        let mut soup = TriangleSoup::default();
        for i in 0..=40 {
            for j in 0..=40 {
                soup.vertices.push([5.0, 0.05 * i as f32, 0.05 * j as f32]);
            }
        }
        for (i, j) in (0..40_u32).flat_map(|i| (0..40).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| i * 41 + j;
            soup.faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            soup.faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        soup.face_class = vec![0; soup.faces.len()];
        let merged = merge_vertices(&soup, 0.2);
        assert!(merged.faces.len() < soup.faces.len() / 8, "{} faces", merged.faces.len());
        let bvh = crate::bvh::Bvh::build(&merged, 10.0);
        for k in 0..100 {
            let (y, z) = (0.3 + 0.014 * k as f32, 1.7 - 0.013 * k as f32);
            let ray = crate::bvh::Ray::new(glam::Vec3::new(0.0, y, z), glam::Vec3::X, 10.0);
            assert_eq!(bvh.closest_hit(&ray).t, 5.0, "a hole at {y}, {z}");
        }
    }
}
