//! Triangles in `f64`: the primitives that make them, simple polygons cut into them, and the places of a shape's copies.

use glam::{DMat3, DVec3};

use super::description::{
    BoxDescription, CylinderDescription, PlaneDescription, PrismDescription, ShapeDescription,
};
use lidar_cast::geom::{Pose, TriangleSoup, crossing, turn};
use lidar_cast::maths;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location};

/// Least height of a triangle over its longest side from one corner that is more than rounding.
const THINNEST: f64 = 1e-14;

/// Lower and upper corner of the box around points; `None` without any.
pub(crate) fn around(mut points: impl Iterator<Item = DVec3>) -> Option<[DVec3; 2]> {
    let first = points.next()?;
    Some(points.fold([first; 2], |[low, high], p| [low.min(p), high.max(p)]))
}

/// The part of a polygon within a box (Sutherland, Hodgman 1974). Each corner is a position, and vectors that vary along
/// the sides.
pub(crate) fn clipped<const N: usize>(
    mut ring: Vec<[DVec3; N]>,
    [low, high]: [[f64; 3]; 2],
) -> Vec<[DVec3; N]> {
    for k in 0..3 {
        for (sign, bound) in [(1.0, low[k]), (-1.0, -high[k])] {
            let depth = |corner: &[DVec3; N]| sign * corner[0][k] - bound;
            let mut inside = Vec::with_capacity(ring.len() + 1);
            for (i, a) in ring.iter().enumerate() {
                let b = &ring[(i + 1) % ring.len()];
                let (from, to) = (depth(a), depth(b));
                inside.extend((from >= 0.0).then_some(*a));
                if (from >= 0.0) != (to >= 0.0) {
                    let share = from / (from - to);
                    inside.push(std::array::from_fn(|part| a[part].lerp(b[part], share)));
                }
            }
            ring = inside;
        }
    }
    ring
}

/// Triangles with a class each, in the frame of their owner: world, actor or ego.
///
/// Coordinates are `f64`: national ones keep their millimetres until they are moved to the ego.
#[derive(Debug, Clone, Default)]
pub(crate) struct Solid {
    pub vertices: Vec<DVec3>,
    pub faces: Vec<[u32; 3]>,
    pub classes: Vec<u16>,
    /// Number of faces up to the end of each shape of a list; empty for a single shape.
    pub ends: Vec<usize>,
}

impl Solid {
    pub(crate) fn of_class(vertices: Vec<DVec3>, faces: Vec<[u32; 3]>, class: u16) -> Self {
        let classes = vec![class; faces.len()];
        Self { vertices, faces, classes, ends: Vec::new() }
    }

    pub(crate) fn append(&mut self, other: &Self, pose: &Pose) {
        let base = self.vertices.len() as u32;
        let faces = self.faces.len();
        self.ends.extend(other.ends.iter().map(|end| end + faces));
        self.vertices.extend(other.vertices.iter().map(|&v| pose.apply(v)));
        self.faces.extend(other.faces.iter().map(|f| f.map(|v| v + base)));
        self.classes.extend_from_slice(&other.classes);
    }

    /// True if a triangle is more than a line or a point.
    pub(crate) fn has_area(&self) -> bool {
        self.faces.iter().any(|face| {
            let [a, b, c] = face.map(|v| self.vertices[v as usize]);
            let longest = (b - a).length_squared().max((c - a).length_squared());
            (b - a).cross(c - a).length() > THINNEST * longest
        })
    }

    /// Appends these triangles to `soup`, moved by `pose` in `f64` and then rounded.
    pub(crate) fn append_to(&self, soup: &mut TriangleSoup, pose: &Pose) {
        let base = soup.vertices.len() as u32;
        soup.vertices.extend(self.vertices.iter().map(|&v| pose.apply(v).as_vec3().to_array()));
        soup.faces.extend(self.faces.iter().map(|f| f.map(|v| v + base)));
        soup.face_class.extend_from_slice(&self.classes);
    }

