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

    /// `self` after `inner`: `(a_from_b).then_inner(b_from_c)` is `a_from_c`.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translation: self.apply(inner.translation),
        }
    }
}

/// An even motion from one pose to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glide {
    from: Pose,
    step: DVec3,
    axis: DVec3,
    /// From −π to π.
    angle: f64,
}

impl Glide {
    /// On a straight line and turning evenly the short way.
    pub fn new(from: &Pose, to: &Pose) -> Self {
        let step = to.translation - from.translation;
        if from.rotation == to.rotation {
            return Self { from: *from, step, axis: DVec3::Z, angle: 0.0 };
        }
        let turn = DQuat::from_mat3(&(to.rotation * from.rotation.transpose())).normalize();
        let (axis, angle) = turn.to_axis_angle();
        // Angles come from 0 to 2π; the short way round is at most half a turn.
        Self { from: *from, step, axis, angle: if angle > PI { angle - TAU } else { angle } }
    }

    /// True if nothing moves.
    pub fn is_still(&self) -> bool {
        self.step == DVec3::ZERO && self.angle == 0.0
    }

    /// The pose after a share of the motion: at 0 the first to the bit, and beyond 1 things go on.
    pub fn at(&self, share: f64) -> Pose {
        let translation = self.from.translation + self.step * share;
        if self.angle == 0.0 || share == 0.0 {
            return Pose { translation, ..self.from };
        }
        let turn = DMat3::from_axis_angle(self.axis, self.angle * share);
        Pose { rotation: turn * self.from.rotation, translation }
    }
}
