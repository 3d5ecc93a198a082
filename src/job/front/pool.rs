//! Placements found for a front: scored over all frames, and searches of poses around the best of them.

use std::collections::HashSet;
use std::time::Instant;

use super::pareto::{Answered, FrontProgress, FrontState, Objectives, front, known};
use super::sweep::{Chosen, End, spread};
use super::{
    Front, FrontObjective, FrontObjectives, FrontPoint, FrontStopped, NEARLY, is_over, picks,
};
use crate::job::{Job, JobError};
use crate::score::Objective;
use crate::search::{
    Equipped, Evaluator, Event, Judged, Observer, PATIENCE, Settings, Suite, Work, optimize,
};
use crate::vehicle::{Equipment, Placement, Vehicle};

/// Steps of progress in the search around one point, and the share that its generations take.
const STEPS: u64 = 100;
const GENERATIONS: u64 = 40;

/// A placement with its values.
#[derive(Debug, Clone)]
struct FrontCandidate {
    point: FrontPoint,
    /// Mounts and models.
    kinds: Equipment,
    /// Objective of a search around it.
    gain: Objective,
}

impl Objectives {
    /// Values of a point as the Pareto filter takes them.
    pub(super) fn new(objectives: &FrontObjectives, point: &FrontPoint) -> Self {
        let of = objectives.all().iter().zip(&point.values);
        let values = of.map(|(objective, value)| objective.turned(*value)).collect();
        Self { values, meets: point.meets }
    }
}

/// All placements found so far.
pub(super) struct Pool<'a> {
    job: &'a Job,
    suite: &'a Suite,
    vehicle: &'a Vehicle,
    objectives: &'a FrontObjectives,
    evaluator: Evaluator,
    candidates: Vec<FrontCandidate>,
    scored: usize,
}

impl<'a> Pool<'a> {
    /// An empty pool, with an engine for each scene; notes the device.
    pub(super) fn open(
        job: &'a Job,
        suite: &'a Suite,
        vehicle: &'a Vehicle,
        objectives: &'a FrontObjectives,
        observer: &mut dyn Observer,
    ) -> Result<Self, JobError> {
        let (evaluator, notes) = job.evaluator(|_| {})?;
        for note in &notes {
            observer.on(&Event::Note(note));
        }
        let (candidates, scored) = (Vec::new(), 0);
        Ok(Self { job, suite, vehicle, objectives, evaluator, candidates, scored })
    }

    /// Scores equipment on its poses of the coarse grid. Chosen rigs: all of them where the observer has stopped the
    /// choices before, else until it says so. Others: until the time is over, too.
    pub(super) fn add(
        &mut self,
        chosen: Vec<Chosen>,
        others: Vec<Chosen>,
        end: End,
        observer: &mut dyn Observer,
    ) -> Result<End, JobError> {
        let (first, frames) = (chosen.len() as u64, self.evaluator.frame_count());
        let total = first + others.len() as u64;
        for (done, chosen) in (0..).zip(chosen.into_iter().chain(others)) {
            if done >= first && is_over(self.job.settings.time) {
                return Ok(End::Time);
            }
            let work = Work::Confirming { frames };
            let goes_on = observer.on(&Event::Progress { work, done, total });
            if done > 0 && !goes_on && end != End::Interrupted {
                return Ok(End::Interrupted);
            }
            let Chosen { equipped: Equipped { equipment, placement, .. }, gain } = chosen;
            self.score(placement, equipment, gain)?;
        }
        Ok(end)
    }

    /// Scores a placement over all frames; one without a value of an objective is left out.
    fn score(
        &mut self,
        placement: Placement,
        kinds: Equipment,
        gain: Objective,
    ) -> Result<(), JobError> {
        let judged = self.evaluator.judged(std::slice::from_ref(&placement))?.remove(0);
        self.scored += 1;
        let equipment = Equipped::words(&kinds, self.vehicle);
        let point = self.point(placement, judged, self.vehicle.cost(&kinds), equipment);
        self.candidates.extend(point.map(|point| FrontCandidate { point, kinds, gain }));
        Ok(())
    }

