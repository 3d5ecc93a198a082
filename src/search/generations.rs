//! The generations of a run: CMA-ES over the free pose fields of all LiDARs.

use std::cmp::Ordering;
use std::fmt;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use sightline_cma::{CmaOptions, Ended, RestartOptions, Restarts};

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::settings::Settings;
use crate::json::counted;
use crate::score::{Scores, Standing};
use crate::vehicle::{Constraints, Placement, PoseGrid};

/// Step size at the start, in the search space scaled to [0, 1]: most of each range is reached.
const STEP_SIZE: f64 = 0.3;
/// Standard deviation in each variable below which the scores no longer tell candidates apart, as a
/// share of its range: beams and voxels are spaced some centimetres apart.
const LEAST_DEVIATION: f64 = 0.01;
/// Share of the evaluations that is left when the least deviation is given up for the final polish.
const POLISH: f64 = 0.15;

/// Largest count of a loaded search: far beyond any run, far below overflow.
pub(super) const MOST_COUNTED: u64 = 1 << 53;

/// One line of `history.jsonl`.
///
/// It holds nothing that depends on time or machine, so that equal runs leave equal bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GenerationRecord {
    /// From 1.
    pub generation: u64,
    /// Placements evaluated so far.
    pub evaluations: u64,
    /// Best objective of this generation among placements that keep every rule, less the penalty for cars that are not
    /// seen all round; larger is better.
    pub best: Option<f64>,
    /// Median of this generation over all that were scored, as for `best`.
    pub median: Option<f64>,
    /// Best so far, as for `best`; it falls only where more frames are averaged from now on, or where a placement that
    /// misses less of the requirements takes its place.
    pub best_so_far: Option<f64>,
    /// Share of the requirements that the best so far misses, summed over them; `None` where it meets all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub missing: Option<f64>,
    /// Candidates of this generation that break a rule of the mount; they are not evaluated.
    pub infeasible: usize,
    /// Candidates of this generation that violate a guard.
    pub guarded: usize,
    /// Step size of the search distribution, in the search space scaled to [0, 1].
    pub step_size: f64,
}

/// Why the generations have ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum GenerationsStop {
    /// The limit of evaluations is reached.
    Budget,
    /// A placement reached the score that was wanted.
    Target,
    /// No pose field is free: there is one placement.
    Fixed,
}

impl fmt::Display for GenerationsStop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Budget => "evaluations: the limit is reached",
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
    /// Its standing over the frames of the search.
    pub standing: Standing,
    /// Generation that found it.
    pub generation: u64,
}

/// Result of one generation.
pub struct Generation {
    /// Its line of the history.
    pub record: GenerationRecord,
    /// Its placements that keep the rules of the mount, with their scores.
    pub scored: Vec<(Placement, Scores)>,
    /// Wall time of the scores.
    pub scoring: Duration,
}

/// A CMA-ES over the free pose fields of all LiDARs; one generation is one batch.
///
/// Where it stops by itself it restarts (BIPOP) while evaluations remain. LiDARs are alike, so the
/// order within a placement means nothing: layouts to start from and the best placement are put into
/// one order, so that layouts that differ by it alone are one point.
///
/// Saved and loaded whole: a loaded search continues to the same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Generations {
    cma: Option<Restarts>,
    best: Option<Best>,
    pub(super) generation: u64,
    evaluations: u64,
    pub(super) stopped: Option<GenerationsStop>,
}

/// A placement with its LiDARs ordered by x, then by the other pose fields.
fn canonical(constraints: &Constraints, placement: &Placement) -> Placement {
    let mut ordered = placement.clone();
    if constraints.kinds().len() > 1 {
        ordered.lidars = constraints.in_slots(&ordered.lidars).unwrap_or(ordered.lidars);
        return ordered;
    }
    ordered.lidars.sort_by(|a, b| {
        let mut fields = a.fields().into_iter().zip(b.fields());
        let order = fields.find_map(|(a, b)| Some(a.1.total_cmp(&b.1)).filter(|o| o.is_ne()));
        order.unwrap_or(Ordering::Equal)
    });
    ordered
}

