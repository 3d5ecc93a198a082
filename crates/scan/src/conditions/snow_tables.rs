//! Functions of the flakes in a beam that have no short form, tabulated once.

use lidar_cast::maths;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Steps of each table.
const STEPS: usize = 1024;
const GUIDES: usize = 512;
/// z of P(5/2, z) and of the mean share up to which the tables go.
const WIDEST: f64 = 36.0;
const WIDEST_MEAN: f64 = 400.0;

/// The functions of a fall that have no short form, the same for all snow.
pub(super) struct SnowTables {
    /// x·q² by q = g'^(1/3), g' = 3·g(x).
    threshold: Vec<f64>,
    /// P(5/2, w²) by w.
    gamma: Vec<f64>,
    /// Start of the search in `gamma`, by P.
    guide: Vec<u16>,
    /// ∫₀¹ P(3, x·t²) dt by √x.
    mean_share: Vec<f64>,
}

pub(super) static TABLES: LazyLock<SnowTables> = LazyLock::new(SnowTables::new);

impl SnowTables {
    fn new() -> Self {
        let step = |k: usize| k as f64 / STEPS as f64;
        // 3·∫₀¹ t²·e^(−xt²) dt.
        let g = |x: f64| match x < 1e-3 {
            true => 1.0 - 0.6 * x + 3.0 / 14.0 * x * x,
            false => {
                let w = x.sqrt();
                (0.75 * PI.sqrt() * maths::erf(w) - 1.5 * w * maths::exp(-x)) / (x * w)
            }
        };
        let threshold = (0..=STEPS).map(|k| {
            let q = step(k);
            let product = |x: f64| x * q * q;
            if k == 0 {
                return maths::pow(3.0 * PI.sqrt() / 4.0, 2.0 / 3.0);
            }
            let (mut low, mut high) = (0.0, 2.0 / (q * q));
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if g(middle) > q.powi(3) { low = middle } else { high = middle }
            }
            product(0.5 * (low + high))
        });
        let gamma = (0..=STEPS).map(|k| {
            let w = step(k) * WIDEST.sqrt();
            let tail = maths::exp(-w * w) * w * (1.0 + 2.0 / 3.0 * w * w);
            (maths::erf(w) - 2.0 / PI.sqrt() * tail).max(0.0)
        });
        let mean_share = (0..=STEPS).map(|k| {
            let x = (step(k) * WIDEST_MEAN.sqrt()).powi(2);
            let p = |z: f64| 1.0 - maths::exp(-z) * (1.0 + z * (1.0 + 0.5 * z));
            (0..400).map(|i| p(x * ((f64::from(i) + 0.5) / 400.0).powi(2))).sum::<f64>() / 400.0
        });
        let gamma: Vec<f64> = gamma.collect();
        let guide = (0..GUIDES).map(|k| {
            let below = gamma.partition_point(|&p| p <= k as f64 / GUIDES as f64);
            below.clamp(1, STEPS) as u16
        });
        Self {
            threshold: threshold.collect(),
            guide: guide.collect(),
            mean_share: mean_share.collect(),
            gamma,
        }
    }

    /// x above which a share of the flakes has its echoes.
    pub fn threshold(&self, share: f64) -> f64 {
        // At q = 10⁻⁶ echoes are stronger than any in ten thousand years of snow.
        let q = f64::from(maths::cbrtf(share as f32)).max(1e-6);
        at(&self.threshold, q) / (q * q)
    }

    /// t = r/R of a flake with its echo at x.
    pub fn place(&self, x: f64, u: f64) -> f64 {
        if x < 0.01 {
            return maths::pow(u, 0.2);
        }
        let widest = x.sqrt();
        let steps = widest / WIDEST.sqrt() * STEPS as f64;
        let part =
            u * if steps >= STEPS as f64 { 1.0 } else { at(&self.gamma, steps / STEPS as f64) };
        let bucket = (part * GUIDES as f64) as usize;
        let mut above = usize::from(self.guide[bucket.min(GUIDES - 1)]);
        while above < STEPS && self.gamma[above] <= part {
            above += 1;
        }
        let (a, b) = (self.gamma[above - 1], self.gamma[above]);
        let share = if b > a { (part - a) / (b - a) } else { 0.0 };
        let w = ((above - 1) as f64 + share) / STEPS as f64 * WIDEST.sqrt();
        (w / widest).min(1.0)
    }

    /// Share of the mean extinction up to R that is left to flakes with echoes below x.
    pub fn mean_share(&self, x: f64) -> f64 {
        if x >= WIDEST_MEAN {
            // 1 − ∫₀^∞ Q(3, v²) dv / √x; the integral is 15√π/16.
            return 1.0 - 15.0 * PI.sqrt() / 16.0 / x.sqrt();
        }
        at(&self.mean_share, (x / WIDEST_MEAN).sqrt())
    }
}

/// Value of a table at a place from 0 to 1.
fn at(table: &[f64], place: f64) -> f64 {
    let place = place * (table.len() - 1) as f64;
    let below = (place as usize).min(table.len() - 2);
    table[below] + (place - below as f64) * (table[below + 1] - table[below])
}
