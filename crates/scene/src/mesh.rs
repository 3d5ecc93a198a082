//! Mesh files: OBJ, PLY, STL and glTF, each read into the same plain triangles, and their place in the owner's frame; robots.

#[cfg(feature = "mesh")]
mod gltf;
#[cfg(feature = "mesh")]
mod gltf_json;
#[cfg(feature = "mesh")]
mod gltf_walk;
#[cfg(feature = "mesh")]
mod obj;
#[cfg(feature = "mesh")]
mod ply;
#[cfg(feature = "mesh")]
mod ply_file;
#[cfg(feature = "mesh")]
mod polygon;
#[cfg(feature = "mesh")]
mod stl;
#[cfg(feature = "mesh")]
#[cfg(test)]
mod tests;
#[cfg(feature = "mesh")]
mod urdf;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use lidar_cast::geom::Pose;
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, DescriptionError, Location, read_limited, read_text};

/// Reads the mesh named at `at`; the ending of its name tells the format.
pub(crate) fn load(at: &Location, file: &Path) -> Checked<RawMesh> {
    let fault = |fault: MeshFault| fault.of(at, file);
    let read = reader(&extension(file)).map_err(fault)?;
    let bytes = read_limited(file, MAX_FILE).map_err(|error| unread(error, at, file, "mesh"))?;
    let dir = file.parent().unwrap_or(Path::new(""));
    let mut mesh = read(&bytes, dir).map_err(fault)?;
    mesh.files.push(file.to_owned());
    check_mesh(&mesh).map_err(fault)?;
    mesh.drop_unused();
    for note in &mut mesh.notes {
        let text = format!("{at}: {}: {}", file.display(), note.text());
        *note = if note.is_doubt() { Note::doubt(text) } else { Note::fact(text) };
    }
    Ok(mesh)
}

/// Error of a `kind` of file that cannot be read.
fn unread(error: DescriptionError, at: &Location, file: &Path, kind: &str) -> DescriptionError {
    match error {
        DescriptionError::Read { source, .. } => {
            let problem = format!(
                "cannot be read: {source}; name a {kind} from the folder of the description"
            );
            MeshFault::new("file", problem).of(at, file)
        }
        other => other.of_file(at.clone()),
    }
}

/// Reads the bytes of a mesh file; buffers of a glTF lie in the folder.
type ReadMesh = fn(&[u8], &Path) -> Parsed<RawMesh>;

#[cfg(feature = "mesh")]
fn reader(extension: &str) -> Parsed<ReadMesh> {
    match extension {
        "obj" => Ok(|bytes, _| obj::read(bytes)),
        "ply" => Ok(|bytes, _| ply::read(bytes)),
        "stl" => Ok(|bytes, _| stl::read(bytes)),
        "gltf" | "glb" => Ok(gltf::read),
        "dae" | "step" | "stp" | "iges" | "igs" | "fbx" | "blend" => Err(MeshFault::new(
            "name",
            "ends in none of .obj, .ply, .stl, .gltf, .glb; docs/own-mesh.md has a converter of three lines",
        )),
        "urdf" | "xacro" => Err(MeshFault::new(
            "name",
            "is a robot description, not a mesh; name it under the key `urdf` in place of `mesh`",
        )),
        _ => Err(MeshFault::new(
            "name",
            "ends in none of .obj, .ply, .stl, .gltf, .glb; convert it to one of these",
        )),
    }
}

#[cfg(not(feature = "mesh"))]
fn reader(_: &str) -> Parsed<ReadMesh> {
    Err(MeshFault::new("file", "cannot be read: this build is without the feature `mesh`"))
}

/// Checks for at least one triangle, indices in range, and finite corners.
fn check_mesh(mesh: &RawMesh) -> Parsed<()> {
    if mesh.faces.is_empty() {
        return Err(MeshFault::new(
            "file",
            "holds no triangle; export its faces, not points or lines alone",
        ));
    }
    let count = mesh.vertices.len();
    for (i, face) in mesh.faces.iter().enumerate() {
        for &v in face {
            let Some(corner) = mesh.vertices.get(v as usize) else {
                let problem = format!("refers to vertex {v}, there are {count}");
                return Err(MeshFault::new(format!("face {i}"), problem));
            };
            if !corner.is_finite() {
                let problem =
                    format!("{} is not a finite position; export it again", exponents(*corner));
                return Err(MeshFault::new(format!("vertex {v}"), problem));
            }
        }
    }
    Ok(())
}

/// A position with exponents: 1e300 would have 301 digits.
fn exponents(v: DVec3) -> String {
    format!("[{:e}, {:e}, {:e}]", v.x, v.y, v.z)
}

/// Directions of a file's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MeshAxes {
    /// x forward, y left, z up, as here.
    ZUp,
    /// x forward, y up, z right, as Blender writes a world whose x is forward.
    YUp,
    /// x left, y up, z forward, as the specification of glTF has it.
    ZForward,
}

