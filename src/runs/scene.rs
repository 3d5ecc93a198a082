//! Scene files: made by rule, taken over from maps and scans, counted.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use super::psog::{DatasetArgs, tell_notes};
use super::{RunError, Watcher, opening};
use crate::datasets::{ImportOptions, ImportedScene, LabelledSequence, read_nuscenes, to_scene};
use crate::files::{
    FileError, Session, is_sink, target, will_read, writable_file, write_pair, write_whole,
};
use crate::geom::TriangleSoup;
use crate::job::{JobError, JobScene};
use crate::json::counted;
use crate::problem::{Problem, world_of};
use crate::psog::PsogInfo;
use crate::report::columns::align_columns;
use crate::scan::BeamHits;
use crate::scene::{EgoBody, Scene, street};
use crate::search::Evaluator;
use crate::vehicle::{Placement, SensorPose};
use crate::worlds::{WorldKind, generate, import_opendrive, mesh_shape, read_opendrive, write_ply};

/// Makes a world of a kind from a seed, with `frames` frames, and writes it to `out`.
///
/// # Errors
/// Files that cannot be written, a world that cannot be made.
pub fn new_world(
    kind: WorldKind,
    seed: u64,
    frames: usize,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    let target = SceneOutput::new(out, None)?;
    let world = generate(kind, seed, frames)?;
    target.write(world.mesh(), &world.scene(&target.name(), &target.mesh_name()), watcher)
}

/// Makes a plain crossing of exactly `triangles` triangles, for timings, and writes it to `out`.
///
/// # Errors
/// Files that cannot be written.
pub fn new_street(
    triangles: usize,
    seed: u64,
    frames: u32,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    let target = SceneOutput::new(out, None)?;
    let soup = street(triangles, seed);
    target.write(&soup, &plain(&target, frames, &soup), watcher)
}

/// Region, sensor and mount of the own scenes, the sensor with 720 azimuth steps.
fn plain(target: &SceneOutput<'_>, frames: u32, soup: &TriangleSoup) -> Value {
    let body = |size: [f64; 3]| json!([{ "class": "vehicle", "box": { "foot": [0, 0, 0.25], "size": size } }]);
    let route = |from: [f64; 2], to: [f64; 2], spacing: f64| json!({ "points": [from, to], "spacing": spacing });
    json!({
        "sightline": 1,
        "name": target.name(),
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 720, "range": 100 },
        "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "first-hit",
        "frames": frames,
        "ego": { "body": body([4.5, 1.8, 1.3]), "route": route([-12.0, -1.7], [100.0, -1.7], 3.0) },
        "static": [mesh_shape(soup, &target.mesh_name())],
        "actors": [
            { "name": "oncoming", "parts": body([4.4, 1.8, 1.4]), "route": route([40.0, 1.7], [-100.0, 1.7], 5.0) },
            { "name": "ahead", "parts": body([4.4, 1.8, 1.4]), "route": route([6.0, -1.7], [100.0, -1.7], 4.0) },
            { "name": "crossing", "parts": body([8.0, 2.4, 2.8]), "route": route([1.7, -30.0], [1.7, 100.0], 6.0) }
        ]
    })
}

/// A scene to be made of a map, or of labelled scans.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ImportRequest {
    /// OpenDRIVE file (.xodr): its roads and lanes; houses, trees and traffic come from the seed; or the
    /// folder of a data set
    pub input: PathBuf,
    /// The folder is a set in the layout of nuScenes with lidarseg
    #[cfg_attr(feature = "cli", arg(long, requires = "scene_name", group = "scans"))]
    pub nuscenes: bool,
    /// Scene of the set
    #[cfg_attr(feature = "cli", arg(long = "scene", value_name = "NAME", requires = "nuscenes"))]
    pub scene_name: Option<String>,
    /// The folder holds scans of CARLA's semantic LiDAR, named by their frames: 000123.ply, .bin or .npy
    #[cfg_attr(feature = "cli", arg(long, requires = "poses", group = "scans"))]
    pub carla: bool,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub datasets: DatasetArgs,
    /// Edge of the cells that the plates and boxes of scans are made of, in metres [default: 0.4]
    #[cfg_attr(feature = "cli", arg(long, value_name = "M", value_parser = super::parse::number_as("0.4")))]
    pub cell: Option<f64>,
    /// Seed of all that the map does not say
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", conflicts_with = "scans", default_value_t = 1, value_parser = super::parse::whole::<u64>))]
    pub seed: u64,
    /// Frames that a map's scene has, a tenth of a second apart
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", conflicts_with = "scans", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=1000)))]
    pub frames: u32,
    /// Scene file to write; the mesh stands beside it, with the ending .ply
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

