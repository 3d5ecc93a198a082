//! One CMA-ES search: ask, tell, stop.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::bounds::BoundTransform;
use crate::options::{Candidate, CandidateOrigin, MAX_POPULATION, check_length};
use crate::state::{Roots, SearchDistribution};
use crate::stop::CostHistory;
use crate::{CmaError, CmaOptions, Constants, StopReason, constants};

/// Largest condition number of C whose decomposition is trusted.
const MAX_CONDITION: f64 = 1e14;
/// Largest step size, as a multiple of the first: beyond it every point is random.
const MAX_STEP_SIZE: f64 = 1e6;
/// Longest pause of clipped points in a saved search, in generations.
const MOST_PAUSE: u32 = 1 << 30;
/// Deviations below this share of the first step size count as a point.
const SHRUNK: f64 = 1e-12;
/// Deviations below this share of their released floor end the polish.
const POLISHED: f64 = 1e-3;

/// CMA-ES with ask and tell.
///
/// Samples depend on (seed, generation) alone: equal seeds give equal bits, and a saved and loaded
/// search goes on to the same bits as one that never stopped.
///
/// With bounds, the best point of a generation joins the next one, moved onto each bound within a
/// standard deviation: an optimum on a face is evaluated exactly there.
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
/// # Ok::<(), sightline_cma::CmaError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cma {
    constants: Constants,
    state: SearchDistribution,
    seed: u64,
    space: Option<BoundTransform>,
    /// Floors of the standard deviations, in the search space.
    min_std: Option<Vec<f64>>,
    polishing: bool,
    first_step_size: f64,
    /// Injected points that no generation has held yet, in the caller's space.
    waiting: Vec<Vec<f64>>,
    /// Best point moved onto the bounds, for the next generation.
    clip: Option<Vec<f64>>,
    /// Clipped point evaluated last.
    last_clip: Option<Vec<f64>>,
    /// Generations until the next clipped point.
    clip_wait: u32,
    /// Generations that a bad clipped point holds off the next.
    clip_pause: u32,
    progress: CostHistory,
    /// Roots of the present C; `None` before the first use and where C does not decompose.
    #[serde(skip)]
    roots: Option<Roots>,
}

