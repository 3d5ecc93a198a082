//! The placement of a hand-over, and everything that is computed about it.

use std::path::Path;

use super::mask::SelfHitMask;
use super::run::{self, RunFound};
use super::{HandoverRequest, Held};
use crate::bvh::Hit;
use crate::csv::rounded;
use crate::engine::BackendError;
use crate::files::changed_input;
use crate::geom::Pose;
use crate::job::{Job, Tolerance};
use crate::near_field::{Footprint, NearField, NearSite, self_hits};
use crate::problem::SensorBatch;
use crate::runs::inputs::{Given, file_and_name, named_placements, no_ground};
use crate::runs::opening::{LoadTimes, Loaded};
use crate::runs::{Computing, RunError, opening};
use crate::scene::{EgoBody, Scene};
use crate::score::{Guard, HOLDS, SHARED, Seen, all_held_in_words};
use crate::search::Evaluator;
use crate::vehicle::{
    BeamTable, Placement, Region, SensorPose, Sensors, UnknownSensor, name_lidars,
};

/// A placement on its vehicle, in one frame.
pub(super) struct HandoverRig {
    job: Job,
    pub placement: Placement,
    /// File of the placement; `None` of one in memory.
    pub file: Option<String>,
    /// Mount of each LiDAR that stands on one with a name.
    pub mounts: Vec<Option<String>>,
    /// Number of each LiDAR's model.
    pub models: Vec<usize>,
    /// True for each LiDAR whose phase differs from frame to frame. Its pose here has phase 0.
    pub spins_freely: Vec<bool>,
    sensors: Sensors,
    /// Sensor-to-ego transform of each LiDAR, phase included.
    pub poses: Vec<Pose>,
    /// True for each beam of each LiDAR that ends at the own body.
    own: Vec<Vec<bool>>,
    /// Guards `self_hit`, as `sightline score` finds them in this frame.
    pub guards: Vec<Guard>,
    /// Triangles of the own body in the ego frame, metres.
    pub body: Vec<[[f32; 3]; 3]>,
    /// Blind zone on the ground, or why there is none.
    pub near: Result<(Footprint, NearField), String>,
    /// Lines of the title block: mounting tolerance, origin of the placement.
    pub about: Vec<String>,
    /// Requirements that it misses, in words, or why they were not looked at.
    pub warnings: Vec<String>,
    /// Lines of the run that found it; none of another placement, or where its files have changed.
    pub of_run: Vec<String>,
    frame: u32,
}

impl HandoverRig {
    /// Sentence on the frame that the body is taken in, where bodies of the vehicle move.
    pub(crate) fn frame_in_words(&self) -> Option<String> {
        let scene = self.scene();
        if !(scene.has_moving_bodies() || scene.has_bodies_held_still()) {
            return None;
        }
        let ridden = self.placement.lidars.iter().enumerate();
        let ridden = ridden.filter(|(_, pose)| !pose.rides_on.is_none());
        let ridden: Vec<String> = ridden.map(|(k, _)| k.to_string()).collect();
        let carried = match &ridden[..] {
            [] => String::new(),
            _ => format!(
                " Poses of LiDARs that ride on a body ({}) are as in frame 0.",
                ridden.join(", ")
            ),
        };
        Some(format!(
            "Bodies of the vehicle move: boxes, masks and drawing are of frame {}. For another frame: sightline rig handover \
             SCENE PLACEMENTS --vehicle FILE --frame N.{carried}",
            self.frame
        ))
    }

