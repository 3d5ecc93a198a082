//! The links of a URDF as triangles.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::Builder;
use crate::mesh::{Geometry, Placing, RobotFile};
use crate::scene::description::UrdfDescription;
use crate::scene::solid::Solid;
use lidar_cast::geom::Pose;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Location};

/// Corners of a cylinder's base, and of a sphere's circles of latitude.
const SIDES: u32 = 32;
/// Bands of a sphere from pole to pole.
const BANDS: u32 = 16;

impl Builder<'_> {
    /// Triangles of a robot's links, with all joints at rest.
    pub(super) fn urdf(
        &mut self,
        at: &Location,
        urdf: &UrdfDescription,
        class: u16,
    ) -> Result<Solid, DescriptionError> {
        let UrdfDescription { translate, roll, pitch, yaw, .. } = *urdf;
        let placing = Placing::new(at, None, None, translate, [roll, pitch, yaw])?;
        let tag = urdf.geometry.as_deref().unwrap_or("visual");
        if !["visual", "collision"].contains(&tag) {
            let wanted = "\"visual\" or \"collision\"";
            return Err(bad(&at.key("geometry"), format!("{tag:?}"), wanted));
        }
        let file = self.dir.join(&urdf.file);
        let packages = urdf.packages.as_ref().map(|packages| self.dir.join(packages));
        let robot = RobotFile { file: &file, packages: packages.as_deref(), tag };
        let parts = robot.parts(at, &urdf.without)?;
        self.others.push(file.clone());
        let mut solid = Solid::default();
        for part in parts {
            let shape = self.part(at, &part.geometry, class)?;
            let count = self.triangles + (solid.faces.len() + shape.faces.len()) as u64;
            self.check_count(at, count)?;
            solid.append(&shape, &placing.pose().compose(&part.root_from_part));
        }
        match solid.vertices.iter().all(|v| v.abs().max_element() <= check::MAX_METRES) {
            true => Ok(solid),
            false => {
                let wanted = "a robot within 1e9 m of the origin; correct its origins and scales";
                Err(bad(&at.key("file"), format!("{:?}", urdf.file), wanted))
            }
        }
    }

    fn part(
        &mut self,
        at: &Location,
        geometry: &Geometry,
        class: u16,
    ) -> Result<Solid, DescriptionError> {
        Ok(match geometry {
            Geometry::Box(edges) => Solid::cuboid(DVec3::ZERO, *edges, 0.0, class),
            Geometry::Cylinder(radius, length) => {
                let foot = DVec3::Z * (-length / 2.0);
                Solid::cylinder(foot, *radius, *length, SIDES, class)
            }
            Geometry::Sphere(radius) => Solid::sphere(*radius, [SIDES, BANDS], class),
            Geometry::Mesh(file, scale) => self.mesh_of_link(at, file, *scale, class)?,
        })
    }

    fn mesh_of_link(
        &mut self,
        at: &Location,
        file: &Path,
        scale: DVec3,
        class: u16,
    ) -> Result<Solid, DescriptionError> {
        let placing = Placing::scaled(scale, Pose::IDENTITY);
        let raw = self.raw(at, file, &placing)?;
        Ok(Solid {
            vertices: placing.vertices(at, file, &raw)?,
            faces: raw.faces.clone(),
            classes: vec![class; raw.faces.len()],
            ends: Vec::new(),
        })
    }

    /// Files that are no meshes.
    pub(super) fn other_files(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.others.iter().cloned()
    }
}
