//! Settings of fidelity from fine to coarse, and those that a scene does not allow.

use serde::{Deserialize, Serialize};

use crate::json::counted;
use crate::scene::{Coverage, PsogSource, Scene};
use crate::vehicle::Lidar;

/// Least and largest voxel edge of a setting in metres, beside the scene's own edge.
const EDGES: [f64; 2] = [0.1, 0.8];
/// Fewest azimuth steps that are left of a turn.
const FEWEST_STEPS: u32 = 16;
/// Most voxels of the finest grid: 32 MiB a bitmap.
const MOST_VOXELS: f64 = (1_u64 << 28) as f64;
/// Voxel edge at which a beam takes as long to walk as to be cast, in metres.
///
/// This and the next two are fitted to scenes/highway.json: within a factor of 1.5 for 9 of 10 settings.
const METRES_A_CAST: f64 = 0.07;
/// Length of the ways of beams that run through, in lengths of those that end.
const THROUGH: f64 = 4.0;
/// Voxels that are counted in the time in which a beam is cast.
const VOXELS_A_CAST: f64 = 3000.0;
/// Ratio of the times of the `f64` scorer and of the CPU backend.
const SLOWER_IN_F64: f64 = 3.0;
/// Slack for edges that decimals cannot give exactly.
const SLACK: f64 = 1e-9;

/// Detail in which a scene is modelled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SceneDetail {
    /// Edge of a voxel as a multiple of the scene's own.
    pub voxel: f64,
    /// Divisor of the azimuth steps; of a list of n directions ⌈n / azimuth⌉ are cast, evenly.
    pub azimuth: u32,
    /// Frames that are cast into, spread evenly from the first on.
    pub frames: u32,
    /// True if beams run through surfaces.
    pub through: bool,
    /// Edge of the cells within which vertices are merged, as a multiple of the voxel's; 0 keeps
    /// every triangle.
    pub detail: f64,
}

/// Engine of a setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Engine {
    /// the f64 scorer, on the CPU.
    F64,
    /// The CPU backend, in `f32`.
    Cpu,
    /// The GPU backend, in `f32`.
    Gpu,
    /// A warm pose atlas of the CPU backend: placements are moved to the grid of the swaps, on which
    /// every pose was cast before.
    Atlas,
}

impl Engine {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::F64 => "f64",
            Self::Cpu => "CPU",
            Self::Gpu => "GPU",
            Self::Atlas => "atlas",
        }
    }
}

/// One setting: a fidelity and an engine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Detail in which the scene is modelled.
    pub fidelity: SceneDetail,
    /// Arithmetic and device that compute it.
    pub engine: Engine,
}

/// Settings from fine to coarse.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ladder {
    /// Setting after setting: the finest in `f64` first, then the finest in `f32`.
    pub all: Vec<Setting>,
    /// Why settings are missing, one sentence each.
    pub left_out: Vec<String>,
}

impl SceneDetail {
    /// Everything that a scene describes.
    pub fn of_scene(scene: &Scene) -> Self {
        let through = !scene.has_geometry() || scene.coverage() == Coverage::Through;
        let frames = if through { 1 } else { scene.frame_count() as u32 };
        Self { voxel: 1.0, azimuth: 1, frames, through, detail: 0.0 }
    }

    /// True if this models no more than `other` in any respect.
    pub(crate) fn is_within(&self, other: &Self) -> bool {
        self.voxel >= other.voxel
            && self.azimuth >= other.azimuth
            && self.frames <= other.frames
            && self.through >= other.through
            && self.detail >= other.detail
    }

    /// True if a score means the same as at `other`. Another voxel size, sensor or kind of coverage changes the
    /// quantity itself, and only rankings compare.
    pub(crate) fn same_quantity(&self, other: &Self) -> bool {
        self.voxel == other.voxel && self.azimuth == other.azimuth && self.through == other.through
    }

    /// The setting in words; `edge` is the scene's own voxel edge in metres.
    pub(crate) fn words(&self, edge: f64) -> String {
        let mut words = vec![format!("{} m", round(self.voxel * edge))];
        if self.azimuth > 1 {
            words.push(format!("azimuth 1/{}", self.azimuth));
        }
        if self.through {
            words.push("through".into());
        } else {
            words.push(counted(self.frames as usize, "frame"));
        }
        if self.detail > 0.0 {
            words.push(format!("merged {} m", round(self.detail * self.voxel * edge)));
        }
        words.join(", ")
    }
}

fn round(metres: f64) -> f64 {
    (metres * 1e4).round() / 1e4
}

