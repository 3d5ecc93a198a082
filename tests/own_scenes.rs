//! The committed scenes at a coarse fidelity, for tests that must hold on each of them.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use sightline::psog::Psog;
use sightline::scan::scan_scene;
use sightline::scene::{EgoBody, PsogSource, Scene};
use sightline::score::Scores;
use sightline::search::Evaluator;
use sightline::vehicle::read_placements;

use crate::common::*;

/// Names of the committed scenes.
pub(crate) const SCENES: [&str; 4] =
    ["urban-crossing", "highway", "residential", "industrial-yard"];
/// Frames that problems of these tests are summed over.
pub(crate) const FRAMES: [usize; 2] = [0, 3];
/// Azimuth steps of their sensors.
pub(crate) const AZIMUTH_STEPS: u32 = 90;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// A committed scene with larger voxels, fewer beams, fewer frames and sparser scans.
pub(crate) fn description(name: &str) -> Value {
    let text = std::fs::read_to_string(folder().join(format!("{name}.json"))).unwrap();
    let mut scene: Value = serde_json::from_str(&text).unwrap();
    scene["roi"]["voxel"] = json!([0.5, 0.5, 0.5]);
    scene["lidar"]["channels"] = json!(8);
    scene["lidar"]["azimuth_steps"] = json!(AZIMUTH_STEPS);
    scene["frames"] = json!(4);
    scene["psog"] = json!({ "scan": { "channels": 32, "azimuth_steps": 360, "window": 1 } });
    scene
}

/// The layouts of Table 7.
pub(crate) fn table_7() -> Vec<Placement> {
    read_placements(folder().join("placements.json")).unwrap()
}

/// A scene with all that is built from it.
pub(crate) struct Own {
    pub scene: Scene,
    pub psog: Psog,
    pub soups: Vec<TriangleSoup>,
    pub problem: Arc<Problem>,
    pub constraints: Constraints,
}

impl Own {
    /// Builds a description of [`description`]'s kind.
    pub(crate) fn new(description: &Value) -> Self {
        let scene = Scene::from_json(&description.to_string(), &folder(), "own.json").unwrap();
        let roi = scene.roi().grid().unwrap();
        let PsogSource::Scan(settings) = scene.psog_source() else { panic!("scans its P-SOG") };
        let (psog, _) = scan_scene(&scene, &roi, settings, |_| true).unwrap();
        let sensors = scene.sensors().unwrap();
        let problem = Problem::from_scene(&scene, &psog, sensors, &FRAMES).unwrap();
        let soups = FRAMES.map(|t| scene.frame(t, EgoBody::Include)).to_vec();
        let constraints = scene.constraints();
        Self { scene, psog, soups, problem: Arc::new(problem), constraints }
    }

    /// An evaluator on the CPU.
    pub(crate) fn evaluator(&self) -> Evaluator {
        let backend = CpuBackend::new(self.problem.task().clone(), MEMORY);
        Evaluator::new(self.problem.clone(), Box::new(backend))
    }

    /// Scores on the CPU.
    pub(crate) fn scores(&self, placements: &[Placement]) -> Vec<Scores> {
        self.evaluator().scores(placements).unwrap()
    }

    /// The scene as a mirror in its xz plane shows it.
    pub(crate) fn mirrored(&self) -> Self {
        let roi = *self.psog.roi();
        let mut rows: Vec<(u64, &[u16])> = self
            .psog
            .index()
            .iter()
            .map(|&v| mirrored_voxel(&roi, v))
            .zip(self.psog.rows())
            .collect();
        rows.sort_by_key(|row| row.0);
        let counts = rows.iter().flat_map(|row| row.1.iter().copied()).collect();
        let index = rows.iter().map(|row| row.0).collect();
        let classes = self.psog.classes().to_vec();
        let psog = Psog::new(roi, self.psog.frames(), classes, index, counts).unwrap();
        let mut soups = self.soups.clone();
        for soup in &mut soups {
            soup.vertices.iter_mut().for_each(|v| v[1] = -v[1]);
        }
        // The beams of the mirrored sensor: a scene's table is its own mirror image but for rounding.
        let directions = self.problem.sensors().table(0).directions().iter();
        let directions =
            directions.map(|&[x, y, z]| glam::DVec3::new(x.into(), -f64::from(y), z.into()));
        let range = self.scene.lidars()[0].range();
        let table = BeamTable::from_directions(directions, range).unwrap();
        let detection: Vec<u16> = self.scene.detection_among(psog.classes());
        let content = sightline::problem::content_of(&psog, &detection);
        let far = self.problem.far_range();
        let frames: Vec<_> = soups.iter().map(|soup| Arc::new(Bvh::build(soup, far))).collect();
        let problem =
            Problem::from(Task::new(roi, content, table, frames, self.problem.ends_at_hits()));
        let constraints = self.constraints.with_regions(|region| {
            // y, roll and yaw change their sign.
            for k in [1, 3, 5] {
                (region.lower[k], region.upper[k]) = (-region.upper[k], -region.lower[k]);
            }
        });
        Self { scene: self.scene.clone(), psog, soups, problem: Arc::new(problem), constraints }
    }
}

/// The voxel on the other side of the xz plane of a grid that is symmetric about it.
pub(crate) fn mirrored_voxel(roi: &Roi, voxel: u64) -> u64 {
    let [i, j, k] = roi.coords(voxel);
    roi.linear([i, roi.shape()[1] - 1 - j, k])
}

/// A placement as a mirror in the xz plane shows it.
pub(crate) fn mirrored(placement: &Placement) -> Placement {
    let mut placement = placement.clone();
    for pose in &mut placement.lidars {
        (pose.y, pose.roll, pose.yaw) = (-pose.y, -pose.roll, -pose.yaw);
    }
    placement
}
