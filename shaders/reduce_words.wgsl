// reduce_words: counts the voxels that any sensor of a placement covers.
//
// CPU twin   crates/lidar-cast/src/reduce.rs::reduce_words
// Reads      placements[placements], bitmaps[sensors × bitmap_words]
// Writes     totals[placement × (1 + class_count)] += covered voxels
// Dispatch   (ceil(bitmap_words / ITEMS_PER_WORKGROUP), placements)

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> placements: array<Sensors>;
@group(0) @binding(2) var<storage, read> bitmaps: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<atomic<u32>>;

var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(WORKGROUP_SIZE)
fn reduce_words(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensors = placements[group.y];
    var count = 0u;
    for (var k = 0u; k < ITEMS_PER_INVOCATION; k++) {
        let word = group.x * ITEMS_PER_WORKGROUP + k * WORKGROUP_SIZE + local;
        if word < uniforms.bitmap_words {
            var covered = 0u;
            for (var s = 0u; s < sensors.count; s++) {
                covered |= bitmaps[(sensors.first + s) * uniforms.bitmap_words + word];
            }
            count += countOneBits(covered);
        }
    }
    atomicAdd(&sum, count);
    workgroupBarrier();
    if local == 0u {
        atomicAdd(&totals[group.y * (1u + uniforms.class_count)], atomicLoad(&sum));
    }
}
