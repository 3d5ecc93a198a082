//! Where a map itself has poles, signs and barriers, so that none of ours stands beside them.

use std::collections::BTreeSet;

use glam::DVec2;

use super::model::class;
use super::network::Network;

/// Edge of a cell in metres: the map's own thing in a cell, or in one beside it, is the thing that ours would be.
const NEAR: f64 = 2.0;

/// Cells of [`NEAR`] metres in which a map itself has a thing of a class.
#[derive(Debug, Default)]
pub struct Brought(BTreeSet<(u16, [i32; 2])>);

impl Brought {
    /// All posts and shapes of a network; barriers of all kinds are one class.
    pub fn of(network: &Network) -> Self {
        let signs = network.posts.iter().map(|post| (class::TRAFFIC_SIGN, post.foot));
        let barrier = |class| match class {
            class::FENCE | class::WALL | class::GUARD_RAIL => class::GUARD_RAIL,
            other => other,
        };
        let shapes = network.shapes.iter().flat_map(|shape| {
            let class = barrier(shape.class);
            let edges = shape.faces.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]);
            edges.flat_map(move |(from, to)| {
                // A rail of one piece is there all along.
                let pieces = ((to - from).truncate().length() / NEAR).ceil().clamp(1.0, 1e3) as u32;
                (0..pieces).map(move |k| (class, from.lerp(to, f64::from(k) / f64::from(pieces))))
            })
        });
        Self(signs.chain(shapes).map(|(class, p)| (class, cell(p.truncate()))).collect())
    }

    /// True if the map has a thing of the class within 2 to 4 m.
    pub fn near(&self, class: u16, p: DVec2) -> bool {
        let [x, y] = cell(p);
        (-1..=1).any(|i| (-1..=1).any(|j| self.0.contains(&(class, [x + i, y + j]))))
    }
}

fn cell(p: DVec2) -> [i32; 2] {
    [(p.x / NEAR).floor() as i32, (p.y / NEAR).floor() as i32]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::network::Shape;

    #[test]
    fn a_pole_takes_the_place_of_one_within_3_m_and_a_rail_of_all_along_it() {
        let shape = |class, faces| Shape { class, faces, solid: true };
        let rail = [DVec3::ZERO, DVec3::X * 100.0, DVec3::new(100.0, 0.0, 0.8)];
        let pole = [DVec3::new(1.0, 41.0, 0.0); 3];
        let shapes = vec![shape(class::WALL, vec![rail]), shape(class::POLE, vec![pole])];
        let of_map = Brought::of(&Network { shapes, ..Network::default() });
        let near = |class, x, y| of_map.near(class, DVec2::new(x, y));
        assert!(near(class::POLE, 2.9, 41.0) && near(class::POLE, 1.0, 39.1));
        assert!(!near(class::POLE, 5.1, 41.0) && !near(class::POLE, 1.0, 46.0));
        assert!(near(class::GUARD_RAIL, 53.0, 1.0) && !near(class::GUARD_RAIL, 53.0, 5.0));
        assert!(!near(class::POLE, 53.0, 1.0));
    }
}