    /// A box of `size` around `center`, turned by `yaw` about its own vertical axis: 12 triangles
    /// facing outwards.
    pub(crate) fn cuboid(center: DVec3, size: DVec3, yaw: f64, class: u16) -> Self {
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
    pub(crate) fn prism(base: &[[f64; 2]], z: [f64; 2], class: u16) -> Self {
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
        Self::of_class(vertices, faces, class)
    }

    /// Upright prism with `sides` corners on the circle around `foot`, the first at +x.
    pub(crate) fn cylinder(foot: DVec3, radius: f64, height: f64, sides: u32, class: u16) -> Self {
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

    /// A ball of circles of latitude with `sides` corners, `bands` of them from pole to pole; all corners lie on the
    /// sphere around the origin.
    pub(crate) fn sphere(radius: f64, [sides, bands]: [u32; 2], class: u16) -> Self {
        let corner = |band: u32, side: u32| {
            let (sin, cos) =
                maths::sin_cos(std::f64::consts::PI * f64::from(band) / f64::from(bands));
            let (y, x) = maths::sin_cos(std::f64::consts::TAU * f64::from(side) / f64::from(sides));
            radius * DVec3::new(sin * x, sin * y, cos)
        };
        let mut vertices = vec![DVec3::Z * radius, DVec3::Z * -radius];
        vertices.extend((1..bands).flat_map(|band| (0..sides).map(move |side| corner(band, side))));
        let number = |band: u32, side: u32| match band {
            0 => 0,
            band if band == bands => 1,
            band => 2 + (band - 1) * sides + side % sides,
        };
        let mut faces = Vec::new();
        for (band, side) in (0..bands).flat_map(|band| (0..sides).map(move |side| (band, side))) {
            let [a, b] = [number(band, side), number(band, side + 1)];
            let [c, d] = [number(band + 1, side), number(band + 1, side + 1)];
            // At a pole two corners are one.
            faces.extend(
                [[a, c, d], [a, d, b]].into_iter().filter(|f| f[0] != f[2] && f[1] != f[2]),
            );
        }
        Self::of_class(vertices, faces, class)
    }

    /// A level rectangle facing up: two triangles.
    pub(crate) fn plane(min: [f64; 2], max: [f64; 2], z: f64, class: u16) -> Self {
        let corners = [[min[0], min[1]], [max[0], min[1]], [max[0], max[1]], [min[0], max[1]]];
        let vertices = corners.iter().map(|p| DVec3::new(p[0], p[1], z)).collect();
        Self::of_class(vertices, vec![[0, 1, 2], [0, 2, 3]], class)
    }
}

/// End of the error of two corners of a shape without an extent between them.
const APART: &str = "; give it an extent, `max` above `min` by 0.1 m for example";

pub(crate) fn cuboid(at: &Location, b: &BoxDescription, class: u16) -> Checked<Solid> {
    let yaw = check::radians(&at.key("yaw"), b.yaw)?;
    let (center, size) = match (b.center, b.foot, b.size, b.min, b.max) {
        (Some(center), None, Some(size), None, None) => {
            let center = check::point(&at.key("center"), center)?;
            (center.into(), DVec3::from(check::size(&at.key("size"), size)?))
        }
        (None, Some(foot), Some(size), None, None) => {
            let foot = DVec3::from(check::point(&at.key("foot"), foot)?);
            let size = DVec3::from(check::size(&at.key("size"), size)?);
            (foot + DVec3::Z * (size.z / 2.0), size)
        }
        (None, None, None, Some(min), Some(max)) => {
            let [min, max] = check::corners(at, min, max, APART)?.map(DVec3::from);
            ((min + max) / 2.0, max - min)
        }
        _ => {
            let keys = ["center", "foot", "size", "min", "max"];
            let keys = keys.into_iter().zip([b.center, b.foot, b.size, b.min, b.max]);
            let found: Vec<&str> = keys.filter_map(|(key, value)| value.map(|_| key)).collect();
            return Err(check::choice(at, &found, &["center, size", "foot, size", "min, max"]));
        }
    };
    Ok(Solid::cuboid(center, size, yaw, class))
}

pub(crate) fn prism(at: &Location, p: &PrismDescription, class: u16) -> Checked<Solid> {
    let base = simple(&at.key("base"), &p.base)?;
    let z = at.key("z");
    for i in 0..2 {
        check::metres(&z.item(i), p.z[i])?;
    }
    if p.z[0] >= p.z[1] {
        let is_flat = p.z[0] == p.z[1];
        let mend = if is_flat { "; raise the top".into() } else { check::swapped(p.z) };
        let wanted = format!("a range [bottom, top] with bottom < top{mend}");
        return Err(bad(&z, format!("{:?}", p.z), wanted));
    }
    Ok(Solid::prism(&base, p.z, class))
}

pub(crate) fn cylinder(at: &Location, c: &CylinderDescription, class: u16) -> Checked<Solid> {
    let foot = check::point(&at.key("foot"), c.foot)?;
    let radius = check::length(&at.key("radius"), c.radius)?;
    let height = check::length(&at.key("height"), c.height)?;
    let sides = check::count(&at.key("sides"), c.sides.unwrap_or(12), 3, 256)?;
    Ok(Solid::cylinder(foot.into(), radius, height, sides, class))
}

pub(crate) fn plane(at: &Location, p: &PlaneDescription, class: u16) -> Checked<Solid> {
    for i in 0..2 {
        check::metres(&at.key("min").item(i), p.min[i])?;
        check::metres(&at.key("max").item(i), p.max[i])?;
    }
    check::rising(at, p.min, p.max)?;
    if let Some(i) = (0..2).find(|&i| p.min[i] == p.max[i]) {
        let wanted = format!("above min ({}){APART}", p.min[i]);
        return Err(bad(&at.key("max").item(i), p.max[i], wanted));
    }
    let z = check::metres(&at.key("z"), p.z)?;
    Ok(Solid::plane(p.min, p.max, z, class))
}

const MAX_COPIES: u64 = 100_000;

/// Poses of the copies of a shape; without `at` and `repeat` one copy in place.
pub(super) fn copies(at: &Location, shape: &ShapeDescription) -> Checked<Vec<Pose>> {
    match (&shape.at, &shape.repeat) {
        (None, None) => Ok(vec![Pose::IDENTITY]),
        (Some(_), Some(_)) => {
            let mend = "`at` already says where the copies stand; keep one of the two";
            Err(check::misplaced(at, "repeat", mend))
        }
        (Some(list), None) => {
            let at = at.key("at");
            if list.is_empty() || list.len() as u64 > MAX_COPIES {
                let wanted = format!("1 to {MAX_COPIES} positions");
                return Err(bad(&at, format!("a list of {}", list.len()), wanted));
            }
            list.iter()
                .enumerate()
                .map(|(i, p)| {
                    let here = at.item(i);
                    let (xyz, yaw) = match **p {
                        [x, y, z, yaw] => ([x, y, z], check::radians(&here.item(3), yaw)?),
                        [x, y, z] => ([x, y, z], 0.0),
                        [x, y] => ([x, y, 0.0], 0.0),
                        _ => {
                            let value = format!("a list of {} numbers", p.len());
                            return Err(bad(&here, value, "[x, y], [x, y, z] or [x, y, z, yaw]"));
                        }
                    };
                    Ok(Pose::new(check::point(&here, xyz)?.into(), 0.0, 0.0, yaw))
                })
                .collect()
        }
        (None, Some(repeat)) => {
            let at = at.key("repeat");
            let count = check::count(&at.key("count"), repeat.count, 1, MAX_COPIES)?;
            let step = DVec3::from(check::point(&at.key("step"), repeat.step)?);
            let far = (step * f64::from(count)).abs().max_element();
            check::metres(&at.key("step"), far)?;
            let nth = |i| Pose { translation: step * f64::from(i), ..Pose::IDENTITY };
            Ok((0..count).map(nth).collect())
        }
    }
}

/// Corners of one prism; checks and clipping are quadratic in it.
const MAX_CORNERS: usize = 1000;

/// Checks that `base` is a simple polygon; returns it counter-clockwise.
fn simple(at: &Location, base: &[[f64; 2]]) -> Checked<Vec<[f64; 2]>> {
    let n = base.len();
    if !(3..=MAX_CORNERS).contains(&n) {
        return Err(bad(at, format!("a list of {n}"), format!("3 to {MAX_CORNERS} corners")));
    }
    for (i, p) in base.iter().enumerate() {
        for (k, v) in p.iter().enumerate() {
            check::metres(&at.item(i).item(k), *v)?;
        }
        if *p == base[(i + 1) % n] {
            let wanted = "different from the next corner; leave repeated corners out, the last one \
                          joins the first by itself";
            return Err(bad(&at.item(i), format!("{p:?}"), wanted));
        }
    }
    if let Some((i, j)) = crossing(base) {
        let [a, b, c, d] = [i, i + 1, j, j + 1].map(|k| base[k % n]);
        let value = format!("the side from {c:?} to {d:?}");
        let wanted = format!(
            "free of the side from {a:?} to {b:?}; the outline must not cross or touch itself"
        );
        return Err(bad(&at.item(j), value, wanted));
    }
    let mut corners = base.to_vec();
    // Relative to the first corner, so that far-away outlines keep their digits.
    let area: f64 = (1..n - 1).map(|i| turn(base[0], base[i], base[i + 1])).sum();
    if area == 0.0 {
        let wanted = "a polygon with an area; move a corner off the line of the others";
        return Err(bad(at, "the outline", wanted));
    }
    if area < 0.0 {
        corners.reverse();
    }
    Ok(corners)
}

/// Cuts a simple counter-clockwise polygon into `corners.len() − 2` counter-clockwise triangles.
fn triangulate(corners: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut left: Vec<u32> = (0..corners.len() as u32).collect();
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    let corner = |i: u32| corners[i as usize];
    while left.len() > 3 {
        let n = left.len();
        let ear = |&i: &usize| {
            let ids = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let [a, b, c] = ids.map(corner);
            let inside = |&j: &u32| {
                let p = corner(j);
                !ids.contains(&j)
                    && turn(a, b, p) >= 0.0
                    && turn(b, c, p) >= 0.0
                    && turn(c, a, p) >= 0.0
            };
            turn(a, b, c) > 0.0 && !left.iter().any(inside)
        };
        // Every simple polygon has an ear; when rounding hides it, a straight corner goes first.
        let flat = |&i: &usize| {
            turn(corner(left[(i + n - 1) % n]), corner(left[i]), corner(left[(i + 1) % n])) == 0.0
        };
        let i = (0..n).find(ear).or_else(|| (0..n).find(flat)).unwrap_or(0);
        triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
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
    fn a_ball_is_closed_and_faces_outwards() {
        let solid = Solid::sphere(1.5, [32, 16], 0);
        assert_eq!(solid.faces.len(), 2 * 32 * 15);
        assert!(solid.vertices.iter().all(|v| (v.length() - 1.5).abs() < 1e-12));
        let whole = 4.0 / 3.0 * std::f64::consts::PI * 1.5_f64.powi(3);
        assert!((0.97..1.0).contains(&(volume(&solid) / whole)), "{}", volume(&solid) / whole);
        for [a, b, c] in corners(&solid) {
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
        }
    }

    #[test]
    fn a_plane_faces_up() {
        let solid = Solid::plane([0.0, 0.0], [2.0, 3.0], 1.0, 0);
        assert_eq!(area(&solid), 6.0);
        for [a, b, c] in corners(&solid) {
            assert!((b - a).cross(c - a).z > 0.0);
        }
    }

    fn area_of(corners: &[[f64; 2]]) -> f64 {
        let parts = triangulate(corners);
        assert_eq!(parts.len(), corners.len() - 2);
        parts
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| corners[i as usize]);
                assert!(turn(a, b, c) >= 0.0, "{t:?} is turned over");
                turn(a, b, c) / 2.0
            })
            .sum()
    }

