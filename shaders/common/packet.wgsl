// The way of a packet of beams through the tree: what holds for all of them sorts out nodes and
// triangles.
//
// CPU twins  src/bvh/{bounds,packet}.rs, without chunks
// Reads      tree (src/bvh/quads.rs); BEAMS_SPREAD, whether a packet's directions may differ; SIFTS, whether
//            beams are sifted before they are tested

const NOTHING: u32 = 0xffffffffu;
// Farther than any plane.
const UNBOUNDED: f32 = 1e30;

struct Triangle {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    normal: vec3<f32>,
    prim: u32,
}

// Where some beams cross a plane and how they are sheared: middle and half of the range, on both axes
// beside the major one. Distances count from that plane.
struct Bounds {
    major: u32,
    plane: f32,
    middle: vec2<f32>,
    half: vec2<f32>,
    shear: vec2<f32>,
    turn: vec2<f32>,
    // By axis, turned as the beams: the axis itself; how far the side of a box that is met first is shifted
    // in a word of a node; the origin for which boxes are closest and farthest, in steps of the tree; least
    // and largest inverse direction a step.
    axis: vec3<u32>,
    near_shift: vec3<u32>,
    near: vec3<f32>,
    far: vec3<f32>,
    inverse_low: vec3<f32>,
    inverse_high: vec3<f32>,
    // The same along the major axis in metres.
    near_plane: f32,
    major_low: f32,
    major_high: f32,
    // Metres by which everything may be off through rounding.
    slack: f32,
    start: f32,
}

// What is still to be visited, and where the beams enter it at the earliest.
var<private> items: array<u32, QUAD_STACK>;
var<private> enters: array<f32, QUAD_STACK>;
var<private> depth: u32;
var<private> next: u32 = ROOT_ITEM;
var<private> steps: u32;

// One compare and select; `min` and `max` look for NaN, too.
fn least(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return select(b, a, a < b);
}

fn most(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return select(b, a, a > b);
}

// The sum of turned products, added in the order of the axes as they were before.
fn sum_in_order(x: vec4<f32>, y: vec4<f32>, z: vec4<f32>, major: u32) -> vec4<f32> {
    let upright = major == 2u;
    return x + select(z, y, upright) + select(y, z, upright);
}

fn least_of(v: vec4<f32>) -> f32 {
    return min(min(v.x, v.y), min(v.z, v.w));
}

fn most_of(v: vec4<f32>) -> f32 {
    return max(max(v.x, v.y), max(v.z, v.w));
}

// Bounds of beams that cross the plane between `low` and `high`, turned so that the major axis is the
// last, and start between `shift.x` and `shift.y` before it.
fn new_bounds(
    major: u32,
    plane: f32,
    low: vec2<f32>,
    high: vec2<f32>,
    shear_low: vec2<f32>,
    shear_high: vec2<f32>,
    inverse_low: vec3<f32>,
    inverse_high: vec3<f32>,
    shift: vec2<f32>,
) -> Bounds {
    let sides = max(abs(low), abs(high));
    let largest = max(sides.x, sides.y) + abs(plane) + max(abs(shift.x), abs(shift.y));
    let slack = BOUNDS_SLACK * (uniforms.pad + largest * PAD_SHARE);
    let first = vec3(low, plane) - slack;
    let last = vec3(high, plane) + slack;
    let backward = inverse_high < vec3(0.0);
    // Where some beams go up and some down an axis, it bounds nothing.
    let bound = backward | (inverse_low > vec3(0.0));
    let corner = permute(bitcast<vec4<f32>>(texel(0u, 0u)).xyz, major);
    let step = permute(bitcast<vec4<f32>>(texel(1u, 0u)).xyz, major);
    var bounds: Bounds;
    bounds.major = major;
    bounds.plane = plane;
    bounds.slack = slack;
    bounds.start = -shift.y - slack;
    bounds.middle = 0.5 * (low + high);
    bounds.half = 0.5 * (high - low) + slack;
    bounds.shear = 0.5 * (shear_low + shear_high);
    bounds.turn = 0.5 * (shear_high - shear_low);
    bounds.axis = vec3<u32>(permute(vec3(0.0, 1.0, 2.0), major));
    bounds.near_shift = select(vec3(0u), vec3(16u), backward);
    bounds.near = select(vec3(UNBOUNDED), (select(last, first, backward) - corner) / step, bound);
    bounds.far = select(vec3(-UNBOUNDED), (select(first, last, backward) - corner) / step, bound);
    bounds.inverse_low = select(vec3(1.0), inverse_low * step, bound);
    bounds.inverse_high = select(vec3(1.0), inverse_high * step, bound);
    bounds.near_plane = select(last.z, first.z, backward.z);
    bounds.major_low = inverse_low.z;
    bounds.major_high = inverse_high.z;
    return bounds;
}

