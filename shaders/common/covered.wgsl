// Which sensors of a placement cover a voxel: what the reductions share.

struct Sensors {
    first: u32,
    count: u32,
}

fn covers(sensor: u32, voxel: u32) -> bool {
    let word = bitmaps[sensor * uniforms.bitmap_words + (voxel >> 5u)];
    return ((word >> (voxel & 31u)) & 1u) == 1u;
}
