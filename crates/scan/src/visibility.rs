//! Per-beam visibility in weather, for scoring. A beam that does not return covers no voxel.

use std::sync::{Arc, Mutex};

use glam::DVec3;
use lidar_cast::bvh::Hit;
use lidar_cast::geom::Pose;
use rayon::prelude::*;
use sightline_scene::problem::{Air, Frame, Problem, SensorBatch};
use sightline_scene::scene::{Coverage, Scene};
use sightline_scene::vehicle::{Echoes, Response};

use super::ScanError;
use super::conditions::{self, Condition, FallEffect, Flake, JoinedEcho};
use super::optics::{Optics, is_seen};
use super::stage::Stage;
use crate::fires::{Chance, Purpose};

/// Reflectance of a target that faces the sensor, by which beams that meet nothing are cut: farther than it
/// would be seen they tell nothing.
const TARGET: f64 = 0.3;
/// Steps of the table of how far that is, by chance.
const STEPS: usize = 256;
/// Times that the range in which it is looked for is halved: to a tenth of a millimetre of 100 m.
const HALVINGS: usize = 20;

/// Weather and faults for scoring.
///
/// A beam that meets a surface returns with the probability of a scan, and then covers its voxels as in clear air;
/// otherwise it covers nothing. A beam that meets nothing covers as far as it would see a target of 30 %, behind all
/// snow and rain on its way; nothing if crosstalk hits it. One draw for each frame, model and beam number decides, so
/// that voxels are weighted by probability, in whole beams: all engines have equal bits, neighbouring placements equal
/// luck. LiDARs of one model share the draws: where two beams of one number meet in a voxel, both return or neither.
/// Other seeds give other draws, also of dark vehicles; their mean is the expectation.
#[derive(Debug)]
struct Visibility {
    optics: Optics,
    stage: Stage,
    /// Cached reach tables, one for each pair of response and range seen so far.
    reaches: Mutex<Vec<Reach>>,
}

/// Response and random numbers of one beam.
struct Beam<'a> {
    response: &'a Response,
    chance: Chance,
    /// Seed of the draw.
    seed: u64,
}

/// A model's response, its range, and the reach of [`TARGET`] in metres by detection draw.
type Reach = (Response, f32, Arc<[f32]>);

/// The problem under weather and faults; unchanged if `conditions` is empty.
///
/// # Errors
/// Beams that end at nothing, a condition given twice.
pub fn in_conditions(
    scene: &Scene,
    problem: Problem,
    conditions: &[Condition],
) -> Result<Problem, ScanError> {
    if conditions.is_empty() {
        return Ok(problem);
    }
    let air = Visibility::new(scene, &problem, conditions)?;
    Ok(problem.in_air(air))
}

impl Visibility {
    /// Visibility of the scene's beams under `conditions`.
    fn new(
        scene: &Scene,
        problem: &Problem,
        conditions: &[Condition],
    ) -> Result<Arc<Self>, ScanError> {
        if scene.coverage() == Coverage::Through || !scene.has_geometry() {
            return Err(ScanError::Refused(format!(
                "the scene `{}` has no geometry that ends beams (coverage `through`); conditions need `\"coverage\": \
                 \"first-hit\"`",
                scene.name()
            )));
        }
        let optics = Optics::new(scene, conditions::weather(conditions)?);
        let first = problem.geometry(0).into_iter().flat_map(|frame| frame.instances());
        Ok(Arc::new(Self { stage: Stage::of(scene, first), optics, reaches: Mutex::default() }))
    }

    /// Metres up to which [`TARGET`] is detected in air without snow or rain, by detection draw.
    fn reaches(&self, response: &Response, range: f32) -> Arc<[f32]> {
        let mut known = self.reaches.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((.., found)) = known.iter().find(|(r, far, _)| r == response && *far == range) {
            return found.clone();
        }
        let step = |step: usize| {
            let draw = (step as f64 + 0.5) / STEPS as f64;
            let clear = FallEffect { passed: 1.0, flake: None };
            reach(response, &self.optics, f64::from(range), &clear, draw) as f32
        };
        let reaches: Arc<[f32]> = (0..STEPS).map(step).collect();
        known.push((*response, range, reaches.clone()));
        reaches
    }

    /// True if a beam comes back from the surface of a thing that it hits.
    fn returns(&self, beam: &Beam<'_>, thing: usize, class: u16, cosine: f64, range: f64) -> bool {
        let (response, instance) = (beam.response, self.stage.things[thing].instance);
        let fallen = self.fallen(beam, range);
        let power = self.optics.power(beam.seed, class, instance, cosine, range);
        let mut power = power * fallen.passed;
        let mut other = self.optics.of_fog(range);
        if let Some(flake) = fallen.flake {
            match flake.join(range, power) {
                JoinedEcho::Apart => other = other.max(flake.power),
                JoinedEcho::Target(peak) => power = peak,
                JoinedEcho::Flake(_) => return false,
            }
        }
        let hidden = response.echoes == Echoes::Strongest && other > power;
        let draw = || beam.chance.draw(Purpose::Detection, 0);
        !hidden
            && !self.is_wrong(beam)
            && is_seen(response, power, draw)
            && range >= response.min_range
    }

