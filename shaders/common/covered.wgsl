// Sensors of a placement, and whether a sensor covers a voxel: shared by the reductions.
//
// CPU twin   crates/lidar-cast/src/reduce.rs::is_set; bit b of word w is bit number 32 w + b

struct Sensors {
    first: u32,
    count: u32,
}

fn covers(sensor: u32, voxel: u32) -> bool {
    let word = bitmaps[sensor * uniforms.bitmap_words + (voxel >> 5u)];
    return ((word >> (voxel & 31u)) & 1u) == 1u;
}
