use std::fmt;

use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::state::Roots;
use super::{BoundTransform, Constants, State};

/// Condition number of C from which the decomposition is no longer trusted.
const MAX_CONDITION: f64 = 1e14;
/// Most a step size may grow to, in units of the search space: beyond it every point is random.
const MAX_STEP_SIZE: f64 = 1e6;
/// Largest population.
const MAX_POPULATION: usize = 1_000_000;

/// How a [`Cma`] searches, beside mean and step size.
#[derive(Debug, Clone, PartialEq)]
pub struct CmaOptions {
    /// Candidates of a generation, λ; `None` takes 4 + ⌊3 ln n⌋.
    pub population: Option<usize>,
    /// Whether bad candidates take part in the covariance update with negative weights.
    pub active: bool,
    /// 1/4 for the tutorial of 2023, 0 for that of 2016.
    pub c_mu_offset: f64,
    /// Seed of all samples.
    pub seed: u64,
    /// (lower, upper) of each variable; the search space is then scaled to [0, 1] and every
    /// candidate is feasible.
    pub bounds: Option<Vec<(f64, f64)>>,
    /// Least standard deviation of each variable in the caller's units.
    pub min_std: Option<Vec<f64>>,
}

impl Default for CmaOptions {
    fn default() -> Self {
        Self {
            population: None,
            active: true,
            c_mu_offset: 0.25,
            seed: 0,
            bounds: None,
            min_std: None,
        }
    }
}

/// What cannot be searched with.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum OptimizeError {
    /// A number that must be finite, or positive.
    #[error("{name} = {value} is not usable; give a finite {name}{}", positive(.name))]
    BadNumber {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A vector of another length than the mean.
    #[error("{name} has {got} entries, the mean has {want}; give one for each variable")]
    WrongLength {
        /// Which.
        name: &'static str,
        /// Entries given.
        got: usize,
        /// Entries needed.
        want: usize,
    },
    /// Bounds out of order, or not finite.
    #[error("bounds {lower} to {upper} of variable {index} are not in order")]
    BadBounds {
        /// Variable.
        index: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// No variable, or none with width.
    #[error("there is nothing to search: no variable has room to vary")]
    NoVariable,
    /// Too few or too many candidates.
    #[error("a population of {population} is not usable; take 2 to {MAX_POPULATION}")]
    BadPopulation {
        /// As given.
        population: usize,
    },
}

fn positive(name: &str) -> &'static str {
    if name == "step size" { " above zero" } else { "" }
}

/// Why a search cannot go on by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum StopReason {
    /// The condition number of C passed 10¹⁴.
    Condition,
    /// C is not finite, or its eigenvectors were not found.
    Decomposition,
    /// Every standard deviation is below 10⁻¹² of the first one.
    TolX,
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Condition => "condition: the covariance matrix is ill-conditioned",
            Self::Decomposition => "decomposition: the covariance matrix has no eigenvectors",
            Self::TolX => "tolx: the search distribution has shrunk to a point",
        })
    }
}

