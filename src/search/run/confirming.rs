//! The last step: the result of each method over all frames, the better of them, and the outcome.

use std::time::Instant;

use super::seeing::Flaw;
use super::state::Run;
use crate::json::counted;
use crate::score::Standing;
use crate::search::bound::Certificate;
use crate::search::error::SearchError;
use crate::search::evaluator::Evaluator;
use crate::search::generations::why_left_out;
use crate::search::observer::Watch;
use crate::search::on_demand::{FramesOnDemand, SearchEnd};
use crate::search::outcome::{LAYOUT_GIVEN, MethodRecord, Outcome, Scored, Stopped};
use crate::search::pilot::Pilot;
use crate::search::rules::{active_bounds, findings};
use crate::search::seat::FRAMES_AT_ONCE;
use crate::search::settings::{Method, PATIENCE};
use crate::search::spread::{Gain, GainSpread, PhaseCheck, check_draws};
use crate::search::tolerance::Tolerance;
use crate::vehicle::{Placement, placement_to_nanometres};

/// Says that a part of the outcome is left out for want of time.
fn left_out(part: &str, watch: &mut Watch) {
    let why = watch.why_over();
    watch.note(&format!("{why}: {part} is left out"));
}

fn record_of(method: &'static str, scored: &Scored) -> MethodRecord {
    let (objective, requirements) = (scored.objective, scored.scores.met());
    MethodRecord { method, objective, requirements, evaluations: 0, poses_cast: 0, won: false }
}

/// The result of each method, and the best of all that was found and given.
type ConfirmedResults = (Vec<MethodRecord>, Option<Scored>);

/// The result of one method: `None` where the run is to end before it is scored, the inner `None` where there is none.
type MethodResult = Option<Option<(MethodRecord, Scored)>>;

impl Run {
    /// Scores the result of each method and the baselines: over all frames, or over few where the run is to end before.
    pub(super) fn confirm(&mut self, watch: &mut Watch) -> Result<Outcome, SearchError> {
        if let Some(outcome) = self.confirmed(watch)? {
            return Ok(outcome);
        }
        self.cut(watch);
        let (few, all) = (self.few_frames(), self.suite.frame_count());
        let (count, why) = (few.len(), watch.why_over());
        watch.note(&format!("{why}: result and baselines are scored over {count} of {all} frames"));
        self.sitting.hurried = Some(few);
        (self.sitting.over_all, self.sitting.baselines) = (None, None);
        Ok(self.confirmed(watch)?.expect("few frames are scored whatever the time"))
    }

    /// The outcome over the frames of [`Self::confirming`]; `None` where the run is to end before that.
    fn confirmed(&mut self, watch: &mut Watch) -> Result<Option<Outcome>, SearchError> {
        let Some(baselines) = self.baselines(watch)? else { return Ok(None) };
        let Some((methods, best)) = self.best(&baselines, watch)? else { return Ok(None) };
        let certificate = best.as_ref().map(|best| self.certificate(&best.placement, watch));
        let certificate = certificate.transpose()?.flatten();
        let unscored = self.state.settings.baselines.len() - baselines.len();
        if unscored > 0 {
            left_out(&format!("the score of {}", counted(unscored, "baseline")), watch);
        }
        self.tell_changes(watch);
        let evaluations = self.state.generations.evaluations();
        let constraints = self.suite.constraints();
        let swapped = self.state.swaps.as_ref().map_or(0, |swaps| swaps.poses_cast);
        let (stopped, confirmed_frames) = (self.stopped(watch), self.confirming().frame_count());
        let early = match stopped {
            Stopped::Time => " for want of time",
            Stopped::Interrupted => ": the run was interrupted",
            Stopped::Generations(_) | Stopped::Settled => "",
        };
        let end = SearchEnd { frames: confirmed_frames, early };
        let used =
            |levels: &FramesOnDemand| levels.used(evaluations, swapped, constraints.lidars(), end);
        let search_frames = self.frames().len();
        let sample = self.state.bounds.as_ref().filter(|_| best.is_some());
        let spread = best.as_ref().map(|best| self.spread(best, &baselines, watch));
        let spread = spread.transpose()?.flatten();
        let phases = self.phase_check(best.as_ref(), &baselines, watch)?;
        let evaluator = self.sitting.evaluator.as_ref();
        let engine = evaluator.map(|evaluator| evaluator.backend());
        let mut backend_changes = self.sitting.changes.clone();
        backend_changes.extend(evaluator.into_iter().flat_map(Evaluator::changes));
        Ok(Some(Outcome {
            active_bounds: best
                .as_ref()
                .map(|best| active_bounds(&best.placement, constraints))
                .unwrap_or_default(),
            best: best.map(Scored::settled),
            baselines: baselines.into_iter().map(Scored::settled).collect(),
            unscored_baselines: unscored,
            methods,
            climbs: self.state.swaps.as_ref().map(|swaps| swaps.climbs),
            certificate,
            spread,
            phases,
            findings: sample.map(|bounds| findings(&bounds.sample.scored())).unwrap_or_default(),
            frames_used: self.state.levels.as_ref().map(used),
            search_frames,
            confirmed_frames,
            history: self.state.history.clone(),
            evaluations,
            ended: self.ended_in_words(),
            left_out: self.left_out(),
            stopped,
            untried: None,
            backend: engine.map_or_else(String::new, |engine| engine.name().to_owned()),
            adapter: engine.map_or_else(String::new, |engine| engine.adapter().to_owned()),
            backend_changes,
            times: self.sitting.times,
        }))
    }

