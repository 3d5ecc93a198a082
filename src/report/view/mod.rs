//! The 3-D view of a page: things, voxels and beams of one scene, as plain data.
//!
//! | file | holds |
//! |---|---|
//! | `world` | shapes once, and the pose of each thing by frame |
//! | `sight` | voxels with information, and which layouts see them |
//! | `beams` | ends of the beams of each LiDAR |
//! | `pack` | all of it as one JSON header and one run of bytes |
//! | `view.js`, `gl.js` | the view itself, in the page |

pub(crate) mod sight;
mod world;

use crate::engine::{Backend, BackendError};
use crate::problem::{Problem, spread};
use crate::psog::Roi;
use crate::scene::Scene;
use crate::vehicle::Placement;
use world::{BeamEnds, Things};

pub use sight::{Gains, InformationView};

/// Frames that the slider goes through at most, on a page of one scene and on one of several.
const FRAMES: [u32; 2] = [12, 6];
/// Bytes that the voxels of a page may take, before base64 makes four of three.
const VOXEL_BYTES: usize = 1_500_000;
/// Most voxels that are drawn of all scenes of a page.
const VOXELS: usize = 60_000;

/// Data that the 3-D view of a placement shows in one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewData {
    scene: String,
    roi: Roi,
    classes: Vec<String>,
    /// Numbers of the frames shown.
    frames: Vec<usize>,
    frame_count: usize,
    placement: Placement,
    things: Things,
    sight: InformationView,
    beams: BeamEnds,
}

impl ViewData {
    /// View of `placement` and `baselines` in a scene whose problem is over all of its frames. A page holds
    /// `scenes` views, which share its room.
    ///
    /// # Errors
    /// See [`Backend::bitmaps`] and [`Backend::hits`].
    pub fn new(
        scene: &Scene,
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
        baselines: &[Placement],
        scenes: usize,
    ) -> Result<Self, BackendError> {
        let frames = spread(problem.frame_count(), Some(FRAMES[usize::from(scenes > 1)]));
        let mask = if placement.lidars.len() > 8 { 2 } else { 1 };
        let each = 7 + baselines.len() + mask * frames.len();
        let most = VOXELS.min(VOXEL_BYTES / each) / scenes;
        Ok(Self {
            scene: scene.name().to_owned(),
            roi: *problem.roi(),
            classes: problem.content().classes().to_vec(),
            frame_count: problem.frame_count(),
            things: Things::new(scene, &frames, scenes),
            sight: InformationView::new(problem, engine, placement, baselines, &frames, most)?,
            beams: BeamEnds::new(problem, engine, placement, &frames, scenes)?,
            placement: placement.clone(),
            frames,
        })
    }

    /// Name of the scene.
    pub fn scene(&self) -> &str {
        &self.scene
    }

    /// Numbers of the frames shown.
    pub fn frames(&self) -> &[usize] {
        &self.frames
    }

    /// Nats that the layouts gain, by class and by distance.
    pub fn gains(&self) -> &Gains {
        &self.sight.gains
    }

    /// Sentences on frames, things and voxels that the view leaves out.
    pub fn left_out(&self) -> Vec<String> {
        let (shown, all) = (self.frames.len(), self.frame_count);
        let frames =
            (shown < all).then(|| format!("The slider goes through {shown} of {all} frames."));
        frames.into_iter().chain(self.things.left_out()).chain(self.sight.left_out()).collect()
    }
}

#[cfg(test)]
mod tests;
