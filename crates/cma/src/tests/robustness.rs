//! Costs, sizes and boxes that are no good: a stated result, no panic, no hang.

use super::*;

/// Runs until a stop or `most` generations; every candidate has to be finite and in the box.
fn run(cma: &mut Cma, most: usize, cost: impl Fn(&[f64]) -> f64) -> Option<StopReason> {
    for _ in 0..most {
        assert!(told(cma, &cost).iter().flatten().all(|x| x.is_finite()));
        if let Some(reason) = cma.stop() {
            return Some(reason);
        }
    }
    None
}

#[test]
fn one_variable_and_the_smallest_and_largest_populations_converge() {
    for (n, population) in [(1, 4), (1, 10_000), (2, 2), (3, 10_000)] {
        let options = CmaOptions {
            population: Some(population),
            bounds: Some(vec![(-5.0, 5.0); n]),
            ..CmaOptions::default()
        };
        let mut cma = Cma::new(&vec![2.0; n], 0.3, options).unwrap();
        let most = if population > 1000 { 60 } else { 1000 };
        run(&mut cma, most, |x| sphere(x) - 7.0);
        assert!(cma.mean_point().iter().all(|x| x.abs() < 0.1), "{n} {population}");
    }
}

#[test]
fn a_range_of_no_width_holds_its_variable() {
    let bounds = Some(vec![(1.5, 1.5), (-5.0, 5.0), (-2.0, -2.0)]);
    let options = CmaOptions { bounds, ..CmaOptions::default() };
    let mut cma = Cma::new(&[0.0, 3.0, 0.0], 0.3, options).unwrap();
    cma.inject(&[vec![9.0, 9.0, 9.0]]).unwrap();
    for _ in 0..80 {
        let points = told(&mut cma, sphere);
        assert!(points.iter().all(|point| point[0] == 1.5 && point[2] == -2.0));
    }
    assert!(cma.mean_point()[1].abs() < 1e-3);
}

#[test]
fn an_ill_conditioned_problem_stops_by_name() {
    let mut cma = Cma::new(&[1.0; 4], 1.0, CmaOptions { seed: 1, ..Default::default() }).unwrap();
    let ridge = |x: &[f64]| x.iter().zip([1.0, 1e6, 1e12, 1e18]).map(|(x, s)| s * x * x).sum();
    let reason = run(&mut cma, 20_000, ridge);
    assert_eq!(reason, Some(StopReason::Condition));
    // It still can be asked.
    assert_eq!(cma.ask().len(), 8);
}

#[test]
fn constant_and_meaningless_costs_never_stop_a_search_nor_throw_it_out() {
    for cost in [1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let options = CmaOptions { bounds: Some(vec![(0.0, 1.0); 2]), ..CmaOptions::default() };
        let mut cma = Cma::new(&[0.5; 2], 0.1, options).unwrap();
        assert_eq!(run(&mut cma, 2000, |_| cost), None, "{cost}");
        assert!(cma.step_size() > 0.1 && cma.step_size() <= 1e5 * (1.0 + 1e-9));
        let text = serde_json::to_string(&cma).unwrap();
        assert_eq!(serde_json::from_str::<Cma>(&text).unwrap().ask(), cma.ask());
    }
}

#[test]
fn a_covariance_that_is_no_matrix_stops_by_name() {
    let cma = boxed(1, 3);
    let mut state = serde_json::to_value(&cma).unwrap();
    // No eigenvalue is positive.
    for k in 0..9 {
        state["state"]["cov"][0][k] = Value::from(if k % 4 == 0 { -1.0 } else { 0.0 });
    }
    let mut cma: Cma = serde_json::from_value(state).unwrap();
    for _ in 0..3 {
        told(&mut cma, |_| 1.0);
    }
    assert_eq!(cma.stop(), Some(StopReason::Decomposition));
}

#[test]
fn target_and_budget_stop_by_name() {
    let stop = |target, budget| {
        let options = CmaOptions { target, budget, ..CmaOptions::default() };
        let mut cma = Cma::new(&[2.0; 3], 1.0, options).unwrap();
        (run(&mut cma, 5000, sphere), cma.evaluations())
    };
    assert_eq!(stop(Some(1e-3), None).0, Some(StopReason::Target));
    assert_eq!(stop(None, Some(50)), (Some(StopReason::Budget), 56));
    let reason = stop(None, None).0.unwrap();
    assert_eq!(reason.to_string(), "tolfun: the costs agree within the tolerance");
}

#[test]
fn an_optimum_on_a_face_is_evaluated_exactly() {
    let bounds = Some(vec![(0.1, 0.3), (-5.0, 0.7), (-3.0, 20.0)]);
    let options = CmaOptions { bounds, seed: 2, ..CmaOptions::default() };
    let mut cma = Cma::new(&[0.2, -2.0, 5.0], 0.3, options).unwrap();
    let mut exact = false;
    for _ in 0..200 {
        let points = told(&mut cma, |x| -x[0] - x[1] + (x[2] - 4.0).powi(2));
        exact |= points.iter().any(|point| point[0] == 0.3 && point[1] == 0.7);
    }
    assert!(exact);
}
