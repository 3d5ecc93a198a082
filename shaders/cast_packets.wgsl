// cast_packets: one invocation casts one direction from up to PACKET_RAYS sensors of one rotation.
//
// CPU twin   src/backend/cpu/packets.rs::cast_packets, src/bvh/{packet,bounds,lanes}.rs
// Reads      poses, directions, blocks (where the order of sensors begins that is best for a workgroup's
//            directions, and the block of these), slots (sensors in that order by four, NO_SLOT for
//            none), origins (x, y and z of each four), tree
// Writes     hits[sensors × direction_count] of the sensors in slots; marks[packets]: which beams hit,
//            and which are left to the host (their prim is UNFINISHED)
// Constants  BEAMS_SIFTED: a triangle is tested for those beams only that may hit it, which its edges tell;
//            for scenes whose triangles are smaller than a packet is wide
// Dispatch   (packets of sensors, ceil(direction_count / WORKGROUP_SIZE))
// Numerics   that of cast_closest; beams that pass beside a box through rounding are UNFINISHED

const BEAMS_SPREAD: bool = false;
const SIFTS: bool = BEAMS_SIFTED;

const RAYS: u32 = 4u * PACKET_FOURS;

// The packet, a number a beam: origins, turned so that the major axis is the last; where beams cross the
// plane of the bounds, from the middle of all; best hits, and how far it is to them from that plane. Only
// sifted beams are looked up by their index.
var<private> origin_x: array<f32, RAYS>;
var<private> origin_y: array<f32, RAYS>;
var<private> origin_z: array<f32, RAYS>;
var<private> cross_x: array<f32, RAYS>;
var<private> cross_y: array<f32, RAYS>;
var<private> best_t: array<f32, RAYS>;
var<private> best_prim: array<u32, RAYS>;
var<private> reach: array<f32, RAYS>;

