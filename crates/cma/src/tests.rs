//! Updates against golden traces, smooth functions, bounds, saving, floors.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use serde_json::Value;

use super::*;
use crate::state::SearchDistribution;

mod restarts;
mod robustness;

/// Traces of a reference implementation, from the folder that `build.rs` looked for.
fn golden(file: &str) -> Value {
    let folder = std::env::var_os("SIGHTLINE_GOLDEN").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/golden"),
        PathBuf::from,
    );
    let path = folder.join(file);
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}; set SIGHTLINE_GOLDEN", path.display()));
    serde_json::from_str(&text).unwrap()
}

fn vector(value: &Value) -> DVector<f64> {
    let numbers = value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap());
    DVector::from_vec(numbers.collect())
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<_> = value.as_array().unwrap().iter().map(|r| vector(r).transpose()).collect();
    DMatrix::from_rows(&rows)
}

/// Largest difference as a share of the largest entry.
fn difference(got: &[f64], want: &[f64]) -> f64 {
    let largest = want.iter().fold(1e-300_f64, |m, w| m.max(w.abs()));
    got.iter().zip(want).map(|(g, w)| (g - w).abs() / largest).fold(0.0, f64::max)
}

#[test]
#[cfg_attr(not(has_golden), ignore = "needs cma_tell.json in ../shared/golden or SIGHTLINE_GOLDEN")]
fn updates_follow_the_reference_traces() {
    let file = golden("cma_tell.json");
    let traces = file["traces"].as_array().unwrap();
    assert_eq!(traces.len(), 12);
    for trace in traces {
        let id = trace["id"].as_str().unwrap();
        let n = trace["n"].as_u64().unwrap() as usize;
        let population = trace["lam"].as_u64().unwrap() as usize;
        let active = trace["active"] == true;
        let offset = trace["c_mu_offset"].as_f64().unwrap();
        let constants = Constants::new(n, population, active, offset);
        let want = &trace["constants"];
        let weights = vector(&want["weights"]);
        assert!(difference(&constants.weights, weights.as_slice()) < 1e-13, "{id}: weights");
        for (name, got) in [
            ("mu_eff", constants.mu_eff),
            ("c_sigma", constants.c_sigma),
            ("d_sigma", constants.d_sigma),
            ("c_c", constants.c_c),
            ("c_1", constants.c_1),
            ("c_mu", constants.c_mu),
            ("chi_N", constants.chi_n),
        ] {
            assert!(difference(&[got], &[want[name].as_f64().unwrap()]) < 1e-13, "{id}: {name}");
        }
        let mut state =
            SearchDistribution::new(vector(&trace["m0"]), trace["sigma0"].as_f64().unwrap());
        for (g, generation) in trace["generations"].as_array().unwrap().iter().enumerate() {
            let roots = state.roots().unwrap();
            let x: Vec<_> = generation["x"].as_array().unwrap().iter().map(vector).collect();
            for (x, z) in x.iter().zip(generation["z"].as_array().unwrap()) {
                let sampled = &state.mean + &roots.root * vector(z) * state.step_size;
                assert!(difference(sampled.as_slice(), x.as_slice()) < 1e-12, "{id}, {g}: x");
            }
            let order = generation["order_best_first"].as_array().unwrap().iter();
            let steps: Vec<_> = order
                .map(|i| (&x[i.as_u64().unwrap() as usize] - &state.mean) / state.step_size)
                .collect();
            let lengths: Vec<f64> =
                steps.iter().map(|y| (&roots.inverse_root * y).norm_squared()).collect();
            let steps = DMatrix::from_columns(&steps);
            let h_sigma = state.update(&constants, &roots, &steps, &lengths);
            let want = &generation["h_sigma"];
            assert_eq!(h_sigma, want == true || want.as_f64() == Some(1.0), "{id}, {g}");
            let worst = [
                difference(state.mean.as_slice(), vector(&generation["m"]).as_slice()),
                difference(&[state.step_size], &[generation["sigma"].as_f64().unwrap()]),
                difference(state.path_sigma.as_slice(), vector(&generation["p_sigma"]).as_slice()),
                difference(state.path_c.as_slice(), vector(&generation["p_c"]).as_slice()),
                difference(state.cov.as_slice(), matrix(&generation["C"]).as_slice()),
            ];
            assert!(worst.iter().all(|&w| w < 1e-12), "{id}, {g}: {worst:?}");
        }
    }
}

