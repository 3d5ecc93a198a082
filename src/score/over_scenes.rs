//! Scores of one placement in several scenes as one: the mean that a search over scenes maximizes.

use std::collections::BTreeMap;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Guard, Scores, Seen, TaskScores, Tasks};
use crate::problem::Content;
use crate::psog::to_nats;

/// Σ H over all voxels of a scene in nats: of segmentation and of detection.
pub(crate) fn totals(content: &Content) -> [f64; 2] {
    let [segmentation, detection, ..] = content.entropy_total();
    [to_nats(segmentation), to_nats(detection)]
}

/// Mean of values; `None` where one of them does not exist, or there is none.
fn mean(values: impl ExactSizeIterator<Item = Option<f64>>) -> Option<f64> {
    let count = values.len();
    let sum = values.sum::<Option<f64>>();
    sum.filter(|_| count > 0).map(|sum| sum / count as f64)
}

/// Mean of sums over covered voxels: where nothing is covered the sum is 0, unless that is so everywhere.
fn mean_of_sums(values: impl ExactSizeIterator<Item = Option<f64>> + Clone) -> Option<f64> {
    let exists = values.clone().any(|value| value.is_some());
    mean(values.map(|value| value.or(exists.then_some(0.0))))
}

impl TaskScores {
    /// Means over scenes; the gain is the mean of the shares, in nats of the mean total, so that no scene
    /// counts more because more changes in it.
    fn over_scenes(scenes: &[(Self, f64)]) -> Self {
        let of = |score: fn(&Self) -> Option<f64>| mean(scenes.iter().map(|(task, _)| score(task)));
        let share = mean_of_sums(scenes.iter().map(|(task, _)| task.information_gain_share));
        let total = mean(scenes.iter().map(|(_, total)| Some(*total)));
        Self {
            m_sog: of(|task| task.m_sog),
            m_sog_scaled: of(|task| task.m_sog_scaled),
            m_sog_nonzero: of(|task| task.m_sog_nonzero),
            m_sog_scaled_nonzero: of(|task| task.m_sog_scaled_nonzero),
            information_gain: share.zip(total).map(|(share, total)| share * total),
            information_gain_share: share,
        }
    }
}

impl Tasks {
    /// Tasks over several scenes, each given with its [`totals`]; a single scene's tasks are returned unchanged.
    pub(super) fn over_scenes(scenes: &[(Self, [f64; 2])]) -> Self {
        if let [(tasks, _)] = scenes {
            return *tasks;
        }
        let segmentation = scenes.iter().map(|(tasks, totals)| (tasks.segmentation, totals[0]));
        let detection = scenes.iter().map(|(tasks, totals)| Some((tasks.detection?, totals[1])));
        let detection: Option<Vec<_>> = detection.collect();
        Self {
            segmentation: TaskScores::over_scenes(&segmentation.collect::<Vec<_>>()),
            detection: detection.map(|scenes| TaskScores::over_scenes(&scenes)),
            s_mig: mean_of_sums(scenes.iter().map(|(tasks, _)| tasks.s_mig)),
            near_gain: mean_of_sums(scenes.iter().map(|(tasks, _)| tasks.near_gain)),
            near_gain_2: mean_of_sums(scenes.iter().map(|(tasks, _)| tasks.near_gain_2)),
            near_gain_3: mean_of_sums(scenes.iter().map(|(tasks, _)| tasks.near_gain_3)),
        }
    }
}

impl Scores {
    /// Scores of one placement over several scenes, each given as its name, the scores there and its
    /// totals in nats, of segmentation and of detection.
    ///
    /// Every scene counts the same. The information gain of each is divided by the scene's own total; the
    /// mean of these shares times the mean total is the gain over all, in nats. The other scores are plain
    /// means, and do not exist where one of them does not; gains and S-MIG, which are sums, are 0 in a scene
    /// in which nothing is covered. A class counts over the scenes that have it. Guards are those of any
    /// scene.
    pub(crate) fn over_scenes(scenes: &[(&str, &Scores, [f64; 2])]) -> Self {
        let [(_, first, _), others @ ..] = scenes else { return Self::default() };
        if others.is_empty() {
            return (*first).clone();
        }
        let tasks = |&(_, scores, totals): &(&str, &Scores, [f64; 2])| (Tasks::of(scores), totals);
        let tasks = Tasks::over_scenes(&scenes.iter().map(tasks).collect::<Vec<_>>());
        let count = scenes.len() as f64;
        let plain = |of: fn(&Scores) -> f64| scenes.iter().map(|s| of(s.1)).sum::<f64>() / count;
        let unique = |lidar: usize| {
            scenes.iter().filter_map(|s| s.1.unique_share.get(lidar)).sum::<f64>() / count
        };
        Self {
            name: first.name.clone(),
            covered: plain(|scores| scores.covered),
            covered_nonzero: plain(|scores| scores.covered_nonzero),
            covered_by_class: by_class(scenes),
            beams: scenes.iter().map(|s| s.1.beams).sum::<u64>() / scenes.len() as u64,
            hit_share: mean(scenes.iter().map(|s| s.1.hit_share)),
            unique_share: (0..first.unique_share.len()).map(unique).collect(),
            required: required(scenes),
            guards: guards(scenes),
            broken_rules: first.broken_rules.clone(),
            ..Self::of_tasks(tasks)
        }
    }
}

