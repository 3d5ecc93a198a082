//! The search for the best placement, and how good its result is.
//!
//! [`optimize`] is the main job: frames on demand, CMA-ES, swaps on a grid of sensor poses, finalists
//! confirmed over all frames, bounds. [`Run`] is the same step by step.
//!
//! | file | holds |
//! |---|---|
//! | `settings`, `observer`, `outcome`, `error` | what goes into a run, and what comes out of it |
//! | `run` | the run as a machine of a few states |
//! | `evaluator` | scores of placements on one engine |
//! | `generations` | CMA-ES over the free pose fields |
//! | `levels`, `on_demand` | few frames that stand for all, and when more are needed |
//! | `atlas`, `grid_search`, `climb`, `swaps` | placements on a grid of poses |
//! | `equip`, `areas` | models and numbers of sensors under a budget; what must be seen |
//! | `bound` | how much better than the result another placement could be |
//! | `findings`, `rules` | what goes with the objective; the rules of the mount in words |

mod areas;
pub(crate) mod atlas;
pub(crate) mod bound;
pub(crate) mod climb;
mod equip;
mod error;
mod evaluator;
mod findings;
pub(crate) mod generations;
pub(crate) mod grid_search;
pub(crate) mod levels;
mod observer;
mod on_demand;
mod outcome;
pub(crate) mod rules;
mod run;
mod settings;
pub(crate) mod swaps;

pub use bound::{Certificate, GainBound};
pub use equip::{Equipped, cost_front, equip};
pub use error::SearchError;
pub use evaluator::Evaluator;
pub use findings::Finding;
pub use generations::{GenerationRecord, GenerationsStop};
pub use observer::{Event, Observer, Work};
pub use on_demand::{FramesUsed, WorkByPurpose};
pub use outcome::{LeftOut, MethodRecord, Outcome, Scored, SearchTimes, Stopped};
pub(crate) use rules::rules_in_words;
pub use run::{Phase, Run, State, optimize};
pub use settings::{FrameChoice, Method, Settings, TimeLimit};
pub(crate) use swaps::SWAP_SPACING;
