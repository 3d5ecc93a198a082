//! Simple polygons in the xy plane: checks and ear clipping.

use lidar_cast::geom::{crossing, turn};
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location};

/// Corners of one prism; checks and clipping are quadratic in it.
const MAX_CORNERS: usize = 1000;

/// Checks that `base` is a simple polygon; returns it counter-clockwise.
pub(crate) fn simple(at: &Location, base: &[[f64; 2]]) -> Checked<Vec<[f64; 2]>> {
    let n = base.len();
    if !(3..=MAX_CORNERS).contains(&n) {
        return Err(bad(at, format!("a list of {n}"), format!("3 to {MAX_CORNERS} corners")));
    }
    for (i, p) in base.iter().enumerate() {
        for (k, v) in p.iter().enumerate() {
            check::metres(&at.item(i).item(k), *v)?;
        }
        if *p == base[(i + 1) % n] {
            let wanted = "different from the next corner; leave repeated corners out, the last one \
                          joins the first by itself";
            return Err(bad(&at.item(i), format!("{p:?}"), wanted));
        }
    }
    if let Some((i, j)) = crossing(base) {
        let [a, b, c, d] = [i, i + 1, j, j + 1].map(|k| base[k % n]);
        let value = format!("the side from {c:?} to {d:?}");
        let wanted = format!(
            "free of the side from {a:?} to {b:?}; the outline must not cross or touch itself"
        );
        return Err(bad(&at.item(j), value, wanted));
    }
    let mut corners = base.to_vec();
    // Relative to the first corner, so that far-away outlines keep their digits.
    let area: f64 = (1..n - 1).map(|i| turn(base[0], base[i], base[i + 1])).sum();
    if area == 0.0 {
        return Err(bad(at, "the outline", "a polygon with an area"));
    }
    if area < 0.0 {
        corners.reverse();
    }
    Ok(corners)
}

/// Cuts a simple counter-clockwise polygon into `corners.len() − 2` counter-clockwise triangles.
pub(crate) fn triangulate(corners: &[[f64; 2]]) -> Vec<[u32; 3]> {
    let mut left: Vec<u32> = (0..corners.len() as u32).collect();
    let mut triangles = Vec::with_capacity(corners.len() - 2);
    let corner = |i: u32| corners[i as usize];
    while left.len() > 3 {
        let n = left.len();
        let ear = |&i: &usize| {
            let ids = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let [a, b, c] = ids.map(corner);
            let inside = |&j: &u32| {
                let p = corner(j);
                !ids.contains(&j)
                    && turn(a, b, p) >= 0.0
                    && turn(b, c, p) >= 0.0
                    && turn(c, a, p) >= 0.0
            };
            turn(a, b, c) > 0.0 && !left.iter().any(inside)
        };
        // Every simple polygon has an ear; when rounding hides it, a straight corner goes first.
        let flat = |&i: &usize| {
            turn(corner(left[(i + n - 1) % n]), corner(left[i]), corner(left[(i + 1) % n])) == 0.0
        };
        let i = (0..n).find(ear).or_else(|| (0..n).find(flat)).unwrap_or(0);
        triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[[f64; 2]]) -> f64 {
        let parts = triangulate(corners);
        assert_eq!(parts.len(), corners.len() - 2);
        parts
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| corners[i as usize]);
                assert!(turn(a, b, c) >= 0.0, "{t:?} is turned over");
                turn(a, b, c) / 2.0
            })
            .sum()
    }

    #[test]
    fn concave_outlines_keep_their_area_in_both_senses() {
        let l = [[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        let mut turned = l;
        turned.reverse();
        for base in [l, turned] {
            assert_eq!(area(&simple(&Location::top("t"), &base).unwrap()), 6.0);
        }
        // A comb: many reflex corners.
        let mut comb = vec![[0.0, 0.0], [9.0, 0.0]];
        for i in (0..9).rev() {
            let height = if i % 2 == 0 { 3.0 } else { 1.0 };
            comb.extend([[f64::from(i) + 1.0, height], [f64::from(i), height]]);
        }
        assert_eq!(area(&simple(&Location::top("t"), &comb).unwrap()), 5.0 * 3.0 + 4.0);
    }

    #[test]
    fn random_outlines_with_many_straight_corners_keep_their_area() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut tried = 0;
        while tried < 500 {
            // Seen from the origin the corners turn once; on a small grid many lie in line.
            let n = rng.random_range(3..40);
            let mut angles: Vec<f64> =
                (0..n).map(|_| rng.random_range(0.0..std::f64::consts::TAU)).collect();
            angles.sort_by(f64::total_cmp);
            let corner = |a: &f64, r: f64| [(r * a.cos()).round(), (r * a.sin()).round()];
            let base: Vec<_> =
                angles.iter().map(|a| corner(a, rng.random_range(2.0..12.0))).collect();
            let Ok(outline) = simple(&Location::top("t"), &base) else { continue };
            let shoelace: f64 = (0..n)
                .map(|i| (outline[i], outline[(i + 1) % n]))
                .map(|(a, b)| (a[0] * b[1] - a[1] * b[0]) / 2.0)
                .sum();
            assert_eq!(area(&outline), shoelace, "{outline:?}");
            tried += 1;
        }
    }

    #[test]
    fn the_largest_comb_is_cut_in_a_moment() {
        let mut comb = vec![[0.0, 0.0], [499.0, 0.0]];
        for i in (0..499).rev() {
            let height = if i % 2 == 0 { 3.0 } else { 1.0 };
            comb.extend([[f64::from(i) + 1.0, height], [f64::from(i), height]]);
        }
        let start = std::time::Instant::now();
        assert_eq!(area(&simple(&Location::top("t"), &comb).unwrap()), 250.0 * 3.0 + 249.0);
        assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
    }

    #[test]
    fn a_straight_corner_is_allowed() {
        let base = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        assert_eq!(area(&simple(&Location::top("t"), &base).unwrap()), 4.0);
    }

    #[test]
    fn crossing_touching_and_flat_outlines_are_refused() {
        let bad: [&[[f64; 2]]; 5] = [
            &[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]],
            &[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]],
            &[[0.0, 0.0], [4.0, 0.0], [2.0, 0.0]],
            &[[0.0, 0.0], [1.0, 0.0]],
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        ];
        for base in bad {
            assert!(simple(&Location::top("t"), base).is_err(), "{base:?}");
        }
    }
}
