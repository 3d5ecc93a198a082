//! Outlines in a plane: which way three points turn, and sides that cross.

/// Twice the signed area of a triangle; positive when a, b, c turn counter-clockwise.
pub fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Two sides of a closed outline that cross, touch, or run back over each other, by the corners where they begin;
/// `None` of a simple polygon. No corner is the same as the next one.
pub fn crossing(corners: &[[f64; 2]]) -> Option<(usize, usize)> {
    let n = corners.len();
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    pairs.into_iter().find(|&(i, j)| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        let (c, d) = (corners[j], corners[(j + 1) % n]);
        let (tip, p, q) = match (j == i + 1, i == 0 && j == n - 1) {
            (true, _) => (b, a, d),
            (_, true) => (a, b, c),
            _ => return touch(a, b, c, d),
        };
        // Neighbours share a corner.
        turn(tip, p, q) == 0.0
            && (p[0] - tip[0]) * (q[0] - tip[0]) + (p[1] - tip[1]) * (q[1] - tip[1]) > 0.0
    })
}

/// True if the closed segments a–b and c–d share a point.
fn touch(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> bool {
    let sides = [turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)];
    if sides[0] * sides[1] < 0.0 && sides[2] * sides[3] < 0.0 {
        return true;
    }
    let within = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (0..2).all(|k| p[k].min(q[k]) <= r[k] && r[k] <= p[k].max(q[k]))
    };
    (sides[0] == 0.0 && within(a, b, c))
        || (sides[1] == 0.0 && within(a, b, d))
        || (sides[2] == 0.0 && within(c, d, a))
        || (sides[3] == 0.0 && within(c, d, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_that_cross_are_named() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(crossing(&square), None);
        let bow = [square[0], square[2], square[1], square[3]];
        assert_eq!(crossing(&bow), Some((0, 2)));
        // A side that ends on another one, and one that runs back.
        assert!(crossing(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]]).is_some());
        assert_eq!(crossing(&[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0]]), Some((0, 1)));
    }
}
