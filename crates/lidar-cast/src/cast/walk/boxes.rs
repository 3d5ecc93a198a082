//! The beams that may meet the sixteen boxes of a node.

use super::angles::{Eye, Rects};
use super::grid::{Grid, Window};
use super::ops::{per_target, three};
use crate::bvh::bvh16::Node16;

per_target! {
    use super::{angles};

    /// Rectangles of a node's children.
    ///
    /// A box with middle m is bounded in the frame d = m/|m|, s = k × m/ρ, e = d × s, with k the
    /// sensor's axis and ρ the distance from it, by its half extents H along these three. All of it
    /// lies at distances from the axis of at least ρ_min = (|m| − H_d)·cos − H_e·|sin|, at azimuths
    /// within H_s/ρ_min, and, seen from the side, at elevations within ψ = atan(H_e/(|m| − H_d)) of
    /// the middle's; tan(e ± ψ) by the addition theorem. An azimuth to the side lowers a tangent by a
    /// factor of at least 1 − q²/2.
    ///
    /// Seen by an eye that moves by v and turns by τ, a point at p lies at most v + τ·|p| beside where it is seen
    /// else: all half extents grow by that, |p| being at most |m| + H_d + H_s + H_e.
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
