//! Chart of a search: best and median objective against evaluations.

use super::plot::{Change, ReferenceLine};
use super::{Axis, Plot, Series};
use crate::search::GenerationRecord;
use crate::search::Scored;

/// The best and the median objective against evaluations. Baselines and result are lines across, since swaps may find
/// the result after the generations. An upright line marks each change of frames in `steps`, (generation, frames), the
/// start first.
pub fn convergence_svg(
    history: &[GenerationRecord],
    objective: &str,
    baselines: &[Scored],
    best: Option<&Scored>,
    steps: &[(u64, u32)],
) -> String {
    let points = |value: fn(&GenerationRecord) -> Option<f64>| -> Vec<(f64, f64)> {
        history.iter().filter_map(|r| Some((r.evaluations as f64, value(r)?))).collect()
    };
    let series = |name: &str, points| Series {
        name: name.to_owned(),
        points,
        line: true,
        labels: Vec::new(),
    };
    let level = |scored: &'_ Scored, name, accent| {
        Some(ReferenceLine { name, value: scored.objective?, accent })
    };
    let mut levels: Vec<ReferenceLine> =
        baselines.iter().filter_map(|b| level(b, b.placement.name.as_str(), false)).collect();
    levels.extend(best.and_then(|best| level(best, "the result", true)));
    let plot = Plot {
        title: "Convergence of the search".to_owned(),
        x_title: "placements evaluated".to_owned(),
        y_title: format!("{objective} (larger is better)"),
        x: Axis::Numbers,
        series: vec![
            series("best so far", points(|r| r.best_so_far)),
            series("median of a generation", points(|r| r.median)),
        ],
    };
    let change = |&(generation, frames): &(u64, u32)| {
        let last = history.iter().rfind(|record| record.generation <= generation)?;
        Some(Change { at: last.evaluations as f64, name: format!("{frames} frames") })
    };
    let steps = steps_of_generations(steps, history.len() as u64);
    let changes: Vec<Change> = steps.iter().skip(1).filter_map(change).collect();
    plot.svg_with(&levels, &changes)
}

/// Steps that the generations follow; a last step for the swaps alone is left out.
pub(super) fn steps_of_generations(steps: &[(u64, u32)], generations: u64) -> Vec<(u64, u32)> {
    steps.iter().copied().filter(|(generation, _)| *generation < generations).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stands_where_the_frames_change_and_a_curve_goes_on() {
        let record = |generation: u64| GenerationRecord {
            generation,
            evaluations: 10 * generation,
            best: Some(1.0),
            median: Some(0.5),
            best_so_far: Some(1.0 + generation as f64),
            infeasible: 0,
            guarded: 0,
            step_size: 0.3,
        };
        let history: Vec<GenerationRecord> = (1..=4).map(record).collect();
        let svg = convergence_svg(&history, "near_gain", &[], None, &[(0, 1), (2, 6), (4, 24)]);
        assert!(svg.contains(">6 frames<") && !svg.contains(">24 frames<"), "{svg}");
        // 20 evaluations of 10 to 40, with 6 % of margin: a third of the way.
        let x = 90.0 + 560.0 * (0.06 + 1.0 / 3.0) / 1.12;
        assert!(svg.contains(&format!("d=\"M{x:.1} 50V350\"")), "{x} {svg}");
        assert!(!convergence_svg(&history, "near_gain", &[], None, &[]).contains(" frames<"));
    }
}
