//! How the vertices of a mesh file come into the frame of its owner.

use std::path::Path;

use glam::DVec3;

use super::raw::{RawMesh, extension};
use crate::geom::Pose;
use crate::json::check::{self, bad};
use crate::json::{DescriptionError, Place};

/// Axes, a scale and a pose: what a description says about a mesh beside its file.
pub(crate) struct Placing {
    /// Whether y points up in the file.
    y_up: bool,
    scale: f64,
    pose: Pose,
}

impl Placing {
    /// Checks the keys `axes`, `scale`, `translate` and `roll`, `pitch`, `yaw` of a mesh.
    pub fn new(
        at: &Place,
        file: &Path,
        axes: Option<&str>,
        scale: Option<f64>,
        translate: [f64; 3],
        [roll, pitch, yaw]: [f64; 3],
    ) -> Result<Self, DescriptionError> {
        let y_up = match axes {
            None => matches!(extension(file).as_str(), "gltf" | "glb"),
            Some("z-up") => false,
            Some("y-up") => true,
            Some(other) => {
                return Err(bad(&at.key("axes"), format!("{other:?}"), "\"z-up\" or \"y-up\""));
            }
        };
        let scale = scale.unwrap_or(1.0);
        if !(scale > 0.0 && scale <= 1.0e6) {
            return Err(bad(&at.key("scale"), scale, "a scale above 0 and at most 1000000"));
        }
        let roll = check::radians(&at.key("roll"), roll)?;
        let pitch = check::radians(&at.key("pitch"), pitch)?;
        let yaw = check::radians(&at.key("yaw"), yaw)?;
        let translate = check::point(&at.key("translate"), translate)?;
        Ok(Self { y_up, scale, pose: Pose::new(translate.into(), roll, pitch, yaw) })
    }

    /// The vertices of a mesh in its owner's frame, in metres.
    pub fn vertices(
        &self,
        at: &Place,
        file: &Path,
        mesh: &RawMesh,
    ) -> Result<Vec<DVec3>, DescriptionError> {
        let place = |(i, v): (usize, &DVec3)| {
            let v = if self.y_up { DVec3::new(v.x, -v.z, v.y) } else { *v };
            let v = self.pose.apply(v * self.scale);
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
