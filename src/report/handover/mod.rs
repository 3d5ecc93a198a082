//! The drawing of a rig for others: from above, from the right and from the front at one scale, with mounts, fields of
//! view and the blind zone on the ground.
//!
//! | file | holds |
//! |---|---|
//! | `views` | the rig in each view, in metres |
//! | `sheet` | scale and places of the views on the sheet |
//! | `draw` | a view on the sheet, with its measures |
//! | `legend` | words beside the views |

mod draw;
mod sheet;

#[cfg(test)]
mod tests;

use super::drawing::Drawing;
use crate::geom::Pose;
use crate::near_field::{Footprint, NearField};
use crate::shared::FieldOfView;
use crate::vehicle::SensorPose;

/// A LiDAR as it is drawn.
pub(crate) struct DrawnLidar {
    pub pose: SensorPose,
    /// The pose after a turn by the phase.
    pub ego_from_sensor: Pose,
    pub view: FieldOfView,
    /// Words for its model and its mount; may be empty.
    pub model: String,
    pub mount: String,
}

/// A box around a mount, in the ego frame, metres.
pub(crate) struct DrawnMount {
    /// May be empty.
    pub name: String,
    pub corners: [[f64; 3]; 2],
}

/// A rig with all that its drawing shows.
pub(crate) struct DrawnRig<'a> {
    /// Names of vehicle and placement.
    pub vehicle: &'a str,
    pub placement: &'a str,
    /// Triangles of the own body in the ego frame, metres.
    pub body: &'a [[[f32; 3]; 3]],
    pub lidars: Vec<DrawnLidar>,
    pub mounts: Vec<DrawnMount>,
    /// Outline on the ground and blind zone; or a sentence that says why there is none.
    pub near: Result<(&'a Footprint, &'a NearField), String>,
}

impl DrawnRig<'_> {
    /// The drawing on a sheet of A3, across.
    pub(crate) fn drawing(&self) -> Drawing {
        let views = sheet::Views::of(self);
        let sheet = sheet::Sheet::of(&views, self.lidars.len());
        let mut drawing = Drawing::new(
            sheet::A3,
            &format!(
                "{}, {}: LiDARs from above, from the right and from the front",
                self.vehicle, self.placement
            ),
        );
        draw::top(&mut drawing, self, &views, &sheet);
        draw::side(&mut drawing, self, &views, &sheet);
        draw::front(&mut drawing, self, &views, &sheet);
        draw::scale_bar(&mut drawing, &sheet);
        draw::draw(&mut drawing, self, &sheet);
        drawing
    }
}
