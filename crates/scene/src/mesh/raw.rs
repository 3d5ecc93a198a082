//! A mesh as its file gives it, and the fault of one that cannot be used.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use sightline_files::Note;

/// Directions of a file's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// x forward, y left, z up, as here.
    ZUp,
    /// x forward, y up, z right, as Blender writes a world whose x is forward.
    YUp,
    /// x left, y up, z forward, as the specification of glTF has it.
    ZForward,
}

impl Axes {
    /// Axes by the word for them in a scene file, or in the extras of a glTF asset.
    pub fn of(word: &str) -> Option<Self> {
        match word {
            "z-up" => Some(Self::ZUp),
            "y-up" => Some(Self::YUp),
            "z-forward" => Some(Self::ZForward),
            _ => None,
        }
    }

    /// A position in metres forward, left and up.
    pub(super) fn turn(self, v: DVec3) -> DVec3 {
        match self {
            Self::ZUp => v,
            Self::YUp => DVec3::new(v.x, -v.z, v.y),
            Self::ZForward => DVec3::new(v.z, v.x, v.y),
        }
    }
}

/// Largest mesh file or buffer, in bytes.
pub(super) const MAX_FILE: u64 = 1 << 30;

/// Most triangles of a mesh, and of a scene.
pub const MOST_TRIANGLES: usize = 10_000_000;

/// Ending of a file's name, in small letters.
pub(super) fn extension(file: &Path) -> String {
    file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// A mesh as its file gives it, before scale, axes and classes.
#[derive(Debug, Default)]
pub struct RawMesh {
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) faces: Vec<[u32; 3]>,
    /// Index into `materials`, one a face.
    pub face_material: Vec<u32>,
    /// Names (OBJ, glTF) or labels (PLY) in use; `None` for faces without one.
    pub materials: Vec<Option<String>>,
    /// Index in `materials` by name: a search would take time with faces × materials.
    #[cfg_attr(not(feature = "mesh"), allow(dead_code))]
    pub(super) by_name: HashMap<Option<String>, u32>,
    /// The mesh file and its buffers.
    pub files: Vec<PathBuf>,
    /// Parts of the file that were passed over.
    pub notes: Vec<Note>,
    /// Axes that the file itself names.
    pub(super) axes: Option<Axes>,
}

#[cfg(feature = "mesh")]
impl RawMesh {
    /// Index of the material called `name`, added where it is new.
    pub(super) fn material(&mut self, name: Option<&str>) -> u32 {
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
    pub(super) fn triangle(&mut self, face: [u32; 3], material: u32) -> Result<(), String> {
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
    pub(super) fn drop_unused(&mut self) {
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
pub(super) struct Fault {
    /// Line, vertex, face or header entry.
    pub(super) element: String,
    pub(super) problem: String,
}

impl Fault {
    pub(super) fn new(element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { element: element.into(), problem: problem.into() }
    }
}
