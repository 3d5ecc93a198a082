//! How the vertices of a mesh file come into the frame of its owner.

use std::path::Path;

use glam::DVec3;

use super::raw::{Axes, RawMesh, extension};
use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};

/// Axes, scale and pose of a mesh, from the description that names its file.
pub struct Placing {
    /// Axes that the description names.
    axes: Option<Axes>,
    scale: f64,
    pose: Pose,
}

impl Placing {
    /// Checks the keys `axes`, `scale`, `translate` and `roll`, `pitch`, `yaw` of a mesh.
    pub fn new(
        at: &Place,
        axes: Option<&str>,
        scale: Option<f64>,
        translate: [f64; 3],
        [roll, pitch, yaw]: [f64; 3],
    ) -> Result<Self, DescriptionError> {
        let axes = axes.map(|word| {
            let wanted = "\"z-up\", \"y-up\" (x forward) or \"z-forward\" (y up, x left)";
            Axes::of(word).ok_or_else(|| bad(&at.key("axes"), format!("{word:?}"), wanted))
        });
        let axes = axes.transpose()?;
        let scale = scale.unwrap_or(1.0);
        if !(scale > 0.0 && scale <= 1.0e6) {
            return Err(bad(&at.key("scale"), scale, "a scale above 0 and at most 1000000"));
        }
        let roll = check::radians(&at.key("roll"), roll)?;
        let pitch = check::radians(&at.key("pitch"), pitch)?;
        let yaw = check::radians(&at.key("yaw"), yaw)?;
        let translate = check::point(&at.key("translate"), translate)?;
        Ok(Self { axes, scale, pose: Pose::new(translate.into(), roll, pitch, yaw) })
    }

    /// A note on the forward axis of a glTF that neither the description nor the file names.
    pub fn note(&self, at: &Place, file: &Path, mesh: &RawMesh) -> Option<Note> {
        let open = is_gltf(file) && self.axes.or(mesh.axes).is_none();
        open.then(|| {
            Note::fact(format!(
                "{at}: {} does not say which way is forward; x is taken, as Blender writes a world. `axes` decides: \
                 \"y-up\" for x, \"z-forward\" for z as the specification of glTF has it",
                file.display()
            ))
        })
    }

    /// The vertices of a mesh in its owner's frame, in metres.
    pub fn vertices(
        &self,
        at: &Place,
        file: &Path,
        mesh: &RawMesh,
    ) -> Result<Vec<DVec3>, DescriptionError> {
        let axes = self.axes.or(mesh.axes).unwrap_or(match is_gltf(file) {
            true => Axes::YUp,
            false => Axes::ZUp,
        });
        let place = |(i, v): (usize, &DVec3)| {
            let v = self.pose.apply(axes.turn(*v) * self.scale);
            if v.abs().max_element() <= check::MAX_METRES {
                return Ok(v);
            }
            Err(DescriptionError::Mesh {
                at: Box::new(at.clone()),
                mesh: file.to_owned(),
                element: format!("vertex {i}"),
                problem: format!(
                    "lies at {}, further than 1e9 m from the origin; move the mesh or give a smaller `scale`",
                    super::exponents(v)
                ),
            })
        };
        mesh.vertices.iter().enumerate().map(place).collect()
    }
}

fn is_gltf(file: &Path) -> bool {
    matches!(extension(file).as_str(), "gltf" | "glb")
}