impl ImportRequest {
    /// Refuses options of scans beside a map.
    fn check(&self) -> Result<(), RunError> {
        let refused = match (self.nuscenes, self.carla, self.cell, self.datasets.lidar_height) {
            (false, false, Some(cell), _) => {
                format!("--cell {cell}: is for --nuscenes and --carla")
            }
            (_, false, _, Some(height)) => format!("--lidar-height {height}: is for --carla"),
            _ => return Ok(()),
        };
        Err(RunError::Usage(format!("{refused}; leave it out")))
    }
}

/// Makes a scene and writes it.
///
/// # Errors
/// Files that cannot be read or written, a map or a set of another format.
pub fn import(request: &ImportRequest, watcher: &dyn Watcher) -> Result<(), RunError> {
    let _session = Session::begin();
    request.check()?;
    let ImportRequest { input, datasets, out, .. } = request;
    let cell = request.cell.unwrap_or(ImportOptions::default().cell);
    match (request.nuscenes, request.carla) {
        (true, _) => {
            let names: Vec<String> = request.scene_name.iter().cloned().collect();
            let scenes = read_nuscenes(input, datasets.version.as_deref(), &names)?;
            scenes.iter().try_for_each(|scene| {
                tell_notes(scene, watcher)?;
                of_scans(scene, cell, out, watcher)
            })
        }
        (false, true) => of_scans(&datasets.carla(input, watcher)?, cell, out, watcher),
        (false, false) => opendrive(input, request.seed, request.frames as usize, out, watcher),
    }
}

fn opendrive(
    file: &Path,
    seed: u64,
    frames: usize,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    let name = file.to_string_lossy();
    if file.is_dir() {
        return Err(RunError::Usage(format!(
            "{name}: is a folder; say which set it holds, by --nuscenes --scene NAME or by --carla --poses FILE, or give \
             the .xodr file in it"
        )));
    }
    if !matches!(name.rsplit('.').next(), Some("xodr" | "gz")) {
        return Err(RunError::Usage(format!(
            "{name}: is of no format that is imported; give an OpenDRIVE file with the ending .xodr"
        )));
    }
    let target = SceneOutput::new(out, Some(file))?;
    let text = read_opendrive(file)?;
    let world = import_opendrive(&text, &file.display().to_string(), seed, frames)?;
    world.notes().iter().try_for_each(|note| watcher.tell(note))?;
    target.write(world.mesh(), &world.scene(&target.name(), &target.mesh_name()), watcher)
}

/// Plates, boxes and actors of labelled scans.
fn of_scans(
    sequence: &dyn LabelledSequence,
    cell: f64,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    writable_file(out)?;
    let imported = to_scene(sequence, &ImportOptions { cell })?;
    let ImportedScene { scene, plates, boxes, actors } = imported;
    let text = serde_json::to_string(&scene)
        .map_err(|source| FileError::Json { path: out.to_owned(), source })?;
    // A scene that this program would refuse is not written.
    let read = Scene::from_json(&text, out.parent().unwrap_or(out), &out.display().to_string())?;
    write_whole(out, |file| writeln!(file, "{text}").map_err(RunError::io(out)))?;
    watcher.note(&format!(
        "{}, {} of ground, {}, {} in {}",
        counted(read.frame_count(), "frame"),
        counted(plates, "plate"),
        counted(boxes, "box"),
        counted(actors, "actor"),
        out.display()
    ));
    Ok(())
}

/// A scene file to be written, with its mesh beside it.
struct SceneOutput<'a> {
    out: &'a Path,
    mesh: PathBuf,
}

impl<'a> SceneOutput<'a> {
    /// Checks that both files can be written, and that nothing is lost that nobody has named, where `inputs` are read.
    pub(crate) fn new(out: &'a Path, inputs: Option<&Path>) -> Result<Self, RunError> {
        let mesh = out.with_extension("ply");
        if mesh == out {
            return Err(RunError::Usage(format!(
                "{}: is the name of the mesh; give the scene the ending .json",
                out.display()
            )));
        }
        if is_sink(&target(out)?) {
            return Err(RunError::Usage(format!(
                "{}: is no regular file, and the mesh is to stand beside it; name a file",
                out.display()
            )));
        }
        inputs.iter().for_each(|input| will_read(input));
        writable_file(out)?;
        let target = Self { out, mesh };
        let name = target.name();
        if name.contains(char::is_control) {
            return Err(RunError::Usage(format!(
                "{name:?}: is to be the name of the scene, which has no control characters; name another file"
            )));
        }
        target.check_mesh()?;
        Ok(target)
    }

