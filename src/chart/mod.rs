//! Fidelity of a scene's model: settings from fine to coarse, their cost, and the distance of their scores and rankings
//! from those of the finest one in `f64`.
//!
//! | file | holds |
//! |---|---|
//! | `run` | the chart: every setting measured in turn; settings, state, observer |
//! | `setting` | a setting, and the settings that a scene allows |
//! | `world` | the problem that a scene poses at a setting; triangles merged below a size |
//! | `exact` | the finest setting: casting, coverage and sums in `f64` |
//! | `ranking` | score error, Kendall's τ, top-1 regret, bootstrap intervals |
//! | `measure` | cost and scores of one setting |
//! | `early` | settings that are left early or not begun |

pub(crate) mod early;
mod exact;
pub(crate) mod measure;
pub(crate) mod ranking;
mod run;
pub(crate) mod setting;
pub(crate) mod world;

use world::ChartWorld;

pub use early::{Left, Skipped};
pub(crate) use measure::{Measured, PoseCost};
pub use ranking::Advice;
pub(crate) use ranking::{MOST_SWAPPED, RankingError, Rated, cheapest, pareto, rate};
pub use run::{Chart, ChartObserver, ChartRow, ChartSettings, ChartState, chart};
pub use setting::SceneDetail;
pub(crate) use setting::{Engine, Ladder, Setting};
pub use world::ChartError;
pub(crate) use world::merge_vertices;
