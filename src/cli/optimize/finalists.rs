//! What each way of searching found, the better of them, and what is known of others.

use indicatif::ProgressBar;
use sightline::report::{MethodRecord, Scored};
use sightline::search::{Certificate, Evaluator, SWAP_SPACING, Swapped};
use sightline::study::{Finding as LayoutFinding, findings};
use sightline::vehicle::Placement;

use super::Run;
use super::grid::{Bounds, GridStage, Method};
use crate::cli::args::Compute;
use crate::cli::error::Error;
use crate::cli::interrupt::Interrupt;

/// What a run has come to.
#[derive(Default)]
pub(super) struct Finding {
    pub(super) best: Option<Scored>,
    pub(super) methods: Vec<MethodRecord>,
    pub(super) certificate: Option<Certificate>,
    pub(super) findings: Vec<LayoutFinding>,
}

impl Run {
    /// Swaps and bounds over the frames of the search.
    pub(super) fn on_the_grid(
        &mut self,
        compute: &Compute,
        interrupt: &Interrupt,
    ) -> Result<(Option<Swapped>, Option<Bounds>), Error> {
        let delta = self.settings.search.delta;
        let spacing = delta.unwrap_or(SWAP_SPACING);
        // The result of the generations first: it has most to gain where casts run out.
        let best = self.search.best().map(|best| &best.placement);
        let mut starts: Vec<Placement> =
            self.chosen.as_ref().or(best).cloned().into_iter().collect();
        starts.extend(self.good_baselines()?.into_iter().take(1));
        let lidars = self.evaluator.constraints().lidars as u64;
        let casts = self.settings.search.evaluations * lidars;
        let mut stage = GridStage {
            evaluator: &mut self.evaluator,
            objective: &self.objective,
            compute,
            interrupt,
        };
        let swaps = match self.settings.method {
            Method::Cma => None,
            // Half as much again as the generations cast: swaps gain more from a cast than they do.
            Method::Both if !starts.is_empty() => {
                stage.climb(spacing, &starts, casts / 2 * 3, self.settings.search.seed)?
            }
            // Where no candidate of the generations kept the rules, greedy may find one that does.
            Method::Both | Method::Swaps => {
                stage.everywhere(spacing, &starts, self.settings.search.seed)?
            }
        };
        let bounds = stage.bounds(delta, self.settings.search.seed)?;
        if let (Some(auto), Some(swaps)) = (&mut self.auto, &swaps) {
            auto.note_swaps(swaps.poses_cast, lidars);
        }
        Ok((swaps, Some(bounds)))
    }

    /// Baselines that keep every rule and violate no guard, the best first; over all frames where
    /// their scores there are known.
    fn good_baselines(&mut self) -> Result<Vec<Placement>, Error> {
        let baselines = &self.settings.baselines;
        let evaluator = self.full.as_mut().unwrap_or(&mut self.evaluator);
        let scores = evaluator.scores(baselines)?;
        let constraints = evaluator.constraints();
        let allowed = baselines.iter().zip(&scores).filter(|(placement, scores)| {
            constraints.violations(placement).is_empty()
                && scores.guards.is_empty()
                && placement.lidars.len() == constraints.lidars
        });
        let mut good: Vec<(f64, Placement)> = allowed
            .filter_map(|(placement, scores)| {
                Some((self.objective.value(scores)?, placement.clone()))
            })
            .collect();
        good.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(good.into_iter().map(|(_, placement)| placement).collect())
    }

    /// Scores what each method found over all frames and takes the best; `searched_with` is the
    /// evaluator of the search where that was over fewer.
    pub(super) fn confirm(
        &mut self,
        swaps: Option<Swapped>,
        bounds: Option<Bounds>,
        mut searched_with: Option<Evaluator>,
        bar: &ProgressBar,
    ) -> Result<Finding, Error> {
        let mut methods = Vec::new();
        let mut finalists: Vec<Scored> = Vec::new();
        let best = self.chosen.clone().or_else(|| self.search.best().map(|b| b.placement.clone()));
        if let Some(best) = best {
            let named = Placement { name: "optimized".into(), ..best };
            let lidars = named.lidars.len() as u64;
            let scored = self.scored(&[named], bar)?.remove(0);
            methods.push(MethodRecord {
                method: "cma-es",
                objective: scored.objective,
                evaluations: self.search.evaluations(),
                poses_cast: self.search.evaluations() * lidars,
                won: false,
            });
            finalists.push(scored);
        }
        if let Some(swaps) = swaps {
            let mut ends = vec![swaps.placement];
            if searched_with.is_some() {
                // What the frames and triangles of the search cannot tell apart.
                ends.extend(swaps.others);
            }
            let mut scored = self.scored(&ends, bar)?;
            let scored = scored.swap_remove(best_of(&scored).unwrap_or(0));
            methods.push(MethodRecord {
                method: "swaps",
                objective: scored.objective,
                evaluations: swaps.evaluations,
                poses_cast: swaps.poses_cast,
                won: false,
            });
            finalists.push(scored);
        }
        let Some(best) = best_of(&finalists) else { return Ok(Finding::default()) };
        methods[best].won = true;
        let scored = finalists.swap_remove(best);
        // The bounds are over the frames of the search, so the result is scored there as well.
        let evaluator = searched_with.as_mut().unwrap_or(&mut self.evaluator);
        let there = evaluator.scores(std::slice::from_ref(&scored.placement))?;
        let value = self.objective.value(&there[0]).unwrap_or(f64::NAN);
        let properties = bounds.as_ref().map(|b| findings(&b.sample.scored())).unwrap_or_default();
        let certificate = bounds.map(|b| Certificate::new(b.sample.lipschitz(), b.gain, value));
        Ok(Finding { best: Some(scored), methods, certificate, findings: properties })
    }
}

/// Position of the best: one that violates a guard comes after any that does not.
fn best_of(finalists: &[Scored]) -> Option<usize> {
    let standing = |scored: &Scored| {
        let value = scored.objective.unwrap_or(f64::NEG_INFINITY);
        (scored.scores.guards.is_empty(), value)
    };
    (0..finalists.len()).max_by(|&a, &b| {
        let (a, b) = (standing(&finalists[a]), standing(&finalists[b]));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    })
}
