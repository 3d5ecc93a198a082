use std::cmp::Ordering;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::Evaluator;
use crate::engine::BackendError;
use crate::score::{Objective, Scores};
use crate::vehicle::{Constraints, Placement, PoseGrid, PoseGridError, Spacing};
use sightline_cma::{Cma, CmaError, CmaOptions, Ended, RestartOptions, Restarts};

/// Step size at the start, in the search space scaled to [0, 1]: most of each range is reached.
const STEP_SIZE: f64 = 0.3;
/// Standard deviation in each variable below which the scores no longer tell candidates apart, as a
/// share of its range: beams and voxels are spaced some centimetres apart.
const LEAST_DEVIATION: f64 = 0.01;
/// Share of the evaluations that is left when the least deviation is given up for the final polish.
const POLISH: f64 = 0.15;

/// One line of `history.jsonl`.
///
/// It holds nothing that depends on time or machine, so that equal runs leave equal bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GenerationRecord {
    /// From 1.
    pub generation: u64,
    /// Placements evaluated so far.
    pub evaluations: u64,
    /// Best objective of this generation among placements that keep every rule; larger is better.
    pub best: Option<f64>,
    /// Median objective of this generation, over all that were scored.
    pub median: Option<f64>,
    /// Best objective so far among placements that keep every rule.
    pub best_so_far: Option<f64>,
    /// Candidates of this generation that break a rule of the mount; they are not evaluated.
    pub infeasible: usize,
    /// Candidates of this generation that violate a guard.
    pub guarded: usize,
    /// Step size of the search distribution, in the search space scaled to [0, 1].
    pub step_size: f64,
}

/// What decides about a search, beside the problem.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchSettings {
    /// Text of the objective to maximize.
    pub objective: String,
    /// Candidates after which the search ends, at the end of a generation.
    pub evaluations: u64,
    /// Candidates of a generation; `None` leaves it to the strategy.
    pub population: Option<usize>,
    /// Candidates wanted at once: further instances of the strategy run beside the first while they
    /// fit; `None` runs one at a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub batch: Option<usize>,
    /// Seed of all randomness.
    pub seed: u64,
    /// Grid to whose poses candidates are moved before they are scored, as in Algorithm 1 of Place3D;
    /// `None` leaves them where they are.
    pub delta: Option<Spacing>,
}

/// Why a search has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SearchStop {
    /// The evaluations are used up.
    Budget,
    /// A placement reached the score that was wanted.
    Target,
    /// No pose field is free: there is one placement.
    Fixed,
}

impl fmt::Display for SearchStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Budget => "budget: the evaluations are used up",
            Self::Target => "target: a placement reached the score that was wanted",
            Self::Fixed => "fixed: no pose field is free, so there is one placement",
        })
    }
}

/// The best placement so far that keeps every rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Best {
    /// Its poses.
    pub placement: Placement,
    /// Its objective over the frames of the search.
    pub value: f64,
    /// Guards it violates.
    pub guards: usize,
    /// Generation that found it.
    pub generation: u64,
}

/// Why a search cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// From evaluating.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// From the strategy.
    #[error(transparent)]
    Optimize(#[from] CmaError),
    /// From the grid of poses.
    #[error(transparent)]
    Grid(#[from] PoseGridError),
}

/// A CMA-ES over the free pose fields of all LiDARs; one generation is one batch.
///
/// Where it stops by itself it restarts (BIPOP) while evaluations remain. LiDARs are alike, so the
/// order within a placement means nothing: layouts to start from and the best placement are put into
/// one order, so that layouts that differ by it alone are one point.
///
/// It saves and loads whole: a loaded search goes on to the same bits.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Search {
    settings: SearchSettings,
    cma: Option<Restarts>,
    best: Option<Best>,
    generation: u64,
    evaluations: u64,
    stopped: Option<SearchStop>,
}

/// How good a candidate is, worst rule first.
///
/// Candidates that keep the rules of the mount come before those that do not (and these by how much
/// they break them), those without a violated guard before those with, and then the objective counts.
#[derive(Debug, Clone, Copy)]
struct Standing {
    /// Sum of what is broken, in m and rad.
    violation: f64,
    guards: usize,
    /// Objective; `None` where it does not exist.
    value: Option<f64>,
}

impl Standing {
    /// −objective of a candidate that violates nothing; NaN of the others, which compare with it by
    /// standing alone.
    fn cost(&self) -> f64 {
        let value = self.value.filter(|_| self.violation == 0.0 && self.guards == 0);
        value.map_or(f64::NAN, |value| -value)
    }

    fn compare(&self, other: &Self) -> Ordering {
        let value = |s: &Self| s.value.unwrap_or(f64::NEG_INFINITY);
        self.violation
            .total_cmp(&other.violation)
            .then(self.guards.cmp(&other.guards))
            .then(value(other).total_cmp(&value(self)))
    }
}

/// A placement with its LiDARs ordered by x, then by the other pose fields.
fn canonical(placement: &Placement) -> Placement {
    let mut ordered = placement.clone();
    ordered.lidars.sort_by(|a, b| {
        let mut fields = a.fields().into_iter().zip(b.fields());
        let order = fields.find_map(|(a, b)| Some(a.1.total_cmp(&b.1)).filter(|o| o.is_ne()));
        order.unwrap_or(Ordering::Equal)
    });
    ordered
}

