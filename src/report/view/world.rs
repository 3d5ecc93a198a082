//! Shapes of a scene once, in few enough triangles, and the pose of each thing by frame.

use crate::chart::simplify::merge_vertices;
use crate::geom::TriangleSoup;
use crate::scene::{EgoBody, Scene};

/// Most triangles of all shapes of a page, which holds 19 bytes of each.
const TRIANGLES: usize = 40_000;
/// Edge in metres of the cells that corners are first merged in where there are more, and of the last.
const CELLS: [f64; 2] = [0.1, 30.0];

/// Things that the view draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Things {
    /// Equal things share a shape.
    pub shapes: Vec<TriangleSoup>,
    /// Shape of each thing, in the order static world, actors, bodies of the ego.
    pub shape_of: Vec<usize>,
    /// Number of the first body of the ego among the things.
    pub own: usize,
    /// Rows of the rotation and translation from each thing's frame to the ego frame, `[frames][things]`.
    pub poses: Vec<Vec<[f32; 12]>>,
    /// Triangles of the scene's shapes, before any were merged.
    triangles: usize,
}

impl Things {
    /// The things of a scene and their poses in some of its frames, on a page with `scenes` scenes.
    pub fn new(scene: &Scene, frames: &[usize], scenes: usize) -> Self {
        let mut shapes: Vec<TriangleSoup> = Vec::new();
        let mut shape_of = Vec::new();
        for part in scene.parts(EgoBody::Include) {
            let soup = scene.part(part);
            let known = shapes.iter().position(|shape| *shape == soup);
            shape_of.push(known.unwrap_or(shapes.len()));
            if known.is_none() {
                shapes.push(soup);
            }
        }
        let triangles = count(&shapes);
        let poses = frames.iter().map(|&frame| {
            let poses = scene.part_poses(frame).into_iter();
            poses
                .map(|pose| {
                    let (turn, at) = (pose.rotation, pose.translation);
                    let row = |k: usize| [0, 1, 2].map(|c| turn.col(c)[k]);
                    let ([a, b, c], [d, e, f], [g, h, i]) = (row(0), row(1), row(2));
                    [a, b, c, at.x, d, e, f, at.y, g, h, i, at.z].map(|v| v as f32)
                })
                .collect()
        });
        Self {
            poses: poses.collect(),
            shapes: few(shapes, TRIANGLES / scenes),
            shape_of,
            own: scene.body_part(),
            triangles,
        }
    }

    /// Sentence on corners that were merged; `None` where none was.
    pub fn left_out(&self) -> Option<String> {
        let (all, shown) = (self.triangles, count(&self.shapes));
        let words = "The scene's {all} triangles are drawn as {shown}: near corners are merged.";
        let words = words.replace("{all}", &all.to_string()).replace("{shown}", &shown.to_string());
        (shown < all).then_some(words)
    }
}

fn count(shapes: &[TriangleSoup]) -> usize {
    shapes.iter().map(|shape| shape.faces.len()).sum()
}

/// The shapes with corners merged in ever larger cells until the triangles are few enough. Triangles beyond `most` even
/// then are dropped.
fn few(mut shapes: Vec<TriangleSoup>, most: usize) -> Vec<TriangleSoup> {
    let mut cell = CELLS[0];
    while count(&shapes) > most && cell < CELLS[1] {
        for shape in &mut shapes {
            *shape = merge_vertices(shape, cell);
        }
        cell *= 2.0;
    }
    let mut left = most;
    for shape in &mut shapes {
        shape.faces.truncate(left);
        shape.face_class.truncate(left);
        left -= shape.faces.len();
    }
    shapes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_of_many_triangles_becomes_one_of_few() {
        // A flat square of 200 000 triangles.
        let (n, step) = (316_u32, 0.05_f32);
        let vertices =
            (0..=n).flat_map(|i| (0..=n).map(move |j| [i as f32 * step, j as f32 * step, 0.0]));
        let at = |i: u32, j: u32| i * (n + 1) + j;
        let faces = (0..n).flat_map(|i| {
            (0..n).flat_map(move |j| {
                [
                    [at(i, j), at(i + 1, j), at(i, j + 1)],
                    [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)],
                ]
            })
        });
        let faces: Vec<[u32; 3]> = faces.collect();
        let face_class = vec![0; faces.len()];
        let soup = TriangleSoup { vertices: vertices.collect(), faces, face_class };
        let shown = few(vec![soup.clone()], TRIANGLES);
        let left = count(&shown);
        assert!((1_000..=TRIANGLES).contains(&left), "{left}");
        let things = Things {
            shapes: shown,
            shape_of: vec![0],
            own: 1,
            poses: vec![],
            triangles: count(&[soup]),
        };
        assert!(
            things.left_out().unwrap().starts_with("The scene's 199712 triangles are drawn as ")
        );
    }
}
