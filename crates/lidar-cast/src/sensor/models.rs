//! The sensor models of a vehicle, and where in a turn each sensor is.

use std::collections::HashSet;
use std::f64::consts::TAU;
use std::sync::Arc;

use serde::Serialize;

use super::placement::nearest;
use super::{BeamTable, Placement, Response, Ride, SensorName, SensorPose};
use crate::geom::Pose;
use crate::maths::mixed;

/// Start angle of a spinning sensor: radians about its own axis, added to every azimuth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpinPhase {
    /// One fixed angle in radians for all frames: the sensors are locked to each other.
    Locked(f64),
    /// A random angle in every frame: the sensors spin freely.
    Free,
    /// A fixed angle for all frames, chosen by a search for each LiDAR. Bounds in radians: lowest, highest.
    Between(f64, f64),
}

impl SpinPhase {
    /// Phase in radians of a sensor whose pose gives none: 0 if free, else the allowed angle nearest to 0.
    pub fn at_rest(self) -> f64 {
        match self {
            Self::Locked(phase) => phase,
            Self::Free => 0.0,
            Self::Between(from, to) => 0.0_f64.clamp(from, to),
        }
    }

    /// Phase mirrored at the plane y = 0: the angle changes sign, and bounds swap.
    fn mirrored(self) -> Self {
        match self {
            Self::Locked(phase) => Self::Locked(0.0 - phase),
            Self::Free => Self::Free,
            Self::Between(from, to) => Self::Between(0.0 - to, 0.0 - from),
        }
    }
}

/// One model that a vehicle's sensors may be of.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorModel {
    /// Name in placements.
    pub name: SensorName,
    /// Its beams, and how far they go.
    pub table: BeamTable,
    /// Where in its turn it fires.
    pub phase: SpinPhase,
    /// Price of one, in any currency.
    pub price: f64,
    /// Echo model: rated range, noise, beam divergence, echoes kept.
    pub response: Response,
}

impl SensorModel {
    /// A model without a name, locked at 0, of the usual response.
    pub fn plain(table: BeamTable) -> Self {
        let response = Response::usual(f64::from(table.range()));
        let (name, phase, price) = (SensorName::default(), SpinPhase::Locked(0.0), 0.0);
        Self { name, table, phase, price, response }
    }
}

/// A placement names a model that the vehicle does not have, or a body.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no {what} `{name}`; {}the vehicle has {known}", meant(.nearest))]
pub struct UnknownSensor {
    /// `sensor`, or `body to ride on`.
    pub what: &'static str,
    /// Name written in the placement.
    pub name: SensorName,
    /// The most similar of the vehicle's names, if one is similar.
    pub nearest: Option<String>,
    /// The vehicle's names, in words.
    pub known: String,
}

fn meant(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|name| format!("did you mean `{name}`? ")).unwrap_or_default()
}

/// A LiDAR of a placement that is of no model of the vehicle.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum ForeignLidar {
    /// It names a model that the vehicle does not have.
    #[error("placement `{placement}`, LiDAR {lidar}: {source}")]
    Unknown { placement: String, lidar: usize, source: UnknownSensor },
    /// It names no model, and the vehicle has several.
    #[error(
        "placement `{placement}`, LiDAR {lidar} names no sensor, and the vehicle has {} models: {}; add \
         \"sensor\": \"{first}\" to the LiDAR, or give --sensor {lidar}={first} (in Python sensors=[…])",
        .models.len(), list(.models), first = .models[0]
    )]
    Unnamed { placement: String, lidar: usize, models: Vec<SensorName> },
    /// `--sensor` names another model than the placement.
    #[error(
        "placement `{placement}`, LiDAR {lidar} is a `{named}`, and --sensor {lidar}={asked} says otherwise; \
         leave one of them out"
    )]
    Renamed { placement: String, lidar: usize, named: SensorName, asked: SensorName },
}

/// The models of a scene's own `lidar`, in words.
const NAMELESS: &str = "one model without a name: names of models come with the file of a vehicle, `--vehicle FILE` (in \
                        Python vehicle=…)";

fn list(models: &[SensorName]) -> String {
    models.iter().map(SensorName::as_str).collect::<Vec<_>>().join(", ")
}

