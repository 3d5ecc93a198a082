//! CMA-ES that starts again: IPOP and BIPOP.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::options::{MAX_POPULATION, MOST_COUNTED, check_bounds};
use crate::{Candidate, Cma, CmaError, CmaOptions, StopReason, constants};

/// Smallest population of a small instance, unless the first instance's is smaller still.
const LEAST_POPULATION: usize = 4;

/// Most instances of a saved search.
const MOST_INSTANCES: u32 = 1 << 30;

/// Rule for the instance that follows a stopped one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RestartStrategy {
    /// Twice the population of the one before: Auger and Hansen, CEC 2005.
    Ipop,
    /// Large instances, each of twice the population, and small ones of random population and step size,
    /// by turns so that both regimes use as many evaluations: Hansen, BBOB 2009.
    Bipop,
}

/// Settings of [`Restarts`]; [`Cma`]'s options hold for its instances.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RestartOptions {
    /// Rule for the next instance.
    pub strategy: RestartStrategy,
    /// (lower, upper) of each variable for the random means of later instances; `None` takes the bounds,
    /// and without bounds every instance starts at the first mean.
    pub region: Option<Vec<(f64, f64)>>,
}

impl Default for RestartOptions {
    fn default() -> Self {
        Self { strategy: RestartStrategy::Bipop, region: None }
    }
}

/// Record of a stopped instance.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ended {
    /// Candidates of a generation.
    pub population: usize,
    /// Candidates told to the instance.
    pub evaluations: u64,
    /// Reason of its stop.
    pub reason: StopReason,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RestartInstance {
    small: bool,
    cma: Cma,
}

/// Evaluations and instances of one regime.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct RegimeUsage {
    evaluations: u64,
    instances: u32,
}

/// CMA-ES with restarts: a new instance follows each stopped one. The interface equals [`Cma`]'s.
///
/// Target and budget of the options hold for all instances together, and nothing else ends the search.
/// The first instance is the [`Cma`] of the same options. Later ones depend on the seed alone: equal
/// seeds give equal bits, and a saved and loaded search goes on to the same bits.
///
/// ```
/// use sightline_cma::{CmaOptions, RestartOptions, Restarts};
/// let options =
///     CmaOptions { bounds: Some(vec![(-5.0, 5.0); 2]), budget: Some(9000), ..Default::default() };
/// let mut search = Restarts::new(&[4.0, -4.0], 0.2, options, RestartOptions::default())?;
/// let mut best = f64::INFINITY;
/// while search.stop().is_none() {
///     let candidates = search.ask();
///     let rastrigin = |x: &f64| 10.0 + x * x - 10.0 * (std::f64::consts::TAU * x).cos();
///     let costs: Vec<f64> =
///         candidates.iter().map(|c| c.point().iter().map(rastrigin).sum()).collect();
///     best = costs.iter().copied().fold(best, f64::min);
///     search.tell(&candidates, &costs)?;
/// }
/// assert!(best < 1e-6);
/// # Ok::<(), sightline_cma::CmaError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Restarts {
    mean: Vec<f64>,
    step_size: f64,
    options: CmaOptions,
    restarts: RestartOptions,
    first_population: usize,
    running: RestartInstance,
    ended: Vec<Ended>,
    large: RegimeUsage,
    small: RegimeUsage,
    /// Evaluations of the last stopped large instance.
    last_large: Option<u64>,
    polishing: bool,
    evaluations: u64,
    target_reached: bool,
}

impl Restarts {
    /// Looks whether the parts of a loaded search belong together, for `all` variables. A file holds any numbers.
    ///
    /// # Errors
    /// The first part that does not fit.
    pub fn check(&self, all: usize) -> Result<(), CmaError> {
        let what = "it is of other variables";
        if self.mean.len() != all {
            return Err(CmaError::BadState { what });
        }
        self.options.check(&self.mean, self.step_size)?;
        if let Some(region) = &self.restarts.region {
            check_bounds("the region of restarts", region, all)?;
        }
        let counts = [self.large, self.small].map(|spent| spent.evaluations);
        let counts = counts.into_iter().chain(self.last_large).chain([self.evaluations]);
        let instances = self.large.instances.max(self.small.instances);
        if !(2..=MAX_POPULATION).contains(&self.first_population)
            || counts.into_iter().any(|count| count > MOST_COUNTED)
            || instances > MOST_INSTANCES
        {
            return Err(CmaError::BadState { what: "its counts are beyond any run" });
        }
        self.running.cma.check(all)
    }

    /// A search whose first instance is [`Cma::new`] of the same mean, step size and options.
    ///
    /// # Errors
    /// Like [`Cma::new`], or a region that does not fit the mean.
    pub fn new(
        mean: &[f64],
        step_size: f64,
        options: CmaOptions,
        restarts: RestartOptions,
    ) -> Result<Self, CmaError> {
        if let Some(region) = &restarts.region {
            check_bounds("the region of restarts", region, mean.len())?;
        }
        let first = Cma::new(mean, step_size, options.clone())?;
        let mut search = Self {
            mean: mean.to_vec(),
            step_size,
            options,
            restarts,
            first_population: first.constants().population,
            running: RestartInstance { small: false, cma: first },
            ended: Vec::new(),
            large: RegimeUsage::default(),
            small: RegimeUsage::default(),
            last_large: None,
            polishing: false,
            evaluations: 0,
            target_reached: false,
        };
        search.start_next()?;
        Ok(search)
    }

