//! The main job as a machine of a few states, whose state is a value.
//!
//! | phase | a step of it | then |
//! |---|---|---|
//! | [`Frames`](Phase::Frames) | chooses the frames that the search begins with | `Generations`, or `Finalists` for [`Method::Swaps`](super::Method::Swaps) |
//! | [`Generations`](Phase::Generations) | one generation of the CMA-ES; then a look at whether its frames still tell the best apart | itself until budget, target, time or interruption end it, `Finalists` |
//! | [`Finalists`](Phase::Finalists) | scores the best of the generations over all frames; goes to the frames of the swaps | `Swaps`, or `Confirm` once the target is reached |
//! | [`Swaps`](Phase::Swaps) | moves single LiDARs anywhere on a grid of poses | `Refine` |
//! | [`Refine`](Phase::Refine) | moves single LiDARs to poses nearby, over more frames and on finer grids | `Bounds` |
//! | [`Bounds`](Phase::Bounds) | samples the grid, bounds the gain of every placement on it | `Confirm` |
//! | [`Confirm`](Phase::Confirm) | scores the result of each method, and the baselines, over all frames | the [`Outcome`](super::Outcome) |
//!
//! A [`State`] that was saved after any step and resumed gives the bits of a run that never stopped.
//! If time or an interruption cuts a phase short, the run goes on to its outcome, but its state stays that before
//! the cut: a resumed run does the phase anew.
//!
//! `state` holds the value and the run around it, which puts the steps together; `choosing`, `generating`, `on_grid`,
//! `seeing`, `securing` and `confirming` hold the steps.

mod choosing;
mod confirming;
mod generating;
mod on_grid;
mod securing;
mod seeing;
mod state;

pub use state::{Phase, Run, State, optimize};
