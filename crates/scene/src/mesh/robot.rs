//! Robots that scenes name: their file, and the shapes of their links.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::MeshFault;
use lidar_cast::geom::Pose;
use sightline_files::json::{DescriptionError, Location, read_text};

/// Largest robot file, in bytes.
const MAX_FILE: u64 = 64 << 20;

/// Shape of a link.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub enum Geometry {
    /// Edges along x, y, z in metres; the middle is the origin.
    Box(DVec3),
    /// Radius and length along z in metres; the middle is the origin.
    Cylinder(f64, f64),
    /// Radius in metres.
    Sphere(f64),
    /// A file, and metres a unit along its axes.
    Mesh(PathBuf, DVec3),
}

/// A shape of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotPart {
    /// Shape in a frame of its own.
    pub geometry: Geometry,
    /// Takes the shape's frame to the root link's frame.
    pub root_from_part: Pose,
}

/// Angles of an `<origin>`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub struct OriginAngles {
    /// The joint or link that has it, in words.
    pub of: String,
    /// Roll, pitch and yaw in radians.
    pub angles: [f64; 3],
}

/// Shapes of a robot's links, with all joints at rest.
#[derive(Debug, Default)]
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub struct RobotShapes {
    /// In the order of the file.
    pub parts: Vec<RobotPart>,
    /// Angles of all origins that count.
    pub origins: Vec<OriginAngles>,
    /// Names of links that have shapes of the other kind only, and so are missing among the parts.
    pub missing: Vec<String>,
}

/// A URDF, and which of its shapes are meant.
pub struct RobotFile<'a> {
    /// The file.
    pub file: &'a Path,
    /// Folder that holds the packages of `package://`.
    pub packages: Option<&'a Path>,
    /// `visual` or `collision`.
    pub tag: &'a str,
}

impl RobotFile<'_> {
    /// The shapes of all links but those called `without`.
    ///
    /// # Errors
    /// A file that is no URDF of known shapes; an error names the link or joint, and `at`.
    pub fn parts(
        &self,
        at: &Location,
        without: &[String],
    ) -> Result<RobotShapes, DescriptionError> {
        let fault = |fault: MeshFault| DescriptionError::Mesh {
            at: Box::new(at.clone()),
            mesh: self.file.to_owned(),
            element: fault.element,
            problem: fault.problem,
        };
        let text = read_text(self.file, MAX_FILE).map_err(|error| match error {
            DescriptionError::Read { source, .. } => fault(MeshFault::new(
                "file",
                format!("cannot be read: {source}; name a URDF from the folder of the description"),
            )),
            other => other.of_file(at.clone()),
        })?;
        self.read(&text, without).map_err(fault)
    }

    #[cfg(feature = "mesh")]
    fn read(&self, text: &str, without: &[String]) -> Result<RobotShapes, MeshFault> {
        let folder = self.file.parent().unwrap_or(Path::new(""));
        let Self { packages, tag, .. } = *self;
        super::urdf::Robot { text, folder, packages, tag, without }.parts()
    }

    #[cfg(not(feature = "mesh"))]
    fn read(&self, _: &str, _: &[String]) -> Result<RobotShapes, MeshFault> {
        let _ = self.packages;
        Err(MeshFault::new("file", "cannot be read: this build is without the feature `mesh`"))
    }
}
