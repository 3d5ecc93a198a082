//! Scores and margins of a row's placement without each of its LiDARs, also as columns of CSV.

use serde::{Deserialize, Serialize};

use super::Row;
use super::table::SCORES;
use crate::csv::number;
use crate::json::distinct;
use crate::score::{Scores, Seen};

/// A placement without one of its LiDARs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AfterLoss {
    /// Number of the LiDAR that is lost, from 0.
    pub lidar: usize,
    /// Its number, and its mount where the vehicle names some: `LiDAR 2 (roof)`.
    pub name: String,
    /// Information gain of the others as a share of all information.
    pub information_gain_share: Option<f64>,
    /// Near gain of the others, from 0 to 1.
    pub near_gain: Option<f64>,
    /// M-SOG of the others, a voxel.
    pub m_sog_scaled: Option<f64>,
    /// M-SOG of the others for the detection target, a voxel.
    pub detection_m_sog_scaled: Option<f64>,
    /// Voxels that the others cover, a mean over frames.
    pub covered: f64,
    /// Every requirement of the vehicle, in its order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub requirements: Vec<Margin>,
}

/// A requirement, and how far it is from failing.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Margin {
    /// Name of the requirement, with the words that its row of `score` has.
    pub name: String,
    /// Share that is required.
    pub required: f64,
    /// Share that is found.
    pub found: f64,
    /// Percentage points by which more is found than required; below 0 where the requirement is not met.
    pub margin_points: f64,
    /// True if enough is found.
    pub met: bool,
}

impl Margin {
    /// A requirement that must hold without any one LiDAR counts with the LiDARs there are: one is lost already.
    fn of(seen: &Seen) -> Self {
        let found = seen.lost.as_ref().map_or(seen.share, |lost| lost.intact);
        Self {
            name: seen.title(),
            required: seen.least,
            found,
            margin_points: 100.0 * (found - seen.least),
            met: found >= seen.least,
        }
    }
}

impl AfterLoss {
    /// Scores of a placement without a LiDAR, which has a name.
    pub(super) fn new(lidar: usize, name: String, scores: &Scores) -> Self {
        Self {
            lidar,
            name,
            information_gain_share: scores.segmentation.information_gain_share,
            near_gain: scores.near_gain,
            m_sog_scaled: scores.segmentation.m_sog_scaled,
            detection_m_sog_scaled: scores.detection.and_then(|of| of.m_sog_scaled),
            covered: scores.covered,
            requirements: scores.required.iter().map(Margin::of).collect(),
        }
    }

    /// Titles and cells in CSV: scores in the units of a study, then margins in percentage points.
    fn cells(&self) -> impl Iterator<Item = (String, String)> {
        let scale = |value: Option<f64>, factor: f64| value.map(|value| factor * value);
        let scores = [
            scale(self.information_gain_share, 100.0),
            scale(self.near_gain, 100.0),
            scale(self.m_sog_scaled, 1e6),
            scale(self.detection_m_sog_scaled, 1e6),
            Some(self.covered),
        ];
        let scores = SCORES.into_iter().map(str::to_owned).zip(scores);
        let margins = self.requirements.iter().map(|of| {
            let title = format!("{} margin points", of.name);
            (title, Some(of.margin_points))
        });
        let lost = format!("LiDAR {} lost: ", self.lidar);
        scores.chain(margins).map(move |(title, value)| (lost.clone() + &title, number(value)))
    }
}

/// Titles of the columns of all losses in some rows, each once; none where no LiDAR was lost.
pub(crate) fn titles_of_losses<'r>(rows: impl IntoIterator<Item = &'r Row>) -> Vec<String> {
    let rows: Vec<&Row> = rows.into_iter().collect();
    let lidars = rows.iter().map(|row| row.after_loss.len()).max().unwrap_or(0);
    let of = |lidar: usize| rows.iter().filter_map(move |row| row.after_loss.get(lidar));
    let titles: Vec<String> = (0..lidars)
        .flat_map(|lidar| of(lidar).flat_map(AfterLoss::cells).map(|(title, _)| title))
        .collect();
    distinct(titles.iter()).into_iter().cloned().collect()
}

/// Cells of a row below [`titles_of_losses`]; empty where its placement has no such LiDAR.
pub(crate) fn cells_of_losses(row: &Row, titles: &[String]) -> Vec<String> {
    let cells: Vec<(String, String)> = row.after_loss.iter().flat_map(AfterLoss::cells).collect();
    let cell = |title: &String| cells.iter().find(|(of, _)| of == title);
    titles
        .iter()
        .map(|title| cell(title).map_or_else(String::new, |(_, cell)| cell.clone()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Lost;

    #[test]
    fn the_margin_of_a_requirement_allows_for_no_second_loss() {
        let lost = Some(Lost { intact: 0.95, ..Lost::default() });
        let required = vec![Seen::of("near", 0.5), Seen { lost, ..Seen::of("any", 0.25) }];
        let scores = Scores { near_gain: Some(0.25), covered: 8.0, required, ..Scores::default() };
        let found = AfterLoss::new(1, "LiDAR 1 (roof)".to_owned(), &scores);
        let margins: Vec<(f64, bool)> =
            found.requirements.iter().map(|of| (of.margin_points.round(), of.met)).collect();
        assert_eq!(margins, [(-40.0, false), (5.0, true)]);
        let known: AfterLoss =
            serde_json::from_value(serde_json::to_value(&found).unwrap()).unwrap();
        assert_eq!(known, found);
    }

    #[test]
    fn rows_with_fewer_lidars_have_empty_cells() {
        let lost = |lidar: usize, near_gain: f64| AfterLoss {
            lidar,
            near_gain: Some(near_gain),
            ..AfterLoss::default()
        };
        let row = |gains: &[f64]| Row {
            after_loss: gains.iter().enumerate().map(|(k, gain)| lost(k, *gain)).collect(),
            ..Row::default()
        };
        let rows = [row(&[0.25]), row(&[0.5, 0.75])];
        let titles = titles_of_losses(&rows);
        assert_eq!(titles.len(), 10, "{titles:?}");
        assert_eq!(
            [&*titles[1], &*titles[6]],
            ["LiDAR 0 lost: near gain %", "LiDAR 1 lost: near gain %"]
        );
        let cells = |row: &Row| {
            let cells = cells_of_losses(row, &titles);
            [cells[1].clone(), cells[6].clone()]
        };
        assert_eq!([cells(&rows[0]), cells(&rows[1])], [["25", ""], ["50", "75"]]);
        assert!(titles_of_losses(&[Row::default()]).is_empty());
    }
}
