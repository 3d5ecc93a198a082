//! Rigid transforms.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat, DVec3};

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

    /// `share` of the way to another pose, on a straight line and turning evenly the short way; 0 is `self`
    /// to the bit, and beyond 1 things go on.
    pub fn toward(&self, other: &Self, share: f64) -> Self {
        if share == 0.0 || self == other {
            return *self;
        }
        let (axis, angle) =
            DQuat::from_mat3(&(other.rotation * self.rotation.transpose())).to_axis_angle();
        // Angles come from 0 to 2π; the short way round is at most half a turn.
        let angle = if angle > PI { angle - TAU } else { angle };
        let turn = DMat3::from_axis_angle(axis, angle * share);
        let translation = self.translation + (other.translation - self.translation) * share;
        Self { rotation: turn * self.rotation, translation }
    }

    /// `self` after `inner`: `(a_from_b).then_inner(b_from_c)` is `a_from_c`.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translation: self.apply(inner.translation),
        }
    }
}
