//! The placement of a hand-over, and everything that is computed about it.

use std::path::Path;

use super::HandoverRequest;
use super::mask::SelfHitMask;
use crate::engine::BackendError;
use crate::geom::Pose;
use crate::job::Job;
use crate::near_field::{Footprint, NearField, NearSite};
use crate::problem::SensorBatch;
use crate::runs::inputs::{Given, file_and_name, named_placements};
use crate::runs::opening::{LoadTimes, Loaded};
use crate::runs::{Computing, RunError, opening};
use crate::scene::{EgoBody, Scene};
use crate::vehicle::{BeamTable, Placement, Sensors};

/// A placement on its vehicle, in one frame.
pub(super) struct HandoverRig {
    job: Job,
    pub placement: Placement,
    /// File of the placement.
    pub file: String,
    /// Mount of each LiDAR that stands on one with a name.
    pub mounts: Vec<Option<String>>,
    /// Number of each LiDAR's model.
    pub models: Vec<usize>,
    sensors: Sensors,
    /// Sensor-to-ego transform of each LiDAR, phase included.
    pub poses: Vec<Pose>,
    /// True for each beam of each LiDAR that ends at the own body.
    own: Vec<Vec<bool>>,
    /// Triangles of the own body in the ego frame, metres.
    pub body: Vec<[[f32; 3]; 3]>,
    /// Blind zone on the ground, or why there is none.
    pub near: Result<(Footprint, NearField), String>,
}

impl HandoverRig {
    pub fn new(request: &HandoverRequest, computing: &Computing<'_>) -> Result<Self, RunError> {
        let Some((text, scenes)) = request.files.split_last() else {
            return Err(RunError::Usage("give a file of placements".to_owned()));
        };
        let mut placement = one(text)?;
        let scene = scene(scenes, text, request.frame, computing)?;
        let job = Job::new(scene.without_requirements())
            .geometry_alone()
            .one_frame(request.frame as usize);
        let job = job.engine(computing.engine.clone());
        let mut loaded = Loaded { job, times: LoadTimes::default() };
        let mut evaluator = loaded.evaluator(computing)?;
        let file = file_and_name(text).0;
        let problem = evaluator.shared_problem();
        Given::in_problem(Path::new(file), &problem, computing).all([&mut placement])?;
        let sensors = problem.sensors().clone();
        let mut models = Vec::new();
        for lidar in &mut placement.lidars {
            let model = sensors.number(lidar).map_err(BackendError::from)?;
            models.push(model);
            // A mask is of the columns of the sensor itself: one that spins freely stands at its angle 0.
            lidar.phase = lidar.phase.or(Some(sensors.models()[model].phase.at_rest()));
        }
        let job = loaded.job;
        let scene = job.scene();
        let own = scene.triangles(EgoBody::Exclude) as u32;
        let batch =
            SensorBatch::new(&problem, &placement.lidars, None).map_err(BackendError::from)?;
        let hits = evaluator.backend_mut().hits(&placement.lidars, 0)?;
        let is_own = |k: usize| {
            let hits = hits[batch.beams_of(k)].iter();
            hits.map(|hit| hit.is_hit() && hit.prim >= own).collect()
        };
        let own = (0..placement.lidars.len()).map(is_own).collect();
        let poses = batch.ego_from_sensors(0);
        let near = match NearSite::new(scene, &problem) {
            Ok(site) => {
                let near = site.look(evaluator.backend_mut(), &placement)?;
                Ok((site.footprint().clone(), near))
            }
            Err(why) => Err(why.to_string()),
        };
        if let Err(why) = &near {
            computing.watcher.note(&format!("the drawing has no blind zone: {why}"));
        }
        let mounts = scene.vehicle().mount_names(&placement.lidars);
        let mounts = mounts.into_iter().map(|name| name.map(str::to_owned)).collect();
        let body = scene.body();
        let file = file.to_owned();
        Ok(Self { file, mounts, models, sensors, poses, own, body, near, placement, job })
    }

    pub fn scene(&self) -> &Scene {
        self.job.scene()
    }

    /// Name of the vehicle, or of the scene where the vehicle has none.
    pub fn vehicle_name(&self) -> &str {
        let scene = self.scene();
        if scene.vehicle().name.is_empty() { scene.name() } else { &scene.vehicle().name }
    }

    /// Beams of a LiDAR.
    pub fn table(&self, lidar: usize) -> &BeamTable {
        self.sensors.table(self.models[lidar])
    }

    /// Name of a model; `lidar` for the one of a scene, which has none.
    pub fn model_name(&self, model: usize) -> String {
        let name = self.sensors.models()[model].name;
        if name.is_none() { "lidar".to_owned() } else { name.as_str().to_owned() }
    }

    pub fn price(&self, model: usize) -> f64 {
        self.sensors.models()[model].price
    }

    /// Numbers of the models that the rig has, rising.
    pub fn used_models(&self) -> Vec<usize> {
        let mut used = self.models.clone();
        used.sort_unstable();
        used.dedup();
        used
    }

    /// The mask of each LiDAR.
    pub fn masks(&self) -> Vec<SelfHitMask<'_>> {
        let mask = |k: usize| {
            let phase = self.placement.lidars[k].phase.unwrap_or_default();
            SelfHitMask::new(self.table(k), phase, &self.own[k])
        };
        (0..self.own.len()).map(mask).collect()
    }
}

/// The only placement of a file, or the one named behind a colon.
fn one(text: &str) -> Result<Placement, RunError> {
    let mut all = named_placements(text)?;
    match &all[..] {
        [_] => Ok(all.swap_remove(0)),
        [] => Err(RunError::Usage(format!(
            "{text}: holds no placement; there is nothing to hand over"
        ))),
        [first, ..] => {
            let names: Vec<&str> = all.iter().map(|placement| &*placement.name).take(12).collect();
            Err(RunError::Usage(format!(
                "{text}: holds {} placements, and one is handed over; name it behind a colon, as {}:{} (it has {})",
                all.len(),
                file_and_name(text).0,
                first.name,
                names.join(", ")
            )))
        }
    }
}

/// The scene that is given, or level ground around the vehicle.
fn scene(
    files: &[String],
    placements: &str,
    frame: u32,
    computing: &Computing<'_>,
) -> Result<Scene, RunError> {
    let scene = match (files, &computing.vehicle) {
        ([file], _) => {
            let mend = "static shapes, actors and an ego body";
            opening::geometry(Path::new(file), mend, computing)?
        }
        ([], Some(vehicle)) => {
            let scene = Scene::level_ground(vehicle)?;
            scene.notes().iter().try_for_each(|note| computing.watcher.tell(note))?;
            scene
        }
        ([], None) => {
            return Err(RunError::Usage(format!(
                "{placements}: there is neither a scene nor a vehicle; give --vehicle FILE for level ground, or a \
                 scene before the placements"
            )));
        }
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
