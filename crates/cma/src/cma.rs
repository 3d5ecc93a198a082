use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::options::{MAX_POPULATION, check_bounds, check_length};
use super::state::Roots;
use super::stop::Progress;
use super::{BoundTransform, CmaOptions, Constants, OptimizeError, State, StopReason};

/// Condition number of C from which the decomposition is no longer trusted.
const MAX_CONDITION: f64 = 1e14;
/// Most a step size may grow to, in units of the search space: beyond it every point is random.
const MAX_STEP_SIZE: f64 = 1e6;
/// Share of the first deviation, with no floor, at which the search has shrunk to a point.
const SHRUNK: f64 = 1e-12;
/// Share of a released floor at which the polish is over.
const POLISHED: f64 = 1e-3;
/// Deviations of a coordinate above its floor that count as on it.
const ON_FLOOR: f64 = 2.0;
/// Most of a range that the clipped best point is moved by.
const NEAR_BOUND: f64 = 0.1;

/// Growth of the step size where the search is stuck on a plateau.
const OFF_PLATEAU: f64 = 10.0;
/// Most generations between clipped points.
const LONGEST_PAUSE: u32 = 16;

/// Where a candidate is from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    Sampled,
    Injected,
    /// The best point of the generation before, moved onto the bounds that it was near.
    Clipped,
}

/// A point to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    x: DVector<f64>,
    point: Vec<f64>,
    origin: Origin,
    /// ‖C^(−1/2) (x − m)/σ‖² of a sample, which is that of its z; 0 of others.
    length: f64,
}

impl Candidate {
    /// The point in the caller's space, within the bounds.
    pub fn point(&self) -> &[f64] {
        &self.point
    }
}

/// CMA-ES with ask and tell.
///
/// Samples come from (seed, generation) alone, so equal seeds give equal bits, and a saved and loaded
/// search goes on as if it had never stopped.
///
/// With bounds, the best point of a generation joins the next one moved onto the bounds that it is
/// within a standard deviation of, so that an optimum on a face is evaluated exactly there.
///
/// ```
/// use sightline_cma::{Cma, CmaOptions};
/// let mut cma = Cma::new(&[3.0, 3.0], 1.0, CmaOptions::default())?;
/// while cma.stop().is_none() {
///     let candidates = cma.ask();
///     let costs: Vec<f64> =
///         candidates.iter().map(|c| c.point().iter().map(|x| x * x).sum()).collect();
///     cma.tell(&candidates, &costs)?;
/// }
/// assert!(cma.mean_point().iter().all(|x| x.abs() < 1e-3));
/// # Ok::<(), sightline_cma::OptimizeError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cma {
    constants: Constants,
    state: State,
    seed: u64,
    space: Option<BoundTransform>,
    /// Least standard deviations in the search space.
    min_std: Option<Vec<f64>>,
    polishing: bool,
    first_step_size: f64,
    /// Points waiting to join a generation, in the caller's space.
    waiting: Vec<Vec<f64>>,
    /// The clipped best point that the next generation evaluates, and the last one that was.
    clip: Option<Vec<f64>>,
    last_clip: Option<Vec<f64>>,
    /// Generations until the next clipped point, and those that a bad one will hold off the next.
    clip_wait: u32,
    clip_pause: u32,
    progress: Progress,
    /// Of C as it stands; `None` before the first use and where C does not decompose.
    #[serde(skip)]
    roots: Option<Roots>,
}

