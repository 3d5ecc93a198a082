//! Time of ask and tell.

use std::time::{Duration, Instant};

use sightline_cma::{Cma, CmaError, CmaOptions};

/// Generations measured.
const GENERATIONS: usize = 200;
/// Generations before, to fill caches.
const WARM_UP: usize = 20;

/// Prints the median times of one ask and one tell, with bounds.
pub(crate) fn print() -> Result<(), CmaError> {
    println!("{:>3} {:>6} {:>9} {:>9} {:>9}", "n", "lambda", "ask ms", "tell ms", "sum ms");
    for (n, population) in [(16, 1000), (48, 1000), (16, 12), (48, 15)] {
        let options = CmaOptions {
            population: Some(population),
            bounds: Some(vec![(-5.0, 5.0); n]),
            ..CmaOptions::default()
        };
        let mut cma = Cma::new(&vec![2.0; n], 0.2, options)?;
        let mut times = Vec::new();
        for _ in 0..WARM_UP + GENERATIONS {
            let start = Instant::now();
            let candidates = cma.ask();
            let ask = start.elapsed();
            let cost = |x: &[f64]| -> f64 {
                x.iter().enumerate().map(|(i, x)| (i + 1) as f64 * x * x).sum()
            };
            let costs: Vec<f64> = candidates.iter().map(|c| cost(c.point())).collect();
            let start = Instant::now();
            cma.tell(&candidates, &costs)?;
            times.push((ask, start.elapsed()));
        }
        let median = |of: fn(&(Duration, Duration)) -> Duration| {
            let mut of: Vec<f64> =
                times[WARM_UP..].iter().map(|t| of(t).as_secs_f64() * 1e3).collect();
            of.sort_by(f64::total_cmp);
            of[of.len() / 2]
        };
        println!(
            "{n:>3} {population:>6} {:>9.3} {:>9.3} {:>9.3}",
            median(|t| t.0),
            median(|t| t.1),
            median(|t| t.0 + t.1)
        );
    }
    Ok(())
}
