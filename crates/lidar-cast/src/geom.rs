//! Rigid transforms, boxes, outlines and triangle soups.
//!
//! Frame of every coordinate: ISO 8855 (x forward, y left, z up), right-handed, in metres; angles in
//! radians. Transforms are `f64`; triangles are `f32`, in the ego frame or in that of a rigid part whose
//! origin is near, so that world coordinates of any size have been rebased before they are rounded.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DQuat, DVec3, Vec3};

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

/// Axis-aligned box, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing: growing it by anything gives that thing.
    pub(crate) const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Grows the box to hold `point`.
    pub(crate) fn grow(&mut self, point: Vec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// Grows the box to hold `other`.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Half the surface area in square metres; 0 for the empty box.
    pub(crate) fn half_area(&self) -> f32 {
        let size = (self.max - self.min).max(Vec3::ZERO);
        size.x * size.y + size.y * size.z + size.z * size.x
    }
}

/// Triangles with one semantic class each, in the ego frame or a part's own frame, in metres.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TriangleSoup {
    /// Corner positions `[V]`.
    pub vertices: Vec<[f32; 3]>,
    /// Vertex indices `[F]`; a face's index is its triangle id (`prim`) in a frame, or in a tree.
    pub faces: Vec<[u32; 3]>,
    /// Index into the scene's class names `[F]`.
    pub face_class: Vec<u16>,
}

impl TriangleSoup {
    /// The three corners of face `prim`.
    pub fn corners(&self, prim: u32) -> [[f32; 3]; 3] {
        self.faces[prim as usize].map(|v| self.vertices[v as usize])
    }

    /// Appends every triangle of `other`; its face ids move up by the faces already here.
    pub fn append(&mut self, other: &Self) {
        let base = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.faces.extend(other.faces.iter().map(|f| f.map(|v| v + base)));
        self.face_class.extend_from_slice(&other.face_class);
    }
}

/// Twice the signed area of a triangle; positive when a, b, c turn counter-clockwise.
pub fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Two sides of a closed outline that cross, touch, or run back over each other, by the corners where they begin;
/// `None` of a simple polygon. No corner is the same as the next one.
pub fn crossing(corners: &[[f64; 2]]) -> Option<(usize, usize)> {
    let n = corners.len();
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    pairs.into_iter().find(|&(i, j)| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        let (c, d) = (corners[j], corners[(j + 1) % n]);
        let (tip, p, q) = match (j == i + 1, i == 0 && j == n - 1) {
            (true, _) => (b, a, d),
            (_, true) => (a, b, c),
            _ => return touch(a, b, c, d),
        };
        // Neighbours share a corner.
        turn(tip, p, q) == 0.0
            && (p[0] - tip[0]) * (q[0] - tip[0]) + (p[1] - tip[1]) * (q[1] - tip[1]) > 0.0
    })
}

/// True if the closed segments a–b and c–d share a point.
fn touch(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> bool {
    let sides = [turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)];
    if sides[0] * sides[1] < 0.0 && sides[2] * sides[3] < 0.0 {
        return true;
    }
    let within = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (0..2).all(|k| p[k].min(q[k]) <= r[k] && r[k] <= p[k].max(q[k]))
    };
    (sides[0] == 0.0 && within(a, b, c))
        || (sides[1] == 0.0 && within(a, b, d))
        || (sides[2] == 0.0 && within(c, d, a))
        || (sides[3] == 0.0 && within(c, d, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_that_cross_are_named() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(crossing(&square), None);
        let bow = [square[0], square[2], square[1], square[3]];
        assert_eq!(crossing(&bow), Some((0, 2)));
        // A side that ends on another one, and one that runs back.
        assert!(crossing(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]]).is_some());
        assert_eq!(crossing(&[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0]]), Some((0, 1)));
    }
}
