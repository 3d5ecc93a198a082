// cast_shafts: one invocation casts eight beams of a shaft and stores their closest hits.
//
// CPU twin   src/backend/cpu/cast.rs::cast_closest, src/bvh/{intersect,shafts}.rs
// Reads      blocks (shaft and major axis of every SHAFT_LANES invocations), beams (per invocation two groups of four:
//            x, y and z of the origins, then of the directions), slots (where the hits of a group go,
//            NO_SLOT for none), starts (a shaft's first candidate), candidates, triangles
// Writes     hits[sensors × direction_count] at the slots; counters[1 + sensor] += hits
// Dispatch   (ceil(blocks / (WORKGROUP_SIZE / SHAFT_LANES))), spilling into y
// Numerics   that of cast_closest; no branches within the loop, which a software device does not skip

struct Triangle {
    a: vec3<f32>,
    prim: u32,
    b: vec3<f32>,
    pad0: u32,
    c: vec3<f32>,
    pad1: u32,
    normal: vec3<f32>,
    pad2: u32,
}

struct Candidate {
    triangle: u32,
    enter: f32,
}

// Four rays; the axes x, y and z as they are, and turned so that the major axis is the last.
struct Four {
    origin_x: vec4<f32>,
    origin_y: vec4<f32>,
    origin_z: vec4<f32>,
    direction_x: vec4<f32>,
    direction_y: vec4<f32>,
    direction_z: vec4<f32>,
    inverse_x: vec4<f32>,
    inverse_y: vec4<f32>,
    inverse_z: vec4<f32>,
    turned_x: vec4<f32>,
    turned_y: vec4<f32>,
    turned_z: vec4<f32>,
    shear_x: vec4<f32>,
    shear_y: vec4<f32>,
}

struct Inside {
    enter: vec4<f32>,
    leave: vec4<f32>,
}