impl UnknownSensor {
    fn among(models: &[SensorName], name: SensorName) -> Self {
        let named = models.iter().filter(|model| !model.is_none());
        let names: Vec<String> = named.map(|model| format!("`{model}`")).collect();
        let known = if names.is_empty() { NAMELESS.into() } else { names.join(", ") };
        let nearest = nearest(name.as_str(), models.iter().map(SensorName::as_str));
        Self { what: "sensor", name, nearest, known }
    }
}

/// Models of a vehicle, at least one, and the seed of random draws: free phases, and beams lost in weather.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensors {
    models: Arc<[SensorModel]>,
    rides: Arc<[Ride]>,
    seed: u64,
}

impl From<BeamTable> for Sensors {
    /// One model without a name, locked at 0.
    fn from(table: BeamTable) -> Self {
        Self { models: [SensorModel::plain(table)].into(), rides: [].into(), seed: 0 }
    }
}

impl Sensors {
    /// From models in the vehicle's order; `None` without any.
    pub fn new(models: Vec<SensorModel>) -> Option<Self> {
        (!models.is_empty()).then(|| Self { models: models.into(), rides: [].into(), seed: 0 })
    }

    /// A copy with other beams of one model.
    ///
    /// # Panics
    /// A number that no model has.
    pub fn with_beams(&self, model: usize, table: BeamTable) -> Self {
        let mut models = self.models.to_vec();
        models[model].table = table;
        Self { models: models.into(), ..self.clone() }
    }

    /// A copy with the own bodies that may carry sensors.
    pub fn riding(self, rides: Vec<Ride>) -> Self {
        Self { rides: rides.into(), ..self }
    }

    /// A copy with another seed.
    pub fn with_seed(&self, seed: u64) -> Self {
        Self { seed, ..self.clone() }
    }

    /// Sensors mirrored at the plane y = 0: beam tables and phases. Bodies that carry them stand as they do.
    pub fn mirrored(&self) -> Self {
        let image = |model: &SensorModel| {
            let (table, phase) = (model.table.mirrored(), model.phase.mirrored());
            SensorModel { table, phase, ..model.clone() }
        };
        Self { models: self.models.iter().map(image).collect(), ..self.clone() }
    }

    /// Seed of random draws.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// All models, in the vehicle's order.
    pub fn models(&self) -> &[SensorModel] {
        &self.models
    }

    /// Beams of a model.
    ///
    /// # Panics
    /// A number that no model has.
    pub fn table(&self, model: usize) -> &BeamTable {
        &self.models[model].table
    }

    /// Number of the model that a pose names; 0 if it names none. [`Self::check`] refuses a pose without a
    /// name where the vehicle has several models.
    ///
    /// # Errors
    /// The vehicle has no such model, or no body that is to carry it.
    pub fn number(&self, pose: &SensorPose) -> Result<usize, UnknownSensor> {
        if !pose.rides_on.is_none() && Ride::find(&self.rides, pose.rides_on).is_none() {
            return Err(Ride::unknown(&self.rides, pose.rides_on));
        }
        if pose.sensor.is_none() {
            return Ok(0);
        }
        let found = self.models.iter().position(|model| model.name == pose.sensor);
        found.ok_or_else(|| UnknownSensor::among(&self.names(), pose.sensor))
    }

    /// Names of all models, in the vehicle's order.
    pub fn names(&self) -> Vec<SensorName> {
        self.models.iter().map(|model| model.name).collect()
    }

    /// Checks that the vehicle has the model of every LiDAR. With several models, each LiDAR must name its own.
    ///
    /// # Errors
    /// The first LiDAR whose model is not known.
    pub fn check(&self, placement: &Placement) -> Result<(), ForeignLidar> {
        for (lidar, pose) in placement.lidars.iter().enumerate() {
            let placement = || placement.name.clone();
            if pose.sensor.is_none() && self.models.len() > 1 {
                let models = self.names();
                return Err(ForeignLidar::Unnamed { placement: placement(), lidar, models });
            }
            let unknown = |source| ForeignLidar::Unknown { placement: placement(), lidar, source };
            self.number(pose).map_err(unknown)?;
        }
        Ok(())
    }

