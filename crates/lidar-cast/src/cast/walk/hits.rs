//! The listed tests: which beams pass between a triangle's edges, and which hits are the best.

use glam::Vec3;

use super::angles::Eye;
use super::descent::{
    BLOCK_SHIFT, LENGTH_SHIFT, SLOT_SHIFT, TESTS, Test, Tests, WalkMemory, WindowBeams, some,
    some_mut,
};
use super::grid::{Directions, Grid, Window};
use super::ops::{W, per_target, three};
use super::triangles::TriangleView;
use crate::bvh::bvh16::Block16;
use crate::bvh::{Hit, Ray};

/// Vectors of a rectangle from which on its rows are cut one by one.
const CUT_VECTORS: i32 = 4;
const LANES: [i32; W] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Inputs shared by all hit tests of one walk.
pub(super) struct WalkInputs<'a> {
    pub(super) grid: &'a Grid,
    pub(super) window: Window,
    /// Directions of its beams in the sensor frame.
    pub(super) local: &'a Directions,
    pub(super) eye: Eye,
    pub(super) blocks: &'a [Block16],
    /// Added to the index of each face.
    pub(super) first_prim: u32,
}

/// Asks `Ray::intersect` itself, for a beam that passes so close to an edge or beside the box that
/// rounding decides.
#[cold]
#[inline(never)]
fn ask(scene: &WalkInputs<'_>, block: &Block16, slot: usize, beams: &mut WindowBeams, at: usize) {
    let direction = Vec3::from(beams.direction.each_ref().map(|numbers| numbers[at]));
    let triangle = block.triangle(slot);
    let mut best = Hit { t: beams.t[at], prim: beams.prim[at] as u32 };
    let ray = Ray::new(scene.eye.origin.into(), direction, best.t);
    ray.intersect(&triangle, scene.eye.pad, scene.first_prim, &mut best);
    (beams.t[at], beams.prim[at]) = (best.t, best.prim as i32);
}