// Where beams have gone so far along an axis, at the earliest and at the latest.
fn soonest(distance: vec4<f32>, low: f32, high: f32) -> vec4<f32> {
    if BEAMS_SPREAD {
        return least(distance * low, distance * high);
    }
    return distance * low;
}

fn latest(distance: vec4<f32>, low: f32, high: f32) -> vec4<f32> {
    if BEAMS_SPREAD {
        return most(distance * low, distance * high);
    }
    return distance * low;
}

fn texel(x: u32, y: u32) -> vec4<u32> {
    return textureLoad(tree, vec2(x, y), 0);
}

// One side of four boxes, in steps.
fn side(word: vec4<u32>, shift: u32) -> vec4<f32> {
    return vec4<f32>(bitcast<vec4<i32>>((word >> vec4(shift)) & vec4(0xffffu)));
}

// The nearest child of a node that the beams may enter is next; the others go on the stack, farthest
// first.
fn push_children(
    bounds: Bounds,
    farthest: f32,
    x: vec4<u32>,
    y: vec4<u32>,
    z: vec4<u32>,
    children: vec4<u32>,
) {
    let low = bounds.inverse_low;
    let high = bounds.inverse_high;
    let shift = bounds.near_shift;
    let near_x = side(x, shift.x);
    let near_y = side(y, shift.y);
    let near_z = side(z, shift.z);
    let far_x = side(x, 16u - shift.x);
    let far_y = side(y, 16u - shift.y);
    let far_z = side(z, 16u - shift.z);
    let near = most(
        most(
            soonest(near_x - bounds.near.x, low.x, high.x),
            soonest(near_y - bounds.near.y, low.y, high.y),
        ),
        most(soonest(near_z - bounds.near.z, low.z, high.z), vec4(bounds.start)),
    );
    let far = least(
        least(
            latest(far_x - bounds.far.x, low.x, high.x),
            latest(far_y - bounds.far.y, low.y, high.y),
        ),
        latest(far_z - bounds.far.z, low.z, high.z),
    );
    // Equal to the best distance is still visited: a tie may have a lower id.
    let meets = (near <= far) & (near <= vec4(farthest));
    var enter = select(vec4(UNBOUNDED), near, meets);
    var child = children;
    var swap = enter.x < enter.y;
    enter = select(enter, enter.yxzw, swap);
    child = select(child, child.yxzw, swap);
    swap = enter.z < enter.w;
    enter = select(enter, enter.xywz, swap);
    child = select(child, child.xywz, swap);
    swap = enter.x < enter.z;
    enter = select(enter, enter.zyxw, swap);
    child = select(child, child.zyxw, swap);
    swap = enter.y < enter.w;
    enter = select(enter, enter.xwzy, swap);
    child = select(child, child.xwzy, swap);
    swap = enter.y < enter.z;
    enter = select(enter, enter.xzyw, swap);
    child = select(child, child.xzyw, swap);
    push(enter.x, child.x);
    push(enter.y, child.y);
    push(enter.z, child.z);
    next = select(NOTHING, child.w, enter.w < UNBOUNDED);
}

fn push(enter: f32, child: u32) {
    enters[depth] = enter;
    items[depth] = child;
    depth += select(0u, 1u, enter < UNBOUNDED);
}

