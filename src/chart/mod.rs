//! How much of a scene has to be modelled: settings from fine to coarse, what each costs, and how far
//! its scores and its ranking are from those of the finest one in `f64`.
//!
//! | file | holds |
//! |---|---|
//! | `setting` | a setting, and the ladder of them |
//! | `world` | the problem that a scene poses at a setting |
//! | `simplify` | triangles merged below a size |
//! | `exact`, `exact_tree` | the finest setting: casting, coverage and sums in `f64` |
//! | `ranking` | score error, Kendall's τ, top-1 regret, bootstrap intervals |
//! | `measure` | cost and scores of one setting |
//! | `verdict` | the Pareto front and the cheapest setting that keeps the ranking |

mod exact;
mod exact_tree;
mod measure;
mod ranking;
mod setting;
mod simplify;
mod verdict;
mod world;

pub use exact::Exact;
pub use measure::{Measured, Open, PoseCost, Workshop};
pub use ranking::{Interval, RankingError};
pub use setting::{Engine, Fidelity, Ladder, Rung};
pub use simplify::merge_vertices;
pub use verdict::{MOST_SWAPPED, Rated, Verdict, cheapest, pareto, rate};
pub use world::{FidelityError, World, candidates};
