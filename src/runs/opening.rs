//! From files to scenes, problems and evaluators, with what is said on the way.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};

use crate::engine::open;
use crate::problem::{Problem, StageTimes, spread};
use crate::psog::Psog;
use crate::scan::conditions::{Condition, Kind};
use crate::scan::in_conditions;
use crate::scene::{PsogSource, Scene};
use crate::search::{Evaluator, Member, SearchError, Suite};

use super::{Computing, Error, Watcher};

/// Seconds until scoring could begin.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoadTimes {
    /// Reading files.
    pub load: f64,
    /// P-SOG, trees, device.
    pub build: f64,
}

/// A scene ready to be scored.
pub struct Loaded {
    pub scene: Scene,
    pub evaluator: Evaluator,
    pub times: LoadTimes,
}

/// Reads a scene and its P-SOG, and makes its problem over `frames` of its frames (all if `None`).
pub fn problem(
    path: &Path,
    frames: Option<u32>,
    conditions: &[Condition],
    computing: &Computing<'_>,
) -> Result<(Scene, Problem, LoadTimes), Error> {
    note_conditions(conditions, computing.watcher);
    let (scene, psog, mut times) = scene_and_psog(path, computing)?;
    let start = Instant::now();
    let frames = spread(scene.frame_count(), frames);
    let problem = Problem::with_psog(&scene, &psog, &frames)?;
    let problem = in_conditions(&scene, problem, conditions)?;
    times.build += start.elapsed().as_secs_f64();
    Ok((scene, problem, times))
}

/// Scenes ready to be scored together.
pub struct Suited {
    pub scenes: Vec<Scene>,
    pub suite: Suite,
    pub evaluator: Evaluator,
    pub times: LoadTimes,
}

/// As [`problem`], for several that share LiDAR and mount, with an engine for each.
pub fn suite(
    paths: &[PathBuf],
    frames: Option<u32>,
    conditions: &[Condition],
    computing: &Computing<'_>,
) -> Result<Suited, Error> {
    note_conditions(conditions, computing.watcher);
    let mut times = LoadTimes::default();
    let (mut scenes, mut problems) = (Vec::new(), Vec::new());
    for path in paths {
        let (scene, psog, took) = scene_and_psog(path, computing)?;
        note_frames(&scene, frames, computing.watcher);
        let start = Instant::now();
        let frames = spread(scene.frame_count(), frames);
        let problem = Problem::with_psog(&scene, &psog, &frames)?;
        let problem = Arc::new(in_conditions(&scene, problem, conditions)?);
        computing.watcher.detail(&problem.modelled().to_string());
        problems.push((scene.name().to_owned(), problem));
        times.load += took.load;
        times.build += took.build + start.elapsed().as_secs_f64();
        scenes.push(scene);
    }
    let start = Instant::now();
    let paths: Vec<&PathBuf> = paths.iter().collect();
    let suite = Suite::new(problems).map_err(|error| in_scene(error, &paths))?;
    note_classes(&suite, computing.watcher);
    let watcher = computing.watcher;
    let told = watcher.notes();
    let opened = Evaluator::open(&suite, &computing.engine, move |change: &str| told(change));
    let (evaluator, notes) = opened?;
    notes.iter().for_each(|note| watcher.note(note));
    times.build += start.elapsed().as_secs_f64();
    Ok(Suited { scenes, suite, evaluator, times })
}

/// Reads a scene and says what in it is most likely not meant.
pub fn read(path: &Path, vehicle: Option<&Path>, watcher: &dyn Watcher) -> Result<Scene, Error> {
    let scene = Scene::read_with(path, vehicle)?;
    scene.notes().iter().try_for_each(|note| watcher.tell(note))?;
    Ok(scene)
}

/// Reads a scene and reads or builds its P-SOG.
pub fn scene_and_psog(
    path: &Path,
    computing: &Computing<'_>,
) -> Result<(Scene, Arc<Psog>, LoadTimes), Error> {
    let (start, watcher) = (Instant::now(), computing.watcher);
    let scene = read(path, computing.vehicle.as_deref(), watcher)?;
    let from_file = matches!(scene.psog_source(), PsogSource::File(_));
    let mut times = LoadTimes { load: start.elapsed().as_secs_f64(), build: 0.0 };
    let start = Instant::now();
    let bar = watcher.bar(scene.frame_count() as u64, Some("frames scanned for the P-SOG"));
    let psog = Psog::of(&scene, || bar.advance(1))?;
    drop(bar);
    let took = start.elapsed().as_secs_f64();
    *(if from_file { &mut times.load } else { &mut times.build }) += took;
    let same = |&count: &u16| count == 0 || u32::from(count) == psog.frames();
    if psog.counts().iter().all(same) {
        watcher.note(&format!(
            "the P-SOG tells nothing: each voxel is the same in all of its {} frame(s), so that every \
             entropy is 0; give it frames in which something moves",
            psog.frames()
        ));
    }
    Ok((scene, Arc::new(psog), times))
}