    /// A placement with its values; `None` where it has none of an objective.
    fn point(
        &self,
        placement: Placement,
        judged: Judged,
        price: f64,
        equipment: String,
    ) -> Option<FrontPoint> {
        let Judged { scores, by_scene } = judged;
        let sensors = placement.lidars.len();
        let value = |objective: &FrontObjective| objective.value(&scores, sensors, price);
        let values: Option<Vec<f64>> = self.objectives.all().iter().map(value).collect();
        let values = values.filter(|values| values.iter().all(|v| v.is_finite()))?;
        let meets = scores.missing() <= 0.0;
        Some(FrontPoint { placement, values, price, equipment, meets, scores, by_scene })
    }

    /// Placements to compare with, scored over all frames until the observer stops it; notes those without a value of an
    /// objective.
    fn baselines(&mut self, observer: &mut dyn Observer) -> Result<Vec<FrontPoint>, JobError> {
        let (job, mut compared) = (self.job, Vec::new());
        let all = job.compared_with();
        let work = Work::Confirming { frames: self.evaluator.frame_count() };
        for (done, placement) in (0..).zip(all) {
            if !observer.on(&Event::Progress { work, done, total: all.len() as u64 }) {
                break;
            }
            let one = std::slice::from_ref(placement);
            let mut judged = self.evaluator.judged(one)?;
            job.add_broken_rules(self.evaluator.problem().rules(), one, &mut judged);
            let price = self.vehicle.price_of_rig(placement).unwrap_or(0.0);
            let equipment = match self.vehicle.equipment_of(placement) {
                Some((kinds, _)) => Equipped::words(&kinds, self.vehicle),
                None => {
                    format!("rules of the mounts are broken, LiDARs: {}", placement.lidars.len())
                }
            };
            match self.point(placement.clone(), judged.remove(0), price, equipment) {
                Some(point) => compared.push(point),
                None => {
                    let names = self.objectives.names().join(", ");
                    let words =
                        format!("baseline {}: has no value of each of {names}", placement.name);
                    observer.on(&Event::Note(&words));
                }
            }
        }
        Ok(compared)
    }

    /// Numbers of the candidates on the front, in the order of its first objective.
    fn front(&self) -> Vec<usize> {
        let standing = |of: &FrontCandidate| Objectives::new(self.objectives, &of.point);
        let standings: Vec<Objectives> = self.candidates.iter().map(standing).collect();
        let mut best = front(&standings);
        best.sort_by(|&a, &b| {
            let pairs = standings[a].values.iter().zip(&standings[b].values);
            let orders = pairs.map(|(a, b)| a.total_cmp(b));
            orders.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        });
        best
    }

    /// Candidates to search around, and whether the requirements come first there: points of the front that meet or trade
    /// them or miss little, and cheap candidates that miss little. Around points that miss any a search goes by the score
    /// alone, too.
    fn around(&self) -> Vec<(usize, bool)> {
        let trades = self.objectives.has(&FrontObjective::Requirements);
        let missing = |k: usize| self.candidates[k].point.scores.missing();
        let nearly: Vec<usize> =
            (0..self.candidates.len()).filter(|&k| missing(k) <= NEARLY).collect();
        let standing = |&k: &usize| {
            let of = self.objectives.all().iter().zip(&self.candidates[k].point.values);
            let costs = of.filter(|(objective, _)| objective.is_cost()).map(|(_, cost)| *cost);
            Objectives { values: costs.chain([missing(k)]).collect(), meets: true }
        };
        let cheap = front(&nearly.iter().map(standing).collect::<Vec<_>>());
        let front = spread(&self.front());
        let mut all: Vec<(usize, bool)> =
            front.iter().map(|&k| (k, trades || self.candidates[k].point.meets)).collect();
        let near = front.into_iter().filter(|k| nearly.contains(k));
        for k in cheap.into_iter().map(|at| nearly[at]).chain(near).filter(|&k| missing(k) > 0.0) {
            if !all.contains(&(k, true)) {
                all.push((k, true));
            }
        }
        all
    }