/// Costs for a strategy that only looks at ranks: equal standings get equal costs.
fn rank_costs(standings: &[Standing]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..standings.len()).collect();
    order.sort_by(|&a, &b| standings[a].compare(&standings[b]));
    let mut costs = vec![0.0; standings.len()];
    for pair in order.windows(2) {
        let step = standings[pair[0]].compare(&standings[pair[1]]) == Ordering::Less;
        costs[pair[1]] = costs[pair[0]] + f64::from(u8::from(step));
    }
    costs
}

impl Search {
    /// A search within the rules; `start` holds hand-made layouts that join the first generation.
    ///
    /// Where no pose field is free there is one placement only, and one generation evaluates it.
    ///
    /// # Errors
    /// Settings that the strategy refuses.
    pub fn new(
        settings: SearchSettings,
        constraints: &Constraints,
        start: &[Placement],
    ) -> Result<Self, SearchError> {
        let bounds = constraints.variable_bounds();
        let cma = if bounds.is_empty() {
            None
        } else {
            let middle: Vec<f64> = bounds.iter().map(|(low, high)| 0.5 * (low + high)).collect();
            let floor = bounds.iter().map(|(low, high)| LEAST_DEVIATION * (high - low)).collect();
            let options = CmaOptions {
                population: settings.population,
                seed: settings.seed,
                bounds: Some(bounds),
                min_std: Some(floor),
                ..CmaOptions::default()
            };
            // More instances than evaluations would end before they begin.
            let most = usize::try_from(settings.evaluations).unwrap_or(usize::MAX);
            let batch = settings.batch.map(|batch| batch.min(most));
            let restarts = RestartOptions { batch, ..RestartOptions::default() };
            let mut cma = Restarts::new(&middle, STEP_SIZE, options, restarts)?;
            let usable = start.iter().filter(|p| Self::why_left_out(constraints, p).is_empty());
            let points: Vec<Vec<f64>> =
                usable.filter_map(|p| constraints.variables_of(&canonical(p))).collect();
            cma.inject(&points)?;
            Some(cma)
        };
        Ok(Self { settings, cma, best: None, generation: 0, evaluations: 0, stopped: None })
    }

    /// Its settings.
    pub fn settings(&self) -> &SearchSettings {
        &self.settings
    }

    /// The best placement so far; `None` while no candidate kept the rules of the mount.
    pub fn best(&self) -> Option<&Best> {
        self.best.as_ref()
    }

    /// Generations so far.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Candidates so far.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Why the search has ended; `None` while it has not.
    pub fn stopped(&self) -> Option<SearchStop> {
        self.stopped
    }

    /// Ends the search: its best placement is good enough.
    pub fn stop_at_target(&mut self) {
        self.stopped = Some(SearchStop::Target);
    }

    /// Instances of the strategy that have stopped, each followed by another.
    pub fn ended(&self) -> &[Ended] {
        self.cma.as_ref().map_or(&[], Restarts::ended)
    }

    /// Why a layout to start from is not used, in words; empty where it is.
    pub fn why_left_out(constraints: &Constraints, start: &Placement) -> Vec<String> {
        let (has, wanted) = (start.lidars.len(), constraints.lidars);
        if has != wanted {
            return vec![format!("it has {has} LiDAR(s), the mount {wanted}")];
        }
        let broken = constraints.violations(start);
        if broken.is_empty() && constraints.variables_of(start).is_none() {
            return vec![
                "LiDARs in the plane of symmetry are none of the pairs that are moved".into(),
            ];
        }
        broken.iter().map(ToString::to_string).collect()
    }

