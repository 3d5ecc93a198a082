//! Settings of a run of [`optimize`](super::optimize), and the grid that it takes unless one is given.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::swaps::SWAP_SPACING;
use super::tolerance::Tolerance;
use crate::engine::EngineChoice;
use crate::score::Objective;
use crate::vehicle::{Constraints, Placement, PoseGrid, PoseGridError, Spacing, table_7};

/// Method of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// CMA-ES, then swaps among poses spread over a grid, and their refinement; the better one wins.
    #[default]
    Both,
    /// CMA-ES alone.
    Cma,
    /// Greedy and swaps over every pose of the grid, and their refinement.
    Swaps,
}

/// Frames over which placements are searched; the result is always confirmed over all frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrameChoice {
    /// The fewest that keep the ranking of placements, and more once they no longer tell the best apart.
    #[default]
    OnDemand,
    /// All.
    All,
    /// This many, spread evenly from the first on.
    Count(u32),
}

/// A limit of wall time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeLimit {
    /// When it began to run.
    pub start: Instant,
    /// Time after which the run ends. Generations end after two fifths of it. With many frames, the frames are chosen
    /// within the first fifth, finalists of the generations are confirmed in the third, and the result in the last.
    /// Scoring the result over few frames comes on top.
    pub length: Duration,
}

/// Time for optional parts of the outcome once the run is to end.
pub(crate) const PATIENCE: Duration = Duration::from_secs(3);

/// Share of a [`TimeLimit`] that the generations may take; the swaps have the rest.
pub(super) const GENERATIONS_SHARE: f64 = 0.4;
/// Share that choosing the frames may take.
pub(super) const FRAMES_SHARE: f64 = 0.2;
/// Share after which no more finalists of the generations are confirmed over many frames.
pub(super) const FINALISTS_SHARE: f64 = 0.6;
/// Share that the whole search may take where the result is confirmed over many frames.
pub(super) const SEARCH_SHARE: f64 = 0.8;

impl TimeLimit {
    /// A limit that begins to run now.
    pub fn from_now(length: Duration) -> Self {
        Self { start: Instant::now(), length }
    }

    /// Time at which the search has to end.
    pub(crate) fn deadline(&self) -> Instant {
        self.start + self.length
    }

    /// Time at which a share of the length is over.
    pub(super) fn after(&self, share: f64) -> Instant {
        self.start + self.length.mul_f64(share)
    }
}

/// Settings of a run: objective, method, budget, frames, and layouts to start from.
///
/// Equal settings give equal results on every engine, unless [`Self::time`] cuts the run short.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Score, or weighted sum of scores, to maximize.
    pub objective: Objective,
    /// Method of the search.
    pub method: Method,
    /// Placements that the generations evaluate. Swaps among some poses of the grid then cast up to twice as many sensor
    /// poses; casts of their refinements, of a pose in a frame, grow with this number, too.
    pub evaluations: u64,
    /// Placements of a generation; `None` leaves it to the CMA-ES.
    pub population: Option<usize>,
    /// Grid to whose poses candidates are moved before they are scored, as in Algorithm 1 of Place3D;
    /// `None` leaves them where they are, and gives the swaps a grid of 0.1 m and 0.1 rad.
    pub delta: Option<Spacing>,
    /// Seed of all randomness.
    pub seed: u64,
    /// Frames over which placements are searched.
    pub frames: FrameChoice,
    /// Layouts to compare with, and to start from where the mount allows them.
    pub baselines: Vec<Placement>,
    /// More layouts to start from where the mount allows them.
    pub starts: Vec<Placement>,
    /// Share of the best placement to which the bound on the gain is to close, whatever work that takes; `None` for as
    /// close as little work gets it.
    #[serde(default)]
    pub gap: Option<f64>,
    /// Objective over all frames at which the search ends.
    pub target: Option<f64>,
    /// Mounting tolerance within which requirements are to hold. Where they do not, LiDARs of the result move a little
    /// until they do. No part of a saved state.
    #[serde(skip)]
    pub tolerance: Option<Tolerance>,
    /// Limit of wall time; no part of a saved state.
    #[serde(skip)]
    pub time: Option<TimeLimit>,
    /// Engine that computes; no part of a saved state, since every engine gives the same bits.
    #[serde(skip, default = "EngineChoice::cpu")]
    pub engine: EngineChoice,
}

