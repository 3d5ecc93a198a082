//! Columns of scores, the same in the terminal, on the page and in the audit.

use super::{RunRecord, SceneRecord};
use crate::csv::number;
use crate::json::fixed;
use crate::score::{NEAR_GAINS, Scores};
use crate::search::Scored;

/// A score as it is shown to people: title and cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ScoreColumn {
    /// Name of the placement.
    Name,
    /// M-SOG, literal eq. 5.
    MSog,
    /// M-SOG/N in millionths, as the paper prints it.
    MSogScaled,
    /// M-SOG/N of the detection task, in millionths.
    Detection,
    /// Information gain in nats.
    Gain,
    /// Information gain in per cent of the information that the scene holds.
    GainShare,
    /// Share of the information gained where near voxels weigh more, in per cent.
    NearGain,
    /// Near gain where a voxel counts for up to two LiDARs that cover it, in per cent.
    NearGain2,
    /// Near gain where a voxel counts for up to three LiDARs, in per cent.
    NearGain3,
    /// Ground within 10 m of the body that is seen, in per cent.
    NearField,
    /// S-MIG in nats.
    SMig,
    /// Covered voxels.
    Covered,
    /// Beams that hit a surface, in per cent.
    Hits,
}

impl ScoreColumn {
    /// Every column, the name first.
    pub const ALL: [Self; 13] = [
        Self::Name,
        Self::Gain,
        Self::GainShare,
        Self::NearGain,
        Self::NearGain2,
        Self::NearGain3,
        Self::NearField,
        Self::MSog,
        Self::MSogScaled,
        Self::Detection,
        Self::SMig,
        Self::Covered,
        Self::Hits,
    ];
    /// The columns that an objective can name.
    pub const METRICS: [Self; 6] =
        [Self::Gain, Self::NearGain, Self::MSog, Self::MSogScaled, Self::Detection, Self::SMig];