impl Generations {
    /// A search within the rules; `starts` are layouts that join the first generation where the mount
    /// allows them.
    ///
    /// Where no pose field is free there is one placement only, and one generation evaluates it.
    ///
    /// # Errors
    /// Settings that the strategy refuses.
    pub fn new<'a>(
        settings: &Settings,
        constraints: &Constraints,
        starts: impl Iterator<Item = &'a Placement>,
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
            let mut cma = Restarts::new(&middle, STEP_SIZE, options, RestartOptions::default())?;
            let usable = starts.filter(|p| why_left_out(constraints, p).is_empty());
            let points: Vec<Vec<f64>> = usable
                .filter_map(|p| constraints.variables_of(&canonical(constraints, p)))
                .collect();
            cma.inject(&points)?;
            Some(cma)
        };
        Ok(Self { cma, best: None, generation: 0, evaluations: 0, stopped: None })
    }

    /// Looks whether a loaded search is one over these rules.
    pub(super) fn check(&self, constraints: &Constraints) -> Result<(), String> {
        if self.generation.max(self.evaluations) > MOST_COUNTED {
            return Err("its counts are beyond any run".to_owned());
        }
        let variables = constraints.variable_bounds().len();
        let checked = self.cma.as_ref().map_or(Ok(()), |cma| cma.check(variables));
        checked.map_err(|error| error.to_string())
    }

    /// The best placement so far; `None` while no candidate kept the rules of the mount.
    pub fn best(&self) -> Option<&Best> {
        self.best.as_ref()
    }

    /// Candidates so far.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Why the search has ended; `None` while it has not.
    pub fn stopped(&self) -> Option<GenerationsStop> {
        self.stopped
    }

    /// Instances of the CMA-ES that have stopped, each followed by another.
    pub fn ended(&self) -> &[Ended] {
        self.cma.as_ref().map_or(&[], Restarts::ended)
    }

    /// Runs one generation: asks for candidates, scores those that keep the rules, tells the ranks. `None` once `go_on`,
    /// which is asked before every few candidates and frames, says no; the search is then as before the call.
    ///
    /// # Errors
    /// The batch could not be evaluated; the search is then as before the call.
    pub fn step(
        &mut self,
        evaluator: &mut Evaluator,
        settings: &Settings,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Generation>, SearchError> {
        let constraints = evaluator.constraints().clone();
        let mut cma = self.cma.clone();
        let candidates = cma.as_mut().map(Restarts::ask).unwrap_or_default();
        let points: Vec<&[f64]> = match &cma {
            Some(_) => candidates.iter().map(|candidate| candidate.point()).collect(),
            None => vec![&[]],
        };
        let placements = self.placements(&points, &constraints, settings)?;
        // From plus zero: an empty sum is minus zero, which sorts before plus zero.
        let amount =
            |p: &Placement| constraints.violations(p).iter().fold(0.0, |sum, v| sum + v.amount());
        let violation: Vec<f64> = placements.iter().map(amount).collect();
        let kept = placements.iter().zip(&violation).filter(|(_, v)| **v == 0.0);
        let kept: Vec<Placement> = kept.map(|(placement, _)| placement.clone()).collect();
        let start = Instant::now();
        let Some(scores) = evaluator.scores_while(&kept, go_on)? else { return Ok(None) };
        let scoring = start.elapsed();
        let mut of_kept = scores.iter().map(|scores| Standing::of(scores, &settings.objective));
        let standing = |&violation: &f64| {
            let of_kept = if violation == 0.0 { of_kept.next() } else { None };
            of_kept.unwrap_or_else(|| Standing::outside(violation))
        };
        let standings: Vec<Standing> = violation.iter().map(standing).collect();
        if let Some(cma) = &mut cma {
            let costs: Vec<f64> = standings.iter().map(Standing::cost).collect();
            cma.tell_ranked(&candidates, &Standing::ranks(&standings), &costs)?;
            let spent = self.evaluations + placements.len() as u64;
            let left = settings.evaluations.saturating_sub(spent);
            if left as f64 <= POLISH * settings.evaluations as f64 {
                cma.polish();
            }
        }
        self.generation += 1;
        self.evaluations += placements.len() as u64;
        self.keep_best(&constraints, &placements, &standings);
        self.stopped = match &cma {
            None => Some(GenerationsStop::Fixed),
            Some(_) if self.evaluations >= settings.evaluations => Some(GenerationsStop::Budget),
            Some(_) => None,
        };
        self.cma = cma;
        let record = self.record(&standings);
        Ok(Some(Generation { record, scored: kept.into_iter().zip(scores).collect(), scoring }))
    }

    fn placements(
        &self,
        points: &[&[f64]],
        constraints: &Constraints,
        settings: &Settings,
    ) -> Result<Vec<Placement>, SearchError> {
        let generation = self.generation + 1;
        let named = points.iter().enumerate().map(|(index, point)| Placement {
            name: format!("generation-{generation}-{index}"),
            lidars: constraints.poses_of(point),
        });
        let Some(spacing) = settings.delta else { return Ok(named.collect()) };
        let grid = PoseGrid::new(constraints, spacing)?;
        Ok(named.map(|placement| grid.snapped(&placement, constraints.ties)).collect())
    }

    /// Scores the best placement so far anew: on another problem its old value compares with nothing. False, and
    /// nothing is changed, where `go_on` said no as in [`Self::step`].
    pub(crate) fn rescore_best(
        &mut self,
        evaluator: &mut Evaluator,
        settings: &Settings,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<bool, SearchError> {
        if let Some(best) = &mut self.best {
            let scores = evaluator.scores_while(std::slice::from_ref(&best.placement), go_on)?;
            let Some(scores) = scores else { return Ok(false) };
            best.standing = Standing::of(&scores[0], &settings.objective);
        }
        Ok(true)
    }

    fn keep_best(
        &mut self,
        constraints: &Constraints,
        placements: &[Placement],
        standings: &[Standing],
    ) {
        for (placement, standing) in placements.iter().zip(standings) {
            if standing.value.is_none() {
                continue;
            }
            if self.best.as_ref().is_none_or(|best| standing.beats(&best.standing)) {
                self.best = Some(Best {
                    placement: canonical(constraints, placement),
                    standing: *standing,
                    generation: self.generation,
                });
            }
        }
    }

    fn record(&self, standings: &[Standing]) -> GenerationRecord {
        let mut values: Vec<f64> = standings.iter().filter_map(Standing::worth).collect();
        values.sort_by(f64::total_cmp);
        GenerationRecord {
            generation: self.generation,
            evaluations: self.evaluations,
            best: Standing::best(standings).and_then(|best| standings[best].worth()),
            median: values.get(values.len() / 2).copied(),
            best_so_far: self.best.as_ref().and_then(|best| best.standing.worth()),
            missing: self.best.as_ref().map(|best| best.standing.violation).filter(|&v| v > 0.0),
            infeasible: standings.iter().filter(|s| s.violation > 0.0).count(),
            guarded: standings.iter().filter(|s| s.guards > 0).count(),
            step_size: self.cma.as_ref().map_or(0.0, |cma| cma.running().step_size()),
        }
    }
}

/// Why a layout to start from is not used, in words; empty where it is.
pub(crate) fn why_left_out(constraints: &Constraints, start: &Placement) -> Vec<String> {
    let (has, wanted) = (start.lidars.len(), constraints.lidars());
    if has != wanted {
        return vec![format!("it has {}, the mount {wanted}", counted(has, "LiDAR"))];
    }
    let has_models =
        constraints.kinds().len() == 1 || constraints.in_slots(&start.lidars).is_some();
    if !has_models {
        return vec!["its LiDARs are of other models than this search chose for the mounts".into()];
    }
    let broken = constraints.violations(start);
    if broken.is_empty() && constraints.variables_of(start).is_none() {
        return vec!["LiDARs in the plane of symmetry are none of the pairs that are moved".into()];
    }
    broken.iter().map(ToString::to_string).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_the_lidars_means_nothing() {
        let pose = |x: f64, yaw: f64| crate::vehicle::SensorPose {
            yaw,
            ..crate::vehicle::SensorPose::at(x, 0.0, 2.0)
        };
        let poses = [pose(0.5, 0.1), pose(-1.0, 0.2), pose(0.5, -0.3)];
        let placement = |order: [usize; 3]| Placement {
            name: "any".into(),
            lidars: order.map(|k| poses[k]).to_vec(),
        };
        let want = placement([1, 2, 0]);
        for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2], [1, 2, 0]] {
            assert_eq!(
                canonical(&Constraints::in_box([0.0; 6], [0.0; 6], 3), &placement(order)),
                want
            );
        }
    }
}