struct Best {
    t: vec4<f32>,
    prim: vec4<u32>,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> blocks: array<u32>;
@group(0) @binding(2) var<storage, read> beams: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> slots: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read> starts: array<u32>;
@group(0) @binding(5) var<storage, read> candidates: array<Candidate>;
@group(0) @binding(6) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(7) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(8) var<storage, read_write> counters: array<atomic<u32>>;

// Moves the major axis to z, keeping the handedness.
fn permute(v: vec3<f32>, major: u32) -> vec3<f32> {
    return select(select(v, v.zxy, major == 1u), v.yzx, major == 0u);
}

fn pick(a: vec4<f32>, b: vec4<f32>, c: vec4<f32>, which: u32) -> vec4<f32> {
    return select(select(c, b, which == 1u), a, which == 0u);
}

fn safe_inverse(d: vec4<f32>) -> vec4<f32> {
    let zero = d == vec4(0.0);
    return select(1.0 / select(d, vec4(1.0), zero), vec4(FAR), zero);
}

fn four(first: u32, major: u32) -> Four {
    let ox = beams[first];
    let oy = beams[first + 1u];
    let oz = beams[first + 2u];
    let dx = beams[first + 3u];
    let dy = beams[first + 4u];
    let dz = beams[first + 5u];
    let along = pick(dx, dy, dz, major);
    return Four(
        ox, oy, oz, dx, dy, dz,
        safe_inverse(dx), safe_inverse(dy), safe_inverse(dz),
        pick(oy, oz, ox, major), pick(oz, ox, oy, major), pick(ox, oy, oz, major),
        pick(dy, dz, dx, major) / along, pick(dz, dx, dy, major) / along,
    );
}

// Where the rays are inside a box, clipped to t >= 0.
fn slab(rays: Four, low: vec3<f32>, high: vec3<f32>) -> Inside {
    let x0 = (low.x - rays.origin_x) * rays.inverse_x;
    let x1 = (high.x - rays.origin_x) * rays.inverse_x;
    let y0 = (low.y - rays.origin_y) * rays.inverse_y;
    let y1 = (high.y - rays.origin_y) * rays.inverse_y;
    let z0 = (low.z - rays.origin_z) * rays.inverse_z;
    let z1 = (high.z - rays.origin_z) * rays.inverse_z;
    let enter = max(max(max(min(x0, x1), min(y0, y1)), min(z0, z1)), vec4(0.0));
    return Inside(enter, min(min(max(x0, x1), max(y0, y1)), max(z0, z1)));
}

// The better of `best` and the hits of one triangle (Woop, Benthin, Wald 2013).
fn intersect(
    rays: Four,
    triangle: Triangle,
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    low: vec3<f32>,
    high: vec3<f32>,
    best: Best,
) -> Best {
    let az = a.z - rays.turned_z;
    let bz = b.z - rays.turned_z;
    let cz = c.z - rays.turned_z;
    let ax = (a.x - rays.turned_x) - rays.shear_x * az;
    let ay = (a.y - rays.turned_y) - rays.shear_y * az;
    let bx = (b.x - rays.turned_x) - rays.shear_x * bz;
    let by = (b.y - rays.turned_y) - rays.shear_y * bz;
    let cx = (c.x - rays.turned_x) - rays.shear_x * cz;
    let cy = (c.y - rays.turned_y) - rays.shear_y * cz;
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let zero = vec4(0.0);
    let positive = (u >= zero) & (v >= zero) & (w >= zero);
    let negative = (u <= zero) & (v <= zero) & (w <= zero);
    let inside = (positive | negative) & (u + v + w != zero);

    let bare = slab(rays, low, high);
    let padded = slab(rays, low - uniforms.pad, high + uniforms.pad);
    let beside = bare.enter > bare.leave;
    let enter = select(bare.enter, padded.enter, beside);
    let leave = select(bare.leave, padded.leave, beside);

    let n = triangle.normal;
    let towards = n.x * rays.direction_x + n.y * rays.direction_y + n.z * rays.direction_z;
    let height = n.x * (triangle.a.x - rays.origin_x)
        + n.y * (triangle.a.y - rays.origin_y)
        + n.z * (triangle.a.z - rays.origin_z);
    let level = towards == zero;
    let quotient = height / select(towards, vec4(1.0), level);
    let t = min(max(quotient, enter), leave);
    let closer = (t < best.t) | ((t == best.t) & (vec4(triangle.prim) < best.prim));
    let is_hit =
        inside & (enter <= leave) & !level & (quotient > zero) & (t > zero) & closer;
    return Best(select(best.t, t, is_hit), select(best.prim, vec4(triangle.prim), is_hit));
}

fn store(slot: u32, t: f32, prim: u32) {
    if slot != NO_SLOT {
        hits[slot] = Hit(t, prim);
        if prim != NO_HIT {
            atomicAdd(&counters[1u + slot / uniforms.direction_count], 1u);
        }
    }
}

fn store_all(at: vec4<u32>, best: Best) {
    store(at.x, best.t.x, best.prim.x);
    store(at.y, best.t.y, best.prim.y);
    store(at.z, best.t.z, best.prim.z);
    store(at.w, best.t.w, best.prim.w);
}

// Beams whose hits go nowhere have none from the start.
fn none(at: vec4<u32>) -> Best {
    return Best(select(vec4(uniforms.range), vec4(-1.0), at == vec4(NO_SLOT)), vec4(NO_HIT));
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn cast_shafts(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let invocation = (group.y * groups.x + group.x) * WORKGROUP_SIZE + local;
    let block = blocks[invocation / SHAFT_LANES];
    if block == NO_SLOT {
        return;
    }
    let shaft = block >> MAJOR_BITS;
    let major = block & ((1u << MAJOR_BITS) - 1u);
    let left = four(12u * invocation, major);
    let right = four(12u * invocation + 6u, major);
    let left_slots = slots[2u * invocation];
    let right_slots = slots[2u * invocation + 1u];
    var best_left = none(left_slots);
    var best_right = none(right_slots);
    let end = starts[shaft + 1u];
    for (var k = starts[shaft]; k < end; k++) {
        let candidate = candidates[k];
        let farthest = max(best_left.t, best_right.t);
        // Equal to the best distance is still visited: a tie may have a lower id.
        if all(farthest < vec4(candidate.enter)) {
            break;
        }
        let triangle = triangles[candidate.triangle];
        let a = permute(triangle.a, major);
        let b = permute(triangle.b, major);
        let c = permute(triangle.c, major);
        let low = min(min(triangle.a, triangle.b), triangle.c);
        let high = max(max(triangle.a, triangle.b), triangle.c);
        best_left = intersect(left, triangle, a, b, c, low, high, best_left);
        best_right = intersect(right, triangle, a, b, c, low, high, best_right);
    }
    store_all(left_slots, best_left);
    store_all(right_slots, best_right);
}
