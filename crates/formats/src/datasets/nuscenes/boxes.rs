//! Which box a point lies in.

use glam::DVec3;

use lidar_cast::geom::Pose;

/// A box in the frame of a scan.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct ScanBox {
    /// Takes the scan's frame to the box's own, whose origin is its middle.
    pub box_from_sensor: Pose,
    /// Half of its extents.
    pub half: DVec3,
}

impl ScanBox {
    /// True if a point lies in the box or on its surface.
    pub fn holds(&self, point: DVec3) -> bool {
        self.holds_within(point, 0.0)
    }

    /// True if a point lies in the box grown by `margin` metres on every side.
    pub fn holds_within(&self, point: DVec3, margin: f64) -> bool {
        self.box_from_sensor.apply(point).abs().cmple(self.half + margin).all()
    }
}