    /// Refuses to replace a mesh that the scene at `out` does not name.
    fn check_mesh(&self) -> Result<(), RunError> {
        let named = |text: String| text.contains(&Value::from(self.mesh_name()).to_string());
        if !self.mesh.exists() || !self.out.exists() {
            return Ok(());
        }
        match std::fs::read_to_string(self.out).is_ok_and(named) {
            true => Ok(()),
            false => Err(self.mesh_is_there()),
        }
    }

    /// Refuses to replace a mesh without a scene, unless it equals the new one: a killed run left that.
    fn check_mesh_without_scene(&self, soup: &TriangleSoup) -> Result<(), RunError> {
        if self.out.exists() || !self.mesh.exists() {
            return Ok(());
        }
        let mut new = Vec::new();
        write_ply(soup, &mut new).map_err(RunError::io(&self.mesh))?;
        match std::fs::read(&self.mesh).is_ok_and(|old| old == new) {
            true => Ok(()),
            false => Err(self.mesh_is_there()),
        }
    }

    fn mesh_is_there(&self) -> RunError {
        RunError::Usage(format!(
            "{}: is there and would be overwritten by the scene's mesh; name another scene than {}, or move the \
             mesh away",
            self.mesh.display(),
            self.out.display()
        ))
    }

    /// Name of the scene, taken from its file.
    pub(crate) fn name(&self) -> String {
        self.out.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Name of the mesh as the scene has it.
    fn mesh_name(&self) -> String {
        self.mesh.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Writes both and says so.
    pub(crate) fn write(
        &self,
        soup: &TriangleSoup,
        scene: &Value,
        watcher: &dyn Watcher,
    ) -> Result<(), RunError> {
        let mesh = &self.mesh;
        self.check_mesh_without_scene(soup)?;
        write_pair(
            (mesh, |file: &mut BufWriter<&mut File>| {
                write_ply(soup, file).map_err(RunError::io(mesh))
            }),
            (self.out, |file: &mut BufWriter<&mut File>| {
                serde_json::to_writer_pretty(&mut *file, scene)
                    .map_err(|source| FileError::Json { path: self.out.to_owned(), source })?;
                file.write_all(b"\n").map_err(RunError::io(self.out))
            }),
        )?;
        watcher.note(&format!(
            "{} triangles in {}, scene in {}",
            soup.faces.len(),
            mesh.display(),
            self.out.display()
        ));
        Ok(())
    }
}

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

/// Counts frames, triangles, actors, voxels and hits of a scene file, with the vehicle of another file where one is given.
///
/// # Errors
/// A file that cannot be read, a scene without geometry.
pub fn count(
    path: &Path,
    vehicle: Option<&Path>,
    watcher: &dyn Watcher,
) -> Result<SceneCounts, RunError> {
    let scene = opening::read(path, vehicle, watcher)?;
    if !scene.has_geometry() {
        return Err(RunError::Usage(format!(
            "{}: has no geometry to count; add static shapes or actors",
            path.display()
        )));
    }
    let frames = scene.frame_count();
    let scene = JobScene::from(scene);
    opening::note_mounts(&scene, watcher)?;
    let (scene, psog) = (scene.scene(), opening::psog(&scene, None, watcher)?);
    let info = PsogInfo::new(&psog, None);
    let soup = scene.frame(0, EgoBody::Include);
    let mut actors = BTreeMap::new();
    for track in scene.tracks() {
        *actors.entry(track.kind.name().to_owned()).or_default() += 1;
    }
    // A LiDAR above the origin may stand within the own body.
    let all: Vec<usize> = (0..frames).collect();
    let world = |far| world_of(scene, &all, far, EgoBody::Exclude);
    let problem = Problem::in_world(&psog, scene, scene.sensors()?, &all, true, world);
    let problem = problem
        .map_err(|source| JobError::Problem { files: path.display().to_string(), source })?;
    let (lost, hits_by_range) = hits(&problem, &soup.face_class, frames)?;
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
/// the first mount in height, without the own body, in all frames.
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
