//! The functions of `cma_problems.json`, after its `formulas`.

use std::collections::HashMap;
use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;
use serde_json::Value;

/// `cma_problems.json`.
#[derive(Deserialize)]
pub(crate) struct File {
    pub schema: String,
    pub settings: Value,
    pub problems: Vec<TestFunction>,
    rotations: HashMap<usize, Vec<Vec<f64>>>,
    common: HashMap<usize, Common>,
}

/// Optima, starts and grids shared by all problems of one dimension.
#[derive(Deserialize)]
struct Common {
    x_opt: Vec<f64>,
    x_opt_grid: Vec<f64>,
    x0: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
pub(crate) struct TestFunction {
    pub id: String,
    pub func: String,
    pub n: usize,
    pub target: f64,
    pub budget: u64,
    pub sigma0: f64,
    pub x0_scale: f64,
    pub lower: Option<f64>,
    pub upper: Option<f64>,
    pub indicator: String,
    pub popsize: Option<usize>,
    pub restart: Option<String>,
    pub params: HashMap<String, f64>,
}

/// The cost of a point without its noise.
pub(crate) type Cost<'a> = Box<dyn Fn(&[f64]) -> f64 + 'a>;

impl File {
    /// Start of one run.
    pub(crate) fn start(&self, problem: &TestFunction, run: usize) -> Vec<f64> {
        self.common[&problem.n].x0[run].iter().map(|x| x * problem.x0_scale).collect()
    }

    /// The function of a problem; `None` if this program does not know it.
    pub(crate) fn cost<'a>(&'a self, problem: &'a TestFunction) -> Option<Cost<'a>> {
        let n = problem.n;
        let common = self.common.get(&n)?;
        let rotation = self.rotations.get(&n)?;
        let (x_opt, grid) = (&common.x_opt, &common.x_opt_grid);
        let param = |name: &str| problem.params.get(name).copied().unwrap_or(f64::NAN);
        let (cond, delta, q) = (param("cond"), param("delta"), param("q"));
        let powers = move |base: f64| -> Vec<f64> {
            (0..n).map(|i| base.powf(i as f64 / (n - 1) as f64)).collect()
        };
        let scale = powers(if problem.func == "linear_box" { 10.0 } else { cond });
        let shifted =
            move |x: &[f64]| -> Vec<f64> { x.iter().zip(x_opt).map(|(x, o)| x - o).collect() };
        let sphere = move |x: &[f64]| shifted(x).iter().map(|z| z * z).sum::<f64>();
        let turned = move |z: &[f64]| -> Vec<f64> {
            rotation.iter().map(|row| row.iter().zip(z).map(|(r, z)| r * z).sum()).collect()
        };
        let step = move |z: f64| delta * (z / delta + 0.5).floor();
        let sum = move |z: Vec<f64>, f: &dyn Fn(usize, f64) -> f64| -> f64 {
            z.into_iter().enumerate().map(|(i, z)| f(i, z)).sum()
        };
        let on_grid =
            move |x: &[f64]| -> Vec<f64> { x.iter().zip(grid).map(|(x, o)| x - o).collect() };
        Some(match problem.func.as_str() {
            "sphere" | "noisy_sphere_mult" | "noisy_sphere_add" => Box::new(sphere),
            "ellipsoid" => Box::new(move |x| sum(shifted(x), &|i, z| scale[i] * z * z)),
            "ellipsoid_rot" => {
                Box::new(move |x| sum(turned(&shifted(x)), &|i, z| scale[i] * z * z))
            }
            "rosenbrock" => Box::new(|x| {
                let pair = |w: &[f64]| 100.0 * (w[0] * w[0] - w[1]).powi(2) + (1.0 - w[0]).powi(2);
                x.windows(2).map(pair).sum()
            }),
            "rastrigin" => Box::new(move |x| {
                10.0 * n as f64 + sum(shifted(x), &|_, z| z * z - 10.0 * (TAU * z).cos())
            }),
            "linear_box" => Box::new(move |x| sum(x.to_vec(), &|i, x| scale[i] * (x + 5.0))),
            "sphere_box" => Box::new(move |x| {
                let centre = |i: usize| if i.is_multiple_of(2) { 7.0 } else { x_opt[i] };
                sum(x.to_vec(), &|i, x| (x - centre(i)).powi(2)) - 4.0 * n.div_ceil(2) as f64
            }),
            "step_sphere" => Box::new(move |x| sum(on_grid(x), &|_, z| step(z).powi(2))),
            "step_ellipsoid_rot" => {
                Box::new(move |x| sum(turned(&on_grid(x)), &|i, z| scale[i] * step(z).powi(2)))
            }
            "floor_sphere" => Box::new(move |x| q * (sphere(x) / q).floor()),
            _ => return None,
        })
    }
}

/// Noise of one run, added to every cost before the search is told.
pub(crate) struct Noise {
    rng: ChaCha8Rng,
    share: f64,
    offset: f64,
}

impl Noise {
    pub(crate) fn new(problem: &TestFunction, run: usize) -> Self {
        let noise = problem.params.get("noise").copied().unwrap_or(0.0);
        let of = |func: &str| if problem.func == func { noise } else { 0.0 };
        Self {
            rng: ChaCha8Rng::seed_from_u64(run as u64),
            share: of("noisy_sphere_mult"),
            offset: of("noisy_sphere_add"),
        }
    }

    pub(crate) fn observe(&mut self, cost: f64) -> f64 {
        let draw: f64 = StandardNormal.sample(&mut self.rng);
        cost * (1.0 + self.share * draw) + self.offset * draw
    }
}