    /// Starts the next instance in place of the one that runs: the first one at the mean of the search, all later ones at
    /// random means.
    fn start_next(&mut self) -> Result<(), CmaError> {
        let small = self.restarts.strategy == RestartStrategy::Bipop && self.small < self.large;
        let (first, mut population) = (self.first_population, self.first_population);
        let (mut mean, mut step_size) = (self.mean.clone(), self.step_size);
        let mut options = CmaOptions { target: None, budget: None, ..self.options.clone() };
        let index = u64::from(self.large.instances + self.small.instances);
        if index > 0 {
            // Generations draw from the streams from 0 upwards, instances from the last one downwards.
            let mut rng = ChaCha8Rng::seed_from_u64(self.options.seed);
            rng.set_stream(u64::MAX - index);
            options.seed = rng.random();
            if let Some(region) = self.restarts.region.as_ref().or(self.options.bounds.as_ref()) {
                let draw = |&(low, high): &(f64, f64)| low + rng.random::<f64>() * (high - low);
                mean = region.iter().map(draw).collect();
            }
            let doubled = |times: u32| {
                let population = 1_usize.checked_shl(times).and_then(|f| first.checked_mul(f));
                population.unwrap_or(MAX_POPULATION).min(MAX_POPULATION)
            };
            population = doubled(self.large.instances);
            if small {
                let (u, v): (f64, f64) = (rng.random(), rng.random());
                let largest = doubled(self.large.instances.saturating_sub(1)) as f64;
                let share = constants::pow(0.5 * largest / first as f64, u * u);
                population = ((first as f64 * share) as usize).max(LEAST_POPULATION.min(first));
                step_size *= constants::pow(10_f64, -2.0 * v);
                options.budget = self.last_large.map(|evaluations| evaluations / 2);
            }
        }
        options.population = Some(population);
        let mut cma = Cma::new(&mean, step_size, options)?;
        if self.polishing {
            cma.polish();
        }
        let spent = if small { &mut self.small } else { &mut self.large };
        spent.instances += 1;
        self.running = RestartInstance { small, cma };
        Ok(())
    }

    /// Candidates of the next generation of the running instance; the same ones until they are told.
    pub fn ask(&mut self) -> Vec<Candidate> {
        self.running.cma.ask()
    }

    /// Like [`Cma::tell`], for the running instance; another one follows where it stops.
    ///
    /// # Errors
    /// The number of candidates or costs differs from the last `ask`.
    pub fn tell(&mut self, candidates: &[Candidate], costs: &[f64]) -> Result<(), CmaError> {
        self.tell_ranked(candidates, costs, costs)
    }

    /// Like [`Cma::tell_ranked`], for the running instance; another one follows where it stops.
    ///
    /// # Errors
    /// The number of candidates, ranks or costs differs from the last `ask`.
    pub fn tell_ranked(
        &mut self,
        candidates: &[Candidate],
        ranks: &[f64],
        costs: &[f64],
    ) -> Result<(), CmaError> {
        let RestartInstance { small, cma } = &mut self.running;
        cma.tell_ranked(candidates, ranks, costs)?;
        let told = candidates.len() as u64;
        let spent = if *small { &mut self.small } else { &mut self.large };
        spent.evaluations += told;
        self.evaluations += told;
        let target = self.options.target;
        self.target_reached |= target.is_some_and(|target| costs.iter().any(|&c| c <= target));
        let Some(reason) = cma.stop() else { return Ok(()) };
        let evaluations = cma.evaluations();
        if !*small {
            self.last_large = Some(evaluations);
        }
        self.ended.push(Ended { population: cma.constants().population, evaluations, reason });
        self.start_next()
    }

    /// Like [`Cma::inject`], for the running instance.
    ///
    /// # Errors
    /// A point of another length than the mean, or not finite.
    pub fn inject(&mut self, points: &[Vec<f64>]) -> Result<(), CmaError> {
        self.running.cma.inject(points)
    }

    /// [`Cma::polish`] for all running and all later instances.
    pub fn polish(&mut self) {
        self.polishing = true;
        self.running.cma.polish();
    }

    /// [`StopReason::Target`] or [`StopReason::Budget`]; nothing else ends the search.
    pub fn stop(&self) -> Option<StopReason> {
        if self.target_reached {
            return Some(StopReason::Target);
        }
        let spent = self.options.budget.is_some_and(|budget| self.evaluations >= budget);
        spent.then_some(StopReason::Budget)
    }

    /// Stopped instances, in the order of their stops.
    pub fn ended(&self) -> &[Ended] {
        &self.ended
    }

    /// The instance that runs.
    pub fn running(&self) -> &Cma {
        &self.running.cma
    }

    /// Candidates told so far, over all instances.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }
}
