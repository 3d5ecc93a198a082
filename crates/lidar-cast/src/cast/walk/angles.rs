//! Angles of sixteen boxes or triangles, and the rectangles of beams that they span.

use bytemuck::Zeroable;

use super::TreeView;
use super::grid::{CELLS, Grid, Window};
use super::ops::{W, per_target, three};
use crate::bvh::bvh16::Node16;

/// Beams closer to the axis than this tangent allows may be off by any azimuth through rounding:
/// whatever reaches there counts for all columns.
const POLE: f32 = 100.0;
/// A tangent that is steeper than every beam.
const STEEPEST: f32 = 1e6;
/// More than a whole turn from end to end, in radians.
const ALL_AROUND: f32 = 4.0;

/// A sensor as the walk sees it.
pub(super) struct Eye {
    pub(super) origin: [f32; 3],
    /// The axes of the sensor frame in the frame of the tree.
    pub(super) axes: [[f32; 3]; 3],
    /// Error bound of distances, in metres: the pad of the tree's boxes.
    pub(super) pad: f32,
    /// No hit farther than this counts.
    pub(super) farthest: f32,
    /// Metres by which other places lie off the origin that beams leave, and radians by which they are turned.
    pub(super) moved: f32,
    pub(super) turned: f32,
}

impl Eye {
    /// A sensor that stands still.
    pub(super) fn of(part: &TreeView<'_>) -> Self {
        let rows = part.pose.rows;
        Self {
            origin: rows.map(|row| row[3]),
            axes: [0, 1, 2].map(|axis| rows.map(|row| row[axis])),
            pad: part.bvh.pad,
            farthest: f32::INFINITY,
            moved: 0.0,
            turned: 0.0,
        }
    }

    /// True if beams leave other places, too.
    pub(super) fn is_swept(&self) -> bool {
        self.moved > 0.0 || self.turned > 0.0
    }
}

/// Rows and columns that sixteen boxes or triangles may be seen by, and how near they begin.
#[repr(align(64))]
#[derive(Zeroable)]
pub(super) struct Rects {
    /// A bit for each that is seen by a beam.
    pub(super) seen: u16,
    /// A bit for each that fills both ends of the window, perhaps not its middle.
    pub(super) split: u16,
    /// First and last row and column.
    pub(super) rows: [[i32; W]; 2],
    pub(super) columns: [[i32; W]; 2],
    pub(super) distance: [f32; W],
    /// Where columns begin and end before they are rounded and cut to the window.
    pub(super) exact: [[f32; W]; 2],
}

