// cast_mixed: one invocation casts up to PACKET_RAYS beams that go roughly the same way.
//
// CPU twin   src/backend/cpu/packets.rs::cast_packets, src/bvh/{packet,bounds,ranges,lanes}.rs
// Reads      order (by workgroup, which packets are its), slots (where the hits of each four go, NO_SLOT
//            for none), beams (of each four x, y and z of the origins, then of the directions, whose
//            major axis and signs are those of all beams of the packet), tree
// Writes     hits at the slots; marks[packets]: which beams hit, and which are left to the host (their prim
//            is UNFINISHED)
// Dispatch   (ceil(packets / WORKGROUP_SIZE)), spilling into y; packets without beams are spare
// Numerics   that of cast_packets

const BEAMS_SPREAD: bool = true;
const SIFTS: bool = false;

// All turned so that the major axis is the last.
struct Four {
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    direction_x: vec4<f32>,
    direction_y: vec4<f32>,
    direction_z: vec4<f32>,
    inverse_x: vec4<f32>,
    inverse_y: vec4<f32>,
    inverse_z: vec4<f32>,
    shear_x: vec4<f32>,
    shear_y: vec4<f32>,
    t: vec4<f32>,
    prim: vec4<u32>,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> order: array<u32>;
@group(0) @binding(2) var<storage, read> slots: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> beams: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(5) var<storage, read_write> marks: array<vec4<u32>>;
@group(0) @binding(6) var tree: texture_storage_2d<rgba32uint, read>;

fn inverse_four(d: vec4<f32>) -> vec4<f32> {
    let zero = d == vec4(0.0);
    return select(1.0 / select(d, vec4(1.0), zero), vec4(FAR), zero);
}

fn pick(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>, major: u32) -> vec4<f32> {
    return select(select(c, b, major == 1u), a, major == 0u);
}

fn new_four(at: u32, major: u32) -> Four {
    let ox = beams[6u * at];
    let oy = beams[6u * at + 1u];
    let oz = beams[6u * at + 2u];
    let dx = beams[6u * at + 3u];
    let dy = beams[6u * at + 4u];
    let dz = beams[6u * at + 5u];
    let x = pick(dy, dx, dx, major);
    let y = pick(dz, dz, dy, major);
    let z = pick(dx, dy, dz, major);
    return Four(
        pick(oy, ox, ox, major),
        pick(oz, oz, oy, major),
        pick(ox, oy, oz, major),
        x,
        y,
        z,
        inverse_four(x),
        inverse_four(y),
        inverse_four(z),
        x / z,
        y / z,
        vec4(uniforms.range),
        vec4(NO_HIT),
    );
}

// Four beams after one triangle (Woop, Benthin, Wald 2013).
fn intersect(four: Four, major: u32, backward: vec3<bool>, triangle: Triangle) -> Four {
    let a = permute(triangle.a, major);
    let b = permute(triangle.b, major);
    let c = permute(triangle.c, major);
    let n = permute(triangle.normal, major);
    let low = min(min(a, b), c);
    let high = max(max(a, b), c);
    let near = select(low, high, backward);
    let far = select(high, low, backward);

    let dx = a.x - four.x;
    let dy = a.y - four.y;
    let az = a.z - four.z;
    let bz = b.z - four.z;
    let cz = c.z - four.z;
    let ax = dx - four.shear_x * az;
    let ay = dy - four.shear_y * az;
    let bx = (b.x - four.x) - four.shear_x * bz;
    let by = (b.y - four.y) - four.shear_y * bz;
    let cx = (c.x - four.x) - four.shear_x * cz;
    let cy = (c.y - four.y) - four.shear_y * cz;
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let zero = vec4(0.0);
    // On one side of all edges; on both only where all three are zero.
    let inside = (least(least(u, v), w) >= zero) != (most(most(u, v), w) <= zero);

    let enter = most(
        most((near.x - four.x) * four.inverse_x, (near.y - four.y) * four.inverse_y),
        most((near.z - four.z) * four.inverse_z, zero),
    );
    let leave = least(
        least((far.x - four.x) * four.inverse_x, (far.y - four.y) * four.inverse_y),
        (far.z - four.z) * four.inverse_z,
    );

    let towards =
        sum_in_order(n.x * four.direction_x, n.y * four.direction_y, n.z * four.direction_z, major);
    let height = sum_in_order(n.x * dx, n.y * dy, n.z * az, major);
    let level = towards == zero;
    let quotient = height / select(towards, vec4(1.0), level);
    let t = least(most(quotient, enter), leave);
    let closer = (t < four.t) | ((t == four.t) & (vec4(triangle.prim) < four.prim));
    let ahead = inside & !level & (quotient > zero);
    // The host decides what passes beside the bare box: that of a padded one costs a fifth of this.
    let beside = ahead & (enter > leave);
    let is_hit = ahead & (t > zero) & closer;
    let best_t = select(four.t, t, is_hit);
    let best_prim = select(four.prim, vec4(triangle.prim), is_hit);
    var after = four;
    after.t = select(best_t, vec4(-1.0), beside);
    after.prim = select(best_prim, vec4(UNFINISHED), beside);
    return after;
}

// Where the beams lie closest together, on their way up to `range`: the variance of the crossings
// x + s (z - z0) is least at z0 - cov(x, s) / var(s).
fn narrowest_plane(start: f32, covariance: f32, variance: f32, forward: bool) -> f32 {
    let sign = select(-1.0, 1.0, forward);
    let ahead = -covariance / select(variance, 1.0, variance <= 0.0) * sign;
    return start + sign * clamp(ahead, 0.0, uniforms.range);
}

fn sum_of(v: vec4<f32>) -> f32 {
    return v.x + v.y + v.z + v.w;
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn cast_mixed(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let packet = order[group.y * groups.x + group.x] * WORKGROUP_SIZE + local;
    let first = packet * PACKET_FOURS;
    if slots[first].x == NO_SLOT {
        return;
    }
    let at = 6u * first;
    let major = major_axis(vec3(beams[at + 3u].x, beams[at + 4u].x, beams[at + 5u].x));
    var fours: array<Four, PACKET_FOURS>;
    var low = vec4(UNBOUNDED);
    var high = vec4(-UNBOUNDED);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        fours[k] = new_four(first + k, major);
        low = least(low, fours[k].z);
        high = most(high, fours[k].z);
    }
    let start = 0.5 * (least_of(low) + most_of(high));
    let first_x = fours[0].x.x;
    let first_y = fours[0].y.x;
    let shear_x = fours[0].shear_x.x;
    let shear_y = fours[0].shear_y.x;
    var sum_x = vec4(0.0);
    var sum_y = vec4(0.0);
    var sum_sx = vec4(0.0);
    var sum_sy = vec4(0.0);
    var products = vec4(0.0);
    var squares = vec4(0.0);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let before = start - fours[k].z;
        let x = fours[k].x + fours[k].shear_x * before - first_x;
        let y = fours[k].y + fours[k].shear_y * before - first_y;
        let sx = fours[k].shear_x - shear_x;
        let sy = fours[k].shear_y - shear_y;
        sum_x += x;
        sum_y += y;
        sum_sx += sx;
        sum_sy += sy;
        products += x * sx + y * sy;
        squares += sx * sx + sy * sy;
    }
    let all_sx = sum_of(sum_sx);
    let all_sy = sum_of(sum_sy);
    let rays = f32(4u * PACKET_FOURS);
    let covariance =
        sum_of(products) - (sum_of(sum_x) * all_sx + sum_of(sum_y) * all_sy) / rays;
    let variance = sum_of(squares) - (all_sx * all_sx + all_sy * all_sy) / rays;
    let plane = narrowest_plane(start, covariance, variance, fours[0].direction_z.x > 0.0);