/// Mean share of each area, which all scenes have, as they are of one vehicle.
fn required(scenes: &[(&str, &Scores, [f64; 2])]) -> Vec<Seen> {
    let Some((_, first, _)) = scenes.first() else { return Vec::new() };
    let mean = |area: usize| {
        let shares = scenes.iter().filter_map(|scene| scene.1.required.get(area));
        shares.map(|seen| seen.share).sum::<f64>() / scenes.len() as f64
    };
    let areas = first.required.iter().enumerate();
    // Areas alone: all other requirements are measured over all scenes at once.
    areas.map(|(area, seen)| Seen { share: mean(area), ..seen.clone() }).collect()
}

/// Mean of each class over the scenes that have it, in the order in which they name them.
fn by_class(scenes: &[(&str, &Scores, [f64; 2])]) -> Vec<(String, f64)> {
    let mut order: Vec<&String> = Vec::new();
    let mut sums: BTreeMap<&String, (f64, f64)> = BTreeMap::new();
    for (class, covered) in scenes.iter().flat_map(|scene| &scene.1.covered_by_class) {
        let (sum, count) = sums.entry(class).or_insert_with(|| {
            order.push(class);
            (0.0, 0.0)
        });
        (*sum, *count) = (*sum + covered, *count + 1.0);
    }
    let mean = |class: &String| sums.get(class).map_or(0.0, |(sum, count)| sum / count);
    order.into_iter().map(|class| (class.clone(), mean(class))).collect()
}

/// The guards of all scenes, each with the name of its scene.
fn guards(scenes: &[(&str, &Scores, [f64; 2])]) -> Vec<Guard> {
    let of_scene = |&(scene, scores, _): &(&str, &Scores, [f64; 2])| {
        let named = move |guard: &Guard| Guard::InScene {
            scene: scene.to_owned(),
            guard: Box::new(guard.clone()),
        };
        scores.guards.iter().map(named).collect::<Vec<_>>()
    };
    scenes.iter().flat_map(of_scene).collect()
}

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

/// The mean of values by scene and frame, `[scenes][frames]`, with a percentile interval (Efron 1979).
///
/// The bootstrap has two stages (Davison and Hinkley 1997, section 3.8). Each of `resamples` times it draws as many
/// scenes as there are, with replacement, and from each as many frames as it has. Equal seeds give equal bits.
///
/// `None` where a scene has no frame, or there is no scene or no resample to draw.
pub(crate) fn bootstrap(values: &[Vec<f64>], resamples: usize, seed: u64) -> Option<Interval> {
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

    fn scores(gain: f64, share: f64, m_sog: Option<f64>, classes: &[(&str, f64)]) -> Scores {
        let segmentation = TaskScores {
            information_gain: Some(gain),
            information_gain_share: Some(share),
            m_sog,
            ..TaskScores::default()
        };
        let covered_by_class = classes.iter().map(|(c, n)| ((*c).to_owned(), *n)).collect();
        Scores {
            segmentation,
            covered: 10.0 * gain,
            covered_by_class,
            unique_share: vec![share, 0.5],
            ..Scores::default()
        }
    }

    #[test]
    fn every_scene_counts_the_same_however_much_changes_in_it() {
        // 300 of 1000 nats and 10 of 100: shares 0.3 and 0.1, their mean 0.2 of 550 nats on average.
        let large = scores(300.0, 0.3, Some(-1.0), &[("car", 4.0), ("pole", 8.0)]);
        let mut small = scores(10.0, 0.1, Some(-2.0), &[("pole", 2.0), ("tree", 6.0)]);
        small.guards = vec![Guard::CoversNothing];
        let both = [("large", &large, [1000.0, 0.0]), ("small", &small, [100.0, 0.0])];
        let mean = Scores::over_scenes(&both);
        let close = |a: Option<f64>, b: f64| assert!((a.unwrap() - b).abs() < 1e-12, "{a:?} {b}");
        close(mean.segmentation.information_gain_share, 0.2);
        close(mean.segmentation.information_gain, 110.0);
        close(mean.segmentation.m_sog, -1.5);
        assert_eq!(mean.covered, 1550.0);
        let classes: Vec<_> = mean.covered_by_class.iter().map(|(c, n)| (c.as_str(), *n)).collect();
        assert_eq!(classes, [("car", 4.0), ("pole", 5.0), ("tree", 6.0)]);
        assert_eq!(mean.unique_share, [0.2, 0.5]);
        assert_eq!(mean.guards.len(), 1);
        assert!(mean.guards[0].to_string().ends_with("(in small)"), "{}", mean.guards[0]);
        // One scene alone is as it was.
        assert_eq!(Scores::over_scenes(&both[..1]), large);
        // A scene where nothing is covered has no gain, but a mean over covered voxels does not exist.
        let blind = Scores { segmentation: TaskScores::default(), ..Scores::default() };
        let none = ("blind", &blind, [100.0, 0.0]);
        let mean = Scores::over_scenes(&[both[0], none]).segmentation;
        close(mean.information_gain_share, 0.15);
        assert_eq!(mean.m_sog, None);
        let mean = Scores::over_scenes(&[none, none]).segmentation;
        assert_eq!(mean.information_gain, None);
    }

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
