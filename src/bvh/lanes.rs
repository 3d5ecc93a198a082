//! Triangles against the rays of a chunk, a lane a ray.

use super::packet::{CHUNK, Lanes, Packet, least, most};
use super::{Hit, Triangle};

/// A number that depends on the direction alone.
#[inline(always)]
fn turned<const PARALLEL: bool>(lanes: &Lanes, chunk: usize, i: usize) -> f32 {
    if PARALLEL { lanes[0][0] } else { lanes[chunk][i] }
}

/// `Ray::intersect` for every ray of a chunk; whether one passes between the triangle's edges.
#[inline(always)]
pub(super) fn intersect<const PARALLEL: bool>(
    triangle: &Triangle,
    pad: f32,
    packet: &mut Packet,
    chunk: usize,
) -> bool {
    let mut inside = [0; CHUNK];
    if !inside_edges::<PARALLEL>(triangle, packet, chunk, &mut inside) {
        return false;
    }
    let (mut low, mut high) = (triangle.a, triangle.a);
    for k in 0..3 {
        low[k] = least(least(low[k], triangle.b[k]), triangle.c[k]);
        high[k] = most(most(high[k], triangle.b[k]), triangle.c[k]);
    }
    if distances::<PARALLEL>(triangle, low, high, packet, chunk, &inside) {
        retry(triangle, pad, packet, chunk, &inside, low, high);
    }
    true
}

/// Marks the lanes whose ray passes between the edges; whether there are any.
#[inline(always)]
fn inside_edges<const PARALLEL: bool>(
    triangle: &Triangle,
    packet: &Packet,
    chunk: usize,
    inside: &mut [u32; CHUNK],
) -> bool {
    let axes = packet.axes();
    let at = |corner: &[f32; 3]| [corner[axes[0]], corner[axes[1]], corner[axes[2]]];
    let (a, b, c) = (at(&triangle.a), at(&triangle.b), at(&triangle.c));
    let ox = &packet.origin[axes[0]][chunk];
    let oy = &packet.origin[axes[1]][chunk];
    let oz = &packet.origin[axes[2]][chunk];
    let mut any = 0;
    for i in 0..CHUNK {
        let sx = turned::<PARALLEL>(&packet.shear[0], chunk, i);
        let sy = turned::<PARALLEL>(&packet.shear[1], chunk, i);
        let (az, bz, cz) = (a[2] - oz[i], b[2] - oz[i], c[2] - oz[i]);
        let (ax, ay) = ((a[0] - ox[i]) - sx * az, (a[1] - oy[i]) - sy * az);
        let (bx, by) = ((b[0] - ox[i]) - sx * bz, (b[1] - oy[i]) - sy * bz);
        let (cx, cy) = ((c[0] - ox[i]) - sx * cz, (c[1] - oy[i]) - sy * cz);
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
fn distances<const PARALLEL: bool>(
    triangle: &Triangle,
    low: [f32; 3],
    high: [f32; 3],
    packet: &mut Packet,
    chunk: usize,
    inside: &[u32; CHUNK],
) -> bool {
    let [ox, oy, oz] = &packet.origin;
    let (ox, oy, oz) = (&ox[chunk], &oy[chunk], &oz[chunk]);
    let (best, prim) = (&mut packet.hits.t[chunk], &mut packet.hits.prim[chunk]);
    let (n, a, id) = (triangle.normal, triangle.a, triangle.prim);
    let mut any_beside = 0;
    for i in 0..CHUNK {
        let dx = turned::<PARALLEL>(&packet.direction[0], chunk, i);
        let dy = turned::<PARALLEL>(&packet.direction[1], chunk, i);
        let dz = turned::<PARALLEL>(&packet.direction[2], chunk, i);
        let ix = turned::<PARALLEL>(&packet.inverse[0], chunk, i);
        let iy = turned::<PARALLEL>(&packet.inverse[1], chunk, i);
        let iz = turned::<PARALLEL>(&packet.inverse[2], chunk, i);
        let (x0, x1) = ((low[0] - ox[i]) * ix, (high[0] - ox[i]) * ix);
        let (y0, y1) = ((low[1] - oy[i]) * iy, (high[1] - oy[i]) * iy);
        let (z0, z1) = ((low[2] - oz[i]) * iz, (high[2] - oz[i]) * iz);
        let enter = most(most(most(least(x0, x1), least(y0, y1)), least(z0, z1)), 0.0);
        let leave = least(least(most(x0, x1), most(y0, y1)), most(z0, z1));
        let towards = n[0] * dx + n[1] * dy + n[2] * dz;
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
    chunk: usize,
    inside: &[u32; CHUNK],
    low: [f32; 3],
    high: [f32; 3],
) {
    for i in (0..CHUNK).filter(|&i| inside[i] != 0) {
        let ray = packet.ray(chunk, i);
        let (enter, leave) = ray.slab(low.into(), high.into());
        if enter > leave {
            let mut best = Hit { t: packet.hits.t[chunk][i], prim: packet.hits.prim[chunk][i] };
            ray.intersect(triangle, pad, &mut best);
            (packet.hits.t[chunk][i], packet.hits.prim[chunk][i]) = (best.t, best.prim);
        }
    }
}