    pub(crate) fn new(
        request: &HandoverRequest,
        computing: &Computing<'_>,
    ) -> Result<Self, RunError> {
        let Some((text, scenes)) = request.files.split_last() else {
            return Err(RunError::Usage("give a file of placements".to_owned()));
        };
        let Handed { mut placement, text, scene, about, warnings, of_run } =
            Handed::new(request, text, scenes, computing)?;
        let job = Job::new(scene).geometry_alone().one_frame(request.frame as usize);
        let job = job.engine(computing.engine.clone());
        let mut loaded = Loaded { job, times: LoadTimes::default() };
        let mut evaluator = loaded.evaluator(computing)?;
        let file = file_and_name(&text).0;
        let problem = evaluator.shared_problem();
        Given::in_problem(Path::new(file), &problem, computing).whole([&mut placement])?;
        // Only now: warnings about a rig with an unknown model would mislead.
        warnings.iter().for_each(|words| computing.watcher.note(words));
        let sensors = problem.sensors().clone();
        let job = loaded.job;
        let scene = job.scene();
        // By the phases that scores and studies have: only masks and drawing are of the sensors at rest.
        let near = near_field(scene, &mut evaluator, &placement)?;
        if let Err(why) = &near {
            computing.watcher.note(&format!("the drawing has no blind zone: {why}"));
        }
        let guards = self_hits(scene, &problem, evaluator.backend_mut(), &placement)?;
        let (models, spins_freely) =
            at_rest(&mut placement, &sensors).map_err(BackendError::from)?;
        let own = scene.triangles(EgoBody::Exclude) as u32;
        let batch =
            SensorBatch::new(&problem, &placement.lidars, None).map_err(BackendError::from)?;
        let hits = evaluator.backend_mut().hits(&placement.lidars, 0)?;
        let is_own = |hit: &Hit| hit.is_hit() && hit.prim >= own;
        let of_lidar = |k: usize| hits[batch.beams_of(k)].iter().map(is_own).collect();
        let own = (0..placement.lidars.len()).map(of_lidar).collect();
        let poses = batch.ego_from_sensors(0);
        let mounts = scene.vehicle().mount_names(&placement.lidars);
        let mounts = mounts.into_iter().map(|name| name.map(str::to_owned)).collect();
        let body = scene.body_in(request.frame as usize);
        Ok(Self {
            file: request.held.placement.is_none().then(|| file.to_owned()),
            job,
            placement,
            mounts,
            models,
            spins_freely,
            sensors,
            poses,
            own,
            guards,
            body,
            near,
            about,
            warnings,
            of_run,
            frame: request.frame,
        })
    }

    pub(crate) fn scene(&self) -> &Scene {
        self.job.scene()
    }

    /// Name of the vehicle, or of the scene where the vehicle has none.
    pub(crate) fn vehicle_name(&self) -> &str {
        let scene = self.scene();
        if scene.vehicle().name.is_empty() { scene.name() } else { &scene.vehicle().name }
    }

    /// Beams of a LiDAR.
    pub(crate) fn table(&self, lidar: usize) -> &BeamTable {
        self.sensors.table(self.models[lidar])
    }

    /// Name of a model; `lidar` for the one of a scene, which has none.
    pub(crate) fn model_name(&self, model: usize) -> String {
        let name = self.sensors.models()[model].name;
        if name.is_none() { "lidar".to_owned() } else { name.as_str().to_owned() }
    }

    /// True if a mount stands where its vehicle file says: no body has carried it away in this frame.
    pub(crate) fn is_in_place(&self, mount: &Region) -> bool {
        let at = SensorPose { rides_on: mount.rides_on, ..SensorPose::default() };
        self.sensors.carried(&at, self.frame as usize, Pose::IDENTITY) == Pose::IDENTITY
    }

    pub(crate) fn price(&self, model: usize) -> f64 {
        self.sensors.models()[model].price
    }

    /// Numbers of the models that the rig has, rising.
    pub(crate) fn used_models(&self) -> Vec<usize> {
        let mut used = self.models.clone();
        used.sort_unstable();
        used.dedup();
        used
    }

    /// The mask of each LiDAR.
    pub(crate) fn masks(&self) -> Vec<SelfHitMask<'_>> {
        let mask = |k: usize| {
            let phase = self.placement.lidars[k].phase.unwrap_or_default();
            SelfHitMask::new(self.table(k), phase, &self.own[k])
        };
        (0..self.own.len()).map(mask).collect()
    }
}

/// Gives each LiDAR without a phase that of its model at rest: a mask is of the columns of the sensor itself, and one that
/// spins freely stands at its angle 0. Returns the number of each LiDAR's model, and whether it spins freely.
fn at_rest(
    placement: &mut Placement,
    sensors: &Sensors,
) -> Result<(Vec<usize>, Vec<bool>), UnknownSensor> {
    let (mut models, mut free) = (Vec::new(), Vec::new());
    for lidar in &mut placement.lidars {
        let model = sensors.number(lidar)?;
        models.push(model);
        free.push(lidar.phase.is_none() && sensors.is_free(lidar.sensor));
        lidar.phase = lidar.phase.or(Some(sensors.models()[model].phase.at_rest()));
    }
    Ok((models, free))
}

/// Outline of the body and near field of a placement, or why there is none.
fn near_field(
    scene: &Scene,
    evaluator: &mut Evaluator,
    placement: &Placement,
) -> Result<Result<(Footprint, NearField), String>, RunError> {
    let problem = evaluator.shared_problem();
    Ok(match NearSite::new(scene, &problem) {
        Ok(site) => {
            let near = site.look(evaluator.backend_mut(), placement)?;
            Ok((site.footprint().clone(), near))
        }
        Err(why) => Err(why.to_string()),
    })
}