    #[test]
    fn concave_outlines_keep_their_area_in_both_senses() {
        let l = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let mut turned = l;
        turned.reverse();
        for base in [l, turned] {
            assert_eq!(area_of(&simple(&Location::top("t"), &base).unwrap()), 6.0);
        }
    }

    #[test]
    fn random_outlines_with_many_straight_corners_keep_their_area() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut tried = 0;
        while tried < 500 {
            // Seen from the origin the corners turn once; on a small grid many lie in line.
            let n = rng.random_range(3..40);
            let mut angles: Vec<f64> =
                (0..n).map(|_| rng.random_range(0.0..std::f64::consts::TAU)).collect();
            angles.sort_by(f64::total_cmp);
            let corner = |a: &f64, r: f64| [(r * a.cos()).round(), (r * a.sin()).round()];
            let base: Vec<_> =
                angles.iter().map(|a| corner(a, rng.random_range(2.0..12.0))).collect();
            let Ok(outline) = simple(&Location::top("t"), &base) else { continue };
            let shoelace: f64 = (0..n)
                .map(|i| (outline[i], outline[(i + 1) % n]))
                .map(|(a, b)| (a[0] * b[1] - a[1] * b[0]) / 2.0)
                .sum();
            assert_eq!(area_of(&outline), shoelace, "{outline:?}");
            tried += 1;
        }
    }

    #[test]
    fn the_largest_comb_is_cut_in_a_moment() {
        let mut comb = vec![[0.0, 0.0], [499.0, 0.0]];
        for i in (0..499).rev() {
            let height = if i % 2 == 0 { 3.0 } else { 1.0 };
            comb.extend([[f64::from(i) + 1.0, height], [f64::from(i), height]]);
        }
        let start = std::time::Instant::now();
        assert_eq!(area_of(&simple(&Location::top("t"), &comb).unwrap()), 250.0 * 3.0 + 249.0);
        assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
    }

    #[test]
    fn a_straight_corner_is_allowed() {
        let base = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(area_of(&simple(&Location::top("t"), &base).unwrap()), 4.0);
    }

    #[test]
    fn crossing_touching_and_flat_outlines_are_refused() {
        let bad: [&[[f64; 2]]; 5] = [
            &[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]],
            &[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]],
            &[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0]],
            &[[0.0, 0.0], [1.0, 0.0]],
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        ];
        for base in bad {
            assert!(simple(&Location::top("t"), base).is_err(), "{base:?}");
        }
    }
}