type Function = fn(&[f64]) -> f64;

fn sphere(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

fn ellipsoid(x: &[f64]) -> f64 {
    let n = x.len() as f64 - 1.0;
    x.iter().enumerate().map(|(i, x)| 1e6_f64.powf(i as f64 / n) * x * x).sum()
}

fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|p| 100.0 * (p[0] * p[0] - p[1]).powi(2) + (1.0 - p[0]).powi(2)).sum()
}

/// Asks a generation and tells its costs; returns its points.
fn told(cma: &mut Cma, cost: impl Fn(&[f64]) -> f64) -> Vec<Vec<f64>> {
    let candidates = cma.ask();
    let points: Vec<Vec<f64>> = candidates.iter().map(|c| c.point().to_vec()).collect();
    let costs: Vec<f64> = points.iter().map(|point| cost(point)).collect();
    cma.tell(&candidates, &costs).unwrap();
    points
}

fn generations(cma: &mut Cma, f: Function, count: usize) -> f64 {
    let points = (0..count).flat_map(|_| told(cma, f));
    points.map(|point| f(&point)).fold(f64::INFINITY, f64::min)
}

#[test]
fn smooth_functions_are_solved() {
    for (f, count) in [(sphere as Function, 250), (ellipsoid, 600), (rosenbrock, 900)] {
        let options = CmaOptions { seed: 4, ..CmaOptions::default() };
        let mut cma = Cma::new(&[0.4; 8], 0.5, options).unwrap();
        let best = generations(&mut cma, f, count);
        assert!(best < 1e-9, "{best}");
    }
}

fn boxed(seed: u64, n: usize) -> Cma {
    let bounds = Some(vec![(-5.0, 5.0); n]);
    let options = CmaOptions { seed, bounds, ..CmaOptions::default() };
    Cma::new(&vec![1.0; n], 0.3, options).unwrap()
}

#[test]
fn an_optimum_on_the_bounds_is_reached_and_never_passed() {
    let mut cma = boxed(1, 6);
    for _ in 0..400 {
        let points = told(&mut cma, |x| x.iter().sum());
        assert!(points.iter().flatten().all(|x| (-5.0..=5.0).contains(x)));
    }
    assert!(cma.mean_point().iter().all(|x| x + 5.0 < 1e-8), "{:?}", cma.mean_point());
}

#[test]
fn only_ranks_matter() {
    let (mut plain, mut warped) = (boxed(2, 4), boxed(2, 4));
    for _ in 0..50 {
        let candidates = plain.ask();
        assert_eq!(candidates, warped.ask());
        let costs: Vec<f64> = candidates.iter().map(|c| sphere(c.point())).collect();
        let exponential: Vec<f64> = costs.iter().map(|c| c.exp()).collect();
        plain.tell(&candidates, &costs).unwrap();
        warped.tell(&candidates, &exponential).unwrap();
    }
}

#[test]
fn a_saved_search_goes_on_to_the_same_bits() {
    let mut whole = boxed(3, 5);
    whole.inject(&vec![vec![0.5; 5]; 9]).unwrap();
    generations(&mut whole, ellipsoid, 20);
    let text = serde_json::to_string(&whole).unwrap();
    let mut loaded: Cma = serde_json::from_str(&text).unwrap();
    generations(&mut whole, ellipsoid, 20);
    generations(&mut loaded, ellipsoid, 20);
    assert_eq!(serde_json::to_string(&whole).unwrap(), serde_json::to_string(&loaded).unwrap());
}