/// A point to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    x: DVector<f64>,
    point: Vec<f64>,
    injected: bool,
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
/// ```
/// use sightline::optimize::{Cma, CmaOptions};
/// let mut cma = Cma::new(&[3.0, 3.0], 1.0, CmaOptions::default())?;
/// for _ in 0..60 {
///     let candidates = cma.ask();
///     let costs: Vec<f64> =
///         candidates.iter().map(|c| c.point().iter().map(|x| x * x).sum()).collect();
///     cma.tell(&candidates, &costs)?;
/// }
/// assert!(cma.mean_point().iter().all(|x| x.abs() < 1e-3));
/// # Ok::<(), sightline::optimize::OptimizeError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cma {
    constants: Constants,
    state: State,
    seed: u64,
    space: Option<BoundTransform>,
    /// Least standard deviations in the search space.
    min_std: Option<Vec<f64>>,
    first_step_size: f64,
    /// Points waiting to join a generation, in the caller's space.
    waiting: Vec<Vec<f64>>,
    failed: bool,
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
        let length = |name, got| match got == want {
            true => Ok(()),
            false => Err(OptimizeError::WrongLength { name, got, want }),
        };
        if let Some(&value) = mean.iter().find(|m| !m.is_finite()) {
            return Err(OptimizeError::BadNumber { name: "mean", value });
        }
        if !(step_size > 0.0 && step_size.is_finite()) {
            return Err(OptimizeError::BadNumber { name: "step size", value: step_size });
        }
        if let Some(std) = &options.min_std {
            length("the least standard deviation", std.len())?;
            if let Some(&value) = std.iter().find(|s| !s.is_finite()) {
                return Err(OptimizeError::BadNumber { name: "least standard deviation", value });
            }
        }
        let space = match options.bounds {
            Some(bounds) => {
                length("the bounds", bounds.len())?;
                for (index, &(lower, upper)) in bounds.iter().enumerate() {
                    if !(lower <= upper && lower.is_finite() && upper.is_finite()) {
                        return Err(OptimizeError::BadBounds { index, lower, upper });
                    }
                }
                Some(BoundTransform::new(bounds))
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
        let min_std = options.min_std.map(|std| match &space {
            Some(space) => space.free_part(&std, |s, (low, high)| s / (high - low)),
            None => std,
        });
        let start = match &space {
            Some(space) => space.preimage(mean),
            None => mean.to_vec(),
        };
        let constants = Constants::new(n, population, options.active, options.c_mu_offset);
        Ok(Self {
            state: State::new(DVector::from_vec(start), step_size),
            constants,
            seed: options.seed,
            space,
            min_std,
            first_step_size: step_size,
            waiting: Vec::new(),
            failed: false,
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
        let want = self.point_of(&self.state.mean).len();
        for point in points {
            if point.len() != want {
                let got = point.len();
                return Err(OptimizeError::WrongLength { name: "an injected point", got, want });
            }
            if let Some(&value) = point.iter().find(|v| !v.is_finite()) {
                return Err(OptimizeError::BadNumber { name: "injected point", value });
            }
        }
        self.waiting.extend_from_slice(points);
        Ok(())
    }

    fn point_of(&self, x: &DVector<f64>) -> Vec<f64> {
        match &self.space {
            Some(space) => space.point(x.as_slice()),
            None => x.as_slice().to_vec(),
        }
    }

    fn roots(&mut self) -> Option<&Roots> {
        if self.roots.is_none() {
            self.roots = self.state.roots();
            self.failed = self.roots.is_none();
        }
        self.roots.as_ref()
    }

    /// λ candidates of the next generation; the same ones until they are told.
    ///
    /// After a failed decomposition, see [`Self::stop`], they are drawn with C = I.
    pub fn ask(&mut self) -> Vec<Candidate> {
        let n = self.constants.n;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(self.state.generation);
        let root = self.roots().map(|roots| roots.root.clone());
        let injected = self.waiting.len().min(self.constants.population / 2);
        let injections = self.waiting[..injected].iter().map(|point| {
            let x = match &self.space {
                Some(space) => space.preimage(point),
                None => point.clone(),
            };
            let x = DVector::from_vec(x);
            Candidate { point: self.point_of(&x), x, injected: true }
        });
        let samples = (injected..self.constants.population).map(|_| {
            let z = DVector::from_fn(n, |_, _| StandardNormal.sample(&mut rng));
            // Eqs. 38 to 40: x = m + σ C^(1/2) z.
            let y = root.as_ref().map_or_else(|| z.clone(), |root| root * &z);
            let x = &self.state.mean + y * self.state.step_size;
            Candidate { point: self.point_of(&x), x, injected: false }
        });
        injections.chain(samples).collect()
    }

    /// Moves the distribution towards the candidates of low cost.
    ///
    /// Only the order of the costs matters; NaN ranks last, and equal costs rank in the order given.
    /// A generation of equal costs teaches nothing and widens the search.
    ///
    /// # Errors
    /// Candidates of another number than λ, or costs of another number than candidates.
    pub fn tell(&mut self, candidates: &[Candidate], costs: &[f64]) -> Result<(), OptimizeError> {
        let want = self.constants.population;
        for (name, got) in [("the generation", candidates.len()), ("the costs", costs.len())] {
            if got != want {
                return Err(OptimizeError::WrongLength { name, got, want });
            }
        }
        let injected = candidates.iter().filter(|c| c.injected).count();
        self.waiting.drain(..injected.min(self.waiting.len()));
        let Some(roots) = self.roots().cloned() else {
            self.state.generation += 1;
            return Ok(());
        };
        let mut order: Vec<usize> = (0..want).collect();
        order.sort_by(|&a, &b| {
            costs[a].is_nan().cmp(&costs[b].is_nan()).then(costs[a].total_cmp(&costs[b]))
        });
        let (first, last) = (costs[order[0]], costs[order[want - 1]]);
        if first == last || first.is_nan() {
            let c = &self.constants;
            self.state.step_size *= (0.2 + c.c_sigma / c.d_sigma).exp();
            self.state.generation += 1;
        } else {
            let steps: Vec<DVector<f64>> =
                order.iter().map(|&i| self.step_of(&candidates[i], &roots)).collect();
            self.state.update(&self.constants, &roots, &steps);
        }
        self.state.step_size = self.state.step_size.min(MAX_STEP_SIZE * self.first_step_size);
        self.raise_deviations();
        self.roots = None;
        Ok(())
    }

    /// y = (x − m)/σ; that of an injected point no longer than samples are.
    fn step_of(&self, candidate: &Candidate, roots: &Roots) -> DVector<f64> {
        let y = (&candidate.x - &self.state.mean) / self.state.step_size;
        if !candidate.injected {
            return y;
        }
        let n = self.constants.n as f64;
        let longest = n.sqrt() + 2.0 * n / (n + 2.0);
        let length = (&roots.inverse_root * &y).norm();
        if length > longest { y * (longest / length) } else { y }
    }

    /// Keeps every standard deviation at its floor: the objective is constant on small scales.
    fn raise_deviations(&mut self) {
        let Some(floors) = &self.min_std else { return };
        for (k, floor) in floors.iter().enumerate() {
            let least = (floor / self.state.step_size).powi(2);
            if least.is_finite() && self.state.cov[(k, k)] < least {
                self.state.cov[(k, k)] = least;
            }
        }
    }

    /// Why the search should end; `None` while it can go on.
    pub fn stop(&self) -> Option<StopReason> {
        let Some(roots) = self.roots.clone().or_else(|| self.state.roots()) else {
            return Some(StopReason::Decomposition);
        };
        if roots.condition > MAX_CONDITION {
            return Some(StopReason::Condition);
        }
        let widest = self.state.cov.diagonal().max().sqrt() * self.state.step_size;
        (widest < 1e-12 * self.first_step_size).then_some(StopReason::TolX)
    }

    /// Step size σ in units of the search space.
    pub fn step_size(&self) -> f64 {
        self.state.step_size
    }

    /// The mean in the caller's space.
    pub fn mean_point(&self) -> Vec<f64> {
        self.point_of(&self.state.mean)
    }

    /// Strategy parameters.
    pub fn constants(&self) -> &Constants {
        &self.constants
    }
}