/// Reads a scene for its geometry in one frame; its P-SOG is not needed and stays empty.
pub fn geometry(path: &Path, frame: u32, computing: &Computing<'_>) -> Result<Loaded, Error> {
    let start = Instant::now();
    let scene = read(path, computing.vehicle.as_deref(), computing.watcher)?;
    if !scene.has_geometry() {
        return Err(Error::Usage(format!(
            "{}: has no geometry to cast into; add static shapes, actors or an ego body",
            path.display()
        )));
    }
    let (frame, frames) = (frame as usize, scene.frame_count());
    if frame >= frames {
        return Err(Error::Usage(format!(
            "{}: there is no frame {frame}; give --frame 0 to {}",
            path.display(),
            frames - 1
        )));
    }
    let load = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let evaluator = evaluator(Problem::of_frame(&scene, frame)?, computing)?;
    let times = LoadTimes { load, build: start.elapsed().as_secs_f64() };
    Ok(Loaded { scene, evaluator, times })
}

/// Says what scores are where a condition moves points alone.
pub fn note_conditions(conditions: &[Condition], watcher: &dyn Watcher) {
    let (blur, others): (Vec<Kind>, Vec<Kind>) =
        conditions.iter().map(Condition::kind).partition(|kind| *kind == Kind::Blur);
    if !blur.is_empty() {
        let scores = match others.is_empty() {
            // Any condition has scores ask the sensor's response, which has its say in clear air, too.
            true => {
                "those of clear air under the sensor's own response, as with fog:mor=inf; without a condition \
                 every beam counts that meets something"
            }
            false => "those of the other conditions",
        };
        watcher.note(&format!(
            "--condition blur: takes no beam away, it only moves the points of a scan; scores are {scores}"
        ));
    }
}

/// Says where `--frames` asks for more than there are.
pub fn note_frames(scene: &Scene, wanted: Option<u32>, watcher: &dyn Watcher) {
    let count = scene.frame_count();
    if let Some(wanted) = wanted.filter(|wanted| *wanted as usize > count) {
        watcher.note(&format!("--frames {wanted}: the scene has {count}; all of them are used"));
    }
}

/// Says where scenes have other classes than the first: no score but the counts by class compares them.
pub fn note_classes(suite: &Suite, watcher: &dyn Watcher) {
    let Some((first, others)) = suite.members().split_first() else { return };
    let classes_of = |member: &Member| member.problem().content().classes().to_vec();
    let known = classes_of(first);
    for member in others {
        let own = classes_of(member);
        let less = known.iter().filter(|class| !own.contains(class)).cloned().collect();
        let more = own.iter().filter(|class| !known.contains(class)).cloned().collect();
        let lists: [(&str, Vec<String>); 2] = [("lacks", less), ("adds", more)];
        let lists = lists.iter().filter(|(_, list)| !list.is_empty());
        let lists: Vec<String> =
            lists.map(|(w, list)| format!("{w} {}", list.join(", "))).collect();
        if !lists.is_empty() {
            watcher.note(&format!(
                "{}: its classes are not those of {}: it {}; a count by class is the mean over the scenes that \
                 have the class, nothing else depends on it; give all the same `classes` to compare them",
                member.name(),
                first.name(),
                lists.join(" and ")
            ));
        }
    }
}

/// An error of scenes and settings, with the file of the scene that it is about.
pub fn in_scene(error: SearchError, scenes: &[&PathBuf]) -> Error {
    match error.scene().and_then(|scene| scenes.get(scene)) {
        Some(scene) => Error::Usage(format!("{}: {error}", scene.display())),
        None => error.into(),
    }
}

/// An evaluator of a problem on the engine asked for; says which one that is.
pub fn evaluator(
    problem: impl Into<Arc<Problem>>,
    computing: &Computing<'_>,
) -> Result<Evaluator, Error> {
    let problem = problem.into();
    let (choice, told) = (&computing.engine, computing.watcher.notes());
    computing.watcher.detail(&problem.modelled().to_string());
    computing.watcher.detail(&format!(
        "scene and P-SOG take {} MiB, work buffers at most {} MiB",
        problem.bytes() >> 20,
        choice.memory_budget() >> 20
    ));
    let opened = open(&problem, choice, move |change: &str| told(change))?;
    opened.notes.iter().for_each(|note| computing.watcher.note(note));
    Ok(Evaluator::new(problem, opened.engine))
}

/// Seconds of loading, of each stage up to now, and of all since a start.
pub(super) fn timings(load: LoadTimes, stages: StageTimes, start: Instant) -> Value {
    json!({
        "load": load.load,
        "build": load.build,
        "cast": stages.cast.as_secs_f64(),
        "cover": stages.cover.as_secs_f64(),
        "reduce": stages.reduce.as_secs_f64(),
        "total": start.elapsed().as_secs_f64(),
    })
}