// Whether all beams surely miss a triangle: beside its corners, on the outer side of one of its edges,
// or with all hits before it.
fn misses(bounds: Bounds, farthest: f32, triangle: Triangle) -> bool {
    let a = permute(triangle.a, bounds.major);
    let b = permute(triangle.b, bounds.major);
    let c = permute(triangle.c, bounds.major);
    let along = soonest(
        vec4(a.z, b.z, c.z, c.z) - bounds.near_plane,
        bounds.major_low,
        bounds.major_high,
    );
    let behind = least_of(along) > farthest;

    // As seen along the beams.
    let az = a.z - bounds.plane;
    let bz = b.z - bounds.plane;
    let cz = c.z - bounds.plane;
    let a2 = a.xy - bounds.middle - bounds.shear * az;
    let b2 = b.xy - bounds.middle - bounds.shear * bz;
    let c2 = c.xy - bounds.middle - bounds.shear * cz;
    let a_reach = bounds.turn * abs(az);
    let b_reach = bounds.turn * abs(bz);
    let c_reach = bounds.turn * abs(cz);
    let low = min(min(a2 - a_reach, b2 - b_reach), c2 - c_reach);
    let high = max(max(a2 + a_reach, b2 + b_reach), c2 + c_reach);
    let wide = bounds.half + bounds.slack;
    let apart = any(low > wide) | any(high < -wide);

    let size = abs(a2) + abs(b2) + abs(c2);
    let deepest = max(max(abs(az), abs(bz)), abs(cz));
    let widest = bounds.half + deepest * bounds.turn;
    let error = 2.0 * bounds.slack * (size.x + size.y + widest.x + widest.y);
    let u = edge(bounds, a2, az, b2, bz);
    let v = edge(bounds, b2, bz, c2, cz);
    let w = edge(bounds, c2, cz, a2, az);
    let area = u.x + v.x + w.x;
    let doubt = u.y + v.y + w.y + 4.0 * error;
    let middle = vec3(u.x, v.x, w.x);
    let spread = vec3(u.z, v.z, w.z) + error;
    let left = any(middle + spread < vec3(0.0));
    let right = any(middle - spread > vec3(0.0));
    return behind | apart | ((area > doubt) & left) | ((area < -doubt) & right);
}

// An edge function's value in the middle, the spread of the area's share, and its own.
fn edge(bounds: Bounds, p: vec2<f32>, pz: f32, q: vec2<f32>, qz: f32) -> vec3<f32> {
    let value = p.x * q.y - p.y * q.x;
    let step = abs(q - p);
    let moved = step.y * bounds.half.x + step.x * bounds.half.y;
    let turned = bounds.turn.x * abs(pz * q.y - qz * p.y) + bounds.turn.y * abs(qz * p.x - pz * q.x);
    let both = (bounds.turn.x * bounds.half.y + bounds.turn.y * bounds.half.x) * abs(qz - pz);
    return vec3(value, turned, turned + moved + both);
}

// Goes on to the next triangle that the beams may hit; false where there is none, or no step left.
fn next_triangle(bounds: Bounds, farthest: f32, triangle: ptr<function, Triangle>) -> bool {
    var found = false;
    steps++;
    while !found {
        while (next == NOTHING) & (depth > 0u) {
            depth--;
            steps++;
            next = select(items[depth], NOTHING, enters[depth] > farthest);
        }
        // One for this loop and one for that above, which drivers may run once for nothing.
        steps += 2u;
        if (next == NOTHING) | (steps >= NESTED_STEPS) {
            break;
        }
        // A triangle is read as it lies, a node's sides in the order in which they are met.
        let is_node = next < TRIANGLE_ITEM;
        let first = (next & ~TRIANGLE_ITEM) * ITEM_TEXELS;
        next = NOTHING;
        let x = first & (TREE_ROW - 1u);
        let y = first / TREE_ROW;
        let order = select(vec3(0u, 1u, 2u), bounds.axis, is_node);
        let t0 = texel(x + order.x, y);
        let t1 = texel(x + order.y, y);
        let t2 = texel(x + order.z, y);
        let t3 = texel(x + 3u, y);
        if is_node {
            push_children(bounds, farthest, t0, t1, t2, t3);
        } else {
            let read = Triangle(
                bitcast<vec4<f32>>(t0).xyz,
                bitcast<vec4<f32>>(t1).xyz,
                bitcast<vec4<f32>>(t2).xyz,
                bitcast<vec4<f32>>(t3).xyz,
                t0.w,
            );
            // What sifts the beams of a triangle need not know that it is for none.
            if SIFTS {
                found = true;
            } else {
                found = !misses(bounds, farthest, read);
            }
            if found {
                *triangle = read;
            }
        }
    }
    return found;
}

// Stores the hits of four beams.
fn store(at: vec4<u32>, t: vec4<f32>, prim: vec4<u32>) {
    if at.x != NO_SLOT {
        hits[at.x] = Hit(t.x, prim.x);
    }
    if at.y != NO_SLOT {
        hits[at.y] = Hit(t.y, prim.y);
    }
    if at.z != NO_SLOT {
        hits[at.z] = Hit(t.z, prim.z);
    }
    if at.w != NO_SLOT {
        hits[at.w] = Hit(t.w, prim.w);
    }
}

// A bit for each of four beams, at the place of the four.
fn marks_of(which: vec4<bool>, four: u32) -> vec2<u32> {
    let bits = select(vec4(0u), vec4(1u, 2u, 4u, 8u), which);
    let mark = (bits.x | bits.y | bits.z | bits.w) << (4u * (four % 8u));
    return select(vec2(0u, mark), vec2(mark, 0u), four < 8u);
}
