//! Restarts: populations, saving.

use super::*;

fn rastrigin(x: &[f64]) -> f64 {
    x.iter().map(|x| 10.0 + x * x - 10.0 * (std::f64::consts::TAU * x).cos()).sum()
}

fn search(strategy: RestartStrategy, budget: u64) -> Restarts {
    let bounds = Some(vec![(-5.0, 5.0); 3]);
    let options = CmaOptions { bounds, seed: 7, budget: Some(budget), ..CmaOptions::default() };
    let restarts = RestartOptions { strategy, region: None };
    Restarts::new(&[4.0, -3.0, 2.0], 0.1, options, restarts).unwrap()
}

/// Largest batch asked.
fn run(search: &mut Restarts, generations: usize) -> usize {
    let mut largest = 0;
    for _ in 0..generations {
        if search.stop().is_some() {
            break;
        }
        let candidates = search.ask();
        assert!(candidates.iter().all(|c| c.point().iter().all(|x| (-5.0..=5.0).contains(x))));
        largest = largest.max(candidates.len());
        let costs: Vec<f64> = candidates.iter().map(|c| rastrigin(c.point())).collect();
        search.tell(&candidates, &costs).unwrap();
    }
    largest
}

#[test]
fn the_first_instance_is_the_plain_search() {
    let mut whole = search(RestartStrategy::Bipop, 100_000);
    let options =
        CmaOptions { bounds: Some(vec![(-5.0, 5.0); 3]), seed: 7, ..CmaOptions::default() };
    let mut plain = Cma::new(&[4.0, -3.0, 2.0], 0.1, options).unwrap();
    for _ in 0..30 {
        let candidates = plain.ask();
        assert_eq!(candidates, whole.ask());
        let costs: Vec<f64> = candidates.iter().map(|c| rastrigin(c.point())).collect();
        plain.tell(&candidates, &costs).unwrap();
        whole.tell(&candidates, &costs).unwrap();
    }
}

#[test]
fn ipop_doubles_and_bipop_shares_the_evaluations() {
    let mut ipop = search(RestartStrategy::Ipop, 30_000);
    run(&mut ipop, usize::MAX);
    assert_eq!(ipop.stop(), Some(StopReason::Budget));
    assert!(ipop.ended().len() >= 3);
    for (k, ended) in ipop.ended().iter().enumerate() {
        assert_eq!(ended.population, 7 << k);
    }
    let mut bipop = search(RestartStrategy::Bipop, 60_000);
    run(&mut bipop, usize::MAX);
    let (mut large, mut small, mut next) = (0, 0, 7);
    for ended in bipop.ended() {
        if ended.population == next {
            large += ended.evaluations;
            next *= 2;
        } else {
            assert!(ended.population < next && ended.population >= 4);
            small += ended.evaluations;
        }
    }
    assert!(next > 14 && small > 0 && small < 2 * large, "{small} {large}");
}

#[test]
fn a_saved_search_with_restarts_goes_on_to_the_same_bits() {
    let mut whole = search(RestartStrategy::Bipop, 1_000_000);
    run(&mut whole, 97);
    let text = serde_json::to_string(&whole).unwrap();
    let mut loaded: Restarts = serde_json::from_str(&text).unwrap();
    run(&mut whole, 300);
    run(&mut loaded, 300);
    assert!(whole.ended().len() > 1);
    assert_eq!(serde_json::to_string(&whole).unwrap(), serde_json::to_string(&loaded).unwrap());
}

#[test]
fn a_target_ends_it_and_meaningless_costs_do_not() {
    let options = CmaOptions { target: Some(0.5), ..CmaOptions::default() };
    let mut search = Restarts::new(&[3.0; 2], 1.0, options, RestartOptions::default()).unwrap();
    for _ in 0..400 {
        let candidates = search.ask();
        search.tell(&candidates, &vec![f64::NAN; candidates.len()]).unwrap();
    }
    assert_eq!(search.stop(), None);
    let candidates = search.ask();
    search.tell(&candidates, &vec![0.5; candidates.len()]).unwrap();
    assert_eq!(search.stop(), Some(StopReason::Target));
    let region = Some(vec![(0.0, 1.0)]);
    let error = Restarts::new(
        &[3.0; 2],
        1.0,
        CmaOptions::default(),
        RestartOptions { region, ..RestartOptions::default() },
    );
    assert!(error.unwrap_err().to_string().contains("the region of restarts has 1 entries"));
}
