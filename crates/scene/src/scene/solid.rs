//! Triangles in `f64`, and the primitives that make them.

use glam::{DMat3, DVec3};

use super::polygon::triangulate;
use lidar_cast::geom::{Pose, TriangleSoup};
use lidar_cast::maths;

/// Triangles with a class each, in the frame of their owner: world, actor or ego.
///
/// Coordinates are `f64`: national ones keep their millimetres until they are moved to the ego.
#[derive(Debug, Clone, Default)]
pub struct Solid {
    pub vertices: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
    pub classes: Vec<u16>,
}

impl Solid {
    /// Appends `other`, moved by `pose`.
    pub fn append(&mut self, other: &Self, pose: &Pose) {
        let base = self.vertices.len() as u32;
        self.vertices.extend(other.vertices.iter().map(|&v| pose.apply(v)));
        self.faces.extend(other.faces.iter().map(|f| f.map(|v| v + base)));
        self.classes.extend_from_slice(&other.classes);
    }

    /// True if a triangle is more than a line or a point.
    pub fn has_area(&self) -> bool {
        self.faces.iter().any(|face| {
            let [a, b, c] = face.map(|v| self.vertices[v as usize]);
            (b - a).cross(c - a) != DVec3::ZERO
        })
    }

    /// Appends these triangles to `soup`, moved by `pose` in `f64` and then rounded.
    pub fn append_to(&self, soup: &mut TriangleSoup, pose: &Pose) {
        let base = soup.vertices.len() as u32;
        soup.vertices.extend(self.vertices.iter().map(|&v| pose.apply(v).as_vec3().to_array()));
        soup.faces.extend(self.faces.iter().map(|f| f.map(|v| v + base)));
        soup.face_class.extend_from_slice(&self.classes);
    }

    /// A box of `size` around `center`, turned by `yaw` about its own vertical axis: 12 triangles
    /// facing outwards.
    pub fn cuboid(center: DVec3, size: DVec3, yaw: f64, class: u16) -> Self {
        let half = size / 2.0;
        let base = [[-half.x, -half.y], [half.x, -half.y], [half.x, half.y], [-half.x, half.y]];
        let mut solid = Self::prism(&base, [-half.z, half.z], class);
        let turn = DMat3::from_rotation_z(yaw);
        for v in &mut solid.vertices {
            *v = turn * *v + center;
        }
        solid
    }

    /// Walls, floor and roof over a simple counter-clockwise `base`, facing outwards:
    /// 4n − 4 triangles for n corners.
    pub fn prism(base: &[[f64; 2]], z: [f64; 2], class: u16) -> Self {
        let n = base.len() as u32;
        let ring = |z| base.iter().map(move |p| DVec3::new(p[0], p[1], z));
        let vertices = ring(z[0]).chain(ring(z[1])).collect();
        let lids = triangulate(base);
        let mut faces: Vec<[u32; 3]> = lids.iter().map(|&[a, b, c]| [a, c, b]).collect();
        faces.extend(lids.iter().map(|t| t.map(|v| v + n)));
        for i in 0..n {
            let j = (i + 1) % n;
            faces.extend([[i, j, j + n], [i, j + n, i + n]]);
        }
        let classes = vec![class; faces.len()];
        Self { vertices, faces, classes }
    }

    /// Upright prism with `sides` corners on the circle around `foot`, the first at +x.
    pub fn cylinder(foot: DVec3, radius: f64, height: f64, sides: u32, class: u16) -> Self {
        let corner = |i: u32| {
            let (sin, cos) =
                maths::sin_cos(f64::from(i) * std::f64::consts::TAU / f64::from(sides));
            [radius * cos, radius * sin]
        };
        let base: Vec<_> = (0..sides).map(corner).collect();
        let mut solid = Self::prism(&base, [0.0, height], class);
        for v in &mut solid.vertices {
            *v += foot;
        }
        solid
    }

    /// A level rectangle facing up: two triangles.
    pub fn plane(min: [f64; 2], max: [f64; 2], z: f64, class: u16) -> Self {
        let corners = [[min[0], min[1]], [max[0], min[1]], [max[0], max[1]], [min[0], max[1]]];
        Self {
            vertices: corners.iter().map(|p| DVec3::new(p[0], p[1], z)).collect(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
            classes: vec![class; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(solid: &Solid) -> impl Iterator<Item = [DVec3; 3]> + '_ {
        solid.faces.iter().map(|f| f.map(|v| solid.vertices[v as usize]))
    }

    fn area(solid: &Solid) -> f64 {
        corners(solid).map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
    }

    /// Volume by the divergence theorem; positive only if the faces point outwards.
    fn volume(solid: &Solid) -> f64 {
        corners(solid).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn a_box_has_twelve_outward_triangles() {
        let center = DVec3::new(5.0, -3.0, 1.0);
        let solid = Solid::cuboid(center, DVec3::new(2.0, 3.0, 4.0), 0.3, 7);
        assert_eq!((solid.vertices.len(), solid.faces.len()), (8, 12));
        assert!(solid.classes.iter().all(|&c| c == 7));
        assert!((area(&solid) - 52.0).abs() < 1e-12);
        assert!((volume(&solid) - 24.0).abs() < 1e-12);
        for [a, b, c] in corners(&solid) {
            assert!((b - a).cross(c - a).dot((a + b + c) / 3.0 - center) > 0.0);
        }
    }

    #[test]
    fn a_prism_over_a_concave_base_has_its_area_and_volume() {
        let base = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let solid = Solid::prism(&base, [1.0, 3.0], 0);
        assert_eq!(solid.faces.len(), 4 * 6 - 4);
        assert!((area(&solid) - (2.0 * 6.0 + 14.0 * 2.0)).abs() < 1e-12);
        assert!((volume(&solid) - 12.0).abs() < 1e-12);
    }

    #[test]
    fn a_cylinder_is_its_inscribed_prism() {
        let solid = Solid::cylinder(DVec3::new(9.0, 9.0, 2.0), 2.0, 5.0, 12, 0);
        let base = 12.0 / 2.0 * 4.0 * (std::f64::consts::TAU / 12.0).sin();
        assert!((volume(&solid) - base * 5.0).abs() < 1e-9);
        assert!(solid.vertices.iter().all(|v| v.z == 2.0 || v.z == 7.0));
    }

    #[test]
    fn a_plane_faces_up() {
        let solid = Solid::plane([0.0, 0.0], [2.0, 3.0], 1.0, 0);
        assert_eq!(area(&solid), 6.0);
        for [a, b, c] in corners(&solid) {
            assert!((b - a).cross(c - a).z > 0.0);
        }
    }
}
