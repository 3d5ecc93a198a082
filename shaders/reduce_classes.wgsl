// reduce_classes: counts the covered voxels in which each class occurs.
//
// CPU twin   crates/lidar-cast/src/reduce.rs::reduce_classes
// Reads      placements[placements], bitmaps[sensors × bitmap_words], class_voxels (bit numbers,
//            class after class), class_runs (class, first, end: at most ITEMS_PER_WORKGROUP each)
// Writes     totals[placement × (1 + class_count) + 1 + class] += covered voxels
// Dispatch   (class_runs, placements)

struct ClassRun {
    class_id: u32,
    first: u32,
    end: u32,
    spare: u32,
}

@group(0) @binding(0) var<uniform> uniforms: Uniforms;
@group(0) @binding(1) var<storage, read> placements: array<Sensors>;
@group(0) @binding(2) var<storage, read> bitmaps: array<u32>;
@group(0) @binding(3) var<storage, read> class_voxels: array<u32>;
@group(0) @binding(4) var<storage, read> class_runs: array<ClassRun>;
@group(0) @binding(5) var<storage, read_write> totals: array<atomic<u32>>;

var<workgroup> sum: atomic<u32>;

@compute @workgroup_size(WORKGROUP_SIZE)
fn reduce_classes(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let sensors = placements[group.y];
    let run = class_runs[group.x];
    var count = 0u;
    for (var item = run.first + local; item < run.end; item += WORKGROUP_SIZE) {
        for (var s = 0u; s < sensors.count; s++) {
            if covers(sensors.first + s, class_voxels[item]) {
                count++;
                break;
            }
        }
    }
    atomicAdd(&sum, count);
    workgroupBarrier();
    if local == 0u {
        let slot = group.y * (1u + uniforms.class_count) + 1u + run.class_id;
        atomicAdd(&totals[slot], atomicLoad(&sum));
    }
}