    /// Metres that a beam without a hit covers, at most `range`. `reaches` holds the distances for air without snow
    /// or rain.
    fn far(&self, beam: &Beam<'_>, reaches: &[f32], range: f32) -> f32 {
        let draw = beam.chance.draw(Purpose::Detection, 0);
        if self.is_wrong(beam) {
            0.0
        } else if self.optics.weather.falls().next().is_none() {
            range.min(reaches[(draw * STEPS as f64) as usize])
        } else {
            let range = f64::from(range);
            reach(beam.response, &self.optics, range, &self.fallen(beam, range), draw) as f32
        }
    }

    /// Light that passes snow and rain up to `range`, and the strongest of their echoes, dimmed by fog on its way.
    fn fallen(&self, beam: &Beam<'_>, range: f64) -> FallEffect {
        let mut all = FallEffect { passed: 1.0, flake: None };
        for (falling, purpose, _) in self.optics.weather.falls() {
            let draws = beam.chance.draws(purpose);
            let fallen = falling.beam(beam.response.divergence, range, draws);
            all.passed *= fallen.passed;
            let flake = fallen.flake.map(|flake| {
                let power = flake.power * self.optics.through_fog(flake.range);
                Flake { power, ..flake }
            });
            let stronger =
                flake.filter(|flake| all.flake.is_none_or(|known| flake.power > known.power));
            all.flake = stronger.or(all.flake);
        }
        all
    }

    /// True if a beam takes another sensor's pulse for its own.
    fn is_wrong(&self, beam: &Beam<'_>) -> bool {
        beam.chance.draw(Purpose::Crosstalk, 0) < self.optics.weather.crosstalk
    }
}

impl Air for Visibility {
    fn passed(&self, metres: f64) -> f64 {
        self.optics.weather.passed(metres)
    }

    fn dim(
        &self,
        batch: &SensorBatch<'_>,
        ego_from_sensors: &[Pose],
        frame: &Frame,
        number: usize,
        hits: &mut [Hit],
    ) {
        let seed = batch.seed();
        let mut rows = Vec::with_capacity(batch.len());
        let mut rest = hits;
        for sensor in 0..batch.len() {
            let (row, others) = rest.split_at_mut(batch.beams_of(sensor).len());
            rest = others;
            rows.push((sensor, row));
        }
        rows.into_par_iter().for_each(|(sensor, row)| {
            let model = batch.sensor_model(sensor);
            let reaches = self.reaches(&model.response, model.table.range());
            let poses = frame.instances().iter();
            let turns: Vec<_> = poses
                .map(|instance| instance.pose_from(&ego_from_sensors[sensor]).rotation)
                .collect();
            let directions = batch.table(sensor).directions();
            let (frame, kind) = (number as u32, batch.model(sensor) as u32);
            for (beam, (hit, direction)) in row.iter_mut().zip(directions).enumerate() {
                let chance = Chance::new(seed, frame, kind, beam as u32);
                let beam = Beam { response: &model.response, chance, seed };
                if !hit.is_hit() {
                    *hit = Hit::ended(self.far(&beam, &reaches, hit.t));
                    continue;
                }
                let thing = self.stage.thing_of(hit.prim);
                let (class, normal) = self.stage.things[thing].face(hit.prim);
                let direction = turns[thing] * DVec3::from(direction.map(f64::from));
                let cosine = normal.as_dvec3().dot(direction).abs().min(1.0);
                if !self.returns(&beam, thing, class, cosine, f64::from(hit.t)) {
                    *hit = Hit::ended(0.0);
                }
            }
        });
    }
}

/// Farthest range up to `range` metres at which [`TARGET`] is detected; fog and falling snow dim it.
fn reach(response: &Response, optics: &Optics, range: f64, fallen: &FallEffect, draw: f64) -> f64 {
    let flake = fallen.flake.map_or(0.0, |flake| flake.power);
    let seen = |r: f64| {
        let power = fallen.passed * TARGET / (r * r) * optics.through_fog(r);
        let hidden = response.echoes == Echoes::Strongest && optics.of_fog(r).max(flake) > power;
        !hidden && is_seen(response, power, || draw)
    };
    if seen(range) {
        return range;
    }
    let (mut near, mut far) = (0.0, range);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (near + far);
        if seen(middle) { near = middle } else { far = middle }
    }
    near
}
