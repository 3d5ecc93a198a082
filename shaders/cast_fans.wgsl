// cast_fans: one invocation casts a fan, up to PACKET_RAYS neighbouring directions of one sensor.
//
// CPU twin   src/backend/cpu/packets.rs::cast_packets, src/bvh/{packet,bounds,lanes}.rs
// Reads      poses, sensors (that of each row of workgroups), slots (directions of each fan by four,
//            NO_SLOT for none), directions (x, y and z of each four), tree
// Writes     hits[sensors × direction_count] of these sensors; marks[sensors × fans]: which beams hit, and
//            which are left to the host (their prim is UNFINISHED)
// Dispatch   (ceil(fans / WORKGROUP_SIZE), sensors)
// Numerics   that of cast_packets

struct Four {
    // Directions, and their inverse.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
    inverse_x: vec4<f32>,
    inverse_y: vec4<f32>,
    inverse_z: vec4<f32>,
    // Turned so that the major axis is the last.
    shear_x: vec4<f32>,
    shear_y: vec4<f32>,
    // Largest component, and its sign.
    way: vec4<u32>,
    t: vec4<f32>,
    prim: vec4<u32>,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> poses: array<DevicePose>;
@group(0) @binding(2) var<storage, read> sensors: array<u32>;
@group(0) @binding(3) var<storage, read> slots: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(6) var<storage, read_write> marks: array<vec4<u32>>;
@group(0) @binding(7) var tree: texture_2d<f32>;

fn turned_four(row: vec4<f32>, x: vec4<f32>, y: vec4<f32>, z: vec4<f32>) -> vec4<f32> {
    let d = row.x * x + row.y * y + row.z * z;
    return select(d, vec4(0.0), abs(d) < vec4(TINY_COMPONENT));
}

fn safe_inverse_four(d: vec4<f32>) -> vec4<f32> {
    let zero = d == vec4(0.0);
    return select(1.0 / select(d, vec4(1.0), zero), vec4(FAR), zero);
}

fn new_four(at: u32, pose: DevicePose) -> Four {
    let in_table_x = directions[3u * at];
    let in_table_y = directions[3u * at + 1u];
    let in_table_z = directions[3u * at + 2u];
    let x = turned_four(pose.row_x, in_table_x, in_table_y, in_table_z);
    let y = turned_four(pose.row_y, in_table_x, in_table_y, in_table_z);
    let z = turned_four(pose.row_z, in_table_x, in_table_y, in_table_z);
    let x_leads = (abs(x) > abs(y)) & (abs(x) > abs(z));
    let y_leads = (abs(x) <= abs(y)) & (abs(y) > abs(z));
    let major = select(select(vec4(2u), vec4(1u), y_leads), vec4(0u), x_leads);
    let along = select(select(z, y, y_leads), x, x_leads);
    var four: Four;
    four.x = x;
    four.y = y;
    four.z = z;
    four.inverse_x = safe_inverse_four(x);
    four.inverse_y = safe_inverse_four(y);
    four.inverse_z = safe_inverse_four(z);
    four.shear_x = select(select(x, z, y_leads), y, x_leads) / along;
    four.shear_y = select(select(y, x, y_leads), z, x_leads) / along;
    four.way = 2u * major + select(vec4(0u), vec4(1u), along < vec4(0.0));
    return four;
}

// Four beams after one triangle (Woop, Benthin, Wald 2013).
fn intersect(four: Four, origin: vec3<f32>, major: u32, triangle: Triangle) -> Four {
    let a = permute(triangle.a - origin, major);
    let b = permute(triangle.b - origin, major);
    let c = permute(triangle.c - origin, major);
    let low = min(min(triangle.a, triangle.b), triangle.c) - origin;
    let high = max(max(triangle.a, triangle.b), triangle.c) - origin;
    let height = dot_in_order(triangle.normal, triangle.a - origin);

    let ax = a.x - four.shear_x * a.z;
    let ay = a.y - four.shear_y * a.z;
    let bx = b.x - four.shear_x * b.z;
    let by = b.y - four.shear_y * b.z;
    let cx = c.x - four.shear_x * c.z;
    let cy = c.y - four.shear_y * c.z;
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let zero = vec4(0.0);
    let one_side = (least(least(u, v), w) >= zero) | (most(most(u, v), w) <= zero);
    let inside = one_side & (u + v + w != zero);

    let x0 = low.x * four.inverse_x;
    let x1 = high.x * four.inverse_x;
    let y0 = low.y * four.inverse_y;
    let y1 = high.y * four.inverse_y;
    let z0 = low.z * four.inverse_z;
    let z1 = high.z * four.inverse_z;
    let enter = most(most(least(x0, x1), least(y0, y1)), most(least(z0, z1), zero));
    let leave = least(least(most(x0, x1), most(y0, y1)), most(z0, z1));

    let n = triangle.normal;
    let towards = n.x * four.x + n.y * four.y + n.z * four.z;
    let level = towards == zero;
    let quotient = vec4(height) / select(towards, vec4(1.0), level);
    let t = least(most(quotient, enter), leave);
    let closer = (t < four.t) | ((t == four.t) & (vec4(triangle.prim) < four.prim));
    let ahead = inside & !level & (quotient > zero) & (four.t >= zero);
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

@compute @workgroup_size(WORKGROUP_SIZE)
fn cast_fans(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let fans = arrayLength(&slots) / PACKET_FOURS;
    let fan = group.x * WORKGROUP_SIZE + local;
    if fan >= fans {
        return;
    }
    let first = fan * PACKET_FOURS;
    let sensor = sensors[group.y];
    let pose = poses[sensor];
    let origin = beam_origin(pose);
    var fours: array<Four, PACKET_FOURS>;
    var ways = 0u;
    for (var k = 0u; k < PACKET_FOURS; k++) {
        fours[k] = new_four(first + k, pose);
        let bits = vec4(1u) << fours[k].way;
        ways |= bits.x | bits.y | bits.z | bits.w;
    }
    var mark = vec4(0u);
    // Beams of one largest component at a time: triangles are turned for all of them.
    while ways != 0u {
        let way = firstTrailingBit(ways);
        ways &= ways - 1u;
        let major = way / 2u;
        var shear_low_x = vec4(UNBOUNDED);
        var shear_high_x = vec4(-UNBOUNDED);
        var shear_low_y = vec4(UNBOUNDED);
        var shear_high_y = vec4(-UNBOUNDED);
        var low_x = vec4(UNBOUNDED);
        var high_x = vec4(-UNBOUNDED);
        var low_y = vec4(UNBOUNDED);
        var high_y = vec4(-UNBOUNDED);
        var low_z = vec4(UNBOUNDED);
        var high_z = vec4(-UNBOUNDED);
        for (var k = 0u; k < PACKET_FOURS; k++) {
            var four = fours[k];
            let goes = four.way == vec4(way);
            four.t = select(vec4(-1.0), vec4(uniforms.range), goes);
            four.prim = vec4(NO_HIT);
            fours[k] = four;
            shear_low_x = select(shear_low_x, least(shear_low_x, four.shear_x), goes);
            shear_high_x = select(shear_high_x, most(shear_high_x, four.shear_x), goes);
            shear_low_y = select(shear_low_y, least(shear_low_y, four.shear_y), goes);
            shear_high_y = select(shear_high_y, most(shear_high_y, four.shear_y), goes);
            low_x = select(low_x, least(low_x, four.inverse_x), goes);
            high_x = select(high_x, most(high_x, four.inverse_x), goes);
            low_y = select(low_y, least(low_y, four.inverse_y), goes);
            high_y = select(high_y, most(high_y, four.inverse_y), goes);
            low_z = select(low_z, least(low_z, four.inverse_z), goes);
            high_z = select(high_z, most(high_z, four.inverse_z), goes);
        }
        // All beams start in one point, and so they cross the plane there.
        let start = permute(origin, major);
        let bounds = new_bounds(
            major,
            start.z,
            start.xy,
            start.xy,
            vec2(least_of(shear_low_x), least_of(shear_low_y)),
            vec2(most_of(shear_high_x), most_of(shear_high_y)),
            vec3(least_of(low_x), least_of(low_y), least_of(low_z)),
            vec3(most_of(high_x), most_of(high_y), most_of(high_z)),
            vec2(0.0),
        );
        next = 0u;
        depth = 0u;
        var farthest = uniforms.range + bounds.slack;
        var triangle: Triangle;
        while next_triangle(bounds, farthest, &triangle) {
            var reach = vec4(-UNBOUNDED);
            for (var k = 0u; k < PACKET_FOURS; k++) {
                fours[k] = intersect(fours[k], origin, major, triangle);
                reach = most(reach, fours[k].t);
            }
            farthest = most_of(reach) + bounds.slack;
        }
        let out_of_steps = steps >= PACKET_STEPS;
        for (var k = 0u; k < PACKET_FOURS; k++) {
            let slot = slots[first + k];
            let goes = (slot != vec4(NO_SLOT)) & (fours[k].way == vec4(way));
            let at = select(vec4(NO_SLOT), sensor * uniforms.direction_count + slot, goes);
            let prim = select(fours[k].prim, vec4(UNFINISHED), out_of_steps);
            store(at, fours[k].t, prim);
            let left = (prim == vec4(UNFINISHED)) & goes;
            mark |= vec4(marks_of((prim < vec4(UNFINISHED)) & goes, k), marks_of(left, k));
        }
    }
    marks[group.y * fans + fan] = mark;
}