    /// The result of each method and the best of all; `None` where the run is to end before that.
    fn best(
        &mut self,
        baselines: &[Scored],
        watch: &mut Watch,
    ) -> Result<Option<ConfirmedResults>, SearchError> {
        let Some(found) = self.found(watch)? else { return Ok(None) };
        let (mut methods, mut finalists): (Vec<_>, Vec<_>) = found.into_iter().unzip();
        let Some(given) = self.best_given(baselines, watch)? else { return Ok(None) };
        let kept: Vec<Placement> = self.sitting.kept.iter().cloned().collect();
        let Some(judged) = self.judged_over_all(&kept, watch)? else { return Ok(None) };
        let kept = self.scored(&kept, judged, watch)?.pop();
        // The first of equal ones: a layout that was given is the result only where it is better than all that was found.
        let all: Vec<&Scored> = finalists.iter().chain(&given).collect();
        let Some(best) = self.best_of(&all)? else {
            return Ok(Some(self.or_kept((methods, None), kept, watch)));
        };
        if let Some(given) = given.filter(|_| best == finalists.len()) {
            methods.push(record_of(LAYOUT_GIVEN, &given));
            finalists.push(given);
        }
        let mut result = finalists.swap_remove(best);
        methods[best].won = true;
        methods[best].evaluations += self.secure(&mut result, watch)?;
        methods[best].objective = result.objective;
        methods[best].requirements = result.scores.met();
        Ok(Some(self.or_kept((methods, Some(result)), kept, watch)))
    }

    /// The result of an earlier sitting where this one is cut short and has found none that is better. Moves that more copies
    /// hold after may be what is missing: a rig that meets all requirements then stays.
    fn or_kept(
        &self,
        (mut methods, result): ConfirmedResults,
        kept: Option<Scored>,
        watch: &Watch,
    ) -> ConfirmedResults {
        let is_cut = self.before_cut.is_some() || watch.is_over();
        let is_better = |kept: &Scored| {
            let Some(result) = &result else { return true };
            let tolerance = self.state.settings.tolerance.as_ref();
            let is_to_hold =
                tolerance.is_some_and(Tolerance::is_some) && !kept.scores.required.is_empty();
            let is_other = kept.placement.lidars != result.placement.lidars;
            let [kept, found] = [kept, result].map(Scored::standing);
            let is_insecure = watch.is_over() && is_to_hold;
            is_other && (!found.beats(&kept) || (is_insecure && kept.violation <= 0.0))
        };
        let Some(kept) = kept.filter(|kept| is_cut && is_better(kept)) else {
            return (methods, result);
        };
        methods.iter_mut().for_each(|method| method.won = false);
        methods.push(MethodRecord { won: true, ..record_of("earlier sitting", &kept) });
        (methods, Some(kept))
    }

    /// Placements that each method found; `None` where the run is to end before they are scored.
    fn found(
        &mut self,
        watch: &mut Watch,
    ) -> Result<Option<Vec<(MethodRecord, Scored)>>, SearchError> {
        let mut found = Vec::new();
        for of_method in [Self::found_by_generations, Self::found_by_swaps] {
            let Some(one) = of_method(self, watch)? else { return Ok(None) };
            found.extend(one);
        }
        Ok(Some(found))
    }

