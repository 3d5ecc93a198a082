// cast_closest: one invocation casts one beam into all instances in reach and stores its closest hit.
//
// CPU twin   crates/lidar-cast/src/cast/reference.rs::cast_frame_closest, over Bvh::closer_hit in the same file (a binary
//            tree; the hit does not depend on the tree, see crates/lidar-cast/src/bvh/mod.rs); for scans, whose groups of rays that
//            leave one place are a sensor each, crates/lidar-cast/src/cast/bundle.rs::closest_hit
// Reads      sensors[sensors], instances (those of a sensor one after the other), directions (those of a
//            model one after the other), nodes (of all trees; every bit in crates/lidar-cast/src/bvh/bvh4.rs), triangles
// Writes     hits[first_beam + beam], every element; counters[0] += beams out of steps or stack (their
//            prim is UNFINISHED, the host casts them), counters[1 + sensor] += hits
// Dispatch   (ceil(most directions of a model / WORKGROUP_SIZE), sensors), x spilling into z; spare invocations
//            only help to count
// Prelude    WORKGROUP_SIZE, STACK_ENTRIES, NO_HIT, UNFINISHED, STEP_BUDGET, TRIANGLE_ITEM, NO_ROOT, NO_CROSSING (printed from
//            crates/lidar-cast/src/engine/gpu/layout.rs)
// Numerics   f32 as common/exact.wgsl has it, no transcendental functions, no infinities: coordinates are at most 2^40 m,
//            or the root is NO_ROOT and the host casts what reaches the instance; equal distances go to the lower prim of the
//            frame, first_prim and the tree's own number together

// Coordinates and factors from which on nothing is denormal, see `keeps_bits`: 2^-100 and 2^-51.
const LEAST_COORDINATE: f32 = 0x1p-100f;
const LEAST_FACTOR: f32 = 0x1p-51f;
// 2^-50: a decision by a number of at least this size is the same where denormals are flushed. Proof: a flush changes a
// coordinate only where it is below 2^-100, and a distance along the ray by 2^-126 · 1e20 < 2^-59 at most. Factors are
// below 2^42, so that such a coordinate's product is below 2^-58. It turns no sign of a difference of 2^-50.
const SURE: f32 = 0x1p-50f;

struct BvhNode {
    corner: vec3<f32>,
    low_x: u32,
    step: vec3<f32>,
    low_y: u32,
    high: vec3<u32>,
    low_z: u32,
    children: vec4<u32>,
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

// A tree and where a sensor stands in its frame; 80 bytes.
struct Instance {
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    center: vec3<f32>,
    radius: f32,
    least_square: f32,
    pad: f32,
    root: u32,
    first_prim: u32,
}

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    shear: vec2<f32>,
    major: u32,
}

@group(0) @binding(0) var<storage, read> instances: array<Instance>;
@group(0) @binding(1) var<storage, read> sensors: array<Sensor>;
@group(0) @binding(2) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> nodes: array<BvhNode>;
@group(0) @binding(4) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(5) var<storage, read_write> hits: array<Hit>;
@group(0) @binding(6) var<storage, read_write> counters: array<atomic<u32>>;

var<workgroup> hit_count: atomic<u32>;
// Entry k of invocation i is word k · WORKGROUP_SIZE + i, so that entries of neighbours lie side by side.
var<workgroup> stack: array<u32, STACK_ENTRIES * WORKGROUP_SIZE>;
// Loop steps of this invocation so far, over instances and nodes.
var<private> steps: u32;
// Number of this invocation, which is the word of its first entry of the stack.
var<private> base: u32;

// 1 / d for d = 0 or TINY_COMPONENT <= |d| <= 1.001: at most 1e9.
fn safe_inverse(d: f32) -> f32 {
    if d == 0.0 {
        return NO_CROSSING;
    }
    return divide(1.0, d);
}

// Axis of the largest component.
fn major_axis(direction: vec3<f32>) -> u32 {
    let size = abs(direction);
    if size.x > size.y {
        return select(2u, 0u, size.x > size.z);
    }
    return select(2u, 1u, size.y > size.z);
}

// Moves the major axis to z and keeps the order of the other two: (y, z, x), (x, z, y) or (x, y, z). For y
// this mirrors, unlike the twin's cyclic (z, x, y); the signs of all three edge functions turn together.
fn permute(v: vec3<f32>, major: u32) -> vec3<f32> {
    return select(select(v, v.xzy, major == 1u), v.yzx, major == 0u);
}

fn new_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    let major = major_axis(direction);
    let d = permute(direction, major);
    let inverse =
        vec3(safe_inverse(direction.x), safe_inverse(direction.y), safe_inverse(direction.z));
    // |d.z| >= 0.57, and the quotients are 0 or at least 0.9e-9.
    return Ray(origin, direction, inverse, vec2(divide(d.x, d.z), divide(d.y, d.z)), major);
}

// Where the ray is inside a box, clipped to t >= 0: (enter, leave).
fn slab(ray: Ray, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let t0 = rounded3(low - ray.origin) * ray.inverse;
    let t1 = rounded3(high - ray.origin) * ray.inverse;
    let near = min(t0, t1);
    let far = max(t0, t1);
    return vec2(max(max(max(near.x, near.y), near.z), 0.0), min(min(far.x, far.y), far.z));
}

