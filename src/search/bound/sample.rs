//! Placements sampled on a grid in pairs of neighbours, and the paper's bound from them.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::grid_search::GridSearch;
use crate::vehicle::{Placement, SensorPose};

/// Theorem 1 of Place3D: |G(u*) − G(best sampled)| ≤ C_M + k_G·δ, from measured numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LipschitzBound {
    /// Largest less smallest objective of the placements sampled on the grid.
    pub c_m: f64,
    /// Largest change of the objective a metre (or radian) between neighbours on the grid.
    pub k_g: f64,
    /// Largest spacing of the grid along a pose field that may vary, in m or rad.
    pub delta: f64,
    /// C_M + k_G·δ.
    pub bound: f64,
    /// Placements sampled, their neighbours not counted.
    pub samples: usize,
}

/// Placements sampled on a grid in pairs of neighbours, with their objectives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GridSample {
    pairs: Vec<(Placement, Option<f64>)>,
    delta: f64,
}

impl GridSample {
    /// The placements sampled.
    pub fn placements(&self) -> impl Iterator<Item = &Placement> {
        self.pairs.iter().map(|(placement, _)| placement)
    }

    /// Checks that the placements of a loaded sample come in pairs.
    pub(crate) fn check(&self) -> Result<(), String> {
        let is_whole = self.pairs.len().is_multiple_of(2) && self.delta.is_finite();
        is_whole.then_some(()).ok_or_else(|| "sampled placements do not come in pairs".to_owned())
    }

    /// Samples placements on the grid of a search, each with one neighbour a step along one pose field away.
    ///
    /// Ties between LiDARs are left out: random poses never keep them.
    /// Placements that break another rule of the mount are drawn again, but not for ever. None are drawn once `go_on`
    /// says no. It is asked before each pair but the first, and as by [`GridSearch::hold_while`]. The sample may
    /// therefore be smaller than `samples`, and is empty where nothing may vary or no pair was cast in time.
    pub fn draw(
        search: &mut GridSearch,
        evaluator: &mut Evaluator,
        samples: usize,
        seed: u64,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Self, SearchError> {
        let constraints = evaluator.constraints().untied();
        let grid = search.atlas().grid().clone();
        let lidars = constraints.lidars();
        if lidars == 0 {
            return Ok(Self { pairs: Vec::new(), delta: 0.0 });
        }
        let free = constraints.slots.iter().flat_map(|slot| slot.region.free_fields());
        let delta = free.map(|k| grid.step()[k]).fold(0.0, f64::max);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut pairs = Vec::new();
        for _ in 0..100 * samples {
            // One pair in any case, where that is a few casts: the findings have something to go by.
            if pairs.len() == 2 * samples || (!pairs.is_empty() && !go_on()) {
                break;
            }
            let poses: Vec<u32> =
                (0..lidars).map(|lidar| rng.random_range(grid.poses_of_lidar(lidar))).collect();
            let lidar = rng.random_range(0..lidars);
            let mut near = grid.along(poses[lidar], 1);
            near.retain(|&pose| pose != poses[lidar]);
            if near.is_empty() {
                break;
            }
            let mut moved = poses.clone();
            moved[lidar] = near[rng.random_range(0..near.len())];
            let pair = [poses, moved];
            let placed = |poses: &Vec<u32>| Placement {
                name: "sample".into(),
                lidars: poses.iter().map(|&pose| grid.pose(pose)).collect(),
            };
            let keeps = |poses| constraints.violations(&placed(poses)).is_empty();
            if pair.iter().all(keeps) {
                if !search.atlas.hold_while(evaluator, &pair.concat(), &mut |_| go_on())? {
                    break;
                }
                for poses in &pair {
                    let value = Some(search.value(evaluator, poses)?);
                    pairs.push((placed(poses), value.filter(|value| value.is_finite())));
                }
            }
        }
        Ok(Self { pairs, delta })
    }

    /// The placements that have an objective.
    pub fn scored(&self) -> Vec<(Placement, f64)> {
        self.pairs.iter().filter_map(|(p, value)| Some((p.clone(), (*value)?))).collect()
    }

    /// The paper's bound. The sample decides about C_M and k_G: both are estimates from below. C_M
    /// alone is as large as the range of the sampled scores, so the bound tells nothing that the
    /// sample does not; it is reported because the paper does.
    ///
    /// `None` where no sampled placement has an objective.
    pub fn lipschitz(&self) -> Option<LipschitzBound> {
        let scored = self.scored();
        let (low, high) =
            scored.iter().fold((f64::MAX, f64::MIN), |(l, h), (_, v)| (l.min(*v), h.max(*v)));
        let slopes = self.pairs.chunks(2).filter_map(|pair| {
            let numbers = |pose: &SensorPose| pose.values().into_iter().chain(pose.phase);
            let fields = pair[0].0.lidars.iter().zip(&pair[1].0.lidars);
            let fields = fields.flat_map(|(a, b)| numbers(a).zip(numbers(b)));
            let apart: f64 = fields.map(|(a, b)| (a - b).abs()).sum();
            Some((pair[0].1? - pair[1].1?).abs() / apart).filter(|_| apart > 0.0)
        });
        let k_g = slopes.fold(0.0, f64::max);
        let (c_m, delta) = (high - low, self.delta);
        let samples = self.pairs.len() / 2;
        let bound = c_m + k_g * delta;
        (!scored.is_empty()).then_some(LipschitzBound { c_m, k_g, delta, bound, samples })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loaded_sample_has_pairs() {
        let one = r#"[{ "name": "sample", "lidars": [{ "x": 0, "y": 0, "z": 2 }] }, null]"#;
        let read = |pairs: &str| -> GridSample {
            serde_json::from_str(&format!(r#"{{ "pairs": [{pairs}], "delta": 0.1 }}"#)).unwrap()
        };
        let pair = read(&format!("{one}, {one}"));
        assert_eq!((pair.check(), pair.lipschitz()), (Ok(()), None));
        assert!(read(one).check().is_err());
    }
}
