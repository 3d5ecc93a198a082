use crate::score::Objective;
use crate::search::{Evaluator, SearchError};
use crate::vehicle::{Constraints, Placement};
use sightline_cma::{Cma, CmaOptions};

/// Step size at the start, in shares of each range.
const STEP_SIZE: f64 = 0.3;

/// The placement without each of its LiDARs in turn.
pub fn without_each(placement: &Placement) -> Vec<Placement> {
    (0..placement.lidars.len())
        .map(|lost| {
            let mut lidars = placement.lidars.clone();
            lidars.remove(lost);
            Placement { name: format!("without-{lost}"), lidars }
        })
        .collect()
}

/// The objective that is left when the most valuable LiDAR fails; `None` where it does not exist, or
/// a guard speaks against what is left.
///
/// # Errors
/// From the backend.
pub fn after_worst_loss(
    evaluator: &mut Evaluator,
    objective: &Objective,
    placements: &[Placement],
) -> Result<Vec<Option<f64>>, SearchError> {
    let left: Vec<Placement> = placements.iter().flat_map(without_each).collect();
    let scores = evaluator.scores(&left)?;
    let mut values =
        scores.iter().map(|scores| objective.value(scores).filter(|_| scores.guards.is_empty()));
    let worst = |placement: &Placement| {
        let each: Vec<Option<f64>> = values.by_ref().take(placement.lidars.len()).collect();
        each.into_iter().try_fold(f64::INFINITY, |worst, value| Some(worst.min(value?)))
    };
    Ok(placements.iter().map(worst).collect())
}

/// CMA-ES for the placement that is best after its worst loss, with its objective then.
///
/// # Errors
/// From the strategy or the backend.
pub fn most_robust(
    evaluator: &mut Evaluator,
    objective: &Objective,
    starts: &[Placement],
    evaluations: u64,
    seed: u64,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<(Placement, f64)>, SearchError> {
    let constraints: Constraints = evaluator.constraints().clone();
    let bounds = constraints.variable_bounds();
    let middle: Vec<f64> = bounds.iter().map(|(low, high)| 0.5 * (low + high)).collect();
    let options = CmaOptions { seed, bounds: Some(bounds), ..CmaOptions::default() };
    let mut cma = Cma::new(&middle, STEP_SIZE, options)?;
    let usable = starts.iter().filter(|p| constraints.violations(p).is_empty());
    cma.inject(&usable.filter_map(|p| constraints.variables_of(p)).collect::<Vec<_>>())?;
    let mut best: Option<(Placement, f64)> = None;
    let mut done = 0;
    while done < evaluations && cma.stop().is_none() && go_on() {
        let candidates = cma.ask();
        let placements: Vec<Placement> = candidates
            .iter()
            .map(|c| Placement { name: "robust".into(), lidars: constraints.poses_of(c.point()) })
            .collect();
        let broken =
            |p: &Placement| constraints.violations(p).iter().map(|v| v.amount()).sum::<f64>();
        let broken: Vec<f64> = placements.iter().map(broken).collect();
        let kept: Vec<Placement> = placements
            .iter()
            .zip(&broken)
            .filter(|(_, b)| **b == 0.0)
            .map(|(p, _)| p.clone())
            .collect();
        let mut values = after_worst_loss(evaluator, objective, &kept)?.into_iter();
        // Rules before guards before the objective, as in `Search`.
        let costs: Vec<f64> = broken
            .iter()
            .map(|&broken| {
                if broken != 0.0 {
                    return f64::MAX.min(1e200 * (1.0 + broken));
                }
                values.next().flatten().map_or(1e150, |value| -value)
            })
            .collect();
        for (placement, &cost) in placements.iter().zip(&costs) {
            if cost < 1e150 && best.as_ref().is_none_or(|(_, value)| -cost > *value) {
                best = Some((placement.clone(), -cost));
            }
        }
        cma.tell(&candidates, &costs)?;
        done += candidates.len() as u64;
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::SensorPose;

    #[test]
    fn one_lidar_less_each_time() {
        let pose = |x| SensorPose { x, y: 0.0, z: 2.0, roll: 0.0, pitch: 0.0, yaw: 0.0 };
        let placement = Placement { name: "p".into(), lidars: [1.0, 2.0, 3.0].map(pose).to_vec() };
        let left = without_each(&placement);
        let xs: Vec<Vec<f64>> =
            left.iter().map(|p| p.lidars.iter().map(|l| l.x).collect()).collect();
        assert_eq!(xs, [[2.0, 3.0], [1.0, 3.0], [1.0, 2.0]]);
    }
}
