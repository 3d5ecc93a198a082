//! Counts of scene files: frames, triangles, actors, voxels, hits.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use crate::job::Job;
use crate::problem::Problem;
use crate::psog::PsogInfo;
use crate::report::text::align_columns;
use crate::runs::{RunError, Watcher, opening};
use crate::scan::BeamHits;
use crate::scene::EgoBody;
use crate::search::Evaluator;
use crate::vehicle::{Placement, SensorPose};

/// Upper ends of the classes of range, metres.
const RANGES: [f32; 5] = [5.0, 10.0, 20.0, 40.0, f32::INFINITY];
const RANGE_NAMES: [&str; 5] = ["0–5 m", "5–10 m", "10–20 m", "20–40 m", "over 40 m"];

/// Counts of one scene.
#[derive(Debug, Serialize)]
pub struct SceneCounts {
    /// Name of the scene.
    pub name: String,
    /// Its frames.
    pub frames: usize,
    /// Triangles of the first frame, the ego's body included.
    pub triangles: usize,
    /// Actors by kind.
    pub actors: BTreeMap<String, usize>,
    /// Metres between the ego's first and last place.
    pub ego_way: f64,
    /// Occupied voxels of the P-SOG.
    pub occupied: u64,
    /// Percent of the classes' voxels, by class.
    pub voxel_share: BTreeMap<String, f64>,
    /// Entropy of the P-SOG in nats.
    pub entropy: f64,
    /// Percent of the reference LiDAR's beams that hit nothing.
    pub lost: f64,
    /// Percent of its hits in each class of range.
    pub hits_by_range: [f64; 5],
}

/// Counts frames, triangles, actors, voxels and hits of a scene file.
///
/// # Errors
/// A file that cannot be read, a scene without geometry.
pub fn count(path: &Path, watcher: &dyn Watcher) -> Result<SceneCounts, RunError> {
    let scene = opening::read(path, None, watcher)?;
    if !scene.has_geometry() {
        return Err(RunError::Usage(format!(
            "{}: has no geometry to count; add static shapes or actors",
            path.display()
        )));
    }
    let frames = scene.frame_count();
    let job = Job::new(scene);
    let (scene, psog) = (job.scene(), opening::psog(&job.scenes()[0], None, watcher)?);
    let info = PsogInfo::new(&psog, None);
    let soup = scene.frame(0, EgoBody::Include);
    let mut actors = BTreeMap::new();
    for track in scene.tracks() {
        *actors.entry(track.kind.name().to_owned()).or_default() += 1;
    }
    let (lost, hits_by_range) = hits(&*job.problem()?, &soup.face_class, frames)?;
    let votes: u64 = info.classes.iter().map(|c| c.voxels).sum();
    let share = |voxels: u64| 100.0 * voxels as f64 / votes.max(1) as f64;
    let seen = info.classes.iter().filter(|c| c.voxels > 0);
    let way = scene.ego_pose(frames - 1).translation - scene.ego_pose(0).translation;
    Ok(SceneCounts {
        name: scene.name().to_owned(),
        frames,
        triangles: soup.faces.len(),
        actors,
        ego_way: way.length(),
        occupied: info.occupied,
        voxel_share: seen.map(|c| (c.name.clone(), share(c.voxels))).collect(),
        entropy: info.entropy_segmentation,
        lost,
        hits_by_range,
    })
}

/// Percent of beams without a hit, and of hits by range: one LiDAR above the origin, in the middle of
/// the first mount in height, in all frames. Hits on the ego's own body are left out.
fn hits(problem: &Problem, classes: &[u16], frames: usize) -> Result<(f64, [f64; 5]), RunError> {
    let [low, high] = problem.constraints().corners();
    let z = 0.5 * (low[2] + high[2]);
    let pose = SensorPose { z, ..SensorPose::default() };
    let placement = Placement { name: "middle".to_owned(), lidars: vec![pose] };
    let mut evaluator = Evaluator::on_cpu(problem.clone());
    let (mut beams, mut count) = (0, [0_usize; 5]);
    for t in 0..frames {
        let problem = problem.over(&[t]);
        let columns = BeamHits::of(std::slice::from_ref(&placement), &problem, classes, |poses| {
            evaluator.backend_mut().hits(poses, t)
        })?;
        beams += columns.beams();
        for distance in columns.distance.iter().filter(|d| d.is_finite()) {
            count[RANGES.partition_point(|end| end <= distance).min(4)] += 1;
        }
    }
    let hits: usize = count.iter().sum();
    let percent = |n: usize, of: usize| 100.0 * n as f64 / of.max(1) as f64;
    Ok((percent(beams - hits, beams), count.map(|n| percent(n, hits))))
}

/// A column a scene.
pub fn counts_text(facts: &[SceneCounts]) -> String {
    let row = |name: &str, value: &dyn Fn(&SceneCounts) -> String| {
        std::iter::once(name.to_owned()).chain(facts.iter().map(value)).collect::<Vec<String>>()
    };
    let mut rows = vec![
        row("", &|f| f.name.clone()),
        row("frames", &|f| f.frames.to_string()),
        row("ego drives, m", &|f| format!("{:.0}", f.ego_way)),
        row("triangles", &|f| f.triangles.to_string()),
    ];
    let union = |of: &dyn Fn(&SceneCounts) -> Vec<String>| {
        facts.iter().flat_map(of).collect::<std::collections::BTreeSet<String>>()
    };
    for kind in union(&|f| f.actors.keys().cloned().collect()) {
        rows.push(row(&kind, &|f| f.actors.get(&kind).copied().unwrap_or(0).to_string()));
    }
    rows.push(row("occupied voxels", &|f| f.occupied.to_string()));
    rows.push(row("entropy, nats", &|f| format!("{:.0}", f.entropy)));
    for class in union(&|f| f.voxel_share.keys().cloned().collect()) {
        let share = |f: &SceneCounts| f.voxel_share.get(&class).copied().unwrap_or(0.0);
        rows.push(row(&format!("{class}, % of voxels"), &|f| format!("{:.2}", share(f))));
    }
    rows.push(row("beams without a hit, %", &|f| format!("{:.1}", f.lost)));
    for (k, name) in RANGE_NAMES.iter().enumerate() {
        rows.push(row(&format!("hits at {name}, %"), &|f| format!("{:.1}", f.hits_by_range[k])));
    }
    align_columns(&rows)
}
