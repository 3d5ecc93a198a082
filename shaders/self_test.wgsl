// self_test: one invocation computes one case of the table that a device has to answer when it is opened.
//
// CPU twin   crates/lidar-cast/src/engine/gpu/self_test.rs::expected
// Reads      cases: operation, three operands (bits of f32, or integers), 0 (see common/exact.wgsl)
// Writes     answers, one word a case, every element
// Dispatch   cases / WORKGROUP_SIZE: the host fills the table up to whole workgroups
// Prelude    WORKGROUP_SIZE (printed from crates/lidar-cast/src/engine/gpu/layout.rs)
// Numerics   operations 0 to 13 must have the bits of IEEE 754 wherever result and operands are normal or zero; 14 to 17
//            show which freedom of Vulkan the device uses

struct Case {
    operation: u32,
    a: u32,
    b: u32,
    c: u32,
    zero: u32,
}

@group(0) @binding(0) var<storage, read> cases: array<Case>;
@group(0) @binding(1) var<storage, read_write> answers: array<u32>;

fn answer(operation: u32, words: vec3<u32>) -> u32 {
    let a = bitcast<f32>(words.x);
    let b = bitcast<f32>(words.y);
    let c = bitcast<f32>(words.z);
    switch operation {
        case 0u: { return bitcast<u32>(a + b); }
        case 1u: { return bitcast<u32>(a - b); }
        case 2u: { return bitcast<u32>(a * b); }
        case 3u: { return bitcast<u32>(divide(a, b)); }
        case 4u: { return bitcast<u32>(rounded(a * b) + c); }
        case 5u: { return bitcast<u32>(rounded(a + b) + c); }
        case 6u: { return bitcast<u32>(rounded(a - b) * c); }
        case 7u: { return bitcast<u32>(min(a, b)); }
        case 8u: { return bitcast<u32>(max(a, b)); }
        case 9u: { return select(2u, 1u, a < b) + select(0u, 4u, a == b) + select(0u, 8u, a >= b); }
        case 10u: { return bitcast<u32>(floor(a)); }
        case 11u: { return bitcast<u32>(ceil(a)); }
        case 12u: { return bitcast<u32>(f32(words.x)); }
        case 13u: { return u32(a); }
        case 14u: { return bitcast<u32>(a * b + c); }
        case 15u: { return bitcast<u32>((a + b) + c); }
        case 16u: { return bitcast<u32>(a / b); }
        case 17u: { return bitcast<u32>(a * b); }
        default: { return 0u; }
    }
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn self_test(@builtin(global_invocation_id) invocation: vec3<u32>) {
    let item = cases[invocation.x];
    zero = item.zero;
    answers[invocation.x] = answer(item.operation, vec3(item.a, item.b, item.c));
}
