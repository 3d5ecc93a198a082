// cover_voxels: one invocation walks one beam from brick to brick and marks the voxels it traverses.
//
// CPU twin   crates/lidar-cast/src/cover/reference.rs::cover_voxels (a voxel at a time)
// Reads      poses[sensors], sensors[sensors], directions (those of a model one after the other), hits
//            of all beams if beams end at hits
// Writes     bitmaps[sensors × bitmap_words] by atomic or: word = brick of 4 × 4 × 2 voxels, bit
//            8·(x mod 4) + 2·(y mod 4) + (z mod 2) (crates/lidar-cast/src/cover/bit_order.rs)
// Dispatch   (ceil(most directions of a model / WORKGROUP_SIZE), sensors), x spilling into z; the host covers the
//            beams of sensors for which crates/lidar-cast/src/engine/gpu/chunk.rs::is_covered does not hold
// Prelude    WORKGROUP_SIZE, NO_HIT, HIT_PUSH, NO_CROSSING (printed from crates/lidar-cast/src/engine/gpu/layout.rs)
// Numerics   f32 as common/exact.wgsl has it; plane i is crossed at (i − p) · inverse, from the plane's number alone.
//            p is 0 or at least 1e-12 and below 2^15, so i − p is 0 or at least 2^-63; a voxel is from 2^-60 to 2^60 m, a
//            direction's component 0 or from 1e-9 to 1.001: nothing is denormal, and nothing overflows
//
// The voxels of a brick that a beam traverses follow from the order in which it crosses the brick's
// planes, without a walk: a mask removes every voxel that a plane, or a pair of planes, excludes.
// - Plane a crossed by the time the beam enters the brick: removes the voxels before a.
// - Plane a not crossed by the time the beam leaves or ends: removes the voxels behind a.
// - Plane a crossed no later than plane b: removes the voxels before a and behind b.

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> poses: array<DevicePose>;
@group(0) @binding(2) var<storage, read> sensors: array<Sensor>;
@group(0) @binding(3) var<storage, read> directions: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> hits: array<Hit>;
@group(0) @binding(5) var<storage, read_write> bitmaps: array<atomic<u32>>;

// Voxels of a brick below each of the planes in it: below x = 1 are bits 0 to 7, below y = 1 bits 0 and 1
// of each group of eight, below z = 1 the even bits.
const BELOW_X: vec3<u32> = vec3(0x000000ffu, 0x0000ffffu, 0x00ffffffu);
const BELOW_Y: vec3<u32> = vec3(0x03030303u, 0x0f0f0f0fu, 0x3f3f3f3fu);
const BELOW_Z: u32 = 0x55555555u;
const SIZE: vec3<f32> = vec3(4.0, 4.0, 2.0);
const PLANES: vec3<f32> = vec3(1.0, 2.0, 3.0);
const NONE: vec3<u32> = vec3(0u);

