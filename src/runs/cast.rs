//! Every beam's hit in one frame of a scene, as a file and as a summary.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;
use serde_json::Value;

use super::given::Given;
use super::opening::{self, LoadTimes, Loaded, timings};
use super::{Computing, RunError, glb};
use crate::export::GltfView;
use crate::files::{Session, writable_file, write_whole};
use crate::job::Job;
use crate::scan::BeamHits;
use crate::scene::EgoBody;
use crate::vehicle::read_placements;

/// Beams to be cast.
#[derive(Debug, Clone, Default)]
pub struct CastRequest {
    /// Scene file with geometry.
    pub scene: PathBuf,
    /// File of placements.
    pub placements: PathBuf,
    /// File for the hits, `.npz`.
    pub out: Option<PathBuf>,
    /// File for scene and hits as binary glTF.
    pub gltf: Option<PathBuf>,
    /// Frame of the scene, from 0.
    pub frame: u32,
}

/// Summary of a cast: device, beams, hits and times.
#[derive(Debug, Serialize)]
pub struct CastSummary {
    /// Name of the scene.
    pub scene: String,
    /// Kind of engine that cast.
    pub backend: &'static str,
    /// Its device.
    pub adapter: String,
    /// Frame of the scene.
    pub frame: u32,
    /// Beams cast.
    pub beams: usize,
    /// Beams that hit something.
    pub hits: usize,
    /// Triangles of the frame.
    pub triangles: usize,
    /// File of the hits.
    pub out: Option<PathBuf>,
    /// Threads of the process.
    pub threads: usize,
    /// Seconds of each stage.
    pub timings: Value,
}

/// Casts all beams of placements in one frame, and writes the hits where the request names a file.
///
/// # Errors
/// Files that cannot be read or written, a scene without geometry or without the frame, more beams than memory holds.
pub fn cast(request: &CastRequest, computing: &Computing<'_>) -> Result<CastSummary, RunError> {
    let _session = Session::begin();
    let start = Instant::now();
    let mut placements = read_placements(&request.placements)?;
    let mut loaded = frame(request, computing)?;
    let mut evaluator = loaded.evaluator(computing)?;
    let scene = loaded.job.scene();
    if let Some(path) = &request.out {
        writable_file(path)?;
    }
    glb::check(request.gltf.as_deref())?;
    let soup = scene.frame(request.frame as usize, EgoBody::Include);
    let problem = evaluator.problem().clone();
    Given::in_problem(&request.placements, &problem, computing).all(&mut placements)?;
    let columns = BeamHits::of(&placements, &problem, &soup.face_class, |poses| {
        evaluator.backend_mut().hits(poses, 0)
    })?;
    if let Some(path) = &request.out {
        write_whole(path, |file| columns.write(file, &soup).map_err(RunError::io(path)))?;
    }
    if request.gltf.is_some() {
        let points: Vec<_> = columns.points().collect();
        let frame = request.frame as usize;
        let view = GltfView { scene, frame, placements: &placements, points: &points };
        glb::write(request.gltf.as_deref(), computing.watcher, &view)?;
    }
    let engine = evaluator.backend();
    Ok(CastSummary {
        scene: scene.name().to_owned(),
        backend: engine.name(),
        adapter: engine.adapter().to_owned(),
        frame: request.frame,
        beams: columns.beams(),
        hits: columns.hits(),
        triangles: soup.faces.len(),
        out: request.out.clone(),
        threads: rayon::current_num_threads(),
        timings: timings(loaded.times, engine.times(), start),
    })
}

/// One frame of the scene as a job of geometry alone.
fn frame(request: &CastRequest, computing: &Computing<'_>) -> Result<Loaded, RunError> {
    let (start, mend) = (Instant::now(), "static shapes, actors or an ego body");
    let scene = opening::geometry(&request.scene, mend, computing)?;
    let (frame, frames) = (request.frame as usize, scene.frame_count());
    if frame >= frames {
        return Err(RunError::Usage(format!(
            "{}: there is no frame {frame}; give --frame 0 to {}",
            request.scene.display(),
            frames - 1
        )));
    }
    let job = Job::new(scene).geometry_alone().one_frame(frame);
    let times = LoadTimes { load: start.elapsed().as_secs_f64(), build: 0.0 };
    Ok(Loaded { job: job.engine(computing.engine.clone()), times })
}
