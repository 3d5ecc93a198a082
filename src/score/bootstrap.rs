//! Confidence of a mean over scenes: a bootstrap over scenes, and over the frames of each.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Share of the resampled means that an interval leaves out at each end.
const TAIL: f64 = 0.025;

/// A mean over scenes, and the interval that holds 95 % of the resampled means.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Mean over scenes of the means over their frames.
    pub mean: f64,
    /// Lower end: the quantile 0.025 of the resampled means.
    pub low: f64,
    /// Upper end: the quantile 0.975.
    pub high: f64,
}

/// The mean of values by scene and frame, `[scenes][frames]`, with a percentile interval (Efron 1979):
/// `resamples` times as many scenes are drawn with replacement, and of each of them as many of its frames
/// (a bootstrap in two stages: Davison and Hinkley 1997, section 3.8). Equal seeds give equal bits.
///
/// `None` where a scene has no frame, or there is no scene or no resample to draw.
pub fn bootstrap(values: &[Vec<f64>], resamples: usize, seed: u64) -> Option<Interval> {
    if values.is_empty() || resamples == 0 || values.iter().any(Vec::is_empty) {
        return None;
    }
    let of_scene = |frames: &Vec<f64>| frames.iter().sum::<f64>() / frames.len() as f64;
    let mean = values.iter().map(of_scene).sum::<f64>() / values.len() as f64;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut means: Vec<f64> = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        let scenes = (0..values.len()).map(|_| {
            let frames = &values[rng.random_range(0..values.len())];
            let drawn = (0..frames.len()).map(|_| frames[rng.random_range(0..frames.len())]);
            drawn.sum::<f64>() / frames.len() as f64
        });
        means.push(scenes.sum::<f64>() / values.len() as f64);
    }
    means.sort_by(f64::total_cmp);
    Some(Interval { mean, low: quantile(&means, TAIL), high: quantile(&means, 1.0 - TAIL) })
}

/// The quantile of sorted values, interpolated between neighbours as NumPy does.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    below + (above - below) * at.fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: Interval, want: [f64; 3], within: f64) {
        for (got, want) in [got.mean, got.low, got.high].into_iter().zip(want) {
            assert!((got - want).abs() < within, "{got} is not {want}");
        }
    }

    #[test]
    fn by_hand() {
        // Two scenes of one frame: their means are 0, ½ or 1, one in four at each end.
        let two = bootstrap(&[vec![0.0], vec![1.0]], 2000, 1).unwrap();
        assert_eq!(two, Interval { mean: 0.5, low: 0.0, high: 1.0 });
        // Equal values have no spread; each scene counts the same, whatever its number of frames.
        let same = bootstrap(&[vec![0.25; 3], vec![0.25]], 500, 1).unwrap();
        assert_eq!(same, Interval { mean: 0.25, low: 0.25, high: 0.25 });
        let uneven = bootstrap(&[vec![1.0; 9], vec![0.0]], 500, 1).unwrap();
        assert_eq!(uneven.mean, 0.5);
        // One scene still has its frames to draw from: 2 of {0, 1} give 0 in a quarter of the draws.
        let one = bootstrap(&[vec![0.0, 1.0]], 2000, 1).unwrap();
        assert_eq!((one.low, one.high), (0.0, 1.0));
        assert_eq!(bootstrap(&[vec![1.0], vec![]], 500, 1), None);
        assert_eq!(bootstrap(&[], 500, 1), None);
    }

    #[test]
    fn as_scipy_and_numpy_have_it() {
        // scipy.stats.bootstrap((v,), np.mean, method="percentile", n_resamples=1_000_000), version 1.17.1.
        let v = [0.3, -0.1, 0.25, 0.6, 0.1, 0.45, 0.2, -0.05];
        let scenes: Vec<Vec<f64>> = v.iter().map(|&v| vec![v]).collect();
        close(bootstrap(&scenes, 50_000, 3).unwrap(), [0.21875, 0.06875, 0.375], 0.005);
        // Two stages in NumPy, 400 000 resamples.
        let scenes = [vec![0.1, 0.3, 0.2], vec![-0.2, 0.4], vec![0.5, 0.45, 0.6, 0.1]];
        let found = bootstrap(&scenes, 50_000, 3).unwrap();
        close(found, [0.2375, 0.011_111_11, 0.433_333_33], 0.008);
        assert_eq!(Some(found), bootstrap(&scenes, 50_000, 3), "equal seeds give equal bits");
    }

    #[test]
    fn quantiles_lie_between_neighbours() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(quantile(&[7.0], 0.975), 7.0);
    }
}