    /// Runs one generation: asks for candidates, scores those that keep the rules, tells the ranks.
    ///
    /// # Errors
    /// The batch could not be evaluated; the search is then as before the call.
    pub fn step(
        &mut self,
        evaluator: &mut Evaluator,
        objective: &Objective,
    ) -> Result<GenerationRecord, SearchError> {
        let constraints = evaluator.constraints().clone();
        let mut cma = self.cma.clone();
        let candidates = cma.as_mut().map(Restarts::ask).unwrap_or_default();
        let generation = self.generation + 1;
        let mut placements: Vec<Placement> = if cma.is_some() {
            let poses = candidates.iter().map(|c| constraints.poses_of(c.point()));
            let named = poses.enumerate().map(|(index, lidars)| Placement {
                name: format!("generation-{generation}-{index}"),
                lidars,
            });
            named.collect()
        } else {
            vec![Placement { name: "only".into(), lidars: constraints.poses_of(&[]) }]
        };
        if let Some(spacing) = self.settings.delta {
            let grid = PoseGrid::new(&constraints, spacing)?;
            placements = placements
                .iter()
                .map(|placement| grid.snapped(placement, constraints.ties))
                .collect();
        }
        let violation: Vec<f64> = placements
            .iter()
            // From plus zero: an empty sum is minus zero, which sorts before what was kept.
            .map(|p| constraints.violations(p).iter().fold(0.0, |sum, v| sum + v.amount()))
            .collect();
        let kept = placements.iter().zip(&violation).filter(|(_, v)| **v == 0.0);
        let kept: Vec<Placement> = kept.map(|(placement, _)| placement.clone()).collect();
        let mut scores = evaluator.scores(&kept)?.into_iter();
        let standings: Vec<Standing> = violation
            .iter()
            .map(|&violation| {
                let scores: Option<Scores> = if violation == 0.0 { scores.next() } else { None };
                Standing {
                    violation,
                    guards: scores.as_ref().map_or(0, |s| s.guards.len()),
                    value: scores.as_ref().and_then(|s| objective.value(s)),
                }
            })
            .collect();
        if let Some(cma) = &mut cma {
            let costs: Vec<f64> = standings.iter().map(Standing::cost).collect();
            cma.tell_ranked(&candidates, &rank_costs(&standings), &costs)?;
            let spent = self.evaluations + placements.len() as u64;
            let left = self.settings.evaluations.saturating_sub(spent);
            if left as f64 <= POLISH * self.settings.evaluations as f64 {
                cma.polish();
            }
        }
        self.generation = generation;
        self.evaluations += placements.len() as u64;
        self.keep_best(&placements, &standings);
        let step_size =
            cma.as_ref().and_then(|cma| cma.running().next()).map_or(0.0, Cma::step_size);
        self.stopped = if cma.is_none() {
            Some(SearchStop::Fixed)
        } else if self.evaluations >= self.settings.evaluations {
            Some(SearchStop::Budget)
        } else {
            None
        };
        self.cma = cma;
        Ok(self.record(&standings, step_size))
    }

    /// Scores the best placement so far anew: on another problem its old value compares with nothing.
    ///
    /// # Errors
    /// The placement could not be evaluated.
    pub fn rescore_best(
        &mut self,
        evaluator: &mut Evaluator,
        objective: &Objective,
    ) -> Result<(), SearchError> {
        if let Some(best) = &mut self.best {
            let scores = evaluator.scores(std::slice::from_ref(&best.placement))?.remove(0);
            best.guards = scores.guards.len();
            best.value = objective.value(&scores).unwrap_or(f64::NEG_INFINITY);
        }
        Ok(())
    }

    fn keep_best(&mut self, placements: &[Placement], standings: &[Standing]) {
        for (placement, standing) in placements.iter().zip(standings) {
            let (Some(value), true) = (standing.value, standing.violation == 0.0) else { continue };
            let better = self.best.as_ref().is_none_or(|best| {
                let held =
                    Standing { violation: 0.0, guards: best.guards, value: Some(best.value) };
                standing.compare(&held) == Ordering::Less
            });
            if better {
                self.best = Some(Best {
                    placement: canonical(placement),
                    value,
                    guards: standing.guards,
                    generation: self.generation,
                });
            }
        }
    }

    fn record(&self, standings: &[Standing], step_size: f64) -> GenerationRecord {
        let mut values: Vec<f64> = standings.iter().filter_map(|s| s.value).collect();
        values.sort_by(f64::total_cmp);
        let best = standings.iter().min_by(|a, b| a.compare(b));
        GenerationRecord {
            generation: self.generation,
            evaluations: self.evaluations,
            best: best.and_then(|s| s.value),
            median: values.get(values.len() / 2).copied(),
            best_so_far: self.best.as_ref().map(|best| best.value),
            infeasible: standings.iter().filter(|s| s.violation > 0.0).count(),
            guarded: standings.iter().filter(|s| s.guards > 0).count(),
            step_size,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_rank_before_guards_before_the_objective() {
        let standing = |violation, guards, value| Standing { violation, guards, value };
        let standings = [
            standing(0.0, 1, Some(9.0)),
            standing(0.0, 0, Some(-2.0)),
            standing(0.3, 0, None),
            standing(0.0, 0, Some(-1.0)),
            standing(0.1, 0, None),
            standing(0.0, 0, Some(-2.0)),
            standing(0.0, 0, None),
        ];
        assert_eq!(rank_costs(&standings), [3.0, 1.0, 5.0, 0.0, 4.0, 1.0, 2.0]);
        let costs = standings.map(|standing| standing.cost());
        assert!(costs[0].is_nan() && costs[2].is_nan() && costs[6].is_nan());
        assert_eq!((costs[1], costs[3]), (2.0, 1.0));
    }

    #[test]
    fn the_order_of_the_lidars_means_nothing() {
        let pose = |x: f64, yaw: f64| crate::vehicle::SensorPose {
            x,
            y: 0.0,
            z: 2.0,
            roll: 0.0,
            pitch: 0.0,
            yaw,
        };
        let poses = [pose(0.5, 0.1), pose(-1.0, 0.2), pose(0.5, -0.3)];
        let placement = |order: [usize; 3]| Placement {
            name: "any".into(),
            lidars: order.map(|k| poses[k]).to_vec(),
        };
        let want = placement([1, 2, 0]);
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0]] {
            assert_eq!(canonical(&placement(order)), want);
        }
    }
}
