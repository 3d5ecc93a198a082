//! The outline of the own vehicle on the ground, and distances from it.

use crate::maths;

/// Convex hull of the own body seen from above: corners in the ego frame, metres, counter-clockwise.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
#[serde(transparent)]
pub struct Footprint {
    corners: Vec<[f64; 2]>,
}

/// Twice the signed area of a triangle, positive where it turns left.
fn turn([ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]) -> f64 {
    (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
}

impl Footprint {
    /// The hull of points; `None` where they enclose no area.
    ///
    /// Monotone chain (Andrew 1979).
    pub fn of(points: impl IntoIterator<Item = [f64; 2]>) -> Option<Self> {
        let mut points: Vec<[f64; 2]> = points.into_iter().collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        points.dedup();
        let chain = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
            let mut chain: Vec<[f64; 2]> = Vec::new();
            for &point in points {
                while let [.., a, b] = chain[..] {
                    if turn(a, b, point) > 0.0 {
                        break;
                    }
                    chain.pop();
                }
                chain.push(point);
            }
            chain.pop();
            chain
        };
        let mut corners = chain(&mut points.iter());
        corners.extend(chain(&mut points.iter().rev()));
        let footprint = Self { corners };
        (footprint.corners.len() > 2 && footprint.area() > 0.0).then_some(footprint)
    }

    /// Corners, counter-clockwise.
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners
    }

    /// Edges from corner to corner.
    fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(a, b)| (*a, *b))
    }

    /// Lower and upper corner of the box around it along the axes.
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        let fold = |start: f64, least: fn(f64, f64) -> f64| {
            [0, 1].map(|k| self.corners.iter().map(|c| c[k]).fold(start, least))
        };
        [fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max)]
    }

    /// Middle of the box around it.
    pub fn middle(&self) -> [f64; 2] {
        let [low, high] = self.bounds();
        [0, 1].map(|k| 0.5 * (low[k] + high[k]))
    }

    /// Square metres.
    pub fn area(&self) -> f64 {
        polygon_area(&self.corners)
    }

    /// Metres from the outline to a point outside; 0 inside.
    pub fn distance(&self, point: [f64; 2]) -> f64 {
        if self.edges().all(|(a, b)| turn(a, b, point) >= 0.0) {
            return 0.0;
        }
        let from_edge = |(a, b): ([f64; 2], [f64; 2])| {
            let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
            let length = along[0] * along[0] + along[1] * along[1];
            let share = ((to[0] * along[0] + to[1] * along[1]) / length).clamp(0.0, 1.0);
            maths::hypot(to[0] - share * along[0], to[1] - share * along[1])
        };
        self.edges().map(from_edge).fold(f64::INFINITY, f64::min)
    }

    /// Metres from the middle to the outline in a direction of unit length.
    pub fn reach(&self, direction: [f64; 2]) -> f64 {
        let middle = self.middle();
        let leaving = self.edges().filter_map(|(a, b)| {
            // Outward normal of an edge of a counter-clockwise polygon.
            let normal = [b[1] - a[1], a[0] - b[0]];
            let towards = direction[0] * normal[0] + direction[1] * normal[1];
            let gap = (a[0] - middle[0]) * normal[0] + (a[1] - middle[1]) * normal[1];
            (towards > 0.0).then(|| gap / towards)
        });
        leaving.fold(f64::INFINITY, f64::min).max(0.0)
    }
}

/// Square metres of a polygon without crossings.
pub(super) fn polygon_area(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let doubled: f64 = corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum();
    0.5 * doubled.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_with_points_inside_and_on_its_edges() {
        let corners = [[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]];
        let others = [[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [1.0, -1.0]];
        let hull = Footprint::of(others.into_iter().chain(corners)).unwrap();
        assert_eq!(hull.corners(), corners);
        assert_eq!((hull.area(), hull.middle()), (8.0, [0.0, 0.0]));
        assert_eq!(hull.distance([1.9, 0.9]), 0.0);
        assert_eq!(hull.distance([5.0, 0.0]), 3.0);
        assert_eq!(hull.distance([5.0, 5.0]), 5.0);
        assert_eq!(hull.reach([1.0, 0.0]), 2.0);
        assert!((hull.reach([0.6, 0.8]) - 1.25).abs() < 1e-12);
    }

    #[test]
    fn points_on_a_line_are_no_outline() {
        assert_eq!(Footprint::of([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
        assert_eq!(Footprint::of([]), None);
    }
}