impl Settings {
    /// Grid of the swaps, and its spacing: the one given, or the least multiple of 0.1 m and 0.1 rad whose poses can be
    /// numbered.
    pub(super) fn grid(
        &self,
        constraints: &Constraints,
    ) -> Result<(PoseGrid, Spacing), PoseGridError> {
        match self.delta {
            Some(spacing) => Ok((PoseGrid::new(constraints, spacing)?, spacing)),
            None => coarse_grid(constraints, SWAP_SPACING, 1, u64::MAX),
        }
    }

    /// Sensor poses that the first swaps are meant to cast: half as many again as the generations, since swaps gain more
    /// from a cast. The swaps cast a quarter more at most, next to poses of good ends.
    pub(super) fn poses_for_swaps(&self, lidars: usize) -> u64 {
        (self.evaluations.saturating_mul(lidars as u64) / 2).saturating_mul(3)
    }
}

impl Default for Settings {
    /// The near gain, 180 evaluations and their swaps, frames on demand, the layouts of Table 7
    /// as baselines, on the CPU.
    fn default() -> Self {
        Self {
            objective: Objective::default(),
            method: Method::default(),
            evaluations: 180,
            population: None,
            delta: None,
            seed: 1,
            frames: FrameChoice::default(),
            baselines: table_7(),
            starts: Vec::new(),
            gap: None,
            target: None,
            tolerance: None,
            time: None,
            engine: EngineChoice::cpu(),
        }
    }
}

/// Poses of a grid that needs no widening.
const FEW_POSES: u64 = 100;
/// Largest multiple of a spacing: beyond it no mount has two poses along a field.
const MOST_TIMES: u32 = 1000;

/// The finest grid of at most `most` poses, or of a few where `most` is less, whose spacing is a multiple of the given
/// one, `least` times or more; and that spacing. All its poses are on the grid of the given spacing.
pub(crate) fn coarse_grid(
    constraints: &Constraints,
    spacing: Spacing,
    least: u32,
    most: u64,
) -> Result<(PoseGrid, Spacing), PoseGridError> {
    let mut times = least;
    loop {
        let Spacing { metres, radians } = spacing;
        let (metres, radians) = (metres * f64::from(times), radians * f64::from(times));
        let wider = Spacing { metres, radians };
        match PoseGrid::new(constraints, wider) {
            Ok(grid) if u64::from(grid.len()) <= most.max(FEW_POSES) => return Ok((grid, wider)),
            Ok(_) | Err(PoseGridError::TooManyPoses { .. }) if times < MOST_TIMES => times += 1,
            made => return Ok((made?, wider)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    #[test]
    fn a_grid_without_a_given_spacing_is_the_finest_whose_poses_can_be_numbered() {
        // 6 by 2 by 2.5 m in all attitudes: 61 · 21 · 26 · 63 · 32 · 63 poses, more than 2³¹.
        let turn = [PI - 1e-3, FRAC_PI_2 - 1e-3, PI - 1e-3];
        let [roll, pitch, yaw] = turn;
        let free = |x: f64| {
            let (low, high) =
                ([-x, -1.0, 1.0, -roll, -pitch, -yaw], [x, 1.0, 3.5, roll, pitch, yaw]);
            Constraints::in_box(low, high, 2)
        };
        let settings = Settings::default();
        let (grid, spacing) = settings.grid(&free(3.0)).unwrap();
        assert_eq!(spacing, Spacing { metres: 0.2, radians: 0.2 });
        assert_eq!(grid.len(), 31 * 11 * 13 * 32 * 16 * 32);
        // A narrower mount keeps the spacing, and a given spacing is never widened.
        let (_, spacing) = settings.grid(&free(1.0)).unwrap();
        assert_eq!(spacing, Spacing { metres: 0.1, radians: 0.1 });
        let given = Settings { delta: Some(spacing), ..settings };
        let told = given.grid(&free(3.0)).unwrap_err().to_string();
        assert!(told.contains("widen --delta"), "{told}");
    }
}
