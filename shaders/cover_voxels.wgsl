// cover_voxels: one invocation walks one beam through the grid and marks the voxels it traverses.
//
// CPU twin   src/backend/cpu/cover.rs::cover_voxels
// Reads      poses[sensors], directions[direction_count], hits[sensors × direction_count] where beams
//            end at hits
// Writes     bitmaps[dispatched sensors × bitmap_words], a word a brick of 4 × 4 × 2 voxels (see
//            src/backend/gpu/bricks.rs), bits set by atomic or; walk_state, one word a beam,
//            only where a walk can need more than STEP_BUDGET steps and is resumed by further passes
// Dispatch   (ceil(direction_count / WORKGROUP_SIZE), sensors from first_sensor on), x spilling into z
// Numerics   f32; plane i is crossed at (i − p) · inverse, from the plane's number alone

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> poses: array<DevicePose>;
@group(0) @binding(2) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> hits: array<Hit>;
@group(0) @binding(4) var<storage, read_write> bitmaps: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> walk_state: array<u32>;

struct Walk {
    shape: vec3<i32>,
    p: vec3<f32>,
    inverse: vec3<f32>,
    slope: vec3<f32>,
    forward: vec3<bool>,
}

fn new_walk(in_grid: vec3<f32>, direction: vec3<f32>) -> Walk {
    let level = direction == vec3(0.0);
    // Divides by one where the beam stays level, to keep infinities out.
    let divisor = select(direction, vec3(1.0), level);
    let inverse = select(uniforms.voxel / divisor, vec3(FAR), level);
    let slope = select(direction / uniforms.voxel, vec3(0.0), level);
    return Walk(vec3<i32>(uniforms.shape), in_grid, inverse, slope, direction >= vec3(0.0));
}

fn crossing(walk: Walk, axis: u32, plane: i32) -> f32 {
    return (f32(plane) - walk.p[axis]) * walk.inverse[axis];
}

// Voxel coordinate after every crossing up to and including t.
fn cell_at(walk: Walk, axis: u32, t: f32) -> i32 {
    let start = i32(floor(walk.p[axis]));
    // The guess may be off where rounding differs from that of `crossing`, which decides.
    let guess = floor(walk.p[axis] + t * walk.slope[axis]);
    var cell = i32(clamp(guess, -2e9, 2e9));
    if walk.forward[axis] {
        cell = max(cell, start);
        while cell > start && crossing(walk, axis, cell) > t {
            cell--;
        }
        while crossing(walk, axis, cell + 1) <= t {
            cell++;
        }
    } else {
        cell = min(cell, start);
        while cell < start && crossing(walk, axis, cell + 1) > t {
            cell++;
        }
        while crossing(walk, axis, cell) <= t {
            cell--;
        }
    }
    return cell;
}

// When the beam enters the grid, 0 if it starts inside, FAR if it never does.
fn entry_of(walk: Walk) -> f32 {
    var entry = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        let n = walk.shape[axis];
        let below = walk.p[axis] < 0.0;
        let above = walk.p[axis] >= f32(n);
        if select(below, above, walk.forward[axis]) {
            return FAR;
        }
        if below {
            entry = max(entry, crossing(walk, axis, 0));
        }
        if above {
            entry = max(entry, crossing(walk, axis, n));
        }
    }
    return entry;
}

// Bit of a voxel within its brick.
fn bit_of(cell: vec3<i32>) -> u32 {
    let at = vec3<u32>(cell) & vec3(3u, 3u, 1u);
    return (at.x << 3u) | (at.y << 1u) | at.z;
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn cover_voxels(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensor = uniforms.first_sensor + group.y;
    let beam = (group.z * groups.x + group.x) * WORKGROUP_SIZE + local;
    if beam >= uniforms.direction_count {
        return;
    }
    let slot = sensor * uniforms.direction_count + beam;
    var t_end = uniforms.range;
    if uniforms.ends_at_hits == 1u {
        let hit = hits[slot];
        if hit.prim != NO_HIT {
            t_end = hit.t + PUSH;
        }
    }
    let pose = poses[sensor];
    let walk = new_walk(pose.in_grid.xyz, beam_direction(pose, directions[beam].xyz));

    var cell: vec3<i32>;
    if uniforms.walk_pass <= 1u {
        let entry = entry_of(walk);
        if entry > t_end {
            if uniforms.walk_pass > 0u {
                walk_state[slot] = WALK_DONE;
            }
            return;
        }
        cell = vec3(cell_at(walk, 0u, entry), cell_at(walk, 1u, entry), cell_at(walk, 2u, entry));
    } else {
        let voxel = walk_state[slot];
        if voxel == WALK_DONE {
            return;
        }
        let row = voxel / uniforms.shape.z;
        let coords = vec3(row / uniforms.shape.y, row % uniforms.shape.y, voxel % uniforms.shape.z);
        cell = vec3<i32>(coords);
    }

    if any(cell < vec3(0)) || any(cell >= walk.shape) {
        if uniforms.walk_pass > 0u {
            walk_state[slot] = WALK_DONE;
        }
        return;
    }
    let hop = select(vec3(-1), vec3(1), walk.forward);
    let step = select(vec3(-1.0), vec3(1.0), walk.forward);
    // The plane ahead of cell c is c + 1 going forward and c going backward.
    var plane = vec3<f32>(cell + select(vec3(0), vec3(1), walk.forward));
    var next = (plane - walk.p) * walk.inverse;
    let last = select(vec3(0.0), vec3<f32>(walk.shape), walk.forward);
    let exits = (last - walk.p) * walk.inverse;
    let exit = min(min(min(exits.x, exits.y), exits.z), FAR);
    let bricks = (vec3<u32>(walk.shape) + vec3(3u, 3u, 1u)) >> vec3(2u, 2u, 1u);
    let base = group.y * uniforms.bitmap_words;
    var state = WALK_DONE;
    var steps = 0u;
    loop {
        // Bits of one brick are gathered before they are written.
        let brick = vec3<u32>(cell) >> vec3(2u, 2u, 1u);
        var bits = 0u;
        var goes_on = true;
        loop {
            bits |= 1u << bit_of(cell);
            let t = min(min(next.x, next.y), next.z);
            // The crossing at `exit` leaves the grid.
            goes_on = t <= t_end && t < exit;
            let crosses = next == vec3(t);
            plane += select(vec3(0.0), step, crosses);
            cell += select(vec3(0), hop, crosses);
            next = (plane - walk.p) * walk.inverse;
            steps++;
            if !goes_on || any((vec3<u32>(cell) >> vec3(2u, 2u, 1u)) != brick) {
                break;
            }
        }
        let word = (brick.x * bricks.y + brick.y) * bricks.z + brick.z;
        atomicOr(&bitmaps[base + word], bits);
        if !goes_on {
            break;
        }
        // Each brick is a loop step of its own for the driver's limit.
        steps++;
        if steps >= STEP_BUDGET {
            let shape = uniforms.shape;
            let at = vec3<u32>(cell);
            state = (at.x * shape.y + at.y) * shape.z + at.z;
            break;
        }
    }
    if uniforms.walk_pass > 0u {
        walk_state[slot] = state;
    }
}
