//! Triangles against the rays of a packet, a lane a ray.

use super::packet::{Bounds, PACKET_RAYS, Packet, least, most};
use super::{Hit, Triangle};

/// `Ray::intersect` for every lane; returns the farthest of the best distances.
#[inline(always)]
pub(super) fn intersect(
    triangle: &Triangle,
    pad: f32,
    bounds: &Bounds,
    packet: &mut Packet,
    farthest: f32,
) -> f32 {
    let corners = [triangle.a, triangle.b, triangle.c];
    if passes_beside(&corners, packet, bounds) {
        return farthest;
    }
    let mut inside = [0_u32; PACKET_RAYS];
    if !inside_edges(&corners, packet, &mut inside) {
        return farthest;
    }
    let (mut low, mut high) = (triangle.a, triangle.a);
    for k in 0..3 {
        low[k] = least(least(low[k], triangle.b[k]), triangle.c[k]);
        high[k] = most(most(high[k], triangle.b[k]), triangle.c[k]);
    }
    let beside = distances(triangle, low, high, packet, &inside);
    if beside {
        retry(triangle, pad, packet, &inside, low, high);
    }
    packet.farthest(bounds)
}

/// Whether all rays surely miss a triangle, on the outer side of one of its edges.
///
/// Seen along a ray, a corner lies at its coordinates less shear times depth. An edge function is
/// affine in the origin and in the shear but for their product, so its spread over the packet is a
/// sum of absolute values.
#[inline(always)]
fn passes_beside(corners: &[[f32; 3]; 3], packet: &Packet, bounds: &Bounds) -> bool {
    let axes = [(packet.major + 1) % 3, (packet.major + 2) % 3, packet.major];
    let (middle, half, shear, turn) = (bounds.middle, bounds.half, bounds.shear, bounds.turn);
    let seen = |corner: &[f32; 3]| {
        let z = corner[axes[2]] - middle[2];
        let x = corner[axes[0]] - middle[0] - shear[0] * z;
        let y = corner[axes[1]] - middle[1] - shear[1] * z;
        [x, y, z]
    };
    let (a, b, c) = (seen(&corners[0]), seen(&corners[1]), seen(&corners[2]));
    let deepest = most(most(a[2].abs(), b[2].abs()), c[2].abs());
    let size = |p: [f32; 3]| p[0].abs() + p[1].abs();
    let widest = half[0] + half[1] + deepest * (turn[0] + turn[1]);
    let error = 2.0 * bounds.slack * (size(a) + size(b) + size(c) + widest);
    let edge = |from: [f32; 3], to: [f32; 3]| {
        let turned = turn[0] * (from[2] * to[1] - to[2] * from[1]).abs()
            + turn[1] * (to[2] * from[0] - from[2] * to[0]).abs();
        let moved = (to[1] - from[1]).abs() * half[0] + (to[0] - from[0]).abs() * half[1];
        let both = (turn[0] * half[1] + turn[1] * half[0]) * (to[2] - from[2]).abs();
        (from[0] * to[1] - from[1] * to[0], turned, turned + moved + both + error)
    };
    let (u, v, w) = (edge(a, b), edge(b, c), edge(c, a));
    let area = u.0 + v.0 + w.0;
    let doubt = u.1 + v.1 + w.1 + 4.0 * error;
    if area > doubt {
        (u.0 + u.2 < 0.0) | (v.0 + v.2 < 0.0) | (w.0 + w.2 < 0.0)
    } else if area < -doubt {
        (u.0 - u.2 > 0.0) | (v.0 - v.2 > 0.0) | (w.0 - w.2 > 0.0)
    } else {
        false
    }
}

