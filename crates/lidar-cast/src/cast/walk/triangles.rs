//! Cuts the sixteen triangles of a block down to the beams that may hit them.

use bytemuck::Zeroable;

use super::angles::{Eye, Rects};
use super::grid::{Grid, Window};
use super::ops::{W, per_target, three};
use crate::bvh::bvh16::Block16;

/// Angle in radians by which an edge's plane may be turned through rounding: edges of at least
/// [`SHORTEST`] of the distance are turned by less than 2e-4, estimates add as much.
const TURNED: f32 = 4e-4;
const SHORTEST: f32 = 4e-3;

/// Sixteen triangles as seen from a sensor.
#[repr(align(64))]
#[derive(Zeroable)]
pub(super) struct TriangleView {
    /// Normals of the planes through the origin and an edge, in the sensor frame, by edge and axis; a
    /// beam passes inside where its products with all three are positive.
    pub(super) edges: [[[f32; W]; 3]; 3],
    /// Products below this may have the wrong sign.
    pub(super) doubt: [f32; W],
    /// For each edge: how far below zero its product with the middle of a beam may be of which some ray passes
    /// inside, from somewhere in the window.
    pub(super) margin: [[f32; W]; 3],
    /// Distance of the plane from the origin along the normal, as `Ray::intersect` has it.
    pub(super) above: [f32; W],
    /// Lower and upper corner of the bare box, from the origin.
    pub(super) sides: [[[f32; W]; 3]; 2],
    /// Azimuths from and to.
    azimuths: [[f32; W]; 2],
    /// A bit for each whose rows cannot be cut one by one.
    pub(super) uncut: u16,
    /// For each edge: the normal's azimuth, from the triangle's first and last one; how its plane
    /// rises, −n_z/n_xy; and how uncertain that is.
    begin: [[f32; W]; 3],
    end: [[f32; W]; 3],
    rise: [[f32; W]; 3],
    blur: [[f32; W]; 3],
}

