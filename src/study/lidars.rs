//! Number of LiDARs: the best placement of each number, and the gain of each one more.

use super::cases::Cases;
use super::columns::{self, SCORES, made_large};
use super::scene::StudyScene;
use super::{Drawing, StudyError, Table};
use crate::vehicle::Placement;

/// Numbers of LiDARs that are compared.
const LIDARS: std::ops::RangeInclusive<usize> = 1..=8;
/// Columns of [`SCORES`] that grow with every LiDAR: the gain and the near gain.
const GAINS: [usize; 2] = [0, 1];

pub(super) fn lidars(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let counts = LIDARS.map(|count| (count.to_string(), count)).collect();
    let mut rows = cases.each(counts, |count, rows| {
        let constraints = scene.constraints().with_lidars(count);
        let mut evaluator = scene.evaluator_under(&constraints)?;
        // The best of one LiDAR less, with one more at each corner of the mount in turn.
        let mut starts = scene.published.clone();
        let before = rows.last().and_then(|row| row.placement.as_ref());
        starts.extend(before.iter().flat_map(|before| with_one_more(scene, before)));
        let objective = &scene.settings.objective;
        let best = scene.optimize_from(&evaluator, objective, &starts)?;
        let Some(best) = best else { return Ok((Vec::new(), None)) };
        let values = columns::values(&scene.score(&mut evaluator, &best)?);
        Ok((values, Some(best)))
    })?;
    // Each gain gets a column of its increments beside it; the knee is taken of the gain that the searches maximize.
    let gains = GAINS.map(|gain| columns::numbers(&rows, gain));
    for (k, row) in rows.iter_mut().enumerate() {
        row.values.resize(SCORES.len(), None);
        for (gain, gains) in GAINS.into_iter().zip(&gains).rev() {
            let before = if k == 0 { 0.0 } else { gains[k - 1] };
            row.values.insert(gain + 1, Some(gains[k] - before).filter(|more| !more.is_nan()));
        }
    }
    let marginal = ["marginal gain %", "marginal near gain %"];
    let of_gains = GAINS.into_iter().zip(marginal).flat_map(|(gain, more)| [SCORES[gain], more]);
    let columns = ["LiDARs"].into_iter().chain(of_gains).chain(SCORES[GAINS.len()..].to_vec());
    let drawn = usize::from(made_large(&scene.settings.objective) == GAINS[1]);
    let drawing = Drawing::of_column(2 * drawn, SCORES[drawn], true);
    let title = scene.title("the best placement of each number of LiDARs");
    let known: Vec<f64> = gains[drawn].iter().copied().take_while(|gain| !gain.is_nan()).collect();
    Ok(Table::new(title, columns, rows, notes(scene, SCORES[drawn], &known), drawing))
}

fn notes(scene: &StudyScene, drawn: &str, gains: &[f64]) -> Vec<String> {
    let mut notes = vec![format!(
        "Each number has its own search of {} evaluations for `{}`; where a value falls, raise --evaluations.",
        scene.settings.evaluations, scene.settings.objective
    )];
    let from_none: Vec<f64> = std::iter::once(0.0).chain(gains.iter().copied()).collect();
    if let Some(knee) = knee(&from_none) {
        notes.push(format!(
            "The {} bends most at {knee} LiDAR(s): up to there each adds more than the average of all {}.",
            drawn.trim_end_matches(" %"),
            gains.len()
        ));
    }
    notes
}

/// A placement with one more LiDAR at each corner of the mount's box.
fn with_one_more(scene: &StudyScene, before: &Placement) -> Vec<Placement> {
    let [low, high] = scene.constraints().corners();
    let corners = (0..8).map(|corner| {
        let mut pose = before.lidars[0];
        let side = |k: usize| if corner >> k & 1 == 1 { high[k] } else { low[k] };
        (pose.x, pose.y, pose.z) = (side(0), side(1), side(2));
        let lidars = before.lidars.iter().copied().chain([pose]).collect();
        Placement { name: format!("corner-{corner}"), lidars }
    });
    corners.collect()
}

/// Index at which a curve of falling gains bends most: the point farthest above the line from the first to the last,
/// after both axes are scaled to [0, 1]. `None` with fewer than three points or without rise.
fn knee(values: &[f64]) -> Option<usize> {
    let (first, last) = (*values.first()?, *values.last()?);
    if values.len() < 3 || last <= first {
        return None;
    }
    let steps = (values.len() - 1) as f64;
    let above = |k: usize| (values[k] - first) / (last - first) - k as f64 / steps;
    (1..values.len() - 1).max_by(|&a, &b| above(a).total_cmp(&above(b))).filter(|&k| above(k) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_knee_is_where_the_curve_bends() {
        assert_eq!(knee(&[0.0, 8.0, 9.0, 9.5, 10.0]), Some(1));
        assert_eq!(knee(&[0.0, 1.0, 2.0]), None, "a line has no knee");
        assert_eq!(knee(&[3.0, 2.0, 1.0]), None);
    }
}