/// Marks the lanes whose ray passes between the edges; whether there are any.
#[inline(always)]
fn inside_edges(corners: &[[f32; 3]; 3], packet: &Packet, inside: &mut [u32; PACKET_RAYS]) -> bool {
    let lanes = packet.lanes();
    let axes = [(packet.major + 1) % 3, (packet.major + 2) % 3, packet.major];
    let at = |corner: &[f32; 3]| [corner[axes[0]], corner[axes[1]], corner[axes[2]]];
    let (a, b, c) = (at(&corners[0]), at(&corners[1]), at(&corners[2]));
    let ox = &packet.origin[axes[0]][..lanes];
    let oy = &packet.origin[axes[1]][..lanes];
    let oz = &packet.origin[axes[2]][..lanes];
    let [sx, sy] = [&packet.shear[0][..lanes], &packet.shear[1][..lanes]];
    let inside = &mut inside[..lanes];
    let mut any = 0;
    for i in 0..lanes {
        let (az, bz, cz) = (a[2] - oz[i], b[2] - oz[i], c[2] - oz[i]);
        let (ax, ay) = ((a[0] - ox[i]) - sx[i] * az, (a[1] - oy[i]) - sy[i] * az);
        let (bx, by) = ((b[0] - ox[i]) - sx[i] * bz, (b[1] - oy[i]) - sy[i] * bz);
        let (cx, cy) = ((c[0] - ox[i]) - sx[i] * cz, (c[1] - oy[i]) - sy[i] * cz);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let outside = ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0));
        let det = u + v + w;
        let passes = u32::from(!outside & (det != 0.0));
        inside[i] = passes;
        any |= passes;
    }
    any != 0
}

/// Takes over the distances of marked lanes where they are best; whether a lane passes beside the
/// bare box, so that the padded one decides.
#[inline(always)]
fn distances(
    triangle: &Triangle,
    low: [f32; 3],
    high: [f32; 3],
    packet: &mut Packet,
    inside: &[u32; PACKET_RAYS],
) -> bool {
    let lanes = packet.lanes();
    let ox = &packet.origin[0][..lanes];
    let oy = &packet.origin[1][..lanes];
    let oz = &packet.origin[2][..lanes];
    let dx = &packet.direction[0][..lanes];
    let dy = &packet.direction[1][..lanes];
    let dz = &packet.direction[2][..lanes];
    let ix = &packet.inverse[0][..lanes];
    let iy = &packet.inverse[1][..lanes];
    let iz = &packet.inverse[2][..lanes];
    let (best, prim) = (&mut packet.t[..lanes], &mut packet.prim[..lanes]);
    let inside = &inside[..lanes];
    let (n, a, id) = (triangle.normal, triangle.a, triangle.prim);
    let mut any_beside = 0;
    for i in 0..lanes {
        let (x0, x1) = ((low[0] - ox[i]) * ix[i], (high[0] - ox[i]) * ix[i]);
        let (y0, y1) = ((low[1] - oy[i]) * iy[i], (high[1] - oy[i]) * iy[i]);
        let (z0, z1) = ((low[2] - oz[i]) * iz[i], (high[2] - oz[i]) * iz[i]);
        let enter = most(most(most(least(x0, x1), least(y0, y1)), least(z0, z1)), 0.0);
        let leave = least(least(most(x0, x1), most(y0, y1)), most(z0, z1));
        let towards = n[0] * dx[i] + n[1] * dy[i] + n[2] * dz[i];
        let above = n[0] * (a[0] - ox[i]) + n[1] * (a[1] - oy[i]) + n[2] * (a[2] - oz[i]);
        let quotient = above / towards;
        let t = least(most(quotient, enter), leave);
        let closer = (t < best[i]) | ((t == best[i]) & (id < prim[i]));
        let ahead = (towards != 0.0) & ((quotient > 0.0) | quotient.is_nan()) & (inside[i] != 0);
        let beside = enter > leave;
        let takes = ahead & (t > 0.0) & closer & !beside;
        best[i] = if takes { t } else { best[i] };
        prim[i] = if takes { id } else { prim[i] };
        any_beside |= u32::from(beside & ahead);
    }
    any_beside != 0
}

/// Asks `Ray::intersect` itself for the marked lanes that pass beside the bare box.
#[cold]
#[inline(never)]
fn retry(
    triangle: &Triangle,
    pad: f32,
    packet: &mut Packet,
    inside: &[u32; PACKET_RAYS],
    low: [f32; 3],
    high: [f32; 3],
) {
    for lane in (0..packet.lanes()).filter(|&lane| inside[lane] != 0) {
        let ray = packet.ray(lane);
        let (enter, leave) = ray.slab(low.into(), high.into());
        if enter > leave {
            let mut best = Hit { t: packet.t[lane], prim: packet.prim[lane] };
            ray.intersect(triangle, pad, &mut best);
            (packet.t[lane], packet.prim[lane]) = (best.t, best.prim);
        }
    }
}
