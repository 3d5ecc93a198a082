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
    // Where the first beam begins, and keys a metre from there on.
    start: f32,
    scale: f32,
}

// What is still to be visited: of each node on the way down, its word and the keys of the children that are
// left, nearest first. A key says where the beams enter a child at the earliest, and which one it is. Two
// numbers a node: a software device writes what is looked up by an index one lane after the other.
var<private> words: array<u32, QUAD_STACK>;
var<private> keys: array<u32, QUAD_STACK>;
var<private> depth: u32;
// The node whose children are visited now.
var<private> word: u32;
var<private> left: u32 = NO_KEYS;
var<private> next: u32 = ROOT_ITEM;
var<private> steps: u32;

const KEY_BITS: u32 = 10u;
const NO_KEY: u32 = (1u << KEY_BITS) - 1u;
const NO_KEYS: u32 = (1u << (3u * KEY_BITS)) - 1u;
// A number of quarters is in the lower bits of its sum with this.
const QUARTERS: f32 = 2097152.0;
// Largest distance in a key: one more is for what is rounded, and one for no key.
const LONGEST: f32 = 253.0;

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
    bounds.scale = LONGEST / (uniforms.range + shift.y - shift.x + 2.0 * slack);
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
    return textureLoad(tree, vec2(x, y));
}

// One side of four boxes, in steps.
fn side(word: vec4<u32>, shift: u32) -> vec4<f32> {
    return vec4<f32>(bitcast<vec4<i32>>((word >> vec4(shift)) & vec4(0xffffu)));
}

// Keys of distances that are not before the start, without the slot; what is farther has no lower key.
fn keys_of(bounds: Bounds, distance: vec4<f32>) -> vec4<u32> {
    let quarters = bitcast<vec4<u32>>((distance - bounds.start) * bounds.scale + QUARTERS);
    return quarters & vec4(NO_KEY - 3u);
}

// The last key of what may still be hit; one more, should a driver round differently here and there.
fn last_key(bounds: Bounds, farthest: f32) -> u32 {
    return keys_of(bounds, vec4(max(farthest, bounds.start))).x + 4u + 3u;
}

// A child of the present node.
fn child(slot: u32) -> u32 {
    return ((word & CHILD_ITEM) + slot) | ((word << (3u - slot)) & TRIANGLE_ITEM);
}

// Visits the nearest child of a node that the beams may enter, then the others, then what was left.
fn enter(
    bounds: Bounds,
    farthest: f32,
    x: vec4<u32>,
    y: vec4<u32>,
    z: vec4<u32>,
    children: vec4<u32>,
) {
    words[depth] = word;
    keys[depth] = left;
    depth += select(1u, 0u, (left & NO_KEY) == NO_KEY);
    word = children.x;
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
    let slots = vec4(0u, 1u, 2u, 3u);
    let meets = (near <= far) & (near <= vec4(farthest)) & (slots < vec4(children.y));
    let own = select(vec4(NO_KEY), keys_of(bounds, near) | slots, meets);
    let lower = min(own.xz, own.yw);
    let upper = max(own.xz, own.yw);
    let nearest = min(lower.x, lower.y);
    let last = max(upper.x, upper.y);
    let second = max(lower.x, lower.y);
    let third = min(upper.x, upper.y);
    left = min(second, third) | (max(second, third) << KEY_BITS) | (last << (2u * KEY_BITS));
    next = select(child(nearest & 3u), NOTHING, nearest == NO_KEY);
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
    let last = last_key(bounds, farthest);
    steps++;
    while !found {
        steps++;
        if next == NOTHING {
            // The nearest is too far, and so are the others.
            if (left & NO_KEY) > last {
                if depth == 0u {
                    break;
                }
                depth--;
                word = words[depth];
                left = keys[depth];
            }
            let key = left & NO_KEY;
            if key > last {
                left = NO_KEYS;
                continue;
            }
            next = child(key & 3u);
            left = (left >> KEY_BITS) | (NO_KEY << (2u * KEY_BITS));
        }
        if steps >= NESTED_STEPS {
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
            enter(bounds, farthest, t0, t1, t2, t3);
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