    /// Names the first model in LiDARs without a name, where the vehicle has several. Only for placements that
    /// the program makes: placements in files must name their models.
    ///
    /// Returns whether any was named.
    pub fn name_first(&self, placements: &mut [Placement]) -> bool {
        let [first, _, ..] = &self.models[..] else { return false };
        let unnamed = placements.iter_mut().flat_map(|placement| &mut placement.lidars);
        let mut any = false;
        for pose in unnamed.filter(|pose| pose.sensor.is_none()) {
            (pose.sensor, any) = (first.name, true);
        }
        any
    }

    /// Beams of one sensor in words: `4000 beams`, of several models `4000 or 8000 beams`. Models that are not `used` do not
    /// count, unless none is; a LiDAR without a name may be of any.
    pub fn beams_in_words(&self, used: &HashSet<SensorName>) -> String {
        let all = used.is_empty() || used.contains(&SensorName::NONE);
        let is_used = |model: &&SensorModel| all || used.contains(&model.name);
        let models = self.models.iter().filter(is_used);
        let mut beams: Vec<usize> = models.map(|model| model.table.directions().len()).collect();
        beams.sort_unstable();
        beams.dedup();
        let beams: Vec<String> = beams.iter().map(usize::to_string).collect();
        format!("{} beams", beams.join(" or "))
    }

    /// True if any model turns all the way round.
    pub fn turns(&self) -> bool {
        let turns = |model: &SensorModel| model.table.grid().is_some_and(|grid| grid.turn);
        self.models.iter().any(turns)
    }

    /// A copy with every model that turns free of the others.
    pub fn with_free_phases(&self) -> Self {
        let freed = |model: &SensorModel| match model.table.grid() {
            Some(grid) if grid.turn => SensorModel { phase: SpinPhase::Free, ..model.clone() },
            _ => model.clone(),
        };
        Self { models: self.models.iter().map(freed).collect(), ..self.clone() }
    }

    /// Range of the model that sees farthest, in metres.
    pub fn longest_range(&self) -> f32 {
        self.models.iter().map(|model| model.table.range()).fold(0.0, f32::max)
    }

    /// Beams of the model that has most.
    pub fn most_beams(&self) -> usize {
        self.models.iter().map(|model| model.table.directions().len()).max().unwrap_or(0)
    }

    /// True if the phase of the model of a name differs from frame to frame; the first's for no name.
    pub fn is_free(&self, name: SensorName) -> bool {
        let named = |model: &&SensorModel| name.is_none() || model.name == name;
        self.models.iter().find(named).is_some_and(|model| model.phase == SpinPhase::Free)
    }

    /// True if any model's phase differs from frame to frame.
    pub fn has_free_phase(&self) -> bool {
        self.models.iter().any(|model| model.phase == SpinPhase::Free)
    }

    /// True if both have equal models and draws, whatever bodies carry sensors.
    pub fn has_models_of(&self, other: &Self) -> bool {
        (&self.models, self.seed) == (&other.models, other.seed)
    }

    /// True if all bodies that may carry sensors stand alike in two frames.
    pub fn stand_alike(&self, frames: [usize; 2]) -> bool {
        self.rides.iter().all(|ride| ride.pose(frames[0]) == ride.pose(frames[1]))
    }

    /// Sensor-to-ego transform of a sensor of a model in a frame: as [`Self::turned`], carried by the body that it rides on.
    pub fn ego_from_sensor(&self, model: usize, pose: &SensorPose, frame: usize) -> Pose {
        self.carried(pose, frame, self.turned(model, pose, frame))
    }

    /// A transform to the ego frame of frame 0, carried by the body that a sensor rides on to where it stands in a frame.
    pub fn carried(&self, pose: &SensorPose, frame: usize, ego_from_sensor: Pose) -> Pose {
        match Ride::find(&self.rides, pose.rides_on) {
            Some(ride) => ride.pose(frame).compose(&ego_from_sensor),
            None => ego_from_sensor,
        }
    }

    /// Sensor-to-ego transform of a sensor of a model that nothing carries: its pose after a turn by the phase,
    /// R = Rz(yaw)·Ry(pitch)·Rx(roll)·Rz(phase). The pose's phase counts; without one, the model's.
    pub fn turned(&self, model: usize, pose: &SensorPose, frame: usize) -> Pose {
        let rest = pose.ego_from_sensor();
        let phase = match (pose.phase, self.models[model].phase) {
            (Some(phase), _) => phase,
            (None, SpinPhase::Free) => {
                self.chance(model, pose, frame) * self.models[model].table.period()
            }
            (None, locked) => locked.at_rest(),
        };
        if phase == 0.0 {
            return rest;
        }
        rest.compose(&Pose::new(glam::DVec3::ZERO, 0.0, 0.0, phase))
    }