struct Way {
    direction: vec3<f32>,
    major: u32,
    // Turned as the origins.
    inverse: vec3<f32>,
    shear: vec2<f32>,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> poses: array<DevicePose>;
@group(0) @binding(2) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> blocks: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> slots: array<vec4<u32>>;
@group(0) @binding(5) var<storage, read> origins: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(7) var<storage, read_write> marks: array<vec4<u32>>;
@group(0) @binding(8) var tree: texture_storage_2d<rgba32uint, read>;

fn new_way(direction: vec3<f32>) -> Way {
    let major = major_axis(direction);
    let d = permute(direction, major);
    let inverse = vec3(safe_inverse(d.x), safe_inverse(d.y), safe_inverse(d.z));
    return Way(direction, major, inverse, vec2(d.x / d.z, d.y / d.z));
}

fn load_four(k: u32, at: u32, major: u32) {
    let x = origins[3u * at];
    let y = origins[3u * at + 1u];
    let z = origins[3u * at + 2u];
    let first = major == 0u;
    let second = major == 1u;
    let third = major == 2u;
    let turned_x = select(x, y, first);
    let turned_y = select(z, y, third);
    let turned_z = select(select(z, y, second), x, first);
    for (var lane = 0u; lane < 4u; lane++) {
        origin_x[4u * k + lane] = turned_x[lane];
        origin_y[4u * k + lane] = turned_y[lane];
        origin_z[4u * k + lane] = turned_z[lane];
        best_t[4u * k + lane] = uniforms.range;
        best_prim[4u * k + lane] = NO_HIT;
    }
}

fn four_of(numbers: ptr<private, array<f32, RAYS>>, k: u32) -> vec4<f32> {
    let at = 4u * k;
    return vec4((*numbers)[at], (*numbers)[at + 1u], (*numbers)[at + 2u], (*numbers)[at + 3u]);
}

// A triangle as all beams of a packet see it, turned as the beams.
struct Seen {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    // The corners of its box that are met first and last.
    near: vec3<f32>,
    far: vec3<f32>,
    normal: vec3<f32>,
    towards: f32,
    prim: u32,
}

fn new_seen(triangle: Triangle, way: Way) -> Seen {
    let a = permute(triangle.a, way.major);
    let b = permute(triangle.b, way.major);
    let c = permute(triangle.c, way.major);
    let low = min(min(a, b), c);
    let high = max(max(a, b), c);
    let backward = way.inverse < vec3(0.0);
    let near = select(low, high, backward);
    let far = select(high, low, backward);
    let towards = dot_in_order(triangle.normal, way.direction);
    // No hit is ahead of beams along the plane: all heights become zero.
    let normal = permute(select(triangle.normal, vec3(0.0), towards == 0.0), way.major);
    return Seen(a, b, c, near, far, normal, select(towards, 1.0, towards == 0.0), triangle.prim);
}

fn lower(a: f32, b: f32) -> f32 {
    return select(b, a, a < b);
}

fn higher(a: f32, b: f32) -> f32 {
    return select(b, a, a > b);
}

// Tests one beam of the packet after one triangle (Woop, Benthin, Wald 2013).
fn intersect(beam: u32, way: Way, plane: f32, seen: Seen) {
    let x = origin_x[beam];
    let y = origin_y[beam];
    let z = origin_z[beam];
    let old_t = best_t[beam];
    let old_prim = best_prim[beam];
    let dx = seen.a.x - x;
    let dy = seen.a.y - y;
    let az = seen.a.z - z;
    let bz = seen.b.z - z;
    let cz = seen.c.z - z;
    let ax = dx - way.shear.x * az;
    let ay = dy - way.shear.y * az;
    let bx = (seen.b.x - x) - way.shear.x * bz;
    let by = (seen.b.y - y) - way.shear.y * bz;
    let cx = (seen.c.x - x) - way.shear.x * cz;
    let cy = (seen.c.y - y) - way.shear.y * cz;
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    // On one side of all edges; on both only where all three are zero.
    let inside = (lower(lower(u, v), w) >= 0.0) != (higher(higher(u, v), w) <= 0.0);

    let enter = higher(
        higher((seen.near.x - x) * way.inverse.x, (seen.near.y - y) * way.inverse.y),
        higher((seen.near.z - z) * way.inverse.z, 0.0),
    );
    let leave = lower(
        lower((seen.far.x - x) * way.inverse.x, (seen.far.y - y) * way.inverse.y),
        (seen.far.z - z) * way.inverse.z,
    );
    // Added in the order of the axes as they were before.
    let across = seen.normal.y * dy;
    let ahead_of = seen.normal.z * az;
    let upright = way.major == 2u;
    let height =
        seen.normal.x * dx + select(ahead_of, across, upright) + select(across, ahead_of, upright);
    let quotient = height / seen.towards;
    let t = lower(higher(quotient, enter), leave);
    let closer = (t < old_t) | ((t == old_t) & (seen.prim < old_prim));
    let ahead = inside & (quotient > 0.0);
    // The host decides what passes beside the bare box: that of a padded one costs a fifth of this.
    let beside = ahead & (enter > leave);
    let is_hit = ahead & (t > 0.0) & closer;
    let new_t = select(select(old_t, t, is_hit), -1.0, beside);
    best_t[beam] = new_t;
    best_prim[beam] = select(select(old_prim, seen.prim, is_hit), UNFINISHED, beside);
    reach[beam] = new_t - (plane - z) * way.inverse.z;
}

// Three lines on the plane of the bounds, on one side of which all beams cross it that may hit a triangle:
// start + along_x · x + along_y · y is not negative.
struct Sieve {
    start: vec3<f32>,
    along_x: vec3<f32>,
    along_y: vec3<f32>,
}

// The sieve of a triangle. All that is rounded on the way to an edge function, here and in `intersect`,
// moves a corner by less than fourteen units in the last place of the largest coordinate, and the products
// add no more than as much again: twice sixteen are allowed for.
fn new_sieve(bounds: Bounds, largest: f32, seen: Seen) -> Sieve {
    let a = seen.a.xy - bounds.middle - bounds.shear * (seen.a.z - bounds.plane);
    let b = seen.b.xy - bounds.middle - bounds.shear * (seen.b.z - bounds.plane);
    let c = seen.c.xy - bounds.middle - bounds.shear * (seen.c.z - bounds.plane);
    let reach = max(abs(seen.near), abs(seen.far));
    let off = PAD_SHARE * (max(max(reach.x, reach.y), reach.z) + largest);
    let size = abs(a) + abs(b) + abs(c) + bounds.half;
    let error = 2.0 * off * (size.x + size.y);
    let edges = vec3(a.x * b.y - a.y * b.x, b.x * c.y - b.y * c.x, c.x * a.y - c.y * a.x);
    let area = edges.x + edges.y + edges.z;
    let sign = select(1.0, -1.0, area < 0.0);
    var start = sign * edges + error;
    var along_x = sign * vec3(a.y - b.y, b.y - c.y, c.y - a.y);
    var along_y = sign * vec3(b.x - a.x, c.x - b.x, a.x - c.x);
    // Seen edge-on, where rounding alone gives edge functions their signs: hits are inside its padded box, of
    // which both sides count along the axis where it is narrower.
    if abs(area) <= 4.0 * error {
        let first = bounds.shear * (seen.near.z - bounds.plane);
        let last = bounds.shear * (seen.far.z - bounds.plane);
        let margin = 2.0 * (off + uniforms.pad);
        let low = min(seen.near.xy, seen.far.xy) - bounds.middle - max(first, last) - margin;
        let high = max(seen.near.xy, seen.far.xy) - bounds.middle - min(first, last) + margin;
        let upright = high.x - low.x < high.y - low.y;
        start = select(vec3(-low.y, high.y, -low.x), vec3(-low.x, high.x, -low.y), upright);
        along_x = select(vec3(0.0, 0.0, 1.0), vec3(1.0, -1.0, 0.0), upright);
        along_y = select(vec3(1.0, -1.0, 0.0), vec3(0.0, 0.0, 1.0), upright);
    }
    return Sieve(start, along_x, along_y);
}

// Which of four beams pass through the sieve and go at least so far.
fn passes(k: u32, sieve: Sieve, nearest: f32) -> vec4<bool> {
    let x = four_of(&cross_x, k);
    let y = four_of(&cross_y, k);
    let u = sieve.start.x + sieve.along_x.x * x + sieve.along_y.x * y;
    let v = sieve.start.y + sieve.along_x.y * x + sieve.along_y.y * y;
    let w = sieve.start.z + sieve.along_x.z * x + sieve.along_y.z * y;
    let zero = vec4(0.0);
    return (u >= zero) & (v >= zero) & (w >= zero) & (four_of(&reach, k) >= vec4(nearest));
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn cast_packets(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let block = blocks[group.y];
    let beam = block.y * WORKGROUP_SIZE + local;
    if beam >= uniforms.direction_count {
        return;
    }
    let first = block.x + group.x * PACKET_FOURS;
    let way = new_way(beam_direction(poses[slots[first].x], directions[beam].xyz));
    var low = vec4(UNBOUNDED);
    var high = vec4(-UNBOUNDED);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        load_four(k, first + k, way.major);
        low = least(low, four_of(&origin_z, k));
        high = most(high, four_of(&origin_z, k));
    }
    // Hits lie a row apart from sensor to sensor. Loads bring their cache lines at the same time, each lane
    // those of other sensors; stores would wait for one line after the other.
    let lane = local % 8u;
    var loaded = 0u;
    for (var k = 0u; k < PACKET_FOURS / 2u; k++) {
        let sensor = slots[first + 2u * k + lane / 4u][lane % 4u];
        loaded |= hits[sensor * uniforms.direction_count + beam - lane].prim;
    }
    // Beams are moved to where they cross a plane amid the origins.
    let plane = 0.5 * (least_of(low) + most_of(high));
    var low_x = vec4(UNBOUNDED);
    var high_x = vec4(-UNBOUNDED);
    var low_y = vec4(UNBOUNDED);
    var high_y = vec4(-UNBOUNDED);
    var low_shift = vec4(UNBOUNDED);
    var high_shift = vec4(-UNBOUNDED);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let before = plane - four_of(&origin_z, k);
        let x = four_of(&origin_x, k) + way.shear.x * before;
        let y = four_of(&origin_y, k) + way.shear.y * before;
        let shift = before * way.inverse.z;
        low_x = least(low_x, x);
        high_x = most(high_x, x);
        low_y = least(low_y, y);
        high_y = most(high_y, y);
        low_shift = least(low_shift, shift);
        high_shift = most(high_shift, shift);
    }
    let shift = vec2(least_of(low_shift), most_of(high_shift));
    let bounds = new_bounds(
        way.major,
        plane,
        vec2(least_of(low_x), least_of(low_y)),
        vec2(most_of(high_x), most_of(high_y)),
        way.shear,
        way.shear,
        way.inverse,
        way.inverse,
        shift,
    );
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let before = plane - four_of(&origin_z, k);
        let x = four_of(&origin_x, k) + way.shear.x * before - bounds.middle.x;
        let y = four_of(&origin_y, k) + way.shear.y * before - bounds.middle.y;
        for (var lane = 0u; lane < 4u; lane++) {
            cross_x[4u * k + lane] = x[lane];
            cross_y[4u * k + lane] = y[lane];
            reach[4u * k + lane] = uniforms.range - before[lane] * way.inverse.z;
        }
    }
    let sides = abs(bounds.middle) + bounds.half;
    let largest = max(sides.x, sides.y) + abs(plane) + max(abs(shift.x), abs(shift.y));
    var farthest = uniforms.range - shift.x + bounds.slack;
    var triangle: Triangle;
    while next_triangle(bounds, farthest, &triangle) {
        let seen = new_seen(triangle, way);
        if BEAMS_SIFTED {
            let sieve = new_sieve(bounds, largest, seen);
            let corners = (vec3(seen.a.z, seen.b.z, seen.c.z) - bounds.near_plane) * way.inverse.z;
            let nearest = min(min(corners.x, corners.y), corners.z) - bounds.slack;
            var may = vec2(0u);
            for (var k = 0u; k < PACKET_FOURS; k++) {
                may |= marks_of(passes(k, sieve, nearest), k);
            }
            loop {
                if (may.x | may.y) == 0u {
                    break;
                }
                steps++;
                let in_first = may.x != 0u;
                let word = select(may.y, may.x, in_first);
                let rest = word & (word - 1u);
                may = select(vec2(0u, rest), vec2(rest, may.y), in_first);
                intersect(firstTrailingBit(word) + select(32u, 0u, in_first), way, plane, seen);
            }
        } else {
            for (var k = 0u; k < PACKET_FOURS; k++) {
                intersect(4u * k, way, plane, seen);
                intersect(4u * k + 1u, way, plane, seen);
                intersect(4u * k + 2u, way, plane, seen);
                intersect(4u * k + 3u, way, plane, seen);
            }
        }
        var reaches = vec4(-UNBOUNDED);
        for (var k = 0u; k < PACKET_FOURS; k++) {
            reaches = most(reaches, four_of(&reach, k));
        }
        farthest = most_of(reaches) + bounds.slack;
    }
    // No walk is under way: this adds nothing, which no compiler knows.
    steps += loaded * uniforms.walk_pass;
    let out_of_steps = steps >= NESTED_STEPS;
    var mark = vec4(0u);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let at = slots[first + k];
        let none = at == vec4(NO_SLOT);
        let best = vec4(
            best_prim[4u * k],
            best_prim[4u * k + 1u],
            best_prim[4u * k + 2u],
            best_prim[4u * k + 3u],
        );
        let prim = select(best, vec4(UNFINISHED), out_of_steps);
        let t = four_of(&best_t, k);
        store(select(at * uniforms.direction_count + beam, at, none), t, prim);
        let left = (prim == vec4(UNFINISHED)) & !none;
        mark |= vec4(marks_of(prim < vec4(UNFINISHED), k), marks_of(left, k));
    }
    marks[(group.y * groups.x + group.x) * WORKGROUP_SIZE + local] = mark;
}