impl Cma {
    /// A search from `mean` in the caller's space; `step_size` is in units of the search space: the
    /// caller's without bounds, shares of each range with bounds.
    ///
    /// # Errors
    /// A number that is not usable, lengths that differ, or nothing to search.
    pub fn new(mean: &[f64], step_size: f64, options: CmaOptions) -> Result<Self, OptimizeError> {
        let want = mean.len();
        if let Some(&value) = mean.iter().find(|m| !m.is_finite()) {
            return Err(OptimizeError::BadNumber { name: "mean", value });
        }
        if !(step_size > 0.0 && step_size.is_finite()) {
            return Err(OptimizeError::BadNumber { name: "step size", value: step_size });
        }
        if let Some(std) = &options.min_std {
            check_length("the least standard deviation", std.len(), want)?;
            if let Some(&value) = std.iter().find(|s| !s.is_finite()) {
                return Err(OptimizeError::BadNumber { name: "least standard deviation", value });
            }
        }
        for (name, number) in [("target", options.target), ("tolerance", Some(options.tol_fun))] {
            if let Some(value) = number.filter(|v| !v.is_finite()) {
                return Err(OptimizeError::BadNumber { name, value });
            }
        }
        let space = match &options.bounds {
            Some(bounds) => {
                check_bounds("the bounds", bounds, want)?;
                Some(BoundTransform::new(bounds.clone()))
            }
            None => None,
        };
        let n = space.as_ref().map_or(want, BoundTransform::free_count);
        if n == 0 {
            return Err(OptimizeError::NoVariable);
        }
        let population = options.population.unwrap_or_else(|| Constants::default_population(n));
        if !(2..=MAX_POPULATION).contains(&population) {
            return Err(OptimizeError::BadPopulation { population });
        }
        let min_std = options.min_std.as_ref().map(|std| match &space {
            Some(space) => space.free_part(std, |s, (low, high)| s / (high - low)),
            None => std.clone(),
        });
        let start = match &space {
            Some(space) => space.preimage(mean),
            None => mean.to_vec(),
        };
        Ok(Self {
            constants: Constants::new(n, population, options.active, options.c_mu_offset),
            state: State::new(DVector::from_vec(start), step_size),
            seed: options.seed,
            space,
            min_std,
            polishing: false,
            first_step_size: step_size,
            waiting: Vec::new(),
            clip: None,
            last_clip: None,
            clip_wait: 0,
            clip_pause: 1,
            progress: Progress::new(&options, n, population),
            roots: None,
        })
    }

    /// Lets points of the caller's space join the next generations, at most half of each.
    ///
    /// They need not come from [`Self::ask`]; how far one may pull the mean is limited as in Hansen,
    /// "Injecting external solutions into CMA-ES", arXiv:1110.4181.
    ///
    /// # Errors
    /// A point of another length than the mean, or not finite.
    pub fn inject(&mut self, points: &[Vec<f64>]) -> Result<(), OptimizeError> {
        let want = self.mean_point().len();
        for point in points {
            check_length("an injected point", point.len(), want)?;
            if let Some(&value) = point.iter().find(|v| !v.is_finite()) {
                return Err(OptimizeError::BadNumber { name: "injected point", value });
            }
        }
        self.waiting.extend_from_slice(points);
        Ok(())
    }

    /// Releases the floors of the standard deviations for the final polish, until the search ends.
    ///
    /// The search does so itself once it is on the floor, every deviation within twice its own, and
    /// neither the best nor the median costs have fallen for 2 (10 + 30 n/λ) generations, unless it is
    /// stuck on a plateau, which widens it; see [`Self::tell`]. The polish is over where every deviation is below 10⁻³ of its floor: [`StopReason::TolX`].
    pub fn polish(&mut self) {
        self.polishing = true;
    }

    fn point_of(&self, x: &[f64]) -> Vec<f64> {
        match &self.space {
            Some(space) => space.point(x),
            None => x.to_vec(),
        }
    }