    /// Columns to show of some scores: all, the near field only where it was looked for, and near gains of several LiDARs
    /// only where an objective names them.
    pub fn shown<'a>(all: impl IntoIterator<Item = &'a Scores>, objective: &str) -> Vec<Self> {
        let looked = all.into_iter().any(|scores| scores.near_field.is_some());
        let is_shown = |column: &Self| match column {
            Self::NearField => looked,
            Self::NearGain2 => objective.contains(NEAR_GAINS[1]),
            Self::NearGain3 => objective.contains(NEAR_GAINS[2]),
            _ => true,
        };
        Self::ALL.into_iter().filter(is_shown).collect()
    }

    /// Share that results are compared by where an objective was maximized: each near gain for itself, else the gain.
    pub fn argued(objective: &str) -> Self {
        let of = [Self::NearGain, Self::NearGain2, Self::NearGain3];
        let named = NEAR_GAINS.iter().position(|name| *name == objective);
        named.map_or(Self::GainShare, |named| of[named])
    }

    /// A near gain or the information gain as a share, for [`Self::argued`].
    pub fn share(self, scores: &Scores) -> Option<f64> {
        match self {
            Self::NearGain => scores.near_gain,
            Self::NearGain2 => scores.near_gain_2,
            Self::NearGain3 => scores.near_gain_3,
            _ => scores.segmentation.information_gain_share,
        }
    }

    /// Title with its unit.
    pub fn title(self) -> &'static str {
        match self {
            Self::Name => "placement",
            Self::MSog => "M-SOG",
            Self::MSogScaled => "M-SOG/N ×1e-6",
            Self::Detection => "det ×1e-6",
            Self::Gain => "gain nats",
            Self::GainShare => "gain %",
            Self::NearGain => "near gain %",
            Self::NearGain2 => "near gain ×2 %",
            Self::NearGain3 => "near gain ×3 %",
            Self::NearField => "near field %",
            Self::SMig => "S-MIG",
            Self::Covered => "covered",
            Self::Hits => "hits %",
        }
    }

    /// Title in CSV, its unit last.
    pub fn key(self) -> &'static str {
        match self {
            Self::Name => "placement",
            Self::MSog => "m_sog",
            Self::MSogScaled => "m_sog_scaled",
            Self::Detection => "detection_m_sog_scaled",
            Self::Gain => "information_gain_nats",
            Self::GainShare => "information_gain_share",
            Self::NearGain => "near_gain_share",
            Self::NearGain2 => "near_gain_2_share",
            Self::NearGain3 => "near_gain_3_share",
            Self::NearField => "near_field_share",
            Self::SMig => "s_mig_nats",
            Self::Covered => "covered_voxels",
            Self::Hits => "hit_share",
        }
    }

    /// The cell of a placement in CSV: full precision, no percent; empty where the score does not exist.
    pub fn plain_cell(self, scores: &Scores) -> String {
        let task = &scores.segmentation;
        number(match self {
            Self::Name => return scores.name.clone(),
            Self::MSog => task.m_sog,
            Self::MSogScaled => task.m_sog_scaled,
            Self::Detection => scores.detection.and_then(|detection| detection.m_sog_scaled),
            Self::Gain => task.information_gain,
            Self::GainShare | Self::NearGain | Self::NearGain2 | Self::NearGain3 => {
                self.share(scores)
            }
            Self::NearField => scores.near_field,
            Self::SMig => scores.s_mig,
            Self::Covered => Some(scores.covered),
            Self::Hits => scores.hit_share,
        })
    }

    /// The cell of a placement; – where the score does not exist.
    pub fn cell(self, scores: &Scores) -> String {
        let task = &scores.segmentation;
        let scaled = |value: Option<f64>, factor: f64| value.map(|v| v * factor);
        match self {
            Self::Name => scores.name.clone(),
            Self::MSog => optional(task.m_sog, 4),
            Self::MSogScaled => optional(scaled(task.m_sog_scaled, 1e6), 3),
            Self::Detection => {
                optional(scaled(scores.detection.and_then(|d| d.m_sog_scaled), 1e6), 3)
            }
            Self::Gain => optional(task.information_gain, 0),
            Self::GainShare | Self::NearGain | Self::NearGain2 | Self::NearGain3 => {
                optional(scaled(self.share(scores), 100.0), 2)
            }
            Self::NearField => optional(scaled(scores.near_field, 100.0), 1),
            Self::SMig => optional(scores.s_mig, 0),
            Self::Covered => format!("{:.0}", scores.covered),
            Self::Hits => optional(scaled(scores.hit_share, 100.0), 1),
        }
    }
}

/// A number, or – where there is none.
pub fn optional(value: Option<f64>, decimals: usize) -> String {
    value.map_or("–".into(), |v| fixed(v, decimals))
}

/// A row of titles, then a row a placement: its name, its gain, or near gain where that was maximized, in per cent over
/// all scenes and in each; `None` where there is one scene.
pub fn by_scene(run: &RunRecord) -> Option<Vec<Vec<String>>> {
    let column = ScoreColumn::argued(&run.objective);
    rows_by_scene(&run.scenes, run.best.as_ref(), &run.baselines, column)
}

/// Like [`by_scene`], of scenes, a result and baselines, by a share.
pub fn rows_by_scene(
    scenes: &[SceneRecord],
    best: Option<&Scored>,
    baselines: &[Scored],
    column: ScoreColumn,
) -> Option<Vec<Vec<String>>> {
    if scenes.is_empty() {
        return None;
    }
    let names = scenes.iter().map(|scene| scene.name.clone());
    let titles = [column.title(), "all"].map(str::to_owned).into_iter().chain(names);
    let row = |scored: &Scored| {
        let each = scored.by_scene.iter().map(|scene| &scene.scores);
        let cells = std::iter::once(&scored.scores).chain(each);
        let cells = cells.map(|scores| column.cell(scores));
        std::iter::once(scored.placement.name.clone()).chain(cells).collect()
    };
    let rows = best.into_iter().chain(baselines).map(row);
    Some(std::iter::once(titles.collect()).chain(rows).collect())
}
