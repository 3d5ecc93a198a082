// Arithmetic that has the same bits on every device: `rounded` and `divide`.
//
// CPU twin   crates/lidar-cast/src/engine/gpu/isa.rs::divide
//
// Vulkan lets a driver merge a product and a sum into one rounding, reorder sums, divide with an error of 2.5 ulp,
// and flush denormals to zero (specification, "Precision and Operation of SPIR-V Instructions").

// Always 0, read from a buffer: each kernel sets it first, and no compiler can know its value.
var<private> zero: u32;

// x, rounded where it was computed. Proof: x ^ zero depends on every bit of x while `zero` is unknown, so the
// operation that made x has to end before the one that takes it begins, and the two cannot be merged.
fn rounded(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ zero);
}

fn rounded2(x: vec2<f32>) -> vec2<f32> {
    return bitcast<vec2<f32>>(bitcast<vec2<u32>>(x) ^ vec2(zero));
}

fn rounded3(x: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(x) ^ vec3(zero));
}

// a / b to the nearest float, ties to even, for a and b normal and |a / b| above 2^-126, or a = 0, from the device's own
// quotient, which may be wrong by 2.5 ulp. (Markstein, "Computation of elementary functions on the IBM RISC System/6000", 1990: the sign of
// an exact remainder corrects a quotient; here in integers.)
//
// Proof: m_a and m_b are mantissas in [2^23, 2^24), and Q = 2^s m_a / m_b lies in [2^23, 2^24). An error of 2.5 ulp and
// the cut to an integer leave the guess q within 3 of floor(Q). Then |r| < 4 m_b < 2^26, so that r, whose terms lose
// only multiples of 2^32, is the true remainder. Six comparisons move q to floor(Q), whose remainder rounds it.
fn divide(a: f32, b: f32) -> f32 {
    let bits_a = bitcast<u32>(a);
    let bits_b = bitcast<u32>(b);
    let fraction_a = bits_a & 0x7fffffu;
    let fraction_b = bits_b & 0x7fffffu;
    let m_a = fraction_a | 0x800000u;
    let m_b = fraction_b | 0x800000u;
    let less = m_a < m_b;
    let one = 0x3f800000u;
    let guess = rounded(bitcast<f32>(fraction_a | one) / bitcast<f32>(fraction_b | one));
    let q = u32(guess * select(8388608.0, 16777216.0, less));
    let r = i32((m_a << select(23u, 24u, less)) - q * m_b);
    let m = i32(m_b);
    let low = i32(r < 0) + i32(r < -m) + i32(r < -2 * m);
    let high = i32(r >= m) + i32(r >= 2 * m) + i32(r >= 3 * m);
    let whole = u32(i32(q) + high - low);
    let twice = 2 * (r - (high - low) * m);
    let up = u32(twice > m || (twice == m && (whole & 1u) == 1u));
    // whole + up lies in [2^23, 2^24]: the sum adds its leading bit to the exponent, a carry included.
    let exponent = ((bits_a >> 23u) & 255u) - ((bits_b >> 23u) & 255u) + select(126u, 125u, less);
    let bits = ((exponent << 23u) + whole + up) | ((bits_a ^ bits_b) & 0x80000000u);
    return select(bitcast<f32>(bits), 0.0, (bits_a << 1u) == 0u);
}

// Whether all components are zero or at least as large as a float, told by bits, which no device flushes.
fn at_least(x: vec3<f32>, least: f32) -> bool {
    // Less 1, zero becomes the largest word.
    let size = (bitcast<vec3<u32>>(x) & vec3(0x7fffffffu)) - vec3(1u);
    return min(min(size.x, size.y), size.z) >= bitcast<u32>(least) - 1u;
}
