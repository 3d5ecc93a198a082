//! The own body seen from above, and whether a target stands in it.

use glam::DVec2;

use crate::problem::Frame;
use crate::scene::Target;

/// A triangle seen from above, metres in the ego frame.
#[derive(Debug)]
struct FlatTriangle {
    corners: [DVec2; 3],
    /// Height of its highest corner.
    top: f64,
}

/// Triangles of a body seen from above.
#[derive(Debug)]
pub(super) struct BodyPlan {
    triangles: Vec<FlatTriangle>,
    /// Lower and upper corner of all; equal infinities without triangles.
    bounds: [DVec2; 2],
}

/// A rectangle along x and y by its lower and upper corner.
type Rectangle = [DVec2; 2];

/// True if two rectangles share more than an edge.
fn rectangles_meet([low, high]: Rectangle, [from, to]: Rectangle) -> bool {
    from.cmplt(high).all() && to.cmpgt(low).all()
}

impl FlatTriangle {
    fn bounds(&self) -> Rectangle {
        let [a, b, c] = self.corners;
        [a.min(b).min(c), a.max(b).max(c)]
    }

    /// True if the triangle and a rectangle share more than an edge: no line along an edge of either parts them.
    fn meets(&self, rectangle: Rectangle) -> bool {
        let [low, high] = rectangle;
        let parts = |k: usize| {
            let [a, b, c] = [0, 1, 2].map(|next| self.corners[(k + next) % 3]);
            let across = (b - a).perp();
            // Edges of upright faces may have no length.
            if across == DVec2::ZERO {
                return false;
            }
            let [first, third] = [a.dot(across), c.dot(across)];
            let (middle, half) =
                (0.5 * (low + high).dot(across), 0.5 * (high - low).dot(across.abs()));
            middle + half <= first.min(third) || middle - half >= first.max(third)
        };
        rectangles_meet(self.bounds(), rectangle) && !(0..3).any(parts)
    }
}

impl BodyPlan {
    pub(super) fn of(body: &Frame) -> Self {
        let corners: Vec<_> = body.corners().collect();
        let flat = |at: &[glam::DVec3]| FlatTriangle {
            corners: [at[0], at[1], at[2]].map(|at| at.truncate()),
            top: at[0].z.max(at[1].z).max(at[2].z),
        };
        let triangles: Vec<FlatTriangle> = corners.chunks_exact(3).map(flat).collect();
        let none = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let bounds = triangles.iter().map(FlatTriangle::bounds);
        let bounds = bounds.fold(none, |[low, high], [from, to]| [low.min(from), high.max(to)]);
        Self { triangles, bounds }
    }

    /// Own bodies of a scene's frame; their triangles have the numbers from `own` on.
    pub(super) fn in_frame(geometry: &Frame, own: usize) -> Frame {
        let instances = geometry.instances().iter();
        Frame::new(instances.filter(|instance| instance.first_prim as usize >= own).cloned())
    }

    /// True if a target at a position stands in the body: its box in plan meets a triangle that reaches above its bottom.
    pub(super) fn holds(&self, target: &Target, [x, y, z]: [f64; 3]) -> bool {
        let corner = |at: [f64; 3]| DVec2::new(x + at[0], y + at[1]);
        let [low, high] = target.corners;
        let rectangle = [corner(low), corner(high)];
        let is_met =
            |triangle: &FlatTriangle| triangle.top > z + low[2] && triangle.meets(rectangle);
        rectangles_meet(self.bounds, rectangle) && self.triangles.iter().any(is_met)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::targets::tests::{site, wall};

    #[test]
    fn a_place_beside_a_bar_is_free_and_one_above_a_body_too() {
        // A deck at 1 m from x = −1 to 1, and a thin bar that leads back and to the left at 45°.
        let mut body = wall(0.0);
        body.vertices =
            vec![[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]];
        let bar = [[-1.0, 0.0, 0.5], [-4.0, 3.0, 0.5], [-4.0, 3.1, 0.5], [-1.0, 0.1, 0.5]];
        body.vertices.extend(bar);
        body.faces.extend([[4, 5, 6], [4, 6, 7]]);
        body.face_class.extend([0; 2]);
        let site = site(&[glam::DVec3::X], 10.0, &body);
        let adult = Target::named("adult").unwrap();
        let free = |x: f64, y: f64, z: f64| site.has_room(&adult, [x, y, z]);
        assert!(!free(0.0, 0.0, 0.0) && !free(1.1, 0.0, 0.0), "in the deck");
        assert!(free(1.5, 0.0, 0.0), "beside the deck");
        assert!(!free(-2.5, 1.5, 0.0), "in the bar");
        assert!(
            free(-1.6, 2.4, 0.0) && free(-3.6, 0.4, 0.0),
            "beside the bar, in the box around it"
        );
        assert!(free(0.0, 0.0, 1.0) && !free(0.0, 0.0, 0.9), "on the deck");
    }
}