per_target! {
    use super::{angles};

    /// Rectangles of a block's triangles, and edge planes for the hit tests.
    fn triangles(
        grid: &Grid, window: &Window, eye: &Eye, block: &Block16, out: &mut Rects, seen: &mut TriangleView
    ) {
        let corners = corners(eye, block);
        let local = three!(C => three!(K => along(corners[C], &eye.axes[K])));
        let whole = spread(grid, window, eye, block.valid, local, out, seen);
        let [low, high] = sides(eye, corners, out);
        seen.sides = [three!(K => store(low[K])), three!(K => store(high[K]))];
        // Added in the order of `Ray::intersect`, without fused operations.
        let n = three!(K => load(&block.normal[K]));
        let a = corners[0];
        let above = add(add(mul(n[0], a[0]), mul(n[1], a[1])), mul(n[2], a[2]));
        seen.above = store(above);
        edges(local, whole, out, seen);
    }

    /// Rectangles of a block's triangles for a moving eye, and edge planes with margins for its motion.
    fn outlines(
        grid: &Grid, window: &Window, eye: &Eye, block: &Block16, out: &mut Rects, seen: &mut TriangleView
    ) {
        let corners = corners(eye, block);
        let local = three!(C => three!(K => along(corners[C], &eye.axes[K])));
        let whole = spread(grid, window, eye, block.valid, local, out, seen);
        sides(eye, corners, out);
        if out.seen != 0 {
            edges(local, whole, out, seen);
            margins(eye, local, seen);
        }
    }

    /// How far an eye that moves by v and turns by τ may see a beam outside of an edge's plane that passes inside.
    ///
    /// With the corner at p and the edge e, n = p × e becomes n − v × e, and the beam d turns to d'. Products change
    /// by at most |n|·τ + v·|e|, and `doubt` by 6e-6·|p|·(v + τ·|p|) for the beams that lie farther off. Where
    /// the plane of the triangle is closer than v to the eye, it may be seen from either side, and anything goes.
    fn margins(eye: &Eye, local: [[V; 3]; 3], seen: &mut TriangleView) {
        let n = three!(E => three!(K => load(&seen.edges[E][K])));
        let lengths = three!(E => length(n[E]));
        let all = length(three!(K => add(add(n[0][K], n[1][K]), n[2][K])));
        let far = three!(C => length(local[C]));
        let far = max(max(far[0], far[1]), far[2]);
        let (moved, turned) = (splat(eye.moved), splat(eye.turned));
        let doubt = mul(mul(far, splat(6e-6)), fma(far, turned, moved));
        let doubt = add(doubt, load(&seen.doubt));
        // Six times the volume from the eye to the triangle, and its error bound.
        let volume = abs(dot(n[0], local[0]));
        let unsure = mul(mul(far, lengths[0]), splat(4e-6));
        let unsure = fma(mul(all, moved), splat(1.02), unsure);
        let unsure = le(volume, unsure);
        let edge = [
            three!(K => sub(local[2][K], local[1][K])),
            three!(K => sub(local[0][K], local[2][K])),
            three!(K => sub(local[1][K], local[0][K])),
        ];
        for k in 0..3 {
            let margin = fma(lengths[k], turned, mul(length(edge[k]), moved));
            let margin = fma(margin, splat(1.02), doubt);
            seen.margin[k] = store(select(unsure, splat(1e30), margin));
        }
    }

    fn length(v: [V; 3]) -> V {
        let square = max(dot(v, v), splat(1e-30));
        mul(square, rsqrt(square))
    }

    /// Corners from the origin.
    fn corners(eye: &Eye, block: &Block16) -> [[V; 3]; 3] {
        three!(C => three!(K => sub(load(&block.corners[C][K]), splat(eye.origin[K]))))
    }

    /// Lower and upper corner of the bare box, and from it how near triangles begin.
    fn sides(eye: &Eye, corners: [[V; 3]; 3], out: &mut Rects) -> [[V; 3]; 2] {
        let zero = splat(0.0);
        let low = three!(K => min(min(corners[0][K], corners[1][K]), corners[2][K]));
        let high = three!(K => max(max(corners[0][K], corners[1][K]), corners[2][K]));
        let outside = three!(K => max(max(low[K], sub(zero, high[K])), zero));
        let nearest = distance(outside, eye);
        out.distance = store(nearest);
        out.seen &= bits(le(nearest, splat(eye.farthest)));
        [low, high]
    }

    /// Rows and columns of triangles: those of their corners. A triangle that holds the pole has
    /// corners more than 2.5 rad apart; it, and one with a corner at the origin, is whole.
    ///
    /// Edges are great circles, which rise above both ends: tan e = A·cos(a − a₀), so by a factor of
    /// at most 1/cos(span/2).
    ///
    /// An eye that moves by v and turns by τ sees a corner at most g = v + τ·|p| beside where it is. The azimuth is
    /// then off by at most k = g/(ρ − g), the tangent by k·(1 + |tan|).
    fn spread(
        grid: &Grid, window: &Window, eye: &Eye, valid: u16, local: [[V; 3]; 3], out: &mut Rects,
        seen: &mut TriangleView
    ) -> M {
        let rho = three!(C => fma(local[C][0], local[C][0], mul(local[C][1], local[C][1])));
        let azimuth = three!(C => atan2(local[C][1], local[C][0]));
        let tangent = three!(C => mul(local[C][2], rsqrt(max(rho[C], splat(1e-12)))));
        let (zero, first) = (splat(0.0), azimuth[0]);
        let (b, c) = (wrap(sub(azimuth[1], first)), wrap(sub(azimuth[2], first)));
        let (mut low, mut high) = (min(min(b, c), zero), max(max(b, c), zero));
        let (mut lowest, mut highest) = (
            min(min(tangent[0], tangent[1]), tangent[2]),
            max(max(tangent[0], tangent[1]), tangent[2]),
        );
        let closest = min(min(rho[0], rho[1]), rho[2]);
        let mut whole = le(closest, splat(1e-12));
        if eye.is_swept() {
            let [(off_a, a), (off_b, b), (off_c, c)] =
                three!(C => (beside(eye, local[C], rho[C]), [zero, b, c][C]));
            low = min(min(sub(b, off_b), sub(c, off_c)), sub(a, off_a));
            high = max(max(add(b, off_b), add(c, off_c)), add(a, off_a));
            let off = [off_a, off_b, off_c];
            let rise = three!(C => mul(off[C], add(splat(1.0), abs(tangent[C]))));
            let lower = three!(C => sub(tangent[C], rise[C]));
            let upper = three!(C => add(tangent[C], rise[C]));
            lowest = min(min(lower[0], lower[1]), lower[2]);
            highest = max(max(upper[0], upper[1]), upper[2]);
            whole = either(whole, lt(splat(1.0), max(max(off_a, off_b), off_c)));
        }
        let span = sub(high, low);
        let whole = either(whole, lt(splat(2.5), span));
        // 1 − x²/8 ≤ cos(x/2)
        let cos = max(fnma(mul(span, span), splat(0.1251), splat(0.9999)), splat(0.05));
        let bulge = mul(rcp(cos), splat(1.0001));
        let lowest = select(lt(lowest, zero), mul(lowest, bulge), lowest);
        let highest = select(lt(zero, highest), mul(highest, bulge), highest);
        let azimuths = [add(first, low), add(first, high)];
        rects(grid, window, valid, whole, [lowest, highest], azimuths, out);
        seen.azimuths = [store(azimuths[0]), store(azimuths[1])];
        whole
    }

    /// k of a corner by its distance ρ² from the axis; 10⁶ where it is moved beyond the axis.
    fn beside(eye: &Eye, corner: [V; 3], rho: V) -> V {
        let square = max(fma(corner[2], corner[2], rho), splat(1e-12));
        let far = mul(mul(square, rsqrt(square)), splat(1.001));
        let grown = fma(far, splat(eye.turned), splat(eye.moved));
        let flat = max(rho, splat(1e-12));
        let near = fnma(grown, splat(1.001), mul(mul(flat, rsqrt(flat)), splat(0.999)));
        let off = mul(mul(grown, rcp(max(near, splat(1e-6)))), splat(1.001));
        select(lt(near, splat(1e-6)), splat(1e6), off)
    }

    /// Planes of the edges: v × (w − v), which does not cancel where corners are far away.
    ///
    /// With u = 2⁻²⁴, corners are off by 6·u·|v| and edges by twice that. Products with a beam at a
    /// distance r from the corners are off by less than u·|v|·(25·e + 45·r), with e the longest edge.
    /// The products of `Ray::intersect` are counted in. Beams of a rectangle pass within
    /// r ≤ e + 4e-3·|v| of the corners, or within |v| where it is whole.
    fn edges(local: [[V; 3]; 3], whole: M, out: &mut Rects, seen: &mut TriangleView) {
        let edge = [
            three!(K => sub(local[2][K], local[1][K])),
            three!(K => sub(local[0][K], local[2][K])),
            three!(K => sub(local[1][K], local[0][K])),
        ];
        let normal =
            [cross(local[1], edge[0]), cross(local[2], edge[1]), cross(local[0], edge[2])];
        // So that they point inwards from either side.
        let side = sign(dot(normal[0], local[0]));
        for (k, normal) in normal.into_iter().enumerate() {
            seen.edges[k] = three!(K => store(flip(normal[K], side)));
        }
        let squares = three!(K => dot(edge[K], edge[K]));
        let lengths = three!(K => dot(local[K], local[K]));
        let longest = max(max(squares[0], squares[1]), squares[2]);
        let shortest = min(min(squares[0], squares[1]), squares[2]);
        let far = max(max(lengths[0], lengths[1]), lengths[2]);
        let short = lt(shortest, mul(far, splat(SHORTEST * SHORTEST)));
        out.split |= bits(either(short, whole));
        seen.uncut = out.split;
        // |v|·(e + 4e-3·|v|) = √(|v|²·e²) + 4e-3·|v|²
        let product = mul(longest, far);
        let reach = select(whole, splat(1.0), splat(4e-3));
        let doubt = fma(far, reach, mul(product, rsqrt(max(product, splat(1e-30)))));
        let doubt = mul(doubt, splat(6e-6));
        // Too small to be sure of anything.
        let doubt = select(lt(product, splat(1e-24)), splat(1e30), doubt);
        seen.doubt = store(doubt);
    }

    /// Precomputes azimuth spans and slopes of a block's edges for [`rows`].
    fn prepare_rows(seen: &mut TriangleView) {
        let [from, to] = [load(&seen.azimuths[0]), load(&seen.azimuths[1])];
        for k in 0..3 {
            let n = three!(K => load(&seen.edges[k][K]));
            let azimuth = atan2(n[1], n[0]);
            let flat = max(fma(n[0], n[0], mul(n[1], n[1])), splat(1e-30));
            let all = fma(n[2], n[2], flat);
            let by_flat = rsqrt(flat);
            seen.begin[k] = store(wrap(sub(from, azimuth)));
            seen.end[k] = store(wrap(sub(to, azimuth)));
            seen.rise[k] = store(mul(sub(splat(0.0), n[2]), by_flat));
            let length = mul(all, rsqrt(all));
            seen.blur[k] = store(mul(mul(length, by_flat), splat(TURNED)));
        }
    }

    /// First and last column of a triangle in sixteen rows from a given one on.
    ///
    /// A row with tangent t is inside an edge's plane at azimuths φ ± acos(−n_z·t/n_xy) around that of
    /// the normal, φ.
    fn rows(
        grid: &Grid, window: &Window, seen: &TriangleView, rects: &Rects, slot: usize, row: usize
    ) -> [I; 2] {
        let some = grid.lookup.tangents[row..].first_chunk();
        let tangent = load(some.unwrap_or(&[0.0; W]));
        let (zero, one) = (splat(0.0), splat(1.0));
        let reach = add(one, abs(tangent));
        let (mut later, mut sooner) = (zero, zero);
        for k in 0..3 {
            let q = mul(tangent, splat(seen.rise[k][slot]));
            let q = fnma(reach, splat(seen.blur[k][slot]), q);
            let angle = add(acos(min(max(q, splat(-1.0)), one)), splat(2e-4));
            let (begin, end) = (splat(seen.begin[k][slot]), splat(seen.end[k][slot]));
            let (low, turn) = (sub(zero, angle), splat(std::f32::consts::TAU));
            let enters = select(lt(angle, begin), sub(turn, angle), low);
            let leaves = select(lt(end, low), sub(angle, turn), angle);
            later = max(later, sub(enters, begin));
            sooner = max(sooner, sub(end, leaves));
        }
        let per = splat(grid.columns.per_radian);
        let first = ceil_i(fma(later, per, splat(rects.exact[0][slot])));
        let last = floor_i(fnma(sooner, per, splat(rects.exact[1][slot])));
        let end = splat_i(window.columns as i32 - 1);
        [max_i(first, splat_i(0)), min_i(last, end)]
    }

    /// Within 1e-4 rad (Abramowitz and Stegun 4.4.45).
    fn acos(q: V) -> V {
        let x = abs(q);
        let p = fma(x, splat(-0.0187293), splat(0.074261));
        let p = fma(p, x, splat(-0.2121144));
        let p = fma(p, x, splat(1.5707288));
        let rest = max(sub(splat(1.0), x), splat(1e-12));
        let p = mul(p, mul(rest, rsqrt(rest)));
        select(lt(q, splat(0.0)), sub(splat(std::f32::consts::PI), p), p)
    }
}
