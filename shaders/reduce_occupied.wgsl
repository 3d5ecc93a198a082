// reduce_occupied: sums the entropies of the occupied voxels that a placement covers.
//
// CPU twin   crates/lidar-cast/src/reduce.rs::reduce_occupied
// Reads      placements[placements], bitmaps[sensors × bitmap_words], occupied[occupied_count]
// Writes     partials[placement × workgroups × PARTIAL_WORDS], every element: word 0 the count of covered
//            occupied voxels, words 1 + 2k and 2 + 2k the sums of the low and the high 16 bits of sum k
//            (k = 0 to 3: kinds of information; 4 and 5: near information of voxels that at least two and three
//            sensors cover; 6 + s: unique entropy of sensor s), which cannot overflow within a workgroup; the
//            host adds them up
// Dispatch   (ceil(occupied_count / ITEMS_PER_WORKGROUP), placements)

struct OccupiedVoxel {
    index: u32,
    segmentation: u32,
    detection: u32,
    bernoulli: u32,
    near: u32,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> placements: array<Sensors>;
@group(0) @binding(2) var<storage, read> bitmaps: array<u32>;
@group(0) @binding(3) var<storage, read> occupied: array<OccupiedVoxel>;
@group(0) @binding(4) var<storage, read_write> partials: array<u32>;

var<workgroup> sums: array<atomic<u32>, PARTIAL_WORDS>;

fn add_halves(slot: u32, low: u32, high: u32) {
    atomicAdd(&sums[1u + 2u * slot], low);
    atomicAdd(&sums[2u + 2u * slot], high);
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn reduce_occupied(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensors = placements[group.y];
    var count = 0u;
    var low = vec4(0u);
    var high = vec4(0u);
    // Near information of voxels that at least two, and three, sensors cover.
    var low_repeated = vec2(0u);
    var high_repeated = vec2(0u);
    // Sums per invocation, added once: an atomic per voxel would cost more than the rest of the kernel.
    var unique_low: array<vec4<u32>, MAX_LIDARS / 4u>;
    var unique_high: array<vec4<u32>, MAX_LIDARS / 4u>;
    for (var k = 0u; k < ITEMS_PER_INVOCATION; k++) {
        let item = group.x * ITEMS_PER_WORKGROUP + k * WORKGROUP_SIZE + local;
        if item >= uniforms.occupied_count {
            break;
        }
        let voxel = occupied[item];
        var times = 0u;
        var last = 0u;
        for (var s = 0u; s < sensors.count; s++) {
            if covers(sensors.first + s, voxel.index) {
                times++;
                last = s;
            }
        }
        if times > 0u {
            let entropy = vec4(voxel.segmentation, voxel.detection, voxel.bernoulli, voxel.near);
            count++;
            low += entropy & vec4(0xffffu);
            high += entropy >> vec4(16u);
        }
        let repeated = vec2(times) >= vec2(2u, 3u);
        low_repeated += select(vec2(0u), vec2(voxel.near & 0xffffu), repeated);
        high_repeated += select(vec2(0u), vec2(voxel.near >> 16u), repeated);
        if times == 1u {
            let own = vec4(last & 3u) == vec4(0u, 1u, 2u, 3u);
            unique_low[last >> 2u] += select(vec4(0u), vec4(voxel.segmentation & 0xffffu), own);
            unique_high[last >> 2u] += select(vec4(0u), vec4(voxel.segmentation >> 16u), own);
        }
    }
    atomicAdd(&sums[0], count);
    for (var kind = 0u; kind < 4u; kind++) {
        add_halves(kind, low[kind], high[kind]);
    }
    for (var level = 0u; level < 2u; level++) {
        add_halves(4u + level, low_repeated[level], high_repeated[level]);
    }
    for (var s = 0u; s < sensors.count; s++) {
        add_halves(6u + s, unique_low[s >> 2u][s & 3u], unique_high[s >> 2u][s & 3u]);
    }
    workgroupBarrier();
    let base = (group.y * groups.x + group.x) * PARTIAL_WORDS;
    for (var word = local; word < PARTIAL_WORDS; word += WORKGROUP_SIZE) {
        partials[base + word] = atomicLoad(&sums[word]);
    }
}