per_target! {
    use super::{};

    /// Angle of (x, y) within 1e-4 rad (Abramowitz and Stegun 4.4.49, one term less).
    fn atan2(y: V, x: V) -> V {
        let (long, short) = (max(abs(x), abs(y)), min(abs(x), abs(y)));
        let z = mul(short, rcp(max(long, splat(1e-30))));
        let square = mul(z, z);
        let p = fma(splat(0.020_835_1), square, splat(-0.085133));
        let p = fma(p, square, splat(0.180141));
        let p = fma(p, square, splat(-0.330_299_5));
        let p = mul(fma(p, square, splat(0.999866)), z);
        let p = select(lt(abs(x), abs(y)), sub(splat(std::f32::consts::FRAC_PI_2), p), p);
        let p = select(lt(x, splat(0.0)), sub(splat(std::f32::consts::PI), p), p);
        flip(p, sign(y))
    }

    /// An angle less whole turns: from −π to π.
    fn wrap(angle: V) -> V {
        let turns = nearest(mul(angle, splat(1.0 / std::f32::consts::TAU)));
        fnma(turns, splat(std::f32::consts::TAU), angle)
    }

    fn dot(a: [V; 3], b: [V; 3]) -> V {
        fma(a[2], b[2], fma(a[1], b[1], mul(a[0], b[0])))
    }

    fn along(a: [V; 3], axis: &[f32; 3]) -> V {
        dot(a, three!(K => splat(axis[K])))
    }

    fn cross(a: [V; 3], b: [V; 3]) -> [V; 3] {
        [
            fnma(a[2], b[1], mul(a[1], b[2])),
            fnma(a[0], b[2], mul(a[2], b[0])),
            fnma(a[1], b[0], mul(a[0], b[1])),
        ]
    }

    /// Lower bound of a vector's length: rounding and motion are subtracted.
    fn distance(v: [V; 3], eye: &Eye) -> V {
        let square = max(dot(v, v), splat(1e-30));
        fma(mul(square, rsqrt(square)), splat(0.9998), splat(-2.0 * eye.pad - eye.moved))
    }

    /// Tangents and azimuths, from and to, as rows and columns of a window.
    ///
    /// Errors allowed: tangents 2.5e-4 of themselves plus 1e-5, azimuths as in `ColumnScale`.
    /// Triangles in `whole` get all rows and all columns.
    fn rects(
        grid: &Grid, window: &Window, valid: u16, whole: M,
        tangents: [V; 2], azimuths: [V; 2], rects: &mut Rects
    ) {
        let [low, high] = tangents;
        let pole = either(whole, either(lt(splat(POLE), high), lt(low, splat(-POLE))));
        let high = select(either(whole, lt(splat(POLE), high)), splat(STEEPEST), high);
        let low = select(either(whole, lt(low, splat(-POLE))), splat(-STEEPEST), low);
        let cells = [cells(grid, sub(low, margin(low))), cells(grid, add(high, margin(high)))];
        for i in 0..W {
            rects.rows[0][i] = grid.lookup.first[cells[0][i] as usize % CELLS];
            rects.rows[1][i] = grid.lookup.last[cells[1][i] as usize % CELLS];
        }
        let from = select(pole, splat(-ALL_AROUND), azimuths[0]);
        let to = select(pole, splat(ALL_AROUND), azimuths[1]);
        let scale = &grid.columns;
        let turn = splat(scale.turn);
        let from = sub(mul(from, splat(scale.per_radian)), splat(scale.low));
        let to = sub(mul(to, splat(scale.per_radian)), splat(scale.high));
        // Begins within the first turn, counted from the window; and a turn earlier.
        let turns = mul(floor(mul(from, splat(1.0 / scale.turn))), turn);
        let before = add(turns, splat(window.from as f32));
        let (from, to) = (sub(from, before), sub(to, before));
        let (early_from, early_to) = (sub(from, turn), sub(to, turn));
        let (none, end) = (splat_i(0), splat_i(window.columns as i32 - 1));
        let (a, b) = (max_i(ceil_i(from), none), min_i(floor_i(to), end));
        let (c, d) = (max_i(ceil_i(early_from), none), min_i(floor_i(early_to), end));
        let (late, early) = (le_i(a, b), le_i(c, d));
        let split = both(late, early);
        let first = select_i(split, none, select_i(early, c, a));
        let last = select_i(split, end, select_i(early, d, b));
        rects.columns = [store_i(first), store_i(last)];
        rects.exact = [store(select(early, early_from, from)), store(select(early, early_to, to))];
        rects.split = bits(either(split, pole));
        let rows = le_i(load_i(&rects.rows[0]), load_i(&rects.rows[1]));
        rects.seen = valid & bits(both(rows, either(late, early)));
    }

    fn margin(tangent: V) -> V {
        fma(abs(tangent), splat(2.5e-4), splat(1e-5))
    }

    /// Cells of the measure t / (1 + |t|).
    fn cells(grid: &Grid, tangent: V) -> [i32; W] {
        let measure = mul(tangent, rcp(add(splat(1.0), abs(tangent))));
        let from = sub(measure, splat(grid.lookup.from));
        let cell = mul(from, splat(grid.lookup.per_measure));
        store_i(floor_i(min(max(cell, splat(0.0)), splat((CELLS - 1) as f32))))
    }

    /// Rectangles of a node's children.
    ///
    /// A box with middle m is bounded by its half extents H along d = m/|m|, s = k × m/ρ and e = d × s.
    /// Here k is the sensor's axis, and ρ the distance of m from it. All of the box lies
    ///
    /// - at distances from the axis of at least ρ_min = (|m| − H_d)·cos − H_e·|sin|;
    /// - at azimuths within H_s/ρ_min of the middle's;
    /// - seen from the side, at elevations within ψ = atan(H_e/(|m| − H_d)) of the middle's.
    ///
    /// The addition theorem gives tan(e ± ψ). An azimuth to the side lowers a tangent by a factor of at
    /// least 1 − q²/2.
    ///
    /// An eye that moves by v and turns by τ sees a point at p at most v + τ·|p| beside its direction for an
    /// eye at rest. All half extents grow by that, |p| being at most |m| + H_d + H_s + H_e.
    fn boxes(grid: &Grid, window: &Window, eye: &Eye, node: &Node16, out: &mut Rects) {
        let m = three!(K => sub(load(&node.middle[K]), splat(eye.origin[K])));
        let h = three!(K => load(&node.half[K]));
        let x = along(m, &eye.axes[0]);
        let y = along(m, &eye.axes[1]);
        let z = along(m, &eye.axes[2]);
        let rho_square = max(fma(x, x, mul(y, y)), splat(1e-12));
        let square = fma(z, z, rho_square);
        let (by_rho, by_length) = (rsqrt(rho_square), rsqrt(square));
        let d = three!(K => mul(m[K], by_length));
        let s = cross(three!(K => splat(eye.axes[2][K])), m);
        let s = three!(K => mul(s[K], by_rho));
        let e = cross(d, s);
        // Reciprocal roots are estimates: extents grow by a thousandth.
        let fat = splat(1.001);
        let deep = mul(dot(three!(K => abs(d[K])), h), fat);
        let wide = mul(dot(three!(K => abs(s[K])), h), fat);
        let tall = mul(dot(three!(K => abs(e[K])), h), fat);
        let (mut deep, mut wide, mut tall) = (deep, wide, tall);
        if eye.is_swept() {
            let far = fma(square, by_length, add(deep, add(wide, tall)));
            let grown = fma(mul(far, fat), splat(eye.turned), splat(eye.moved));
            (deep, wide, tall) = (add(deep, grown), add(wide, grown), add(tall, grown));
        }
        let near = sub(mul(mul(square, by_length), splat(0.999)), deep);
        let sin = mul(z, by_length);
        let cos = mul(mul(rho_square, by_rho), by_length);
        let rho_min = fnma(tall, abs(sin), mul(near, cos));
        let one = splat(1.0);
        let q = mul(mul(wide, rcp(rho_min)), fat);
        let whole = either(le(near, splat(0.0)), lt(rho_min, splat(1e-6)));
        let whole = either(whole, lt(splat(3.0), q));
        let (tangent, psi) = (mul(z, by_rho), mul(tall, rcp(near)));
        let product = mul(tangent, psi);
        let high = mul(add(tangent, psi), rcp(sub(one, product)));
        let low = mul(sub(tangent, psi), rcp(add(one, product)));
        // Beyond the pole tangents turn round.
        let high = select(lt(sub(one, product), splat(1e-3)), splat(1e6), high);
        let low = select(lt(add(one, product), splat(1e-3)), splat(-1e6), low);
        let shrink = max(fnma(mul(q, q), splat(0.5), one), splat(0.0));
        let high = select(lt(high, splat(0.0)), mul(high, shrink), high);
        let low = select(lt(splat(0.0), low), mul(low, shrink), low);
        let azimuth = atan2(y, x);
        let azimuths = [sub(azimuth, q), add(azimuth, q)];
        rects(grid, window, node.valid, whole, [low, high], azimuths, out);
        let outside = three!(K => max(sub(abs(m[K]), h[K]), splat(0.0)));
        let nearest = distance(outside, eye);
        out.distance = store(nearest);
        out.seen &= bits(le(nearest, splat(eye.farthest)));
    }
}
