//! The search for the best placement, and how good its result is.
//!
//! [`optimize`] is the main job: frames on demand, CMA-ES, swaps on a grid of sensor poses and their
//! refinement over more frames, finalists confirmed over all frames, bounds. [`Run`] does the job step by step.
//!
//! | file | holds |
//! |---|---|
//! | `settings`, `observer`, `outcome`, `error` | settings, events, results and errors of a run |
//! | `run` | the run as a machine of a few states |
//! | `suite` | the scenes of a run, and their mirror images |
//! | `evaluator`, `seat` | scores of placements: over all scenes, and in one on its engine |
//! | `generations` | CMA-ES over the free pose fields |
//! | `pilot`, `on_demand` | few frames that stand for all, and when more are needed |
//! | `atlas`, `atlases`, `grid_search`, `climb`, `swaps` | placements on a grid of poses |
//! | `equip` | models and numbers of sensors under a budget; requirements |
//! | `tolerance`, `copies` | requirements in copies of a placement that are mounted a little off |
//! | `bound` | bounds on how much better than the result another placement could be |
//! | `spread` | gain over the best baseline beside the spread between scenes, and at draws that the search has not seen |
//! | `rules` | the rules of the mount in words; layout properties that go with the objective |

pub(crate) mod atlas;
pub(crate) mod atlases;
pub(crate) mod bound;
pub(crate) mod climb;
mod copies;
mod equip;
mod error;
mod evaluator;
pub(crate) mod generations;
pub(crate) mod grid_search;
mod observer;
mod on_demand;
mod outcome;
pub(crate) mod pilot;
pub(crate) mod rules;
mod run;
mod seat;
mod settings;
mod spread;
mod suite;
pub(crate) mod swaps;
#[cfg(test)]
mod tests;
mod tolerance;

pub use bound::{Certificate, GainBound};
pub(crate) use copies::{COPIES, FRAMES_OF_COPIES, Moved, SEED_OF_RESULT, drawn, error_of_share};
pub(crate) use equip::is_about;
pub use equip::{Choosing, EquipStep, Equipped, Equipping, Limits, OpenMount, PLAIN, cost_front};
pub(crate) use equip::{EveryRig, REQUIRED};
pub use error::SearchError;
pub use evaluator::{Evaluator, Judged, SceneScores};
pub use generations::{GenerationRecord, GenerationsStop};
pub use observer::{Event, Observer, Work};
pub use on_demand::FramesUsed;
pub(crate) use outcome::LAYOUT_GIVEN;
pub use outcome::{LeftOut, MethodRecord, Outcome, Scored, SearchTimes, Stopped};
pub use rules::Finding;
pub(crate) use rules::rules_in_words;
pub use run::{Phase, Run, State, optimize};
pub(crate) use seat::FRAMES_AT_ONCE;
pub use settings::{FrameChoice, Method, Settings, TimeLimit};
pub(crate) use settings::{PATIENCE, coarse_grid};
pub(crate) use spread::MANY_SCENES;
pub use spread::{Gain, GainSpread, PhaseCheck};
pub use suite::{Member, Suite};
pub use swaps::Climbs;
pub(crate) use swaps::SWAP_SPACING;
pub use tolerance::Tolerance;