/// A placement on its scene, and the words of the title block about it.
struct Handed {
    placement: Placement,
    /// File of the placement, with its name where it has several.
    text: String,
    scene: Scene,
    about: Vec<String>,
    warnings: Vec<String>,
    of_run: Vec<String>,
}

impl Handed {
    fn new(
        request: &HandoverRequest,
        text: &str,
        scenes: &[String],
        computing: &Computing<'_>,
    ) -> Result<Self, RunError> {
        let given = match &request.held.placement {
            Some(_) => run::GivenRig { text: text.to_owned(), run: None },
            None => run::GivenRig::new(text)?,
        };
        let (text, run) = (&given.text, given.run.as_ref());
        let placement = request.held.placement.clone();
        let placement = placement.map_or_else(|| one(&request.files, text), Ok)?;
        let of_run = run.filter(|_| computing.vehicle.is_none());
        // In another scene than its own the run has measured nothing.
        let own = of_run.filter(|run| is_scene_of(run, scenes));
        let computing = &with_vehicle(of_run, computing);
        // A run whose vehicle its scene says.
        let own_scene = own.filter(|run| run.vehicle.is_none() && scenes.is_empty());
        let own_scene: Vec<String> =
            own_scene.iter().map(|run| run.scene.display().to_string()).collect();
        let scenes = if own_scene.is_empty() { scenes } else { &own_scene };
        let on_level_ground = scenes.is_empty();
        let scene = scene(scenes, text, request, computing)?;
        let changed = own.and_then(|run| changed_input(&run.folder));
        let unchanged = own.filter(|_| changed.is_none());
        let of_run = unchanged.map_or_else(Vec::new, |run| run.words.clone());
        let warnings = match unchanged {
            Some(run) => {
                let overlap = &scene.vehicle().overlap;
                let is_shared =
                    |seen: &&mut Seen| overlap.iter().any(|rule| rule.name == seen.name);
                let mut required = run.required.clone();
                required.iter_mut().filter(is_shared).for_each(|seen| seen.done = SHARED);
                doubts(&required, run.hold_in)
            }
            None => {
                let changed = changed.iter().map(|file| {
                    let file = file.file_name().unwrap_or_default().display();
                    format!(
                        "CHANGED SINCE THE RUN: {file}; rules and requirements are looked at anew"
                    )
                });
                changed.chain(warnings(&scene, &placement, computing)).collect()
            }
        };
        let mut about = about(run, text, &request.held);
        let place = if on_level_ground { "level ground" } else { scene.name() };
        let moves = scene.has_moving_bodies() && request.frame > 0;
        let outline = if moves { "; depths from the vehicle's box in frame 0" } else { "" };
        about.push(format!("Blind zone and masks: {place}, frame {}{outline}", request.frame));
        about.extend(held_requirements(&scene).filter(|_| unchanged.is_none()));
        Ok(Self { placement, text: text.clone(), scene, about, warnings, of_run })
    }
}

/// Sentence on the one pose of bodies that move in which requirements were looked at, on level ground.
fn held_requirements(scene: &Scene) -> Option<String> {
    let requires = !scene.vehicle().require_order.is_empty();
    (requires && scene.has_bodies_held_still()).then(|| {
        "Requirements: bodies as in frame 0 alone; a scene before the placements looks at all of their poses".to_owned()
    })
}

/// Requirements that are not met, or on paper only, in words; a line on all of them where only all together hold in too few
/// copies, of which `hold_in` is the share.
fn doubts(required: &[Seen], hold_in: Option<f64>) -> Vec<String> {
    let is_firm = |seen: &Seen| seen.is_met() && seen.holds_in.is_none_or(|share| share >= HOLDS);
    let doubtful = required.iter().filter(|seen| !is_firm(seen));
    let mut lines: Vec<String> = doubtful.map(ToString::to_string).collect();
    if let Some(share) = hold_in.filter(|&share| lines.is_empty() && share < HOLDS) {
        lines.push(all_held_in_words(share));
    }
    lines
}

/// True if no scene is given, or that of a run.
fn is_scene_of(run: &RunFound, scenes: &[String]) -> bool {
    let place = |path: &Path| path.canonicalize().ok();
    match scenes {
        [] => true,
        [scene] => place(Path::new(scene)).is_some_and(|given| Some(given) == place(&run.scene)),
        _ => false,
    }
}