    /// The best layout to compare with or to start from that the mount allows, named as a result; `None` where the run is
    /// to end before starts are scored.
    fn best_given(
        &mut self,
        baselines: &[Scored],
        watch: &mut Watch,
    ) -> Result<Option<Option<Scored>>, SearchError> {
        let constraints = self.suite.constraints().clone();
        let is_allowed = |placement: &Placement| why_left_out(&constraints, placement).is_empty();
        let starts = self.state.settings.starts.iter().filter(|start| is_allowed(start));
        let starts: Vec<Placement> = starts.cloned().collect();
        let Some(judged) = self.judged_over_all(&starts, watch)? else { return Ok(None) };
        let mut given = self.scored(&starts, judged, watch)?;
        given.extend(baselines.iter().filter(|b| is_allowed(&b.placement)).cloned());
        let standings: Vec<Standing> = given.iter().map(Scored::standing).collect();
        let best = Standing::best(&standings).map(|best| {
            let mut best = given.swap_remove(best);
            best.placement.name = "optimized".into();
            best
        });
        Ok(Some(best))
    }

    /// Objectives of the result and the best baseline at draws that the search has not seen.
    fn phase_check(
        &self,
        best: Option<&Scored>,
        baselines: &[Scored],
        watch: &mut Watch,
    ) -> Result<Option<PhaseCheck>, SearchError> {
        let Some(best) = best.filter(|_| self.suite.is_left_to_chance()) else { return Ok(None) };
        let rival = Scored::yardstick(baselines).map(|rival| &rival.placement);
        let (objective, memory) = (self.objective(), self.memory());
        let (best, suite) = (&best.placement, self.confirming());
        let patience = Instant::now() + PATIENCE;
        let is_short = self.suite.frame_count() <= FRAMES_AT_ONCE;
        let mut go_on = || (is_short && Instant::now() < patience) || watch.goes_on();
        let checked = check_draws(&suite, &objective, best, rival, memory, &mut go_on)?;
        if checked.is_none() {
            left_out("the check at other draws", watch);
        }
        Ok(checked)
    }

    fn found_by_generations(&mut self, watch: &mut Watch) -> Result<MethodResult, SearchError> {
        let best = self.state.generations.best().map(|best| best.placement.clone());
        let Some(best) = self.state.chosen.clone().or(best) else {
            return Ok(Some(None));
        };
        let named = [self.written(&Placement { name: "optimized".into(), ..best })];
        let Some(judged) = self.judged_over_all(&named, watch)? else { return Ok(None) };
        let scored = self.scored(&named, judged, watch)?.remove(0);
        let evaluations = self.state.generations.evaluations();
        let poses_cast = evaluations * named[0].lidars.len() as u64;
        let method = MethodRecord { evaluations, poses_cast, ..record_of("cma-es", &scored) };
        Ok(Some(Some((method, scored))))
    }

    /// A placement as files have it, to the nanometre: scores are those of the poses that are written. One that breaks a rule
    /// there stays as it is.
    fn written(&self, placement: &Placement) -> Placement {
        let (constraints, written) = (self.suite.constraints(), placement_to_nanometres(placement));
        let broken = |placement: &Placement| constraints.violations(placement).len();
        if broken(&written) > broken(placement) { placement.clone() } else { written }
    }

    /// The best of the ends of the swaps. Fewer frames than all tell the ends apart too badly to take the first, and another
    /// end is better than a first one that looks at the own body or loses a car. Where the time is over before the others are scored, the
    /// first one counts alone.
    fn found_by_swaps(&mut self, watch: &mut Watch) -> Result<MethodResult, SearchError> {
        let Some(swaps) = self.state.swaps.clone() else { return Ok(Some(None)) };
        let mut ends = vec![swaps.placement];
        let is_flawed =
            self.has(Flaw::AtBody, &ends[0], watch)? || self.has(Flaw::Blind, &ends[0], watch)?;
        if !self.is_over_all() || is_flawed {
            ends.extend(swaps.others);
        }
        let ends: Vec<Placement> = ends.iter().map(|end| self.written(end)).collect();
        let (first, others) = ends.split_at(1);
        let Some(mut judged) = self.judged_over_all(first, watch)? else { return Ok(None) };
        match self.judged_over_all(others, watch)? {
            Some(more) => judged.extend(more),
            None => {
                left_out(&format!("the score of {}", counted(others.len(), "more climb")), watch)
            }
        }
        let mut scored = self.scored(&ends[..judged.len()], judged, watch)?;
        let best = self.best_of(&scored.iter().collect::<Vec<_>>())?;
        let scored = scored.swap_remove(best.unwrap_or(0));
        let (evaluations, poses_cast) = (swaps.evaluations, swaps.poses_cast);
        let method = MethodRecord { evaluations, poses_cast, ..record_of("swaps", &scored) };
        Ok(Some(Some((method, scored))))
    }

