//! What carries the sensors in a scene: a LiDAR and a mount, or a vehicle.

use std::path::{Path, PathBuf};

use super::angles;
use super::classes::Classes;
use super::description::{Dictionary, SceneDescription, ShapeDescription, VehicleSource};
use super::shapes::Builder;
use super::solid::Solid;
use crate::vehicle::sensor_file::Measures;
use crate::vehicle::stated;
use crate::vehicle::{
    Constraints, Described, Lidar, Mount, Response, SensorError, SensorModel, Sensors, Vehicle,
    VehicleDescription, read_vehicle,
};
use sightline_files::Note;
use sightline_files::json::{DescriptionError, Place};

/// A scene's vehicle, its body and its files.
pub(super) struct Carrier {
    pub carries: Carries,
    /// A body that takes the place of the scene's own.
    pub body: Option<Body>,
    pub files: Vec<PathBuf>,
    /// Sentences about the LiDAR or the vehicle.
    pub notes: Vec<Note>,
}

/// Sensors of a scene and where they may stand.
#[derive(Debug, Clone)]
pub(super) enum Carries {
    /// One model on one mount.
    Lidar {
        lidar: Box<Lidar>,
        mount: Box<Mount>,
        /// How the LiDAR measures, where its sensor file says so.
        response: Option<Response>,
    },
    /// Models and mounts of a vehicle.
    Vehicle(Box<Vehicle>),
}

impl Carries {
    /// The models, at least one.
    pub fn lidars(&self) -> Vec<&Lidar> {
        match self {
            Self::Lidar { lidar, .. } => vec![lidar],
            Self::Vehicle(vehicle) => vehicle.sensors.iter().map(|model| &model.lidar).collect(),
        }
    }

    /// The models with their beams.
    pub fn sensors(&self) -> Result<Sensors, SensorError> {
        match self {
            Self::Lidar { lidar, response, .. } => {
                let plain = SensorModel::plain(lidar.table()?);
                let response = response.unwrap_or(plain.response);
                Sensors::new(vec![SensorModel { response, ..plain }]).ok_or(SensorError::NoBeams)
            }
            Self::Vehicle(vehicle) => vehicle.models(),
        }
    }

    /// Rules of the mount, or of the vehicle with its fullest equipment.
    pub fn constraints(&self) -> Constraints {
        match self {
            Self::Lidar { mount, .. } => (&**mount).into(),
            Self::Vehicle(vehicle) => vehicle.constraints(&vehicle.fullest()),
        }
    }

    /// Corners of the smallest box around all mounts, in the ego frame.
    pub fn corners(&self) -> [[f64; 3]; 2] {
        match self {
            Self::Lidar { mount, .. } => [mount.min, mount.max],
            Self::Vehicle(vehicle) => {
                let all = vehicle.mounts.iter().map(|mount| mount.sensors[0]).enumerate();
                vehicle.constraints(&all.collect()).corners()
            }
        }
    }
}

/// Shapes of a vehicle's body.
pub(super) struct Body {
    pub shapes: Vec<ShapeDescription>,
    pub at: Place,
    /// Where its files are.
    pub dir: PathBuf,
}

impl Body {
    /// The body's triangles, the files that its shapes name, and notes about them.
    pub fn build(
        &self,
        classes: &Classes,
        shapes: &Dictionary<Vec<ShapeDescription>>,
    ) -> Result<(Solid, Vec<PathBuf>, Vec<Note>), DescriptionError> {
        let mut builder = Builder::new(&self.at, classes, shapes, &self.dir);
        let solid = builder.list(&self.at.key("body"), &self.shapes)?;
        let mut notes = builder.notes();
        notes.extend(angles::of_shapes(&self.at.key("body"), &self.shapes));
        Ok((solid, builder.files(), notes))
    }
}

impl Carrier {
    /// From a scene's description, or from the vehicle file given beside it.
    pub fn new(
        top: &Place,
        scene: &mut SceneDescription,
        dir: &Path,
        given: Option<&Path>,
    ) -> Result<Self, DescriptionError> {
        let source = match (given, scene.vehicle.take()) {
            (Some(file), _) => Some((Place::top(&file.display().to_string()), file.to_owned())),
            (None, Some(VehicleSource::Inline(vehicle))) => {
                only_vehicle(top, scene)?;
                return Self::of_vehicle(top.key("vehicle"), *vehicle, None, dir);
            }
            (None, Some(VehicleSource::File(file))) => {
                only_vehicle(top, scene)?;
                let file = dir.join(file);
                Some((Place::top(&file.display().to_string()), file))
            }
            (None, None) => None,
        };
        if let Some((at, file)) = source {
            let dir = file.parent().unwrap_or(Path::new("")).to_owned();
            return Self::of_vehicle(at, read_vehicle(&file)?, Some(file), &dir);
        }
        let missing = |key, mend: &str| DescriptionError::Missing {
            at: Box::new(top.clone()),
            key,
            mend: mend.to_owned(),
        };
        let lidar = scene.lidar.take();
        let lidar =
            lidar.ok_or_else(|| missing("lidar", "describe the sensor, or give a `vehicle`"))?;
        let mount = scene.mount.take();
        let mount = mount
            .ok_or_else(|| missing("mount", "say where sensors may stand, or give a `vehicle`"))?;
        let mount = Box::new(Mount::new(&top.key("mount"), &mount)?);
        let files = lidar.file.iter().map(|file| dir.join(file)).collect();
        let Described { lidar, measures, notes } = Described::new(&top.key("lidar"), lidar, dir)?;
        let response = (measures != Measures::default()).then(|| stated(lidar.range(), &measures));
        let carries = Carries::Lidar { lidar: Box::new(lidar), mount, response };
        Ok(Self { carries, body: None, files, notes })
    }

    fn of_vehicle(
        at: Place,
        mut vehicle: VehicleDescription<ShapeDescription>,
        file: Option<PathBuf>,
        dir: &Path,
    ) -> Result<Self, DescriptionError> {
        let shapes = std::mem::take(&mut vehicle.body);
        let stem = file.as_ref().and_then(|file| file.file_stem());
        let stem = stem.map_or("vehicle".into(), |stem| stem.to_string_lossy());
        let (vehicle, mut files) = Vehicle::new(&at, vehicle, &stem, dir)?;
        files.extend(file);
        let body = (!shapes.is_empty()).then(|| Body { shapes, at, dir: dir.to_owned() });
        let notes = vehicle.notes.clone();
        Ok(Self { carries: Carries::Vehicle(Box::new(vehicle)), body, files, notes })
    }
}

/// Refuses a LiDAR or mount beside a vehicle.
fn only_vehicle(top: &Place, scene: &SceneDescription) -> Result<(), DescriptionError> {
    for (key, there) in [("lidar", scene.lidar.is_some()), ("mount", scene.mount.is_some())] {
        if there {
            let (at, mend) =
                (Box::new(top.clone()), "the `vehicle` says it; leave one out".to_owned());
            return Err(DescriptionError::Misplaced { at, key, mend });
        }
    }
    Ok(())
}
