//! Rigid transforms.

use glam::{DMat3, DVec3};

/// Rigid transform `p ↦ rotation · p + translation`, in metres.
///
/// A pose named `a_from_b` takes coordinates in frame b to coordinates in frame a.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Orthonormal, right-handed.
    pub rotation: DMat3,
    /// Position of the origin of the inner frame, seen from the outer one.
    pub translation: DVec3,
}

impl Pose {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// `R = Rz(yaw) · Ry(pitch) · Rx(roll)`, angles in radians.
    pub fn new(translation: DVec3, roll: f64, pitch: f64, yaw: f64) -> Self {
        let rotation = DMat3::from_rotation_z(yaw)
            * DMat3::from_rotation_y(pitch)
            * DMat3::from_rotation_x(roll);
        Self { rotation, translation }
    }

    /// Takes a point from the inner frame to the outer one.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The transform back.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// `self` after `inner`: `(a_from_b).then_inner(b_from_c)` is `a_from_c`.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translation: self.apply(inner.translation),
        }
    }
}