    /// A number from 0 to 1 that only seed, model, pose and frame decide, not the order in which poses are
    /// cast.
    fn chance(&self, model: usize, pose: &SensorPose, frame: usize) -> f64 {
        let numbers = pose.values().map(|value| (value + 0.0).to_bits());
        let words = [self.seed, model as u64, frame as u64].into_iter().chain(numbers);
        let hash = words.fold(0, |hash, word| mixed(hash ^ word));
        (hash >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl BeamTable {
    /// The least turn about the sensor's axis that leaves its beams as they are, in radians: one azimuth
    /// step of a spinning sensor, a whole turn of any other.
    fn period(&self) -> f64 {
        self.grid().filter(|grid| grid.turn).map_or(TAU, |grid| grid.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensors(phase: SpinPhase) -> Sensors {
        let table = BeamTable::spinning(&[(0.0, 0.0)], 250, 100.0).unwrap();
        let name = SensorName::new("spinning").unwrap();
        Sensors::new(vec![SensorModel { name, phase, ..SensorModel::plain(table) }]).unwrap()
    }

    fn turn(sensors: &Sensors, pose: &SensorPose, frame: usize) -> f64 {
        let pose =
            pose.ego_from_sensor().inverse().compose(&sensors.ego_from_sensor(0, pose, frame));
        assert!((pose.rotation.z_axis.z - 1.0).abs() < 1e-15, "a turn about the sensor's axis");
        pose.rotation.x_axis.y.atan2(pose.rotation.x_axis.x)
    }

    #[test]
    fn a_locked_phase_is_a_turn_about_the_sensors_own_axis() {
        let pose = SensorPose { roll: 0.3, pitch: -0.2, yaw: 1.0, ..SensorPose::at(0.1, 0.2, 2.0) };
        assert!((turn(&sensors(SpinPhase::Locked(0.01)), &pose, 7) - 0.01).abs() < 1e-14);
        let still = sensors(SpinPhase::Locked(0.0)).ego_from_sensor(0, &pose, 7);
        assert_eq!(still, pose.ego_from_sensor(), "to the bit");
    }

    #[test]
    fn other_beams_are_those_of_one_model_alone() {
        let one = |elevation: f64| BeamTable::spinning(&[(elevation, 0.0)], 250, 100.0).unwrap();
        let named = |name: &str, elevation: f64| {
            let name = SensorName::new(name).unwrap();
            SensorModel { name, price: 7.0, ..SensorModel::plain(one(elevation)) }
        };
        let both = Sensors::new(vec![named("roof", 0.0), named("corner", 5.0)]).unwrap();
        let changed = both.with_beams(1, one(-9.0));
        assert_eq!((changed.table(0), changed.table(1)), (&one(0.0), &one(-9.0)));
        let told = |sensors: &Sensors| -> Vec<_> {
            sensors.models().iter().map(|model| (model.name, model.phase, model.price)).collect()
        };
        assert_eq!(told(&changed), told(&both));
    }

    #[test]
    fn a_pose_that_names_a_phase_is_locked_there() {
        let pose = SensorPose { roll: 0.3, yaw: 1.0, ..SensorPose::at(0.1, 0.2, 2.0) };
        let phased = SensorPose { phase: Some(0.004), ..pose };
        for phase in [SpinPhase::Free, SpinPhase::Locked(0.01), SpinPhase::Between(0.0, 0.02)] {
            assert!((turn(&sensors(phase), &phased, 7) - 0.004).abs() < 1e-14, "{phase:?}");
        }
        assert!(turn(&sensors(SpinPhase::Between(-0.01, 0.02)), &pose, 7).abs() < 1e-14);
        assert!((turn(&sensors(SpinPhase::Between(0.01, 0.02)), &pose, 7) - 0.01).abs() < 1e-14);
        // A mirror image looks where the mirror shows it.
        let both = sensors(SpinPhase::Between(0.01, 0.02));
        let image = both.mirrored().ego_from_sensor(0, &phased.mirrored(), 0).rotation.x_axis;
        let itself = both.ego_from_sensor(0, &phased, 0).rotation.x_axis;
        assert!((image - glam::DVec3::new(itself.x, -itself.y, itself.z)).length() < 1e-14);
        assert!((turn(&both.mirrored(), &pose.mirrored(), 0) + 0.01).abs() < 1e-14);
    }

    #[test]
    fn free_phases_are_spread_over_one_step_and_differ_by_frame_pose_and_seed() {
        let free = sensors(SpinPhase::Free);
        let pose = SensorPose::at(0.1, 0.2, 2.0);
        let step = TAU / 250.0;
        let of = |free: &Sensors, z: f64| -> Vec<f64> {
            (0..400).map(|t| turn(free, &SensorPose { z, ..pose }, t) / step).collect()
        };
        let turns = of(&free, 2.0);
        assert!(turns.iter().all(|turn| (-1e-9..1.0).contains(turn)));
        // A uniform variable has mean 1/2 and variance 1/12: four standard errors of 400 draws.
        let mean = turns.iter().sum::<f64>() / 400.0;
        let variance = turns.iter().map(|turn| (turn - mean).powi(2)).sum::<f64>() / 400.0;
        assert!(
            (mean - 0.5).abs() < 0.06 && (variance - 1.0 / 12.0).abs() < 0.015,
            "{mean} {variance}"
        );
        for other in [of(&free, 2.1), of(&free.with_seed(1), 2.0)] {
            let product = |(a, b): (&f64, &f64)| (a - 0.5) * (b - 0.5);
            let covariance = turns.iter().zip(&other).map(product).sum::<f64>() / 400.0;
            assert!(covariance.abs() < 0.02, "{covariance}");
        }
    }

    #[test]
    fn an_unknown_sensor_is_named_beside_those_there_are() {
        let sensors = sensors(SpinPhase::Free);
        let pose = SensorPose::at(0.0, 0.0, 2.0);
        assert_eq!(sensors.number(&pose), Ok(0));
        let known = SensorPose { sensor: SensorName::new("spinning").unwrap(), ..pose };
        assert_eq!(sensors.number(&known), Ok(0));
        let other = SensorPose { sensor: SensorName::new("other").unwrap(), ..pose };
        let words = sensors.number(&other).unwrap_err().to_string();
        assert_eq!(words, "there is no sensor `other`; the vehicle has `spinning`");
        let slip = SensorPose { sensor: SensorName::new("spining").unwrap(), ..pose };
        let words = sensors.number(&slip).unwrap_err().to_string();
        assert!(words.contains("`spining`; did you mean `spinning`? the vehicle has"), "{words}");
    }

    #[test]
    fn of_several_models_each_lidar_names_its_own() {
        let table = || BeamTable::spinning(&[(0.0, 0.0)], 250, 100.0).unwrap();
        let name = |name: &str| SensorName::new(name).unwrap();
        let model = |of: &str| SensorModel { name: name(of), ..SensorModel::plain(table()) };
        let both = Sensors::new(vec![model("spin-32"), model("corner-8")]).unwrap();
        let at = |sensor| SensorPose { sensor, ..SensorPose::at(0.0, 0.0, 2.0) };
        let lidars = vec![at(name("corner-8")), at(SensorName::NONE)];
        let mut placements = [Placement { name: "a".into(), lidars }];
        let words = both.check(&placements[0]).unwrap_err().to_string();
        assert_eq!(
            words,
            "placement `a`, LiDAR 1 names no sensor, and the vehicle has 2 models: spin-32, corner-8; add \
         \"sensor\": \"spin-32\" to the LiDAR, or give --sensor 1=spin-32 (in Python sensors=[…])"
        );
        assert!(
            sensors(SpinPhase::Free)
                .check(&Placement { lidars: vec![at(SensorName::NONE)], ..placements[0].clone() })
                .is_ok()
        );
        assert!(both.name_first(&mut placements) && !both.name_first(&mut placements));
        let named: Vec<_> = placements[0].lidars.iter().map(|pose| pose.sensor).collect();
        assert_eq!(named, [name("corner-8"), name("spin-32")]);
        assert_eq!(both.check(&placements[0]), Ok(()));
        assert!(!sensors(SpinPhase::Free).name_first(&mut placements));
    }
}
