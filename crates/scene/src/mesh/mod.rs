//! Mesh files: OBJ, PLY and glTF, each read into the same plain triangles.

#[cfg(feature = "mesh")]
mod gltf;
#[cfg(feature = "mesh")]
mod gltf_data;
#[cfg(feature = "mesh")]
mod gltf_walk;
#[cfg(feature = "mesh")]
mod obj;
mod placing;
#[cfg(feature = "mesh")]
mod ply;
#[cfg(feature = "mesh")]
mod ply_file;
#[cfg(feature = "mesh")]
mod polygon;
mod raw;

use std::path::Path;

use glam::DVec3;

use raw::{Fault, MAX_FILE, extension};
use sightline_files::Note;
use sightline_files::json::{DescriptionError, Place, read_limited};

pub use placing::Placing;
pub use raw::{MOST_TRIANGLES, RawMesh};

/// Reads the mesh named at `at`; the ending of its name tells the format.
pub fn load(at: &Place, file: &Path) -> Result<RawMesh, DescriptionError> {
    let fault = |f: Fault| DescriptionError::Mesh {
        at: Box::new(at.clone()),
        mesh: file.to_owned(),
        element: f.element,
        problem: f.problem,
    };
    let read = reader(&extension(file)).map_err(fault)?;
    let bytes = read_limited(file, MAX_FILE).map_err(|error| match error {
        DescriptionError::Read { source, .. } => fault(Fault::new(
            "file",
            format!("cannot be read: {source}; name a mesh from the folder of the description"),
        )),
        other => other.of_file(at.clone()),
    })?;
    let dir = file.parent().unwrap_or(Path::new(""));
    let mut mesh = read(&bytes, dir).map_err(fault)?;
    mesh.files.push(file.to_owned());
    check(&mesh).map_err(fault)?;
    mesh.drop_unused();
    for note in &mut mesh.notes {
        let text = format!("{at}: {}: {}", file.display(), note.text());
        *note = if note.is_doubt() { Note::doubt(text) } else { Note::fact(text) };
    }
    Ok(mesh)
}

/// Reads the bytes of a mesh file; buffers of a glTF lie in the folder.
type Reader = fn(&[u8], &Path) -> Result<RawMesh, Fault>;

/// The reader of files with an extension.
#[cfg(feature = "mesh")]
fn reader(extension: &str) -> Result<Reader, Fault> {
    match extension {
        "obj" => Ok(|bytes, _| obj::read(bytes)),
        "ply" => Ok(|bytes, _| ply::read(bytes)),
        "gltf" | "glb" => Ok(gltf::read),
        _ => Err(Fault::new("name", "ends in none of .obj, .ply, .gltf, .glb")),
    }
}

#[cfg(not(feature = "mesh"))]
fn reader(_: &str) -> Result<Reader, Fault> {
    Err(Fault::new("file", "cannot be read: this build is without the feature `mesh`"))
}

/// Checks for at least one triangle, indices in range, and finite corners.
fn check(mesh: &RawMesh) -> Result<(), Fault> {
    if mesh.faces.is_empty() {
        return Err(Fault::new(
            "file",
            "holds no triangle; export its faces, not points or lines alone",
        ));
    }
    let count = mesh.vertices.len();
    for (i, face) in mesh.faces.iter().enumerate() {
        for &v in face {
            let Some(corner) = mesh.vertices.get(v as usize) else {
                let problem = format!("refers to vertex {v}, there are {count}");
                return Err(Fault::new(format!("face {i}"), problem));
            };
            if !corner.is_finite() {
                let problem =
                    format!("{} is not a finite position; export it again", exponents(*corner));
                return Err(Fault::new(format!("vertex {v}"), problem));
            }
        }
    }
    Ok(())
}

/// A position with exponents: 1e300 would have 301 digits.
fn exponents(v: DVec3) -> String {
    format!("[{:e}, {:e}, {:e}]", v.x, v.y, v.z)
}

#[cfg(feature = "mesh")]
#[cfg(test)]
mod tests;
