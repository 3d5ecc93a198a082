//! An order of many rays in which neighbours go down the trees alike.
//!
//! Rays are sorted by the cell in which they enter the frame's box and by the cell of their direction, along a Z-order curve.
//! Nodes and triangles that one of them needs then lie in the cache for the next.

use glam::Vec3;
use rayon::prelude::*;

use super::RayScene;
use super::lanes::W;
use crate::geom::Aabb;

/// Fewest rays, and fewest triangles, for which an order pays: smaller trees lie in the second-level cache anyway.
const FEWEST: usize = 1 << 15;
const FEWEST_TRIANGLES: usize = 1 << 16;
/// Groups of neighbouring rays that are looked at to see whether the rays have an order of their own.
const GROUPS: usize = 64;
/// Rays in a sample, whose entries tell how far the entries of all rays lie apart.
const SAMPLE: usize = 1024;
/// Bits of a cell along an axis of the box, and along each of the two axes of directions.
const PLACE_BITS: u32 = 3;
const DIRECTION_BITS: u32 = 4;
const CELLS: usize = 1 << (3 * PLACE_BITS + 2 * DIRECTION_BITS);
/// Least cosine between neighbours of rays that have an order of their own.
const ALIKE: f32 = 0.9;

/// Numbers of the rays in such an order; `None` for few rays or triangles, and for rays whose
/// neighbours are alike as they come.
pub(super) fn order_of(rays: &[[f32; 6]], scene: &RayScene) -> Option<Vec<u32>> {
    let is_many = (FEWEST..=u32::MAX as usize).contains(&rays.len());
    if !is_many || scene.triangle_count() < FEWEST_TRIANGLES || are_alike(rays) {
        return None;
    }
    let sample = rays.iter().step_by(rays.len() / SAMPLE).map(|ray| entry(ray, &scene.bounds));
    let mut entries = Aabb::EMPTY;
    sample.filter(|entry| entry.is_finite()).for_each(|entry| entries.grow(entry));
    let cells = rays.par_iter().map(|ray| cell(ray, &scene.bounds, &entries));
    let cells: Vec<u32> = cells.collect();
    let mut starts = vec![0; CELLS + 1];
    cells.iter().for_each(|&cell| starts[cell as usize + 1] += 1);
    for cell in 0..CELLS {
        starts[cell + 1] += starts[cell];
    }
    let mut order = vec![0; rays.len()];
    for (ray, &cell) in (0..).zip(&cells) {
        let place: &mut u32 = &mut starts[cell as usize];
        order[*place as usize] = ray;
        *place += 1;
    }
    Some(order)
}

/// True if in most groups of neighbours all directions are alike.
fn are_alike(rays: &[[f32; 6]]) -> bool {
    let groups = rays.chunks(W).step_by(rays.len().div_ceil(W * GROUPS));
    let is_alike = |group: &[[f32; 6]]| {
        let direction = |ray: &[f32; 6]| Vec3::from_slice(&ray[3..]).normalize_or_zero();
        let first = direction(&group[0]);
        group.iter().all(|ray| direction(ray).dot(first) > ALIKE)
    };
    let (alike, all) =
        groups.fold((0, 0), |(alike, all), group| (alike + usize::from(is_alike(group)), all + 1));
    2 * alike > all
}

/// Point where a ray enters a box, or begins within it.
fn entry(ray: &[f32; 6], bounds: &Aabb) -> Vec3 {
    let (origin, direction) = (Vec3::from_slice(&ray[..3]), Vec3::from_slice(&ray[3..]));
    let inverse = direction.recip();
    let (to_min, to_max) = ((bounds.min - origin) * inverse, (bounds.max - origin) * inverse);
    origin + direction * to_min.min(to_max).max_element().max(0.0)
}

/// Cell of a ray, of its direction and of its entry among `entries`; numbers that are not finite fall into any.
fn cell(ray: &[f32; 6], bounds: &Aabb, entries: &Aabb) -> u32 {
    let place = (entry(ray, bounds) - entries.min) / (entries.max - entries.min);
    let place = (place * (1 << PLACE_BITS) as f32).to_array();
    let direction = Vec3::from_slice(&ray[3..]);
    // Octahedral map: the sphere onto a square.
    let [x, y, z] = (direction * direction.abs().element_sum().recip()).to_array();
    let folded = |a: f32, b: f32| if z < 0.0 { (1.0 - b.abs()).copysign(a) } else { a };
    let half = (1 << (DIRECTION_BITS - 1)) as f32;
    let towards = [folded(x, y), folded(y, x)].map(|axis| (axis + 1.0) * half);
    let part = |table: &[u32], number: f32| table[(number as usize).min(table.len() - 1)];
    let place = (0..3).fold(0, |all, axis| all | part(&IN_BOX, place[axis]) << axis);
    let towards = (0..2).fold(0, |all, axis| all | part(&ON_SPHERE, towards[axis]) << axis);
    place << (2 * DIRECTION_BITS) | towards
}

/// Numbers with zeros between their bits, for an axis of the box and of directions.
const IN_BOX: [u32; 1 << PLACE_BITS] = spread(3);
const ON_SPHERE: [u32; 1 << DIRECTION_BITS] = spread(2);

/// The first `N` numbers with their bits `stride` apart.
const fn spread<const N: usize>(stride: u32) -> [u32; N] {
    let (mut all, mut number) = ([0; N], 0);
    while number < N {
        let mut bit = 0;
        while bit < N.ilog2() {
            all[number] |= (number as u32 >> bit & 1) << (bit * stride);
            bit += 1;
        }
        number += 1;
    }
    all
}