impl Setting {
    /// Estimated time of a placement on the CPU from its beams and voxels, in beams of one LiDAR that are cast.
    pub(crate) fn effort(&self, scene: &Scene) -> f64 {
        let SceneDetail { voxel, azimuth, frames, through, .. } = self.fidelity;
        let most = scene.lidars().iter().map(|lidar| lidar.beam_count()).max().unwrap_or(0);
        let beams = most as f64 / f64::from(azimuth);
        let voxels: f64 =
            scene.roi().shape.map(f64::from).iter().product::<f64>() / (voxel * voxel * voxel);
        let walk = METRES_A_CAST / (voxel * scene.roi().voxel[0]);
        // A beam that runs through ends at nothing.
        let beam = if through { THROUGH * walk } else { 1.0 + walk };
        let slower = if self.engine == Engine::F64 { SLOWER_IN_F64 } else { 1.0 };
        f64::from(frames) * (beams * beam + voxels / VOXELS_A_CAST) * slower
    }

    /// The setting in words; `edge` is the scene's own voxel edge in metres.
    pub(crate) fn words(&self, edge: f64) -> String {
        format!("{}, {}", self.fidelity.words(edge), self.engine.name())
    }
}

impl Ladder {
    /// Single steps down from the finest setting, then combinations of steps.
    ///
    /// `finest` is the edge of the finest voxels in metres; `None` takes half of the scene's own where
    /// that is not below 0.1 m.
    pub(crate) fn new(scene: &Scene, finest: Option<f64>) -> Self {
        let own = SceneDetail::of_scene(scene);
        let mut left_out = Vec::new();
        let voxels = voxel_factors(scene, finest, &mut left_out);
        let top = SceneDetail { voxel: voxels[0], ..own };
        let steps = |lidar: &&Lidar| match lidar {
            Lidar::Spinning { azimuth_steps, .. } => *azimuth_steps,
            Lidar::Directions { directions, .. } => directions.len() as u32,
        };
        let steps = scene.lidars().iter().map(steps).min().unwrap_or(0);
        let azimuths: Vec<u32> =
            [1, 2, 4, 8].into_iter().filter(|d| *d == 1 || steps / d >= FEWEST_STEPS).collect();
        let frames = halvings(own.frames);
        if own.through {
            let why = if scene.has_geometry() {
                "the scene's coverage is `through`"
            } else {
                "the scene has no geometry"
            };
            left_out.push(format!("frames, first-hit coverage and geometry detail: {why}"));
        }

        let mut settings = Self { all: Vec::new(), left_out };
        settings.add(top, Engine::F64);
        settings.add(top, Engine::Cpu);
        settings.add(top, Engine::Gpu);
        settings.add_each(Engine::Cpu, &voxels, |&voxel| SceneDetail { voxel, ..top });
        settings.add(own, Engine::Gpu);
        settings.add(SceneDetail { frames: own.frames.div_ceil(4), ..own }, Engine::Atlas);
        for &voxel in &voxels {
            settings.add(SceneDetail { voxel, ..own }, Engine::Atlas);
            settings.add(SceneDetail { voxel, frames: 1, ..own }, Engine::Atlas);
        }
        settings.add_each(Engine::Cpu, &azimuths, |&azimuth| SceneDetail { azimuth, ..top });
        settings.add_each(Engine::Cpu, &frames, |&frames| SceneDetail { frames, ..top });
        if !own.through {
            settings.add(SceneDetail { through: true, frames: 1, ..top }, Engine::Cpu);
            let merged = |&detail: &f64| SceneDetail { detail, ..top };
            settings.add_each(Engine::Cpu, &[0.5, 1.0, 2.0], merged);
        }
        settings.add_combinations(&voxels, &azimuths, &frames, top);
        settings
    }

    fn add_combinations(
        &mut self,
        voxels: &[f64],
        azimuths: &[u32],
        frames: &[u32],
        top: SceneDetail,
    ) {
        for &voxel in voxels.iter().filter(|v| **v >= 1.0).take(3) {
            for &azimuth in azimuths.iter().take(3) {
                for &frames in frames.iter().filter(|f| **f < top.frames) {
                    self.add(SceneDetail { voxel, azimuth, frames, ..top }, Engine::Cpu);
                }
                if !top.through || azimuth > 1 {
                    let through =
                        SceneDetail { voxel, azimuth, frames: 1, through: true, detail: 0.0 };
                    self.add(through, Engine::Cpu);
                }
            }
        }
        if !top.through && top.frames > 2 {
            let frames = top.frames.div_ceil(4);
            let small = SceneDetail { voxel: 1.0, azimuth: 2, frames, ..top };
            self.add(SceneDetail { detail: 1.0, ..small }, Engine::Cpu);
            self.add(small, Engine::Cpu);
            self.add(small, Engine::Gpu);
        }
    }

    fn add_each<T>(&mut self, engine: Engine, all: &[T], of: impl Fn(&T) -> SceneDetail) {
        all.iter().for_each(|one| self.add(of(one), engine));
    }