/// A command's engine and watcher with the vehicle of a run.
fn with_vehicle<'a>(run: Option<&RunFound>, computing: &Computing<'a>) -> Computing<'a> {
    let vehicle = run.and_then(|run| run.vehicle.clone());
    Computing { vehicle: vehicle.or_else(|| computing.vehicle.clone()), ..computing.clone() }
}

/// Rules of the vehicle that a placement breaks, and requirements that it misses, measured over all frames, in words; or a
/// sentence that says why none was looked at.
fn warnings(scene: &Scene, placement: &Placement, computing: &Computing<'_>) -> Vec<String> {
    let mut placement = placement.clone();
    // A choice that does not fit is told where the models are looked up.
    let _ = name_lidars(&computing.sensors, &mut placement);
    let broken = scene.rules().violations(&placement);
    let mut warnings: Vec<String> =
        broken.iter().map(|rule| format!("RULE BROKEN: {rule}")).collect();
    if scene.vehicle().require_order.is_empty() {
        return warnings;
    }
    let job = Job::new(scene.clone()).without_psogs().engine(computing.engine.clone());
    match job.score(std::slice::from_ref(&placement)) {
        Ok(judged) => {
            let scores = judged.iter().map(|judged| &judged.scores);
            warnings.extend(
                scores.flat_map(|scores| doubts(&scores.required, scores.requirements_hold_in)),
            );
        }
        Err(why) => warnings.push(format!("requirements were not looked at: {why}")),
    }
    warnings
}

fn about(run: Option<&RunFound>, text: &str, held: &Held) -> Vec<String> {
    let tolerance = match run {
        Some(run) => run.tolerance,
        None => Some(Tolerance::default()),
    };
    let usual = if run.is_none() { " (the usual one)" } else { "" };
    let tolerance = tolerance.filter(Tolerance::is_some).map(|most| {
        format!(
            "Mounting tolerance: each coordinate ±{} mm, each angle ±{}°{usual}",
            rounded(1000.0 * most.metres, 3),
            rounded(most.radians.to_degrees(), 3)
        )
    });
    let name = |path: &Path| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        name.unwrap_or_else(|| path.display().to_string())
    };
    let version = env!("CARGO_PKG_VERSION");
    let origin = match run {
        Some(run) => format!("Found with seed {} in the run {}", run.seed, name(&run.folder)),
        None if held.placement.is_some() => format!("Placement {text}"),
        None => format!("Placement of {}", name(Path::new(file_and_name(text).0))),
    };
    tolerance.into_iter().chain([format!("{origin}; drawn by sightline {version}")]).collect()
}

/// The only placement of a file, or the one named behind a colon.
fn one(files: &[String], text: &str) -> Result<Placement, RunError> {
    let mut all = named_placements(text)?;
    match &all[..] {
        [_] => Ok(all.swap_remove(0)),
        [] => Err(RunError::Usage(format!(
            "{text}: holds no placement; there is nothing to hand over"
        ))),
        [first, ..] => {
            let names: Vec<&str> = all.iter().map(|placement| &*placement.name).take(12).collect();
            Err(RunError::Usage(format!(
                "{text}: holds {} placements, and one is handed over; name it behind a colon, as `{}` (it has {})",
                all.len(),
                run::command(files, text, &first.name),
                names.join(", ")
            )))
        }
    }
}

/// The scene that is given, or level ground around the vehicle.
fn scene(
    files: &[String],
    placements: &str,
    request: &HandoverRequest,
    computing: &Computing<'_>,
) -> Result<Scene, RunError> {
    let (frame, mend) = (request.frame, "static shapes, actors and an ego body");
    let scene = match (files, &computing.vehicle) {
        ([file], _) => match &request.held.scene {
            Some(scene) => opening::with_geometry(Scene::clone(scene), file, mend)?,
            None => opening::geometry(Path::new(file), mend, computing)?,
        },
        ([], Some(vehicle)) => opening::level_ground(vehicle, None, computing.watcher)?,
        ([], None) => return Err(no_ground(placements)),
        ([_, second, ..], _) => {
            return Err(RunError::Usage(format!(
                "{second}: is a second scene, and a rig is handed over in one; leave it out"
            )));
        }
    };
    let frames = scene.frame_count();
    if frame as usize >= frames {
        let place = files.first().map_or("level ground", |file| file);
        return Err(RunError::Usage(match frames {
            1 => format!("{place}: there is no frame {frame}; it has one, leave out --frame"),
            _ => format!("{place}: there is no frame {frame}; give --frame 0 to {}", frames - 1),
        }));
    }
    Ok(scene)
}