impl Cma {
    /// Starts at `mean`, in the caller's space.
    ///
    /// `step_size` is in units of the search space: the caller's without bounds, shares of each range
    /// with bounds.
    ///
    /// # Errors
    /// A number that is not usable, lengths that differ, or no variable with room to vary.
    pub fn new(mean: &[f64], step_size: f64, options: CmaOptions) -> Result<Self, CmaError> {
        options.check(mean, step_size)?;
        let space = options.bounds.clone().map(BoundTransform::new);
        let n = space.as_ref().map_or(mean.len(), BoundTransform::free_count);
        if n == 0 {
            return Err(CmaError::NoVariable);
        }
        let population = options.population.unwrap_or_else(|| Constants::default_population(n));
        if !(2..=MAX_POPULATION).contains(&population) {
            return Err(CmaError::BadPopulation { population });
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
            state: SearchDistribution::new(DVector::from_vec(start), step_size),
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
            progress: CostHistory::new(&options, n, population),
            roots: None,
        })
    }

    /// Looks whether the parts of a loaded search belong together, for `all` variables in the caller's space. A file
    /// holds any numbers.
    ///
    /// # Errors
    /// The first part that does not fit.
    pub fn check(&self, all: usize) -> Result<(), CmaError> {
        let n = self.constants.n;
        let is_space = match &self.space {
            Some(space) => space.is_whole(all) && space.free_count() == n,
            None => n == all,
        };
        let points = self.waiting.iter().chain(&self.clip).chain(&self.last_clip);
        let is_pause = (1..=MOST_PAUSE).contains(&self.clip_pause) && self.clip_wait <= MOST_PAUSE;
        let parts = [
            ("its variables are not those of its bounds", n > 0 && is_space),
            ("its constants are not those of its population", self.constants.is_whole()),
            ("its distribution is of other variables", self.state.is_of(n)),
            ("its floors are of other variables", self.min_std.iter().all(|std| std.len() == n)),
            ("a point is of other variables", points.into_iter().all(|p| p.len() == all)),
            ("its first step size is not above 0", self.first_step_size > 0.0),
            ("its pauses are too long", is_pause),
            ("its record of costs is damaged", self.progress.is_whole()),
        ];
        match parts.into_iter().find(|(_, is_whole)| !is_whole) {
            Some((what, _)) => Err(CmaError::BadState { what }),
            None => Ok(()),
        }
    }

    /// Adds points of the caller's space to the next generations, at most half of each.
    ///
    /// The points need not come from [`Self::ask`]; the pull of one on the mean is limited as in N. Hansen,
    /// "Injecting external solutions into CMA-ES", arXiv:1110.4181.
    ///
    /// # Errors
    /// A point of another length than the mean, or not finite.
    pub fn inject(&mut self, points: &[Vec<f64>]) -> Result<(), CmaError> {
        let want = self.mean_point().len();
        for point in points {
            check_length("an injected point", point.len(), want)?;
            if let Some(&value) = point.iter().find(|v| !v.is_finite()) {
                return Err(CmaError::BadNumber { name: "injected point", value });
            }
        }
        self.waiting.extend_from_slice(points);
        Ok(())
    }

    /// Releases the floors of the standard deviations until the search ends: the final polish.
    ///
    /// The search polishes by itself once every deviation is within twice its floor and neither the best
    /// nor the median costs have fallen for 2 (10 + 30 n/λ) generations, unless a plateau widened it
    /// before; see [`Self::tell`]. The polish ends with every deviation below 10⁻³ of its floor:
    /// [`StopReason::TolX`].
    pub fn polish(&mut self) {
        self.polishing = true;
    }

    /// Point of the caller's space at `x` of the search space.
    fn point_of(&self, x: &[f64]) -> Vec<f64> {
        match &self.space {
            Some(space) => space.point(x),
            None => x.to_vec(),
        }
    }

    /// Draws the λ candidates of the next generation; until [`Self::tell`] the same ones.
    ///
    /// After a failed decomposition ([`StopReason::Decomposition`]) candidates are drawn with C = I.
    pub fn ask(&mut self) -> Vec<Candidate> {
        let n = self.constants.n;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.state.generation);
        if self.roots.is_none() {
            self.roots = self.state.roots();
        }
        let injected = self.waiting.len().min(self.constants.population / 2);
        let mut candidates = Vec::with_capacity(self.constants.population);
        let given = self.waiting[..injected].iter().map(|point| (point, CandidateOrigin::Injected));
        for (point, origin) in given.chain(self.clip.iter().map(|p| (p, CandidateOrigin::Clipped)))
        {
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
        let z = DMatrix::from_fn(n, samples, |_, _| normal(&mut rng));
        // Eqs. 38 to 40: x = m + σ C^(1/2) z.
        let y = self
            .roots
            .as_ref()
            .map_or_else(|| z.clone(), |roots| constants::product(&roots.root, &z));
        candidates.extend(y.column_iter().zip(z.column_iter()).map(|(y, z)| {
            let x = &self.state.mean + y * self.state.step_size;
            let (point, length) = (self.point_of(x.as_slice()), z.norm_squared());
            Candidate { point, x, origin: CandidateOrigin::Sampled, length }
        }));
        candidates
    }

    /// Moves the distribution towards the candidates of low cost.
    ///
    /// Only the order of the costs matters; NaN ranks last, and equal costs rank in the order given.
    /// Equal costs in the whole generation, or in its best three quarters, widen the search. The step
    /// size grows tenfold on a plateau: neither the best nor the median costs have fallen for
    /// 2 (10 + 30 n/λ) generations, and one best cost came twice.
    ///
    /// # Errors
    /// Candidates of another number than λ, or costs of another number than candidates.
    pub fn tell(&mut self, candidates: &[Candidate], costs: &[f64]) -> Result<(), CmaError> {
        self.tell_ranked(candidates, costs, costs)
    }

    /// [`Self::tell`] for candidates that one number does not order.
    ///
    /// `ranks` order the candidates of this generation. `costs` compare between generations, NaN for a
    /// candidate without one; only [`Self::stop`] and the release of the floors read them.
    ///
    /// # Errors
    /// Candidates of another number than λ, or ranks or costs of another number than candidates.
    pub fn tell_ranked(
        &mut self,
        candidates: &[Candidate],
        ranks: &[f64],
        costs: &[f64],
    ) -> Result<(), CmaError> {
        let want = self.constants.population;
        for (name, got) in
            [("candidates", candidates.len()), ("ranks", ranks.len()), ("costs", costs.len())]
        {
            if got != want {
                return Err(CmaError::WrongCount { name, got, want });
            }
        }
        let injected = candidates.iter().filter(|c| c.origin == CandidateOrigin::Injected).count();
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
        self.adjust(candidates, &order);
        self.roots = self.state.roots();
        Ok(())
    }

    /// Writes y = (x − m)/σ into `step` and returns ‖C^(−1/2) y‖².
    ///
    /// The y of an injected or clipped point is shortened to ‖C^(−1/2) y‖ ≤ √n + 2n/(n + 2), about the
    /// length of the longest sample.
    fn step_of(&self, candidate: &Candidate, roots: &Roots, step: &mut [f64]) -> f64 {
        let scale = 1.0 / self.state.step_size;
        for ((y, x), m) in step.iter_mut().zip(&candidate.x).zip(&self.state.mean) {
            *y = (x - m) * scale;
        }
        if candidate.origin == CandidateOrigin::Sampled {
            return candidate.length;
        }
        let n = self.constants.n as f64;
        let longest = n.sqrt() + 2.0 * n / (n + 2.0);
        let length =
            constants::apply(&roots.inverse_root, &DVector::from_column_slice(step)).norm();
        if length > longest {
            step.iter_mut().for_each(|y| *y *= longest / length);
        }
        length.min(longest).powi(2)
    }

    /// Reason to end the search; `None` while it can go on.
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

    /// Mean in the caller's space.
    pub fn mean_point(&self) -> Vec<f64> {
        self.point_of(self.state.mean.as_slice())
    }

    /// Strategy parameters.
    pub fn constants(&self) -> &Constants {
        &self.constants
    }

    /// Candidates told so far.
    pub fn evaluations(&self) -> u64 {
        self.progress.evaluations
    }

    /// True if the floors of the standard deviations are released: [`Self::polish`].
    pub fn polishing(&self) -> bool {
        self.polishing
    }

    /// Applies all additions after an update; `order` sorts the candidates, best first.
    fn adjust(&mut self, candidates: &[Candidate], order: &[usize]) {
        if self.progress.stuck_on_plateau() {
            self.state.step_size *= OFF_PLATEAU;
        }
        self.state.step_size = self.state.step_size.min(MAX_STEP_SIZE * self.first_step_size);
        self.raise_deviations();
        self.clip_next(candidates, order);
    }

    /// Grows σ by exp(0.2 + c_σ/d_σ): a generation of equal costs shows no direction.
    fn widen(&mut self) {
        let c = &self.constants;
        self.state.step_size *= constants::exp(0.2 + c.c_sigma / c.d_sigma);
    }

    /// Standard deviation of variable `k` in the search space, σ √C_kk.
    fn deviation(&self, k: usize) -> f64 {
        self.state.step_size * self.state.cov[(k, k)].sqrt()
    }

    /// Moves the best point onto the bounds near it, for the next generation to evaluate.
    ///
    /// No clipped point comes twice in a row. A clipped point in the worse half doubles the
    /// generations until the next one, up to [`LONGEST_PAUSE`]; one in the better half ends the pause.
    fn clip_next(&mut self, candidates: &[Candidate], order: &[usize]) {
        let Some(space) = &self.space else { return };
        let rank = order.iter().position(|&i| candidates[i].origin == CandidateOrigin::Clipped);
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

    /// Raises every standard deviation to its floor, below which the cost is constant.
    ///
    /// Releases the floors once all deviations are on them and the costs no longer fall; see
    /// [`Self::polish`].
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
}

/// A number of the standard normal distribution.
///
/// The ziggurat of `rand_distr` takes numbers beyond 3.654 from the C library's logarithm, whose last bit differs
/// between processors: they are cut to multiples of 2⁻⁴⁰.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    const TAIL: f64 = 3.654;
    const STEPS: f64 = (1_u64 << 40) as f64;
    let z: f64 = StandardNormal.sample(rng);
    if z.abs() > TAIL { (z * STEPS).round() / STEPS } else { z }
}

/// Deviations count as on their floor up to this multiple of it.
const ON_FLOOR: f64 = 2.0;
/// Farthest move of the best point onto a bound, as a share of the variable's range.
const NEAR_BOUND: f64 = 0.1;
/// Growth of the step size on a plateau that the search does not leave.
const OFF_PLATEAU: f64 = 10.0;
/// Longest pause between clipped points, in generations.
const LONGEST_PAUSE: u32 = 16;