    /// Searches placements around the best candidates so far, which all stay in the pool.
    pub(super) fn polish(
        &mut self,
        kept: &mut FrontProgress<'_>,
        observer: &mut dyn Observer,
    ) -> Result<End, JobError> {
        let order = self.around();
        let total = STEPS * order.len() as u64;
        let mut said: HashSet<String> = HashSet::new();
        for (number, (k, is_bound)) in (0..).zip(order) {
            let from = self.candidates[k].clone();
            let settings = Settings {
                objective: self.sought(&from.gain),
                baselines: Vec::new(),
                starts: vec![from.point.placement.clone()],
                time: None,
                gap: None,
                ..self.job.settings.clone()
            };
            let asked = FrontState::polish(
                &from.point.placement, &from.kinds, &settings.objective, is_bound,
            );
            if let Some(known) = known(&kept.state.polished, &asked).cloned() {
                known.map(|best| self.score(best, from.kinds, from.gain)).transpose()?;
                continue;
            }
            let suite = self.suite.with_equipment(&self.vehicle.constraints(&from.kinds));
            let suite = if is_bound { suite } else { suite.without_requirements() };
            let (mut end, mut step) = (End::Done, 0);
            let mut observe = |event: &Event| {
                step = step.max(step_of(event, settings.evaluations));
                let done = STEPS * number + step;
                let goes_on = match event {
                    Event::Note(note) if said.insert((*note).to_owned()) => observer.on(event),
                    _ => observer.on(&Event::Progress { work: Work::Polish, done, total }),
                };
                if !goes_on {
                    end = End::Interrupted;
                } else if is_over(self.job.settings.time) {
                    end = end.and(End::Time);
                }
                end == End::Done
            };
            let outcome = optimize(suite, &settings, &mut observe);
            let outcome = outcome.map_err(|error| self.job.in_scene(error))?;
            if end != End::Done {
                return Ok(end);
            }
            let best = outcome.best.map(|best| best.placement);
            kept.keep(|state| state.polished.push(Answered { asked, found: best.clone() }));
            best.map(|best| self.score(best, from.kinds, from.gain)).transpose()?;
        }
        Ok(End::Done)
    }

    /// Searches the fewest sensors that meet all requirements, and the best for all the money, unless a candidate meets
    /// them. If one does, and prices count, the fewest alone, by as many evaluations as a point has.
    pub(super) fn meet(
        &mut self,
        is_whole: bool,
        kept: &mut FrontProgress<'_>,
        observer: &mut dyn Observer,
    ) -> Result<End, JobError> {
        let gain = self.candidates.first().map_or_else(Objective::default, |of| of.gain.clone());
        let gain = self.sought(&gain);
        if self.candidates.iter().any(|of| of.point.meets) {
            if is_whole || !self.objectives.has(&FrontObjective::Price) {
                return Ok(End::Done);
            }
            let evaluations = self.job.settings.evaluations;
            let asked = FrontState::cheapest(&gain, evaluations);
            return self.search_whole(
                (asked, &gain),
                (true, evaluations),
                kept,
                &mut Quiet(observer),
            );
        }
        let words = "no point meets all requirements so far: the fewest sensors that do are searched, then the best for all \
                     the money";
        observer.on(&Event::Note(words));
        for fewest in [true, false] {
            let asked = FrontState::meeting(&gain, fewest);
            let evaluations = Settings::default().evaluations;
            let end = self.search_whole((asked, &gain), (fewest, evaluations), kept, observer)?;
            if end != End::Done {
                return Ok(end);
            }
        }
        Ok(End::Done)
    }

    /// One search of sensors and placements together, by so many evaluations, whose result joins the candidates: of the
    /// fewest sensors, or of the best for all the money.
    fn search_whole(
        &mut self,
        (asked, gain): (String, &Objective),
        (fewest, evaluations): (bool, u64),
        kept: &mut FrontProgress<'_>,
        observer: &mut dyn Observer,
    ) -> Result<End, JobError> {
        if let Some(known) = known(&kept.state.met, &asked).cloned() {
            known.map(|(best, kinds)| self.score(best, kinds, gain.clone())).transpose()?;
            return Ok(End::Done);
        }
        // Baselines are compared with, not started from.
        let baselines = Settings::default().baselines;
        let settings =
            Settings { evaluations, baselines, starts: Vec::new(), ..self.job.settings.clone() };
        let job = self.job.clone().search(settings).objective(gain.clone()).fewest(fewest);
        let mut is_interrupted = false;
        let mut observe = |event: &Event| {
            let goes_on = match event {
                Event::Generation(_) => observer.on(&Event::Asks),
                other => observer.on(other),
            };
            is_interrupted |= !goes_on;
            goes_on
        };
        let found = job.optimize(&mut observe)?;
        let found = found
            .and_then(|found| Some((found.outcome.best?.placement, found.equipped?.equipment)));
        let end = match is_interrupted {
            true => End::Interrupted,
            false if is_over(self.job.settings.time) => End::Time,
            false => End::Done,
        };
        if end == End::Done {
            kept.keep(|state| state.met.push(Answered { asked, found: found.clone() }));
        }
        found.map(|(best, kinds)| self.score(best, kinds, gain.clone())).transpose()?;
        Ok(end)
    }

