//! `cast` and `view`: every beam's hit in one frame, and a page about a placement.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;
use serde_json::Value;

use super::inputs::{Given, file_and_name, fit_alone, held, named_placements, note_repeated};
use super::opening::{LoadTimes, Loaded, timings};
use super::outputs::Figure;
use super::run_folder::{rig_path, with_run_scenes};
use super::{Computing, Conditions, FiguresOut, Gltf, MountingArgs, RunError, opening, outputs};
use crate::export::GltfView;
use crate::files::{Session, will_read, write_whole};
use crate::job::{Job, JobFiles};
use crate::json::counted;
use crate::report::{Figures, Looks, SceneRecord, Subject, view_html};
use crate::scan::BeamHits;
use crate::scan::conditions::in_words;
use crate::scene::EgoBody;
use crate::score::{Objective, Seen};
use crate::search::{Evaluator, Scored};
use crate::vehicle::{Placement, read_placements};

/// Beams to be cast.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct CastRequest {
    /// Scene file; it must have geometry
    pub scene: PathBuf,
    /// File of placements, all of which are cast, or the folder of a run
    pub placements: PathBuf,
    /// Write the hits to this .npz file
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: Option<PathBuf>,
    /// Frame of the scene, from 0
    #[cfg_attr(feature = "cli", arg(long, default_value_t = 0, value_name = "T"))]
    pub frame: u32,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub gltf: Gltf,
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
    let mut placements = read_placements(rig_path(&request.placements)?)?;
    fit_alone(&request.placements, &placements, computing)?;
    will_read(&request.scene);
    outputs::check_gltf(request.gltf.gltf.as_deref())?;
    if let Some(path) = &request.out {
        outputs::check_file(path, "npz")?;
    }
    let mut loaded = frame(request, computing)?;
    let mut evaluator = loaded.evaluator(computing)?;
    let scene = loaded.job.scene();
    let soup = scene.frame(request.frame as usize, EgoBody::Include);
    let problem = evaluator.problem().clone();
    Given::in_problem(&request.placements, &problem, computing).whole(&mut placements)?;
    let columns = BeamHits::of(&placements, &problem, &soup.face_class, |poses| {
        evaluator.backend_mut().hits(poses, 0)
    })?;
    if let Some(path) = &request.out {
        write_whole(path, |file| columns.write(file, &soup).map_err(RunError::io(path)))?;
    }
    if request.gltf.gltf.is_some() {
        let points: Vec<_> = columns.points().collect();
        let frame = request.frame as usize;
        let view = GltfView { scene, frame, placements: &placements, points: &points };
        outputs::write_gltf(request.gltf.gltf.as_deref(), computing.watcher, &view)?;
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

/// A placement to be shown.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ViewRequest {
    /// Scene files, then a file of placements, with :NAME of the one to show [default: its first]; or the folder of a run
    /// alone
    #[cfg_attr(feature = "cli", arg(value_names = ["SCENE", "PLACEMENTS[:NAME]"], required = true, num_args = 1..))]
    pub files: Vec<String>,
    /// Placement to compare with, or a file of them; may be given several times
    ///
    /// Without it those of Table 7 of the paper, where the vehicle is its car: one model, a mount that holds them.
    #[cfg_attr(feature = "cli", arg(long, alias = "baseline", value_name = "PLACEMENTS[:NAME]"))]
    pub baselines: Vec<String>,
    /// Page to write
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub mounting: MountingArgs,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
    /// Command that makes the page again, which stands on it.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub command: String,
    /// Command that asks how far each LiDAR may be off, for the page.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub tolerance: String,
}

/// Error of placements without a scene.
fn alone(files: &[String]) -> RunError {
    RunError::Usage(format!(
        "{}: stands alone; give a scene, then a file of placements, or the folder of a run",
        files.concat()
    ))
}