    var low_x = vec4(UNBOUNDED);
    var high_x = vec4(-UNBOUNDED);
    var low_y = vec4(UNBOUNDED);
    var high_y = vec4(-UNBOUNDED);
    var low_shift = vec4(UNBOUNDED);
    var high_shift = vec4(-UNBOUNDED);
    var low_sx = vec4(UNBOUNDED);
    var high_sx = vec4(-UNBOUNDED);
    var low_sy = vec4(UNBOUNDED);
    var high_sy = vec4(-UNBOUNDED);
    var low_ix = vec4(UNBOUNDED);
    var high_ix = vec4(-UNBOUNDED);
    var low_iy = vec4(UNBOUNDED);
    var high_iy = vec4(-UNBOUNDED);
    var low_iz = vec4(UNBOUNDED);
    var high_iz = vec4(-UNBOUNDED);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let before = plane - fours[k].z;
        let x = fours[k].x + fours[k].shear_x * before;
        let y = fours[k].y + fours[k].shear_y * before;
        let shift = before * fours[k].inverse_z;
        low_x = least(low_x, x);
        high_x = most(high_x, x);
        low_y = least(low_y, y);
        high_y = most(high_y, y);
        low_shift = least(low_shift, shift);
        high_shift = most(high_shift, shift);
        low_sx = least(low_sx, fours[k].shear_x);
        high_sx = most(high_sx, fours[k].shear_x);
        low_sy = least(low_sy, fours[k].shear_y);
        high_sy = most(high_sy, fours[k].shear_y);
        low_ix = least(low_ix, fours[k].inverse_x);
        high_ix = most(high_ix, fours[k].inverse_x);
        low_iy = least(low_iy, fours[k].inverse_y);
        high_iy = most(high_iy, fours[k].inverse_y);
        low_iz = least(low_iz, fours[k].inverse_z);
        high_iz = most(high_iz, fours[k].inverse_z);
    }
    let shift = vec2(least_of(low_shift), most_of(high_shift));
    let bounds = new_bounds(
        major,
        plane,
        vec2(least_of(low_x), least_of(low_y)),
        vec2(most_of(high_x), most_of(high_y)),
        vec2(least_of(low_sx), least_of(low_sy)),
        vec2(most_of(high_sx), most_of(high_sy)),
        vec3(least_of(low_ix), least_of(low_iy), least_of(low_iz)),
        vec3(most_of(high_ix), most_of(high_iy), most_of(high_iz)),
        shift,
    );
    var farthest = uniforms.range - shift.x + bounds.slack;
    let backward =
        vec3(fours[0].inverse_x.x, fours[0].inverse_y.x, fours[0].inverse_z.x) < vec3(0.0);
    var triangle: Triangle;
    while next_triangle(bounds, farthest, &triangle) {
        var reach = vec4(-UNBOUNDED);
        for (var k = 0u; k < PACKET_FOURS; k++) {
            fours[k] = intersect(fours[k], major, backward, triangle);
            reach = most(reach, fours[k].t - (plane - fours[k].z) * fours[k].inverse_z);
        }
        farthest = most_of(reach) + bounds.slack;
    }
    let out_of_steps = steps >= NESTED_STEPS;
    var mark = vec4(0u);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let slot = slots[first + k];
        let prim = select(fours[k].prim, vec4(UNFINISHED), out_of_steps);
        store(slot, fours[k].t, prim);
        let some = slot != vec4(NO_SLOT);
        let left = (prim == vec4(UNFINISHED)) & some;
        mark |= vec4(marks_of((prim < vec4(UNFINISHED)) & some, k), marks_of(left, k));
    }
    marks[packet] = mark;
}
