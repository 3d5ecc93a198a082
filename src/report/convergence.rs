//! Chart of a search: best and median objective against evaluations.

use super::plot::Level;
use super::{Axis, Plot, Series};
use crate::search::GenerationRecord;
use crate::search::Scored;

/// The best and the median objective against evaluations; the baselines and the result, which swaps may
/// have found after the generations, as lines across.
pub fn convergence_svg(
    history: &[GenerationRecord],
    objective: &str,
    baselines: &[Scored],
    best: Option<&Scored>,
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
    let level =
        |scored: &'_ Scored, name, accent| Some(Level { name, value: scored.objective?, accent });
    let mut levels: Vec<Level> =
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
    plot.svg_with(&levels)
}