@compute @workgroup_size(WORKGROUP_SIZE)
fn cover_voxels(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensor = sensors[group.y];
    let beam = (group.z * groups.x + group.x) * WORKGROUP_SIZE + local;
    if beam >= sensor.direction_count || sensor.covered_by_host == 1u {
        return;
    }
    zero = sensor.zero;
    var t_end = sensor.range;
    if uniforms.ends_at_hits == 1u {
        let hit = hits[sensor.first_beam + beam];
        if hit.prim != NO_HIT {
            t_end = rounded(hit.t + HIT_PUSH);
        }
    }
    let pose = poses[group.y];
    let p = pose.in_grid.xyz;
    let direction = beam_direction(pose, directions[sensor.first_direction + beam].xyz);
    let forward = direction >= vec3(0.0);
    // A backward beam that starts on a plane has crossed it.
    let cell = select(ceil(p) - 1.0, floor(p), forward);
    if t_end < 0.0 || any(cell < vec3(0.0)) {
        return;
    }
    let level = direction == vec3(0.0);
    // Divides by one along an axis on which the beam stays level: no infinities.
    let divisor = select(direction, vec3(1.0), level);
    let voxel = uniforms.voxel;
    let slopes =
        vec3(divide(voxel.x, divisor.x), divide(voxel.y, divisor.y), divide(voxel.z, divisor.z));
    let inverse = select(slopes, vec3(NO_CROSSING), level);
    let last = select(vec3(0.0), vec3<f32>(uniforms.shape), forward);
    let exits = rounded3(last - p) * inverse;
    let exit = min(min(min(exits.x, exits.y), exits.z), NO_CROSSING);
    // A crossing at t_end counts (next float above it), the one that leaves the grid does not.
    let stop = select(exit, bitcast<f32>(bitcast<u32>(t_end) + 1u), t_end < exit);

    // Masks: x_y2[k] holds the voxels before x plane k + 1 and behind y plane 2, y2_x[k] the reverse.
    let back = select(vec3(~0u), NONE, forward);
    let before_x = BELOW_X ^ back.xxx;
    let before_y = BELOW_Y ^ back.yyy;
    let before_z = BELOW_Z ^ back.z;
    let behind_x = ~before_x;
    let behind_y = ~before_y;
    let behind_z = ~before_z;
    let x_y1 = before_x & behind_y.xxx;
    let y1_x = before_y.xxx & behind_x;
    let x_y2 = before_x & behind_y.yyy;
    let y2_x = before_y.yyy & behind_x;
    let x_y3 = before_x & behind_y.zzz;
    let y3_x = before_y.zzz & behind_x;
    let x_z = before_x & vec3(behind_z);
    let z_x = vec3(before_z) & behind_x;
    let y_z = before_y & vec3(behind_z);
    let z_y = vec3(before_z) & behind_y;

    let at = vec3<u32>(cell) >> vec3(2u, 2u, 1u);
    let bricks = (uniforms.shape + vec3(3u, 3u, 1u)) >> vec3(2u, 2u, 1u);
    let stride = vec3(bricks.y * bricks.z, bricks.z, 1u);
    let base = group.y * uniforms.bitmap_words;
    var word = base + at.x * stride.x + at.y * stride.y + at.z * stride.z;
    var corner = vec3<f32>(at) * SIZE;
    let next_word = select(NONE - stride, stride, forward);
    let next_corner = select(-SIZE, SIZE, forward);
    let ahead = select(vec3(0.0), SIZE, forward);
    var t = 0.0;
    loop {
        let x = rounded3(rounded3(corner.xxx + PLANES) - p.xxx) * inverse.xxx;
        let y = rounded3(rounded3(corner.yyy + PLANES) - p.yyy) * inverse.yyy;
        let z = rounded(rounded(corner.z + 1.0) - p.z) * inverse.z;
        let exits = rounded3(rounded3(corner + ahead) - p) * inverse;
        let exit = min(min(exits.x, exits.y), exits.z);
        let until = min(exit, stop);
        var out = select(NONE, before_x, x <= vec3(t)) | select(NONE, behind_x, x >= vec3(until));
        out |= select(NONE, before_y, y <= vec3(t)) | select(NONE, behind_y, y >= vec3(until));
        out |= select(NONE, x_y1, x <= y.xxx) | select(NONE, y1_x, y.xxx <= x);
        out |= select(NONE, x_y2, x <= y.yyy) | select(NONE, y2_x, y.yyy <= x);
        out |= select(NONE, x_y3, x <= y.zzz) | select(NONE, y3_x, y.zzz <= x);
        out |= select(NONE, x_z, x <= vec3(z)) | select(NONE, z_x, vec3(z) <= x);
        out |= select(NONE, y_z, y <= vec3(z)) | select(NONE, z_y, vec3(z) <= y);
        let out_z = select(0u, before_z, z <= t) | select(0u, behind_z, z >= until);
        atomicOr(&bitmaps[word], ~(out.x | out.y | out.z | out_z));
        if exit >= stop {
            break;
        }
        t = exit;
        let crosses = exits == vec3(exit);
        corner += select(vec3(0.0), next_corner, crosses);
        let on = select(NONE, next_word, crosses);
        word += on.x + on.y + on.z;
    }
}
