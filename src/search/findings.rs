//! Correlation of layout properties with the objective, beside the null model of mean height.

use crate::maths;
use crate::score::{mean_height, spearman};
use crate::vehicle::Placement;

/// Numbers that describe a layout, by name.
type Descriptor = (&'static str, fn(&Placement) -> f64);

/// Properties of the paper's "intuitive interpretation"; the first, mean height, is the null model.
const DESCRIPTORS: [Descriptor; 4] = [
    ("mean height", mean_height),
    ("height spread", |p| deviation(p.lidars.iter().map(|l| l.z))),
    ("horizontal spread", |p| {
        maths::hypot(
            deviation(p.lidars.iter().map(|l| l.x)),
            deviation(p.lidars.iter().map(|l| l.y)),
        )
    }),
    ("mean |roll|", |p| p.lidars.iter().map(|l| l.roll.abs()).sum::<f64>() / p.lidars.len() as f64),
];

/// Standard deviation, with all values as the population.
fn deviation(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    (values.map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Correlation of one layout property with the score, over a sample of placements.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Finding {
    /// Name of the property.
    pub property: &'static str,
    /// Spearman's rank correlation with the score; `None` where either is constant.
    pub correlation: Option<f64>,
    /// Partial rank correlation with the score, mean height held fixed; `None` for mean height itself.
    pub beside_height: Option<f64>,
}

/// Fewest placements that are correlated: of two each correlation is 1 or −1.
const FEWEST: usize = 10;

/// Rank correlations of layout properties with the score over a sample, also with mean height held fixed; none of fewer
/// than ten placements.
pub(super) fn findings(sample: &[(Placement, f64)]) -> Vec<Finding> {
    if sample.len() < FEWEST { Vec::new() } else { correlated(sample) }
}

fn correlated(sample: &[(Placement, f64)]) -> Vec<Finding> {
    let scores: Vec<f64> = sample.iter().map(|(_, score)| *score).collect();
    let of = |describe: fn(&Placement) -> f64| -> Vec<f64> {
        // Rounded, so that equal layouts have equal numbers whatever the order of their sums.
        sample.iter().map(|(placement, _)| (describe(placement) * 1e9).round()).collect()
    };
    let heights = of(mean_height);
    let by_height = spearman(&heights, &scores);
    let finding = |(index, &(property, describe)): (usize, &Descriptor)| {
        let values = of(describe);
        let correlation = spearman(&values, &scores);
        let beside_height = (index > 0)
            .then(|| partial(correlation?, spearman(&values, &heights)?, by_height?))
            .flatten();
        Finding { property, correlation, beside_height }
    };
    DESCRIPTORS.iter().enumerate().map(finding).collect()
}

/// Correlation of a and b with c held fixed, from the three pairwise ones.
fn partial(ab: f64, ac: f64, bc: f64) -> Option<f64> {
    let scale = ((1.0 - ac * ac) * (1.0 - bc * bc)).sqrt();
    (scale > 1e-9).then(|| (ab - ac * bc) / scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SensorPose;

    fn placement(poses: &[(f64, f64, f64, f64)]) -> Placement {
        let pose = |&(x, y, z, roll): &(f64, f64, f64, f64)| SensorPose {
            roll,
            ..SensorPose::at(x, y, z)
        };
        Placement { name: "p".into(), lidars: poses.iter().map(pose).collect() }
    }

    #[test]
    fn descriptors_by_hand() {
        let layout = placement(&[(1.0, 0.0, 2.0, -0.2), (-1.0, 0.0, 3.0, 0.0)]);
        let values = DESCRIPTORS.map(|(_, describe)| describe(&layout));
        assert_eq!(values, [2.5, 0.5, 1.0, 0.1]);
    }

    #[test]
    fn a_score_that_is_height_leaves_nothing_to_the_others() {
        // Spread and height rise together, but the score follows height alone.
        let sample: Vec<(Placement, f64)> = [(0.1, 2.0), (0.2, 2.3), (0.4, 2.2), (0.5, 2.6)]
            .iter()
            .map(|&(x, z)| (placement(&[(x, 0.0, z, 0.0), (-x, 0.0, z, 0.0)]), z))
            .collect();
        assert_eq!(findings(&sample), [], "four placements are too few");
        let found = correlated(&sample);
        assert_eq!(found[0].correlation, Some(1.0));
        assert_eq!(found[0].beside_height, None);
        assert_eq!(found[1].correlation, None, "no height spread at all");
        assert!((found[2].correlation.unwrap() - 0.8).abs() < 1e-12);
        assert_eq!(found[2].beside_height, None, "height leaves nothing to explain");
        assert_eq!(partial(0.5, 0.0, 0.0), Some(0.5));
    }
}