// The better of `best` and the hit of one triangle (Woop, Benthin, Wald 2013); UNFINISHED where a device that flushes
// denormals could decide otherwise.
fn intersect(ray: Ray, triangle: Triangle, pad: f32, first_prim: u32, best: Hit) -> Hit {
    let a = permute(rounded3(triangle.a - ray.origin), ray.major);
    let b = permute(rounded3(triangle.b - ray.origin), ray.major);
    let c = permute(rounded3(triangle.c - ray.origin), ray.major);
    let a2 = rounded2(a.xy - rounded2(ray.shear * a.z));
    let b2 = rounded2(b.xy - rounded2(ray.shear * b.z));
    let c2 = rounded2(c.xy - rounded2(ray.shear * c.z));
    let u = rounded(c2.x * b2.y) - rounded(c2.y * b2.x);
    let v = rounded(a2.x * c2.y) - rounded(a2.y * c2.x);
    let w = rounded(b2.x * a2.y) - rounded(b2.y * a2.x);
    if min(min(abs(u), abs(v)), abs(w)) < SURE {
        let exact = keeps_bits(ray, triangle, a, b, c)
            && at_least(vec3(a2, b2.x), LEAST_FACTOR) && at_least(vec3(c2, b2.y), LEAST_FACTOR);
        if !exact {
            return Hit(0.0, UNFINISHED);
        }
    }
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return best;
    }
    // Numbers of one sign: their sum is 0 where all are.
    if u == 0.0 && v == 0.0 && w == 0.0 {
        return best;
    }
    let low = min(min(triangle.a, triangle.b), triangle.c);
    let high = max(max(triangle.a, triangle.b), triangle.c);
    var inside = slab(ray, low, high);
    var least = abs(inside.y);
    if inside.x > inside.y {
        inside = slab(ray, rounded3(low - pad), rounded3(high + pad));
        least = min(least, abs(inside.y));
    }
    // Distance from the plane: u, v and w of a long thin triangle are small differences of large
    // products, and their quotient is wrong by millimetres.
    let towards = dot_in_order(triangle.normal, ray.direction);
    let height = dot_in_order(triangle.normal, rounded3(triangle.a - ray.origin));
    if min(least, min(abs(towards), abs(height))) < SURE {
        let exact = keeps_bits(ray, triangle, a, b, c) && at_least(triangle.normal, LEAST_FACTOR);
        // Small but not zero: the quotient may be out of the range of `divide`.
        let small = (towards != 0.0 && abs(towards) < SURE) || (height != 0.0 && abs(height) < SURE);
        if !exact || small {
            return Hit(0.0, UNFINISHED);
        }
    }
    if inside.x > inside.y || towards == 0.0 || height == 0.0 {
        return best;
    }
    let quotient = divide(height, towards);
    if quotient <= 0.0 {
        return best;
    }
    let t = min(max(quotient, inside.x), inside.y);
    let prim = first_prim + triangle.prim;
    if t > 0.0 && (t < best.t || (t == best.t && prim < best.prim)) {
        return Hit(t, prim);
    }
    return best;
}

// True if no difference or product in a triangle's test is denormal; a, b, c are its corners seen from the ray's origin.
//
// Coordinates of 0 or at least 2^-100 are multiples of 2^-123, and so are their differences. Factors of 0 or at least
// 2^-51 have products of at least 2^-102, which are multiples of 2^-125, and so are their sums.
fn keeps_bits(ray: Ray, triangle: Triangle, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    return at_least(ray.origin, LEAST_COORDINATE) && at_least(triangle.a, LEAST_COORDINATE)
        && at_least(triangle.b, LEAST_COORDINATE) && at_least(triangle.c, LEAST_COORDINATE)
        && at_least(a, LEAST_FACTOR) && at_least(b, LEAST_FACTOR) && at_least(c, LEAST_FACTOR);
}

// Distances to four sides, from that to the node's corner and that of a step.
fn planes(begin: f32, bytes: u32, step: f32) -> vec4<f32> {
    return begin + vec4<f32>((vec4(bytes) >> vec4(0u, 8u, 16u, 24u)) & vec4(255u)) * step;
}

// Distance at which the ray enters each child's box; NO_CROSSING for a box it misses or enters behind `limit`. A
// box entered at `limit` counts: a triangle at an equal distance may have a lower id. Decides only the order of visits and
// which boxes are left out, for which they have room: see crates/lidar-cast/src/bvh/bvh4.rs (why no triangle is missed).
fn enter_children(ray: Ray, node: BvhNode, limit: f32) -> vec4<f32> {
    let inverse = ray.inverse;
    let back = inverse < vec3(0.0);
    let low = vec3(node.low_x, node.low_y, node.low_z);
    let near = select(low, node.high, back);
    let far = select(node.high, low, back);
    let begin = (node.corner - ray.origin) * inverse;
    let step = node.step * inverse;
    let near_x = planes(begin.x, near.x, step.x);
    let near_y = planes(begin.y, near.y, step.y);
    let near_z = planes(begin.z, near.z, step.z);
    let far_x = planes(begin.x, far.x, step.x);
    let far_y = planes(begin.y, far.y, step.y);
    let far_z = planes(begin.z, far.z, step.z);
    let enter = max(max(near_x, near_y), max(near_z, vec4(0.0)));
    let leave = min(min(far_x, far_y), min(far_z, vec4(limit)));
    return select(vec4(NO_CROSSING), enter, (enter <= leave) & (node.children != vec4(0u)));
}

