//! Where on this vehicle should the LiDARs go?
//!
//! Scores of known placements in a scene:
//!
//! ```
//! use sightline::{Evaluator, Problem, Scene, read_placements};
//!
//! let scene = Scene::read("scenes/industrial-yard.json")?;
//! let mut evaluator = Evaluator::on_cpu(Problem::of(&scene)?);
//! for scores in evaluator.scores(&read_placements("scenes/placements.json")?)? {
//!     println!("{:14} {:?} nats", scores.name, scores.segmentation.information_gain);
//! }
//! # Ok::<(), sightline::Error>(())
//! ```
//!
//! A search for a better one, with progress:
//!
//! ```
//! use std::sync::Arc;
//!
//! use sightline::{Event, Problem, Scene, Settings, optimize};
//!
//! let problem = Arc::new(Problem::of(&Scene::read("scenes/industrial-yard.json")?)?);
//! let settings = Settings { evaluations: 24, ..Settings::default() };
//! let outcome = optimize(&problem, &settings, &mut |event: &Event| {
//!     if let Event::Generation(record) = event {
//!         println!("{} evaluations, best {:?}", record.evaluations, record.best_so_far);
//!     }
//!     true
//! })?;
//! println!("{:?}", outcome.best.map(|best| best.placement.lidars));
//! # Ok::<(), sightline::Error>(())
//! ```
//!
//! One direction of data flow, top to bottom; a module imports only what stands above it:
//!
//! | module | holds |
//! |---|---|
//! | [`geom`] | rigid transforms, boxes, triangle soups |
//! | [`vehicle`] | sensors, mount, placements and their rules |
//! | [`scene`] | the scene file, meshes and primitives, one triangle soup a frame |
//! | [`psog`] | region of interest, voxels, P-SOG, entropy |
//! | `bvh` | bounding volume hierarchy, flat and wide |
//! | [`problem`] | what is asked, ready to be computed |
//! | `cast` | closest hits of all beams |
//! | `cover` | voxels that beams cover |
//! | `reduce` | integer sums over covered voxels |
//! | [`scan`] | scans of a scene by virtual sensors |
//! | [`engine`] | the three stages on the CPU and on the GPU behind one trait |
//! | [`score`] | scores, guards and objectives from the sums |
//! | [`search`] | CMA-ES and swaps over a problem, bounds on what they leave |
//! | [`audit`] | trials against the metric itself |
//! | [`verify`] | comparisons of engines bit by bit, and with `f64` |
//! | [`chart`] | settings from fine to coarse, their cost and their error |
//! | [`study`] | how many LiDARs, which sensor, what if one fails |
//! | [`files`] | files that are whole at any time, folders of runs |
//! | [`report`] | what a run leaves behind: JSON, SVG, HTML |

mod error;
mod memory;

pub mod audit;
mod bvh;
mod cast;
pub mod chart;
mod cover;
pub mod engine;
pub mod files;
pub mod geom;
mod json;
pub mod problem;
pub mod psog;
mod reduce;
pub mod report;
pub mod scan;
pub mod scene;
pub mod score;
pub mod search;
pub mod study;
pub mod vehicle;
pub mod verify;

pub use engine::{EngineChoice, EngineKind};
pub use error::Error;
pub use problem::Problem;
pub use psog::Psog;
pub use scene::Scene;
pub use score::{Objective, Scores};
pub use search::{Evaluator, Event, Observer, Outcome, Settings, optimize};
pub use vehicle::{BeamTable, Constraints, Placement, SensorPose, read_placements};

/// Parts that tests and benchmarks of this project look into; nothing here is stable.
#[doc(hidden)]
pub mod internals {
    pub use crate::bvh::{Bvh, Hit, NO_HIT, Ray, major_axis};
    pub use crate::cast::{
        Caster, Casting, FAN_DIRECTIONS, Fan, Instructions, PACKET_RAYS, Packet, PacketHits, Part,
        Scratch, cast_closest,
    };
    pub use crate::cover::{BitOrder, WalkScratch, cover_sensor, cover_voxels};
    pub use crate::reduce::reduce;
    pub use crate::search::atlas::{Atlas, Union};
    pub use crate::search::bound::{Effort, GridSample, bound_gain};
    pub use crate::search::climb::Moves;
    pub use crate::search::generations::{Generation, Generations};
    pub use crate::search::grid_search::GridSearch;
    pub use crate::search::levels::{Level, Pilot};
    pub use crate::search::swaps::{SwapSettings, Swapped, swap_from};
}