    /// Bounds; the result is scored over the bounds' frames to compare.
    fn certificate(
        &mut self,
        best: &Placement,
        watch: &mut Watch,
    ) -> Result<Option<Certificate>, SearchError> {
        let Some(bounds) = self.state.bounds.clone() else { return Ok(None) };
        let heeds_time = self.heeds_time();
        if self.sitting.hurried.is_some() && self.frames_of_bounds().len() > FRAMES_AT_ONCE {
            left_out("the bound on other placements", watch);
            return Ok(None);
        }
        let of_bounds = self.evaluator_of_bounds(watch)?;
        let mut go_on = || watch.goes_on() || !heeds_time;
        let Some(there) = of_bounds.scores_while(std::slice::from_ref(best), &mut go_on)? else {
            left_out("the bound on other placements", watch);
            return Ok(None);
        };
        let there = &there[0];
        let found = self.objective().value(there).unwrap_or(f64::NAN);
        let mut certificate = Certificate::new(bounds.sample.lipschitz(), bounds.gain, found);
        let (frames, all) = (self.frames_of_bounds().len(), self.suite.frame_count());
        if let Some(gain) = certificate.gain.as_ref().filter(|_| frames < all) {
            let reached = self.objective().spoken(found);
            certificate.gain_says +=
                &format!(" (over {frames} of {all} frames, in which the result has {reached}");
            let others = "; a placement that is better there may be worse over all)";
            certificate.gain_says += if gain.upper > found { others } else { ")" };
        }
        if certificate.gain.is_some() && self.suite.constraints().ties.any() {
            certificate.gain_says += " (over placements that need not be symmetric or level)";
        }
        Ok(Some(certificate))
    }

    /// Tests whether the lead over the best baseline exceeds the spread between scenes. If no baseline keeps all rules, the
    /// best of all counts. `None` for one scene, or without a baseline.
    fn spread(
        &self,
        best: &Scored,
        baselines: &[Scored],
        watch: &mut Watch,
    ) -> Result<Option<GainSpread>, SearchError> {
        let Some(rival) = Scored::rival(baselines).filter(|_| self.suite.scene_count() > 1) else {
            return Ok(None);
        };
        let pair = vec![best.placement.clone(), rival.placement.clone()];
        let (suite, heeds_time) = (self.confirming(), self.heeds_time());
        let mut go_on = |_| watch.goes_on() || !heeds_time;
        let Some(by_frame) = Pilot::new(&suite, pair, self.memory(), &mut go_on)? else {
            left_out("the spread of the gain over the scenes", watch);
            return Ok(None);
        };
        let gain = Gain::of(&self.state.settings.objective);
        let shares = [0, 1].map(|index| by_frame.gain_shares(index, gain.kind()));
        let seed = self.state.settings.seed;
        let name = &rival.placement.name;
        let mut spread = GainSpread::new(name, gain, &shares, seed);
        if let Some(spread) = spread.as_mut().filter(|_| !rival.is_honest()) {
            spread.words += &format!(" But {name} breaks a rule or has a guard against it.");
        }
        Ok(spread)
    }

    fn stopped(&self, watch: &Watch) -> Stopped {
        let generations = self.state.generations.stopped();
        let is_cut_short = generations.is_none() && self.state.settings.method != Method::Swaps;
        if watch.interrupted || self.sitting.interrupted {
            return Stopped::Interrupted;
        }
        match generations {
            Some(why) if self.is_at_target() => Stopped::Generations(why),
            _ if self.sitting.out_of_time || is_cut_short => Stopped::Time,
            Some(why) => Stopped::Generations(why),
            None => Stopped::Settled,
        }
    }
}