// The better of `held` and the closest hit in one tree; UNFINISHED out of steps or stack.
fn closer_hit(ray: Ray, root: u32, pad: f32, first_prim: u32, held: Hit) -> Hit {
    var best = held;
    stack[base] = root;
    // Word behind the last entry.
    var end = base + WORKGROUP_SIZE;
    // Two loops: the lanes of a vector find their next triangles together, then test them together.
    for (; steps < STEP_BUDGET; steps += 2u) {
        if end == base {
            return best;
        }
        end -= WORKGROUP_SIZE;
        var item = stack[end];
        loop {
            if (item >= TRIANGLE_ITEM) | (steps >= STEP_BUDGET) {
                break;
            }
            if end > base + (STACK_ENTRIES - 3u) * WORKGROUP_SIZE {
                return Hit(0.0, UNFINISHED);
            }
            steps++;
            // The nearest child is next; the others go onto the stack, the lower pair last.
            let node = nodes[item];
            let enter = enter_children(ray, node, best.t);
            let child = node.children;
            let swap_low = enter.y < enter.x;
            let swap_high = enter.w < enter.z;
            let low = min(enter.x, enter.y);
            let high = min(enter.z, enter.w);
            let low_child = select(child.x, child.y, swap_low);
            let high_child = select(child.z, child.w, swap_high);
            let swap = high < low;
            item = select(low_child, high_child, swap);
            // Stores without a branch: an entry stays only if its box is entered.
            stack[end] = select(child.w, child.z, swap_high);
            end += select(0u, WORKGROUP_SIZE, max(enter.z, enter.w) < NO_CROSSING);
            stack[end] = select(high_child, low_child, swap);
            end += select(0u, WORKGROUP_SIZE, max(low, high) < NO_CROSSING);
            stack[end] = select(child.y, child.x, swap_low);
            end += select(0u, WORKGROUP_SIZE, max(enter.x, enter.y) < NO_CROSSING);
            if min(low, high) == NO_CROSSING {
                if end == base {
                    return best;
                }
                end -= WORKGROUP_SIZE;
                item = stack[end];
            }
        }
        best = intersect(ray, triangles[item ^ TRIANGLE_ITEM], pad, first_prim, best);
    }
    return Hit(0.0, UNFINISHED);
}

// Whether the beam surely meets nothing of an instance up to its best hit, see crates/lidar-cast/src/cast/sight.rs (why no hit is lost,
// however the device rounds).
fn misses(instance: Instance, direction: vec3<f32>, limit: f32) -> bool {
    let along = dot_in_order(instance.center, direction);
    return (along < -instance.radius) | (along - instance.radius > limit)
        | (along * along < instance.least_square);
}

// The closest hit of a beam in the instances of its sensor.
fn closest_hit(direction: vec3<f32>, sensor: Sensor) -> Hit {
    var best = Hit(sensor.range, NO_HIT);
    for (var k = sensor.first_instance; k < sensor.end_instance; k++) {
        steps++;
        if steps >= STEP_BUDGET {
            return Hit(0.0, UNFINISHED);
        }
        let instance = instances[k];
        if instance.root == NO_ROOT {
            return Hit(0.0, UNFINISHED);
        }
        if misses(instance, direction, best.t) {
            continue;
        }
        let origin = vec3(instance.row_x.w, instance.row_y.w, instance.row_z.w);
        let towards = vec3(
            turned(instance.row_x, direction),
            turned(instance.row_y, direction),
            turned(instance.row_z, direction),
        );
        let ray = new_ray(origin, towards);
        best = closer_hit(ray, instance.root, instance.pad, instance.first_prim, best);
        if best.prim == UNFINISHED {
            return best;
        }
    }
    return best;
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn cast_closest(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensor = sensors[group.y];
    zero = sensor.zero;
    base = local;
    if local == 0u {
        atomicStore(&hit_count, 0u);
    }
    workgroupBarrier();
    let beam = (group.z * groups.x + group.x) * WORKGROUP_SIZE + local;
    if beam < sensor.direction_count {
        let hit = closest_hit(directions[sensor.first_direction + beam].xyz, sensor);
        hits[sensor.first_beam + beam] = hit;
        if hit.prim == UNFINISHED {
            atomicAdd(&counters[0], 1u);
        } else if hit.prim != NO_HIT {
            atomicAdd(&hit_count, 1u);
        }
    }
    workgroupBarrier();
    if local == 0u {
        atomicAdd(&counters[1u + group.y], atomicLoad(&hit_count));
    }
}
