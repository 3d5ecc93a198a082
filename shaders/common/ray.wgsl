// What the intersection of a ray with boxes and triangles takes.
//
// CPU twin   src/bvh/intersect.rs

fn safe_inverse(d: f32) -> f32 {
    if d == 0.0 {
        return FAR;
    }
    return 1.0 / d;
}

// Axis of the largest component.
fn major_axis(direction: vec3<f32>) -> u32 {
    let size = abs(direction);
    if size.x > size.y {
        return select(2u, 0u, size.x > size.z);
    }
    return select(2u, 1u, size.y > size.z);
}

// Moves the major axis to z, so that of the others x stays before y. Mirrored for one of the axes, which
// turns the signs of all edge functions and no more.
fn permute(v: vec3<f32>, major: u32) -> vec3<f32> {
    return select(select(v, v.xzy, major == 1u), v.yzx, major == 0u);
}

// Products added from left to right, which `dot` does not promise.
fn dot_in_order(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