per_target! {
    use super::{angles, triangles};

    /// Lists the tests of a block's triangles with the beams of their rectangles.
    fn list(scene: &WalkInputs<'_>, work: &mut WalkMemory, k: usize) {
        let columns = splat_i(scene.window.columns as i32);
        let rects = &work.rects[k];
        let [first_row, last_row] = [load_i(&rects.rows[0]), load_i(&rects.rows[1])];
        let [from, to] = [load_i(&rects.columns[0]), load_i(&rects.columns[1])];
        let length = sub_i(to, from);
        let short = le_i(length, splat_i(W as i32 - 1));
        let height = sub_i(last_row, first_row);
        let simple = rects.seen & bits(both(le_i(height, splat_i(0)), short));
        let at = add_i(mul_i(first_row, columns), from);
        let lanes = mul_i(load_i(&LANES), splat_i(SLOT_SHIFT));
        let who = add_i(lanes, splat_i(k as i32 * BLOCK_SHIFT));
        let words = add_i(add_i(at, mul_i(length, splat_i(LENGTH_SHIFT))), who);
        append(scene, work, simple, words);
        let mut left = work.rects[k].seen & !simple;
        let mut prepared = false;
        while left != 0 {
            let slot = left.trailing_zeros() as usize % W;
            left &= left - 1;
            let rects = &work.rects[k];
            let rows = rects.rows[1][slot] - rects.rows[0][slot] + 1;
            let length = rects.columns[1][slot] - rects.columns[0][slot];
            let large = (length / W as i32 + 1) * rows >= CUT_VECTORS;
            let cut = large && work.seen[k].uncut >> slot & 1 == 0;
            if cut && !prepared {
                prepare_rows(&mut work.seen[k]);
                prepared = true;
            }
            list_rows(scene, work, k, slot, cut);
        }
    }

    /// Lists the tests of one triangle, sixteen rows at a time.
    fn list_rows(scene: &WalkInputs<'_>, work: &mut WalkMemory, k: usize, slot: usize, cut: bool) {
        let columns = splat_i(scene.window.columns as i32);
        let who = splat_i(slot as i32 * SLOT_SHIFT + k as i32 * BLOCK_SHIFT);
        let [first_row, last_row] = [work.rects[k].rows[0][slot], work.rects[k].rows[1][slot]];
        let [from, to] = [work.rects[k].columns[0][slot], work.rects[k].columns[1][slot]];
        for row in (first_row..=last_row).step_by(W) {
            let valid = ((2_u32 << (last_row - row).min(W as i32 - 1)) - 1) as u16;
            let [mut at, to] = if cut {
                let (seen, rects) = (&work.seen[k], &work.rects[k]);
                rows(scene.grid, &scene.window, seen, rects, slot, row as usize)
            } else {
                [splat_i(from), splat_i(to)]
            };
            let base = mul_i(add_i(load_i(&LANES), splat_i(row)), columns);
            let base = add_i(base, who);
            let mut some = valid & bits(le_i(at, to));
            while some != 0 {
                let length = min_i(sub_i(to, at), splat_i(W as i32 - 1));
                let words = add_i(add_i(base, at), mul_i(length, splat_i(LENGTH_SHIFT)));
                append(scene, work, some, words);
                at = add_i(at, splat_i(W as i32));
                some &= bits(le_i(at, to));
            }
        }
    }

    fn append(scene: &WalkInputs<'_>, work: &mut WalkMemory, some: u16, words: I) {
        let tests = &mut *work.tests;
        let at = tests.len.min(TESTS - W);
        tests.words[at..at + W].copy_from_slice(&compress(some, words));
        tests.len = at + some.count_ones() as usize;
        if tests.len > TESTS - W {
            test(scene, work);
        }
    }

    /// Does the listed tests.
    fn test(scene: &WalkInputs<'_>, work: &mut WalkMemory) {
        let found = inside(scene, work);
        distances(scene, work, found);
        work.tests.len = 0;
    }

    /// Notes the tests in which a beam passes between the edges, and how many there are.
    fn inside(scene: &WalkInputs<'_>, work: &mut WalkMemory) -> usize {
        let Tests { words, len, inside } = &mut *work.tests;
        let [x, y, z] = scene.local;
        let mut found = 0;
        for &word in &words[..*len] {
            let Test { at, lanes, slot, block } = Test::of(word);
            let TriangleView { edges, doubt, .. } = &work.seen[block];
            let local = [load(some(x, at)), load(some(y, at)), load(some(z, at))];
            let [u, v, w] = three!(E => dot(three!(K => splat(edges[E][K][slot])), local));
            let least = min(min(u, v), w);
            let doubt = doubt[slot];
            let nearest = splat(work.rects[block].distance[slot]);
            let ahead = both(mask(lanes), le(nearest, load(some(&work.beams.t, at))));
            let maybe = bits(both(ahead, le(splat(-doubt), least)));
            let sure = bits(both(ahead, le(splat(doubt), least)));
            inside[found % TESTS] = (word, maybe, sure);
            found += usize::from(maybe != 0);
        }
        found
    }

    /// Takes over the distances that are best, as `Ray::intersect` computes them.
    fn distances(scene: &WalkInputs<'_>, work: &mut WalkMemory, found: usize) {
        for index in 0..found {
            let (word, maybe, sure) = work.tests.inside[index % TESTS];
            let Test { at, slot, block: k, .. } = Test::of(word);
            let block = &scene.blocks[work.blocks[k]];
            let WindowBeams { direction, inverse, t: best, prim } = &mut *work.beams;
            let n = three!(K => splat(block.normal[K][slot]));
            let d = three!(K => load(some(&direction[K], at)));
            let i = three!(K => load(some(&inverse[K], at)));
            let towards = add(add(mul(n[0], d[0]), mul(n[1], d[1])), mul(n[2], d[2]));
            let TriangleView { above, sides, .. } = &work.seen[k];
            let quotient = div(splat(above[slot]), towards);
            let low = three!(K => mul(splat(sides[0][K][slot]), i[K]));
            let high = three!(K => mul(splat(sides[1][K][slot]), i[K]));
            let enter = three!(K => min(low[K], high[K]));
            let leave = three!(K => max(low[K], high[K]));
            let zero = splat(0.0);
            let enter = max(max(enter[0], enter[1]), max(enter[2], zero));
            let leave = min(min(leave[0], leave[1]), leave[2]);
            let t = min(max(quotient, enter), leave);
            let id = splat_i(block.prim[slot].wrapping_add(scene.first_prim) as i32);
            let (before, other) = (load(some(best, at)), load_i(some(prim, at)));
            let closer = either(lt(t, before), both(eq(t, before), less_id(id, other)));
            let ahead = both(lt(zero, quotient), lt(zero, t));
            let beside = bits(lt(leave, enter));
            let takes = both(mask(sure & !beside), both(closer, ahead));
            *some_mut(best, at) = store(select(takes, t, before));
            *some_mut(prim, at) = store_i(select_i(takes, id, other));
            let mut left = maybe & (!sure | beside);
            while left != 0 {
                let at = at + left.trailing_zeros() as usize;
                left &= left - 1;
                ask(scene, block, slot, &mut work.beams, at);
            }
        }
    }

    /// World directions of the beams of a rectangle, and the farthest of their best distances.
    fn turn(local: &Directions, axes: &[[f32; 3]; 3], beams: &mut WindowBeams, at: usize, to: usize) -> f32 {
        let mut farthest = splat(f32::NEG_INFINITY);
        for at in (at..=to).step_by(W) {
            let l = three!(K => load(some(&local[K], at)));
            for k in 0..3 {
                let d = add(
                    add(mul(splat(axes[0][k]), l[0]), mul(splat(axes[1][k]), l[1])),
                    mul(splat(axes[2][k]), l[2]),
                );
                let zero = lt(abs(d), splat(crate::task::TINY_COMPONENT));
                let d = select(zero, splat(0.0), d);
                *some_mut(&mut beams.direction[k], at) = store(d);
                let inverse = select(zero, splat(crate::bvh::FAR_INVERSE), div(splat(1.0), d));
                *some_mut(&mut beams.inverse[k], at) = store(inverse);
            }
            farthest = max(farthest, load(some(&beams.t, at)));
        }
        store(farthest).into_iter().fold(f32::NEG_INFINITY, f32::max)
    }
}
