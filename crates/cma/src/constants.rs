//! Strategy parameters: Table 1 of the tutorial.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::options::MAX_POPULATION;

pub(crate) use libm::{exp, log as ln, pow};

/// Strategy parameters of Table 1 of the tutorial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Variables.
    pub n: usize,
    /// Candidates of a generation, λ.
    pub population: usize,
    /// Candidates that move the mean, µ = ⌊λ/2⌋.
    pub mu: usize,
    /// Recombination weights, best first `[λ]`; negative ones for the active update.
    pub weights: Vec<f64>,
    /// Variance-effective selection mass of the positive weights, µ_eff.
    pub mu_eff: f64,
    /// Learning rate of the step-size path.
    pub c_sigma: f64,
    /// Damping of the step size.
    pub d_sigma: f64,
    /// Learning rate of the covariance path.
    pub c_c: f64,
    /// Learning rate of the rank-one update.
    pub c_1: f64,
    /// Learning rate of the rank-µ update.
    pub c_mu: f64,
    /// Expected length of a standard normal vector, E‖N(0, I)‖.
    pub chi_n: f64,
}

impl Constants {
    /// True if loaded constants are of one population and may be computed with.
    pub(super) fn is_whole(&self) -> bool {
        let Self { population, mu, ref weights, .. } = *self;
        let rates = [self.c_sigma, self.c_c, self.c_1, self.c_mu];
        (2..=MAX_POPULATION).contains(&population)
            && mu == population / 2
            && weights.len() == population
            && rates.iter().all(|rate| (0.0..=1.0).contains(rate))
            && self.d_sigma > 0.0
            && self.chi_n > 0.0
            && self.mu_eff > 0.0
    }

    /// Default parameters for `n` ≥ 1 variables and `population` ≥ 2 candidates; `active` and
    /// `c_mu_offset` as in [`super::CmaOptions`].
    pub(super) fn new(n: usize, population: usize, active: bool, c_mu_offset: f64) -> Self {
        let dim = n as f64;
        let lambda = population as f64;
        let mu = population / 2;
        // Eq. 49: w'_i = ln((λ + 1)/2) − ln i.
        let raw: Vec<f64> =
            (1..=population).map(|i| ln((lambda + 1.0) / 2.0) - ln(i as f64)).collect();
        let mass = |w: &[f64]| {
            let (sum, squares) = w.iter().fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
            if squares > 0.0 { sum * sum / squares } else { 0.0 }
        };
        let mu_eff = mass(&raw[..mu]);
        let mu_eff_minus = mass(&raw[mu..]);
        // Eqs. 57 and 58.
        let c_1 = 2.0 / ((dim + 1.3).powi(2) + mu_eff);
        let c_mu = (1.0 - c_1).min(
            2.0 * (c_mu_offset + mu_eff + 1.0 / mu_eff - 2.0) / ((dim + 2.0).powi(2) + mu_eff),
        );
        // Eqs. 50 to 53: bound on the sum of the negative weights.
        let alpha = (1.0 + c_1 / c_mu)
            .min(1.0 + 2.0 * mu_eff_minus / (mu_eff + 2.0))
            .min((1.0 - c_1 - c_mu) / (dim * c_mu));
        let positive: f64 = raw.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = raw.iter().filter(|w| **w < 0.0).map(|w| -w).sum();
        let weights = raw
            .iter()
            .map(|&w| {
                if w >= 0.0 {
                    w / positive
                } else if active {
                    w * alpha.max(0.0) / negative
                } else {
                    0.0
                }
            })
            .collect();
        // Eqs. 55 and 56.
        let c_sigma = (mu_eff + 2.0) / (dim + mu_eff + 5.0);
        let d_sigma = 1.0 + 2.0 * (((mu_eff - 1.0) / (dim + 1.0)).sqrt() - 1.0).max(0.0) + c_sigma;
        let c_c = (4.0 + mu_eff / dim) / (dim + 4.0 + 2.0 * mu_eff / dim);
        let chi_n = dim.sqrt() * (1.0 - 1.0 / (4.0 * dim) + 1.0 / (21.0 * dim * dim));
        Self { n, population, mu, weights, mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi_n }
    }

    /// λ = 4 + ⌊3 ln n⌋, eq. 48.
    pub(super) fn default_population(n: usize) -> usize {
        4 + (3.0 * ln(n as f64)).floor() as usize
    }
}

/// a·b, added to `sum`, term by term. The product of `nalgebra` takes other code where a processor has fused
/// multiplication.
pub(crate) fn add_product(sum: &mut DMatrix<f64>, a: &DMatrix<f64>, b: &DMatrix<f64>) {
    for (column, mut sum) in b.column_iter().zip(sum.column_iter_mut()) {
        for (a, &b) in a.column_iter().zip(&column) {
            sum.iter_mut().zip(&a).for_each(|(sum, a)| *sum += a * b);
        }
    }
}

/// a·b.
pub(crate) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(a.nrows(), b.ncols());
    add_product(&mut product, a, b);
    product
}

/// a·x.
pub(crate) fn apply(a: &DMatrix<f64>, x: &DVector<f64>) -> DVector<f64> {
    let mut sum = DVector::zeros(a.nrows());
    for (a, &x) in a.column_iter().zip(x) {
        sum.iter_mut().zip(&a).for_each(|(sum, a)| *sum += a * x);
    }
    sum
}
