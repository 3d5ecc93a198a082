//! Triangles merged below a size.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use crate::geom::TriangleSoup;

/// Merges the vertices of each cubic cell of edge `cell` metres into their mean, and drops the
/// triangles of which two corners have become one (Rossignac, Borrel 1993), and all but the first of
/// those that have become the same.
///
/// A vertex moves by less than the cell's diagonal and one alone in its cell stays, so that walls and roads keep their
/// corners; things smaller than a cell vanish. Triangles keep their order and class. A `cell` that is not above 0
/// changes nothing.
pub fn merge_vertices(soup: &TriangleSoup, cell: f64) -> TriangleSoup {
    if cell.is_nan() || cell <= 0.0 {
        return soup.clone();
    }
    let mut slots: HashMap<[i64; 3], u32> = HashMap::new();
    let mut sums: Vec<(DVec3, Vec<[u32; 3]>)> = Vec::new();
    let slot_of: Vec<u32> = soup
        .vertices
        .iter()
        .map(|vertex| {
            let key = vertex.map(|v| (f64::from(v) / cell).floor() as i64);
            let slot = *slots.entry(key).or_insert_with(|| {
                sums.push((DVec3::ZERO, Vec::new()));
                sums.len() as u32 - 1
            });
            // A corner that several triangles list on their own counts once.
            let bits = vertex.map(f32::to_bits);
            let (sum, seen) = &mut sums[slot as usize];
            if !seen.contains(&bits) {
                seen.push(bits);
                *sum += DVec3::from(vertex.map(f64::from));
            }
            slot
        })
        .collect();
    let mut merged = TriangleSoup {
        vertices: sums
            .iter()
            .map(|(sum, seen)| (*sum / seen.len() as f64).as_vec3().to_array())
            .collect(),
        ..TriangleSoup::default()
    };
    let mut seen = HashSet::new();
    for (face, &class) in soup.faces.iter().zip(&soup.face_class) {
        let [a, b, c] = face.map(|v| slot_of[v as usize]);
        let mut corners = [a, b, c];
        corners.sort_unstable();
        if a != b && b != c && c != a && seen.insert(corners) {
            merged.faces.push([a, b, c]);
            merged.face_class.push(class);
        }
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_things_vanish_and_large_ones_keep_their_corners() {
        let wall = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 0.0, 3.0]];
        let leaf = [[5.1, 5.1, 1.1], [5.2, 5.1, 1.1], [5.1, 5.2, 1.2]];
        let soup = TriangleSoup {
            vertices: [wall, leaf].concat(),
            faces: vec![[0, 1, 2], [3, 4, 5]],
            face_class: vec![4, 7],
        };
        let merged = merge_vertices(&soup, 0.5);
        assert_eq!((merged.faces.len(), &merged.face_class[..]), (1, &[4][..]));
        assert_eq!(merged.corners(0), wall);
        assert_eq!(merge_vertices(&soup, 0.0), soup);
        assert_eq!(merge_vertices(&soup, 0.01).faces.len(), 2);
    }

    #[test]
    fn triangles_that_become_the_same_are_kept_once() {
        let near = |d: f32| [[0.1 + d, 0.1, 0.1], [1.1 + d, 0.1, 0.1], [1.1, 1.1 + d, 0.1]];
        let soup = TriangleSoup {
            vertices: [near(0.0), near(0.1), near(0.2), near(2.0)].concat(),
            // The second turns the other way round, the last lies elsewhere.
            faces: vec![[0, 1, 2], [5, 4, 3], [7, 8, 6], [9, 10, 11]],
            face_class: vec![1, 2, 3, 4],
        };
        let merged = merge_vertices(&soup, 1.0);
        assert_eq!(merged.face_class, [1, 4]);
        assert_eq!(merge_vertices(&soup, 0.01), soup);
    }

    #[test]
    fn a_tessellated_wall_stays_closed() {
        // A wall of 40 × 40 quads of 5 cm, merged in cells of 20 cm.
        let mut soup = TriangleSoup::default();
        for i in 0..=40 {
            for j in 0..=40 {
                soup.vertices.push([5.0, 0.05 * i as f32, 0.05 * j as f32]);
            }
        }
        for (i, j) in (0..40_u32).flat_map(|i| (0..40).map(move |j| (i, j))) {
            let at = |i: u32, j: u32| i * 41 + j;
            soup.faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            soup.faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        soup.face_class = vec![0; soup.faces.len()];
        let merged = merge_vertices(&soup, 0.2);
        assert!(merged.faces.len() < soup.faces.len() / 8, "{} faces", merged.faces.len());
        let bvh = crate::bvh::Bvh::build(&merged, 10.0);
        for k in 0..100 {
            let (y, z) = (0.3 + 0.014 * k as f32, 1.7 - 0.013 * k as f32);
            let ray = crate::bvh::Ray::new(glam::Vec3::new(0.0, y, z), glam::Vec3::X, 10.0);
            assert_eq!(bvh.closest_hit(&ray).t, 5.0, "a hole at {y}, {z}");
        }
    }
}
