//! Where on this vehicle should the LiDARs go?
//!
//! One direction of data flow, top to bottom; a module imports only what stands above it:
//!
//! | module | holds |
//! |---|---|
//! | [`geom`] | rigid transforms, boxes, triangle soups |
//! | [`scene`] | the scene file, meshes and primitives, one triangle soup a frame |
//! | [`bvh`] | bounding volume hierarchy and the closest-hit reference |
//! | [`grid`] | region of interest, voxels, P-SOG, entropy |
//! | [`placement`] | beam tables, sensor poses, mount and constraints |
//! | [`backend`] | casting, coverage and integer sums on the CPU and on the GPU |
//! | [`atlas`] | coverage of sensor poses on a grid, cast once and kept |
//! | [`score`] | scores, guards and objectives from the sums |
//! | [`optimize`] | CMA-ES: pure numbers, knows no GPU and no scene |
//! | [`search`] | ask, evaluate, score, tell |
//! | [`audit`] | trials against the metric itself |
//! | [`verify`] | comparisons of backends bit by bit, and with `f64` |
//! | [`fidelity`] | settings from fine to coarse, their cost and their error |
//! | [`study`] | how many LiDARs, which sensor, what if one fails |
//! | [`report`] | what a run leaves behind: JSON, SVG, HTML |

pub mod atlas;
pub mod audit;
pub mod backend;
pub mod bvh;
pub mod fidelity;
pub mod geom;
pub mod grid;
pub mod optimize;
pub mod placement;
pub mod report;
pub mod scene;
pub mod score;
pub mod search;
pub mod study;
pub mod verify;
