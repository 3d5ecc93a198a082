//! Where on this vehicle should the LiDARs go?
//!
//! A [`Scene`] is a world over time with a vehicle in it, a [`Placement`] a pose for each LiDAR on that vehicle, in
//! metres and radians of the ego frame: x forward, y left, z up. A [`Job`] scores placements in scenes and searches the
//! best one.
//!
//! Scores of known placements in a scene:
//!
//! ```
//! use sightline::{Job, Scene, read_placements};
//!
//! let job = Job::new(Scene::read("scenes/industrial-yard.json")?);
//! for judged in job.score(&read_placements("scenes/placements.json")?)? {
//!     println!("{:14} {:?} nats", judged.scores.name, judged.scores.segmentation.information_gain);
//! }
//! # Ok::<(), sightline::Error>(())
//! ```
//!
//! A search for a better one, with progress:
//!
//! ```
//! use sightline::{Event, Job, Scene, Settings};
//!
//! let scene = Scene::read("scenes/industrial-yard.json")?;
//! let job = Job::new(scene).search(Settings { evaluations: 24, ..Settings::default() });
//! let found = job.optimize(&mut |event: &Event| {
//!     if let Event::Generation(record) = event {
//!         println!("{} evaluations, best {:?}", record.evaluations, record.best_so_far);
//!     }
//!     true
//! })?;
//! println!("{:?}", found.and_then(|found| found.outcome.best).map(|best| best.placement.lidars));
//! # Ok::<(), sightline::Error>(())
//! ```
//!
//! Data flow one way, from top to bottom: a module imports only those above it. Modules down to [`export`] are
//! re-exports of the crates that hold them. The crate `lidar-cast` has the three stages: beams are cast, voxels that
//! they cover are marked, marks are summed up.
//!
//! | module | holds |
//! |---|---|
//! | [`geom`] | rigid transforms, boxes, triangle soups |
//! | [`vehicle`] | sensors, mount, placements and their rules |
//! | [`rig`] | rigs in the formats of other programs |
//! | [`scene`] | the scene file, meshes and primitives, one triangle soup a frame |
//! | [`worlds`] | worlds by rule: generated, and on OpenDRIVE roads |
//! | [`psog`] | region of interest, voxels, entropy; P-SOG: in how many frames a voxel has which class |
//! | [`datasets`] | labelled scans of public data sets, to P-SOGs and to scenes of boxes |
//! | [`problem`] | the task of the engines and the rules of the mount, from a scene and a P-SOG |
//! | [`scan`] | scans of a scene by virtual sensors |
//! | [`engine`] | the three stages on the CPU and on the GPU behind one trait |
//! | [`export`] | scans as data sets that public loaders read |
//! | [`targets`] | beams on targets at range, the range card of a rig |
//! | [`score`] | scores and objectives from the sums; guards: reasons not to believe a score |
//! | [`near_field`] | ground, poles and own body near a vehicle |
//! | [`shared`] | things by the number of LiDARs that see them, overlap of pairs of LiDARs |
//! | [`search`] | the best placement by CMA-ES and swaps, bounds on how much better another one could be |
//! | [`job`] | the main job: scenes, vehicle, weather and search behind one type |
//! | [`audit`] | attempts to raise a score while seeing less, and whether guards notice |
//! | [`verify`] | comparisons of engines bit by bit, and with `f64` |
//! | [`chart`] | settings from fine to coarse, their cost and their error |
//! | [`study`] | how many LiDARs, which sensor, what if one fails |
//! | [`report`] | files of a run: JSON, SVG, HTML |
//! | [`runs`] | work on files: each command as a function of scenes, placements and folders |
//! | `cli` | the program: parses arguments, calls the modules above, prints |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod allocator;
mod error;

pub mod audit;
pub mod chart;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod job;
pub mod near_field;
mod overlap;
// The program prints most of its texts and tables.
#[cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]
pub mod report;
#[doc(hidden)]
pub mod runs;
pub mod score;
pub mod search;
pub mod shared;
pub mod study;
pub mod targets;
pub mod verify;

pub use sightline_files::Note;
pub use sightline_formats::{datasets, export, rig};
pub use sightline_scan as scan;
pub use sightline_scene::{problem, psog, scene, vehicle};
pub use sightline_worlds as worlds;

use lidar_cast::{bvh, cast, cover, maths, memory};
pub use lidar_cast::{engine, geom};
use sightline_files::{csv, files, json};

pub use engine::{EngineChoice, EngineKind};
pub use error::Error;
pub use job::{Job, JobFiles, JobScene};
pub use problem::Problem;
pub use psog::Psog;
pub use scene::Scene;
pub use score::{Objective, Scores};
pub use search::{Evaluator, Event, Observer, Outcome, Settings, Suite, optimize};
pub use vehicle::{BeamTable, Constraints, Placement, SensorPose, read_placements};

/// Parts that the program, the tests and the benchmarks of this project look into; nothing here is stable.
#[doc(hidden)]
pub mod internals {
    pub use crate::allocator::Sentence;
    pub use crate::chart::setting::{Engine, Setting};
    pub use crate::files::{FileError, Input, RunDir, write_whole};
    pub use crate::psog::entropy::{EntropyKind, to_nats};
    pub use crate::score::standing::Standing;
    pub use crate::search::atlas::{Atlas, Union};
    pub use crate::search::atlases::Atlases;
    pub use crate::search::bound::{Effort, GridSample, bound_gain};
    pub use crate::search::climb::Moves;
    pub use crate::search::generations::Generations;
    pub use crate::search::grid_search::{GridPlacement, GridSearch};
    pub use crate::search::pilot::Pilot;
    pub use crate::search::swaps::{Climbing, SwapSettings, swap_anywhere};
    pub use crate::vehicle::constraints::Ties;
    pub use crate::vehicle::placements::draws;
    pub use crate::vehicle::pose_grid::{PoseGrid, Spacing};
    pub use crate::verify::oracle::{Explanation, explain};
    pub use crate::verify::{hostile_placements, usual_placements};
}
