//! Rank statistics: Kendall's τ and Spearman's ρ, and mean height as the null model beside them.

use crate::vehicle::Placement;

/// Mean height of a placement's LiDARs above the ground, in metres: the null model that every
/// correlation stands beside, because height alone ranks placements much as a score does.
pub fn mean_height(placement: &Placement) -> f64 {
    placement.lidars.iter().map(|l| l.z).sum::<f64>() / placement.lidars.len() as f64
}

/// Kendall's τ-b of two equally long lists; `None` where one of them is constant.
pub fn kendall_tau(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mut agree, mut a_pairs, mut b_pairs) = (0.0, 0.0, 0.0);
    for i in 0..a.len() {
        for j in 0..i {
            let sign = |x: f64, y: f64| match x.total_cmp(&y) {
                _ if x == y => 0.0,
                std::cmp::Ordering::Less => -1.0,
                _ => 1.0,
            };
            let (da, db): (f64, f64) = (sign(a[i], a[j]), sign(b[i], b[j]));
            agree += da * db;
            a_pairs += da.abs();
            b_pairs += db.abs();
        }
    }
    (a_pairs > 0.0 && b_pairs > 0.0).then(|| agree / f64::sqrt(a_pairs * b_pairs))
}

/// Spearman's rank correlation, ties at their mean rank; `None` where one list is constant.
pub fn spearman(a: &[f64], b: &[f64]) -> Option<f64> {
    let ranks = |values: &[f64]| -> Vec<f64> {
        let rank = |v: f64| {
            let below = values.iter().filter(|&&w| w < v).count() as f64;
            let equal = values.iter().filter(|&&w| w == v).count() as f64;
            below + (equal - 1.0) / 2.0
        };
        values.iter().map(|&v| rank(v)).collect()
    };
    let (a, b) = (ranks(a), ranks(b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let dot = |x: &[f64], y: &[f64]| -> f64 {
        x.iter().zip(y).map(|(p, q)| (p - mean) * (q - mean)).sum()
    };
    let (aa, bb) = (dot(&a, &a), dot(&b, &b));
    (aa > 0.0 && bb > 0.0).then(|| dot(&a, &b) / (aa * bb).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_by_hand() {
        let a = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(kendall_tau(&a, &[10.0, 20.0, 30.0, 40.0]), Some(1.0));
        assert_eq!(kendall_tau(&a, &[4.0, 3.0, 2.0, 1.0]), Some(-1.0));
        // One of six pairs is the other way round.
        assert_eq!(kendall_tau(&a, &[1.0, 2.0, 4.0, 3.0]), Some(4.0 / 6.0));
        assert_eq!(spearman(&a, &[1.0, 2.0, 4.0, 3.0]), Some(0.8));
        assert_eq!(spearman(&a, &[5.0; 4]), None);
        assert_eq!(kendall_tau(&a, &[5.0; 4]), None);
    }
}
