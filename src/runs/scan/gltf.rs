//! A frame with the points of its scan as binary glTF, beside the data set.

use std::sync::Arc;

use super::request::ScanRequest;
use crate::export::GltfView;
use crate::runs::{RunError, Watcher, glb};
use crate::scan::{ScanError, Scanner, Stage};
use crate::scene::Scene;
use crate::vehicle::Placement;

impl ScanRequest {
    /// Checks that `--gltf` shows one frame of one scene, and that its file can be written.
    pub(super) fn check_gltf(
        &self,
        scenes: &[Scene],
        placements: &[Placement],
    ) -> Result<(), RunError> {
        let (Some((path, frame)), [scene, ..]) = (&self.gltf, scenes) else { return Ok(()) };
        if scenes.len() > 1 || placements.len() > 1 {
            return Err(RunError::Usage(format!(
                "--gltf {}: shows one scene and one placement; give one of each",
                path.display()
            )));
        }
        let frames = scene.frame_count();
        if *frame as usize >= frames {
            return Err(RunError::Usage(format!(
                "--frame {}: the scene `{}` has frames 0 to {}",
                frame,
                scene.name(),
                frames - 1
            )));
        }
        glb::check(Some(path))
    }

    /// Writes the frame of `--gltf` with the points of its scan, cast into the trees that `stage` gives.
    pub(super) fn write_gltf(
        &self,
        scene: &Scene,
        placement: &Placement,
        stage: impl FnOnce() -> Result<Arc<Stage>, ScanError>,
        watcher: &dyn Watcher,
    ) -> Result<(), RunError> {
        let Some((path, frame)) = &self.gltf else { return Ok(()) };
        let frame = *frame as usize;
        let scan = Scanner::on(stage()?, scene, placement, &self.scanning)?.scan(frame);
        let points: Vec<_> = scan.points().map(|point| (point.class, point.position)).collect();
        let placements = std::slice::from_ref(placement);
        let view = GltfView { scene, frame, placements, points: &points };
        glb::write(Some(path), watcher, &view)
    }
}