    fn add(&mut self, fidelity: SceneDetail, engine: Engine) {
        let setting = Setting { fidelity, engine };
        let finest = self.all.first().map_or(fidelity, |first| first.fidelity);
        if fidelity.is_within(&finest) && !self.all.contains(&setting) {
            self.all.push(setting);
        }
    }
}

/// Edges of voxels to try as multiples of the scene's own, rising; adds to `left_out` why others cannot be tried.
fn voxel_factors(scene: &Scene, finest: Option<f64>, left_out: &mut Vec<String>) -> Vec<f64> {
    if matches!(scene.psog_source(), PsogSource::File(_)) {
        left_out.push(
            "other voxel sizes: the P-SOG is a file of counts, and voxels cannot be merged without the \
             frames that were counted"
                .to_owned(),
        );
        return vec![1.0];
    }
    let edge = scene.roi().voxel[0];
    let voxel_count: f64 = scene.roi().shape.map(f64::from).iter().product();
    let factor = match finest {
        Some(metres) => metres / edge,
        None if 0.5 * edge >= EDGES[0] - SLACK && 8.0 * voxel_count <= MOST_VOXELS => 0.5,
        None => 1.0,
    };
    let coarser = [2.0, 4.0, 8.0].into_iter().filter(|f| f * edge <= EDGES[1] + SLACK);
    let mut voxels: Vec<f64> = std::iter::once(factor).chain([1.0]).chain(coarser).collect();
    voxels.retain(|f| *f >= factor);
    voxels.dedup();
    voxels
}

/// `count`, half of it, a quarter, …, 1.
pub(super) fn halvings(count: u32) -> Vec<u32> {
    std::iter::successors(Some(count), |n| Some(n / 2).filter(|n| *n > 0)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn scene(voxel: f64, coverage: &str) -> Scene {
        let text = format!(
            r#"{{ "sightline": 1, "roi": {{ "min": [-4, -4, 0], "max": [4, 4, 2],
                   "voxel": [{voxel}, {voxel}, {voxel}] }},
                 "lidar": {{ "channels": 4, "fov": [-20, 5], "azimuth_steps": 90, "range": 20 }},
                 "mount": {{ "min": [0, 0, 1], "max": [1, 1, 1.5], "lidars": 1 }},
                 "coverage": "{coverage}", "frames": 12,
                 "static": [{{ "class": "road", "plane": {{ "min": [-4, -4], "max": [4, 4], "z": 0.1 }} }}] }}"#
        );
        Scene::from_json(&text, Path::new(""), "test.json").unwrap()
    }

    fn words(settings: &Ladder, edge: f64) -> Vec<String> {
        settings.all.iter().map(|setting| setting.words(edge)).collect()
    }

    #[test]
    fn the_settings_step_down_from_the_finest_in_f64() {
        let settings = Ladder::new(&scene(0.2, "first-hit"), None);
        let words = words(&settings, 0.2);
        assert_eq!(words[0], "0.1 m, 12 frames, f64");
        for wanted in [
            "0.1 m, 12 frames, GPU",
            "0.2 m, 12 frames, CPU",
            "0.8 m, 12 frames, CPU",
            "0.1 m, azimuth 1/4, 12 frames, CPU",
            "0.1 m, 1 frame, CPU",
            "0.1 m, through, CPU",
            "0.1 m, 12 frames, merged 0.2 m, CPU",
            "0.4 m, azimuth 1/2, 3 frames, CPU",
            "0.8 m, azimuth 1/4, 1 frame, CPU",
            "0.2 m, azimuth 1/2, 3 frames, GPU",
            "0.2 m, 3 frames, atlas",
            "0.8 m, 12 frames, atlas",
        ] {
            assert!(words.iter().any(|w| w == wanted), "{wanted} is missing in {words:?}");
        }
        // 90 / 8 azimuth steps would be too few, and 1.6 m is too coarse.
        assert!(!words.iter().any(|w| w.contains("1/8") || w.contains("1.6 m")), "{words:?}");
        let mut sorted = words.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), words.len(), "a setting comes twice");
        assert!(settings.left_out.is_empty());
        let coarse = Ladder::new(&scene(0.2, "first-hit"), Some(0.2));
        assert_eq!(coarse.all[0].words(0.2), "0.2 m, 12 frames, f64");
        assert!(coarse.all.len() < settings.all.len());
    }

    #[test]
    fn through_coverage_leaves_frames_and_geometry_out() {
        let settings = Ladder::new(&scene(0.15, "through"), None);
        let words = words(&settings, 0.15);
        // Half of 0.15 m is below 0.1 m.
        assert_eq!(words[0], "0.15 m, through, f64");
        assert!(words.iter().all(|w| !w.contains("frame") && !w.contains("merged")), "{words:?}");
        assert!(settings.left_out[0].contains("`through`"), "{:?}", settings.left_out);
    }
}