impl MeshAxes {
    /// Axes by the word for them in a scene file, or in the extras of a glTF asset.
    fn of(word: &str) -> Option<Self> {
        match word {
            "z-up" => Some(Self::ZUp),
            "y-up" => Some(Self::YUp),
            "z-forward" => Some(Self::ZForward),
            _ => None,
        }
    }

    /// A position in metres forward, left and up.
    fn turn(self, v: DVec3) -> DVec3 {
        match self {
            Self::ZUp => v,
            Self::YUp => DVec3::new(v.x, -v.z, v.y),
            Self::ZForward => DVec3::new(v.z, v.x, v.y),
        }
    }
}

/// Names and unknown statements that a note tells.
#[cfg(feature = "mesh")]
const MOST_TOLD: usize = 8;
/// Largest mesh file or buffer, in bytes.
const MAX_FILE: u64 = 1 << 30;

/// Most triangles of a mesh, and of a scene.
pub(crate) const MOST_TRIANGLES: usize = 10_000_000;

/// Ending of a file's name, in small letters.
fn extension(file: &Path) -> String {
    file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// A mesh as its file gives it, before scale, axes and classes.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct RawMesh {
    vertices: Vec<DVec3>,
    pub(crate) faces: Vec<[u32; 3]>,
    /// Index into `materials`, one a face.
    pub face_material: Vec<u32>,
    /// Names (OBJ, glTF) or labels (PLY) in use; `None` for faces without one.
    pub materials: Vec<Option<String>>,
    /// Index in `materials` by name: a search would take time with faces × materials.
    #[cfg_attr(not(feature = "mesh"), allow(dead_code))]
    by_name: HashMap<Option<String>, u32>,
    /// The mesh file and its buffers.
    pub files: Vec<PathBuf>,
    /// Parts of the file that were passed over.
    pub notes: Vec<Note>,
    /// Axes that the file itself names.
    axes: Option<MeshAxes>,
}

#[cfg(feature = "mesh")]
impl RawMesh {
    /// Index of the material called `name`, added where it is new.
    fn material(&mut self, name: Option<&str>) -> u32 {
        let name = name.map(str::to_owned);
        *self.by_name.entry(name).or_insert_with_key(|name| {
            self.materials.push(name.clone());
            self.materials.len() as u32 - 1
        })
    }

    /// Adds a triangle.
    ///
    /// # Errors
    /// There are [`MOST_TRIANGLES`] already.
    fn triangle(&mut self, face: [u32; 3], material: u32) -> Result<(), String> {
        if self.faces.len() == MOST_TRIANGLES {
            return Err(format!("is one too many: {MOST_TRIANGLES} triangles may be there"));
        }
        self.faces.push(face);
        self.face_material.push(material);
        Ok(())
    }
}

impl RawMesh {
    /// Drops the vertices that no face uses: they have no surface, and may be anywhere.
    fn drop_unused(&mut self) {
        let mut place = vec![u32::MAX; self.vertices.len()];
        self.faces.as_flattened().iter().for_each(|&v| place[v as usize] = 0);
        if !place.contains(&u32::MAX) {
            return;
        }
        let mut kept = 0;
        for (old, new) in place.iter_mut().enumerate().filter(|(_, new)| **new == 0) {
            *new = kept;
            self.vertices[kept as usize] = self.vertices[old];
            kept += 1;
        }
        self.vertices.truncate(kept as usize);
        self.faces.as_flattened_mut().iter_mut().for_each(|v| *v = place[*v as usize]);
    }
}

/// Fault of a mesh file and the element that has it.
#[derive(Debug)]
struct MeshFault {
    /// Line, vertex, face or header entry.
    element: String,
    problem: String,
}

/// Result of a reader of mesh files.
type Parsed<T> = Result<T, MeshFault>;

impl MeshFault {
    fn new(element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { element: element.into(), problem: problem.into() }
    }

    /// Names the place of a description and the file that it names.
    fn of(self, at: &Location, file: &Path) -> DescriptionError {
        let Self { element, problem } = self;
        DescriptionError::Mesh { at: Box::new(at.clone()), mesh: file.to_owned(), element, problem }
    }
}

/// Axes, scale and pose of a mesh, from the description that names its file.
pub(crate) struct Placing {
    /// Axes that the description names.
    axes: Option<MeshAxes>,
    /// Metres a unit along the axes of the file.
    scale: DVec3,
    /// Takes the scaled mesh to the frame of its owner.
    pub pose: Pose,
    /// True where a description may name `axes`: a mesh of a URDF has none.
    takes_axes: bool,
}