/// Writes the page about a placement. False, and a note, where the placement misses a requirement.
///
/// # Errors
/// Files that cannot be read or written, no placement to show, scenes that do not go together.
pub fn view(request: &ViewRequest, computing: &Computing<'_>) -> Result<bool, RunError> {
    let _session = Session::begin();
    let given: Vec<PathBuf> = request.files.iter().map(PathBuf::from).collect();
    let (files, computing) = &with_run_scenes(&given, computing)?;
    let (Some(placements), Some((_, paths @ [_, ..]))) = (request.files.last(), files.split_last())
    else {
        return Err(alone(&request.files));
    };
    let mut given = named_placements(placements)?;
    let count = given.len();
    let shown = given.first_mut().ok_or_else(|| {
        RunError::Usage(format!("{placements}: holds no placement; there is nothing to show"))
    })?;
    if count > 1 {
        let (name, all) = (&shown.name, counted(count, "placement"));
        computing.watcher.note(&format!(
            "{placements}: shows `{name}` of {all}; {placements}:NAME shows another"
        ));
    }
    let rivals = request.baselines.iter().map(|text| read(text));
    let mut rivals = rivals.collect::<Result<Vec<_>, RunError>>()?;
    fit_alone(Path::new(file_and_name(placements).0), std::slice::from_ref(&*shown), computing)?;
    for (file, all) in &rivals {
        fit_alone(Path::new(file), all, computing)?;
    }
    note_repeated(paths, computing.watcher);
    paths.iter().for_each(|scene| will_read(scene));
    let out = &request.out;
    outputs::check_file(out, "html")?;
    outputs::check_figures(request.figures.figures.as_deref())?;
    let files = opening::files(paths, &request.conditions.condition, None, computing);
    let files = JobFiles { tolerance: Some(request.mounting.tolerance), ..files };
    let mut loaded = opening::job(&files, computing)?;
    let mut evaluator = loaded.evaluator(computing)?;
    let (job, problem) = (loaded.job, evaluator.problem());
    opening::note_relief(&job, computing.watcher)?;
    let look = |file: &str| Given::in_problem(Path::new(file), problem, computing);
    look(file_and_name(placements).0).all([&mut *shown])?;
    for (file, all) in &mut rivals {
        look(file).all(all)?;
    }
    let baselines = match rivals.is_empty() {
        true => held(job.scene().vehicle(), problem.sensors(), computing)?,
        false => rivals.into_iter().flat_map(|(_, placements)| placements).collect(),
    };
    // The placement shown is not compared with itself.
    let baselines: Vec<Placement> =
        baselines.into_iter().filter(|baseline| baseline != shown).collect();
    let (page, figures, is_met) = page(request, &job, &mut evaluator, shown, &baselines)?;
    let wrote = outputs::wrote(request.figures.figures.as_deref(), (figures.len(), 0), Some(out));
    outputs::write_figures(request.figures.figures.as_deref(), figures, None)?;
    outputs::write_text(out, &page)?;
    wrote.iter().for_each(|wrote| computing.watcher.note(wrote));
    if !is_met {
        let name = &shown.name;
        computing.watcher.note(&format!("NOT MET: {name} misses a requirement; exit code 1"));
    }
    Ok(is_met)
}

/// Placements of a file, perhaps with a name behind a colon, beside the file.
fn read(text: &str) -> Result<(&str, Vec<Placement>), RunError> {
    Ok((file_and_name(text).0, named_placements(text)?))
}

/// The page, its figures by name, and whether the placement meets all requirements.
fn page(
    request: &ViewRequest,
    job: &Job,
    evaluator: &mut Evaluator,
    shown: &Placement,
    baselines: &[Placement],
) -> Result<(String, Vec<Figure>, bool), RunError> {
    let suite = &job.suite()?;
    let all: Vec<Placement> = std::iter::once(shown).chain(baselines).cloned().collect();
    let objective = Objective::default();
    let scored = all.iter().zip(evaluator.judged(&all)?);
    let scored = scored.map(|(p, judged)| Scored::new(p, judged, &objective, suite.rules()));
    let mut scored: Vec<Scored> = scored.collect();
    // Copies mounted a little off take seconds, and the page shows them for one placement alone.
    let without_copies = job.clone().tolerance(None);
    for (k, Scored { placement, scores, price, .. }) in scored.iter_mut().enumerate() {
        *price = job.scene().vehicle().price_of_rig(placement);
        let job = if k == 0 { job } else { &without_copies };
        job.look_closely(evaluator.backend_mut(), [(&*placement, scores)])?;
    }
    let (result, baselines) = (&scored[0], &scored[1..]);
    let looks = Looks::new(job, suite, shown, baselines, &mut || true)?;
    let figures = Figures::new(Some(result), suite.rules(), &job.scene().body(), Some(looks));
    let records = SceneRecord::several(suite);
    let names: Vec<&str> = job.scenes().iter().map(|scene| scene.scene().name()).collect();
    let names = names.join(", ");
    let objective = objective.to_string();
    let conditions = in_words(&request.conditions.condition);
    let command = request.command.clone();
    let subject = Subject::given(&names, &records, result, baselines, &objective, command);
    let (tolerance, conditions) = (request.tolerance.clone(), &conditions[..]);
    let subject = Subject { tolerance, conditions, ..subject };
    let is_met = result.scores.required.iter().all(Seen::is_met);
    Ok((view_html(&subject, &figures), figures.files(Some(result)), is_met))
}
