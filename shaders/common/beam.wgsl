// Uniforms, poses, sensors, hits, and the direction of a beam: shared by all kernels.
//
// CPU twins  crates/lidar-cast/src/engine/gpu/layout.rs::Uniforms, ::Sensor, crates/lidar-cast/src/task/world.rs::DevicePose, crates/lidar-cast/src/bvh/intersect.rs::Hit
//            (offsets compared by a test in crates/lidar-cast/src/engine/gpu/kernels.rs), crates/lidar-cast/src/task/world.rs::beam_direction

struct Uniforms {
    shape: vec3<u32>,
    bitmap_words: u32,
    voxel: vec3<f32>,
    occupied_count: u32,
    class_count: u32,
    ends_at_hits: u32,
    spare: vec2<u32>,
}

struct DevicePose {
    row_x: vec4<f32>,
    row_y: vec4<f32>,
    row_z: vec4<f32>,
    in_grid: vec4<f32>,
}

struct Sensor {
    first_instance: u32,
    end_instance: u32,
    first_direction: u32,
    direction_count: u32,
    first_beam: u32,
    range: f32,
    zero: u32,
    covered_by_host: u32,
}

struct Hit {
    t: f32,
    prim: u32,
}

// Products added from left to right, which `dot` does not promise.
fn dot_in_order(a: vec3<f32>, b: vec3<f32>) -> f32 {
    let product = rounded3(a * b);
    return rounded(product.x + product.y) + product.z;
}

// A component of a direction in another frame; components below TINY_COMPONENT become 0, so that level beams stay level.
// A product below 2^-126 that a device flushes to zero changes no bit: against a sum of 1e-9 or more it is less than half
// an ulp, and a smaller sum becomes 0.
fn turned(row: vec4<f32>, v: vec3<f32>) -> f32 {
    let d = dot_in_order(row.xyz, v);
    return select(d, 0.0, abs(d) < TINY_COMPONENT);
}

fn beam_direction(pose: DevicePose, direction: vec3<f32>) -> vec3<f32> {
    return vec3(
        turned(pose.row_x, direction),
        turned(pose.row_y, direction),
        turned(pose.row_z, direction),
    );
}

fn beam_origin(pose: DevicePose) -> vec3<f32> {
    return vec3(pose.row_x.w, pose.row_y.w, pose.row_z.w);
}
