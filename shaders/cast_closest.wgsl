// cast_closest: one invocation casts one beam and stores its closest hit.
//
// CPU twin   src/backend/cpu/cast.rs::cast_closest, src/bvh/{intersect,traverse}.rs
// Reads      poses[sensors], directions[direction_count], nodes, triangles
// Writes     hits[sensors × direction_count], every element; counters[0] += beams that ran out of
//            steps (their prim is UNFINISHED), counters[1 + sensor] += hits
// Dispatch   (ceil(direction_count / WORKGROUP_SIZE), sensors), x spilling into z; spare invocations
//            only help to count
// Numerics   f32, no transcendental functions, no infinities; equal distances go to the lower prim

struct Node {
    min: vec3<f32>,
    first: u32,
    max: vec3<f32>,
    count: u32,
}

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

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    shear: vec2<f32>,
    major: u32,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> poses: array<DevicePose>;
@group(0) @binding(2) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> nodes: array<Node>;
@group(0) @binding(4) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(5) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;

var<workgroup> hit_count: atomic<u32>;

fn new_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    let major = major_axis(direction);
    let d = permute(direction, major);
    let inverse =
        vec3(safe_inverse(direction.x), safe_inverse(direction.y), safe_inverse(direction.z));
    return Ray(origin, direction, inverse, vec2(d.x / d.z, d.y / d.z), major);
}

// Where the ray is inside a box, clipped to t >= 0: (enter, leave).
fn slab(ray: Ray, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let t0 = (low - ray.origin) * ray.inverse;
    let t1 = (high - ray.origin) * ray.inverse;
    let near = min(t0, t1);
    let far = max(t0, t1);
    return vec2(max(max(max(near.x, near.y), near.z), 0.0), min(min(far.x, far.y), far.z));
}

// The better of `best` and the hit of one triangle (Woop, Benthin, Wald 2013).
fn intersect(ray: Ray, triangle: Triangle, best: Hit) -> Hit {
    let a = permute(triangle.a - ray.origin, ray.major);
    let b = permute(triangle.b - ray.origin, ray.major);
    let c = permute(triangle.c - ray.origin, ray.major);
    let a2 = a.xy - ray.shear * a.z;
    let b2 = b.xy - ray.shear * b.z;
    let c2 = c.xy - ray.shear * c.z;
    let u = c2.x * b2.y - c2.y * b2.x;
    let v = a2.x * c2.y - a2.y * c2.x;
    let w = b2.x * a2.y - b2.y * a2.x;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return best;
    }
    let det = u + v + w;
    if det == 0.0 {
        return best;
    }
    let low = min(min(triangle.a, triangle.b), triangle.c);
    let high = max(max(triangle.a, triangle.b), triangle.c);
    var inside = slab(ray, low, high);
    if inside.x > inside.y {
        inside = slab(ray, low - uniforms.pad, high + uniforms.pad);
    }
    if inside.x > inside.y {
        return best;
    }
    // From the plane and not from u, v and w: in a long thin triangle these are small differences of
    // large products, and their quotient is wrong by millimetres.
    let towards = dot_in_order(triangle.normal, ray.direction);
    if towards == 0.0 {
        return best;
    }
    let quotient = dot_in_order(triangle.normal, triangle.a - ray.origin) / towards;
    if quotient <= 0.0 {
        return best;
    }
    let t = min(max(quotient, inside.x), inside.y);
    if t > 0.0 && (t < best.t || (t == best.t && triangle.prim < best.prim)) {
        return Hit(t, triangle.prim);
    }
    return best;
}

fn closest_hit(ray: Ray) -> Hit {
    var best = Hit(uniforms.range, NO_HIT);
    if uniforms.node_count == 0u {
        return best;
    }
    var stack: array<u32, MAX_DEPTH>;
    var depth = 0u;
    var index = 0u;
    for (var step = 0u; step < STEP_BUDGET; step++) {
        let node = nodes[index];
        if node.count > 0u {
            // Every triangle is a loop step of its own for the driver's limit.
            step += node.count;
            for (var k = 0u; k < node.count && step < STEP_BUDGET; k++) {
                best = intersect(ray, triangles[node.first + k], best);
            }
        } else {
            let left = node.first;
            let left_node = nodes[left];
            let right_node = nodes[left + 1u];
            let left_t = slab(ray, left_node.min, left_node.max);
            let right_t = slab(ray, right_node.min, right_node.max);
            // Equal to the best distance is still visited: a tie may have a lower id.
            let visit_left = left_t.x <= left_t.y && left_t.x <= best.t;
            let visit_right = right_t.x <= right_t.y && right_t.x <= best.t;
            if visit_left && visit_right {
                let left_first = left_t.x <= right_t.x;
                stack[depth] = select(left, left + 1u, left_first);
                depth++;
                index = select(left + 1u, left, left_first);
                continue;
            }
            if visit_left || visit_right {
                index = select(left + 1u, left, visit_left);
                continue;
            }
        }
        if depth == 0u {
            return best;
        }
        depth--;
        index = stack[depth];
    }
    return Hit(0.0, UNFINISHED);
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn cast_closest(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensor = group.y;
    let beam = (group.z * groups.x + group.x) * WORKGROUP_SIZE + local;
    if beam < uniforms.direction_count {
        let pose = poses[sensor];
        let ray = new_ray(beam_origin(pose), beam_direction(pose, directions[beam].xyz));
        let hit = closest_hit(ray);
        hits[sensor * uniforms.direction_count + beam] = hit;
        if hit.prim == UNFINISHED {
            atomicAdd(&counters[0], 1u);
        } else if hit.prim != NO_HIT {
            atomicAdd(&hit_count, 1u);
        }
    }
    workgroupBarrier();
    if local == 0u {
        atomicAdd(&counters[1u + sensor], atomicLoad(&hit_count));
    }
}