    /// λ candidates of the next generation; the same ones until they are told.
    ///
    /// After a failed decomposition, see [`Self::stop`], they are drawn with C = I.
    pub fn ask(&mut self) -> Vec<Candidate> {
        let n = self.constants.n;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.state.generation);
        if self.roots.is_none() {
            self.roots = self.state.roots();
        }
        let injected = self.waiting.len().min(self.constants.population / 2);
        let mut candidates = Vec::with_capacity(self.constants.population);
        let given = self.waiting[..injected].iter().map(|point| (point, Origin::Injected));
        for (point, origin) in given.chain(self.clip.iter().map(|p| (p, Origin::Clipped))) {
            let x = match &self.space {
                Some(space) => space.preimage(point),
                None => point.clone(),
            };
            candidates.push(Candidate {
                point: self.point_of(&x),
                x: DVector::from_vec(x),
                origin,
                length: 0.0,
            });
        }
        let samples = self.constants.population - candidates.len();
        let z = DMatrix::from_fn(n, samples, |_, _| StandardNormal.sample(&mut rng));
        // Eqs. 38 to 40: x = m + σ C^(1/2) z.
        let y = self.roots.as_ref().map_or_else(|| z.clone(), |roots| &roots.root * &z);
        candidates.extend(y.column_iter().zip(z.column_iter()).map(|(y, z)| {
            let x = &self.state.mean + y * self.state.step_size;
            let (point, length) = (self.point_of(x.as_slice()), z.norm_squared());
            Candidate { point, x, origin: Origin::Sampled, length }
        }));
        candidates
    }

    /// Moves the distribution towards the candidates of low cost.
    ///
    /// Only the order of the costs matters; NaN ranks last, and equal costs rank in the order given.
    /// A generation of equal costs teaches nothing and widens the search; one whose best three quarters
    /// are equal widens it, too. Where neither the best nor the median costs have fallen for
    /// 2 (10 + 30 n/λ) generations and a best cost came back, as it does on plateaus alone, the step
    /// size grows tenfold.
    ///
    /// # Errors
    /// Candidates of another number than λ, or costs of another number than candidates.
    pub fn tell(&mut self, candidates: &[Candidate], costs: &[f64]) -> Result<(), OptimizeError> {
        self.tell_ranked(candidates, costs, costs)
    }

    /// As [`Self::tell`], where the order of a generation is not that of one number: `ranks` orders
    /// the candidates of this generation, and `costs` compare between generations, NaN where a
    /// candidate has none. Only [`Self::stop`] and the release of the floors look at the latter.
    ///
    /// # Errors
    /// Candidates of another number than λ, or ranks or costs of another number than candidates.
    pub fn tell_ranked(
        &mut self,
        candidates: &[Candidate],
        ranks: &[f64],
        costs: &[f64],
    ) -> Result<(), OptimizeError> {
        let want = self.constants.population;
        for (name, got) in
            [("candidates", candidates.len()), ("ranks", ranks.len()), ("costs", costs.len())]
        {
            if got != want {
                return Err(OptimizeError::WrongCount { name, got, want });
            }
        }
        let injected = candidates.iter().filter(|c| c.origin == Origin::Injected).count();
        self.waiting.drain(..injected.min(self.waiting.len()));
        self.progress.note(costs);
        if self.roots.is_none() {
            self.roots = self.state.roots();
        }
        let Some(roots) = self.roots.take() else {
            self.state.generation += 1;
            return Ok(());
        };
        let mut order: Vec<usize> = (0..want).collect();
        order.sort_by(|&a, &b| {
            ranks[a].is_nan().cmp(&ranks[b].is_nan()).then(ranks[a].total_cmp(&ranks[b]))
        });
        let (first, last) = (ranks[order[0]], ranks[order[want - 1]]);
        if first == last || first.is_nan() {
            self.widen();
            self.state.generation += 1;
        } else {
            let mut steps = DMatrix::zeros(self.constants.n, want);
            let columns = steps.column_iter_mut().zip(&order);
            let lengths: Vec<f64> = columns
                .map(|(mut step, &i)| self.step_of(&candidates[i], &roots, step.as_mut_slice()))
                .collect();
            self.state.update(&self.constants, &roots, &steps, &lengths);
            if ranks[order[want * 3 / 4]] == first {
                self.widen();
            }
        }
        if self.progress.stuck_on_plateau() {
            self.state.step_size *= OFF_PLATEAU;
        }
        self.state.step_size = self.state.step_size.min(MAX_STEP_SIZE * self.first_step_size);
        self.raise_deviations();
        self.clip_next(candidates, &order);
        self.roots = self.state.roots();
        Ok(())
    }

    /// One step up, as the longest path would take.
    fn widen(&mut self) {
        let c = &self.constants;
        self.state.step_size *= (0.2 + c.c_sigma / c.d_sigma).exp();
    }

    /// y = (x − m)/σ into `step`; that of a point from outside no longer than samples are. Returns
    /// ‖C^(−1/2) y‖².
    fn step_of(&self, candidate: &Candidate, roots: &Roots, step: &mut [f64]) -> f64 {
        let scale = 1.0 / self.state.step_size;
        for ((y, x), m) in step.iter_mut().zip(&candidate.x).zip(&self.state.mean) {
            *y = (x - m) * scale;
        }
        if candidate.origin == Origin::Sampled {
            return candidate.length;
        }
        let n = self.constants.n as f64;
        let longest = n.sqrt() + 2.0 * n / (n + 2.0);
        let length = (&roots.inverse_root * DVector::from_column_slice(step)).norm();
        if length > longest {
            step.iter_mut().for_each(|y| *y *= longest / length);
        }
        length.min(longest).powi(2)
    }

    /// Standard deviation of a variable in the search space.
    fn deviation(&self, k: usize) -> f64 {
        self.state.step_size * self.state.cov[(k, k)].sqrt()
    }

    /// Moves the best point onto the bounds that it is near, for the next generation to evaluate; not
    /// twice the same one, and ever more seldom while such points end in the worse half.
    fn clip_next(&mut self, candidates: &[Candidate], order: &[usize]) {
        let Some(space) = &self.space else { return };
        let rank = order.iter().position(|&i| candidates[i].origin == Origin::Clipped);
        self.clip_wait = self.clip_wait.saturating_sub(1);
        if let Some(rank) = rank {
            self.last_clip = self.clip.take();
            let good = rank < self.constants.mu;
            self.clip_wait = if good { 0 } else { self.clip_pause };
            self.clip_pause = if good { 1 } else { (2 * self.clip_pause).min(LONGEST_PAUSE) };
        }
        let near = |k: usize| self.deviation(k).min(NEAR_BOUND);
        self.clip = if self.clip_wait > 0 || self.constants.population < 4 {
            None
        } else {
            let clipped = space.clipped(candidates[order[0]].point(), near);
            clipped.filter(|clipped| self.last_clip.as_ref() != Some(clipped))
        };
    }

    /// Keeps every standard deviation at its floor, as the objective is constant on small scales, and
    /// releases the floors when that has ceased to help; see [`Self::polish`].
    fn raise_deviations(&mut self) {
        let Some(floors) = &self.min_std else { return };
        if self.polishing {
            return;
        }
        let on_floor =
            floors.iter().enumerate().all(|(k, floor)| self.deviation(k) <= ON_FLOOR * floor);
        if on_floor && !self.progress.falls() {
            self.polishing = true;
            return;
        }
        for (k, floor) in floors.iter().enumerate() {
            let least = (floor / self.state.step_size).powi(2);
            if least.is_finite() && self.state.cov[(k, k)] < least {
                self.state.cov[(k, k)] = least;
            }
        }
    }

    /// Why the search should end; `None` while it can go on.
    pub fn stop(&self) -> Option<StopReason> {
        if let Some(reason) = self.progress.stop() {
            return Some(reason);
        }
        let condition = match &self.roots {
            Some(roots) => Some(roots.condition),
            None => self.state.roots().map(|roots| roots.condition),
        };
        match condition {
            None => return Some(StopReason::Decomposition),
            Some(condition) if condition > MAX_CONDITION => return Some(StopReason::Condition),
            Some(_) => {}
        }
        let polished = self.polishing.then_some(self.min_std.as_ref()).flatten();
        let shrunk = (0..self.constants.n).all(|k| {
            let least = SHRUNK * self.first_step_size;
            self.deviation(k) < polished.map_or(least, |floors| least.max(POLISHED * floors[k]))
        });
        shrunk.then_some(StopReason::TolX)
    }

    /// Step size σ in units of the search space.
    pub fn step_size(&self) -> f64 {
        self.state.step_size
    }

    /// The mean in the caller's space.
    pub fn mean_point(&self) -> Vec<f64> {
        self.point_of(self.state.mean.as_slice())
    }

    /// Strategy parameters.
    pub fn constants(&self) -> &Constants {
        &self.constants
    }

    /// Candidates told so far.
    pub fn evaluations(&self) -> u64 {
        self.progress.evaluations()
    }

    /// Whether the floors of the standard deviations are released; see [`Self::polish`].
    pub fn polishing(&self) -> bool {
        self.polishing
    }
}