#[test]
fn injected_points_are_evaluated_as_they_are() {
    let mut cma = boxed(5, 4);
    let layout = vec![4.9, -5.0, 5.0, 0.25];
    cma.inject(std::slice::from_ref(&layout)).unwrap();
    let candidates = cma.ask();
    for (got, want) in candidates[0].point().iter().zip(&layout) {
        assert!((got - want).abs() < 1e-12, "{got} {want}");
    }
    // Far better than all else, it pulls the mean, but not out of the world.
    let costs: Vec<f64> = (0..candidates.len()).map(|i| i as f64).collect();
    let before = cma.step_size();
    cma.tell(&candidates, &costs).unwrap();
    assert!(cma.step_size() < 3.0 * before);
    let pulled = cma.mean_point();
    assert!(pulled[0] > 1.0 && pulled[1] < 1.0, "{pulled:?}");
    assert_eq!(
        cma.inject(&[vec![0.0; 3]]).unwrap_err().to_string(),
        "an injected point has 3 entries, the mean has 4; give one for each variable"
    );
}

#[test]
fn hostile_costs_and_sizes_end_in_a_stated_result() {
    let hostile: [fn(usize) -> f64; 5] = [
        |_| f64::NAN,
        |_| 1.0,
        |i| if i % 2 == 0 { f64::NAN } else { i as f64 },
        |i| if i % 3 == 0 { f64::INFINITY } else { f64::NEG_INFINITY },
        |i| if i == 0 { -f64::MAX } else { f64::MAX },
    ];
    for cost in hostile {
        for (n, population) in [(1, 4), (3, 4), (2, 2), (4, 1000)] {
            let options = CmaOptions {
                population: Some(population),
                bounds: Some(vec![(0.0, 1.0); n]),
                ..CmaOptions::default()
            };
            let mut cma = Cma::new(&vec![0.5; n], 0.3, options).unwrap();
            for _ in 0..60 {
                let candidates = cma.ask();
                let inside = |c: &Candidate| c.point().iter().all(|x| (0.0..=1.0).contains(x));
                assert!(candidates.iter().all(inside));
                let costs: Vec<f64> = (0..population).map(cost).collect();
                cma.tell(&candidates, &costs).unwrap();
                let _ = cma.stop();
            }
        }
    }
}

#[test]
fn deviations_stay_above_their_floor_until_the_polish() {
    let options = CmaOptions {
        bounds: Some(vec![(-5.0, 5.0); 3]),
        min_std: Some(vec![0.1; 3]),
        ..CmaOptions::default()
    };
    let mut cma = Cma::new(&[1.0; 3], 0.3, options).unwrap();
    let spread = |cma: &mut Cma| {
        let x: Vec<f64> = cma.ask().iter().map(|c| c.point()[0]).collect();
        let mean = x.iter().sum::<f64>() / x.len() as f64;
        (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64).sqrt()
    };
    generations(&mut cma, sphere, 30);
    assert!(!cma.polishing());
    assert!(spread(&mut cma) > 0.03, "{}", spread(&mut cma));
    let mut asked = cma.clone();
    asked.polish();
    // Nothing falls on the floor: it is released, and the polish ends where it has shrunk.
    for cma in [&mut cma, &mut asked] {
        let mut count = 0;
        while cma.stop().is_none() {
            generations(cma, sphere, 1);
            count += 1;
            assert!(count < 2000);
        }
        assert!(cma.polishing());
        assert_eq!(cma.stop(), Some(StopReason::TolX));
        assert!(spread(cma) < 2e-4);
        assert!(cma.mean_point().iter().all(|x| x.abs() < 2e-4), "{:?}", cma.mean_point());
    }
}

#[test]
fn unusable_settings_are_errors() {
    let new = |mean: &[f64], step: f64, options: CmaOptions| {
        Cma::new(mean, step, options).unwrap_err().to_string()
    };
    let with = |bounds: Vec<(f64, f64)>| CmaOptions { bounds: Some(bounds), ..Default::default() };
    assert!(new(&[f64::NAN], 1.0, CmaOptions::default()).contains("mean = NaN"));
    assert!(new(&[0.0], 0.0, CmaOptions::default()).contains("step size above zero"));
    assert!(new(&[0.0], 1.0, with(vec![(1.0, 0.0)])).contains("variable 0"));
    assert!(new(&[0.0], 1.0, with(vec![(1.0, 1.0)])).contains("nothing to search"));
    assert!(new(&[0.0], 1.0, with(vec![])).contains("0 entries"));
    let one = CmaOptions { population: Some(1), ..CmaOptions::default() };
    assert!(new(&[0.0], 1.0, one).contains("population of 1"));
}
