//! Search distribution and its update, eqs. 38 to 47.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::de::{Error as _, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize};

use crate::options::MOST_COUNTED;
use crate::{Constants, constants};

/// Floor of the eigenvalues, as a share of the largest: rounding makes small ones negative.
const EIGENVALUE_FLOOR: f64 = 1e-15;
/// Most sweeps of one decomposition.
const MAX_SWEEPS: usize = 10_000;

/// Search distribution N(mean, σ² C) and its evolution paths.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct SearchDistribution {
    /// Mean m.
    #[serde(deserialize_with = "read_vector")]
    pub(super) mean: DVector<f64>,
    pub(super) step_size: f64,
    /// Covariance matrix C.
    #[serde(deserialize_with = "read_matrix")]
    pub(super) cov: DMatrix<f64>,
    /// Evolution path of the step size, p_σ.
    #[serde(deserialize_with = "read_vector")]
    pub(super) path_sigma: DVector<f64>,
    /// Evolution path of the covariance, p_c.
    #[serde(deserialize_with = "read_vector")]
    pub(super) path_c: DVector<f64>,
    /// Generations told.
    pub(super) generation: u64,
}

/// C^(1/2) and C^(−1/2), both symmetric, and the condition number of C.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Roots {
    pub(super) root: DMatrix<f64>,
    pub(super) inverse_root: DMatrix<f64>,
    pub(super) condition: f64,
}

/// A vector as nalgebra writes it: entries, rows, and a unit for its one column.
fn read_vector<'de, D: Deserializer<'de>>(from: D) -> Result<DVector<f64>, D::Error> {
    let (entries, rows, _): (Vec<f64>, usize, IgnoredAny) = Deserialize::deserialize(from)?;
    if rows != entries.len() {
        return Err(D::Error::custom("a vector has another length than its entries"));
    }
    Ok(DVector::from_vec(entries))
}

/// A matrix as nalgebra writes it: entries by column, rows, columns. nalgebra's own reader multiplies the two
/// unchecked.
fn read_matrix<'de, D: Deserializer<'de>>(from: D) -> Result<DMatrix<f64>, D::Error> {
    let (entries, rows, columns): (Vec<f64>, usize, usize) = Deserialize::deserialize(from)?;
    if rows.checked_mul(columns) != Some(entries.len()) {
        return Err(D::Error::custom("a matrix has another size than its entries"));
    }
    Ok(DMatrix::from_vec(rows, columns, entries))
}

impl SearchDistribution {
    /// True if all parts are of `n` variables.
    pub(super) fn is_of(&self, n: usize) -> bool {
        let vectors = [&self.mean, &self.path_sigma, &self.path_c];
        vectors.iter().all(|vector| vector.len() == n)
            && self.cov.shape() == (n, n)
            && self.step_size > 0.0
            && self.generation <= MOST_COUNTED
    }

    /// Identity covariance and empty paths.
    pub(super) fn new(mean: DVector<f64>, step_size: f64) -> Self {
        let n = mean.len();
        Self {
            mean,
            step_size,
            cov: DMatrix::identity(n, n),
            path_sigma: DVector::zeros(n),
            path_c: DVector::zeros(n),
            generation: 0,
        }
    }

    /// Square roots of C through its eigenvectors; `None` if C is not finite or does not decompose.
    pub(super) fn roots(&self) -> Option<Roots> {
        if self.cov.iter().any(|c| !c.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::try_new(self.cov.clone(), f64::EPSILON, MAX_SWEEPS)?;
        let largest = eigen.eigenvalues.max();
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        let values = eigen.eigenvalues.map(|v| v.max(largest * EIGENVALUE_FLOOR));
        let basis = &eigen.eigenvectors;
        let turned = basis.transpose();
        let with = |scale: DVector<f64>| {
            let mut scaled = basis.clone();
            scaled.column_iter_mut().zip(&scale).for_each(|(mut column, &scale)| column *= scale);
            constants::product(&scaled, &turned)
        };
        Some(Roots {
            root: with(values.map(f64::sqrt)),
            inverse_root: with(values.map(|v| 1.0 / v.sqrt())),
            condition: largest / values.min(),
        })
    }

    /// One update from the steps y_i = (x_i − m)/σ of all candidates `[n, λ]`, best first, and their
    /// ‖C^(−1/2) y_i‖² `[λ]`; returns h_σ.
    pub(super) fn update(
        &mut self,
        c: &Constants,
        roots: &Roots,
        steps: &DMatrix<f64>,
        lengths: &[f64],
    ) -> bool {
        let n = c.n as f64;
        // Eqs. 38 and 39, c_m = 1.
        let weights = DVector::from_column_slice(&c.weights);
        let best = steps.columns(0, c.mu).into_owned();
        let step = constants::apply(&best, &weights.rows(0, c.mu).into_owned());
        self.mean += &step * self.step_size;
        // Eq. 43.
        self.path_sigma = &self.path_sigma * (1.0 - c.c_sigma)
            + constants::apply(&roots.inverse_root, &step)
                * (c.c_sigma * (2.0 - c.c_sigma) * c.mu_eff).sqrt();
        let length = self.path_sigma.norm();
        // Eq. 44.
        self.step_size *= constants::exp(c.c_sigma / c.d_sigma * (length / c.chi_n - 1.0));
        // Below eq. 45: h_σ stalls p_c while σ grows fast.
        self.generation += 1;
        let seen = 1.0 - constants::pow(1.0 - c.c_sigma, 2.0 * self.generation as f64);
        let h_sigma = length / seen.sqrt() < (1.4 + 2.0 / (n + 1.0)) * c.chi_n;
        let h = f64::from(u8::from(h_sigma));
        // Eq. 45.
        self.path_c =
            &self.path_c * (1.0 - c.c_c) + &step * (h * (c.c_c * (2.0 - c.c_c) * c.mu_eff).sqrt());
        // Eqs. 46 and 47, all steps in one product.
        let lost = (1.0 - h) * c.c_c * (2.0 - c.c_c);
        let used = c.weights.iter().rposition(|&w| w != 0.0).map_or(0, |last| last + 1);
        let mut scaled = steps.columns(0, used).into_owned();
        for (i, mut column) in scaled.column_iter_mut().enumerate() {
            let w = match weights[i] {
                w if w >= 0.0 => w,
                // A step of length 0 has no direction.
                w => {
                    if lengths[i] > 0.0 {
                        w * n / lengths[i]
                    } else {
                        0.0
                    }
                }
            };
            column *= c.c_mu * w;
        }
        self.cov *= 1.0 + c.c_1 * lost - c.c_1 - c.c_mu * weights.sum();
        self.cov.ger(c.c_1, &self.path_c, &self.path_c, 1.0);
        constants::add_product(&mut self.cov, &scaled, &steps.columns(0, used).transpose());
        self.cov = (&self.cov + self.cov.transpose()) * 0.5;
        h_sigma
    }
}
