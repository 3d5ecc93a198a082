// cast_packets: one invocation casts one direction from up to PACKET_RAYS sensors of one rotation.
//
// CPU twin   src/backend/cpu/packets.rs::cast_packets, src/bvh/{packet,bounds,lanes}.rs
// Reads      poses, directions, blocks (where the order of sensors begins that is best for a workgroup's
//            directions, and the block of these), slots (sensors in that order by four, NO_SLOT for
//            none), origins (x, y and z of each four), tree
// Writes     hits[sensors × direction_count] of the sensors in slots; marks[packets]: which beams hit,
//            and which are left to the host (their prim is UNFINISHED)
// Dispatch   (packets of sensors, ceil(direction_count / WORKGROUP_SIZE))
// Numerics   that of cast_closest; beams that pass beside a box through rounding are UNFINISHED

const BEAMS_SPREAD: bool = false;

struct Four {
    // Origins, turned so that the major axis is the last.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    t: vec4<f32>,
    prim: vec4<u32>,
}

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
@group(0) @binding(8) var tree: texture_2d<f32>;

fn new_way(direction: vec3<f32>) -> Way {
    let major = major_axis(direction);
    let d = permute(direction, major);
    let inverse = vec3(safe_inverse(d.x), safe_inverse(d.y), safe_inverse(d.z));
    return Way(direction, major, inverse, vec2(d.x / d.z, d.y / d.z));
}

fn new_four(at: u32, major: u32) -> Four {
    let x = origins[3u * at];
    let y = origins[3u * at + 1u];
    let z = origins[3u * at + 2u];
    let first = major == 0u;
    let second = major == 1u;
    let third = major == 2u;
    return Four(
        select(x, y, first),
        select(z, y, third),
        select(select(z, y, second), x, first),
        vec4(uniforms.range),
        vec4(NO_HIT),
    );
}

// Four beams after one triangle (Woop, Benthin, Wald 2013).
fn intersect(four: Four, way: Way, triangle: Triangle) -> Four {
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

    let dx = a.x - four.x;
    let dy = a.y - four.y;
    let az = a.z - four.z;
    let bz = b.z - four.z;
    let cz = c.z - four.z;
    let ax = dx - way.shear.x * az;
    let ay = dy - way.shear.y * az;
    let bx = (b.x - four.x) - way.shear.x * bz;
    let by = (b.y - four.y) - way.shear.y * bz;
    let cx = (c.x - four.x) - way.shear.x * cz;
    let cy = (c.y - four.y) - way.shear.y * cz;
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let zero = vec4(0.0);
    // On one side of all edges; on both only where all three are zero.
    let inside = (least(least(u, v), w) >= zero) != (most(most(u, v), w) <= zero);

    let enter = most(
        most((near.x - four.x) * way.inverse.x, (near.y - four.y) * way.inverse.y),
        most((near.z - four.z) * way.inverse.z, zero),
    );
    let leave = least(
        least((far.x - four.x) * way.inverse.x, (far.y - four.y) * way.inverse.y),
        (far.z - four.z) * way.inverse.z,
    );
    let height = sum_in_order(normal.x * dx, normal.y * dy, normal.z * az, way.major);
    let quotient = height / select(towards, 1.0, towards == 0.0);
    let t = least(most(quotient, enter), leave);
    let closer = (t < four.t) | ((t == four.t) & (vec4(triangle.prim) < four.prim));
    let ahead = inside & (quotient > zero);
    // The host decides what passes beside the bare box: that of a padded one costs a fifth of this.
    let beside = ahead & (enter > leave);
    let is_hit = ahead & (t > zero) & closer;
    let best_t = select(four.t, t, is_hit);
    let best_prim = select(four.prim, vec4(triangle.prim), is_hit);
    return Four(
        four.x,
        four.y,
        four.z,
        select(best_t, vec4(-1.0), beside),
        select(best_prim, vec4(UNFINISHED), beside),
    );
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
    var fours: array<Four, PACKET_FOURS>;
    var low = vec4(UNBOUNDED);
    var high = vec4(-UNBOUNDED);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        fours[k] = new_four(first + k, way.major);
        low = least(low, fours[k].z);
        high = most(high, fours[k].z);
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
        let before = plane - fours[k].z;
        let x = fours[k].x + way.shear.x * before;
        let y = fours[k].y + way.shear.y * before;
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
    var farthest = uniforms.range - shift.x + bounds.slack;
    var triangle: Triangle;
    while next_triangle(bounds, farthest, &triangle) {
        var reach = vec4(-UNBOUNDED);
        for (var k = 0u; k < PACKET_FOURS; k++) {
            fours[k] = intersect(fours[k], way, triangle);
            reach = most(reach, fours[k].t - (plane - fours[k].z) * way.inverse.z);
        }
        farthest = most_of(reach) + bounds.slack;
    }
    // No walk is under way: this adds nothing, which no compiler knows.
    steps += loaded * uniforms.walk_pass;
    let out_of_steps = steps >= NESTED_STEPS;
    var mark = vec4(0u);
    for (var k = 0u; k < PACKET_FOURS; k++) {
        let at = slots[first + k];
        let none = at == vec4(NO_SLOT);
        let prim = select(fours[k].prim, vec4(UNFINISHED), out_of_steps);
        store(select(at * uniforms.direction_count + beam, at, none), fours[k].t, prim);
        let left = (prim == vec4(UNFINISHED)) & !none;
        mark |= vec4(marks_of(prim < vec4(UNFINISHED), k), marks_of(left, k));
    }
    marks[(group.y * groups.x + group.x) * WORKGROUP_SIZE + local] = mark;
}