impl Placing {
    /// Checks the keys `axes`, `scale`, `translate` and `roll`, `pitch`, `yaw` of a mesh.
    pub(crate) fn new(
        at: &Location,
        axes: Option<&str>,
        scale: Option<f64>,
        translate: [f64; 3],
        [roll, pitch, yaw]: [f64; 3],
    ) -> Checked<Self> {
        let axes = axes.map(|word| {
            let wanted = "\"z-up\", \"y-up\" (x forward) or \"z-forward\" (y up, x left)";
            MeshAxes::of(word).ok_or_else(|| bad(&at.key("axes"), format!("{word:?}"), wanted))
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
        let (scale, pose) = (DVec3::splat(scale), Pose::new(translate.into(), roll, pitch, yaw));
        Ok(Self { axes, scale, pose, takes_axes: true })
    }

    /// Axes as the file has them, and metres a unit along each.
    pub(crate) fn scaled(scale: DVec3) -> Self {
        Self { axes: None, scale, pose: Pose::IDENTITY, takes_axes: false }
    }

    /// A note on the forward axis of a glTF that neither the description nor the file names.
    pub(crate) fn note(&self, at: &Location, file: &Path, mesh: &RawMesh) -> Option<Note> {
        let open = is_gltf(file) && self.axes.or(mesh.axes).is_none();
        let mend = match self.takes_axes {
            true => {
                "`axes` decides: \"y-up\" for x, \"z-forward\" for z as the specification of glTF has it"
            }
            false => {
                "where it is z, as the specification of glTF has it, turn the <origin> of the shape in the URDF by a \
                 yaw of 1.5708"
            }
        };
        open.then(|| {
            Note::fact(format!(
                "{at}: {} does not say which way is forward; x is taken, as Blender writes a world. {mend}",
                file.display()
            ))
        })
    }

    /// The vertices of a mesh in its owner's frame, in metres.
    pub(crate) fn vertices(
        &self,
        at: &Location,
        file: &Path,
        mesh: &RawMesh,
    ) -> Checked<Vec<DVec3>> {
        let axes = self.axes.or(mesh.axes).unwrap_or(match is_gltf(file) {
            true => MeshAxes::YUp,
            false => MeshAxes::ZUp,
        });
        let place = |(i, v): (usize, &DVec3)| {
            let v = self.pose.apply(axes.turn(*v * self.scale));
            if v.abs().max_element() <= check::MAX_METRES {
                return Ok(v);
            }
            let problem = format!(
                "lies at {}, further than 1e9 m from the origin; move the mesh or give a smaller `scale`",
                exponents(v)
            );
            Err(MeshFault::new(format!("vertex {i}"), problem).of(at, file))
        };
        mesh.vertices.iter().enumerate().map(place).collect()
    }
}

fn is_gltf(file: &Path) -> bool {
    matches!(extension(file).as_str(), "gltf" | "glb")
}

/// Largest robot file, in bytes.
const MAX_ROBOT: u64 = 64 << 20;

/// Shape of a robot's link.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub(crate) enum Geometry {
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
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub(crate) struct RobotPart {
    /// Shape in a frame of its own.
    pub geometry: Geometry,
    /// Takes the shape's frame to the root link's frame.
    pub root_from_part: Pose,
}

/// Angles of an `<origin>`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub(crate) struct OriginAngles {
    /// The joint or link that has it, in words.
    pub of: String,
    /// Roll, pitch and yaw in radians.
    pub angles: [f64; 3],
}

/// Shapes of a robot's links, with all joints at rest.
#[derive(Debug)]
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub(crate) struct RobotShapes {
    /// In the order of the file.
    pub parts: Vec<RobotPart>,
    /// Angles of all origins that count.
    pub origins: Vec<OriginAngles>,
    /// Names of links that have shapes of the other kind only, and so are missing among the parts.
    pub missing: Vec<String>,
    /// Joints that cannot stand at 0, with the values at which they stand, in words.
    pub moved: Vec<String>,
    /// Elements that bring another file, which are not read.
    pub includes: usize,
    /// Elements that no reader of URDF knows where they stand, in words.
    pub strange: Vec<String>,
}

/// A URDF, and which of its shapes are meant.
#[cfg_attr(not(feature = "mesh"), allow(dead_code))]
pub(crate) struct RobotFile<'a> {
    /// The file.
    pub file: &'a Path,
    /// Folder that holds the packages of `package://`.
    pub packages: Option<&'a Path>,
    /// `visual` or `collision`.
    pub tag: &'a str,
    /// Names of links that are left out.
    pub without: &'a [String],
    /// Values of joints that do not stand at rest, radians or metres.
    pub joints: &'a [(String, f64)],
}

impl RobotFile<'_> {
    /// Reads the shapes.
    ///
    /// # Errors
    /// A file that is no URDF of known shapes; an error names the link or joint, and `at`.
    pub(crate) fn parts(&self, at: &Location) -> Checked<RobotShapes> {
        let text = read_text(self.file, MAX_ROBOT);
        let text = text.map_err(|error| unread(error, at, self.file, "URDF"))?;
        self.shapes(&text).map_err(|fault| fault.of(at, self.file))
    }

    #[cfg(not(feature = "mesh"))]
    fn shapes(&self, _: &str) -> Parsed<RobotShapes> {
        Err(MeshFault::new("file", "cannot be read: this build is without the feature `mesh`"))
    }
}