    /// Objective of a search around a point: the only score of the front, or the gain that it was chosen by.
    fn sought(&self, gain: &Objective) -> Objective {
        let mut scores = self.objectives.scores();
        match (scores.next(), scores.next()) {
            (Some(score), None) => score.clone(),
            _ => gain.clone(),
        }
    }

    /// Candidates on the front, with their names.
    fn named_points(&self) -> Vec<FrontPoint> {
        let numbers = self.front();
        let best = numbers.iter().map(|&k| self.candidates[k].point.clone());
        let mut points: Vec<FrontPoint> = best.collect();
        for (number, point) in (1..).zip(&mut points) {
            point.placement.name = format!("front-{number}");
            point.scores.name.clone_from(&point.placement.name);
        }
        points
    }

    /// The front, each point looked at closely as `sightline score` does, and its picks.
    pub(super) fn finish(
        mut self,
        requires: bool,
        is_whole: bool,
        mut end: End,
        observer: &mut dyn Observer,
    ) -> Result<Front, JobError> {
        let mut points = self.named_points();
        let mut baselines = self.baselines(observer)?;
        let total = (points.len() + baselines.len()) as u64;
        // Copies of placements take most of a look, and a look at all points may take longer than the search had.
        let patience = Instant::now() + PATIENCE;
        let time = self.job.settings.time;
        for (done, point) in (0..).zip(points.iter_mut().chain(&mut baselines)) {
            if end == End::Interrupted
                || !observer.on(&Event::Progress { work: Work::Looks, done, total })
            {
                end = End::Interrupted;
                break;
            }
            let (scores, by_scene) = (point.scores.clone(), point.by_scene.clone());
            let mut judged = [Judged { scores, by_scene }];
            let placements = std::slice::from_ref(&point.placement);
            let mut go_on = || Instant::now() < patience || !is_over(time);
            let evaluator = &mut self.evaluator;
            let looked = self
                .job
                .look_closely_by_scene_while(evaluator, placements, &mut judged, &mut go_on)?;
            end = if looked { end } else { End::Time };
            let [Judged { scores, by_scene }] = judged;
            // A closer look may find a place that is missed.
            point.meets &= scores.missing() <= 0.0;
            (point.scores, point.by_scene) = (scores, by_scene);
        }
        for change in self.evaluator.changes() {
            observer.on(&Event::Note(&change));
        }
        let picks = picks(self.objectives, &points, requires);
        let stopped = match end {
            End::Done => FrontStopped::Complete,
            End::Time => FrontStopped::Time,
            End::Interrupted => FrontStopped::Interrupted,
        };
        let engine = self.evaluator.backend();
        let (backend, adapter) = (engine.name().to_owned(), engine.adapter().to_owned());
        let (objectives, scored) = (self.objectives.clone(), self.scored);
        let is_whole = is_whole && end == End::Done;
        Ok(Front {
            objectives,
            points,
            picks,
            baselines,
            scored,
            is_whole,
            stopped,
            backend,
            adapter,
        })
    }
}

/// Passes on all but sentences, which would be about other sensors than those of a point.
struct Quiet<'a>(&'a mut dyn Observer);

impl Observer for Quiet<'_> {
    fn on(&mut self, event: &Event) -> bool {
        match event {
            Event::Note(_) => self.0.on(&Event::Asks),
            other => self.0.on(other),
        }
    }
}

/// Step of the search around one point that an event stands for.
fn step_of(event: &Event, evaluations: u64) -> u64 {
    let share = |done: u64, total: u64, steps: u64| steps * done.min(total) / total.max(1);
    match event {
        Event::Generation(record) => share(record.evaluations, evaluations, GENERATIONS),
        Event::Progress { work: Work::Swaps, done, total } => {
            GENERATIONS + share(*done, *total, STEPS - GENERATIONS - 5)
        }
        _ => 0,
    }
}
