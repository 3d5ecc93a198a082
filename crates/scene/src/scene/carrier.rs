//! The vehicle of a scene: inline, from a file, or made of the scene's `lidar` and `mount`.

use std::path::{Path, PathBuf};

use super::angles;
use super::classes::Classes;
use super::description::{Dictionary, SceneDescription, ShapeDescription, VehicleSource};
use super::shapes::Builder;
use super::solid::Solid;
use crate::vehicle::{Vehicle, VehicleDescription, read_vehicle};
use sightline_files::Note;
use sightline_files::json::{DescriptionError, Place};

/// A scene's vehicle, its body and its files.
pub(super) struct Carrier {
    pub vehicle: Vehicle,
    /// A body that takes the place of the scene's own.
    pub body: Option<Body>,
    pub files: Vec<PathBuf>,
    /// Sentences about the vehicle and its sensors.
    pub notes: Vec<Note>,
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
        let files = lidar.file.iter().map(|file| dir.join(file)).collect();
        let vehicle = Vehicle::nameless(top, lidar, &mount, dir)?;
        Ok(Self { notes: vehicle.notes.clone(), vehicle, body: None, files })
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
        Ok(Self { notes: vehicle.notes.clone(), vehicle, body, files })
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
