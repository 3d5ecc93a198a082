//! The scene file that is written, and its mesh beside it.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::files::{FileError, is_sink, target, will_read, writable_file, write_pair};
use crate::geom::TriangleSoup;
use crate::runs::{RunError, Watcher};
use crate::worlds::write_ply;

/// A scene file to be written, with its mesh beside it.
pub(super) struct SceneOutput<'a> {
    out: &'a Path,
    mesh: PathBuf,
}

impl<'a> SceneOutput<'a> {
    /// Checks that both files can be written, and that nothing is lost that nobody has named, where `inputs` are read.
    pub fn new(out: &'a Path, inputs: Option<&Path>) -> Result<Self, RunError> {
        let mesh = out.with_extension("ply");
        if mesh == out {
            return Err(RunError::Usage(format!(
                "{}: is the name of the mesh; give the scene the ending .json",
                out.display()
            )));
        }
        if is_sink(&target(out)?) {
            return Err(RunError::Usage(format!(
                "{}: is no regular file, and the mesh is to stand beside it; name a file",
                out.display()
            )));
        }
        inputs.iter().for_each(|input| will_read(input));
        writable_file(out)?;
        let target = Self { out, mesh };
        let name = target.name();
        if name.contains(char::is_control) {
            return Err(RunError::Usage(format!(
                "{name:?}: is to be the name of the scene, which has no control characters; name another file"
            )));
        }
        target.check_mesh()?;
        Ok(target)
    }

    /// Refuses to replace a mesh that the scene at `out` does not name.
    fn check_mesh(&self) -> Result<(), RunError> {
        let named = |text: String| text.contains(&Value::from(self.mesh_name()).to_string());
        if !self.mesh.exists() || !self.out.exists() {
            return Ok(());
        }
        match std::fs::read_to_string(self.out).is_ok_and(named) {
            true => Ok(()),
            false => Err(self.mesh_is_there()),
        }
    }

    /// Refuses to replace a mesh without a scene, unless it equals the new one: a killed run left that.
    fn check_mesh_without_scene(&self, soup: &TriangleSoup) -> Result<(), RunError> {
        if self.out.exists() || !self.mesh.exists() {
            return Ok(());
        }
        let mut new = Vec::new();
        write_ply(soup, &mut new).map_err(RunError::io(&self.mesh))?;
        match std::fs::read(&self.mesh).is_ok_and(|old| old == new) {
            true => Ok(()),
            false => Err(self.mesh_is_there()),
        }
    }

    fn mesh_is_there(&self) -> RunError {
        RunError::Usage(format!(
            "{}: is there and would be overwritten by the scene's mesh; name another scene than {}, or move the \
             mesh away",
            self.mesh.display(),
            self.out.display()
        ))
    }

    /// Name of the scene, taken from its file.
    pub fn name(&self) -> String {
        self.out.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Name of the mesh as the scene has it.
    pub fn mesh_name(&self) -> String {
        self.mesh.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Writes both and says so.
    pub fn write(
        &self,
        soup: &TriangleSoup,
        scene: &Value,
        watcher: &dyn Watcher,
    ) -> Result<(), RunError> {
        let mesh = &self.mesh;
        self.check_mesh_without_scene(soup)?;
        write_pair(
            (mesh, |file: &mut BufWriter<&mut File>| {
                write_ply(soup, file).map_err(RunError::io(mesh))
            }),
            (self.out, |file: &mut BufWriter<&mut File>| {
                serde_json::to_writer_pretty(&mut *file, scene)
                    .map_err(|source| FileError::Json { path: self.out.to_owned(), source })?;
                file.write_all(b"\n").map_err(RunError::io(self.out))
            }),
        )?;
        watcher.note(&format!(
            "{} triangles in {}, scene in {}",
            soup.faces.len(),
            mesh.display(),
            self.out.display()
        ));
        Ok(())
    }
}
